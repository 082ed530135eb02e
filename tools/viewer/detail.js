// The page of `qmpipe serve` for a detail-increment model: the mesh follows the eye, block by block. Its
// increments are fetched once, as splits, and applied here (detail_walk.js). tools/web/detail_service.h says
// which addresses the page asks for.
//
// Query: ?heading=DEG&pitch=DEG&range=METRES  from where to look at the middle first
//        ?pixels=N     how long the smallest visible object may be on the screen
//        ?svo=METRES   one threshold everywhere instead
//        ?wireframe=1  ?bare=1  switches; bare hides all text

const query = new URLSearchParams(location.search);
const number = (name, fallback) => (query.has(name) ? Number(query.get(name)) : fallback);
const element = (id) => document.getElementById(id);
const grouped = (count) => count.toLocaleString('en');

// What a frame may spend on walking, so that it stays short, and in steps of how many splits.
const walkMs = 6;
const splitsAtOnce = 128;
const framesKept = 600;

// What people can do something about is thrown as this.
class Plain extends Error {}

function say(title, ...sentences) {
  const note = element('note');
  note.replaceChildren(Object.assign(document.createElement('h1'), { textContent: title }));
  for (const sentence of sentences) {
    note.append(Object.assign(document.createElement('p'), { textContent: sentence }));
  }
}

function report(error) {
  say('Nothing to show', error instanceof Plain ? error.message : `${error}`);
  if (!(error instanceof Plain)) throw error;
}

function requireWebGl() {
  if (document.createElement('canvas').getContext('webgl2')) return;
  throw new Plain('This browser has no WebGL 2, which three.js draws with. Switch on hardware ' +
                  'acceleration in its settings, or use another browser. Meshes can be had without ' +
                  'one: qmpipe detail extract.');
}

async function loadLibraries() {
  try {
    const [THREE, { OrbitControls }, scene, walk] = await Promise.all([
      import('three'), import('./three/OrbitControls.js'), import('./detail_scene.js'),
      import('./detail_walk.js')]);
    return { THREE, OrbitControls, ...scene, ...walk };
  } catch (error) {
    throw new Plain('three.js is not installed beside this page: run tools/setup.sh in the folder ' +
                    `of qmpipe, and load the page again. (${error.message})`);
  }
}

async function fetchPart(address) {
  const response = await fetch(address);
  if (!response.ok) throw new Plain(`${address} is answered with ${response.status}.`);
  return response;
}

// decodeBlock() of detail_walk.js, in a thread of its own.
class Decoder {
  constructor() {
    this.worker = new Worker(new URL('./detail_decoder.js', import.meta.url), { type: 'module' });
  }

  // One at a time.
  decode(buffer, size) {
    return new Promise((resolve, reject) => {
      this.worker.onerror = () => reject(new Plain('detail_decoder.js cannot be run.'));
      this.worker.onmessage = ({ data: { block, error } }) => {
        if (error) reject(new Plain(error));
        else resolve(block);
      };
      this.worker.postMessage({ buffer, size }, [buffer]);
    });
  }

  end() {
    this.worker.terminate();
  }
}

class Viewer {
  constructor(libraries, description) {
    Object.assign(this, { libraries, description });
    const { THREE, OrbitControls, DetailScene, boxOf } = libraries;
    const whole = new THREE.Box3();
    const origin = new THREE.Vector3();
    for (const block of description.blocks) whole.union(boxOf(block, origin));
    this.middle = whole.getCenter(new THREE.Vector3());
    this.radius = whole.getSize(new THREE.Vector3()).length() / 2;
    this.detail = new DetailScene(description, this.middle,
                                  whole.clone().translate(this.middle.clone().negate()));
    this.renderer = new THREE.WebGLRenderer({ antialias: true });
    element('view').append(this.renderer.domElement);
    this.camera = new THREE.PerspectiveCamera(60, 1, 1, 2);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.maxPolarAngle = 0.495 * Math.PI;
    this.controls.maxDistance = 20 * this.radius;
    this.pixels = 2;
    this.svo = null;   // a threshold in metres, or by the distance
    this.frames = [];  // of the last frames with a picture: { ms, work_ms, splits }
    this.isLoaded = false;
    this.needsPicture = true;
    addEventListener('resize', () => this.fit());
    this.fit();
    this.look({ heading: number('heading', 15), pitch: number('pitch', -35),
                range: number('range', 1.5 * this.radius) });
  }

  fit() {
    const { clientWidth: width, clientHeight: height } = element('view');
    this.renderer.setPixelRatio(devicePixelRatio);
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.needsPicture = true;
  }

  // At the middle of the model, or at `at`, a point in its coordinates.
  look({ heading, pitch, range, at = this.middle.toArray() }) {
    const { THREE } = this.libraries;
    const [h, p] = [heading, pitch].map(THREE.MathUtils.degToRad);
    this.controls.target.set(...at).sub(this.middle);
    this.camera.position.set(-Math.sin(h) * Math.cos(p), -Math.cos(h) * Math.cos(p), -Math.sin(p))
        .multiplyScalar(range).add(this.controls.target);
    this.needsPicture = true;
  }

  // What may be as long as `pixels` on the screen at that distance (Ai et al. 2019, section 2.3.2).
  svoAt(distance) {
    const half = this.libraries.THREE.MathUtils.degToRad(this.camera.fov) / 2;
    return this.pixels * 2 * distance * Math.tan(half) / this.renderer.domElement.height;
  }

  setTargets() {
    const { levelForSvo } = this.libraries;
    for (const one of this.loaded) {
      const svo = this.svo ?? this.svoAt(this.camera.position.distanceTo(one.middle));
      one.target = levelForSvo(one.block, svo);
    }
  }

  get loaded() {
    return this.detail.blocks.filter(Boolean);
  }

  // All blocks in turn, until the frame's time is over.
  walk() {
    const end = performance.now() + walkMs;
    let splits = 0;
    for (let walked = true; walked && performance.now() < end;) {
      walked = false;
      for (const { walk, target } of this.loaded) {
        const steps = walk.step(target, splitsAtOnce);
        splits += steps;
        walked ||= steps > 0;
      }
    }
    return splits;
  }

  frame(now) {
    try {
      this.advance(now);
      requestAnimationFrame((then) => this.frame(then));
    } catch (error) {
      report(error);
    }
  }

  advance(now) {
    const start = performance.now();
    if (this.controls.update()) this.needsPicture = true;
    this.setTargets();
    const splits = this.walk();
    this.isWalking = splits > 0;
    if (splits === 0 && !this.needsPicture) {
      this.last = undefined;
      return;
    }
    this.needsPicture = false;
    this.draw();
    const work = performance.now() - start;
    // After a rest there is no frame before this one.
    this.frames.push({ ms: now - (this.last ?? now - work), work_ms: work, splits });
    if (this.frames.length > framesKept) this.frames.shift();
    this.last = now;
    this.showState();
  }

  draw() {
    const distance = this.camera.position.length();
    this.camera.near = Math.max(distance - 1.1 * this.radius, 2e-4 * this.radius);
    this.camera.far = distance + 1.1 * this.radius;
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
    this.detail.update(this.camera);
    this.renderer.render(this.detail.scene, this.camera);
  }

  get triangles() {
    return this.description.seams + this.loaded.reduce((sum, one) => sum + one.walk.triangles, 0);
  }

  get idle() {
    return this.isLoaded && !this.isWalking && !this.needsPicture;
  }

  showState() {
    const levels = this.loaded.map(({ walk, block }) => walk.level / Math.max(block.levels, 1));
    const percent = (share) => `${Math.round(100 * share)} %`;
    const recent = this.frames.slice(-30).map(({ ms }) => ms).sort((a, b) => a - b);
    const lines = [
      `triangles  ${grouped(this.triangles)} of ${grouped(this.description.triangles[1])}`,
      `levels     ${levels.length > 6
          ? `${percent(Math.min(...levels))} to ${percent(Math.max(...levels))}`
          : levels.map(percent).join('  ')} of the way to the finest`,
      `frame      ${recent[recent.length >> 1].toFixed(1)} ms`];
    element('state').textContent = lines.join('\n');
  }

  async load() {
    const { decodeSeams } = this.libraries;
    const { blocks } = this.description;
    const decoder = new Decoder();
    const part = async (b) => (await fetchPart(`block/${b}.bin`)).arrayBuffer();
    let coming = part(0);
    for (let b = 0; b < blocks.length; ++b) {
      const buffer = await coming;
      // The next one is on its way while this one is decoded.
      if (b + 1 < blocks.length) coming = part(b + 1);
      this.detail.addBlock(b, await decoder.decode(buffer, blocks[b]));
      this.needsPicture = true;
      this.note(`block ${b + 1} of ${blocks.length} ...`);
    }
    decoder.end();
    const seams = await fetchPart('seams.bin');
    this.seams = decodeSeams(await seams.arrayBuffer(), this.description);
    this.detail.addSeams(this.seams);
    const bytes = blocks.reduce((sum, block) => sum + block.bytes, 0);
    this.note(`${blocks.length} blocks in ${(bytes / 1e6).toFixed(1)} MB`);
    this.needsPicture = true;
    this.isLoaded = true;
  }

  note(sentence) {
    const [coarsest, finest] = this.description.triangles.map(grouped);
    say(this.description.name, `${coarsest} to ${finest} triangles, ${sentence}`);
  }
}

// The slider's places, 0 to 1, are thresholds from the finest to the coarsest, by their logarithms.
function svoScale({ blocks }) {
  const high = Math.max(...blocks.map(({ svo_m: [coarsest] }) => coarsest), 1e-6);
  const low = Math.max(Math.min(...blocks.map(({ svo_m: [, finest] }) => finest)), high * 1e-4);
  const width = Math.max(Math.log(high / low), 1e-6);
  return { svoOf: (place) => low * Math.exp(place * width),
           placeOf: (svo) => Math.log(svo / low) / width };
}

function connectSwitches(viewer) {
  const scale = svoScale(viewer.description);
  const apply = () => {
    const isFixed = element('rule').value === 'fixed';
    viewer.pixels = 2 ** Number(element('pixels').value);
    viewer.svo = isFixed ? scale.svoOf(Number(element('svo').value)) : null;
    element('pixels-row').style.display = isFixed ? 'none' : 'block';
    element('svo-row').style.display = isFixed ? 'block' : 'none';
    element('pixels-text').textContent = `smallest visible object: ${viewer.pixels.toFixed(2)} pixels`;
    element('svo-text').textContent =
        `smallest visible object: ${Number((viewer.svo ?? 0).toPrecision(3))} m`;
    viewer.detail.setWireframe(element('wireframe').checked);
    viewer.needsPicture = true;
  };
  if (query.has('pixels')) element('pixels').value = Math.log2(number('pixels'));
  if (query.has('svo')) {
    element('rule').value = 'fixed';
    element('svo').value = scale.placeOf(number('svo'));
  }
  element('wireframe').checked = query.get('wireframe') === '1';
  element('switches').addEventListener('input', apply);
  apply();
  for (const id of ['switches', 'state']) element(id).style.display = 'block';
}

async function show() {
  requireWebGl();
  const [libraries, response] = await Promise.all([loadLibraries(), fetchPart('model.json')]);
  const viewer = new Viewer(libraries, await response.json());
  connectSwitches(viewer);
  if (query.get('bare') === '1') {
    for (const id of ['note', 'switches', 'state']) element(id).style.visibility = 'hidden';
  }
  // For the console, and for the tests.
  window.qmpipe = viewer;
  viewer.frame(performance.now());
  await viewer.load();
}

show().catch(report);
