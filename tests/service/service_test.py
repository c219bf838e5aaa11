"""The commands of imud@.service, executed as systemd executes them: with its folder, its socket for notifications and its exit codes.

usage: service_test.py BUILD_FOLDER SOURCE_FOLDER

What a cgroup, a namespace or a capability does is not tested here: `tools/packaging/check-packages` has systemd verify the unit.
"""
import ctypes
import os
import pathlib
import random
import re
import select
import shlex
import signal
import socket
import subprocess
import sys
import tempfile
import termios
import time
import tty
import unittest

BUILD, SOURCE = (pathlib.Path(argument).resolve() for argument in (sys.argv.pop(1), sys.argv.pop(1)))
SYSTEM = SOURCE / "tools/packaging/system"
UNIT = (SYSTEM / "imud@.service").read_text()

PTRACE_SEIZE, PTRACE_INTERRUPT = 0x4206, 0x4207
WAIT_FOR_ANY_THREAD = 0x40000000  # __WALL

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
    watchdog = {}

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
        return {**self.watchdog, "RUNTIME_DIRECTORY": str(self.folder / "run"), "NOTIFY_SOCKET": str(self.folder / "notify"), "PATH": "/usr/bin:/bin"}

    def start(self, instance="bench", options=()):
        run = subprocess.Popen([*self.command("ExecStart", instance), *options], env=self.environment(), stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, text=True)
        self.addCleanup(lambda: (run.kill(), run.communicate()) if run.poll() is None else None)
        return run

    def reload(self, instance="bench"):
        return subprocess.run(self.command("ExecReload", instance), env=self.environment(), capture_output=True, text=True)

    def notification(self):
        return self.notified.recv(4096).decode()

    def expect_reload(self, begin_us):
        """What Type=notify-reload requires (systemd.service(5)), with a time that is not before the manager's signal."""
        first, second = self.notification().split("\n")
        self.assertEqual(first, "RELOADING=1")
        self.assertRegex(second, r"^MONOTONIC_USEC=\d+$")
        self.assertLessEqual(begin_us, int(second.partition("=")[2]))
        self.assertLessEqual(int(second.partition("=")[2]), time.monotonic_ns() // 1000)
        self.assertEqual(self.notification(), "READY=1")

    def test_start_reload_stop(self):
        self.assertEqual(setting("Type"), "notify")
        self.write(0.01)
        run = self.start()
        self.assertEqual(self.notification(), "READY=1")
        self.write(0.0234567)
        begin_us = time.monotonic_ns() // 1000
        reloaded = self.reload()
        self.assertEqual(reloaded.returncode, 0, reloaded.stderr)
        self.expect_reload(begin_us)
        run.terminate()
        self.assertEqual(self.notification(), "STOPPING=1")
        log, _ = run.communicate()
        self.assertEqual(run.returncode, 0, log)
        self.assertIn("0.0234567", log)

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
        self.write(0.0345678)
        path = self.folder / "etc/bench.toml"
        path.write_text(path.read_text().replace("stim300", "vectornav"))
        refused = self.reload()
        self.assertNotEqual(refused.returncode, 0)
        self.assertIn("imu.imu1.protocol", refused.stderr)
        run.terminate()
        log, _ = run.communicate()
        self.assertEqual(run.returncode, 0, log)
        self.assertNotIn("0.0345678", log)

    def test_a_reload_by_a_signal_and_the_command_at_once(self):
        """As systemd does both for Type=notify-reload: the command waits for the reload of the signal, and fails if its file is refused."""
        self.write(0.01)
        run = self.start()
        self.assertEqual(self.notification(), "READY=1")
        for number, bias in enumerate([0.0625, 0.125, '"much"', '"more"', 0.1875, 0.25]):
            self.write(bias)
            begin_us = time.monotonic_ns() // 1000
            run.send_signal(signal.SIGHUP)
            reloaded = self.reload()
            self.assertEqual(reloaded.returncode == 0, number not in (2, 3), reloaded.stderr)
            for _ in range(2):
                self.expect_reload(begin_us)
        run.terminate()
        self.assertEqual(self.notification(), "STOPPING=1")
        log, _ = run.communicate()
        self.assertEqual(run.returncode, 0, log)
        for text in ("= [ 0.125, 0.0", "SIGHUP: reload refused", "= [ 0.25, 0.0"):
            self.assertIn(text, log)

    def test_two_instances_beside_one_another(self):
        self.write(0.01, "a")
        self.write(0.02, "b")
        runs = [self.start("a"), self.start("b")]
        self.assertEqual([self.notification(), self.notification()], ["READY=1"] * 2)
        self.write(0.0456789, "b")
        self.assertEqual(self.reload("b").returncode, 0)
        logs = []
        for run in runs:
            run.terminate()
            logs.append(run.communicate()[0])
            self.assertEqual(run.returncode, 0)
        self.assertEqual(["0.0456789" in log for log in logs], [False, True])

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

    def test_twenty_kills_at_random_moments(self):
        """Each run after a kill is ready, and who reads the pty, which `imud pty` holds, goes on with the same descriptor."""
        link = self.folder / "imu"
        keeper = subprocess.Popen([BUILD / "imud", "pty", link], env=self.environment(), stdout=subprocess.PIPE, text=True)
        self.addCleanup(lambda: (keeper.kill(), keeper.communicate()))
        self.assertIn("is held", keeper.stdout.readline())
        self.write(0.01)
        path = self.folder / "etc/bench.toml"
        path.write_text(path.read_text().replace("file:/dev/null", f"pty:{link}"))
        reader = os.open(link, os.O_RDWR | os.O_NOCTTY)
        self.addCleanup(os.close, reader)
        tty.setraw(reader)
        draw = random.Random(20)
        longest_s = 0
        for number in range(20):
            begin = time.monotonic()
            run = self.start()
            # Each fourth is killed while it starts, wherever it is then.
            if number % 4 == 3:
                time.sleep(draw.uniform(0, 0.1))
            else:
                self.assertEqual(self.notification(), "READY=1")
                longest_s = max(longest_s, time.monotonic() - begin)
                termios.tcflush(reader, termios.TCIFLUSH)  # what came from the run before
                self.assertTrue(select.select([reader], [], [], 60)[0])
                self.assertGreater(len(os.read(reader, 4096)), 0)
                time.sleep(draw.uniform(0, 0.2))
            run.kill()
            run.communicate()
            # An exit code that is started again.
            self.assertNotIn(str(run.returncode), setting("RestartPreventExitStatus").split())
            self.assertEqual(self.hang_ups(reader), 0)
            self.discard_notifications()
        print(f"the longest start after a kill took {longest_s:.2f} s", file=sys.stderr)

    def hang_ups(self, descriptor):
        waiting = select.poll()
        waiting.register(descriptor, 0)
        return sum(event & (select.POLLHUP | select.POLLERR) for _, event in waiting.poll(0))

    def discard_notifications(self):
        while select.select([self.notified], [], [], 0)[0]:
            self.notification()

    def test_figures_go_on_in_a_new_file_after_rotation(self):
        figures, rotated = self.folder / "bench.jsonl", self.folder / "bench.jsonl.1"
        self.write(0.01)
        run = self.start(options=["--quality", figures])
        self.assertEqual(self.notification(), "READY=1")

        def wait_for_figures():
            while not figures.exists() or not figures.stat().st_size:
                self.assertIsNone(run.poll())
                time.sleep(0.05)

        wait_for_figures()
        figures.rename(rotated)
        run.send_signal(signal.SIGHUP)
        wait_for_figures()
        size = rotated.stat().st_size
        run.terminate()
        run.communicate()
        self.assertEqual(rotated.stat().st_size, size)
        self.assertIn("kill --kill-whom=main --signal=HUP 'imud@*.service'", (SYSTEM / "logrotate.conf").read_text())
        self.assertEqual(setting("StateDirectory"), "imud")

    def test_the_unit_of_users_has_the_same_commands(self):
        users = (SYSTEM / "imud-user@.service").read_text()
        for name in ("Type", "ExecReload", "Restart", "WatchdogSec", "RestartPreventExitStatus"):
            self.assertIn(f"\n{name}={setting(name)}\n", users)
        self.assertIn("\nExecStart=" + setting("ExecStart").replace("/etc/", "%E/") + "\n", users)
        # A manager of a user can neither change the user nor give rights.
        self.assertNotRegex(users, r"(?m)^(User|Group|SupplementaryGroups|AmbientCapabilities|DevicePolicy|RuntimeDirectory)=")
        self.assertIn("WantedBy=default.target", users)

    def test_the_journal_gets_fields(self):
        """A socket stands in for the journal's, in a mount namespace with a /run of its own."""
        (self.folder / "journal").mkdir()
        journal = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.addCleanup(journal.close)
        journal.bind(str(self.folder / "journal/socket"))
        journal.settimeout(60)
        namespace = ["unshare", "--mount", *(["--map-root-user"] if os.geteuid() != 0 else []), "sh", "-c",
                     'mount -t tmpfs tmpfs /run && mkdir /run/systemd && ln -s "$0" /run/systemd/journal && exec "$@"',
                     self.folder / "journal"]
        if subprocess.run([*namespace, "true"], capture_output=True).returncode != 0:
            self.fail("needs a mount namespace: run as root, or allow namespaces of users")
        read, write = os.pipe()
        self.addCleanup(os.close, read)
        stream = os.fstat(write)
        self.write(0.01)
        run = subprocess.Popen([*namespace, *self.command("ExecStart", "bench")], stderr=write, stdout=subprocess.DEVNULL,
                               env={**self.environment(), "JOURNAL_STREAM": f"{stream.st_dev}:{stream.st_ino}"})
        os.close(write)
        self.addCleanup(lambda: (run.kill(), run.wait()))

        def entry(text):
            while text not in (found := self.fields(journal.recv(65536)))["MESSAGE"]:
                self.assertEqual(found["SYSLOG_IDENTIFIER"], "imud")
            return found

        self.assertEqual(entry("errors of the model")["IMU"], "imu1")
        ready = entry("ready, ")
        self.assertEqual((ready["PRIORITY"], ready.get("IMU"), ready.get("COUNTER")), ("6", None, None))
        port = int(re.search(r"truth.port is udp:127.0.0.1:(\d+)", ready["MESSAGE"]).group(1))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as simulator:
            simulator.sendto(b"no truth", ("127.0.0.1", port))
        refused = entry("truth refused")
        self.assertEqual((refused["PRIORITY"], refused["COUNTER"]), ("4", "truth.refused"))
        begun = subprocess.run([BUILD / "imud", "ctl", "--name", "bench", "fault.begin", "name=broken", "imu=imu1",
                                "target=gyro.x", "kind=bias", "value=0.1"], env=self.environment(), capture_output=True)
        self.assertEqual(begun.returncode, 0, begun.stderr)
        begins = entry("imu1: broken: bias of gyro.x")
        self.assertEqual((begins["IMU"], begins.get("COUNTER")), ("imu1", None))
        # A text of several lines is one entry.
        path = self.folder / "etc/bench.toml"
        path.write_text(path.read_text() + "wrong = 1\nmore_wrong = 2\n")
        run.send_signal(signal.SIGHUP)
        several = entry("more_wrong")
        self.assertEqual(several["PRIORITY"], "3")
        self.assertRegex(several["MESSAGE"], r"\n.*more_wrong|more_wrong.*\n")
        run.terminate()
        self.assertEqual(run.wait(), 0)
        # Nothing of this is on standard error as well.
        self.assertEqual(os.read(read, 65536), b"")

    def fields(self, datagram):
        """The fields of an entry (systemd, docs/JOURNAL_NATIVE_PROTOCOL.md)."""
        found = {}
        while datagram:
            line, _, rest = datagram.partition(b"\n")
            name, equals, value = line.partition(b"=")
            if not equals:
                size = int.from_bytes(rest[:8], "little")
                value, rest = rest[8:8 + size], rest[8 + size + 1:]
            found[name.decode()] = value.decode()
            datagram = rest
        return found

    def pings(self, count):
        for _ in range(count):
            self.assertEqual(self.notification(), "WATCHDOG=1")

    def standing_still(self, run, name):
        """Stops the thread of this name alone, as a debugger does; returns its number. By this thread, until it ends."""
        libc = ctypes.CDLL(None, use_errno=True)
        tasks = pathlib.Path(f"/proc/{run.pid}/task")
        threads = [int(task.name) for task in tasks.iterdir() if (int(task.name) != run.pid) == (name == "sampling")]
        self.assertEqual(len(threads), 1)
        for request in (PTRACE_SEIZE, PTRACE_INTERRUPT):
            self.assertEqual(libc.ptrace(request, threads[0], None, None), 0, os.strerror(ctypes.get_errno()))
        while "State:\tt" not in (tasks / f"{threads[0]}/status").read_text():
            time.sleep(0.01)
        self.addCleanup(self.end_stopped, run, threads[0])
        return threads[0]

    def end_stopped(self, run, thread):
        if run.returncode is not None:
            return
        os.kill(run.pid, signal.SIGKILL)  # Popen.kill() takes the stop for the end
        # The debugger of the thread has to take note of its stop and of its end.
        while os.WIFSTOPPED(os.waitpid(thread, WAIT_FOR_ANY_THREAD)[1]):
            pass
        run.communicate()

    def test_watchdog_is_notified_while_the_run_waits(self):
        """In real time before the first truth, in lockstep without truth, and while a reader is awaited."""
        self.assertIsNotNone(setting("WatchdogSec"))
        self.watchdog = {"WATCHDOG_USEC": "400000"}
        self.write(0.01)
        path = self.folder / "etc/bench.toml"
        text = path.read_text()
        for changed, options in ((text, []), ('clock = "lockstep"\n' + text, []),
                                 (text.replace("file:/dev/null", f"pty:{self.folder}/imu"), ["--wait-for-reader"])):
            path.write_text(changed)
            run = self.start(options=options)
            self.assertEqual(self.notification(), "READY=1")
            self.pings(12)
            run.terminate()
            run.communicate()
            while self.notification() != "STOPPING=1":
                pass

    def test_watchdog_of_another_process_or_none(self):
        self.write(0.01)
        for self.watchdog in ({}, {"WATCHDOG_USEC": "1000", "WATCHDOG_PID": "1"}, {"WATCHDOG_USEC": "much"}):
            run = self.start()
            self.assertEqual(self.notification(), "READY=1")
            begin_us = time.monotonic_ns() // 1000
            self.assertEqual(self.reload().returncode, 0)
            self.expect_reload(begin_us)
            run.terminate()
            self.assertEqual(self.notification(), "STOPPING=1")
            run.communicate()

    def test_watchdog_fires_if_a_thread_stands_still(self):
        for name in ("sampling", "main"):
            self.watchdog = {"WATCHDOG_USEC": "400000"}
            self.write(0.01)
            run = self.start()
            self.assertEqual(self.notification(), "READY=1")
            self.pings(3)
            thread = self.standing_still(run, name)
            # Those that were under way come; then, for longer than the manager waits, none.
            self.notified.settimeout(2)
            end = time.monotonic() + 60
            with self.assertRaises(TimeoutError):
                while time.monotonic() < end:
                    self.pings(1)
            self.notified.settimeout(60)
            self.end_stopped(run, thread)

    def test_devices_are_serial_ports_that_the_page_names(self):
        self.assertEqual(setting("DevicePolicy"), "closed")
        allowed = re.findall("^DeviceAllow=(.*)$", UNIT, re.MULTILINE)
        page = (SYSTEM.parent / "README.md").read_text()
        named = re.search("may open serial ports alone: (.*?) Another", page, re.DOTALL).group(1)
        self.assertEqual(allowed, [f"char-{name} rw" for name in re.findall("`(tty[A-Za-z]+)`", named)])

    def test_the_user_of_the_unit_is_made(self):
        made = re.findall(r"^u (\S+) ", (SYSTEM / "sysusers.conf").read_text(), re.MULTILINE)
        self.assertEqual(made, [setting("User")])
        self.assertEqual(setting("Group"), setting("User"))
        self.assertIn(f"/run/{setting('RuntimeDirectory')} 0755 {setting('User')} {setting('Group')} ",
                      (SYSTEM / "tmpfiles.conf").read_text())


if __name__ == "__main__":
    unittest.main()
