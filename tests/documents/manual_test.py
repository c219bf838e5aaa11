"""The manual has every command, option, name, setting, counter, key, method, kind of fault and scenario; mandoc warns of nothing.

usage: manual_test.py BUILD_FOLDER SOURCE_FOLDER
"""
import json
import re
import subprocess
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
        self.assertEqual(len(pages), 31)
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

if __name__ == "__main__":
    unittest.main()
