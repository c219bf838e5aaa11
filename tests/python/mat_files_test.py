#!/usr/bin/env python3
"""The MAT-files that imu-decode writes, by SciPy, which shares nothing with libmatio."""
import subprocess
import unittest

import numpy
import scipy.io

from support import FLIGHT, PROGRAMS, RunTest, run

IDEAL = "rate_hz = 1000\nprotocol = 'native'\nport = 'file:{file}'\ngyro.max_rad_per_s = 10\n" \
        "accelerometer.max_m_per_s2 = 200\n"


class MatFiles(RunTest):
    def flight(self):
        file = self.folder / "imu.bin"
        config = self.config(IDEAL.format(file=file))
        run("imud", "replay", config, FLIGHT, "-q")
        return file, config

    def decode(self, *arguments):
        run("imu-decode", *arguments, "--quiet", "--npy", self.folder / "a.npy", "--mat", self.folder / "a.mat")
        return numpy.load(self.folder / "a.npy"), scipy.io.loadmat(self.folder / "a.mat")

    def test_it_has_the_values_of_the_array(self):
        file, config = self.flight()
        array, mat = self.decode("native", f"file:{file}", "--truth", config, FLIGHT)
        self.assertEqual({name for name in mat if not name.startswith("__")}, {"imud", *array.dtype.names})
        self.assertEqual(array.shape, (10001,))
        for name in array.dtype.names:
            self.assertEqual(mat[name].shape, (10001, 3 if array[name].ndim == 2 else 1), name)
            self.assertEqual(mat[name].dtype.str, array[name].dtype.str, name)
            numpy.testing.assert_array_equal(mat[name].reshape(array[name].shape), array[name])
        about = mat["imud"][0, 0]
        self.assertEqual(about["unit"][0, 0]["gyro"][0], "rad/s")
        self.assertTrue(about["frame"][0, 0]["dvel"][0].startswith("P:"))
        self.assertEqual(about["protocol"][0], "native")
        self.assertEqual(about["seed"][0, 0], 7)
        self.assertIn("max_rad_per_s = 10.0", about["config"][0])
        self.assertTrue(mat["__header__"].startswith(b"MATLAB 5.0 MAT-file, written by imud "))

    def test_the_same_measurements_give_the_same_bytes(self):
        file, _ = self.flight()
        for name in "a.mat", "b.mat":
            run("imu-decode", "native", f"file:{file}", "--quiet", "--mat", self.folder / name)
        self.assertEqual((self.folder / "a.mat").read_bytes(), (self.folder / "b.mat").read_bytes())

    def test_names_in_other_letters_stay(self):
        file = self.folder / "Prüfstand ü.csv"
        header = "time_ns,counter," + ",".join(f"{n}_{a}" for n in ("gyro", "accel", "dtheta", "dvel") for a in "xyz")
        file.write_text(header + ",temperature,status\n,,1,2,3,,,,,,,,,,,\n")
        array, mat = self.decode("csv", f"file:{file}")
        self.assertEqual(mat["imud"][0, 0]["port"][0], f"file:{file}")
        self.assertEqual(mat["gyro"].tolist(), [[1, 2, 3]])
        self.assertTrue(numpy.isnan(mat["accel"]).all())
        self.assertEqual((mat["time_ns"][0, 0], mat["counter"][0, 0]), (array["time_ns"][0], 2**64 - 1))

    def test_a_full_disk_is_an_error(self):
        file, _ = self.flight()
        for blocks in 256, 1248:
            done = subprocess.run(["bash", "-c", f"ulimit -f {blocks}; trap '' XFSZ; exec {PROGRAMS}/imu-decode native "
                                   f"file:{file} --quiet --mat {self.folder}/a.mat"], capture_output=True, text=True)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn(f"{self.folder}/a.mat: cannot write all of it", done.stderr)
            self.assertIn("samples    10001 in", done.stderr)

    def test_a_path_that_cannot_be_written_is_named_at_once(self):
        _, errors = run("imu-decode", "csv", "file:/dev/null", "--mat", self.folder / "no" / "a.mat", exit_code=2)
        self.assertIn("no/a.mat: cannot write it: No such file or directory", errors)


if __name__ == "__main__":
    unittest.main()
