#!/usr/bin/env python3
"""Runs an FMU for co-simulation (FMI 2.0 or 3.0) and sends its motion to imud, in real time or in lockstep.

It needs FMPy (pip install fmpy), and lockstep_client.py and realtime_client.py beside it. See README.md.
"""
import argparse
import math
import pathlib
import shutil
import sys

import fmpy
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2]))  # imud's tools
from lockstep_client import LockstepClient, Truth  # noqa: E402
from realtime_client import RealtimeClient  # noqa: E402

# The meanings of a variable. The attitude is that of front-right-down relative to north-east-down, or to an
# inertial frame.
QUANTITIES = {
    "roll": "rad", "pitch": "rad", "yaw": "rad", "qw": "1", "qx": "1", "qy": "1", "qz": "1",
    "p": "rad/s", "q": "rad/s", "r": "rad/s", "pdot": "rad/s^2", "qdot": "rad/s^2", "rdot": "rad/s^2",
    "fx": "m/s^2, specific force", "fy": "m/s^2", "fz": "m/s^2",
    "x": "m", "y": "m", "z": "m", "vx": "m/s", "vy": "m/s", "vz": "m/s",
}


def mrp(w, x, y, z):
    """Modified Rodrigues parameters of a quaternion, of the shorter rotation."""
    norm = math.copysign(math.sqrt(w * w + x * x + y * y + z * z), w)
    return tuple(v / norm / (1 + w / norm) for v in (x, y, z))


def quaternion_of_euler(roll, pitch, yaw):
    cr, sr, cp, sp, cy, sy = (f(a / 2) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return (cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy)


def truth_of(time_ns, values):
    """`values`: of QUANTITIES by name; one that is not mapped is 0, and a vector that is not mapped is not sent."""
    def vector(names):
        return tuple(values.get(name, 0.0) for name in names) if any(name in values for name in names) else None
    euler = (values.get(angle, 0.0) for angle in ("roll", "pitch", "yaw"))
    q = vector(("qw", "qx", "qy", "qz")) or quaternion_of_euler(*euler)
    zero = (0.0, 0.0, 0.0)
    return Truth(simulation_time_ns=time_ns, sigma_BN=mrp(*q), r_BN_N=vector("xyz") or zero,
                 v_BN_N=vector(("vx", "vy", "vz")) or zero, omega_BN_B=vector("pqr") or zero,
                 omegaDot_BN_B=vector(("pdot", "qdot", "rdot")), specific_force_B=vector(("fx", "fy", "fz")))


class Fmu:
    def __init__(self, path, start, variables):
        description = fmpy.read_model_description(path)
        if description.coSimulation is None:
            sys.exit(f"{path} is no FMU for co-simulation")
        references = {v.name: v.valueReference for v in description.modelVariables}
        for name in (*start, *variables):
            if name not in references:
                sys.exit(f"{path} has no variable {name}; it has {', '.join(sorted(references))}")
        self._folder = fmpy.extract(path)
        self._is_3 = description.fmiVersion.startswith("3")
        self._fmu = (FMU3Slave if self._is_3 else FMU2Slave)(
            guid=description.guid, unzipDirectory=self._folder, instanceName="imud",
            modelIdentifier=description.coSimulation.modelIdentifier)
        self._fmu.instantiate()
        for name, value in start.items():
            (self._fmu.setFloat64 if self._is_3 else self._fmu.setReal)([references[name]], [value])
        if not self._is_3:
            self._fmu.setupExperiment(startTime=0.0)
        self._fmu.enterInitializationMode()
        self._fmu.exitInitializationMode()
        self._references = [references[name] for name in variables]

    def values(self):
        return (self._fmu.getFloat64 if self._is_3 else self._fmu.getReal)(self._references)

    def step(self, time, size):
        self._fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def close(self):
        self._fmu.terminate()
        self._fmu.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)


def assignment(text):
    name, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"{text}: right would be NAME=VALUE")
    return name, value


def main():
    parser = argparse.ArgumentParser(description="Sends the motion of an FMU to imud.",
                                     epilog="Quantities: " + "; ".join(f"{n} ({u})" for n, u in QUANTITIES.items()))
    parser.add_argument("fmu")
    parser.add_argument("--map", nargs="+", type=assignment, required=True, metavar="QUANTITY=VARIABLE")
    parser.add_argument("--start", nargs="*", type=assignment, default=[], metavar="VARIABLE=NUMBER",
                        help="start values")
    parser.add_argument("--step-ms", type=int, default=10, help="communication step (%(default)s)")
    parser.add_argument("--for", dest="seconds", type=float, default=10.0, help="simulated seconds (%(default)s)")
    parser.add_argument("--lockstep", action="store_true", help="wait for imud in every step; otherwise in real time")
    parser.add_argument("--port", type=int, default=9810, help="UDP port of imud's truth.port (%(default)s)")
    options = parser.parse_args()
    mapped = dict(options.map)
    if unknown := set(mapped) - set(QUANTITIES):
        parser.error(f"--map: {', '.join(sorted(unknown))} is no quantity; see --help")
    fmu = Fmu(options.fmu, {name: float(value) for name, value in options.start}, list(mapped.values()))
    client = (LockstepClient if options.lockstep else RealtimeClient)("127.0.0.1", options.port)
    with client as imud:
        send = imud.step if options.lockstep else imud.send
        for step in range(round(options.seconds * 1000 / options.step_ms) + 1):
            answer = send(truth_of(step * options.step_ms * 1_000_000, dict(zip(mapped, fmu.values()))))
            if options.lockstep and not answer.accepted:
                sys.exit("imud refused the truth; its log has the cause")
            fmu.step(step * options.step_ms / 1000, options.step_ms / 1000)
    fmu.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
