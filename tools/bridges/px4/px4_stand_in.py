#!/usr/bin/env python3
"""Stands in for PX4 where only the path from the simulator to imud is tried: it connects to the simulator as PX4 does,
asks for HIL_STATE_QUATERNION, and commands a climb with a yaw to and fro, without any control. See README.md."""
import argparse
import math
import select
import socket
import struct
import sys
import time

CRC_EXTRA = {0: 50, 76: 152, 93: 47}  # HEARTBEAT, COMMAND_LONG, HIL_ACTUATOR_CONTROLS; of the MAVLink common set


def crc16(data, crc=0xFFFF):
    """CRC-16/MCRF4XX, as MAVLink has it."""
    for byte in data:
        byte ^= crc & 0xFF
        byte = (byte ^ byte << 4) & 0xFF
        crc = crc >> 8 ^ byte << 8 ^ byte << 3 ^ byte >> 4
    return crc


class Sender:
    def __init__(self, line):
        self._line, self._sequence = line, 0

    def send(self, message, payload):
        """A frame of MAVLink 1 from system 1, component 1."""
        body = struct.pack("<5B", len(payload), self._sequence, 1, 1, message) + payload
        self._sequence = (self._sequence + 1) % 256
        self._line.sendall(b"\xfe" + body + struct.pack("<H", crc16(body + bytes([CRC_EXTRA[message]]))))


def main():
    parser = argparse.ArgumentParser(description="Stands in for PX4 at a simulator that speaks MAVLink over TCP.")
    parser.add_argument("--port", type=int, default=4560, help="TCP port of the simulator (%(default)s)")
    parser.add_argument("--interval-us", type=int, default=4000, help="of HIL_STATE_QUATERNION (%(default)s)")
    parser.add_argument("--throttle", type=float, default=0.6, help="0 to 1 (%(default)s)")
    parser.add_argument("--for", dest="seconds", type=float, default=60.0, help="(%(default)s)")
    options = parser.parse_args()
    line = socket.create_connection(("127.0.0.1", options.port))
    sender, begin, next_beat, received = Sender(line), time.monotonic(), 0.0, 0
    try:
        while (now := time.monotonic() - begin) < options.seconds:
            if now >= next_beat:
                sender.send(0, struct.pack("<I5B", 0, 2, 12, 128 + 1, 4, 3))  # a quadrotor, PX4, armed, active
                interval = struct.pack("<7fH3B", 115, options.interval_us, 0, 0, 0, 0, 0, 511, 1, 1, 0)
                sender.send(76, interval)  # MAV_CMD_SET_MESSAGE_INTERVAL
                next_beat += 1.0
            # Motors 1 and 2 turn counter-clockwise, 3 and 4 clockwise: their difference makes the vehicle yaw.
            motors = [options.throttle + sign * 0.02 * math.sin(2 * now) for sign in (1, 1, -1, -1)]
            sender.send(93, struct.pack("<QQ16fB", round(now * 1e6), 0, *motors, *[0.0] * 12, 128 + 1))
            if select.select([line], [], [], 0.004)[0]:
                received += len(line.recv(65536))
    except (ConnectionError, KeyboardInterrupt):
        pass
    print(f"px4_stand_in.py: {received} bytes received", file=sys.stderr)
    return 0 if received else 1


if __name__ == "__main__":
    sys.exit(main())
