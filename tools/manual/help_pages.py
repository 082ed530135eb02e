"""The help texts of qmpipe, taken apart: what man pages, completions and a test are made from."""
import re
import subprocess

GROUPS = ["Required", "Input", "Output", "Quality", "The papers' parameters", "Resources", "Commands",
          "Messages"]
# Where the text of an option or a command begins.
TEXT_COLUMN = 28


class Page:
    """A help text: what the command does, its usage, groups with their entries [what, text], and the
    notes, examples and exit codes behind them."""

    def __init__(self, text):
        self.lines = text.splitlines()
        self.usage = " ".join(line.strip() for line in self.lines if line.startswith("Usage: "))
        self.summary = " ".join(line for line in self.lines[:self._first("Usage: ")] if line)
        self.order = []
        self.groups = {}
        self.examples = []
        self.exit_codes = ""
        self.notes = []
        self._read()

    def _first(self, start):
        return next(k for k, line in enumerate(self.lines) if line.startswith(start))

    def _read(self):
        entries = None
        in_examples = False
        for line in self.lines[self._first("Usage: ") + 1:]:
            if line.endswith(":") and line[:-1] in GROUPS + ["Options"]:
                self.order.append(line[:-1])
                entries, in_examples = self.groups.setdefault(line[:-1], []), False
            elif re.search(r"(^|\. )Examples?\b.*:$", line):
                entries, in_examples = None, True
                if line not in ("Example:", "Examples:"):
                    self._read_note(line)
            elif in_examples and line.startswith("  "):
                self.examples.append(line.strip())
            elif line.startswith("Exit codes: "):
                entries, in_examples = None, False
                self.exit_codes = line.removeprefix("Exit codes: ")
            elif entries is not None and line.startswith("  "):
                self._read_entry(entries, line)
            else:
                entries, in_examples = None, False
                if line or self.notes:
                    self._read_note(line)

    @staticmethod
    def _read_entry(entries, line):
        if line.startswith(" " * TEXT_COLUMN):
            entries[-1][1] = (entries[-1][1] + " " + line.strip()).strip()
            return
        what, _, said = line.strip().partition("  ")
        entries.append([what, said.strip()])

    def _read_note(self, line):
        # A code that did not fit its line goes on in the next one.
        if self.exit_codes and not self.exit_codes.endswith("."):
            self.exit_codes += " " + line.strip()
        else:
            self.notes.append(line)

    def options(self):
        """Of each option: its group, its names, the name of its value ("" for none), its text."""
        for group, entries in self.groups.items():
            if group == "Commands":
                continue
            for what, text in entries:
                names, _, value = what.replace(", ", ",").removesuffix(" ...").partition(" ")
                yield group, names.split(","), value, text


def pages(qmpipe, *command):
    """(command, page) of each command, the program itself first."""
    done = subprocess.run([qmpipe, *command, "--help"], capture_output=True, text=True, timeout=60,
                          stdin=subprocess.DEVNULL, check=True)
    page = Page(done.stdout)
    yield command, page
    for name, _ in page.groups.get("Commands", []):
        yield from pages(qmpipe, *command, name)
