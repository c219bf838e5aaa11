"""The manual has every command, option, name, setting, counter, key, method, kind of fault and scenario; mandoc warns of nothing.

usage: manual_test.py BUILD_FOLDER SOURCE_FOLDER
"""
import json
import re
import shlex
import subprocess
import tempfile
import unittest

from stated import DOCUMENTS, SOURCE, commands, keys, methods, names, options, output


def rendered(page):
    text = output("mandoc", "-T", "utf8", "-O", "width=100", page)
    return re.sub(r".\x08", "", text)


class ManualTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.pages = {path.name: rendered(path) for path in sorted((DOCUMENTS / "man").rglob("*.*"))}

    def test_no_warnings(self):
        pages = sorted((DOCUMENTS / "man").rglob("*.*"))
        self.assertEqual(len(pages), 39)
        checked = subprocess.run(["mandoc", "-T", "lint", "-W", "warning", *pages], capture_output=True, text=True)
        self.assertEqual((checked.returncode, checked.stdout), (0, ""))

    def test_every_command_and_option(self):
        count = 0
        for words in commands():
            page = self.pages["-".join(words) + ".1"]
            for option in options(words):
                self.assertRegex(page, rf"(?m)^ +(-\w, )?{option}(,|\s|$)", words)
                count += 1
        self.assertGreater(count, 120)

    def test_every_name(self):
        products, truth = self.pages["imud-products.7"], self.pages["imud-truth.7"]
        for kinds, page in ((("protocol",), products), (("preset",), products), (("truth format",), truth)):
            self.assertGreater(len(names(*kinds)), 10)
            for name in names(*kinds):
                self.assertRegex(page, rf"(?m)^ +{re.escape(name)}( |$)")
        for name in names("transport"):
            self.assertRegex(truth, rf"(?m)^ +{name}:")
            self.assertRegex(products, rf"(?m)^ +{name}:")

    def test_every_setting_and_counter(self):
        listed = json.loads(output("imud", "list", "--json"))
        pages = {"protocol": self.pages["imud-products.7"], "truth format": self.pages["imud-truth.7"]}
        count = 0
        for name in listed:
            for setting in name.get("settings", []) + name.get("counters", []):
                prefix = "truth." if name["kind"] == "truth format" else ""
                self.assertRegex(pages[name["kind"]], rf"(?m)^ +(counter )?{re.escape(prefix + setting['key'])}( |$)")
                count += 1
        self.assertGreater(count, 150)

    def test_every_key(self):
        found = keys()
        self.assertGreater(len(found), 140)
        for key in sorted(found):
            self.assertRegex(self.pages["imud.toml.5"], rf"(?m)^ +([\w.]+, )*{key}(,|\s|$)")

    def test_every_fault_and_scenario(self):
        page = self.pages["imud-scenario.5"]
        kinds = {fault["name"] for fault in json.loads(output("imud", "list", "faults", "--json"))}
        self.assertGreater(len(kinds), 40)
        for kind in sorted(kinds):
            self.assertRegex(page, rf"kind: {kind}\b")
        for path in (SOURCE / "tools/scenarios").glob("*.toml"):
            self.assertRegex(page, rf"(?m)^ +{re.escape(path.name)}$")

    def test_every_method(self):
        found = methods()
        self.assertGreater(len(found), 10)
        for method in found:
            self.assertRegex(self.pages["imud-ctl.1"], rf"(?m)^ +([\w.]+, )*{re.escape(method)}(,|\s|$)")

    def test_every_column(self):
        count = 0
        for name in json.loads(output("imud", "list", "--json")):
            for group in name.get("columns", []):
                self.assertRegex(self.pages["imud-truth.7"], rf"(?m)^ +{re.escape(', '.join(group['names']))}(\n +| +){group['need']}: ")
                count += 1
        self.assertGreater(count, 10)

    def test_every_text_is_whole(self):
        """No option is described by a full stop alone, and no summary is cut."""
        for name, page in self.pages.items():
            self.assertNotRegex(page, r"(?m)^ +\.$", name)
        self.assertRegex(self.pages["imud-replay.1"], r"(?m)^ +--jobs N.*\n* +Processes for the seeds")
        self.assertRegex(self.pages["imud-list.1"], r"imud-list - show protocols, truth formats, transports and\s+presets")
        self.assertRegex(self.pages["imud-status.1"], r"EXIT STATUS\n +0 a run has answered")

    def test_every_page_that_is_named_is_there(self):
        count = 0
        for name, page in self.pages.items():
            text = re.sub(r"\s+", " ", page)
            for path in re.findall(r"(\S*)\bREADME\.md pages|([\w/.-]+\.md)\b", text):
                # Documents of others have other names.
                if not path[1] or not path[1].startswith(("/usr/share/imud/", "core/", "emulator/", "protocols/", "tests/", "tools/", "transports/",
                                                          "control/", "faults/", "web/")):
                    continue
                self.assertTrue(path[1].startswith("/usr/share/imud/"), f"{name}: {path[1]}")
                self.assertTrue((SOURCE / path[1].removeprefix("/usr/share/imud/")).is_file(), f"{name}: {path[1]}")
                count += 1
            self.assertNotRegex(text, "of this folder|compares these tables", name)
        self.assertGreater(count, 10)
        self.assertIn("its keys are in imud-scenario(5)", re.sub(r"\s+", " ", self.pages["imud.toml.5"]))

    def test_the_first_steps(self):
        """The examples of imud(1) that end by themselves, as they stand, in an empty folder."""
        page = self.pages["imud.1"]
        self.assertIn("Truth is the true motion of the vehicle", page)
        self.assertIn("systemctl enable --now imud@NAME", page)
        examples = [line.split("    #")[0].strip() for line in page.split("EXAMPLES\n")[1].split("\nFILES")[0].splitlines()]
        with tempfile.TemporaryDirectory() as folder:
            run = [line for line in examples if line.startswith(("imud init", "imud check"))]
            self.assertEqual(len(run), 3)
            for line in run:
                output(*shlex.split(line), cwd=folder)
            for line in ("imud run", "imu-truth coning --to udp:127.0.0.1:9810", "imu-decode vectornav pty:imu1"):
                self.assertIn(line, examples)


if __name__ == "__main__":
    unittest.main()
