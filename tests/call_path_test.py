#!/usr/bin/env python3
"""Compares the functions that emulator/README.md lists between a datagram and the wire with the code.

Each is defined in the file beside its name, and its name stands in the file of the function under which it is indented,
or in a file that this one calls through Engine::apply.
"""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
text = (root / "emulator/README.md").read_text()
block = text.split("## From a datagram to the wire", 1)[1].split("```", 2)[1]
faults, callers, checked = [], [], 0
# What a driver proposes goes through the engine.
through = "".join((root / "emulator" / path).read_text()
                  for path in ("engine/engine.cpp", "engine/engine_commands.cpp", "engine/step.hpp", "engine/engine.hpp"))
for line in block.strip("\n").splitlines():
    match = re.match(r"( *)(\w+)::(\w+) +(\S+)", line)
    if match is None:
        faults.append(f"no function and file in: {line}")
        continue
    checked += 1
    depth, kind, name, path = len(match[1]) // 2, match[2], match[3], root / "emulator" / match[4]
    if not path.is_file():
        faults.append(f"{kind}::{name}: there is no file emulator/{match[4]}")
        continue
    here = path.read_text()
    virtual = kind == "Host"  # its real one is MonotonicHost
    if not re.search(rf"\b{'MonotonicHost' if virtual else kind}::{name}\(", here):
        faults.append(f"{kind}::{name} is not defined in emulator/{match[4]}")
    del callers[depth:]
    if callers:
        caller, caller_text = callers[-1]
        if not re.search(rf"\b{name}\(", caller_text + through):
            faults.append(f"{kind}::{name} is not called from the file of {caller}")
    callers.append((f"{kind}::{name}", here))
print("\n".join(faults))
print(f"{checked} functions checked, {len(faults)} faults")
sys.exit(1 if faults or checked < 20 else 0)
