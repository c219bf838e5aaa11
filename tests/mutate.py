#!/usr/bin/python3
"""Puts small faults into the code, one at a time, and counts how many of them the folder's tests notice.

It works in a copy of the tree. A mutant that the compiler refuses is not counted; one whose tests fail, crash or exceed
the time limit is noticed. Only the tests of the file's own folder are run: another folder's may notice more.
"""
import argparse
import contextlib
import dataclasses
import pathlib
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
FOLDERS = ("core", "protocols", "transports", "emulator", "tools")

# clang-format puts binary operators between spaces; the brackets of templates therefore do not match.
OPERATORS = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "+": "-", "-": "+", "*": "/", "/": "*",
             "%": "*", "&&": "||", "||": "&&", "&": "|", "|": "&", "+=": "-=", "-=": "+=", "*=": "/="}
SWAPS = {"true": "false", "false": "true", "std::min": "std::max", "std::max": "std::min", "++": "--", "--": "++"}
LITERAL = re.compile(r'"(?:\\.|[^"\\])*"|(?<![\w])\'(?:\\.|[^\'\\])\'|//.*')
NUMBER = re.compile(r"(?<![\w.'])(0x[0-9A-Fa-f]+|\d+\.\d+|\d+\.|\d+)(?=(?:[eE][-+]?\d+)?[uUlLfF]*(?![\w.']))")
STATEMENT = re.compile(r"\s+(?!return\b|break\b|continue\b|using\b|case\b|default\b|else\b|throw\b|static_assert\b)"
                       r"(?:[\w:.\[\]]|->|\(\*?\w+\))+(?:\(.*\)| (?:[-+*/|&^]|<<|>>)?= .*|\+\+|--);$")


@dataclasses.dataclass(frozen=True)
class Mutant:
    path: str
    line: int  # from 1
    before: str
    after: str


def mutants_of_line(path, number, line, previous):
    """Every mutant of one line of code."""
    code = LITERAL.sub(lambda match: " " * len(match[0]), line)
    if not code.strip() or code.lstrip().startswith(("#", "static_assert", "using ", "template", "extern ")):
        return
    if ".reserve(" in code:  # Nearly every mutant is equivalent.
        return
    def change(begin, end, text):
        return Mutant(path, number, line, line[:begin] + text + line[end:])
    for match in re.finditer(r"(?<= )(\S+)(?= |$)", code):
        if match[1] in OPERATORS:
            yield change(match.start(1), match.end(1), OPERATORS[match[1]])
    for old, new in SWAPS.items():
        for match in re.finditer(r"(?<![\w:+-])" + re.escape(old) + r"(?![\w+-])|(?<=\w)" + re.escape(old) + r"(?=[;)])"
                                 if old in ("++", "--") else r"\b" + old + r"\b", code):
            yield change(match.start(), match.end(), new)
    for match in NUMBER.finditer(code):
        number_text = match[1]
        if "." in number_text:
            changed = repr(float(number_text) * 1.5 if float(number_text) else 1.0)
        else:
            is_octal = re.fullmatch("0[0-7]+", number_text)
            changed = f"0{int(number_text, 8) + 1:o}" if is_octal else str(int(number_text, 0) + 1)
        yield change(match.start(), match.end(), changed)
    for match in re.finditer(r"(?<![\w=!])!(?=[\w(])", code):
        yield change(match.start(), match.end(), "")
    condition = re.search(r"\b(?:if|while) \((?!.*;)(?!const auto|auto)", code)
    if condition:
        depth, begin = 1, condition.end()
        for end in range(begin, len(code)):
            depth += {"(": 1, ")": -1}.get(code[end], 0)
            if depth == 0:
                yield change(begin, end, "!(" + line[begin:end] + ")")
                break
    if STATEMENT.match(code) and code.count("(") == code.count(")") and re.search(r"([;{}:]|^|\))\s*$", previous):
        indent = len(line) - len(line.lstrip())
        yield change(indent, len(line), ";")


def mutants(path, lines):
    """Every mutant of the file's lines, or of those whose number is in `lines`."""
    text = (ROOT / path).read_text().splitlines()
    previous = ""
    for number, line in enumerate(text, 1):
        if lines is None or number in lines:
            yield from mutants_of_line(path, number, line, previous)
        previous = LITERAL.sub("", line)


def changed_since(revision):
    """{path: numbers of the lines changed since `revision`}."""
    diff = subprocess.run(["git", "diff", "-U0", revision, "--", *FOLDERS], cwd=ROOT, check=True, capture_output=True,
                          text=True).stdout
    changed, path = {}, None
    for line in diff.splitlines():
        if line.startswith("+++ "):
            path = line[6:] if line.endswith((".cpp", ".hpp")) else None
        hunk = re.match(r"@@ -\S+ \+(\d+)(?:,(\d+))? @@", line)
        if hunk and path:
            changed.setdefault(path, set()).update(range(int(hunk[1]), int(hunk[1]) + int(hunk[2] or 1)))
    return changed


class Tree:
    """The copy, built with the tests of some folders."""

    def __init__(self, folder, jobs):
        self.root, self.jobs, self.limits = pathlib.Path(folder), jobs, {}
        listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, check=True,
                                capture_output=True, text=True).stdout.splitlines()
        names = {name for name in listed if (ROOT / name).is_file()}
        mark = self.root / "build/mutants"
        if any(self.root.glob("*")) and not mark.exists():
            sys.exit(f"{folder}: neither empty nor a copy that this program has made")
        mark.mkdir(parents=True, exist_ok=True)
        for old in [path for path in self.root.rglob("*") if path.is_file()]:
            if (name := str(old.relative_to(self.root))) not in names and not name.startswith("build/"):
                old.unlink()
        for name in names:
            source, copy = ROOT / name, self.root / name
            if not copy.exists() or copy.read_bytes() != source.read_bytes():  # ninja goes by the time of a file
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(source, copy)
        subprocess.run(["cmake", "-G", "Ninja", "-B", "build", "-DCMAKE_BUILD_TYPE=None",
                        "-DCMAKE_CXX_FLAGS=-O1 -Wno-maybe-uninitialized"], cwd=self.root, check=True,
                       stdout=subprocess.DEVNULL)

    def builds(self, folder):
        return subprocess.run(["ninja", "-C", "build", f"-j{self.jobs}", f"{folder}_tests"], cwd=self.root,
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0

    def failure(self, folder, limit=None):
        """The first test that fails, or how else the program ends; empty if all tests pass."""
        try:
            run = subprocess.run([f"build/tests/{folder}_tests", "--gtest_fail_fast", "--gtest_brief=1"], cwd=self.root,
                                 stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL,
                                 timeout=limit)
        except subprocess.TimeoutExpired:
            return "time limit"
        failed = re.search(rb"^\[  FAILED  \] ([\w./]+)", run.stdout, re.MULTILINE)
        return failed[1].decode() if failed else f"exit code {run.returncode}" if run.returncode else ""

    def prepare(self, folder):
        begin = time.monotonic()
        if not self.builds(folder):
            sys.exit(f"{folder}_tests does not build")
        built = time.monotonic()
        if failure := self.failure(folder):
            sys.exit(f"{folder}_tests fails without a mutant: {failure}")
        self.limits[folder] = 30 + 3 * (time.monotonic() - built)
        print(f"{folder}_tests: built in {built - begin:.0f} s, passes in {time.monotonic() - built:.0f} s", flush=True)

    def test(self, mutant):
        folder = mutant.path.split("/")[0]
        file = self.root / mutant.path
        text = file.read_text()
        lines = text.splitlines(keepends=True)
        assert lines[mutant.line - 1].rstrip("\n") == mutant.before
        lines[mutant.line - 1] = mutant.after + "\n"
        file.write_text("".join(lines))
        try:
            if not self.builds(folder):
                return "refused", ""
            failure = self.failure(folder, self.limits[folder])
            return ("noticed", failure) if failure else ("survived", "")
        finally:
            file.write_text(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", nargs="*", help="file whose lines are all eligible, such as core/timeline.cpp")
    parser.add_argument("--since", metavar="REV", help="make only the lines changed since this revision eligible")
    parser.add_argument("--count", type=int, default=20, help="mutants, drawn at random; 0: all (default: 20)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the draw (default: 1)")
    parser.add_argument("--jobs", type=int, default=2, help="number of compiler jobs (default: 2)")
    parser.add_argument("--tree", metavar="FOLDER", type=pathlib.Path,
                        help="the copy and its build, kept for later runs (default: one that is removed)")
    parser.add_argument("--list", action="store_true", help="only print the mutants")
    options = parser.parse_args()
    if bool(options.file) == bool(options.since):
        parser.error("give either files or --since")
    where = changed_since(options.since) if options.since else dict.fromkeys(options.file)
    for path in where:
        if path.split("/")[0] not in FOLDERS or not (ROOT / path).is_file():
            parser.error(f"{path}: not a file in {', '.join(FOLDERS)}")

    # Sorted, so that the mutants of one file follow one another, and little is compiled again.
    drawn = [mutant for path, lines in sorted(where.items()) for mutant in mutants(path, lines)]
    if options.count and options.count < len(drawn):
        drawn = sorted(random.Random(options.seed).sample(drawn, options.count), key=lambda m: (m.path, m.line))
    if not drawn:
        sys.exit("these lines have no mutants")

    def show(result, mutant, by=""):
        print(f"{result:9} {mutant.path}:{mutant.line} {by}".rstrip(), flush=True)
        print(f"  - {mutant.before.strip()}\n  + {mutant.after.strip()}", flush=True)

    if options.list:
        for mutant in drawn:
            show("", mutant)
        return
    results = {"noticed": 0, "survived": 0, "refused": 0}
    with contextlib.ExitStack() as stack:
        tree = Tree(options.tree or stack.enter_context(tempfile.TemporaryDirectory(prefix="mutate-")), options.jobs)
        for name in sorted({mutant.path.split("/")[0] for mutant in drawn}):
            tree.prepare(name)
        for mutant in drawn:
            result, failure = tree.test(mutant)
            results[result] += 1
            show(result, mutant, failure and f"by {failure}")
    counted = results["noticed"] + results["survived"]
    print(f"{results['noticed']} of {counted} noticed ({100 * results['noticed'] / max(counted, 1):.0f} %), "
          f"{results['refused']} refused by the compiler")


if __name__ == "__main__":
    main()
