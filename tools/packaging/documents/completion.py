"""Completion for bash, zsh and fish, from the same declarations as --help."""
import re

from roff import cells

FILES, CONFIGS, RUNS, SCENARIOS, NOTHING = "files", "configs", "runs", "scenarios", "nothing"
# Where a scenario is looked for beside the current folder.
SHARED = ("/usr/local/share/imud", "/usr/share/imud")


def first_words(command, title):
    """The names of a list at the end of a tool's help, whose titles begin with `title`."""
    return [match.group(1) for head, lines in command.sections if head.startswith(title)
            for match in (re.match(r"  (\S+)", row) for row in lines) if match]


def keys(text):
    """The keys of CONFIGURATION.md, those of imus for the first one."""
    table, found = None, []
    for row in text.splitlines():
        if row.startswith("#"):
            names = re.findall(r"`\[+([a-z_.]+)\]+`", row)
            if names or row.startswith("## "):
                table = [re.sub(r"^imu\b", "imu.0", name) + "." for name in names] or ([""] if row == "## The file" else [])
        elif row.startswith("| `") and table:
            for name in re.findall(r"`([a-z_0-9.]+)`", cells(row)[0]):
                # A key that begins with its sensor stands in that sensor's table.
                sensor = f"imu.0.{name.split('.')[0]}." if "." in name else ""
                found += ["imu.0." + name] if sensor and any(prefix.startswith("imu.0.gyro.") for prefix in table) else \
                    [prefix + name for prefix in table]
    return list(dict.fromkeys(found))


class Completion:
    def __init__(self, programs, source):
        self.programs = programs
        decode = programs.commands["imu-decode"]
        protocols = first_words(decode, "Protocols") + first_words(decode, "Logs")
        control = (source / "emulator/control/README.md").read_text()
        begin = control.index("| method | parameters | does |")
        methods = [name for row in control[begin:control.index("\n\n", begin)].splitlines()[2:]
                   for name in re.findall(r"`([a-z.]+)`", cells(row)[0])]
        deviations = next(option for option in programs.commands["imu-allan"].options if "--deviation" in option.names)
        init = programs.commands["imud init"]
        simulators = next(option for option in init.options if option.names == ["--from"]).text.split(";")[0].split(", ")
        units = [unit for name in programs.of_kind("protocol") for setting in name["settings"] if setting["key"] == "model"
                 for unit in setting["valid"].removeprefix("one of ").split(", ")]
        settings = [setting["key"] for name in programs.of_kind("protocol") for setting in name["settings"]]
        found = keys((source / "emulator/CONFIGURATION.md").read_text())
        self.sets = {
            "names": programs.shipped_names("protocol", "truth format", "transport", "preset"),
            "lists": ["faults", "checks"],
            "protocols": protocols,
            "arrays": ["npy"],
            "ports": [f"{name}:" for name in programs.shipped_names("transport")],
            "keys": [f"{key}=" for key in found],
            "settings": [f"{key}=" for key in dict.fromkeys(settings)],
            "products": programs.shipped_names("protocol") + units,
            "simulators": list(dict.fromkeys(simulators + programs.shipped_names("truth format"))),
            "methods": methods,
            "campaign_actions": ["collect", "report"],
            "motions": first_words(programs.commands["imu-truth"], "Motions") + ["list"],
            "formats": programs.shipped_names("truth format") + ["ulog", "mcap"],
            "presets": programs.shipped_names("preset"),
            "deviations": re.findall(r"[a-z]+(?:-[a-z]+)?", deviations.text.replace("(default)", "").replace(" or ", " ")),
            "topics": list(dict.fromkeys(word for key in found for word in (key, key.rpartition(".")[2]))),
            "commands": [entry.names[0] for entry in programs.commands["imud"].commands],
        }
        # The commands that have commands of their own.
        self.groups = [command for command in programs.commands.values() if len(command.words) > 1 and command.commands]
        for command in self.groups:
            self.sets[f"{command.words[-1]}_commands"] = [entry.names[0] for entry in command.commands]

    def kinds(self, command, entry):
        """What completes the value of an option or a positional argument: some of FILES, CONFIGS (files
        that are a configuration or a record, if there is one), RUNS, SCENARIOS and the sets."""
        name, value, words = entry.names[-1], entry.value, " ".join(command.words)
        if words == "imud":
            return ["commands"]
        if name == "--set":
            return ["settings"] if words in ("imu-decode", "imu-allan", "imu-fit", "imu-truth") else ["keys"]
        if (words, name) == ("imud init", "--truth"):
            return ["ports"]
        given = {"--scenario": [SCENARIOS, FILES], "--name": [RUNS], "--deviation": ["deviations"], "--format": ["formats"],
                 "PROTOCOL": ["protocols"] + ([] if words == "imu-decode" else ["arrays"]), "PORT": ["ports", FILES],
                 "PRODUCT": ["products"], "--from": ["simulators", FILES], "--port": ["ports"],
                 "METHOD": ["methods"], "TOPIC": ["commands", "topics"], "PARAMETER": ["keys"], "MOTION": ["motions"], "ACTION": ["campaign_actions"]}.get(name)
        if given:
            return given
        if name == "NAME" and words in ("imud status", "imud top"):
            return [RUNS]
        if name == "NAME":
            return ["names", "lists"] if words == "imud list" else ["names"]
        if value.startswith("PRESET"):
            return ["presets", FILES]
        if name == "CONFIG":
            return [CONFIGS]
        if re.search(r"FILE|PATH|RECORD|DIR", value) or name in ("CAPTURE", "FILE", "LINK", "PLAN", "DIR", "RACK"):
            return [FILES]
        return [NOTHING]

    def bash(self):
        out = ["# Completion of imud's commands for bash, made from their --help."]
        out += [f"_imud_{name}='{' '.join(words)}'" for name, words in self.sets.items()]
        out.append(BASH_BEGIN.replace("GROUPS", "|".join(command.words[-1] for command in self.groups)))
        for words, command in self.programs.commands.items():
            flags = [name for option in command.options for name in option.names]
            valued = [name for option in command.options if option.value for name in option.names]
            out += [f"    '{words}')", f"      options='{' '.join(flags)}'", f"      valued=' {' '.join(valued)} '"]
            out.append("      case $previous in")
            for option in command.options:
                if option.value:
                    out.append(f"        {'|'.join(option.names)}) kinds='{' '.join(self.kinds(command, option))}' ;;")
            out.append("      esac")
            positionals = [" ".join(self.kinds(command, entry)) for entry in command.positionals]
            if command in self.groups:
                positionals = [f"{command.words[-1]}_commands"]
            out.append(f"      positionals=({' '.join(repr(kinds) for kinds in positionals)})")
            if command.positionals and command.positionals[-1].repeated:
                out.append("      repeated=1")
            out.append("      ;;")
        out.append(BASH_END + " ".join(name for name in self.programs.commands if " " not in name))
        return "\n".join(out) + "\n"

    def zsh(self):
        def quoted(text):
            return "'" + text.replace("'", "'\\''") + "'"

        def helped(text):
            return re.sub(r"([\[\]:\\])", r"\\\1", text)

        out = [f"#compdef {' '.join(name for name in self.programs.commands if ' ' not in name)}",
               "# Completion of imud's commands for zsh, made from their --help."]
        for name, words in self.sets.items():
            suffix = " -S ''" if words[0].endswith(("=", ":")) else ""
            out.append(f"_imud_{name}() {{ compadd{suffix} -- {' '.join(quoted(word) for word in words)} }}")
        out.append(ZSH_BEGIN)
        both = {tuple(kinds) for command in self.programs.commands.values() for entry in command.options + command.positionals
                for kinds in [self.kinds(command, entry)] if len(kinds) > 1}
        for kinds in sorted(both):
            functions = " ".join("_files;" if kind == FILES else f"_imud_{kind};" for kind in kinds)
            out.append(f"_imud_{'_or_'.join(kinds)}() {{ {functions} }}")
        for words, command in self.programs.commands.items():
            specs = []
            for option in command.options:
                exclusive = f"({' '.join(option.names)})" if len(option.names) > 1 and not option.repeated else ""
                for name in option.names:
                    spec = ("*" if option.repeated else exclusive) + name + f"[{helped(option.text)}]"
                    if option.value:
                        spec += f":{helped(option.value)}:{self.zsh_action(command, option)}"
                    specs.append(spec)
            for number, entry in enumerate(command.positionals, 1):
                place = "*" if entry.repeated else number
                specs.append(f"{place}:{helped(entry.names[0])}:{self.zsh_action(command, entry)}")
            if words == "imud":
                described = " ".join(quoted(f"{entry.names[0]}:{entry.text}") for entry in command.commands)
                out.append(f"_imud_described() {{ local -a commands=({described}); _describe command commands }}")
                specs += ["(-)1:command:_imud_described", "(-)*::argument:->argument"]
            if command in self.groups:
                specs += [f"(-)1:command:_imud_{command.words[-1]}_commands", "(-)*::argument:->argument"]
            out.append(f"_{command.name.replace('-', '_')}_specs() {{ specs=({' '.join(quoted(spec) for spec in specs)}) }}")
        out.append(ZSH_END)
        return "\n".join(out) + "\n"

    def zsh_action(self, command, entry):
        kinds = [kind for kind in self.kinds(command, entry) if kind != NOTHING]
        functions = ["_files" if kind == FILES else "_imud_configs" if kind == CONFIGS else f"_imud_{kind}" for kind in kinds]
        if not functions:
            return " "
        return functions[0] if len(functions) == 1 else f"_imud_{'_or_'.join(kinds)}"

    def fish(self):
        def quoted(text):
            return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"

        out = ["# Completion of imud's commands for fish, made from their --help.", FISH_BEGIN]
        for words, command in self.programs.commands.items():
            program = command.words[0]
            condition = "__fish_use_subcommand" if words == "imud" else \
                "; and ".join(f"__fish_seen_subcommand_from {word}" for word in command.words[1:])
            # A command below another one can have the name of a command.
            others = [group.words[1] for group in self.groups if len(command.words) == 2 and
                      f"{' '.join(group.words)} {command.words[1]}" in self.programs.commands]
            condition += "".join(f"; and not __fish_seen_subcommand_from {other}" for other in others)
            if command in self.groups:
                names = " ".join(self.sets[f"{command.words[1]}_commands"])
                for entry in command.commands:
                    out.append(f"complete -c {program} -n {quoted(f'{condition}; and not __fish_seen_subcommand_from {names}')} "
                               f"-f -a {quoted(entry.names[0])} -d {quoted(entry.text)}")
            begin = f"complete -c {program}" + (f" -n {quoted(condition)}" if condition else "")
            if words == "imud":
                for entry in command.commands:
                    out.append(f"{begin} -f -a {quoted(entry.names[0])} -d {quoted(entry.text)}")
            for option in command.options:
                names = " ".join(f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}" for name in option.names)
                spec = f"{begin} {names} -d {quoted(option.text)}"
                if option.value:
                    spec += self.fish_values(self.kinds(command, option), "-x")
                out.append(spec)
            for entry in command.positionals:
                values = self.fish_values(self.kinds(command, entry), "-f")
                if " -a " in values:
                    out.append(f"{begin}{values.replace(' -F', '')} -d {quoted(entry.names[0])}")
        return "\n".join(out) + "\n"

    def fish_values(self, kinds, exclusive):
        given = [kind for kind in kinds if kind not in (FILES, CONFIGS, NOTHING)]
        dynamic = {RUNS: "(__imud_runs)", SCENARIOS: "(__imud_scenarios)"}
        words = [dynamic[kind] if kind in dynamic else " ".join(self.sets[kind]) for kind in given]
        flags = (" -r -F" if exclusive == "-x" else "") if FILES in kinds or CONFIGS in kinds else f" {exclusive}"
        return flags + (f" -a '{' '.join(words)}'" if words else "")


BASH_BEGIN = """
_imud_values() { # KINDS WORD: fills COMPREPLY
  local kind folder
  for kind in $1; do
    case $kind in
      nothing) ;;
      files) compopt -o filenames 2>/dev/null; mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen -f -- "$2") ;;
      configs)
        compopt -o filenames 2>/dev/null
        mapfile -t COMPREPLY < <(compgen -f -X '!*.toml' -- "$2"; compgen -f -X '!*.pcapng*' -- "$2"; compgen -d -- "$2")
        if ((${#COMPREPLY[@]} == 0)); then mapfile -t COMPREPLY < <(compgen -f -- "$2"); fi ;;
      runs) mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen -W "$(imud ctl 2>/dev/null | cut -d' ' -f1)" -- "$2") ;;
      scenarios)
        for folder in """ + " ".join(SHARED) + """; do
          mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen -G "$folder/tools/scenarios/*.toml" | grep -F -- "$2")
        done ;;
      *)
        local set=_imud_$kind
        mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen -W "${!set}" -- "$2") ;;
    esac
  done
  # A key or a port goes on after its = or : sign.
  if [[ ${COMPREPLY[0]-} == *[=:] ]]; then compopt -o nospace 2>/dev/null; fi
}

_imud() {
  local word=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} program=${COMP_WORDS[0]##*/}
  local first=1 options='' valued='' kinds='' positionals=() repeated='' place=0 skip='' i
  COMPREPLY=()
  # Words end at = and : too; what follows these is the user's.
  if [[ $word == [=:]* || $previous == [=:] ]]; then return; fi
  if [[ $program == imud ]] && ((COMP_CWORD > 1)) && [[ ${COMP_WORDS[1]} != -* ]]; then
    program="imud ${COMP_WORDS[1]}" first=2
    if ((COMP_CWORD > 2)) && [[ ${COMP_WORDS[1]} == @(GROUPS) && ${COMP_WORDS[2]} != -* ]]; then
      program+=" ${COMP_WORDS[2]}" first=3
    fi
  elif [[ $program == imud ]]; then
    positionals=(commands)
  fi
  case $program in"""
BASH_END = """  esac
  if [[ $program == imud ]]; then positionals=(commands); fi
  if [[ $kinds ]]; then _imud_values "$kinds" "$word"; return; fi
  if [[ $word == -* ]]; then mapfile -t COMPREPLY < <(compgen -W "$options" -- "$word"); return; fi
  for ((i = first; i < COMP_CWORD; i++)); do
    if [[ $skip ]]; then skip=''; continue; fi
    case ${COMP_WORDS[i]} in
      -*) if [[ $valued == *" ${COMP_WORDS[i]} "* ]]; then skip=1; fi ;;
      *) ((place += 1)) ;;
    esac
  done
  if [[ $repeated ]] && ((place >= ${#positionals[@]})); then place=$((${#positionals[@]} - 1)); fi
  _imud_values "${positionals[place]-}" "$word"
}
complete -F _imud """
ZSH_BEGIN = """_imud_configs() { _files -g '*.(toml|pcapng|pcapng.*)(-.)' }
_imud_runs() { compadd -- ${(f)"$(imud ctl 2>/dev/null | cut -d' ' -f1)"} }
_imud_scenarios() { compadd -- """ + " ".join(f"{folder}/tools/scenarios/*.toml(N)" for folder in SHARED) + """ }
"""
# _arguments changes `words` for the function that calls it, and for no other.
ZSH_END = """
_imud_dispatch() {
  local curcontext=$curcontext context state state_descr line
  local -a specs
  typeset -A opt_args
  _${service//-/_}_specs
  _arguments -C "${specs[@]}"
  if [[ $state != argument ]]; then return; fi
  if (($+functions[_imud_${words[1]}_specs])); then
    local group=$words[1]
    state=''
    _imud_${group}_specs
    _arguments -C "${specs[@]}"
    if [[ $state == argument ]] && (($+functions[_imud_${group}_${words[1]}_specs])); then
      _imud_${group}_${words[1]}_specs
      _arguments "${specs[@]}"
    fi
  fi
}
_imud_dispatch "$@"
"""
FISH_BEGIN = """function __imud_runs
    imud ctl 2>/dev/null | string replace -r ' .*' ''
end
function __imud_scenarios
    for folder in """ + " ".join(SHARED) + """
        for file in $folder/tools/scenarios/*.toml
            echo $file
        end
    end
end
"""
