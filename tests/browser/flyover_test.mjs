// Is terrain drawn wherever a camera looks down on it? CesiumJS flies over a set of the whole world and
// over sets whose data lies in one root only, low enough that the roots' headers decide.
//
//   QMPIPE_PROGRAM=.../qmpipe QMPIPE_WORK=FOLDER node flyover_test.mjs
//
// Screenshots of what failed stay in QMPIPE_WORK.

import assert from 'node:assert/strict';
import { mkdirSync, rmSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { launch, openPage, qmpipe, waitForTiles, withServer } from './browser.mjs';

const work = process.env.QMPIPE_WORK;
assert(work, 'QMPIPE_WORK names the folder for sets and screenshots');
const patience = { timeout: 600000 };
let browser;

before(async () => {
  rmSync(work, { recursive: true, force: true });
  mkdirSync(work, { recursive: true });
  browser = await launch();
}, patience);

after(async () => browser?.close());

function buildSet(name, bounds, size, maxZoom) {
  const dem = join(work, `${name}.tif`);
  const set = join(work, name);
  qmpipe('synth', '-o', dem, '--size', size, '--bounds', bounds, '--seed', '7');
  qmpipe('build', dem, '-o', set, '--max-zoom', `${maxZoom}`);
  return set;
}

// Moves the camera there and tells what stands under the middle of the picture: the tile that is drawn,
// if any, and how many are.
async function lookDown(page, [longitude, latitude, height]) {
  await page.evaluate(([lon, lat, up]) => {
    window.qmpipe.viewer.camera.setView({ destination: Cesium.Cartesian3.fromDegrees(lon, lat, up) });
  }, [longitude, latitude, height]);
  await waitForTiles(page);
  return page.evaluate(([lon, lat]) => {
    const below = Cesium.Cartographic.fromDegrees(lon, lat);
    const tiles = window.qmpipe.viewer.scene.globe._surface._tilesToRender;
    const tile = tiles.find((one) => Cesium.Rectangle.contains(one.rectangle, below));
    return { drawn: tiles.length, level: tile?.level ?? -1 };
  }, [longitude, latitude]);
}

// Each place: longitude, latitude, metres up, and the level that is drawn there at least.
async function flyOver(set, places) {
  await withServer(set, async (address) => {
    const { page, wrong } = await openPage(browser, { width: 320, height: 240 });
    await page.goto(address);
    await waitForTiles(page);
    for (const place of places) {
      const seen = await lookDown(page, place);
      const least = place[3];
      if (seen.level < least) await page.screenshot({ path: join(work, 'bare.png') });
      assert(seen.level >= least,
             `at ${place.join(', ')}: ${JSON.stringify(seen)}, wanted level ${least} or deeper`);
    }
    assert.deepEqual(wrong, []);
    await page.close();
  });
}

test('twelve places of the whole world', patience, async () => {
  const set = buildSet('world', '-180,-90,180,90', '720x360', 3);
  const places = [];
  for (const latitude of [-60, 5, 50]) {
    for (const longitude of [-179.5, -95, -3, 100]) places.push([longitude, latitude, 20000, 3]);
  }
  await flyOver(set, places);
});

// From close above their middle, and from space.
for (const [name, west, south] of [['catalonia', 1, 41], ['alaska', -152, 62], ['west-of-fiji', 177, -18]]) {
  test(`data in one root only: ${name}`, patience, async () => {
    const bounds = [west, south, west + 1, south + 1];
    const set = buildSet(name, bounds.join(','), '300x300', 8);
    const [longitude, latitude] = [west + 0.5, south + 0.5];
    await flyOver(set, [[longitude, latitude, 20000, 6], [longitude, latitude, 2e6, 2]]);
  });
}
