"""The SBOM of the package imud: the mandatory fields of SPDX 2.3, every shared library that the programs need, as the loader finds
it, the headers that the sources include, and the chart library by the version that the program itself contains.

usage: sbom_test.py BUILD_FOLDER SOURCE_FOLDER

Clauses are of the SPDX specification 2.3 (github.com/spdx/spdx-spec, tag v2.3, folder chapters). A document was once validated by
schemas/spdx-schema.json of that tag.
"""
import functools
import json
import os
import pathlib
import re
import subprocess
import sys
import unittest

BUILD, SOURCE = (pathlib.Path(argument).resolve() for argument in (sys.argv.pop(1), sys.argv.pop(1)))
PROGRAMS = ("imud", "imu-allan", "imu-campaign", "imu-decode", "imu-fit", "imu-plot", "imu-truth")
# Libraries that are compiled in as headers, in part or as a whole; their first file, as the sources include it.
COMPILED_IN = ("eigen3/Eigen/Core", "boost/asio.hpp", "boost/beast.hpp", "boost/endian/conversion.hpp", "toml++/toml.h", "fmt/format.h",
               "spdlog/spdlog.h", "CLI/CLI.hpp", "nlohmann/json.hpp", "Random123/philox.h")


def write(**environment):
    return subprocess.run(["/usr/bin/python3", "-B", SOURCE / "tools/packaging/sbom.py", BUILD, BUILD, SOURCE / "tools/packaging/debian/changelog"],
                          env={"PATH": "/usr/bin:/bin:/usr/sbin:/sbin", **environment}, check=True, capture_output=True).stdout


@functools.cache
def owner(path):
    """The package of a file, by whichever of its paths dpkg has, without its architecture."""
    for form in (path, os.path.realpath(path), path.removeprefix("/usr")):
        search = subprocess.run(["dpkg-query", "--search", form], capture_output=True, text=True)
        if search.returncode == 0:
            return search.stdout.split(": ")[0].split(",")[0].split(":")[0]
    raise AssertionError(f"{path} is in no package")


class SbomTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.bytes = write(SOURCE_DATE_EPOCH="1700000000")
        cls.document = json.loads(cls.bytes)
        cls.packages = {package["name"]: package for package in cls.document["packages"]}
        cls.names = {package["SPDXID"]: package["name"] for package in cls.document["packages"]}

    def related(self, kind):
        """{package: comment} of the packages that imud has this relation to."""
        return {self.names[relation["relatedSpdxElement"]]: relation["comment"] for relation in self.document["relationships"]
                if relation["relationshipType"] == kind and relation["spdxElementId"] == self.packages["imud"]["SPDXID"]}

    def test_document(self):
        """Clauses 6.1 to 6.5, 6.8 and 6.9, and the relationship that clause 11 requires."""
        self.assertEqual((self.document["spdxVersion"], self.document["dataLicense"], self.document["SPDXID"]),
                         ("SPDX-2.3", "CC0-1.0", "SPDXRef-DOCUMENT"))
        self.assertRegex(self.document["name"], r"^imud-\S+$")
        self.assertRegex(self.document["documentNamespace"], r"^https://[^#\s]+$")
        self.assertEqual(self.document["creationInfo"]["created"], "2023-11-14T22:13:20Z")
        for creator in self.document["creationInfo"]["creators"]:
            self.assertRegex(creator, r"^(Person|Organization|Tool): \S")
        self.assertIn({"spdxElementId": "SPDXRef-DOCUMENT", "relationshipType": "DESCRIBES",
                       "relatedSpdxElement": self.packages["imud"]["SPDXID"]}, self.document["relationships"])

    def test_packages(self):
        """Clauses 7.1, 7.2 and 7.7; 7.8 is true, and requires a checksum of all files, if it is left out."""
        self.assertEqual(len(self.names), len(self.document["packages"]), "an identifier occurs twice")
        for package in self.document["packages"]:
            self.assertRegex(package["SPDXID"], r"^SPDXRef-[A-Za-z0-9.-]+$")
            self.assertTrue(package["name"] and package["versionInfo"] and package["downloadLocation"], package)
            self.assertIs(package["filesAnalyzed"], False)
            self.assertRegex(package["supplier"], r"^(Person|Organization): \S")
            if package["name"] != "imud":
                version = subprocess.run(["dpkg-query", "--show", "-f", "${Version}", package["name"]], capture_output=True, text=True).stdout
                self.assertEqual(package["versionInfo"], version, package["name"])

    def test_every_package_has_a_relation_and_no_other_is_named(self):
        ends = [(relation["spdxElementId"], relation["relatedSpdxElement"]) for relation in self.document["relationships"]]
        self.assertEqual({end for pair in ends for end in pair} - {"SPDXRef-DOCUMENT"}, set(self.names))

    def test_every_needed_library(self):
        linked = self.related("DYNAMIC_LINK")
        needed = set()
        for program in PROGRAMS:
            section = subprocess.run(["readelf", "--dynamic", "--wide", BUILD / program], capture_output=True, text=True, check=True).stdout
            names = re.findall(r"\(NEEDED\)\s+Shared library: \[(.*)\]", section)
            self.assertGreaterEqual(len(names), 8)
            loaded = dict(re.findall(r"^\s*(\S+) => (\S+)", subprocess.run(["ldd", BUILD / program], capture_output=True, text=True).stdout, re.MULTILINE))
            for name in names:
                package = owner(loaded[name])
                self.assertIn(package, linked, name)
                self.assertRegex(linked[package], rf"(^|; ){re.escape(name)} by ([\w, -]+, )?{program}(,|;|$)")
                needed.add(package)
        self.assertEqual(set(linked), needed)

    def test_libraries_that_are_compiled_in(self):
        compiled = self.related("STATIC_LINK")
        for header in COMPILED_IN:
            self.assertIn(owner(f"/usr/include/{header}"), compiled, header)
        # These are in the tests only.
        for header in ("gtest/gtest.h", "benchmark/benchmark.h"):
            self.assertNotIn(owner(f"/usr/include/{header}"), compiled, header)

    def test_the_library_of_the_page(self):
        stated = re.search(rb"Chart\.js v([\d.]+)\n", (BUILD / "imud").read_bytes()).group(1).decode()
        self.assertEqual(list(self.related("CONTAINS")), ["libjs-chart.js"])
        self.assertTrue(self.packages["libjs-chart.js"]["versionInfo"].startswith(stated))
        self.assertEqual(self.packages["libjs-chart.js"]["licenseDeclared"], "MIT")
        debian = (SOURCE / "tools/packaging/debian/copyright").read_text()
        self.assertRegex(debian, r"Files: chart\.min\.js\n.*\nLicense: Expat")

    def test_what_is_opened_later(self):
        relations = [(relation["spdxElementId"], relation["relatedSpdxElement"]) for relation in self.document["relationships"]
                     if relation["relationshipType"] == "RUNTIME_DEPENDENCY_OF"]
        rules = (SOURCE / "tools/packaging/debian/rules").read_text()
        sonames = re.findall(r"dpkg-query --search (lib[\w.+-]+\.so\.[\d.]+)", rules)
        self.assertGreaterEqual(len(sonames), 2)

        def stems(names):
            return sorted(re.match("lib[a-z]+", name)[0] for name in names)
        self.assertEqual(stems(self.names[library] for library, _ in relations), stems(sonames))
        self.assertEqual({user for _, user in relations}, {self.packages["imud"]["SPDXID"]})

    def test_the_same_of_the_same(self):
        self.assertEqual(write(SOURCE_DATE_EPOCH="1700000000", PYTHONHASHSEED="1", TZ="Pacific/Auckland", LC_ALL="C.UTF-8"), self.bytes)
        later = json.loads(write(SOURCE_DATE_EPOCH="1700000001"))
        # Another document is another name (clause 6.5.1).
        self.assertNotEqual(later["documentNamespace"], self.document["documentNamespace"])
        self.assertEqual(later["packages"], self.document["packages"])


if __name__ == "__main__":
    unittest.main()
