"""`imud help` explains every key of the reference, finds by a word, and suggests the nearest name.

usage: help_test.py IMUD
"""
import pathlib
import re
import subprocess
import sys
import unittest

IMUD = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE = pathlib.Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True
sys.path.insert(0, str(SOURCE / "tools/packaging/documents"))

from completion import keys  # noqa: E402
from roff import cells  # noqa: E402


def imud(*words):
    return subprocess.run([IMUD, *words], capture_output=True, text=True)


def plain(text):
    return re.sub(r"\[([^\]\[]*)\]\([^)]*\)", r"\1", text).replace("`", "")


class HelpTest(unittest.TestCase):
    def explained(self, *words):
        done = imud("help", *words)
        self.assertEqual(done.returncode, 0, (words, done.stderr))
        return done.stdout

    def test_every_row(self):
        """A key of each row of CONFIGURATION.md, with the text of each of its columns."""
        rows = titles = 0
        for line in (SOURCE / "emulator/CONFIGURATION.md").read_text().splitlines():
            if not line.startswith("|"):
                head = None
            elif head is None:
                head = cells(line)
                titles += 1
            elif not line.startswith("|---"):
                key, *others = cells(line)
                text = self.explained(re.findall(r"`([^`]+)`", key)[-1])
                for title, cell in zip(head[1:], others):
                    self.assertIn(f"  {title:<9} {plain(cell)}\n", text, line)
                rows += 1
        self.assertGreater(rows, 200)
        self.assertGreater(titles, 20)

    def test_every_full_name(self):
        """The names that --set takes: of each table the first and the last one, as an imu's number, name or * has it."""
        names = keys((SOURCE / "emulator/CONFIGURATION.md").read_text())
        tables = {}
        for name in names:
            tables.setdefault(name.rpartition(".")[0], []).append(name)
        self.assertGreater(len(tables), 15)
        for some in tables.values():
            for name in {some[0], some[-1]}:
                for imu in ("imu.0.", "imu.front.", "imu.*."):
                    given = re.sub(r"^imu\.0\.", imu, name)
                    first = self.explained(given).splitlines()[0]
                    self.assertEqual(first.split(" of ")[0], re.sub(r"^imu\.0\.", "imu.", name), given)

    def test_keys_of_faults(self):
        self.assertIn("fault.for_s\n  default   to the end of the run\n", self.explained("fault.for_s"))
        self.assertIn("expect.within_s\n", self.explained("within_s"))

    def test_a_commands_name_wins(self):
        for command in ("run", "check", "init", "list", "ctl"):
            self.assertEqual(self.explained(command), imud(command, "--help").stdout)
        self.assertEqual(self.explained(), imud("--help").stdout)
        self.assertEqual(self.explained("--help"), imud("--help").stdout)

    def test_a_name_of_the_list(self):
        for name in ("stim300", "vectornav", "jsbsim", "udp", "hipnuc"):
            self.assertEqual(self.explained(name), imud("list", name).stdout)

    def test_finds_by_a_word(self):
        text = self.explained("gyro")
        for found in ("keys, of which", "  imu.gyro.bias_rad_per_s ", "  imu.device.gyro_unit of stim300 "):
            self.assertIn(found, text)
        text = self.explained("CAN")
        for found in ("names that imud list explains\n", "  dronecan ", "  can "):
            self.assertIn(found, text)
        self.assertRegex(self.explained("stuck"), r"kinds of faults.*\n(  .*\n)*  stuck ")
        text = self.explained("Reader")
        for found in ("options\n", "  imud run --wait-for-reader ", "  imu.also "):
            self.assertIn(found, text)
        self.assertIn("  imud replay --seeds ", self.explained("--seeds"))
        self.assertIn("  imud campaign run --case ", self.explained("whole shards"))
        self.assertIn("  gazebo ", self.explained("gz topic"))
        self.assertIn("  imud pty ", self.explained("pseudo"))
        # A key is found by its own name where it is not the first of its row.
        self.assertIn("  imu.accelerometer.bias_m_per_s2 ", self.explained("bias_m_"))

    def test_output_that_cannot_be_written(self):
        """A full disk, and standard error that is full, too."""
        for words in (("help", "gyro"), ("help", "rate_hz"), ("check", "none.toml"), ("list",)):
            for errors in (subprocess.PIPE, open("/dev/full", "w")):
                with open("/dev/full", "w") as full:
                    done = subprocess.run([IMUD, *words], stdout=full, stderr=errors, text=True)
                self.assertIn(done.returncode, (1, 2), words)
                if errors == subprocess.PIPE:
                    self.assertRegex(done.stderr, "No space left|No such file")
                else:
                    errors.close()

    def test_suggests_the_nearest(self):
        for given, near in (("rate_hs", "rate_hz"), ("gyo", "gyro"), ("imu.gyro.bias_deg_per_sec", "imu.gyro.bias_deg_per_s"), ("stim30O", "stim300"),
                            ("selftst", "selftest"), ("gyor", "gyro")):
            done = imud("help", given)
            self.assertEqual((done.returncode, done.stdout), (2, ""))
            self.assertIn(f'did you mean "{near}"?', done.stderr)
        self.assertIn("imud list", imud("help", "qqqqqqqqqqq").stderr)


if __name__ == "__main__":
    unittest.main()
