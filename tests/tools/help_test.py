#!/usr/bin/env python3
"""Reads the help of every command as a person would who has a terminal of 100 columns: what must be
given comes first, options stand in groups, numbers say their unit and what they are by default.

usage: help_test.py QMPIPE [unittest's arguments]
"""
import pathlib
import re
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools" / "manual"))
from help_pages import GROUPS, pages  # noqa: E402

QMPIPE = None
COLUMNS = 100
UNITS = re.compile(r"metre|second|degree|pixel|zoom|thread|tile|triangle|share|level|block|connection|port"
                   r"|faults|bytes|512M|g_g=|number|\bm\b", re.IGNORECASE)
# What these are when they are not given is another option's matter.
WITHOUT_DEFAULT = {"--tolerance-at": "zooms that differ", "--grid": "--param", "--triangles": "a target",
                   "--svo": "a choice of five", "--level": "a choice of five",
                   "--distance": "a choice of five", "--eye": "a choice of five"}
NUMBER = re.compile(r"^(N|X|[A-Z]|X,Y,Z|SECONDS|SHARE|SIZE)$")


def run(*arguments):
    return subprocess.run([QMPIPE, *arguments], capture_output=True, text=True, timeout=60,
                          stdin=subprocess.DEVNULL, check=False)


class Help(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.pages = dict(pages(QMPIPE))

    def each(self, check):
        for command, page in self.pages.items():
            with self.subTest(command=" ".join(command)):
                check(command, page)

    def test_every_command_is_read(self):
        for command in ("build", "verify", "serve", "check", "compare", "info", "tin", "synth", "convert",
                        "pack", "unpack", "diff"):
            self.assertIn((command,), self.pages)
        for command in ("build", "extract", "info", "verify"):
            self.assertIn(("detail", command), self.pages)

    def test_fits_100_columns(self):
        def check(_, page):
            self.assertEqual([line for line in page.lines if len(line) > COLUMNS], [])
            self.assertEqual([line for line in page.lines if line != line.rstrip()], [])
        self.each(check)

    def test_options_stand_in_groups_and_each_once(self):
        def check(_, page):
            self.assertEqual(page.order, [g for g in GROUPS if g in page.groups])
            self.assertIn("Messages", page.groups)
            names = [name for _, names, _, _ in page.options() for name in names]
            self.assertEqual(sorted(set(names)), sorted(names))
            self.assertIn("--help", names)
            for group, entries in page.groups.items():
                for what, text in entries:
                    self.assertGreater(len(text), 8, f"{group}: {what} says nothing")
        self.each(check)

    def test_what_must_be_given_comes_first_with_the_output_at_the_head(self):
        def check(command, page):
            if not command or command == ("detail",):
                self.assertIn(" COMMAND", page.usage)
                return
            self.assertEqual(page.order[0], "Required")
            required = [what for what, _ in page.groups["Required"]]
            elsewhere = [what for group, entries in page.groups.items() if group != "Required"
                         for what, _ in entries]
            self.assertFalse([what for what in elsewhere if "-o," in what or not what.startswith("-")])
            for what in required:
                self.assertIn(what.split()[0].split(",")[0].replace("...", ""), page.usage)
            if any("-o," in what for what in required):
                self.assertTrue(required[0].startswith("-o, --output "), required)
        self.each(check)
        for command in ("build", "compare", "convert", "pack", "unpack", "tin", "synth"):
            self.assertIn("Usage: qmpipe " + command + " ", self.pages[(command,)].usage)
            self.assertRegex(self.pages[(command,)].usage, r" -o [A-Z]+ ?")

    def test_numbers_say_their_unit_and_their_default(self):
        checked = []

        def check(command, page):
            for _, names, value, text in page.options():
                if not NUMBER.match(value):
                    continue
                checked.append(names)
                self.assertRegex(text, UNITS, names)
                if names[-1] not in WITHOUT_DEFAULT and (*command, names[-1]) != ("tin", "--tolerance"):
                    self.assertRegex(text, r"default|0: ", names)
        self.each(check)
        self.assertGreater(len(checked), 25)

    def test_choices_name_their_default(self):
        for command, name, default in (("build", "--nodata", "pull"), ("build", "--reduce", "mean"),
                                       ("build", "--scheme", "geodetic"), ("build", "--method", "greedy"),
                                       ("convert", "--gzip", "keep"), ("tin", "--frame", "local")):
            text, = [text for _, names, _, text in self.pages[(command,)].options() if name in names]
            self.assertIn(f"default: {default}", text)

    def test_the_papers_parameters_stand_together(self):
        names = [name for group, names, _, _ in self.pages[("build",)].options()
                 for name in names if group == "The papers' parameters"]
        self.assertEqual(sorted(names), ["--grid", "--method", "--param", "--params", "--stop"])

    def test_every_page_has_an_example_that_names_its_command(self):
        def check(command, page):
            text = "\n".join(page.lines)
            self.assertIn("xample", text)
            self.assertIn("  " + " ".join(("qmpipe", *command)), text)
        self.each(check)
        self.assertIn("  qmpipe build dem.tif -o tiles", "\n".join(self.pages[()].lines))


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    unittest.main(verbosity=2)
