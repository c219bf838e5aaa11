#!/usr/bin/env python3
"""tools/with-slurm: four nodes, which share the jobs; the others go on when one dies; and nothing is left.

Its argument is with-slurm. It needs neither root nor control groups. Without Slurm's packages it fails.
"""
import contextlib
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

WITH_SLURM = os.path.abspath(sys.argv.pop())
LIMIT_S = 120  # a busy machine takes some ten times as long as a quiet one, which takes 2 s

# A task of an array that ends when as many tasks as there are nodes have begun: as many must run at the same time.
TASK = """#!/bin/bash
touch "$1/$SLURMD_NODENAME.$SLURM_ARRAY_TASK_ID"
for ((i = 0; i < 3000; i++)); do
    begun=("$1"/n*.*)
    ((${#begun[@]} >= $2)) && touch "$1/ended.$SLURM_ARRAY_TASK_ID" && exit
    sleep 0.1
done
exit 1
"""


def processes_with(text):
    """Returns the processes that name the text in their command line or environment, except this one."""
    found = []
    for entry in pathlib.Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                texts = (entry / "cmdline").read_bytes() + (entry / "environ").read_bytes()
            except OSError:  # it has ended meanwhile, or is another user's
                continue
            if text.encode() in texts:
                found.append(int(entry.name))
    return found


class WithSlurm(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name) / "tmp"  # where the clusters have their folders
        self.folder.mkdir()
        self.work = pathlib.Path(folder.name) / "work"
        self.work.mkdir()
        (self.work / "task.sh").write_text(TASK)
        self.environment = os.environ | {"TMPDIR": str(self.folder), "WORK": str(self.work)}
        self.started = []
        self.addCleanup(self.kill_started)

    def kill_started(self):
        for program in self.started:
            program.kill()
            program.wait()
        for process in processes_with(str(self.folder)):  # of a program that has failed to do so
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        for program in self.started:
            program.communicate()

    def start(self, *arguments, **environment):
        program = subprocess.Popen([WITH_SLURM, *arguments], env=self.environment | environment, cwd=self.work,
                                   stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.started.append(program)
        return program

    def run_script(self, *arguments, **environment):
        program = self.start(*arguments, **environment)
        output, errors = program.communicate(timeout=LIMIT_S)
        return program.returncode, output, errors

    def assert_nothing_left(self):
        self.assertEqual(list(self.folder.iterdir()), [])
        left = [(process, pathlib.Path(f"/proc/{process}/cmdline").read_text()) for process in processes_with(str(self.folder))]
        self.assertEqual(left, [])

    def assert_all_ended_on(self, nodes):
        names = [path.name.split(".") for path in (self.work / "began").iterdir()]
        self.assertEqual({node for node, _ in names} - {"ended"}, nodes)
        self.assertEqual(sorted(task for node, task in names if node == "ended"), [f"{task}" for task in range(1, 9)])

    def test_four_nodes_share_an_array(self):
        code, output, errors = self.run_script("bash", "-c", """
            sinfo --noheader --Node --format='%N %T'
            mkdir began
            sbatch --quiet --array=1-8 --output=/dev/null task.sh "$PWD/began" 4 || exit
            while [[ $(squeue --noheader) ]]; do sleep 0.1; done
            exit 7""")
        self.assertEqual((code, errors), (7, ""))
        self.assertEqual(output, "n1 idle\nn2 idle\nn3 idle\nn4 idle\n")
        self.assert_all_ended_on({"n1", "n2", "n3", "n4"})
        self.assert_nothing_left()

    def test_the_others_go_on_without_a_node_that_died_and_it_comes_back(self):
        code, output, errors = self.run_script("bash", "-c", """
            folder=$(dirname "$SLURM_CONF")
            mkdir began
            kill -KILL "$(<"$folder/slurmd.n2.pid")"
            sbatch --quiet --array=1-8 --output=/dev/null task.sh "$PWD/began" 3 || exit
            while [[ $(squeue --noheader) ]]; do sleep 0.1; done
            until [[ $(sinfo --noheader --nodes=n2 --format=%T) == down* ]]; do sleep 0.1; done
            slurmd -N n2 || exit
            until [[ $(sinfo --noheader --nodes=n2 --format=%T) == idle ]]; do sleep 0.1; done
            srun --nodes=4 true""")
        self.assertEqual((code, output, errors), (0, "", ""))
        self.assert_all_ended_on({"n1", "n3", "n4"})
        self.assert_nothing_left()

    def test_two_clusters_are_beside_each_other(self):
        script = """scontrol show config | grep -E '^(SlurmctldPort|MaxArraySize) ' && sinfo --noheader --format=%D
                    touch "ready.$0"; until [[ -e ready.1 && -e ready.2 ]]; do sleep 0.1; done"""
        programs = [self.start("--nodes", "2", "--set", f"MaxArraySize={10 + i}", "--", "bash", "-c", script, f"{i}")
                    for i in (1, 2)]
        outputs = [program.communicate(timeout=LIMIT_S) for program in programs]
        self.assertEqual([(program.returncode, errors) for program, (_, errors) in zip(programs, outputs)],
                         [(0, "")] * 2)
        rows = [[line.split()[-1] for line in output.splitlines()] for output, _ in outputs]
        self.assertEqual([(row[0], row[2]) for row in rows], [("11", "2"), ("12", "2")])
        self.assertNotEqual(rows[0][1], rows[1][1])
        self.assert_nothing_left()

    def test_nothing_is_left_when_it_is_ended(self):
        # A job that ignores what can be ignored, and a process of the command in a session of its own.
        script = """trap '' INT TERM HUP
                    sbatch --quiet --output=/dev/null --wrap 'trap "" TERM INT; touch runs; while :; do sleep 1; done'
                    setsid sleep 1000 &
                    until [[ -e runs ]]; do sleep 0.1; done
                    trap - INT TERM HUP
                    exec python3 -c 'import time; print("runs", flush=True); time.sleep(1000)'"""
        for number, code in ((signal.SIGTERM, 128 + signal.SIGTERM), (signal.SIGINT, 128 + signal.SIGINT),
                             (signal.SIGKILL, -signal.SIGKILL)):
            with self.subTest(number=number):
                (self.work / "runs").unlink(missing_ok=True)
                program = self.start("bash", "-c", script)
                self.assertEqual(program.stdout.readline(), "runs\n")
                self.assertGreater(len(processes_with(str(self.folder))), 8)  # daemons, steps, and the command
                program.send_signal(number)
                self.assertEqual(program.wait(timeout=LIMIT_S), code)
                deadline = time.monotonic() + LIMIT_S
                while number == signal.SIGKILL and time.monotonic() < deadline and \
                        (list(self.folder.iterdir()) or processes_with(str(self.folder))):
                    time.sleep(0.05)  # by the second process
                self.assert_nothing_left()

    def test_a_signal_ends_the_start(self):
        program = self.start("--nodes", "64", "--", "true")
        deadline = time.monotonic() + LIMIT_S
        while not list(self.folder.glob("with-slurm.*/slurm.conf")):
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.005)
        program.send_signal(signal.SIGTERM)
        self.assertEqual(program.communicate(timeout=LIMIT_S), ("", ""))
        self.assertEqual(program.returncode, 128 + signal.SIGTERM)
        self.assert_nothing_left()

    def test_a_signal_while_the_nodes_become_idle_ends_the_start(self):
        (self.work / "bin").mkdir()
        sinfo = self.work / "bin/sinfo"
        sinfo.write_text('#!/bin/sh\nkill -TERM "$PPID"\necho "n1 idle"\n')
        sinfo.chmod(0o755)
        # The command cannot be run: the exit code would be another one.
        code, output, errors = self.run_script("--nodes", "1", "--", "/nowhere",
                                               PATH=f"{self.work}/bin:{os.environ['PATH']}")
        self.assertEqual((code, output, errors), (128 + signal.SIGTERM, "", ""))
        self.assert_nothing_left()

    def test_exit_codes(self):
        for command, code in ((["true"], 0), (["/nowhere"], 127), ([str(self.work)], 126),
                              (["sh", "-c", "kill -KILL $$"], 137)):
            with self.subTest(command=command):
                self.assertEqual(self.run_script("--nodes", "1", "--", *command)[0], code)
        self.assert_nothing_left()

    def test_refusals_name_the_cause(self):
        for arguments, words in ((["--set", "AuthType=auth/none_such", "true"], "with-slurm: slurmctld has ended: "),
                                 (["--nodes", "65", "true"], "--nodes 65: give 1 to 64"),
                                 (["--set", "x", "true"], "--set x: give KEY=VALUE"),
                                 ([], "no command is given"), (["--none", "true"], "see --help")):
            with self.subTest(arguments=arguments):
                code, output, errors = self.run_script(*arguments)
                self.assertEqual((code, output, errors.count("\n")), (125, "", 1), errors)
                self.assertIn(words, errors)
        self.assert_nothing_left()

    def test_missing_packages_are_named(self):
        # The program's own search adds these folders of the system.
        text = pathlib.Path(WITH_SLURM).read_text().replace(":/usr/sbin:/sbin", "")
        script = self.work / "with-slurm"
        script.write_text(text)
        script.chmod(0o755)
        programs = self.work / "bin"
        programs.mkdir()
        (programs / "munged").symlink_to("/bin/true")
        result = subprocess.run([script, "true"], env=self.environment | {"PATH": str(programs)}, text=True,
                                capture_output=True, timeout=LIMIT_S, check=False)
        self.assertEqual((result.returncode, result.stdout, result.stderr),
                         (125, "", "with-slurm: Slurm is missing here: apt-get install --no-install-recommends "
                                   "slurm-client slurmctld slurmd\n"))


if __name__ == "__main__":
    unittest.main()
