"""The commands of imud@.service, executed as systemd executes them: with its folder, its socket for notifications and its exit codes.

usage: service_test.py BUILD_FOLDER SOURCE_FOLDER

What a cgroup, a namespace or a capability does is not tested here: `tools/packaging/check` has systemd verify the unit.
"""
import os
import pathlib
import re
import shlex
import signal
import socket
import subprocess
import sys
import tempfile
import unittest

BUILD, SOURCE = (pathlib.Path(argument).resolve() for argument in (sys.argv.pop(1), sys.argv.pop(1)))
SYSTEM = SOURCE / "tools/packaging/system"
UNIT = (SYSTEM / "imud@.service").read_text()

CONFIGURATION = """[truth]
port = "udp:127.0.0.1:0"
[realtime]
priority = 0
lock_memory = false
[[imu]]
protocol = "stim300"
port = "file:/dev/null"
gyro.bias_rad_per_s = [{bias}, 0, 0]
"""


def setting(name):
    return re.search(rf"^{name}=(.*)$", UNIT, re.MULTILINE).group(1)


class ServiceTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        (self.folder / "etc").mkdir()
        (self.folder / "run").mkdir()
        self.notified = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.addCleanup(self.notified.close)
        self.notified.bind(str(self.folder / "notify"))
        self.notified.settimeout(60)

    def write(self, bias, instance="bench"):
        (self.folder / f"etc/{instance}.toml").write_text(CONFIGURATION.format(bias=bias))

    def command(self, name, instance):
        words = shlex.split(setting(name).replace("%i", instance).replace("/etc/imud", str(self.folder / "etc")))
        return [str(BUILD / words[0]), *words[1:]]

    def environment(self):
        return {"RUNTIME_DIRECTORY": str(self.folder / "run"), "NOTIFY_SOCKET": str(self.folder / "notify"), "PATH": "/usr/bin:/bin"}

    def start(self, instance="bench"):
        run = subprocess.Popen(self.command("ExecStart", instance), env=self.environment(), stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, text=True)
        self.addCleanup(lambda: (run.kill(), run.communicate()) if run.poll() is None else None)
        return run

    def reload(self, instance="bench"):
        return subprocess.run(self.command("ExecReload", instance), env=self.environment(), capture_output=True, text=True)

    def notification(self):
        return self.notified.recv(4096).decode()

    def test_start_reload_stop(self):
        self.assertEqual(setting("Type"), "notify")
        self.write(0.01)
        run = self.start()
        self.assertEqual(self.notification(), "READY=1")
        self.write(0.02)
        reloaded = self.reload()
        self.assertEqual(reloaded.returncode, 0, reloaded.stderr)
        run.terminate()
        self.assertEqual(self.notification(), "STOPPING=1")
        log, _ = run.communicate()
        self.assertEqual(run.returncode, 0, log)
        self.assertIn("0.02", log)

    def test_reload_of_a_wrong_file_fails_and_changes_nothing(self):
        self.write(0.01)
        run = self.start()
        self.assertEqual(self.notification(), "READY=1")
        self.write('"much"')
        refused = self.reload()
        self.assertNotEqual(refused.returncode, 0)
        self.assertIn("bias_rad_per_s", refused.stderr)
        self.assertIsNone(run.poll())
        # What cannot change in a run is named, and refused whole.
        self.write(0.03)
        path = self.folder / "etc/bench.toml"
        path.write_text(path.read_text().replace("stim300", "vectornav"))
        refused = self.reload()
        self.assertNotEqual(refused.returncode, 0)
        self.assertIn("imu.imu1.protocol", refused.stderr)
        run.terminate()
        log, _ = run.communicate()
        self.assertEqual(run.returncode, 0, log)
        self.assertNotIn("0.03", log)

    def test_two_instances_beside_one_another(self):
        self.write(0.01, "a")
        self.write(0.02, "b")
        runs = [self.start("a"), self.start("b")]
        self.assertEqual([self.notification(), self.notification()], ["READY=1"] * 2)
        self.write(0.04, "b")
        self.assertEqual(self.reload("b").returncode, 0)
        logs = []
        for run in runs:
            run.terminate()
            logs.append(run.communicate()[0])
            self.assertEqual(run.returncode, 0)
        self.assertEqual(["0.04" in log for log in logs], [False, True])

    def test_a_wrong_file_is_not_started_again(self):
        self.write('"much"')
        run = self.start()
        run.communicate()
        self.assertIn(str(run.returncode), setting("RestartPreventExitStatus").split())
        self.assertEqual(setting("Restart"), "on-failure")

    def test_a_failure_is_started_again(self):
        self.write(0.01)
        run = self.start()
        self.assertEqual(self.notification(), "READY=1")
        run.send_signal(signal.SIGKILL)
        run.communicate()
        self.write(0.01)
        again = self.start()
        # The socket of the one that was killed is in the way of nothing.
        self.assertEqual(self.notification(), "READY=1")
        self.assertEqual(self.reload().returncode, 0)
        again.terminate()
        again.communicate()

    def test_the_user_of_the_unit_is_made(self):
        made = re.findall(r"^u (\S+) ", (SYSTEM / "sysusers.conf").read_text(), re.MULTILINE)
        self.assertEqual(made, [setting("User")])
        self.assertEqual(setting("Group"), setting("User"))
        self.assertIn(f"/run/{setting('RuntimeDirectory')} 0755 {setting('User')} {setting('Group')} ",
                      (SYSTEM / "tmpfiles.conf").read_text())


if __name__ == "__main__":
    unittest.main()
