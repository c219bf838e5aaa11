#!/usr/bin/env python3
"""Campaigns on a real Slurm of four nodes: the same shards as on this machine, byte for byte, whatever happens.

Its arguments are imud and with-slurm, by which it runs itself. Without Slurm's packages it fails.
"""
import contextlib
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

WITH_SLURM, IMUD = (os.path.abspath(sys.argv.pop()) for _ in range(2))
SOURCE = pathlib.Path(__file__).resolve().parent.parent.parent
CAPTURE = SOURCE / "tests/captures/jsbsim_c172_10s.pcap"
LIMIT_S = 600
CASES, BATCH, TASK = 96, 4, 8  # so that there are 24 shards in 12 tasks
# Four tasks run at the same time; an array has five at most, so that there are three.
SLURM_CONF = ["--set", "MaxArraySize=5"]


def wait_for(condition, what):
    deadline = time.monotonic() + LIMIT_S
    while not (result := condition()):
        if time.monotonic() > deadline:
            raise AssertionError(f"waited in vain for {what}")
        time.sleep(0.05)
    return result


def run(*words, **options):
    return subprocess.run(words, capture_output=True, text=True, timeout=LIMIT_S, check=False, **options)


def cluster():
    return pathlib.Path(os.environ["SLURM_CONF"]).parent


def processes_of(variable):
    """Returns the processes that have the environment variable, such as `SLURMD_NODENAME=n2`, and their steps."""
    found = []
    for entry in pathlib.Path("/proc").iterdir():
        with contextlib.suppress(OSError):
            if entry.name.isdigit() and variable.encode() in (entry / "environ").read_bytes().split(b"\0"):
                found.append(int(entry.name))
    return found


def kill_node(name):
    """A node that loses its power: its daemon, and whatever runs there, end at once."""
    for step in pathlib.Path("/proc").iterdir():  # the daemons of the steps have their node's folder open
        with contextlib.suppress(OSError):
            if step.name.isdigit() and (step / "comm").read_text().startswith("slurmstepd") and \
                    f"spool.{name}" in " ".join(os.readlink(one) for one in (step / "fd").iterdir()):
                os.kill(int(step.name), signal.SIGKILL)
    for process in [int((cluster() / f"slurmd.{name}.pid").read_text()), *processes_of(f"SLURMD_NODENAME={name}")]:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)


def start_node(name):
    subprocess.run(["slurmd", "-N", name], check=True)


def nodes_are(state, nodes="n1,n2,n3,n4"):
    found = run("sinfo", "--noheader", "--Node", f"--nodes={nodes}", "--format=%T").stdout.split()
    return bool(found) and all(one.startswith(state) for one in found)


def tasks(*states):
    words = ["squeue", "--noheader", "--array", "--format=%A %F_%K %t %N"]
    return [line.split() for line in run(*words, *(f"--states={state}" for state in states)).stdout.splitlines()]


class CampaignSlurm(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.work = pathlib.Path(folder.name) / "a folder's"  # which a shell would not take for one word
        cls.work.mkdir()
        (cls.work / "imu.toml").write_text(run(IMUD, "example", "stim300").stdout)
        cls.plan = cls.write_plan("plan.toml", "")
        local = cls.work / "local"
        cls.check(run(IMUD, "campaign", "run", cls.plan, "--into", local, "--jobs", "2", "--quiet"))
        cls.expected = cls.shards_of(local)
        assert len(cls.expected) == CASES // BATCH

    @classmethod
    def write_plan(cls, name, more):
        path = cls.work / name
        path.write_text(f"""base = "imu.toml"
capture = "{CAPTURE}"
set = ["truth.format=jsbsim", "truth.port=udp:127.0.0.1:5140"]
seeds = "1..{CASES // 2}"
batch = {BATCH}
[axes]
"imu.imu1.gyro.angle_random_walk_deg_per_rt_hr" = [0.1, 0.2]
{more}""")
        return path

    @staticmethod
    def check(result, code=0):
        assert result.returncode == code, f"exit code {result.returncode}\n{result.stdout}\n{result.stderr}"
        return result

    @staticmethod
    def shards_of(folder):
        return {path.name: path.read_bytes() for path in (folder / "shards").iterdir()}

    def setUp(self):
        wait_for(lambda: nodes_are("idle"), "idle nodes")
        self.into = self.work / self.id().rpartition(".")[2]
        self.addCleanup(run, "scancel", "--user", f"{os.getuid()}")

    def campaign(self, plan=None):
        return [IMUD, "campaign", "run", plan or self.plan, "--into", self.into, "--engine", "slurm", "--slurm-task", f"{TASK}"]

    def start(self, words, **options):
        program = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)
        self.addCleanup(program.communicate)
        self.addCleanup(program.kill)
        return program

    def resume_until_whole(self, result):
        for _ in range(5):
            if result.returncode == 0:
                return
            self.assertEqual(result.returncode, 3, result.stderr)
            result = run(IMUD, "campaign", "resume", self.into)
        self.fail(result.stderr)

    def assert_same_as_local(self):
        self.assertEqual(self.shards_of(self.into), self.expected)  # and no temporary file
        self.assertEqual(list((self.into / "slurm/log").iterdir()), [])

    def shards(self):
        return list((self.into / "shards").glob("*.jsonl"))

    def test_same_bytes_by_four_nodes(self):
        program = self.start(self.campaign())
        nodes = set()
        while program.poll() is None:
            nodes |= {node for *_, state, node in (task for task in tasks() if len(task) == 4) if state == "R"}
        output, errors = program.communicate()
        self.assertEqual(program.returncode, 0, errors)
        self.assertEqual(nodes, {"n1", "n2", "n3", "n4"})
        self.assertEqual(errors.count("submitted job "), 3, errors)  # 12 tasks, an array has 5
        self.assertIn("96 cases, 24 shards\n", output)
        self.assert_same_as_local()
        # There is nothing to do again.
        again = self.check(run(*self.campaign()))
        self.assertIn("96 of 96 cases are done already", again.stderr)
        self.assertNotIn("submitted", again.stderr)
        other = run(*self.campaign()[:-1], "12")
        self.assertEqual(other.returncode, 2)
        self.assertIn("its tasks have 8 cases; --slurm-task is for a new folder", other.stderr)

    def test_a_node_dies_a_task_is_requeued_and_the_cluster_restarts(self):
        program = self.start(self.campaign())
        wait_for(lambda: len(self.shards()) >= 2, "the first shards")
        kill_node("n2")
        for _, task, *_ in tasks("RUNNING")[:2]:
            run("scontrol", "requeue", task)  # it may have ended meanwhile
        wait_for(lambda: len(self.shards()) >= 6, "further shards")
        # All daemons and tasks end, and begin again with the controller's state.
        controller = int((cluster() / "slurmctld.pid").read_text())
        os.kill(controller, signal.SIGKILL)
        for name in ("n1", "n3", "n4"):
            kill_node(name)
        self.assertLess(len(self.shards()), CASES // BATCH)
        subprocess.run(["slurmctld"], check=True)
        for name in ("n1", "n2", "n3", "n4"):
            start_node(name)
        output, errors = program.communicate(timeout=LIMIT_S)
        self.resume_until_whole(subprocess.CompletedProcess([], program.returncode, output, errors))
        self.assert_same_as_local()

    def test_it_is_left_and_taken_up(self):
        plan = self.write_plan("slow.toml", "[slurm]\nmax_running = 1\npartition = \"debug\"\ntime_limit = \"10\"\n")
        program = self.start(self.campaign(plan))
        wait_for(lambda: len(self.shards()) >= 1, "the first shard")
        self.assertLessEqual(len(tasks("RUNNING")), 1)
        program.send_signal(signal.SIGINT)
        _, errors = program.communicate(timeout=LIMIT_S)
        self.assertEqual(program.returncode, 3, errors)
        self.assertIn("left: the jobs go on; imud campaign status ", errors)
        queued = {job for job, *_ in tasks()}
        self.assertGreaterEqual(len(queued), 3)
        resumed = self.check(run(IMUD, "campaign", "resume", self.into))
        self.assertIn("tasks run or wait already", resumed.stderr)
        self.assertNotIn("submitted", resumed.stderr)
        self.assertEqual({name: rows.partition(b"\n")[2].rpartition(b"\n{")[0] for name, rows in self.shards_of(self.into).items()},
                         {name: rows.partition(b"\n")[2].rpartition(b"\n{")[0] for name, rows in self.expected.items()})

    def test_it_ends_when_the_pass_rate_is_known(self):
        plan = self.work / "until.toml"
        head = (self.work / "plan.toml").read_text().partition("[axes]")[0]
        plan.write_text(head.replace(f"1..{CASES // 2}", "1..400") + 'until = "cases pass rate within 8 % at 95 %"\n')
        local = self.work / "until"
        self.check(run(IMUD, "campaign", "run", plan, "--into", local, "--jobs", "2", "--quiet"))
        self.check(run(*self.campaign(plan)))
        wait_for(lambda: not tasks(), "the end of tasks that are not needed")
        status, expected = (json.loads(run(IMUD, "campaign", "status", "--json", folder).stdout) for folder in (self.into, local))
        self.assertIn("reached after 24 of 400 cases", expected["until"])
        self.assertEqual([status[key] for key in ("until", "cases", "cases_done", "rates")],
                         [expected[key] for key in ("until", "cases", "cases_done", "rates")])
        self.assertLess(len(self.shards()), 100)

    def test_two_at_the_same_time_with_one_folder(self):
        programs = [self.start(self.campaign()) for _ in range(2)]
        for program in programs:
            _, errors = program.communicate(timeout=LIMIT_S)
            self.assertEqual(program.returncode, 0, errors)
        wait_for(lambda: not tasks(), "the end of tasks that were submitted twice")
        self.assert_same_as_local()

    def test_tasks_that_are_cancelled_are_said_and_done_again(self):
        program = self.start(self.campaign())
        wait_for(lambda: len(self.shards()) >= 1, "the first shard")
        run("scancel", "--user", f"{os.getuid()}")
        _, errors = program.communicate(timeout=LIMIT_S)
        self.assertEqual(program.returncode, 3, errors)
        self.assertIn("the tasks have ended without ", errors)
        self.assertIn(f"imud campaign resume {self.into} submits them again", errors)
        whole = len(self.shards())
        resumed = self.check(run(IMUD, "campaign", "resume", self.into))
        self.assertIn(f"{whole * BATCH} of {CASES} cases are done already", resumed.stderr)
        self.assertEqual(self.shards_of(self.into), self.expected)

    def test_only_the_task_of_a_damaged_shard_is_submitted(self):
        self.check(run(*self.campaign()))
        shard = sorted(self.shards())[9]
        shard.write_bytes(shard.read_bytes()[:-20])
        resumed = self.check(run(IMUD, "campaign", "resume", self.into))
        self.assertEqual(resumed.stderr.count("submitted job "), 1, resumed.stderr)
        self.assertIn(": 1 tasks of 8 cases each", resumed.stderr)
        self.assert_same_as_local()

    def test_a_cluster_that_takes_no_more_is_asked_again(self):
        # As a limit of submitted jobs does: the second array is refused once.
        programs = self.work / "bin"
        programs.mkdir()
        (programs / "sbatch").write_text(f"""#!/bin/sh
echo x >>'{self.work.as_posix().replace("'", "'" + '"' + "'" + '"' + "'")}/calls'
[ "$(wc -l <"$(dirname "$0")/../calls")" -ne 2 ] || {{
    echo 'sbatch: error: QOSMaxSubmitJobPerUserLimit' >&2
    exit 1
}}
PATH=${{PATH#*:}} exec sbatch "$@"
""")
        (programs / "sbatch").chmod(0o755)
        environment = os.environ | {"PATH": f"{programs}:{os.environ['PATH']}"}
        result = self.check(run(*self.campaign(), env=environment))
        self.assertIn("sbatch: error: QOSMaxSubmitJobPerUserLimit; 2 arrays wait for tasks to end", result.stderr)
        self.assertEqual(result.stderr.count("submitted job "), 3)
        self.assert_same_as_local()

    def test_the_manifest_of_kubernetes(self):
        # The syntax of the YAML, and of the command by a shell. It needs no Slurm.
        import yaml  # pylint: disable=import-outside-toplevel
        job = yaml.safe_load((SOURCE / "emulator/campaign/kubernetes.yaml").read_text())
        self.assertEqual((job["apiVersion"], job["kind"], job["spec"]["completionMode"]), ("batch/v1", "Job", "Indexed"))
        container, = job["spec"]["template"]["spec"]["containers"]
        values = {one["name"]: one["value"] for one in container["env"]}
        self.assertEqual(int(values["CASES"]), job["spec"]["completions"] * int(values["CASES_PER_TASK"]))
        programs = self.work / "kubernetes"
        programs.mkdir()
        (programs / "imud").write_text("#!/bin/sh\necho \"$@\"\n")
        (programs / "imud").chmod(0o755)
        for index, cases, expected in ((0, "10000", "0..99"), (99, "9950", "9900..9949")):
            environment = values | {"CASES": cases, "JOB_COMPLETION_INDEX": f"{index}", "PATH": f"{programs}:/usr/bin:/bin"}
            result = self.check(run(*container["command"], *container["args"], env=environment))
            self.assertEqual(result.stdout, "campaign run /campaign/plan.toml --into /campaign/results "
                                            f"--case {expected} --jobs 1 --quiet\n")

    def test_refusals(self):
        for more, words in (("--slurm-option=--array=0-1", "`--array` is set by the campaign itself"),
                            ("--slurm-option=--partition=none", "invalid partition specified: none")):
            with self.subTest(more=more):
                result = run(*self.campaign(), more)
                self.assertEqual(result.returncode, 2, result.stderr)
                self.assertIn(words, result.stderr)
        result = run(*self.campaign(), "--case", "0..3")
        self.assertEqual(result.returncode, 2)
        self.assertIn("--case and --jobs are for --engine local", result.stderr)
        result = run(*self.campaign()[:-4], "--slurm-task", "8")
        self.assertEqual(result.returncode, 2)
        self.assertIn("--slurm-option and --slurm-task are for --engine slurm", result.stderr)


if __name__ == "__main__":
    if "SLURM_CONF" not in os.environ or not cluster().name.startswith("with-slurm."):
        os.execv(WITH_SLURM, [WITH_SLURM, *SLURM_CONF, "--", sys.executable, "-B", *sys.argv, IMUD, WITH_SLURM])
    unittest.main()
