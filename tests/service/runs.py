"""Runs of imud with control sockets in a folder of their own, for the tests of the commands that ask them.

Used by tests whose first arguments are BUILD_FOLDER SOURCE_FOLDER.
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

BUILD, SOURCE = (pathlib.Path(argument).resolve() for argument in (sys.argv.pop(1), sys.argv.pop(1)))
IMUD = str(BUILD / "imud")

CONFIGURATION = """clock = "realtime"
[truth]
port = "udp:127.0.0.1:0"
[control]
name = "{name}"
[realtime]
priority = 0
lock_memory = false
[[imu]]
protocol = "stim300"
port = "file:/dev/null"
before_first = "rest"
{more}
"""


class RunsTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.environment = {"PATH": "/usr/bin:/bin", "XDG_RUNTIME_DIR": folder.name, "LC_ALL": "C.UTF-8", "TERM": "xterm"}

    def socket(self, name):
        return self.folder / f"imud-{name}.sock"

    def start(self, name="bench", more="", words=()):
        """Starts a run, with more words of its command line, and waits until it is ready."""
        (self.folder / f"{name}.toml").write_text(CONFIGURATION.format(name=name, more=more))
        read, write = os.pipe()
        run = subprocess.Popen([IMUD, "run", f"{name}.toml", "--quiet", "--ready-fd", str(write), *words], cwd=self.folder,
                               env=self.environment, pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(write)
        self.addCleanup(lambda: (run.kill(), run.wait()))
        self.assertEqual(os.read(read, 6), b"ready\n")
        os.close(read)
        return run

    def imud(self, *words, **others):
        """Returns the exit code, and what was printed."""
        done = subprocess.run([IMUD, *words], env=self.environment, capture_output=True, text=True, timeout=120,
                              **others)
        return done.returncode, done.stdout + done.stderr
