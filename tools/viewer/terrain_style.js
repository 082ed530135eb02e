// How the terrain is painted: colours by height with their legend, grey beyond the data, the data's
// outline, tile boundaries.

// Shares of the way from one height to another.
const seaStops = [[0, '#0b2a4a'], [0.6, '#2f6f9f'], [1, '#9cc4d6']];
const landStops = [[0, '#5f8f63'], [0.2, '#a3b877'], [0.45, '#d9c48f'], [0.7, '#a9866a'],
                   [0.9, '#d8d2cc'], [1, '#ffffff']];
// Flat coasts of coarse tiles lie a little above 0 m here and there: no hard spots in the sea.
const shoreStops = [[0, '#a9c2b4'], [0.03, '#6d9a6d'], ...landStops.slice(1)];
// The same everywhere on the globe: metres up to the highest.
const fixedHeights = [-6000, 2800];
const fixedSea = [[0, '#0b2a4a'], [0.967, '#2f6f9f'], [1, '#9cc4d6']];
const fixedLand = [[0, '#a9c08f'], [0.107, '#8fab6c'], [0.321, '#cdb98a'], [0.643, '#a8927c'],
                   [1, '#f4f4f2']];

// What fits heights from `low` to `high`: where some are below 0 m there is a shore.
export function defaultRampKind(heights) {
  if (!heights) return 'fixed';
  return heights[0] < 0 ? 'shore' : 'fitted';
}

// A ramp has two halves, below and above `pivot`, each as wide in `image`.
export function rampOf(kind, heights) {
  let [low, high] = heights || fixedHeights;
  let halves = [seaStops, shoreStops];
  if (kind === 'fixed') {
    [low, high] = fixedHeights;
    halves = [fixedSea, fixedLand];
  }
  if (kind === 'fitted') {
    high = Math.max(high, low + 1);
    return { image: paint([landStops]), low, pivot: (low + high) / 2, high };
  }
  return { image: paint(halves), low: Math.min(low, -1), pivot: 0, high: Math.max(high, 1) };
}

function paint(parts) {
  const canvas = document.createElement('canvas');
  canvas.width = 2048;
  canvas.height = 1;
  const brush = canvas.getContext('2d');
  const width = canvas.width / parts.length;
  parts.forEach((stops, part) => {
    const gradient = brush.createLinearGradient(part * width, 0, (part + 1) * width, 0);
    for (const [share, colour] of stops) gradient.addColorStop(share, colour);
    brush.fillStyle = gradient;
    brush.fillRect(part * width, 0, width, 1);
  });
  return canvas;
}

// A height's place in a ramp's image, 0 to 1.
function placeOf({ low, pivot, high }, height) {
  return height > pivot ? 0.5 + 0.5 * (height - pivot) / (high - pivot)
                        : 0.5 * (height - low) / (pivot - low);
}

// The largest of 1, 2, 5, 10, 20, 50 ... that is not more.
export function roundDown(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [5, 2, 1].map((step) => step * power).find((step) => step <= value * (1 + 1e-9)) ?? power;
}

function metres(height, span) {
  const decimals = span > 20 ? 0 : (span > 2 ? 1 : 2);
  const text = Number(height.toFixed(decimals)).toLocaleString('en').replace('-', '−');
  return `${text === '−0' ? '0' : text} m`;
}

// Draws the ramp upwards into `box`, with its ends, 0 and round heights between them in metres.
export function drawLegend(box, ramp) {
  const bar = document.createElement('canvas');
  bar.width = 1;
  bar.height = 256;
  const brush = bar.getContext('2d');
  for (let row = 0; row < bar.height; ++row) {
    const height = ramp.high + (ramp.low - ramp.high) * (row + 0.5) / bar.height;
    const column = Math.floor(Math.min(placeOf(ramp, height), 0.9999) * ramp.image.width);
    brush.drawImage(ramp.image, column, 0, 1, 1, 0, row, 1, 1);
  }
  const labels = document.createElement('div');
  box.replaceChildren(bar, labels);
  const span = ramp.high - ramp.low;
  const step = Math.max(roundDown(span / 2.5), 0.01);
  const heights = [ramp.low, ramp.high];
  for (let k = Math.ceil(ramp.low / step); k * step <= ramp.high; ++k) {
    // Lines of text need a seventh of the bar each.
    if (heights.every((other) => Math.abs(other - k * step) > span / 7)) heights.push(k * step);
  }
  for (const height of heights) {
    const label = document.createElement('span');
    label.textContent = metres(height, span);
    label.style.top = `${100 * (ramp.high - height) / span}%`;
    labels.append(label);
  }
}

// White where the data have a height, black where they have none.
function paintCover(cover) {
  const canvas = document.createElement('canvas');
  canvas.width = cover ? cover.columns : 1;
  canvas.height = cover ? cover.rows.length : 1;
  const brush = canvas.getContext('2d');
  const picture = brush.createImageData(canvas.width, canvas.height);
  for (let row = 0; row < canvas.height; ++row) {
    for (let column = 0; column < canvas.width; ++column) {
      const shade = !cover || cover.rows[canvas.height - 1 - row][column] ? 255 : 0;
      picture.data.set([shade, shade, shade, 255], 4 * (row * canvas.width + column));
    }
  }
  brush.putImageData(picture, 0, 0);
  return canvas;
}

// From angles in radians, east of the extent's west and north of its south, to a place in the cover's
// picture: two offsets, then two factors. Posts are the middles of its pixels.
function placeInCover(cover, [west, south]) {
  if (!cover) return [0.5, 0.5, 0, 0];
  const axis = (from, first, last, count) => {
    const factor = last > first ? (count - 1) / count / (last - first) : 0;
    return [0.5 / count + (from - first) * factor, factor * 180 / Math.PI];
  };
  const [[atX, perX], [atY, perY]] = [
    axis(west, cover.postsDeg[0], cover.postsDeg[2], cover.columns),
    axis(south, cover.postsDeg[1], cover.postsDeg[3], cover.rows.length)];
  return [atX, atY, perX, perY];
}

// A tile's own coordinates run from 0 to 1, so its sides are known. Those of the data's extent are told
// by distances in metres: from the planes of two meridians, and from two parallels' cones. They are
// differences from the camera's, which keepExtent() works out in double precision: 32 bits for places on
// the globe would tear the outline of a set of centimetres.
const squash = 1 - 0.00669437999014;  // of WGS84: b^2 / a^2
const source = `
  const float squash = ${squash};
  float besideLine(float distance_, float largestPixel) {
    float pixel = clamp(fwidth(distance_), 1e-6, largestPixel);
    return 1.0 - smoothstep(0.8, 1.8, abs(distance_) / pixel);
  }
  czm_material czm_getMaterial(czm_materialInput input_) {
    czm_material material = czm_getDefaultMaterial(input_);
    float share = input_.height > pivot
        ? clamp(0.5 + 0.5 * (input_.height - pivot) / (high - pivot), 0.5 + gap, 1.0)
        : clamp(0.5 * (input_.height - low) / (pivot - low), 0.0, 0.5 - gap);
    vec3 colour = czm_gammaCorrect(texture(ramp, vec2(share, 0.5))).rgb;
    vec3 off_eye = czm_inverseViewRotation * -input_.positionToEyeEC;
    vec2 place = eye.xy + off_eye.xy;
    float axis = length(place);
    float off_axis = (2.0 * dot(eye.xy, off_eye.xy) + dot(off_eye.xy, off_eye.xy)) / (axis + eye.z);
    vec2 inward_x = eyeInward.xy + vec2(meridians.x * off_eye.y - meridians.y * off_eye.x,
                                        meridians.w * off_eye.x - meridians.z * off_eye.y);
    vec2 inward_y = eyeInward.zw + vec2(1.0, -1.0) *
        vec2(parallels.x * off_eye.z - parallels.y * off_axis,
             parallels.z * off_eye.z - parallels.w * off_axis);
    float within_x = turns > 0.75 ? 1.0
        : (turns > 0.25 ? max(step(0.0, inward_x.x), step(0.0, inward_x.y))
                        : step(0.0, inward_x.x) * step(0.0, inward_x.y));
    float within_y = step(0.0, inward_y.x) * step(0.0, inward_y.y);
    // East of the extent's west and north of its south, in radians, as exact as the distances are.
    float east = atan(inward_x.x, dot(place, meridians.xy));
    float north = atan(inward_y.x, squash * parallels.x * axis +
                                   parallels.y / squash * (eye.w + off_eye.z));
    vec2 at = coverPlace.xy + coverPlace.zw * vec2(east, north);
    float turn = czm_twoPi * coverPlace.z;
    if (turn > 0.0) at.x -= turn * floor((at.x - 0.5) / turn + 0.5);
    vec2 beyond = abs(at - 0.5);
    // Data end less than a post's distance beyond the outermost posts.
    vec2 last = 0.5 + 0.5 / vec2(textureSize(cover, 0));
    float covered = step(beyond.x, last.x) * step(beyond.y, last.y) *
        step(0.5, texture(cover, clamp(at, 0.0, 1.0)).r);
    colour = mix(colour, vec3(0.29, 0.3, 0.31), extent * (1.0 - within_x * within_y * covered));
    // Skirts and cliffs that are seen edge-on have pixels of kilometres.
    float largest = 10.0 * czm_metersPerPixel(vec4(-input_.positionToEyeEC, 1.0));
    float sides = max(besideLine(inward_x.x, largest) * step(0.0, dot(place, meridians.xy)),
                      besideLine(inward_x.y, largest) * step(0.0, dot(place, meridians.zw)));
    sides *= within_y * step(turns, 0.75);
    float ends = max(besideLine(inward_y.x, largest), besideLine(inward_y.y, largest)) * within_x;
    colour = mix(colour, vec3(1.0, 0.62, 0.05), outline * max(sides, ends));
    vec2 off = min(input_.st, 1.0 - input_.st) / max(fwidth(input_.st), vec2(1e-6));
    float line = 1.0 - smoothstep(0.6, 1.4, min(off.x, off.y));
    material.diffuse = mix(colour, vec3(0.75, 0.1, 0.05), boundaries * line);
    material.alpha = 1.0;
    return material;
  }`;

export function terrainMaterial(extentDeg, coverOfData) {
  const { image, low, pivot, high } = rampOf('fixed');
  const [west, south, east, north] = extentDeg.map((degrees) => degrees * Math.PI / 180);
  const parallel = (latitude) => [Math.cos(latitude), squash * Math.sin(latitude)];
  const span = extentDeg[2] - extentDeg[0];
  const vector = (...numbers) => new Cesium.Cartesian4(...numbers);
  return new Cesium.Material({
    fabric: {
      type: 'QmpipeTerrain',
      uniforms: {
        ramp: image, low, pivot, high, gap: 0.5 / image.width, boundaries: 0, extent: 1, outline: 1,
        meridians: vector(Math.cos(west), Math.sin(west), Math.cos(east), Math.sin(east)),
        parallels: vector(...parallel(south), ...parallel(north)),
        turns: span >= 360 ? 1 : (span > 180 ? 0.5 : 0),
        cover: paintCover(coverOfData),
        coverPlace: vector(...placeInCover(coverOfData, extentDeg)),
        eye: vector(0, 0, 0, 0), eyeInward: vector(0, 0, 0, 0),
      },
      source,
    },
  });
}

// Before each picture: the camera's place against the extent.
export function keepExtent(scene, material) {
  const { meridians, parallels, eye, eyeInward } = material.uniforms;
  const w = { ...meridians };
  const p = { ...parallels };
  scene.preRender.addEventListener(() => {
    const { x, y, z } = scene.camera.positionWC;
    const axis = Math.hypot(x, y);
    Cesium.Cartesian4.fromElements(x, y, axis, z, eye);
    Cesium.Cartesian4.fromElements(w.x * y - w.y * x, w.w * x - w.z * y, p.x * z - p.y * axis,
                                   p.w * axis - p.z * z, eyeInward);
  });
}

// CesiumJS hides the hair cracks between tiles behind skirts. Their own heights, up to kilometres lower,
// would paint them as dotted lines of other colours; with the heights of the sides they hang from they
// look like the ground. (The positions stay.)
export function paintSkirtsLikeGround() {
  const data = Cesium.QuantizedMeshTerrainData.prototype;
  const createMesh = data.createMesh;
  data.createMesh = function (...options) {
    const promise = createMesh.apply(this, options);
    return promise && promise.then((mesh) => {
      levelSkirts(mesh);
      return mesh;
    });
  };
}

function levelSkirts(mesh) {
  const { vertices, stride, encoding } = mesh;
  const isPacked = encoding.quantization === Cesium.TerrainQuantization.BITS12;
  let skirt = mesh.vertexCountWithoutSkirts * stride;
  for (const side of [mesh.westIndicesSouthToNorth, mesh.southIndicesEastToWest,
                      mesh.eastIndicesNorthToSouth, mesh.northIndicesWestToEast]) {
    for (const index of side) {
      const top = index * stride;
      // Packed: 12 bits of the vertical position, then 12 of the height.
      if (isPacked) {
        vertices[skirt + 1] = Math.floor(vertices[skirt + 1] / 4096) * 4096 + vertices[top + 1] % 4096;
      } else {
        vertices[skirt + 3] = vertices[top + 3];
      }
      skirt += stride;
    }
  }
}
