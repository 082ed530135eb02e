// A detail-increment model as its parts come from `qmpipe serve`, and the walk through the levels of a
// block, on typed arrays. No page is needed: tests run it in Node. The model's rules are those of
// formats/detail_model/data.h and docs/DETAIL_FORMAT.md; what the parts hold, tools/web/detail_service.h says.

const none = 0xFFFFFFFF;
const next = (e) => (e % 3 === 2 ? e - 2 : e + 1);
const previous = (e) => (e % 3 === 0 ? e + 2 : e - 1);

// The part is not what model.json says of it, or its splits cannot be.
export class DamagedModel extends Error {
  constructor(what) {
    super(`the model is damaged: ${what}`);
  }
}

// Takes arrays of 32-bit words one after the other out of a part; of each, the lowest bytes come
// first.
class Planes {
  constructor(buffer) {
    this.bytes = new Uint8Array(buffer);
    this.at = 0;
  }

  take(count) {
    if (this.at + 4 * count > this.bytes.length) throw new DamagedModel('a part is too short');
    const words = new Uint32Array(count);
    for (let shift = 0; shift < 32; shift += 8) {
      for (let k = 0; k < count; ++k) words[k] |= this.bytes[this.at + k] << shift;
      this.at += count;
    }
    return words;
  }

  end() {
    if (this.at !== this.bytes.length) throw new DamagedModel('a part is too long');
  }
}

const undoZigZag = (code, expected) => expected + ((code >>> 1) ^ -(code & 1));

// The block's points on the model's grid: x, y and z one after the other. Those of splits are told by
// their difference to the middle of the triangle, as it was made, that the split's half-edge is of.
function decodePoints(codes, coarsePoints, corners, halfEdges) {
  const points = new Int32Array(3 * codes[0].length);
  const last = [0, 0, 0];
  for (let p = 0; p < coarsePoints; ++p) {
    for (let k = 0; k < 3; ++k) points[3 * p + k] = last[k] = undoZigZag(codes[k][p], last[k]);
  }
  const made = new Uint32Array(corners.length + 6 * halfEdges.length);
  made.set(corners);
  let edges = corners.length;
  for (let level = 0; level < halfEdges.length; ++level) {
    const e = halfEdges[level];
    if (e >= edges) throw new DamagedModel(`the split to level ${level + 1} names no triangle`);
    const first = e - e % 3;
    const [a, b, c] = [3 * made[first], 3 * made[first + 1], 3 * made[first + 2]];
    const p = coarsePoints + level;
    for (let k = 0; k < 3; ++k) {
      const expected = Math.floor((points[a + k] + points[b + k] + points[c + k]) / 3);
      points[3 * p + k] = undoZigZag(codes[k][p], expected);
    }
    const [v, r, l] = [made[e], made[next(e)], made[previous(e)]];
    made[edges++] = v;
    made[edges++] = r;
    made[edges++] = p;
    made[edges++] = v;
    made[edges++] = p;
    made[edges++] = l;
  }
  return points;
}

// A block from its part and what model.json says of it.
export function decodeBlock(buffer, size) {
  const planes = new Planes(buffer);
  const codes = [0, 1, 2].map(() => planes.take(size.points));
  const corners = new Uint32Array(3 * size.coarse_triangles);
  for (let k = 0; k < 3; ++k) {
    const cornerCodes = planes.take(size.coarse_triangles);
    let last = 0;
    for (let t = 0; t < cornerCodes.length; ++t) {
      last = undoZigZag(cornerCodes[t], last) >>> 0;
      if (last >= size.coarse_points) throw new DamagedModel('the coarsest mesh names no point');
      corners[3 * t + k] = last;
    }
  }
  const halfEdges = planes.take(size.levels);
  const fans = planes.take(size.levels);
  const svoBits = planes.take(size.levels + 1);
  planes.end();
  for (let level = 1; level < svoBits.length; ++level) {
    svoBits[level] = svoBits[level - 1] - svoBits[level];
  }
  return {
    coarsePoints: size.coarse_points,
    coarseTriangles: size.coarse_triangles,
    levels: size.levels,
    points: decodePoints(codes, size.coarse_points, corners, halfEdges),
    corners,
    halfEdges,
    fans,
    svo: new Float32Array(svoBits.buffer),  // of each level, metres
  };
}

// The corners of the seams' triangles: of each the block and the point in it.
export function decodeSeams(buffer, description) {
  const planes = new Planes(buffer);
  const blocks = planes.take(3 * description.seams);
  const points = planes.take(3 * description.seams);
  planes.end();
  const last = new Array(description.blocks.length).fill(0);
  for (let k = 0; k < blocks.length; ++k) {
    const size = description.blocks[blocks[k]];
    if (!size) throw new DamagedModel('a seam names no block');
    points[k] = last[blocks[k]] = undoZigZag(points[k], last[blocks[k]]) >>> 0;
    if (points[k] >= size.coarse_points) throw new DamagedModel('a seam names no point');
  }
  return { blocks, points };
}

// The coarsest level whose smallest visible object is no larger; the finest where none is.
export function levelForSvo(block, svo) {
  let low = 0;
  let high = block.levels;
  while (low < high) {
    const middle = (low + high) >>> 1;
    if (block.svo[middle] > svo) low = middle + 1;
    else high = middle;
  }
  return low;
}

// The mesh of a block at a level that can be changed. `vertices` has the point that each half-edge
// leaves, of the first 3 * triangles half-edges; half-edge 3 t + k leaves the k-th point of triangle t.
export class DetailWalk {
  // Half-edges to a page, of which `changed` has a flag: what a graphics card's copy lacks.
  static pageBits = 10;

  constructor(block) {
    this.block = block;
    this.level = 0;
    const most = block.corners.length + 6 * block.levels;
    this.vertices = new Uint32Array(most);
    this.twins = new Uint32Array(most).fill(none);
    this.vertices.set(block.corners);
    this.changed = new Uint8Array((most >> DetailWalk.pageBits) + 1).fill(1);
    this.findTwins();
  }

  get triangles() {
    return this.block.coarseTriangles + 2 * this.level;
  }

  findTwins() {
    const { corners, coarsePoints } = this.block;
    // The half-edges that leave point p: leaving[first[p]] to leaving[first[p + 1] - 1].
    const first = new Uint32Array(coarsePoints + 2);
    for (const point of corners) ++first[point + 2];
    for (let p = 2; p < first.length; ++p) first[p] += first[p - 1];
    const leaving = new Uint32Array(corners.length);
    for (let e = 0; e < corners.length; ++e) leaving[first[corners[e] + 1]++] = e;
    for (let e = 0; e < corners.length; ++e) {
      const [from, to] = [corners[e], corners[next(e)]];
      if (from === to) throw new DamagedModel('a triangle has a point twice');
      for (let k = first[from]; k < first[from + 1]; ++k) {
        if (leaving[k] !== e && corners[next(leaving[k])] === to) {
          throw new DamagedModel('two triangles lie on one another');
        }
      }
      for (let k = first[to]; k < first[to + 1]; ++k) {
        if (corners[next(leaving[k])] === from) this.twins[e] = leaving[k];
      }
    }
  }

  link(e, f) {
    if (e !== none) this.twins[e] = f;
    if (f !== none) this.twins[f] = e;
  }

  setVertex(e, point) {
    this.vertices[e] = point;
    this.changed[e >> DetailWalk.pageBits] = 1;
  }

  // The last half-edge of the fan of the split to the next level; throws when there is no such fan.
  lastOfFan(first, fan) {
    const wrong = (what) => new DamagedModel(`the split to level ${this.level + 1} ${what}`);
    if (first >= 3 * this.triangles || fan === 0) throw wrong('takes no triangle');
    let last = first;
    for (let k = 1; k < fan; ++k) {
      last = this.twins[previous(last)];
      if (last === none) throw wrong('reaches over the rim');
      if (last === first) throw wrong('reaches around its point');
    }
    if (this.twins[previous(last)] === first) throw wrong('takes all triangles of its point');
    return last;
  }

  // One level finer.
  refine() {
    const { block, vertices, twins } = this;
    const first = block.halfEdges[this.level];
    const last = this.lastOfFan(first, block.fans[this.level]);
    const end = previous(last);
    const v = vertices[first];
    const u = block.coarsePoints + this.level;
    const r = vertices[next(first)];
    const l = vertices[end];
    const added = 3 * this.triangles;
    for (let e = first; ; e = twins[previous(e)]) {
      this.setVertex(e, u);
      if (e === last) break;
    }
    this.setVertex(added, v);
    this.setVertex(added + 1, r);
    this.setVertex(added + 2, u);
    this.setVertex(added + 3, v);
    this.setVertex(added + 4, u);
    this.setVertex(added + 5, l);
    this.link(added, twins[first]);
    this.link(added + 5, twins[end]);
    this.link(added + 1, first);
    this.link(added + 4, end);
    this.link(added + 2, added + 3);
    ++this.level;
  }

  // One level coarser. There must be one.
  coarsen() {
    const { block, vertices, twins } = this;
    --this.level;
    const first = block.halfEdges[this.level];
    const fan = block.fans[this.level];
    const added = 3 * this.triangles;
    const v = vertices[added];
    let last = first;
    for (let e = first, k = 0; k < fan; ++k) {
      this.setVertex(e, v);
      last = e;
      e = twins[previous(e)];
    }
    const end = previous(last);
    this.link(end, twins[added + 5]);
    this.link(first, twins[added]);
    twins.fill(none, added, added + 6);
  }

  // Towards a level, by at most so many steps; says how many were done.
  step(level, most) {
    const steps = Math.min(Math.abs(level - this.level), most);
    if (level > this.level) for (let k = 0; k < steps; ++k) this.refine();
    else for (let k = 0; k < steps; ++k) this.coarsen();
    return steps;
  }

  goTo(level) {
    this.step(level, Infinity);
  }

  // Whole triangles in use among which are all that changed since this was last asked: calls
  // visit(begin, end) with ranges of half-edges.
  takeChanges(visit) {
    const used = 3 * this.triangles;
    const pages = this.changed.length;
    for (let page = 0; page < pages;) {
      if (this.changed[page] === 0) {
        ++page;
        continue;
      }
      const begin = page << DetailWalk.pageBits;
      if (begin >= used) break;
      while (page < pages && this.changed[page] === 1) this.changed[page++] = 0;
      const end = page << DetailWalk.pageBits;
      visit(begin - begin % 3, Math.min(end + 2 - (end + 2) % 3, used));
    }
  }
}
