#!/usr/bin/env python3
"""The same bytes on every processor: builds with and without what the C library makes of one.

glibc chooses its sines and logarithms by what the processor can do, and their last bits differ.
GLIBC_TUNABLES takes the abilities away, as an older processor would lack them.

usage: processor_test.py QMPIPE
"""
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

QMPIPE = None
LESSER = {**os.environ, "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-AVX2_Usable,-AVX2,-FMA4"}
METHODS = ("greedy", "edge-collapse", "ps-random", "ps-grid", "ps-hierarchy", "ps-wlop")
# Prints how the C library's functions round, in a few thousand places.
PROBE = ("import math\nfor k in range(4000):\n x = 0.37 + k * 0.0113\n"
         " print(math.sin(x).hex(), math.exp(-x).hex(), math.atan2(x, 3).hex(), math.tan(x).hex())")


def run(*arguments, env=None):
    return subprocess.run([QMPIPE, *map(str, arguments)], capture_output=True, text=True,
                          timeout=120, stdin=subprocess.DEVNULL, env=env)


def height_m(x, y):
    return (300 * math.sin(x / 9) * math.cos(y / 7) + 120 * math.sin(x * y / 150)
            + 40 * math.cos(x / 2.3 + y / 1.9) + 500)


def write_dem(path, west, south, pixel, width=110, height=90):
    rows = (" ".join(f"{height_m(c, r):.3f}" for c in range(width)) for r in range(height))
    path.write_text(f"ncols {width}\nnrows {height}\nxllcorner {west}\nyllcorner {south}\n"
                    f"cellsize {pixel}\n" + "\n".join(rows) + "\n")


def bytes_of(path):
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    # The report tells times.
    return {str(p.relative_to(path)): p.read_bytes() for p in files if p.name != "report.json"}


class Processor(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        probes = [subprocess.run([sys.executable, "-c", PROBE], capture_output=True, check=True,
                                 env=env).stdout for env in (None, LESSER)]
        if probes[0] == probes[1]:
            raise unittest.SkipTest("this C library rounds alike with and without the abilities")

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="qmpipe-processor-")
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)

    def compare(self, name, command, dem, *options):
        made = []
        for kind, env in (("all", None), ("less", LESSER)):
            # The same name in the same place: it may stand in the output.
            out = self.root / kind / name
            out.parent.mkdir(exist_ok=True)
            done = run(*command, dem, "-o", out, *options, env=env)
            self.assertEqual(done.returncode, 0, done.stderr)
            made.append(bytes_of(out))
        self.assertEqual(made[0].keys(), made[1].keys())
        changed = [name for name, data in made[0].items() if data != made[1][name]]
        self.assertEqual(changed, [], f"{len(changed)} of {len(made[0])} files")

    def test_sets_of_a_dem_in_degrees(self):
        dem = self.root / "degrees.asc"
        write_dem(dem, 6.3, 43.7, 0.01)
        for method in METHODS:
            with self.subTest(method):
                self.compare(method, ("build",), dem, "--source-crs", "EPSG:4326",
                             "--method", method)
        self.compare("mercator", ("build",), dem, "--source-crs", "EPSG:4326",
                     "--scheme", "mercator")

    def test_sets_of_projected_dems(self):
        for crs, west, south in (("EPSG:32632", 300000, 5000000), ("EPSG:3035", 4000000, 2700000),
                                 ("EPSG:3031", -60000, 900000)):
            dem = self.root / (crs[5:] + ".asc")
            write_dem(dem, west, south, 900)
            methods = ("greedy", "ps-hierarchy", "ps-wlop") if crs == "EPSG:32632" else ("greedy",)
            for method in methods:
                with self.subTest(crs=crs, method=method):
                    self.compare(crs[5:] + method, ("build",), dem, "--source-crs", crs, "--method",
                                 method)

    def test_one_tin_and_a_detail_increment_model(self):
        dem = self.root / "degrees.asc"
        write_dem(dem, 6.3, 43.7, 0.01)
        crs = ("--source-crs", "EPSG:4326")
        self.compare("wlop.ply", ("tin",), dem, *crs, "--method", "ps-wlop", "--triangles", 900)
        self.compare("model.h5", ("detail", "build"), dem, *crs)


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    unittest.main()
