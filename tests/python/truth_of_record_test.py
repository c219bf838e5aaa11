#!/usr/bin/env python3
"""imu-decode --truth RECORD: the truth at each measurement of a recorded run, in lockstep and in real time."""
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
        # What all truths of the record give at these instants, in their order.
        run("imu-truth", "capture", self.folder / "run.pcapng", "--csv", self.folder / "truths.csv")
        truths = numpy.genfromtxt(self.folder / "truths.csv", delimiter=",", names=True)
        self.assertGreater(len(truths), 50)
        errors = array["gyro"] - array["true_gyro"]
        self.assertGreater(abs(errors[known & extrapolated]).max(), 1e-6)
        t = array["time_ns"] * 1e-9
        for axis, column in enumerate(("omega_BN_B_x", "omega_BN_B_y", "omega_BN_B_z")):
            linear = numpy.interp(t, truths["time_ns"] * 1e-9, truths[column])
            between = known & (t <= truths["time_ns"].max() * 1e-9)
            self.assertLess(abs(array["true_gyro"][between, axis] - linear[between]).max(), 0.02)
        # Behind the newest truth nothing is known, nor while motion is held: then simulation time stands still.
        held = array["status"] & 128 != 0
        self.assertTrue((held | (t > truths["time_ns"].max() * 1e-9))[~known].all())


if __name__ == "__main__":
    unittest.main()
