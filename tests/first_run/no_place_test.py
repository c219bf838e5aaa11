"""Truth without a place is named in the log and in the summary, once, where an imu needs a place, and nowhere else.

usage: no_place_test.py IMUD
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

IMUD = pathlib.Path(sys.argv.pop(1)).resolve()
ATTITUDE = {"lat-geod-rad": 0.5, "long-gc-rad": 0.1, "epa-rad": 0, "phi-rad": 0, "theta-rad": 0, "psi-rad": 0, "p-rad_sec": 0,
            "q-rad_sec": 0, "r-rad_sec": 0}
POSITION = {"eci-x-ft": 1.83e7, "eci-y-ft": 1.83e6, "eci-z-ft": 9.9e6}
VELOCITY = {"eci-x-fps": -133, "eci-y-fps": 1334, "eci-z-fps": 0}
FORCE = {"a-pilot-x-ft_sec2": 0, "a-pilot-y-ft_sec2": 0, "a-pilot-z-ft_sec2": -32.1}
FIELD = ", so there is no place: magnetometers measure 0"


class NoPlaceTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def replayed(self, columns, protocol="vectornav", earth="", rows=30):
        """Replays rows of a vehicle that stands still. Returns the warning of the log and the remark of the summary on places."""
        table = ["Time, " + ", ".join(columns)]
        table += [f"{i / 100}, " + ", ".join(str(value) for value in columns.values()) for i in range(rows)]
        (self.folder / "truth.txt").write_text("\n".join(table) + "\n")
        (self.folder / "imu.toml").write_text(
            f'clock = "fast"\n[truth]\nport = "file:truth.txt"\nformat = "jsbsim"\n{earth}'
            f'[[imu]]\nprotocol = "{protocol}"\nport = "file:imu.bin"\n')
        done = subprocess.run([IMUD, "run", "imu.toml", "--summary", "summary.json"], cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        remarks = json.loads((self.folder / "summary.json").read_text())["truth"].get("remarks", [])
        return ([line for line in done.stderr.splitlines() if "no place" in line], [text for text in remarks if "no place" in text])

    def test_a_velocity_is_missing(self):
        log, remarks = self.replayed({**ATTITUDE, **POSITION, **FORCE})
        self.assertEqual((len(log), len(remarks)), (1, 1))
        self.assertIn("lacks velocities/eci-x-fps, eci-y-fps, eci-z-fps" + FIELD, log[0])
        self.assertTrue(remarks[0].startswith("lacks velocities/eci-x-fps, eci-y-fps, eci-z-fps" + FIELD), remarks)

    def test_a_position_or_both_are_missing(self):
        self.assertIn("lacks position/eci-x-ft, eci-y-ft, eci-z-ft" + FIELD, self.replayed({**ATTITUDE, **VELOCITY, **FORCE})[1][0])
        self.assertIn("eci-z-ft and velocities/eci-x-fps", self.replayed({**ATTITUDE, **FORCE})[1][0])

    def test_nothing_is_missing(self):
        self.assertEqual(self.replayed({**ATTITUDE, **POSITION, **VELOCITY, **FORCE}), ([], []))

    def test_nobody_needs_it(self):
        """A unit without magnetometer, an Earth that is switched off, and truths that are too few to tell."""
        lacking = {**ATTITUDE, **POSITION, **FORCE}
        self.assertEqual(self.replayed(lacking, protocol="stim300"), ([], []))
        self.assertEqual(self.replayed(lacking, earth='[earth]\nframe = "none"\n'), ([], []))
        self.assertEqual(self.replayed(lacking, rows=9), ([], []))

    def test_the_columns_are_named_by_list(self):
        listed = subprocess.run([IMUD, "list", "jsbsim"], check=True, capture_output=True, text=True).stdout
        self.assertEqual(listed.count("for place, magnetic field, pressure and GNSS"), 2, listed)


if __name__ == "__main__":
    unittest.main()
