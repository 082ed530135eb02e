// Where on the globe a tile set has data, and from where all of it is seen.

const wholeTurn = 360;

// Where a set by qmpipe has data and where holes and corners are without: posts in rows from the south and columns
// from the west, 1 where the data have a height. Rows are evenly spaced in degrees here. Null: it does not say.
export function coverOf(layer) {
  const data = layer.qmpipe?.data;
  if (!isCover(data)) return null;
  const rows = data.rows.flatMap((text) => {
    const [times, turns] = text.split(':');
    const row = new Uint8Array(data.columns);
    let at = 0;
    turns.trim().split(' ').forEach((count, turn) => {
      row.fill(turn % 2, at, at + Number(count));
      at += Number(count);
    });
    return Array(Number(times)).fill(row);
  });
  const { posts_deg: postsDeg, columns } = data;
  if (layer.projection !== 'EPSG:3857' || rows.length < 2) return { postsDeg, columns, rows };
  const [south, north] = [mercator(postsDeg[1]), mercator(postsDeg[3])];
  const even = rows.map((_, k) => {
    const latitude = postsDeg[1] + (postsDeg[3] - postsDeg[1]) * k / (rows.length - 1);
    const row = (mercator(latitude) - south) / (north - south) * (rows.length - 1);
    return rows[Math.max(0, Math.min(Math.round(row), rows.length - 1))];
  });
  return { postsDeg, columns, rows: even };
}

// Whoever made the set: what is no picture of sensible size is none.
function isCover(data) {
  const isCount = (count) => Number.isInteger(count) && count > 0 && count <= 4096;
  return Array.isArray(data?.rows) && data.rows.every((text) => /^\d+:( \d+)* ?$/.test(text)) &&
      isCount(data.rows.reduce((sum, text) => sum + parseInt(text, 10), 0)) && isCount(data.columns) &&
      Array.isArray(data.posts_deg) && data.posts_deg.length === 4 && data.posts_deg.every(Number.isFinite);
}

function mercator(latitude) {
  return Math.log(Math.tan(Math.PI * (latitude + 90) / 360));
}

function latitudeOfMercatorRow(row, rows) {
  const angle = Math.PI * (2 * row / rows - 1);
  return 2 * Math.atan(Math.exp(angle)) * 180 / Math.PI - 90;
}

// The box around ranges of tiles of one zoom, in degrees. East of a box across the antimeridian is
// more than 180: the box leaves out the widest run of columns without a tile, wherever it is.
export function boundsOfRanges(ranges, zoom, isMercator) {
  const rows = 2 ** zoom;
  const columns = isMercator ? rows : 2 * rows;
  const runs = ranges.map((range) => [range.startX, range.endX + 1]).sort((a, b) => a[0] - b[0]);
  let reached = runs[0][1];
  let widest = { size: 0, from: columns, to: columns };
  for (const [start, end] of [...runs.slice(1), [runs[0][0] + columns, 0]]) {
    if (start - reached > widest.size) widest = { size: start - reached, from: reached, to: start };
    reached = Math.max(reached, end);
  }
  const west = widest.size > 0 ? widest.to % columns : 0;
  const east = west + columns - widest.size;
  const latitude = (row) =>
      (isMercator ? latitudeOfMercatorRow(row, rows) : row / rows * 180 - 90);
  const longitude = (column) => column / columns * wholeTurn - 180;
  return [longitude(west), latitude(Math.min(...ranges.map((range) => range.startY))),
          longitude(east), latitude(Math.max(...ranges.map((range) => range.endY)) + 1)];
}

// West, south, east, north in degrees; east is more than 180 across the antimeridian. layer.json's
// bounds cannot say that: there they go round the whole globe. Where the data are tells more, or the tiles of the
// deepest zoom that has any.
export function extentOf(layer, boundsOfTilesDeg) {
  const bounds = layer.bounds || boundsOfTilesDeg || [-180, -90, 180, 90];
  const [west, south, east, north] = bounds.map(Number);
  if (east < west) return [west, south, east + wholeTurn, north];
  const data = layer.qmpipe?.data;
  if (isCover(data) && east - west > wholeTurn - 1e-6) {
    const half = data.columns > 1 ? (data.posts_deg[2] - data.posts_deg[0]) / (data.columns - 1) / 2 : 0;
    const [first, last] = [data.posts_deg[0] - half, data.posts_deg[2] + half];
    return last - first < wholeTurn - 1e-6 ? [first, south, last, north] : [west, south, east, north];
  }
  const available = layer.available || [];
  const zoom = available.findLastIndex((ranges) => ranges.length > 0);
  if (east - west < wholeTurn - 1e-6 || zoom < 0) return [west, south, east, north];
  const tiles = boundsOfRanges(available[zoom], zoom, layer.projection === 'EPSG:3857');
  return [tiles[0], Math.max(south, tiles[1]), tiles[2], Math.min(north, tiles[3])];
}

// Where the camera stands, in metres from the middle of the extent, for all of it to be in a picture
// of that shape. CesiumJS opens 60 degrees along the longer side.
export function rangeOverExtent([west, south, east, north], pitchDeg, widthByHeight) {
  const metresADegree = 111320;
  const radians = Math.PI / 180;
  const middle = Math.max(-80, Math.min((south + north) / 2, 80));
  const wide = Math.min(east - west, 180) * metresADegree * Math.cos(middle * radians);
  const high = (north - south) * metresADegree * Math.sin(Math.abs(pitchDeg) * radians);
  const slope = Math.tan(30 * radians);
  const across = 2 * slope * Math.min(1, widthByHeight);
  const upwards = 2 * slope * Math.min(1, 1 / widthByHeight);
  return Math.min(1.6 * Math.max(wide / across, high / upwards), 2.2e7);
}
