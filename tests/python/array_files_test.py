#!/usr/bin/env python3
"""Arrays of imud replay --npy: beside every fault, written aside, kept when a run fails, completed after a signal."""
import os
import signal
import subprocess
import time
import unittest

import numpy

from support import FLIGHT, PROGRAMS, RunTest, run

NATIVE = "protocol = 'native'\nrate_hz = 200\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 200\n"
IMU = "name = 'a'\nport = 'pty:{folder}/a'\nmodel = 'ideal'\n"

# Target, kind and keys of faults that act between 2 s and 4 s.
OF_SENSORS = {"gyro.bias": "value_deg_per_s = 1", "gyro.dead": "", "accelerometer.noise": "value = 1",
              "temperature.stuck": ""}
OF_MESSAGES = {"message.missing": "each = 0.5", "message.repeated": "value = 2", "message.out_of_order": "",
               "message.late": "delay_ms = 30\njitter_ms = 20", "message.batched": "period_ms = 25",
               "message.counter_stuck": "", "message.counter_jump": "value = 9", "message.invalid": "",
               "message.other_settings": "", "clock.jump": "value_s = 2", "clock.drift": "value_ppm = 100",
               "device.self_test_failed": "", "power.off": "", "power.brown_out": "per_s = 3",
               "power.boot_loader": "", "power.settings_lost": "", "wire.silence": "", "wire.disconnect": ""}
DAMAGING = {"wire.bit_errors": "value = 1e-4", "wire.byte_loss": "value = 1e-4", "wire.cut": "value = 0.1",
            "wire.checksum_wrong": "value = 0.1", "wire.garbage": "bytes_per_s = 1000", "wire.break": "",
            "wire.half_bandwidth": "value = 0.01", "wire.baud_wrong": "value = 1.1"}
OF_TRUTH = {"truth.frozen": "", "truth.lost": "", "truth.late": "", "truth.nan": ""}


def fault(name, keys):
    target, kind = name.split(".")
    duration = "" if kind == "settings_lost" else "for_s = 2\n"  # it happens at an instant
    return f"[[fault]]\ntarget = '{target}'\nkind = '{kind}'\nat_s = 2\n{duration}{keys}\n"


class ArrayFiles(RunTest):
    def arrays(self, imu, tables="", seeds=(), exit_codes=(0, 3)):
        """Returns the measurements and the truth of a replay."""
        config = self.config(IMU.format(folder=self.folder) + imu + tables)
        done = subprocess.run([PROGRAMS / "imud", "replay", config, FLIGHT, "--npy", self.folder / "x.npy", "-q", *seeds],
                              capture_output=True, text=True)
        self.assertIn(done.returncode, exit_codes, (tables, done.stderr))
        return numpy.load(self.folder / "x.npy"), numpy.load(self.folder / "x_truth.npy")

    def test_faults_of_sensors_are_errors_beside_a_truth_without_them(self):
        for name, keys in OF_SENSORS.items():
            measured, truth = self.arrays(NATIVE, fault(name, keys), ["--seeds", "4..6"])
            self.assertEqual((measured.shape, truth.shape), ((3, 2001), (2001,)), name)
            since = truth["time_ns"] - truth["time_ns"][0]
            during = (since >= 2e9) & (since < 4e9)
            error = measured["gyro"] - truth["true_gyro"]
            self.assertEqual(abs(error[:, ~during]).max(), 0, name)
            if name == "gyro.bias":
                numpy.testing.assert_allclose(error[:, during], numpy.radians(1), atol=1e-12)
            if name == "gyro.dead":
                numpy.testing.assert_array_equal(error[:, during] + truth["true_gyro"][during], 0)

    def test_faults_of_truth_are_errors_beside_the_motion(self):
        whole = self.arrays(NATIVE)[1]
        for name, keys in OF_TRUTH.items():
            _, truth = self.arrays(NATIVE, fault(name, keys))
            self.assertEqual(truth.tobytes(), whole.tobytes(), name)

    def test_each_measurement_has_its_own_truth_whatever_its_way(self):
        """Of a product with time and number, and of one without time, whose sums are those of its last message."""
        half_lsb = {NATIVE: 0, "protocol = 'stim300'\n": 5.4e-7, "protocol = 'mip'\n": 1e-9}
        for imu, bound in half_lsb.items():
            for name, keys in OF_MESSAGES.items():
                if name == "device.self_test_failed" and "mip" in imu:
                    continue
                for seeds in [], ["--seeds", "4..5", "--jobs", "1"]:
                    with self.subTest(imu=imu[:22], fault=name, seeds=len(seeds)):
                        measured, truth = self.arrays(imu, fault(name, keys), [*seeds, "--for", "5"])
                        self.assertEqual(measured.shape, truth.shape)
                        known = measured["fields"] != 0
                        self.assertGreater(known.sum(), 0.5 * known.size)
                        if name == "message.other_settings":
                            since = truth["time_ns"] - truth["time_ns"][0, 0]
                            known &= (since < 2e9) | (since > 4.1e9)
                        for quantity in "gyro", "dtheta":
                            error = (measured[quantity] - truth["true_" + quantity])[known]
                            error = error[~numpy.isnan(measured[quantity][known])]
                            # The first increments may follow samples of which nothing was sent.
                            self.assertLessEqual(numpy.isnan(error).any(axis=-1).sum() if error.ndim > 1 else 0, 40)
                            if quantity == "gyro" or name[:5] not in ("power", "clock"):
                                self.assertLessEqual(numpy.nanmax(abs(error), initial=0), max(bound, 1e-9), quantity)
                        self.assertTrue(numpy.isnan(measured["gyro"][~known & (measured["fields"] == 0)]).all())

    def test_damaged_frames_do_not_shift_the_truth(self):
        for name, keys in DAMAGING.items():
            for imu in NATIVE, "protocol = 'stim300'\n":
                with self.subTest(imu=imu[:22], fault=name):
                    measured, truth = self.arrays(imu, fault(name, keys), ["--for", "5"])
                    self.assertEqual(measured.shape, truth.shape)
                    error = abs(measured["gyro"] - truth["true_gyro"]).max(axis=-1)
                    self.assertLess((error > 1e-6).sum(), 0.02 * error.size)
                    self.assertLessEqual(error[0, -100:].max(), 5.4e-7)

    def test_imu_decode_has_the_truth_beside_a_fault(self):
        for name, keys in {**OF_MESSAGES, **OF_SENSORS}.items():
            with self.subTest(name):
                config = self.config(IMU.format(folder=self.folder).replace("pty:", "file:") + NATIVE + fault(name, keys))
                subprocess.run([PROGRAMS / "imud", "replay", config, FLIGHT, "--fast", "-q"], capture_output=True)
                run("imu-decode", "native", f"file:{self.folder}/a", "--quiet", "--npy", self.folder / "y.npy",
                    "--truth", config, FLIGHT)
                rows = numpy.load(self.folder / "y.npy")
                self.assertGreater(len(rows), 1500)
                error = abs(rows["gyro"] - rows["true_gyro"]).max(axis=-1)
                self.assertFalse(numpy.isnan(error).any())
                if name in OF_MESSAGES and name != "message.other_settings":
                    self.assertEqual(error.max(), 0)

    def test_a_run_that_fails_keeps_the_arrays_and_names_the_cause(self):
        measured, _ = self.arrays(NATIVE)
        config, before = self.folder / "imu.toml", (self.folder / "x.npy").read_bytes()
        config.write_text(config.read_text().replace(FLIGHT, "x.pcap").replace("pcap:x.pcap", "udp:127.0.0.1:9811"))
        for seeds in [], ["--seeds", "1..3"]:
            _, errors = run("imud", "replay", config, FLIGHT.split("?")[0], "--npy", self.folder / "x.npy", "-q", *seeds,
                            exit_code=1)
            self.assertRegex(errors, r"a: sends no measurement, .*datagrams to port 5140 and none to 9811")
            self.assertEqual((self.folder / "x.npy").read_bytes(), before)
            self.assertEqual(sorted(os.listdir(self.folder)), ["imu.toml", "x.npy", "x_truth.npy"])
        for path in "-", "/dev/stdout":
            _, errors = run("imud", "replay", config, FLIGHT, "--npy", path, exit_code=2)
            self.assertIn("an array cannot go to a stream; give a file", errors)

    def end_when_three_are_done(self, program, part, ended_by, are_done):
        done, end = 0, time.monotonic() + 120
        while time.monotonic() < end and program.poll() is None and done < 3:
            time.sleep(0.01)
            if part.exists():
                try:
                    done = are_done(numpy.load(part, mmap_mode="r")[:, -1]).sum()
                except (ValueError, EOFError):
                    pass
        program.send_signal(ended_by)
        return program.communicate(timeout=120)

    def test_truth_of_each_seed_is_completed_as_well(self):
        self.arrays("protocol = 'stim300'\nclock.frequency_random_walk_ppm_per_rt_hr = 50\n", "")
        measured, truth = self.folder / "x.npy", self.folder / "x_truth.npy"
        # The last of all seeds is among them.
        command = [PROGRAMS / "imud", "replay", self.folder / "imu.toml", FLIGHT, "--npy", measured, "--jobs", "2",
                   "--seeds", f"{2**64 - 40}..{2**64 - 1}", "--set", "imu.a.model=stim300"]
        subprocess.run(command, check=True, capture_output=True, timeout=120)
        whole = [path.read_bytes() for path in (measured, truth)]
        program = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, stdout=subprocess.DEVNULL)
        # Where the clock wanders, the last row of a run is spare.
        _, errors = self.end_when_three_are_done(program, self.folder / "x.npy.incomplete", signal.SIGTERM,
                                                 lambda rows: numpy.isnat(rows["time_ns"].view("M8[ns]")))
        self.assertEqual(program.returncode, 3, errors)
        array = numpy.load(self.folder / "x.npy.incomplete", mmap_mode="r")
        done = (array["fields"][:, 0] != 0).sum()
        del array
        self.assertTrue(0 < done < 40, done)
        self.assertIn(f"a signal ended it after {done} of 40 runs", errors)
        subprocess.run(command, check=True, capture_output=True, timeout=120)
        self.assertEqual([path.read_bytes() for path in (measured, truth)], whole)

    def test_an_array_that_a_signal_ends_is_completed_by_the_same_command(self):
        measured, _ = self.arrays("protocol = 'stim300'\n", fault("gyro.bias", OF_SENSORS["gyro.bias"]))
        config, part = self.folder / "imu.toml", self.folder / "x.npy.incomplete"
        before = (self.folder / "x.npy").read_bytes()
        command = ["replay", config, FLIGHT, "--npy", self.folder / "x.npy", "--seeds", "1..30", "--jobs", "2",
                   "--set", "imu.a.model=stim300"]
        for ended_by in signal.SIGTERM, signal.SIGKILL:
            program = subprocess.Popen([PROGRAMS / "imud", *map(str, command)], stderr=subprocess.PIPE, text=True,
                                       stdout=subprocess.DEVNULL, start_new_session=True)
            _, errors = self.end_when_three_are_done(program, part, ended_by, lambda rows: rows["fields"] != 0)
            self.assertEqual(program.returncode, 3 if ended_by == signal.SIGTERM else -signal.SIGKILL, errors)
            self.assertEqual((self.folder / "x.npy").read_bytes(), before)
            array = numpy.load(part, mmap_mode="r")
            self.assertEqual(array.shape, (30, measured.shape[1]))
            missing = array["fields"][:, -1] == 0
            self.assertTrue(0 < missing.sum() < 30, missing.sum())
            if ended_by == signal.SIGTERM:
                self.assertIn("x.npy.incomplete is incomplete: the same command does the runs that are missing", errors)
                self.assertTrue(numpy.isnan(array["gyro"][missing, -1]).all())
                self.assertTrue(numpy.isnat(array["time_ns"].view("M8[ns]")[missing, 0]).all())
            del array
        for other in ["--set=imu.a.phase_us=100"], ["--set=seed=9"], ["--for", "5"]:
            _, errors = run("imud", *command, *other, exit_code=2)
            self.assertIn(".incomplete: is the part of another array, of imud ", errors)
        command[command.index("1..30")] = "1..31"
        _, errors = run("imud", *command, exit_code=2)
        self.assertIn("seeds 1..30, ", errors)
        command[command.index("1..31")] = "1..30"
        _, errors = run("imud", *command)
        self.assertRegex(errors, r"[1-9]\d* of 30 runs are in the arrays already; the others follow")
        self.assertFalse(part.exists())
        completed = (self.folder / "x.npy").read_bytes(), (self.folder / "x_truth.npy").read_bytes()
        run("imud", *command)
        self.assertEqual(completed, ((self.folder / "x.npy").read_bytes(), (self.folder / "x_truth.npy").read_bytes()))


if __name__ == "__main__":
    unittest.main()
