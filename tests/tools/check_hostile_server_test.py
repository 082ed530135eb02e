#!/usr/bin/env python3
"""`qmpipe check` against servers that are broken or mean: it ends within its timeout, with words.

usage: check_hostile_server_test.py QMPIPE
"""
import contextlib
import gzip
import os
import pathlib
import shutil
import signal
import socket
import ssl
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import served_set
from served_set import check, codes, is_tile, serving

QMPIPE = None
FILES = {}


def redirect_for_ever(answer, _):
    answer.status = 302
    answer.headers["Location"] = "/layer.json"
    return answer


@contextlib.contextmanager
def raw_server(behave):
    """A socket whose every connection is given to behave(connection, stop) in a thread."""
    listener = socket.create_server(("127.0.0.1", 0))
    stop = threading.Event()
    threads = []

    def handle(connection):
        with connection, contextlib.suppress(OSError):
            behave(connection, stop)

    def accept():
        while not stop.is_set():
            with contextlib.suppress(TimeoutError):
                connection, _ = listener.accept()
                connection.settimeout(0.2)
                threads.append(threading.Thread(target=handle, args=(connection,)))
                threads[-1].start()

    listener.settimeout(0.05)
    acceptor = threading.Thread(target=accept)
    acceptor.start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}/"
    finally:
        stop.set()
        acceptor.join()
        listener.close()
        for thread in threads:
            thread.join()


def request_of(connection):
    return connection.recv(65536).decode("latin-1")


def sends(data):
    def behave(connection, _):
        request_of(connection)
        connection.sendall(data)
    return behave


def sends_for_ever(start, more):
    def behave(connection, stop):
        request_of(connection)
        connection.sendall(start)
        # A client may be slow to read: a connection closed for that would end the answer.
        while not stop.is_set():
            with contextlib.suppress(TimeoutError):
                connection.send(more)
    return behave


def trickles(start, more):
    def behave(connection, stop):
        request_of(connection)
        connection.sendall(start)
        while not stop.wait(0.05):
            connection.sendall(more)
    return behave


def hangs(connection, stop):
    request_of(connection)
    stop.wait()


def never_reads(_, stop):
    stop.wait()


OK = b"HTTP/1.1 200 OK\r\n"
TIMEOUT_S = 1


class HostileServer(unittest.TestCase):
    def ends(self, behave, word, faults=("no-answer",), code=1):
        with raw_server(behave) as address:
            start = time.monotonic()
            done, report = check(QMPIPE, address, "--timeout", TIMEOUT_S)
            took_s = time.monotonic() - start
        self.assertEqual(codes(report, "fault"), list(faults), done.stdout)
        self.assertEqual(done.returncode, code)
        self.assertIn(word, report["findings"][0]["text"])
        self.assertLess(took_s, 3 * TIMEOUT_S + 4)

    def test_hangs(self):
        self.ends(hangs, "1 seconds")

    def test_does_not_read(self):
        self.ends(never_reads, "1 seconds")

    def test_closes_at_once(self):
        self.ends(sends(b""), "without an answer")

    def test_closes_in_the_headers(self):
        with raw_server(sends(OK + b"Content-Type: appl")) as address:
            done, report = check(QMPIPE, address)
        self.assertIn(done.returncode, (1, 3), done.stdout)
        self.assertEqual(len(codes(report, "fault")), 1)

    def test_closes_in_the_body(self):
        self.ends(sends(OK + b"Access-Control-Allow-Origin: *\r\nContent-Length: 900\r\n\r\n{"),
                  "after 1 bytes", ["cut-off"], 3)

    def test_closes_in_a_chunk(self):
        self.ends(sends(OK + b"Access-Control-Allow-Origin: *\r\nTransfer-Encoding: chunked\r\n\r\n"
                        b"5\r\n{\"a"), "after 3 bytes", ["cut-off"], 3)

    def test_garbage(self):
        self.ends(sends(bytes(range(256)) * 100), "HTTP")

    def test_another_protocol(self):
        self.ends(sends(b"SSH-2.0-OpenSSH_9.2\r\n"), "HTTP")

    def test_a_long_status_line(self):
        with raw_server(sends(b"HTTP/1.1 200 " + b"a" * 3000000 + b"\r\n\r\n")) as address:
            done, report = check(QMPIPE, address, "--timeout", TIMEOUT_S)
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertEqual(codes(report, "fault"), ["no-answer"])

    def test_headers_without_end(self):
        self.ends(sends_for_ever(OK, b"X-Filler: " + b"x" * 500 + b"\r\n"), "header")

    def test_a_header_without_end(self):
        with raw_server(sends_for_ever(OK + b"X: ", b"x" * 4096)) as address:
            done, report = check(QMPIPE, address, "--timeout", TIMEOUT_S)
        self.assertEqual((done.returncode, codes(report, "fault")), (1, ["no-answer"]))

    def test_headers_that_trickle(self):
        self.ends(trickles(OK, b"X: y\r\n"), "1 seconds")

    def test_a_body_without_end(self):
        self.ends(sends_for_ever(OK + b"\r\n", b" " * 65536), "")

    def test_a_body_that_trickles(self):
        self.ends(trickles(OK + b"\r\n", b" "), "1 seconds")

    def test_a_body_that_claims_to_be_huge(self):
        self.ends(sends(OK + b"Access-Control-Allow-Origin: *\r\n"
                        b"Content-Length: 99999999999999\r\n\r\n{"), "after 1 bytes", ["cut-off"], 3)

    def test_a_gzip_bomb(self):
        bomb = gzip.compress(b" " * (300 << 20), 9)
        self.ends(sends(OK + b"Access-Control-Allow-Origin: *\r\nContent-Encoding: gzip\r\n"
                        b"Content-Length: %d\r\n\r\n" % len(bomb) + bomb), "more than",
                  ["gzip-damaged"], 3)

    def test_tiles_that_hang_cost_a_few_timeouts(self):
        def hang(answer, _):
            if is_tile(answer.path):
                time.sleep(2 * TIMEOUT_S)
            return answer

        with serving(FILES, hang) as address:
            start = time.monotonic()
            done, report = check(QMPIPE, address, "--timeout", TIMEOUT_S)
            self.assertLess(time.monotonic() - start, 5 * TIMEOUT_S)
        self.assertEqual((done.returncode, codes(report, "fault")), (3, ["tile-no-answer"]))
        self.assertEqual(report["tiles_asked"], 3)

    def test_redirections_without_end(self):
        with serving(FILES, redirect_for_ever) as address:
            done, report = check(QMPIPE, address)
        self.assertEqual((done.returncode, codes(report, "fault")), (1, ["no-answer"]))
        self.assertIn("redirections", report["findings"][0]["text"])

    def test_nobody_listens(self):
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        done, report = check(QMPIPE, f"http://127.0.0.1:{port}/")
        self.assertEqual((done.returncode, codes(report, "fault")), (1, ["no-answer"]))
        self.assertIn("cannot connect", report["findings"][0]["text"])

    def test_no_such_host(self):
        done, report = check(QMPIPE, "http://no-such-host.invalid/")
        self.assertEqual(done.returncode, 1)
        self.assertIn("cannot be resolved", report["findings"][0]["text"])

    def test_a_certificate_that_nobody_vouches_for(self):
        if not shutil.which("openssl"):
            self.skipTest("openssl is not installed")
        with tempfile.TemporaryDirectory(prefix="qmpipe-tls-") as folder:
            key, certificate = f"{folder}/key.pem", f"{folder}/certificate.pem"
            subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj",
                            "/CN=localhost", "-keyout", key, "-out", certificate],
                           check=True, capture_output=True)
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(certificate, key)

            def greet(connection, _):
                connection.settimeout(30)  # a handshake takes long on a busy machine
                with contextlib.suppress(ssl.SSLError):
                    context.wrap_socket(connection, server_side=True).close()

            with raw_server(greet) as address:
                done, report = check(QMPIPE, address.replace("http:", "https:"))
        self.assertEqual((done.returncode, codes(report, "fault")), (1, ["no-answer"]))
        self.assertIn("certificate is not trusted", report["findings"][0]["text"])

    def test_an_interrupt_ends_it_at_once(self):
        with raw_server(hangs) as address:
            running = subprocess.Popen([QMPIPE, "check", address, "--timeout", "60"],
                                       stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                                       env={**os.environ, "no_proxy": "*"})
            time.sleep(1)
            running.send_signal(signal.SIGINT)
            _, words = running.communicate(timeout=10)
        self.assertEqual((running.returncode, words), (130, "qmpipe: interrupted\n"))

    def test_https_where_http_is_spoken(self):
        with serving(FILES) as address:
            done, report = check(QMPIPE, address.replace("http:", "https:"))
        self.assertEqual((done.returncode, codes(report, "fault")), (1, ["no-answer"]))
        self.assertIn("https", report["findings"][0]["text"])


def main():
    global QMPIPE
    if len(sys.argv) < 2:
        print(__doc__, file=sys.stderr)
        return 2
    QMPIPE = sys.argv.pop(1)
    with tempfile.TemporaryDirectory(prefix="qmpipe-hostile-") as folder:
        tiles = pathlib.Path(folder) / "tiles"
        served_set.build_set(QMPIPE, tiles)
        FILES.update(served_set.read_set(tiles))
        unittest.main()


if __name__ == "__main__":
    sys.exit(main())
