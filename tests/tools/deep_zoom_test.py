#!/usr/bin/env python3
"""DEMs of pixels of a centimetre and less: they build at their own zoom and keep what they show.

usage: deep_zoom_test.py QMPIPE
"""
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

QMPIPE = None
EAST_M, NORTH_M = 448000.0, 4800000.0  # UTM zone 31


def run(*arguments):
    return subprocess.run([QMPIPE, *map(str, arguments)], capture_output=True, text=True,
                          timeout=280, stdin=subprocess.DEVNULL)


def write_dem(path, pixel_m, width, height):
    """Sand with ripples of 8 cm, and a stone with a sharp edge."""
    rows = []
    for r in range(height):
        y = (height - 1 - r) * pixel_m
        row = []
        for x in (c * pixel_m for c in range(width)):
            stone = math.hypot(x - 0.4 * width * pixel_m, y - 0.5 * height * pixel_m)
            h = 2 + 0.02 * math.sin(x / 0.08 * 2 * math.pi) + 0.1 * y
            row.append(h + (0.15 if stone < 0.2 * height * pixel_m else 0))
        rows.append(" ".join(f"{h:.5f}" for h in row))
    path.write_text(f"ncols {width}\nnrows {height}\nxllcorner {EAST_M}\nyllcorner {NORTH_M}\n"
                    f"cellsize {pixel_m}\n" + "\n".join(rows) + "\n")


class DeepZoom(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="qmpipe-deep-")
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)

    def build(self, dem, *options):
        out = self.root / "tiles"
        done = run("build", dem, "-o", out, "--source-crs", "EPSG:32631", *options)
        self.assertEqual(done.returncode, 0, done.stderr)
        return out, json.loads((out / "layer.json").read_text())

    def verified(self, out, dem):
        done = run("verify", out, "--source", dem, "--source-crs", "EPSG:32631")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done.stdout

    def test_a_pixel_of_a_centimetre_builds_at_its_own_zoom(self):
        dem = self.root / "sand.asc"
        write_dem(dem, 0.01, 240, 180)
        out, layer = self.build(dem)
        self.assertEqual(layer["maxzoom"], 23)
        text = self.verified(out, dem)
        self.assertIn("0 faults", text)

    def test_the_deepest_zoom_in_every_form_and_scheme(self):
        dem = self.root / "sand.asc"
        write_dem(dem, 0.004, 100, 90)
        for scheme in ("geodetic", "mercator"):
            with self.subTest(scheme):
                out = self.root / scheme
                options = ("--source-crs", "EPSG:32631", "--scheme", scheme, "--max-zoom", 24)
                done = run("build", dem, "-o", out, *options)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn("0 faults", self.verified(out, dem))
                for form in ("mbtiles", "pmtiles"):
                    other = self.root / f"{scheme}.{form}"
                    self.assertEqual(run("convert", out, "-o", other).returncode, 0)
                    back = run("diff", out, other)
                    self.assertEqual(back.returncode, 0, back.stdout + back.stderr)

    def test_every_method_keeps_the_ripples(self):
        dem = self.root / "sand.asc"
        write_dem(dem, 0.005, 70, 60)
        for method in ("edge-collapse", "ps-random", "ps-grid", "ps-hierarchy", "ps-wlop"):
            with self.subTest(method):
                out = self.root / method
                done = run("build", dem, "-o", out, "--source-crs", "EPSG:32631", "--method", method,
                           "--max-zoom", 24)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn("0 faults", self.verified(out, dem))

    def test_deeper_than_the_deepest_is_told(self):
        dem = self.root / "sand.asc"
        write_dem(dem, 0.01, 8, 8)
        done = run("build", dem, "-o", self.root / "x", "--source-crs", "EPSG:32631",
                   "--max-zoom", 25)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("--max-zoom must be 0..24", done.stderr)


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    unittest.main()
