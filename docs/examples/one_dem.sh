# One DEM to a folder of tiles, checked against the DEM, and packed into one file.
qmpipe synth -o dem.tif --size 600x400 --bounds 6.8,43.6,7.3,43.9 --seed 7

qmpipe build dem.tif -o tiles --dry-run            # what it will cost; nothing is written
qmpipe build dem.tif -o tiles --name "Made-up Alps" --attribution "qmpipe synth"
qmpipe verify tiles --source dem.tif               # every tile, and its error; ends with 3 where it finds faults

qmpipe convert tiles -o tiles.pmtiles
qmpipe diff tiles tiles.pmtiles                    # the same tiles
qmpipe info tiles.pmtiles
