#!/usr/bin/env python3
"""Sends the ideal IMU of a Gazebo simulation (gz sim) to imud, through Gazebo's command-line client.

    gz topic --echo --json-output --topic /imu | gazebo_to_imud.py

The topic is that of an IMU sensor without <noise>, whose <orientation_reference_frame> has <localization>ENU. The
messages are gz.msgs.IMU as JSON, one in a line: orientation of the sensor relative to east-north-up, rate and specific
force in the sensor's axes, front-left-up. They become north-east-down and front-right-down. See README.md.
"""
import argparse
import json
import math
import pathlib
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2]))  # imud's tools
from lockstep_client import LockstepClient, Truth  # noqa: E402
from realtime_client import RealtimeClient  # noqa: E402


def vector(message, name):
    """A vector in front-right-down; JSON leaves out what is zero."""
    v = message.get(name, {})
    return (v.get("x", 0.0), -v.get("y", 0.0), -v.get("z", 0.0))


def sigma_of(message):
    """Modified Rodrigues parameters of front-right-down relative to north-east-down.

    With q the orientation (front-left-up to east-north-up), the result is q_NED_ENU * q * q_FLU_FRD: a turn by 180 deg
    about (1, 1, 0), and one about x.
    """
    q = message.get("orientation", {})
    w, x, y, z = (q.get(name, 0.0) for name in "wxyz")
    h = math.sqrt(0.5)
    w, x, y, z = h * (w + z), h * (x + y), h * (x - y), h * (w - z)
    norm = math.copysign(math.sqrt(w * w + x * x + y * y + z * z), w)
    return tuple(v / norm / (1 + w / norm) for v in (x, y, z)) if norm else (0.0, 0.0, 0.0)


def time_ns(message):
    stamp = message.get("header", {}).get("stamp", {})
    return int(stamp.get("sec", 0)) * 1_000_000_000 + int(stamp.get("nsec", 0))


def main():
    parser = argparse.ArgumentParser(description="Sends Gazebo's ideal IMU, as JSON on standard input, to imud.")
    parser.add_argument("--port", type=int, default=9810, help="UDP port of imud's truth.port (%(default)s)")
    parser.add_argument("--lockstep", action="store_true", help="for an imud in lockstep; Gazebo does not wait")
    options = parser.parse_args()
    sent, last = 0, -1
    with (LockstepClient if options.lockstep else RealtimeClient)("127.0.0.1", options.port) as imud:
        send = imud.step if options.lockstep else imud.send
        for line in sys.stdin:
            if not line.strip():
                continue
            message = json.loads(line)
            if (now := time_ns(message)) <= last:
                sys.exit("the simulation's time went back: start this program again with it")
            last = now
            send(Truth(simulation_time_ns=now, sigma_BN=sigma_of(message),
                       omega_BN_B=vector(message, "angularVelocity"),
                       specific_force_B=vector(message, "linearAcceleration")))
            sent += 1
    print(f"gazebo_to_imud.py: {sent} truths", file=sys.stderr)
    return 0 if sent else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(0)
    except (ValueError, RuntimeError) as error:
        sys.exit(f"gazebo_to_imud.py: {error}")
