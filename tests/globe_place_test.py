#!/usr/bin/env python3
"""DEMs at the poles and across the antimeridian, in projections: built at the right zoom, and whole.

usage: globe_place_test.py QMPIPE
"""
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

QMPIPE = None


def run(*arguments):
    return subprocess.run([QMPIPE, *map(str, arguments)], capture_output=True, text=True,
                          timeout=280, stdin=subprocess.DEVNULL)


def write_dem(path, west, south, pixel, width, height):
    """Hills of some hundred metres, nowhere void."""
    rows = (" ".join(f"{900 + 200 * math.sin(c / 7) * math.cos(r / 5) + c:.2f}"
                     for c in range(width)) for r in range(height))
    path.write_text(f"ncols {width}\nnrows {height}\nxllcorner {west!r}\nyllcorner {south!r}\n"
                    f"cellsize {pixel!r}\n" + "\n".join(rows) + "\n")


class GlobePlace(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="qmpipe-place-")
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)

    def built(self, name, *options):
        done = run("build", self.root / f"{name}.asc", "-o", self.root / name, *options)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done, json.loads((self.root / name / "layer.json").read_text())

    def test_the_zoom_does_not_depend_on_where_the_pole_lies_in_its_pixel(self):
        polar = ("--source-crs", "EPSG:3031")
        # The middle of a pixel, half a kilometre beside it, a corner.
        for name, width, west in (("odd", 101, -252500.0), ("beside", 101, -253134.0),
                                  ("even", 102, -255000.0)):
            write_dem(self.root / f"{name}.asc", west, west, 5000.0, width, width)
            self.assertEqual(self.built(name, *polar)[1]["maxzoom"], 4, name)

    def test_a_smaller_max_zoom_says_what_is_sampled_all_the_same(self):
        write_dem(self.root / "dem.asc", 6.0, 45.0, 0.01, 60, 40)
        done, layer = self.built("dem", "--source-crs", "EPSG:4326", "--max-zoom", 4)
        self.assertEqual(layer["maxzoom"], 4)
        # Two blocks of posts at most each way.
        self.assertRegex(done.stderr, r"tiles end at zoom 4, but posts are taken at zoom 7,.*"
                                      r"at most (65536|131072|262144) posts")
        for zoom in (7, 8):
            done, layer = self.built("dem", "--source-crs", "EPSG:4326", "--max-zoom", zoom,
                                     "--overwrite")
            self.assertNotIn("tiles end at zoom", done.stderr)
        self.assertIn("does not make a run read or keep less",
                      " ".join(run("build", "--help").stdout.split()))


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    unittest.main()
