#!/usr/bin/env python3
"""Logs of other programs as input of imu-decode and imu-allan."""
import json
import struct
import subprocess
import unittest

import numpy

from support import FLIGHT, PROGRAMS, RunTest, run
from ulog_reader import MAGIC

IDEAL = "rate_hz = 1000\nprotocol = 'native'\nport = 'file:{file}'\ngyro.max_rad_per_s = 10\n" \
        "accelerometer.max_m_per_s2 = 200\n"


def message(kind, body):
    return struct.pack("<Hc", len(body), kind) + body


def ulog(formats, subscriptions, data, offset=0):
    """Returns a log: formats by text, subscriptions (instance, number, name), data (number, bytes)."""
    log = MAGIC + b"\x01" + bytes(8) + message(b"B", bytes(8) + bytes([offset > 0]) + bytes(7) + struct.pack("<QQQ", offset, 0, 0))
    log += b"".join(message(b"F", text.encode()) for text in formats)
    log += b"".join(message(b"A", struct.pack("<BH", *ids) + name.encode()) for *ids, name in subscriptions)
    return log + b"".join(message(b"D", struct.pack("<H", number) + body) for number, body in data)


COMBINED = "sensor_combined:uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;" \
           "int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;uint32_t accelerometer_integral_dt;" \
           "uint8_t[4] _padding0;"
GYRO = "sensor_gyro:uint64_t timestamp;nested[2] inner;uint64_t timestamp_sample;float x;float y;float z;float temperature;"
NESTED = "nested:uint16_t a;char[3] b;"


def combined(time_us, gyro, accel, relative=0):
    return struct.pack("<Q3fIi3fI", time_us, *gyro, 4000, relative, *accel, 4000)


class LogInput(RunTest):
    def decode(self, log, *settings, exit_code=0):
        (self.folder / "a.ulg").write_bytes(log)
        arguments = [word for setting in settings for word in ("--set", setting)]
        text, errors = run("imu-decode", "ulog", f"file:{self.folder}/a.ulg", *arguments, exit_code=exit_code)
        return [line.split(",") for line in text.splitlines()[1:]], errors

    def test_what_ulog_writes_is_read_without_loss(self):
        file = self.folder / "imu.bin"
        run("imud", "replay", self.config(IDEAL.format(file=file)), FLIGHT, "-q")
        text, _ = run("imu-decode", "native", f"file:{file}", "--ulog", self.folder / "b.ulg")
        again, report = run("imu-decode", "ulog", f"file:{self.folder}/b.ulg")
        self.assertEqual(again, text)
        self.assertIn("rate       1000.000 Hz (device clock)", report)
        rows, _ = self.decode((self.folder / "b.ulg").read_bytes(), "topic=sensor_accel")
        self.assertEqual(len(rows), 10001)
        self.assertEqual(numpy.float32(rows[5][7]), numpy.float32(text.splitlines()[6].split(",")[7]))

    def test_sensor_combined_is_preferred_to_one_sensor(self):
        data = [(0, struct.pack("<Q10xQ4f", 99, 90, 7, 8, 9, 20)), (1, combined(5, (1, 2, 3), (4, 5, 6))),
                (1, combined(9, (1, 2, 3), (4, 5, 6), 2**31 - 1) + bytes(4))]
        log = ulog([COMBINED, GYRO, NESTED], [(0, 0, "sensor_gyro"), (0, 1, "sensor_combined")], data)
        rows, _ = self.decode(log)
        self.assertEqual(rows, [["5000", "", "1", "2", "3", "4", "5", "6"] + [""] * 8,
                                ["9000", "", "1", "2", "3"] + [""] * 11])
        rows, _ = self.decode(log, "topic=sensor_gyro")
        self.assertEqual(rows, [["90000", "", "7", "8", "9"] + [""] * 9 + ["20", ""]])

    def test_an_instance_is_chosen(self):
        log = ulog([COMBINED], [(0, 0, "sensor_combined"), (1, 1, "sensor_combined")],
                   [(0, combined(5, (1, 2, 3), (4, 5, 6))), (1, combined(6, (7, 7, 7), (8, 8, 8)))])
        self.assertEqual(self.decode(log)[0][0][:5], ["5000", "", "1", "2", "3"])
        self.assertEqual(self.decode(log, "instance=1")[0][0][:5], ["6000", "", "7", "7", "7"])

    def test_what_is_appended_after_a_crash_is_left_out(self):
        formats, subscriptions = [COMBINED], [(0, 0, "sensor_combined")]
        data = [(0, combined(5, (1, 2, 3), (4, 5, 6)))]
        size = len(ulog(formats, subscriptions, data))
        rows, report = self.decode(ulog(formats, subscriptions, data, size) + b"\xff\xff\xffcrash")
        self.assertEqual(len(rows), 1)
        self.assertIn("0 malformed", report)

    def test_other_files_are_refused(self):
        log = ulog([COMBINED], [(0, 0, "sensor_combined")], [(0, combined(5, (1, 2, 3), (4, 5, 6)))] * 2)
        _, errors = self.decode(b"MATLAB 5.0 MAT-file", exit_code=1)
        self.assertIn("ulog: this is no ULog; right would be a file .ulg of PX4", errors)
        _, errors = self.decode(log[:12], exit_code=1)
        self.assertIn("ulog: the file ends within its header", errors)
        _, errors = self.decode(log, "topic=vehicle_imu", exit_code=1)
        self.assertIn("ulog: it has no topic vehicle_imu with instance 0", errors)
        rows, report = self.decode(log[:-1])
        self.assertEqual(len(rows), 1)
        self.assertIn("1 malformed", report)
        self.assertIn("did you mean 'ulog'?", run("imu-decode", "ulogg", "file:x", exit_code=2)[1])

    def test_a_damaged_file_is_harmless(self):
        log = ulog([COMBINED], [(0, 0, "sensor_combined")], [(0, combined(5, (1, 2, 3), (4, 5, 6)))] * 2)
        damaged = [log[:at] + bytes([log[at] ^ 255]) + log[at + 1:] for at in range(16, len(log), 9)]
        other = COMBINED.replace("float[3] gyro_rad", "int8_t[0] gyro_rad").replace("uint32_t gyro_integral_dt", "int8_t temperature")
        damaged += [ulog([COMBINED, other], [(0, 0, "sensor_combined")], [(0, b"x" * 10)] * 2),
                    ulog([other], [(0, 0, "sensor_combined")], [(0, b"x" * 28)] * 2),
                    ulog(["sensor_combined:sensor_combined[60000] x;"], [(0, 0, "sensor_combined")], [(0, b"x")])]
        for number, log in enumerate(damaged):
            (self.folder / "a.ulg").write_bytes(log)
            done = subprocess.run([PROGRAMS / "imu-decode", "ulog", f"file:{self.folder}/a.ulg"], capture_output=True)
            self.assertIn(done.returncode, (0, 1), number)

    def test_imu_allan_reads_it(self):
        noise = numpy.random.default_rng(1).normal(0, 0.01, (20000, 6))
        data = [(0, combined(4000 * i, row[:3], row[3:])) for i, row in enumerate(noise)]
        (self.folder / "a.ulg").write_bytes(ulog([COMBINED], [(0, 0, "sensor_combined")], data))
        run("imu-allan", "ulog", f"file:{self.folder}/a.ulg", "--json", self.folder / "a.json")
        report = json.loads((self.folder / "a.json").read_text())
        self.assertEqual(report["samples"], 20000)
        self.assertAlmostEqual(report["rate_hz"], 250, 6)
        self.assertEqual(len(report["axes"]), 6)


if __name__ == "__main__":
    unittest.main()
