"""imu-campaign makes one table of a campaign's shards, the same whatever their order; its statistics are those of Python's modules.

usage: collect_test.py IMU_CAMPAIGN
"""
import csv
import io
import json
import os
import pathlib
import random
import shlex
import sqlite3
import statistics
import subprocess
import sys
import tempfile
import unittest

from shard_files import row_of, write_all, write_campaign, write_shard, write_unfinished_shard

PROGRAM = pathlib.Path(sys.argv.pop(1)).resolve()
HOSTILE = ['comma, "quote"', "line\nfeed\r", "'; DROP TABLE cases; --", "select", "ORDER", "", " ", "naïve ☃", "%s{}\\", "[1]", "=1+1", "\t"]


def rows_of(cases, rng):
    """Rows over two axes and seeds; one in ten fails its expectation, one in a hundred has no metric."""
    rows = []
    for index in range(cases):
        noise, scenario, seed = ("0.1", "0.2", "0.4")[index // 100 % 3], ("", "fail, at 12.toml")[index // 50 % 2], 1 + index % 50
        passes = rng.random() < 0.9
        metrics = {} if rng.random() < 0.01 else {"error_deg": rng.gauss(0, float(noise)), "lost": None}
        rows.append(row_of(index, axes={"imu.imu1.gyro.noise": noise, "scenario": scenario}, seed=seed, exit_code=0 if passes else 3,
                           digest={"imu1": f"{rng.getrandbits(256):064x}"}, figures={"imu1.samples": 1000, "imu1.late": rng.randrange(5)},
                           expect={"settles": passes}, test={"exit_code": 0, "metrics": metrics},
                           shortfalls=[] if passes else ["settles: 3.1, not below 3"]))
    return rows


class Folder:
    """A folder of a test's own, in which the program runs."""

    def __enter__(self):
        self._folder = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self._folder.name)
        return self

    def __exit__(self, *_):
        self._folder.cleanup()

    def run(self, *words, expected=0):
        done = subprocess.run([str(PROGRAM), *map(str, words)], cwd=self.path, capture_output=True, text=True, timeout=300)
        if done.returncode != expected:
            raise AssertionError(f"{words}: {done.returncode}\n{done.stdout}\n{done.stderr}")
        return done

    def collect(self, campaign, expected=0):
        """Returns (CSV, dump of the database, JSON lines) as texts."""
        self.run("collect", campaign, "--csv", "t.csv", "--sqlite", "t.db", "--json", "t.jsonl", expected=expected)
        return (self.path / "t.csv").read_bytes().decode(), self.dump("t.db"), (self.path / "t.jsonl").read_text()

    def dump(self, name):
        with sqlite3.connect(f"file:{self.path / name}?mode=ro", uri=True) as database:
            return "\n".join(database.iterdump())

    def left(self):
        return sorted(path.name for path in self.path.iterdir())


class TableTest(unittest.TestCase):
    def test_ten_thousand_rows(self):
        rows = rows_of(10_000, random.Random(1))
        with Folder() as folder:
            write_all(folder.path / "c", rows, 100)
            text, dump, lines = folder.collect("c")
            self.assertEqual(folder.left(), ["c", "t.csv", "t.db", "t.jsonl"])
            table = list(csv.DictReader(io.StringIO(text, newline="")))
            self.assertEqual(list(table[0]), ["case", "seed", "imu.imu1.gyro.noise", "scenario", "exit_code", "ended_by", "expect.settles",
                                              "digest.imu1", "imu1.samples", "imu1.late", "test.exit_code", "test.error_deg", "test.lost",
                                              "shortfalls", "error"])
            objects = [json.loads(line) for line in lines.splitlines()]
            database = sqlite3.connect(folder.path / "t.db")
            stored = list(database.execute("SELECT * FROM cases"))
            self.assertEqual((len(table), len(objects), len(stored)), (10_000, 10_000, 10_000))
            for row, fields, values, listed in zip(rows, table, stored, objects):
                metric = row["test"]["metrics"].get("error_deg")
                self.assertEqual(fields["test.error_deg"], "" if metric is None else repr(metric))
                expected = [row["case"], row["seed"], float(row["axes"]["imu.imu1.gyro.noise"]), row["axes"]["scenario"], row["exit_code"],
                            "end_of_capture", int(row["expect"]["settles"]), row["digest"]["imu1"], 1000, row["figures"]["imu1.late"], 0,
                            metric, None, "; ".join(row["shortfalls"]) or None, None]
                self.assertEqual(list(values), expected)
                self.assertEqual(list(fields.values())[4:11], [str(value) for value in expected[4:11]])
                self.assertEqual(listed["test.error_deg"], metric)
                self.assertIs(listed["expect.settles"], row["expect"]["settles"])
                self.assertEqual(list(listed), list(fields))
            mean = database.execute('SELECT avg("test.error_deg") FROM cases WHERE "imu.imu1.gyro.noise" = 0.2').fetchone()[0]
            self.assertAlmostEqual(mean, statistics.fmean(row["test"]["metrics"]["error_deg"] for row in rows if row["test"]["metrics"] and
                                                          row["axes"]["imu.imu1.gyro.noise"] == "0.2"))
            database.close()

    def test_the_same_table_in_any_order(self):
        """The shards in another order, in other divisions, and with copies that overlap; one run after another."""
        rng = random.Random(2)
        rows = rows_of(600, rng)
        # Columns that only some cases name, from the first and from a later shard on.
        rows[3]["figures"]["rare"] = 1
        rows[2]["figures"]["imu1.late"] = rows[1]["figures"]["imu1.late"] = 0
        del rows[2]["figures"]["imu1.late"]
        rows[590]["figures"] = {"late.only": 2.5, **rows[590]["figures"]}
        with Folder() as folder:
            write_all(folder.path / "a", rows, 100)
            expected = folder.collect("a")
            table = list(csv.DictReader(io.StringIO(expected[0])))
            # Counters are 0 where they are left out, also before the first one; other figures are not known.
            self.assertEqual([row["rare"] for row in table], ["1" if index == 3 else "0" for index in range(600)])
            self.assertEqual([row["late.only"] for row in table], ["2.5" if index == 590 else "" for index in range(600)])
            report = json.loads(folder.run("report", "a", "--figure", "rare", "--figure", "late.only", "--json", "-").stdout)["figures"]
            self.assertEqual((report["rare"]["runs"], report["rare"]["max"], report["late.only"]["runs"]), (600, 1, 1))
            self.assertAlmostEqual(report["rare"]["mean"], 1 / 600)
            for name, order in (("b", rng.sample(range(12), 12)), ("c", range(11, -1, -1))):
                write_campaign(folder.path / name, 600, 50)
                for shard in order:
                    write_shard(folder.path / name, rows[50 * shard:50 * shard + 50])
                self.assertEqual(folder.collect(name), expected)
            # A shard for each case, and files that are no shards.
            write_all(folder.path / "d", rows, 1)
            write_unfinished_shard(folder.path / "d", 100, 100)
            (folder.path / "d/shards/README").write_text("nothing")
            self.assertEqual(folder.collect("d"), expected)
            self.assertEqual(folder.run("collect", "d", "--csv", "-").stdout, expected[0])
            self.assertEqual(folder.run("collect", "a", "--csv", "/dev/stdout").stdout, expected[0])

    def test_memory_does_not_grow(self):
        """Ten times the cases take at most 4 MB more, where the rows themselves would take 14 MB."""
        # The peak of a child counts its parent's memory before exec(2): the parent is a small process.
        measure = "import os, sys; _, status, usage = os.wait4(os.spawnv(os.P_NOWAIT, sys.argv[1], sys.argv[1:]), 0); " \
                  "print(usage.ru_maxrss); sys.exit(status != 0)"
        # AddressSanitizer keeps freed memory for a while, which is no growth.
        at_once = "quarantine_size_mb=0:thread_local_quarantine_size_kb=0:allocator_release_to_os_interval_ms=0"
        environment = {**os.environ, "ASAN_OPTIONS": f"{os.environ.get('ASAN_OPTIONS', '')}:{at_once}"}
        peaks = []
        for cases in (2000, 20_000):
            with Folder() as folder:
                write_all(folder.path / "c", rows_of(cases, random.Random(9)), 200)
                done = subprocess.run([sys.executable, "-c", measure, str(PROGRAM), "collect", "c", "--csv", "t.csv", "--sqlite", "t.db"],
                                      cwd=folder.path, capture_output=True, text=True, check=True, env=environment)
                peaks.append(int(done.stdout))
        self.assertLess(peaks[1] - peaks[0], 4000, peaks)

    def test_hostile_names(self):
        """Names and values of every kind come out of CSV, SQLite and JSON as they went in."""
        axes = {name: value for name, value in zip(HOSTILE, reversed(HOSTILE))}
        figures = {f"f{name}": index for index, name in enumerate(HOSTILE)} | {"seed": 1, "CASE": 2, "case_2": 3}
        row = row_of(0, axes=axes, figures=figures, expect={name: True for name in HOSTILE}, shortfalls=HOSTILE, ended_by='"', error="a\0b",
                     test={"exit_code": 1, "metrics": {"text": "x,y", "truth": True, "list": [1, 2], "object": {"a": None}}})
        with Folder() as folder:
            write_all(folder.path / "a b'c", [row], 1)
            text, _, lines = folder.collect("a b'c", expected=3)
            names, values = csv.reader(io.StringIO(text, newline=""))
            fields = dict(zip(names, values))
            self.assertEqual(len(fields), len(names))
            for name, value in (axes | figures).items():
                if name not in ("seed", "CASE", "case_2"):
                    self.assertEqual(fields[name], str(value))
            self.assertEqual((fields["seed_2"], fields["CASE_2"], fields["case_2_2"]), ("1", "2", "3"))
            self.assertEqual((fields["shortfalls"], fields["error"], fields["test.text"]), ("; ".join(HOSTILE), "a\0b", "x,y"))
            self.assertEqual((fields["test.list.0"], fields["test.list.1"], fields["test.truth"]), ("1", "2", "1"))
            self.assertEqual(list(json.loads(lines)), names)
            database = sqlite3.connect(folder.path / "t.db")
            cursor = database.execute("SELECT * FROM cases")
            self.assertEqual([column[0] for column in cursor.description], names)
            stored = dict(zip(names, cursor.fetchone()))
            for name, value in axes.items():
                self.assertEqual(stored[name], value)
            self.assertEqual([name for name, in database.execute("SELECT name FROM sqlite_master")], ["cases"])
            database.close()
            # The commands that it prints are the shell's words again.
            report = folder.run("report", "a b'c", expected=3)
            self.assertIn(["imud", "campaign", "resume", "a b'c"], [shlex.split(row)[-4:] for row in report.stderr.splitlines()[-1:]])
            repeat = next(row for row in report.stdout.splitlines() if "campaign repeat" in row)
            self.assertEqual(shlex.split(repeat)[:5], ["imud", "campaign", "repeat", "a b'c", "0"])

    def test_damaged_shards(self):
        """What is cut, changed or missing is named with the command that repairs it; the others are in the table."""
        rows = rows_of(500, random.Random(3))
        damages = {"cut": lambda data: data[:len(data) // 2], "without its last byte": lambda data: data[:-1], "empty": lambda data: b"",
                   "changed": lambda data: data.replace(b'"imu1.samples":1000', b'"imu1.samples":1001', 1),
                   "without its footer": lambda data: data[:data.rindex(b"{")], "garbage": lambda data: b"\xff\0" * 100,
                   "a row too few": lambda data: b"".join(line for i, line in enumerate(data.splitlines(True)) if i != 7),
                   "of another plan": lambda data: data.replace(b'"plan":"6', b'"plan":"7', 1)}
        for name, damage in damages.items():
            with Folder() as folder, self.subTest(name):
                paths = write_all(folder.path / "c", rows, 100)
                data = paths[2].read_bytes()
                paths[2].write_bytes(damage(data))
                self.assertNotEqual(paths[2].read_bytes(), data)
                done = folder.run("collect", "c", "--csv", "t.csv", expected=3)
                self.assertIn(f"{paths[2].relative_to(folder.path)} ", done.stderr)
                self.assertIn("400 of 500 cases are complete; to run the others: imud campaign resume c\n", done.stderr)
                with open(folder.path / "t.csv", newline="") as file:
                    self.assertEqual([int(row["case"]) for row in csv.DictReader(file)], [*range(200), *range(300, 500)])
                self.assertIn("400 of 500 cases", folder.run("report", "c", expected=3).stdout)
                write_shard(folder.path / "c", rows[200:300])
                self.assertEqual(len(folder.run("collect", "c", "--csv", "-").stdout.splitlines()), 501)

    def test_imud_campaign_becomes_this_program(self):
        with Folder() as folder:
            write_all(folder.path / "c", rows_of(40, random.Random(10)), 20)
            for words, expected in ((("collect", "c", "--csv", "-"), 0), (("report", "c", "--worst", "imu1.late"), 0),
                                    (("collect", "--sqlite"), 2)):
                done = folder.run(*words, expected=expected)
                same = subprocess.run([str(PROGRAM.parent / "imud"), "campaign", *words], cwd=folder.path, capture_output=True, text=True,
                                      timeout=300)
                self.assertEqual((same.returncode, same.stdout, same.stderr), (expected, done.stdout, done.stderr))

    def test_missing_cases(self):
        rows = rows_of(300, random.Random(4))
        rows[5] |= {"exit_code": 1, "error": "imud.toml: cannot read it"}
        with Folder() as folder:
            write_campaign(folder.path / "c", 300, 100)
            self.assertEqual(folder.run("collect", "c", "--csv", "-", expected=3).stdout.splitlines(),
                             ["case,seed,exit_code,ended_by,shortfalls,error"])
            write_shard(folder.path / "c", rows[:100])
            write_shard(folder.path / "c", rows[200:])
            done = folder.run("collect", "c", "--sqlite", "t.db", expected=3)
            self.assertIn("the cases 100 to 199 are missing\n", done.stderr)
            self.assertIn("1 cases could not be run", done.stderr)
            self.assertIn("199 of 300 cases are complete", done.stderr)
            self.assertIn("could", done.stderr)

    def test_cases_behind_the_end_do_not_count(self):
        """A plan with `until` ends with the first shard at which the rate is known; a faster node has run others."""
        rows = [row_of(index, exit_code=3 if index == 7 or index >= 200 else 0, expect={"settles": index != 7}) for index in range(300)]
        with Folder() as folder:
            write_all(folder.path / "short", rows[:200], 50)
            write_all(folder.path / "long", rows, 50)
            expected = folder.collect("short")
            for until in ("cases pass rate within 1.5 % at 95 %", "settles pass rate within 1.5 % at 95 %"):
                write_campaign(folder.path / "long", 400, 50, until=until)  # the last 100 were not run at all
                self.assertEqual(folder.collect("long"), expected)
                report = json.loads(folder.run("report", "long", "--json", "-").stdout)
                self.assertEqual((report["cases"], report["found"], report["failed"]), (200, 200, 1))
                self.assertIn(f"{until}: reached after 200 of 400 cases: 199 of 200 passed, 97.22 to 99.91 %",
                              folder.run("report", "long").stdout)
            # A shard before the end is missing: nobody knows where it is.
            (folder.path / "long/shards/000000050-000000099.jsonl").unlink()
            self.assertIn("not yet reached after 50 of 400", folder.run("report", "long", expected=3).stdout)

    def test_an_old_table_stays_until_the_new_one_is_whole(self):
        with Folder() as folder:
            begin = '"seed":1,"exit_code":0,"ended_by":"end_of_capture","digest":{},"figures":'  # a good result
            write_all(folder.path / "c", ['{"case":0,' + begin + "{}}", '{"case":1,' + begin + "[1, {]}"], 2)
            (folder.path / "t.csv").write_text("old")
            done = folder.run("collect", "c", "--csv", "t.csv", "--sqlite", "t.db", expected=1)
            self.assertIn("case 1: its row cannot be read", done.stderr)
            self.assertEqual((folder.left(), (folder.path / "t.csv").read_text()), (["c", "t.csv"], "old"))

    def test_refusals(self):
        with Folder() as folder:
            shard = write_all(folder.path / "c", rows_of(4, random.Random(5)), 2)[0]
            (folder.path / "empty").mkdir()
            for words, text in ((("collect", "c"), "no table is asked for"), (("collect", "empty", "--csv", "-"), "no folder of a campaign"),
                                (("collect", "c", "--csv", "c/campaign.json"), "the campaign's own"),
                                (("collect", "c", "--csv", "c/plan.toml"), "the campaign's own"),
                                (("collect", "c", "--csv", shard), "is in the folder of the cases"), (("draw", "c"), "draw"),
                                (("collect", "c", "--csv", "a", "--sqlite", "a"), "give another file"),
                                (("collect", "c", "--csv", "a", "--worst", "x"), "--worst is no option of it"),
                                (("report", "c", "--csv", "a"), "--csv is no option of it"),
                                (("report", "c", "--figure", "imu1.sample"), "no case has it"),
                                (("report", "c", "--worst", "nothing"), "no case has it"),
                                (("report", "c", "--over", "nothing"), "there are imu.imu1.gyro.noise, scenario"),
                                (("report", "c", "--plot", "a.png"), "one --figure"),
                                (("report", "c", "--figure", "imu1.late", "--plot", "a.pdf"), "FILE.svg or FILE.png")):
                self.assertIn(text, folder.run(*words, expected=2).stderr, words)
            self.assertEqual(folder.left(), ["c", "empty"])
            self.assertIn("cannot write", folder.run("collect", "c", "--csv", "none/t.csv", expected=2).stderr)


class ReportTest(unittest.TestCase):
    def test_statistics(self):
        """Means, deviations and percentiles are those of Python's statistics module."""
        rows = rows_of(3000, random.Random(6))
        with Folder() as folder:
            write_all(folder.path / "c", rows, 250)
            report = json.loads(folder.run("report", "c", "--json", "-", "--worst", "test.error_deg", "--count", "3").stdout)
            self.assertEqual((report["cases"], report["found"], report["cases_of_percentiles"]), (3000, 3000, 3000))
            self.assertEqual(list(report["figures"]), ["expect.settles", "test.error_deg"])

            def expect(found, rows):
                numbers = [row["test"]["metrics"]["error_deg"] for row in rows if "error_deg" in row["test"]["metrics"]]
                self.assertEqual(found["runs"], len(numbers))
                self.assertAlmostEqual(found["mean"], statistics.fmean(numbers), 12)
                self.assertAlmostEqual(found["standard_deviation"], statistics.stdev(numbers), 12)
                cuts = statistics.quantiles(numbers, n=20, method="inclusive")
                for name, cut in (("p5", 0), ("p25", 4), ("p50", 9), ("p75", 14), ("p95", 18)):
                    self.assertAlmostEqual(found[name], cuts[cut], 12)
                self.assertEqual((found["min"], found["max"]), (min(numbers), max(numbers)))

            error, settles = report["figures"]["test.error_deg"], report["figures"]["expect.settles"]
            expect(error, rows)
            for noise in ("0.1", "0.2", "0.4"):
                chosen = [row for row in rows if row["axes"]["imu.imu1.gyro.noise"] == noise]
                expect(error["by"]["imu.imu1.gyro.noise"][noise], chosen)
                rate = settles["by"]["imu.imu1.gyro.noise"][noise]
                self.assertEqual((rate["runs"], rate["passes"]), (len(chosen), sum(row["expect"]["settles"] for row in chosen)))
                # The bounds solve (p - x)^2 = z^2 x (1 - x) / n.
                n, p, z = rate["runs"], rate["rate"], statistics.NormalDist().inv_cdf(0.975)
                for x in rate["wilson_95"]:
                    self.assertAlmostEqual((p - x) ** 2, z * z * x * (1 - x) / n, 12)
                self.assertTrue(rate["wilson_95"][0] < p < rate["wilson_95"][1])
            size = lambda row: abs(row["test"]["metrics"].get("error_deg", 0))
            worst = sorted(rows, key=size, reverse=True)[:3]
            self.assertEqual([(one["case"], abs(one["value"])) for one in report["worst"]["test.error_deg"]],
                             [(row["case"], size(row)) for row in worst])
            failed = [row["case"] for row in rows if row["exit_code"] != 0]
            self.assertEqual((report["failed"], [one["case"] for one in report["failures"]]), (len(failed), failed[:3]))
            self.assertEqual(report["failures"][0]["repeat"], f"imud campaign repeat c {failed[0]} --record case_{failed[0]}.pcapng")

            text = folder.run("report", "c", "--figure", "imu1.late", "--over", "scenario").stdout
            self.assertIn("imu1.late by scenario\n", text)
            self.assertNotIn("imu1.late by imu.imu1", text)
            self.assertNotIn("test.error_deg", text)

    def test_no_metric_at_all(self):
        """Absent numbers and NaN, which the rows have as null, do not count; a campaign without figures has a report."""
        with Folder() as folder:
            write_all(folder.path / "c", [row_of(index, figures={"a": None, "b": [None, 1.5][index % 2]}) for index in range(4)], 4)
            report = json.loads(folder.run("report", "c", "--figure", "b", "--json", "-").stdout)
            self.assertEqual((report["figures"]["b"]["runs"], report["figures"]["b"]["mean"]), (2, 1.5))
            self.assertIn("4 of 4 cases", folder.run("report", "c").stdout)

    def test_pictures(self):
        rows = rows_of(1200, random.Random(8))
        with Folder() as folder:
            write_all(folder.path / "c", rows, 600)
            axes = ("--over", "imu.imu1.gyro.noise", "--over", "scenario")
            begins = {0: "histogram,", 2: "fan,0.1,", 4: "heat_map,0,0,"}
            for figure in ("test.error_deg", "imu1.samples", "expect.settles"):
                for words, begin in begins.items():
                    for suffix in ("svg", "png"):
                        folder.run("report", "c", "--figure", figure, *axes[:words], "--plot", f"p.{suffix}")
                        self.assertGreater((folder.path / f"p.{suffix}").stat().st_size, 2000)
                    data = (folder.path / "p.plot.csv").read_text().splitlines()
                    if figure == "expect.settles":
                        begin = begin.replace("fan", "pass_rate")
                    self.assertTrue(data[1].startswith(begin), data)
                    if words == 4 and figure == "test.error_deg":
                        cell = [row["test"]["metrics"]["error_deg"] for row in rows if list(row["axes"].values()) == ["0.1", ""] and
                                row["test"]["metrics"]]
                        self.assertAlmostEqual(float(data[1].split(",")[3]), statistics.fmean(cell), 12)
                        self.assertEqual(data[1].split(",")[4], str(len(cell)))
                    if words == 0:
                        self.assertEqual(sum(int(row.split(",")[3]) for row in data[1:]),
                                         sum(1 for row in rows if figure != "test.error_deg" or row["test"]["metrics"]))
            # Values over time, in the order of their times; the rows lack some of them.
            over_time = [row_of(i, figures={"e": 1.5, "e@10": float(i), "e@2.5": i / 4.0 if i % 2 else None}) for i in range(100)]
            write_all(folder.path / "t", over_time, 100)
            text = folder.run("report", "t", "--figure", "e", "--over", "time", "--plot", "o.svg").stdout
            self.assertIn("\ne@2.5 ", text)
            data = (folder.path / "o.plot.csv").read_text().splitlines()
            self.assertEqual([row.split(",")[:3] for row in data[1:]], [["over_time", "2.5", "50"], ["over_time", "10", "100"]])
            quantiles = statistics.quantiles([float(i) for i in range(100)], n=20, method="inclusive")
            for cell, i in zip(data[2].split(",")[4:], (0, 4, 9, 14, 18), strict=True):
                self.assertAlmostEqual(float(cell), quantiles[i], 9)
            self.assertGreater((folder.path / "o.svg").stat().st_size, 2000)
            self.assertNotIn("e@10", folder.run("report", "t").stdout)
            self.assertIn("no case has imu1.late@TIME", folder.run("report", "c", "--figure", "imu1.late", "--over", "time", expected=2).stderr)
            # Another program's file is not replaced.
            (folder.path / "q.plot.csv").write_text("time_s,x\n")
            self.assertIn("move it", folder.run("report", "c", "--figure", "imu1.late", "--plot", "q.png", expected=2).stderr)


if __name__ == "__main__":
    unittest.main()
