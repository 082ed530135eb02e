# Depths that are positive downwards, without a word in the file that says so; no coarse zoom shows a place deeper than
# it was sounded.
qmpipe synth -o land.tif --size 400x300 --bounds 7.2,43.3,7.6,43.6 --seed 3
gdal_translate -q -scale 0 1000 1 1001 land.tif depths.tif

qmpipe build depths.tif -o sea --z-scale -1 --reduce max --tolerance 4000
qmpipe verify sea --source depths.tif --z-scale -1
