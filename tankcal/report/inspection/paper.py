"""An inspection on paper: its figures, limits, verdicts and remarks in the words of a language."""

from collections import defaultdict
from typing import ClassVar

from tankcal.record.inspection import INSPECTION
from tankcal.report.plain import words_with_part
from tankcal.report.saved_paper import SavedPaper, bearable, iso_day, signed_text
from tankcal.text.digits import NOTHING, fixed, shortest
from tankcal.text.languages import DEFAULT
from tankcal.text.words import load_words

FILE = INSPECTION.file
WORKBOOK = "inspection.xlsx"
UNVERIFIED = "*"  # beside a limit that was not read in the text of its standard
AT_LEAST = ("settlement_cosine",)  # checks whose figure is to be as large as the limit, or larger
FINE = ("settlement_all", "settlement_subset", "settlement_de_beer")  # of hundredths of a mm
UNITS = {  # {of a check: (as it is printed, factor, decimals)}
    "mm": ("mm", 1.0, 1),
    "mm/m": ("mm/m", 1.0, 2),
    "1/m": ("mm/m²", 1e3, 3),  # a curvature: what the slope changes by in a metre
    "": ("", 1.0, 4),
}
SUFFIXES = (("_mm", "image mm", 1), ("_m", "m", 2), ("_deg", "deg", 1))  # of values of remarks
_SPACE = "\N{NO-BREAK SPACE}"
_SURE, _LOST = 0.9995, 0.0005  # probabilities beyond which a tenth of a percent says nothing


class InspectionPaper(SavedPaper):
    """A `record.inspection.InspectionFile` as plain data, with the words of a language.

    found       as parsed; checked against its schema
    language    one of languages.LANGUAGES; None: English
    letterhead  a `letterhead.Letterhead` of who inspects, or None

    Words are looked up in the group's part under `inspection` first, then in the group itself.
    """

    kind, file = "inspection", FILE
    attached: ClassVar[dict] = {FILE: "inspection", WORKBOOK: "inspection_workbook"}

    def __init__(self, found, language=None, letterhead=None):
        super().__init__(words_with_part(load_words(language or DEFAULT), "inspection"))
        found = INSPECTION.migrated(found, INSPECTION.file)
        self.saved = found
        self.found = found | {"rule": self._rule(found["rule"])}
        self.letterhead = letterhead.data() if letterhead else None

    def _rule(self, rule):
        """The rule with the texts of a shipped one; those of a file of one's own stay."""
        if rule is None:
            return None
        name = rule["file"].removesuffix(".toml")
        english = load_words(DEFAULT)["inspection"]["rule_texts"].get(name, {})
        own = self.words["rule_texts"].get(name, {})
        return rule | {key: own[key] for key, text in english.items() if rule[key] == text}

    def subject(self):
        """What the papers are about: the tank."""
        return bearable(f"{self.word('page.tank')} {self.found['tank']['id']}")

    def date(self):
        """The day of the survey, ISO; "" where it is not known, or is none."""
        return iso_day(self.found["tank"]["survey_date"])

    # ---- what a check says

    def check_name(self, code):
        """The name of a check; a code without words stays as it is."""
        return self.words["checks"].get(code, code)

    def verdict(self, one):
        """The verdict of a check in words; a code without words stays as it is."""
        code = verdict_of(one)
        return self.words["verdicts"].get(code, code)

    def place(self, one):
        """Where the figure of a check was found: epoch, course, height, azimuth."""
        said = []
        if one["epoch"] is not None:
            said.append(bearable(one["epoch"]))
        if one["course"] is not None:
            said.append(self.word("texts.course", course=one["course"]))
        if one["height_m"] is not None:
            said.append(self.number(one["height_m"], "m", decimals=2))
        if one["azimuth_deg"] is not None:
            said.append(self.azimuth(one["azimuth_deg"]))
        return ", ".join(said) or NOTHING

    def azimuth(self, degrees):
        """An azimuth to a tenth of a degree."""
        return self.number(degrees, "deg", decimals=1)

    def in_unit(self, one, value):
        """A figure of a check in its unit, all of a check with the same decimals; None of None."""
        if value is None:
            return None
        symbol, factor, decimals = unit_of(one)
        text = fixed(value * factor, decimals, self.marks)
        return f"{text}{_SPACE}{symbol}" if symbol else text

    def value(self, one):
        """The figure of a check, with its sign where it has two sides."""
        if one["value"] is None:
            return None
        text = self.in_unit(one, one["value"])
        return text if one["code"] in AT_LEAST else signed_text(one["value"], text)

    def reading(self, one):
        """The largest reading of a check whose figure is an estimate; None of others."""
        return self.value(one | {"value": one["reading"]})

    def limit(self, one):
        """The limit of a check; marked where it was not read in the text of its standard."""
        bound = one["limit"]
        if bound is None:
            return None
        symbol, factor, decimals = unit_of(one)
        text = shortest(round(bound["value"] * factor, decimals), self.marks)
        sign = "≥" if one["code"] in AT_LEAST else "≤"
        mark = "" if bound["verified"] else f"{_SPACE}{UNVERIFIED}"
        unit = f"{_SPACE}{symbol}" if symbol else ""
        return f"{sign}{_SPACE}{text}{unit}{mark}"

    def probability(self, one):
        """The probability of conformity, to a tenth of a percent; None where there is none."""
        share = one["probability"]
        if share is None:
            return None
        if share > _SURE:
            return f">{_SPACE}{fixed(99.9, 1, self.marks)}{_SPACE}%"
        if share < _LOST:
            return f"<{_SPACE}{fixed(0.1, 1, self.marks)}{_SPACE}%"
        return f"{fixed(100 * share, 1, self.marks)}{_SPACE}%"

    def remark(self, one):
        """What is to be read beside a check, as a sentence; None where there is nothing.

        A code without words comes with its values, for a remark is never hidden.
        """
        code = one["remark"]
        if code is None:
            return None
        values = {key: self._shown(key, value) for key, value in one["remark_values"].items()}
        template = self.words["remarks"].get(code)
        if template is None:
            told = ", ".join(f"{key} {value}" for key, value in values.items())
            return f"{code}: {told}" if told else code
        return template.format_map(defaultdict(lambda: NOTHING, values))

    def _shown(self, key, value):
        """A value of a remark: texts, or a number in the unit that its key ends with."""
        if value is None:
            return NOTHING
        if isinstance(value, list):
            return ", ".join(self._shown(key, one) for one in value)
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


def unit_of(one):
    """Unit of a check as it is printed, the factor to it, and the decimals of its figures."""
    symbol, factor, decimals = UNITS.get(one["unit"], (one["unit"], 1.0, 4))
    return symbol, factor, 2 if one["code"] in FINE and one["unit"] == "mm" else decimals


def verdict_of(one):
    """The verdict of a check; "no_limit" where there is nothing to judge its figure by."""
    return "no_limit" if one["limit"] is None and one["value"] is not None else one["verdict"]


def epoch_name(one):
    """A settlement as its checks call it: an epoch, or the difference of two."""
    return one["epoch"] if one["since"] is None else f"{one['epoch']} - {one['since']}"
