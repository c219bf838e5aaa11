#!/usr/bin/env python3
"""Logs of PX4 and of ROS 2 as truth: imu-truth capture --csv, and a replay of what it writes."""
import csv
import io
import math
import struct
import subprocess
import unittest

import numpy

from log_writers import mcap, ros_header, ulog
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

    def check_turn(self, truth, first_s, begin_s=0, rate=1e-6, force=1e-3):
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
        self.check_turn(self.convert(ulog(*flight(position_hz=10)))[0], 7, force=0.01)

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
        for name, file in ("a.ulg", ulog(formats, subscriptions, data[:8])), ("a.mcap", odometry(seconds=0, crc=0)):
            for at in range(0, len(file), 17):
                (self.folder / name).write_bytes(file[:at] + bytes([file[at] ^ 255]) + file[at + 1:])
                done = subprocess.run([PROGRAMS / "imu-truth", "capture", self.folder / name, "--csv", "-"],
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

    def test_a_replay_of_the_log_itself_says_what_to_do(self):
        (self.folder / "imu.toml").write_text("[truth]\nformat = 'csv'\nport = 'udp:127.0.0.1:0'\n[[imu]]\n"
                                              f"protocol = 'stim300'\nport = 'file:{self.folder}/a.bin'\n")
        for name, log, words in ("a.ulg", ulog(*flight()), "a ULog of PX4"), ("a.mcap", odometry(), "an MCAP log"):
            (self.folder / name).write_bytes(log)
            errors = run("imud", "replay", self.folder / "imu.toml", self.folder / name, "--fast", exit_code=1)[1]
            self.assertIn(f"the capture has {words}: imu-truth capture FILE --csv truth.csv makes truth of it", errors)

    def test_a_log_is_converted_and_not_sent(self):
        (self.folder / "a.ulg").write_bytes(ulog(*flight()))
        errors = run("imu-truth", "capture", self.folder / "a.ulg", "--to", "udp:127.0.0.1:9", exit_code=2)[1]
        self.assertIn("a.ulg: is a log, which --csv FILE converts to what imud replay reads", errors)
        text, _ = run("imu-truth", "capture", self.folder / "a.ulg", "--csv", "-", "--gravity-m-per-s2", "1.5")
        rows = list(csv.DictReader(io.StringIO(text)))
        self.assertAlmostEqual(float(rows[400]["nonConservativeAccelpntB_B_z"]), -1.5, 2)

    # ROS 2.

    def test_an_odometry_with_twist(self):
        truth, errors = self.convert(odometry(), name="a.mcap")
        self.check_turn(truth, 1000, rate=1e-12, force=1e-6)
        self.assertIn("note         /odom with its twist", errors)
        truth, errors = self.convert(odometry(), "twist=none", name="a.mcap")
        self.check_turn(truth, 1000)
        self.assertIn("note         /odom, whose rate is derived", errors)

    def test_an_odometry_without_twist(self):
        truth, errors = self.convert(odometry(twist=False), name="a.mcap")
        self.check_turn(truth, 1000)
        self.assertIn("note         /odom, whose rate is derived", errors)

    def test_poses(self):
        self.check_turn(self.convert(odometry(schema="geometry_msgs/msg/PoseStamped"), name="a.mcap")[0], 1000)

    def test_pitch_and_roll(self):
        # Northwards: 90 deg about up. A positive angle about front-left-up's y, which points left, is nose down.
        angle = 0.4
        half, quarter = math.sin(angle / 2), math.sqrt(0.5)
        for axis, rolled, force in (1, (half, 0, 0), (0, -GRAVITY * math.sin(angle), -GRAVITY * math.cos(angle))), \
                (2, (0, -half, 0), (GRAVITY * math.sin(angle), 0, -GRAVITY * math.cos(angle))):
            x, y, _ = rolled
            w = math.cos(angle / 2)
            q = quarter * (x - y), quarter * (x + y), quarter * w, quarter * w  # x, y, z, w of the product
            body = ros_header(5, 0, "map")
            body += bytes(-len(body) % 8)
            messages = [(0, n, b"\0\1\0\0" + struct.pack("<i", 5 + n) + body[4:] + struct.pack("<7d", 3, 4, 5, *q))
                        for n in range(40)]
            truth, _ = self.convert(mcap(messages, schema="geometry_msgs/msg/PoseStamped"), name="a.mcap")
            for i in 1, 2, 3:
                numpy.testing.assert_allclose(truth[f"sigma_BN_{i}"], math.tan(angle / 4) * (i == axis), atol=1e-12)
            for i, name in enumerate("xyz"):
                numpy.testing.assert_allclose(truth[f"r_BN_N_{name}"], (4, 3, -5)[i], atol=1e-9)
                numpy.testing.assert_allclose(truth[f"nonConservativeAccelpntB_B_{name}"], force[i], atol=1e-9)

    def test_axes_are_chosen(self):
        # East-north-up and front-left-up taken for north-east-down and front-right-down: the turn is about +z still,
        # but upside down.
        truth, _ = self.convert(odometry(), "level=ned", "body=frd", name="a.mcap")
        numpy.testing.assert_allclose(truth["omega_BN_B_z"], -YAW_RATE, atol=1e-12)
        numpy.testing.assert_allclose(truth["r_BN_N_z"], 100, atol=1e-9)

    def test_a_topic_is_chosen(self):
        file = odometry(topics=("/odom", "/truth"), channel=1)
        errors = self.convert(file, name="a.mcap", exit_code=2)[1]
        self.assertIn("its topics are /odom (nav_msgs/msg/Odometry, cdr), /truth (nav_msgs/msg/Odometry, cdr)", errors)
        truth, errors = self.convert(file, "topic=/truth", name="a.mcap")
        self.check_turn(truth, 1000, rate=1e-12)
        self.assertIn("; --set topic=... chooses another of /odom, /truth", errors)

    def test_a_recording_without_truth_names_what_it_has(self):
        errors = self.convert(odometry(schema="sensor_msgs/msg/Imu"), name="a.mcap", exit_code=2)[1]
        self.assertIn("mcap: it has no truth, which would be nav_msgs/msg/Odometry or geometry_msgs/msg/PoseStamped by "
                      "cdr; its topics are /odom (sensor_msgs/msg/Imu, cdr)\n", errors)
        self.assertIn("mcap: this is no MCAP", self.convert(b"x" * 100, name="a.mcap", exit_code=2)[1])
        self.assertIn("(records with a wrong CRC: 1)", self.convert(odometry(crc=5), name="a.mcap", exit_code=2)[1])
        self.assertIn("chunks are compressed by lz4", self.convert(odometry(compression="lz4"), name="a.mcap", exit_code=2)[1])
        self.assertIn("none.mcap: No such file", run("imu-truth", "capture", self.folder / "none.mcap", "--csv", "-",
                                                     exit_code=2)[1])


def odometry(seconds=4, twist=True, schema="nav_msgs/msg/Odometry", channel=0, topics=("/odom",), **options):
    """The turn as nav_msgs/msg/Odometry or geometry_msgs/msg/PoseStamped, by REP 103: the world's axes are east, north
    and up, the body's front, left and up; the twist is in the body's. 100 a second."""
    messages = []
    for n in range(100 * seconds + 1):
        _, (north, east, down), _ = turn(n / 100)
        yaw = math.pi / 2 - YAW_RATE * n / 100  # from east, counter-clockwise
        body = ros_header(1000 + n // 100, n % 100 * 10_000_000, "odom" + "_" * (n % 5))
        if "Odometry" in schema:
            body += bytes(-len(body) % 4) + struct.pack("<I", 10) + b"base_link\0"
        body += bytes(-len(body) % 8) + struct.pack("<7d", east, north, -down, 0, 0, math.sin(yaw / 2), math.cos(yaw / 2))
        if "Odometry" in schema:
            body += struct.pack("<36d", *range(36))
            body += struct.pack("<6d", *((SPEED, 0, 0, 0, 0, -YAW_RATE) if twist else [0] * 6)) + struct.pack("<36d", *range(36))
        messages.append((channel, n, b"\0\1\0\0" + body))
    return mcap(messages, schema=schema, topics=topics, **options)


if __name__ == "__main__":
    unittest.main()
