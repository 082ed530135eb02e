#!/usr/bin/env python3
"""The program as a person meets it: exit codes, messages, results on stdout, files.

usage: cli_test.py QMPIPE
"""
import contextlib
import fcntl
import json
import os
import pathlib
import pty
import re
import signal
import sqlite3
import struct
import subprocess
import sys
import tempfile
import termios
import time
import unittest

QMPIPE = None


def run(*arguments, **options):
    return subprocess.run([QMPIPE, *map(str, arguments)], capture_output=True, text=True,
                          timeout=120, stdin=subprocess.DEVNULL, **options)


class Cli(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="qmpipe-cli-")
        cls.root = pathlib.Path(cls.folder.name)
        cls.dem = cls.root / "dem.tif"
        done = run("synth", "-o", cls.dem, "--size", "400x300", "--bounds", "6,44,7,44.75",
                   "--seed", 3)
        assert done.returncode == 0, done.stderr
        cls.tiles = cls.root / "tiles"
        cls.built = run("build", cls.dem, "-o", cls.tiles)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def fails(self, code, *arguments, says=(), **options):
        done = run(*arguments, **options)
        self.assertEqual(done.returncode, code, done.stderr)
        for text in says:
            self.assertIn(text, done.stderr)
        self.assertTrue(done.stderr.strip(), "no message")
        return done

    def test_help_names_every_command(self):
        done = run("--help")
        self.assertEqual(done.returncode, 0)
        for command in ("build", "verify", "serve", "check", "compare", "info", "tin", "synth",
                        "convert", "pack", "unpack", "diff"):
            self.assertIn(command, done.stdout)

    def test_each_command_has_help_with_an_example(self):
        for command in ("build", "verify", "serve", "check", "compare", "info", "tin", "synth",
                        "convert", "pack", "unpack", "diff"):
            done = run(command, "--help")
            self.assertEqual(done.returncode, 0)
            self.assertIn("qmpipe " + command, done.stdout)
            self.assertIn("xample", done.stdout)

    def test_version(self):
        self.assertRegex(run("--version").stdout, r"^qmpipe \d+\.\d+\.\d+\n$")

    def test_build_reports_on_stdout(self):
        self.assertEqual(self.built.returncode, 0, self.built.stderr)
        self.assertIn("max error m", self.built.stdout)
        self.assertRegex(self.built.stdout, r"built: \d+ tiles")
        why = "Errors of kilometres at coarse zooms are meant"
        self.assertIn(why, self.built.stdout)
        self.assertIn(why, run("verify", self.tiles, "--source", self.dem).stdout)
        done = run("build", self.dem, "-o", self.root / "fine", "--tolerance", 900, "--max-zoom", 3)
        self.assertNotIn(why, done.stdout)

    def test_silent_run_has_no_carriage_returns(self):
        self.assertNotIn("\r", self.built.stderr)

    def test_progress_in_a_terminal_fits_its_window(self):
        big = self.root / "progress.tif"
        done = run("synth", "-o", big, "--size", "2400x1800", "--bounds", "6,43.5,8,45")
        self.assertEqual(done.returncode, 0, done.stderr)
        for columns, extra in ((24, ()), (60, ()), (200, ("-v",))):
            master, slave = pty.openpty()
            fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
            process = subprocess.Popen(
                [QMPIPE, "build", big, "-o", self.root / "progress", "--overwrite", *extra],
                stdout=subprocess.DEVNULL, stderr=slave, stdin=subprocess.DEVNULL)
            os.close(slave)
            shown = b""
            with contextlib.suppress(OSError):  # the other end is closed
                while piece := os.read(master, 4096):
                    shown += piece
            os.close(master)
            self.assertEqual(process.wait(timeout=60), 0, shown)
            updates = [line.split("\r")[0] for line in shown.decode().split("\r\x1b[K")[1:]]
            self.assertTrue(any(line.startswith("mesh") for line in updates), shown)
            self.assertLessEqual(max(len(line) for line in updates if "qmpipe: " not in line),
                                 columns)
            self.assertEqual(" | ready " in shown.decode(), "-v" in extra)

    def test_verify_of_own_set_finds_nothing(self):
        done = run("verify", self.tiles, "--source", self.dem)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("0 faults", done.stdout)

    def test_verify_finds_damage(self):
        copy = self.root / "damaged"
        run("build", self.dem, "-o", copy, "--overwrite")
        deepest = max((p for p in copy.glob("*/*/*.terrain")), key=lambda p: int(p.parts[-3]))
        deepest.write_bytes(deepest.read_bytes()[:100])
        done = run("verify", copy, "--json")
        self.assertEqual(done.returncode, 3, done.stderr)
        key = "/".join(deepest.with_suffix("").parts[-3:])
        self.assertIn(key, done.stdout)
        json.loads(done.stdout)

    def test_info_of_set_and_tile(self):
        done = run("info", self.tiles, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        json.loads(done.stdout)
        tile = max(self.tiles.glob("*/*/*.terrain"), key=lambda p: p.stat().st_size)
        done = run("info", tile)
        self.assertEqual(done.returncode, 0, done.stderr)
        for name in ("tile.ply", "tile.obj", "tile.glb", "tile.stl"):
            done = run("info", tile, "--mesh", self.root / name)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertGreater((self.root / name).stat().st_size, 500)

    def test_mbtiles_hold_what_the_folder_holds(self):
        packed = self.root / "packed.mbtiles"
        done = run("build", self.dem, "-o", packed, "--name", "tiles")
        self.assertEqual(done.returncode, 0, done.stderr)
        files = sorted(self.tiles.glob("*/*/*.terrain"))
        with contextlib.closing(sqlite3.connect(packed)) as database:
            self.assertEqual(database.execute("PRAGMA integrity_check").fetchone(), ("ok",))
            rows = database.execute("SELECT zoom_level, tile_column, tile_row, tile_data FROM tiles")
            found = {"/".join(map(str, row[:3])): row[3] for row in rows}
            layer, = database.execute(
                "SELECT value FROM metadata WHERE name = 'layer.json'").fetchone()
        expected = {"/".join(path.with_suffix("").parts[-3:]): path.read_bytes() for path in files}
        self.assertEqual(found, expected)
        self.assertEqual(layer, (self.tiles / "layer.json").read_text())
        self.assertEqual(json.loads((self.root / "packed.mbtiles.report.json").read_text())["tiles"],
                         len(files))
        counted = subprocess.run(["sqlite3", packed, "SELECT count(*) FROM tiles"],
                                 capture_output=True, text=True, check=True).stdout
        self.assertEqual(int(counted), len(files))
        done = run("verify", packed, "--source", self.dem)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("0 faults", done.stdout)

    def test_info_of_mbtiles_and_of_a_tile_in_a_set(self):
        packed = self.root / "info.mbtiles"
        run("build", self.dem, "-o", packed)
        as_file = json.loads(run("info", packed, "--json").stdout)
        as_folder = json.loads(run("info", self.tiles, "--json").stdout)
        self.assertEqual(as_file["zooms"], as_folder["zooms"])
        self.assertEqual(as_file["complaints"], [])
        self.assertEqual(as_file["layer"]["name"], "info")
        tile = max(self.tiles.glob("*/*/*.terrain"), key=lambda p: p.stat().st_size)
        key = "/".join(tile.with_suffix("").parts[-3:])
        expected = json.loads(run("info", tile, "--json").stdout)
        for place in (packed, self.tiles):
            found = json.loads(run("info", place, "--key", key, "--json").stdout)
            self.assertEqual(found.pop("key"), key)
            self.assertEqual({**found, "path": ""}, {**expected, "path": ""})
        self.assertIn(f"info.mbtiles: tile {key}", run("info", packed, "--key", key).stdout)
        meshes = []
        for number, place in enumerate(([tile], [packed, "--key", key], [self.tiles, "--key", key])):
            mesh = self.root / f"in-set-{number}.ply"
            done = run("info", *place, "--mesh", mesh)
            self.assertEqual(done.returncode, 0, done.stderr)
            meshes.append(mesh.read_bytes())
        self.assertEqual(meshes, [meshes[0]] * 3)
        self.fails(1, "info", packed, "--key", "9/0/0", says=["there is no tile 9/0/0"])
        self.fails(2, "info", packed, "--mesh", self.root / "x.ply", says=["--key"])
        self.fails(2, "info", tile, "--key", key, says=["--key"])
        self.fails(2, "info", packed, "--key", "9/0", says=["zoom/x/y"])

    def test_pmtiles_are_no_output_of_a_build(self):
        out = self.root / "out.pmtiles"
        self.fails(2, "build", self.dem, "-o", out, says=["qmpipe convert"])
        self.assertFalse(out.exists())

    def test_what_is_no_mbtiles_file_is_refused(self):
        fake = self.root / "fake.mbtiles"
        fake.write_text("no database")
        for command in ("info", "verify"):
            self.fails(1, command, fake, says=["fake.mbtiles", "no SQLite file"])
        # The name does not matter where the first bytes tell.
        run("build", self.dem, "-o", self.root / "real.mbtiles")
        renamed = self.root / "real.bin"
        (self.root / "real.mbtiles").rename(renamed)
        self.assertEqual(run("verify", renamed).returncode, 0)

    def test_tin_writes_one_mesh_and_its_errors(self):
        for name in ("tin.ply", "tin.obj", "tin.glb", "tin.stl"):
            done = run("tin", self.dem, "-o", self.root / name, "--tolerance", "20", "--json")
            self.assertEqual(done.returncode, 0, done.stderr)
            report = json.loads(done.stdout)
            self.assertEqual(report["file_bytes"], (self.root / name).stat().st_size)
            self.assertEqual((report["columns"], report["rows"]), (400, 300))
            self.assertEqual(report["posts"], 400 * 300)
            self.assertLessEqual(report["largest_error_m"], 20)
            self.assertLessEqual(report["mean_error_m"], report["rms_error_m"])
            self.assertEqual(report["triangles"] / (2 * 399 * 299),
                             report["share_of_grid_triangles"])
        stl = (self.root / "tin.stl").read_bytes()
        self.assertEqual(int.from_bytes(stl[80:84], "little"), report["triangles"])
        first = (self.root / "tin.ply").read_bytes()
        done = run("tin", self.dem, "-o", self.root / "tin.ply", "--param", "g_e=20", "-v")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((self.root / "tin.ply").read_bytes(), first)
        self.assertRegex(done.stderr, r"(?m)^  g_e +20 ")
        self.assertRegex(done.stdout, r"(?m)^largest error +\d+\.\d+ m, at column \d+, row \d+$")

    def test_tin_of_so_many_triangles_in_the_coordinates_of_the_crs(self):
        obj = self.root / "crs.obj"
        done = run("tin", self.dem, "-o", obj, "--triangles", "500", "--frame", "crs")
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = obj.read_text().splitlines()
        self.assertIn(sum(line.startswith("f ") for line in lines), (499, 500))
        longitudes = [float(line.split()[1]) for line in lines if line.startswith("v ")]
        self.assertAlmostEqual(min(longitudes), 6 + 0.5 / 400)
        self.assertAlmostEqual(max(longitudes), 7 - 0.5 / 400)

    def test_tin_refuses_with_the_remedy(self):
        out = self.root / "refused.ply"
        self.fails(2, "tin", self.dem, "-o", self.root / "refused.off", says=[".stl"])
        self.fails(2, "tin", self.dem, "-o", self.root / "refused.glb", "--frame", "crs",
                   says=[".ply"])
        self.fails(2, "tin", self.dem, "-o", out, "--tolerance", "1", "--triangles", "9",
                   says=["not both"])
        self.fails(2, "tin", self.dem, "-o", out, "--tolerance", "1", "--param", "g_e=2",
                   says=["g_e"])
        self.fails(2, "tin", self.dem, "-o", out, "--tolerance", "1", "--stop", "edges",
                   "--method", "edge-collapse", says=["--stop edges"])
        self.fails(2, "tin", self.dem, "-o", out, "--memory", "2M", says=["-outsize"])
        self.fails(2, "tin", self.dem, "-o", out, "--method", "magic", says=["greedy"])
        self.fails(2, "tin", "-o", out)
        self.fails(1, "tin", self.root / "nowhere.tif", "-o", out, says=["nowhere.tif"])
        self.fails(1, "tin", self.dem, "-o", self.root / "none" / "x.ply", says=["no folder"])
        self.assertFalse(out.exists())

    def test_json_run_is_json_throughout(self):
        done = run("build", self.dem, "-o", self.root / "json", "--json", "--overwrite")
        self.assertEqual(done.returncode, 0, done.stderr)
        events = [json.loads(line)["event"] for line in done.stderr.splitlines()]
        self.assertIn("estimate", events)
        self.assertIn("phase_done", events)
        report = json.loads(done.stdout)
        self.assertEqual(report["tiles"], sum(zoom["tiles"] for zoom in report["zooms"]))
        on_disk = json.loads((self.root / "json" / "report.json").read_text())
        self.assertEqual(on_disk["tiles"], report["tiles"])
        self.assertGreater(report["source"]["blocks"], 0)
        self.assertLess(report["source"]["decoded_per_block"], 1.05)
        self.assertEqual(on_disk["source"], report["source"])

    def test_dry_run_prints_the_estimate_and_writes_nothing(self):
        out = self.root / "dry"
        done = run("build", self.dem, "-o", out, "--dry-run")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"estimate: \d+ tiles.* of memory and .* of disk")
        self.assertFalse(out.exists())
        self.assertEqual(list(self.root.glob("dry*")), [])

    def test_existing_output_is_refused_with_the_remedy(self):
        self.fails(1, "build", self.dem, "-o", self.tiles, "--max-zoom", 3, says=["--overwrite"])
        file = self.root / "there.mbtiles"
        file.write_text("mine")
        self.fails(1, "build", self.dem, "-o", file, says=["--overwrite"])
        self.assertEqual(file.read_text(), "mine")
        self.assertEqual(sorted(p.name for p in self.root.glob("there.*")), [file.name])
        self.assertEqual(run("build", self.dem, "-o", file, "--overwrite").returncode, 0)
        self.assertEqual(run("verify", file).returncode, 0)

    def test_overwrite_leaves_other_files_alone(self):
        out = self.root / "shared-folder"
        run("build", self.dem, "-o", out)
        (out / "notes.txt").write_text("mine")
        done = run("build", self.dem, "-o", out, "--overwrite")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((out / "notes.txt").read_text(), "mine")

    def test_usage_errors_exit_2(self):
        out = self.root / "usage"
        self.fails(2, "build", "-o", out)
        self.fails(2)
        self.fails(2, "bild")
        self.fails(2, "build", self.dem, "-o", out, "--threads", "0", says=["--threads"])
        self.fails(2, "build", self.dem, "-o", out, "--tolerance", "0", says=["--tolerance"])
        self.fails(2, "build", self.dem, "-o", out, "--tolerance", "soft")
        self.fails(2, "build", self.dem, "-o", out, "--gzip", "13", says=["none"])
        self.fails(2, "build", self.dem, "-o", out, "--nodata", "zero", says=["pull"])
        self.fails(2, "build", self.dem, "-o", out, "--memory", "lots", says=["512M"])
        self.fails(2, "build", self.dem, "-o", out, "--memory", "1M", says=["MiB or more"])
        self.fails(2, "build", self.dem, "-o", out, "--checkpoint", "-1", says=["--checkpoint"])
        self.fails(2, "build", self.dem, "-o", out, "--checkpoint", "nan", says=["--checkpoint"])
        self.fails(2, "build", self.dem, "-o", out, "--keep-run", "--checkpoint", "0",
                   says=["--keep-run needs checkpoints"])
        self.fails(2, "build", self.dem, "-o", out, "--tolerance-at", "9:3", says=["9=20"])
        self.fails(2, "build", self.dem, "-o", out, "--min-zoom", "5", "--max-zoom", "2",
                   says=["--max-zoom"])
        self.fails(2, "build", self.dem, "-o", out, "--max-zoom", "99")
        # More blocks than could ever be listed: refused by arithmetic, at once.
        self.fails(2, "build", self.dem, "-o", out, "--max-zoom", "21", says=["MiB or more"])
        self.fails(2, "synth", "-o", self.root / "x.tif", "--size", "12", "--bounds", "0,0,1,1")
        self.assertFalse(out.exists())

    def test_missing_input_is_named(self):
        self.fails(1, "build", self.root / "nowhere.tif", "-o", self.root / "a",
                   says=["nowhere.tif"])

    def test_truncated_input_is_named(self):
        cut = self.root / "cut.tif"
        cut.write_bytes(self.dem.read_bytes()[:self.dem.stat().st_size // 2])
        done = self.fails(1, "build", cut, "-o", self.root / "b", says=["cut.tif"])
        self.assertFalse((self.root / "b" / "layer.json").exists(), done.stdout)

    def test_input_that_is_no_raster_is_named(self):
        text = self.root / "text.tif"
        text.write_text("no raster at all")
        self.fails(1, "build", text, "-o", self.root / "c", says=["text.tif"])

    def test_input_without_crs_says_how_to_give_one(self):
        bare = self.root / "bare.asc"
        rows = "\n".join(" ".join(str(100 + 7 * c + r) for c in range(20)) for r in range(20))
        bare.write_text("ncols 20\nnrows 20\nxllcorner 400000\nyllcorner 5000000\n"
                        "cellsize 1000\nNODATA_value -9999\n" + rows + "\n")
        self.fails(1, "build", bare, "-o", self.root / "d", says=["coordinate reference system", "--source-crs"])
        done = run("build", bare, "-o", self.root / "d2", "--source-crs", "EPSG:32632",
                   "--max-zoom", "4")
        self.assertEqual(done.returncode, 0, done.stderr)
        # The set remembers the CRS it was told.
        done = run("verify", self.root / "d2", "--source", bare)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_unwritable_output_is_named(self):
        blocked = self.root / "a-file"
        blocked.write_text("not a folder")
        self.fails(1, "build", self.dem, "-o", blocked / "tiles", says=["a-file"])

    def test_full_disk_ends_with_a_remedy(self):
        if os.geteuid() != 0:
            self.skipTest("needs root to mount a small disk")
        small = self.root / "small"
        small.mkdir()
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(small)],
                                 capture_output=True, check=False)
        if mounted.returncode != 0:
            self.skipTest("cannot mount here: " + mounted.stderr.decode().strip())
        try:
            self.fails(1, "build", self.dem, "-o", small / "tiles", "--gzip", "none",
                       says=["space"])
            self.assertFalse((small / "tiles" / "layer.json").exists())
        finally:
            subprocess.run(["umount", str(small)], check=False)

    def test_interrupt_exits_130_and_leaves_no_finished_set(self):
        big = self.root / "big.tif"
        done = run("synth", "-o", big, "--size", "2400x1800", "--bounds", "6,43.5,8,45",
                   "--seed", 7)
        self.assertEqual(done.returncode, 0, done.stderr)
        out = self.root / "interrupted"
        process = subprocess.Popen([QMPIPE, "build", str(big), "-o", str(out), "--tolerance",
                                    "1500"], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   text=True)
        deadline = time.monotonic() + 60
        while not list(out.glob("*/*/*.terrain")) and time.monotonic() < deadline:
            self.assertIsNone(process.poll(), "ended before it could be interrupted")
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, stderr)
        self.assertRegex(stderr, r"stopped after \d+ of \d+ tiles")
        self.assertFalse((out / "layer.json").exists())

    def test_a_finished_build_given_again_says_so_and_does_nothing(self):
        for name in ("again", "again.mbtiles"):
            out = self.root / name
            build = ("build", self.dem, "-o", out, "--max-zoom", 5)
            self.assertEqual(run(*build).returncode, 0)
            report = (out if out.is_dir() else self.root) / (
                "report.json" if out.is_dir() else name + ".report.json")
            before = report.read_bytes()
            done = run(*build, "--threads", 1)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertRegex(done.stdout, r"^built already: \d+ tiles in ")
            self.assertEqual(run(*build, "--json").stdout.encode(), before)
            self.assertEqual(report.read_bytes(), before)
            self.fails(1, *build, "--tolerance", 9000, "--attribution", "me",
                       says=['g_e (--tolerance) was "15000/2", and is "9000/2" now',
                             '--attribution was "", and is "me" now', "--overwrite"])
            self.assertEqual(run(*build, "--overwrite").stdout.count("built already"), 0)
            self.assertNotIn(str(self.root), report.read_text(), "the report may be served")
        tile = next((self.root / "again").glob("5/*/*.terrain"))
        tile.unlink()
        self.fails(1, "build", self.dem, "-o", self.root / "again", "--max-zoom", 5,
                   says=["tiles are there of the", "--overwrite"])

    def test_pack_convert_and_unpack_give_the_same_set_back(self):
        packed = self.root / "turn.mbtiles"
        archive = self.root / "turn.pmtiles"
        back = self.root / "turn_back"
        for arguments in (("pack", self.tiles, "-o", packed),
                          ("convert", packed, "-o", archive),
                          ("unpack", archive, "-o", back)):
            done = run(*arguments, "--json")
            self.assertEqual(done.returncode, 0, done.stderr)
            report = json.loads(done.stdout)
            self.assertEqual(report["tiles"], len(list(self.tiles.glob("*/*/*.terrain"))))
            self.assertEqual((report["repacked_tiles"], report["notes"]), (0, []))
        names = sorted(p.relative_to(back) for p in back.rglob("*") if p.is_file())
        self.assertEqual(names, sorted(p.relative_to(self.tiles) for p in self.tiles.rglob("*")
                                       if p.is_file() and p.name != "report.json"))
        for name in names:
            self.assertEqual((back / name).read_bytes(), (self.tiles / name).read_bytes())
        for form in (packed, archive, back):
            done = run("diff", self.tiles, form)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            done = run("verify", form)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        plain = self.root / "turn_plain.pmtiles"
        done = run("pack", archive, "-o", plain, "--gzip", "none")
        self.assertEqual(done.returncode, 0, done.stderr)
        done = run("diff", archive, plain, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        report = json.loads(done.stdout)
        self.assertTrue(report["same"])
        self.assertEqual(report["total"]["same_unpacked"], report["total"]["tiles_a"])

    def test_rows_from_the_north_are_turned(self):
        packed = self.root / "south.mbtiles"
        done = run("pack", self.tiles, "-o", packed)
        self.assertEqual(done.returncode, 0, done.stderr)
        flipped = self.root / "north.mbtiles"
        with contextlib.closing(sqlite3.connect(packed)) as tms, \
                contextlib.closing(sqlite3.connect(flipped)) as xyz, xyz:
            xyz.execute("CREATE TABLE metadata (name TEXT, value TEXT)")
            xyz.execute("CREATE TABLE tiles (zoom_level INTEGER, tile_column INTEGER,"
                        " tile_row INTEGER, tile_data BLOB)")
            xyz.executemany("INSERT INTO metadata VALUES (?, ?)",
                            tms.execute("SELECT name, value FROM metadata"))
            xyz.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)",
                            tms.execute("SELECT zoom_level, tile_column,"
                                        " (1 << zoom_level) - 1 - tile_row, tile_data FROM tiles"))
        out = self.root / "turned"
        done = run("convert", flipped, "-o", out, "--rows", "xyz")
        self.assertEqual(done.returncode, 0, done.stderr)
        done = run("diff", self.tiles, out)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_diff_tells_what_differs(self):
        coarse = self.root / "coarse"
        done = run("build", self.dem, "-o", coarse, "--tolerance", "60000")
        self.assertEqual(done.returncode, 0, done.stderr)
        done = run("diff", self.tiles, coarse, "--max", 2)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("layer.json qmpipe.", done.stdout)
        self.assertRegex(done.stdout, r"(?m)^different \d+/\d+/\d+: \d+ / \d+ vertices")
        self.assertRegex(done.stdout, r"(?m)^\d+ more different not shown$")
        self.assertEqual(run("diff", self.tiles, coarse, "--max", 2, "--threads", 1).stdout,
                         done.stdout)
        self.fails(1, "diff", self.tiles, self.root / "nowhere", says=["nowhere"])
        self.fails(2, "diff", self.tiles)

    def test_convert_refuses_with_the_remedy(self):
        self.fails(2, "pack", self.tiles, "-o", self.root / "folder", says=[".mbtiles or .pmtiles"])
        self.fails(2, "unpack", self.tiles, "-o", self.root / "x.mbtiles", says=["convert"])
        self.fails(2, "convert", self.tiles, "-o", self.tiles, "--overwrite",
                   says=["the output is the input"])
        self.fails(2, "convert", self.tiles / "layer.json", "-o", str(self.tiles) + "/",
                   "--overwrite", says=["the output is the input"])
        self.fails(2, "convert", self.tiles, "-o", self.root / "x.pmtiles", "--gzip", "13",
                   says=["--gzip 13"])
        self.fails(2, "convert", self.tiles, "-o", self.root / "x.pmtiles", "--rows", "xyz",
                   says=["--rows"])
        self.fails(2, "convert", self.tiles, "-o", self.root / "x.pmtiles", "--rows", "up")
        self.fails(2, "convert", self.tiles)
        self.fails(1, "convert", self.root / "nothing", "-o", self.root / "x.pmtiles",
                   says=["nothing"])
        taken = self.root / "taken.pmtiles"
        taken.write_text("mine")
        self.fails(1, "pack", self.tiles, "-o", taken, says=["--overwrite"])
        self.assertEqual(taken.read_text(), "mine")
        self.fails(1, "convert", taken, "-o", self.root / "x", says=["taken.pmtiles"])
        self.assertFalse((self.root / "x").exists())
        self.assertFalse((self.root / "x.pmtiles").exists())

    def test_verify_of_nothing_is_an_error(self):
        self.fails(1, "verify", self.root / "nothing-here", says=["nothing-here"])

    def test_synth_is_a_pure_function_of_the_seed(self):
        names = []
        for name, seed in (("s1", 5), ("s2", 5), ("s3", 6)):
            path = self.root / (name + ".tif")
            run("synth", "-o", path, "--size", "200x150", "--bounds", "0,0,1,1", "--seed", seed)
            names.append(path.read_bytes())
        self.assertEqual(names[0], names[1])
        self.assertNotEqual(names[0], names[2])

    def test_verbose_prints_every_effective_option(self):
        done = run("build", self.dem, "-o", self.root / "v", "--dry-run", "-v")
        for word in ("method", "g_e", "g_g", "resampling", "reduce", "nodata", "gzip", "threads", "memory"):
            self.assertTrue(re.search(r"^  " + word, done.stderr, re.M), word)

    def test_a_method_is_chosen_with_its_parameters(self):
        params = self.root / "params.json"
        params.write_text('{"r_r": [90, 80], "p_e": "512/2", "e_e": 700}')
        out = self.root / "random"
        done = run("build", self.dem, "-o", out, "--method", "ps-random", "--params", params,
                   "--param", "p_b=5", "-v")
        self.assertEqual(done.returncode, 0, done.stderr)
        for line in ("method         ps-random", "r_r            90,80", "p_e            512/2",
                     "p_b            5"):
            self.assertIn(line, done.stderr)
        self.assertNotIn("e_e", done.stderr)
        self.assertNotIn("g_g", done.stderr)
        report = json.loads((out / "report.json").read_text())
        self.assertEqual(report["method"], "ps-random")
        self.assertEqual(report["zooms"][2]["parameters"]["r_r"], 80)
        self.assertEqual(report["zooms"][2]["parameters"]["p_e"], 128)
        self.assertIsNone(report["zooms"][2]["tolerance_m"])
        checked = run("verify", out, "--source", self.dem)
        self.assertEqual(checked.returncode, 0, checked.stdout)
        # Another method in the same place is other work.
        self.fails(1, "build", self.dem, "-o", out, "--method", "ps-grid", says=["--overwrite"])

    def test_parameters_that_make_no_sense_are_refused(self):
        build = ("build", self.dem, "-o", self.root / "no")
        self.fails(2, *build, "--method", "wlop", says=["ps-wlop"])
        self.fails(2, *build, "--stop", "edges", says=["edge-collapse only"])
        self.fails(2, *build, "--param", "e_e=5", says=["greedy has no parameter e_e", "g_e, g_g"])
        self.fails(2, *build, "--param", "g_g", says=["NAME=VALUE"])
        self.fails(2, *build, "--param", "g_g=ten", says=["--param g_g=ten"])
        self.fails(2, *build, "--param", "g_g=1000", says=["g_g: 1000", "0 to 256"])
        self.fails(2, *build, "--method", "ps-grid", "--grid", "4", says=["no parameter g_g"])
        self.fails(1, *build, "--params", self.root / "nowhere.json", says=["nowhere.json"])

    def test_compare_writes_a_report(self):
        out = self.root / "report"
        done = run("compare", self.dem, "-o", out, "--methods", "greedy,ps-hierarchy,ps-grid",
                   "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        numbers = json.loads(done.stdout)
        self.assertEqual([m["method"] for m in numbers["methods"]],
                         ["greedy", "ps-hierarchy", "ps-grid"])
        self.assertEqual(sorted(p.name for p in out.iterdir()),
                         ["compare.json", "distances.csv", "index.html", "run_times.csv",
                          "single_tile.csv", "zooms.csv"])
        self.fails(2, "compare", self.dem, "-o", out, says=["--overwrite"])
        self.fails(2, "compare", self.dem, "-o", self.root / "r2", "--methods", "greedy,greedy",
                   says=["twice"])
        self.fails(2, "compare", self.dem, "-o", self.root / "r2", "--methods", "greed",
                   says=["choose one of"])
        self.fails(2, "compare", self.dem)
        kept = run("compare", self.dem, "-o", out, "--overwrite", "--keep-tiles", "--methods",
                   "greedy")
        self.assertEqual(kept.returncode, 0, kept.stderr)
        self.assertTrue((out / "tiles" / "greedy" / "layer.json").exists())


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    unittest.main(verbosity=2)
