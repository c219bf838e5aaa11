#!/usr/bin/env python3
"""Counts the instructions per sample of a fast replay of every product, and of the loop that the host's clock paces.

replay_cost_test.py IMUD IMU_TRUTH RUN_LOOP PERCENT

Valgrind counts two lengths of a run, of which the difference counts. A figure that differs by more than PERCENT from
the table fails. Another compiler, C library, Valgrind or processor has other figures, which are only printed.

The figures of one build repeat within 0.05 %, those of the loop within 0.3 %: measured by six runs with environments
of 0.1 to 4 kB, another temporary folder and another stack, beside programs that kept the processors busy.
"""
import os
import re
import subprocess
import sys
import tempfile

from counted import differences, instructions

imud, imu_truth, run_loop = map(os.path.abspath, sys.argv[1:4])
percent = float(sys.argv[4])
# g++ 12.2, glibc 2.36, Valgrind 3.19, x86-64 with AVX2; truth at 100 Hz as CSV text of 21 columns.
EXPECTED = {"native": 2856, "csv": 6255, "stim300": 4348, "mip": 4034, "vectornav": 4578, "dronecan": 4264,
            "mip, places": 10269, "mip, its filter": 14440, "the loop, 1 imu": 4419, "the loop, 16 imus": 4749}
RATES = {"stim300": 2000, "vectornav": 800}  # a product's own; elsewhere 1 kHz
SOLUTIONS = {"places": "truth", "its filter": "filter"}  # of a receiver and a magnetometer beside the gyros
INS = ('device.model = "3dm-gx5-45"\nnavigation.solution = "{}"\n[earth]\nframe = "local"\nlatitude_deg = 48\n'
       "longitude_deg = 11\n")
RANGES = "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n"


def write(name, text):
    with open(name, "w", encoding="utf-8") as file:
        file.write(text)


def of_a_replay(what):
    product, *solution = what.split(", ")
    own = product in RATES
    port = "canfile:/dev/null" if product == "dronecan" else "file:/dev/null"
    write("replay.toml", 'clock = "fast"\n[truth]\nport = "file:truth2.csv"\nformat = "csv"\n[[imu]]\n'
          f'protocol = "{product}"\nport = "{port}"\n' + ("" if own else "rate_hz = 1000\n") +
          (RANGES if product in ("native", "csv") else "") + (INS.format(SOLUTIONS[solution[0]]) if solution else ""))
    few, many = (instructions(imud, "replay", "replay.toml", f"file:truth{s}.csv", "--fast", "--threads", "1")
                 for s in (2, 12))
    return (many - few) / (10 * RATES.get(product, 1000))


def of_the_loop(imus):
    write("loop.toml", 'clock = "realtime"\n[truth]\nport = "udp:127.0.0.1:9810"\ndelay_ms = 20\n' + "".join(
        f'[[imu]]\nname = "i{i}"\nport = "file:{i}"\nprotocol = "native"\nrate_hz = 1000\n'
        f"phase_us = {1000 * i / imus}\n" + RANGES for i in range(imus)))
    few, many = (instructions(run_loop, "loop.toml", str(s)) for s in (1, 3))
    return (many - few) / (2000 * imus)


counted = 0
wrong = []
with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    for s in (2, 12):
        subprocess.run([imu_truth, "coning", "--rate", "100", "--for", str(s), "--csv", f"truth{s}.csv"], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for what, expected in EXPECTED.items():
        loop = re.fullmatch(r"the loop, (\d+) imus?", what)
        cost = of_the_loop(int(loop[1])) if loop else of_a_replay(what)
        counted += 1
        difference = 100 * (cost / expected - 1) if expected else 0
        print(f"{what:18} {cost:7.0f} instructions per sample, {difference:+.1f} % from {expected}")
        if abs(difference) > percent:
            wrong.append(what)
if counted != len(EXPECTED):
    sys.exit("not all were counted")
if different := differences():
    print("NOT COMPARED with the table: " + "; ".join(different))
elif wrong:
    sys.exit(f"more than {percent} % from the table, which a change must keep or a faster one must lower: "
             + ", ".join(wrong))
