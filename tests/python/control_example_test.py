#!/usr/bin/env python3
"""The example of emulator/control/README.md, as it stands there, with the path of this run's socket."""
import json
import socket as socket_module
import subprocess
import sys
import textwrap
import time
import unittest

from support import PROGRAMS, SOURCE, RunTest

CONFIG = """clock = "realtime"
[truth]
port = "udp:127.0.0.1:0"
[realtime]
priority = 0
lock_memory = false
[control]
socket = "{socket}"
[[imu]]
name = "imu1"
protocol = "native"
port = "file:{file}"
before_first = "rest"
rate_hz = 100
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 100
"""


def example():
    lines = (SOURCE / "emulator/control/README.md").read_text().splitlines(keepends=True)
    first = next(i for i, line in enumerate(lines) if line.startswith("    import json, socket"))
    last = next(i for i in range(first, len(lines)) if lines[i].strip() and not lines[i].startswith("    "))
    return textwrap.dedent("".join(lines[first:last]))


class ControlExample(RunTest):
    def test_it_sets_a_bias_and_receives_samples(self):
        config, socket = self.folder / "imu.toml", self.folder / "imud-bench.sock"
        config.write_text(CONFIG.format(socket=socket, file=self.folder / "imu.bin"))
        imud = subprocess.Popen([PROGRAMS / "imud", "run", config, "-q"], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        self.addCleanup(imud.wait)
        self.addCleanup(imud.terminate)
        with socket_module.socket(socket_module.AF_UNIX) as probe:
            while probe.connect_ex(str(socket)) != 0:
                self.assertIsNone(imud.poll())
                time.sleep(0.01)
        path = "/run/user/1000/imud-bench.sock"
        self.assertEqual(example().count(path), 1)
        client = subprocess.Popen([sys.executable, "-u", "-c", example().replace(path, str(socket))], stdout=subprocess.PIPE, text=True)
        self.addCleanup(client.stdout.close)
        self.addCleanup(client.wait)
        self.addCleanup(client.kill)
        applied, subscribed, samples = (client.stdout.readline() for _ in range(3))
        self.assertIn("'applied': [{'imu': 'imu1', 'sample': ", applied)
        self.assertIn("'decimate': 10", subscribed)
        params = json.loads(samples)["params"]
        # The bias of the example on a sensor without noise, at rest but for the Earth.
        self.assertAlmostEqual(params["rate"][0][0] - params["true_rate"][0][0], 0.01, places=9)


if __name__ == "__main__":
    unittest.main()
