#!/usr/bin/env python3
"""The ground outside the data: fine DEMs far above 0 m build with default options, all zooms show one
surface without cliffs there, headers are tight, and a refusal names what works and leaves nothing.

usage: outside_test.py QMPIPE
"""
import gzip
import json
import math
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import unittest

QMPIPE = None


def run(*arguments):
    return subprocess.run([QMPIPE, *map(str, arguments)], capture_output=True, text=True,
                          timeout=280, stdin=subprocess.DEVNULL)


def write_dem(path, pixel_m, height_m, relief_m, size=(180, 140), void=None, north_m=5300000):
    """Hills in UTM zone 33, the lowest at height_m; `void(column, row)` tells where there are none."""
    width, height = size
    rows = []
    for r in range(height):
        row = []
        for c in range(width):
            h = height_m + relief_m * (0.5 + 0.3 * math.sin(c / 17) * math.cos(r / 13)
                                       + 0.2 * math.sin(c / 5 + r / 7))
            row.append("-9999" if void and void(c, r) else f"{h:.3f}")
        rows.append(" ".join(row))
    path.write_text(f"ncols {width}\nnrows {height}\nxllcorner 450000\nyllcorner {north_m}\n"
                    f"cellsize {pixel_m}\nNODATA_value -9999\n" + "\n".join(rows) + "\n")


def header_and_heights(path):
    data = path.read_bytes()
    if data[:2] == b"\x1f\x8b":
        data = gzip.decompress(data)
    low, high = struct.unpack_from("<2f", data, 24)
    count, = struct.unpack_from("<I", data, 88)
    codes = struct.unpack_from(f"<{count}H", data, 92 + 4 * count)
    h, heights = 0, []
    for code in codes:
        h += (code >> 1) ^ -(code & 1)
        heights.append(h)
    step = (high - low) / 32767
    return low, high, low + min(heights) * step, low + max(heights) * step


class Outside(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="qmpipe-outside-")
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        self.out = self.root / "tiles"

    def dem(self, *values, **options):
        path = self.root / "dem.asc"
        write_dem(path, *values, **options)
        return path

    def build(self, dem, *options):
        return run("build", dem, "-o", self.out, "--source-crs", "EPSG:32633", *options)

    def built(self, dem, *options):
        done = self.build(dem, *options)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done

    def verified(self, dem):
        done = run("verify", self.out, "--source", dem, "--source-crs", "EPSG:32633", "--json")
        report = json.loads(done.stdout)
        self.assertEqual(report["faults"], [], done.stdout[:2000])
        return report

    def test_fine_dems_far_above_zero_build_with_default_options(self):
        # Lidar in the Alps and the Andes, a drone's survey, a photogrammetric one; below the sea too.
        for pixel_m, height_m, relief_m in ((1, 2500, 30), (0.5, 5200, 60), (0.02, 311, 4),
                                            (0.1, 3999, 0.5), (1, -4000, 25)):
            with self.subTest(pixel_m=pixel_m, height_m=height_m):
                dem = self.dem(pixel_m, height_m, relief_m)
                self.built(dem, "--overwrite")
                self.verified(dem)
                self.check_headers()

    def check_headers(self):
        judged = 0
        for tile in self.out.glob("*/*/*.terrain"):
            low, high, lowest, highest = header_and_heights(tile)
            if highest - lowest > 100:
                judged += 1
                self.assertLessEqual(high - low, 1.15 * (highest - lowest), tile)
        self.assertGreater(judged, 0)

    def test_high_mountains_beside_the_sea_have_tight_headers(self):
        dem = self.dem(90, 0, 8600)
        self.built(dem)
        self.verified(dem)
        self.check_headers()

    def test_holes_and_islands_are_one_surface_for_all_zooms(self):
        def void(c, r):
            return (c - 60) ** 2 + (r - 70) ** 2 < 900 or c + r > 250
        dem = self.dem(10, 1500, 700, void=void)
        for policy in ("pull", "omit", "pull=5000", "height=1200"):
            with self.subTest(policy=policy):
                self.built(dem, "--overwrite", "--nodata", policy, "--tolerance", 2000)
                self.verified(dem)

    def test_omit_writes_no_tile_with_a_void_that_nothing_needs(self):
        dem = self.dem(10, 1500, 700)
        self.built(dem)
        whole = {str(p.relative_to(self.out)) for p in self.out.glob("*/*/*.terrain")}
        self.built(dem, "--overwrite", "--nodata", "omit")
        omitted = {str(p.relative_to(self.out)) for p in self.out.glob("*/*/*.terrain")}
        self.assertLess(omitted, whole)
        deepest = max(int(name.split("/")[0]) for name in whole)
        # The deepest zoom has no tile but those that are full; 180 x 140 pixels fill few.
        count = sum(name.startswith(f"{deepest}/") for name in omitted)
        self.assertLess(count, sum(name.startswith(f"{deepest}/") for name in whole))
        self.verified(dem)

    def test_a_cliff_or_levels_apart_outside_the_data_are_faults(self):
        dem = self.dem(1, 2000, 20)
        self.built(dem)
        # The set says that its voids fade, but they were at 0 m at once.
        layer = (self.out / "layer.json").read_text()
        done = self.build(dem, "--overwrite", "--nodata", "height=0", "--tolerance-at",
                          ",".join(f"{z}=0.5" for z in range(15, 20)))
        self.assertEqual(done.returncode, 0, done.stderr)
        flat = json.loads((self.out / "layer.json").read_text())
        flat["qmpipe"]["nodata"] = "pull"
        flat["qmpipe"]["nodata_base_zoom"] = json.loads(layer)["qmpipe"]["nodata_base_zoom"]
        (self.out / "layer.json").write_text(json.dumps(flat))
        done = run("verify", self.out, "--source", dem, "--source-crs", "EPSG:32633", "--json")
        self.assertEqual(done.returncode, 3)
        kinds = json.loads(done.stdout)["counts"]
        self.assertIn("cliff-outside", kinds)
        self.assertIn("levels-apart-outside", kinds)

    def test_a_tolerance_that_cannot_work_is_refused_with_a_line_that_does(self):
        dem = self.dem(30, 0, 4000)
        for options in ((), ("--run-folder", self.root / "run")):
            done = self.build(dem, "--tolerance-at", "10=0.01,11=0.02", *options)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertEqual([p.name for p in self.root.iterdir()], ["dem.asc"])
        line = re.search(r"--tolerance-at (\S+)", done.stderr.split("works for all zooms")[1])
        self.built(dem, "--tolerance-at", line[1])
        self.verified(dem)

    def test_a_default_tolerance_ends_at_what_the_format_holds(self):
        # A tower on a plain: 3,000 m within a tile of 300 m.
        def height(c, r):
            return 3000 if 40 < c < 90 and 40 < r < 90 else 10
        path = self.root / "dem.asc"
        rows = "\n".join(" ".join(str(height(c, r)) for c in range(140)) for r in range(140))
        path.write_text("ncols 140\nnrows 140\nxllcorner 450000\nyllcorner 5300000\ncellsize 0.2\n"
                        "NODATA_value -9999\n" + rows + "\n")
        done = self.built(path)
        self.assertIn("32,768", done.stderr)
        self.verified(path)

    def test_nothing_is_left_of_a_run_without_data(self):
        dem = self.dem(10, 100, 5, size=(20, 20), void=lambda c, r: True)
        parts = self.root / "parts.vrt"
        made = subprocess.run(["gdalbuildvrt", "-q", "-a_srs", "EPSG:32633", parts, dem],
                              capture_output=True, text=True, timeout=60)
        self.assertEqual(made.returncode, 0, made.stderr)
        for out in ("tiles", "deep/er/tiles", "one.mbtiles"):
            done = run("build", dem, "-o", self.root / out, "--source-crs", "EPSG:32633")
            self.assertEqual(done.returncode, 1)
            self.assertIn("no valid post", done.stderr)
            self.assertEqual(sorted(p.name for p in self.root.iterdir()), ["dem.asc", "parts.vrt"])
        dem.unlink()
        done = run("build", parts, "-o", self.out)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertEqual([p.name for p in self.root.iterdir()], ["parts.vrt"])

    def test_an_empty_folder_that_was_there_stays(self):
        self.out.mkdir()
        dem = self.dem(10, 100, 5, size=(20, 20), void=lambda c, r: True)
        self.assertEqual(self.build(dem).returncode, 1)
        self.assertTrue(self.out.is_dir())


if __name__ == "__main__":
    QMPIPE = str(pathlib.Path(sys.argv.pop(1)).resolve())
    unittest.main(verbosity=2)
