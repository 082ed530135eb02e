#!/usr/bin/env python3
"""The examples of docs/examples run from nothing, as they stand, and the guide names each of them.

usage: examples_test.py QMPIPE [unittest's arguments]
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

QMPIPE = None
DOCS = pathlib.Path(__file__).resolve().parents[2] / "docs"
EXAMPLES = sorted((DOCS / "examples").glob("*.sh"))


class Examples(unittest.TestCase):
    def test_run_from_nothing(self):
        self.assertGreater(len(EXAMPLES), 4)
        environment = dict(os.environ, PATH=f"{QMPIPE.parent}:{os.environ['PATH']}")
        for example in EXAMPLES:
            with self.subTest(example.name), tempfile.TemporaryDirectory() as folder:
                done = subprocess.run(["bash", "-euo", "pipefail", str(example)], cwd=folder, env=environment,
                                      capture_output=True, text=True, timeout=120, check=False,
                                      stdin=subprocess.DEVNULL)
                self.assertEqual(done.returncode, 0, f"{done.stdout}\n{done.stderr}")

    def test_are_named_in_the_guide(self):
        guide = (DOCS / "GUIDE.md").read_text(encoding="utf-8")
        for example in EXAMPLES:
            self.assertIn(f"(examples/{example.name})", guide)


if __name__ == "__main__":
    QMPIPE = pathlib.Path(sys.argv.pop(1)).resolve()
    unittest.main()
