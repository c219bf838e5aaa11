#!/usr/bin/env python3
"""Measures starts of imud: the instructions of those that end at once, the dynamic linker's among them, and the memory
of a run.

start_cost_test.py IMUD

Valgrind counts them. A start that takes more than its limit fails; another compiler, C library or processor has other
figures, which are only printed. A run in realtime locks its memory, and has all of it from the start on.
"""
import os
import subprocess
import sys
import tempfile

from counted import instructions, is_known

imud = os.path.abspath(sys.argv[1])
# Some 5 % above what g++ 12.2, glibc 2.36 and x86-64 with AVX2 take, in millions.
LIMITS = {("--version",): 4.7, ("list",): 4.9, ("check", "native.toml"): 7.7, ("check", "stim300.toml"): 14.6}
RANGES = "rate_hz = 200\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n"

MOST_DATA_KB = 5200  # some 20 % above what a run of one imu has, on every processor


def data_kb():
    """Returns VmData of a run of one imu that is ready: the memory that it can write, without the stack."""
    with open("run.toml", "w", encoding="utf-8") as file:
        file.write(f'[truth]\nport = "udp:127.0.0.1:0"\n[[imu]]\nprotocol = "native"\nport = "pty:./imu1"\n{RANGES}')
    run = subprocess.Popen([imud, "run", "run.toml"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    try:
        if not any(" info ready" in line for line in run.stderr):
            sys.exit("the run has ended before it was ready")
        with open(f"/proc/{run.pid}/status", encoding="utf-8") as file:
            return int(next(line.split()[1] for line in file if line.startswith("VmData:")))
    finally:
        run.terminate()
        run.communicate()


counted = 0
wrong = []
with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    for protocol in "native", "stim300":
        with open(f"{protocol}.toml", "w", encoding="utf-8") as file:
            file.write(f'[truth]\nport = "udp:127.0.0.1:9810"\n[[imu]]\nprotocol = "{protocol}"\nport = "pty:imu1"\n'
                       + (RANGES if protocol == "native" else ""))
    for arguments, limit in LIMITS.items():
        cost = instructions(imud, *arguments) / 1e6
        what = " ".join(("imud", *arguments))
        counted += 1
        print(f"{what:24} {cost:6.2f} million instructions, at most {limit}")
        if not 1 < cost <= limit:
            wrong.append(what)
    data = data_kb()
    print(f"a run of one imu has {data} kB, at most {MOST_DATA_KB}")
if counted != len(LIMITS):
    sys.exit("not all were counted")
if not 1000 < data <= MOST_DATA_KB:
    sys.exit("a run has more memory than it needs")
if not is_known():
    print("another compiler, C library or processor: not compared")
elif wrong:
    sys.exit("the start has become too expensive, by a library that is linked or by work that nobody asked for: "
             + ", ".join(wrong))
