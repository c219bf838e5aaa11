#!/usr/bin/env python3
"""tools/with-vcan --keep: commands share a guest and its bus, and leave nothing behind.

Its argument is with-vcan.
"""
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

WITH_VCAN = sys.argv.pop()
LIMIT_S = 300  # only a test that fails waits so long


class KeptGuest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.environment = os.environ | {"TMPDIR": folder.name, "WITH_VCAN": "uml", "WITH_VCAN_VERBOSE": "1"}
        self.kept = pathlib.Path(folder.name) / f"with-vcan-kept.{os.geteuid()}"
        self.addCleanup(self.run_script, "--end")

    def run_script(self, *arguments, **options):
        return subprocess.run([WITH_VCAN, *arguments], env=self.environment, capture_output=True, text=True,
                              stdin=subprocess.DEVNULL, timeout=LIMIT_S, **options)

    def start(self, *arguments):
        program = subprocess.Popen([WITH_VCAN, "--keep", *arguments], env=self.environment, stdin=subprocess.DEVNULL,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(program.kill)
        return program

    def test_commands_share_one_guest_and_its_bus(self):
        first = self.run_script("--keep", "sh", "-c", "echo out; echo err >&2; cat; umask; pwd; exit 7", cwd="/usr",
                                umask=0o27)
        self.assertEqual((first.returncode, first.stdout), (7, "out\n0027\n/usr\n"))
        self.assertEqual(first.stderr, "with-vcan: using a guest that is kept\nerr\n")

        host = self.start("sh", "-c", "candump -n 2 vcan0 & until grep -q vcan0 /proc/net/can/rcvlist_all; "
                          "do sleep 0.1; done; echo listens; wait")
        self.assertEqual(host.stdout.readline(), "listens\n")
        frames = [self.run_script("--keep", "cansend", "vcan0", frame) for frame in ("123#11", "124#2233")]
        self.assertEqual([(one.returncode, one.stderr) for one in frames], [(0, "")] * 2)  # no second guest
        output, errors = host.communicate(timeout=LIMIT_S)
        self.assertEqual([line.split() for line in output.splitlines()],
                         [["vcan0", "123", "[1]", "11"], ["vcan0", "124", "[2]", "22", "33"]], errors)
        self.assertEqual(host.returncode, 0)

        self.assertEqual(self.run_script("--keep", "/nowhere").returncode, 127)
        pieces = self.run_script("--keep", "seq", "100000")
        self.assertEqual(pieces.stdout, "".join(f"{i}\n" for i in range(1, 100001)))

        # A signal reaches the command in the guest.
        host = self.start("sh", "-c", "trap 'echo caught; exit 3' TERM; echo waits; while :; do sleep 0.1; done")
        self.assertEqual(host.stdout.readline(), "waits\n")
        host.send_signal(signal.SIGTERM)
        self.assertEqual((host.communicate(timeout=LIMIT_S)[0], host.returncode), ("caught\n", 3))

        self.assertEqual([one.name for one in self.kept.glob("job.*")], [])
        self.assertEqual(self.run_script("--end").returncode, 0)
        self.assertFalse(self.kept.exists())

    def test_a_guest_that_nobody_uses_ends(self):
        self.environment["WITH_VCAN_IDLE"] = "2"
        first = self.run_script("--keep", "true")
        self.assertEqual(first.returncode, 0, first.stderr)
        deadline = time.monotonic() + LIMIT_S
        while subprocess.run(["flock", "-n", self.kept / "lock", "true"], check=False).returncode != 0:
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.1)
        again = self.run_script("--keep", "true")
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertIn("with-vcan: using a guest that is kept\n", again.stderr)
        self.environment["WITH_VCAN_IDLE"] = "x"
        self.assertEqual(self.run_script("--keep", "true").returncode, 125)


if __name__ == "__main__":
    unittest.main()
