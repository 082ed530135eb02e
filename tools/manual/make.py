#!/usr/bin/env python3
"""Writes the man pages of qmpipe and the completions for bash from what --help says.

usage: make.py QMPIPE FOLDER     FOLDER/man1/qmpipe*.1 and FOLDER/bash/qmpipe
"""
import pathlib
import re
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from help_pages import pages  # noqa: E402

EXIT_STATUS = """0 done, 1 failed, 2 wrong usage, 3 faults or differences found (verify, check, diff), 130 interrupted."""
DIAGNOSTICS = """Messages go to standard error and begin with "qmpipe:". One that ends a run names the file, the
cause and, in the next line, what to do. Progress is one line on a terminal and nothing elsewhere."""
MEMORY = """The process stays within \\-\\-memory, whatever the size of the input, and says before it begins how
much it may take. A budget that cannot work is refused with the least that can. Without the option it is nine tenths of
the machine's memory, or of what a control group allows."""


def escaped(text):
    """Text as roff prints it: a line that begins with a dot or a quote is no request."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"^([.'])", r"\\&\1", text, flags=re.MULTILINE)


def name_of(command):
    return "-".join(("qmpipe", *command))


def options_of(page):
    for group in page.order:
        if group == "Commands":
            continue
        yield f'.SS "{escaped(group)}"'
        for what, text in page.groups[group]:
            yield ".TP"
            yield f".B {escaped(what)}"
            yield escaped(text)


def commands_of(command, page):
    for name, text in page.groups.get("Commands", []):
        yield ".TP"
        yield f".BR {escaped(name_of((*command, name)))} (1)"
        yield escaped(text)


def literal(lines):
    yield ".EX"
    yield from (escaped(line) for line in lines)
    yield ".EE"


def man_page(command, page, version, siblings):
    usage = page.usage.removeprefix("Usage: ")
    yield f'.TH {name_of(command).upper().replace("-", chr(92) + "-")} 1 "" "{version}" "qmpipe"'
    yield ".SH NAME"
    yield f"{escaped(name_of(command))} \\- {escaped(page.summary.rstrip('.'))}"
    yield ".SH SYNOPSIS"
    yield f".B {escaped(usage)}"
    yield ".SH DESCRIPTION"
    yield escaped(page.summary.rstrip(".") + ".")
    notes = page.notes
    if any(line.strip() for line in notes):
        yield ".PP"
        yield from literal(notes)
    if "Commands" in page.groups:
        yield ".SH COMMANDS"
        yield from commands_of(command, page)
    yield ".SH OPTIONS"
    yield from options_of(page)
    if any("--memory" in names for _, names, _, _ in page.options()):
        yield ".SH MEMORY"
        yield MEMORY
    if page.examples:
        yield ".SH EXAMPLES"
        yield from literal(page.examples)
    yield ".SH EXIT STATUS"
    yield escaped(page.exit_codes) if page.exit_codes else EXIT_STATUS
    yield ".SH DIAGNOSTICS"
    yield escaped(DIAGNOSTICS)
    yield ".SH SEE ALSO"
    yield ", ".join(f"\\fB{escaped(name)}\\fR(1)" for name in siblings if name != name_of(command))


def completions(all_pages):
    yield "# Completions of qmpipe for bash; for zsh after: autoload -U bashcompinit && bashcompinit"
    yield "_qmpipe() {"
    yield '  local word=${COMP_WORDS[COMP_CWORD]} command="" k'
    yield "  for ((k = 1; k < COMP_CWORD; k++)); do"
    yield '    [[ ${COMP_WORDS[k]} == -* ]] || command+=" ${COMP_WORDS[k]}"'
    yield "  done"
    yield "  case $command in"
    # The longest names first, since what follows them may be anything.
    for command, page in sorted(all_pages.items(), key=lambda item: -len(item[0])):
        names = [name for _, names, _, _ in page.options() for name in names if name.startswith("-")]
        names += [name for name, _ in page.groups.get("Commands", [])]
        pattern = f'" {" ".join(command)}"*' if command else "*"
        yield f'    {pattern}) COMPREPLY=($(compgen -W "{" ".join(names)}" -- "$word")) ;;'
    yield "  esac"
    yield "}"
    yield "complete -o bashdefault -o default -F _qmpipe qmpipe"


def main(arguments):
    if len(arguments) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    qmpipe, folder = arguments[0], pathlib.Path(arguments[1])
    version = subprocess.run([qmpipe, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    all_pages = dict(pages(qmpipe))
    siblings = [name_of(command) for command in all_pages]
    for sub in ("man1", "bash"):
        (folder / sub).mkdir(parents=True, exist_ok=True)
    for command, page in all_pages.items():
        lines = man_page(command, page, version, siblings)
        (folder / "man1" / f"{name_of(command)}.1").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "bash" / "qmpipe").write_text("\n".join(completions(all_pages)) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
