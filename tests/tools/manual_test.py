#!/usr/bin/env python3
"""The man pages and completions that are made from --help: whole, free of groff's warnings, and of use.

usage: manual_test.py QMPIPE [unittest's arguments]
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

MANUAL = pathlib.Path(__file__).resolve().parents[2] / "tools" / "manual"
sys.path.insert(0, str(MANUAL))
from help_pages import pages  # noqa: E402

QMPIPE = None
SECTIONS = ("NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "EXIT STATUS", "DIAGNOSTICS", "SEE ALSO")


def run(*arguments):
    return subprocess.run([str(a) for a in arguments], capture_output=True, text=True, timeout=60,
                          stdin=subprocess.DEVNULL, check=False)


class Manual(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.pages = dict(pages(QMPIPE))
        cls.folder = tempfile.TemporaryDirectory(prefix="qmpipe-manual-")
        cls.root = pathlib.Path(cls.folder.name)
        made = run(sys.executable, MANUAL / "make.py", QMPIPE, cls.root)
        assert made.returncode == 0, made.stderr

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def page(self, command):
        return self.root / "man1" / f"{'-'.join(('qmpipe', *command))}.1"

    def printed(self, path):
        done = run("groff", "-ww", "-man", "-Tascii", "-P-c", "-P-b", "-P-u", "-rLL=400n", path)
        self.assertEqual((done.returncode, done.stderr), (0, ""), path)
        return done.stdout

    def test_each_command_has_a_page_without_warnings(self):
        self.assertEqual(sorted(p.name for p in (self.root / "man1").iterdir()),
                         sorted(self.page(command).name for command in self.pages))
        for command in self.pages:
            with self.subTest(command=command):
                lines = self.printed(self.page(command)).splitlines()
                for section in SECTIONS:
                    self.assertIn(section, lines)

    def test_a_page_says_all_that_the_help_says(self):
        for command, page in self.pages.items():
            said = " ".join(self.printed(self.page(command)).split())
            with self.subTest(command=command):
                for _, names, value, text in page.options():
                    self.assertIn(" ".join((", ".join(names) + " " + value).split()), said)
                    self.assertIn(" ".join(text.split()), said)
                for line in page.examples + page.notes:
                    self.assertIn(" ".join(line.split()), said)
                self.assertIn(page.exit_codes, said)

    def test_commands_with_examples_show_them(self):
        for command, page in self.pages.items():
            with self.subTest(command=command):
                self.assertTrue(page.examples, "a command without an example")
                self.assertIn("EXAMPLES", self.printed(self.page(command)).splitlines())

    def completed(self, *words):
        script = (f"source '{self.root / 'bash' / 'qmpipe'}'; COMP_WORDS=({' '.join(repr(w) for w in words)});"
                  f"COMP_CWORD={len(words) - 1}; _qmpipe; printf '%s\\n' \"${{COMPREPLY[@]}}\"")
        done = run("bash", "-c", script)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return done.stdout.split()

    def test_bash_completes_commands_and_their_options(self):
        self.assertIn("build", self.completed("qmpipe", ""))
        self.assertEqual(self.completed("qmpipe", "buil"), ["build"])
        self.assertEqual(self.completed("qmpipe", "detail", "ext"), ["extract"])
        for command, page in self.pages.items():
            for _, names, _, _ in page.options():
                for name in names:
                    if name.startswith("--"):
                        with self.subTest(command=command, name=name):
                            self.assertIn(name, self.completed("qmpipe", *command, "a.tif", name)
                                          if command else self.completed("qmpipe", name))


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    unittest.main()
