// The page of detail-increment models in a headless Chromium, through `qmpipe serve`.
//
//   QMPIPE_PROGRAM=.../qmpipe QMPIPE_WORK=FOLDER node detail_viewer_test.mjs
//
// Screenshots stay in QMPIPE_WORK.

import assert from 'node:assert/strict';
import { copyFileSync, mkdirSync, rmSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { launch, lookAt, openPage, qmpipe, withServer } from './browser.mjs';

const work = process.env.QMPIPE_WORK;
assert(work, 'QMPIPE_WORK names the folder for models and screenshots');
const patience = { timeout: 300000 };
const size = 300;
const model = join(work, 'model.h5');
const pages = fileURLToPath(new URL('../../tools/viewer/', import.meta.url));

let browser;

before(async () => {
  rmSync(work, { recursive: true, force: true });
  mkdirSync(work, { recursive: true });
  const dem = join(work, 'dem.tif');
  qmpipe('synth', '-o', dem, '--size', `${size}x${size}`, '--bounds', '6,43.5,6.2,43.65', '--seed', '3');
  qmpipe('detail', 'build', dem, '-o', model, '--blocks', '16', '--keep', '2%');
  browser = await launch();
}, patience);

after(async () => browser?.close());

// Until no block moves and the picture is drawn, for some frames; what is drawn then.
async function settle(page) {
  await page.waitForFunction(() => {
    const viewer = window.qmpipe;
    if (!viewer) return false;
    viewer.restingFrames = viewer.idle ? (viewer.restingFrames ?? 0) + 1 : 0;
    return viewer.restingFrames > 5;
  }, null, { timeout: 120000 });
  return page.evaluate(() => {
    const viewer = window.qmpipe;
    viewer.restingFrames = 0;
    return { triangles: viewer.triangles, levels: viewer.loaded.map(({ walk }) => walk.level),
             targets: viewer.loaded.map(({ target }) => target),
             text: document.getElementById('state').textContent };
  });
}

async function look(page, from) {
  await page.evaluate((where) => window.qmpipe.look(where), from);
  return settle(page);
}

const slide = (page, id, value) => page.locator(`#${id}`).fill(`${value}`);

// How many edges of the whole, seams among it, have one triangle; fails where one has more than two
// or two on one side.
const openEdges = (page) => page.evaluate(() => {
  const { loaded, seams } = window.qmpipe;
  const edges = new Set();
  const add = (corners) => corners.forEach((from, k) => {
    const edge = `${from} ${corners[(k + 1) % 3]}`;
    if (edges.has(edge)) throw new Error(`the edge ${edge} has two triangles on one side`);
    edges.add(edge);
  });
  loaded.forEach(({ walk }, b) => {
    for (let t = 0; t < walk.triangles; ++t) {
      add([0, 1, 2].map((k) => `${b}:${walk.vertices[3 * t + k]}`));
    }
  });
  for (let t = 0; t < seams.points.length; t += 3) {
    add([0, 1, 2].map((k) => `${seams.blocks[t + k]}:${seams.points[t + k]}`));
  }
  return [...edges].filter((edge) => !edges.has(edge.split(' ').reverse().join(' '))).length;
});

test('triangles come and go with the distance, and no block tears off another', patience, async () => {
  await withServer(model, async (address, said) => {
    const { page, wrong, seen } = await openPage(browser);
    await page.goto(`${address}?pixels=1`);
    await settle(page);
    const rim = 4 * (size - 1);
    const counts = [];
    for (const range of [60000, 20000, 6000, 1500, 6000, 20000, 60000]) {
      const state = await look(page, { heading: 15, pitch: -40, range });
      assert.deepEqual(state.levels, state.targets);
      assert(state.text.includes(state.triangles.toLocaleString('en')), state.text);
      assert.equal(await openEdges(page), rim, `from ${range} m`);
      counts.push(state.triangles);
      if (range === 1500) {
        const picture = await lookAt(page, await page.screenshot({ path: join(work, 'near.png') }));
        assert(picture.spread > 15 && picture.colours > 60, JSON.stringify(picture));
      }
    }
    for (let k = 1; k < 4; ++k) assert(counts[k] > counts[k - 1], `${counts}`);
    assert.deepEqual(counts.slice(4), counts.slice(0, 3).reverse(), 'the same way back');
    assert.equal(said.coarsest_triangles <= counts[0] && counts[3] <= said.finest_triangles, true);
    // Each block has its own distance.
    const state = await look(page, { heading: 45, pitch: -20, range: 2500,
                                     at: [1000, 1000, 1000] });
    assert(new Set(state.levels).size > 1, `${state.levels}`);
    assert.equal(await openEdges(page), rim);
    // A look around, so that there are frames to judge however few of them the walks took.
    for (const heading of [135, 225, 315]) await look(page, { heading, pitch: -20, range: 2500 });
    const frames = await page.evaluate(() => window.qmpipe.frames);
    assert(frames.length > 10);
    const sorted = frames.map(({ work_ms: ms }) => ms).sort((a, b) => a - b);
    console.log(`triangles ${counts.join(' ')}; ${frames.length} frames, work of the page median ` +
                `${sorted[sorted.length >> 1].toFixed(1)} ms, most ${sorted.at(-1).toFixed(1)} ms; ` +
                `most splits in a frame ${Math.max(...frames.map(({ splits }) => splits))}`);
    assert(sorted[0] > 0 && frames.every(({ ms, splits }) => ms >= 0 && splits >= 0));
    assert.deepEqual(wrong, []);
    const foreign = [...seen.keys()].filter((url) => !url.startsWith(address) && /^http/.test(url));
    assert.deepEqual(foreign, [], 'nothing comes from elsewhere');
    await page.close();
  });
});

test('the sliders change the detail, the wireframe switch the picture', patience, async () => {
  await withServer(model, async (address, said) => {
    const { page, wrong } = await openPage(browser);
    await page.goto(`${address}?range=15000`);
    const counts = [];
    for (const power of [4, 1, -2]) {
      await slide(page, 'pixels', power);
      counts.push((await settle(page)).triangles);
    }
    assert(counts[0] < counts[1] && counts[1] < counts[2], `pixels: ${counts}`);
    await page.selectOption('#rule', 'fixed');
    for (const [place, triangles] of [[1, said.coarsest_triangles], [0, said.finest_triangles]]) {
      await slide(page, 'svo', place);
      const state = await settle(page);
      // The threshold is the last block's to get there; logarithms round.
      assert(Math.abs(state.triangles / triangles - 1) < 0.02, `${state.triangles} of ${triangles}`);
    }
    await slide(page, 'svo', 0.6);
    const fixed = await settle(page);
    const moved = await look(page, { heading: 90, pitch: -60, range: 5000 });
    assert.deepEqual(moved.levels, fixed.levels, 'a fixed threshold knows no distance');
    const whole = await lookAt(page, await page.screenshot());
    await page.check('#wireframe');
    await settle(page);
    const lines = await lookAt(page, await page.screenshot({ path: join(work, 'wireframe.png') }));
    assert(lines.mean < whole.mean - 15, 'lines on the dark are darker than the whole surface');
    assert(lines.spread > 15, 'there are lines');
    // The lines follow the levels too.
    await slide(page, 'svo', 0);
    await settle(page);
    const more = await lookAt(page, await page.screenshot());
    assert(more.mean > lines.mean + 10, `${more.mean} against ${lines.mean}`);
    await page.uncheck('#wireframe');
    await settle(page);
    const again = await lookAt(page, await page.screenshot());
    assert(again.mean > lines.mean + 15, `${again.mean} against ${lines.mean}`);
    assert.deepEqual(wrong, []);
    await page.close();
  });
});

test('blocks are decoded beside the page, and the decoder ends with them', patience, async () => {
  await withServer(model, async (address) => {
    const { page, wrong } = await openPage(browser);
    const workers = [];
    page.on('worker', (worker) => workers.push(worker.url()));
    await page.goto(address);
    await settle(page);
    assert.deepEqual(workers, [new URL('detail_decoder.js', address).href]);
    assert.deepEqual(page.workers(), []);
    assert.deepEqual(wrong, []);
    await page.close();
  });
});

test('a damaged part is told in words', patience, async () => {
  await withServer(model, async (address) => {
    const { page, wrong } = await openPage(browser);
    await page.route('**/block/3.bin', async (route) => {
      const response = await route.fetch();
      await route.fulfill({ response, body: (await response.body()).subarray(0, -1) });
    });
    await page.goto(address);
    await page.waitForSelector('text=the model is damaged: a part is too short');
    assert.deepEqual(wrong, []);
    await page.close();
  });
});

test('a browser without WebGL is told so in words', patience, async () => {
  const blind = await launch('--disable-3d-apis');
  try {
    await withServer(model, async (address) => {
      const { page, wrong } = await openPage(blind);
      await page.goto(address);
      await page.waitForSelector('text=no WebGL 2', { timeout: 60000 });
      assert.deepEqual(wrong, []);
    });
  } finally {
    await blind.close();
  }
});

test('a server without three.js says how to get it', patience, async () => {
  const bare = join(work, 'pages');
  mkdirSync(bare, { recursive: true });
  for (const name of ['index.html', 'detail.html', 'detail.js', 'detail_scene.js',
                      'detail_walk.js', 'detail_decoder.js']) {
    copyFileSync(join(pages, name), join(bare, name));
  }
  process.env.QMPIPE_VIEWER = bare;
  try {
    await withServer(model, async (address) => {
      const { page } = await openPage(browser);
      await page.goto(address);
      await page.waitForSelector('text=tools/setup.sh', { timeout: 60000 });
      await page.close();
    });
  } finally {
    delete process.env.QMPIPE_VIEWER;
  }
});
