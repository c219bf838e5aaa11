"""Writes the folder of a campaign, as `imud campaign run` leaves it, of rows that are made up.

usage: shard_files.py DIR CASES BATCH    to measure: rows of some 100 figures
"""
import hashlib
import json
import pathlib
import random
import sys

PLAN = hashlib.sha256(b"plan").hexdigest()
VERSION = "0.1.0"
BUILD = ""  # of imud, which calls it unknown; a test may set another one


def dump(value):
    """JSON as imud writes it, without blanks."""
    return json.dumps(value, separators=(",", ":"))


def row_of(index, **members):
    """A row with the members that every row has; `members` replaces some."""
    row = {"case": index, "identity": f"{index:064x}", "axes": {}, "seed": 1, "exit_code": 0, "ended_by": "end_of_capture", "digest": {},
           "figures": {}, "expect": {}, "shortfalls": [], "error": None}
    return row | members


def write_shard(folder, rows):
    """Writes consecutive rows, which are dictionaries or lines of text, as a whole shard; returns its path."""
    lines = [row if isinstance(row, str) else dump(row) for row in rows]
    first = json.loads(lines[0])["case"]
    last = first + len(lines) - 1
    text = dump({"campaign": 1, "plan": PLAN, "version": VERSION, "build": BUILD, "first": first, "last": last}) + "\n"
    text += "".join(line + "\n" for line in lines)
    path = pathlib.Path(folder) / "shards" / f"{first:09}-{last:09}.jsonl"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text + dump({"rows": len(lines), "sha256": hashlib.sha256(text.encode()).hexdigest()}) + "\n")
    return path


def write_unfinished_shard(folder, first, last):
    """Writes a part of a shard that a process of another host is writing (TemporaryFile of emulator/campaign/shards/shard.hpp)."""
    (pathlib.Path(folder) / "shards" / f".{first:09}-{last:09}.n2.example.boot-1.5.tmp").write_text("{")


def write_campaign(folder, cases, batch, **members):
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "campaign.json").write_text(dump({"plan": "/plans/plan.toml", "campaign": 1, "plan_sha256": PLAN, "cases": cases, "batch": batch,
                                                      "version": VERSION, "build": BUILD} | members))


def write_all(folder, rows, batch):
    """Writes campaign.json, and the rows in shards of `batch` cases; returns the paths of the shards."""
    write_campaign(folder, len(rows), batch)
    return [write_shard(folder, rows[first:first + batch]) for first in range(0, len(rows), batch)]


def measured_row(index, rng):
    """A row as long as that of an imu with all its counters."""
    figures = {f"imu1.counter_{i}": rng.randrange(100_000) for i in range(60)} | {f"truth.level_{i}": rng.random() for i in range(30)}
    return row_of(index, axes={"imu.imu1.gyro.angle_random_walk_deg_per_rt_hr": ["0.1", "0.2", "0.4"][index // 1000 % 3],
                               "capture": ["a.pcap", "b.pcap"][index // 3000 % 2], "scenario": ["", "fail_at_12.toml"][index // 500 % 2]},
                  seed=1 + index % 500, digest={"imu1": f"{rng.getrandbits(256):064x}"}, figures=figures,
                  expect={"settles": rng.random() < 0.98}, test={"exit_code": 0, "metrics": {"error_deg": rng.gauss(0, 1)}})


if __name__ == "__main__":
    folder, cases, batch = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    rng = random.Random(1)
    write_campaign(folder, cases, batch)
    # A thousand rows again and again, so that writing does not take longer than what is measured.
    tails = [dump(measured_row(index, rng))[len(dump({"case": index})) - 1:] for index in range(1000)]
    for first in range(0, cases, batch):
        write_shard(folder, [dump({"case": index})[:-1] + tails[index % 1000] for index in range(first, min(first + batch, cases))])
