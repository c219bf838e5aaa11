#!/usr/bin/env python3
"""Writes the SBOM of the package imud, as SPDX 2.3 in JSON: Debian's packages that its programs are linked to, those whose headers
are compiled into them, and the library that the page of imud contains.

usage: sbom.py PROGRAMS_FOLDER BUILD_FOLDER CHANGELOG

PROGRAMS_FOLDER has the programs as they are installed, BUILD_FOLDER the build that has made them, by Ninja, which records the
headers. The date is SOURCE_DATE_EPOCH, or the changelog's: the same programs, headers and packages give the same document. Written
to standard output.

Clauses in comments are of the SPDX specification 2.3 (github.com/spdx/spdx-spec, tag v2.3, folder chapters).
"""
import datetime
import email.utils
import json
import os
import pathlib
import re
import subprocess
import sys
import urllib.parse
import uuid

# imud opens these itself (debian/rules has them among the dependencies).
LOADED = {"libpcap.so.0.8": "opened when a capture is read", "libncursesw.so.6": "opened by imud top"}
# The names of machine-readable copyright files, and SPDX's where these are others (clause 10, Annex A of the specification).
LICENSES = {"Expat": "MIT", "MIT": "MIT", "BSD-2-clause": "BSD-2-Clause", "BSD-3-clause": "BSD-3-Clause", "BSL-1.0": "BSL-1.0",
            "MPL-2": "MPL-2.0", "MPL-2.0": "MPL-2.0", "Zlib": "Zlib", "GPL-2": "GPL-2.0-only"}
PROJECT = "SPDXRef-imud"


def output_of(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


class Debian:
    """The installed packages: which one has a file, and what it is."""

    def __init__(self):
        release = dict(line.split("=", 1) for line in pathlib.Path("/etc/os-release").read_text().splitlines() if "=" in line)
        self._vendor = release["ID"].strip('"')
        self._release = release.get("VERSION_ID", release.get("VERSION_CODENAME", "")).strip('"')

    def owners(self, paths):
        """Returns {path: package} for names that dpkg-query --search accepts. Raises ValueError if one is in no package."""
        found = {}
        # dpkg knows files by the path of their installation: where /lib is a link, either of both.
        spellings = {form: path for path in sorted(paths) for form in (path, path.removeprefix("/usr"), os.path.realpath(path))}
        search = subprocess.run(["dpkg-query", "--search", *spellings], capture_output=True, text=True, env={**os.environ, "LC_ALL": "C"})
        for line in search.stdout.splitlines():
            packages, _, path = line.partition(": ")
            if path in spellings and not packages.startswith("diversion by"):
                found[spellings[path]] = packages.split(", ")[0]
        missing = sorted(set(paths) - set(found))
        if missing:
            raise ValueError(f"{missing[0]} is in no package, of {len(missing)} files")
        return found

    def library(self, soname, architecture):
        """Returns the package that has the shared library for the architecture, such as x86_64-linux-gnu."""
        for line in output_of("dpkg-query", "--search", soname).splitlines():
            packages, _, path = line.partition(": ")
            path = pathlib.PurePath(path)
            if path.name == soname and path.parent.name == architecture:
                return packages.split(", ")[0]
        raise ValueError(f"{soname} is in no package for {architecture}")

    def describe(self, package):
        """Returns the element of SPDX (clause 7) for an installed package."""
        fields = ("Package", "Version", "Architecture", "source:Package", "source:Version", "Maintainer")
        form = "\\n".join(f"${{{field}}}" for field in fields)
        name, version, architecture, source, source_version, maintainer = output_of("dpkg-query", "--show", "-f", form, package).split("\n")
        # The specification of package URLs leaves ':' as it is (github.com/package-url/purl-spec).
        purl = f"pkg:deb/{self._vendor}/{urllib.parse.quote(name, safe='')}@{urllib.parse.quote(version, safe=':')}" \
               f"?arch={architecture}&distro={self._vendor}-{self._release}"
        return {"SPDXID": "SPDXRef-" + re.sub(r"[^A-Za-z0-9.-]", "-", name.replace("+", "p")), "name": name, "versionInfo": version,
                "supplier": "Organization: " + re.sub(r"<(.*)>", r"(\1)", maintainer), "downloadLocation": "NOASSERTION",
                "filesAnalyzed": False, "sourceInfo": f"Debian's source package {source} {source_version}",
                "licenseConcluded": "NOASSERTION", "licenseDeclared": self._license(name), "copyrightText": "NOASSERTION",
                "externalRefs": [{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl", "referenceLocator": purl}]}

    @staticmethod
    def _license(package):
        """Returns the license of all files of the package, where its copyright file states one that SPDX has."""
        try:
            text = pathlib.Path(f"/usr/share/doc/{package}/copyright").read_text()
        except OSError:
            return "NOASSERTION"
        stated = re.search(r"^Files:\s*\*\s*\n(?:.+\n)*?License:[ \t]*(.*)$", text, re.MULTILINE)
        return LICENSES.get(stated.group(1).strip() if stated else "", "NOASSERTION")


def needed_libraries(program):
    return re.findall(r"^\s*NEEDED\s+(\S+)$", output_of("objdump", "-p", program), re.MULTILINE)


def architecture_of(build):
    """Returns what the compiler of the build compiles for, as in names of folders: x86_64-linux-gnu."""
    return output_of(cached(build, "CMAKE_CXX_COMPILER"), "-print-multiarch").strip()


def cached(build, name):
    return re.search(rf"^{name}:\w+=(.*)$", (build / "CMakeCache.txt").read_text(), re.MULTILINE).group(1)


def headers(build, programs):
    """Returns all files outside the source tree and the build that the compiler has read for these programs."""
    inputs = output_of("ninja", "-C", str(build), "-t", "inputs", *programs).split()
    compiled = [path for path in inputs if path.endswith((".o", ".gch"))]  # objects, precompiled headers
    own = tuple(f"{os.path.realpath(folder)}/" for folder in (build, cached(build, "CMAKE_HOME_DIRECTORY")))
    found = set()
    for line in output_of("ninja", "-C", str(build), "-t", "deps", *compiled).splitlines():
        if line.startswith("    "):
            path = os.path.normpath(os.path.join(build, line.strip()))
            if not os.path.realpath(path).startswith(own):
                found.add(path)
    if not found:
        raise ValueError(f"{build} has no record of headers: it was not built by Ninja, or not here")
    return found


def main(programs_folder, build_folder, changelog):
    programs_folder, build = pathlib.Path(programs_folder), pathlib.Path(build_folder).resolve()
    text = pathlib.Path(changelog).read_text()
    version = re.match(r"imud \((.*?)\)", text).group(1)
    date = email.utils.parsedate_to_datetime(re.search(r"^ -- .*>  (.*)$", text, re.MULTILINE).group(1)).timestamp()
    created = datetime.datetime.fromtimestamp(int(os.environ.get("SOURCE_DATE_EPOCH", date)), datetime.timezone.utc)
    names = ("imud", "imu-allan", "imu-campaign", "imu-decode", "imu-fit", "imu-plot", "imu-truth")
    debian, architecture = Debian(), architecture_of(build)

    users = {}  # of libraries
    for program in names:
        for soname in needed_libraries(programs_folder / program):
            users.setdefault(soname, []).append(program)
    relations = {}  # (kind, package) -> words
    for soname, programs in users.items():
        kind = "DYNAMIC_LINK", debian.library(soname, architecture)
        relations.setdefault(kind, []).append(f"{soname} by {', '.join(programs)}")
    for soname, reason in LOADED.items():
        relations["RUNTIME_DEPENDENCY_OF", debian.library(soname, architecture)] = [f"{soname}, {reason}"]
    for package in set(debian.owners(headers(build, names)).values()):
        relations["STATIC_LINK", package] = ["its headers are compiled into the programs"]
    chart = cached(build, "chart_js")
    relations["CONTAINS", debian.owners([chart])[chart]] = [f"{pathlib.Path(chart).name}, in the page of imud"]

    elements = {package: debian.describe(package) for package in {package for _, package in relations}}
    packages = sorted(elements.values(), key=lambda element: element["SPDXID"])
    relationships = [{"spdxElementId": "SPDXRef-DOCUMENT", "relationshipType": "DESCRIBES", "relatedSpdxElement": PROJECT}]
    for (kind, package), words in sorted(relations.items()):
        ends = PROJECT, elements[package]["SPDXID"]
        if kind.endswith("_OF"):
            ends = ends[::-1]
        relationships.append({"spdxElementId": ends[0], "relationshipType": kind, "relatedSpdxElement": ends[1],
                              "comment": "; ".join(sorted(words))})
    project = {"SPDXID": PROJECT, "name": "imud", "versionInfo": version, "supplier": "Organization: The imud authors",
               "downloadLocation": "NOASSERTION", "filesAnalyzed": False, "licenseConcluded": "MIT", "licenseDeclared": "MIT",
               "copyrightText": "2026, the imud authors", "primaryPackagePurpose": "APPLICATION"}
    document = {"spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": "SPDXRef-DOCUMENT",
                "name": f"imud-{version}-{architecture}",
                "creationInfo": {"created": created.strftime("%Y-%m-%dT%H:%M:%SZ"), "creators": [f"Tool: imud-sbom-{version}"]},
                "packages": [project, *packages], "relationships": relationships}
    # Clause 6.5.2: a UUID of version 5 that follows from the content, below the place for those without a site.
    content = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(document, sort_keys=True))
    document["documentNamespace"] = f"https://spdx.org/spdxdocs/{document['name']}-{content}"
    json.dump(document, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
