#!/usr/bin/env bash
# The main job from nothing: installs what is missing, builds qmpipe, makes up a DEM, turns it into
# a pyramid, verifies it, and says how to look at it.
#   tools/demo.sh [FOLDER]      default: demo
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-demo}

tools/setup.sh
cmake --preset release >/dev/null
cmake --build --preset release --target qmpipe
qmpipe=build/release/tools/qmpipe

mkdir -p "$out"
"$qmpipe" synth -o "$out/dem.tif" --size 2400x1800 --bounds 6,43.5,8,45 --seed 3 --overwrite
# Plain tiles, so that any static server will do without a Content-Encoding header.
"$qmpipe" build "$out/dem.tif" -o "$out/tiles" --gzip none --overwrite \
  --name "qmpipe demo" --attribution "Made-up terrain by qmpipe synth"
"$qmpipe" verify "$out/tiles" --source "$out/dem.tif"
cp tools/viewer.html "$out/index.html"

cat <<TEXT

The tile set is in $out/tiles. To look at it:
  python3 -m http.server 8080 --bind 127.0.0.1 --directory $out
and open http://127.0.0.1:8080/ in a browser (the page loads CesiumJS from its public site).
To look at one tile in a mesh viewer:
  $qmpipe info \$(find $out/tiles -name '*.terrain' -size +4k | sort | tail -n 1) --mesh tile.glb
TEXT
