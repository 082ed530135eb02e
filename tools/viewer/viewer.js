// The page of `qmpipe serve`. It works behind any static server too: index.html and viewer.js with
// CesiumJS in the folder "cesium" and the tile set in the folder "tiles" beside them.
//
// Query: ?tiles=ADDRESS  of the tile set (default: tiles)
//        ?lon=DEG&lat=DEG&heading=DEG&pitch=DEG&range=METRES  where to look at first
//        ?wireframe=1  ?boundaries=1  ?ramp=fixed  ?bare=1  switches; bare hides all text

const query = new URLSearchParams(location.search);
const number = (name, fallback) => (query.has(name) ? Number(query.get(name)) : fallback);
const element = (id) => document.getElementById(id);

// Heights in metres: the sea's depths, the shore, meadows, rock, snow.
const fixedStops = [[-6000, '#0b2a4a'], [-200, '#2f6f9f'], [0, '#9cc4d6'], [4, '#a9c08f'],
                    [300, '#8fab6c'], [900, '#cdb98a'], [1800, '#a8927c'], [2800, '#f4f4f2']];
// Shares of the way from the lowest to the highest.
const fittedStops = [[0, '#5f8f63'], [0.2, '#a3b877'], [0.45, '#d9c48f'], [0.7, '#a9866a'],
                     [0.9, '#d8d2cc'], [1, '#ffffff']];

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
    boundsDeg: set.bounds_deg || layer.bounds || [-180, -90, 180, 90],
    heights: set.heights_m || [fixedStops[0][0], fixedStops[fixedStops.length - 1][0]],
    changes: set.layer_changes || [],
  };
}

function rampOf(kind, heights) {
  let stops = fixedStops;
  if (kind === 'fitted') {
    const span = Math.max(heights[1] - heights[0], 1);
    stops = fittedStops.map(([share, colour]) => [heights[0] + share * span, colour]);
  }
  const low = stops[0][0];
  const high = stops[stops.length - 1][0];
  const canvas = document.createElement('canvas');
  canvas.width = 2048;
  canvas.height = 1;
  const brush = canvas.getContext('2d');
  const gradient = brush.createLinearGradient(0, 0, canvas.width, 0);
  for (const [height, colour] of stops) {
    gradient.addColorStop((height - low) / (high - low), colour);
  }
  brush.fillStyle = gradient;
  brush.fillRect(0, 0, canvas.width, 1);
  return { image: canvas, low, high };
}

// Colours by height; a tile's own coordinates run from 0 to 1, so its sides are known too.
function terrainMaterial() {
  const { image, low, high } = rampOf('fixed', []);
  return new Cesium.Material({
    fabric: {
      type: 'QmpipeTerrain',
      uniforms: { ramp: image, low, high, boundaries: 0 },
      source: `
        czm_material czm_getMaterial(czm_materialInput input_) {
          czm_material material = czm_getDefaultMaterial(input_);
          float share = clamp((input_.height - low) / (high - low), 0.0, 1.0);
          vec3 colour = czm_gammaCorrect(texture(ramp, vec2(share, 0.5))).rgb;
          vec2 off = min(input_.st, 1.0 - input_.st) / max(fwidth(input_.st), vec2(1e-6));
          float line = 1.0 - smoothstep(0.6, 1.4, min(off.x, off.y));
          material.diffuse = mix(colour, vec3(0.75, 0.1, 0.05), boundaries * line);
          material.alpha = 1.0;
          return material;
        }`,
    },
  });
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
    globe.showGroundAtmosphere = !wireframe;
    material.uniforms.boundaries = element('boundaries').checked ? 1 : 0;
    globe.enableLighting = element('lighting').checked;
    const { image, low, high } = rampOf(element('ramp').value, set.heights);
    Object.assign(material.uniforms, { ramp: image, low, high });
    viewer.scene.requestRender();
  };
  for (const name of ['wireframe', 'boundaries']) element(name).checked = query.get(name) === '1';
  if (query.get('ramp') === 'fixed') element('ramp').value = 'fixed';
  element('switches').addEventListener('change', apply);
  element('switches').style.display = 'block';
  apply();
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

function lookAtData(viewer, set) {
  const [west, south, east, north] = set.boundsDeg;
  const middle = (set.heights[0] + set.heights[1]) / 2;
  const centre = Cesium.Cartesian3.fromDegrees(number('lon', (west + east) / 2),
                                               number('lat', (south + north) / 2),
                                               Math.max(-12000, Math.min(middle, 9000)));
  const metresADegree = 111320;
  const wide = (east - west) * metresADegree *
      Math.max(0.1, Math.cos(Cesium.Math.toRadians((south + north) / 2)));
  const high = (north - south) * metresADegree;
  const range = number('range', Math.min(1.2 * Math.max(wide, high), 2e7));
  viewer.camera.lookAt(centre, new Cesium.HeadingPitchRange(
      Cesium.Math.toRadians(number('heading', 15)),
      Cesium.Math.toRadians(number('pitch', range > 5e6 ? -90 : -40)), range));
  viewer.camera.lookAtTransform(Cesium.Matrix4.IDENTITY);
}

async function show() {
  requireWebGl();
  const tiles = query.get('tiles') || 'tiles';
  const [set] = await Promise.all([describeSet(tiles), loadCesium()]);
  const terrainProvider =
      await Cesium.CesiumTerrainProvider.fromUrl(tiles, { requestVertexNormals: true });
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
  scene.globe.dynamicAtmosphereLighting = false;
  scene.backgroundColor = Cesium.Color.fromCssColorString('#10151c');
  lightFromNorthWest(scene);
  const material = terrainMaterial();
  scene.globe.material = material;
  connectSwitches(viewer, material, set);
  showHeightUnderCursor(viewer, terrainProvider);
  lookAtData(viewer, set);
  if (query.get('bare') === '1') {
    for (const id of ['note', 'switches', 'cursor']) element(id).style.visibility = 'hidden';
  }
  // For the console, and for the tests.
  window.qmpipe = { viewer, terrainProvider, errors, set };
}

show().catch((error) => {
  say('Nothing to show', error instanceof Plain ? error.message : `${error}`);
  if (!(error instanceof Plain)) throw error;
});
