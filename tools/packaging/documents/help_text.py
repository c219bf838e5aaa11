"""The commands and options of imud's programs, as their --help states them."""
import dataclasses
import json
import pathlib
import re
import subprocess

TOOLS = ("imu-allan", "imu-campaign", "imu-decode", "imu-fit", "imu-plot", "imu-truth")
PROGRAMS = ("imud", *TOOLS)
# After a name: the value, "REQUIRED", and which other options it needs or excludes.
ENTRY = re.compile(r"^  (?P<entry>\S.*)$")
COLUMN = 30  # where the texts of CLI11's help begin


@dataclasses.dataclass
class Entry:
    """An option, a positional argument or a command."""
    names: list
    value: str = ""  # what --help calls the value; empty: a flag
    relations: str = ""  # "Needs: --to", "Excludes: --quiet"
    required: bool = False
    repeated: bool = False
    text: str = ""

    @property
    def is_option(self):
        return self.names[0].startswith("-")


@dataclasses.dataclass
class Command:
    words: list  # ["imud", "run"]
    summary: str = ""
    usage: str = ""
    positionals: list = dataclasses.field(default_factory=list)
    groups: list = dataclasses.field(default_factory=list)  # (title, [Entry])
    commands: list = dataclasses.field(default_factory=list)
    sections: list = dataclasses.field(default_factory=list)  # of the end of the text: (title, lines)

    @property
    def name(self):
        return "-".join(self.words)

    @property
    def options(self):
        return [option for _, options in self.groups for option in options]


def entry_of(text):
    text, required = re.subn(r" REQUIRED\b", "", text)
    relation = re.search(r" ?((?:Needs|Excludes): .*)$", text)
    if relation:
        text = text[:relation.start()]
    text, repeated = re.subn(r" ?\.\.\.$", "", text)
    names, _, value = text.strip().partition(" ")
    # CLI11 appends the type and range of some values: "SECONDS:FLOAT in [0 - 10]".
    value = re.sub(r":(?:INT|UINT|FLOAT|NUMBER|POSITIVE|NONNEGATIVE)\b.*$", "", value).strip()
    if not names.startswith("-"):
        value = "" if value == "TEXT" else value
        if repeated or names.endswith("..."):
            names, repeated = names.removesuffix("..."), True
    return Entry(names.split(","), value, relation.group(1) if relation else "", bool(required), bool(repeated))


def parse(words, text):
    command = Command(list(words))
    head, _, rest = text.partition("\nUsage: ")
    command.summary = " ".join(head.split())
    command.usage, _, rest = rest.partition("\n")
    title, in_footer = "", False
    for line in rest.splitlines():
        if line and not line.startswith(" "):
            # A line that ends with a colon begins a section; another one is of the text at the end.
            if line.endswith(":"):
                title = line[:-1]
                in_footer = False
                command.sections.append((title, []))
            else:
                title, _, line = line.partition(": ")
                command.sections.append((title, [line]))
                in_footer = True
            continue
        if not command.sections:
            continue
        command.sections[-1][1].append(line[9:] if in_footer and title == "Example" else line)
    footer = []
    for title, lines in command.sections:
        entries = []
        for line in lines:
            match = ENTRY.match(line)
            if match and not line[2:3].isspace():
                # A long name has the line for itself; a range in it, such as [1 - 10], may have a space at the column.
                begin = line[:COLUMN]
                if len(line) > COLUMN and begin[-1] == " " and begin.count("[") == begin.count("]") and line[COLUMN] != "[":
                    entries.append((entry_of(line[:COLUMN].rstrip()), [line[COLUMN:]]))
                else:
                    entries.append((entry_of(line.strip()), []))
            elif line.startswith(" " * COLUMN) and entries:
                entries[-1][1].append(line.strip())
        for entry, parts in entries:
            entry.text = " ".join(parts)
        entries = [entry for entry, _ in entries]
        if title == "Positionals":
            command.positionals = entries
        elif title == "Subcommands":
            command.commands = entries
        elif entries and all(entry.is_option for entry in entries):
            command.groups.append((title, entries))
        else:
            footer.append((title, [line for line in lines if line.strip()]))
    command.sections = footer
    return command


class Programs:
    """What the programs of a folder state of themselves. `emulator` starts them, if it is not empty."""

    def __init__(self, folder, emulator=()):
        self.folder = pathlib.Path(folder)
        self.emulator = emulator
        self.commands = {}
        for program in PROGRAMS:
            self.add([program])
        self.version = self.output(["imud", "--version"]).split()[1]
        self.names = json.loads(self.output(["imud", "list", "--json"]))
        self.faults = json.loads(self.output(["imud", "list", "faults", "--json"]))

    def output(self, words):
        return subprocess.run([*self.emulator, self.folder / words[0], *words[1:]], check=True, capture_output=True, text=True).stdout

    def add(self, words):
        """Adds a command, and the commands below it, such as those of `imud campaign`."""
        # `imud help --help` shows the help of imud.
        command = parse(words, self.output([*words, "help" if words[-1] == "help" else "--help"]))
        self.commands[" ".join(words)] = command
        for entry in command.commands:
            self.add([*words, entry.names[0]]).summary = entry.text
        return command

    def of_kind(self, kind):
        return [name for name in self.names if name["kind"] == kind]

    def shipped_names(self, *kinds):
        return [name["name"] for name in self.names if name["kind"] in kinds]
