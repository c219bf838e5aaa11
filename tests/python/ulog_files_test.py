#!/usr/bin/env python3
"""The ULog files that imu-decode writes, by a reader of their own."""
import subprocess
import unittest

import numpy

from support import FLIGHT, PROGRAMS, RunTest, run
from ulog_reader import Ulog

IDEAL = "rate_hz = 1000\nprotocol = '{protocol}'\nport = 'file:{file}'\ngyro.max_rad_per_s = 10\n" \
        "accelerometer.max_m_per_s2 = 200\n"
HEADER = "time_ns,counter," + ",".join(f"{n}_{a}" for n in ("gyro", "accel", "dtheta", "dvel") for a in "xyz") + \
         ",temperature,status\n"

# Messages that pyulog (PX4/pyulog 3cf1779, ULog.write_ulog) wrote for the measurement 5000,1,1,2,3,4,5,6,,,,,,,20,0.
REFERENCE = """
554c6f67011235010500000000000000
28004200000000000000000000000000000000000000000000000000000000000000000000000000000000
15004910636861725b345d207379735f6e616d65696d7564
130041000000696d75645f6d6561737572656d656e74 0e004100010073656e736f725f6779726f 0f004100020073656e736f725f616363656c
2e0044010005000000000000000500000000000000000000000000803f00000040000040400000a0410000000000000001
2e004402000500000000000000050000000000000000000000000080400000a0400000c0400000a0410000000000000001
8a00440000050000000000000088130000000000000100000000000000000000000000f03f000000000000004000000000000008400000000000001040
00000000000014400000000000001840000000000000f87f000000000000f87f000000000000f87f000000000000f87f000000000000f87f000000000000f87f
000000000000344000000000cf000000
"""


class UlogFiles(RunTest):
    def flight(self, protocol="native"):
        file = self.folder / "imu.bin"
        config = self.config(IDEAL.format(file=file, protocol=protocol))
        run("imud", "replay", config, FLIGHT, "-q")
        return file, config

    def decode(self, *arguments, exit_code=0, **options):
        _, errors = run("imu-decode", *arguments, "--quiet", "--npy", self.folder / "a.npy", "--ulog",
                        self.folder / "a.ulg", exit_code=exit_code, **options)
        return numpy.load(self.folder / "a.npy"), Ulog((self.folder / "a.ulg").read_bytes()), errors

    def test_it_has_the_values_of_the_array(self):
        file, config = self.flight()
        array, log, _ = self.decode("native", f"file:{file}", "--truth", config, FLIGHT)
        all_of_it = log.arrays["imud_measurement"]
        self.assertEqual(all_of_it.dtype.names, ("timestamp", *array.dtype.names))
        for name in array.dtype.names:
            numpy.testing.assert_array_equal(all_of_it[name], array[name])
        for name, quantity in ("sensor_gyro", "gyro"), ("sensor_accel", "accel"):
            message = log.arrays[name]
            for time in "timestamp", "timestamp_sample":
                self.assertEqual(message[time].tolist(), (array["time_ns"] // 1000).tolist())
            for axis in range(3):
                numpy.testing.assert_array_equal(message["xyz"[axis]], array[quantity][:, axis].astype("f4"))
            numpy.testing.assert_array_equal(message["temperature"], array["temperature"].astype("f4"))
            self.assertTrue((message["samples"] == 1).all())
        self.assertEqual(log.start_us, array["time_ns"][0] // 1000)
        self.assertEqual((log.info["sys_name"], log.info["protocol"], log.info["seed"]), ("imud", "native", 7))
        self.assertIn("max_rad_per_s = 10.0", log.info["config"])

    def test_the_bytes_are_those_of_the_reference_writer(self):
        self.decode("csv", "-", stdin=HEADER + "5000,1,1,2,3,4,5,6,,,,,,,20,0\n")
        written = (self.folder / "a.ulg").read_bytes()
        header, flags, name, subscriptions, gyro, accel, *measurement = REFERENCE.split("\n")[1:-1]
        self.assertTrue(written.startswith(bytes.fromhex(header + flags + name)), written[:100].hex())
        self.assertTrue(written.endswith(bytes.fromhex(subscriptions + gyro + accel + "".join(measurement))), written.hex())

    def test_what_is_not_carried_has_no_message(self):
        array, log, _ = self.decode("csv", "-", stdin=HEADER + "5000,,1,2,3,,,,,,,,,,,\n7999,,,,,4,5,6,,,,,,,,\n")
        self.assertEqual(log.arrays["sensor_gyro"][["timestamp", "x", "y", "z"]].tolist(), [(5, 1, 2, 3)])
        self.assertEqual(log.arrays["sensor_accel"][["timestamp", "x", "y", "z"]].tolist(), [(7, 4, 5, 6)])
        self.assertEqual(log.arrays["imud_measurement"]["time_ns"].tolist(), [5000, 7999])
        self.assertTrue(numpy.isnan(log.arrays["imud_measurement"]["accel"][0]).all())

    def test_measurements_without_time_need_a_rate(self):
        rows = HEADER + ",,1,2,3,,,,,,,,,,,\n,,4,5,6,,,,,,,,,,,\n"
        _, log, errors = self.decode("csv", "-", stdin=rows, exit_code=1)
        self.assertIn("a.ulg: 2 of 2 measurements carry no time, and are left out; right would be --rate-hz HZ", errors)
        self.assertEqual(len(log.arrays["imud_measurement"]), 0)
        _, log, _ = self.decode("csv", "-", "--rate-hz", 400, stdin=rows)
        self.assertEqual(log.arrays["sensor_gyro"]["timestamp"].tolist(), [0, 2500])
        _, _, errors = self.decode("csv", "-", stdin=HEADER + "-1,,1,2,3,,,,,,,,,,,\n", exit_code=1)
        self.assertIn("1 of 1 measurements are before time 0", errors)
        _, _, errors = self.decode("csv", "-", stdin=HEADER + ",,1,2,3,,,,,,,,,,,\n-1,,1,2,3,,,,,,,,,,,\n", exit_code=1)
        self.assertIn("1 of 2 measurements carry no time, and are left out; right would be --rate-hz HZ; 1 of 2 measurements "
                      "are before time 0", errors)
        _, errors = run("imu-decode", "csv", "-", "--rate-hz", 400, stdin=rows, exit_code=2)
        self.assertIn("--rate-hz: is for --mcap and --ulog, of which none is given", errors)

    def test_a_long_configuration_is_whole(self):
        names = [f"name = 'imu{i}'\n" + IDEAL.format(protocol="native", file=self.folder / f"imu{i}.bin")
                 for i in range(60)]
        config = self.config(*names)
        _, log, _ = self.decode("csv", "-", "--config", config, stdin=HEADER + "5000,,1,2,3,,,,,,,,,,,\n")
        text, _ = run("imud", "check", config, "--toml")
        self.assertGreater(len(text), 2 * 16384)
        self.assertEqual(log.info["config"], text)

    def test_a_full_disk_is_an_error(self):
        file, _ = self.flight()
        done = subprocess.run(["bash", "-c", f"ulimit -f 256; trap '' XFSZ; exec {PROGRAMS}/imu-decode native "
                               f"file:{file} --quiet --ulog {self.folder}/a.ulg"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn(f"{self.folder}/a.ulg: File too large", done.stderr)


if __name__ == "__main__":
    unittest.main()
