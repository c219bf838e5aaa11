"""Runs the built programs for the tests of this folder: the first argument is the folder of the programs."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

PROGRAMS = pathlib.Path(sys.argv.pop(1))
SOURCE = pathlib.Path(__file__).resolve().parents[2]
FLIGHT = f"{SOURCE}/tests/captures/jsbsim_c172_10s.pcap?port=5140"

# A flight of ten seconds.
CONFIG = """seed = 7
clock = "fast"
[truth]
port = "pcap:{flight}"
format = "jsbsim"
"""


def run(name, *arguments, exit_code=0, stdin=None):
    """Returns the standard output and the standard error of a program, whose exit code must be that one."""
    done = subprocess.run([PROGRAMS / name, *map(str, arguments)], capture_output=True, text=True, input=stdin)
    if done.returncode != exit_code:
        raise AssertionError(f"{name} {arguments}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout, done.stderr


class RunTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def config(self, *imus, name="imu.toml"):
        """Writes a configuration with these tables of imus, and returns its path."""
        path = self.folder / name
        path.write_text(CONFIG.replace("{flight}", FLIGHT) + "".join(f"[[imu]]\n{imu}\n" for imu in imus))
        return path
