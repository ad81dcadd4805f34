"""A comparison on paper: its values in the words of a language."""

from collections import defaultdict
from typing import ClassVar

from tankcal.job.rule_files import shipped_names, shipped_rule
from tankcal.record.comparison import COMPARISON
from tankcal.report.comparison.tables import symbol_of
from tankcal.report.plain import words_with_part
from tankcal.report.saved_paper import SavedPaper, bearable, iso_day, signed_text
from tankcal.text.digits import LITRE_DECIMALS, NOTHING
from tankcal.text.languages import DEFAULT
from tankcal.text.words import load_words

FILE = "comparison.json"
WORKBOOK = "comparison.xlsx"
UNITS = {"C": "degC", "%": "percent", "mm": "image mm"}  # {of the file: of report.numbers}
DECIMALS = {"C": 1, "kg/m3": 1, "mm": 2, "m": 4, "m3": 4, "%": 3}
CODES = {  # {value of a reason: group of words that it is looked up in}
    "steps": "steps",
    "step": "steps",
    "limit": "numbers",
    "limits": "numbers",
    "of": "ages",
}


class ComparisonPaper(SavedPaper):
    """A `record.comparison.ComparisonFile` as plain data, with the words of a language.

    found       as parsed; checked against its schema
    language    one of languages.LANGUAGES; None: English
    letterhead  a `letterhead.Letterhead` of who compares, or None

    Words are looked up in the group's part under `comparison` first, then in the group itself.
    """

    kind, file = "comparison", FILE
    attached: ClassVar[dict] = {FILE: "comparison", WORKBOOK: "comparison_workbook"}

    def __init__(self, found, language=None, letterhead=None):
        super().__init__(words_with_part(load_words(language or DEFAULT), "comparison"))
        found = COMPARISON.migrated(found, COMPARISON.file)
        self.saved = found
        texts = self._texts_of_rule(found["rule"])
        own = {key: value for key, value in texts.items() if key != "clauses"}
        self.found = found | {"rule": found["rule"] and found["rule"] | own}
        for key in ("legal", "ages"):
            self.found[key] = [_with_clause(one, texts.get("clauses", {})) for one in found[key]]
        self.letterhead = letterhead.data() if letterhead else None

    def _texts_of_rule(self, rule):
        """The texts of a shipped rule; none of a laboratory's own file, whose own stay."""
        name = (rule or {}).get("file", "").removesuffix(".toml")
        texts = self.words.get("rule_texts", {}).get(name)
        if texts is None or name not in shipped_names():
            return {}
        return texts if shipped_rule(name).name == rule["name"] else {}

    def subject(self):
        """What the papers are about: the tank, or the file of the former table."""
        tank = self.found["tank"]
        subject = f"{self.word('page.tank')} {tank}" if tank else self.found["former"]["name"]
        return bearable(subject)

    def date(self):
        """The day of the new table, ISO; "" where its date is not known, or is none."""
        return iso_day(self.found["new"]["date"])

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


def _variant(values):
    """The end of the word for a reason: of a delivery, with a limit of c, for what was lacking."""
    if "low_m" in values:
        return "_of_delivery"
    if values.get("c_limit") is not None:
        return "_with_limit"
    return "_for_lack" if values.get("lacking") else ""


def _with_clause(one, clauses):
    """A number of the rule with its clause in the reader's language; others are quoted as is."""
    return one | {"clause": clauses.get(one["clause"], one["clause"])}
