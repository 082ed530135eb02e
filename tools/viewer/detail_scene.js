// How a detail-increment model is drawn: a mesh for each block, whose indices follow the block's walk,
// and one for the seams. Lit from the north-west as printed maps, coloured by height.

import * as THREE from 'three';
import { DetailWalk } from './detail_walk.js';

// Shares of the way from the lowest to the highest.
const stops = [[0, '#5f8f63'], [0.2, '#a3b877'], [0.45, '#d9c48f'], [0.7, '#a9866a'],
               [0.9, '#d8d2cc'], [1, '#ffffff']];

function rampTexture() {
  const canvas = document.createElement('canvas');
  canvas.width = 512;
  canvas.height = 1;
  const brush = canvas.getContext('2d');
  const gradient = brush.createLinearGradient(0, 0, canvas.width, 0);
  for (const [share, colour] of stops) gradient.addColorStop(share, colour);
  brush.fillStyle = gradient;
  brush.fillRect(0, 0, canvas.width, 1);
  return new THREE.CanvasTexture(canvas);
}

// `light`: a vector towards the light, or none where lines are drawn. The surface's own slope is that
// of the triangle, so that the mesh is seen as it is.
function terrainMaterial(ramp, heights, light, shade) {
  return new THREE.ShaderMaterial({
    uniforms: { ramp: { value: ramp }, heights: { value: new THREE.Vector2(...heights) },
                light: { value: light ?? new THREE.Vector3() }, shade: { value: shade } },
    side: THREE.DoubleSide,
    polygonOffset: light !== null,
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 1,
    vertexShader: `
      varying vec3 place;
      void main() {
        place = position;
        gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
      }`,
    fragmentShader: `
      uniform sampler2D ramp;
      uniform vec2 heights;
      uniform vec3 light;
      uniform float shade;
      varying vec3 place;
      void main() {
        float share = clamp((place.z - heights.x) / (heights.y - heights.x), 0.0, 1.0);
        vec3 colour = texture2D(ramp, vec2(share, 0.5)).rgb;
        if (light != vec3(0.0)) {
          vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
          normal *= normal.z < 0.0 ? -1.0 : 1.0;
          colour *= 0.4 + 0.85 * max(dot(normal, light), 0.0);
        }
        gl_FragColor = vec4(colour * shade, 1.0);
      }`,
  });
}

// The box that model.json tells, in the page's coordinates; a block without points has none.
export function boxOf(description, middle) {
  if (description.box === null) return new THREE.Box3();
  const corner = (at) => new THREE.Vector3(...description.box[at]).sub(middle);
  return new THREE.Box3(corner(0), corner(1));
}

function updateLines(vertices, index, begin, end) {
  for (let e = begin; e < end; ++e) {
    index.array[2 * e] = vertices[e];
    index.array[2 * e + 1] = vertices[e % 3 === 2 ? e - 2 : e + 1];
  }
  index.addUpdateRange(2 * begin, 2 * (end - begin));
  index.needsUpdate = true;
}

export class DetailScene {
  // `middle` is taken off all coordinates, in doubles: the card's are of 32 bits.
  constructor(description, middle, box) {
    this.description = description;
    this.middle = middle;
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color('#10151c');
    this.blocks = [];  // { block, walk, box, middle, mesh, lines, target }
    this.wireframe = false;
    const ramp = rampTexture();
    const heights = [box.min.z, Math.max(box.max.z, box.min.z + 1)];
    this.surface = terrainMaterial(ramp, heights, new THREE.Vector3(-0.6, 0.5, 0.62).normalize(), 1);
    this.line = terrainMaterial(ramp, heights, null, 1);
  }

  // Writes where the block's point p is to positions[at ...].
  place(block, p, positions, at) {
    const { offset, step_m: step } = this.description;
    for (let k = 0; k < 3; ++k) {
      positions[at + k] = offset[k] - this.middle.getComponent(k) + step[k] * block.points[3 * p + k];
    }
  }

  addBlock(number, block) {
    const positions = new Float32Array(block.points.length);
    for (let p = 0; p < block.points.length / 3; ++p) {
      this.place(block, p, positions, 3 * p);
    }
    const walk = new DetailWalk(block);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
    geometry.setIndex(new THREE.BufferAttribute(walk.vertices, 1).setUsage(THREE.DynamicDrawUsage));
    const mesh = new THREE.Mesh(geometry, this.surface);
    const box = boxOf(this.description.blocks[number], this.middle);
    // Whether it is in view is known from its box.
    mesh.frustumCulled = false;
    this.scene.add(mesh);
    const middle = box.getCenter(new THREE.Vector3());
    this.blocks[number] = { block, walk, box, middle, mesh, lines: null, target: 0 };
    this.setWireframe(this.wireframe);
  }

  // REQUIRES: all blocks.
  addSeams(seams) {
    const positions = new Float32Array(3 * seams.points.length);
    for (let k = 0; k < seams.points.length; ++k) {
      const { block } = this.blocks[seams.blocks[k]];
      this.place(block, seams.points[k], positions, 3 * k);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
    const mesh = new THREE.Mesh(geometry, this.surface);
    mesh.frustumCulled = false;
    const ends = new Uint32Array(2 * seams.points.length);
    for (let e = 0; e < seams.points.length; ++e) {
      ends.set([e, e % 3 === 2 ? e - 2 : e + 1], 2 * e);
    }
    const outline = geometry.clone().setIndex(new THREE.BufferAttribute(ends, 1));
    this.seamLines = new THREE.LineSegments(outline, this.line);
    this.seamLines.frustumCulled = false;
    this.scene.add(mesh, this.seamLines);
    this.setWireframe(this.wireframe);
  }

  setWireframe(on) {
    this.wireframe = on;
    this.surface.uniforms.shade.value = on ? 0.16 : 1;
    if (this.seamLines) this.seamLines.visible = on;
    for (const one of this.blocks.filter(Boolean)) {
      if (on) one.lines ??= this.linesOf(one);
      // Lines that nobody sees are not kept up.
      if (on) one.walk.changed.fill(1);
      if (one.lines) one.lines.visible = on;
    }
  }

  // The edges of all triangles: of half-edge e its two ends.
  linesOf({ walk, mesh }) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', mesh.geometry.getAttribute('position'));
    geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(2 * walk.vertices.length), 1)
        .setUsage(THREE.DynamicDrawUsage));
    const lines = new THREE.LineSegments(geometry, this.line);
    lines.frustumCulled = false;
    this.scene.add(lines);
    return lines;
  }

  // What changed in the blocks that the camera sees goes to the card with the next picture.
  update(camera) {
    const frustum = new THREE.Frustum().setFromProjectionMatrix(new THREE.Matrix4()
        .multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse));
    for (const { walk, box, mesh, lines } of this.blocks.filter(Boolean)) {
      mesh.visible = frustum.intersectsBox(box);
      if (lines) lines.visible = mesh.visible && this.wireframe;
      if (!mesh.visible) continue;
      const index = mesh.geometry.index;
      walk.takeChanges((begin, end) => {
        index.addUpdateRange(begin, end - begin);
        index.needsUpdate = true;
        if (lines?.visible) updateLines(walk.vertices, lines.geometry.index, begin, end);
      });
      mesh.geometry.setDrawRange(0, 3 * walk.triangles);
      lines?.geometry.setDrawRange(0, 6 * walk.triangles);
    }
  }
}
