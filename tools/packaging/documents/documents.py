#!/usr/bin/env python3
"""Writes the pages of the manual and the completions of the shells, made of what the programs state of themselves.

usage: documents.py PROGRAMS_FOLDER SOURCE_FOLDER OUTPUT_FOLDER [EMULATOR]

OUTPUT_FOLDER gets man/man1, man/man5, man/man7, bash, zsh and fish. The pages have the date of the changelog: the same
programs and sources give the same files. EMULATOR starts programs of another processor.
"""
import email.utils
import pathlib
import shutil
import sys

sys.dont_write_bytecode = True

from completion import Completion
from help_text import PROGRAMS, Programs
from manual import Manual


def date_of(changelog):
    line = next(line for line in changelog.splitlines() if line.startswith(" -- "))
    return email.utils.parsedate_to_datetime(line.split(">  ")[1]).date().isoformat()


def main(programs_folder, source_folder, output_folder, *emulator):
    source, output = pathlib.Path(source_folder), pathlib.Path(output_folder)
    programs = Programs(programs_folder, emulator)
    files = {}
    for page in Manual(programs, source, date_of((source / "tools/packaging/debian/changelog").read_text())).pages:
        files[f"man/man{page.section}/{page.file}"] = page.text()
    completion = Completion(programs, source)
    files["bash/imud"] = completion.bash()
    files["zsh/_imud"] = completion.zsh()
    files["fish/imud.fish"] = completion.fish()
    # These shells look for the file of a command by its name.
    for program in PROGRAMS[1:]:
        files[f"bash/{program}"] = ". \"${BASH_SOURCE[0]%/*}/imud\"\n"
        files[f"fish/{program}.fish"] = "source (status dirname)/imud.fish\n"
    shutil.rmtree(output, ignore_errors=True)
    for name, text in files.items():
        path = output / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


if __name__ == "__main__":
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    main(*sys.argv[1:])
