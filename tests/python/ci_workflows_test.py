#!/usr/bin/env python3
"""The workflows for CI services: what they run after the build, by bash, with the README's configuration and capture."""
import os
import re
import shutil
import subprocess
import unittest

import yaml

from support import PROGRAMS, SOURCE, RunTest

FLIGHT = SOURCE / "tests/captures/jsbsim_c172_10s.pcap"


def steps_of_github():
    workflow = yaml.safe_load((SOURCE / "tools/ci/github.yml").read_text())
    return {step["name"]: step["run"] for step in workflow["jobs"]["imu"]["steps"] if "run" in step}


def lines_of_gitlab():
    return yaml.safe_load((SOURCE / "tools/ci/gitlab.yml").read_text())["imu"]["script"]


class Workflows(RunTest):
    def run_as_a_service_does(self, script):
        shutil.copy(FLIGHT, self.folder / "flight.pcap")
        config = re.search(r"```toml\n(# imu\.toml.*?)```", (SOURCE / "README.md").read_text(), re.S)
        (self.folder / "imu.toml").write_text(config.group(1))
        return subprocess.run(["bash", "-e", "-c", script], cwd=self.folder, capture_output=True, text=True,
                              env={**os.environ, "PATH": f"{PROGRAMS.resolve()}:{os.environ['PATH']}"})

    def check(self, script):
        done = self.run_as_a_service_does(script)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        for name in "summary.json", "junit.xml", "imu1.csv":
            self.assertGreater((self.folder / name).stat().st_size, 100, name)
        (self.folder / "flight.pcap").write_bytes(FLIGHT.read_bytes()[:500_000])
        cut = subprocess.run(["bash", "-e", "-c", script], cwd=self.folder, capture_output=True, text=True,
                             env={**os.environ, "PATH": f"{PROGRAMS.resolve()}:{os.environ['PATH']}"})
        self.assertEqual(cut.returncode, 3, "a capture that is cut short makes the job fail")

    def test_github(self):
        self.check(steps_of_github()["Replay a flight"])

    def test_gitlab(self):
        lines = lines_of_gitlab()
        begin = next(i for i, line in enumerate(lines) if line.startswith("imud check"))
        self.check("\n".join(lines[begin:]))

    def test_both_build_and_run_the_same(self):
        github = "\n".join(steps_of_github().values()).replace(" \\\n  ", " ")
        for line in lines_of_gitlab():
            if not line.startswith("export"):
                self.assertIn(re.sub(r"\s+", " ", line), re.sub(r"\s+", " ", github))


if __name__ == "__main__":
    unittest.main()
