// The page of `qmpipe serve`. It works behind any static server too: index.html, viewer.js and what it
// imports, with CesiumJS in the folder "cesium" and the tile set in the folder "tiles" beside them.
//
// Query: ?tiles=ADDRESS  of the tile set (default: tiles)
//        ?lon=DEG&lat=DEG&heading=DEG&pitch=DEG&range=METRES  where to look at first
//        ?wireframe=1  ?boundaries=1  ?extent=0  ?ramp=shore|fitted|fixed  switches
//        ?bare=1  hides the panels and the data's outline

import { coverOf, extentOf, rangeOverExtent } from './data_extent.js';
import { defaultRampKind, drawLegend, keepExtent, paintSkirtsLikeGround, rampOf, roundDown,
         terrainMaterial } from './terrain_style.js';

const query = new URLSearchParams(location.search);
const number = (name, fallback) => (query.has(name) ? Number(query.get(name)) : fallback);
const isBare = query.get('bare') === '1';
const element = (id) => document.getElementById(id);

// What people can do something about is thrown as this.
class Plain extends Error {}

function say(title, ...sentences) {
  const note = element('note');
  note.replaceChildren();
  note.append(Object.assign(document.createElement('h1'), { textContent: title }));
  for (const sentence of sentences) {
    note.append(Object.assign(document.createElement('p'), { textContent: sentence }));
  }
}

function complain(sentence) {
  const line = Object.assign(document.createElement('p'), { textContent: sentence });
  line.className = 'wrong';
  element('note').append(line);
}

function requireWebGl() {
  const canvas = document.createElement('canvas');
  if (canvas.getContext('webgl2') || canvas.getContext('webgl')) return;
  throw new Plain('This browser has no WebGL, which CesiumJS draws with. Switch on hardware ' +
                  'acceleration in its settings, or use another browser. The tiles can be checked ' +
                  'without one: qmpipe verify, qmpipe check.');
}

async function loadCesium() {
  const base = new URL('cesium/', location.href).href;
  window.CESIUM_BASE_URL = base;
  const style = document.createElement('link');
  style.rel = 'stylesheet';
  style.href = base + 'Widgets/widgets.css';
  document.head.append(style);
  await new Promise((resolve, reject) => {
    const script = document.createElement('script');
    script.src = base + 'Cesium.js';
    script.onload = resolve;
    script.onerror = () => reject(new Plain(
        'CesiumJS is not installed beside this page: run tools/setup.sh in the folder of qmpipe, ' +
        'and load the page again.'));
    document.head.append(script);
  });
}

async function fetchJson(address) {
  const response = await fetch(address);
  if (!response.ok) throw new Plain(`${address} is answered with ${response.status}.`);
  return response.json();
}

// What `qmpipe serve` knows of the set; behind other servers, what layer.json says.
async function describeSet(tiles) {
  const layer = await fetchJson(tiles + '/layer.json');
  const response = await fetch(tiles + '/set.json').catch(() => null);
  const set = response && response.ok ? await response.json() : {};
  return {
    name: layer.name || tiles,
    layer,
    tiles: set.tiles,
    extentDeg: extentOf(layer, set.bounds_deg),
    cover: coverOf(layer),
    heights: set.heights_m,
    changes: set.layer_changes || [],
  };
}

// Light from the north-west, half-way up, as on printed maps, wherever the camera goes.
function lightFromNorthWest(scene) {
  scene.light = new Cesium.DirectionalLight({ direction: new Cesium.Cartesian3(1, 0, 0) });
  const fromSky = new Cesium.Cartesian3(0.6, -0.5, -0.62);
  const frame = new Cesium.Matrix4();
  scene.preRender.addEventListener(() => {
    Cesium.Transforms.eastNorthUpToFixedFrame(scene.camera.positionWC, undefined, frame);
    Cesium.Matrix4.multiplyByPointAsVector(frame, fromSky, scene.light.direction);
  });
}

function connectSwitches(viewer, material, set) {
  const globe = viewer.scene.globe;
  const apply = () => {
    const wireframe = element('wireframe').checked;
    globe._surface.tileProvider._debug.wireframe = wireframe;
    // Lines are seen against the dark, not against the day's sky from below.
    viewer.scene.skyAtmosphere.show = !wireframe;
    const extent = element('extent').checked ? 1 : 0;
    Object.assign(material.uniforms, {
      boundaries: element('boundaries').checked ? 1 : 0, extent, outline: isBare ? 0 : extent,
    });
    globe.enableLighting = element('lighting').checked;
    const { image, low, pivot, high } = rampOf(element('ramp').value, set.heights);
    Object.assign(material.uniforms, { ramp: image, low, pivot, high });
    drawLegend(element('legend'), { image, low, pivot, high });
    viewer.scene.requestRender();
  };
  for (const name of ['wireframe', 'boundaries']) element(name).checked = query.get(name) === '1';
  element('extent').checked = query.get('extent') !== '0';
  element('ramp').value = query.get('ramp') || defaultRampKind(set.heights);
  if (element('ramp').selectedIndex < 0) element('ramp').value = defaultRampKind(set.heights);
  element('display').open = window.innerWidth >= 600;
  element('switches').addEventListener('change', apply);
  element('home').addEventListener('click', () => lookAtExtent(viewer, set, (name, usual) => usual));
  element('switches').style.display = 'flex';
  element('legend').style.display = 'block';
  apply();
}

// The set's own words may be HTML. Its texts and web links are shown, nothing else of it is loaded.
function attributionOf(html) {
  const line = document.createElement('span');
  const copy = (from, to) => {
    for (const node of from.childNodes) {
      if (node.nodeType === Node.TEXT_NODE) to.append(node.textContent);
      if (node.nodeType !== Node.ELEMENT_NODE || /^(script|style)$/i.test(node.tagName)) continue;
      const address = node.tagName === 'A' ? node.getAttribute('href') || '' : '';
      const isLink = /^https?:\/\//i.test(address);
      const part = document.createElement(isLink ? 'a' : 'span');
      if (isLink) Object.assign(part, { href: address, target: '_blank', rel: 'noopener' });
      copy(node, part);
      to.append(part);
    }
  };
  copy(new DOMParser().parseFromString(html, 'text/html').body, line);
  return line;
}

function showCredits(layer) {
  const software = Object.assign(document.createElement('a'), {
    href: 'https://cesium.com/cesiumjs/', target: '_blank', rel: 'noopener', textContent: 'CesiumJS',
  });
  const credits = element('credits');
  credits.replaceChildren();
  if (layer.attribution) {
    const attribution = attributionOf(`${layer.attribution}`);
    attribution.id = 'attribution';
    credits.append(attribution, ' | ');
  }
  credits.append(software);
}

function showLoading(viewer) {
  const box = element('loading');
  viewer.scene.globe.tileLoadProgressEvent.addEventListener((waiting) => {
    box.style.display = waiting > 0 ? 'block' : 'none';
    box.textContent = `loading ${waiting} ${waiting === 1 ? 'tile' : 'tiles'}`;
  });
}

// For lengths across the picture, at what is seen in its middle.
function showScale(viewer) {
  const { scene } = viewer;
  const box = element('scale');
  let last = '';
  scene.postRender.addEventListener(() => {
    const { clientWidth, clientHeight } = scene.canvas;
    const ray = scene.camera.getPickRay(new Cesium.Cartesian2(clientWidth / 2, clientHeight / 2));
    const hit = ray && scene.globe.pick(ray, scene);
    box.style.display = hit ? 'block' : 'none';
    if (!hit) return;
    const place = new Cesium.BoundingSphere(hit, 0);
    const metresAPixel = scene.camera.getPixelSize(place, clientWidth, clientHeight);
    const length = roundDown(110 * metresAPixel);
    const text = length >= 1000 ? `${length / 1000} km`
        : (length >= 1 ? `${length} m` : `${Math.round(length * 100)} cm`);
    const width = `${Math.round(length / metresAPixel)}px`;
    if (last === text + width) return;
    last = text + width;
    box.textContent = text;
    box.style.width = width;
  });
}

const placeText = (degrees, positive, negative) =>
    `${Math.abs(degrees).toFixed(5)}° ${degrees < 0 ? negative : positive}`;

// The mesh as it is drawn gives a height at once; where the cursor rests, the tile's own is fetched.
function showHeightUnderCursor(viewer, terrainProvider) {
  const box = element('cursor');
  let rest = 0;
  const write = (place, height, of) => {
    const degrees = Cesium.Math.toDegrees;
    box.textContent = `${placeText(degrees(place.latitude), 'N', 'S')}  ` +
        `${placeText(degrees(place.longitude), 'E', 'W')}   ${height.toFixed(1)} m${of}`;
  };
  viewer.screenSpaceEventHandler.setInputAction((movement) => {
    clearTimeout(rest);
    const ray = viewer.camera.getPickRay(movement.endPosition);
    const hit = ray && viewer.scene.globe.pick(ray, viewer.scene);
    box.style.display = hit ? 'block' : 'none';
    if (!hit) return;
    const place = Cesium.Cartographic.fromCartesian(hit);
    write(place, place.height, ' (as drawn)');
    rest = setTimeout(async () => {
      const asked = new Cesium.Cartographic(place.longitude, place.latitude);
      await Cesium.sampleTerrainMostDetailed(terrainProvider, [asked]).catch(() => null);
      if (asked.height !== undefined) write(asked, asked.height, ' (deepest tile)');
    }, 250);
  }, Cesium.ScreenSpaceEventType.MOUSE_MOVE);
}

// `choose(name, usual)`: what a query wants instead of what shows all of the data.
function lookAtExtent(viewer, set, choose) {
  const [west, south, east, north] = set.extentDeg;
  const { clientWidth, clientHeight } = viewer.scene.canvas;
  const shape = clientWidth / Math.max(clientHeight, 1);
  const [low, high] = set.heights || [0, 0];
  const centre = Cesium.Cartesian3.fromDegrees(choose('lon', (west + east) / 2),
                                               choose('lat', (south + north) / 2),
                                               Math.max(-12000, Math.min((low + high) / 2, 9000)));
  const tilted = -40;
  let range = choose('range', rangeOverExtent(set.extentDeg, tilted, shape));
  const pitch = choose('pitch', range > 5e6 ? -90 : tilted);
  range = choose('range', rangeOverExtent(set.extentDeg, pitch, shape));
  viewer.camera.lookAt(centre, new Cesium.HeadingPitchRange(
      Cesium.Math.toRadians(choose('heading', pitch === -90 ? 0 : 15)), Cesium.Math.toRadians(pitch),
      range));
  viewer.camera.lookAtTransform(Cesium.Matrix4.IDENTITY);
}

async function show() {
  requireWebGl();
  const tiles = query.get('tiles') || 'tiles';
  const [set] = await Promise.all([describeSet(tiles), loadCesium()]);
  paintSkirtsLikeGround();
  showCredits(set.layer);
  const terrainProvider =
      await Cesium.CesiumTerrainProvider.fromUrl(tiles, { requestVertexNormals: true });
  // The page shows layer.json's attribution itself, and no logo of a service that is not used.
  Cesium.CreditDisplay.cesiumCredit = undefined;
  terrainProvider._tileCredits = undefined;
  const viewer = new Cesium.Viewer('globe', {
    terrainProvider, baseLayer: false, baseLayerPicker: false, geocoder: false, timeline: false,
    animation: false, homeButton: false, sceneModePicker: false, navigationHelpButton: false,
    fullscreenButton: false, infoBox: false, selectionIndicator: false, requestRenderMode: true,
    maximumRenderTimeChange: Infinity,
  });
  const zooms = `zooms ${set.layer.minzoom || 0} to ${set.layer.maxzoom}`;
  say(set.name, set.tiles ? `${set.tiles} tiles, ${zooms}` : zooms);
  for (const change of set.changes) complain(`layer.json did not fit the tiles: ${change}`);
  const errors = [];
  terrainProvider.errorEvent.addEventListener((error) => {
    errors.push(error.message);
    if (errors.length <= 3) complain(error.message);
  });
  const scene = viewer.scene;
  // Air between the eye and the ground would wash the colours out of which heights are read. Fog stays
  // as what spares far tiles.
  scene.globe.showGroundAtmosphere = false;
  scene.fog.renderable = false;
  scene.globe.baseColor = Cesium.Color.fromCssColorString('#303335');
  scene.backgroundColor = Cesium.Color.fromCssColorString('#10151c');
  lightFromNorthWest(scene);
  const material = terrainMaterial(set.extentDeg, set.cover);
  scene.globe.material = material;
  keepExtent(scene, material);
  connectSwitches(viewer, material, set);
  showHeightUnderCursor(viewer, terrainProvider);
  showLoading(viewer);
  showScale(viewer);
  lookAtExtent(viewer, set, number);
  if (isBare) {
    for (const id of ['note', 'switches', 'loading', 'cursor', 'scale', 'legend']) {
      element(id).style.visibility = 'hidden';
    }
  }
  // For the console, and for the tests.
  window.qmpipe = { viewer, terrainProvider, errors, set };
}

show().catch((error) => {
  say('Nothing to show', error instanceof Plain ? error.message : `${error}`);
  if (!(error instanceof Plain)) throw error;
});
