// A headless Chromium, a `qmpipe serve`, and what a page may not do: shared by the browser tests.

import { existsSync } from 'node:fs';

export { program, qmpipe, run, withServer } from './server.mjs';

const chromiumPath = '/usr/bin/chromium';
// Drawing in software on a busy machine takes its time; what is wrong shows long before.
const patience = 180000;
const skipped = 77;  // what ctest takes for a test that was left out
const chromium = await import('playwright-core').then((module) => module.chromium).catch(() => null);
if (!chromium || !existsSync(chromiumPath)) {
  console.log('skipped: there is no playwright-core or no Chromium; run tools/setup.sh --dev');
  process.exit(skipped);
}
const chromiumFlags = [
  '--headless', '--no-sandbox', '--disable-quic', '--no-first-run',
  '--disable-background-networking', '--disable-component-update', '--disable-sync',
];
// WebGL without a graphics card.
const softwareWebGl = ['--use-angle=swiftshader', '--enable-unsafe-swiftshader'];

export const launch = (...flags) => chromium.launch({
  executablePath: chromiumPath,
  args: [...chromiumFlags, ...(flags.length > 0 ? flags : softwareWebGl)],
});

// A page that collects everything that went wrong on it.
export async function openPage(browser, viewport = { width: 960, height: 640 }) {
  const page = await browser.newPage({ viewport });
  page.setDefaultTimeout(patience);
  const wrong = [];
  const seen = new Map();  // by address: status
  page.on('console', (message) => {
    if (message.type() === 'error') wrong.push(`console: ${message.text()}`);
  });
  page.on('pageerror', (error) => wrong.push(`exception: ${error}`));
  page.on('requestfailed', (request) => {
    wrong.push(`failed: ${request.url()} ${request.failure()?.errorText}`);
  });
  page.on('response', (response) => {
    seen.set(response.url(), response.status());
    if (response.status() >= 400) wrong.push(`${response.status()}: ${response.url()}`);
  });
  return { page, wrong, seen };
}

// Until every tile that the view needs is drawn, and stays so for a while.
export async function waitForTiles(page) {
  await page.waitForFunction(() => window.qmpipe !== undefined);
  await page.waitForFunction(() => {
    const globe = window.qmpipe.viewer.scene.globe;
    const drawn = globe._surface._tilesToRender.map((tile) => `${tile.level}/${tile.x}/${tile.y}`);
    const picture = drawn.sort().join(' ');
    const now = performance.now();
    const state = window.qmpipe.waiting ??= { picture: '', since: now };
    window.qmpipe.viewer.scene.requestRender();
    if (!globe.tilesLoaded || picture === '' || picture !== state.picture) {
      Object.assign(state, { picture, since: now });
    }
    return now - state.since > 1500;
  }, null, { polling: 100 });
  return page.evaluate(() => {
    delete window.qmpipe.waiting;
    const levels = window.qmpipe.viewer.scene.globe._surface._tilesToRender.map((t) => t.level);
    return { drawn: levels.length, deepest: Math.max(...levels) };
  });
}

// What a screenshot looks like: mean and spread of its brightness (0..255), and how many of 4096
// colours it has.
export async function lookAt(page, png) {
  return page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
    const canvas = new OffscreenCanvas(image.width, image.height);
    const brush = canvas.getContext('2d');
    brush.drawImage(image, 0, 0);
    const { data } = brush.getImageData(0, 0, image.width, image.height);
    let sum = 0;
    let squares = 0;
    const colours = new Set();
    for (let at = 0; at < data.length; at += 4) {
      const bright = (data[at] + data[at + 1] + data[at + 2]) / 3;
      sum += bright;
      squares += bright * bright;
      colours.add(((data[at] >> 4) << 8) | ((data[at + 1] >> 4) << 4) | (data[at + 2] >> 4));
    }
    const count = data.length / 4;
    const mean = sum / count;
    return { mean, spread: Math.sqrt(squares / count - mean * mean), colours: colours.size };
  }, png.toString('base64'));
}
