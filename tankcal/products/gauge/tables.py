"""Tables of a commissioning, declared once for certificate, workbook and CSV."""

from tankcal.report.tables import Column, Table

_SHOWN = {"sheet": True, "width": 12}


def _mm(key, u, **more):
    """Column of millimetres with the digits of its U."""
    return Column(key, "image mm", u=u, csv=key, least=1, **_SHOWN, **more)


def _m(key, decimals=3):
    return Column(key, "m", decimals=decimals, csv=key, **_SHOWN)


def _k(on=None):
    return Column("k", decimals=2, csv="k", on=on, **_SHOWN)


LEVELS = Table(
    "gauge_levels",
    (
        Column("name", text=lambda paper, row: row["name"], csv="name", sheet=True, width=14),
        Column("count", decimals=0, csv="count", **_SHOWN),
        _m("dip_m", 4),
        _m("gauge_m", 4),
        _mm("deviation_mm", "U_mm"),
        _mm("U_mm", "U_mm"),
        _k(),
        _mm("residual_mm", "U_mm", on=""),
        Column("w", decimals=1, csv="w", **_SHOWN),
        Column("limit_mm", "image mm", decimals=1, csv="limit_mm", **_SHOWN),
        Column("probability", "share", decimals=0, csv="probability", **_SHOWN),
        Column("verdict", words="verdicts", csv="verdict", sheet=True, width=22),
    ),
    rows=lambda gauge: gauge["levels"],
)
CORRECTIONS = Table(
    "gauge_corrections",
    (
        _m("gauge_m"),
        _mm("correction_mm", "U_mm"),
        _mm("U_mm", "U_mm"),
        _k(on=""),
        _mm("table_correction_mm", "U_table_mm"),
        _mm("U_table_mm", "U_table_mm"),
        Column("is_outside", words="outside", csv="is_outside", sheet=True, width=14),
    ),
    rows=lambda gauge: gauge["corrections"],
)
ZEROS = Table(
    "gauge_zeros",
    (
        Column("code", words="zeros", csv="code", sheet=True, width=30),
        _mm("z_mm", "U_mm"),
        _mm("U_mm", "U_mm"),
        Column("source", words="zero_sources", csv="source", sheet=True, width=34),
    ),
    rows=lambda gauge: gauge["zeros"],
)
BUDGET = Table(
    "gauge_budget",
    (
        Column("source", words="sources", csv="source", sheet=True, width=34),
        Column("low_mm", "image mm", decimals=2, csv="low_mm", **_SHOWN),
        Column("middle_mm", "image mm", decimals=2, csv="middle_mm", **_SHOWN),
        Column("high_mm", "image mm", decimals=2, csv="high_mm", **_SHOWN),
        Column("dof", decimals=0, csv="dof", nothing="∞", **_SHOWN),
    ),
    rows=lambda gauge: gauge["budget"],
)
FILES = {"levels.csv": LEVELS, "corrections.csv": CORRECTIONS}
