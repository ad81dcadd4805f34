"""Files of `tankcal compare`: the comparison as JSON, CSV, workbook, PDF and web page.

All values come from comparison.json; no number is computed here.
"""

from collections import defaultdict
from typing import ClassVar

from tankcal.job.rule_files import shipped_names, shipped_rule
from tankcal.record.recalibration import COMPARISON
from tankcal.report.comparison.tables import COURSES, DELIVERIES, ROWS, WATERFALL, unit_symbol
from tankcal.report.plain import words_with_part
from tankcal.report.saved_document import SavedDocument, SavedPaper, bearable, iso_day, signed_text
from tankcal.text.digits import LITRE_DECIMALS, NOTHING
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words

__all__ = ["DOCUMENT", "ComparisonPaper", "rebuild", "refuse_foreign", "write_comparison"]

FILE, WORKBOOK = "comparison.json", "comparison.xlsx"
TABLES = {
    "rows.csv": ROWS,
    "waterfall.csv": WATERFALL,
    "deliveries.csv": DELIVERIES,
    "courses.csv": COURSES,
}
UNITS = {"C": "degC", "%": "percent", "mm": "image mm"}  # {unit of the file: unit of the report}
DECIMALS = {"C": 1, "kg/m3": 1, "mm": 2, "m": 4, "m3": 4, "%": 3}  # by unit of the file
CODES = {  # {value of a reason: group of its words}
    "steps": "steps",
    "step": "steps",
    "limit": "numbers",
    "limits": "numbers",
    "of": "ages",
}


class ComparisonPaper(SavedPaper):
    """Formatter of a `record.recalibration.ComparisonFile` in a language.

    Words are looked up in the part of a group under `comparison` first, then in the group.

    Parameters
    ----------
    comparison : dict
        The comparison as plain data; it is checked by its schema.
    language : str, optional
        One of languages.LANGUAGES; None: English.
    letterhead : letterhead.Letterhead, optional
        Letterhead of the laboratory that compares.
    """

    kind, file = "comparison", FILE
    attached: ClassVar[dict] = {FILE: "comparison", WORKBOOK: "comparison_workbook"}

    def __init__(self, comparison, language=None, letterhead=None):
        super().__init__(words_with_part(load_words(language or DEFAULT), "comparison"))
        self.saved = COMPARISON.migrated(comparison, COMPARISON.file)
        rule = self.saved["rule"]
        texts = self._texts_of_rule(rule)
        clauses = texts.get("clauses", {})
        of_rule = {key: text for key, text in texts.items() if key != "clauses"}
        self.record = self.saved | {"rule": rule and rule | of_rule}
        for key in ("legal", "ages"):
            self.record[key] = [
                entry | {"clause": clauses.get(entry["clause"], entry["clause"])}
                for entry in self.saved[key]
            ]
        self.letterhead = letterhead.data() if letterhead else None

    def _texts_of_rule(self, rule):
        """Return the texts of a shipped rule in the language; {} for a file of the user."""
        name = (rule or {}).get("file", "").removesuffix(".toml")
        texts = self.words.get("rule_texts", {}).get(name)
        if texts is None or name not in shipped_names():
            return {}
        return texts if shipped_rule(name).name == rule["name"] else {}

    def subject(self):
        """Return the tank, or the file of the former table if the tank is unknown."""
        tank = self.record["tank"]
        subject = f"{self.word('page.tank')} {tank}" if tank else self.record["former"]["name"]
        return bearable(subject)

    def date(self):
        """Return the ISO date of the new table; "" if it is unknown or no date."""
        return iso_day(self.record["new"]["date"])

    # ---- values

    def measure(self, value, unit, decimals=None):
        """Return a value in a unit of the file; "not known" for None."""
        if value is None:
            return self.word("texts.not_known")
        decimals = DECIMALS.get(unit, 4) if decimals is None else decimals
        return self.number(value, UNITS.get(unit, unit), decimals=decimals)

    def declared_value(self, value, unit):
        """Return a declared or printed value without final zeros; None for None."""
        return self.plain(value, unit_symbol(unit))

    def reason(self, reason):
        """Return a reason {code, values} as a sentence; the code and the values without words."""
        code, values = reason["code"], reason["values"]
        texts = {  # places in words consist of letters: {d} is the place of d_m3
            key.removesuffix("_m3"): self._value_of_reason(values, key) for key in values
        }
        template = self.words["reasons"].get(code + _variant(values))
        if template is None:
            listed = ", ".join(f"{key} {text}" for key, text in texts.items())
            return f"{code}: {listed}" if listed else code
        return template.format_map(defaultdict(lambda: NOTHING, texts))

    def _value_of_reason(self, values, key):
        """Return a code as its name, or a number in the unit of its key or in `unit`."""
        value = values[key]
        if value is None:
            return "∞" if key == "E_n" else NOTHING
        if key in CODES:
            codes = value if isinstance(value, list) else [value]
            return ", ".join(self.words[CODES[key]].get(code, code) for code in codes)
        if isinstance(value, list):
            return ", ".join(map(str, value))
        if isinstance(value, str):
            return value
        if isinstance(value, int):
            return self.number(value, decimals=0)
        if key == "value":
            return self.measure(value, values["unit"])
        if key == "most":
            return self.declared_value(value, values["unit"])
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
    """Return the suffix of the sentence: for a delivery, a limit of c, or missing values."""
    if "low_m" in values:
        return "_of_delivery"
    if values.get("c_limit") is not None:
        return "_with_limit"
    return "_for_lack" if values.get("lacking") else ""


def _load_renderers():
    from tankcal.report.comparison.paper import pages, write

    return pages, write


DOCUMENT = SavedDocument(
    COMPARISON,
    ComparisonPaper,
    _load_renderers,
    tables=TABLES,
)
refuse_foreign, rebuild = DOCUMENT.refuse_foreign, DOCUMENT.rebuild
write_comparison = DOCUMENT.write
