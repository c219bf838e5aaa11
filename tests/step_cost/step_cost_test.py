#!/usr/bin/env python3
"""Counts the instructions of a step of the sensor model: a truth pushed, a sample taken at its time.

step_cost_test.py TAKE_STEPS

Valgrind counts them, so that the figures do not depend on what else the machine does. The program ends with a fault if
a step allocates or a sample is saturated.
"""
import sys

from counted import instructions

take_steps = sys.argv[1]


def per_step(model):
    few, many = 10_000, 30_000
    return (instructions(take_steps, model, str(many)) - instructions(take_steps, model, str(few))) / (many - few)


truths = per_step("truths")
memo = per_step("memo") - truths
tactical = per_step("tactical") - truths
with open("/proc/cpuinfo") as file:
    has_avx2 = " avx2 " in file.read()
# g++ 12: 1593 with AVX2, tactical 2915. The module of Basilisk takes 8507 for the same as the memo.
limit = 1650 if has_avx2 else 3000
print(f"instructions per step: memo {memo:.0f}, at most {limit} here; tactical {tactical:.0f}, "
      f"{tactical / memo:.2f} times as many, at most 2")
if not 500 < memo <= limit or not memo < tactical <= 2 * memo:
    sys.exit("a step has become too expensive")
