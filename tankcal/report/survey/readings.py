"""Single readings: those set aside, those that fit worst, those that nothing controls."""

from tankcal.report import numbers
from tankcal.report.paper import Column
from tankcal.report.survey.common import LARGE_UNITS, MOST_ROWS, SMALL_UNITS, with_note
from tankcal.text.digits import fixed, with_digits
from tankcal.text.words import observation_name

WORST = 16  # rows of a table of the worst readings
WEAK = 0.1  # redundancy number below which a blunder has to be 13 sds to be found
_DECIMALS = {"mm": 1, "m": 2, "rad": 1}  # of residuals in um, mm and arc seconds


def adjusted(paper):
    """Readings that took part: neither set aside nor only compared, nor held."""
    return [
        row for row in paper.readings if not row["removed"] and not row["check"] and row["sd"] != 0
    ]


def held(paper):
    """What was held exactly, with what its release would say: the largest test quantity first."""
    rows = paper.record["adjustment"].get("held", [])
    if not rows:
        return []
    rows = sorted(rows, key=lambda row: -abs(row["w"] or 0.0))
    shown = []
    for row in rows[:MOST_ROWS]:
        unit = row["unit"]
        small = numbers.unit(SMALL_UNITS.get(unit, ""))
        of_release = {
            f"released_{key}": _in_small(paper, row[key], unit, small) for key in ("change", "sd")
        }
        shown.append(_reading(paper, row) | of_release)
    block = paper.table(
        "held",
        shown,
        [
            Column("observation"),
            Column("between"),
            Column("value", align="right"),
            Column("released_change", align="right"),
            Column("released_sd", align="right"),
            Column("small_unit", heading="unit"),
            Column("w", decimals=1),
            Column("mdb", align="right"),
            Column("effect_m", "mm", decimals=1),
            Column("row", decimals=0),
        ],
        critical=paper.number(paper.record["adjustment"]["critical_w"], digits=3),
    )
    return with_note(paper, block, shown, rows)


def table(paper, name, rows, columns=("residual", "w"), **values):
    """A table of readings, cut to the first MOST_ROWS; columns beside what names a reading."""
    if not rows:
        return []
    shown = [_reading(paper, row) for row in rows[:MOST_ROWS]]
    residual = [Column("residual", align="right"), Column("small_unit", heading="unit")]
    known = {
        "residual": residual,
        "redundancy": [Column("redundancy", digits=2)],
        "w": [Column("w", decimals=1)],
        "sd": [Column("declared_sd", align="right")],
        "mdb": [Column("mdb", align="right")],
        "effect": [Column("effect_m", "mm", decimals=1)],
    }
    block = paper.table(
        name,
        shown,
        [
            Column("observation"),
            Column("between"),
            Column("value", align="right"),
            *(column for name in columns for column in known[name]),
            Column("file"),
            Column("row", decimals=0),
        ],
        **values,
    )
    return with_note(paper, block, shown, rows)


def _reading(paper, row):
    unit, number = row["unit"], paper.number
    between = " – ".join(map(str, row["ids"]))
    element = _element(paper, row["element"])
    small = numbers.unit(SMALL_UNITS.get(unit, ""))
    shown = {
        key: _in_small(paper, row[key], unit, small) for key in ("residual", "mdb") if key in row
    }
    return row | {
        "observation": observation_name(paper.words, row),
        "declared_sd": paper.number(row["sd"], SMALL_UNITS.get(unit, ""), digits=2),
        "between": f"{between}, {element}" if element else between,
        "value": number(row["value"], LARGE_UNITS[unit], decimals=4)
        if unit in LARGE_UNITS
        else number(row["value"], digits=4),
        **shown,
        "small_unit": small.symbol or None,
        "file": row["file"] or None,
    }


def _element(paper, code):
    """The name of what was observed of it: an angle, or the scale of an instrument."""
    words = paper.words
    return words["elements"].get(code) or words["instrument_parts"].get(code, code)


def _in_small(paper, value, unit, small):
    if value is None:
        return None
    if unit not in _DECIMALS:
        return with_digits(value, 2, paper.marks)
    return fixed(value * small.factor, _DECIMALS[unit], paper.marks)


def removed(paper):
    """Readings that were set aside, the worst first."""
    return sorted(paper.record["adjustment"]["removed"], key=lambda row: -abs(row["w"] or 0.0))


def largest(paper):
    """Readings with the largest w of those that were adjusted."""
    controlled = [row for row in adjusted(paper) if row["controlled"] and row["w"] is not None]
    return sorted(controlled, key=lambda row: -abs(row["w"]))[:WORST]


def control(paper):
    """What nothing controls, and where an undetected blunder would do most."""
    a, alone = paper.record["adjustment"], [row for row in adjusted(paper) if not row["controlled"]]
    numbers_of = [row["redundancy"] for row in adjusted(paper) if row["controlled"]]
    found = table(paper, "uncontrolled", alone, ["sd"], count=len(alone), all=len(adjusted(paper)))
    if not alone and numbers_of:
        smallest, largest, mean = (
            paper.number(value, digits=2)
            for value in (min(numbers_of), max(numbers_of), sum(numbers_of) / len(numbers_of))
        )
        found = [paper.paragraph("all_controlled", smallest=smallest, largest=largest, mean=mean)]
    weak = sum(number < WEAK for number in numbers_of)
    if weak:
        limit = paper.number(WEAK, digits=1)
        found.append(paper.paragraph("weakly_controlled", count=weak, limit=limit))
    found += held(paper)
    return found + table(
        paper,
        "weakest_readings",
        _weakest(paper),
        ["residual", "redundancy", "mdb", "effect"],
        power=paper.percent(a["power"]),
        alpha=paper.percent(a["alpha"]),
    )


def _weakest(paper):
    """Readings whose undetected bias would move a point most."""
    felt = [row for row in adjusted(paper) if row["controlled"] and row["effect_m"] is not None]
    return sorted(felt, key=lambda row: -row["effect_m"])[:WORST]


def compared(paper):
    """Readings that were only compared, the largest difference in its sd first."""
    checks = [row for row in paper.readings if row["check"]]
    return sorted(checks, key=lambda row: -abs(row["w"] or 0.0))
