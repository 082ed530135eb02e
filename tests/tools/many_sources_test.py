#!/usr/bin/env python3
"""More rasters than the process may have files open give the tiles of one that holds them all.

usage: many_sources_test.py QMPIPE [unittest's arguments]
"""
import math
import pathlib
import resource
import subprocess
import sys
import tempfile
import unittest

QMPIPE = None
FILES = 300
ACROSS = 20
SIDE = 60  # pixels
CELL_DEG = 1 / 1024
FILES_OPEN = 256
IN_DEGREES = ("--source-crs", "EPSG:4326")


def height_m(column, row):
    return 1000 + 400 * math.sin(column / 37) * math.cos(row / 23) + (column * 7 + row * 13) % 11


def limit_files():
    resource.setrlimit(resource.RLIMIT_NOFILE, (FILES_OPEN, FILES_OPEN))


def run(*arguments, limited=False):
    return subprocess.run([QMPIPE, *map(str, arguments)], capture_output=True, text=True,
                          check=False, timeout=300, preexec_fn=limit_files if limited else None)


def contents(out):
    return {str(path.relative_to(out)): path.read_bytes() for path in sorted(out.rglob("*"))
            if path.is_file() and path.name != "report.json"}


class ManySourcesTest(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory(prefix="qmpipe-many-")
        self.addCleanup(place.cleanup)
        self.root = pathlib.Path(place.name)
        self.parts = []
        for k in range(FILES):
            part = self.root / f"part{k}.asc"
            column, row = k % ACROSS * SIDE, k // ACROSS * SIDE
            lines = [f"ncols {SIDE}", f"nrows {SIDE}", f"xllcorner {6 + column * CELL_DEG!r}",
                     f"yllcorner {44 + row * CELL_DEG!r}", f"cellsize {CELL_DEG!r}"]
            for r in range(SIDE):
                lines.append(" ".join(f"{height_m(column + c, row + SIDE - 1 - r):.2f}"
                                      for c in range(SIDE)))
            part.write_text("\n".join(lines) + "\n")
            self.parts.append(part)

    def build(self, name, *arguments, **options):
        out = self.root / name
        done = run("build", *self.parts, "-o", out, "--name", "t", *IN_DEGREES, *arguments, **options)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done

    def test_few_files_may_be_open(self):
        self.build("all", "--threads", "1")
        self.build("few", "--threads", "2", limited=True)
        self.assertEqual(contents(self.root / "few"), contents(self.root / "all"))
        # And these are the tiles of the raster that the files were cut from.
        rows = FILES // ACROSS * SIDE
        one = self.root / "one.asc"
        # Part k is rows from the south up, its own rows from the north down.
        one.write_text("\n".join(
            [f"ncols {ACROSS * SIDE}", f"nrows {rows}", "xllcorner 6.0", "yllcorner 44.0",
             f"cellsize {CELL_DEG!r}"] +
            [" ".join(f"{height_m(c, rows - 1 - r):.2f}" for c in range(ACROSS * SIDE))
             for r in range(rows)]) + "\n")
        self.parts = [one]
        self.build("one")
        self.assertEqual(contents(self.root / "one"), contents(self.root / "all"))
        done = run("verify", self.root / "few", *IN_DEGREES, "--source", *self.parts, limited=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_what_is_needed_does_not_grow_with_the_number_of_files(self):
        done = self.build("frugal", "--threads", "2", "--memory", "300M")
        self.assertNotIn("is kept in", done.stderr, "the lattice of so few posts fits the memory")

    def test_the_first_that_is_missing_is_named(self):
        self.parts[150:150] = [self.root / "absent1.tif"]
        self.parts.append(self.root / "absent2.tif")
        done = run("build", *self.parts, "-o", self.root / "none", *IN_DEGREES)
        self.assertEqual(done.returncode, 1)
        self.assertIn("absent1.tif", done.stderr)
        self.assertNotIn("absent2.tif", done.stderr)


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    unittest.main(verbosity=2)
