"""The pages of the manual, from --help, from `imud list` and from the reference in Markdown."""
import re

from roff import Page, escape, inline, line, markdown, verbatim

EXIT = "0 done and complete; 1 failed while running; 2 the configuration or the command line is wrong; 3 done, but " \
       "incomplete, or a limit of --require is violated."
# Sections of a tool's help that imud-products(7) has.
PRODUCTS = re.compile(r"^(Protocols|Logs|Ports)")
SEE = ["imud(1)", "imu-decode(1)", "imu-truth(1)", "imud.toml(5)", "imud-scenario(5)", "imud-truth(7)", "imud-products(7)"]


def option_tag(option):
    names = ", ".join(f"\\fB{escape(name)}\\fR" for name in option.names)
    value, equals, default = option.value.partition("=")
    if option.value == "KEY=VALUE":
        value, equals = option.value, ""
    return names + (f" \\fI{escape(value)}\\fR" if value else "") + (f" ({escape(default)})" if equals else "") + \
        (" ..." if option.repeated else "")


def entry_text(entry):
    text = entry.text.rstrip(".")
    if entry.required and entry.is_option:
        text += "; required"
    if entry.relations:
        text += "; " + re.sub(r"(\w+): ", lambda match: match.group(1).lower() + " ", entry.relations)
    return text[:1].upper() + text[1:] + "."


def first_lower(text):
    word = text.split(" ", 1)[0]
    return text if word.isupper() or len(word) < 2 else text[0].lower() + text[1:]


class Manual:
    def __init__(self, programs, source, date):
        self.programs, self.source, self.date = programs, source, date
        self.pages = [self.command_page(command) for command in programs.commands.values()]
        self.pages += [self.configuration(), self.scenarios(), self.truth(), self.products()]

    def page(self, name, section, summary):
        return Page(name, section, summary, self.date, self.programs.version)

    def see_also(self, page):
        page.head("SEE ALSO")
        own = f"{page.name}({page.section})"
        page.lines.append(", ".join(f"\\fB{escape(name[:-3])}\\fR{name[-3:]}" for name in SEE if name != own))
        return page

    def command_page(self, command):
        summary = command.summary.split(": ")[0] if command.name == "imud" else re.split(r"[.:;,](?: |$)", command.summary)[0]
        page = self.page(command.name, 1, first_lower(summary))
        page.head("SYNOPSIS")
        words = " ".join(command.words)
        page.lines += [f"\\fB{escape(words)}\\fR {escape(command.usage[len(words):].strip())}"]
        page.head("DESCRIPTION")
        page.lines.append(line(escape(command.summary.rstrip(".") + ".")))
        for entry in command.positionals:
            page.item(f"\\fI{escape(entry.names[0])}\\fR" + (" ..." if entry.repeated else ""), entry_text(entry))
        if command.commands:
            page.head("COMMANDS")
            for entry in command.commands:
                page.item(f"\\fB{escape(entry.names[0])}\\fR", entry_text(entry))
            page.paragraph(f"Each has a page of its own, such as `{command.name}-{command.commands[0].names[0]}(1)`.")
        if command.name == "imud-ctl":
            page.head("METHODS")
            page.lines += self.methods()
        for title, options in command.groups:
            page.head(title.upper())
            for option in options:
                page.item(option_tag(option), entry_text(option))
        examples = []
        status = EXIT
        for title, lines in command.sections:
            if title == "Exit codes":
                status = lines[0]
            elif title == "Example":
                examples = lines
            elif title == "Every key":
                continue
            elif PRODUCTS.match(title):
                continue
            else:
                page.head(title.upper())
                page.lines += verbatim(lines)
        if any(PRODUCTS.match(title) for title, _ in command.sections):
            page.head("PROTOCOLS AND PORTS")
            page.paragraph("`imud-products(7)` has the protocols with their settings, the logs that can take a protocol's "
                           "place, and the ports.")
        page.head("EXIT STATUS")
        page.lines.append(line(escape(status)))
        if examples:
            page.head("EXAMPLES")
            page.lines += verbatim(example.strip() for example in examples)
        if command.name == "imud":
            page.head("FILES")
            page.item("\\fIimud.toml\\fR, \\fI~/.config/imud/imud.toml\\fR, \\fI/etc/imud/imud.toml\\fR",
                      "The configuration of run and check if none is given: the first of these that exists. XDG_CONFIG_HOME takes "
                      "the place of ~/.config.")
            page.item("\\fI/etc/imud/NAME.toml\\fR", "The configuration of the service imud@NAME.")
            page.item("\\fI/run/imud\\fR", "The folder of its ptys and of its control socket, imud-NAME.sock.")
            page.item("\\fI/usr/share/imud\\fR", "Examples, scenarios, bridges to simulators, a captured flight, and all README.md pages.")
        return self.see_also(page)

    def methods(self):
        text = (self.source / "emulator/control/README.md").read_text()
        begin = text.index("| method | parameters | does |")
        return markdown(text[begin:text.index("\n\n", begin)])

    def configuration(self):
        page = self.page("imud.toml", 5, "configuration of imud")
        page.head("DESCRIPTION")
        page.paragraph("The pages that this one names are in `/usr/share/imud/emulator`.")
        page.lines += markdown((self.source / "emulator/CONFIGURATION.md").read_text())
        return self.see_also(page)

    def scenarios(self):
        page = self.page("imud-scenario", 5, "what fails in a run of imud, and what is expected of its hosts")
        page.head("DESCRIPTION")
        page.paragraph("The pages that this one names are in `/usr/share/imud/emulator`.")
        page.lines += markdown((self.source / "emulator/faults/README.md").read_text())
        page.head("SHIPPED SCENARIOS")
        page.paragraph("In `/usr/share/imud/tools/scenarios`, for `--scenario`:")
        for path in sorted((self.source / "tools/scenarios").glob("*.toml")):
            comment = re.match(r"(?:#.*\n)+", path.read_text())
            text = " ".join(row.lstrip("# ") for row in comment.group(0).splitlines()) if comment else ""
            page.item(f"\\fB{escape(path.name)}\\fR", text)
        return self.see_also(page)

    def settings(self, page, name, prefix):
        for setting in name.get("settings", []):
            text = setting["help"]
            default = setting.get("default")
            shown = "" if default is None else f"default {str(default).lower() if isinstance(default, bool) else default}"
            shown = "; ".join(part for part in (setting.get("valid", ""), shown) if part)
            page.item(f"\\fB{escape(prefix + setting['key'])}\\fR", text + (f" ({shown})" if shown else ""))

    def named(self, page, kind, prefix=""):
        for name in self.programs.of_kind(kind):
            page.lines += [f'.SS "{escape(name["name"])}"', line(escape(f"{name['summary']}. Document: {name['document']}."))]
            self.settings(page, name, prefix)
            for counter in name.get("counters", []):
                page.item(f"counter \\fB{escape(counter['key'])}\\fR", counter["help"])

    def ports(self, page):
        page.head("PORTS")
        for name in self.programs.of_kind("transport"):
            page.item(f"\\fB{escape(name['syntax'])}\\fR", name["summary"])

    def truth(self):
        page = self.page("imud-truth", 7, "formats in which imud receives truth")
        page.head("DESCRIPTION")
        page.paragraph("Truth is the true motion of a vehicle, which a simulator sends to `truth.port` in `truth.format` "
                       "(`imud.toml(5)`). The formats, with their settings in `[truth]`:")
        self.named(page, "truth format", "truth.")
        self.ports(page)
        return self.see_also(page)

    def products(self):
        page = self.page("imud-products", 7, "sensors that imud emulates")
        page.head("DESCRIPTION")
        page.paragraph("A product is chosen by `protocol` in `[[imu]]` (`imud.toml(5)`); its settings are in `[imu.device]`, and "
                       "a preset of its errors is chosen by `model`. `imud list NAME` prints all of one.")
        page.head("PROTOCOLS")
        self.named(page, "protocol")
        self.ports(page)
        page.head("PRESETS")
        for name in self.programs.of_kind("preset"):
            page.item(f"\\fB{escape(name['name'])}\\fR", f"{name['summary']}. Document: {name['document']}")
        return self.see_also(page)
