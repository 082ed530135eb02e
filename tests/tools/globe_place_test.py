#!/usr/bin/env python3
"""DEMs at the poles, across the antimeridian and in many files: built at the right zoom, and whole.

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
TURN_M = 40075016.6855785  # once round the globe in EPSG:3857 and EPSG:4087


def run(*arguments):
    return subprocess.run([QMPIPE, *map(str, arguments)], capture_output=True, text=True,
                          timeout=280, stdin=subprocess.DEVNULL)


def hills(width, height):
    """Of some hundred metres, nowhere void; rows from the north."""
    return [[900 + 200 * math.sin(c / 7) * math.cos(r / 5) + c for c in range(width)]
            for r in range(height)]


def write_grid(path, west, south, pixel, rows):
    path.write_text(f"ncols {len(rows[0])}\nnrows {len(rows)}\nxllcorner {west!r}\n"
                    f"yllcorner {south!r}\ncellsize {pixel!r}\nNODATA_value -9999\n" +
                    "\n".join(" ".join(f"{h:.2f}" for h in row) for row in rows) + "\n")


def write_dem(path, west, south, pixel, width, height):
    write_grid(path, west, south, pixel, hills(width, height))


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

    def tiles(self, name):
        folder = self.root / name
        return {str(path.relative_to(folder)): path.read_bytes()
                for path in sorted(folder.rglob("*.terrain"))}

    def verified(self, name, *sources, crs, code=0):
        done = run("verify", self.root / name, "--source-crs", crs,
                   *(part for source in sources for part in ("--source", self.root / source)))
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout

    def test_a_mercator_dem_past_180_degrees_is_whole(self):
        west, south, pixel = 19950000.0, -1740000.0, 2000.0
        for name, shift in (("here", 0), ("a_turn_back", -TURN_M), ("two_on", 2 * TURN_M)):
            write_dem(self.root / f"{name}.asc", west + shift, south, pixel, 120, 120)
        for scheme in ("geodetic", "mercator"):
            options = ("--source-crs", "EPSG:3857", "--scheme", scheme, "--overwrite")
            _, layer = self.built("here", *options)
            deepest = layer["available"][-1]
            columns = (2 if scheme == "geodetic" else 1) << layer["maxzoom"]
            self.assertEqual({min(r["startX"] for r in deepest), max(r["endX"] for r in deepest)},
                             {0, columns - 1})
            self.verified("here", "here.asc", crs="EPSG:3857")
            for name in ("a_turn_back", "two_on"):
                self.built(name, *options)
                self.assertEqual(self.tiles(name), self.tiles("here"), f"{name} {scheme}")

    def test_a_globe_from_0_to_360_degrees_is_that_from_180_west_to_180_east(self):
        width, height = 90, 45
        rows = hills(width, height)
        write_grid(self.root / "east.asc", 0.0, -TURN_M / 4, TURN_M / width, rows)
        write_grid(self.root / "both.asc", -TURN_M / 2, -TURN_M / 4, TURN_M / width,
                   [row[width // 2:] + row[:width // 2] for row in rows])
        for scheme in ("geodetic", "mercator"):
            for name in ("east", "both"):
                self.built(name, "--source-crs", "EPSG:4087", "--scheme", scheme, "--overwrite")
            self.assertEqual(self.tiles("east"), self.tiles("both"))
            self.verified("east", "both.asc", crs="EPSG:4087")

    def test_verify_sees_heights_that_the_build_had_no_place_for(self):
        # The map of a sinusoidal projection ends at 180 degrees.
        crs = "+proj=sinu +datum=WGS84"
        write_dem(self.root / "edge.asc", 11000000.0, 6000000.0, 8000.0, 80, 40)
        done, _ = self.built("edge", "--source-crs", crs)
        self.assertRegex(done.stderr, r"about \d+ % of its pixels have heights that lie nowhere")
        self.assertIn("missing-tile", self.verified("edge", "edge.asc", crs=crs, code=3))
        write_dem(self.root / "inside.asc", 9900000.0, 6000000.0, 8000.0, 80, 40)
        self.assertNotIn("nowhere", self.built("inside", "--source-crs", crs)[0].stderr)
        self.verified("inside", "inside.asc", crs=crs)

    def test_a_dem_that_was_cut_into_files_gives_the_tiles_of_the_whole(self):
        rows = hills(90, 70)
        for r in range(20, 30):
            rows[r][40:60] = [-9999] * 20
        west, south, pixel = 5.0, 44.0, 0.01
        write_grid(self.root / "whole.asc", west, south, pixel, rows)
        files = []
        for r0, r1 in ((0, 1), (1, 33), (33, 70)):
            for c0, c1 in ((0, 31), (28, 60), (60, 62), (62, 90)):
                name = self.root / f"part{len(files)}.asc"
                write_grid(name, west + c0 * pixel, south + (len(rows) - r1) * pixel, pixel,
                           [row[c0:c1] for row in rows[r0:r1]])
                files.append(name)
        crs = ("--source-crs", "EPSG:4326")
        for resampling in ("bilinear", "cubic"):
            self.built("whole", *crs, "--resampling", resampling, "--overwrite")
            for order in (files, files[::-1]):
                done = run("build", *order, "-o", self.root / "cut", *crs, "--resampling",
                           resampling, "--overwrite")
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn("12 of 12 inputs lie on one grid", done.stderr)
                self.assertEqual(self.tiles("cut"), self.tiles("whole"))
        done = run("verify", self.root / "cut", "--source", self.root / "whole.asc")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

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
