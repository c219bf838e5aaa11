"""`imud status`: what runs, in every state that a run can be in.

usage: status_test.py BUILD_FOLDER SOURCE_FOLDER
"""
import datetime
import json
import os
import shutil
import signal
import socket
import subprocess
import threading
import time
import unittest

from runs import IMUD, RunsTest

STOPPED_ANSWERS_S = 2
LIMIT_S = 60


class StatusTest(RunsTest):
    def runs(self, *words, stopped=()):
        """The exit code, and the runs of this test: others may run on this machine. Asks again while a run that is not
        stopped has not answered in time, as on a busy machine."""
        end = time.monotonic() + LIMIT_S
        while True:
            code, text = self.imud("status", "--json", *words)
            runs = {run["name"]: run for run in json.loads(text)["runs"] if run["socket"].startswith(str(self.folder))}
            if all(run["state"] != "silent" or name in stopped for name, run in runs.items()) or time.monotonic() > end:
                return code, runs

    def status(self, name):
        """The exit code, and the text about a run, which is asked again as above."""
        end = time.monotonic() + LIMIT_S
        while True:
            code, text = self.imud("status", name)
            if "has not answered within" not in text or time.monotonic() > end:
                return code, text

    def test_nothing_runs(self):
        code, text = self.imud("status", "no-such-run")
        self.assertEqual(code, 1)
        self.assertRegex(text, "^imud: (no imud of this user runs, so that none is named no-such-run: |there is no no-such-run; those that run: )")
        self.assertEqual(self.runs("no-such-run"), (1, {}))

    def test_a_run(self):
        before = datetime.datetime.now(datetime.timezone.utc).replace(microsecond=0)
        run = self.start(more='name = "nose"\n')
        code, runs = self.runs("bench")
        self.assertEqual(code, 0)
        bench = runs["bench"]
        self.assertEqual((bench["state"], bench["pid"], bench["socket"]), ("running", run.pid, str(self.socket("bench"))))
        self.assertEqual(bench["config"], str(self.folder / "bench.toml"))
        started = datetime.datetime.strptime(bench["started"], "%Y-%m-%dT%H:%M:%S%z")
        self.assertTrue(before <= started <= datetime.datetime.now(datetime.timezone.utc), bench["started"])
        self.assertEqual(bench["clients"], {"control": 1, "web": 0})
        imu = bench["imus"][0]
        self.assertEqual((imu["name"], imu["protocol"], imu["port"], imu["port_state"]), ("nose", "stim300", "file:/dev/null", "ready"))
        self.assertIn("lateness_us", bench["counters"]["imus"][0])
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(str(self.socket("bench")))
            client.sendall(b'{"jsonrpc":"2.0","method":"status","id":1}\n')
            self.assertEqual(json.loads(client.makefile().readline())["result"]["clients"]["control"], 1)
            self.assertEqual(self.runs()[1]["bench"]["clients"]["control"], 2)
            code, text = self.status("bench")
        self.assertEqual(code, 0)
        first, second, clients, truth, head, row = text.splitlines()
        self.assertRegex(first, rf"^bench: process {run.pid}, since \S+Z, for 0:00:\d\d, clock realtime, version \S+$")
        self.assertEqual(second, f"  configuration {self.folder}/bench.toml")
        self.assertEqual(clients, "  clients: 1 of the control socket, 0 of the page")
        self.assertEqual(truth, "  truth 0.0 Hz, 0 accepted, 0 lost, refused: none")
        self.assertEqual(head.split()[:4], ["IMU", "PRODUCT", "HZ", "SET"])
        self.assertRegex(row, r"^  nose +stim300 +2000 +\d+\.\d +\d+ +\d+ +\d+ +\d+ +\d+\.\d +\d+\.\d +\d+\.\d  file:/dev/null$")

    def test_faults_power_and_readers(self):
        self.start(more=f'name = "a"\n[[imu]]\nname = "b"\nprotocol = "stim300"\nport = "pty:{self.folder}/b"\n')
        for words in (("power", "imu=a", "state=off"),
                      ("fault.begin", "name=broken", "imu=b", "target=gyro.x", "kind=bias", "value=0.1")):
            # Without its name, imud asks which one is meant while another test's run goes on.
            code, text = self.imud("ctl", "--name", "bench", *words)
            self.assertEqual(code, 0, text)
        code, text = self.status("bench")
        self.assertEqual(code, 0)
        self.assertRegex(text, r"(?m)file:/dev/null, power off$")
        self.assertRegex(text, r"(?m)/b, no reader$")
        self.assertRegex(text, r"(?m)^  fault broken: bias of gyro\.x, imu b, since sample \d+$")

    def test_several_and_one_by_name(self):
        self.start("a")
        self.start("b")
        self.assertEqual([list(self.runs(*names)[1]) for names in ((), ("b",))], [["a", "b"], ["b"]])
        code, text = self.imud("status", "c")
        self.assertEqual((code, text), (1, text))
        self.assertRegex(text, "^imud: there is no c; those that run: a, b")
        self.assertEqual(self.runs("c"), (1, {}))

    def test_a_killed_run(self):
        run = self.start("a")
        run.kill()
        run.wait()
        code, text = self.imud("status", "a")
        self.assertEqual(code, 1)
        self.assertEqual(text, f"a: does not run: it was killed, and has left {self.socket('a')}, which the next run removes\n")
        self.start("b")  # removes the socket of a
        self.assertEqual([(name, one["state"]) for name, one in self.runs()[1].items()], [("b", "running")])

    def test_a_stopped_run_is_waited_for_for_a_limited_time(self):
        stopped = self.start("a")
        self.start("b")
        stopped.send_signal(signal.SIGSTOP)
        # Connections that the run does not accept, more than its socket permits: connect() waits.
        for _ in range(300):
            client = socket.socket(socket.AF_UNIX)
            self.addCleanup(client.close)
            client.setblocking(False)
            try:
                client.connect(str(self.socket("a")))
            except BlockingIOError:
                break
        else:
            self.fail("the socket accepts any number")
        code, runs = self.runs(stopped=["a"])
        self.assertEqual(code, 1)
        self.assertEqual({name: one["state"] for name, one in runs.items()}, {"a": "silent", "b": "running"})
        self.assertIn(f"a: has not answered within {STOPPED_ANSWERS_S} s", self.imud("status", "a")[1])
        stopped.send_signal(signal.SIGCONT)

    def test_a_socket_of_another_user(self):
        if os.geteuid() != 0:
            self.skipTest("needs another user")
        self.start("a")
        os.chmod(self.folder, 0o755)
        (self.folder / "other").mkdir()
        self.environment["XDG_RUNTIME_DIR"] = str(self.folder / "other")
        os.chown(self.folder / "other", 65534, 65534)
        self.socket("a").rename(self.folder / "other/imud-a.sock")
        program = self.folder / "imud"  # where that user can execute it
        shutil.copy(IMUD, program)
        program.chmod(0o755)
        done = subprocess.run([program, "status", "a"], env=self.environment, capture_output=True, text=True, timeout=120,
                              user=65534, group=65534)
        self.assertEqual(done.returncode, 1)
        self.assertIn("a: belongs to another user", done.stdout + done.stderr)

    def test_an_answer_is_not_executed_by_the_terminal(self):
        """What answers at a socket may be anything, and what it says is shown, not executed."""
        listening = socket.socket(socket.AF_UNIX)
        self.addCleanup(listening.close)
        listening.bind(str(self.socket("a")))
        listening.listen()
        for answer, expected in [({"version": "\x1b]0;owned\x07\x9b2J"}, "version ?]0;owned??2J"), (5, "has not answered"),
                                 ({"pid": "many"}, "does not know")]:
            def serve():
                for _ in range(2):  # the search for runs, and the question
                    connection = listening.accept()[0]
                    with connection, connection.makefile("rw") as lines:
                        if lines.readline():
                            print(json.dumps({"jsonrpc": "2.0", "id": 1, "result": answer}, ensure_ascii=False), file=lines, flush=True)
                            lines.readline()
            server = threading.Thread(target=serve, daemon=True)
            server.start()
            text = self.imud("status")[1]
            server.join()
            self.assertIn(expected, text)
            self.assertNotIn("\x1b", text)
            self.assertNotIn("\x9b", text)


if __name__ == "__main__":
    unittest.main()
