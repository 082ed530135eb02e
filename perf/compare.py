#!/usr/bin/env python3
"""Compares two result files of perf/run: the ratio of medians, and whether it is more than noise.

A change counts when the medians are further apart than both spreads together. The exit code is 1
when something got slower than the threshold and the change counts, 2 when a file cannot be read.
"""

import argparse
import json
import sys
import tempfile
import unittest

# The commit is what is compared, so it may differ.
MACHINE_KEYS = ["cpu", "cores", "memory_bytes", "kernel", "compiler", "build_type"]
EXAMPLE = """example:
  git switch main    && perf/run -o before.json
  git switch faster  && perf/run -o after.json
  perf/compare.py before.json after.json --threshold 5
Both in one session on one machine that has nothing else to do; see CONTRIBUTING, "Measuring"."""


class BadResult(Exception):
    pass


def read_result(path):
    try:
        with open(path, encoding="utf-8") as file:
            result = json.load(file)
        for entry in result["benchmarks"].values():
            float(entry["median"]), float(entry["spread"]), int(entry["repetitions"])
        result["machine"].items()
    except OSError as error:
        raise BadResult(f"{path}: {error.strerror}") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise BadResult(f"{path} is no result of perf/run ({error!r})") from error
    return result


def verdict(before, after, threshold):
    """(ratio, noise, word) of one benchmark; ratio and noise are shares of the first median."""
    if before["unit"] != after["unit"] or before["median"] <= 0:
        return None, None, "cannot be compared"
    ratio = after["median"] / before["median"]
    noise = (before["spread"] + after["spread"]) / before["median"]
    if before["repetitions"] < 2 or after["repetitions"] < 2:
        return ratio, None, "noise unknown"
    if abs(ratio - 1) <= noise:
        return ratio, noise, ""
    if ratio < 1:
        return ratio, noise, "faster"
    return ratio, noise, "SLOWER" if ratio > 1 + threshold else "slower"


def changed_counters(before, after):
    """Counters that are exact in both and differ: sizes and counts, not rates."""
    for name in sorted(before.keys() & after.keys()):
        old, new = before[name], after[name]
        if old["spread"] == 0 and new["spread"] == 0 and old["median"] != new["median"]:
            yield f"{name} {old['median']:.6g} -> {new['median']:.6g}"


def compare(before, after, threshold):
    """(lines to print, True when something got slower beyond threshold and noise)."""
    lines = []
    for key in MACHINE_KEYS:
        old, new = before["machine"].get(key), after["machine"].get(key)
        if old != new:
            lines.append(f"another machine or build: {key} {old} -> {new}; ratios mean little")
    for result, name in ((before, "first"), (after, "second")):
        if result.get("quick"):
            lines.append(f"the {name} result is of a quick run; ratios mean little")
    left, right = before["benchmarks"], after["benchmarks"]
    width = max([len(name) for name in left.keys() & right.keys()] + [9])
    lines.append(f"{'benchmark':<{width}} {'before':>12} {'after':>12} {'unit':<4} {'ratio':>6} "
                 f"{'noise':>7}")
    is_slower = False
    for name in left:
        if name not in right:
            continue
        old, new = left[name], right[name]
        ratio, noise, word = verdict(old, new, threshold)
        is_slower |= word == "SLOWER"
        ratio_text = "-" if ratio is None else f"{ratio:.3f}"
        noise_text = "-" if noise is None else f"{100 * noise:.1f} %"
        notes = ", ".join([word] * bool(word) +
                          list(changed_counters(old.get("counters", {}), new.get("counters", {}))))
        lines.append(f"{name:<{width}} {old['median']:>12.5g} {new['median']:>12.5g} "
                     f"{new['unit']:<4} {ratio_text:>6} {noise_text:>7}  {notes}".rstrip())
    lines += [f"only in the first: {name}" for name in left if name not in right]
    lines += [f"only in the second: {name}" for name in right if name not in left]
    return lines, is_slower


class SelfTest(unittest.TestCase):
    @staticmethod
    def result(median, spread, repetitions=5, **machine):
        entry = {"unit": "ns", "median": median, "spread": spread, "repetitions": repetitions,
                 "counters": {"bytes": {"median": median // 2, "spread": 0}}}
        return {"machine": {"cpu": "A", "cores": 2, **machine}, "benchmarks": {"case": entry}}

    def check(self, before, after, is_slower, says=""):
        lines, slower = compare(before, after, 0.10)
        self.assertEqual(slower, is_slower, lines)
        self.assertIn(says, "\n".join(lines))
        return "\n".join(lines)

    def test_slower_than_threshold_and_noise_fails(self):
        self.check(self.result(100, 2), self.result(115, 2), True, "SLOWER")

    def test_slower_within_the_noise_of_either_side_does_not(self):
        for spreads in ((20, 0), (0, 20), (8, 8)):
            text = self.check(self.result(100, spreads[0]), self.result(115, spreads[1]), False)
            self.assertNotIn("lower", text)

    def test_slower_within_the_threshold_is_marked_only(self):
        self.check(self.result(100, 1), self.result(108, 1), False, "slower")

    def test_faster_is_marked(self):
        self.check(self.result(100, 1), self.result(80, 1), False, "faster")

    def test_one_repetition_proves_nothing(self):
        self.check(self.result(100, 0, 1), self.result(200, 0, 1), False, "noise unknown")

    def test_another_machine_is_said(self):
        self.check(self.result(100, 1), self.result(100, 1, cores=80), False, "cores 2 -> 80")

    def test_quick_runs_are_said(self):
        self.check({**self.result(100, 1), "quick": True}, self.result(100, 1), False, "quick run")

    def test_exact_counters_that_changed_are_shown(self):
        self.check(self.result(100, 50), self.result(104, 50), False, "bytes 50 -> 52")

    def test_what_is_in_one_file_only_is_listed(self):
        other = self.result(100, 1)
        other["benchmarks"] = {"new": other["benchmarks"]["case"]}
        text = self.check(self.result(100, 1), other, False)
        self.assertIn("only in the first: case", text)
        self.assertIn("only in the second: new", text)

    def test_a_file_that_is_no_result_is_refused(self):
        for text in ("", "[]", "{}", '{"machine": {}, "benchmarks": {"a": {"median": 1}}}'):
            with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
                file.write(text)
                file.flush()
                with self.assertRaises(BadResult):
                    read_result(file.name)
        with self.assertRaises(BadResult):
            read_result("/nonexistent.json")


def main():
    if sys.argv[1:] == ["--self-test"]:
        unittest.main(argv=[sys.argv[0]])
    parser = argparse.ArgumentParser(description=__doc__, epilog=EXAMPLE,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", metavar="A.json")
    parser.add_argument("after", metavar="B.json")
    parser.add_argument("--threshold", type=float, default=10, metavar="PERCENT",
                        help="how much slower is a failure (default: 10)")
    parser.add_argument("--self-test", action="store_true", help="check this program, then stop")
    arguments = parser.parse_args()
    try:
        before, after = read_result(arguments.before), read_result(arguments.after)
    except BadResult as error:
        print(f"compare.py: {error}", file=sys.stderr)
        sys.exit(2)
    lines, is_slower = compare(before, after, arguments.threshold / 100)
    print("\n".join(lines))
    sys.exit(1 if is_slower else 0)


if __name__ == "__main__":
    main()
