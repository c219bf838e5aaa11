#!/usr/bin/env python3
"""Checks which folder includes or names which other, and that comments avoid certain words."""
import fnmatch
import pathlib
import re
import sys

# The rooms of emulator that a tool may link: all that runs a configuration, but not the daemon around it.
ENGINE = {f"emulator/{room}" for room in ("ground", "plan", "faults", "frames", "config", "truth", "imu", "engine", "record", "drive",
                                              "campaign/shards")}

# folder: (folders of the project it may include, system headers it must not)
RULES = {
    "core": ({"core"}, r"boost/(?!histogram)|sys/|unistd|fcntl|poll\.h|thread|mutex|chrono.*clock|CLI|toml|spdlog|pcap|libserial"),
    "protocols": ({"core", "protocols"}, r"boost/asio|sys/|unistd|fcntl|poll\.h|thread|mutex|CLI|toml|spdlog|pcap|libserial"),
    "transports": ({"core", "transports"}, r"boost/|thread|mutex|CLI|toml|spdlog|Eigen"),
    "emulator": ({"core", "protocols", "transports", "emulator"}, r"pcap|libserial|linux/can"),
    "tools": ({"core", "protocols", "transports", "tools"} | ENGINE, r"pcap|libserial|linux/can|toml"),
}
CLOCKS = re.compile(r"(steady|system|high_resolution)_clock|clock_gettime|\btime\(NULL\)|\btime\(nullptr\)")
ENTRY_FOLDERS = {"protocols/devices": "protocol", "protocols/truth_formats": "truth_format"}
# Defaults for users and a command: the only texts in emulator and tools that may begin with a transport's name.
PORTS_GIVEN = {("emulator/commands/selftest.cpp", "pty:imu"), ("emulator/commands/command_line.cpp", "pty"),
               ("tools/imu_truth.cpp", "udp:127.0.0.1:9810"),
               ("tools/lockstep_client.hpp", "udp:"),
               # The noun, not the transport.
               ("emulator/rack/rack_commands.cpp", "record"), ("emulator/report/outcome.cpp", "record"),
               ("emulator/report/summary.cpp", "record"), ("tools/stream_report.cpp", "record")}
TOP_LEVEL = {"CMakeLists.txt", "CMakePresets.json", "LICENSE", "README.md", "core", "emulator", "protocols", "tests",
             "tools", "transports", "build"}

# The floors of a folder, from the ground: each has rooms, which are folders, or files of the folder itself. A file may
# include files of its own room, of a room around that, and of the floors below. The last floor has all files that are on
# no other.
FLOORS = {
    "core": ["vector.hpp units.hpp time.hpp gps_time.hpp frame.hpp uart.hpp", "numbers/",
             "attitude.* truth.* sample.hpp timeline.*",
             "earth/", "gnss/", "environment/ effects/ pose/", "clock/",
             "imu*.* triad.hpp size_effect.* rest.* navigation_errors.hpp", ""],
    "protocols": ["protocol.* frame_seal.* truth_format.* settings.* native_truth.hpp sync_datagram.hpp", "wire/", "quantities/",
                  "measurements/", "frames/layout/", "frames/text/ frames/host/", "signals/ frames/", ""],
    "transports": ["port.hpp port_spec.* endpoint.* host_clock.hpp file_descriptor.hpp byte_writer.* "
                   "loaded_library.hpp",
                   "can/ file/ socket/ uart/", "capture/", ""],
    "emulator": ["ground/", "campaign/shards/ plan/", "faults/ frames/", "config/", "truth/", "imu/", "engine/", "record/", "drive/", "report/ programs/", "control/",
                 "web/", "run/", "seeds/", "campaign/cases/ campaign/slurm/ campaign/status/", "campaign/", "init/ watch/", "rack/", "commands/", ""],
    "tools": ["*_client.hpp duration_text.* gnuplot.* output_options.hpp program.* "
              "setting_texts.hpp stop_signal.* stream_*.* text_output.*", "input/ replay/ vcan/ checks/", "arrays/ find/", "truth/", "allan/",
              "plot/ fit/ campaign/", ""],
}
# A folder with more files than these hides something.
MOST_FILES = 30

root = pathlib.Path(sys.argv[1])
faults = []
checked = 0

for folder, (allowed, forbidden) in RULES.items():
    for path in sorted((root / folder).rglob("*.[ch]pp")):
        checked += 1
        name = path.relative_to(root)
        for number, line in enumerate(path.read_text().splitlines(), 1):
            include = re.match(r'\s*#\s*include\s*([<"])([^>"]+)[>"]', line)
            # A header that simulators copy has those that it needs beside it.
            is_beside = include and "/" not in include[2] and (path.parent / include[2]).is_file()
            folders = {include[2].split("/")[0], include[2].rpartition("/")[0]} if include else set()
            if include and include[1] == '"' and not folders & allowed and not is_beside:
                faults.append(f"{name}:{number}: {folder} may not include {include[2]}")
            if include and include[1] == "<" and re.search(forbidden, include[2]):
                faults.append(f"{name}:{number}: {folder} must not know <{include[2]}>")
            if folder in ("core", "protocols") and CLOCKS.search(line):
                faults.append(f"{name}:{number}: {folder} reads no clock")
        if path.suffix == ".hpp" and "#pragma once" not in path.read_text():
            faults.append(f"{name}: no #pragma once")



def floor_of(folder, path):
    """Returns the number of the floor of a file, by its path in the folder."""
    for number, rooms in enumerate(FLOORS[folder]):
        for room in rooms.split():
            if path.startswith(room) if room.endswith("/") else "/" not in path and fnmatch.fnmatch(path, room):
                return number
    return len(FLOORS[folder]) - 1


arrows = 0
for folder in FLOORS:
    for path in sorted((root / folder).rglob("*.[ch]pp")):
        name = str(path.relative_to(root / folder))
        floor = floor_of(folder, name)
        for number, line in enumerate(path.read_text().splitlines(), 1):
            include = re.match(rf'\s*#\s*include\s*"{folder}/([^"]+)"', line)
            if include is None:
                continue
            arrows += 1
            other = floor_of(folder, include[1])
            room = include[1].rpartition("/")[0] + "/"
            is_same_room = name.startswith(room) if room != "/" else "/" not in name
            if other > floor or (other == floor and not is_same_room):
                faults.append(f"{folder}/{name}:{number}: floor {floor} may not include {include[1]} of floor {other}")
if arrows < 1000:
    faults.append(f"only {arrows} includes have been compared with the floors")
for path in sorted({path.parent for folder in (*RULES, "tests") for path in (root / folder).rglob("*.[ch]pp")}):
    count = sum(1 for file in path.iterdir() if file.suffix in (".cpp", ".hpp"))
    if count > MOST_FILES:
        faults.append(f"{path.relative_to(root)}: {count} files in one folder, more than {MOST_FILES}: divide it")

def public_functions(body, is_public):
    """Counts the public functions that the body of a class declares or defines, but not those that it overrides."""
    count, chunk, at = 0, "", 0
    while at < len(body):
        char = body[at]
        if char == "{":
            depth, end = 1, at + 1
            while depth:
                depth += {"{": 1, "}": -1}.get(body[end], 0)
                end += 1
            at, char = end - 1, ";" if re.search(r"\)[\w\s:&,()]*$|^\s*(struct|class|enum|union)\b", chunk) else ""
        if char == ";":
            text = chunk.strip()
            is_type = re.match(r"(struct|class|enum|union|using|friend|static_assert)\b", text)
            if is_public and not is_type and not text.endswith("override") and re.match(r"[^=(]*\(|.*\boperator\b", text, re.DOTALL):
                count += 1
            chunk = ""
        elif char == ":" and (access := re.search(r"(?:^|\s)(public|protected|private)\s*$", chunk)):
            is_public, chunk = access[1] == "public", ""
        else:
            chunk += char
        at += 1
    return count


# The seams between folders, whose implementations may have them all; and a function for each quantity of a product.
WIDE = {"Device", "Port", "Quantities"}
MOST_FUNCTIONS = 20
classes = 0
for folder in RULES:
    for path in sorted((root / folder).rglob("*.hpp")):
        text = re.sub(r"//.*|\"(?:[^\"\\\n]|\\.)*\"|'(?:[^'\\\n]|\\.)'", "", path.read_text())
        for match in re.finditer(r"\b(class|struct) (\w+)[^;{}()]*\{", text):
            depth, end = 1, match.end()
            while depth:
                depth += {"{": 1, "}": -1}.get(text[end], 0)
                end += 1
            classes += 1
            count = public_functions(text[match.end():end - 1], match[1] == "struct")
            if count > MOST_FUNCTIONS and match[2] not in WIDE:
                faults.append(f"{path.relative_to(root)}: {match[2]} has {count} public functions, more than "
                              f"{MOST_FUNCTIONS}: divide it")
if classes < 300:
    faults.append(f"only {classes} classes were counted")

# Code asks for the properties of a transport, not for its name. A text for people may contain a port, but not begin with it.
names = [name.replace("_", "-") for path in sorted((root / "transports").glob("*.cpp"))
         for name in re.findall(r'constexpr Transport (\w+)_transport = ', path.read_text())]
if len(names) < 14:
    faults.append(f"transports: only {len(names)} entries found")
named = re.compile(rf"({'|'.join(names)})(:|$)")
given = set()
for folder in ("core", "protocols", "emulator", "tools"):
    for path in sorted((root / folder).rglob("*.[ch]pp")):
        name = str(path.relative_to(root))
        for number, line in enumerate(path.read_text().splitlines(), 1):
            code = re.sub(r"^\s*//.*", "", line)
            for text in re.findall(r'"((?:[^"\\]|\\.)*)"', code):
                if (name, text) in PORTS_GIVEN:
                    given.add((name, text))
                elif named.match(text) and not code.lstrip().startswith("#"):
                    faults.append(f"{name}:{number}: \"{text}\": ask for a property of Transport, not for a name")
            if re.search(r"\bscheme\s*[=!]=|[=!]=\s*[\w.>-]*\bscheme\b|transport\w*(->|\.)name\s*[=!]=", code):
                faults.append(f"{name}:{number}: ask for a property of Transport, not for its name")
for unused in sorted(PORTS_GIVEN - given):
    faults.append(f"{unused[0]}: \"{unused[1]}\" is no longer given there: take it from PORTS_GIVEN")

def keyword_of(stem):
    """A keyword that begins with a digit, such as 42, has a word before it in its file's stem: nasa_42."""
    last = stem.rpartition("_")[2]
    return last if last[:1].isdigit() and last != stem else stem.replace("_", "-")


for folder, suffix in ENTRY_FOLDERS.items():
    entries = {path: path.stem for path in (root / folder).glob("*.cpp")}
    if suffix == "protocol":
        entries |= {path: path.parent.name for path in (root / folder).parent.glob("*/device.cpp")}
    for path, stem in sorted(entries.items()):
        checked += 1
        name = path.relative_to(root)
        keyword = keyword_of(stem)
        text = path.read_text()
        entry = re.search(rf" {stem}_{suffix} = (\w+<\w+>\()?\{{", text)  # a function may complete it
        if entry is None:
            faults.append(f"{name}: ends in no table entry {stem}_{suffix}")
        elif f'"{keyword}"' not in text[entry.start():]:
            faults.append(f"{name}: its entry is not named \"{keyword}\" as the file or its folder")

# Folders of tools have other files beside those that end in an entry, so that the table would lack an entry of another name.
entries = 0
for folder, suffix in (("arrays", "row_format"), ("input", "log_format"), ("truth", "truth_log")):
    for path in sorted((root / "tools" / folder).glob("*.cpp")):
        for name in re.findall(r"^(?:extern )?constexpr (?:RowFormat|TruthLog|Protocol) (\w+) = ", path.read_text(), re.MULTILINE):
            entries += 1
            if name != f"{path.stem}_{suffix}":
                faults.append(f"{path.relative_to(root)}: the table has no {name}: call it {path.stem}_{suffix}")
if entries < 9:
    faults.append(f"tools: only {entries} entries of tables were found")

# The other files of transports are no entries. A product in a folder of its own has its entry in device.cpp.
entries = 0
for path in sorted((root / "transports").glob("*.cpp")):
    for stem, entry in re.findall(r"^extern constexpr Transport (\w+)_transport = \{(.*?)^\};", path.read_text(), re.MULTILINE | re.DOTALL):
        name = re.search(r'^ *\.name = "(.*?)"', entry, re.MULTILINE)
        entries += 1
        if stem != path.stem or name is None or name[1] != keyword_of(stem):
            faults.append(f"{path.relative_to(root)}: its entry {stem}_transport is named {name and name[1]}, not as the file")
if entries != len(names):
    faults.append(f"transports: {entries} of {len(names)} entries were compared with their files")
for path in sorted((root / "protocols").glob("*/*.cpp")):
    if path.parent.name not in ("devices", "truth_formats") and path.name != "device.cpp" and re.search(
            r"^(extern )?constexpr (Protocol|TruthFormat) \w+ = ", path.read_text(), re.MULTILINE):
        faults.append(f"{path.relative_to(root)}: has an entry, which no table has: it belongs into device.cpp")

# Numbers that stand for something, in random streams and in records: each enumerator has one of its own.
def numbers_of(path, enum, least):
    """Returns the name of each number."""
    text = re.sub(r"//.*", "", (root / path).read_text())
    found = {}
    for enumerator in re.search(rf"enum class {enum}\b[^{{]*\{{(.*?),?\s*\}}", text, re.DOTALL)[1].split(","):
        name, _, number = enumerator.replace(" ", "").strip().partition("=")
        if not number.isdecimal():
            faults.append(f"{path}: {enum}::{name} has no number")
        elif found.setdefault(int(number), name) != name:
            faults.append(f"{path}: {enum}::{name} has the number of {found[int(number)]}")
    if len(found) < least:
        faults.append(f"{path}: {enum} has only {len(found)} numbers, of at least {least}")
    return found


numbers_of("core/numbers/random.hpp", "Quantity", 9)
for number, name in numbers_of("core/numbers/random.hpp", "Process", 25).items():
    if 32 <= number < 64 and name != "flicker":
        faults.append(f"core/numbers/random.hpp: {name} has the number {number} of an octave of flicker")

# The dissector of records has its own lists. Lua numbers the elements that have no number of their own from 1.
dissector = (root / "tools/wireshark/imud.lua").read_text()
shown = re.findall(r'"([^"]+)"', re.search(r"local outcomes = \{(.*?)\}", dissector)[1])
intake = re.sub(r"//.*", "", (root / "emulator/truth/truth_intake.hpp").read_text())
outcomes = re.findall(r"\w+", re.search(r"enum class Outcome[^{]*\{(.*?)\}", intake, re.DOTALL)[1])
if [outcome.replace(" ", "_") for outcome in shown] != outcomes or len(outcomes) < 6:
    faults.append(f"tools/wireshark/imud.lua: the outcomes of a truth are {shown}, in truth_intake.hpp {outcomes}")
commands = re.search(r"local commands = \{(.*?)\}", dissector, re.DOTALL)[1]
elements = re.findall(r'(?:\[(\d+)\] = )?"(\w+)"', commands)
shown = dict(enumerate((name for number, name in elements if not number), 1)) | {int(number): name for number, name in elements if number}
kinds = numbers_of("emulator/imu/command.hpp", "Kind", 19)
for number in sorted(shown.keys() | kinds.keys()):
    if shown.get(number) != kinds.get(number):
        faults.append(f"tools/wireshark/imud.lua: command {number} is {shown.get(number)}, in command.hpp {kinds.get(number)}")

# g++ 14 makes weak symbols of signal_protocol<NAME>, though NAME is in an anonymous namespace: with one name in two files
# the linker takes one file's messages for both.
tables = {}
for path in [*(root / "protocols").rglob("*.cpp"), *(root / "tests/extension").rglob("*.cpp")]:
    for table in re.findall(r"signal_protocol<(\w+)>", path.read_text()):
        if (other := tables.setdefault(table, path)) != path:
            faults.append(f"{path.relative_to(root)}: {table} is also of {other.relative_to(root)}: name it after the file")
if len(tables) < 5:
    faults.append(f"protocols: only {len(tables)} tables of signal_protocol() were found")

# A chart of the page shows a member of the notifications, and its truth another one.
sent = (root / "emulator/control/subscriptions.cpp").read_text()
charts = re.findall(r"^ *(\{.*\bkey: \"(\w+)\",.*)", (root / "emulator/web/page/quantities.js").read_text(), re.MULTILINE)
for chart, key in charts:
    if "is_computed: true" in chart:
        continue  # by a function of the page
    for member in [key, f"true_{key}"] if "has_truth: true" in chart else [key]:
        if f'"{member}"' not in sent:
            faults.append(f"emulator/web/page/quantities.js: no notification has {member}")
if len(charts) < 7:
    faults.append(f"emulator/web/page/quantities.js: only {len(charts)} charts were found")

# A function of imud whose name std has, too: with a std::string as argument g++ 14 finds that of std, or both.
for folder in RULES:
    for path in sorted((root / folder).rglob("*.[ch]pp")):
        for number, line in enumerate(path.read_text().splitlines(), 1):
            if re.search(r"(?<!std::)\bquoted\(", re.sub(r"//.*", "", line)):
                faults.append(f"{path.relative_to(root)}:{number}: quoted(): call it in_quotes(), std has one of that name")

# Comments are whole sentences in the field's words: coinages that were found often, and their replacements.
COINAGES = {
    r"hears?|heard|hearing": "receive", r"obeys?|obeyed": "execute", r"patience": "timeout, longest wait",
    r"gives? up|given up": "discard, end", r"anew": "again, restart", r"sees? off": "drain", r"takes? in what": "integrate",
    # A pronoun that carries the sentence.
    r"(?:those|that) of|those that|what (?:it|they)|likewise|as (?:\w+ ){1,2}has (?:it|them)": "the noun",
}
coined = re.compile(rf"\b({'|'.join(COINAGES)})\b", re.IGNORECASE)
for folder in RULES:
    for path in sorted((root / folder).rglob("*.[ch]pp")):
        name = str(path.relative_to(root))
        in_comment = False
        for number, line in enumerate(path.read_text().splitlines(), 1):
            code = re.sub(r'"(?:[^"\\]|\\.)*"', '""', line)
            comment = re.search(r"//\s*(.*)", code)
            if comment and not in_comment and re.match(r"(Of|What)\b", comment[1]):
                faults.append(f"{name}:{number}: a comment begins with \"{comment[1].split()[0]}\": write a sentence")
            if comment and (word := coined.search(comment[1])):
                better = next(b for c, b in COINAGES.items() if re.fullmatch(c, word[0], re.IGNORECASE))
                faults.append(f"{name}:{number}: \"{word[0]}\" in a comment: write {better}")
            in_comment = bool(re.match(r"\s*//", line))

for path in root.iterdir():
    if not path.name.startswith(".") and path.name not in TOP_LEVEL:
        faults.append(f"{path.name}: does not belong at the top level")

print("\n".join(faults))
print(f"{checked} files checked, {len(faults)} faults")
sys.exit(1 if faults or checked < 30 else 0)
