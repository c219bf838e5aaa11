"""imud@.service under systemd, which runs as process 1 of namespaces of its own, with a journal; and that of a user under `systemd --user`.

usage: systemd_test.py BUILD_FOLDER SOURCE_FOLDER

Needs root, systemd and a kernel that has cgroup2; otherwise nothing is tested, and the exit code is 77. /etc, /var and /usr/local are
overlays, /run is empty: nothing of it stays. The units of Debian that a start needs are stand-ins without work.
"""
import atexit
import json
import os
import pathlib
import random
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import termios
import time
import tty
import unittest

BUILD, SOURCE = (pathlib.Path(argument).resolve() for argument in (sys.argv.pop(1), sys.argv.pop(1)))
SYSTEM = SOURCE / "tools/packaging/system"
LIMIT_S = 60  # only a test that fails waits so long

BOOT = """set -e
mount --make-rprivate /
mount -t proc proc /proc
umount -l /sys/fs/cgroup
mount -t cgroup2 cgroup2 /sys/fs/cgroup
mount -t tmpfs tmpfs /run
for d in etc var usr/local; do
  mkdir -p /run/overlay/$d/upper /run/overlay/$d/work
  mount -t overlay overlay -o lowerdir=/$d,upperdir=/run/overlay/$d/upper,workdir=/run/overlay/$d/work /$d
done
mkdir -p /run/systemd/system /etc/imud /usr/local/bin
cp "$1/imud" /usr/local/bin/
cp "$2"/units/* "$3/imud@.service" /run/systemd/system/
systemd-sysusers "$3/sysusers.conf"
systemd-sysusers --inline 'u bench - "a user"'
mkdir -p /run/bench/units /run/bench/.config/imud
cp "$2"/units/basic.target "$2"/units/shutdown.target /run/bench/units/
cp "$2"/units/multi-user.target /run/bench/units/default.target
sed '/^Wants=/d' -i /run/bench/units/default.target
cp "$3/imud-user@.service" /run/bench/units/imud@.service
chown -R bench:bench /run/bench
systemd-tmpfiles --create "$3/tmpfiles.conf"
# As the package for Debian 13 has them (debian/rules).
[ "$4" -lt 253 ] || sed -i 's/^Type=notify$/Type=notify-reload/' /run/systemd/system/imud@.service /run/bench/units/imud@.service
export container=test SYSTEMD_UNIT_PATH=/run/systemd/system
exec /lib/systemd/systemd --system --unit=multi-user.target --log-target=journal --show-status=no
"""
STAND_INS = ("sysinit.target", "basic.target", "network.target", "multi-user.target", "shutdown.target", "umount.target",
             "sockets.target", "syslog.socket")
# What user@.service of systemd does, without PAM and logind.
USERS_MANAGER = """[Unit]
DefaultDependencies=no
[Service]
Type=notify
User=bench
Delegate=yes
Environment=HOME=/run/bench XDG_RUNTIME_DIR=/run/bench SYSTEMD_UNIT_PATH=/run/bench/units
ExecStart=/lib/systemd/systemd --user --log-target=journal
# The manager exits at once; SIGTERM would have it start a target for that.
KillSignal=SIGRTMIN+24
KillMode=mixed
"""
CONFIGURATION = """[truth]
port = "udp:127.0.0.1:0"
[[imu]]
protocol = "stim300"
port = "pty:{folder}/imu1"
gyro.bias_rad_per_s = [{bias}, 0, 0]
"""


class Missing(Exception):
    """This machine cannot have a systemd in namespaces."""


class Namespaces:
    """A systemd that has booted. Throws Missing."""

    def __init__(self):
        mounts = [line.split() for line in pathlib.Path("/proc/mounts").read_text().splitlines()]
        self.cgroup = pathlib.Path(next((mount[1] for mount in mounts if mount[2] == "cgroup2"), "/nowhere"), f"imud-test-{os.getpid()}")
        if os.geteuid() != 0 or not shutil.which("systemctl"):
            raise Missing("needs root, and systemd")
        try:
            self.cgroup.mkdir()
        except OSError as why:
            raise Missing(f"no cgroup2: {why}") from why
        self.process = None
        self.folder = pathlib.Path(tempfile.mkdtemp())
        (self.folder / "units").mkdir()
        for name in STAND_INS:
            (self.folder / "units" / name).write_text("[Unit]\nDescription=stand-in\nDefaultDependencies=no\n"
                                                      + ("[Socket]\nListenDatagram=/run/none\n" if name.endswith("socket") else ""))
        (self.folder / "units/multi-user.target").write_text("[Unit]\nDescription=all\nDefaultDependencies=no\n"
                                                             "Wants=systemd-journald.service\n")
        (self.folder / "units/manager.service").write_text(USERS_MANAGER)
        for name in ("systemd-journald.service", "systemd-journald.socket", "systemd-journald-dev-log.socket"):
            shutil.copy(f"/lib/systemd/system/{name}", self.folder / "units")
        version = subprocess.run(["systemctl", "--version"], capture_output=True, text=True).stdout.split()[1]
        atexit.register(self.end)
        command = ["setpriv", "--pdeathsig", "KILL", "unshare", "--mount", "--pid", "--fork", "--ipc", "--uts", "--cgroup", "--kill-child", "bash", "-c", BOOT, "boot",
                   BUILD, self.folder, SYSTEM, version]
        self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                        preexec_fn=lambda: (self.cgroup / "cgroup.procs").write_text(str(os.getpid())))
        end = time.monotonic() + LIMIT_S
        while self.run("systemctl", "is-active", "multi-user.target", "systemd-journald.service")[1] != "active\nactive\n":
            if self.process.poll() is not None or time.monotonic() > end:
                self.process.kill()
                raise AssertionError("systemd has not started: " + self.process.communicate()[0].decode(errors="replace"))
            time.sleep(0.1)

    def first(self):
        """The process 1 of the namespaces, by its number outside; 0: there is none yet."""
        text = pathlib.Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text()
        return int(text.split()[0]) if text else 0

    def run(self, *words):
        """Runs a command beside systemd. Returns the exit code, and what was printed."""
        if not self.first():
            return 1, ""
        done = subprocess.run(["nsenter", "--target", str(self.first()), "--mount", "--pid", "--ipc", "--uts", "--cgroup", *words],
                              capture_output=True, text=True, env={"PATH": "/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin"})
        return done.returncode, done.stdout + done.stderr

    def end(self):
        if self.process:
            self.process.kill()
            self.process.communicate()
        for _ in range(100):  # the kernel ends what was in it
            for path in sorted(self.cgroup.rglob("*"), reverse=True):
                if path.is_dir():
                    try:
                        path.rmdir()
                    except OSError:
                        pass
            try:
                self.cgroup.rmdir()
                break
            except OSError:
                time.sleep(0.1)
        shutil.rmtree(self.folder)


class SystemdTest(unittest.TestCase):
    system = None

    def run_all(self, *words):
        code, text = self.system.run(*words)
        self.assertEqual(code, 0, f"{words}: {text}\n{self.system.run('journalctl', '-n', '30', '--no-pager')[1]}")
        return text

    def write(self, bias, path="/etc/imud/bench.toml", folder="/run/imud"):
        self.run_all("sh", "-c", 'printf "%s" "$0" > $1', CONFIGURATION.format(bias=bias, folder=folder), path)

    def shown(self, key):
        return self.run_all("systemctl", "show", "--value", "-p", key, "imud@bench").strip()

    def wait_until(self, is_so):
        end = time.monotonic() + LIMIT_S
        while not is_so():
            self.assertLess(time.monotonic(), end, self.system.run("systemctl", "status", "imud@bench")[1])
            time.sleep(0.02)

    def start(self):
        self.write(0.01)
        self.run_all("systemctl", "restart", "imud@bench")
        self.addCleanup(self.run_all, "systemctl", "stop", "imud@bench")

    def test_start_status_and_stop(self):
        self.start()
        self.assertEqual(self.shown("ActiveState"), "active")
        status = json.loads(self.run_all("imud", "status", "--json"))["runs"]
        self.assertEqual([(run["name"], run["state"], run["config"]) for run in status],
                         [("bench", "running", "/etc/imud/bench.toml")])
        self.assertEqual(self.run_all("ps", "-o", "user=", "-p", self.shown("MainPID")).strip(), "imud")
        self.assertEqual(self.run_all("stat", "-c", "%U", "/var/lib/imud").strip(), "imud")
        self.run_all("systemctl", "stop", "imud@bench")
        self.assertEqual((self.shown("ActiveState"), self.shown("Result")), ("inactive", "success"))

    def test_reload(self):
        self.start()
        process = self.shown("MainPID")
        self.write('"much"')
        self.assertNotEqual(self.system.run("systemctl", "reload", "imud@bench")[0], 0)
        self.assertEqual((self.shown("ActiveState"), self.shown("MainPID")), ("active", process))
        self.assertIn("bias_rad_per_s", self.run_all("journalctl", "-u", "imud@bench"))
        self.write(0.0234567)
        self.run_all("systemctl", "reload", "imud@bench")
        self.assertEqual(self.shown("MainPID"), process)
        self.assertIn("0.0234567", self.run_all("journalctl", "-u", "imud@bench"))

    def by_user(self, *words):
        """Runs a command as the user who has a manager. Returns the exit code, and what was printed."""
        return self.system.run("setpriv", "--reuid=bench", "--regid=bench", "--init-groups", "env", "HOME=/run/bench", "XDG_RUNTIME_DIR=/run/bench",
                               *words)

    def test_the_unit_of_a_user(self):
        def all_by_user(*words):
            code, text = self.by_user(*words)
            self.assertEqual(code, 0, f"{words}: {text}\n{self.system.run('journalctl', '-n', '30', '--no-pager')[1]}")
            return text

        def shown(key):
            return all_by_user("systemctl", "--user", "show", "--value", "-p", key, "imud@bench").strip()

        path = "/run/bench/.config/imud/bench.toml"
        self.write(0.01, path, "/run/bench")
        self.run_all("systemctl", "start", "manager.service")
        self.addCleanup(self.run_all, "systemctl", "stop", "manager.service")
        all_by_user("systemctl", "--user", "start", "imud@bench")
        process = shown("MainPID")
        self.assertEqual(shown("ActiveState"), "active")
        self.assertEqual(self.run_all("ps", "-o", "user=", "-p", process).strip(), "bench")
        status = json.loads(all_by_user("imud", "status", "--json"))["runs"]
        self.assertEqual([(run["name"], run["state"], run["config"], run["pid"]) for run in status], [("bench", "running", path, int(process))])
        self.write('"much"', path, "/run/bench")
        self.assertNotEqual(self.by_user("systemctl", "--user", "reload", "imud@bench")[0], 0)
        self.write(0.0234567, path, "/run/bench")
        all_by_user("systemctl", "--user", "reload", "imud@bench")
        self.assertEqual((shown("ActiveState"), shown("MainPID")), ("active", process))
        self.assertIn("0.0234567", self.run_all("journalctl", "-o", "cat", f"_PID={process}"))
        all_by_user("systemctl", "--user", "kill", "--signal=KILL", "imud@bench")
        self.wait_until(lambda: shown("ActiveState") == "active" and shown("MainPID") not in ("0", process))
        all_by_user("systemctl", "--user", "stop", "imud@bench")
        self.assertEqual((shown("ActiveState"), shown("Result")), ("inactive", "success"))

    def test_a_wrong_file_is_not_started_again(self):
        self.write('"much"')
        self.assertNotEqual(self.system.run("systemctl", "restart", "imud@bench")[0], 0)
        self.assertEqual((self.shown("ActiveState"), self.shown("ExecMainStatus")), ("failed", "2"))

    def test_the_journal_filters_by_imu(self):
        self.start()
        self.wait_until(lambda: "errors of the model" in self.system.run("journalctl", "-u", "imud@bench", "IMU=imu1")[1])
        entries = [json.loads(line) for line in self.run_all("journalctl", "-u", "imud@bench", "-o", "json", "IMU=imu1").splitlines()]
        self.assertTrue(all(entry["IMU"] == "imu1" and entry["SYSLOG_IDENTIFIER"] == "imud" for entry in entries))
        self.assertIn("6", {entry["PRIORITY"] for entry in entries})
        everything = self.run_all("journalctl", "-u", "imud@bench", "-o", "cat")
        self.assertIn("ready, truth.port is", everything)
        self.assertNotIn("<6>", everything)

    def test_twenty_kills_at_random_moments(self):
        """With a pty that `imud pty` holds, whose reader goes on."""
        keeper = subprocess.Popen(["nsenter", "--target", str(self.system.first()), "--mount", "--pid", "--ipc", "setpriv", "--reuid=imud",
                                   "--regid=imud", "--init-groups", "/usr/local/bin/imud", "pty", "/run/imud/imu1"], stdout=subprocess.PIPE,
                                  text=True, start_new_session=True)
        self.addCleanup(lambda: (os.killpg(keeper.pid, signal.SIGKILL), keeper.communicate()))
        slave = re.search(r"as (\S+)", keeper.stdout.readline()).group(1)
        self.start()
        reader = os.open(slave, os.O_RDWR | os.O_NOCTTY)
        self.addCleanup(os.close, reader)
        tty.setraw(reader)
        draw = random.Random(20)
        longest_s = 0
        for number in range(20):
            process = self.shown("MainPID")
            self.run_all("systemctl", "kill", "--signal=KILL", "imud@bench")
            begin = time.monotonic()
            self.wait_until(lambda: self.shown("ActiveState") == "active" and self.shown("MainPID") not in ("0", process))
            longest_s = max(longest_s, time.monotonic() - begin)
            termios.tcflush(reader, termios.TCIFLUSH)  # what came from the run before
            self.assertTrue(select.select([reader], [], [], LIMIT_S)[0], number)
            self.assertGreater(len(os.read(reader, 4096)), 0)
            time.sleep(draw.uniform(0, 0.2))
        self.assertGreaterEqual(int(self.shown("NRestarts")), 20)
        print(f"the longest restart took {longest_s:.2f} s", file=sys.stderr)

    def test_the_watchdog_ends_a_run_that_stands_still(self):
        self.run_all("sh", "-c", "mkdir -p /run/systemd/system/imud@bench.service.d && printf '[Service]\\nWatchdogSec=5\\nTimeoutAbortSec=1\\n'"
                     " > /run/systemd/system/imud@bench.service.d/test.conf && systemctl daemon-reload")
        self.addCleanup(self.run_all, "sh", "-c", "rm -r /run/systemd/system/imud@bench.service.d && systemctl daemon-reload")
        self.start()
        process = self.shown("MainPID")
        self.run_all("kill", "-STOP", process)
        self.wait_until(lambda: self.shown("MainPID") not in ("0", process) and self.shown("ActiveState") == "active")
        self.assertIn("Watchdog timeout", self.run_all("journalctl", "-u", "imud@bench", "-o", "cat"))


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: os.kill(os.getpid(), signal.SIGINT))
    try:
        SystemdTest.system = Namespaces()
    except Missing as why:
        print(f"nothing is tested: {why}")
        sys.exit(77)
    unittest.main()
