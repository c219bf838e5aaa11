"""Eight hosts of a rack sample at the same instants: one joins late, one is cut off and comes back, and the source of truth dies. Three
of them have phases of their own, as three redundant imus of one vehicle.

usage: hosts_test.py BUILD_FOLDER SOURCE_FOLDER

What load cannot disturb is tested: the instants at which samples were due, which are in the records, and that none is missing. How late
they leave is measured by the target `rack_timing`. Needs root and ip (iproute2), otherwise nothing is tested, and the exit code is 77.
"""
import json
import pathlib
import struct
import sys
import tempfile
import time
import unittest

BUILD, SOURCE = (pathlib.Path(argument).resolve() for argument in (sys.argv.pop(1), sys.argv.pop(1)))
sys.path[:0] = [str(SOURCE / "tools/python"), str(pathlib.Path(__file__).parent)]
import numpy  # noqa: E402
import rack  # noqa: E402
from imud.record import load_record  # noqa: E402

LATE, CUT = 7, 3  # the numbers of hosts
CUT_S = 10
PHASES_US = {1: 1700, 2: 3400}  # of three redundant imus on hosts 0 to 2
PEAK_ERROR_US = 20  # of the estimate: the hosts have one clock
SAMPLE, TRANSMIT = 11, 12  # RecordEvent, transports/capture/record_packet.hpp
INTERPOLATED, HELD, SKIPPED = 0, 2, 1  # its flags
EXTRAPOLATED_NS = 100_000_000  # truth.extrapolate_ms: then the sampled time stands still


def eventually(condition):
    end = time.monotonic() + rack.LIMIT_S
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True


class Host:
    """What a host's files state."""

    def __init__(self, rig, number):
        self.summary = json.loads(rig.file(number, "json").read_text())
        self.imu, self.truth = self.summary["imus"][0], self.summary["truth"]
        events = [struct.unpack("<BBHIqqq", packet.data) for packet in load_record(rig.file(number, "pcapng")).of("imud")]
        self.due = [a for kind, _, _, _, a, _, _ in events if kind == TRANSMIT]
        self.phase_ns = 1000 * PHASES_US.get(number, 0)
        # By K: the instant less the time of the truth sampled, ns, without samples whose time stands still because truth is missing or
        # a hold-up is worked off. The host has one imu, and no sample is at rest.
        sampled = [(a, newest, flags) for kind, flags, _, _, a, newest, _ in events if kind == SAMPLE]
        self.map_ns = {self.imu["first_k"] + k: (self.imu["first_k"] + k) * rack.PERIOD_NS + self.phase_ns - a
                       for k, (a, newest, flags) in enumerate(sampled)
                       if flags < HELD and a - newest < EXTRAPOLATED_NS and a != newest and (k == 0 or a > sampled[k - 1][0])}
        self.skipped = sum(kind == TRANSMIT and flags & SKIPPED for kind, flags, *_ in events)
        self.first = self.imu["first_k"]
        rows = numpy.loadtxt(rig.file(number, "csv"), delimiter=",", skiprows=1, usecols=4)
        # By K: the angular rate, rad/s, of samples between two truths. At the end of a run a sample may be taken that is not sent.
        self.rate = {self.first + k: rate for k, ((_, _, flags), rate) in enumerate(zip(sampled, rows))
                     if flags == INTERPOLATED and self.first + k in self.map_ns}


class HostsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        rig = rack.Rack(BUILD, SOURCE, folder.name, phases_us=PHASES_US)
        cls.addClassCleanup(rig.end)
        everyone = range(len(rig.hosts))
        on_time = [number for number in everyone if number != LATE]

        def lines(number):
            """The samples of a host that move: it samples truth, and the motion is not held."""
            text = rig.file(number, "csv").read_text() if rig.file(number, "csv").exists() else ""
            return [line for line in text.splitlines()[1:] if line.count(",") >= 15 and float(line.split(",")[4]) != 0]

        def samples(numbers, count=100):
            """Waits until each of the hosts has so many more samples of truth."""
            before = {number: len(lines(number)) for number in numbers}
            for number in numbers:
                if not eventually(lambda: len(lines(number)) >= before[number] + count):
                    raise AssertionError(f"host {number} has no samples of truth: " + rig.file(number, "log").read_text())

        for number in on_time:
            rig.start(number)
        source = rig.source(clock="monotonic")
        samples(on_time)
        rig.start(LATE)
        samples([LATE])
        rig.cut(CUT, True)
        time.sleep(CUT_S)
        rig.cut(CUT, False)
        samples([CUT])
        source.kill()  # and with it the map from the hosts' clock to the simulator's time
        time.sleep(1)
        rig.source(clock="monotonic")  # another run, with another map
        samples(everyone)
        for imud in rig.imuds.values():
            imud.send_signal(2)
        cls.exit_codes = [rig.imuds[number].wait(rack.LIMIT_S) for number in everyone]
        cls.hosts = [Host(rig, number) for number in everyone]
        cls.logs = [rig.file(number, "log").read_text() for number in everyone]

    def test_no_sample_is_lost(self):
        for number, host in enumerate(self.hosts):
            with self.subTest(host=number):
                self.assertEqual(self.exit_codes[number], 0, self.logs[number])
                self.assertEqual(host.imu["samples"], len(host.due))
                self.assertEqual((host.imu["dropped"], host.skipped, host.summary["clock"]["steps"]), (0, 0, 0))

    def test_sample_k_is_due_at_the_same_instant_on_all_hosts(self):
        for number, host in enumerate(self.hosts):
            with self.subTest(host=number):
                self.assertGreater(len(host.due), 300)
                off = [due - (host.first + k) * rack.PERIOD_NS - host.phase_ns for k, due in enumerate(host.due)]
                self.assertEqual(set(off), {0})

    def test_sample_k_is_of_the_same_truth_on_all_hosts(self):
        maps = {map_ns for host in self.hosts for map_ns in host.map_ns.values()}
        self.assertEqual(len(maps), 2, "one for each source: when its simulation began by the clock of all, and the delay")
        every = {K: map_ns for host in self.hosts for K, map_ns in host.map_ns.items()}
        for number, host in enumerate(self.hosts):
            with self.subTest(host=number):
                self.assertGreaterEqual(len(host.map_ns), 200)
                self.assertEqual({K for K, map_ns in host.map_ns.items() if map_ns != every[K]}, set())
                self.assertEqual(host.truth["stamps_refused"], 0)
        # Before and after it was cut off, with one source.
        cut = [K for K, map_ns in self.hosts[CUT].map_ns.items() if map_ns == min(maps)]
        self.assertGreaterEqual(len(cut), 200)
        self.assertGreater(max(b - a for a, b in zip(cut, cut[1:])), (CUT_S - 1) * rack.RATE_HZ)

    def test_three_redundant_imus_correlate_at_their_phases(self):
        """A flight computer that knows the samples by K alone sees one motion: the later of two streams leads by its phase."""
        first_map = min(self.hosts[0].map_ns.values())

        def period(host):
            """The mean rate by the place of K in the motion's period, which is a second, with the first source."""
            rates = [[] for _ in range(rack.RATE_HZ)]
            for K, rate in host.rate.items():
                if host.map_ns[K] == first_map:
                    rates[K % rack.RATE_HZ].append(rate)
            places = [place for place, values in enumerate(rates) if values]
            self.assertGreater(len(places), rack.RATE_HZ / 2)
            means = [numpy.mean(rates[place]) for place in places]
            return numpy.interp(range(rack.RATE_HZ), places, means, period=rack.RATE_HZ) - numpy.mean(means)

        streams = [period(self.hosts[number]) for number in range(3)]
        for a, b in (0, 1), (0, 2), (1, 2):
            with self.subTest(hosts=(a, b)):
                # Samples by which b is put back, and the correlation; the peak by a parabola through the three greatest.
                lags = numpy.arange(-rack.RATE_HZ // 4, rack.RATE_HZ // 4)
                correlation = [numpy.dot(streams[a], numpy.roll(streams[b], lag)) for lag in lags]
                peak = int(numpy.argmax(correlation))
                before, at, after = correlation[peak - 1:peak + 2]
                samples = lags[peak] + 0.5 * (before - after) / (before - 2 * at + after)
                phase_us = (self.hosts[b].phase_ns - self.hosts[a].phase_ns) / 1e3
                print(f"hosts {a} and {b}: peak at {1e6 * samples / rack.RATE_HZ:.1f} us, phases {phase_us:.1f} us apart")
                self.assertAlmostEqual(1e6 * samples / rack.RATE_HZ, phase_us, delta=PEAK_ERROR_US)

    def test_a_host_that_joins_late_is_at_the_current_k(self):
        late = self.hosts[LATE]
        for number, host in enumerate(self.hosts):
            if number != LATE:
                self.assertGreater(late.first, host.first)
                self.assertLess(late.first, host.first + len(host.due), "the hosts run at the same time")
        self.assertEqual(late.first % rack.RATE_HZ, 0, "the first sample is at a whole second")

    def test_a_host_that_was_cut_off_counts_what_it_has_missed(self):
        # The source sends 2000 truths while the host is cut off, less by what a busy machine holds up at both ends.
        self.assertGreater(self.hosts[CUT].truth["lost"], 1000)
        self.assertGreater(self.hosts[CUT].imu["held"], 1000)


if __name__ == "__main__":
    try:
        rack.Rack(BUILD, SOURCE, "/nowhere", count=1).end()
    except rack.Missing as why:
        print(f"not tested: {why}")
        sys.exit(77)
    unittest.main(verbosity=2)
