#!/usr/bin/env python3
"""What the numbers of a raster mean, as a user says it and as the program tells it, in every command
that reads DEMs.

usage: source_heights_test.py QMPIPE
"""
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import unittest

QMPIPE = None
FAULTS = pathlib.Path(os.environ.get("QMPIPE_DATA", pathlib.Path(__file__).resolve().parents[3] /
                                     "shared" / "data")) / "faults"


def run(*arguments):
    done = subprocess.run([QMPIPE, *map(str, arguments)], capture_output=True, text=True,
                          timeout=120, stdin=subprocess.DEVNULL, check=False)
    done.said = done.stdout + done.stderr
    return done


def translate(source, target, *options):
    subprocess.run(["gdal_translate", "-q", *map(str, options), str(source), str(target)], check=True,
                   capture_output=True)


class SourceHeights(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="qmpipe-heights-")
        cls.root = pathlib.Path(cls.folder.name)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def setUp(self):
        self.place = pathlib.Path(tempfile.mkdtemp(dir=self.root))
        self.outputs = 0

    def data(self, name):
        if not (FAULTS / name).exists():
            self.skipTest(f"no {name} (set QMPIPE_DATA)")
        # Some drivers write beside what they read.
        copy = self.place / name
        copy.write_bytes((FAULTS / name).read_bytes())
        return copy

    def grid(self, name, rows, *options, values="Float32"):
        """A raster of 0.01 degrees from rows of numbers."""
        text = self.place / "grid.asc"
        text.write_text(f"ncols {len(rows[0])}\nnrows {len(rows)}\nxllcorner 7\nyllcorner 44\n"
                        "cellsize 0.01\n" + "\n".join(" ".join(map(str, row)) for row in rows))
        path = self.place / name
        translate(text, path, "-a_srs", "EPSG:4326", "-ot", values, *options)
        return path

    def slope(self, name, *options, mark=None, values="Float32", size=40):
        """From 100 m up, the mark in a corner of 8 x 8 pixels."""
        rows = [[mark if mark is not None and c < 8 and r < 8 else 100 + 10 * c + r
                 for c in range(size)] for r in range(size)]
        return self.grid(name, rows, *options, values=values)

    def commands(self, dem, *options):
        """Each that reads a DEM, and what it makes."""
        self.outputs += 1
        tiles = self.place / f"tiles{self.outputs}"
        return (["build", dem, "-o", tiles, "--max-zoom", 8, *options],
                ["tin", dem, "-o", self.place / "a.ply", *options],
                ["detail", "build", dem, "-o", self.place / "a.h5", *options])

    def done(self, *line):
        done = run(*line)
        self.assertEqual(done.returncode, 0, done.said)
        return done

    def heights(self, dem, *options):
        """The lowest and the highest height of its TIN, in metres."""
        done = self.done("tin", dem, "-o", self.place / "h.ply", "--tolerance", 0.5, "--json",
                         *options)
        return json.loads(done.stdout)["height_m"]

    def advice(self, said, option):
        found = re.search(option + r" (\"[^\"]*\"|[^\s;]+)", said)
        self.assertIsNotNone(found, f"no {option} in: {said}")
        return [option, shlex.split(found.group(1))[0]]

    # Voids that nobody declared.

    def test_heights_that_earth_does_not_have_end_each_command_with_a_line_that_works(self):
        for name, mark in (("undeclared_32768_int16.tif", -32768),
                           ("minus1e10_undeclared.tif", -10000000000)):
            dem = self.data(name)
            for line in self.commands(dem):
                with self.subTest(line[:2], dem=name):
                    refused = run(*line)
                    self.assertEqual(refused.returncode, 1, refused.said)
                    self.assertIn(f"2400 of 14400 pixels hold {mark}", refused.said)
                    self.assertIn(name, refused.said)
                    option = self.advice(refused.said, "--void")
                    self.assertNotIn("marks voids", self.done(*line, *option).stderr)
            low, high = self.heights(dem, "--void", mark)
            self.assertTrue(99 < low < high < 901, (low, high))

    def test_values_that_stand_apart_are_named_with_their_count(self):
        dem = self.data("undeclared_9999.tif")
        for line in self.commands(dem):
            with self.subTest(line[:2]):
                told = self.done(*line)
                self.assertIn("-9999 stands in 2400 of 14400 pixels", told.stderr)
                option = self.advice(told.stderr, "--void")
                if line[0] == "build":
                    line += ["--overwrite"]
                self.assertNotIn("-9999", self.done(*line, *option).stderr)

    def test_allowed_heights_are_taken(self):
        dem = self.slope("a.tif", mark=-20000)
        for line in self.commands(dem, "--allow-heights"):
            with self.subTest(line[:2]):
                self.done(*line)
        self.assertEqual(self.heights(dem, "--allow-heights")[0], -20000)

    def test_good_heights_are_passed_over_in_silence(self):
        for name, options in (("plain.tif", []), ("declared.tif", ["-a_nodata", -32768])):
            dem = self.slope(name, *options, mark=-32768 if options else None, values="Int16")
            for line in self.commands(dem):
                with self.subTest(line[:2], dem=name):
                    self.assertNotIn("void", self.done(*line).stderr)

    def test_a_mosaic_is_judged_where_it_is_read(self):
        # The lower-priority raster's void values lie under valid heights of the first.
        first = self.slope("first.tif")
        second = self.slope("second.tif", mark=-32768)
        done = self.done("build", first, second, "-o", self.place / "tiles")
        self.assertNotIn("-32768", done.stderr)
        refused = run("build", second, first, "-o", self.place / "others")
        self.assertEqual(refused.returncode, 1, refused.said)

    def test_verify_takes_what_a_set_was_built_with(self):
        dem = self.slope("a.tif", mark=-9999)
        tiles = self.place / "tiles"
        options = ["--void", "-9999,<-12000", "--z-scale", "0.5", "--z-offset", "-30"]
        self.done("build", dem, "-o", tiles, *options)
        recipe = json.loads((tiles / "layer.json").read_text())["qmpipe"]
        self.assertEqual(recipe["heights"], {"void": "-9999,<-12000", "z-scale": 0.5,
                                             "z-offset": -30})
        self.assertIn("0 faults", self.done("verify", tiles, "--source", dem).stdout)
        # Where all that a tile would have is void.
        half = self.grid("half.tif", [[-9999 if c < 300 else c for c in range(600)]
                                      for _ in range(300)])
        self.done("build", half, "-o", self.place / "half", "--void", -9999)
        self.assertIn("0 faults", self.done("verify", self.place / "half", "--source", half).stdout)
        # What is given by hand goes first.
        done = run("verify", tiles, "--source", dem, "--z-offset", 4000)
        self.assertEqual(done.returncode, 3, done.said)

    def test_verify_of_a_set_with_allowed_heights_does_not_stop(self):
        dem = self.slope("a.tif", mark=-20000)
        tiles = self.place / "tiles"
        self.done("build", dem, "-o", tiles, "--allow-heights")
        self.assertIn("0 faults", self.done("verify", tiles, "--source", dem).stdout)

    def test_another_set_in_its_place_is_refused_by_the_option(self):
        dem = self.slope("a.tif", mark=-9999)
        tiles = self.place / "tiles"
        self.done("build", dem, "-o", tiles)
        for option, value in (("--void", "-9999"), ("--z-scale", "2"), ("--z-offset", "1")):
            with self.subTest(option):
                refused = run("build", dem, "-o", tiles, option, value)
                self.assertEqual(refused.returncode, 1, refused.said)
                self.assertIn(option, refused.stderr)
        # It decides whether a run ends, and not what comes of it.
        self.assertIn("built already", self.done("build", dem, "-o", tiles, "--allow-heights").stdout)

    # Which way up, above what.

    def test_depths_become_heights_in_every_command(self):
        for name, reason in (("nc_depth_down.nc", "'positive' is 'down'"),
                             ("depth_crs.tif", "'MSL depth' points down")):
            dem = self.data(name)
            options = ["--source-crs", "EPSG:4326"] if name.endswith(".nc") else []
            for line in self.commands(dem, *options):
                with self.subTest(line[:2], dem=name):
                    told = self.done(*line).stderr
                    self.assertIn(reason, told)
                    self.assertEqual(self.advice(told, "--z-scale"), ["--z-scale", "-1"])
            low, high = self.heights(dem, *options)
            self.assertTrue(-1000 < low < high < -50, (low, high))
            low, high = self.heights(dem, *options, "--z-scale", -1, "--z-offset", 5)
            self.assertTrue(55 < low < high < 1005, (low, high))
            tiles = self.place / f"deep-{name}"
            self.done("build", dem, "-o", tiles, *options)
            self.assertIn("0 faults", self.done("verify", tiles, "--source", dem).stdout)

    def test_a_declared_datum_is_named_and_nothing_is_converted(self):
        told = self.done("build", self.data("rd28992.tif"), "-o", self.place / "a").stderr
        self.assertRegex(told, "above 'NAP height': nothing is converted .*geoid")
        # A datum of one source does not silence the note about another.
        both = [self.data("rd28992.tif"), self.slope("plain.tif")]
        told = self.done("build", *both, "-o", self.place / "b", "--max-zoom", 6).stderr
        self.assertIn("NAP height", told)
        self.assertIn("names no vertical datum", told)
        # Heights above the ellipsoid need neither.
        dem = self.place / "geodetic.tif"
        translate(self.slope("c.tif"), dem, "-a_srs", "EPSG:4979")
        told = self.done("build", dem, "-o", self.place / "c").stderr
        self.assertNotIn("geoid", told)

    # Which numbers are heights.

    def test_pictures_are_refused_and_decoded_where_they_encode_heights(self):
        picture, encoded = self.data("rgb_picture.tif"), self.data("terrain_rgb.tif")
        for line in (*self.commands(picture), *self.commands(encoded)):
            with self.subTest(line[:3]):
                refused = run(*line)
                self.assertEqual(refused.returncode, 1, refused.said)
                self.assertIn("picture", refused.said)
                self.assertIn("--encoding terrarium", refused.said)
                self.assertIn("--band 1", refused.said)
        self.assertIn("--encoding terrain-rgb (which they look like)",
                      run("tin", encoded, "-o", self.place / "a.ply").said)
        for line in self.commands(encoded, "--encoding", "terrain-rgb"):
            with self.subTest(line[:2]):
                self.done(*line)
        low, high = self.heights(encoded, "--encoding", "terrain-rgb")
        self.assertTrue(-500 < low < high < 9000, (low, high))
        tiles = self.place / "decoded"
        self.done("build", encoded, "-o", tiles, "--encoding", "terrain-rgb")
        self.assertIn("0 faults", self.done("verify", tiles, "--source", encoded).stdout)
        self.assertEqual(self.heights(picture, "--band", 1)[0] >= 0, True)

    def test_the_grid_that_is_a_height_is_taken_from_a_container(self):
        dem = self.data("nc_tid_first.nc")
        for line in self.commands(dem):
            with self.subTest(line[:2]):
                self.assertRegex(self.done(*line).stderr, "elevation is taken.*name.*tid'")
        self.assertGreater(self.heights(dem)[1], 100)
        self.done("tin", f'NETCDF:"{dem}":tid', "-o", self.place / "tid.ply")

    def test_bands_are_chosen_by_number(self):
        one, two = self.slope("one.tif"), self.slope("two.tif", mark=5000)
        both = self.place / "both.vrt"
        subprocess.run(["gdalbuildvrt", "-q", "-separate", str(both), str(one), str(two)],
                       check=True)
        for line in self.commands(both):
            self.assertIn("--band 2", self.done(*line).stderr)
        self.assertLess(self.heights(both)[1], 1000)
        self.assertEqual(self.heights(both, "--band", 2)[1], 5000)
        refused = run("tin", both, "-o", self.place / "a.ply", "--band", 3)
        self.assertEqual(refused.returncode, 1)
        self.assertIn("2 bands", refused.said)

    def test_the_fine_grid_of_a_bag_is_an_open_option_away(self):
        bag = self.data("test_vr.bag")
        told = self.done("build", bag, "-o", self.place / "coarse").stderr
        option = self.advice(told, "--oo")
        self.assertEqual(option, ["--oo", "MODE=RESAMPLED_GRID"])
        deepest = {}
        for name, options in (("coarse", []), ("fine", option)):
            tiles = self.place / name
            if options:
                self.done("build", bag, "-o", tiles, *options)
            self.assertIn("0 faults", self.done("verify", tiles, "--source", bag).stdout)
            deepest[name] = json.loads((tiles / "layer.json").read_text())["maxzoom"]
        self.assertGreater(deepest["fine"], deepest["coarse"] + 1)

    def test_configuration_reaches_gdal_and_secrets_no_file(self):
        dem = self.slope("a.tif")
        tiles = self.place / "tiles"
        options = ["--config", "GDAL_CACHEMAX=64", "--config", "AWS_SECRET_ACCESS_KEY=hunter2",
                   "--oo", "API_KEY=hunter2", "--oo", "NUM_THREADS=1"]
        done = self.done("build", dem, "-o", tiles, "-v", *options)
        self.assertNotIn("hunter2", done.said)
        self.assertIn("no open option API_KEY", done.stderr)
        for path in tiles.rglob("*"):
            if path.is_file():
                self.assertNotIn(b"hunter2", path.read_bytes(), path)
        heights = json.loads((tiles / "layer.json").read_text())["qmpipe"]["heights"]
        self.assertEqual(heights, {"config": ["GDAL_CACHEMAX"], "oo": ["NUM_THREADS=1"]})
        self.assertIn("built already", self.done("build", dem, "-o", tiles, *options).stdout)
        # Another value of what a set was built with is another set.
        refused = run("build", dem, "-o", tiles, "--config", "GDAL_CACHEMAX=65", *options[2:])
        self.assertEqual(refused.returncode, 1, refused.said)
        self.assertIn("--config", refused.stderr)
        # It reaches GDAL: a driver that is skipped opens nothing.
        refused = run("build", dem, "-o", self.place / "b", "--config", "GDAL_SKIP=GTiff")
        self.assertEqual(refused.returncode, 1, refused.said)

    def test_options_of_somebody_elses_set_name_no_files(self):
        dem = self.slope("a.tif")
        tiles = self.place / "tiles"
        self.done("build", dem, "-o", tiles)
        layer = json.loads((tiles / "layer.json").read_text())
        for heights in ({"oo": ["GEOREF_SOURCES=/etc/passwd"]}, {"oo": ["A=<VRTDataset>"]},
                        {"oo": ["A=http://127.0.0.1/"]}, {"oo": "x"}, {"config": ["A/B"]},
                        {"band": 0}, {"band": 1e9}, {"void": 3}, {"void": "x"}, {"z-scale": 0},
                        {"z-offset": 1e300}, {"encoding": "x"}, []):
            with self.subTest(heights):
                layer["qmpipe"]["heights"] = heights
                (tiles / "layer.json").write_text(json.dumps(layer))
                done = run("verify", tiles, "--source", dem)
                self.assertEqual(done.returncode, 3, done.said)
                self.assertIn("layer.json", done.said)

    # Units.

    def test_units_and_what_a_unit_of_the_crs_may_mean(self):
        self.assertNotIn("unknown", self.done(*self.commands(self.data("unit_usfoot.tif"))[0]).stderr)
        low, high = self.heights(self.data("unit_usfoot.tif"))
        self.assertTrue(99 < low < high < 902, (low, high))
        dem = self.data("stateplane_ftus.tif")
        for line in self.commands(dem):
            with self.subTest(line[:2]):
                option = self.advice(self.done(*line).stderr, "--z-scale")
        feet = self.heights(dem)[1]
        self.assertAlmostEqual(self.heights(dem, *option)[1], feet * 1200 / 3937, delta=0.01)

    # Where, and on which body.

    def test_each_kind_of_misplaced_raster_has_its_own_remedy(self):
        points = self.data("gcp_only.tif")
        for options in ([], ["--source-crs", "EPSG:4326"]):
            refused = run("build", points, "-o", self.place / "a", *options)
            self.assertEqual(refused.returncode, 1, refused.said)
            remedy = re.search("gdalwarp .*", refused.said).group()
            self.assertNotIn("--source-crs", refused.said)
        warped = self.place / "warped.tif"
        subprocess.run([*shlex.split(remedy.replace("FILE", str(points)).replace(
            "NEW.tif", str(warped)))], check=True, capture_output=True)
        self.done("build", warped, "-o", self.place / "a")

        netcdf = self.data("nc_proj_topdown.nc")
        refused = run("build", netcdf, "-o", self.place / "b")
        self.assertEqual(refused.returncode, 1, refused.said)
        self.assertIn("--source-crs", refused.said)
        self.assertNotIn("a_ullr", refused.said)
        self.done("build", netcdf, "-o", self.place / "b", "--source-crs", "EPSG:32632")

    def test_a_crs_that_cannot_be_that_of_the_raster_is_refused(self):
        metres = self.place / "metres.tif"
        translate(self.slope("a.tif"), metres, "-a_srs", "EPSG:32632", "-a_ullr", 500000, 4900000,
                  501000, 4899000)
        for crs, words in (("EPSG:5773", "heights alone"), ("EPSG:4978", "centre"),
                           ("EPSG:4326", "no degrees")):
            for line in self.commands(metres, "--source-crs", crs):
                with self.subTest(line[:2], crs=crs):
                    refused = run(*line)
                    self.assertEqual(refused.returncode, 2, refused.said)
                    self.assertIn(words, refused.said)
                    self.assertIn("--source-crs " + crs, refused.said)

    def test_another_body_is_refused_and_never_said_to_be_earth(self):
        mars = self.data("mars.tif")
        for line in self.commands(mars):
            with self.subTest(line[:2]):
                refused = run(*line)
                self.assertEqual(refused.returncode, 1, refused.said)
                self.assertIn("another body", refused.said)
                self.assertNotIn("EPSG", refused.said)
        remedy = re.search('gdalwarp .*', refused.said).group()
        plane = self.place / "plane.tif"
        subprocess.run(shlex.split(remedy.replace("FILE", str(mars)).replace(
            "NEW.tif", str(plane))), check=True, capture_output=True)
        self.done("tin", plane, "-o", self.place / "mars.ply")

    def test_compare_measures_against_what_it_built_from(self):
        dem = self.slope("a.tif", mark=-32768, size=300)
        self.done("compare", dem, "-o", self.place / "report", "--methods", "greedy", "--void",
                  -32768, "--max-zoom", 6)

    def test_nonsense_is_refused(self):
        dem = self.slope("a.tif")
        for option, values in (("--void", ("x", "<", "1,", "<1,<2", "nan")),
                               ("--z-scale", ("0", "x", "nan", "1e99")),
                               ("--z-offset", ("x", "inf", "1e9")),
                               ("--band", ("0", "-1", "x")), ("--encoding", ("x", "")),
                               ("--oo", ("x", "=1")), ("--config", ("x", "=1"))):
            for value in values:
                for line in (*self.commands(dem), ["verify", self.place, "--source", dem]):
                    with self.subTest(line[:2], option=option, value=value):
                        done = run(*line, option, value)
                        self.assertEqual(done.returncode, 2, done.said)
                        self.assertIn(option, done.stderr)
        done = run("tin", dem, "-o", self.place / "a.ply", "--band", 1, "--encoding", "terrarium")
        self.assertEqual(done.returncode, 2, done.said)


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    unittest.main()
