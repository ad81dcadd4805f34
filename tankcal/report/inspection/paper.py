"""Texts of an inspection in a language: figures, limits, verdicts and remarks."""

from collections import defaultdict
from typing import ClassVar

from tankcal.record.inspection import INSPECTION
from tankcal.report import numbers
from tankcal.report.plain import words_with_part
from tankcal.report.saved_document import SavedPaper, bearable, iso_day, signed_text
from tankcal.text.digits import NOTHING, fixed, shortest
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words

FILE = INSPECTION.file
WORKBOOK = "inspection.xlsx"
UNVERIFIED = "*"  # marks a limit that was not read in the text of its standard
AT_LEAST = ("settlement_cosine",)  # checks with a lower limit
FINE = ("settlement_all", "settlement_subset", "settlement_de_beer")  # checks in 0.01 mm
UNITS = {  # {unit of a check: (printed unit, factor, decimals)}
    "mm": ("mm", 1.0, 1),
    "mm/m": ("mm/m", 1.0, 2),
    "1/m": ("mm/m²", 1e3, 3),  # a curvature: change of the slope per metre
    "": ("", 1.0, 4),
}
SUFFIXES = (
    ("_mm", "image mm", 1),
    ("_m", "m", 2),
    ("_deg", "deg", 1),
)  # units of the values of remarks
_SPACE = "\N{NO-BREAK SPACE}"
_SURE, _LOST = 0.9995, 0.0005  # probabilities that round to 100 % and 0 %


class InspectionPaper(SavedPaper):
    """A `record.inspection.InspectionFile` as plain data, with the words of a language.

    Words are searched for under `inspection` first, then in the general group.

    Parameters
    ----------
    inspection : dict
        Plain data; checked against its schema.
    language : str, optional
        One of languages.LANGUAGES; None: English.
    letterhead : letterhead.Letterhead, optional
        Letterhead of the inspecting organisation.
    """

    kind, file = "inspection", FILE
    attached: ClassVar[dict] = {FILE: "inspection", WORKBOOK: "inspection_workbook"}

    def __init__(self, inspection, language=None, letterhead=None):
        super().__init__(words_with_part(load_words(language or DEFAULT), "inspection"))
        inspection = INSPECTION.migrated(inspection, INSPECTION.file)
        self.saved = inspection
        self.record = inspection | {"rule": self._rule(inspection["rule"])}
        self.letterhead = letterhead.data() if letterhead else None

    def _rule(self, rule):
        """Rule with translated texts if it is a shipped rule; texts of other rules are kept."""
        if rule is None:
            return None
        name = rule["file"].removesuffix(".toml")
        english = load_words(DEFAULT)["inspection"]["rule_texts"].get(name, {})
        translated = self.words["rule_texts"].get(name, {})
        return rule | {key: translated[key] for key, text in english.items() if rule[key] == text}

    def subject(self):
        """Name of the tank."""
        return bearable(f"{self.word('page.tank')} {self.record['tank']['id']}")

    def date(self):
        """Date of the survey, ISO; "" if unknown or no date."""
        return iso_day(self.record["tank"]["survey_date"])

    # ---- texts of a check

    def check_name(self, code):
        """Name of a check; a code without words is kept."""
        return self.words["checks"].get(code, code)

    def verdict(self, check):
        """Verdict of a check in words; a code without words is kept."""
        code = verdict_of(check)
        return self.words["verdicts"].get(code, code)

    def place(self, check):
        """Place of the figure of a check: epoch, course, height and azimuth."""
        parts = []
        if check["epoch"] is not None:
            parts.append(bearable(check["epoch"]))
        if check["course"] is not None:
            parts.append(self.word("texts.course", course=check["course"]))
        if check["height_m"] is not None:
            parts.append(self.number(check["height_m"], "m", decimals=2))
        if check["azimuth_deg"] is not None:
            parts.append(self.azimuth(check["azimuth_deg"]))
        return ", ".join(parts) or NOTHING

    def azimuth(self, degrees):
        """Azimuth to a tenth of a degree."""
        return self.number(degrees, "deg", decimals=1)

    def format_figure(self, check, value):
        """Figure of a check in its unit, with the decimals of the check; None for None."""
        if value is None:
            return None
        symbol, factor, decimals = unit_of(check)
        text = fixed(value * factor, decimals, self.marks)
        return numbers.join_unit(text, symbol)

    def value(self, check):
        """Figure of a check, with a sign unless the limit is a lower limit."""
        if check["value"] is None:
            return None
        text = self.format_figure(check, check["value"])
        return text if check["code"] in AT_LEAST else signed_text(check["value"], text)

    def reading(self, check):
        """Largest reading of a check whose figure is an estimate, or None."""
        return self.value(check | {"value": check["reading"]})

    def limit(self, check):
        """Limit of a check, marked if it was not read in the text of its standard."""
        bound = check["limit"]
        if bound is None:
            return None
        symbol, factor, decimals = unit_of(check)
        text = shortest(round(bound["value"] * factor, decimals), self.marks)
        sign = "≥" if check["code"] in AT_LEAST else "≤"
        mark = "" if bound["verified"] else f"{_SPACE}{UNVERIFIED}"
        return f"{sign}{_SPACE}{numbers.join_unit(text, symbol)}{mark}"

    def probability(self, check):
        """Probability of conformity, to a tenth of a percent, or None."""
        share = check["probability"]
        if share is None:
            return None
        if share > _SURE:
            return f">{_SPACE}{fixed(99.9, 1, self.marks)}{_SPACE}%"
        if share < _LOST:
            return f"<{_SPACE}{fixed(0.1, 1, self.marks)}{_SPACE}%"
        return f"{fixed(100 * share, 1, self.marks)}{_SPACE}%"

    def remark(self, check):
        """Remark on a check as a sentence, or None.

        A code without words is shown with its values, because no remark may be hidden.
        """
        code = check["remark"]
        if code is None:
            return None
        values = {
            key: self._format_value(key, value) for key, value in check["remark_values"].items()
        }
        template = self.words["remarks"].get(code)
        if template is None:
            listed = ", ".join(f"{key} {value}" for key, value in values.items())
            return f"{code}: {listed}" if listed else code
        return template.format_map(defaultdict(lambda: NOTHING, values))

    def _format_value(self, key, value):
        """Value of a remark: a text, or a number in the unit at the end of its key."""
        if value is None:
            return NOTHING
        if isinstance(value, list):
            return ", ".join(self._format_value(key, item) for item in value)
        if isinstance(value, bool):
            return self.words["yes_no"]["yes" if value else "no"]
        if not isinstance(value, int | float):
            return bearable(value)
        if key == "one_in":
            return self.number(value, decimals=0)
        if key == "seen":
            return self.number(value, "share", decimals=0)
        if key == "mm_per_m":
            return f"{fixed(value, 2, self.marks)}{_SPACE}mm/m"
        for end, unit, decimals in SUFFIXES:
            if key.endswith(end):
                return self.number(value, unit, decimals=decimals)
        return shortest(value, self.marks, digits=4)


def unit_of(check):
    """Printed unit of a check, the factor to this unit, and the decimals of its figures."""
    symbol, factor, decimals = UNITS.get(check["unit"], (check["unit"], 1.0, 4))
    return symbol, factor, 2 if check["code"] in FINE and check["unit"] == "mm" else decimals


def verdict_of(check):
    """Verdict of a check; "no_limit" for a value without a limit."""
    return "no_limit" if check["limit"] is None and check["value"] is not None else check["verdict"]


def epoch_name(settlement):
    """Name of a settlement in its checks: an epoch, or a difference of two epochs."""
    return (
        settlement["epoch"]
        if settlement["since"] is None
        else f"{settlement['epoch']} - {settlement['since']}"
    )
