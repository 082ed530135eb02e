# What a viewer will meet on a web server, in words. docs/SERVING.md has the lines for nginx, Apache, Caddy and S3; here
# qmpipe is the server.
qmpipe synth -o dem.tif --size 300x200 --bounds 6.8,43.6,7.1,43.8 --seed 7
qmpipe build dem.tif -o tiles

qmpipe serve tiles --port 0 >said &
server=$!
trap 'kill "$server"' EXIT
until address=$(grep -o -m 1 'http://127.0.0.1:[0-9]*/tiles' said); do sleep 0.1; done
qmpipe check "$address"
