"""The pages of the manual, from --help, from `imud list` and from the reference in Markdown."""
import posixpath
import re

from roff import Page, escape, inline, line, markdown, verbatim

EXIT = "0 done and complete; 1 failed while running; 2 the configuration or the command line is wrong; 3 done, but " \
       "incomplete, or a limit of --require is violated."
# Sections of a tool's help that imud-products(7) has.
PRODUCTS = re.compile(r"^(Protocols|Logs|Ports)")
# Where the pages that others name are installed, and those that the manual has.
INSTALLED = "/usr/share/imud/"
IN_MANUAL = {"emulator/CONFIGURATION.md": "imud.toml(5)", "emulator/faults/README.md": "imud-scenario(5)",
             "transports/README.md": "imud-truth(7)"}
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


def installed(text, folder):
    """Returns the Markdown of a document in `folder`, in which other documents have the names that a reader of the manual finds."""
    def named(path):
        return f"`{IN_MANUAL.get(path) or INSTALLED + path}`"

    text = re.sub(r"`tests/[^`]+_test\.cpp` compares .*?\.\n", "", text, flags=re.DOTALL)  # for who changes the code
    text = text.replace("README.md of this folder", named(f"{folder}/README.md"))
    text = re.sub(r"\[[^\]]*\]\(([A-Za-z_/]+\.md)\)", lambda link: named(posixpath.normpath(f"{folder}/{link[1]}")), text)
    return re.sub(r"(?<![\w/])`?((?:core|emulator|protocols|tests|tools|transports)/(?:[a-z_]+/)*[A-Z]+\.md)`?",
                  lambda code: named(code[1]), text)


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
        summary = command.summary.split(": ")[0] if command.name == "imud" else re.split(r"[.:;](?: |$)", command.summary)[0]
        page = self.page(command.name, 1, first_lower(summary))
        page.head("SYNOPSIS")
        words = " ".join(command.words)
        page.lines += [f"\\fB{escape(words)}\\fR {escape(command.usage[len(words):].strip())}"]
        page.head("DESCRIPTION")
        page.lines.append(line(escape(command.summary.rstrip(".") + ".")))
        if command.name == "imud":
            page.paragraph("Truth is the true motion of the vehicle, as a simulator sends it (`imud-truth(7)`): imud computes from it "
                           "what the sensor would measure, and sends that as the product does (`imud-products(7)`).")
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
        if command.name == "imud":
            self.service(page)
            self.first_steps(page)
        elif examples:
            page.head("EXAMPLES")
            page.lines += verbatim(example.strip() for example in examples)
        if command.name == "imud":
            page.head("FILES")
            page.item("\\fIimud.toml\\fR, \\fI~/.config/imud/imud.toml\\fR, \\fI/etc/imud/imud.toml\\fR",
                      "The configuration of run and check if none is given: the first of these that exists. XDG_CONFIG_HOME takes "
                      "the place of ~/.config.")
            page.item("\\fI/etc/imud/NAME.toml\\fR", "The configuration of the service imud@NAME.")
            page.item("\\fI/run/imud\\fR", "The folder of the service's control socket, imud-NAME.sock, and for the links of its ptys, such as "
                      "port = \"pty:/run/imud/imu1\". A run from a shell makes the link of pty:imu1 in the current folder.")
            page.item("\\fI/usr/share/imud\\fR", "Examples, scenarios, bridges to simulators, a captured flight, and all README.md pages.")
        return self.see_also(page)

    def service(self, page):
        page.head("SERVICE")
        page.paragraph("`/etc/imud/NAME.toml` is run by the service `imud@NAME`, as the user imud, which is in the group dialout of serial "
                       "devices. A pty has its link in `/run/imud`: `port = \"pty:/run/imud/imu1\"`.")
        page.lines += verbatim(["systemctl enable --now imud@NAME    # starts it, now and with the machine",
                                "journalctl -u imud@NAME             # its log",
                                "systemctl reload imud@NAME          # reads the file again, as imud ctl reload",
                                "imud status NAME"])

    def first_steps(self, page):
        page.head("EXAMPLES")
        page.paragraph("A VN-100 whose truth JSBSim sends. init prints how JSBSim is started; imud runs first:")
        page.lines += verbatim(["imud init vn-100 --port pty:imu1 --from jsbsim", "imud check", "imud run",
                                "imu-decode vectornav pty:imu1    # in another terminal, in the same folder"])
        page.paragraph("The same without a simulator, by a motion that is known in closed form, at a place:")
        page.lines += verbatim(["imud init vn-100 --port pty:imu1 --from imu-truth --place=47.26,11.35,577 --force", "imud run",
                                "imu-truth coning --to udp:127.0.0.1:9810    # in another terminal",
                                "imu-decode vectornav pty:imu1               # in a third one, in the same folder"])

    def methods(self):
        text = (self.source / "emulator/control/README.md").read_text()
        begin = text.index("| method | parameters | does |")
        return markdown(text[begin:text.index("\n\n", begin)])

    def configuration(self):
        page = self.page("imud.toml", 5, "configuration of imud")
        page.head("DESCRIPTION")
        page.lines += markdown(installed((self.source / "emulator/CONFIGURATION.md").read_text(), "emulator"))
        return self.see_also(page)

    def scenarios(self):
        page = self.page("imud-scenario", 5, "what fails in a run of imud, and what is expected of its hosts")
        page.head("DESCRIPTION")
        page.lines += markdown(installed((self.source / "emulator/faults/README.md").read_text(), "emulator/faults"))
        page.head("SHIPPED SCENARIOS")
        page.paragraph("In `/usr/share/imud/tools/scenarios`, for `--scenario`:")
        for path in sorted((self.source / "tools/scenarios").glob("*.toml")):
            comment = re.match(r"(?:#.*\n)+", path.read_text())
            text = " ".join(row.lstrip("# ") for row in comment.group(0).splitlines()) if comment else ""
            page.item(f"\\fB{escape(path.name)}\\fR", text)
        return self.see_also(page)

    def settings(self, page, name, prefix):
        for setting in name.get("settings", []):
            text = installed(setting["help"], "emulator").replace("`", "")
            default = setting.get("default")
            shown = "" if default is None else f"default {str(default).lower() if isinstance(default, bool) else default}"
            shown = "; ".join(part for part in (setting.get("valid", ""), shown) if part)
            page.item(f"\\fB{escape(prefix + setting['key'])}\\fR", text + (f" ({shown})" if shown else ""))

    def named(self, page, kind, prefix=""):
        for name in self.programs.of_kind(kind):
            page.lines += [f'.SS "{escape(name["name"])}"', line(escape(installed(f"{name['summary']}. Document: {name['document']}.", "emulator").replace("`", "")))]
            self.settings(page, name, prefix)
            if name.get("columns"):
                page.paragraph("Its columns, by the names in the header row, which comes before the first row of numbers:")
            for column in name.get("columns", []):
                page.item("\\fB" + escape(", ".join(column["names"])) + "\\fR", f"{column['need']}: {column['help']}")
            for counter in name.get("counters", []):
                page.item(f"counter \\fB{escape(counter['key'])}\\fR", counter["help"])

    def ports(self, page):
        page.head("PORTS")
        for name in self.programs.of_kind("transport"):
            page.item(f"\\fB{escape(name['syntax'])}\\fR", name["summary"])
        page.paragraph("`pty:imu1` makes the link `imu1` in the folder in which imud is started; a client in another folder needs the "
                       "link's path, as in `imu-decode vectornav pty:/home/me/bench/imu1`. The service (`imud(1)`) has an absolute one, such as "
                       "`pty:/run/imud/imu1`.")

    def truth(self):
        page = self.page("imud-truth", 7, "formats in which imud receives truth")
        page.head("DESCRIPTION")
        page.paragraph("Truth is the true motion of a vehicle, which a simulator sends to `truth.port` in `truth.format` "
                       "(`imud.toml(5)`). `imud list FORMAT` prints what is known of one; a format of columns, such as jsbsim, has "
                       "a header row with their names, then a row for each truth, each a line or a datagram. A simulator that "
                       "sends the header row once is started after imud, or `truth.columns` has the names. The formats, with their "
                       "settings in `[truth]`:")
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
