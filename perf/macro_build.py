#!/usr/bin/env python3
"""Times whole runs of `qmpipe build` on a made-up DEM, on few threads and on many.

Runs of the different thread counts alternate, so that a slow minute of the machine hits all alike.
A run is pinned to as many cores as it has threads; where the machine has fewer, it runs with that
many threads all the same, and the benchmark's name says on how many cores. All runs must write the
same bytes: the exit code is 1 when they do not.
"""

import argparse
import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

import results

EXAMPLE = """example, a short one:
  perf/macro_build.py --size 2048x1536 --repetitions 3 -o macro.json"""
STAGES = ["window", "mesh", "finish", "encode", "sink"]


def hash_of_tiles(folder):
    """Of every file's name and bytes, but for report.json: it has the times of the run."""
    digest = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        if path == folder / "report.json":
            continue
        digest.update(f"{path.relative_to(folder)}\0{path.stat().st_size}\0".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def name_of(threads, available):
    if threads <= available:
        return f"build/{threads} threads"
    return f"build/{threads} threads on {available} cores"


def run_once(command, cores):
    """Seconds of wall and CPU time of a process that may use these cores only."""
    started = time.monotonic()
    # A child inherits its parent's cores.
    own_cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, cores)
    try:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    finally:
        os.sched_setaffinity(0, own_cores)
    said = process.stderr.read().decode(errors="replace")
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    wall_s = time.monotonic() - started
    if process.returncode != 0:
        results.fail(f"{' '.join(map(str, command))} ended with {process.returncode}:\n{said}")
    return wall_s, usage.ru_utime + usage.ru_stime


def build_once(arguments, dem, threads, available):
    """One run; what it took, by counter, and the hash of what it wrote."""
    out = pathlib.Path(tempfile.mkdtemp(prefix="macro-", dir=arguments.work)) / "tiles"
    cores = set(sorted(available)[:threads])
    try:
        wall_s, cpu_s = run_once([arguments.qmpipe, "build", dem, "-o", out, "--name", "macro",
                                  "--threads", str(threads)], cores)
        report = json.loads((out / "report.json").read_text(encoding="utf-8"))
        run = {"wall_s": wall_s, "cpu_s": cpu_s, "survey_s": report["survey_s"],
               "mesh_s": report["mesh_s"], "tiles": report["tiles"],
               "stored_bytes": report["stored_bytes"],
               "peak_resident_bytes": report["peak_resident_bytes"],
               "expected_peak_bytes": report["expected_peak_bytes"], "threads": threads,
               "cores": len(cores)}
        for stage in STAGES:
            run[f"{stage}_s"] = sum(zoom["stage_s"][stage] for zoom in report["zooms"])
        return run, hash_of_tiles(out)
    finally:
        shutil.rmtree(out.parent)


def measure(arguments):
    """The benchmarks of a result file, or the end of the program where bytes differ."""
    available = os.sched_getaffinity(0)
    size = results.size_of(arguments.size)
    dem = results.synth_dem(arguments.qmpipe, arguments.work, size)
    runs = {threads: [] for threads in arguments.threads}
    hashes = {}
    for repetition in range(arguments.repetitions):
        for threads in runs:
            run, content = build_once(arguments, dem, threads, available)
            runs[threads].append(run)
            hashes.setdefault(content, f"{threads} threads, run {repetition + 1}")
            if len(hashes) > 1:
                results.fail("the same build wrote different bytes: " + " and ".join(
                    f"{digest[:16]} ({who})" for digest, who in hashes.items()))
            print(f"{name_of(threads, len(available))}: {run['wall_s']:.2f} s, "
                  f"{run['cpu_s']:.2f} s of CPU, {run['tiles']} tiles", file=sys.stderr)
    found = {}
    for threads, measured in runs.items():
        counters = {key: [run[key] for run in measured] for key in measured[0]}
        found[f"{name_of(threads, len(available))}/{arguments.size}"] = results.benchmark(
            "s", counters.pop("wall_s"), counters)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, epilog=EXAMPLE,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="5120x3840", metavar="COLUMNSxROWS",
                        help="of the DEM, in pixels (default: %(default)s)")
    parser.add_argument("--threads", default="2,80", metavar="N,...",
                        help="thread counts to run with (default: %(default)s)")
    parser.add_argument("--repetitions", type=int, default=5, metavar="N",
                        help="runs of each (default: %(default)s)")
    parser.add_argument("--quick", action="store_true",
                        help="a smoke test: two runs each on a tiny DEM")
    parser.add_argument("--qmpipe", type=pathlib.Path, metavar="PROGRAM",
                        default=results.ROOT / "build/release/tools/qmpipe")
    parser.add_argument("--work", type=pathlib.Path, default=results.WORK, metavar="FOLDER",
                        help="for the DEM, which is kept, and the tiles (default: %(default)s)")
    parser.add_argument("-o", "--output", metavar="FILE", help="JSON (default: stdout)")
    arguments = parser.parse_args()
    arguments.threads = [int(word) for word in arguments.threads.split(",")]
    if arguments.quick:
        arguments.size, arguments.repetitions = "400x300", 2
    results.need_program(arguments.qmpipe)
    found = {"benchmarks": measure(arguments)}
    if arguments.output:
        results.write_json(arguments.output, found)
    else:
        print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
