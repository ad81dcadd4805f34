"""Paper of a comparison with its figures, and its workbook."""

import textwrap

import numpy as np
from matplotlib.figure import Figure

from tankcal.report import blocks
from tankcal.report.camera.figures import styled
from tankcal.report.comparison.tables import (
    COURSES,
    DECIMALS,
    DELIVERIES,
    FINE,
    ROWS,
    STEPS,
    select_rows,
    shown_steps,
    step_rows,
    unit_symbol,
    waterfall_table,
    worst_row,
)
from tankcal.report.markdown import nodes
from tankcal.report.plots.style import FAINT, GREY, INK, PALE, RED, WIDTH, set_margins
from tankcal.report.saved_document import bearable, iso_day, shortened, signed_text
from tankcal.report.tables import Column, Table
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.sections import (
    FIRST_LINE,
    Sentences,
    SheetContent,
    cell_table,
    write_workbook,
)
from tankcal.text.digits import NOTHING, fixed

LABEL_LETTERS = 20  # letters in a line of the label below a bar
ROOM = 0.14  # space for the numbers above the bars, relative to the span of the bars
HEIGHT_IN = 2.3  # height of a figure by dip, inches
LEAST_E_N = 1.25  # smallest limit of an axis of E_n, so that the lines at 1 are inside


@styled
def waterfall(paper):
    """Draw bars from the former to the new volume at the highest dip, and their sum."""
    last = paper.record["waterfall"][-1]
    codes = [*shown_steps(paper.record), "tank"]
    sizes = np.array([last[f"{code}_m3"] for code in codes])
    ends = np.concatenate([[0.0], np.cumsum(sizes)])
    names = [paper.word(f"steps.{code}") for code in (*codes, "all")]
    # Each bar reaches from the end of the bar before it; the last bar shows the sum from zero.
    lows = np.append(np.minimum(ends[:-1], ends[1:]), min(ends[-1], 0.0))
    highs = np.append(np.maximum(ends[:-1], ends[1:]), max(ends[-1], 0.0))
    figure = Figure(figsize=(WIDTH, 2.6))
    ax = figure.subplots()
    places = np.arange(len(names))
    colours = [INK if size >= 0 else RED for size in sizes] + [GREY]
    ax.bar(places, highs - lows, bottom=lows, color=colours, width=0.6)
    ax.hlines(ends[1:], places[:-1] + 0.3, places[1:] - 0.3, color=FAINT, linewidth=0.6)
    ax.axhline(0, color=GREY, linewidth=0.6)
    span = float(highs.max() - lows.min()) or 1.0
    for place, high, size in zip(places, highs, [*sizes, ends[-1]], strict=True):
        text = ("+" if size > 0 else "") + fixed(size, FINE, paper.marks)
        ax.text(place, high + 0.02 * span, text, ha="center", va="bottom", fontsize=8)
    ax.set_ylim(min(lows.min() - 0.04 * span, 0.0), highs.max() + ROOM * span)
    labels = [textwrap.fill(name, LABEL_LETTERS, break_long_words=False) for name in names]
    ax.set_xticks(places, labels, parse_math=False, fontsize=8)
    ax.tick_params(axis="x", length=0)
    ax.set_ylabel(paper.word("axes.step"))
    ax.grid(True, axis="y")
    ax.set_axisbelow(True)
    bottom = 0.28 if all("\n" not in label for label in labels) else 0.42
    set_margins(figure, left=0.65, right=0.1, bottom=bottom, top=0.08)
    return figure


@styled
def differences(paper):
    """Draw the new minus the former volume at each dip, over the bands of U of both tables."""
    rows = _values_of_rows(paper)
    height_m, d_m3 = rows["height_m"], rows["d_m3"]
    figure, ax = _figure_by_dip(paper, "axes.d")
    for key, colour in (("U_former_m3", FAINT), ("U_new_m3", PALE)):
        known = np.isfinite(rows[key])
        if known.any():
            u_m3 = rows[key][known]
            label = paper.word(f"legend.{key}")
            ax.fill_between(
                height_m[known], -u_m3, u_m3, color=colour, alpha=0.45, linewidth=0, label=label
            )
    ax.plot(height_m, d_m3, color=INK, label=paper.word("legend.d"))
    ax.axhline(0, color=GREY, linewidth=0.6)
    _shade_unusable_rows(paper, ax, rows)
    _add_legend(figure, ax)
    return figure


@styled
def normalised(paper):
    """Draw E_n at each dip with lines at +-1; rows that are not judged are pale."""
    rows = _values_of_rows(paper)
    height_m, e_n = rows["height_m"], rows["E_n"]
    judged = height_m >= paper.record["judged_from_m"]
    figure, ax = _figure_by_dip(paper, "axes.E_n")
    ax.plot(
        height_m,
        np.where(judged, e_n, np.nan),
        color=INK,
        label=typeset_E_n(paper.word("legend.judged")),
    )
    if (~judged & np.isfinite(e_n)).any():
        # The pale line includes the lowest judged row, so that both lines meet.
        below = height_m <= height_m[judged].min(initial=np.inf)
        label = paper.word("legend.not_judged")
        ax.plot(height_m, np.where(below, e_n, np.nan), color=PALE, label=label, zorder=1)
    draw_E_n_limits(ax, float(np.nanmax(np.abs(e_n), initial=0.0)))
    _shade_unusable_rows(paper, ax, rows)
    _add_legend(figure, ax)
    return figure


def draw_E_n_limits(ax, largest):
    """Draw lines at E_n = -1, 0 and 1; the axis includes the largest |E_n|."""
    for limit in (-1.0, 1.0):
        ax.axhline(limit, color=RED, linewidth=0.9, linestyle="--")
    ax.axhline(0, color=GREY, linewidth=0.6)
    reach = max(LEAST_E_N, 1.1 * largest)
    ax.set_ylim(-reach, reach)


def typeset_E_n(text):
    """Return a label of a figure with the index of E_n as mathematical text."""
    return text.replace("E\N{LATIN SUBSCRIPT SMALL LETTER N}", r"$E_\mathrm{n}$")


def _values_of_rows(paper):
    """Return {column: values of the rows (rows,)}; nan for None."""
    return {key: np.array(values, dtype=float) for key, values in paper.record["rows"].items()}


def _figure_by_dip(paper, name):
    figure = Figure(figsize=(WIDTH, HEIGHT_IN))
    ax = figure.subplots()
    ax.set_xlabel(paper.word("axes.dip"))
    ax.set_ylabel(typeset_E_n(paper.word(name)))
    ax.set_xlim(paper.record["low_m"], paper.record["high_m"])
    ax.grid(True)
    set_margins(figure, left=0.65, right=0.12, bottom=0.42, top=0.28)
    return figure, ax


def _shade_unusable_rows(paper, ax, rows):
    """Shade the ranges of dips in which a roof is partly afloat."""
    edges = np.diff(np.concatenate([[0], rows["for_use"] == 0, [0]]).astype(int))
    label = {"label": paper.word("legend.not_for_use")}
    for first, last in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0) - 1, strict=True):
        low, high = rows["height_m"][[first, last]]
        ax.axvspan(low, high, color=FAINT, alpha=0.25, linewidth=0, **label)
        label = {}  # one entry in the legend


def _add_legend(figure, ax):
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper right", ncols=4, fontsize=7.5, frameon=False)


LEGAL = (
    Column("number"), Column("value"), Column("as_printed"), Column("limit"), Column("verdict"),
)  # fmt: skip
SIDES = (Column("what"), Column("former"), Column("new"))
FILE_COLUMNS = (Column("file"), Column("sha256"))
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
DECIMALS_OF_LIMITS = {"%": 3, "mm": 1, "m3": 3}  # of values with a legal limit, by unit
HALF = 0.5  # second correlation for which E_n is stated
MOST_ROWS_OF_PAGE = 5000  # a page shows a selection of more rows; workbook and CSV have all


def pages(paper, folder=None, whole=False):
    """Return the blocks of a ComparisonPaper, as `SavedDocument.renderers` describes."""
    return [
        *paper.head(folder),
        *verdict(paper),
        # The signature is beside the verdict: a page with signature lines only is not accepted.
        blocks.signature([paper.word(f"signatures.{role}") for role in ("compared", "approved")]),
        *_sides(paper),
        *_legal(paper),
        *_warnings(paper),
        *_basis(paper),
        *_differences(paper),
        *_deliveries(paper),
        *_courses(paper),
        *_estimated_values(paper),
        *_select_rows(paper, whole),
    ]


# ---- verdict and rule


def verdict(paper):
    """Return the verdict in its box, with its reasons and the rule."""
    comparison, rule = paper.record, paper.record["rule"]
    code = comparison["verdict"] or "none"
    note = ""
    if rule:
        note = paper.word(
            "texts.by_rule", rule=rule["name"], verified=_verification_text(paper, rule)
        )
    reasons = [paper.reason(reason) for reason in comparison["reasons"]]
    return [
        blocks.result(paper.word("labels.verdict"), paper.word(f"verdicts.{code}"), note),
        blocks.paragraph(paper.word(f"texts.verdict_{code}")),
        *([paper.heading("reasons"), blocks.listing(reasons)] if reasons else []),
        *(
            [
                paper.facts(
                    [
                        ("rule", rule["name"]),
                        ("rule_file", rule["file"]),
                        ("rule_source", rule["source"]),
                        ("rule_verified", _verification_text(paper, rule)),
                        ("verdict_verified", _verification_text(paper, paper.record)),
                        ("rule_remark", rule["remark"]),
                        (
                            "rule_asked",
                            paper.word("texts.rule_default") if rule["is_default"] else None,
                        ),
                    ]
                )
            ]
            if rule
            else []
        ),
    ]


def _verification_text(paper, entry):
    """Return whether an entry was verified in the text of the rule, in words."""
    return paper.word(f"verified.{entry['verified']}")


def _legal(paper):
    """Return the limited values and periods of the rule, each with its limit and verdict."""
    rows = [*_legal_rows(paper), *_age_rows(paper)]
    if not rows:
        return []
    entries = [*paper.record["legal"], *paper.record["ages"]]
    clauses = [f"{entry['clause']} ({_verification_text(paper, entry)})" for entry in entries]
    return [
        paper.heading("legal"),
        paper.table("legal", rows, LEGAL),
        paper.paragraph("legal"),
        blocks.listing(list(dict.fromkeys(clauses))),
    ]


def _legal_rows(paper):
    return [
        {
            "number": paper.word(f"numbers.{entry['code']}"),
            "value": _limited_value(paper, entry["value"], entry["unit"]),
            "as_printed": _limited_value(paper, entry["as_printed"], entry["unit"]),
            "limit": f"±\N{NO-BREAK SPACE}{paper.declared_value(entry['limit'], entry['unit'])}",
            "verdict": paper.word(f"limits.{entry['verdict']}"),
        }
        for entry in paper.record["legal"]
    ]


def _limited_value(paper, value, unit):
    if value is None:
        return NOTHING
    return signed_text(value, paper.measure(value, unit, DECIMALS_OF_LIMITS[unit]))


def _age_rows(paper):
    return [
        {
            "number": paper.word(f"ages.{entry['of']}"),
            "value": NOTHING
            if entry["age_years"] is None
            else paper.word("texts.years", years=paper.number(entry["age_years"], decimals=1)),
            "as_printed": NOTHING,
            "limit": paper.word("texts.years", years=paper.plain(entry["years"])),
            "verdict": paper.word(f"limits.{entry['verdict']}"),
        }
        for entry in paper.record["ages"]
    ]


# ---- both tables


def _sides(paper):
    """Return the facts of both tables, side by side, and the digests of their files."""
    files = [
        {"file": shortened(paper.record[side]["name"]), "sha256": paper.record[side]["sha256"]}
        for side in ("former", "new")
    ]
    return [
        paper.heading("tables"),
        paper.table("sides", side_rows(paper), SIDES),
        paper.table("files", files, FILE_COLUMNS),
    ]


def side_rows(paper):
    """Return [{what, former, new}] of the facts that are known of at least one table."""
    tables = [paper.record[name] for name in ("former", "new")]
    former, new = (_table_facts(paper, table) for table in tables)
    if not any(table["height_quantum_m"] for table in tables):
        former["quantum_dip"] = new["quantum_dip"] = None
    unknown = paper.word("texts.not_declared")
    return [
        {
            "what": paper.label(key),
            "former": bearable(former[key] or unknown),
            "new": bearable(new[key] or unknown),
        }
        for key in former
        if former[key] or new[key]
    ]


def _table_facts(paper, table):
    """Return {key of a label: text or None} of one table; a date that is no ISO date is kept."""
    date = table["date"]
    rows = paper.word(
        "texts.rows_of", rows=table["rows"], low=paper.height(table["low_m"]),
        high=paper.height(table["high_m"]),
    )  # fmt: skip
    return {
        "file": table["name"],
        "origin": paper.word(f"origins_of_tables.{table['origin']}"),
        "laboratory": table["laboratory"],
        "number": table["number"],
        "date": paper.day(date) if iso_day(date) == date else date,
        "method": table["method"],
        "kind": table["kind"] and paper.word(f"kinds.{table['kind']}"),
        "rows": rows,
        "top_volume": paper.number(table["top_volume_m3"], "m3", decimals=3),
        "quantum_dip": _quantum(paper, table["height_quantum_m"], "m"),
        "quantum_volume": _quantum(paper, table["volume_quantum_m3"], "m3"),
        "reference_temperature": paper.declared_value(table["reference_temperature_c"], "C"),
        "head_density": paper.word("texts.without_head")
        if table["liquid_density_kg_m3"] == 0
        else paper.declared_value(table["liquid_density_kg_m3"], "kg/m3"),
        "roof": _roof(paper, table["roof"]),
        "reference_height": paper.height(table["reference_height_m"]),
        "U_top": _stated_U(paper, table),
        "U_of_deliveries": table["U_of_deliveries"]
        and paper.word(f"U_of_deliveries.{table['U_of_deliveries']}"),
    }


def _stated_U(paper, table):
    """Return U of the last row with its coverage factor, or None if one is unknown."""
    if table["U_top_m3"] is None or table["k"] is None:
        return None
    U = paper.number(table["U_top_m3"], "m3", u=table["U_top_m3"])
    return paper.word("texts.U_with_k", U=U, k=paper.number(table["k"], decimals=2))


def _quantum(paper, value, unit):
    """Return the value of the last digit, or "not rounded"."""
    return paper.declared_value(value, unit) if value else paper.word("texts.not_rounded")


def _roof(paper, roof):
    if roof is None:
        return None
    text = paper.word(
        "texts.roof", mass=paper.declared_value(roof["mass_kg"], "kg"),
        density=paper.declared_value(roof["density_kg_m3"], "kg/m3"),
        weighing=paper.word(f"parts.{roof['weighing']}"),
    )  # fmt: skip
    if roof["critical_m"] is None:
        return text
    low, high = map(paper.height, roof["critical_m"])
    return f"{text}; {paper.word('texts.critical', low=low, high=high)}"


def _warnings(paper):
    """Return the warnings of the comparison, and the limits of every comparison."""
    texts = [paper.warning(warning) for warning in paper.record["warnings"]]
    error_m3 = paper.record["interpolation_m3"]
    if error_m3:
        volume = paper.number(error_m3, "L", digits=2)
        texts.append(paper.word("texts.interpolation", volume=volume))
    texts += paper.words["standing_limits"].values()
    return [paper.heading("limits"), blocks.listing(texts)]


# ---- common basis


def _basis(paper):
    """Return the steps from the former basis to the new basis, and the waterfall."""
    comparison = paper.record
    table = waterfall_table(comparison)
    material = comparison["material"]
    return [
        paper.heading("basis"),
        paper.paragraph("basis"),
        paper.table("basis", _basis_rows(paper), BASIS),
        *_missing_values(paper),
        _zero(paper),
        paper.paragraph(
            f"material_{material['source']}",
            expansion=paper.number(material["expansion_per_k"], "1/K", digits=3),
            modulus=paper.number(material["modulus_pa"], "GPa", digits=3),
        ),
        paper.figure(
            waterfall(paper), "waterfall_figure",
            dip=paper.height(comparison["waterfall"][-1]["height_m"]),
        ),
        paper.table("waterfall", comparison["waterfall"], table.on_paper()),
    ]  # fmt: skip


def _basis_rows(paper):
    """Return a row for each step, including steps without effect."""
    return [
        step
        | {
            "step": paper.word(f"steps.{step['code']}"),
            "former": _step_value(paper, step, "former"),
            "new": _step_value(paper, step, "new"),
            "source": paper.word(f"sources.{step['source'] or step['state']}"),
        }
        for step in paper.record["steps"]
    ]


def _step_value(paper, step, side):
    if step[side] is None:
        return NOTHING
    if step["code"] == "head" and step[side] == 0:
        return paper.word("texts.without_head")
    if step["code"] == "rounding":
        return _quantum(paper, step[side], step["unit"])
    return paper.measure(step[side], step["unit"])


def _missing_values(paper):
    """Return a paragraph with the keys that omitted steps require."""
    keys = dict.fromkeys(key for step in paper.record["steps"] for key in step["lacking"])
    return [paper.paragraph("lacking", keys=", ".join(keys))] if keys else []


def _zero(paper):
    """Return the height of the new zero above the former one, as used and by the volumes."""
    zero = paper.record["zero"]
    text = paper.word(
        f"texts.zero_{zero['source']}", height=_millimetres(paper, zero["height_m"], zero["u_m"])
    )
    if zero["fitted_m"] is None or zero["source"] == "fitted":
        return blocks.paragraph(text)
    fitted = paper.word(
        "texts.zero_by_volumes", height=_millimetres(paper, zero["fitted_m"], zero["fitted_u_m"])
    )
    return blocks.paragraph(f"{text} {fitted}")


def _millimetres(paper, value_m, u_m):
    text = paper.number(value_m, "mm", decimals=2)
    if not u_m:
        return text
    return paper.word("texts.with_u", value=text, u=paper.number(u_m, "mm", digits=2))


# ---- differences


def _differences(paper):
    """Return the remaining differences with U, the worst row, and E_n with its correlation."""
    is_E_n_known = any(value is not None for value in paper.record["rows"]["E_n"])
    return [
        paper.heading("differences"),
        paper.figure(differences(paper), "differences"),
        _worst_row(paper),
        *([_formula(paper)] if is_E_n_known else []),
        blocks.paragraph(correlation(paper)),
        *([paper.figure(normalised(paper), "normalised")] if is_E_n_known else []),
        *_lowest_judged_dip(paper),
    ]


def _worst_row(paper):
    row = worst_row(paper.record)
    if row is None:
        return paper.paragraph("no_row_judged")
    values = {
        "dip": paper.height(row["height_m"]),
        "d": signed_text(row["d_m3"], paper.number(row["d_m3"], "m3", decimals=3)),
    }
    if row["E_n"] is None:
        return paper.paragraph("worst_row_without_u", **values)
    return paper.paragraph("worst_row", E_n=paper.number(row["E_n"], decimals=2), **values)


def _formula(paper):
    """Return E_n as a formula, with indices in the language."""
    new, former = (rf"U_\mathrm{{{paper.word(f'texts.of_{side}')}}}" for side in ("new", "former"))
    root = rf"\sqrt{{{new}^2 + {former}^2 - 2\,c\,{new}\,{former}}}"
    source = rf"$$E_\mathrm{{n}} = \frac{{d}}{{{root}}}$$"
    return blocks.Block({"kind": "markdown", "nodes": nodes(source)})


def correlation(paper):
    """Return sentences on c: its source, E_n for c = 0.5, and the c at which |E_n| is 1."""
    entry = paper.record["correlation"]
    if entry["worst_E_n"] is None:
        return paper.word("texts.no_E_n")
    values = {
        key: NOTHING if entry[key] is None else paper.number(entry[key], decimals=2)
        for key in ("c", "worst_E_n", "worst_E_n_at_half", "c_limit")
    }
    sentences = [paper.word(f"texts.c_{entry['source']}", **values)]
    if entry["c"] != HALF:
        sentences.append(paper.word("texts.c_at_half", **values))
    limit = "texts.c_never" if entry["c_limit"] is None else "texts.c_limit"
    sentences.append(paper.word(limit, **values))
    if entry["coverage_k"] is not None:
        k = paper.number(entry["coverage_k"], decimals=2)
        sentences.append(paper.word("texts.same_coverage", k=k))
    return " ".join(sentences)


def _lowest_judged_dip(paper):
    lowest_m = paper.record["judged_from_m"]
    if lowest_m <= paper.record["low_m"]:
        return []
    return [paper.paragraph("judged_from", dip=paper.height(lowest_m))]


def _deliveries(paper):
    """Return the worst deliveries of each minimum height."""
    rows = delivery_rows(paper)
    if not rows:
        return []
    return [
        paper.heading("deliveries"),
        paper.show(DELIVERIES, rows),
        paper.paragraph("deliveries"),
    ]


def delivery_rows(paper):
    """Return the worst deliveries; a delivery that is worst by both criteria is one row."""
    rows = {}
    for delivery in paper.record["deliveries"]:
        place = (delivery["minimum_m"], delivery["low_m"], delivery["high_m"])
        rows[place] = delivery | ({"by": "both"} if place in rows else {})
    return list(rows.values())


def _courses(paper):
    """Return the radii of the courses in both tables."""
    rows = paper.record["courses"]
    if not rows:
        return [paper.heading("radii"), paper.paragraph("no_radii")]
    return [paper.heading("radii"), paper.show(COURSES, rows), paper.paragraph("radii")]


# ---- values estimated from the tables


def _estimated_values(paper):
    """Return the values estimated from a table because they are not declared."""
    entries = paper.record["read"]
    if not entries:
        return []
    heads = [_head(paper, entry) for entry in entries if entry["code"].startswith("head_")]
    return [
        paper.heading("read"),
        paper.table("read", _read_rows(paper), READ),
        *([blocks.listing(heads)] if heads else []),
        paper.paragraph("read"),
    ]


def _head(paper, entry):
    """Return a sentence on the head of the liquid in a table, with its density."""
    return paper.word(
        f"texts.{entry['code']}",
        table=paper.word(f"of_tables.{entry['table']}"),
        density=paper.measure(entry["value"], entry["unit"]),
        u="" if entry["u"] is None else paper.number(entry["u"], entry["unit"], digits=2),
    )


def _read_rows(paper):
    return [
        {
            "table": paper.word(f"sides_of_comparison.{entry['table']}"),
            "what": paper.word(f"read.{entry['code']}"),
            "value": _read_value(paper, entry),
            "u": NOTHING
            if entry["u"] is None
            else paper.number(entry["u"], _printed_unit(entry), digits=2),
            "sure": paper.word(f"sure.{entry['sure']}"),
            "used": paper.words["yes_no"]["yes" if entry["used"] else "no"],
        }
        for entry in paper.record["read"]
    ]


def _read_value(paper, entry):
    if entry["value"] is None:
        return paper.word("texts.not_known")
    if entry["code"].startswith("rounding"):
        return _quantum(paper, entry["value"], entry["unit"])
    decimals = None if entry["u"] else 2
    return paper.number(entry["value"], _printed_unit(entry), u=entry["u"], decimals=decimals)


def _printed_unit(entry):
    return "mm" if entry["unit"] == "m" else entry["unit"]


# ---- rows


def _select_rows(paper, whole):
    """Return a selection of the rows, or all rows if `whole` and if the page has space for them.

    The table has one column of the page, so that the last column never contains only a few rows.
    """
    rows = ROWS.rows(paper.record)
    if whole and len(rows) <= MOST_ROWS_OF_PAGE:
        table = paper.table("every_row", rows, ROWS.on_paper(), across=1)
        return [paper.heading("rows"), table]
    selection = select_rows(paper.record)
    note = [paper.paragraph("selected_rows", shown=len(selection), all=len(rows))]
    return [
        paper.heading("rows"),
        paper.show(ROWS, selection, across=1),
        *(note if len(selection) < len(rows) else []),
    ]


WIDTHS = (30, 34, 34, 12, 12, 24, 40, 12)
READ_DECIMALS = 6  # of values estimated from the tables, for units that DECIMALS lacks

SIDES_SHEET = Table("sides", tuple(Column(key, sheet=True) for key in ("what", "former", "new")))
LIMITS = Table(  # limits and periods of the rule; each number with its unit
    "legal",
    (
        Column("number", sheet=True),
        *(
            Column(key, decimals=lambda row: row["decimals"], sheet=True)
            for key in ("value", "as_printed", "limit")
        ),
        Column("unit", sheet=True),
        Column("verdict", words="limits", sheet=True),
        Column("clause", sheet=True),
        Column("verified", sheet=True),
    ),
)
READ_VALUES = Table(  # values estimated from the tables
    "read",
    (
        Column("table", words="sides_of_comparison", sheet=True),
        Column("code", words="read", heading="what", sheet=True),
        *(
            Column(
                key,
                decimals=lambda row: DECIMALS.get(row["unit"], READ_DECIMALS),
                heading=heading,
                sheet=True,
            )
            for key, heading in (("value", "read_value"), ("u", "u"))
        ),
        Column("unit", text=lambda paper, row: unit_symbol(row["unit"]), sheet=True),
        Column("sure", words="sure", sheet=True),
        Column("used", sheet=True),
    ),
    rows=lambda comparison: comparison["read"],
)


def write(paper, path):
    """Write the workbook of a ComparisonPaper; equal comparisons give equal bytes."""
    comparison, new = paper.record, paper.record["new"]
    head = workbook_head(
        comparison["tankcal"],
        tank=comparison["tank"] or comparison["former"]["name"],
        date=new["date"],
        notice=comparison["notice"],
        laboratory=new["laboratory"],
    )
    write_workbook(paper, path, "comparison", head, sheets)


def sheets(book):
    """Yield the content of each sheet, in order."""
    paper, comparison = book.paper, book.paper.record
    yield _verdict_sheet(book, paper)
    yield SheetContent("rows", [cell_table(book, ROWS)], tab="result", is_filtered=True)
    waterfall = cell_table(book, waterfall_table(comparison), comparison["waterfall"])
    yield SheetContent("waterfall", [cell_table(book, STEPS, step_rows(paper)), waterfall])
    yield SheetContent("deliveries", [cell_table(book, DELIVERIES)])
    yield SheetContent("courses", [cell_table(book, COURSES)])


def _verdict_sheet(book, paper):
    """Return verdict, its reasons, both tables, the limits of the rule and estimated values."""
    code = paper.record["verdict"] or "none"
    reasons = [f"– {paper.reason(reason)}" for reason in paper.record["reasons"]]
    verdict = (
        Sentences([paper.word(f"verdicts.{code}")], look=FIRST_LINE),
        Sentences([paper.word(f"texts.verdict_{code}"), *reasons]),
    )
    tables = (
        cell_table(
            book,
            table,
            rows,
            title=paper.word(f"sheet_headings.{table.name}"),
            is_optional=True,
        )
        for table, rows in (
            (SIDES_SHEET, side_rows(paper)),
            (LIMITS, _limit_rows(paper)),
            (READ_VALUES, None),
        )
    )
    return SheetContent(
        "verdict", [verdict, *tables], tab="result", widths=WIDTHS, keeps_together=True
    )


def _limit_rows(paper):
    """Return a row for each limit and each period of the rule."""
    limits = [
        limit
        | {
            "number": paper.word(f"numbers.{limit['code']}"),
            "unit": unit_symbol(limit["unit"]),
            "decimals": DECIMALS_OF_LIMITS[limit["unit"]],
        }
        for limit in paper.record["legal"]
    ]
    periods = [
        age
        | {
            "number": paper.word(f"ages.{age['of']}"),
            "value": age["age_years"],
            "limit": age["years"],
            "unit": paper.word("texts.unit_years"),
            "decimals": 1,
        }
        for age in paper.record["ages"]
    ]
    return [*limits, *periods]
