#!/usr/bin/env python3
"""Holds the layout rules of the repository by reading its files (CONTRIBUTING, "Where things go").

Checked: includes point one way (scheduler <- formats <- stages <- pipeline <- tools, and within a layer
by the table of its rooms; tests and perf may include anything); each third-party library is included only where the table below allows it,
and in no header of ours; a .cpp includes its own header first, so that this compiles alone; no function of the C library whose last bits depend on the processor;
every header opens with a comment and has #pragma once; a name that a header defines is defined
nowhere else; no file is longer than 600 lines; no top-level folder that nobody agreed on.

  layering_test.py [ROOT]       checks a tree, prints every violation, exits 1 when there is one
  layering_test.py --self-test  builds trees with one violation each and checks that it is found
"""

import pathlib
import re
import sys
import tempfile

from defined_names import defined_twice

LAYERS = ["scheduler", "formats", "stages", "pipeline", "tools"]
# A layer's rooms: each may include those before it. A layer without a line here has none.
ROOMS = {
    "formats": ["bytes", "crs", "raster", "heights", "sources", "tile", "mbtiles", "pmtiles", "tile_sets",
                "hdf5", "run_store", "detail_model", "points"],
    "stages": ["posts", "synth", "surface", "greedy", "point_sets", "finish", "edge_collapse",
               "detail_model"],
    "pipeline": ["common", "recipe", "run", "survey", "build", "verify", "tin", "compare", "convert",
                 "web_check", "detail_model"],
    "tools": ["arguments", "web", "commands"],
}
NO_ROOM_NEEDED = {"tools/main.cpp"}
# Of tests/, beside the layers with their rooms.
TEST_ROOMS = {"support", "house", "browser", "fuzz", "golden"}
FREE_FOLDERS = ["tests", "perf"]  # these see everything, and nothing of a layer may include them
ALLOWED_FOLDERS = {*LAYERS, *FREE_FOLDERS, "docs", ".ci"}
# Never part of the project, whether or not they are there.
IGNORED_FOLDERS = {".git", ".cache", ".vscode", ".idea", "build", "demo", "node_modules",
                   "__pycache__"}

# A third-party header and the layers whose .cpp files may include it. A header that no line matches
# is a new dependency: decide which folder owns it and add a line.
THIRD_PARTY = [
    ("TBB", r"(tbb|oneapi)/", ["pipeline"]),
    ("GDAL", r"(gdal|ogr|cpl_|vrtdataset|proj\.h)", ["formats"]),
    ("HDF5", r"(hdf5|H5)", ["formats"]),
    ("SQLite", r"sqlite3", ["formats"]),
    ("zstd", r"zstd", ["formats"]),
    ("libdeflate", r"libdeflate", ["formats", "pipeline"]),
    ("nlohmann-json", r"nlohmann/", ["formats", "pipeline", "tools"]),
    ("meshoptimizer", r"meshoptimizer", ["stages"]),
    ("CGAL", r"(CGAL|boost)/", ["stages"]),
    ("CLI11", r"CLI/", ["tools"]),
    ("libcurl", r"curl/", ["tools"]),
    ("spdlog/fmt", r"(spdlog|fmt)/", LAYERS),
    ("GoogleTest", r"(gtest|gmock)/", []),
    ("Google Benchmark", r"benchmark/", []),
]

# C++ standard headers have no suffix and no folder.
STANDARD = re.compile(r"[a-z0-9_]+$")
# The operating system's, for .cpp files only.
SYSTEM = re.compile(r"((sys|linux|netinet)/\w+|dirent|errno|fcntl|malloc|netdb|poll|pthread|sched|signal|termios|time"
                    r"|unistd)\.h$")
INCLUDE = re.compile(r'\s*#\s*include\s*([<"])([^>"]+)[>"]')

# glibc has several versions of these and takes one by what the processor can do: their last bits
# differ. scheduler/elementary.h has all that is needed. (Square roots, remainders, roundings, ldexp
# and the like are exact.)
PROCESSOR_DEPENDENT = re.compile(
    r"(?<![\w.>:])(?:std::|::)?(?:a?(?:sin|cos|tan)h?|atan2|sincos|exp2?|expm1|log(?:2|10|1p)?|pow"
    r"|hypot|cbrt|erfc?|[lt]gamma)[fl]?\s*\("
    r"|std::(?:normal|lognormal|exponential|gamma|poisson|weibull|cauchy)_distribution")
# Files that may use them, and why what they compute reaches no byte of an output.
PROCESSOR_EXCEPTIONS = {}
STRINGS_AND_COMMENTS = re.compile(r'"(?:\\.|[^"\\])*"|//.*')

WARN_LINES = 400
FAIL_LINES = 600


def layer_of(path):
    return path.parts[0]


def room_of(path):
    """None for what stands in no room, or in a layer that has none."""
    return path.parts[1] if layer_of(path) in ROOMS and len(path.parts) > 2 else None


def check_room(path):
    rooms = ROOMS.get(layer_of(path))
    if rooms is None or str(path) in NO_ROOM_NEEDED:
        return
    if len(path.parts) != 3 or path.parts[1] not in rooms:
        yield f"{path}: in no room of {layer_of(path)}/: {', '.join(rooms)} (tests/house/layering_test.py)"


def check_test_room(path):
    """A layer's tests stand in the same tree as the layer."""
    if layer_of(path) != "tests" or path.parts[1] in TEST_ROOMS:
        return
    layer, inner = path.parts[1], path.parts[2:]
    if layer not in LAYERS or (layer in ROOMS and layer != "tools" and
                               (len(inner) != 2 or inner[0] not in ROOMS[layer])):
        yield f"{path}: tests stand in the rooms of what they test, or in {', '.join(sorted(TEST_ROOMS))}"


def check_way_between_rooms(path, target):
    layer, here, there = layer_of(path), room_of(path), room_of(pathlib.Path(target))
    if here not in ROOMS[layer] or there not in ROOMS[layer]:
        return None
    if ROOMS[layer].index(there) > ROOMS[layer].index(here):
        return (f'{layer}/{here}/ includes "{target}": rooms may include those before them, '
                f'{" <- ".join(ROOMS[layer])}')
    return None


def check_own_include(path, target):
    """An #include "..." line; returns what is wrong with it, or None."""
    folder = target.split("/")[0]
    if "/" not in target or folder not in [*LAYERS, *FREE_FOLDERS]:
        return f'"{target}" is not a path from the repository\'s root; third-party headers go in <>'
    here = layer_of(path)
    if here in FREE_FOLDERS:
        return None
    if folder == here:
        return check_way_between_rooms(path, target) if here in ROOMS else None
    if folder in FREE_FOLDERS:
        return f'{here}/ includes "{target}": nothing includes {folder}/'
    if LAYERS.index(folder) > LAYERS.index(here):
        return f'{here}/ includes "{target}": includes point one way, {" <- ".join(LAYERS)}'
    return None


def check_foreign_include(path, target):
    """An #include <...> line; returns what is wrong with it, or None."""
    if STANDARD.match(target) or layer_of(path) in FREE_FOLDERS:
        return None
    if path.suffix == ".h":
        return f"<{target}>: our headers include ours and the C++ standard's only"
    if SYSTEM.match(target):
        return None
    for name, pattern, layers in THIRD_PARTY:
        if re.match(pattern, target):
            if layer_of(path) in layers:
                return None
            where = " and ".join(f"{layer}/" for layer in layers) or "tests/ and perf/"
            return f"<{target}>: {name} belongs to {where}"
    return f"<{target}>: a new dependency; give it a line in tests/house/layering_test.py"


def check_includes(path, lines):
    for number, line in enumerate(lines, start=1):
        match = INCLUDE.match(line)
        if not match:
            continue
        check = check_own_include if match.group(1) == '"' else check_foreign_include
        problem = check(path, match.group(2))
        if problem:
            yield f"{path}:{number}: {problem}"


def check_arithmetic(path, lines):
    if layer_of(path) not in LAYERS or str(path) in PROCESSOR_EXCEPTIONS:
        return
    for number, line in enumerate(lines, start=1):
        match = PROCESSOR_DEPENDENT.search(STRINGS_AND_COMMENTS.sub('""', line))
        if match:
            yield (f"{path}:{number}: {match.group().rstrip('( ')}: its last bits depend on the "
                   "processor; use scheduler/elementary.h")


def check_header(path, lines):
    if not lines or not lines[0].startswith(("//", "/*")):
        yield f"{path}:1: a header opens with a comment that says what it is for"
    if "#pragma once" not in (line.strip() for line in lines):
        yield f"{path}:1: a header has #pragma once"


def check_first_include(path, lines):
    """That a header compiles alone is proved by the file that includes it before anything else."""
    own = f'"{path.with_suffix(".h")}"'
    number, first = next(((n, line) for n, line in enumerate(lines, start=1)
                          if INCLUDE.match(line)), (1, ""))
    if own not in first:
        yield f"{path}:{number}: the first include is its own header, {own}"


def project_files(root):
    for folder in [*LAYERS, *FREE_FOLDERS, ".ci"]:
        for path in sorted((root / folder).rglob("*")):
            if path.is_file() and not IGNORED_FOLDERS & set(path.relative_to(root).parts):
                yield path


def check_tree(root):
    """Returns (violations, warnings) as lists of lines."""
    violations = []
    warnings = []
    sources = {}
    for folder in sorted(p.name for p in root.iterdir() if p.is_dir()):
        if folder not in ALLOWED_FOLDERS | IGNORED_FOLDERS:
            violations.append(f"{folder}/: not one of the folders that CONTRIBUTING names")
    for absolute in project_files(root):
        path = absolute.relative_to(root)
        # What a test preloads into the program is C: the functions that it replaces are.
        is_preloaded = path.suffix == ".c" and layer_of(path) == "tests"
        if path.suffix in (".hpp", ".hh", ".hxx", ".cc", ".cxx", ".c") and not is_preloaded:
            violations.append(f"{path}: C++ files are called .h and .cpp")
        if path.suffix not in (".h", ".cpp", ".py", ".sh"):
            continue
        lines = absolute.read_text(encoding="utf-8").splitlines()
        if len(lines) > FAIL_LINES:
            violations.append(f"{path}: {len(lines)} lines, {FAIL_LINES} is the limit; split it")
        elif len(lines) > WARN_LINES:
            warnings.append(f"{path}: {len(lines)} lines, {WARN_LINES} is long")
        if path.suffix in (".h", ".cpp"):
            violations += check_room(path)
            violations += check_test_room(path)
            violations += check_includes(path, lines)
            violations += check_arithmetic(path, lines)
            sources[path] = "\n".join(lines)
        if path.suffix == ".h":
            violations += check_header(path, lines)
        elif path.suffix == ".cpp" and absolute.with_suffix(".h").exists():
            violations += check_first_include(path, lines)
    # A test is a program of its own, so what it keeps to itself may be called as it likes.
    violations += defined_twice(sources, is_alone=lambda path: layer_of(path) in FREE_FOLDERS)
    return violations, warnings


# A tree without a fault: every pair that the rules allow and that is easy to get wrong.
GOOD_TREE = {
    "scheduler/a.h": "// A.\n#pragma once\n#include <vector>\n",
    "formats/bytes/a.cpp": '#include "formats/bytes/a.h"\n#include "scheduler/a.h"\n#include <gdal_priv.h>\n'
                     "#include <sqlite3.h>\n#include <zstd.h>\n#include <hdf5.h>\n"
                     "#include <unistd.h>\n#include <libdeflate.h>\n#include <cpl_vsi.h>\n",
    "stages/posts/a.cpp": '#include "formats/bytes/a.h"\n#include <CGAL/Epick.h>\n#include <fmt/format.h>\n'
                    "#include <meshoptimizer.h>\n",
    "pipeline/common/a.cpp": '#include "stages/posts/a.h"\n#include <tbb/flow_graph.h>\n'
                      "#include <nlohmann/json.hpp>\n#include <spdlog/spdlog.h>\n",
    "tools/arguments/a.cpp": '#include "pipeline/common/a.h"\n#include <CLI/CLI.hpp>\n#include <nlohmann/json.hpp>\n',
    "stages/posts/arithmetic.cpp": 'auto a = "sin(x)";  // std::sin(x)\n'
                             "auto b = exponential(x) + std::sqrt(y) + log_.exp(z) + arcsin(x);\n",
    "tests/support/helper.h": '// H.\n#pragma once\n#include "tools/arguments/a.h"\n#include <gtest/gtest.h>\n',
    "perf/a.cpp": '#include "tests/support/helper.h"\n#include <benchmark/benchmark.h>\n'
                  "#include <tbb/flow_graph.h>\n",
    "docs/a.md": "text\n",
    "tools/main.cpp": '#include "tools/commands/a.h"\n#include "tools/arguments/a.h"\n',
    "tools/commands/a.h": '// A.\n#pragma once\n#include "tools/arguments/a.h"\n',
    "build/formats/a.h": "no header of ours\n",
    "tests/__pycache__/a.h": "no header of ours\n",
    # Names that are no second definition: a declaration, a private class, an overload, another
    # namespace, a member, a text, a comment, unnamed namespaces of two layers, a test's own.
    "stages/posts/names.h": "// N.\n#pragma once\nnamespace qmpipe {\nclass Store;\n"
                      "struct Post { int i; };\ninline constexpr int kWide = 1;\n"
                      "inline int size_of(const Post& p) { return p.i; }\n"
                      "template <class T>\nclass Cache { struct Impl; };\n}  // namespace qmpipe\n",
    "stages/posts/store.h": "// S.\n#pragma once\nnamespace qmpipe {\nclass Post;\n"
                      "class Store { struct Post {}; };\ninline int size_of(int p) { return p; }\n"
                      "namespace detail { struct Post {}; }\n}  // namespace qmpipe\n",
    "stages/posts/store.cpp": '#include "stages/posts/store.h"\n'
                        "namespace fs = std::filesystem;\nnamespace qmpipe {\nnamespace {\n"
                        "struct Entry { int k; };  // struct Post {\n"
                        'const char* const kText = "struct Post { int i; };";\n}\n'
                        "struct Store::Impl { int Post = 1; };\nclass Own {};\n}\n",
    "stages/posts/names.cpp": '#include "stages/posts/names.h"\n'
                        "namespace fs = std::filesystem;\nnamespace qmpipe {\nnamespace {\n"
                        "using Number = long;\n}\nint f() { struct Post {}; return 0; }\n}\n",
    "pipeline/common/names.cpp": "namespace qmpipe {\nnamespace {\nstruct Entry { long k; };\n"
                          "int f() try {\n  return 1;\n} catch (int) {\n  return 0;\n}\n}\n}\n",
    "pipeline/common/tries.cpp": "namespace qmpipe {\nnamespace {\n"
                          "int g() try {\n  return 1;\n} catch (int) {\n  return 0;\n}\n}\n}\n",
    "tests/formats/bytes/names_test.cpp": "namespace qmpipe {\nnamespace {\nstruct Post { int x; };\n}\n}\n",
}

HEADER = "// H.\n#pragma once\n"
# (file, its text, what the violation must say)
FAULTS = [
    ("scheduler/b.cpp", '#include "formats/bytes/a.h"\n', "includes point one way"),
    ("formats/bytes/b.h", HEADER + '#include "stages/posts/a.h"\n', "formats/bytes/b.h:3: formats/ includes"),
    ("stages/posts/b.cpp", '#include "pipeline/common/a.h"\n', "includes point one way"),
    ("pipeline/common/b.cpp", '#  include "tools/arguments/a.h"\n', "includes point one way"),
    ("tools/arguments/b.cpp", '#include "tests/support/helper.h"\n', "nothing includes tests/"),
    ("formats/bytes/b.cpp", '#include "formats/crs/a.h"\n',
     'formats/bytes/ includes "formats/crs/a.h": rooms may include those before them'),
    ("formats/b.cpp", "int x;\n", "formats/b.cpp: in no room of formats/"),
    ("formats/bites/b.cpp", "int x;\n", "in no room of formats/"),
    ("formats/bytes/more/b.cpp", "int x;\n", "in no room of formats/"),
    ("formats/bytes/b.cpp", '#include "a.h"\n', "not a path from the repository's root"),
    ("formats/bytes/b.cpp", '#include "fmt/format.h"\n', "not a path from the repository's root"),
    ("scheduler/b.cpp", "#include <tbb/concurrent_queue.h>\n", "TBB belongs to pipeline/"),
    ("stages/posts/b.cpp", "#include <oneapi/tbb.h>\n", "TBB belongs to pipeline/"),
    ("pipeline/common/b.cpp", "#include <gdal_priv.h>\n", "GDAL belongs to formats/"),
    ("tools/arguments/b.cpp", "#include <ogr_spatialref.h>\n", "GDAL belongs to formats/"),
    ("tools/arguments/b.cpp", "#include <cpl_conv.h>\n", "GDAL belongs to formats/"),
    ("stages/posts/b.cpp", "#include <hdf5.h>\n", "HDF5 belongs to formats/"),
    ("pipeline/common/b.cpp", "#include <sqlite3.h>\n", "SQLite belongs to formats/"),
    ("pipeline/common/b.cpp", "#include <zstd.h>\n", "zstd belongs to formats/"),
    ("stages/posts/b.cpp", "#include <libdeflate.h>\n", "libdeflate belongs to formats/ and pipeline/"),
    ("stages/posts/b.cpp", "#include <nlohmann/json.hpp>\n", "nlohmann-json belongs to"),
    ("formats/bytes/b.cpp", "#include <CGAL/Epick.h>\n", "CGAL belongs to stages/"),
    ("pipeline/common/b.cpp", "#include <CLI/CLI.hpp>\n", "CLI11 belongs to tools/"),
    ("formats/bytes/b.cpp", "#include <gtest/gtest.h>\n", "GoogleTest belongs to tests/ and perf/"),
    ("formats/bytes/b.cpp", "#include <Eigen/Dense>\n", "a new dependency"),
    ("stages/posts/b.h", HEADER + "#include <fmt/format.h>\n", "our headers include ours"),
    ("formats/bytes/b.h", HEADER + "#include <gdal_priv.h>\n", "our headers include ours"),
    ("scheduler/b.h", "// No guard.\n", "has #pragma once"),
    ("scheduler/b.h", "#pragma once\n// Late.\n", "opens with a comment"),
    ("scheduler/b.h", "#pragma once", "opens with a comment"),
    ("scheduler/b.hpp", HEADER, "are called .h and .cpp"),
    ("stages/posts/b.cpp", "int x;\n" * 601, "601 lines"),
    ("tests/b.py", "x = 1\n" * 601, "601 lines"),
    ("stages/posts/b.cpp", "double x = std::sin(y);\n", "stages/posts/b.cpp:1: std::sin: its last bits"),
    ("formats/bytes/b.h", HEADER + "inline double f(double y) { return 2*pow(y, 2); }\n", "last bits"),
    ("scheduler/b.cpp", "double x = std::hypot (y, z);\n", "last bits"),
    ("pipeline/common/b.cpp", "std::normal_distribution<double> x;\n", "last bits"),
    ("stages/posts/names.cpp", '#include <vector>\n#include "stages/posts/names.h"\n',
     "stages/posts/names.cpp:1: the first include is its own header, \"stages/posts/names.h\""),
    ("stages/posts/names.cpp", "int x;\n", "the first include is its own header"),
    ("src/b.cpp", "int x;\n", "src/: not one of the folders"),
    ("tools/arguments/b.h", HEADER + "namespace qmpipe {\nstruct Post {\n  int x;\n};\n}\n",
     "tools/arguments/b.h:4: qmpipe::Post is defined in stages/posts/names.h:5 too"),
    ("tools/arguments/b.h", HEADER + "namespace qmpipe {\nenum class Post : int { kA };\n}\n", "Post is"),
    ("tools/arguments/b.h", HEADER + "namespace qmpipe {\nusing Post = int;\n}\n", "Post is defined"),
    ("tools/arguments/b.h", HEADER + "namespace qmpipe {\ntemplate <class T, int N = (1 < 2)>\n"
                           "class Cache final : public Base<T> {\n};\n}\n", "Cache is defined"),
    ("tools/arguments/b.h", HEADER + "namespace qmpipe {\ninline constexpr long kWide{2};\n}\n", "kWide is"),
    ("tools/arguments/b.h", HEADER + "namespace qmpipe {\ninline long size_of(const Post& q) {\n}\n}\n",
     "size_of is defined"),
    ("stages/posts/b.cpp", "namespace qmpipe {\nnamespace {\nstruct Post {};\n}\n}\n",
     "stages/posts/b.cpp:3: qmpipe::Post is defined in stages/posts/names.h:5 too"),
    ("tests/support/b.cpp", "namespace qmpipe {\nstruct Post {};\n}\n", "Post is defined"),
    ("tests/b.cpp", "int b;\n", "tests stand in the rooms"),
    ("tests/formats/b.cpp", "int b;\n", "tests stand in the rooms"),
    ("tests/formats/walls/b.cpp", "int b;\n", "tests stand in the rooms"),
    ("stages/posts/z.cpp", "namespace qmpipe {\nnamespace {\nclass Entry {};\n}\n}\n",
     "stages/posts/z.cpp:3: qmpipe::Entry is defined in stages/posts/store.cpp:5 too, in an unnamed"),
    # `Entry` is not the linker's in the others; `Own` is.
    ("stages/posts/z.cpp", "namespace qmpipe {\nstruct Entry {};\nclass Own {};\n}\n", "Own is defined"),
]


def write_tree(root, files):
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def found_in(files):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        write_tree(root, files)
        return check_tree(root)


def self_test():
    failures = []
    if found_in(GOOD_TREE) != ([], []):
        failures.append(f"a tree without a fault: {found_in(GOOD_TREE)}")
    for name, text, expected in FAULTS:
        violations, _ = found_in({**GOOD_TREE, name: text})
        if len(violations) != 1 or expected not in violations[0]:
            failures.append(f"{name} with {text[:60]!r}: expected '{expected}', got {violations}")
    violations, warnings = found_in({**GOOD_TREE, "stages/posts/b.cpp": "int x;\n" * 401})
    if violations or len(warnings) != 1:
        failures.append("401 lines are a warning and not a violation")
    for failure in failures:
        print(f"self-test: {failure}")
    print(f"self-test: {len(FAULTS) + 2} cases, {len(failures)} wrong")
    return 1 if failures else 0


def main(arguments):
    if arguments == ["--self-test"]:
        return self_test()
    if len(arguments) > 1 or any(a.startswith("-") for a in arguments):
        print(__doc__, file=sys.stderr)
        return 2
    root = pathlib.Path(arguments[0]) if arguments else pathlib.Path(__file__).resolve().parents[2]
    violations, warnings = check_tree(root.resolve())
    for warning in warnings:
        print(f"warning: {warning}")
    for violation in violations:
        print(violation)
    return 1 if violations else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
