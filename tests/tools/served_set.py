"""A small tile set and a web server for it, for the tests of `qmpipe check`: a sound server, whose
answers a test may change on their way out.

The set is a dict from the path within it ("layer.json", "4/16/11.terrain") to the file's bytes.
"""
import contextlib
import gzip
import http.server
import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import threading

MEDIA_TYPE = "application/vnd.quantized-mesh"


def run(program, *arguments, timeout=60):
    # Proxies are for the outside.
    environment = {**os.environ, "no_proxy": "*", "NO_PROXY": "*"}
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True,
                          timeout=timeout, stdin=subprocess.DEVNULL, env=environment)


def check(program, address, *options):
    """What ran, and its report."""
    done = run(program, "check", address, "--json", *options)
    return done, json.loads(done.stdout)


def codes(report, severity):
    return sorted({f["code"] for f in report["findings"] if f["severity"] == severity})


def build_set(program, folder, *options):
    """Makes a DEM and builds its zooms 0 to 4 into `folder`: 11 tiles, with normals."""
    with tempfile.TemporaryDirectory(prefix="qmpipe-dem-") as scratch:
        dem = pathlib.Path(scratch) / "dem.tif"
        steps = [("synth", "-o", dem, "--size", "240x180", "--bounds", "6,44,12,48.5", "--seed", 3),
                 ("build", dem, "-o", folder, "--max-zoom", 4, *options)]
        for step in steps:
            done = run(program, *step)
            assert done.returncode == 0, done.stderr


def read_set(folder):
    folder = pathlib.Path(folder)
    return {path.relative_to(folder).as_posix(): path.read_bytes()
            for path in sorted(folder.rglob("*"))
            if path.name == "layer.json" or path.suffix == ".terrain"}


def is_tile(path):
    return path.endswith(".terrain")


def with_layer(files, **changes):
    """layer.json with other values; None removes a key."""
    layer = {**json.loads(files["layer.json"]), **changes}
    layer = {key: value for key, value in layer.items() if value is not None}
    return {**files, "layer.json": json.dumps(layer).encode()}


def with_tiles(files, change):
    """change(path, plain bytes) -> plain bytes; the files stay gzipped."""
    return {path: gzip.compress(change(path, gzip.decompress(data)), mtime=0)
            if is_tile(path) else data for path, data in files.items()}


def start_of_extensions(tile):
    vertices, = struct.unpack_from("<I", tile, 88)
    width = 4 if vertices > 65536 else 2
    at = 92 + 6 * vertices
    at += -at % width
    triangles, = struct.unpack_from("<I", tile, at)
    at += 4 + 3 * width * triangles
    for _ in range(4):
        count, = struct.unpack_from("<I", tile, at)
        at += 4 + width * count
    return at


def extension(number, payload):
    return struct.pack("<BI", number, len(payload)) + payload


def metadata(available):
    text = json.dumps({"available": available}).encode() if available is not None else b""
    return extension(4, struct.pack("<I", len(text)) + text)


def with_metadata(files, levels):
    """The set with its availability in the tiles of zooms 0, levels, 2 levels ..."""
    available = json.loads(files["layer.json"])["available"]

    def add(path, tile):
        zoom = int(path.split("/")[0])
        if zoom % levels:
            return tile
        return tile + metadata(available[zoom + 1:zoom + 1 + levels])

    return with_tiles(with_layer(files, available=None, metadataAvailability=levels), add)


class Answer:
    def __init__(self, path, status, headers, body):
        self.path = path
        self.status = status
        self.headers = headers
        self.body = body


def sound_answer(files, path):
    """As docs/SERVING.md wants it, for a gzipped set."""
    headers = {"Access-Control-Allow-Origin": "*", "Cache-Control": "max-age=3600"}
    if path not in files:
        return Answer(path, 404, {"Content-Type": "text/plain"}, b"no such file")
    if is_tile(path):
        headers |= {"Content-Type": MEDIA_TYPE, "Content-Encoding": "gzip"}
    else:
        headers |= {"Content-Type": "application/json"}
    return Answer(path, 200, headers, files[path])


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    # Headers and body are two writes, and the second one would wait for the first one's receipt.
    disable_nagle_algorithm = True

    def do_GET(self):
        path = self.path.partition("?")[0].lstrip("/")
        answer = self.server.change(sound_answer(self.server.files, path), self)
        if answer is None:
            self.close_connection = True
            return
        self.send_response(answer.status)
        for name, value in answer.headers.items():
            for one in value if isinstance(value, list) else [value]:
                self.send_header(name, one)
        if "Content-Length" not in answer.headers:
            self.send_header("Content-Length", str(len(answer.body)))
        self.end_headers()
        if self.command == "GET":
            self.wfile.write(answer.body)
        if int(answer.headers.get("Content-Length", len(answer.body))) != len(answer.body):
            self.close_connection = True

    do_HEAD = do_GET

    def log_message(self, *_):
        pass


class Server(http.server.ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, request, client_address):
        """A client that had enough and went away is no news; anything else is."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)


@contextlib.contextmanager
def serving(files, change=lambda answer, handler: answer):
    """Yields the address. `change` sees every answer before it is sent; None sends nothing."""
    server = Server(("127.0.0.1", 0), Handler)
    server.files = files
    server.change = change
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
