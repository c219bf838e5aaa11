#!/usr/bin/env python3
"""Pairs of options and parts of a configuration: what `imud check` accepts runs, or names why it is not complete.

IMUD_PAIRS=1000 sets how many pairs are tried. The pairs are the same each time: each part is in about as many of them.
"""
import itertools
import json
import os
import pathlib
import random
import subprocess
import unittest

import numpy

from support import PROGRAMS, SOURCE, RunTest

PAIRS = int(os.environ.get("IMUD_PAIRS", "90"))
CAPTURES = SOURCE / "tests/captures"

RANGES = "rate_hz = 200\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 200\n"
ENTRIES = [entry for entry in json.loads(subprocess.run([PROGRAMS / "imud", "list", "--json"], capture_output=True, check=True).stdout)
           if entry["kind"] == "protocol"]
CAN = {entry["name"] for entry in ENTRIES if entry["link"] == "CAN"}
WITH_RANGES = {entry["name"] for entry in ENTRIES if "rate_hz" not in entry}  # no product, which has its own
PRODUCTS = ["csv", "stim300", "mip", "vectornav", *sorted(CAN)]


def fault(text):
    return {"tables": f"[[fault]]\nat_s = 0.3\nfor_s = 0.4\n{text}\n"}


# Name of the part: its group, of which a pair has one part alone, and what it adds. `inert`: the measurements' bytes
# are those without it.
PARTS = {
    **{f"protocol {name}": ("product", {"protocol": name}) for name in PRODUCTS},
    "clock lockstep": ("clock", {"root": "clock = 'lockstep'\n"}),
    "clock realtime": ("clock", {"root": "clock = 'realtime'\n"}),
    "seed": ("seed", {"root": "seed = 18446744073709551615\n"}),
    "--summary": ("summary", {"options": ["--summary", "{folder}/s.json"], "inert": True}),
    "--summary -": ("summary", {"options": ["--summary", "-"], "inert": True}),
    "--labels": ("labels", {"options": ["--labels", "{folder}/l.csv"], "inert": True}),
    "--labels json": ("labels", {"options": ["--labels", "{folder}/l.json"], "inert": True}),
    "--junit": ("junit", {"options": ["--junit", "{folder}/j.xml"], "inert": True}),
    "--quality": ("quality", {"options": ["--quality", "{folder}/q.json"], "inert": True}),
    "--record": ("record", {"options": ["--record", "{folder}/r.pcapng"], "inert": True}),
    "--record -": ("record", {"options": ["--record", "-"], "inert": True}),
    "--record-max-mb": ("record", {"options": ["--record", "{folder}/r.pcapng", "--record-max-mb", "1"], "inert": True}),
    "--log-every": ("log", {"options": ["--log-every", "0.1"], "inert": True}),
    "--verbose": ("verbose", {"options": ["--verbose"], "inert": True}),
    "--require": ("require", {"options": ["--require", "a.samples>=1"], "inert": True}),
    "--require more": ("require", {"options": ["--require", "a.samples>=1000000"], "inert": True}),
    "--for": ("for", {"options": ["--for", "0.7"]}),
    "--npy": ("npy", {"options": ["--npy", "{folder}/x.npy"]}),
    "--npy --seeds": ("npy", {"options": ["--npy", "{folder}/x.npy", "--seeds", "3..5"]}),
    "--npy --jobs": ("npy", {"options": ["--npy", "{folder}/x.npy", "--jobs", "3"]}),
    "--seeds": ("npy", {"options": ["--seeds", "3..5", "--set=imu.*.port=file:{folder}/o_{seed}"]}),
    "--jobs": ("npy", {"options": ["--jobs", "2"]}),
    "web": ("web", {"root": "[web]\nlisten = '127.0.0.1:0'\n", "inert": True}),
    "control": ("control", {"root": "[control]\nsocket = '{folder}/c'\n", "inert": True}),
    "control faults": ("control", {"root": "[control]\nsocket = '{folder}/c'\nfaults = true\n", "inert": True}),
    "no control": ("control", {"root": "[control]\nsocket = 'none'\n", "inert": True}),
    "realtime keys": ("realtime", {"root": "[realtime]\nspin_us = 20\npriority = 0\nlock_memory = false\n", "inert": True}),
    "model ideal": ("model", {"imu": "model = 'ideal'\n"}),
    "model white": ("model", {"imu": "model = 'white'\n"}),
    "model stim300": ("model", {"imu": "model = 'stim300'\n"}),
    "model vn-100": ("model", {"imu": "model = 'vn-100'\n"}),
    "bias": ("bias", {"imu": "gyro.bias_deg_per_s = [1, 2, 3]\n"}),
    "turn-on bias": ("turn-on", {"imu": "gyro.turn_on_bias_deg_per_hr = 100\n"}),
    "g-sensitivity": ("g", {"imu": "gyro.g_sensitivity_deg_per_hr_per_g = 50\n"}),
    "random walk": ("walk", {"imu": "accelerometer.acceleration_random_walk_m_per_s2_per_rt_s = 1e-4\n"}),
    "bandwidth": ("filter", {"imu": "gyro.bandwidth_hz = 40\n"}),
    "internal rate": ("internal", {"imu": "internal_rate_hz = 4000\n"}),
    "jitter": ("jitter", {"imu": "sampling_jitter_us = 20\n"}),
    "phase": ("phase", {"imu": "phase_us = 700\n"}),
    "clock error": ("ppm", {"imu": "clock_error_ppm = 50\n"}),
    "mounting": ("mounting", {"imu": "mounting.position_m = [1, 2, 3]\nmounting.yaw_pitch_roll_deg = [10, 20, 30]\n"}),
    "increments memo": ("increments", {"imu": "increments.delta_velocity = 'memo'\n"}),
    "increments integral": ("increments", {"imu": "increments.delta_angle = 'integral'\n"}),
    "rest": ("before", {"imu": "before_first = 'rest'\n"}),
    "temperature": ("temperature", {"imu": "temperature.start_c = 40\n"}),
    "trigger": ("sync", {"imu": "sync.trigger_port = 'pty:{folder}/trigger'\n"}),
    "navigation": ("navigation", {"imu": "navigation.position_m = [1, 1, 2]\n"}),
    "magnetometer": ("magnetometer", {"imu": "magnetometer.bias_ut = [1, 0, 0]\n"}),
    "pace line": ("pace", {"imu": "pace = 'line'\n"}),
    "second port": ("second", {"imu": "second_port = 'file:{folder}/o2'\n"}),
    "earth": ("earth", {"root": "[earth]\nframe = 'local'\norigin = [47.5, 8.5, 400]\n"}),
    "second imu": ("second imu", {"tables": "[[imu]]\nname = 'b'\nprotocol = 'mip'\nport = 'file:{folder}/o3'\n"}),
    "delay": ("delay", {"truth": "delay_ms = 20\n"}),
    "no extrapolation": ("extrapolate", {"truth": "extrapolate_ms = 0\n"}),
    "silence": ("stopped", {"truth": "when_stopped = 'silence'\n"}),
    "flag": ("stopped", {"truth": "when_stopped = 'flag'\n"}),
    "derived rate": ("derived", {"truth": "rate = 'derived'\n"}),
    "gap": ("gap", {"truth": "max_gap_ms = 100\n"}),
    "truth csv": ("format", {"format": "csv"}),
    "truth jsbsim": ("format", {"format": "jsbsim"}),
    "truth gz": ("format", {"format": "gz"}),
    "truth record": ("format", {"format": "record"}),
    "gyro bias": ("fault", fault("target = 'gyro'\nkind = 'bias'\nvalue_deg_per_s = 1")),
    "gyro drawn": ("fault", fault("target = 'gyro.x'\nkind = 'noise'\nfactor = {uniform = [2, 3]}\nprobability = 0.5")),
    "temperature stuck": ("fault", fault("target = 'temperature'\nkind = 'stuck'")),
    "messages missing": ("fault", fault("target = 'message'\nkind = 'missing'\neach = 0.5")),
    "messages late": ("fault", fault("target = 'message'\nkind = 'late'\ndelay_ms = 20")),
    "other settings": ("fault", fault("target = 'message'\nkind = 'other_settings'")),
    "clock jump": ("fault", fault("target = 'clock'\nkind = 'jump'\nvalue_s = 1")),
    "self test": ("fault", fault("target = 'device'\nkind = 'self_test_failed'")),
    "wire silence": ("fault", fault("target = 'wire'\nkind = 'silence'")),
    "wire bits": ("fault", fault("target = 'wire'\nkind = 'bit_errors'\nvalue = 1e-4")),
    "bus off": ("fault", fault("target = 'wire'\nkind = 'bus_off'")),
    "power off": ("fault", fault("target = 'power'\nkind = 'off'")),
    "truth frozen": ("fault", fault("target = 'truth'\nkind = 'frozen'")),
    "truth lost": ("fault", fault("target = 'truth'\nkind = 'lost'")),
    "two faults": ("fault", {"tables": fault("target = 'gyro'\nkind = 'dead'")["tables"] +
                             fault("target = 'wire'\nkind = 'disconnect'")["tables"]}),
    "expect": ("expect", {"tables": "[[expect]]\nwhat = 'host_is_silent'\nwithin_s = 0.1\n"}),
    "expect more": ("expect", {"tables": "[[expect]]\nwhat = 'host_sends'\nwithin_s = 0.1\n"}),
    "scenario": ("scenario", {"options": ["--scenario", f"{SOURCE}/tools/scenarios/stuck_gyro.toml"]}),
}
NO_ARRAY = "--npy", "--npy --seeds", "--npy --jobs"


def chosen(count):
    """Returns pairs of parts of different groups: in the order of a draw, each of those whose parts are rarest so far."""
    every = [pair for pair in itertools.combinations(PARTS, 2) if PARTS[pair[0]][0] != PARTS[pair[1]][0]]
    random.Random(24).shuffle(every)
    used, taken = dict.fromkeys(PARTS, 0), []
    level = 0
    while every and len(taken) < count:
        left = []
        for pair in every:
            if len(taken) < count and max(used[name] for name in pair) <= level:
                taken.append(pair)
                for name in pair:
                    used[name] += 1
            else:
                left.append(pair)
        every, level = left, level + 1
    return taken


class Pairs(RunTest):
    def setUp(self):
        super().setUp()
        self.truths = {}
        self.sent = {}
        csv = self.folder / "truth.csv"
        subprocess.run([PROGRAMS / "imu-truth", "spiral", "--rate", "100", "--for", "1", "--csv", csv], check=True)
        subprocess.run(["gzip", "-k", csv], check=True)
        self.truths = {"csv": ("csv", csv), "gz": ("csv", f"{csv}.gz"),
                       "jsbsim": ("jsbsim", f"{CAPTURES}/jsbsim_c172_10s.pcap?port=5140")}

    def arguments(self, parts, folder):
        """Writes the configuration with these parts; returns its path and the options."""
        texts = {"root": "", "truth": "", "imu": "", "tables": "", "protocol": "native", "format": "csv", "options": []}
        roots = []
        for part in parts:
            for key, value in PARTS[part][1].items():
                if key == "root":
                    roots.insert(0 if not value.startswith("[") else len(roots), value)
                elif key in ("protocol", "format"):
                    texts[key] = value
                elif key != "inert":
                    texts[key] = texts[key] + value
        protocol = texts["protocol"]
        file_format, capture = self.truths.get(texts["format"], self.truths["csv"])
        port = "canfile:{folder}/o.log" if protocol in CAN else "file:{folder}/o"
        text = ("".join(roots) if any("clock" in root for root in roots) else "clock = 'fast'\n" + "".join(roots)) + \
            f"[truth]\nport = '{'pcap' if file_format == 'jsbsim' else 'file'}:{capture}'\nformat = '{file_format}'\n{texts['truth']}" + \
            f"[[imu]]\nname = 'a'\nprotocol = '{protocol}'\nport = '{port}'\n" + \
            (RANGES if protocol in WITH_RANGES else "") + texts["imu"] + texts["tables"]
        config = folder / "imu.toml"
        fill = lambda value: str(value).replace("{folder}", str(folder))
        config.write_text(fill(text))
        options = [fill(option) for option in texts["options"]]
        if texts["format"] == "record":
            record = folder / "of.pcapng"
            subprocess.run([PROGRAMS / "imud", "replay", config, capture, "--fast", "--record", record, "-q"],
                           capture_output=True)
            capture = record
        return config, capture, options

    def run_with(self, parts):
        """Returns whether `check` accepts these parts, the exit code, the errors, and the bytes of the imu's port."""
        folder = pathlib.Path(self.new_folder())
        config, capture, options = self.arguments(parts, folder)
        scenario = options[options.index("--scenario"):][:2] if "--scenario" in options else []
        checked = subprocess.run([PROGRAMS / "imud", "check", config, *scenario], capture_output=True, text=True,
                                 timeout=60)
        self.assertIn(checked.returncode, (0, 2), (parts, checked.stderr))
        if checked.returncode == 2:
            self.assertRegex(checked.stderr, r"imu\.toml|\.toml:\d+: |\d+ fault", parts)
            return False, 2, checked.stderr, b"", folder
        done = subprocess.run([PROGRAMS / "imud", "replay", config, capture, *options], capture_output=True, timeout=120)
        sent = next((path.read_bytes() for path in (folder / "o", folder / "o.log") if path.exists()), b"")
        return True, done.returncode, done.stderr.decode(), sent, folder

    def new_folder(self):
        self.runs = getattr(self, "runs", 0) + 1
        folder = self.folder / str(self.runs)
        folder.mkdir()
        return folder

    def bytes_without(self, part):
        """Returns what the imu sends with one part alone."""
        if part not in self.sent:
            self.sent[part] = self.run_with([part])[3]
        return self.sent[part]

    def test_each_pair_runs_or_names_why_not(self):
        pairs = chosen(PAIRS)
        self.assertEqual(len(pairs), PAIRS)
        ran, refused = 0, 0
        for pair in pairs:
            with self.subTest(pair=pair):
                accepted, code, errors, sent, folder = self.run_with(pair)
                if not accepted:
                    refused += 1
                    continue
                ran += 1
                self.assertIn(code, (0, 1, 2, 3), errors)
                for word in "terminate", "std::", "no scheme", "AddressSanitizer", "Assertion":
                    self.assertNotIn(word, errors)
                if code == 3:
                    self.assertRegex(errors, r"error (incomplete: \S|expected \S|required \S|seed \d+(:| is incomplete:) \S)")
                elif code == 2:  # two options, of which `check` knows nothing, or a capture of another kind
                    self.assertRegex(errors, r"--\w|standard output|clock|port|of\.pcapng|capture|sync|truth")
                elif code == 1:
                    self.assertRegex(errors, r"no measurement|no truth|incomplete: ")
                inert = [part for part in pair if PARTS[part][1].get("inert")]
                if code in (0, 3) and len(inert) == 1 and "clock realtime" not in pair:
                    other = pair[1 - pair.index(inert[0])]
                    self.assertEqual(sent, self.bytes_without(other), "the bytes differ without a word")
                array = [part for part in pair if part in NO_ARRAY]
                if array and code in (0, 3):
                    self.check_array(pair, array[0], folder)
        print(f"{len(pairs)} pairs: {ran} ran, {refused} refused by check", flush=True)
        self.assertGreater(ran, 0.6 * len(pairs))

    def check_array(self, pair, array, folder):
        """The array of --npy has what imu-decode has of the bytes that are sent without it."""
        paths = sorted(folder.glob("*_truth.npy"))
        self.assertEqual(len(paths), 1)
        measured = numpy.load(folder / "x.npy")
        if array == "--npy --seeds" or "second imu" in pair:
            return
        other = pair[1 - pair.index(array)]
        parts = PARTS[other][1]
        if "options" in parts:
            return
        sent = self.bytes_without(other)
        suffix = ".log" if parts.get("protocol") in CAN else ""
        file = folder / f"again{suffix}"
        file.write_bytes(sent)
        subprocess.run([PROGRAMS / "imu-decode", parts.get("protocol", "native"),
                        f"{'canfile' if suffix else 'file'}:{file}", "--quiet", "--npy", folder / "again.npy"],
                       capture_output=True, timeout=60)
        self.assertEqual(numpy.load(folder / "again.npy").tobytes(), measured[0].tobytes(), "the array differs")


if __name__ == "__main__":
    unittest.main()
