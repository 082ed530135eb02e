#!/usr/bin/env bash
# The main job from nothing: installs what is missing, builds qmpipe, makes up a DEM, turns it into
# a pyramid, verifies it, and says how to look at it.
#   tools/demo.sh [FOLDER]      default: demo
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-demo}

tools/setup.sh
cmake --preset release >/dev/null
cmake --build --preset release --target qmpipe manual
qmpipe=build/release/tools/qmpipe

mkdir -p "$out"
"$qmpipe" synth -o "$out/dem.tif" --size 2400x1800 --bounds 6,43.5,8,45 --seed 3 --overwrite
"$qmpipe" build "$out/dem.tif" -o "$out/tiles" --overwrite \
  --name "qmpipe demo" --attribution "Made-up terrain by qmpipe synth"
"$qmpipe" verify "$out/tiles" --source "$out/dem.tif"

cat <<TEXT

The tile set is in $out/tiles. To look at it:
  $qmpipe serve $out/tiles
and open http://127.0.0.1:8080/ in a browser (nothing is loaded from the internet).
To have it as one file, or to look at one tile in a mesh viewer:
  $qmpipe pack $out/tiles -o $out/tiles.mbtiles
  $qmpipe info \$(find $out/tiles -name '*.terrain' -size +4k | sort | tail -n 1) --mesh tile.glb
TEXT
