"""Both tables beside each other, how they came to one basis, and what was read out of them."""

from tankcal.report import blocks
from tankcal.report.comparison import figures
from tankcal.report.comparison.tables import waterfall_of
from tankcal.report.plain import Column
from tankcal.report.saved_paper import bearable, iso_day, shortened
from tankcal.text.digits import NOTHING

SIDES = (Column("what"), Column("former"), Column("new"))
FILES = (Column("file"), Column("sha256"))
BASIS = (
    Column("step"), Column("former"), Column("new"), Column("source"),
    Column("top_m3", "m3", decimals=4, heading="at_top"),
    Column("largest_m3", "m3", decimals=4, heading="largest"),
    Column("largest_at_m", "m", height=True, heading="at_dip"),
)  # fmt: skip
READ = (
    Column("table"), Column("what"), Column("value", heading="read_value"), Column("u"),
    Column("sure"), Column("used"),
)  # fmt: skip


def sides(paper):
    """What each table is, beside each other."""
    files = [
        {"file": shortened(paper.found[side]["name"]), "sha256": paper.found[side]["sha256"]}
        for side in ("former", "new")
    ]
    return [
        paper.heading("tables"),
        paper.table("sides", side_rows(paper), SIDES),
        paper.table("files", files, FILES),
    ]


def _material(paper):
    """The steel that the steps were made with."""
    one = paper.found["material"]
    return paper.paragraph(
        f"material_{one['source']}",
        expansion=paper.number(one["expansion_per_k"], "1/K", digits=3),
        modulus=paper.number(one["modulus_pa"], "GPa", digits=3),
    )


def side_rows(paper):
    """[{what, former, new}]: what is known of a table; a line that neither has is left out."""
    tables = [paper.found[name] for name in ("former", "new")]
    both = [_side(paper, one) for one in tables]
    if not any(one["height_quantum_m"] for one in tables):
        both = [one | {"quantum_dip": None} for one in both]
    open_ = paper.word("texts.not_declared")
    return [
        {
            "what": paper.label(key),
            "former": bearable(both[0][key] or open_),
            "new": bearable(both[1][key] or open_),
        }
        for key in both[0]
        if both[0][key] or both[1][key]
    ]


def _side(paper, one):
    rows = paper.word(
        "texts.rows_of", rows=one["rows"], low=paper.height(one["low_m"]),
        high=paper.height(one["high_m"]),
    )  # fmt: skip
    return {
        "file": one["name"],
        "origin": paper.word(f"origins_of_tables.{one['origin']}"),
        "laboratory": one["laboratory"],
        "number": one["number"],
        "date": _day(paper, one["date"]),
        "method": one["method"],
        "kind": one["kind"] and paper.word(f"kinds.{one['kind']}"),
        "rows": rows,
        "top_volume": paper.number(one["top_volume_m3"], "m3", decimals=3),
        "quantum_dip": _quantum(paper, one["height_quantum_m"], "m"),
        "quantum_volume": _quantum(paper, one["volume_quantum_m3"], "m3"),
        "reference_temperature": paper.chosen(one["reference_temperature_c"], "C"),
        "head_density": _density(paper, one["liquid_density_kg_m3"]),
        "roof": _roof(paper, one["roof"]),
        "reference_height": paper.height(one["reference_height_m"]),
        "U_top": _stated_U(paper, one),
        "U_of_deliveries": one["U_of_deliveries"]
        and paper.word(f"U_of_deliveries.{one['U_of_deliveries']}"),
    }


def _day(paper, text):
    """A date in words; what is none stays as it is."""
    return paper.day(iso_day(text)) if iso_day(text) == text else text


def _stated_U(paper, one):
    """U of the last row with its coverage factor."""
    if one["U_top_m3"] is None or one["k"] is None:
        return None
    U = paper.number(one["U_top_m3"], "m3", u=one["U_top_m3"])
    return paper.word("texts.U_with_k", U=U, k=paper.number(one["k"], decimals=2))


def _quantum(paper, value, unit):
    """What numbers are rounded to."""
    return paper.chosen(value, unit) if value else paper.word("texts.not_rounded")


def _density(paper, density):
    if density == 0:
        return paper.word("texts.without_head")
    return paper.chosen(density, "kg/m3")


def _roof(paper, roof):
    if roof is None:
        return None
    said = paper.word(
        "texts.roof", mass=paper.chosen(roof["mass_kg"], "kg"),
        density=paper.chosen(roof["density_kg_m3"], "kg/m3"),
        weighing=paper.word(f"parts.{roof['weighing']}"),
    )  # fmt: skip
    if roof["critical_m"] is None:
        return said
    low, high = map(paper.height, roof["critical_m"])
    return f"{said}; {paper.word('texts.critical', low=low, high=high)}"


# ---- one basis


def basis(paper):
    """How the former table was brought to the basis of the new one, and the waterfall."""
    table = waterfall_of(paper.found)
    return [
        paper.heading("basis"),
        paper.paragraph("basis"),
        paper.table("basis", basis_rows(paper), BASIS),
        *_lacking(paper),
        *_zero(paper),
        _material(paper),
        paper.figure(
            figures.waterfall(paper), "waterfall_figure",
            dip=paper.height(paper.found["waterfall"][-1]["height_m"]),
        ),
        paper.table("waterfall", paper.found["waterfall"], table.on_paper()),
    ]  # fmt: skip


def basis_rows(paper):
    """Rows of the steps, the ones that change nothing too."""
    return [
        one
        | {
            "step": paper.word(f"steps.{one['code']}"),
            "former": _of_step(paper, one, "former"),
            "new": _of_step(paper, one, "new"),
            "source": paper.word(f"sources.{one['source'] or one['state']}"),
        }
        for one in paper.found["steps"]
    ]


def _of_step(paper, one, side):
    if one[side] is None:
        return NOTHING
    if one["code"] == "head" and one[side] == 0:
        return paper.word("texts.without_head")
    if one["code"] == "rounding":
        return _quantum(paper, one[side], one["unit"])
    return paper.measure(one[side], one["unit"])


def _lacking(paper):
    missing = [name for one in paper.found["steps"] for name in one["lacking"]]
    if not missing:
        return []
    return [paper.paragraph("lacking", keys=", ".join(dict.fromkeys(missing)))]


def _zero(paper):
    """How high the new zero lies above the former one, and what the volumes say of it."""
    zero = paper.found["zero"]
    used = paper.word(
        f"texts.zero_{zero['source']}", height=_mm(paper, zero["height_m"], zero["u_m"])
    )
    if zero["fitted_m"] is None or zero["source"] == "fitted":
        return [blocks.paragraph(used)]
    fitted = paper.word(
        "texts.zero_by_volumes", height=_mm(paper, zero["fitted_m"], zero["fitted_u_m"])
    )
    return [blocks.paragraph(f"{used} {fitted}")]


def _mm(paper, value_m, u_m=None):
    text = paper.number(value_m, "mm", decimals=2)
    if not u_m:
        return text
    return paper.word("texts.with_u", value=text, u=paper.number(u_m, "mm", digits=2))


# ---- what was read


def read_out(paper):
    """What was read out of a table because nobody declared it, heads in sentences."""
    found = read_rows(paper)
    if not found:
        return []
    heads = [_head(paper, one) for one in paper.found["read"] if one["code"].startswith("head_")]
    return [
        paper.heading("read"),
        paper.table("read", found, READ),
        *([blocks.listing(heads)] if heads else []),
        paper.paragraph("read"),
    ]


def _head(paper, one):
    """Whether a table was made with the head of a liquid, and of which."""
    return paper.word(
        f"texts.{one['code']}",
        table=paper.word(f"of_tables.{one['table']}"),
        density=paper.measure(one["value"], one["unit"]),
        u="" if one["u"] is None else paper.number(one["u"], one["unit"], digits=2),
    )


def read_rows(paper):
    """Rows of what was read out of the tables."""
    return [
        {
            "table": paper.word(f"sides_of_comparison.{one['table']}"),
            "what": paper.word(f"read.{one['code']}"),
            "value": _read_value(paper, one),
            "u": NOTHING if one["u"] is None else paper.number(one["u"], _unit(one), digits=2),
            "sure": paper.word(f"sure.{one['sure']}"),
            "used": paper.words["yes_no"]["yes" if one["used"] else "no"],
        }
        for one in paper.found["read"]
    ]


def _read_value(paper, one):
    """What was read, heights of zeros in mm, last digits as they are."""
    if one["value"] is None:
        return paper.word("texts.not_known")
    if one["code"].startswith("rounding"):
        return _quantum(paper, one["value"], one["unit"])
    return paper.number(one["value"], _unit(one), u=one["u"], decimals=None if one["u"] else 2)


def _unit(one):
    return "mm" if one["unit"] == "m" else one["unit"]
