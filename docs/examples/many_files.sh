# A DEM in many files on one grid has the tiles of the DEM in one file: no seam shows where they meet.
qmpipe synth -o whole.tif --size 800x400 --bounds 6.8,43.6,7.6,44 --seed 7
gdal_translate -q -srcwin 0 0 300 400 whole.tif west.tif
gdal_translate -q -srcwin 300 0 500 250 whole.tif north.tif
gdal_translate -q -srcwin 300 250 500 150 whole.tif south.tif

qmpipe build whole.tif -o from_one --name whole
qmpipe build west.tif north.tif south.tif -o from_three --name whole   # says that they lie on one grid
qmpipe diff from_one from_three
