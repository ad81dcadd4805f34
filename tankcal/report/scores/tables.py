"""Tables of scores for page and workbook."""

from tankcal.report.saved_paper import bearable
from tankcal.report.tables import Column, Table
from tankcal.text.digits import NOTHING, fixed

_SHEET = {"sheet": True, "width": 11}


def _ppm(key, **more):
    """Column of relative values, ppm."""
    return Column(key, "ppm", decimals=0, **_SHEET, **more)


def _percent(key):
    """Column of relative values, percent."""
    return Column(key, "percent", decimals=3, **_SHEET)


def _participant(**more):
    """Column of the participant."""
    return Column("participant", text=lambda paper, row: paper.participant(row), sheet=True,
                  width=26, **more)  # fmt: skip


def _method():
    """Column of the method."""
    return Column("method", heading="method_scored", sheet=True, width=20,
                  text=lambda paper, row: paper.method(row["method"]))  # fmt: skip


def _text_column(key, text_of):
    """Column of texts, which only the page has."""
    return Column(key, text=lambda paper, row: text_of(paper, row) or NOTHING, align="right")


def _tops(paper, row):
    """Number of top rows with |E_n| <= 1, and the bounds of its share; None without an E_n."""
    if not row["tops_judged"]:
        return None
    low, high = (fixed(row[key], 2, paper.marks) for key in ("tops_low", "tops_high"))
    return paper.word("texts.tops", good=row["tops_within"], count=row["tops_judged"], low=low,
                      high=high)  # fmt: skip


PARTICIPANTS = Table(
    "scored_participants",
    tuple(
        Column(key, text=lambda paper, row, key=key: bearable(row[key] or NOTHING), sheet=True,
               width=20, heading=f"participant_{key}")
        for key in ("name", "software", "version", "date", "contact", "remarks")
    ),
    rows=lambda scores: scores["participants"],
)  # fmt: skip

ERRORS = Table(
    "scored_errors",
    (
        _participant(),
        _method(),
        _text_column("tables_of", lambda paper, row: f"{row['tables']}/{row['asked']}"),
        _text_column(
            "bias", lambda paper, row: paper.with_sd(row["bias_ppm"], row["u_bias_ppm"], 0)
        ),
        _ppm("rms_top_ppm"),
        _ppm("rms_ppm"),
        _ppm("mean_U_ppm"),
        _text_column(
            "share", lambda paper, row: paper.with_sd(row["share_within"], row["u_share"], 2)
        ),
        _text_column("tops", _tops),
        Column("rms_zeta", decimals=2, **_SHEET),
    ),
    rows=lambda scores: scores["methods"],
)

FORMS = Table(
    "scored_forms",
    (
        _participant(),
        _method(),
        _ppm("form_ppm"),
        _percent("delivery_1cm_percent"),
        _percent("delivery_10cm_percent"),
        _ppm("delivery_2m_ppm"),
        Column("falling_rows", decimals=0, **_SHEET),
    ),
    rows=lambda scores: scores["methods"],
)

TABLES = Table(
    "scored_tables",
    (
        _participant(),
        Column("tank", heading="tank_scored", sheet=True, width=8),
        _method(),
        Column("missing", decimals=0, **_SHEET),
        _ppm("top_error_ppm"),
        Column("top_E_n", decimals=2, **_SHEET),
        _ppm("rms_ppm"),
        _text_column("rows_within", lambda paper, row: f"{row['within']}/{row['judged']}"),
        _ppm("mean_U_ppm"),
        Column("rms_zeta", decimals=2, **_SHEET),
        Column("zero_m3", "m3", decimals=4, **_SHEET),
        _ppm("scale_ppm"),
        _ppm("form_ppm"),
        _ppm("worst_2m_ppm"),
    ),
    rows=lambda scores: [{**table, **table["form"]} for table in scores["tables"]],
)

METHODS_SHEET = Table(
    "scored_methods",
    (
        _participant(),
        _method(),
        *(Column(key, decimals=0, **_SHEET) for key in ("tables", "asked")),
        *(_ppm(key) for key in ("bias_ppm", "u_bias_ppm", "rms_top_ppm", "rms_ppm", "mean_U_ppm")),
        *(Column(key, decimals=3, **_SHEET) for key in ("share_within", "u_share")),
        *(Column(key, decimals=0, **_SHEET) for key in ("tops_within", "tops_judged")),
        *(Column(key, decimals=3, **_SHEET) for key in ("tops_low", "tops_high")),
        Column("rms_zeta", decimals=2, **_SHEET),
        *FORMS.columns[2:],
    ),
    rows=lambda scores: scores["methods"],
)

ROWS = Table(
    "scored_rows",
    (
        _participant(),
        Column("tank", heading="tank_scored", sheet=True, width=8),
        _method(),
        Column("height_m", "m", height=True, heading="height_scored", **_SHEET),
        *(Column(key, "m3", decimals=4, **_SHEET) for key in ("true_m3", "error_m3", "U_m3")),
        *(Column(key, decimals=3, **_SHEET) for key in ("E_n", "zeta")),
    ),
    rows=lambda scores: [
        {**{key: table[key] for key in ("participant", "tank", "method")},
         **{key: values[i] for key, values in table["rows"].items()}}
        for table in scores["tables"]
        for i in range(len(table["rows"]["height_m"]))
    ],
)  # fmt: skip
