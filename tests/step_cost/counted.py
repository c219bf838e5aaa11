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


def version(*command):
    try:
        run = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return "none"
    return run.stdout.strip()


# Returns how this machine differs from the machine of the figures that the tests compare with. Valgrind decides by its
# processor which variants of the libraries' functions run.
def differences():
    here = {"g++": version("g++", "-dumpfullversion"), "glibc": "".join(platform.libc_ver()),
            "Valgrind": version("valgrind", "--version")}
    known = {"g++": "12.2", "glibc": "glibc2.36", "Valgrind": "valgrind-3.19"}
    found = [f"{what} is {here[what]}, not {known[what]}" for what in known if not here[what].startswith(known[what])]
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        return found if " avx2 " in file.read() else found + ["the processor has no AVX2"]


# Returns whether this is the machine of the figures that the tests compare with.
def is_known():
    return not differences()
