"""Tables of a history, declared once for PDF, web page, workbook and CSV, and their rows."""

from tankcal.report.saved_document import bearable
from tankcal.report.tables import Column, Table
from tankcal.text.digits import LITRE_DECIMALS

RADIUS_DECIMALS, MM_DECIMALS = 5, 2
_SHOWN = {"sheet": True, "width": 11}


def _day(key, on=None):
    return Column(key, csv=key, text=lambda paper, row: row[key], on=on, **_SHOWN)


def _number(key="certificate"):
    return Column(key, decimals=0, csv=key, **_SHOWN)


def _text(key, width=22, on=None):
    """Return the column of a user text; words too long for a column are shortened."""
    return Column(
        key,
        text=lambda paper, row: None if row[key] is None else bearable(row[key]),
        csv=key,
        sheet=True,
        width=width,
        on=on,
    )


def _code(key, group, on=None):
    """Return the column of a code, shown as its word in a group; unknown codes are unchanged."""

    def text(paper, row):
        return None if row[key] is None else paper.words[group].get(row[key], row[key])

    return Column(key, text=text, csv=key, sheet=True, width=20, on=on)


def state_text(paper, row):
    """Return the state of a certificate in the register with its date; None without a register."""
    if row.get("state") is None:
        return None
    state = paper.words["certificate_states"][row["state"]]
    return f"{state} {row['state_since']}" if row.get("state_since") else state


_FACTS = "certificate_facts"
CERTIFICATES = Table(
    "certificates",
    (
        Column("certificate", decimals=0, csv="certificate", on=f"certificates {_FACTS}", **_SHOWN),
        _day("date", on="certificates"),
        _day("superseded", on="certificates"),
        _text("number", on="certificates"),
        _text("laboratory", on="certificates"),
        Column("state", text=state_text, csv="state", sheet=True, width=22, on="certificates",
               optional=True),
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
        _code("rule_verdict", "rule_verdicts", on=_FACTS),
        _text("tank", on=""),
        _text("origin", width=9, on=""),
        _text("file", width=34, on=""),
        _text("sha256", width=66, on=""),
    ),
    rows=lambda history: history["certificates"],
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
    rows=lambda history: volume_rows(history),
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
    rows=lambda history: radius_rows(history),
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
    rows=lambda history: radius_change_rows(history),
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
        _code("verdict", "verdicts"),
        _text("rule", width=40, on=""),
    ),
    rows=lambda history: history["changes"],
)  # fmt: skip

CHECKS = Table(
    "history_checks",
    (
        _day("date"),
        _text("file", width=34, on=""),
        _code("code", "checks"),
        Column("value", decimals=2, csv="value", **_SHOWN),
        Column("U", decimals=2, csv="U", **_SHOWN),
        Column("limit", decimals=2, csv="limit", **_SHOWN),
        Column("unit", csv="unit", **_SHOWN),
        _code("verdict", "check_verdicts"),
        _text("rule", width=30, on=""),
        _text("sha256", width=66, on=""),
    ),
    rows=lambda history: check_rows(history),
)


MONTHS = Table(
    "history_months",
    (
        _text("month", width=10),
        Column("leak_l_h", u="leak_U_l_h", least=1, csv="leak_l_h", **_SHOWN),
        Column("leak_U_l_h", u="leak_U_l_h", least=1, csv="leak_U_l_h", **_SHOWN),
        Column("throughput_percent", u="throughput_U_percent", least=1, csv="throughput_percent",
               **_SHOWN),
        Column("throughput_U_percent", u="throughput_U_percent", least=1,
               csv="throughput_U_percent", **_SHOWN),
        _code("verdict", "month_verdicts"),
        _day("alarm"),
        _text("file", width=34, on=""),
        _text("table_sha256", width=66, on=""),
    ),
    rows=lambda history: history.get("months") or [],
)  # fmt: skip


def _steps(paper, row):
    names = paper.words["steps"]
    return ", ".join(names.get(step, step) for step in row["not_made"]) or None


def volume_rows(history):
    """Return rows of VOLUMES, by dip from the highest, then by certificate."""
    days = _dates(history)
    rows = [row | {"date": days[row["certificate"]]} for row in history["volumes"]]
    return sorted(rows, key=lambda row: (-row["height_m"], row["certificate"]))


def radius_rows(history):
    """Return rows of RADII, by course, then by certificate, with the change since the previous."""
    days = _dates(history)
    changes = {
        (change["new"], radius["course"]): radius
        for change in history["changes"]
        for radius in change["radii"]
    }
    rows = []
    for row in history["radii"]:
        change = changes.get((row["certificate"], row["course"]), {})
        rows.append(
            row
            | {"date": days[row["certificate"]], "d_m": change.get("d_m")}
            | {"U_d_m": change.get("U_m"), "E_n": change.get("E_n")}
        )
    return sorted(rows, key=lambda row: (row["course"], row["certificate"]))


def radius_change_rows(history):
    """Return rows of RADIUS_CHANGES."""
    return [
        {"former": change["former"], "new": change["new"], **radius}
        for change in history["changes"]
        for radius in change["radii"]
    ]


def check_rows(history):
    """Return rows of CHECKS: each check of each inspection."""
    keys = ("date", "file", "rule", "sha256")
    return [
        {key: inspection[key] for key in keys} | check
        for inspection in history["inspections"]
        for check in inspection["checks"]
    ]


def _dates(history):
    """Return {number of the certificate: ISO date}."""
    return {entry["certificate"]: entry["date"] for entry in history["certificates"]}
