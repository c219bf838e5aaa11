#!/usr/bin/env python3
"""A flight computer that knows the vehicle's motion from the bytes of a STIM300 alone.

It reads Normal Mode datagrams with rate and acceleration (Datasheet TS1524 rev. 31, Table 5-20) from a serial line or
a pseudo-terminal, integrates the rate to an attitude whose tilt the acceleration corrects, and commands the vehicle:
the one of vehicle.py by torques over UDP, or an aircraft of JSBSim by aileron and elevator over TCP. With --end-deg it
commands nothing, and states how far its estimate is from the true attitude at the end. See README.md.
"""
import argparse
import json
import math
import os
import select
import signal
import socket
import struct
import sys
import termios
import time
import tty

from rotation import angle_between, cross, euler, from_euler, from_rotation_vector, inverse, normalised, product, rotate

GRAVITY = 9.80665  # m/s^2
DEGREE = math.pi / 180


def crc_of_byte(byte):
    crc = byte << 24
    for _ in range(8):
        crc = (crc << 1 ^ 0x04C11DB7 if crc & 0x80000000 else crc << 1) & 0xFFFFFFFF
    return crc


CRC_OF_BYTE = [crc_of_byte(byte) for byte in range(256)]


class Stim300:
    """Finds datagrams in a stream of bytes."""

    SIZE = 28  # identifier 0x91; rates and status; accelerations and status; counter, latency, CRC
    INTERNAL_HZ = 2000  # of the counter

    def __init__(self):
        self._bytes = b""
        self._ticks, self._counter = 0, None  # since the first datagram; of the newest one, modulo 256
        self.skipped = 0  # bytes that belong to no datagram

    def feed(self, data):
        """Yields time since the first datagram (s), rate (rad/s) and specific force (m/s^2) of each datagram."""
        self._bytes += data
        while len(self._bytes) >= self.SIZE:
            frame = self._bytes[:self.SIZE]
            crc = 0xFFFFFFFF
            for byte in frame[:-4]:  # a multiple of four bytes, which needs no padding
                crc = crc << 8 & 0xFFFFFFFF ^ CRC_OF_BYTE[crc >> 24 ^ byte]
            if frame[0] != 0x91 or crc != int.from_bytes(frame[-4:], "big"):
                self._bytes = self._bytes[1:]
                self.skipped += 1
                continue
            self._bytes = self._bytes[self.SIZE:]
            numbers = [int.from_bytes(frame[i:i + 3], "big", signed=True) for i in (1, 4, 7, 11, 14, 17)]
            self._ticks += 0 if self._counter is None else (frame[21] - self._counter) % 256
            self._counter = frame[21]
            yield (self._ticks / self.INTERNAL_HZ, [x * 2.0**-14 * DEGREE for x in numbers[:3]],
                   [x * 2.0**-19 * GRAVITY for x in numbers[3:]])


class Attitude:
    """The attitude by integration of the rate; in steady motion, gravity corrects its tilt.

    `start` is the attitude at the first sample. Without it the vehicle begins at rest, with yaw 0.
    """

    CORRECTION = 0.02  # rad/s per rad of tilt
    STEADY_RATE = 2 * DEGREE  # rad/s
    STEADY_FORCE = 0.03 * GRAVITY  # m/s^2; difference of the specific force from gravity

    def __init__(self, start=None):
        self.q_NB = from_euler(*start) if start else None
        self._averages = start is None  # the first samples give the tilt at the start
        self._time = 0.0

    def update(self, seconds, rate, force):
        size = math.hypot(*force)
        up = [x / max(size, 1e-9) for x in force]  # the specific force of a vehicle at rest points up
        if self.q_NB is None:
            self.q_NB = from_euler(math.atan2(-up[1], -up[2]), math.atan2(up[0], math.hypot(up[1], up[2])), 0.0)
        is_steady = math.hypot(*rate) < self.STEADY_RATE and abs(size - GRAVITY) < self.STEADY_FORCE
        gain = max(self.CORRECTION, 1 / max(seconds, 1e-3) if self._averages else 0.0) if is_steady else 0.0
        tilt = cross(up, rotate(inverse(self.q_NB), (0, 0, -1)))
        turn = [(w + gain * e) * (seconds - self._time) for w, e in zip(rate, tilt)]
        self.q_NB = normalised(product(self.q_NB, from_rotation_vector(turn)))
        self._time = seconds


class TestBed:
    """Commands the torques of vehicle.py: a proportional and derivative law on the error's rotation vector."""

    INERTIA = (2.0, 2.5, 3.0)  # kg m^2
    BANDWIDTH, DAMPING = 2.0, 0.8  # rad/s, -
    TARGETS = ((0, (0, 0, 0)), (6, (10, 0, 30)), (12, (-10, 10, 30)))  # from a time on: roll, pitch, yaw, deg

    def __init__(self, address):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(address)

    def command(self, number, seconds, rate, q_NB):
        """Returns the attitude that it wants and the torques, N m."""
        wanted = from_euler(*(x * DEGREE for x in [t for since, t in self.TARGETS if since <= seconds][-1]))
        w, *error = product(inverse(wanted), q_NB)
        torque = [-j * (2 * math.copysign(1, w) * self.BANDWIDTH**2 * e + 2 * self.DAMPING * self.BANDWIDTH * p)
                  for j, e, p in zip(self.INERTIA, error, rate)]
        try:
            self._socket.send(struct.pack("<I3d", number, *torque))
        except ConnectionError:
            pass  # the vehicle is not there, or no longer
        return wanted, torque


class Jsbsim:
    """Commands an aircraft of JSBSim: roll by the ailerons, pitch by the elevator."""

    TARGETS = ((0, (0, 2)), (10, (20, 2)), (30, (-20, 2)), (45, (0, 4)))  # from a time on: roll, pitch, deg

    def __init__(self, address, waits):
        self._address, self._waits, self._socket = address, waits, None
        self._integrals, self._seconds = [0.0, 0.0], 0.0

    def _connect(self):
        self._socket = when_it_exists(lambda: socket.create_connection(self._address))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._send("resume\n", 1)  # with --suspend it holds after its first step

    def _send(self, lines, replies):
        """Sends commands. In lockstep it waits for the replies, so that a step of JSBSim executes one transmission."""
        self._socket.sendall(lines.encode())
        if not self._waits:
            while select.select([self._socket], [], [], 0)[0]:
                self._receive()
            return
        received = b""
        while received.count(b"successful") + received.count(b"Resuming") < replies:
            # JSBSim's second reply waits for the acknowledgement of its first, which Linux delays by 40 ms.
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
            received += self._receive()

    def _receive(self):
        data = self._socket.recv(4096)
        if not data:
            raise ConnectionError("JSBSim has ended")
        return data

    def command(self, number, seconds, rate, q_NB):
        """Returns the attitude that it wants and aileron and elevator, -1 to 1."""
        roll, pitch, yaw = euler(q_NB)
        wanted_roll, wanted_pitch = (x * DEGREE for x in [t for since, t in self.TARGETS if since <= seconds][-1])
        errors = (wanted_roll - roll, wanted_pitch - pitch)
        step, self._seconds = seconds - self._seconds, seconds
        self._integrals = [max(-0.3, min(0.3, x + e * step)) for x, e in zip(self._integrals, errors)]
        aileron = 1.5 * errors[0] + 0.5 * self._integrals[0] - 0.4 * rate[0]
        elevator = -(3.0 * errors[1] + 0.5 * self._integrals[1] - 0.5 * rate[1])
        commands = [max(-1.0, min(1.0, x)) for x in (aileron, elevator)]
        if number > 0 and self._socket is None:
            self._connect()
        if self._socket is not None:
            self._send(f"set fcs/aileron-cmd-norm {commands[0]:.6f}\n"
                       f"set fcs/elevator-cmd-norm {commands[1]:.6f}\n", 2)
        return from_euler(wanted_roll, wanted_pitch, yaw), commands


class Passenger:
    """Commands nothing: the vehicle's motion is a captured one."""

    def command(self, number, seconds, rate, q_NB):
        """Returns the attitude that it has, and no command."""
        return q_NB, (0, 0, 0)


def errors_deg(estimate, truth):
    """Returns an attitude's errors as the metrics of a campaign's case: the whole angle, and by roll, pitch and yaw."""
    parts = [math.remainder(e - t, 2 * math.pi) / DEGREE for e, t in zip(euler(estimate), euler(truth))]
    return {"error_deg": angle_between(estimate, truth) / DEGREE,
            **{f"{name}_error_deg": part for name, part in zip(("roll", "pitch", "yaw"), parts)}}


def when_it_exists(opener):
    """Opens something that another program makes; waits up to 30 s for it."""
    until = time.monotonic() + 30
    while True:
        try:
            return opener()
        except OSError:
            if time.monotonic() > until:
                raise
            time.sleep(0.05)


def address(text):
    host, _, port = text.rpartition(":")
    return host, int(port)


def main():
    parser = argparse.ArgumentParser(description="Controls the attitude of a vehicle by the bytes of a STIM300.")
    parser.add_argument("port", help="serial line or pseudo-terminal of the STIM300")
    parser.add_argument("--vehicle", type=address, default="127.0.0.1:9820",
                        help="UDP address of vehicle.py (%(default)s)")
    parser.add_argument("--jsbsim", type=address, help="TCP address of JSBSim's <input>, in place of vehicle.py")
    parser.add_argument("--lockstep", action="store_true", help="JSBSim waits for each command")
    parser.add_argument("--start-deg", type=float, nargs=3, metavar=("ROLL", "PITCH", "YAW"),
                        help="attitude at the start, of a vehicle that is not at rest")
    parser.add_argument("--end-deg", type=float, nargs=3, metavar=("ROLL", "PITCH", "YAW"),
                        help="true attitude at the last sample; there is no vehicle to command then")
    parser.add_argument("--metrics", help="writes the error at the end as JSON")
    parser.add_argument("--csv", help="writes measurement, estimate and commands of each sample")
    options = parser.parse_args()
    if bool(options.metrics) != bool(options.end_deg):
        parser.error("--end-deg and --metrics belong together")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    line = when_it_exists(lambda: os.open(options.port, os.O_RDWR | os.O_NOCTTY))
    tty.setraw(line, termios.TCSANOW)  # keeps what has come since it was opened
    log = open(options.csv or os.devnull, "w", encoding="ascii")
    log.write("time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,roll,pitch,yaw,wanted_roll,wanted_pitch,wanted_yaw,"
              "command_1,command_2,command_3\n")
    if options.end_deg:
        vehicle = Passenger()
    else:
        vehicle = Jsbsim(options.jsbsim, options.lockstep) if options.jsbsim else TestBed(options.vehicle)
    sensor, attitude = Stim300(), Attitude(options.start_deg and [x * DEGREE for x in options.start_deg])
    number = 0
    try:
        while data := os.read(line, 4096):
            for seconds, rate, force in sensor.feed(data):
                attitude.update(seconds, rate, force)
                wanted, command = vehicle.command(number, seconds, rate, attitude.q_NB)
                number += 1
                columns = (seconds, *rate, *force, *euler(attitude.q_NB), *euler(wanted), *command)
                log.write(",".join(f"{x:.9g}" for x in columns) + "\n")
    except (KeyboardInterrupt, OSError):
        pass  # the other side has ended
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        log.close()
        print(f"flight computer: {number} samples, {sensor.skipped} bytes of no datagram", file=sys.stderr)
    if options.metrics and number:
        with open(options.metrics, "w", encoding="ascii") as metrics:
            json.dump({"samples": number, "skipped_bytes": sensor.skipped,
                       **errors_deg(attitude.q_NB, from_euler(*(x * DEGREE for x in options.end_deg)))}, metrics)
            metrics.write("\n")
    return 0 if number else 1


if __name__ == "__main__":
    sys.exit(main())
