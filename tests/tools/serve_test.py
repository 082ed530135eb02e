#!/usr/bin/env python3
"""`qmpipe serve` through real sockets: what clients need, and what nobody should send.

  serve_test.py QMPIPE
"""

import concurrent.futures
import gzip
import http.client
import json
import os
import pathlib
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest

from running_server import Server, status_of

QMPIPE = ""
SEED = 20261123
TILE = "application/vnd.quantized-mesh"


class ServeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.root = pathlib.Path(tempfile.mkdtemp(prefix="qmpipe-serve-"))
        cls.addClassCleanup(shutil.rmtree, cls.root)
        dem = cls.root / "dem.tif"
        run = lambda *a: subprocess.run([QMPIPE, *map(str, a)], check=True, capture_output=True)
        run("synth", "-o", dem, "--size", "400x300", "--bounds", "6,43,8,44.5", "--seed", "5")
        cls.packed = cls.root / "packed"
        cls.plain = cls.root / "plain"
        run("build", dem, "-o", cls.packed, "--max-zoom", "3")
        run("build", dem, "-o", cls.plain, "--max-zoom", "3", "--gzip", "none")
        (cls.root / "secret.txt").write_text("not for the web")
        cls.server = Server(QMPIPE, cls.packed)
        cls.addClassCleanup(cls.server.process.kill)

    @classmethod
    def tearDownClass(cls):
        # After all it was sent; a sanitizer would say otherwise.
        code, errors = cls.server.end()
        assert (code, errors) == (0, ""), (code, errors)

    def expect_alive(self, server=None):
        answer = (server or self.server).get("/tiles/0/0/0.terrain", Accept_Encoding="gzip")
        self.assertEqual(answer.status, 200)
        self.assertEqual(answer.body, (self.packed / "0/0/0.terrain").read_bytes())

    def test_packed_tiles_are_sent_as_they_are_to_who_takes_gzip(self):
        for path in ("/tiles/0/1/0.terrain", "/0/1/0.terrain", "/tiles/0/1/0.terrain?v=whatever"):
            answer = self.server.get(path, Accept_Encoding="br, gzip;q=0.5", Origin="http://a.example")
            self.assertEqual(answer.status, 200)
            self.assertEqual(answer.headers["Content-Encoding"], "gzip")
            self.assertEqual(answer.headers["Content-Type"], TILE)
            self.assertEqual(answer.headers["Access-Control-Allow-Origin"], "*")
            self.assertEqual(answer.body, (self.packed / "0/1/0.terrain").read_bytes())

    def test_packed_tiles_are_unpacked_for_who_takes_no_gzip(self):
        plain = gzip.decompress((self.packed / "0/1/0.terrain").read_bytes())
        for accepted in ("identity", "gzip;q=0", "br", ""):
            answer = self.server.get("/tiles/0/1/0.terrain", Accept_Encoding=accepted)
            self.assertIsNone(answer.headers["Content-Encoding"], accepted)
            self.assertEqual(answer.body, plain)

    def test_plain_tiles_are_sent_without_an_encoding(self):
        server = Server(QMPIPE, self.plain)
        try:
            answer = server.get("/tiles/0/1/0.terrain", Accept_Encoding="gzip")
            self.assertIsNone(answer.headers["Content-Encoding"])
            self.assertEqual(answer.body, (self.plain / "0/1/0.terrain").read_bytes())
        finally:
            code, errors = server.end(signal.SIGTERM)
        self.assertEqual((code, errors), (0, ""))

    def test_head_says_the_same_without_a_body(self):
        got = self.server.get("/tiles/1/2/1.terrain", Accept_Encoding="gzip")
        head = self.server.get("/tiles/1/2/1.terrain", method="HEAD", Accept_Encoding="gzip")
        self.assertEqual(head.body, b"")
        for name in ("Content-Length", "Content-Type", "Content-Encoding", "ETag"):
            self.assertEqual(head.headers[name], got.headers[name], name)

    def test_what_the_client_has_is_not_sent_again(self):
        for path in ("/tiles/0/0/0.terrain", "/tiles/layer.json", "/viewer.js"):
            got = self.server.get(path, Accept_Encoding="identity")
            again = self.server.get(path, Accept_Encoding="identity",
                                    If_None_Match=f'"other", W/{got.headers["ETag"]}')
            self.assertEqual((again.status, again.body), (304, b""), path)
            other = self.server.get(path, Accept_Encoding="identity", If_None_Match='"other"')
            self.assertEqual(other.status, 200, path)
        packed = self.server.get("/tiles/0/0/0.terrain", Accept_Encoding="gzip")
        plain = self.server.get("/tiles/0/0/0.terrain", Accept_Encoding="identity")
        self.assertNotEqual(packed.headers["ETag"], plain.headers["ETag"])

    def test_only_the_version_of_these_tiles_may_be_kept_for_ever(self):
        version = json.loads((self.packed / "layer.json").read_text())["version"]
        lasting = self.server.get(f"/tiles/0/0/0.terrain?v={version}")
        self.assertIn("immutable", lasting.headers["Cache-Control"])
        for query in ("", "?v=", "?v=1.0.0", "?w=" + version):
            answer = self.server.get("/tiles/0/0/0.terrain" + query)
            self.assertEqual(answer.headers["Cache-Control"], "no-cache", query)

    def test_layer_json_is_the_sets_own_where_that_fits(self):
        answer = self.server.get("/tiles/layer.json", Accept_Encoding="identity")
        self.assertEqual(answer.body, (self.packed / "layer.json").read_bytes())
        self.assertEqual(answer.headers["Content-Type"], "application/json")
        self.assertEqual(self.server.said["layer_changes"], [])

    def test_layer_json_is_made_where_there_is_none(self):
        bare = self.root / "bare"
        shutil.copytree(self.packed, bare)
        own = json.loads((bare / "layer.json").read_text())
        (bare / "layer.json").unlink()
        server = Server(QMPIPE, bare)
        try:
            self.assertEqual(len(server.said["layer_changes"]), 1)
            made = json.loads(server.get("/tiles/layer.json", Accept_Encoding="identity").body)
            for key in ("available", "format", "scheme", "extensions", "projection", "maxzoom"):
                self.assertEqual(made[key], own[key], key)
            # Who knows whether "1.0.0" changes when the tiles do?
            answer = server.get("/tiles/0/0/0.terrain?v=1.0.0")
            self.assertEqual(answer.headers["Cache-Control"], "no-cache")
        finally:
            self.assertEqual(server.end()[0], 0)

    def test_check_finds_nothing_wrong_with_any_form_of_a_set(self):
        forms = [self.packed, self.plain]
        for form in ("mbtiles", "pmtiles"):
            forms.append(self.root / f"checked.{form}")
            subprocess.run([QMPIPE, "convert", self.packed, "-o", forms[-1]], check=True,
                           capture_output=True)
        for form in forms:
            server = Server(QMPIPE, form)
            try:
                for address in (server.said["terrain"], server.said["viewer"]):
                    done = subprocess.run([QMPIPE, "check", address, "--json", "--origin",
                                           "http://elsewhere.example"], capture_output=True, text=True,
                                          timeout=120, check=False)
                    self.assertEqual(done.returncode, 0, (form, done.stdout, done.stderr))
                    self.assertEqual(json.loads(done.stdout)["findings"], [], form)
            finally:
                self.assertEqual(server.end()[0], 0)

    def test_absent_things_are_404_in_json(self):
        for path in ("/tiles/9/0/0.terrain", "/tiles/0/7/0.terrain", "/tiles/-1/0/0.terrain",
                     "/tiles/00/0/0.terrain", "/tiles/0/0/0.terrain/", "/tiles/0/0.terrain",
                     "/tiles/99999999999999999999/0/0.terrain", "/tiles/x.terrain", "/tiles",
                     "/package.json", "/node_modules/cesium/package.json", "/report.json", "/%ff"):
            answer = self.server.get(path)
            self.assertEqual(answer.status, 404, path)
            self.assertIn("error", json.loads(answer.body), path)
            self.assertEqual(answer.headers["Access-Control-Allow-Origin"], "*")

    def test_pages_come_with_their_media_types(self):
        for path, media_type in (("/", "text/html"), ("/index.html", "text/html"),
                                 ("/viewer.js", "text/javascript"), ("/set.json", "application/json")):
            answer = self.server.get(path)
            self.assertEqual(answer.status, 200, path)
            self.assertTrue(answer.headers["Content-Type"].startswith(media_type), path)

    def test_set_json_says_where_and_how_high_the_data_are(self):
        said = json.loads(self.server.get("/set.json", Accept_Encoding="identity").body)
        west, south, east, north = said["bounds_deg"]
        self.assertTrue(west <= 6 < 8 <= east and south <= 43 < 44.5 <= north, said)
        self.assertLess(said["heights_m"][0], said["heights_m"][1])
        self.assertEqual(said["tiles"], len(list(self.packed.glob("*/*/*.terrain"))))

    def test_no_address_leads_out_of_the_set(self):
        ways = ["/../secret.txt", "/tiles/../../secret.txt", "/%2e%2e/secret.txt", "/..%2fsecret.txt",
                "/tiles/%2e%2e%2f%2e%2e%2fsecret.txt", "/..\\secret.txt", "/%5c..%5csecret.txt",
                "//secret.txt", "/./../secret.txt", "/cesium/../../../secret.txt", "/%00/../secret.txt",
                "/secret.txt%00.terrain", "/tiles/0/0/../../../secret.txt", "/%252e%252e/secret.txt",
                "/0/0/0.terrain%00", "/..%c0%af..%c0%afsecret.txt", str(self.root / "secret.txt"),
                "/" + str(self.root / "secret.txt"), "/tiles/" + "../" * 60 + "etc/passwd"]
        for way in ways:
            for target in (way, "http://127.0.0.1" + way):
                said = self.server.send(f"GET {target} HTTP/1.1\r\nHost: x\r\n\r\n".encode())
                self.assertIn(status_of(said), (400, 404), target)
                self.assertNotIn(b"not for the web", said)
                self.assertNotIn(b"root:", said)
        self.expect_alive()

    def test_other_methods_are_refused(self):
        for method in ("POST", "PUT", "DELETE", "PATCH", "CONNECT", "TRACE", "BREW"):
            said = self.server.send(f"{method} / HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\n\r\nhello"
                                    .encode())
            self.assertIn(status_of(said), (400, 405), method)
        options = self.server.get("/tiles/layer.json", method="OPTIONS", Origin="http://a.example",
                                  Access_Control_Request_Method="GET",
                                  Access_Control_Request_Headers="x-custom")
        self.assertEqual(options.status, 204)
        self.assertIn("GET", options.headers["Access-Control-Allow-Methods"])
        # "*" does not stand for this one.
        self.assertIn("Authorization", options.headers["Access-Control-Allow-Headers"])
        self.expect_alive()

    def test_malformed_requests_get_4xx_or_nothing(self):
        head = b"GET / HTTP/1.1\r\nHost: x\r\n"
        requests = {
            "long path": b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\nHost: x\r\n\r\n",
            "long query": b"GET /?" + b"a=b&" * 30_000 + b" HTTP/1.1\r\nHost: x\r\n\r\n",
            "huge header": head + b"X: " + b"y" * 1_000_000 + b"\r\n\r\n",
            "header without a colon": head + b"nonsense\r\n\r\n",
            "no version": b"GET /\r\n\r\n",
            "future version": b"GET / HTTP/9.9\r\nHost: x\r\n\r\n",
            "lower case": b"get / http/1.1\r\nhost: x\r\n\r\n",
            "no method": b" / HTTP/1.1\r\n\r\n",
            "four words": b"GET / / HTTP/1.1\r\nHost: x\r\n\r\n",
            "a TLS greeting": bytes.fromhex("16030100a5010000a10303") + bytes(150),
            "zeros": bytes(5000),
            "only line ends": b"\r\n" * 2000,
            "bad percent": b"GET /%zz%%%u0041 HTTP/1.1\r\nHost: x\r\n\r\n",
            "bad range": head + b"Range: bytes=9-1\r\n\r\n",
            "endless range": head + b"Range: bytes=0-99999999999999999999\r\n\r\n",
            "a number that is none": b"POST / HTTP/1.1\r\nContent-Length: many\r\n\r\nx",
            "a negative length": b"POST / HTTP/1.1\r\nContent-Length: -5\r\n\r\nx",
            "a huge length": b"POST / HTTP/1.1\r\nContent-Length: 99999999999999999999\r\n\r\nx",
            "bad chunks": b"POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\nab\r\n",
            "a bad multipart": b"POST / HTTP/1.1\r\nContent-Type: multipart/form-data\r\n"
                               b"Content-Length: 3\r\n\r\nabc",
        }
        for name, raw in requests.items():
            with self.subTest(name):
                status = status_of(self.server.send(raw))
                # No answer to what has no end.
                allowed = {None, *range(400, 500)}
                if name in ("bad range", "endless range"):
                    allowed = {200 if name == "bad range" else 206}
                self.assertIn(status, allowed)
        self.expect_alive()

    def test_random_bytes_do_no_harm(self):
        dice = random.Random(SEED)
        sound = (b"GET /tiles/0/0/0.terrain?v=1 HTTP/1.1\r\nHost: x\r\nAccept-Encoding: gzip;q=0.5\r\n"
                 b"If-None-Match: \"a\", W/\"b\"\r\nRange: bytes=0-5,7-9\r\n\r\n")
        for _ in range(300):
            raw = bytearray(sound)
            for _ in range(dice.randrange(1, 8)):
                raw[dice.randrange(len(raw))] = dice.randrange(256)
            status = status_of(self.server.send(bytes(raw[:dice.randrange(1, len(raw) + 1)]),
                                                hang_up=True))
            self.assertTrue(status is None or status < 500, (status, bytes(raw)))
        self.expect_alive()

    def test_silent_connections_do_not_keep_others_out(self):
        silent = [socket.create_connection(("127.0.0.1", self.server.port)) for _ in range(40)]
        try:
            for line in silent[::2]:
                line.sendall(b"GET / HTTP/1.1\r\nHo")
            self.expect_alive()
        finally:
            for line in silent:
                line.close()

    def test_many_requests_at_once_get_the_right_bytes(self):
        tiles = {p.relative_to(self.packed): p.read_bytes() for p in self.packed.glob("*/*/*.terrain")}
        names = sorted(tiles)

        def ask(worker):
            dice = random.Random(SEED + worker)
            connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=60)
            for _ in range(400):
                name = dice.choice(names)
                connection.request("GET", f"/tiles/{name}", headers={"Accept-Encoding": "gzip"})
                answer = connection.getresponse()
                if (answer.status, answer.read()) != (200, tiles[name]):
                    return str(name)
            connection.close()
            return None

        start = time.monotonic()
        with concurrent.futures.ThreadPoolExecutor(16) as workers:
            wrong = [w for w in workers.map(ask, range(16)) if w]
        print(f"{16 * 400 / (time.monotonic() - start):.0f} requests a second", flush=True)
        self.assertEqual(wrong, [])

    def test_a_port_in_use_is_said_and_not_shared(self):
        done = subprocess.run([QMPIPE, "serve", self.packed, "--port", str(self.server.port)],
                              capture_output=True, text=True, timeout=60, check=False)
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertIn("--port", done.stderr)
        self.assertIn("in use", done.stderr)

    def test_only_this_machine_is_served_unless_told_otherwise(self):
        listening = [line.split()[1] for line in pathlib.Path("/proc/net/tcp").read_text().splitlines()
                     if line.split()[3] == "0A"]
        port = f"{self.server.port:04X}"
        self.assertEqual([a for a in listening if a.endswith(":" + port)], ["0100007F:" + port])

    def test_what_cannot_be_served_is_refused(self):
        (self.root / "empty").mkdir(exist_ok=True)
        (self.root / "empty" / "layer.json").write_text("{}")
        for what, code in ((self.root / "nowhere", 1), (self.root / "empty", 1),
                           (self.root / "secret.txt", 1)):
            done = subprocess.run([QMPIPE, "serve", what, "--port", "0"], capture_output=True,
                                  text=True, timeout=60, check=False)
            self.assertEqual(done.returncode, code, done.stderr)
        done = subprocess.run([QMPIPE, "serve", self.packed, "--port", "65536"], capture_output=True,
                              timeout=60, check=False)
        self.assertEqual(done.returncode, 2)
        done = subprocess.run([QMPIPE, "serve", self.packed, "--port", "0"], capture_output=True,
                              text=True, timeout=60, check=False,
                              env={**os.environ, "QMPIPE_VIEWER": str(self.root)})
        self.assertEqual(done.returncode, 1)
        self.assertIn("index.html", done.stderr)

    def test_a_tile_that_is_damaged_on_disk_is_a_500_with_words(self):
        damaged = self.root / "damaged"
        shutil.copytree(self.packed, damaged)
        tile = damaged / "2/4/2.terrain"
        tile = tile if tile.exists() else sorted(damaged.glob("2/*/*.terrain"))[0]
        tile.write_bytes(tile.read_bytes()[:-20])
        server = Server(QMPIPE, damaged)
        try:
            name = tile.relative_to(damaged)
            answer = server.get(f"/tiles/{name}", Accept_Encoding="identity")
            self.assertEqual(answer.status, 500)
            self.assertIn("gzip", json.loads(answer.body)["error"])
            tile.unlink()
            self.assertEqual(server.get(f"/tiles/{name}").status, 500)
            self.expect_alive(server)
        finally:
            self.assertEqual(server.end()[0], 0)


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    print("seed", SEED, flush=True)
    unittest.main(verbosity=2)
