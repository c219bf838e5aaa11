#!/usr/bin/env python3
"""imu-decode --truth: the truth at each measurement of a replay, by time, by number and by order."""
import unittest

import h5py
import numpy

from support import FLIGHT, RunTest, run

IDEAL = "name = '{name}'\nprotocol = '{protocol}'\nport = 'file:{folder}/{name}.bin'\nmodel = '{model}'\n"
RANGE = "rate_hz = {rate}\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 200\n"


class Truth(RunTest):
    def replay(self, *imus):
        config = self.config(*(imu.replace("{folder}", str(self.folder)) for imu in imus))
        run("imud", "replay", config, FLIGHT, "-q")
        return config

    def decode(self, protocol, name, config, *arguments, exit_code=0, file=None):
        _, errors = run("imu-decode", protocol, f"file:{file or self.folder / name}.bin", "--quiet", "--npy",
                        self.folder / "a.npy", "--truth", config, FLIGHT, *arguments, exit_code=exit_code)
        return numpy.load(self.folder / "a.npy"), errors

    def imu(self, name, protocol, model="ideal", rate=None):
        return IDEAL.replace("{name}", name).format(protocol=protocol, model=model, folder="{folder}") + (
            RANGE.format(rate=rate) if rate else "")

    def test_a_sensor_without_errors_measures_the_truth(self):
        config = self.replay(self.imu("a", "native", rate=400), self.imu("b", "stim300"), self.imu("c", "mip"),
                             self.imu("d", "native", rate=250))
        # LSBs of STIM300: 2^-14 deg/s and 2^-19 g; MIP has float32.
        for name, protocol, rate, force in [("a", "native", 0, 0), ("b", "stim300", 5.4e-7, 1e-5),
                                            ("c", "mip", 1e-9, 6e-7), ("d", "native", 0, 0)]:
            array, errors = self.decode(protocol, name, config, "--imu", name, "--hdf5", self.folder / "a.h5")
            self.assertNotIn("truth ", errors)
            self.assertEqual(array.dtype.itemsize, 224)
            self.assertLessEqual(abs(array["gyro"] - array["true_gyro"]).max(), rate)
            self.assertLessEqual(abs(array["accel"] - array["true_accel"]).max(), force)
            if protocol == "native":
                numpy.testing.assert_array_equal(array["dtheta"], array["true_dtheta"])
                numpy.testing.assert_array_equal(array["dvel"], array["true_dvel"])
            with h5py.File(self.folder / "a.h5") as file:
                numpy.testing.assert_array_equal(file["true_dvel"][:], array["true_dvel"])
                self.assertIn("[[imu]]", file.attrs["config"])

    def test_lost_samples_do_not_shift_the_truth(self):
        config = self.replay(self.imu("b", "stim300", model="stim300"))
        whole, _ = self.decode("stim300", "b", config)
        data = (self.folder / "b.bin").read_bytes()
        # Some datagrams are lost, at two places, fewer than the counter has numbers.
        (self.folder / "cut.bin").write_bytes(data[:100_000] + data[102_000:200_000] + data[200_900:])
        array, errors = self.decode("stim300", "b", config, file=self.folder / "cut")
        self.assertNotIn("truth ", errors)
        self.assertGreater(len(whole) - len(array), 40)
        # The last measurement is the same, and so is its truth: bit for bit, as its increment is of its own step.
        self.assertEqual(whole[-1].tobytes(), array[-1].tobytes())
        middle = len(array) // 2
        self.assertIn(array[middle].tobytes(), [row.tobytes() for row in whole[middle:middle + 100]])

    def test_samples_of_another_run_have_no_truth(self):
        config = self.replay(self.imu("a", "native", rate=100))
        text = config.read_text()
        config.write_text(text.replace("rate_hz = 100", "rate_hz = 100\nphase_us = 1000"))
        _, errors = self.decode("native", "a", config, exit_code=1)
        self.assertIn("no sample is one of a replay of this; give the record of the run that was decoded", errors)
        config.write_text(text.replace("rate_hz = 100", "rate_hz = 50"))
        array, errors = self.decode("native", "a", config, exit_code=0)
        self.assertIn("truth      1000 samples have none, of 1001", errors)  # its time and number are one sample's
        self.assertTrue(numpy.isnan(array["true_gyro"][1:]).all())

    def test_samples_without_time_and_number_have_it_by_order(self):
        config = self.replay(self.imu("c", "mip"))
        (self.folder / "cut.bin").write_bytes((self.folder / "c.bin").read_bytes()[:-100])
        array, errors = self.decode("mip", "c", config, file=self.folder / "cut")
        self.assertRegex(errors, "truth      by order, as the samples have neither time nor number, but there are .* 1001 in")
        self.assertLess(abs(array["accel"] - array["true_accel"]).max(), 6e-7)

    def test_faults_name_what_would_be_right(self):
        config = self.replay(self.imu("a", "native", rate=100))
        for arguments, fault in [
            (["--npy", self.folder / "x", "--truth", config], "is no record of imud; --truth needs one, or a conf"),
            (["--truth", config, FLIGHT], "--truth: is for --hdf5, --mat, "),
            (["--npy", self.folder / "x", "--imu", "a"], "--imu: is for --truth"),
            (["--npy", self.folder / "x", "--truth", config, FLIGHT, "--imu", "b"],
             "has no imu b with the protocol native; there are a (native)"),
            (["--npy", self.folder / "x", "--truth", self.folder / "none.toml", FLIGHT], "none.toml"),
            (["--npy", config, "--truth", config, FLIGHT], "is the input; give another file"),
        ]:
            _, errors = run("imu-decode", "native", f"file:{self.folder}/a.bin", *arguments, exit_code=2)
            self.assertIn(fault, errors)


if __name__ == "__main__":
    unittest.main()
