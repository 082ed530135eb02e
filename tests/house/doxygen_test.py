#!/usr/bin/env python3
"""The reference pages of our headers: Doxygen makes them without a warning, and what the comments say is on them.

usage: doxygen_test.py WORK_FOLDER [unittest's arguments]
"""
import html
import pathlib
import re
import shutil
import subprocess
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
WORK = None


def words_of(text):
    return " ".join(html.unescape(re.sub(r"<[^>]*>", "", text)).split())


@unittest.skipIf(shutil.which("doxygen") is None, "doxygen is not installed (tools/setup.sh --dev)")
class ReferencePages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(WORK, ignore_errors=True)
        cls.done = subprocess.run(
            ["bash", "-c", '{ cat docs/Doxyfile; echo "OUTPUT_DIRECTORY = $0"; } | doxygen -', str(WORK)],
            cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
        cls.pages = {page.name: words_of(page.read_text(encoding="utf-8")) for page in (WORK / "html").glob("*.html")}

    def test_are_made_without_a_warning(self):
        self.assertEqual((self.done.returncode, self.done.stdout, self.done.stderr), (0, "", ""))

    def test_say_what_the_comments_say(self):
        everything = " ".join(self.pages.values())
        # Of a file, of a declaration, behind a member.
        for header in ("scheduler/memory_budget.h", "scheduler/block_key.h", "formats/run_store/lattice_store.h"):
            for line in (ROOT / header).read_text(encoding="utf-8").splitlines():
                comment = re.match(r"(?:.*\S  |\s*)// (\S.*)", line)
                if comment and not line.startswith("}"):
                    self.assertIn(words_of(html.escape(comment[1])), everything, f"{header}: {line}")


if __name__ == "__main__":
    WORK = pathlib.Path(sys.argv.pop(1)).resolve()
    unittest.main()
