"""Fails, and lists the files, where clang-format would change one. SOURCE_DIR"""
import pathlib
import re
import subprocess
import sys

source = pathlib.Path(sys.argv[1])
folders = ("core", "protocols", "transports", "emulator", "tools", "tests")
files = sorted(str(path.relative_to(source)) for folder in folders for path in source.joinpath(folder).rglob("*.[ch]pp"))
assert len(files) > 200, f"only {len(files)} files found in {source}"
run = subprocess.run(["clang-format", "--dry-run", *files], cwd=source, stderr=subprocess.PIPE, text=True, check=True)
unformatted = sorted(set(re.findall(r"^(\S+?):\d+:\d+: warning: code should be clang-formatted", run.stderr, re.M)))
if run.stderr and not unformatted:
    sys.exit(run.stderr)
if unformatted:
    sys.exit("\n".join(["not formatted; run clang-format -i on:", *unformatted]))
