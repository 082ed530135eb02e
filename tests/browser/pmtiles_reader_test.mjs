// The archive as the reference reader (npm package `pmtiles`) sees it, against the folder that it
// was packed from: every tile is there with the folder's bytes, layer.json too, and no tile more.
//
// usage: node pmtiles_reader_test.mjs ARCHIVE.pmtiles FOLDER
import assert from "node:assert/strict";
import fs from "node:fs";
import path from "node:path";
import zlib from "node:zlib";
import { PMTiles, TileType } from "pmtiles";

// Answers ranges of bytes, as a server does.
class FileSource {
  constructor(name) {
    this.name = name;
    this.file = fs.openSync(name);
  }
  getKey() {
    return this.name;
  }
  async getBytes(offset, length) {
    const buffer = new ArrayBuffer(length);
    const count = fs.readSync(this.file, new Uint8Array(buffer), 0, length, offset);
    return { data: buffer.slice(0, count) };
  }
}

// [zoom, x, y], y from the south.
function keysOf(folder) {
  return fs
    .readdirSync(folder, { recursive: true })
    .map((name) => name.split(path.sep).join("/").match(/^(\d+)\/(\d+)\/(\d+)\.terrain$/))
    .filter(Boolean)
    .map((match) => match.slice(1).map(Number));
}

// As the reader hands out tiles: unpacked. Two bytes alone do not tell: a plain tile begins with a
// coordinate.
function plain(bytes) {
  const isGzip = bytes[0] === 0x1f && bytes[1] === 0x8b && bytes[2] === 8 && bytes[3] < 0x20;
  return isGzip ? zlib.gunzipSync(bytes) : bytes;
}

const [archiveName, folder] = process.argv.slice(2);
const archive = new PMTiles(new FileSource(archiveName));
const header = await archive.getHeader();
const metadata = await archive.getMetadata();
const layerText = fs.readFileSync(path.join(folder, "layer.json"), "utf8");
const layer = JSON.parse(layerText);
const isGeodetic = (layer.projection ?? "EPSG:4326") === "EPSG:4326";
const down = isGeodetic ? 1 : 0;

assert.equal(metadata["layer.json"], layerText);
assert.equal(metadata.tiling, isGeodetic ? "geodetic-z+1" : "mercator");
assert.equal(metadata.name, layer.name ?? "");
assert.equal(header.specVersion, 3);
assert.equal(header.tileType, TileType.Unknown);
assert.equal(header.clustered, true);
assert.ok(header.rootDirectoryOffset + header.rootDirectoryLength < 16384);

const keys = keysOf(folder);
assert.ok(keys.length > 0);
const zooms = keys.map(([zoom]) => zoom);
assert.equal(header.minZoom, zooms.reduce((a, b) => Math.min(a, b)) + down);
assert.equal(header.maxZoom, zooms.reduce((a, b) => Math.max(a, b)) + down);
assert.equal(header.numAddressedTiles, keys.length);

for (const [zoom, x, y] of keys) {
  const tile = await archive.getZxy(zoom + down, x, 2 ** zoom - 1 - y);
  assert.ok(tile, `tile ${zoom}/${x}/${y} is not found`);
  const stored = fs.readFileSync(path.join(folder, `${zoom}/${x}/${y}.terrain`));
  assert.ok(plain(stored).equals(Buffer.from(tile.data)), `tile ${zoom}/${x}/${y} has other bytes`);
}
// No tile of the lower half, which no geodetic tile stands at.
if (isGeodetic) assert.equal(await archive.getZxy(1, 0, 1), undefined);
console.log(`${keys.length} tiles, ${header.numTileContents} different, leaves of ` +
            `${header.leafDirectoryLength ?? 0} bytes: all as in ${path.basename(folder)}`);
