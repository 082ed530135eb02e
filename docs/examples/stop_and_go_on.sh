# A build that was stopped goes on where it was when the same command is given again, to the same bytes.
qmpipe synth -o dem.tif --size 1200x900 --bounds 6.8,43.6,7.8,44.3 --seed 7
build() { qmpipe build dem.tif -o "$1" --name hills --checkpoint 1 --tolerance 2000; }

stopped=0
timeout --signal=INT 2 qmpipe build dem.tif -o tiles --name hills --checkpoint 1 --tolerance 2000 || stopped=$?
echo "stopped: exit code $stopped"
build tiles
build tiles                                        # nothing is left to do, and it says so
build at_once
qmpipe diff tiles at_once
