# Points as text to one terrain at every scale, without tiles: what half a metre and ten metres of error leave of it.
qmpipe synth -o ground.tif --size 120x90 --bounds 6.8,43.6,6.82,43.615 --seed 5
gdalwarp -q -t_srs EPSG:32632 -r bilinear -dstnodata -9999 ground.tif metres.tif
gdal_translate -q -of XYZ metres.tif all.xyz
awk '$3 > -9999' all.xyz > ground.xyz

qmpipe detail build ground.xyz -o ground.h5
qmpipe detail verify ground.h5
qmpipe detail extract ground.h5 --svo 0.5 -o half_metre.ply
qmpipe detail extract ground.h5 --svo 10 -o ten_metres.ply
test "$(stat -c %s ten_metres.ply)" -lt "$(stat -c %s half_metre.ply)"
