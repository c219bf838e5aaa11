#!/usr/bin/env python3
"""imud replay with seeds: the bytes of single runs, arrays with a seed axis, truth beside the measurements."""
import csv
import json
import os
import pathlib
import re
import signal
import subprocess
import time
import unittest

import numpy

from support import FLIGHT, PROGRAMS, SOURCE, RunTest, run

STIM300 = "name = 'a'\nprotocol = 'stim300'\nport = 'file:{folder}/a_{seed}.bin'\n"
# Errors of a preset; sends every sample bit for bit.
NATIVE = """name = 'b'
rate_hz = 200
protocol = 'native'
model = 'vn-100'
mounting.position_m = [1, 2, 3]
mounting.yaw_pitch_roll_deg = [10, 20, 30]
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 200
port = 'file:{folder}/b_{seed}.bin'
"""
QUANTITIES = "gyro", "accel", "dtheta", "dvel"


class Seeds(RunTest):
    def imus(self, *texts):
        return self.config(*(text.replace("{folder}", str(self.folder)) for text in texts))

    def test_each_seed_has_the_bytes_of_a_run_of_its_own(self):
        config = self.imus(STIM300, NATIVE)
        summary = self.folder / "summary.json"
        run("imud", "replay", config, FLIGHT, "--seeds", "8..12", "--jobs", 3, "--summary", summary, "-q")
        for seed in 8, 12:
            ports = [f"--set=imu.{name}.port=file:{self.folder}/{name}.bin" for name in "ab"]
            run("imud", "replay", config, FLIGHT, f"--set=seed={seed}", *ports, "-q")
            for name in "ab":
                self.assertEqual((self.folder / f"{name}_{seed:02}.bin").read_bytes(),
                                 (self.folder / f"{name}.bin").read_bytes(), (name, seed))
        self.assertNotEqual((self.folder / "b_08.bin").read_bytes(), (self.folder / "b_09.bin").read_bytes())
        written = json.loads(summary.read_text())
        self.assertEqual([entry["seed"] for entry in written["seeds"]], [8, 9, 10, 11, 12])
        self.assertEqual((written["exit_code"], written["complete"], written["ended_by"]), (0, True, "end_of_capture"))
        self.assertEqual([imu["samples"] for imu in written["seeds"][2]["imus"]], [20001, 2001])

    def short_flight(self):
        """Writes a capture of a second."""
        capture = self.folder / "truth.csv"
        rows = ["time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z"]
        rows += [f"{i}0000000,0,0,{i}e-4,0,0,0.04" for i in range(101)]
        capture.write_text("\n".join(rows) + "\n")
        return capture

    def of_csv(self, config):
        config.write_text(config.read_text().replace(FLIGHT, "x.pcap").replace("jsbsim", "csv"))
        return config

    def test_seeds_that_run_together_have_the_bytes_of_seeds_one_by_one(self):
        """With one job four seeds run together, with three jobs three, and the last two."""
        config, capture = self.of_csv(self.imus(STIM300, NATIVE)), self.short_flight()
        alone, summary = self.folder / "alone", self.folder / "summary.json"
        alone.mkdir()
        for seed in range(8, 46):
            ports = [f"--set=imu.{name}.port=file:{alone}/{name}_{seed:02}.bin" for name in "ab"]
            run("imud", "replay", config, capture, f"--set=seed={seed}", *ports, "-q")
        self.assertEqual(len({file.read_bytes() for file in alone.iterdir()}), 2 * 38)
        for jobs in 1, 3:
            arguments = "replay", config, capture, "--seeds", "8..45", "--jobs", jobs, "-q"
            run("imud", *arguments, "--summary", summary)
            for file in alone.iterdir():
                self.assertEqual((self.folder / file.name).read_bytes(), file.read_bytes(), (jobs, file.name))
                (self.folder / file.name).unlink()
            written = json.loads(summary.read_text())["seeds"]
            self.assertEqual([entry["seed"] for entry in written], list(range(8, 46)))
            self.assertEqual([[imu["samples"] for imu in entry["imus"]] for entry in written], [[2001, 201]] * 38)
            run("imud", *arguments, "--npy", self.folder / "{imu}.npy")
            for name, protocol in ("a", "stim300"), ("b", "native"):
                array = numpy.load(self.folder / f"{name}.npy")
                self.assertEqual(len(array), 38)
                for seed in range(8, 46):
                    run("imu-decode", protocol, f"file:{alone}/{name}_{seed:02}.bin", "--quiet", "--npy",
                        self.folder / "one.npy")
                    self.assertEqual(numpy.load(self.folder / "one.npy").tobytes(), array[seed - 8].tobytes(),
                                     (jobs, name, seed))

    def test_imus_of_one_replay_have_processes_of_their_own(self):
        config = self.imus(STIM300, NATIVE)
        ports = [f"--set=imu.{name}.port=file:{self.folder}/{name}.bin" for name in "ab"]
        run("imud", "replay", config, FLIGHT, "--jobs", 2, "--summary", self.folder / "s.json", *ports, "-q")
        together = [(self.folder / f"{name}.bin").read_bytes() for name in "ab"]
        run("imud", "replay", config, FLIGHT, *ports, "-q")
        self.assertEqual([(self.folder / f"{name}.bin").read_bytes() for name in "ab"], together)
        seeds = json.loads((self.folder / "s.json").read_text())["seeds"]
        self.assertEqual([seed["seed"] for seed in seeds], [7])
        self.assertEqual({imu["name"]: imu["samples"] for imu in seeds[0]["imus"]}, {"a": 20001, "b": 2001})

    def test_an_array_has_what_the_files_have(self):
        config = self.imus(STIM300, NATIVE)
        npy = self.folder / "{imu}.npy"
        run("imud", "replay", config, FLIGHT, "--seeds", "1..3", "--npy", npy, "-q")
        run("imud", "replay", config, FLIGHT, "--seeds", "1..3", "-q")
        for name, protocol in ("a", "stim300"), ("b", "native"):
            array = numpy.load(self.folder / f"{name}.npy", mmap_mode="r")
            truth = numpy.load(self.folder / f"{name}_truth.npy", mmap_mode="r")
            self.assertEqual(truth.shape, array.shape[1:])
            for seed in 1, 2, 3:
                run("imu-decode", protocol, f"file:{self.folder}/{name}_{seed}.bin", "--quiet", "--npy",
                    self.folder / "one.npy")
                one = numpy.load(self.folder / "one.npy")
                self.assertEqual(one.dtype, array.dtype)
                self.assertEqual(one.tobytes(), array[seed - 1].tobytes(), (name, seed))
        # The mean of the errors of the seeds is near 0 beside their size.
        error = array["gyro"] - truth["true_gyro"]
        self.assertEqual(error.shape, (3, 2001, 3))
        self.assertLess(abs(error).max(), 0.02)
        self.assertGreater(abs(error).max(), 1e-4)

    def test_a_sensor_without_errors_sends_the_truth(self):
        """Of every product, decimated, without time or with a start-up: half an LSB, or what float32 has."""
        native = "rate_hz = 200\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 200\n"
        products = {  # table, half an LSB of rate and specific force, at least so many measurements
            "native": (native, 0, 0, 2001), "csv": (native, 0, 0, 2001), "stim300": ("", 5.4e-7, 1e-5, 9800),
            "mip": ("", 1e-9, 6e-7, 1001), "vectornav": ("", 5.1e-7, 5.1e-4, 401),
            "j1939": ("", 6.9e-5, 5.1e-3, 970), "dronecan": ("", 2e-6, 4e-3, 1790), "sbg-can": ("", 5.1e-4, 5.1e-3, 2001),
            "xsens-can": ("", 9.8e-4, 2e-3, 1001), "native-can": (native, 1.3e-7, 4e-6, 2001),
            "bosch-mm7": ("", 4.4e-5, 6.3e-4, 990), "bosch-mm5": ("", 4.4e-5, 6.3e-4, 990),
            "canopen": (native + "device.self_start = true\n", 2.5e-4, 2e-3, 1990),
            "nos3-imu": ("device.with_requests = true\n", 2e-9, 3e-8, 2001),
            "dbc": (native, 1.8e-4, 2.5e-3, 2001), "frame": (native, 3.1e-8, 4.9e-7, 2001),
        }
        can = {"j1939", "dronecan", "sbg-can", "xsens-can", "native-can", "bosch-mm7", "bosch-mm5", "canopen", "nos3-imu",
               "dbc"}
        for protocol, (table, rate, force, least) in products.items():
            with self.subTest(protocol):
                port = "canfile:x.log" if protocol in can else "file:x.bin"
                config = self.config(f"protocol = '{protocol}'\nport = '{port}'\nmodel = 'ideal'\n{table}")
                run("imud", "replay", config, FLIGHT, "--npy", self.folder / "x.npy", "-q")
                measured = numpy.load(self.folder / "x.npy")[0]
                truth = numpy.load(self.folder / "x_truth.npy")
                self.assertGreaterEqual(len(measured), least)
                period = numpy.diff(truth["time_ns"])
                self.assertTrue((period > 0).all())
                # Increments: the error of the rate, or of a float32, over the step.
                sent_with = [numpy.s_[:], numpy.s_[:], numpy.s_[1:], numpy.s_[1:]]
                for name, bound, rows in zip(QUANTITIES, (rate, force, 5e-8, 5e-6), sent_with):
                    error = (measured[name] - truth["true_" + name])[rows]
                    carried = ~numpy.isnan(error)
                    self.assertLessEqual(abs(error[carried]).max(initial=0), bound, name)
                self.assertGreater(abs(truth["true_gyro"]).max(), 0.007)

    def test_lever_arm_and_axes_are_those_of_the_sensor(self):
        """Truth against finite differences of the increments, and at rest in the vehicle against its mounting."""
        config = self.imus(NATIVE)
        run("imud", "replay", config, FLIGHT, "--npy", self.folder / "b.npy", "-q")
        truth = numpy.load(self.folder / "b_truth.npy")
        middle = (truth["true_accel"][1:] + truth["true_accel"][:-1]) / 2
        self.assertLess(abs(truth["true_dvel"][1:] / 0.005 - middle).max(), 0.05)
        run("imud", "replay", config, FLIGHT, "--npy", self.folder / "c.npy", "-q",
            "--set=imu.b.mounting.yaw_pitch_roll_deg=[0, 0, 0]")
        body = numpy.load(self.folder / "c_truth.npy")
        yaw, pitch, roll = numpy.radians([10, 20, 30])
        c, s = numpy.cos, numpy.sin
        about_z = numpy.array([[c(yaw), s(yaw), 0], [-s(yaw), c(yaw), 0], [0, 0, 1]])
        about_y = numpy.array([[c(pitch), 0, -s(pitch)], [0, 1, 0], [s(pitch), 0, c(pitch)]])
        about_x = numpy.array([[1, 0, 0], [0, c(roll), s(roll)], [0, -s(roll), c(roll)]])
        dcm = about_x @ about_y @ about_z
        numpy.testing.assert_allclose(truth["true_accel"], body["true_accel"] @ dcm.T, atol=1e-12)

    def test_labels_have_what_was_drawn_for_each_seed(self):
        """They are those of runs with each seed; without a fault of truth, two seeds run together with one job."""
        bias = """
[[fault]]
imu = ['b', 'c']
target = 'gyro.x'
kind = 'bias'
name = 'a, b'
value_deg_per_s = {uniform = [1, 5]}
at_s = {uniform = [0.2, 0.4]}
for_s = 0.1
"""
        frozen = """
[[fault]]
target = 'truth'
kind = 'frozen'
at_s = {uniform = [0.5, 0.7]}
for_s = 0.1
"""
        config, capture = self.imus(NATIVE, NATIVE.replace("'b'", "'c'").replace("b_", "c_")), self.short_flight()
        plain = self.of_csv(config).read_text()
        labels = {suffix: self.folder / f"labels.{suffix}" for suffix in ("csv", "json")}
        for faults, count in (bias, 2), (bias + frozen, 3):
            config.write_text(plain + faults)
            expected, files = {"csv": [], "json": []}, {}
            for seed in range(8, 16):
                ports = [f"--set=imu.{name}.port=file:{self.folder}/{name}.bin" for name in "bc"]
                for suffix, file in labels.items():
                    run("imud", "replay", config, capture, "--fast", f"--set=seed={seed}", *ports, "-q",
                        "--labels", file)
                expected["csv"] += [{"seed": str(seed), **row} for row in self.rows(labels["csv"])]
                expected["json"] += [{"seed": seed, **one} for one in json.loads(labels["json"].read_text())]
                for name in "bc":
                    files[f"{name}_{seed:02}.bin"] = (self.folder / f"{name}.bin").read_bytes()
            self.assertEqual(len(expected["csv"]), 8 * count)
            self.assertEqual(len({row["parameters"] for row in expected["csv"]}), 16 + (count == 3))
            for jobs in 1, 3, 16:
                for suffix, file in labels.items():
                    run("imud", "replay", config, capture, "--seeds", "8..15", "--jobs", jobs, "-q", "--labels", file)
                    found = self.rows(file) if suffix == "csv" else json.loads(file.read_text())
                    self.assertEqual([int(one["seed"]) for one in found],
                                     [seed for seed in range(8, 16) for _ in range(count)])
                    # The imus of a seed may have run apart.
                    self.assertEqual(sorted(map(repr, found)), sorted(map(repr, expected[suffix])), (jobs, suffix))
                for name, content in files.items():
                    self.assertEqual((self.folder / name).read_bytes(), content, (jobs, name))

    @staticmethod
    def rows(path):
        with open(path, newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))

    def test_faults_name_what_would_be_right(self):
        config = self.imus(STIM300, NATIVE)
        same = f"--set=imu.*.port=file:{self.folder}/x.bin"
        for arguments, fault in [
            (["--seeds", "9..1"], "give a seed or a range of at most ten million, such as 1..1000"),
            (["--seeds", "1..9", f"--set=imu.a.port=file:{self.folder}/x.bin"], "give a name with {seed}, such as"),
            (["--seeds", "1..9", "--set=imu.a.port=pty:x"], "runs beside one another write files; give "),
            (["--seeds", "1..9", "--set=imu.a.port=file:-"], "runs beside one another write files; give "),
            (["--npy", self.folder / "x.npy"], "each imu needs a file of its own; give a name with {imu}"),
            (["--npy", self.folder / "no" / "{imu}.npy"], "No such file or directory"),
            (["--seeds", "1..9", "--labels", config], "is the file of the configuration; give another file"),
            (["--seeds", "1..9", "--require", "c.samples>1"], "there is no figure c.samples"),
            (["--seeds", "1..9", same], "imu.1.port"),
            (["--seeds", "1..9", "--summary", config], "is the file of the configuration; give another file"),
        ]:
            _, errors = run("imud", "replay", config, FLIGHT, *arguments, exit_code=2)
            self.assertIn(fault, errors)

    def test_files_of_a_single_run_are_refused(self):
        """Every option that names a file to be written, but those of many runs."""
        config = self.imus(STIM300, NATIVE)
        text, _ = run("imud", "replay", "--help")
        options = set(re.findall(r"(--[a-z-]+) FILE", text)) - {"--scenario", "--summary", "--labels", "--npy"}
        self.assertGreaterEqual(options, {"--junit", "--quality", "--record"}, text)
        for option in sorted(options):
            _, errors = run("imud", "replay", config, FLIGHT, "--seeds", "1..9", option, self.folder / "file", exit_code=2)
            self.assertIn(f"of a single run: {option}; omit them with --seeds", errors)
            self.assertFalse((self.folder / "file").exists())

    def test_a_failure_ends_all(self):
        config = self.imus(NATIVE)
        _, errors = run("imud", "replay", config, FLIGHT, "--seeds", "1..50", "-q",
                        f"--set=imu.b.port=file:{self.folder}/no/{{seed}}.bin", exit_code=1)
        self.assertRegex(errors, r"seed \d+: .*/no/\d+.bin")
        (self.folder / "b_30.bin").mkdir()
        _, errors = run("imud", "replay", config, FLIGHT, "--seeds", "1..50", "-q", exit_code=1)
        self.assertIn("seed 30: ", errors)
        self.assertEqual(list(self.folder.glob("*.incomplete")), [])

    def test_a_file_that_fails_makes_its_own_seed_incomplete(self):
        config, capture = self.of_csv(self.imus(NATIVE)), self.short_flight()
        summary = self.folder / "s.json"
        arguments = "replay", config, capture, "--seeds", "1..40", "--jobs", 1, "-q", "--summary", summary
        run("imud", *arguments)
        files = {file: file.read_bytes() for file in self.folder.glob("b_*.bin")}
        failed = self.folder / "b_13.bin"
        for file in files:
            file.unlink()
        failed.symlink_to("/dev/full")
        run("imud", *arguments, exit_code=3)
        seeds = json.loads(summary.read_text())["seeds"]
        self.assertEqual([seed["seed"] for seed in seeds if not seed["complete"]], [13])
        self.assertEqual([seed["imus"][0]["failed"] > 0 for seed in seeds], [seed == 13 for seed in range(1, 41)])
        self.assertTrue(all(file.read_bytes() == content for file, content in files.items() if file != failed))

    def test_a_full_disk_is_an_error(self):
        """A limit of the files' size is as a full disk."""
        config = self.imus(NATIVE)
        _, errors = run("imud", "replay", config, FLIGHT, "--npy", "/dev/full", "-q", exit_code=2)
        self.assertIn("imud: /dev/full: the rows of an array are written in any order; give a regular file", errors)
        for kib, name in (20, "x_truth.npy"), (230, "x.npy"):
            for seeds in [], ["--seeds", "1..3"]:
                command = [PROGRAMS / "imud", "replay", config, FLIGHT, "--npy", self.folder / "x.npy", "-q", *seeds]
                done = subprocess.run(["bash", "-c", f'ulimit -f {kib}; exec "$@"', "bash", *command],
                                      capture_output=True, text=True)
                self.assertEqual(done.returncode, 1, done.stderr)
                self.assertIn(f"imud: {self.folder}/{name}: File too large\n", done.stderr)
                self.assertNotIn("terminate", done.stderr)

    def test_a_file_that_cannot_be_replaced_loses_itself_alone(self):
        """At their end b, c and d rename their files; b_13.bin is a link to the unfinished file of c."""
        names = "b", "c", "d"
        config = self.of_csv(self.imus(*(NATIVE.replace("'b'", f"'{name}'").replace("/b_", f"/{name}_")
                                         for name in names)))
        replay = "replay", config, self.short_flight(), "-q"
        seeds = "--jobs", 1, "--seeds", "11..18"  # two of them run together
        run("imud", *replay, *seeds)
        whole = {file.name: file.read_bytes() for file in self.folder.glob("?_1?.bin")}
        self.assertEqual(len(whole), 24)
        alone = "--fast", "--set=seed=13", *(f"--set=imu.{name}.port=file:{self.folder}/{name}_13.bin"
                                             for name in names)
        for arguments, ended in (seeds, range(11, 15)), (alone, [13]):
            for file in self.folder.glob("?_1?.bin*"):
                file.unlink()
            (self.folder / "b_13.bin").symlink_to("c_13.bin.incomplete")
            _, errors = run("imud", *replay, *arguments, exit_code=1)
            prefix = "seed 13: " if arguments == seeds else ""
            self.assertIn(f"imud: {prefix}{self.folder}/c_13.bin.incomplete: another process has removed or replaced "
                          "it\n", errors)
            left = {file.name: file.read_bytes() for file in self.folder.glob("?_1?.bin")}
            self.assertEqual(left, {name: whole[name] for name in left})
            self.assertEqual(set(left), {f"{name}_{seed}.bin" for name in names for seed in ended} - {"c_13.bin"})

    def test_incomplete_runs_and_limits_make_the_worst_exit_code(self):
        config = self.imus(NATIVE)
        run("imud", "replay", config, FLIGHT, "--seeds", "1..3", "-q", "--for", 2, "--summary", self.folder / "s.json",
            exit_code=3)
        seeds = json.loads((self.folder / "s.json").read_text())["seeds"]
        self.assertEqual([(seed["exit_code"], seed["imus"][0]["samples"]) for seed in seeds], [(3, 401)] * 3)
        run("imud", "replay", config, FLIGHT, "--seeds", "1..3", "-q", "--require", "b.samples=2001")
        run("imud", "replay", config, FLIGHT, "--seeds", "1..3", "-q", "--require", "b.samples>2001", exit_code=3)

    def test_a_damaged_capture_is_reported_as_by_a_single_run(self):
        """Refusals, remarks and the end of a stored capture are those of the capture itself."""
        capture = self.folder / "truth.csv"
        rows = ["time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z,colour"]
        rows += [f"{i}0000000,0,0,{i}e-4,0,0,0.04,1" for i in range(100)]
        rows[20], rows[40], rows[60] = "x,0,0,0,0,0,0,1", rows[10], "1,2"
        capture.write_text("\n".join(rows) + "\n123,0")
        config = self.of_csv(self.imus(NATIVE))
        arguments = "replay", config, capture, "-q", "--summary", self.folder / "s.json"
        run("imud", *arguments, f"--set=imu.b.port=file:{self.folder}/x", exit_code=3)
        alone = json.loads((self.folder / "s.json").read_text())
        run("imud", *arguments, "--seeds", "1..9", "--jobs", 1, exit_code=3)
        stored = json.loads((self.folder / "s.json").read_text())["seeds"][6]
        self.assertGreater(len(alone["truth"]["refused"]), 2)
        self.assertGreater(len(alone["truth"]["remarks"]), 2)
        del alone["control"]  # runs of many seeds have none
        for summary in alone, stored:
            del summary["duration_s"], summary["config_sha256"], summary["truth"]["rate_hz"]
        self.assertEqual(alone, stored)
        self.assertEqual((self.folder / "x").read_bytes(), (self.folder / "b_7.bin").read_bytes())

    def test_a_capture_that_can_be_read_once(self):
        config = self.imus(NATIVE)
        flight = (SOURCE / "tests/captures/jsbsim_c172_10s.pcap").read_bytes()
        config.write_text(config.read_text().replace(f"pcap:{FLIGHT}", "udp:127.0.0.1:5140"))
        subprocess.run([PROGRAMS / "imud", "replay", config, "pcap:-", "--seeds", "1..2", "-q"], input=flight, check=True,
                       capture_output=True)
        run("imud", "replay", config, FLIGHT, "--seeds", "2..2", "-q", f"--set=imu.b.port=file:{self.folder}/x")
        self.assertEqual((self.folder / "b_2.bin").read_bytes(), (self.folder / "x").read_bytes())

    def test_a_bus_of_each_seed(self):
        config = self.config("protocol = 'sbg-can'\nport = 'canfile:" + str(self.folder) + "/{seed}.log'")
        run("imud", "replay", config, FLIGHT, "--seeds", "1..2", "-q")
        run("imud", "replay", config, FLIGHT, "--set=seed=2", "-q", f"--set=imu.0.port=canfile:{self.folder}/x.log")
        self.assertEqual((self.folder / "2.log").read_bytes(), (self.folder / "x.log").read_bytes())

    def test_a_signal_ends_all_workers(self):
        config = self.imus(STIM300)
        program = subprocess.Popen([PROGRAMS / "imud", "replay", config, FLIGHT, "--seeds", "1..3000", "--jobs", "2",
                                    "--npy", self.folder / "a.npy", "--summary", self.folder / "s.json"],
                                   stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True)
        begin = time.monotonic()
        children = pathlib.Path(f"/proc/{program.pid}/task/{program.pid}/children")
        while len(children.read_text().split()) < 2 and time.monotonic() < begin + 60:
            time.sleep(0.01)
        workers = children.read_text().split()
        self.assertEqual(len(workers), 2)
        program.send_signal(signal.SIGTERM)
        _, errors = program.communicate(timeout=60)
        self.assertEqual(program.returncode, 3, errors)
        self.assertIn("a signal ended it after", errors)
        self.assertFalse(any(os.path.exists(f"/proc/{worker}") for worker in workers))
        summary = json.loads((self.folder / "s.json").read_text())
        self.assertEqual((summary["complete"], summary["ended_by"]), (False, "signal"))


if __name__ == "__main__":
    unittest.main()
