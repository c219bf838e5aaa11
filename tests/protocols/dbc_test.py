"""Checks that the DBC files agree with the decoder: canmatrix decodes the native CAN frames to the same numbers.

Usage: dbc_test.py DUMP_CAN_FRAMES FOLDER_OF_THE_DBC_FILES. Needs python3-canmatrix.
"""
import json
import pathlib
import subprocess
import sys
from decimal import Decimal

import canmatrix
import canmatrix.formats


def require(condition, *what):
    if not condition:  # not `assert`, which PYTHONOPTIMIZE removes
        raise AssertionError(what)


def main(dump, folder):
    matrices = {name: canmatrix.formats.loadp_flat(str(pathlib.Path(folder, name)))
                for name in ("native_can.dbc", "native_can_fd.dbc")}
    seen = {}
    for line in subprocess.run([dump], check=True, capture_output=True, text=True).stdout.splitlines():
        record = json.loads(line, parse_float=Decimal)
        identifier, _, data = record["frame"].partition("#")
        is_fd = data.startswith("#")
        data = bytes.fromhex(data[2:] if is_fd else data)
        frame = matrices[record["dbc"]].frame_by_id(canmatrix.ArbitrationId(int(identifier, 16), extended=False))
        require(frame.is_fd == is_fd and frame.size == len(data), record)
        wanted = record["values"]
        for name, signal in frame.decode(data).items():
            got = Decimal(signal.phys_value)
            if name == "time":
                # The classic frame carries microseconds modulo 2^32.
                modulus = Decimal(2) ** 64 if is_fd else Decimal(2) ** 32 * 1000
                require(got * 10**9 == wanted["time_ns"] % modulus, name, got, record)
            else:
                require(float(got) == float(wanted[name]), name, got, record)
            seen.setdefault(record["dbc"], {}).setdefault(name, set()).add(got)
    signals = {"time", "counter", "temperature", "status"} | {
        f"{quantity}_{axis}" for quantity in ("gyro", "accel", "dtheta", "dvel") for axis in "xyz"}
    for name, matrix in matrices.items():
        require(seen[name].keys() == signals, name, seen[name].keys())
        require(all(len(values) > 50 for values in seen[name].values()), name)
        for frame in matrix.frames:
            for signal in frame.signals:
                require(signal.comment, name, signal.name)
                require(signal.unit or signal.name in ("counter", "status"), name, signal.name)
    print("decoded alike:", {name: len(values) for name, values in seen.items()}, "signals")


main(*sys.argv[1:])
