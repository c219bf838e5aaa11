#!/usr/bin/env python3
"""Adds up the bytes that the compiler reads for the programs, for the two that tools/demo shows, and for the tests, headers and sources, each as often as it is included in
another object file, or in another list of precompiled headers. These decide how long a build takes, and unlike its time are the same on every machine with the same libraries.

build_cost_test.py BUILD_FOLDER

A sum of more than the limit fails: include less, or compile files together; or raise the limit in a commit that says what for. With other
versions of the libraries the sums are only printed.
"""
import os
import subprocess
import sys

from counted import is_known

# MB of g++ 12.2, Boost 1.74 and Eigen 3.4, some 3 % above the sums when they were written down.
LIMITS = {"programs": 346, "demo": 273, "tests": 516}
BY_HAND = ("imud_benchmark.dir", "imud_timing.dir")  # are not always built


def sums(build):
    def ninja(*arguments):
        return subprocess.run(["ninja", "-C", build, "-t", *arguments], capture_output=True, text=True, check=True).stdout

    deps, of_demo = ninja("deps"), set(ninja("inputs", "imud", "imu-decode").splitlines())
    sizes, bytes_of, objects_of = {}, dict.fromkeys(LIMITS, 0), dict.fromkeys(LIMITS, 0)
    kinds = []
    for line in deps.splitlines():
        if line and not line.startswith(" "):
            name = line.split(":")[0]
            kinds = ["tests"] if name.startswith("tests/") else ["programs", "demo"] if name in of_demo else ["programs"]
            if not name.endswith((".o", ".gch")) or any(part in name for part in BY_HAND):
                kinds = []
            for kind in kinds:
                objects_of[kind] += 1
        elif line.strip() and kinds:
            path = os.path.join(build, line.strip())
            if path not in sizes:
                sizes[path] = os.path.getsize(path) if os.path.exists(path) else 0
            for kind in kinds:
                bytes_of[kind] += sizes[path]
    return {kind: (bytes_of[kind] / 1e6, objects_of[kind]) for kind in LIMITS}


wrong = []
for kind, (megabytes, objects) in sums(sys.argv[1]).items():
    print(f"{kind:10} {megabytes:7.0f} MB are read for {objects} object files; the limit is {LIMITS[kind]} MB")
    if objects < 50:
        wrong.append(f"{kind}: only {objects} object files are known")
    elif is_known() and megabytes > LIMITS[kind]:
        wrong.append(f"{kind}: {megabytes:.0f} MB are read, more than {LIMITS[kind]} MB")
sys.exit("\n".join(wrong) or 0)
