// The walk of the viewer's page against the program: the same model, the same levels, the same meshes.
// In Node, without a browser.
//
//   QMPIPE_PROGRAM=.../qmpipe QMPIPE_WORK=FOLDER node detail_walk_test.mjs

import assert from 'node:assert/strict';
import { mkdirSync, readFileSync, rmSync } from 'node:fs';
import { join } from 'node:path';
import { before, test } from 'node:test';
import { DamagedModel, DetailWalk, decodeBlock, decodeSeams, levelForSvo }
    from '../../tools/viewer/detail_walk.js';
import { qmpipe, withServer } from './server.mjs';

const work = process.env.QMPIPE_WORK;
assert(work, 'QMPIPE_WORK names the folder for models and meshes');
const seed = 20261123;
console.log(`seed ${seed}`);

// A linear congruential generator: Math.random takes no seed.
function dice(state) {
  return (below) => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return Math.floor(state / 2 ** 32 * below);
  };
}

const model = join(work, 'model.h5');
let description;
let parts;
let blocks;
let seams;

before(async () => {
  rmSync(work, { recursive: true, force: true });
  mkdirSync(work, { recursive: true });
  const dem = join(work, 'dem.tif');
  // Voids make rims that are no rectangles.
  qmpipe('synth', '-o', dem, '--size', '230x170', '--bounds', '6,43.5,8,45', '--seed', '5', '--voids',
         '0.02');
  qmpipe('detail', 'build', dem, '-o', model, '--blocks', '6', '--keep', '5%');
  await withServer(model, async (address) => {
    const fetched = async (name) => (await fetch(address + name)).arrayBuffer();
    description = await (await fetch(address + 'model.json')).json();
    parts = await Promise.all(description.blocks.map((_, b) => fetched(`block/${b}.bin`)));
    seams = decodeSeams(await fetched('seams.bin'), description);
  });
  blocks = parts.map((part, b) => decodeBlock(part, description.blocks[b]));
});

// What write_mesh_file() writes: doubles, triangles after a byte that says 3.
function readPly(path) {
  const bytes = readFileSync(path);
  const end = bytes.indexOf('end_header\n') + 'end_header\n'.length;
  const header = bytes.subarray(0, end).toString();
  const count = (what) => Number(header.match(new RegExp(`element ${what} (\\d+)`))[1]);
  const positions = [];
  for (let k = 0; k < 3 * count('vertex'); ++k) positions.push(bytes.readDoubleLE(end + 8 * k));
  const indices = [];
  for (let t = 0; t < count('face'); ++t) {
    const at = end + 8 * positions.length + 13 * t;
    assert.equal(bytes[at], 3);
    for (let k = 0; k < 3; ++k) indices.push(bytes.readUInt32LE(at + 1 + 4 * k));
  }
  return { positions, indices };
}

// The mesh of all blocks at their walks' levels and the seams, in the order of `detail extract`.
function meshOf(walks) {
  const positions = [];
  const indices = [];
  const first = [];
  for (const { block, level, triangles, vertices } of walks) {
    first.push(positions.length / 3);
    for (let k = 0; k < 3 * (block.coarsePoints + level); ++k) {
      positions.push(description.offset[k % 3] + description.step_m[k % 3] * block.points[k]);
    }
    for (let e = 0; e < 3 * triangles; ++e) indices.push(first.at(-1) + vertices[e]);
  }
  for (let k = 0; k < seams.points.length; ++k) {
    indices.push(first[seams.blocks[k]] + seams.points[k]);
  }
  return { positions, indices };
}

// Edges with one triangle, as "from to". An edge that two triangles have the same way round fails.
function openEdges(indices) {
  const edges = new Set();
  const end = (e) => indices[e % 3 === 2 ? e - 2 : e + 1];
  for (let e = 0; e < indices.length; ++e) {
    const name = `${indices[e]} ${end(e)}`;
    assert(!edges.has(name), `edge ${name} twice`);
    edges.add(name);
  }
  return [...edges].filter((name) => !edges.has(name.split(' ').reverse().join(' '))).sort();
}

const used = (walk) => walk.vertices.slice(0, 3 * walk.triangles);

test('at any level the mesh is that of qmpipe detail extract, number by number', () => {
  const deepest = Math.max(...blocks.map((block) => block.levels));
  const mesh = join(work, 'mesh.ply');
  const walks = blocks.map((block) => new DetailWalk(block));
  for (const level of [0, 1, 777, deepest, deepest >> 1, 2, 0]) {
    qmpipe('detail', 'extract', model, '--level', `${level}`, '--frame', 'crs', '-o', mesh);
    for (const walk of walks) walk.goTo(Math.min(level, walk.block.levels));
    const [ours, theirs] = [meshOf(walks), readPly(mesh)];
    assert.equal(ours.indices.length, theirs.indices.length, `level ${level}`);
    assert.deepEqual(ours, theirs, `level ${level}`);
  }
});

test('a threshold gives the levels that qmpipe detail extract gives', () => {
  const mesh = join(work, 'threshold.ply');
  for (const svo of [0, 1, 5, 20, 60, 120, 1e9]) {
    const said = JSON.parse(qmpipe('detail', 'extract', model, '--svo', `${svo}`, '-o', mesh, '--json'));
    assert.deepEqual(blocks.map((block) => levelForSvo(block, svo)),
                     said.blocks.map(({ level }) => level), `svo ${svo}`);
  }
});

test('random walks lead to the same triangles as the straight way, and tell all that changes', () => {
  const roll = dice(seed);
  for (const block of blocks) {
    const walk = new DetailWalk(block);
    const copy = new Uint32Array(walk.vertices.length).fill(0xFFFFFFFF);
    for (let k = 0; k < 25; ++k) {
      walk.goTo(roll(4) === 0 ? roll(2) * block.levels : roll(block.levels + 1));
      // Several moves may come before what changed is asked for.
      if (roll(3) > 0) continue;
      walk.takeChanges((begin, end) => copy.set(walk.vertices.subarray(begin, end), begin));
      const straight = new DetailWalk(block);
      straight.goTo(walk.level);
      assert.deepEqual(used(walk), used(straight));
      assert.deepEqual(walk.twins.slice(0, 3 * walk.triangles),
                       straight.twins.slice(0, 3 * walk.triangles));
      assert.deepEqual(copy.slice(0, 3 * walk.triangles), used(straight));
    }
    walk.takeChanges(() => {});
    walk.takeChanges(() => assert.fail('nothing changed since'));
  }
});

test('steps are no more than asked for', () => {
  const walk = new DetailWalk(blocks[0]);
  assert.equal(walk.step(500, 128), 128);
  assert.equal(walk.level, 128);
  assert.equal(walk.step(100, 128), 28);
  assert.equal(walk.step(100, 128), 0);
});

test('no choice of levels opens a crack', () => {
  const roll = dice(seed + 1);
  const walks = blocks.map((block) => new DetailWalk(block));
  // Points have other numbers in other choices, so open edges are told by their places.
  const outline = () => {
    const { positions, indices } = meshOf(walks);
    const place = (p) => positions.slice(3 * p, 3 * p + 3).join(',');
    return openEdges(indices).map((name) => name.split(' ').map(place).join(' ')).sort();
  };
  const coarsest = outline();
  assert(coarsest.length > 2 * (230 + 170) - 8, 'the rim of the DEM and those of voids');
  for (let k = 0; k < 6; ++k) {
    for (const walk of walks) walk.goTo(roll(walk.block.levels + 1));
    assert.deepEqual(outline(), coarsest);
  }
});

test('damaged parts are refused or walked through, and nothing else', () => {
  const roll = dice(seed + 2);
  const [part, size] = [parts[0], description.blocks[0]];
  for (const bytes of [0, 1, part.byteLength >> 1, part.byteLength - 1]) {
    assert.throws(() => decodeBlock(part.slice(0, bytes), size), DamagedModel);
  }
  assert.throws(() => decodeBlock(new Uint8Array(part.byteLength + 1).buffer, size), DamagedModel);
  let refused = 0;
  for (let k = 0; k < 150; ++k) {
    const bytes = new Uint8Array(part.slice(0));
    for (let n = roll(20); n >= 0; --n) bytes[roll(bytes.length)] ^= 1 << roll(8);
    try {
      const walk = new DetailWalk(decodeBlock(bytes.buffer, size));
      walk.goTo(walk.block.levels);
      walk.goTo(0);
    } catch (error) {
      assert(error instanceof DamagedModel, `${error.stack}`);
      ++refused;
    }
  }
  assert(refused > 30, `${refused} refused`);
});
