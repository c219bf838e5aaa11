#!/usr/bin/env python3
"""Counts the instructions of a frame by its description beside the same frame by the product's C++.

frame_cost_test.py ENCODE_SAMPLES

Both send the same bytes (tests/protocols/frames/frame_like_devices_test.cpp). Valgrind counts two lengths of a run, of
which the difference counts, less what the samples themselves take. It is a ratio, and so holds on every machine.
"""
import os
import sys

from counted import instructions

encode = os.path.abspath(sys.argv[1])
LIMIT = 2.0


def per_sample(product, by):
    few, many = (instructions(encode, product, by, str(samples)) for samples in (1000, 11000))
    return (many - few) / 10000


counted = 0
wrong = []
for product in "stim300", "vectornav", "mip":
    motion, device, described = (per_sample(product, by) for by in ("motion", "device", "described"))
    ratio = (described - motion) / (device - motion)
    counted += 1
    print(f"{product:10} {device - motion:6.0f} instructions by its C++, {described - motion:6.0f} described: "
          f"{ratio:.2f} times")
    if not 0.1 < ratio <= LIMIT:
        wrong.append(product)
if counted != 3:
    sys.exit("not all were counted")
if wrong:
    sys.exit(f"more than {LIMIT} times the product's own code: " + ", ".join(wrong))
