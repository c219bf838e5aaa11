#!/usr/bin/env python3
"""Each seed has a sensor of its own: what the labels and the summary say of it, and what its samples show."""
import csv
import json
import unittest

import numpy

from support import FLIGHT, RunTest, run

RATE, FORCE = numpy.array([0.4, -0.2, 0.9]), numpy.array([1.0, 2.0, -9.0])
IMU = """name = '{name}'
rate_hz = 10
protocol = 'native'
port = 'file:unused_{name}'
gyro.max_rad_per_s = 10
gyro.unit_sigma = {{bias_deg_per_hr = 3600, scale_factor_ppm = [500, 1000, 2000], misalignment_mrad = 1}}
gyro.turn_on_bias_deg_per_s = 0.5
gyro.turn_on_sigma.scale_factor_ppm = 100
accelerometer.max_g = 10
accelerometer.unit_sigma.misalignment_mrad = [1, 0, 3]
"""
SEEDS = 400


class Units(RunTest):
    def runs(self, labels):
        """Returns the summary and the arrays of two imus that turn and are accelerated for a second."""
        truth, summary = self.folder / "truth.csv", self.folder / "summary.json"
        columns = [f"{name}_{axis}" for name in ("omega_BN_B", "nonConservativeAccelpntB_B") for axis in "xyz"]
        rows = [",".join(["time_ns", "sigma_BN_1", "sigma_BN_2", "sigma_BN_3", *columns])]
        for k in range(11):
            phi = RATE * 0.1 * k
            angle = numpy.linalg.norm(phi)
            sigma = numpy.tan(angle / 4) * phi / angle if k else phi
            rows.append(",".join(map(repr, [k * 10**8, *map(float, [*sigma, *RATE, *FORCE])])))
        truth.write_text("\n".join(rows) + "\n")
        config = self.config(*(IMU.format(name=name) for name in "ab"))
        config.write_text(config.read_text().replace(FLIGHT, "x.pcap").replace("jsbsim", "csv"))
        run("imud", "replay", config, truth, "--seeds", f"1..{SEEDS}", "--npy", self.folder / "{imu}.npy", "--summary", summary,
            "--labels", labels, "-q")
        return json.loads(summary.read_text()), {name: numpy.load(self.folder / f"{name}.npy") for name in "ab"}

    def test_its_samples_show_what_its_labels_say(self):
        labels = self.folder / "labels.json"
        summary, arrays = self.runs(labels)
        drawn = {(one["seed"], one["imu"], one["target"], one["kind"]): one["parameters"] for one in json.loads(labels.read_text())
                 if one["state"] == "drawn"}
        self.assertEqual(len(drawn), SEEDS * 2 * 3)
        scales = []
        for seed in range(1, SEEDS + 1):
            for name, imu in zip("ab", summary["seeds"][seed - 1]["imus"]):
                unit, power_on = drawn[seed, name, "gyro", "unit"], drawn[seed, name, "gyro", "turn_on"]
                force = drawn[seed, name, "accelerometer", "unit"]
                self.assertEqual(imu["drawn"], {"gyro": {"unit": unit, "turn_on": power_on}, "accelerometer": {"unit": force}})
                turned = RATE + numpy.reshape(unit["misalignment"], (3, 3)) @ RATE
                scale = 1 + numpy.array(unit["scale_factor"]) + power_on["scale_factor"]
                rate = scale * turned + unit["bias"] + power_on["bias"]
                samples = arrays[name][seed - 1]
                self.assertEqual(len(samples), 11)
                self.assertLess(abs(samples["gyro"] - rate).max(), 1e-12)
                accelerated = FORCE + numpy.reshape(force["misalignment"], (3, 3)) @ FORCE
                self.assertLess(abs(samples["accel"] - accelerated).max(), 1e-11)
                self.assertEqual(samples["accel"][0, 1], FORCE[1], "no standard deviation, no draw")
                scales.append(unit["scale_factor"])
        # 800 units: five standard errors of a standard deviation are 12.5 %, one in 3 million.
        for found, wanted in zip(numpy.std(scales, axis=0), (5e-4, 1e-3, 2e-3)):
            self.assertLess(abs(found / wanted - 1), 0.125)

    def test_the_labels_as_a_table(self):
        labels = self.folder / "labels.csv"
        summary, _ = self.runs(labels)
        with open(labels, encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len(rows), SEEDS * 2 * 3)
        row = rows[0]
        self.assertEqual((row["seed"], row["fault"], row["imu"], row["target"], row["kind"], row["state"]),
                         ("1", "", "a", "gyro", "unit", "drawn"))
        terms = dict(term.split("=") for term in row["parameters"].split(" "))
        wanted = summary["seeds"][0]["imus"][0]["drawn"]["gyro"]["unit"]
        self.assertEqual({name: [float(x) for x in values.split(",")] for name, values in terms.items()}, wanted)


if __name__ == "__main__":
    unittest.main()
