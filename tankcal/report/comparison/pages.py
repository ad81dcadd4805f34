"""What a comparison says, block by block: verdict, both tables, basis, differences, radii."""

from tankcal.report import blocks
from tankcal.report.comparison import figures
from tankcal.report.comparison.tables import (
    COURSES,
    DELIVERIES,
    ROWS,
    selected,
    waterfall_of,
    worst_row,
)
from tankcal.report.plain import Column
from tankcal.text.digits import NOTHING

TEXT = {"text": lambda paper, row: row["text"]}
SIDES = (Column("what"), Column("former"), Column("new"))
BASIS = (
    Column("step"), Column("former"), Column("new"), Column("source"),
    Column("top_m3", "m3", decimals=4, heading="at_top"),
    Column("largest_m3", "m3", decimals=4, heading="largest"),
    Column("largest_at_m", "m", height=True, heading="at_dip"),
)  # fmt: skip
LEGAL = (
    Column("number"), Column("value"), Column("as_printed"), Column("limit"), Column("verdict"),
)  # fmt: skip
READ = (Column("table"), Column("what"), Column("value"), Column("u"), Column("sure"),
        Column("used"))  # fmt: skip
FEW_ROWS = 5000  # of the page: more are only in workbook and CSV


def pages(paper, folder=None, whole=False):
    """The blocks of a ComparisonPaper.

    folder  of the files that the PDF holds inside; None: none
    whole   True: with every row, for the web page
    """
    return [
        *paper.head(folder),
        *verdict(paper),
        *sides(paper),
        *legal(paper),
        *basis(paper),
        *differences(paper),
        *deliveries(paper),
        *courses(paper),
        *read_out(paper),
        *rows(paper, whole),
        *warnings(paper),
        blocks.signature([paper.word(f"signatures.{one}") for one in ("compared", "approved")]),
    ]


def verdict(paper):
    """The verdict in its box, with the rule, and its reasons."""
    found, rule = paper.found, paper.found["rule"]
    code = found["verdict"] or "none"
    note = ""
    if rule:
        note = paper.word("texts.by_rule", rule=rule["name"])
    box = blocks.result(paper.word("labels.verdict"), paper.word(f"verdicts.{code}"), note)
    reasons = [paper.reason(one) for one in found["reasons"]]
    return [
        box,
        blocks.paragraph(paper.word(f"texts.verdict_{code}")),
        *([paper.heading("reasons"), blocks.listing(reasons)] if reasons else []),
        *_rule(paper, rule),
    ]


def _rule(paper, rule):
    if not rule:
        return []
    asked = paper.word("texts.rule_default") if rule["is_default"] else None
    return [
        paper.facts(
            [
                ("rule", rule["name"]),
                ("rule_file", rule["file"]),
                ("rule_source", rule["source"]),
                ("rule_verified", paper.word(f"verified.{rule['verified']}")),
                ("verdict_verified", paper.word(f"verified.{paper.found['verified']}")),
                ("rule_remark", rule["remark"]),
                ("rule_asked", asked),
            ]
        )
    ]


# ---- both tables


def sides(paper):
    """What each table is, beside each other."""
    return [paper.heading("tables"), paper.table("sides", side_rows(paper), SIDES)]


def side_rows(paper):
    """[{what, former, new}]: what is known of a table; a line that neither has is left out."""
    both = [_side(paper, paper.found[name]) for name in ("former", "new")]
    open_ = paper.word("texts.not_declared")
    return [
        {
            "what": paper.label(key),
            "former": both[0][key] or open_,
            "new": both[1][key] or open_,
        }
        for key in both[0]
        if both[0][key] or both[1][key]
    ]


def _side(paper, one):
    rounded = {
        key: paper.chosen(one[key], unit) if one[key] else paper.word("texts.not_rounded")
        for key, unit in (("height_quantum_m", "m"), ("volume_quantum_m3", "m3"))
    }
    rows = paper.word(
        "texts.rows_of", rows=one["rows"], low=paper.height(one["low_m"]),
        high=paper.height(one["high_m"]),
    )  # fmt: skip
    return {
        "file": one["name"],
        "origin": paper.word(f"origins_of_tables.{one['source']}"),
        "laboratory": one["laboratory"],
        "number": one["number"],
        "date": _day(paper, one["date"]),
        "method": one["method"],
        "kind": one["kind"] and paper.word(f"kinds.{one['kind']}"),
        "rows": rows,
        "top_volume": paper.number(one["top_volume_m3"], "m3", decimals=3),
        "quantum_dip": rounded["height_quantum_m"],
        "quantum_volume": rounded["volume_quantum_m3"],
        "reference_temperature": paper.chosen(one["reference_temperature_c"], "C"),
        "head_density": _density(paper, one["liquid_density_kg_m3"]),
        "roof": _roof(paper, one["roof"]),
        "reference_height": paper.height(one["reference_height_m"]),
        "coverage": one["k"] and paper.word("texts.U_with_k", k=paper.plain(one["k"])),
        "sha256": one["sha256"],
    }


def _day(paper, text):
    """A date in words; what is none stays as it is."""
    from tankcal.report.comparison.paper import iso_day

    return paper.day(iso_day(text)) if iso_day(text) == text else text


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


# ---- the numbers that a rule limits


def legal(paper):
    """The numbers of the rule, and the periods, each with its limit and verdict."""
    found = [*legal_rows(paper), *age_rows(paper)]
    if not found:
        return []
    return [
        paper.heading("legal"),
        paper.paragraph("legal"),
        paper.table("legal", found, LEGAL),
        blocks.listing(_clauses(paper)),
    ]


def legal_rows(paper):
    """Rows of the three numbers."""
    return [
        {
            "number": paper.word(f"numbers.{one['code']}"),
            "value": _limited(paper, one["value"], one["unit"]),
            "as_printed": _limited(paper, one["as_printed"], one["unit"]),
            "limit": f"± {paper.chosen(one['limit'], one['unit'])}",
            "verdict": paper.word(f"limits.{one['verdict']}"),
        }
        for one in paper.found["legal"]
    ]


def _limited(paper, value, unit):
    decimals = {"%": 3, "mm": 1}[unit]
    return NOTHING if value is None else _signed(value, paper.measure(value, unit, decimals))


def _signed(value, text):
    return f"+{text}" if value > 0 else text


def age_rows(paper):
    """Rows of the periods of the rule."""
    return [
        {
            "number": paper.word(f"ages.{one['of']}"),
            "value": NOTHING if one["age_years"] is None else _years(paper, one["age_years"]),
            "as_printed": NOTHING,
            "limit": _years(paper, one["years"]),
            "verdict": paper.word(f"limits.{one['verdict']}"),
        }
        for one in paper.found["ages"]
    ]


def _years(paper, years):
    return paper.word("texts.years", years=paper.plain(round(years, 1)))


def _clauses(paper):
    """Where each value stands in the rule, and whether it was read there; each clause once."""
    every = [*paper.found["legal"], *paper.found["ages"]]
    said = [f"{one['clause']} ({_verified(paper, one)})" for one in every]
    return list(dict.fromkeys(said))


def _verified(paper, one):
    return paper.word(f"verified.{one['verified']}")


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
        return paper.chosen(one[side], one["unit"]) if one[side] else NOTHING
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


# ---- differences


def differences(paper):
    """What is left at each dip, the worst row, E_n and the correlation that it is for."""
    found = paper.found
    known = any(one is not None for one in found["rows"]["E_n"])
    return [
        paper.heading("differences"),
        *_worst_row(paper),
        paper.figure(figures.differences(paper), "differences"),
        blocks.paragraph(correlation(paper)),
        *([paper.figure(figures.normalised(paper), "normalised")] if known else []),
        *_judged(paper),
    ]


def _worst_row(paper):
    row = worst_row(paper.found)
    if row is None:
        return [paper.paragraph("no_row_judged")]
    values = {
        "dip": paper.height(row["height_m"]),
        "d": _signed(row["d_m3"], paper.number(row["d_m3"], "m3", decimals=3)),
    }
    if row["E_n"] is None:
        return [paper.paragraph("worst_row_without_u", **values)]
    return [paper.paragraph("worst_row", E_n=paper.number(row["E_n"], decimals=2), **values)]


def correlation(paper):
    """What c is, who says so, and what E_n would be with another."""
    one = paper.found["correlation"]
    if one["worst_E_n"] is None:
        return paper.word("texts.no_E_n")
    shown = {
        key: NOTHING if one[key] is None else paper.number(one[key], decimals=2)
        for key in ("c", "worst_E_n", "worst_E_n_at_half", "c_limit")
    }
    said = [paper.word(f"texts.c_{one['source']}", **shown)]
    said.append(paper.word("texts.c_at_half", **shown))
    said.append(paper.word("texts.c_never" if one["c_limit"] is None else "texts.c_limit", **shown))
    if one["coverage_k"] is not None:
        said.append(paper.word("texts.same_coverage", k=paper.plain(one["coverage_k"])))
    return " ".join(said)


def _judged(paper):
    lowest = paper.found["judged_from_m"]
    if lowest <= paper.found["low_m"]:
        return []
    return [paper.paragraph("judged_from", dip=paper.height(lowest))]


def deliveries(paper):
    """The worst deliveries of the least heights."""
    if not paper.found["deliveries"]:
        return []
    return [
        paper.heading("deliveries"),
        paper.paragraph("deliveries"),
        paper.show(DELIVERIES, paper.found["deliveries"]),
    ]


def courses(paper):
    """The radii of the courses in both tables."""
    found = paper.found["courses"]
    if not found:
        return [paper.heading("radii"), paper.paragraph("no_radii")]
    return [paper.heading("radii"), paper.paragraph("radii"), paper.show(COURSES, found)]


def read_out(paper):
    """What was read out of a table because nobody declared it."""
    found = read_rows(paper)
    if not found:
        return []
    return [paper.heading("read"), paper.paragraph("read"), paper.table("read", found, READ)]


def read_rows(paper):
    """Rows of what was read out of the tables."""
    return [
        {
            "table": paper.word(f"sides_of_comparison.{one['table']}"),
            "what": paper.word(f"read.{one['code']}"),
            "value": paper.measure(one["value"], one["unit"]),
            "u": NOTHING if one["u"] is None else paper.number(one["u"], one["unit"], digits=2),
            "sure": paper.word(f"sure.{one['sure']}"),
            "used": paper.words["yes_no"]["yes" if one["used"] else "no"],
        }
        for one in paper.found["read"]
    ]


def rows(paper, whole):
    """A selection of the rows, or every row where there is room."""
    every = ROWS.rows(paper.found)
    if whole and len(every) <= FEW_ROWS:
        columns = ROWS.on_paper()
        return [paper.heading("rows"), paper.table("every_row", every, columns, across=1)]
    some = selected(paper.found)
    return [
        paper.heading("rows"),
        paper.paragraph("selected_rows", shown=len(some), all=len(every)),
        paper.show(ROWS, some),
    ]


def warnings(paper):
    """Warnings, and what limits every comparison."""
    said = [paper.warning(one) for one in paper.found["warnings"]]
    limits = paper.words["standing_limits"].values()
    said += [paper.word("texts.interpolation", volume=_litres(paper))] + list(limits)
    return [paper.heading("limits"), blocks.listing(said)]


def _litres(paper):
    return paper.number(paper.found["interpolation_m3"], "L", digits=2)
