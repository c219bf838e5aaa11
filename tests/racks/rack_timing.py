"""How far apart the samples of eight hosts leave, beside eight loops that do nothing but wait for their instants.

usage: rack_timing.py BUILD_FOLDER SOURCE_FOLDER PLAIN_LOOPS [SECONDS]

The loops (as cyclictest's) run in the same time under the same load, half a period later than the samples. Exit code 1 if the 99th
percentile of the samples' spread over the hosts is above that of the loops by 100 us or more; 77 without root or ip (iproute2).
"""
import pathlib
import struct
import subprocess
import sys
import tempfile
import time

BUILD, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
sys.path[:0] = [str(SOURCE / "tools/python"), str(pathlib.Path(__file__).parent)]
import numpy  # noqa: E402
import rack  # noqa: E402
from imud.record import load_record  # noqa: E402

BEGIN, TRANSMIT = 1, 12  # RecordEvent, transports/capture/record_packet.hpp
HOSTS, BOUND_US = 8, 100


def lateness(path):
    """Returns how late the write of each sample has begun, ns, by the instant at which it was due."""
    ahead, due, late = 0, None, {}
    for packet in load_record(path).packets:
        if packet.interface.name == "imud":
            kind, _, _, _, a, _, _ = struct.unpack("<BBHIqqq", packet.data)
            if kind == BEGIN:
                ahead = a
            due = a if kind == TRANSMIT else due
        elif packet.interface.name == "imu1" and due is not None:
            late.setdefault(due, packet.time_ns - ahead - due)
    return late


def row(name, values_ns):
    p50, p99, p999, largest = numpy.percentile(numpy.asarray(values_ns) / 1e3, (50, 99, 99.9, 100))
    print(f"  {name:<34} p50 {p50:8.1f}   p99 {p99:8.1f}   p99.9 {p999:8.1f}   max {largest:8.1f}")
    return p99


def main():
    seconds = int(sys.argv[4]) if len(sys.argv) > 4 else 60
    with tempfile.TemporaryDirectory() as folder:
        try:
            rig = rack.Rack(BUILD, SOURCE, folder, HOSTS, realtime="")
        except rack.Missing as why:
            print(f"not measured: {why}")
            return 77
        try:
            for number in range(HOSTS):
                rig.start(number)
            rig.source()
            time.sleep(3)
            loops = subprocess.run([sys.argv[3], str(HOSTS), str(rack.PERIOD_NS), str(rack.PERIOD_NS // 2), str(seconds)],
                                   stdout=subprocess.PIPE, text=True, check=True)
            for imud in rig.imuds.values():
                imud.send_signal(2)
            for imud in rig.imuds.values():
                imud.wait(rack.LIMIT_S)
            hosts = [lateness(rig.file(number, "pcapng")) for number in range(HOSTS)]
        finally:
            rig.end()
    bare = numpy.array([line.split() for line in loops.stdout.splitlines()], dtype=float)
    common = sorted(set.intersection(*map(set, hosts)))
    common = common[-len(bare):]
    samples = numpy.array([[host[due] for host in hosts] for due in common], dtype=float)
    print(f"{HOSTS} hosts of one machine, {rack.RATE_HZ} Hz, {len(common)} instants; us")
    row("a loop wakes up late by", bare.ravel())
    row("a sample's write begins late by", samples.ravel())
    one = row("over the loops, an instant's spread", numpy.ptp(bare, axis=1))
    other = row("over the hosts, a sample's spread", numpy.ptp(samples, axis=1))
    met = other - one < BOUND_US
    print(f"  {'ok' if met else 'NOT'}: p99 of the spread is {other - one:+.1f} us beyond the loops', less than {BOUND_US}")
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
