#!/usr/bin/env python3
"""imu-decode --truth RECORD: the truth at each measurement of a recorded run, in lockstep and in real time."""
import struct
import subprocess
import unittest

import numpy

from support import PROGRAMS, RunTest, run

CONFIG = """seed = 3
clock = "{clock}"
realtime.priority = 0
realtime.lock_memory = false
[truth]
port = "udp:127.0.0.1:0"
extrapolate_ms = 20
{keys}[[imu]]
name = "a"
protocol = "stim300"
model = "stim300"
port = "file:{folder}/a.bin"
[[imu]]
name = "b"
protocol = "native"
rate_hz = 250
model = "ideal"
gyro.max_rad_per_s = 100
accelerometer.max_m_per_s2 = 1000
port = "file:{folder}/b.bin"
"""


def events_of(record):
    """The events of a record, each with the name of its interface (transports/capture/record_packet.hpp)."""
    content, at, names, events = record.read_bytes(), 0, [], []
    while at < len(content):
        kind, length = struct.unpack_from("<II", content, at)
        if kind == 1:  # an interface, whose first option is its name
            code, size = struct.unpack_from("<HH", content, at + 16)
            names.append(content[at + 20:at + 20 + size].decode() if code == 2 else None)
        elif kind == 6 and names[struct.unpack_from("<I", content, at + 8)[0]] == "imud":
            size = struct.unpack_from("<I", content, at + 20)[0]
            if size == 32:
                kind_of, flags, interface, _, a, b, c = struct.unpack_from("<BBHIqqq", content, at + 28)
                events.append((EVENTS.get(kind_of), flags, names[interface], a, c))
        at += length
    return events


EVENTS = {4: "truth", 6: "forget_past", 7: "run", 11: "sample"}
EXTRAPOLATED, HELD, ACCEPTED, NEW_RUN = 1, 2, 2, 4


def instants(record, imu):
    """By the sample's number: the truth time that was sampled, and whether truth came up to it in its run."""
    samples, waiting, newest = {}, [], -1
    for name, flags, interface, a, c in events_of(record):
        if name in ("forget_past", "run") or (name == "truth" and flags == NEW_RUN):
            waiting = []
        if name == "truth" and flags in (ACCEPTED, NEW_RUN):
            newest = a
            for number in [number for number in waiting if samples[number][0] <= newest]:
                samples[number][1] = True
                waiting.remove(number)
        if name == "sample" and interface == imu:
            samples[c] = [a, flags not in (EXTRAPOLATED, HELD)]
            if not samples[c][1]:
                waiting.append(c)
    return samples


class TruthOfRecord(RunTest):
    def record(self, clock, *arguments, motion="spiral", keys=""):
        """Records a run of imud on the truth of imu-truth with these arguments."""
        config = self.folder / "imu.toml"
        config.write_text(CONFIG.format(clock=clock, folder=self.folder, keys=keys))
        with subprocess.Popen([PROGRAMS / "imud", "run", config, "--record", self.folder / "run.pcapng"],
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as imud:
            ready = next(line for line in imud.stderr if " ready, truth.port is " in line)
            run("imu-truth", motion, "--to", ready.split()[-1], "--rate", "100", "--for", "1", *arguments)
            imud.terminate()
            imud.communicate()
        self.assertEqual(imud.returncode, 0)
        return config

    def decode(self, protocol, imu, *truth, port=None):
        port = port or f"record:{self.folder}/run.pcapng?interface={imu}"
        _, errors = run("imu-decode", protocol, port, "--quiet", "--npy", self.folder / "a.npy", "--truth", *truth)
        self.assertNotIn("truth ", errors)
        return numpy.load(self.folder / "a.npy")

    def test_a_record_has_the_truth_that_its_configuration_and_truth_give(self):
        config = self.record("lockstep", "--lockstep", "--fast")
        record = self.folder / "run.pcapng"
        by_record = self.decode("stim300", "a", record)
        self.assertEqual(len(by_record), 899)  # of 1001 less the start-up
        self.assertLess(abs(by_record["gyro"] - by_record["true_gyro"]).max(), 0.01)
        self.assertGreater(abs(by_record["gyro"] - by_record["true_gyro"]).max(), 1e-4)
        run("imu-truth", "spiral", "--rate", "100", "--for", "1", "--csv", self.folder / "truth.csv")
        csv = self.folder / "csv.toml"
        csv.write_text(config.read_text().replace("[truth]", "[truth]\nformat = 'csv'"))
        for truth in [(config, f"record:{record}"), (csv, self.folder / "truth.csv")]:
            self.assertEqual(by_record.tobytes(), self.decode("stim300", "a", *truth).tobytes(), truth)
        # So has what the port's file received.
        self.assertEqual(by_record.tobytes(), self.decode("stim300", "a", record,
                                                          port=f"file:{self.folder}/a.bin").tobytes())
        seeds = self.folder / "{imu}.npy"
        run("imud", "replay", record, record, "--seeds", "3..4", "--npy", seeds)
        runs = numpy.load(self.folder / "a.npy")
        self.assertEqual(by_record["gyro"].tobytes(), runs["gyro"][0].tobytes())
        self.assertNotEqual(by_record["gyro"].tobytes(), runs["gyro"][1].tobytes())

    def test_a_fault_that_a_client_began_does_not_shift_the_truth_of_seeds(self):
        """Of an imu whose clock wanders, so that each seed has its own instants."""
        config, record, socket = (self.folder / name for name in ("imu.toml", "run.pcapng", "socket"))
        config.write_text(CONFIG.format(clock="realtime", folder=self.folder, keys="") +
                          "clock.phase_random_walk_ns_per_rt_s = 50000\n"
                          f"[control]\nsocket = '{socket}'\nfaults = true\n")
        with subprocess.Popen([PROGRAMS / "imud", "run", config, "--record", record], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, text=True) as imud:
            ready = next(line for line in imud.stderr if " ready, truth.port is " in line)
            with subprocess.Popen([PROGRAMS / "imu-truth", "coning", "--frequency-hz", "1", "--half-angle-rad", "0.1", "--to",
                                   ready.split()[-1], "--rate", "100", "--for", "3"], stdout=subprocess.DEVNULL) as truth:
                next(line for line in imud.stderr if "truth.delay_ms is" in line)  # it samples
                run("imud", "ctl", "--socket", socket, "fault.begin", "imu=b", "target=message", "kind=missing", "each=0.5",
                    "for_s=0.5")
                self.assertEqual(truth.wait(), 0)
            imud.terminate()
            imud.communicate()
        run("imud", "replay", record, record, "--seeds", "3..4", "--npy", self.folder / "{imu}.npy", "-q")
        measured, true = (numpy.load(self.folder / f"b{name}.npy") for name in ("", "_truth"))
        self.assertEqual(measured.shape, true.shape)
        for seed in range(2):
            known = measured[seed]["fields"] != 0
            error = abs(measured[seed]["gyro"] - true[seed]["true_gyro"]).max(axis=-1)[known]
            is_right, is_unknown = error < 1e-9, numpy.isnan(error)
            self.assertGreater(is_right.sum(), 400)  # of 750, of which some 60 are missing, some before the truth
            self.assertLess((~is_right & ~is_unknown).sum(), 0.05 * is_right.sum(), error)

    def test_a_fault_that_a_client_began_does_not_shift_the_truth(self):
        """The configuration of the record lacks the fault, which loses, delays or exchanges measurements."""
        config, record, socket = (self.folder / name for name in ("imu.toml", "run.pcapng", "socket"))
        config.write_text(CONFIG.format(clock="lockstep", folder=self.folder, keys="") +
                          f"[control]\nsocket = '{socket}'\nfaults = true\n")
        for keys in (("target=message", "kind=missing", "each=0.5"), ("target=message", "kind=out_of_order"),
                     ("target=message", "kind=late", "delay_ms=30"), ("target=power", "kind=off")):
            with self.subTest(keys[1]):
                with subprocess.Popen([PROGRAMS / "imud", "run", config, "--record", record], stdout=subprocess.PIPE,
                                      stderr=subprocess.PIPE, text=True) as imud:
                    ready = next(line for line in imud.stderr if " ready, truth.port is " in line)
                    run("imud", "ctl", "--socket", socket, "fault.begin", "imu=b", "at_s=0.2", "for_s=0.3", *keys)
                    run("imu-truth", "coning", "--frequency-hz", "1", "--half-angle-rad", "0.1", "--to", ready.split()[-1],
                        "--rate", "100", "--for", "1", "--lockstep", "--fast")
                    imud.terminate()
                    imud.communicate()
                self.assertEqual(imud.returncode, 0)
                array = self.decode("native", "b", record)
                self.assertGreater(len(array), 150)  # of 251
                self.assertLess(abs(array["gyro"] - array["true_gyro"]).max(), 1e-9)
                run("imud", "replay", record, record, "--seeds", "3..4", "--npy", self.folder / "{imu}.npy", "-q")
                measured, true = (numpy.load(self.folder / f"b{name}.npy") for name in ("", "_truth"))
                self.assertEqual(measured.shape, true.shape)
                known = measured["fields"] != 0
                self.assertGreater(known.sum(), 300)
                self.assertLess(abs(measured["gyro"] - true["true_gyro"])[known].max(), 1e-9)

    def test_in_real_time_it_is_the_truth_of_the_instant(self):
        # A rate that changes, so that an extrapolated one is wrong.
        self.record("realtime", "--jitter", "15", "--drop", "30", "--frequency-hz", "1", "--half-angle-rad", "0.1",
                    motion="coning", keys="delay_ms = 0\n")
        array = self.decode("native", "b", self.folder / "run.pcapng")
        extrapolated = array["status"] & 64 != 0
        self.assertGreater(extrapolated.sum(), 10)
        self.assertGreater(len(array), 200)
        known = ~numpy.isnan(array["true_gyro"][:, 0])
        self.assertGreater((known & extrapolated).sum(), 5)
        for name in ("gyro", "accel"):
            numpy.testing.assert_array_equal(array[name][~extrapolated], array["true_" + name][~extrapolated])
        errors = array["gyro"] - array["true_gyro"]
        self.assertGreater(abs(errors[known & extrapolated]).max(), 1e-6)
        # What all truths of the record give at these instants, in their order. On a busy machine the sensor's clock is
        # not the simulator's: the record has the instants.
        samples = instants(self.folder / "run.pcapng", "b")
        numbers = array["counter"].astype(int)
        self.assertTrue(set(numbers) <= set(samples))
        run("imu-truth", "capture", self.folder / "run.pcapng", "--csv", self.folder / "truths.csv")
        truths = numpy.genfromtxt(self.folder / "truths.csv", delimiter=",", names=True)
        self.assertGreater(len(truths), 50)
        t = numpy.array([samples[number][0] for number in numbers]) * 1e-9
        for axis, column in enumerate(("omega_BN_B_x", "omega_BN_B_y", "omega_BN_B_z")):
            linear = numpy.interp(t, truths["time_ns"] * 1e-9, truths[column])
            self.assertLess(abs(array["true_gyro"][known, axis] - linear[known]).max(), 0.02)
        # Nothing is known where truth has not come in that run, nor need it be while simulation time stands still.
        moves = array["status"] & 128 == 0
        has_come = numpy.array([samples[number][1] for number in numbers])
        numpy.testing.assert_array_equal(known[moves], has_come[moves])


if __name__ == "__main__":
    unittest.main()
