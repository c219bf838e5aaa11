#!/usr/bin/env python3
"""Counts the instructions of starts of imud that end at once, the dynamic linker's among them.

start_cost_test.py IMUD

Valgrind counts them. A start that takes more than its limit fails; another compiler, C library or processor has other
figures, which are only printed.
"""
import os
import sys
import tempfile

from counted import instructions, is_known

imud = os.path.abspath(sys.argv[1])
# Some 5 % above what g++ 12.2, glibc 2.36 and x86-64 with AVX2 take, in millions.
LIMITS = {("--version",): 4.7, ("list",): 4.9, ("check", "native.toml"): 7.7, ("check", "stim300.toml"): 14.6}
RANGES = "rate_hz = 200\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n"

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
if counted != len(LIMITS):
    sys.exit("not all were counted")
if not is_known():
    print("another compiler, C library or processor: not compared")
elif wrong:
    sys.exit("the start has become too expensive, by a library that is linked or by work that nobody asked for: "
             + ", ".join(wrong))
