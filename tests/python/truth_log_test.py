#!/usr/bin/env python3
"""Logs of PX4 as truth: imu-truth capture --csv, and a replay of what it writes."""
import csv
import io
import math
import struct
import subprocess
import unittest

import numpy

from log_writers import ulog
from support import PROGRAMS, RunTest, run

ATTITUDE = "vehicle_attitude:uint64_t timestamp;uint64_t timestamp_sample;float[4] q;float[4] delta_q_reset;" \
           "uint8_t quat_reset_counter;uint8_t[7] _padding0;"
POSITION = "vehicle_local_position:uint64_t timestamp;uint64_t timestamp_sample;float x;float y;float z;float vx;" \
           "float vy;float vz;bool xy_valid;bool z_valid;bool v_xy_valid;bool v_z_valid;uint8_t[4] _padding0;"
RATE = "vehicle_angular_velocity:uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz;float[3] xyz_derivative;"
TRUTH = "_groundtruth"

YAW_RATE = 0.5  # rad/s, to the right
SPEED = 10  # m/s
GRAVITY = 9.80665


def attitude(time_us, q, sampled=True):
    return struct.pack("<QQ4f4fB", time_us + 300, time_us if sampled else 0, *q, 1, 0, 0, 0, 0)


def position(time_us, r, v, valid=True):
    return struct.pack("<QQ6f4?", time_us + 300, time_us, *r, *v, True, True, valid, True)


def turn(t):
    """Returns q (w first, front-right-down to north-east-down), position and velocity of a level turn to the right,
    from north at the time 0: about the vertical axis alone. float64."""
    yaw, radius = YAW_RATE * t, SPEED / YAW_RATE
    return (math.cos(yaw / 2), 0, 0, math.sin(yaw / 2)), \
        (radius * math.sin(yaw), radius * (1 - math.cos(yaw)), -100), (SPEED * math.cos(yaw), SPEED * math.sin(yaw), 0)


def flight(suffix="", seconds=4, position_hz=50, first_position_s=0.0, gap_s=(0, 0), wrong=False, rate=None):
    """Returns formats, subscriptions and data of a turn: 200 attitudes a second."""
    names = [("vehicle_attitude", ATTITUDE), ("vehicle_local_position", POSITION), ("vehicle_angular_velocity", RATE)]
    first = 10 if suffix else 0
    formats = [text.replace(name + ":", name + suffix + ":") for name, text in names]
    subscriptions = [(0, first + i, name + suffix) for i, (name, _) in enumerate(names)]
    data = []
    for ms in range(0, 1000 * seconds + 1, 5):
        time_us = 7_000_000 + 1000 * ms
        q, r, v = turn(0 if wrong else ms / 1000)
        data.append((first, attitude(time_us, q)))
        if ms % (1000 // position_hz) == 0 and not gap_s[0] < ms / 1000 < gap_s[1]:
            data.append((first + 1, position(time_us, r, v, ms / 1000 >= first_position_s)))
        if rate is not None:
            data.append((first + 2, struct.pack("<QQ6f", time_us + 300, time_us, *rate, 0, 0, 0)))
    return formats, subscriptions, data


class TruthLog(RunTest):
    def convert(self, log, *settings, name="a.ulg", exit_code=0):
        """Returns the columns by name, and standard error."""
        (self.folder / name).write_bytes(log)
        arguments = [word for setting in settings for word in ("--set", setting)]
        text, errors = run("imu-truth", "capture", self.folder / name, "--csv", "-", *arguments, exit_code=exit_code)
        rows = list(csv.reader(io.StringIO(text)))
        if len(rows) < 2:
            return {}, errors
        return dict(zip(rows[0], numpy.array([[float(one) for one in row] for row in rows[1:]]).T)), errors

    def check_turn(self, truth, first_s, begin_s=0, rate=1e-4, force=0.02):
        """The truth is the turn above, from first_s on, which is begin_s into the turn."""
        t = truth["time_ns"] * 1e-9 - first_s
        self.assertAlmostEqual(t[0], begin_s, 9)
        # The modified Rodrigues parameters of a yaw angle.
        for axis, wanted in enumerate((0 * t, 0 * t, numpy.tan(YAW_RATE * t / 4)), 1):
            numpy.testing.assert_allclose(truth[f"sigma_BN_{axis}"], wanted, atol=2e-6)
        states = [turn(one) for one in t]
        for i, axis in enumerate("xyz"):
            numpy.testing.assert_allclose(truth[f"r_BN_N_{axis}"], [r[i] for _, r, _ in states], atol=1e-3)
            numpy.testing.assert_allclose(truth[f"v_BN_N_{axis}"], [v[i] for _, _, v in states], atol=2e-3)
            numpy.testing.assert_allclose(truth[f"omega_BN_B_{axis}"], (0, 0, YAW_RATE)[i], atol=rate)
            # Centripetal: to the right. At rest the specific force points up: -z.
            numpy.testing.assert_allclose(truth[f"nonConservativeAccelpntB_B_{axis}"],
                                          (0, SPEED * YAW_RATE, -GRAVITY)[i], atol=force)

    def test_the_estimate_of_px4(self):
        truth, errors = self.convert(ulog(*flight()))
        self.assertEqual(len(truth["time_ns"]), 801)
        self.check_turn(truth, 7)
        self.assertIn("note         estimate, whose rate is derived", errors)

    def test_ground_truth_is_preferred(self):
        formats, subscriptions, data = flight(wrong=True)
        more = flight(TRUTH, rate=(0, 0, YAW_RATE))
        log = ulog(formats + more[0], subscriptions + more[1], data + more[2])
        truth, errors = self.convert(log)
        self.check_turn(truth, 7, rate=0)
        self.assertIn("note         groundtruth with its rate", errors)
        truth, errors = self.convert(log, "topics=estimate")
        self.assertLess(abs(truth["omega_BN_B_z"]).max(), 1e-9)
        self.assertIn("note         estimate", errors)

    def test_attitudes_before_the_first_position_are_left_out(self):
        truth, _ = self.convert(ulog(*flight(first_position_s=1)))
        self.check_turn(truth, 7, 1)
        self.assertEqual(len(truth["time_ns"]), 601)

    def test_a_position_at_10_hz_is_interpolated(self):
        self.check_turn(self.convert(ulog(*flight(position_hz=10)))[0], 7, force=0.1)

    def test_a_gap_of_positions_is_reported(self):
        truth, errors = self.convert(ulog(*flight(gap_s=(1, 3))), exit_code=3)
        self.assertIn("refused      399 without position", errors)
        self.assertEqual(len(truth["time_ns"]), 402)

    def test_a_log_without_truth_names_what_it_has(self):
        formats, subscriptions, data = flight()
        errors = self.convert(ulog(formats, subscriptions, [one for one in data if one[0] == 0]), exit_code=2)[1]
        self.assertIn("ulog: it has no truth, which would be vehicle_attitude and vehicle_local_position, or "
                      "vehicle_attitude_groundtruth and vehicle_local_position_groundtruth; its topics are "
                      "vehicle_attitude\n", errors)
        errors = self.convert(ulog(formats, subscriptions, data), "topics=groundtruth", exit_code=2)[1]
        self.assertIn("which would be vehicle_attitude_groundtruth and vehicle_local_position_groundtruth; its topics "
                      "are vehicle_attitude, vehicle_local_position\n", errors)
        self.assertIn("; 201 of its positions are not valid (xy_valid,",
                      self.convert(ulog(*flight(first_position_s=9)), exit_code=2)[1])
        self.assertIn("its topics are none", self.convert(ulog([], [], []), exit_code=2)[1])

    def test_damaged_ulogs_are_reported(self):
        log = ulog(*flight())
        truth, errors = self.convert(log[:len(log) // 2], exit_code=3)
        self.assertIn("capture      the log ends within a message, of which it has", errors)
        self.check_turn(truth, 7)
        self.assertIn("ulog: this is no ULog", self.convert(b"x" * 100, exit_code=2)[1])
        self.assertIn("ulog: the file ends within its header", self.convert(log[:9], exit_code=2)[1])
        formats, subscriptions, data = flight()
        other = [formats[0].replace("float[4] q", "int32_t[4] q")] + formats[1:]
        self.assertIn("ulog: vehicle_attitude has no field q of 4 numbers",
                      self.convert(ulog(other, subscriptions, data), exit_code=2)[1])
        nan = data[:400] + [(0, attitude(8_001_000, (math.nan, 0, 0, 0))), (0, attitude(8_002_000, (0, 0, 0, 0))),
                            (0, b"short")] + data[400:]
        errors = self.convert(ulog(formats, subscriptions, nan), exit_code=3)[1]
        self.assertIn("refused      1 not_finite, 1 range", errors)
        self.assertIn("capture      malformed messages: 1", errors)

    def test_damaged_files_are_harmless(self):
        formats, subscriptions, data = flight(seconds=1)
        file = ulog(formats, subscriptions, data[:8])
        for at in range(0, len(file), 17):
            (self.folder / "a.ulg").write_bytes(file[:at] + bytes([file[at] ^ 255]) + file[at + 1:])
            done = subprocess.run([PROGRAMS / "imu-truth", "capture", self.folder / "a.ulg", "--csv", "-"],
                                  capture_output=True)
            self.assertIn(done.returncode, (0, 1, 2, 3), at)

    def test_a_replay_of_the_conversion_measures_the_turn(self):
        (self.folder / "a.ulg").write_bytes(ulog(*flight()))
        run("imu-truth", "capture", self.folder / "a.ulg", "--csv", self.folder / "truth.csv")
        (self.folder / "imu.toml").write_text(
            "clock = 'fast'\n[truth]\nformat = 'csv'\nport = 'udp:127.0.0.1:0'\n[[imu]]\nprotocol = 'native'\n"
            f"rate_hz = 100\nport = 'file:{self.folder}/a.bin'\ngyro.max_rad_per_s = 10\n"
            "accelerometer.max_m_per_s2 = 200\n")
        run("imud", "replay", self.folder / "imu.toml", self.folder / "truth.csv", "-q")
        run("imu-decode", "native", f"file:{self.folder}/a.bin", "--quiet", "--npy", self.folder / "a.npy")
        array = numpy.load(self.folder / "a.npy")
        self.assertEqual(len(array), 401)
        numpy.testing.assert_allclose(array["gyro"], numpy.tile((0, 0, YAW_RATE), (401, 1)), atol=1e-3)
        numpy.testing.assert_allclose(array["accel"], numpy.tile((0, SPEED * YAW_RATE, -GRAVITY), (401, 1)), atol=0.05)

    def test_a_log_is_converted_and_not_sent(self):
        (self.folder / "a.ulg").write_bytes(ulog(*flight()))
        errors = run("imu-truth", "capture", self.folder / "a.ulg", "--to", "udp:127.0.0.1:9", exit_code=2)[1]
        self.assertIn("a.ulg: is a log, which --csv FILE converts to what imud replay reads", errors)
        text, _ = run("imu-truth", "capture", self.folder / "a.ulg", "--csv", "-", "--gravity-m-per-s2", "1.5")
        rows = list(csv.DictReader(io.StringIO(text)))
        self.assertAlmostEqual(float(rows[400]["nonConservativeAccelpntB_B_z"]), -1.5, 2)


if __name__ == "__main__":
    unittest.main()
