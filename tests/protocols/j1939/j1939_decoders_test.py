"""Decoders by others read the J1939 unit's frames: canmatrix the numbers, by the DBC file; tshark the headers, and a
message of several frames.

Usage: j1939_decoders_test.py DUMP_J1939_FRAMES DBC. Needs python3-canmatrix and tshark.
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile

import canmatrix
import canmatrix.formats
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
from tshark import require, tshark, write_log


def check_numbers(records, matrix):
    """Every signal is its true value to one LSB, or to half of it if it is rounded to nearest."""
    seen = {}
    for record in records:
        if "values" not in record:
            continue
        identifier, _, data = record["frame"].partition("#")
        frame = matrix.frame_by_id(canmatrix.ArbitrationId(int(identifier, 16), extended=True))
        rounds_down = frame.name in ("SSI", "MAG", "VP")
        for name, signal in frame.decode(bytes.fromhex(data)).items():
            got, lsb = float(signal.phys_value), float(signal.signal.factor)
            if name in record["values"]:
                # Beyond its range a number saturates.
                limit = -float(signal.signal.offset)
                error = got - max(-limit, min(limit, record["values"][name]))
                low, high = (-lsb, 0) if rounds_down else (-lsb / 2, lsb / 2)
                require(low - 1e-9 <= error <= high + 1e-9, frame.name, name, got, record)
            else:
                wanted = {"repetition_rate": (2,), "mode": (1,)}.get(name, (0, 2) if "merit" in name else (0,))
                require(got in wanted, frame.name, name, got, record)
            seen.setdefault((frame.name, name), set()).add(got)
    for frame in matrix.frames:
        for signal in frame.signals:
            require((frame.name, signal.name) in seen, "not sent", frame.name, signal.name)
            require(signal.comment, frame.name, signal.name)
            is_measured = signal.unit and signal.name != "latency"
            require(not is_measured or len(seen[frame.name, signal.name]) > 20, frame.name, signal.name)
    return len(seen)


def check_headers(records, log):
    rows = tshark(log, "j1939", "j1939.priority", "j1939.pgn", "j1939.src_addr", "j1939.dst_addr", "j1939.data")
    require(len(rows) == len(records), len(rows), len(records))
    names = {0xF02D: (2, None), 0xF02A: (3, None), 0xF029: (3, None), 0xF013: (3, None), 0xFF6B: (3, None),
             0xFF6D: (2, None), 0xFF6A: (6, None), 0xFEF3: (6, None), 0xEE00: (6, 255), 0xEC00: (7, 0x21),
             0xEB00: (7, 0x21)}
    seen = set()
    for (priority, number, source, destination, data), record in zip(rows, records):
        if int(source) != 0x80:
            continue
        require(data == record["frame"].partition("#")[2].lower(), data, record)
        wanted = names[int(number)]
        require((int(priority), int(destination) if destination else None) == wanted, priority, destination, record)
        seen.add(int(number))
    require(seen == names.keys(), seen)


def check_transfer(text, log):
    """tshark's dissector of ISO 11783 puts transfers together, and begins with the number of the message."""
    whole = [row[0] for row in tshark(log, "isobus", "isobus.reassembled.data") if row[0]]
    require(whole == ["c5fd00" + text.encode().hex()], whole)


def main(dump, dbc):
    output = subprocess.run([dump], check=True, stdout=subprocess.PIPE, text=True).stdout
    *records, transferred = [json.loads(line) for line in output.splitlines()]
    require(len(records) > 800, len(records))
    print("canmatrix:", check_numbers(records, canmatrix.formats.loadp_flat(dbc)), "signals")
    with tempfile.TemporaryDirectory() as folder:
        log = os.path.join(folder, "bus.log")
        write_log(log, [record["frame"] for record in records])
        check_headers(records, log)
        check_transfer(transferred["text"], log)
    print("tshark:", len(records), "frames, and a message of several")


main(*sys.argv[1:])
