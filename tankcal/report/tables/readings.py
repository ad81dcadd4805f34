"""Tables of observations: groups, and each reading with its residual."""

import numpy as np

from tankcal.record.columns import Texts, as_columns
from tankcal.report import numbers
from tankcal.report.tables.table import Column, Table
from tankcal.text.digits import decimals_of, fixed, format_significant
from tankcal.text.words import factor_text, group_name, observation_name

MOST_IN_SHEET = 5_000  # largest number of readings, or of points, in the workbook
# Verdicts on groups with enough redundancy to estimate the factor.
_JUDGED = ("as_declared", "better", "worse")


# ---- groups of observations


def group_rows(record):
    """Return the groups with standard deviations and rms in small units (list of dict).

    The factors of groups with too little redundancy are None.
    """
    rows = []
    for row in record["adjustment"]["groups"]:
        unit, factor = numbers.small_unit(row["unit"])
        in_small_unit = {
            key: None if row[key] is None else factor * row[key]
            for key in ("sd_smallest", "sd_largest", "rms")
        }
        judged = row["verdict"] in _JUDGED
        factors = {
            f"judged_{key}": row[key] if judged else None
            for key in ("factor", "factor_low", "factor_high")
        }
        units = {"small_unit": unit, "unit": numbers.spelled(unit) or row["unit"]}
        rows.append(row | in_small_unit | factors | units)
    return rows


def _number_join_unit(key):
    return lambda paper, row: paper.number(row[key], row["small_unit"], digits=2)


def _declared_sd(paper, row):
    smallest, largest = row["sd_smallest"], row["sd_largest"]
    if smallest is None or not largest > smallest * (1 + 1e-9):
        return _number_join_unit("sd_smallest")(paper, row)
    return f"{paper.number(smallest, digits=2)}–{_number_join_unit('sd_largest')(paper, row)}"


def _symbol(key):
    return lambda paper, row: numbers.unit(row[key]).symbol


def _interval(paper, row):
    low, high = (row[f"judged_factor_{end}"] for end in ("low", "high"))
    if row["verdict"] not in _JUDGED:
        return None
    return f"{factor_text(paper.words, low)}–{factor_text(paper.words, high)}"


def _factor(paper, row):
    return factor_text(paper.words, row["factor"]) if row["verdict"] in _JUDGED else None


def _two_digits(key):
    """Return a function of a row: decimals for two significant digits."""
    return lambda row: decimals_of(row[key]) if row[key] else 1


GROUPS = Table(
    "groups",
    (
        Column("kind", on="", csv="kind"),
        Column("name", on="", csv="name"),
        Column("unit", on="", csv="unit"),
        Column("group", text=lambda paper, row: group_name(paper.words, row),
               heading="observations", sheet="observations", width=34),
        Column("count", decimals=0, sheet="values", width=10, csv="count"),
        Column("removed", decimals=0, heading="set_aside", sheet="set_aside", width=10,
               csv="removed"),
        Column("declared_sd", text=_declared_sd, align="right"),
        *(Column(key, decimals=_two_digits(key), on="", sheet=key, width=11, csv=key)
          for key in ("sd_smallest", "sd_largest")),
        Column("rms", text=_number_join_unit("rms"), align="right",
               sheet="rms", width=11, csv="rms",
               in_sheet={"text": None, "decimals": _two_digits("rms")}),
        Column("small_unit", text=_symbol("small_unit"), on="", sheet="unit", width=8),
        Column("redundancy", decimals=1, sheet="redundancy", width=11, csv="redundancy"),
        Column("factor", text=_factor, align="right", csv="factor"),
        Column("factor_sd", on="", csv="factor_sd"),
        Column("interval", text=_interval, align="right"),
        Column("judged_factor", decimals=2, on="", sheet="factor"),
        *(Column(f"judged_factor_{end}", decimals=2, on="", sheet=f"factor_{end}", width=11)
          for end in ("low", "high")),
        *(Column(f"factor_{end}", on="", csv=f"factor_{end}") for end in ("low", "high")),
        Column("verdict", words="verdicts", sheet="verdict", width=16, csv="verdict"),
    ),
    rows=group_rows,
    last={"csv": "redundancy factor factor_sd rms sd_smallest sd_largest factor_low factor_high "
                 "verdict"},
)  # fmt: skip


# ---- readings


def convert_units(readings):
    """Convert readings to their printed units.

    The result contains the names of the units as further columns.

    Parameters
    ----------
    readings : ArrayColumns or dict
        Columns of n readings, {key: values}.

    Returns
    -------
    ArrayColumns
    """
    readings = as_columns(readings)
    units = readings.arrays["unit"] if readings.count else Texts.of([])
    large, small = (
        [unit_of(unit) for unit in units.texts]
        for unit_of in (numbers.large_unit, numbers.small_unit)
    )
    times_large, times_small = (
        np.array([factor for _, factor in shown], dtype=float)[units.codes]
        for shown in (large, small)
    )
    return readings | {
        "value": readings.arrays["value"] * times_large,
        **{key: readings.arrays[key] * times_small for key in _SMALL if key in readings},
        "large_unit": Texts(units.codes, tuple(unit for unit, _ in large)),
        "small_unit": Texts(units.codes, tuple(unit for unit, _ in small)),
        "value_unit": Texts(units.codes, _spelled(large, units.texts)),
        "unit": Texts(units.codes, _spelled(small, units.texts)),
    }


_SMALL = ("residual", "sd", "mdb", "change")


def _spelled(units, names):
    return tuple(
        numbers.spelled(unit) or name for (unit, _), name in zip(units, names, strict=True)
    )


def _decimals(row):
    """Decimals of residuals in micrometres, millimetres or arc seconds."""
    return {"um": 1, "image mm": 2, "arcsec": 1}.get(row["small_unit"], 6)


def _small(key):
    """Return a function of (paper, row) that formats a residual or standard deviation."""

    def text(paper, row):
        if row[key] is None:
            return None
        if not row["small_unit"]:
            return format_significant(row[key], 2, paper.marks)
        return fixed(row[key], _decimals(row), paper.marks)

    return text


def _observed(paper, row):
    rule = {"decimals": 4} if row["large_unit"] else {"digits": 4}
    return paper.number(row["value"], row["large_unit"], **rule)


def _unit_of(key, other_key):
    return lambda paper, row: numbers.unit(row[key]).symbol or row[other_key]


def _ends(paper, row):
    return " – ".join(map(str, row["ids"]))


def _ends_and_element(paper, row):
    """Return the ends of an observation with its element, such as an angle or a scale."""
    words, code = paper.words, row["element"]
    element = words["elements"].get(code) or words["instrument_parts"].get(code, code)
    return f"{_ends(paper, row)}, {element}" if element else _ends(paper, row)


def _use(paper, row):
    code = "set_aside" if row["removed"] else "compared" if row["check"] else "adjusted"
    return paper.words["workbook"]["uses"][code]


_WITH_RESIDUAL = "removed_readings largest_w compared_readings weakest_readings"
READINGS = Table(
    "residuals",
    (
        Column("kind", on="", csv="kind"),
        Column("observation", text=lambda paper, row: observation_name(paper.words, row),
               sheet="observation", width=20),
        Column("between", text=_ends_and_element),
        Column("ids", text=_ends, on="", sheet="between", width=24, csv="id"),
        Column("element", words="elements", on="", sheet="element", width=9, csv="element"),
        Column("value", text=_observed, align="right", sheet="observed", csv="value",
               in_sheet={"text": None, "decimals": 4}),
        Column("value_unit", text=_unit_of("large_unit", "value_unit"), on="", sheet="unit",
               width=7, csv="value_unit"),
        Column("change", text=_small("change"), heading="released_change", align="right",
               on="held"),
        Column("sd", text=_small("sd"), heading="released_sd", align="right", on="held",
               sheet="sd", width=8, csv="sd", in_sheet={"text": None, "decimals": _decimals}),
        Column("residual", text=_small("residual"), align="right", on=_WITH_RESIDUAL,
               sheet="residual", width=10, csv="residual",
               in_sheet={"text": None, "decimals": _decimals}),
        Column("small_unit", text=lambda paper, row: numbers.unit(row["small_unit"]).symbol or None,
               heading="unit", on=f"held {_WITH_RESIDUAL}"),
        Column("declared_sd", text=lambda paper, row: paper.number(
               row["sd"], row["small_unit"], digits=2), align="right", on="uncontrolled"),
        Column("redundancy", digits=2, on="largest_w weakest_readings", sheet="redundancy",
               width=9, csv="redundancy", in_sheet={"digits": None, "decimals": 3}),
        Column("w", decimals=1, on="held removed_readings largest_w compared_readings", sheet="w",
               width=8, csv="w", in_sheet={"decimals": 2}),
        Column("tau", decimals=2, on="", sheet="tau", width=8, csv="tau"),
        Column("mdb", text=_small("mdb"), align="right", on="held weakest_readings", sheet="mdb",
               width=9, csv="mdb", in_sheet={"text": None, "decimals": _decimals}),
        Column("unit", text=_unit_of("small_unit", "unit"), on="", sheet="small_unit", width=7,
               csv="unit"),
        Column("effect_m", "mm", decimals=1, on="held weakest_readings", sheet="effect_mm",
               width=9, csv="effect_mm", csv_unit="mm", in_sheet={"decimals": 2}),
        *(Column(key, on="", csv=key) for key in ("controlled", "removed", "check")),
        Column("use", text=_use, on="", sheet="use", width=11),
        Column("repeats", decimals=0, on="", sheet="readings", width=9, csv="repeats"),
        Column("file", text=lambda paper, row: row["file"] or None,
               on=f"uncontrolled {_WITH_RESIDUAL}", sheet="file", width=22, csv="file",
               in_sheet={"text": None}),
        Column("row", decimals=0, sheet="row", width=7, csv="row", in_sheet={"nothing": ""}),
    ),
    rows=lambda record: list(convert_units(record["adjustment"]["residuals"]).rows()),
    last={
        "sheet": "residual sd mdb unit redundancy w tau effect_m use repeats file row",
        "csv": "residual sd mdb unit redundancy w tau effect_m controlled removed check repeats "
               "file row",
    },
)  # fmt: skip
