#!/usr/bin/env python3
"""The arrays that imu-decode writes, by NumPy and h5py, which share nothing with imud."""
import os
import re
import subprocess
import time
import unittest

import h5py
import numpy

from support import FLIGHT, PROGRAMS, RunTest, run

IDEAL = "rate_hz = {rate}\nprotocol = '{protocol}'\nport = 'file:{file}'\ngyro.max_rad_per_s = 10\n" \
        "accelerometer.max_m_per_s2 = 200\n"


class Arrays(RunTest):
    def bytes_of(self, protocol, rate=1000):
        config = self.config(IDEAL.format(rate=rate, protocol=protocol, file=self.folder / "imu.bin"))
        run("imud", "replay", config, FLIGHT, "-q")
        return self.folder / "imu.bin", config

    def test_every_format_has_a_file_of_the_rows(self):
        """Also formats whose content no other test reads: a file that grows with the rows, and a fault that is named."""
        text, _ = run("imu-decode", "--help")
        formats = set(re.findall(r"(--\w+) FILE +also writes ", text)) - {"--json"}
        self.assertGreaterEqual(formats, {"--hdf5", "--mat", "--mcap", "--npy", "--ulog"}, text)
        file, _ = self.bytes_of("native")
        few = self.folder / "few.bin"
        few.write_bytes(file.read_bytes()[:124 * 100])
        for name in sorted(formats):
            sizes = []
            for rows in few, file:
                run("imu-decode", "native", f"file:{rows}", "--quiet", name, self.folder / "a")
                sizes.append((self.folder / "a").stat().st_size)
            self.assertGreater(sizes[1] - sizes[0], 9000 * 8 * 12, name)  # three vectors and more of each row
            _, errors = run("imu-decode", "native", f"file:{file}", "--quiet", name, self.folder / "no" / "a", exit_code=2)
            self.assertIn("no/a: cannot write it", errors)

    def test_npy_and_hdf5_have_the_values_of_the_csv(self):
        file, config = self.bytes_of("native")
        text, _ = run("imu-decode", "native", f"file:{file}", "--npy", self.folder / "a.npy", "--hdf5",
                      self.folder / "a.h5", "--config", config)
        rows = [line.split(",") for line in text.splitlines()[1:]]
        array = numpy.load(self.folder / "a.npy", mmap_mode="r")
        self.assertIsInstance(array, numpy.memmap)
        self.assertEqual(array.shape, (10001,))
        self.assertEqual(array.dtype.itemsize, 128)
        values = numpy.array(rows, dtype=float)
        self.assertEqual([int(row[0]) for row in rows], array["time_ns"].tolist())
        self.assertEqual([int(row[1]) for row in rows], array["counter"].tolist())
        for name, column in ("gyro", 2), ("accel", 5), ("dtheta", 8), ("dvel", 11):
            numpy.testing.assert_array_equal(array[name], values[:, column:column + 3])
        numpy.testing.assert_array_equal(array["temperature"], values[:, 14])
        numpy.testing.assert_array_equal(array["status"], values[:, 15])
        self.assertTrue((array["fields"] == 255).all())

        with h5py.File(self.folder / "a.h5") as file:
            self.assertEqual(set(file), set(array.dtype.names))
            for name in file:
                numpy.testing.assert_array_equal(file[name][:], array[name])
                self.assertEqual(file[name].maxshape[0], None)
            self.assertEqual(file["gyro"].attrs["unit"], "rad/s")
            self.assertTrue(file["dvel"].attrs["frame"].startswith("P:"))
            self.assertEqual(file.attrs["protocol"], "native")
            self.assertEqual(file.attrs["seed"], 7)
            self.assertIn("max_rad_per_s = 10.0", file.attrs["config"])
            self.assertEqual("imu-decode " + file.attrs["imud_version"] + "\n", run("imu-decode", "--version")[0])

    def test_a_quantity_that_is_not_carried_is_nan(self):
        header = "time_ns,counter," + ",".join(f"{n}_{a}" for n in ("gyro", "accel", "dtheta", "dvel") for a in "xyz")
        rows = header + ",temperature,status\n,,1,2,3,,,,,,,,,,,\n5,6,,,,,,,,,,7,8,9,10,11\n"
        run("imu-decode", "csv", "-", "--quiet", "--npy", self.folder / "a.npy", stdin=rows)
        first, second = numpy.load(self.folder / "a.npy")
        self.assertEqual(first["gyro"].tolist(), [1, 2, 3])
        for name in "accel", "dtheta", "dvel", "temperature":
            self.assertTrue(numpy.isnan(first[name]).all(), name)
        self.assertTrue(numpy.isnat(first["time_ns"].view("m8[ns]")))
        self.assertEqual((first["counter"], first["status"], first["fields"]), (2**64 - 1, 0, 4))
        self.assertEqual((second["time_ns"], second["counter"], second["status"]), (5, 6, 11))
        self.assertEqual(second["dvel"].tolist(), [7, 8, 9])
        self.assertTrue(numpy.isnan(second["gyro"]).all())

    def test_a_component_that_is_not_carried_is_nan(self):
        header = "time_ns,counter," + ",".join(f"{n}_{a}" for n in ("gyro", "accel", "dtheta", "dvel") for a in "xyz")
        (self.folder / "a.csv").write_text(header + ",temperature,status\n5,6,,,3,1,,2,,,,,,,,\n")
        run("imu-decode", "csv", f"file:{self.folder / 'a.csv'}", "--quiet", "--npy", self.folder / "a.npy")
        one, = numpy.load(self.folder / "a.npy")
        numpy.testing.assert_array_equal(one["gyro"], [numpy.nan, numpy.nan, 3])
        numpy.testing.assert_array_equal(one["accel"], [1, numpy.nan, 2])
        self.assertEqual(one["fields"], 1 | 2 | 4 | 8)

    def test_an_array_of_a_killed_program_is_whole(self):
        file, _ = self.bytes_of("native")
        fifo = self.folder / "fifo"
        os.mkfifo(fifo)
        program = subprocess.Popen([PROGRAMS / "imu-decode", "native", f"file:{fifo}", "--quiet", "--npy",
                                    self.folder / "a.npy"])
        with open(fifo, "wb") as pipe:
            pipe.write(file.read_bytes())
            pipe.flush()
            begin = time.monotonic()
            while (self.folder / "a.npy").stat().st_size < 1_000_000 and time.monotonic() < begin + 60:
                time.sleep(0.01)
            program.kill()
            program.wait()
        array = numpy.load(self.folder / "a.npy", mmap_mode="r")
        self.assertGreater(len(array), 7000)
        self.assertEqual(array["counter"].tolist(), list(range(len(array))))

    def test_a_campaign_has_the_arrays_of_its_replays(self):
        """One virtual data set for each imu, over shards that divide no axis evenly; a shard is missing, then there."""
        imus = [f"name = '{name}'\n" + IDEAL.format(rate=rate, protocol=protocol, file=self.folder / name) +
                "gyro.angle_random_walk_deg_per_rt_hr = 0.6\n" for name, rate, protocol in
                (("imu1", 20, "native"), ("imu2", 10, "hg4930"))]
        config, campaign, file = self.config(*imus), self.folder / "runs", self.folder / "a.h5"
        (self.folder / "plan.toml").write_text(f"base = 'imu.toml'\ncapture = '{FLIGHT}'\nseeds = '3..5'\nbatch = 4\narrays = 150\n[axes]\n"
                                               "'imu.imu1.gyro.bias_rad_per_s' = [0, 0.5]\n'imu.imu1.rate_hz' = [20, 10, 5]\n")
        run("imud", "campaign", "run", self.folder / "plan.toml", "--into", campaign, "--quiet")
        moved = campaign / "shards" / "000000008-000000011.jsonl"
        moved.rename(self.folder / "moved")
        _, errors = run("imud", "campaign", "collect", campaign, "--hdf5", file, exit_code=3)
        self.assertIn("the cases 8 to 11 are missing", errors)
        self.assertIn("14 of 18 cases are complete", errors)
        self.assertLess(file.stat().st_size, 100_000)  # the measurements take 691,200 bytes
        with h5py.File(file) as arrays:
            there = arrays["arrays/imu1"][...].reshape(18, 150)["counter"] != 2**64 - 1
            self.assertEqual(there.any(axis=1).tolist(), [not 8 <= case <= 11 for case in range(18)])
            self.assertTrue(numpy.isnan(arrays["arrays/imu2"][1, 0, 0]["gyro"][:, 0]).any() and numpy.isnan(arrays["arrays/imu1"][0, 2, 2]["gyro"]).all())
        (self.folder / "moved").rename(moved)
        run("imud", "campaign", "collect", campaign, "--hdf5", file)
        self.assertEqual([path.name for path in self.folder.glob("a.h5*")], ["a.h5"])
        with h5py.File(file) as arrays:
            self.assertEqual([axis.label for axis in arrays["arrays/imu1"].dims], ["imu.imu1.gyro.bias_rad_per_s", "imu.imu1.rate_hz", "seed", "row"])
            self.assertEqual(arrays["axes/1"].asstr()[:].tolist(), ["20", "10", "5"])
            self.assertEqual((arrays["axes/2"][:].tolist(), arrays["axes/2"].attrs["name"]), ([3, 4, 5], "seed"))
            self.assertEqual(arrays["arrays/imu1"].attrs["gyro.unit"], "rad/s")
            for i, bias in enumerate(("0", "0.5")):
                for k, rate in enumerate((20, 10, 5)):
                    run("imud", "replay", config, FLIGHT, "-q", "--seeds", "3..5", "--npy", self.folder / "{imu}.npy", "--set",
                        f"imu.imu1.gyro.bias_rad_per_s={bias}", "--set", f"imu.imu1.rate_hz={rate}")
                    for name in "imu1", "imu2":
                        replayed, kept = numpy.load(self.folder / f"{name}.npy"), arrays[f"arrays/{name}"][i, k]
                        self.assertEqual(kept.dtype.names, replayed.dtype.names)
                        size = min(150, replayed.shape[1])
                        self.assertEqual(kept[:, :size].tobytes(), replayed[:, :size].tobytes(), (bias, rate, name))
                        self.assertTrue((kept[:, size:]["fields"] == 0).all() and numpy.isnan(kept[:, size:]["accel"]).all())
        (campaign / "shards" / "000000004-000000007.rows").write_bytes(bytes(153_600))
        _, errors = run("imu-campaign", "collect", campaign, "--hdf5", file, exit_code=3)
        self.assertIn("000000004-000000007.jsonl has other arrays than its footer says", errors)
        with h5py.File(file) as arrays:
            self.assertTrue(numpy.isnan(arrays["arrays/imu1"][0, 1, 1]["gyro"]).all())
        _, errors = run("imu-campaign", "collect", campaign, "--hdf5", "/dev/null", exit_code=2)
        self.assertIn("--hdf5 /dev/null: arrays cannot go to a stream; give a file", errors)

    def test_faults_name_what_would_be_right(self):
        file, config = self.bytes_of("native", rate=10)
        for arguments, fault in [
            (["--npy", "-"], "-: an array cannot go to a stream; give a file"),
            (["--npy", "/dev/null"], "give a regular file"),
            (["--npy", file], "is the input; give another file"),
            (["--npy", self.folder / "no" / "a.npy"], "No such file or directory"),
            (["--hdf5", self.folder / "no" / "a.h5"], "no/a.h5: cannot write it"),
            (["--npy", self.folder / "a", "--hdf5", self.folder / "a"], "is the file of --hdf5; give another file"),
            (["--config", config], "--config: is for the attributes of --hdf5"),
        ]:
            _, errors = run("imu-decode", "native", f"file:{file}", *arguments, exit_code=2)
            self.assertIn(fault, errors)

    def test_a_full_disk_is_an_error(self):
        file, _ = self.bytes_of("native")
        command = f"ulimit -f 256; trap '' XFSZ; exec {PROGRAMS}/imu-decode native file:{file} --quiet"
        for option, name in ("--npy", "a.npy"), ("--hdf5", "a.h5"):
            done = subprocess.run(["bash", "-c", f"{command} {option} {self.folder}/{name}"], capture_output=True,
                                  text=True)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn(f"{self.folder}/{name}: ", done.stderr)
            self.assertIn("samples    10001 in", done.stderr)


if __name__ == "__main__":
    unittest.main()
