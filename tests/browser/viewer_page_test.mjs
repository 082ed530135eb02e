// What a user reads on the page of a tile set: which colours stand for which heights, where the data are,
// whose they are; on a telephone too, and across the antimeridian.
//
//   QMPIPE_PROGRAM=.../qmpipe QMPIPE_WORK=FOLDER node viewer_page_test.mjs
//
// The screenshots stay in QMPIPE_WORK.

import assert from 'node:assert/strict';
import { mkdirSync, rmSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { boundsOfRanges, coverOf, extentOf, rangeOverExtent } from '../../tools/viewer/data_extent.js';
import { defaultRampKind, roundDown } from '../../tools/viewer/terrain_style.js';
import { launch, openPage, qmpipe, waitForTiles, withServer } from './browser.mjs';

const work = process.env.QMPIPE_WORK;
assert(work, 'QMPIPE_WORK names the folder for sets and screenshots');
const patience = { timeout: 600000 };
const [west, south, east, north] = [175, -20, 187, -10];  // across 180 degrees
const seed = 20261129;
let browser;
let set;

// A sea of -2000 m in the west, sloping land up to 1200 m in the east.
function writeGrid(file) {
  const [columns, rows] = [120, 100];
  const lines = [`ncols ${columns}`, `nrows ${rows}`, `xllcorner ${west}`, `yllcorner ${south}`, 'cellsize 0.1'];
  for (let j = 0; j < rows; ++j) {
    const row = Array.from({ length: columns }, (_, i) => {
      const share = i / (columns - 1);
      const waves = 40 * Math.sin(0.5 * j) * Math.sin(0.4 * i);
      return Math.round(share < 0.6 ? -2000 + Math.abs(waves) : Math.min(100 + 2750 * (share - 0.6) + waves, 1200));
    });
    lines.push(row.join(' '));
  }
  writeFileSync(file, lines.join('\n') + '\n');
}

before(async () => {
  rmSync(work, { recursive: true, force: true });
  mkdirSync(work, { recursive: true });
  const grid = join(work, 'grid.asc');
  writeGrid(grid);
  set = join(work, 'tiles');
  qmpipe('build', grid, '-o', set, '--source-crs', 'EPSG:4326', '--max-zoom', '5', '--attribution',
         'Made by <a href="https://example.org/">Example</a><img src="/stolen.png"> 2026');
  browser = await launch();
}, patience);

after(async () => browser?.close());

test('bounds of ranges of tiles leave out the widest gap, wherever it is', () => {
  let state = seed;
  const roll = (below) => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return Math.floor(state / 2 ** 32 * below);
  };
  for (let round = 0; round < 500; ++round) {
    const zoom = 2 + roll(5);
    const columns = 2 * 2 ** zoom;
    const [start, width] = [roll(columns), 1 + roll(columns / 2 - 1)];
    const [startY, endY] = [roll(2 ** zoom), roll(2 ** zoom)].sort((a, b) => a - b);
    // As runs of one to three columns, split where the globe's columns end, in any order.
    const ranges = [];
    for (let at = 0; at < width;) {
      const startX = (start + at) % columns;
      const size = Math.min(1 + roll(3), width - at, columns - startX);
      ranges.splice(roll(ranges.length + 1), 0, { startX, endX: startX + size - 1, startY, endY });
      at += size;
    }
    const side = 360 / columns;
    assert.deepEqual(boundsOfRanges(ranges, zoom, false),
                     [-180 + start * side, -90 + startY * side, -180 + (start + width) * side,
                      -90 + (endY + 1) * side], `seed ${seed}, round ${round}`);
  }
  assert.deepEqual(boundsOfRanges([{ startX: 0, endX: 7, startY: 0, endY: 3 }], 2, false),
                   [-180, -90, 180, 90]);
  const [, mercatorSouth, , mercatorNorth] =
      boundsOfRanges([{ startX: 0, endX: 3, startY: 1, endY: 3 }], 2, true);
  assert(Math.abs(mercatorSouth + 66.513) < 1e-3 && Math.abs(mercatorNorth - 85.051) < 1e-3);
});

test('bounds of layer.json are taken where they tell where the data are', () => {
  const available = [[{ startX: 0, startY: 0, endX: 1, endY: 0 }],
                     [{ startX: 0, startY: 0, endX: 0, endY: 0 }, { startX: 3, startY: 0, endX: 3, endY: 0 }]];
  assert.deepEqual(extentOf({ bounds: [6, 43, 8, 45], available }), [6, 43, 8, 45]);
  assert.deepEqual(extentOf({ bounds: [170, -20, -170, -10] }), [170, -20, 190, -10]);
  assert.deepEqual(extentOf({ bounds: [-180, -30, 180, -10], available }), [90, -30, 270, -10]);
  const data = { posts_deg: [100, -29, 200, -11], columns: 51, rows: ['1: 0 51', '1: 3 4'] };
  assert.deepEqual(extentOf({ bounds: [-180, -30, 180, -10], available, qmpipe: { data } }), [99, -30, 201, -10]);
  data.posts_deg = [-180, -29, 179, -11];
  data.columns = 360;
  assert.deepEqual(extentOf({ bounds: [-180, -30, 180, -10], available, qmpipe: { data } }), [-180, -30, 180, -10]);
  assert.deepEqual(extentOf({ available: [] }, [1, 2, 3, 4]), [1, 2, 3, 4]);
  assert.deepEqual(extentOf({}), [-180, -90, 180, 90]);
});

test('where the data are, of rows of posts', () => {
  const data = { posts_deg: [5, 43, 6.5, 44], columns: 4, rows: ['1: 0 4', '2: 1 2', '1: '] };
  const flags = (cover) => cover.rows.map((row) => row.join(''));
  const cover = coverOf({ qmpipe: { data }, projection: 'EPSG:4326' });
  assert.deepEqual(flags(cover), ['1111', '0110', '0110', '0000']);
  assert.deepEqual([cover.postsDeg, cover.columns], [[5, 43, 6.5, 44], 4]);
  assert.equal(coverOf({ qmpipe: {} }), null);
  assert.equal(coverOf({}), null);
  for (const wrong of [5, [], { rows: 1 }, { ...data, columns: 1e9 }, { ...data, columns: -1 }, { ...data, rows: [] },
                       { ...data, posts_deg: [1, 2, 'x', 4] }, { ...data, posts_deg: null }]) {
    assert.equal(coverOf({ qmpipe: { data: wrong } }), null, JSON.stringify(wrong));
  }
  for (const text of [null, 7, 'x 1', '9 9', '1: 9 -3', '0: 1', '1e9: 1', '99999: 1', '1:  2']) {
    assert.equal(coverOf({ qmpipe: { data: { ...data, rows: [text] } } }), null, `${text}`);
  }
  assert.deepEqual(flags(coverOf({ qmpipe: { data: { ...data, rows: ['1: 9 9 3 7'] } } })), ['0000']);
  // Mercator's rows in the south of a tall box are farther apart in degrees than those in the north.
  const tall = { posts_deg: [0, 0, 1, 80], columns: 1, rows: ['2: 0 1', '6: '] };
  const rows = flags(coverOf({ qmpipe: { data: tall }, projection: 'EPSG:3857' }));
  const edge = 2 * Math.atan(Math.exp(1.5 / 7 * Math.log(Math.tan(Math.PI * 85 / 180)))) * 180 / Math.PI - 90;
  assert.deepEqual(rows, Array.from({ length: 8 }, (_, k) => (80 * k / 7 < edge ? '1' : '0')));
  assert(rows[2] === '1', 'further up than in rows of Mercator');
});

test('a shore where heights lie below 0 m, round lengths, and farther off on narrow screens', () => {
  assert.equal(defaultRampKind([-1, 300]), 'shore');
  assert.equal(defaultRampKind([-6000, -20]), 'shore');
  assert.equal(defaultRampKind([0, 300]), 'fitted');
  assert.equal(defaultRampKind(undefined), 'fixed');
  assert.deepEqual([0.019, 0.2, 1, 4.9, 99, 500000].map(roundDown).map((x) => Number(x.toPrecision(6))),
                   [0.01, 0.2, 1, 2, 50, 500000]);
  const box = [4, 44, 10, 45];
  assert(rangeOverExtent(box, -40, 9 / 16) > 1.3 * rangeOverExtent(box, -40, 16 / 9));
});

// Red, green, blue of the screenshot at places in CSS pixels.
async function coloursAt(page, png, places) {
  return page.evaluate(async ([base64, points]) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
    const brush = new OffscreenCanvas(image.width, image.height).getContext('2d');
    brush.drawImage(image, 0, 0);
    return points.map(([x, y]) => [...brush.getImageData(Math.round(x), Math.round(y), 1, 1).data].slice(0, 3));
  }, [png.toString('base64'), places]);
}

// Where places at a height stand in the picture, in CSS pixels; null behind the camera.
const inPicture = (page, places) => page.evaluate((points) => points.map(([lon, lat, height]) => {
  const at = Cesium.SceneTransforms.worldToWindowCoordinates(
      window.qmpipe.viewer.scene, Cesium.Cartesian3.fromDegrees(lon, lat, height));
  return at ? [at.x, at.y] : null;
}), places);

// Pairs of panels that cover each other, and panels that reach out of the window.
const crowded = (page) => page.evaluate(() => {
  const boxes = [...document.querySelectorAll('.box, #globe .cesium-widget-credits')]
      .map((box) => [box.id || box.className, box.getBoundingClientRect()])
      .filter(([, box]) => box.width > 0 && box.height > 0);
  const wrong = [];
  boxes.forEach(([name, a], k) => {
    if (a.left < 0 || a.top < 0 || a.right > innerWidth || a.bottom > innerHeight) wrong.push(name);
    for (const [other, b] of boxes.slice(k + 1)) {
      if (a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom) {
        wrong.push(`${name} and ${other}`);
      }
    }
  });
  return wrong;
});

const isGrey = ([r, g, b]) => Math.max(r, g, b) - Math.min(r, g, b) < 14;
const isOutline = ([r, g, b]) => r > g + 30 && g > b + 30;

async function expectPainted(page, png) {
  const middle = (south + north) / 2;
  const [sea, land, beyond] = await inPicture(page, [[178, middle, -2000], [185, middle, 700], [173, middle, 0]]);
  const [blue, ground, grey] = await coloursAt(page, png, [sea, land, beyond]);
  assert(blue[2] > blue[0] + 30 && blue[2] > blue[1], `the sea is blue: ${blue}`);
  assert(ground[0] >= ground[2] && !isGrey(ground), `the land is not: ${ground}`);
  assert(isGrey(grey) && grey[0] > 15, `no colours beyond the data: ${grey}`);
  // Across each side, some pixel is of the outline, at whatever height the ground there has come to.
  for (const side of [west, east]) {
    const places = await inPicture(page, [-2000, -1000, 0, 600, 1200].map((up) => [side, middle, up]));
    const across = places.flatMap(([x, y]) => Array.from({ length: 61 }, (_, k) => [x - 30 + k, y]));
    const colours = await coloursAt(page, png, across);
    assert(colours.some(isOutline), `an outline at ${side} degrees: ${colours.join(' | ')}`);
  }
}

test('the first view on a telephone of a set across the antimeridian', patience, async () => {
  await withServer(set, async (address) => {
    const { page, wrong, seen } = await openPage(browser, { width: 360, height: 640 });
    await page.addInitScript(() => {
      window.saidLoading = false;
      addEventListener('DOMContentLoaded', () => new MutationObserver(() => {
        const sign = document.getElementById('loading');
        if (sign?.checkVisibility() && /loading \d+ tile/.test(sign.textContent)) window.saidLoading = true;
      }).observe(document.body, { subtree: true, childList: true, attributes: true }));
    });
    await page.goto(address);
    await waitForTiles(page);
    const png = await page.screenshot({ path: join(work, 'telephone.png') });

    const corners = await inPicture(page, [[west, south, 0], [east, south, 0], [east, north, 0], [west, north, 0]]);
    for (const at of corners) {
      assert(at && at[0] > 0 && at[0] < 360 && at[1] > 0 && at[1] < 640, `all data is seen: ${corners}`);
    }
    await expectPainted(page, png);

    assert.equal(await page.inputValue('#ramp'), 'shore');
    const labels = await page.locator('#legend span').allTextContents();
    assert(labels.includes('0 m'), `the shore is in the legend: ${labels}`);
    const numbers = labels.map((text) => Number(text.replace('−', '-').replace(',', '').replace(/ m$/, '')));
    assert(numbers.every(Number.isFinite), `all in metres: ${labels}`);
    assert(Math.min(...numbers) <= -1900 && Math.max(...numbers) >= 1000, `from lowest to highest: ${labels}`);
    assert.match(await page.textContent('#scale'), /^[125]0* (cm|m|km)$/);

    const attribution = page.locator('#attribution');
    assert(await attribution.isVisible());
    assert.equal(await attribution.textContent(), 'Made by Example 2026');
    assert.equal(await attribution.locator('a').getAttribute('href'), 'https://example.org/');
    assert.equal(await page.locator('img').count(), 0, 'no logo');
    assert.deepEqual([...seen.keys()].filter((url) => /ion-credit|stolen/.test(url)), []);

    assert(await page.evaluate(() => window.saidLoading), 'a sign while tiles are loaded');
    assert(!await page.isVisible('#loading'), 'and none after');
    assert.deepEqual(await crowded(page), []);
    await page.click('#display summary');
    assert(await page.isVisible('#wireframe'));
    assert.deepEqual(await crowded(page), [], 'with the switches open');

    const home = await page.evaluate(() => ({ ...window.qmpipe.viewer.camera.positionWC }));
    const away = await page.evaluate(() => {
      const { camera } = window.qmpipe.viewer;
      camera.setView({ destination: Cesium.Cartesian3.fromDegrees(20, 40, 1e6) });
      return { ...camera.positionWC };
    });
    const apart = (a, b) => Math.hypot(a.x - b.x, a.y - b.y, a.z - b.z);
    assert(apart(away, home) > 1e6);
    await page.click('#home');
    const back = await page.evaluate(() => ({ ...window.qmpipe.viewer.camera.positionWC }));
    assert(apart(back, home) < 1, 'the home button leads back');
    assert.deepEqual(wrong, []);
    await page.close();
  });
});

for (const mercator of [false, true]) {
  test(`holes and corners without data are grey, ${mercator ? 'mercator' : 'geodetic'}`, patience, async () => {
    const file = join(work, 'holed.asc');
    const inData = (i, j) => i + j > 40 && Math.hypot(i - 70, j - 50) > 20;
    const lines = ['ncols 120', 'nrows 100', `xllcorner ${west}`, 'yllcorner 40', 'cellsize 0.1', 'NODATA_value -9999'];
    for (let j = 0; j < 100; ++j) {
      lines.push(Array.from({ length: 120 }, (_, i) => (inData(i, j) ? 300 + i + j : -9999)).join(' '));
    }
    writeFileSync(file, lines.join('\n') + '\n');
    const holed = join(work, 'holed');
    qmpipe('build', file, '-o', holed, '--source-crs', 'EPSG:4326', '--overwrite', '--scheme', mercator ? 'mercator' : 'geodetic');
    await withServer(holed, async (address) => {
      const { page, wrong } = await openPage(browser, { width: 640, height: 480 });
      await page.goto(`${address}?pitch=-90&bare=1`);
      await waitForTiles(page);
      const png = await page.screenshot({ path: join(work, 'holed.png') });
      // Cells at least three from where the data end; each with what is expected there.
      const cells = [];
      for (let j = 4; j < 96; j += 7) {
        for (let i = 4; i < 116; i += 7) {
          const near = [[0, 0], [3, 0], [-3, 0], [0, 3], [0, -3]].map(([di, dj]) => inData(i + di, j + dj));
          if (near.every((flag) => flag === near[0])) cells.push([i, j, near[0]]);
        }
      }
      const places = await inPicture(page, cells.map(([i, j]) => [west + (i + 0.5) * 0.1, 50 - (j + 0.5) * 0.1, 300]));
      const colours = await coloursAt(page, png, places);
      const without = colours.filter((colour, k) => !cells[k][2]);
      assert(without.length > 15 && without.length < colours.length / 2);
      const isBeyond = (colour) => isGrey(colour) && colour[0] < 110;
      const faults = cells.filter(([, , isData], k) => isBeyond(colours[k]) === isData);
      assert.deepEqual(faults, [], 'grey where there are no data, and only there');
      assert.deepEqual(wrong, []);
      await page.close();
    });
  });
}

test('skirts between tiles are painted like the ground that they hang from', patience, async () => {
  await withServer(set, async (address) => {
    const { page, wrong } = await openPage(browser, { width: 320, height: 240 });
    await page.goto(address);
    await waitForTiles(page);
    const skirts = await page.evaluate(() => {
      let vertices = 0;
      let lower = 0;
      for (const tile of window.qmpipe.viewer.scene.globe._surface._tilesToRender) {
        const mesh = tile.data.mesh;
        if (!mesh) continue;
        let skirt = mesh.vertexCountWithoutSkirts;
        for (const side of [mesh.westIndicesSouthToNorth, mesh.southIndicesEastToWest,
                            mesh.eastIndicesNorthToSouth, mesh.northIndicesWestToEast]) {
          for (const index of side) {
            const height = (k) => mesh.encoding.decodeHeight(mesh.vertices, k);
            lower += Math.abs(height(skirt) - height(index)) > 1e-3;
            ++skirt;
            ++vertices;
          }
        }
      }
      return { vertices, lower };
    });
    assert(skirts.vertices > 20, JSON.stringify(skirts));
    assert.equal(skirts.lower, 0, JSON.stringify(skirts));
    assert.deepEqual(wrong, []);
    await page.close();
  });
});
