"""Which names a C++ file defines at namespace scope, for the rule that a name is defined once.

No compiler: braces are followed, and what stands before each is looked at. That is enough for code
laid out by clang-format; macros are not expanded.
"""

import re
from typing import NamedTuple

COMMENTS_AND_TEXTS = re.compile(
    r'//[^\n]*|/\*.*?\*/|R"(?P<end>[^(\s]*)\(.*?\)(?P=end)"|"(?:\\.|[^"\\\n])*"'
    r"|(?<![0-9A-Fa-f])'(?:\\.|[^'\\\n])+'|^[ \t]*#(?:\\\n|[^\n])*", re.DOTALL | re.MULTILINE)
NAMESPACE = re.compile(r"(?:inline\s+)?namespace\b\s*([\w:]*)$")
TYPE = re.compile(r"(?:typedef\s+)?(?:struct|class|union|enum(?:\s+(?:class|struct))?)\s+"
                  r"(?:alignas\s*\([^)]*\)\s*)?(\w+)(?:\s+final)?\s*(?::(?!:)[^()]*)?$")
ALIAS = re.compile(r"using\s+(\w+)\s*=")
FUNCTION = re.compile(r"(operator\s*\S+?|[\w:]+)\s*\(")
VARIABLE = re.compile(r"[\w>*&\]]\s*[ *&](\w+)$")
NOT_VARIABLES = re.compile(r"(?:using|namespace|typedef|friend|extern|static_assert|template|return|struct|class"
                           r"|union|enum)\b")


class Name(NamedTuple):
    kind: str       # "type", "alias", "value" or "function"
    name: str       # with its namespaces, without unnamed ones: "qmpipe::Post"
    is_local: bool  # in an unnamed namespace
    line: int
    parameters: str = ""  # of a function: the types of its parameters


def blanked(text):
    """The text without comments, literals, preprocessor lines and attributes, line for line."""
    text = COMMENTS_AND_TEXTS.sub(lambda m: " " + "\n" * m.group().count("\n"), text)
    return re.sub(r"\[\[[^\]]*\]\]", " ", text)


def without_template(head):
    """`template <class T, std::size_t N = (1 > 0)> struct X` -> `struct X`."""
    while match := re.match(r"template\s*<", head):
        depth, parentheses, at = 1, 0, match.end()
        while at < len(head) and depth:
            parentheses += {"(": 1, ")": -1}.get(head[at], 0)
            depth += {"<": 1, ">": -1}.get(head[at], 0) if parentheses == 0 else 0
            at += 1
        head = head[at:].strip()
    return head


def split_parameters(text):
    """The text up to the bracket that ends a list of parameters, cut at its own commas."""
    depth, parts = 0, [""]
    for letter in text:
        if letter in "(<[{":
            depth += 1
        elif letter in ")>]}":
            depth -= 1
            if depth < 0:
                break
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def types_of(parameters):
    """`const A& a, int b = 0` -> `const A&, int`: two functions with the same are one to the linker."""
    types = []
    for part in split_parameters(parameters):
        words = re.sub(r"\s+", " ", part.partition("=")[0]).strip()
        named = re.fullmatch(r"(.*[\w>*&] ?[ *&])(\w+)((?:\[\w*\])*)", words)
        types.append((named.group(1) + named.group(3) if named else words).replace(" ", ""))
    return ", ".join(types)


def name_of_head(head):
    """(kind, name, parameters) of what stands before a `{` at namespace scope, or None."""
    head = without_template(head)
    if head.startswith("catch"):  # of a function whose whole body is tried
        return None
    if match := TYPE.match(head):
        return "type", match.group(1), ""
    function = FUNCTION.search(head)
    value = head.partition("=")[0].rstrip()
    if function and (function.group(1).startswith("operator") or function.end() <= len(value)):
        # Members are defined where their class is.
        if "::" in function.group(1):
            return None
        return "function", function.group(1), types_of(head[function.end():])
    if NOT_VARIABLES.match(value):
        return None
    value = re.sub(r"(?:\[[^\]]*\]\s*)+$", "", value).rstrip()
    match = VARIABLE.search(value)
    return ("value", match.group(1), "") if match else None


def name_of_statement(text):
    """(kind, name, parameters) of a statement that ends with `;`, or None: declarations do not count."""
    text = without_template(text)
    if match := ALIAS.match(text):
        return "alias", match.group(1), ""
    if match := re.match(r"typedef\b.*\b(\w+)$", text, re.DOTALL):
        return "alias", match.group(1), ""
    found = None if NOT_VARIABLES.match(text) else name_of_head(text)
    return found if found and found[0] == "value" else None


class Reader:
    def __init__(self, text):
        self.names = []
        self.scopes = []  # a namespace's name ("" if it has none), or None in any other braces
        self.statement = ""  # what has been read of one at namespace scope
        self.line = 1
        self.start_line = 1
        for token in re.findall(r"[{};]|\n|[^{};\n]+", blanked(text)):
            self.read(token)

    def is_namespace_scope(self):
        return None not in self.scopes

    def read(self, token):
        if token == "\n":
            self.line += 1
        if token == "{":
            self.open()
        elif token == "}":
            self.close()
        elif self.is_namespace_scope():
            if token == ";":
                self.add(name_of_statement(self.statement.strip()))
                self.statement = ""
            else:
                if not self.statement.strip():
                    self.start_line = self.line
                self.statement += token

    def open(self):
        if not self.is_namespace_scope():
            self.scopes.append(None)
            return
        head = self.statement.strip()
        if match := NAMESPACE.match(head):
            self.scopes.append(match.group(1))
            self.statement = ""
            return
        if head == "extern":
            self.scopes.append("extern")
            self.statement = ""
            return
        found = name_of_head(head)
        self.scopes.append(None)
        if found and found[0] != "value":
            self.add(found)
            self.statement = ""
        elif not found:
            self.statement = ""
        # A value's braces are its initializer: its statement goes on to the semicolon.

    def close(self):
        if self.scopes:
            self.scopes.pop()

    def add(self, found):
        if not found:
            return
        kind, name, parameters = found
        named = [scope for scope in self.scopes if scope and scope != "extern"]
        self.names.append(Name(kind, "::".join([*named, name]), "" in self.scopes, self.start_line,
                               parameters))


def defined_names(text):
    return Reader(text).names


def defined_twice(files, is_alone=lambda path: False):
    """What is wrong in {path: text}, as lines. A header's name belongs to it alone: another header,
    or a source file that gives it another meaning, in an unnamed namespace too, is a fault; so are
    types of one name in two source files that the linker would take for one; and what two source
    files of a folder have in unnamed namespaces, for they may be compiled as one. Functions may be
    overloaded, so their parameters count. `is_alone(path)`: what that source file has in unnamed
    namespaces concerns nobody."""
    first_of = {}
    first_local = {}
    faults = []
    # Headers first: where a source file takes a header's name, the source file is at fault.
    for path in sorted(files, key=lambda p: (p.suffix != ".h", p)):
        for name in defined_names(files[path]):
            if path.suffix != ".h" and name.is_local and is_alone(path):
                continue
            key = name.name, name.parameters if name.kind == "function" else None
            # Aliases may be repeated; where they differ, the compiler says so.
            if path.suffix != ".h" and name.is_local and name.kind != "alias":
                other_path, line = first_local.setdefault((path.parts[0], key), (path, name.line))
                if other_path != path:
                    faults.append(f"{path}:{name.line}: {name.name} is defined in {other_path}:{line} too, "
                                  "in an unnamed namespace as here; give one of them another name")
            if path.suffix != ".h" and name.kind == "function":
                continue  # the linker sees those
            is_shared = path.suffix == ".h" or (name.kind == "type" and not name.is_local)
            other_path, line = first_of.get(key, (path, 0))
            if other_path != path and (other_path.suffix == ".h" or is_shared):
                faults.append(f"{path}:{name.line}: {name.name} is defined in {other_path}:{line} too; "
                              "give one of them another name")
            if is_shared:
                first_of.setdefault(key, (path, name.line))
    return faults
