#!/usr/bin/env python3
"""RealtimeClient: sends imud the truths of a simulation at the pace of the host's clock, without waiting for imud.

Copy this file and lockstep_client.py, which encodes the datagrams, into a simulator. They need Python 3.9 and its
standard library. Their licence is imud's (MIT).

    with RealtimeClient("127.0.0.1", 9810) as imud:  # for: imud run imu.toml
        for step in itertools.count():
            imud.send(Truth(
                simulation_time_ns=step * 10_000_000,
                sigma_BN=vehicle.sigma_BN,
                omega_BN_B=vehicle.omega_BN_B,
                specific_force_B=vehicle.specific_force_B,
            ))  # waits until 10 ms have passed since the last one was due
            vehicle.integrate(0.01)

Run as a program, it is a turntable: see --help.
"""
import sys
import time
from dataclasses import replace
from typing import Optional, Tuple

from lockstep_client import CLOCKS, Truth, connect, encode, turntable, turntable_options, whole_number


class RealtimeClient:
    """One run of one vehicle: the first truth is marked as the beginning of a run, and is sent at once.

    Each other truth is due when as much time of the monotonic clock has passed since the first one was sent as
    simulation time between the two: no delay adds up. With `clock` this clock is used, and each truth is stamped with
    the time at which it is due: imuds on several hosts then sample the same truth at the same instant (realtime.epoch,
    truth.delay_ms). Use it from one thread at a time.
    """

    def __init__(
        self,
        address: str,  # numeric, IPv4 or IPv6, as in imud's truth.port
        port: int,
        *,
        stream: int = 0,  # number of the vehicle; imud accepts the truth of one vehicle only
        first_sequence: int = 0,
        clock: Optional[str] = None,  # of the stamps, one of CLOCKS; None: without stamps
    ):
        if clock is not None and clock not in CLOCKS:
            raise ValueError(f"clock is {clock!r}; right would be one of {', '.join(CLOCKS)}")
        self._clock = clock
        # CLOCK_TAI has no name in some Pythons.
        self._id = {"tai": 11, "utc": time.CLOCK_REALTIME}.get(clock, time.CLOCK_MONOTONIC)
        self._stream = whole_number("stream", stream, 0, 0xFFFFFFFF)
        self._sequence = first_sequence & 0xFFFFFFFF
        self._last: Optional[Tuple[int, int]] = None  # simulation time, and the time at which it was due; ns
        self.sent = 0  # truths that the network accepted
        self.refused = 0  # truths that it did not: imud is not running, or the network is down
        self.lateness_ns = 0  # of the last truth: from the instant at which it was due to sending
        self.max_lateness_ns = 0
        self.name, self._socket = connect(address, port)

    def close(self) -> None:
        self._socket.close()

    def __enter__(self) -> "RealtimeClient":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def send(self, truth: Truth) -> bool:
        """Waits until `truth` is due, then sends it; sends it at once if it is late.

        Returns False if the network did not accept it: the next one may be accepted. Raises ValueError as encode()
        does, or if the simulation time is not later than that of the truth before.
        """
        time_ns = whole_number("simulation_time_ns", truth.simulation_time_ns, -(2**63), 2**63 - 1)
        due = self._now()
        if self._last is not None:
            last_time, last_due = self._last
            if time_ns <= last_time:
                raise ValueError(
                    f"simulation_time_ns is {time_ns} after {last_time}; right would be a time that "
                    "increases; for a new run make a new client"
                )
            due = last_due + time_ns - last_time
        stamped = truth if self._clock is None else replace(truth, stamp=(self._clock, due))
        datagram = encode(stamped, self._stream, self._sequence, self.sent == 0, acknowledge=False)
        while (left := due - self._now()) > 0:
            time.sleep(left / 1e9)
        is_sent = self._send(datagram)
        self.lateness_ns = max(0, self._now() - due)
        self.max_lateness_ns = max(self.max_lateness_ns, self.lateness_ns)
        self._last = time_ns, due
        self._sequence = (self._sequence + 1) & 0xFFFFFFFF
        return is_sent

    def _now(self) -> int:
        return time.clock_gettime_ns(self._id)

    def _send(self, datagram: bytes) -> bool:
        for _ in range(2):  # the first error may belong to an earlier datagram
            try:
                self._socket.send(datagram)
                self.sent += 1
                return True
            except OSError:
                continue
        self.refused += 1
        return False


def main() -> int:
    options = turntable_options("Sends imud the motion of a level turntable about its z axis, in real time.")
    try:
        with RealtimeClient(options.address, options.port) as imud:
            for step in range(int(options.duration_s * 100) + 1):
                imud.send(turntable(step, options.rate_rad_per_s))
            print(f"{imud.sent} truths sent, {imud.refused} refused; the latest was {imud.max_lateness_ns / 1e6:.3g} ms late")
            if imud.sent == 0:
                raise RuntimeError(f"nobody receives at {imud.name}; right would be an imud with this truth.port")
    except (OSError, RuntimeError, ValueError) as error:
        print(f"realtime_client.py: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
