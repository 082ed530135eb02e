#!/usr/bin/env python3
"""The configurations of docs/SERVING.md in the servers that they are for: `qmpipe check` finds
nothing to say about a gzipped and a plain set.

usage: serving_docs_test.py QMPIPE
"""
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.error
import urllib.request

import served_set

QMPIPE = None
ROOT = None  # of the sets: gzipped/terrain and plain/terrain
SERVING = pathlib.Path(__file__).resolve().parents[2] / "docs" / "SERVING.md"
FOR_GZIP = re.compile(r"^[^\n]*# gzipped sets only:\n[^\n]*\n", re.M)
STARTS_WITHIN_S = 20


def snippet(language):
    blocks = re.findall(rf"^```{language}\n(.*?)^```$", SERVING.read_text(encoding="utf-8"),
                        re.M | re.S)
    assert len(blocks) == 1, f"{len(blocks)} blocks of {language} in {SERVING}"
    assert len(FOR_GZIP.findall(blocks[0])) == 1, f"no line for gzipped sets in {language}"
    assert "/srv" in blocks[0]
    return blocks[0]


def program(name):
    return shutil.which(name, path=os.environ.get("PATH", "") + ":/usr/sbin:/usr/local/sbin")


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as free:
        return free.getsockname()[1]


def nginx(block, folder, port):
    user = "user root;\n" if os.geteuid() == 0 else ""
    temporary = "".join(f"  {kind}_temp_path {folder}/{kind};\n"
                        for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
    # Compression on, as distributions have it.
    (folder / "nginx.conf").write_text(
        f"{user}daemon off;\npid {folder}/pid;\nerror_log {folder}/error.log;\nevents {{}}\n"
        f"http {{\n  access_log off;\n  gzip on;\n  gzip_types *;\n{temporary}"
        f"  server {{\n    listen 127.0.0.1:{port};\n{block}\n  }}\n}}\n")
    return [program("nginx"), "-p", folder, "-e", folder / "error.log", "-c", folder / "nginx.conf"]


def apache(block, folder, port):
    modules = "".join(f"LoadModule {name}_module /usr/lib/apache2/modules/mod_{name}.so\n"
                      for name in ("mpm_event", "authz_core", "mime", "alias", "headers", "filter",
                                   "deflate"))
    user = "User www-data\nGroup www-data\n" if os.geteuid() == 0 else ""
    (folder / "mime.types").write_text("text/html html\n")
    (folder / "apache.conf").write_text(
        f"{modules}{user}ServerRoot {folder}\nServerName localhost\nListen 127.0.0.1:{port}\n"
        f"PidFile {folder}/pid\nErrorLog {folder}/error.log\nDefaultRuntimeDir {folder}\n"
        f"Mutex file:{folder} default\nTypesConfig {folder}/mime.types\n"
        f"<Directory />\n  Require all denied\n</Directory>\n"
        f"SetOutputFilter DEFLATE\n{block}\n")
    return [program("apache2"), "-X", "-f", folder / "apache.conf"]


def caddy(block, folder, port):
    assert block.startswith("example.org {")
    site = block.replace("example.org {", f"http://127.0.0.1:{port} {{\n    encode gzip", 1)
    (folder / "Caddyfile").write_text(
        "{\n    admin off\n    auto_https off\n}\n" + site)
    return [program("caddy"), "run", "--config", folder / "Caddyfile", "--adapter", "caddyfile"]


class Serving:
    """A server of one of the sets, on a free port, until the end of the `with`."""

    def __init__(self, make, block, form):
        self.folder = tempfile.TemporaryDirectory(prefix="qmpipe-serving-")
        folder = pathlib.Path(self.folder.name)
        folder.chmod(0o755)
        port = free_port()
        self.address = f"http://127.0.0.1:{port}/terrain/"
        command = make(block.replace("/srv", str(ROOT / form)), folder, port)
        self.log = open(folder / "output", "w+", encoding="utf-8")
        self.process = subprocess.Popen([str(part) for part in command], stdout=self.log,
                                        stderr=self.log, cwd=folder, stdin=subprocess.DEVNULL,
                                        env={**os.environ, "HOME": str(folder),
                                             "XDG_CONFIG_HOME": str(folder),
                                             "XDG_DATA_HOME": str(folder)})
        self.port = port

    def __enter__(self):
        end = time.monotonic() + STARTS_WITHIN_S
        while time.monotonic() < end and self.process.poll() is None:
            try:
                socket.create_connection(("127.0.0.1", self.port), 1).close()
                return self.address
            except OSError:
                time.sleep(0.05)
        words = self.words()
        self.__exit__()
        raise AssertionError("the server did not start: " + words)

    def words(self):
        self.log.seek(0)
        text = self.log.read()
        for path in pathlib.Path(self.folder.name).glob("error.log"):
            text += path.read_text(encoding="utf-8")
        return text

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(20)
        self.log.close()
        self.folder.cleanup()


class Documentation(unittest.TestCase):
    def serves_well(self, make, name, language, without_line):
        """without_line: what is found where a gzipped set lacks its line."""
        if not program(name):
            self.skipTest(f"{name} is not installed (tools/setup.sh --dev installs it)")
        for_gzip = snippet(language)
        for_plain = FOR_GZIP.sub("", for_gzip)
        for form, block in (("gzipped", for_gzip), ("plain", for_plain)):
            with self.subTest(form), Serving(make, block, form) as address:
                done, report = served_set.check(QMPIPE, address)
                self.assertEqual(report["findings"], [], done.stdout)
                self.assertEqual((done.returncode, report["tiles_sound"]), (0, 11))
                self.caches_well(address)
        # The line that they are about matters, and its absence is seen.
        with Serving(make, for_plain, "gzipped") as address:
            done, report = served_set.check(QMPIPE, address)
            self.assertEqual(served_set.codes(report, "fault"), [without_line], done.stdout)
        with Serving(make, for_gzip, "plain") as address:
            done, report = served_set.check(QMPIPE, address)
            self.assertEqual(served_set.codes(report, "fault"), ["gzip-announced-but-plain"],
                             done.stdout)

    def caches_well(self, address):
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        for path, word in (("layer.json", "no-cache"), ("0/0/0.terrain", "immutable")):
            with opener.open(address + path, timeout=10) as answer:
                self.assertIn(word, answer.headers["Cache-Control"])
        with self.assertRaises(urllib.error.HTTPError) as missing:
            opener.open(address + "9/9/9.terrain", timeout=10)
        self.assertEqual(missing.exception.code, 404)
        self.assertNotIn("immutable", missing.exception.headers.get("Cache-Control", ""))
        missing.exception.close()

    def test_nginx(self):
        self.serves_well(nginx, "nginx", "nginx", "gzip-not-announced")

    def test_apache(self):
        # Apache is told to compress whatever it can, and does so with what is gzip already.
        self.serves_well(apache, "apache2", "apache", "gzip-twice")

    def test_caddy(self):
        self.serves_well(caddy, "caddy", "caddy", "gzip-not-announced")


def main():
    global QMPIPE, ROOT
    if len(sys.argv) < 2:
        print(__doc__, file=sys.stderr)
        return 2
    QMPIPE = str(pathlib.Path(sys.argv.pop(1)).resolve())
    with tempfile.TemporaryDirectory(prefix="qmpipe-docs-") as folder:
        ROOT = pathlib.Path(folder)
        ROOT.chmod(0o755)
        for form, options in (("gzipped", ()), ("plain", ("--gzip", "none"))):
            (ROOT / form).mkdir()
            served_set.build_set(QMPIPE, ROOT / form / "terrain", *options)
        unittest.main(verbosity=2)


if __name__ == "__main__":
    sys.exit(main())
