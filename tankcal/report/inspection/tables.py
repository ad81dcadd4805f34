"""Texts and tables of an inspection in a language."""

from collections import defaultdict
from typing import ClassVar

from tankcal.record.inspection import INSPECTION
from tankcal.report import numbers
from tankcal.report.plain import words_with_part
from tankcal.report.saved_document import SavedPaper, bearable, iso_day, signed_text
from tankcal.report.tables import Column, Table
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


MM = "image mm"  # unit of a value in millimetres
MOST_GAPS = 12  # largest number of gaps of each kind in the report
_SHOWN = {"sheet": True, "width": 11}


def _mm(key, decimals=1, **more):
    """Column of values in millimetres."""
    return Column(key, MM, decimals=decimals, **_SHOWN, **more)


def _azimuth(**more):
    """Column of azimuths."""
    return Column("azimuth_deg", "deg", decimals=1, **_SHOWN, **more)


def _text_column(key, text_of, **more):
    """Column of texts, with a dash for a check without text."""
    return Column(key, text=lambda paper, row: text_of(paper, row) or NOTHING, **more)


def _format(row):
    """Number format of a check's figures in the workbook, in the unit of the file."""
    return "0.00E+00" if row["unit"] == "1/m" else unit_of(row)[2]


CHECKS = Table(
    "checks",
    (
        _text_column("check", lambda paper, row: paper.check_name(row["code"])),
        _text_column("place", lambda paper, row: paper.place(row)),
        _text_column("value", lambda paper, row: paper.value(row), align="right"),
        _text_column("U", lambda paper, row: paper.format_figure(row, row["U"]), align="right"),
        _text_column("limit", lambda paper, row: paper.limit(row), align="right"),
        _text_column("verdict", lambda paper, row: paper.verdict(row)),
        _text_column("probability", lambda paper, row: paper.probability(row), align="right"),
    ),
    rows=lambda inspection: inspection["checks"],
)

READING = _text_column("reading", lambda paper, row: paper.reading(row), align="right")

LIMITS = Table(
    "limits",
    (
        _text_column("check", lambda paper, row: row["check"]),
        _text_column("limit", lambda paper, row: row["limit"], align="right"),
        _text_column("clause", lambda paper, row: bearable(row["clause"])),
        Column("verified", words="read"),
    ),
)

SHEET_OF_CHECKS = Table(
    "inspection_checks",
    (
        Column("check", sheet=True, width=34),
        Column("epoch", sheet=True, width=11),
        Column("course", decimals=0, sheet=True, width=6),
        Column("height_m", "m", decimals=3, sheet=True, width=7),
        Column("azimuth_deg", "deg", decimals=1, sheet=True, width=8),
        Column("value", decimals=_format, sheet=True, width=9),
        Column("U", decimals=_format, sheet=True, width=9),
        Column("k", decimals=2, sheet=True, width=5),
        Column("reading", decimals=_format, sheet=True, width=9),
        Column("U_reading", decimals=_format, sheet=True, width=9),
        Column("limit", decimals=_format, sheet=True, width=9),
        Column("unit", sheet=True, width=6),
        Column("verdict", sheet=True, width=16),
        Column("probability", "share", decimals=1, sheet=True, width=8),
        Column("used", decimals=0, sheet=True, width=7),
        Column("clause", sheet=True, width=26),
        Column("verified", words="read", sheet=True, width=8),
    ),
)

COURSES = Table(
    "inspected_courses",
    (
        Column("course", decimals=0, **_SHOWN),
        _mm("plumb_least"),
        _mm("plumb_most"),
        _mm("plumb_U"),
        _mm("round_worst"),
        _mm("round_U"),
        _mm("peaking", optional=True),
        _mm("banding", optional=True),
    ),
)

LEVELS = Table(
    "inspected_levels",
    (
        Column("height_m", "m", decimals=3, **_SHOWN),
        Column("course", decimals=0, **_SHOWN),
        Column("mean_radius_m", "m", decimals=4, **_SHOWN),
        Column("centre_x_m", "m", decimals=4, **_SHOWN),
        Column("centre_y_m", "m", decimals=4, **_SHOWN),
        _mm("least"),
        _mm("most"),
        _mm("U"),
        _mm("limit"),
    ),
)

PLACES = Table(
    "level_places",
    (
        Column("height_m", "m", decimals=3, **_SHOWN),
        Column("course", decimals=0, **_SHOWN),
        _azimuth(),
        _mm("departure", 2),
        _mm("U", 2),
    ),
)

GENERATRICES = Table(
    "generatrices",
    (
        Column("height_m", "m", decimals=3, **_SHOWN),
        Column("course", decimals=0, **_SHOWN),
        _azimuth(),
        _mm("plumb", 2),
        _mm("U", 2),
    ),
)

GAPS = Table(
    "weld_gaps",
    (
        Column("kind", words="kinds_of_gaps", sheet=True, width=12),
        Column("course", decimals=0, **_SHOWN),
        Column("height_m", "m", decimals=3, **_SHOWN),
        _azimuth(),
        _mm("gap_mm", heading="gap"),
        _mm("U_mm", heading="U"),
    ),
    rows=lambda inspection: gap_rows(inspection),
)

POINTS = Table(
    "settlement_points",
    (
        Column("epoch", on="", sheet=True, width=16),
        Column("point", sheet=True, width=12, text=lambda paper, row: bearable(row["point"])),
        _azimuth(),
        _mm("z_mm", 2, heading="z"),
        _mm("s_mm", 2, heading="s", on=""),
        _mm("fitted_mm", 2, heading="fitted", on=""),
        _mm("U_i_mm", 2, heading="U_i"),
        _mm("S_i_mm", 2, heading="S_i"),
        _mm("U_S_mm", 2, heading="U_S"),
        Column("in_subset", heading="subset", sheet=True, width=10),
    ),
)

PLANES = Table(
    "settlement_planes",
    (
        Column("epoch", sheet=True, width=16),
        _mm("a_mm", 2, heading="a"),
        _mm("p_mm", 2, heading="p"),
        _mm("q_mm", 2, heading="q"),
        _mm("b_mm", 2, heading="b"),
        _mm("U_b_mm", 2, heading="U"),
        Column("highest_azimuth_deg", "deg", decimals=1, heading="highest", **_SHOWN),
        Column("tilt_mm_per_m", decimals=3, heading="tilt", **_SHOWN),
        Column("R2", decimals=4, **_SHOWN),
        _mm("limit_mm", 2, heading="limit_all"),
        _mm("limit_half_mm", 2, heading="limit_half"),
        _mm("subset_limit_mm", 2, heading="limit_subset"),
    ),
)

EDGES = Table(
    "edge_profiles",
    (
        _azimuth(),
        Column("break_radius_m", "m", decimals=3, heading="break_radius", **_SHOWN),
        Column("width_m", "m", decimals=3, heading="width", **_SHOWN),
        _mm("drop_mm", heading="drop"),
        _mm("U_mm", heading="U"),
        _mm("limit_mm", heading="limit"),
    ),
    rows=lambda inspection: inspection["edges"],
)

READINGS = Table(
    "edge_readings",
    (
        _azimuth(),
        Column("radius_m", "m", decimals=3, heading="radius", **_SHOWN),
        _mm("z", 2),
    ),
)


# ---- rows


def limit_rows(paper):
    """Each limit once, with its check, its clause, and whether it was read there."""
    limits = dict.fromkeys(
        (check["code"], paper.limit(check), check["limit"]["clause"], check["limit"]["verified"])
        for check in paper.record["checks"]
        if check["limit"] is not None
    )
    return [
        {"check": paper.check_name(code), "limit": text, "clause": clause, "verified": verified}
        for code, text, clause, verified in limits
    ]


def sheet_rows(paper):
    """Checks with numbers as numbers, in the unit of the file."""
    return [_sheet_row(paper, check) for check in paper.record["checks"]]


def _sheet_row(paper, check):
    """Row of a check in the workbook."""
    limit = check["limit"] or {"value": None, "clause": None, "verified": None}
    return check | {
        "check": paper.check_name(check["code"]),
        "verdict": paper.verdict(check),
        "limit": limit["value"],
        "clause": limit["clause"],
        "verified": limit["verified"],
        "unit": check["unit"] or None,
    }


def gap_rows(inspection):
    """Gaps at the welds; a horizontal weld without a determined gap has no azimuth."""
    return [
        gap | {"azimuth_deg": None} if gap["kind"] == "banding" and gap["gap_mm"] is None else gap
        for gap in inspection["gaps"]
    ]


def select_checks(inspection, *codes):
    """Select the checks with these codes, in their order."""
    return [check for check in inspection["checks"] if check["code"] in codes]


def limit_mm(inspection, *codes):
    """Limit of the first check with these codes that has a limit in mm, or None."""
    limits = [
        check["limit"]["value"]
        for check in select_checks(inspection, *codes)
        if check["limit"] is not None and check["unit"] == "mm"
    ]
    return limits[0] if limits else None


def is_low(inspection, level):
    """Whether a level is directly above the bottom weld; such a level has another limit."""
    heights = [
        item["height_m"]
        for item in select_checks(inspection, "roundness_low")
        if item["height_m"] is not None
    ]
    if not heights:
        return level is inspection["levels"][0]
    nearest = min(inspection["levels"], key=lambda item: abs(item["height_m"] - heights[0]))
    return level["height_m"] == nearest["height_m"]


def limit_of_level(inspection, level):
    """Limit of the radius of a level, mm, or None."""
    return limit_mm(inspection, "roundness_low" if is_low(inspection, level) else "roundness_high")


def worst_place(departures):
    """Index of the largest deviation in magnitude."""
    return max(range(len(departures)), key=lambda place: abs(departures[place]))


def level_rows(inspection):
    """Levels from the bottom up, with the range of their deviations."""
    return [
        level
        | {
            "least": min(level["departure_mm"]),
            "most": max(level["departure_mm"]),
            "U": level["U_mm"][worst_place(level["departure_mm"])],
            "limit": limit_of_level(inspection, level),
        }
        for level in inspection["levels"]
        if level["departure_mm"]
    ]


def place_rows(inspection):
    """All places of all levels."""
    return [
        {"height_m": level["height_m"], "course": level["course"], "azimuth_deg": azimuth,
         "departure": departure, "U": U}
        for level in inspection["levels"]
        for azimuth, departure, U in zip(
            level["azimuth_deg"], level["departure_mm"], level["U_mm"], strict=True
        )
    ]  # fmt: skip


def generatrix_rows(inspection):
    """All places of the generatrices, from the lowest height."""
    wall = inspection["generatrices"]
    if wall is None:
        return []
    return [
        {"height_m": height, "course": course, "azimuth_deg": azimuth, "plumb": plumb, "U": U}
        for height, course, departures, uncertainties in zip(
            wall["height_m"], wall["course"], wall["departure_mm"], wall["U_mm"], strict=True
        )
        for azimuth, plumb, U in zip(
            wall["azimuth_deg"], departures, uncertainties, strict=True
        )
    ]  # fmt: skip


def course_rows(inspection):
    """Largest deviations of each course from the bottom up; selected, not computed."""
    walls, levels, gaps = generatrix_rows(inspection), place_rows(inspection), inspection["gaps"]
    numbers = {row["course"] for row in (*walls, *levels, *gaps)}
    return [_course_row(number, walls, levels, gaps) for number in sorted(numbers)]


def _course_row(number, walls, levels, gaps):
    """Largest deviations and gaps of a course."""
    wall, level, gaps = (
        [item for item in rows if item["course"] == number] for rows in (walls, levels, gaps)
    )
    row = {"course": number}
    if wall:
        row["plumb_least"] = min(item["plumb"] for item in wall)
        row["plumb_most"] = max(item["plumb"] for item in wall)
        row["plumb_U"] = max(item["U"] for item in wall)
    if level:
        worst = max(level, key=lambda item: abs(item["departure"]))
        row |= {"round_worst": worst["departure"], "round_U": worst["U"]}
    for kind in ("peaking", "banding"):
        known = [item["gap_mm"] for item in gaps if item["kind"] == kind]
        known = [item for item in known if item is not None]
        row |= {kind: max(known, key=abs)} if known else {}
    return row


def select_largest_gaps(inspection, kind, most=MOST_GAPS):
    """Select the largest determined gaps of a kind, the largest first."""
    known = [gap for gap in inspection["gaps"] if gap["kind"] == kind and gap["gap_mm"] is not None]
    return sorted(known, key=lambda gap: -abs(gap["gap_mm"]))[:most]


def point_rows(inspection):
    """All points of all epochs and differences."""
    return [
        {"epoch": epoch_name(settlement)} | point
        for settlement in inspection["settlements"]
        for point in settlement["points"]
    ]


def plane_rows(inspection):
    """Planes of all epochs and differences."""
    return [
        settlement | {"epoch": epoch_name(settlement)} for settlement in inspection["settlements"]
    ]


def reading_rows(inspection):
    """All readings of the profiles of the edge."""
    return [
        {"azimuth_deg": profile["azimuth_deg"], "radius_m": radius, "z": z}
        for profile in inspection["edges"]
        for radius, z in zip(profile["radius_m"], profile["z_mm"], strict=True)
    ]
