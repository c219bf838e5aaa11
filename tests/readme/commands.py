"""Finds the commands in the code blocks of a README.md.

Commands stand in blocks that are indented by four spaces, and in fenced blocks without a language or with "sh" or "bash".
Each line of such a block is a command, a comment, or the rest of the command before it, which ends in a backslash. If lines
of the block begin with "$ ", these alone are commands. A block with "+---" in it is a drawing. A comment before the block, invisible in
the page, has marks, separated by semicolons:

    <!-- commands: none -->                       what follows is output, a drawing or a file
    <!-- commands: not run (hardware): TEXT -->   those that contain TEXT are not run, for one of the reasons below
    <!-- commands: not run (minutes) -->          all of the block
    <!-- commands: stop after 2 s: TEXT -->       gets SIGINT after that time, and must then end with 0 or 130
    <!-- commands: exit code 3: TEXT -->          ends with that code
    <!-- commands: file NAME -->                  the block, of any language, is written to that file

A block whose first line is "# NAME.toml" is such a file as well. A mark that applies to no command is a fault.
"""
import dataclasses
import re

REASONS = ("hardware", "root", "network", "simulator", "minutes", "guest")
MARK = re.compile(r"<!-- commands: (.*) -->$")
PARTS = re.compile(r"(none)$|not run \((\w+)\)(?:: (.+))?$|stop after (\d+) s: (.+)$|exit code (\d+): (.+)$|file (\S+)$")
FILE = re.compile(r"# ([\w.-]+\.toml)\b")


@dataclasses.dataclass
class Command:
    line: int
    text: str
    reason: str = ""  # why it is not run
    stop_s: int = 0  # 0: it ends by itself
    exit_code: int = 0


@dataclasses.dataclass
class File:
    line: int
    name: str
    text: str


def blocks(text):
    """Yields (line, language, lines, marks) of each code block; language is "" of indented ones and None of a fence without."""
    lines = text.splitlines()
    marks, at = [], 0
    while at < len(lines):
        line = lines[at]
        before = lines[at - 1] if at else ""
        if found := MARK.match(line):
            marks += [(at + 1, part) for part in found[1].split("; ")]
        elif line.startswith("```"):
            end = lines.index("```", at + 1)
            yield at + 2, line[3:] or None, lines[at + 1:end], marks
            marks, at = [], end
        elif line.startswith("    ") and (not before.strip() or before.startswith(("    ", "#", "<!--", "```"))):
            end = next((i for i in range(at, len(lines)) if lines[i].strip() and not lines[i].startswith("    ")), len(lines))
            yield at + 1, "", [code[4:] for code in lines[at:end]], marks
            marks, at = [], end - 1
        elif line.strip():
            if marks:
                raise ValueError(f"line {marks[0][0]}: no block follows the mark")
        at += 1
    if marks:
        raise ValueError(f"line {marks[0][0]}: no block follows the mark")


def commands_of(lines, first):
    """The commands in the lines of a block."""
    prompted = any(line.startswith("$ ") for line in lines)
    found, rest = [], False
    for number, line in enumerate(lines, first):
        if rest:
            found[-1].text += "\n" + line
        elif prompted and line.startswith("$ "):
            found.append(Command(number, line[2:]))
        elif not prompted and line.strip() and not line.startswith("#"):
            found.append(Command(number, line))
        else:
            continue
        rest = line.endswith("\\")
    return found


def apply(part, line, found):
    """Applies a mark to the commands of a block."""
    kinds = PARTS.match(part)
    if not kinds or (kinds[2] and kinds[2] not in REASONS):
        raise ValueError(f"line {line}: \"{part}\" is no mark; tests/readme/commands.py lists them")
    _, reason, not_run, seconds, stopped, code, ending, _ = kinds.groups()
    meant = [command for command in found if (not_run or stopped or ending or "") in command.text]
    if not meant:
        raise ValueError(f"line {line}: \"{part}\" applies to no command of the block")
    for command in meant:
        command.reason = reason or command.reason
        command.stop_s = int(seconds or command.stop_s)
        command.exit_code = int(code or command.exit_code)


def read(text):
    """Returns the commands and files of a README.md in their order. Raises ValueError for a wrong mark."""
    found = []
    for first, language, lines, marks in blocks(text):
        parts = [part for _, part in marks]
        named = [part[5:] for part in parts if part.startswith("file ")]
        if not named and language and lines and (first_line := FILE.match(lines[0])):
            named = [first_line[1]]
        if named:
            found.append(File(first, named[0], "".join(line + "\n" for line in lines)))
        elif language in ("", None, "sh", "bash") and parts != ["none"] and not any("+---" in line for line in lines):
            block = commands_of(lines, first)
            for line, part in marks:
                apply(part, line, block)
            found += block
        elif parts and parts != ["none"]:
            raise ValueError(f"line {marks[0][0]}: the block after the mark has no commands")
    return found
