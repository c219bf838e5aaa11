#!/usr/bin/env python3
"""Logs of other programs as input of imu-decode and imu-allan."""
import json
import struct
import subprocess
import unittest

import numpy

from log_writers import mcap, ros_header, ulog
from support import FLIGHT, PROGRAMS, RunTest, run

IDEAL = "rate_hz = 1000\nprotocol = 'native'\nport = 'file:{file}'\ngyro.max_rad_per_s = 10\n" \
        "accelerometer.max_m_per_s2 = 200\n"
HEADER = "time_ns,counter," + ",".join(f"{n}_{a}" for n in ("gyro", "accel", "dtheta", "dvel") for a in "xyz") + \
         ",temperature,status\n"

COMBINED = "sensor_combined:uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;" \
           "int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;uint32_t accelerometer_integral_dt;" \
           "uint8_t[4] _padding0;"
GYRO = "sensor_gyro:uint64_t timestamp;nested[2] inner;uint64_t timestamp_sample;float x;float y;float z;float temperature;"
NESTED = "nested:uint16_t a;char[3] b;"


def combined(time_us, gyro, accel, relative=0):
    return struct.pack("<Q3fIi3fI", time_us, *gyro, 4000, relative, *accel, 4000)


def expect_lacking_again(test, log):
    """A product that sends each second sample, and no rate about x, is the same in the log."""
    text = HEADER + "".join(f"{k}000000,{2 * k},,2,3,4,5,6,,,,,,,20,0\n" for k in range(1, 40))
    run("imu-decode", "csv", "-", f"--{log}", test.folder / "b", stdin=text)
    again, report = run("imu-decode", log, f"file:{test.folder}/b")
    test.assertEqual(again, text)
    test.assertIn("gaps       0 (0 samples missing)", report)


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

    def test_what_is_lacking_is_lacking_again(self):
        expect_lacking_again(self, "ulog")

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


def ros_imu(sec, nanosec, gyro, accel, frame="imu_link", order="<", accel_covariance=0):
    """sensor_msgs/msg/Imu by the rules of CDR: values are aligned to their size, behind the encapsulation."""
    body = ros_header(sec, nanosec, frame, order)
    body += bytes(-len(body) % 8)
    for values, covariance in ((0, 0, 0, 1), -1), (gyro, 0.5), (accel, accel_covariance):
        body += struct.pack(f"{order}{len(values)}d9d", *values, covariance, *[0] * 8)
    return (b"\0\1\0\0" if order == "<" else b"\0\0\0\0") + body


class McapInput(RunTest):
    def decode(self, file, *settings, exit_code=0):
        (self.folder / "a.mcap").write_bytes(file)
        arguments = [word for setting in settings for word in ("--set", setting)]
        lines, errors = run("imu-decode", "mcap", f"file:{self.folder}/a.mcap", *arguments, exit_code=exit_code)
        return [line.split(",") for line in lines.splitlines()[1:]], errors

    def test_what_mcap_writes_is_read_without_loss(self):
        file = self.folder / "imu.bin"
        run("imud", "replay", self.config(IDEAL.format(file=file)), FLIGHT, "-q")
        lines, _ = run("imu-decode", "native", f"file:{file}", "--mcap", self.folder / "b.mcap")
        again, report = run("imu-decode", "mcap", f"file:{self.folder}/b.mcap")
        self.assertEqual(again, lines)
        self.assertIn("0 failures, 0 malformed", report)

    def test_what_is_lacking_is_lacking_again(self):
        expect_lacking_again(self, "mcap")

    def test_imu_messages_of_ros_2_are_read(self):
        for order in "<", ">":
            for frame in "", "imu_link", "a_longer_frame":
                rows, _ = self.decode(mcap([(0, 1, ros_imu(12, 345, (1, 2, 3), (4, 5, 6), frame, order)),
                                            (0, 2, ros_imu(13, 0, (1, 2, 3), (4, 5, 6), frame, order, -1))]))
                self.assertEqual(rows, [["12000000345", "", "1", "2", "3", "4", "5", "6"] + [""] * 8,
                                        ["13000000000", "", "1", "2", "3"] + [""] * 11])

    def test_a_topic_is_chosen(self):
        file = mcap([(n, n, ros_imu(n, 0, (n, 0, 0), (0, 0, 0))) for n in (0, 1)], topics=("/left", "/right"))
        self.assertEqual([row[0] for row in self.decode(file)[0]], ["0"])
        self.assertEqual([row[0] for row in self.decode(file, "topic=/right")[0]], ["1000000000"])
        self.assertIn("mcap: it has no such channel with the topic /up", self.decode(file, "topic=/up", exit_code=1)[1])

    def test_other_files_are_refused(self):
        good = (0, 1, ros_imu(12, 345, (1, 2, 3), (4, 5, 6)))
        for file, fault in (b"ULog\x01\x12\x35\x01", "this is no MCAP file"), (b"\x89M", "ends within its magic"), \
                (mcap([good], "lz4"), "its chunks are compressed by lz4; right would be zstd or none"), \
                (mcap([good], schema="sensor_msgs/msg/Image"), "it has no channel of imud's JSON"):
            self.assertIn(fault, self.decode(file, exit_code=1)[1])
        self.assertIn("1 failure,", self.decode(mcap([good, good], crc=5), exit_code=1)[1])
        rows, report = self.decode(mcap([good, (0, 2, good[2][:-1]), (0, 3, b"")]))
        self.assertEqual(len(rows), 1)
        self.assertIn("2 malformed", report)

    def test_a_damaged_file_is_harmless(self):
        file = mcap([(0, 1, ros_imu(12, 345, (1, 2, 3), (4, 5, 6)))], crc=0)
        for at in range(0, len(file), 11):
            (self.folder / "a.mcap").write_bytes(file[:at] + bytes([file[at] ^ 255]) + file[at + 1:])
            done = subprocess.run([PROGRAMS / "imu-decode", "mcap", f"file:{self.folder}/a.mcap"], capture_output=True)
            self.assertIn(done.returncode, (0, 1), at)

    def test_imu_allan_reads_it(self):
        noise = numpy.random.default_rng(1).normal(0, 0.01, (2000, 6))
        messages = [(0, 0, ros_imu(i // 200, i % 200 * 5_000_000, row[:3], row[3:])) for i, row in enumerate(noise)]
        (self.folder / "a.mcap").write_bytes(mcap(messages))
        run("imu-allan", "mcap", f"file:{self.folder}/a.mcap", "--json", self.folder / "a.json")
        report = json.loads((self.folder / "a.json").read_text())
        self.assertEqual(report["samples"], 2000)
        self.assertAlmostEqual(report["rate_hz"], 200, 6)


if __name__ == "__main__":
    unittest.main()
