#!/usr/bin/env python3
"""A rack whose hosts are folders: `imud rack` starts, shows and stops real runs on them. In place of ssh(1) and
systemctl(1) are stand-ins, which execute what they are given on this machine, in the environment of the host.

usage: rack_test.py BUILD_FOLDER SOURCE_FOLDER
"""
import heapq
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

BUILD, SOURCE = (pathlib.Path(argument).resolve() for argument in (sys.argv.pop(1), sys.argv.pop(1)))
sys.path.insert(0, str(SOURCE / "tools/python"))
from imud.record import load_record  # noqa: E402

IMUD = str(BUILD / "imud")
LIMIT_S = 300  # only a failing test waits for it

# Without a question, and with the host's name behind --, where it cannot be an option.
SSH = """#!/bin/sh
[ "$1 $2" = "-o BatchMode=yes" ] && [ "$3" = -o ] || { echo "ssh: $*" >&2; exit 99; }
shift 4
case "$1 $2 $3 $4" in "-o ServerAliveInterval="*" -o ServerAliveCountMax=3") shift 4 ;; esac
[ "$1" = -- ] && [ $# = 3 ] || { echo "ssh: $*" >&2; exit 99; }
host=$2
if [ "$host" = gone ]; then echo 'ssh: connect to host gone port 22: Connection refused' >&2; exit 255; fi
if [ "$host" = hangs ]; then exec sleep 1000; fi
echo 'Welcome, and imud-rack is no part of this greeting'
cd / && exec env -i HOME=@FOLDER@/$host XDG_RUNTIME_DIR=@FOLDER@/$host PATH=@FOLDER@/$host/bin:/usr/bin:/bin sh -c "$3"
"""

# Has the commands of systemctl that the rack uses. A unit whose name is in `refused` does not start.
SYSTEMCTL = """#!/usr/bin/python3
import os, pathlib, signal, subprocess, sys, time
host = pathlib.Path(os.environ["XDG_RUNTIME_DIR"])
user, action, *units = [word for word in sys.argv[1:] if word not in ("--quiet", "--no-pager", "--lines=5", "--property=ExecStart", "--value")]
assert user == "--user" and units, sys.argv

def command(unit):
    name = unit.removeprefix("imud@")
    words = ["imud", "run", f"{os.environ['HOME']}/.config/imud/{name}.toml", "--set", f"control.name={name}"]
    return words if (host / "unrecorded").exists() else words + ["--record", f"{name}.pcapng"]

def show(unit):
    print(f"{{ path=/usr/bin/imud ; argv[]={' '.join(command(unit))} ; ignore_errors=no ; start_time=[n/a] ; stop_time=[n/a] ; pid=0 }}")
    return True

def process(unit):
    try:
        pid = int((host / f"{unit}.pid").read_text())
        state = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (OSError, ValueError):
        return 0
    return 0 if state in "ZX" else pid

def start(unit):
    if process(unit):
        return True
    if (host / "refused").exists() and unit in (host / "refused").read_text():
        print(f"Job for {unit}.service failed because the control process exited with error code.", file=sys.stderr)
        return False
    read, write = os.pipe()
    with open(host / f"{unit}.log", "a") as log:
        run = subprocess.Popen(command(unit) + ["--ready-fd", str(write)], pass_fds=[write], stdin=subprocess.DEVNULL, stdout=log,
                               stderr=log, cwd=os.environ["HOME"], start_new_session=True)
    os.close(write)
    (host / f"{unit}.pid").write_text(str(run.pid))
    return os.read(read, 6) == b"ready\\n"

def stop(unit):
    if pid := process(unit):
        os.kill(pid, signal.SIGTERM)
    while process(unit):
        time.sleep(0.01)
    return True

def is_active(unit):
    if "--quiet" not in sys.argv:
        print("active" if process(unit) else "inactive")
    return process(unit) != 0

def status(unit):
    print(f"{unit}.service: status of the stand-in")
    return False

done = [{"start": start, "stop": stop, "is-active": is_active, "status": status, "show": show}[action](unit) for unit in units]
sys.exit(0 if all(done) else 1)
"""

# In place of imud on a host that has another one: VERSION is its version; it refuses each configuration if told to.
OTHER_IMUD = """#!/bin/sh
if [ "$1" = --version ]; then echo 'imud @VERSION@'; exit; fi
if [ "$1" = check ] && @REFUSES@; then echo "$2:3: truth.port: not there" >&2; exit 2; fi
exec @IMUD@ "$@"
"""

CONFIGURATION = """clock = "realtime"
[truth]
port = "udp:127.0.0.1:0"
delay_ms = 20
[realtime]
priority = 0
lock_memory = false
epoch = "utc"
allow_unsynchronised = true
[[imu]]
name = "{name}"
protocol = "native"
port = "pty:{folder}/{name}"
before_first = "rest"
rate_hz = 100
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 90
"""


class RackTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="rack")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.addCleanup(self.kill_all)
        (self.folder / "bin").mkdir()
        self.write_program(self.folder / "bin/ssh", SSH.replace("@FOLDER@", folder.name))
        self.environment = {"PATH": f"{folder.name}/bin:/usr/bin:/bin", "HOME": folder.name, "XDG_RUNTIME_DIR": folder.name, "LC_ALL": "C.UTF-8"}
        for host, runs in ("a", ["nose", "tail"]), ("b", ["wing"]), ("c", ["fin"]):
            self.add_host(host)
            for run in runs:
                (self.folder / f"{run}.toml").write_text(self.configuration(run))
        self.rack = self.write_rack("rack", a=["nose", "tail"], b=["wing"], c=["fin"])

    def write_program(self, path, text):
        path.write_text(text)
        path.chmod(0o755)

    def configuration(self, name):
        return CONFIGURATION.format(name=name, folder=self.folder)

    def add_host(self, host):
        programs = self.folder / host / "bin"
        programs.mkdir(parents=True)
        self.write_program(programs / "systemctl", SYSTEMCTL)
        (programs / "imud").symlink_to(IMUD)

    def write_rack(self, name, limit_s=120, **hosts):
        text = f"time_limit_s = {limit_s}\n"
        for host, runs in hosts.items():
            text += f'[[host]]\nname = "{host}"\nservice = "user"\nruns = {json.dumps([run + ".toml" for run in runs])}\n'
        (self.folder / f"{name}.toml").write_text(text)
        return f"{name}.toml"

    def process(self, host, run):
        return int((self.folder / host / f"imud@{run}.pid").read_text())

    def kill_all(self):
        for path in self.folder.glob("*/imud@*.pid"):
            try:
                os.kill(int(path.read_text()), signal.SIGKILL)
            except (OSError, ValueError):
                pass

    def imud(self, *words):
        """Returns the exit code, standard output and standard error."""
        done = subprocess.run([IMUD, "rack", *words], env=self.environment, cwd=self.folder, capture_output=True, text=True, timeout=LIMIT_S)
        return done.returncode, done.stdout, done.stderr

    def status(self, rack=None):
        """Returns the exit code, the states of the runs by their names, and the status."""
        code, out, errors = self.imud("status", rack or self.rack, "--json")
        self.assertEqual(errors, "")
        status = json.loads(out)
        return code, {run["name"]: run["state"] for host in status["hosts"] for run in host["runs"]}, status

    def is_nothing_started(self):
        return not list(self.folder.glob("*/imud@*.pid"))

    def test_from_check_to_stop(self):
        code, out, errors = self.imud("check", self.rack)
        self.assertEqual((code, errors), (0, ""), out)
        self.assertIn("rack.toml: good\n", out)
        self.assertRegex(out, r"(?m)^a +ssh a +imud@tail +tail +native +100 +pty:\S+/tail$")
        code, states, status = self.status()
        self.assertEqual((code, set(states.values()), status["good"]), (1, {"stopped"}, False))

        code, out, errors = self.imud("start", self.rack)
        self.assertEqual((code, out), (0, "a: started imud@nose, imud@tail\nb: started imud@wing\nc: started imud@fin\n"), errors)
        self.assertEqual((self.folder / "b/.config/imud/wing.toml").read_text(), self.configuration("wing"))
        self.assertEqual(list(self.folder.glob("*/.config/imud/.*")), [], "a file is left")
        before = [self.process(*run) for run in (("a", "nose"), ("a", "tail"), ("b", "wing"), ("c", "fin"))]

        # The first samples are at the next whole second.
        deadline = time.monotonic() + LIMIT_S
        while True:
            code, states, status = self.status()
            self.assertEqual((code, set(states.values()), status["good"]), (0, {"running"}, True), status)
            imus = {imu["name"]: imu for host in status["hosts"] for run in host["runs"] for imu in run["imus"]}
            if all(imu["samples"] > 0 for imu in imus.values()):
                break
            self.assertLess(time.monotonic(), deadline)
        self.assertEqual(sorted(imus), ["fin", "nose", "tail", "wing"])
        for imu in imus.values():
            self.assertEqual((imu["protocol"], imu["rate_hz"], imu["first_k"] % 100), ("native", 100, 0), imu)
        self.assertEqual({run["clock"]["epoch"] for host in status["hosts"] for run in host["runs"]}, {"utc"})
        code, out, errors = self.imud("status", self.rack)
        self.assertEqual((code, errors), (0, ""))
        self.assertRegex(out, r"(?m)^HOST +RUN +STATE +VERSION +FOR +IMU +HZ +SAMPLES +MISSED +LATE P99 us +CLOCK +FIRST K$")
        self.assertRegex(out, rf"(?m)^b +wing +running +\S+ +\S+ +wing +\d+\.\d +\d+ +\d+ +\d+\.\d +utc, .* {imus['wing']['first_k']}$")

        # What runs already stays.
        self.assertEqual(self.imud("start", self.rack)[0], 0)
        self.assertEqual([self.process(*run) for run in (("a", "nose"), ("a", "tail"), ("b", "wing"), ("c", "fin"))], before)
        (self.folder / "wing.toml").write_text(self.configuration("wing").replace("rate_hz = 100", "rate_hz = 50"))
        code, out, errors = self.imud("start", self.rack)
        self.assertEqual((code, out), (1, ""))
        self.assertIn("b: imud@wing runs already, with another configuration than wing.toml; stop it first: imud rack stop rack.toml\n", errors)

        os.kill(self.process("b", "wing"), signal.SIGKILL)
        deadline = time.monotonic() + LIMIT_S
        while True:  # until its end is known
            code, states, status = self.status()
            if states["wing"] == "killed":
                break
            self.assertLess(time.monotonic(), deadline, states)
        self.assertEqual((code, states), (1, {"nose": "running", "tail": "running", "wing": "killed", "fin": "running"}))
        self.assertIn("b: imud@wing was killed\n", self.imud("status", self.rack)[1])

        code, out, errors = self.imud("stop", self.rack)
        self.assertEqual((code, out, errors), (0, "a: stopped imud@nose, imud@tail\nb: stopped imud@wing\nc: stopped imud@fin\n", ""))
        self.assertEqual({state for name, state in self.status()[1].items() if name != "wing"}, {"stopped"})

    def test_a_host_that_is_not_reached(self):
        rack = self.write_rack("partly", a=["nose"], gone=["wing"])
        code, out, errors = self.imud("start", rack)
        self.assertEqual((code, out), (1, ""))
        reason = "gone: not reached: ssh: connect to host gone port 22: Connection refused; `ssh gone` must log in without a question\n"
        self.assertEqual(errors[errors.index("gone: not"):], reason + "nothing was started\n")
        self.assertTrue(self.is_nothing_started())
        code, states, status = self.status(rack)
        self.assertEqual((code, states), (1, {"nose": "stopped", "wing": "unknown"}))
        self.assertEqual([host["reached"] for host in status["hosts"]], [True, False])
        self.assertIn(reason, self.imud("status", rack)[1])

    def test_a_host_that_does_not_answer_is_cut_off(self):
        rack = self.write_rack("hanging", limit_s=1, hangs=["wing"])
        code, states, status = self.status(rack)
        self.assertEqual((code, states, status["hosts"][0]["why"]), (1, {"wing": "unknown"}, "has not answered within 1 s"))

    def test_a_host_that_has_another_imud(self):
        def write_imud(version, refuses):
            path = self.folder / "c/bin/imud"
            path.unlink()
            self.write_program(path, OTHER_IMUD.replace("@VERSION@", version).replace("@REFUSES@", refuses).replace("@IMUD@", IMUD))
        version = subprocess.run([IMUD, "--version"], capture_output=True, text=True).stdout.split()[1]
        write_imud("0.0.1", "false")
        code, out, errors = self.imud("start", self.rack)
        self.assertEqual((code, out), (1, ""))
        self.assertIn(f"versions differ: imud 0.0.1 (c), imud {version} (a, b); install one on all hosts\nnothing was started\n", errors)
        self.assertIn("versions differ: 0.0.1 (c), ", self.imud("status", self.rack)[1])
        write_imud(version, "true")
        code, out, errors = self.imud("start", self.rack)
        self.assertEqual((code, out), (1, ""))
        self.assertIn("c: fin.toml is refused there:\n  fin.toml:3: truth.port: not there\nnothing was started\n", errors)
        # The path of the file contains the name of the copy that the host has checked.
        folder = self.folder / ".fin.rack.toml"
        folder.mkdir()
        (folder / "fin.toml").write_text(self.configuration("fin"))
        code, out, errors = self.imud("start", self.write_rack("inner", c=[".fin.rack.toml/fin"]))
        self.assertEqual((code, out), (1, ""))
        self.assertIn("\n  .fin.rack.toml/fin.toml:3: truth.port: not there\nnothing was started\n", errors)
        (self.folder / "c/bin/imud").unlink()
        code, out, errors = self.imud("start", self.rack)
        self.assertIn("imud: not found; install imud there\nnothing was started\n", errors)
        self.assertTrue(self.is_nothing_started())
        self.assertEqual(list(self.folder.glob("*/.config/imud/*.toml")), [], "a configuration has been installed")

    def test_a_run_that_cannot_be_started(self):
        (self.folder / "b/refused").write_text("imud@wing")
        code, out, errors = self.imud("start", self.rack)
        self.assertEqual((code, out), (1, "a: started imud@nose, imud@tail\nb: NOT started imud@wing\n"
                                          "  Job for imud@wing.service failed because the control process exited with error code.\n"
                                          "  imud@wing.service: status of the stand-in\nc: started imud@fin\n"))
        self.assertIn("those that have started go on; repeat imud rack start rack.toml for the others, or imud rack stop rack.toml\n", errors)
        (self.folder / "b/refused").unlink()
        self.assertEqual(self.imud("start", self.rack)[0], 0)
        self.assertEqual(self.imud("stop", self.rack)[0], 0)

    def test_the_records_are_merged_by_time(self):
        self.assertEqual(self.imud("start", self.rack)[0], 0)
        deadline = time.monotonic() + LIMIT_S
        while not all(imu["samples"] > 50 for host in self.status()[2]["hosts"] for run in host["runs"] for imu in run["imus"]):
            self.assertLess(time.monotonic(), deadline)
        self.assertEqual(self.imud("stop", self.rack)[0], 0)
        runs = ("a", "nose"), ("a", "tail"), ("b", "wing"), ("c", "fin")
        records = {f"{host}/{run}/": load_record(self.folder / host / f"{run}.pcapng") for host, run in runs}
        code, out, errors = self.imud("record", self.rack, "all.pcapng")
        self.assertEqual((code, errors), (0, ""))
        self.assertEqual(out, "".join(f"{host}: merged imud@{run}, {len(records[f'{host}/{run}/'].packets)} packets of {run}.pcapng\n"
                                      for host, run in runs))
        merged = load_record(self.folder / "all.pcapng")
        self.assertEqual([one.name for one in merged.interfaces],
                         [prefix + one.name for prefix, record in records.items() for one in record.interfaces])
        # The next one is the earliest of the packets that are next in the records, and of equal ones of the first record.
        expected = heapq.merge(*([(packet.time_ns, prefix + packet.interface.name, packet.data) for packet in record.packets]
                                 for prefix, record in records.items()), key=lambda packet: packet[0])
        self.assertEqual([(packet.time_ns, packet.interface.name, packet.data) for packet in merged.packets], list(expected))
        self.assertGreater(len(merged.packets), 400)

        # A host that is not reached, a run that is not recorded, and a record that is cut short or is none.
        before = (self.folder / "all.pcapng").read_bytes()
        wing = self.folder / "b/wing.pcapng"
        wing.write_bytes(wing.read_bytes()[:-7])
        (self.folder / "a/tail.pcapng").write_text("no record")
        (self.folder / "c/unrecorded").touch()
        rack = self.write_rack("partly", a=["nose", "tail"], b=["wing"], c=["fin"], gone=["rear"])
        code, out, errors = self.imud("record", rack, "some.pcapng")
        self.assertEqual((code, errors), (3, ""))
        lines = out.splitlines()
        self.assertRegex(lines[0], r"^a: merged imud@nose, \d+ packets of nose.pcapng$")
        self.assertEqual(lines[1], "a: NOT merged imud@tail: tail.pcapng is no record (pcapng)")
        self.assertRegex(lines[2], r"^b: merged imud@wing, \d+ packets of wing.pcapng: .*cut")
        self.assertEqual(lines[3], "c: NOT merged imud@fin: its unit has no --record FILE; give it one by `systemctl --user edit "
                                   "imud@.service` there")
        self.assertEqual(lines[4], "gone: NOT merged imud@rear: not reached: ssh: connect to host gone port 22: Connection refused; "
                                   "`ssh gone` must log in without a question")
        prefixes = {one.name.rpartition("/")[0] for one in load_record(self.folder / "some.pcapng").interfaces}
        self.assertEqual(prefixes, {"a/nose", "b/wing"})
        code, out, errors = self.imud("record", self.write_rack("none", c=["fin"]), "all.pcapng")
        self.assertEqual((code, errors), (1, "there is no record; all.pcapng was not written\n"))
        self.assertEqual((self.folder / "all.pcapng").read_bytes(), before)
        self.assertEqual([path.name for path in self.folder.iterdir() if "incomplete" in path.name or path.name.startswith(".")], [])


if __name__ == "__main__":
    unittest.main()
