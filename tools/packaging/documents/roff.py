"""Pages for man: text in man(7) macros, and the Markdown of this project's documents in them."""
import re


ESCAPES = {"\\": "\\e", "-": "\\-", "'": "\\(aq", "`": "\\(ga", "^": "\\(ha", "~": "\\(ti"}
LONG = 30  # longer words get places where a line may end


def escape(text):
    """Returns `text` as roff shows it; hyphens stay hyphens that a reader can copy."""
    escaped = re.sub(r"[\\\-'`^~]", lambda match: ESCAPES[match.group()], text)
    return re.sub(rf"\S{{{LONG},}}", lambda match: re.sub(r"(?<=[,|&?/])(?=.)", r"\\:", match.group()), escaped)


def line(text):
    """Returns one line of text, which no macro's dot begins."""
    return f"\\&{text}" if text.startswith((".", "'")) else text


def inline(text):
    """Returns Markdown of one paragraph: code and links bold, emphasis italic."""
    parts = re.split(r"(`+[^`]+`+|!?\[[^\]]*\]\([^)]*\)|\*\*[^*]+\*\*|<https?://[^>]+>)", " ".join(text.split()))
    out = []
    for part in parts:
        link = re.fullmatch(r"(!?)\[([^\]]*)\]\(([^)]*)\)", part)
        if part.startswith("`") and len(part) > 2:
            out.append(f"\\fB{escape(part.strip('`'))}\\fR")
        elif link:
            if not link.group(1):
                target = link.group(3)
                out.append(escape(link.group(2).replace("`", "")) + (f" ({escape(target)})" if "://" in target else ""))
        elif part.startswith("**"):
            out.append(f"\\fB{escape(part[2:-2])}\\fR")
        else:
            out.append(escape(re.sub(r"\\([|*_`])", r"\1", part)))
    return line("".join(out))


def cells(row):
    """Returns the cells of a row of a table; `\\|` and a | in code are no borders."""
    row = row.strip().removeprefix("|").removesuffix("|")
    return [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|(?=(?:[^`]*`[^`]*`)*[^`]*$)", row)]


def table(rows):
    """A table becomes a list: its first cell, then the others, each named by its column unless it is the last one."""
    heads = cells(rows[0])
    out = []
    for row in rows[2:]:
        first, *others = cells(row)
        out += [".TP", inline(first) or "\\&"]
        named = [f"{head}: {cell}" for head, cell in zip(heads[1:-1], others[:-1]) if cell]
        if named:
            out += [inline("; ".join(named) + "."), ".br"]
        out.append(inline(others[-1]) or "\\&" if others else "\\&")
    return out


def verbatim(lines):
    return [".PP", ".RS 4", ".nf", *(line(escape(text)) or "\\&" for text in lines), ".fi", ".RE"]


def markdown(text):
    """Returns the lines of a page for a document, without its title."""
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    out, lines = [], text.splitlines()
    at = 0
    while at < len(lines):
        here = lines[at]
        if not here.strip():
            at += 1
        elif match := re.match(r"(#+) (.*)", here):
            if len(match.group(1)) > 1:
                plain = match.group(2).replace("`", "")
                out.append(f'.{"SH" if len(match.group(1)) == 2 else "SS"} "{escape(plain)}"')
            at += 1
        elif here.startswith("```"):
            end = next(i for i in range(at + 1, len(lines)) if lines[i].startswith("```"))
            out += verbatim(lines[at + 1:end])
            at = end + 1
        elif here.startswith("    "):
            end = at
            while end < len(lines) and (lines[end].startswith("    ") or not lines[end].strip()):
                end += 1
            block = [text[4:] for text in lines[at:end]]
            while not block[-1].strip():
                block.pop()
            out += verbatim(block)
            at = end
        elif here.startswith("|"):
            end = at
            while end < len(lines) and lines[end].startswith("|"):
                end += 1
            out += table(lines[at:end])
            at = end
        else:
            bullet = re.match(r"(- |\d+\. )", here)
            end = at + 1
            while end < len(lines) and lines[end].strip() and not re.match(r"(- |\d+\. |#|\||```)", lines[end]):
                end += 1
            paragraph = inline(" ".join([here[len(bullet.group(1)):] if bullet else here, *lines[at + 1:end]]))
            if paragraph:
                out += [".IP \\(bu 2" if bullet else ".PP", paragraph]
            at = end
    return out


class Page:
    def __init__(self, name, section, summary, date, version):
        self.name, self.section = name, section
        self.lines = [f'.TH "{name.upper()}" "{section}" "{date}" "imud {version}" "imud"', ".nh", ".ad l", ".SH NAME",
                      f"{name} \\- {escape(summary)}"]

    @property
    def file(self):
        return f"{self.name}.{self.section}"

    def head(self, title):
        self.lines.append(f'.SH "{title}"')

    def paragraph(self, text):
        self.lines += [".PP", inline(text)]

    def item(self, tag, text):
        """`tag` is roff already; `text` is plain, in which nothing is bold."""
        self.lines += [".TP", tag, line(escape(text)) or "\\&"]

    def text(self):
        text = "\n".join(self.lines) + "\n"
        return re.sub(r"^(\.S[HS] .*\n)\.PP\n", r"\1", text, flags=re.MULTILINE)
