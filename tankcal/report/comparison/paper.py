"""A comparison on paper: its values in the words of a language."""

from collections import defaultdict

from tankcal.job.rule_files import shipped_names, shipped_rule
from tankcal.record.comparison import COMPARISON
from tankcal.report import attachments, blocks
from tankcal.report.comparison.tables import symbol_of
from tankcal.report.plain import PlainPaper, words_with_part
from tankcal.text.digits import LITRE_DECIMALS, NOTHING
from tankcal.text.languages import DEFAULT
from tankcal.text.words import load_words, message_sentence

FILE = "comparison.json"
WORKBOOK = "comparison.xlsx"
DIGITS_OF_DIGEST = 12
LONGEST_WORD = 30  # letters of a name in a column of a page
UNITS = {"C": "degC", "%": "percent", "mm": "image mm"}  # {of the file: of report.numbers}
DECIMALS = {"C": 1, "kg/m3": 1, "mm": 2, "m": 4, "m3": 4, "%": 3}
CODES = {  # {value of a reason: group of words that it is looked up in}
    "steps": "steps",
    "step": "steps",
    "limit": "numbers",
    "limits": "numbers",
    "of": "ages",
}


class ComparisonPaper(PlainPaper):
    """A `record.comparison.ComparisonFile` as plain data, with the words of a language.

    found       as parsed; checked against its schema
    language    one of languages.LANGUAGES; None: English
    letterhead  a `letterhead.Letterhead` of who compares, or None

    Words are looked up in the group's part under `comparison` first, then in the group itself.
    """

    def __init__(self, found, language=None, letterhead=None):
        super().__init__(words_with_part(load_words(language or DEFAULT), "comparison"))
        found = COMPARISON.migrated(found, COMPARISON.file)
        self.saved = found
        self.found = found | {"rule": self._rule(found["rule"])}
        self.letterhead = letterhead.data() if letterhead else None

    def _rule(self, rule):
        """The rule with the texts of a shipped one; those of a laboratory's own file stay."""
        name = (rule or {}).get("file", "").removesuffix(".toml")
        texts = self.words.get("rule_texts", {}).get(name)
        if texts is None or name not in shipped_names():
            return rule
        return rule | texts if shipped_rule(name).name == rule["name"] else rule

    def subject(self):
        """What the papers are about: the tank, or the file of the former table."""
        tank = self.found["tank"]
        subject = f"{self.word('page.tank')} {tank}" if tank else self.found["former"]["name"]
        return bearable(subject)

    def head(self, folder=None):
        """The start of the document, and the head of its first page.

        folder  of the files that the PDF holds inside; None: none
        """
        title = self.word("titles.comparison")
        return [
            blocks.document(
                title=f"{title}, {self.subject()}",
                author=self.letterhead["name"] if self.letterhead else "",
                date=self._date(),
                language=self.words["language"]["code"],
                notice=self.found["notice"],
                running=[title, self.subject()],
                footer=self._footer(folder),
                letterhead=self.letterhead,
                attachments=self._attachments(folder),
            ),
            blocks.masthead(title, self.subject()),
        ]

    def _date(self):
        """The day of the new table, ISO; "" where its date is not known, or is none."""
        return iso_day(self.found["new"]["date"])

    def _footer(self, folder):
        """Page numbers, and the first digits of the SHA-256 of the comparison that is printed."""
        made = f"{self.words['page']['footer']} · tankcal {self.found['tankcal']}"
        if folder is None:
            return made
        digest = attachments.sha256((folder / FILE).read_bytes())[:DIGITS_OF_DIGEST]
        return f"{made} · {self.word('texts.digest', digest=digest)}"

    def _attachments(self, folder):
        if folder is None:
            return []
        described = {name: self.word(f"attached.{key}") for name, key in ATTACHED.items()}
        return [one.data() for one in attachments.beside(folder, described)]

    # ---- values

    def measure(self, value, unit, decimals=None):
        """A value in a unit as the file calls it; "not known" for none."""
        if value is None:
            return self.word("texts.not_known")
        decimals = DECIMALS.get(unit, 4) if decimals is None else decimals
        return self.number(value, UNITS.get(unit, unit), decimals=decimals)

    def chosen(self, value, unit):
        """A value that somebody chose or printed, without zeros at its end; None gives None."""
        return self.plain(value, symbol_of(unit))

    def reason(self, one):
        """A reason {code, values} as a sentence; a code without words with its values."""
        values = {  # places in words are letters: {d} of d_m3
            key.removesuffix("_m3"): self._shown(one["values"], key) for key in one["values"]
        }
        template = self.words["reasons"].get(one["code"] + _variant(one["values"]))
        if template is None:
            told = ", ".join(f"{key} {value}" for key, value in values.items())
            return f"{one['code']}: {told}" if told else one["code"]
        return template.format_map(defaultdict(lambda: NOTHING, values))

    def _shown(self, values, key):
        """A value of a reason: a code as its name, a number in the unit of its key or of `unit`."""
        value = values[key]
        if value is None:
            return "∞" if key == "E_n" else NOTHING
        if key in CODES:
            names = value if isinstance(value, list) else [value]
            return ", ".join(self.words[CODES[key]].get(one, one) for one in names)
        if isinstance(value, list):
            return ", ".join(map(str, value))
        if isinstance(value, str):
            return value
        if isinstance(value, int):
            return self.number(value, decimals=0)
        if key == "value":
            return self.measure(value, values["unit"])
        if key == "most":
            return self.chosen(value, values["unit"])
        if key.endswith("_m"):
            return self.height(value)
        if key.endswith("_m3"):
            return signed_text(value, self.number(value, "m3", decimals=LITRE_DECIMALS))
        if key == "age":
            return self.number(value, decimals=1)
        if key == "years":
            return self.plain(value)
        return self.number(value, decimals=2)

    def warning(self, one):
        """A warning of the file in the language."""
        said = message_sentence(self.words, one["text"], one["code"], one["values"])
        place = f"{one['file']}: " if one["file"] else ""
        return f"{place}{said}"


def bearable(text):
    """A text of a user without words that no column holds: their middle is left out."""
    return " ".join(map(shortened, str(text).split(" ")))


def shortened(name):
    """A name of at most LONGEST_WORD letters, its middle left out."""
    half = LONGEST_WORD // 2
    return name if len(name) <= LONGEST_WORD else f"{name[:half]}…{name[1 - half :]}"


def signed_text(value, text):
    """The text of a number with a plus before it where it is above 0."""
    return f"+{text}" if value > 0 else text


def _variant(values):
    """The end of the word for a reason: of a delivery, with a limit of c, for what was lacking."""
    if "low_m" in values:
        return "_of_delivery"
    if values.get("c_limit") is not None:
        return "_with_limit"
    return "_for_lack" if values.get("lacking") else ""


ATTACHED = {FILE: "comparison", WORKBOOK: "comparison_workbook"}


def iso_day(text):
    """The date that a text begins with, as text; "" where it begins with none."""
    from datetime import date

    try:
        return date.fromisoformat(str(text or "")[:10]).isoformat()
    except ValueError:
        return ""
