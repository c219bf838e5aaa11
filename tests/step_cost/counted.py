"""Counts the instructions of a program by Valgrind."""
import platform
import re
import subprocess
import sys


def instructions(*command):
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", *command]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    counted = re.search(r"Collected : (\d+)", run.stderr)
    if run.returncode != 0 or counted is None:
        sys.exit(f"{' '.join(command)}: {run.stderr}")
    return int(counted[1])


# Returns whether this is the machine of the figures that the tests compare with.
def is_known():
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        has_avx2 = " avx2 " in file.read()
    compiler = subprocess.run(["g++", "-dumpfullversion"], capture_output=True, text=True, check=False).stdout.strip()
    return has_avx2 and compiler.startswith("12.2") and platform.libc_ver() == ("glibc", "2.36")
