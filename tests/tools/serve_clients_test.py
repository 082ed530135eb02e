#!/usr/bin/env python3
"""`qmpipe serve` and clients that ask for parts, send too much, send or read too slowly, or hold on while
the server is told to end.

  serve_clients_test.py QMPIPE
"""

import pathlib
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest

from running_server import Server, status_of

QMPIPE = ""
SEED = 20261128
HEAD = b"GET /tiles/0/0/0.terrain HTTP/1.1\r\nHost: x\r\n"
# What the server gives a client for its head, and has for its own end.
HEAD_TIME_S = 5
END_S = 2
# Until a process is seen to have ended, on a busy machine.
SEEN_S = 0.5


def peak_memory_kb(process):
    for line in pathlib.Path(f"/proc/{process.pid}/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1])
    raise AssertionError("no VmHWM")


class Trickle:
    """Sends a byte of an endless header every 50 ms, and knows when the server had enough."""

    def __init__(self, server):
        self.line = server.connect()
        self.start = time.monotonic()
        self.lasted_s = None
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        try:
            self.line.sendall(HEAD + b"X: ")
            while time.monotonic() < self.start + 60:
                self.line.sendall(b"y")
                time.sleep(0.05)
        except OSError:
            self.lasted_s = time.monotonic() - self.start

    def join(self):
        self.thread.join()
        self.line.close()
        return self.lasted_s


class ServeClientsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.root = pathlib.Path(tempfile.mkdtemp(prefix="qmpipe-serve-clients-"))
        cls.addClassCleanup(shutil.rmtree, cls.root)
        dem = cls.root / "dem.tif"
        cls.set = cls.root / "tiles"
        for step in (("synth", "-o", dem, "--size", "200x150", "--bounds", "6,43,8,44.5", "--seed", "5"),
                     ("build", dem, "-o", cls.set, "--max-zoom", "1")):
            subprocess.run([QMPIPE, *map(str, step)], check=True, capture_output=True)
        cls.tile = (cls.set / "0/0/0.terrain").read_bytes()
        cls.server = Server(QMPIPE, cls.set)
        cls.addClassCleanup(cls.server.process.kill)
        # Takes its time; is looked at in a test.
        cls.trickle = Trickle(cls.server)

    @classmethod
    def tearDownClass(cls):
        code, errors = cls.server.end()
        assert (code, errors) == (0, ""), (code, errors)

    def get_tile(self, server=None, **headers):
        return (server or self.server).get("/tiles/0/0/0.terrain", Accept_Encoding="gzip", **headers)

    def expect_alive(self, server=None):
        answer = self.get_tile(server)
        self.assertEqual((answer.status, answer.body), (200, self.tile))

    # Ranges

    def test_one_range_is_a_206_with_that_part(self):
        size = len(self.tile)
        ranges = [(f"{a}-{b}", a, b) for a, b in ((0, 0), (0, 99), (7, size - 1), (size - 1, size - 1))]
        ranges += [("5-", 5, size - 1), ("-9", size - 9, size - 1), (f"-{10 * size}", 0, size - 1),
                   (f"3-{10 * size}", 3, size - 1), ("0-99999999999999999999999", 0, size - 1),
                   ("-99999999999999999999999", 0, size - 1)]
        dice = random.Random(SEED)
        for _ in range(40):
            first, last = sorted(dice.randrange(size) for _ in range(2))
            ranges.append((f"{first}-{last}", first, last))
        for asked, first, last in ranges:
            answer = self.get_tile(Range=f"bytes={asked}")
            self.assertEqual(answer.status, 206, asked)
            self.assertEqual(answer.headers["Content-Range"], f"bytes {first}-{last}/{size}", asked)
            self.assertEqual(answer.body, self.tile[first:last + 1], asked)
            self.assertEqual(answer.headers["Content-Encoding"], "gzip")
        whole = self.get_tile()
        self.assertEqual(whole.headers["Accept-Ranges"], "bytes")
        parts = [self.get_tile(Range=r).body for r in ("bytes=0-99", "bytes=100-")]
        self.assertEqual(b"".join(parts), whole.body)

    def test_pages_have_ranges_too(self):
        whole = self.server.get("/viewer.js").body
        answer = self.server.get("/viewer.js", Range="bytes=100-199")
        self.assertEqual((answer.status, answer.body), (206, whole[100:200]))

    def test_a_range_past_the_end_is_a_416(self):
        size = len(self.tile)
        for asked in (f"{size}-", f"{size}-{size + 5}", "99999999999999999999999-", "-0"):
            answer = self.get_tile(Range=f"bytes={asked}")
            self.assertEqual(answer.status, 416, asked)
            self.assertEqual(answer.headers["Content-Range"], f"bytes */{size}", asked)
            self.assertIn(b"error", answer.body)

    def test_several_ranges_and_malformed_ones_get_the_whole(self):
        for asked in ("bytes=0-5,7-9", "bytes=0-0,-1", "bytes=" + "0-1," * 2000 + "3-4", "bytes=9-1",
                      "bytes=-", "bytes=a-b", "bytes=1", "bytes=+1-2", "lines=1-2", "bytes", "",
                      "bytes=--5", "bytes=0x1-5", "bytes=1-2-3"):
            answer = self.get_tile(Range=asked)
            self.assertEqual((answer.status, answer.body), (200, self.tile), asked[:40])
            self.assertIsNone(answer.headers["Content-Range"])

    def test_a_range_of_another_state_gets_the_whole(self):
        etag = self.get_tile().headers["ETag"]
        for if_range, status in ((etag, 206), ('"other"', 200), ("W/" + etag, 200),
                                 ("Sat, 28 Nov 2026 12:00:00 GMT", 200)):
            answer = self.get_tile(Range="bytes=1-2", If_Range=if_range)
            self.assertEqual(answer.status, status, if_range)
            self.assertEqual(answer.body, self.tile[1:3] if status == 206 else self.tile)

    def test_ranges_change_nothing_else(self):
        etag = self.get_tile().headers["ETag"]
        self.assertEqual(self.get_tile(Range="bytes=0-1", If_None_Match=etag).status, 304)
        head = self.server.get("/tiles/0/0/0.terrain", method="HEAD", Accept_Encoding="gzip",
                               Range="bytes=0-1")
        self.assertEqual((head.status, head.headers["Content-Length"]), (200, str(len(self.tile))))
        self.assertEqual(self.server.get("/nowhere", Range="bytes=0-1").status, 404)

    # Too much

    def test_a_hundred_megabytes_of_headers_take_no_memory(self):
        before = peak_memory_kb(self.server.process)
        floods = {"many headers": b"".join(b"X-%d: %s\r\n" % (k, b"y" * 90) for k in range(10000)),
                  "one header": b"X: " + b"y" * 1_000_000,
                  "an address": b"GET /" + b"a" * 1_000_000,
                  "line ends": b"\r\n" * 500_000}
        for name, piece in floods.items():
            with self.server.connect() as line:
                try:
                    line.sendall(b"" if name == "an address" else HEAD)
                    for _ in range(100_000_000 // len(piece)):
                        line.sendall(piece)
                except OSError:
                    pass  # had enough
                else:
                    # "line ends" are a whole head and then nothing.
                    self.assertEqual(name, "line ends")
        self.assertLess(peak_memory_kb(self.server.process) - before, 16_000)
        self.expect_alive()

    def test_heads_within_the_limits_are_answered_and_larger_ones_said_to_be_too_large(self):
        # With Host, Connection and Accept-Encoding there is room for 97.
        for count, status in ((97, 200), (98, 431), (2000, 431)):
            extra = b"".join(b"X-%d: y\r\n" % k for k in range(count))
            said = self.server.send(HEAD + b"Connection: close\r\nAccept-Encoding: gzip\r\n" + extra + b"\r\n")
            self.assertEqual(status_of(said), status, count)
        for length, status in ((8_000, 200), (30_000, 200), (33_000, 431), (200_000, 431)):
            said = self.server.send(HEAD + b"X: " + b"y" * length + b"\r\n\r\n")
            self.assertEqual(status_of(said), status, length)
        for length, status in ((8_000, 404), (9_000, 414)):
            said = self.server.send(b"GET /" + b"a" * length + b" HTTP/1.1\r\nHost: x\r\n\r\n")
            self.assertEqual(status_of(said), status, length)

    def test_a_body_is_never_taken_for_a_request(self):
        inner = b"GET /tiles/layer.json HTTP/1.1\r\nHost: x\r\n\r\n"
        for method in (b"GET", b"HEAD", b"OPTIONS", b"POST"):
            for framing in (b"Content-Length: %d\r\n" % len(inner), b"Transfer-Encoding: chunked\r\n"):
                with self.server.connect() as line:
                    line.sendall(method + b" /nowhere HTTP/1.1\r\nHost: x\r\n" + framing + b"\r\n" + inner)
                    said = b""
                    while chunk := line.recv(65536):
                        said += chunk
                self.assertEqual(said.count(b"HTTP/1.1 "), 1, (method, framing))
                self.assertNotIn(b"tilejson", said)

    def test_what_could_be_read_in_two_ways_is_refused(self):
        first = b"GET / HTTP/1.1\r\n"
        for name, rest in {
                "no host": b"", "two hosts": b"Host: a\r\nHost: b\r\n",
                "two lengths": b"Host: x\r\nContent-Length: 1\r\nContent-Length: 2\r\n",
                "a list of lengths": b"Host: x\r\nContent-Length: 1, 1\r\n",
                "a length and chunks": b"Host: x\r\nContent-Length: 1\r\nTransfer-Encoding: chunked\r\n",
                "a blank before the colon": b"Host: x\r\nX : y\r\n", "a folded line": b"Host: x\r\n y\r\n",
                "a zero byte": b"Host: x\r\nX: a\0b\r\n", "a lonely CR": b"Host: x\r\nX: a\rb\r\n"}.items():
            self.assertEqual(status_of(self.server.send(first + rest + b"\r\n")), 400, name)

    def test_requests_that_come_at_once_are_answered_in_order(self):
        paths = ["/nowhere", "/tiles/layer.json", "/nothing", "/set.json"] * 5
        raw = b"".join(f"GET {p} HTTP/1.1\r\nHost: x\r\n\r\n".encode() for p in paths[:-1])
        with self.server.connect() as line:
            line.sendall(raw + f"GET {paths[-1]} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n".encode())
            said = b""
            while chunk := line.recv(65536):
                said += chunk
        statuses = [int(piece[:3]) for piece in said.split(b"HTTP/1.1 ")[1:]]
        self.assertEqual(statuses, [404, 200] * 10)

    # Too slow

    def test_who_trickles_a_head_is_cut_off(self):
        self.expect_alive()
        lasted = self.trickle.join()
        self.assertIsNotNone(lasted, "it was never cut off")
        self.assertTrue(HEAD_TIME_S - 1 < lasted < HEAD_TIME_S + 5, lasted)

    def test_clients_that_wait_do_not_keep_out_others_for_long(self):
        server = Server(QMPIPE, self.set, "--threads", "2")
        waiting = [server.connect() for _ in range(2)]
        try:
            start = time.monotonic()
            self.expect_alive(server)
            self.assertLess(time.monotonic() - start, HEAD_TIME_S + 5)
        finally:
            for line in waiting:
                line.close()
            self.assertEqual(server.end(), (0, ""))

    # The end

    def test_it_ends_within_two_seconds_whatever_clients_do(self):
        pages = self.root / "pages"
        pages.mkdir()
        (pages / "index.html").write_text("x")
        (pages / "big.js").write_bytes(bytes(32 << 20))
        for how in (signal.SIGTERM, signal.SIGINT):
            server = Server(QMPIPE, self.set, pages=pages)
            lines = [server.connect() for _ in range(8)]
            lines[0].sendall(HEAD)
            lines[1].sendall(HEAD + b"\r\n")
            lines[2].sendall(b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 1000\r\n\r\n")
            # An answer that nobody takes.
            lines[3].setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            lines[3].sendall(b"GET /big.js HTTP/1.1\r\nHost: x\r\n\r\n")
            trickles = [Trickle(server) for _ in range(4)]
            time.sleep(0.3)
            start = time.monotonic()
            code, errors = server.end(how)
            took = time.monotonic() - start
            for line in lines:
                line.close()
            for trickle in trickles:
                trickle.join()
            self.assertEqual((code, errors), (0, ""), how)
            self.assertLess(took, END_S + SEEN_S, how)

    def test_a_signal_just_after_the_start_is_not_lost(self):
        for how in (signal.SIGTERM, signal.SIGINT):
            for delay in (0, 0, 0, 0.001, 0.002, 0.005, 0.01, 0.02):
                server = Server(QMPIPE, self.set)
                time.sleep(delay)
                start = time.monotonic()
                self.assertEqual(server.end(how), (0, ""), (how, delay))
                self.assertLess(time.monotonic() - start, END_S + SEEN_S, (how, delay))


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    print("seed", SEED, flush=True)
    unittest.main(verbosity=2)
