"""What the scripts of perf/ share: the result file, statistics, and how a program is run.

A result file is one JSON object:
  machine     cpu, cores, memory_bytes, kernel, compiler, build_type, commit
  quick       true when it was a smoke test, whose figures are not for comparing
  benchmarks  by name: unit, median, spread, spread_is ("iqr", or "range" below four repetitions),
              repetitions, counters; a smaller median is better
  counters    by name: median and spread
"""

import json
import os
import pathlib
import platform
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
# Made-up DEMs and past results; git ignores build/.
WORK = ROOT / "build" / "perf"


def summary(values):
    """Median and spread: the interquartile range, or all of the range where there are few."""
    if len(values) >= 4:
        low, _, high = statistics.quantiles(values, n=4, method="inclusive")
    else:
        low, high = min(values), max(values)
    return {"median": statistics.median(values), "spread": high - low}


def benchmark(unit, values, counters):
    """One entry of a result file; `counters` are lists of one value a repetition."""
    return {"unit": unit, **summary(values), "spread_is": "iqr" if len(values) >= 4 else "range",
            "repetitions": len(values),
            "counters": {name: summary(counts) for name, counts in sorted(counters.items())}}


def write_json(path, content):
    path = pathlib.Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def first_line_of(command):
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return done.stdout.splitlines()[0] if done.stdout else ""


def cpu_model():
    for line in pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.machine()


def machine(build):
    """What the figures depend on besides the code; `build` is the folder of the build."""
    cache = {}
    for line in (build / "CMakeCache.txt").read_text(encoding="utf-8").splitlines():
        if "=" in line and not line.startswith(("#", "//")):
            name, value = line.split("=", 1)
            cache[name.split(":")[0]] = value
    build_type = cache.get("CMAKE_BUILD_TYPE", "unknown")
    flags = cache.get("CMAKE_CXX_FLAGS_" + build_type.upper(), "")
    commit = first_line_of(["git", "rev-parse", "--short=12", "HEAD"])
    if first_line_of(["git", "status", "--porcelain"]) not in ("", "unknown"):
        commit += " with changes"
    return {"cpu": cpu_model(), "cores": os.cpu_count(),
            "memory_bytes": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
            "kernel": platform.release(),
            "compiler": first_line_of([cache.get("CMAKE_CXX_COMPILER", "c++"), "--version"]),
            "build_type": f"{build_type} {flags}".strip(), "commit": commit}


def fail(message):
    print(f"{pathlib.Path(sys.argv[0]).name}: {message}", file=sys.stderr)
    sys.exit(1)


def need_program(path):
    if not os.access(path, os.X_OK):
        fail(f"{path} is not there; build it (cmake --preset release && cmake --build --preset "
             "release --target qmpipe), or name another with --qmpipe")


def size_of(text):
    """COLUMNSxROWS as two numbers."""
    columns, _, rows = text.partition("x")
    if not (columns.isdigit() and rows.isdigit()):
        fail(f"{text} is not a size; write COLUMNSxROWS, for example 4096x3072")
    return int(columns), int(rows)


def synth_dem(qmpipe, folder, size):
    """A made-up DEM with pixels of 3 seconds around a mountain range; made once, then kept."""
    columns, rows = size
    path = folder / f"dem-{columns}x{rows}.tif"
    if path.exists():
        return path
    folder.mkdir(parents=True, exist_ok=True)
    west, south = 109.5 - columns / 2400, 15.5 - rows / 2400
    bounds = f"{west!r},{south!r},{west + columns / 1200!r},{south + rows / 1200!r}"
    unfinished = path.with_suffix(".unfinished.tif")
    subprocess.run([qmpipe, "synth", "-o", unfinished, "--size", f"{columns}x{rows}", "--bounds",
                    bounds, "--seed", "1", "--overwrite"], check=True)
    unfinished.rename(path)
    return path
