"""The tables of a history, declared once for paper, page, workbook and CSV; their rows."""

from tankcal.report.saved_paper import bearable
from tankcal.report.tables import Column, Table
from tankcal.text.digits import LITRE_DECIMALS

DIGEST = 12  # letters of a SHA-256 on paper
RADIUS_DECIMALS, MM_DECIMALS = 5, 2
_SHOWN = {"sheet": True, "width": 11}


def _day(key, on=None):
    return Column(key, csv=key, text=lambda paper, row: row[key], on=on, **_SHOWN)


def _number(key="certificate"):
    return Column(key, decimals=0, csv=key, **_SHOWN)


def _text(key, width=22, on=None):
    """A text of a user, of words that a column can hold."""
    return Column(
        key,
        text=lambda paper, row: None if row[key] is None else bearable(row[key]),
        csv=key,
        sheet=True,
        width=width,
        on=on,
    )


def _in_words(key, group, on=None):
    def said(paper, row):
        return None if row[key] is None else paper.words[group].get(row[key], row[key])

    return Column(key, text=said, csv=key, sheet=True, width=20, on=on)


_FACTS = "certificate_facts"
CERTIFICATES = Table(
    "certificates",
    (
        Column("certificate", decimals=0, csv="certificate", on=f"certificates {_FACTS}", **_SHOWN),
        _day("date", on="certificates"),
        _day("superseded", on="certificates"),
        _text("number", on="certificates"),
        _text("laboratory", on="certificates"),
        _text("method", width=40, on=""),
        Column("top_dip_m", "m", height=True, csv="top_dip_m", on="certificates", **_SHOWN),
        Column("top_volume_m3", "m3", decimals=LITRE_DECIMALS, csv="top_volume_m3",
               on="certificates", **_SHOWN),
        Column("U_top_m3", "m3", u="U_top_m3", decimals=3, csv="U_top_m3", on="certificates",
               **_SHOWN),
        Column("k", decimals=2, csv="k", on="", **_SHOWN),
        _text("tankcal", width=10, on=_FACTS),
        Column("reference_temperature_c", "degC", decimals=1, csv="reference_temperature_c",
               on=_FACTS, **_SHOWN),
        Column("liquid_density_kg_m3", "kg/m3", decimals=1, csv="liquid_density_kg_m3", on=_FACTS,
               **_SHOWN),
        Column("reference_height_m", "m", decimals=4, csv="reference_height_m", on=_FACTS,
               **_SHOWN),
        Column("nominal_diameter_m", "m", decimals=3, csv="nominal_diameter_m", on="", **_SHOWN),
        Column("nominal_height_m", "m", decimals=3, csv="nominal_height_m", on="", **_SHOWN),
        _text("zero", on=""),
        Column("sigma0", decimals=3, csv="sigma0", on=_FACTS, **_SHOWN),
        Column("global_test_passed", words="passed_or_not", csv="global_test_passed", on="",
               **_SHOWN),
        _text("rule", width=30, on=""),
        _in_words("rule_verdict", "rule_verdicts", on=_FACTS),
        _text("tank", on=""),
        _text("origin", width=9, on=""),
        _text("file", width=34, on=""),
        _text("sha256", width=66, on=""),
    ),
)  # fmt: skip

VOLUMES = Table(
    "history_volumes",
    (
        _number(),
        _day("date"),
        Column("height_m", "m", height=True, csv="height_m", **_SHOWN),
        Column("volume_m3", "m3", decimals=LITRE_DECIMALS, csv="volume_m3", **_SHOWN),
        Column("U_m3", "m3", u="U_m3", decimals=3, csv="U_m3", **_SHOWN),
        Column("d_m3", "m3", decimals=LITRE_DECIMALS, csv="d_m3", **_SHOWN),
        Column("E_n", decimals=2, csv="E_n", **_SHOWN),
    ),
)

RADII = Table(
    "history_radii",
    (
        _number("course"),
        _number(),
        _day("date"),
        Column("bottom_m", "m", decimals=3, csv="bottom_m", on="", **_SHOWN),
        Column("top_m", "m", decimals=3, csv="top_m", on="", **_SHOWN),
        Column("radius_m", "m", decimals=RADIUS_DECIMALS, csv="radius_m", **_SHOWN),
        Column("U_m", "mm", decimals=MM_DECIMALS, csv="U_m", **_SHOWN),
        Column("d_m", "mm", decimals=MM_DECIMALS, csv="d_m", **_SHOWN),
        Column("U_d_m", "mm", decimals=MM_DECIMALS, csv="U_d_m", **_SHOWN),
        Column("E_n", decimals=2, csv="E_n", **_SHOWN),
    ),
)

RADIUS_CHANGES = Table(
    "radius_changes",
    (
        _number("former"),
        _number("new"),
        _number("course"),
        Column("d_m", "mm", decimals=MM_DECIMALS, csv="d_m", **_SHOWN),
        Column("U_m", "mm", decimals=MM_DECIMALS, csv="U_m", **_SHOWN),
        Column("E_n", decimals=2, csv="E_n", **_SHOWN),
    ),
)

CHANGES = Table(
    "changes",
    (
        _number("former"),
        _number("new"),
        Column("years", decimals=1, csv="years", **_SHOWN),
        Column("high_m", "m", height=True, csv="high_m", **_SHOWN),
        Column("top_d_m3", "m3", decimals=LITRE_DECIMALS, csv="top_d_m3", **_SHOWN),
        Column("U_top_m3", "m3", u="U_top_m3", decimals=3, csv="U_top_m3", **_SHOWN),
        Column("worst_E_n", decimals=2, csv="worst_E_n", **_SHOWN),
        Column("c", decimals=2, nothing="0", csv="c", **_SHOWN),
        Column("zero_m", "mm", decimals=1, csv="zero_m", **_SHOWN),
        Column("zero_source", words="zero_sources", csv="zero_source", on="", **_SHOWN),
        Column("not_made", text=lambda paper, row: _steps(paper, row), csv="not_made", on="",
               sheet=True, width=24),
        Column("low_m", "m", height=True, csv="low_m", on="", **_SHOWN),
        _in_words("verdict", "verdicts"),
        _text("rule", width=40, on=""),
    ),
)  # fmt: skip

CHECKS = Table(
    "history_checks",
    (
        _day("date"),
        _text("file", width=34, on=""),
        _in_words("code", "checks"),
        Column("value", decimals=2, csv="value", **_SHOWN),
        Column("U", decimals=2, csv="U", **_SHOWN),
        Column("limit", decimals=2, csv="limit", **_SHOWN),
        Column("unit", csv="unit", **_SHOWN),
        _in_words("verdict", "check_verdicts"),
        _text("rule", width=30, on=""),
        _text("sha256", width=66, on=""),
    ),
)


def _steps(paper, row):
    return ", ".join(paper.words["steps"].get(one, one) for one in row["not_made"]) or None


def volume_rows(found):
    """Rows of VOLUMES: by dip from the highest, then by certificate."""
    days = _days(found)
    rows = [one | {"date": days[one["certificate"]]} for one in found["volumes"]]
    return sorted(rows, key=lambda one: (-one["height_m"], one["certificate"]))


def radius_rows(found):
    """Rows of RADII: by course, then by certificate, with the change since the one before."""
    days = _days(found)
    changes = {(one["new"], radius["course"]): radius for one in found["changes"]
               for radius in one["radii"]}  # fmt: skip
    rows = []
    for one in found["radii"]:
        change = changes.get((one["certificate"], one["course"]), {})
        rows.append(
            one
            | {"date": days[one["certificate"]], "d_m": change.get("d_m")}
            | {"U_d_m": change.get("U_m"), "E_n": change.get("E_n")}
        )
    return sorted(rows, key=lambda one: (one["course"], one["certificate"]))


def radius_change_rows(found):
    """Rows of RADIUS_CHANGES."""
    return [
        {"former": one["former"], "new": one["new"], **radius}
        for one in found["changes"]
        for radius in one["radii"]
    ]


def check_rows(found):
    """Rows of CHECKS: every check of every inspection."""
    kept = ("date", "file", "rule", "sha256")
    return [
        {key: inspection[key] for key in kept} | check
        for inspection in found["inspections"]
        for check in inspection["checks"]
    ]


def _days(found):
    return {one["certificate"]: one["date"] for one in found["certificates"]}
