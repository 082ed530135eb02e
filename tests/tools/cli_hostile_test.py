#!/usr/bin/env python3
"""What a command line, a terminal, a machine's limits and somebody else's set must not do to a run.

usage: cli_hostile_test.py QMPIPE
"""
import json
import os
import pathlib
import random
import re
import resource
import shutil
import socket
import subprocess
import sys
import tempfile
import unittest
import zipfile

QMPIPE = None
COMMANDS = (["build"], ["verify"], ["serve"], ["check"], ["compare"], ["convert"], ["pack"],
            ["unpack"], ["diff"], ["info"], ["tin"], ["synth"], ["detail", "build"],
            ["detail", "extract"], ["detail", "info"], ["detail", "verify"])
# Of the help: the type names of options that take a number (tools/arguments/number_options.h), and of others.
NUMBERS = re.compile(r"(INT|UINT|FLOAT|SECONDS|X,Y,Z|[A-Z])$")
TEXTS = {"TEXT", "OUT", "CRS", "SIZE", "FILE", "DIR", "MESH", "HTML", "REPORT", "LIST", "SHARE",
         "INPUT", "VALUES", "NAME=VALUE", "Z=M,...", "ZOOM/X/Y", "LEVEL|none", "ADDRESS", "ORIGIN", "HOW"}
OPTION = re.compile(r"^  (?:-\w,)?(--[\w-]+) (NAME=VALUE|Z=M,\.\.\.|[A-Z][A-Z,/]*(?:\|none)?)(?=[\s:=])",
                    re.MULTILINE)


def run(*arguments, **options):
    options = {"timeout": 120, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    done = subprocess.run([QMPIPE, *(a if isinstance(a, bytes) else str(a) for a in arguments)],
                          stdin=subprocess.DEVNULL, check=False, **options)
    done.said = done.stderr.decode("utf-8", "replace")
    return done


def numeric_options(command):
    shown = run(*command, "--help").stdout.decode()
    return [name for name, kind in OPTION.findall(shown) if NUMBERS.match(kind)]


class CliHostile(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="qmpipe-hostile-")
        cls.root = pathlib.Path(cls.folder.name)
        cls.dem = cls.root / "dem.tif"
        made = run("synth", "-o", cls.dem, "--size", "200x150", "--bounds", "6,44,6.5,44.375")
        assert made.returncode == 0, made.said
        cls.tiles = cls.root / "tiles"
        made = run("build", cls.dem, "-o", cls.tiles)
        assert made.returncode == 0, made.said
        cls.model = cls.root / "model.h5"
        made = run("detail", "build", cls.dem, "-o", cls.model)
        assert made.returncode == 0, made.said

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def setUp(self):
        self.place = pathlib.Path(tempfile.mkdtemp(dir=self.root))

    def refused(self, done, code, *words):
        self.assertEqual(done.returncode, code, done.said)
        for word in words:
            self.assertIn(word, done.said)
        sentences = [line for line in done.said.splitlines() if not line.startswith("{")]
        self.assertLess(len("".join(sentences)), 1500, done.said)

    # Printing.

    def printing_commands(self):
        """Each command line prints to stdout and ends with 0 when it can."""
        out, tile = self.place, next(self.tiles.rglob("*.terrain"))
        yield from ([*command, "--help"] for command in COMMANDS)
        yield from (["--help"], ["--version"])
        yield from (["info", self.tiles], ["info", self.tiles, "--json"], ["info", tile])
        yield from (["verify", self.tiles], ["verify", self.tiles, "--json"],
                    ["verify", self.tiles, "--source", self.dem])
        yield from (["diff", self.tiles, self.tiles], ["diff", self.tiles, self.tiles, "--json"])
        yield from (["build", self.dem, "-o", out / "a"], ["build", self.dem, "--dry-run"],
                    ["build", self.dem, "-o", out / "b", "--json"],
                    ["build", self.dem, "-o", self.tiles])
        yield ["tin", self.dem, "-o", out / "a.ply", "--triangles", 200]
        yield ["convert", self.tiles, "-o", out / "a.mbtiles"]
        yield ["compare", self.dem, "-o", out / "report", "--methods", "greedy"]
        yield ["detail", "build", self.dem, "-o", out / "a.h5"]
        yield ["detail", "extract", self.model, "-o", out / "b.ply", "--level", 0]
        yield from (["detail", "info", self.model], ["detail", "verify", self.model])

    def test_what_cannot_be_printed_is_no_success(self):
        lines = list(self.printing_commands())
        for line in lines:
            with self.subTest(line), open("/dev/full", "wb") as full:
                self.refused(run(*line, stdout=full), 1, "standard output")
        shutil.rmtree(self.place)
        self.place.mkdir()
        # The same succeed where they can print, so it was the stream that they failed by.
        for line in lines:
            with self.subTest(line):
                done = run(*line)
                self.assertEqual(done.returncode, 0, done.said)
                self.assertTrue(done.stdout)

    def test_a_server_whose_address_nobody_can_read_does_not_start(self):
        with open("/dev/full", "wb") as full:
            self.refused(run("serve", self.tiles, "--port", 0, stdout=full, timeout=30), 1,
                         "standard output")

    # Terminals.

    EVIL = ("\x1b]0;owned\x07", "\x1b[2J", "\x9b31m", "\r", "\x08", "\x7f", "\u202e", "\u2028",
            "\x00", "\nqmpipe: done", "\u2066", "\x1b[1A")

    def assert_harmless(self, printed, what):
        text = printed.decode("utf-8")  # raises where it is no UTF-8
        found = re.search("[^\n\t -~\u00a0-\uffff\U00010000-\U0010ffff]|[\u2028\u2029\u061c\u200e"
                          "\u200f\u202a-\u202e\u2066-\u2069]", text)
        self.assertIsNone(found, f"{what}: {found and repr(text[found.start() - 40:][:80])}")
        self.assertNotIn("\nqmpipe: done", text, what)

    def hostile_text(self, dice, with_zero):
        parts = [e for e in self.EVIL if with_zero or "\x00" not in e]
        return "".join(dice.choice(parts) + dice.choice(("a", "Ü", " ", "高")) for _ in range(3))

    def test_no_text_of_a_set_steers_the_terminal(self):
        for seed in range(8):
            dice = random.Random(seed)
            text = lambda: self.hostile_text(dice, True)
            tiles = self.place / f"set{seed}"
            shutil.copytree(self.tiles, tiles)
            layer = json.loads((tiles / "layer.json").read_text())
            for key in ("name", "description", "attribution", "version", "format", "scheme",
                        "projection", "tilejson"):
                if dice.random() < 0.7:
                    layer[key] = text()
            layer["tiles"] = ["{z}/{x}/{y}.terrain" + text()]
            layer["extensions"] = [text()]
            if dice.random() < 0.7:
                layer["qmpipe"][dice.choice(list(layer["qmpipe"]))] = text()
            (tiles / "layer.json").write_text(json.dumps(layer))
            for line in (["info", tiles], ["info", tiles, "--json"], ["verify", tiles],
                         ["verify", tiles, "--json"], ["diff", tiles, self.tiles],
                         ["verify", tiles, "--source", self.dem],
                         ["convert", tiles, "-o", self.place / f"{seed}.mbtiles"],
                         ["info", self.place / f"{seed}.mbtiles"]):
                done = run(*line)
                self.assertIn(done.returncode, (0, 1, 2, 3))
                self.assert_harmless(done.stdout, f"seed {seed}, stdout of {line}")
                self.assert_harmless(done.stderr, f"seed {seed}, stderr of {line}")

    def test_no_path_or_option_steers_the_terminal(self):
        for seed in range(6):
            dice = random.Random(seed)
            name = self.hostile_text(dice, False).encode() + dice.choice((b"", b"\xff\x9b", b"\xc3"))
            path = bytes(self.place) + b"/" + name
            for line in (["info", path], ["verify", path], ["tin", path, "-o", path + b".ply"],
                         ["build", path, "-o", path], ["build", self.dem, b"--" + name],
                         ["build", self.dem, "--name", name, "-o", path + b"-out"], [name],
                         ["build", self.dem, "--method", name, "-o", path], ["detail", "info", path],
                         ["convert", path + b"-out", "-o", path + b".mbtiles"],
                         ["info", path + b"-out"], ["check", b"http://127.0.0.1:1/" + name],
                         ["build", self.dem, "--threads", name, "-o", path]):
                done = run(*line)
                self.assertIn(done.returncode, (0, 1, 2, 3), done.said)
                self.assert_harmless(done.stdout, f"seed {seed}, stdout of {line}")
                self.assert_harmless(done.stderr, f"seed {seed}, stderr of {line}")

    def test_no_unit_of_a_raster_steers_the_terminal(self):
        raster = self.place / "unit.vrt"
        raster.write_text(
            '<VRTDataset rasterXSize="200" rasterYSize="150"><SRS>EPSG:4326</SRS>'
            "<GeoTransform>6, 0.0025, 0, 44.375, 0, -0.0025</GeoTransform>"
            '<VRTRasterBand dataType="Float32" band="1"><UnitType>\x1b[31m\x9bfur\x07</UnitType>'
            f"<Description>\x1b[2J</Description><SimpleSource><SourceFilename>{self.dem}"
            "</SourceFilename><SourceBand>1</SourceBand></SimpleSource></VRTRasterBand>"
            "</VRTDataset>", encoding="utf-8")
        done = run("build", raster, "-o", self.place / "out")
        self.assertIn("fur", done.said)
        self.assert_harmless(done.stderr, "unit")

    # Numbers.

    def test_every_type_name_of_the_help_is_of_a_number_or_a_text(self):
        for command in COMMANDS:
            for option, kind in OPTION.findall(run(*command, "--help").stdout.decode()):
                with self.subTest(command=command, option=option):
                    self.assertTrue(NUMBERS.match(kind) or kind in TEXTS, kind)

    def test_numbers_are_decimal(self):
        tried = 0
        for command in COMMANDS:
            for option in numeric_options(command):
                for value in ("0x10", "1f", "0b1", "", " 5"):
                    with self.subTest(command=command, option=option, value=value):
                        self.refused(run(*command, self.dem, option, value), 2, option)
                        tried += 1
        self.assertGreater(tried, 100)

    def test_leading_zeros_make_no_octal_number(self):
        done = run("build", self.dem, "-o", self.place / "a", "--max-zoom", "010", "--dry-run", "-v")
        self.assertEqual(done.returncode, 0, done.said)
        self.assertIn("0..10", done.said)
        self.refused(run("build", self.dem, "-o", self.place / "b", "--max-zoom", "099"), 2, "0..24")

    def test_refusals_fit_on_a_screen(self):
        for command in COMMANDS:
            for option in numeric_options(command):
                with self.subTest(command=command, option=option):
                    done = run(*command, self.dem, option, "-1")
                    self.assertNotRegex(done.said, r"\d{25}")
        self.refused(run("build", self.dem, "-o", self.place / "a", "--max-zoom", "-1"), 2,
                     "--max-zoom must be 0..24")

    def test_no_zoom_to_build_is_refused_with_a_line_that_works(self):
        out = self.place / "out"
        for options in (["--min-zoom", 12], ["--min-zoom", 9, "--max-zoom", 8]):
            with self.subTest(options):
                done = run("build", self.dem, "-o", out, *options)
                self.refused(done, 2, "--min-zoom")
                self.assertEqual(list(self.place.iterdir()), [])
                advice = re.search(r"give (--min-zoom \d+)", done.said).group(1).split()
                done = run("build", self.dem, "-o", out, *advice, *options[2:])
                self.assertEqual(done.returncode, 0, done.said)
                shutil.rmtree(out)

    # Names and pipes.

    def test_names_that_are_too_long_are_told(self):
        for name in ("x" * 256, "x" * 250, "y/" * 2500 + "z"):
            for line in (["build", self.dem, "-o", self.place / name],
                         ["build", self.dem, "-o", self.place / (name + ".mbtiles")],
                         ["tin", self.dem, "--triangles", 9, "-o", self.place / (name + ".ply")],
                         ["synth", "-o", self.place / (name + ".tif"), "--size", "9x9"],
                         ["convert", self.tiles, "-o", self.place / (name + ".pmtiles")],
                         ["detail", "build", self.dem, "-o", self.place / (name + ".h5")]):
                with self.subTest(line=line[:2], length=len(name)):
                    done = run(*line)
                    # Of 254 bytes with its ending a name is right, if nothing is added to it on the way.
                    if done.returncode != 0 or len(name) != 250:
                        self.assertEqual(done.returncode, 1, done.said)
                        self.assertRegex(done.said, "(?i)name too long|no folder")
        self.assertEqual([p.name for p in self.place.iterdir() if "qmpipe" in p.name], [])

    def test_pipes_are_refused_and_not_waited_for(self):
        for ending in ("tif", "las", "xyz", "h5", "mbtiles", "pmtiles", "json", "terrain"):
            pipe = self.place / f"pipe.{ending}"
            os.mkfifo(pipe)
            for line in (["build", pipe, "-o", self.place / "out"],
                         ["tin", pipe, "-o", self.place / "a.ply", "--triangles", 9],
                         ["verify", self.tiles, "--source", pipe], ["verify", pipe],
                         ["info", pipe], ["diff", pipe, self.tiles], ["serve", pipe, "--port", 0],
                         ["convert", pipe, "-o", self.place / "b"], ["detail", "info", pipe],
                         ["detail", "build", pipe, "-o", self.place / "b.h5"],
                         ["build", self.dem, "-o", self.place / "c", "--params", pipe]):
                with self.subTest(line[:2], ending=ending):
                    done = run(*line, timeout=20)
                    self.assertIn(done.returncode, (1, 2), done.said)
                    self.assertIn(pipe.name, done.said)
        self.assertEqual([p for p in self.place.iterdir() if not p.is_fifo()], [])

    # Limits of the machine.

    def test_too_little_memory_ends_with_a_sentence(self):
        for kilobytes in (60_000, 150_000, 300_000, 600_000, 1_000_000, 2_000_000):
            def limit(most=kilobytes * 1024):
                resource.setrlimit(resource.RLIMIT_AS, (most, most))
            # In less than what a run says that it takes, an allocation that fails on one thread leaves a
            # mutex of GDAL 3.6 locked for the others, or HDF5 1.10 with a null: nothing of ours.
            threads = 8 if kilobytes > 400_000 else 1
            for line in (["build", self.dem, "-o", self.place / f"o{kilobytes}", "--threads", threads],
                         ["verify", self.tiles, "--source", self.dem, "--threads", 64],
                         ["convert", self.tiles, "-o", self.place / f"{kilobytes}.mbtiles",
                          "--threads", 200],
                         ["detail", "verify", self.model, "--threads", 300]):
                with self.subTest(line[0], kilobytes=kilobytes):
                    done = run(*line, preexec_fn=limit)
                    # 127: the dynamic loader's, before the program begins.
                    self.assertIn(done.returncode, (0, 1, 2, 127), done.said)
                    if done.returncode in (1, 2):
                        # Not the estimate's line, which names the memory too.
                        self.assertRegex(done.said,
                                         r"(?mi)^qmpipe: (?!\d+ tiles).*(memory|MiB|thread|resource)")

    def test_a_lost_database_of_projections_is_not_the_rasters_fault(self):
        lost = {**os.environ, "PROJ_LIB": str(self.place), "PROJ_DATA": str(self.place)}
        for line in (["build", self.dem, "--dry-run"], ["verify", self.tiles, "--source", self.dem]):
            done = run(*line, env=lost)
            self.assertEqual(done.returncode, 1, done.said)
            self.assertRegex(done.said, "(?m)^qmpipe: .*proj.db")
            self.assertNotIn("--source-crs", done.said)

    def test_the_default_of_threads_is_what_the_process_may_use(self):
        one = min(os.sched_getaffinity(0))
        done = run("build", self.dem, "--dry-run", "-v",
                   preexec_fn=lambda: os.sched_setaffinity(0, {one}))
        self.assertEqual(done.returncode, 0, done.said)
        self.assertRegex(done.said, r"threads +1\n")

    # Somebody else's set.

    def set_with_crs(self, text):
        tiles = self.place / "theirs"
        shutil.rmtree(tiles, ignore_errors=True)
        shutil.copytree(self.tiles, tiles)
        layer = json.loads((tiles / "layer.json").read_text())
        layer["qmpipe"]["source_crs"] = text
        (tiles / "layer.json").write_text(json.dumps(layer))
        return tiles

    def test_a_sets_crs_makes_no_request(self):
        with socket.create_server(("127.0.0.1", 0)) as listener:
            port = listener.getsockname()[1]
            listener.settimeout(0.2)
            for text in (f"http://127.0.0.1:{port}/crs", f"/vsicurl/http://127.0.0.1:{port}/a.prj",
                         f"+proj=longlat +nadgrids=http://127.0.0.1:{port}/g.tif",
                         f"http://opengis.net/def/crs/../127.0.0.1:{port}"):
                with self.subTest(text):
                    process = subprocess.Popen(
                        [QMPIPE, "verify", str(self.set_with_crs(text)), "--source", str(self.dem)],
                        stdout=subprocess.PIPE, stderr=subprocess.PIPE)
                    asked = False
                    while process.poll() is None:
                        try:
                            connection, _ = listener.accept()
                            connection.close()
                            asked = True
                        except TimeoutError:
                            pass
                    told = b"".join(process.communicate()).decode()
                    self.assertFalse(asked, "a request was made")
                    self.assertEqual(process.returncode, 3, told)
                    self.assertRegex(told, r"layer\.json.*source_crs")

    def test_a_sets_crs_opens_no_file(self):
        # Whoever opens a pipe that nobody writes to waits.
        pipe = self.place / "pipe.prj"
        os.mkfifo(pipe)
        readable = self.place / "a.prj"
        readable.write_text("EPSG:4326")
        for text in (str(pipe), f"ESRI::{pipe}", f"+init={pipe}:1", f"+proj=longlat +nadgrids={pipe}",
                     str(readable), f"+proj=longlat +geoidgrids=@null,{pipe}",
                     *self.crs_that_names(pipe)):
            with self.subTest(text):
                done = run("verify", self.set_with_crs(text), "--source", self.dem, timeout=30)
                told = done.stdout.decode() + done.said
                self.assertEqual(done.returncode, 3, told)
                self.assertRegex(told, r"layer\.json.*source_crs")

    @staticmethod
    def crs_that_names(path):
        """Texts for which GDAL or PROJ opens the path, most of them while they parse."""
        def utm(datum="", end="", method="Transverse_Mercator"):
            return (f'PROJCS["a",GEOGCS["b",DATUM["c",SPHEROID["WGS 84",6378137,298.257223563]{datum}],'
                    'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],'
                    f'PROJECTION["{method}"],PARAMETER["central_meridian",9],'
                    f'PARAMETER["scale_factor",0.9996],UNIT["metre",1]{end}]')
        yield utm(datum=f',EXTENSION["PROJ4_GRIDS","{path}"]')
        yield utm(end=f',EXTENSION["PROJ4","+proj=tmerc +lon_0=9 +nadgrids={path} +wktext"]')
        yield utm(end=f',EXTENSION["PROJ4","+proj=tmerc +init={path}:1"]')
        yield utm(method=f"PROJ defmodel model={path}")

    def test_a_rasters_crs_opens_no_file(self):
        pipe = self.place / "grid.gsb"
        os.mkfifo(pipe)
        heights = "\n".join(" ".join(str(100 + (i * j) % 7) for i in range(20)) for j in range(20))
        escape = lambda text: text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
        geometry = "<GeoTransform>500000,30,0,5000000,0,-30</GeoTransform>"
        for number, crs in enumerate((*self.crs_that_names(pipe), f"+proj=longlat +nadgrids={pipe}",
                                      f"+init={pipe}:1")):
            asc = self.place / f"prj{number}" / "a.asc"
            asc.parent.mkdir()
            asc.write_text("ncols 20\nnrows 20\nxllcorner 500000\nyllcorner 5000000\ncellsize 30\n"
                           + heights)
            asc.with_suffix(".prj").write_text(crs)
            pam = self.place / f"pam{number}" / "b.asc"
            pam.parent.mkdir()
            pam.write_text(asc.read_text())
            (pam.parent / "b.asc.aux.xml").write_text(
                f"<PAMDataset><SRS>{escape(crs)}</SRS></PAMDataset>")
            vrt = self.place / f"c{number}.vrt"
            vrt.write_text(f'<VRTDataset rasterXSize="20" rasterYSize="20"><SRS>{escape(crs)}</SRS>'
                           f'{geometry}<VRTRasterBand dataType="Float32" band="1"/></VRTDataset>')
            mosaic = self.place / f"d{number}.vrt"
            mosaic.write_text(
                '<VRTDataset rasterXSize="20" rasterYSize="20"><SRS>EPSG:32632</SRS>'
                f'{geometry}<VRTRasterBand dataType="Float32" band="1"><SimpleSource>'
                f'<SourceFilename>{pam}</SourceFilename><SourceBand>1</SourceBand>'
                "</SimpleSource></VRTRasterBand></VRTDataset>")
            archive = self.place / f"e{number}.zip"
            with zipfile.ZipFile(archive, "w") as into:
                into.write(asc, "a.asc")
                into.write(asc.with_suffix(".prj"), "a.prj")
            for raster in (asc, pam, vrt, mosaic, archive):
                for line in (["build", raster, "-o", self.place / "out"],
                             ["tin", raster, "-o", self.place / "a.ply", "--triangles", 9]):
                    with self.subTest(crs=crs, line=line):
                        self.refused(run(*line, timeout=30), 1, str(pipe), "--source-crs")

    def test_a_pipe_beside_a_raster_is_not_waited_for(self):
        for ending in (".aux.xml", ".ovr", ".msk"):
            raster = self.place / ending[1:] / "dem.tif"
            raster.parent.mkdir()
            shutil.copy(self.dem, raster)
            os.mkfifo(str(raster) + ending)
            with self.subTest(ending):
                self.refused(run("build", raster, "-o", self.place / "out", timeout=30), 1, ending,
                             "pipe")

    def test_a_rasters_grid_in_projs_folders_is_used(self):
        """A bare name is no path; the grid in it is read, here none that is one."""
        raster = self.place / "dem.tif"
        shutil.copy(self.dem, raster)
        (self.place / "dem.tif.aux.xml").write_text(
            "<PAMDataset><SRS>+proj=longlat +datum=WGS84 +nadgrids=@null +no_defs</SRS></PAMDataset>")
        done = run("build", raster, "-o", self.place / "out")
        self.assertEqual(done.returncode, 0, done.said)

    def test_a_sets_own_crs_is_still_used(self):
        for text in ("EPSG:4326", "OGC:CRS84", "+proj=longlat +datum=WGS84 +no_defs"):
            with self.subTest(text):
                done = run("verify", self.set_with_crs(text), "--source", self.dem)
                self.assertEqual(done.returncode, 0, done.stdout.decode() + done.said)

    def test_numbers_that_lie_nowhere_are_faults(self):
        changes = {
            "bounds": [-1e308, -1e308, 1e308, 1e308], "minzoom": -2_000_000_000,
            "maxzoom": 2_000_000_000, "metadataAvailability": 2_000_000_000,
            "available": [[{"startX": 0, "startY": 0, "endX": 2147483647, "endY": 2147483647}]]}
        for key, value in changes.items():
            with self.subTest(key):
                tiles = self.place / key
                shutil.copytree(self.tiles, tiles)
                layer = json.loads((tiles / "layer.json").read_text())
                layer[key] = value
                (tiles / "layer.json").write_text(json.dumps(layer))
                done = run("verify", tiles)
                told = done.stdout.decode() + done.said
                self.assertEqual(done.returncode, 3, told)
                self.assertIn("layer.json", told)
                self.assertNotRegex(told, r"\d{25}")
                for command in (["info", tiles], ["convert", tiles, "-o", tiles.with_suffix(".mbtiles")],
                                ["diff", tiles, self.tiles]):
                    done = run(*command)
                    self.assertIn(done.returncode, (0, 1, 3), done.said)
                    self.assertNotRegex(done.stdout.decode() + done.said, r"\d{25}")

    def test_check_shows_no_password(self):
        with socket.create_server(("127.0.0.1", 0)) as listener:
            address = f"127.0.0.1:{listener.getsockname()[1]}"
        for line in (["check", f"http://user:s3cret@{address}/t/"],
                     ["check", f"http://user:s3cret@{address}/t/", "--json"],
                     ["check", f"ftp://user:s3cret@{address}/"], ["check", "user:s3cret@host/t"],
                     ["check", f"http://{address}/", "--origin", "user:s3cret@host"],
                     ["check", f"http://user:s3cret@{address}/t/", "--tiles", "0x10"]):
            with self.subTest(line):
                done = run(*line)
                self.assertNotEqual(done.returncode, 0)
                self.assertNotIn("s3cret", done.stdout.decode() + done.said)


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    unittest.main()
