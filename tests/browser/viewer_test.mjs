// The real client as judge: CesiumJS in a headless Chromium loads tile sets through `qmpipe serve`.
//
//   QMPIPE_PROGRAM=.../qmpipe QMPIPE_WORK=FOLDER [QMPIPE_DATA=FOLDER] node viewer_test.mjs
//
// Screenshots stay in QMPIPE_WORK. readme.png there is the README's picture (docs/terrain.png).

import assert from 'node:assert/strict';
import { copyFileSync, existsSync, mkdirSync, readdirSync, readFileSync, rmSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { launch, lookAt, openPage, qmpipe, run, waitForTiles, withServer } from './browser.mjs';

const work = process.env.QMPIPE_WORK;
assert(work, 'QMPIPE_WORK names the folder for sets and screenshots');
const data = process.env.QMPIPE_DATA ?? fileURLToPath(new URL('../../../shared/data', import.meta.url));
const seed = 20261123;
const patience = { timeout: 600000 };
const demSize = [1201, 901];
const demBounds = [6, 43.5, 8, 45];

// A linear congruential generator: Math.random takes no seed.
function dice(state) {
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

// The DEM's heights, and their bilinear interpolation between the centres of pixels.
function readDem(tif) {
  const raw = join(work, 'dem.raw');
  run('gdal_translate', '-q', '-of', 'ENVI', '-ot', 'Float32', tif, raw);
  const bytes = readFileSync(raw);
  const [columns, rows] = demSize;
  assert.equal(bytes.length, columns * rows * 4);
  const at = (i, j) => bytes.readFloatLE(4 * (j * columns + i));
  const [west, south, east, north] = demBounds;
  return (lon, lat) => {
    const x = (lon - west) / (east - west) * columns - 0.5;
    const y = (north - lat) / (north - south) * rows - 0.5;
    const i = Math.floor(x);
    const j = Math.floor(y);
    const [fx, fy] = [x - i, y - j];
    return (1 - fy) * ((1 - fx) * at(i, j) + fx * at(i + 1, j)) +
        fy * ((1 - fx) * at(i, j + 1) + fx * at(i + 1, j + 1));
  };
}

// Posts of the deepest zoom, within the DEM and off the sides of tiles, where a client may ask for
// either neighbour.
function randomPosts(zoom, count) {
  const roll = dice(seed);
  const spacing = 180 / 2 ** zoom / 256;
  const [west, south, east, north] = demBounds;
  const margin = 0.01;
  const pick = (low, high, origin) => {
    for (;;) {
      const post = Math.round((low + margin + roll() * (high - low - 2 * margin) - origin) / spacing);
      if (post % 256 !== 0) return origin + post * spacing;
    }
  };
  return Array.from({ length: count }, () => [pick(west, east, -180), pick(south, north, -90)]);
}

let browser;
let heightAt;
let deepest;  // zoom and tolerance
const sets = {};

before(async () => {
  rmSync(work, { recursive: true, force: true });
  mkdirSync(work, { recursive: true });
  const dem = join(work, 'dem.tif');
  qmpipe('synth', '-o', dem, '--size', demSize.join('x'), '--bounds', demBounds.join(','),
         '--seed', '3');
  heightAt = readDem(dem);
  sets.folder = join(work, 'tiles');
  const report = JSON.parse(qmpipe('build', dem, '-o', sets.folder, '--name', 'browser test',
                                   '--json'));
  deepest = report.zooms.at(-1);
  for (const form of ['mbtiles', 'pmtiles']) {
    sets[form] = join(work, `tiles.${form}`);
    qmpipe('convert', sets.folder, '-o', sets[form]);
  }
  sets.plain = join(work, 'plain');
  qmpipe('convert', sets.folder, '-o', sets.plain, '--gzip', 'none');
  browser = await launch();
}, patience);

after(async () => browser?.close());

function expectPicture(look) {
  assert(look.mean > 40 && look.mean < 215, `neither black nor white: ${JSON.stringify(look)}`);
  assert(look.spread > 15, `not all one colour: ${JSON.stringify(look)}`);
  assert(look.colours > 60, `not a few colours: ${JSON.stringify(look)}`);
}

async function expectHeights(page, count) {
  const posts = randomPosts(deepest.zoom, count);
  const heights = await page.evaluate(async (places) => {
    const asked = places.map(([lon, lat]) => Cesium.Cartographic.fromDegrees(lon, lat));
    await Cesium.sampleTerrainMostDetailed(window.qmpipe.terrainProvider, asked);
    return asked.map((place) => place.height);
  }, posts);
  let worst = 0;
  posts.forEach(([lon, lat], k) => {
    assert.equal(typeof heights[k], 'number', `a height at ${lon} ${lat}`);
    worst = Math.max(worst, Math.abs(heights[k] - heightAt(lon, lat)));
  });
  // A hundredth for the DEM's and the tiles' numbers of 32 and 15 bits.
  assert(worst <= deepest.tolerance_m + 0.01,
         `${worst} m off, where ${deepest.tolerance_m} m are allowed (seed ${seed})`);
  return worst;
}

for (const form of ['folder', 'plain', 'mbtiles', 'pmtiles']) {
  test(`CesiumJS draws a ${form} without a complaint and reads the DEM's heights`, patience, async () => {
    await withServer(sets[form], async (address) => {
      const { page, wrong, seen } = await openPage(browser);
      await page.goto(address);
      const state = await waitForTiles(page);
      const png = await page.screenshot({ path: join(work, `${form}.png`) });
      expectPicture(await lookAt(page, png));
      const worst = await expectHeights(page, form === 'folder' ? 300 : 100);
      assert.deepEqual(await page.evaluate(() => window.qmpipe.errors), []);
      assert.deepEqual(wrong, []);
      const foreign = [...seen.keys()].filter((url) => !url.startsWith(address) && /^http/.test(url));
      assert.deepEqual(foreign, [], 'nothing comes from elsewhere');
      const tiles = [...seen.keys()].filter((url) => url.includes('.terrain'));
      assert(tiles.length > state.drawn, `${tiles.length} tiles were asked for`);
      console.log(`${form}: ${state.drawn} tiles drawn, ${tiles.length} asked for, heights within ` +
                  `${worst.toFixed(2)} m of ${deepest.tolerance_m} m allowed`);
      await page.close();
    });
  });
}

test('the reference reader of PMTiles sees the tiles of the folder', patience, () => {
  const reader = fileURLToPath(new URL('pmtiles_reader_test.mjs', import.meta.url));
  console.log(run(process.execPath, reader, sets.pmtiles, sets.folder).trim());
});

test('the switches change the picture, closer tiles are deeper, and the cursor has a height', patience,
     async () => {
  await withServer(sets.folder, async (address) => {
    const { page, wrong } = await openPage(browser);
    await page.goto(`${address}?range=60000`);
    const near = await waitForTiles(page);
    assert(near.deepest >= deepest.zoom - 1, `zoom ${near.deepest} from 60 km`);
    const whole = await lookAt(page, await page.screenshot());
    await page.mouse.move(480, 320);
    await page.waitForFunction(
        () => document.getElementById('cursor').textContent.includes('deepest tile'));
    const text = await page.evaluate(() => document.getElementById('cursor').textContent);
    const [, lat, lon, height] = text.match(/([\d.]+)° N\s+([\d.]+)° E\s+(-?[\d.]+) m/);
    // Between posts the surface is the mesh's, a little farther off than at posts.
    assert(Math.abs(Number(height) - heightAt(Number(lon), Number(lat))) < 3 * deepest.tolerance_m, text);
    await page.mouse.move(5, 635);
    await page.check('#wireframe');
    await page.check('#boundaries');
    await waitForTiles(page);
    const lines = await lookAt(page, await page.screenshot({ path: join(work, 'wireframe.png') }));
    assert(lines.mean < whole.mean - 20, 'lines on the dark are darker than the whole surface');
    assert(lines.spread > 15, 'there are lines');
    await page.uncheck('#wireframe');
    await page.selectOption('#ramp', 'fixed');
    await waitForTiles(page);
    const fixed = await lookAt(page, await page.screenshot());
    assert(Math.abs(fixed.mean - lines.mean) > 10);
    assert.deepEqual(wrong, []);
    await page.close();
  });
});

test('a browser without WebGL is told so in words', patience, async () => {
  const blind = await launch('--disable-3d-apis');
  try {
    await withServer(sets.folder, async (address) => {
      const { page, wrong } = await openPage(blind);
      await page.goto(address);
      await page.waitForSelector('text=no WebGL');
      assert.deepEqual(wrong, []);
    });
  } finally {
    await blind.close();
  }
});

test('a server without CesiumJS says how to get it', patience, async () => {
  const pages = join(work, 'pages');
  mkdirSync(pages, { recursive: true });
  const source = fileURLToPath(new URL('../../tools/viewer', import.meta.url));
  for (const name of readdirSync(source)) {
    if (/\.(html|js)$/.test(name)) copyFileSync(join(source, name), join(pages, name));
  }
  process.env.QMPIPE_VIEWER = pages;
  try {
    await withServer(sets.folder, async (address) => {
      const { page } = await openPage(browser);
      await page.goto(address);
      await page.waitForSelector('text=tools/setup.sh');
      await page.close();
    });
  } finally {
    delete process.env.QMPIPE_VIEWER;
  }
});

test('the picture of the README', patience, async (t) => {
  const dem = join(data, 'N43E007.hgt.zip');
  if (!existsSync(dem)) return t.skip(`no ${dem}: set QMPIPE_DATA`);
  const set = join(work, 'alps.mbtiles');
  qmpipe('build', dem, '-o', set, '--name', 'Maritime Alps', '--tolerance', '5000');
  await withServer(set, async (address) => {
    const { page, wrong } = await openPage(browser, { width: 1280, height: 640 });
    await page.goto(`${address}?lon=7.42&lat=43.9&heading=-12&pitch=-34&range=50000&ramp=fixed&bare=1`);
    await waitForTiles(page);
    const png = await page.screenshot({ path: join(work, 'readme.png') });
    expectPicture(await lookAt(page, png));
    assert.deepEqual(wrong, []);
    await page.close();
  });
});
