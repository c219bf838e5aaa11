#!/usr/bin/env python3
"""LockstepClient: sends imud the truth of a step and waits until imud has emitted every sample up to it.

Copy this file into a simulator. It needs Python 3.9 and its standard library. Its licence is imud's (MIT).

    with LockstepClient("127.0.0.1", 9810) as imud:  # for: imud run imu.toml --set clock=lockstep
        for step in range(201):
            answer = imud.step(Truth(
                simulation_time_ns=step * 10_000_000,
                sigma_BN=vehicle.sigma_BN,
                omega_BN_B=vehicle.omega_BN_B,
                specific_force_B=vehicle.specific_force_B,
            ))
            if not answer.accepted:
                raise RuntimeError("imud refused the truth; its log has the cause")
            vehicle.integrate(0.01)

Frames: N inertial, B the vehicle's body. x_BN_N: of B relative to N, in N components. The datagram's layout, version
1 or with a stamp 2, is that of imud's protocols/native_truth.hpp. Run as a program, it is a turntable: see --help.
"""
import argparse
import math
import operator
import socket
import struct
import sys
import time
from dataclasses import dataclass
from typing import NamedTuple, Optional, Sequence, Tuple

Vector3 = Sequence[float]

# The clocks that hosts share, with their numbers in the datagram: CLOCK_TAI, CLOCK_REALTIME, and CLOCK_MONOTONIC for the
# processes of one host.
CLOCKS = {"tai": 1, "utc": 2, "monotonic": 3}


@dataclass
class Truth:
    """Motion of the vehicle at an instant."""

    simulation_time_ns: int
    r_BN_N: Vector3 = (0.0, 0.0, 0.0)  # m; position of B's origin
    v_BN_N: Vector3 = (0.0, 0.0, 0.0)  # m/s
    sigma_BN: Vector3 = (0.0, 0.0, 0.0)  # attitude as modified Rodrigues parameters e tan(angle/4), of any norm
    omega_BN_B: Vector3 = (0.0, 0.0, 0.0)  # rad/s
    omegaDot_BN_B: Optional[Vector3] = None  # rad/s^2
    specific_force_B: Optional[Vector3] = None  # m/s^2; of B's origin, without gravitation: at rest it points up
    # m/s; integral of the specific force since the start. At most one of the two is given.
    accumulated_dv_inertial_B: Optional[Vector3] = None  # accumulated in N, given in the B axes of the instant
    accumulated_dv_body_sum_B: Optional[Vector3] = None  # sum of increments, each in the B axes at its step's end
    # When the simulation has this time: one of CLOCKS, and its time in ns. In real time with realtime.epoch, imud maps the
    # simulation's time by it.
    stamp: Optional[Tuple[str, int]] = None


class Answer(NamedTuple):
    stream: int
    sequence: int
    simulation_time_ns: int  # up to which imud has emitted all samples
    samples: int  # emitted in this run, by all its imus together
    # True if simulation_time_ns is the truth's. Otherwise imud refused the truth and emitted nothing, because the
    # truth's time is before that of the last truth, or too far ahead of it (truth.max_gap_ms); or imud does not run in
    # lockstep. A truth of the same time is a repetition, and changes nothing.
    accepted: bool


def _crc32c_of_byte(crc: int) -> int:
    for _ in range(8):
        crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc


_CRC32C_TABLE = [_crc32c_of_byte(byte) for byte in range(256)]


def crc32c(data: bytes) -> int:
    """CRC-32C (Castagnoli)."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc = crc >> 8 ^ _CRC32C_TABLE[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFFFFFF


def whole_number(name: str, value, least: int, most: int) -> int:
    """Returns `value` as an int. Raises ValueError if it is no whole number, or is out of its range."""
    try:
        number = operator.index(value)
    except TypeError:
        number = None
    if number is None or not least <= number <= most:
        hint = "; from seconds: round(t * 1e9)" if name.endswith("_ns") else ""
        raise ValueError(f"{name} is {value!r}; right would be a whole number from {least} to {most}{hint}")
    return number


def encode(truth: Truth, stream: int, sequence: int, new_run: bool, acknowledge: bool = True) -> bytes:
    """Returns the datagram of `truth`, which requests an answer if `acknowledge`.

    Raises ValueError for a truth that imud would refuse: a value that is not of its kind, a number that is not finite,
    or two accumulated velocities.
    """
    time_ns = whole_number("simulation_time_ns", truth.simulation_time_ns, -(2**63), 2**63 - 1)
    if truth.accumulated_dv_inertial_B is not None and truth.accumulated_dv_body_sum_B is not None:
        raise ValueError("accumulated_dv_inertial_B and accumulated_dv_body_sum_B: only one of them can be given")
    flags = (16 if acknowledge else 0) | (32 if new_run else 0)
    datagram = bytearray(208)
    for offset, flag, name in (
        (24, 0, "r_BN_N"),
        (48, 0, "v_BN_N"),
        (72, 0, "sigma_BN"),
        (96, 0, "omega_BN_B"),
        (120, 1, "omegaDot_BN_B"),
        (144, 2, "specific_force_B"),
        (168, 4, "accumulated_dv_inertial_B"),
        (168, 8, "accumulated_dv_body_sum_B"),
    ):
        vector = getattr(truth, name)
        if vector is None and flag != 0:
            continue
        try:
            x, y, z = map(float, vector)
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"{name} is {vector!r}; right would be three numbers, (x, y, z)") from None
        if not all(map(math.isfinite, (x, y, z))):
            raise ValueError(f"{name} is not finite: has the simulation diverged?")
        flags |= flag
        struct.pack_into("<3d", datagram, offset, x, y, z)
    version, checksum = 1, 196
    if truth.stamp is not None:
        clock, stamp_ns = truth.stamp
        if clock not in CLOCKS:
            raise ValueError(f"the stamp's clock is {clock!r}; right would be one of {', '.join(CLOCKS)}")
        version, checksum = 2, 204
        struct.pack_into("<qI", datagram, 192, whole_number("stamp_ns", stamp_ns, -(2**62) + 1, 2**62 - 1), CLOCKS[clock])
    struct.pack_into("<4sHHIIq", datagram, 0, b"IMUT", version, flags, stream, sequence, time_ns)
    struct.pack_into("<I", datagram, checksum, crc32c(datagram[:checksum]))
    return bytes(datagram)


def connect(address: str, port: int) -> Tuple[str, socket.socket]:
    """Returns a UDP socket that sends to one address, with the name of that address in imud's configuration.

    Raises ValueError if it is no address, and OSError if nothing can be sent there.
    """
    name = f"udp:[{address}]:{port}" if ":" in str(address) else f"udp:{address}:{port}"
    whole_number("port", port, 1, 65535)
    try:
        family, kind, _, _, peer = socket.getaddrinfo(
            address, port, type=socket.SOCK_DGRAM, flags=socket.AI_NUMERICHOST
        )[0]
    except socket.gaierror as error:
        raise ValueError(f"{name}: {error.strerror}; right would be an address such as 127.0.0.1") from error
    connection = socket.socket(family, kind)
    try:
        connection.connect(peer)  # receives from the peer only, and reports an error if its port is not open
    except OSError:
        connection.close()
        raise
    return name, connection


class LockstepClient:
    """One run of one vehicle: the first truth is marked as the beginning of a run. Use it from one thread at a time."""

    def __init__(
        self,
        address: str,  # numeric, IPv4 or IPv6, as in imud's truth.port
        port: int,
        *,
        timeout: float = 0.2,  # s; of an attempt
        attempts: int = 50,  # imud may start later than the simulator, or take long to emit many samples
        stream: int = 0,  # number of the vehicle; imud accepts the truth of one vehicle only
        # Default: taken from the clock, because imud would take a first truth with an old time and sequence for a
        # repetition, not for a new run.
        first_sequence: Optional[int] = None,
    ):
        self._timeout = timeout
        self._attempts = attempts
        self._stream = whole_number("stream", stream, 0, 0xFFFFFFFF)
        self._sequence = (time.monotonic_ns() if first_sequence is None else first_sequence) & 0xFFFFFFFF
        self._first = True  # no truth was answered yet
        self._error: Optional[OSError] = None  # of the newest attempt
        self._name, self._socket = connect(address, port)

    def close(self) -> None:
        self._socket.close()

    def __enter__(self) -> "LockstepClient":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def step(self, truth: Truth) -> Answer:
        """Sends `truth` and waits for its answer; sends the same datagram again when none comes in time.

        This is harmless, as imud answers a repeated truth again and emits nothing twice. Raises RuntimeError if no
        attempt is answered, and ValueError as encode() does.
        """
        sequence = self._sequence
        self._sequence = (sequence + 1) & 0xFFFFFFFF
        datagram = encode(truth, self._stream, sequence, self._first)
        for _ in range(self._attempts):
            self._error = None
            self._send(datagram)
            answer = self._wait(sequence)
            if answer is not None:
                self._first = False
                time_ns, samples = answer
                return Answer(self._stream, sequence, time_ns, samples, time_ns == truth.simulation_time_ns)
        reason = f" ({self._error.strerror})" if self._error else ""
        raise RuntimeError(
            f"no answer from {self._name} to the truth of {truth.simulation_time_ns} ns, sent {self._attempts} "
            f"times, {self._timeout * 1000:g} ms each{reason}; right would be an imud that runs with "
            f'clock = "lockstep" and truth.port = "{self._name}"; if it does, its log names the truths that it '
            "refuses unanswered"
        )

    def _send(self, datagram: bytes) -> None:
        self._socket.settimeout(None)
        for _ in range(2):  # the first error may belong to an earlier datagram
            try:
                self._socket.send(datagram)
                return
            except OSError as error:
                last = error
        self._error = last  # no answer arrives, and the next attempt follows

    def _wait(self, sequence: int) -> Optional[Tuple[int, int]]:
        """Returns simulation time, ns, and samples of the answer to `sequence`; ignores all other datagrams."""
        until = time.monotonic() + self._timeout
        while (left := until - time.monotonic()) > 0:
            self._socket.settimeout(left)
            try:
                answer = self._socket.recv(64)
            except socket.timeout:
                break
            except OSError as error:
                self._error = error
                continue
            if len(answer) != 32:
                continue
            magic, version, _, stream, answered, time_ns, samples = struct.unpack("<4sHHIIqQ", answer)
            if (magic, version, stream, answered) == (b"IMUA", 1, self._stream, sequence):
                return time_ns, samples
        return None


def turntable(step: int, rate_rad_per_s: float) -> Truth:
    """Returns the truth of a level turntable about its z axis, every 10 ms."""
    angle = math.remainder(rate_rad_per_s * step / 100, 2 * math.pi)
    return Truth(
        simulation_time_ns=step * 10_000_000,
        sigma_BN=(0, 0, math.tan(angle / 4)),
        omega_BN_B=(0, 0, rate_rad_per_s),
        specific_force_B=(0, 0, -9.80665),  # z down
    )


def turntable_options(description: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("address", nargs="?", default="127.0.0.1", help="address of imud's truth.port (%(default)s)")
    parser.add_argument("port", nargs="?", type=int, default=9810, help="UDP port of imud's truth.port (%(default)s)")
    parser.add_argument("--rate-rad-per-s", type=float, default=0.5, help="rate of the turntable (%(default)s)")
    parser.add_argument("--for", dest="duration_s", type=float, default=2, help="simulated seconds (%(default)s)")
    options = parser.parse_args()
    if not 0 <= options.duration_s <= 1e9:
        parser.error("argument --for: right would be seconds from 0 to 1e9")
    return options


def main() -> int:
    options = turntable_options("Sends imud the motion of a level turntable about its z axis, in lockstep.")
    try:
        with LockstepClient(options.address, options.port) as imud:
            for step in range(int(options.duration_s * 100) + 1):
                truth = turntable(step, options.rate_rad_per_s)
                answer = imud.step(truth)
                if not answer.accepted:
                    raise RuntimeError(
                        f"the answer to the truth of {truth.simulation_time_ns / 1e9:g} s is not that of an imud in "
                        f'lockstep, which would have emitted all samples up to it; right would be clock = "lockstep"; '
                        "if that is so, imud's log names the truths that it refuses"
                    )
                if step % 100 == 0:
                    print(f"{answer.simulation_time_ns / 1e9:g} s: {answer.samples} samples")
    except (OSError, RuntimeError, ValueError) as error:
        print(f"lockstep_client.py: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
