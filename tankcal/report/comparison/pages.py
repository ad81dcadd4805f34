"""What a comparison says, block by block: verdict, both tables, basis, differences, radii."""

from tankcal.report import blocks
from tankcal.report.comparison import figures
from tankcal.report.comparison.basis import basis, read_out, sides
from tankcal.report.comparison.tables import COURSES, DELIVERIES, ROWS, selected, worst_row
from tankcal.report.comparison.verdict import legal, signed, verdict
from tankcal.report.markdown import nodes
from tankcal.report.saved_paper import signed_text
from tankcal.text.digits import NOTHING

HALF = 0.5  # the other correlation that E_n is told for
FEW_ROWS = 5000  # of the page: more are only in workbook and CSV


def pages(paper, folder=None, whole=False):
    """The blocks of a ComparisonPaper.

    folder  of the files that the PDF holds inside; None: none
    whole   True: with every row, for the web page
    """
    return [
        *paper.head(folder),
        *verdict(paper),
        *signed(paper),
        *sides(paper),
        *legal(paper),
        *warnings(paper),
        *basis(paper),
        *differences(paper),
        *deliveries(paper),
        *courses(paper),
        *read_out(paper),
        *rows(paper, whole),
    ]


def differences(paper):
    """What is left at each dip, the worst row, E_n and the correlation that it is for."""
    found = paper.found
    known = any(one is not None for one in found["rows"]["E_n"])
    return [
        paper.heading("differences"),
        paper.figure(figures.differences(paper), "differences"),
        *_worst_row(paper),
        *([formula(paper)] if known else []),
        blocks.paragraph(correlation(paper)),
        *([paper.figure(figures.normalised(paper), "normalised")] if known else []),
        *_judged(paper),
    ]


def formula(paper):
    """E_n as a formula, its indices in the language."""
    new, former = (rf"U_\mathrm{{{paper.word(f'texts.of_{one}')}}}" for one in ("new", "former"))
    root = rf"\sqrt{{{new}^2 + {former}^2 - 2\,c\,{new}\,{former}}}"
    source = rf"$$E_\mathrm{{n}} = \frac{{d}}{{{root}}}$$"
    return blocks.Block({"kind": "markdown", "nodes": nodes(source)})


def _worst_row(paper):
    row = worst_row(paper.found)
    if row is None:
        return [paper.paragraph("no_row_judged")]
    values = {
        "dip": paper.height(row["height_m"]),
        "d": signed_text(row["d_m3"], paper.number(row["d_m3"], "m3", decimals=3)),
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
    if one["c"] != HALF:
        said.append(paper.word("texts.c_at_half", **shown))
    said.append(paper.word("texts.c_never" if one["c_limit"] is None else "texts.c_limit", **shown))
    if one["coverage_k"] is not None:
        k = paper.number(one["coverage_k"], decimals=2)
        said.append(paper.word("texts.same_coverage", k=k))
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
        paper.show(DELIVERIES, delivery_rows(paper)),
        paper.paragraph("deliveries"),
    ]


def delivery_rows(paper):
    """The worst deliveries; one that is the worst by both is one row."""
    found = {}
    for one in paper.found["deliveries"]:
        place = (one["minimum_m"], one["low_m"], one["high_m"])
        known = found.get(place)
        found[place] = one | ({"by": "both"} if known else {})
    return list(found.values())


def courses(paper):
    """The radii of the courses in both tables."""
    found = paper.found["courses"]
    if not found:
        return [paper.heading("radii"), paper.paragraph("no_radii")]
    return [paper.heading("radii"), paper.show(COURSES, found), paper.paragraph("radii")]


def rows(paper, whole):
    """A selection of the rows, or every row where there is room.

    As a table in one column of the page: it never leaves a few rows alone on the last one.
    """
    every = ROWS.rows(paper.found)
    if whole and len(every) <= FEW_ROWS:
        columns = ROWS.on_paper()
        return [paper.heading("rows"), paper.table("every_row", every, columns, across=1)]
    some = selected(paper.found)
    told = [paper.paragraph("selected_rows", shown=len(some), all=len(every))]
    return [
        paper.heading("rows"),
        paper.show(ROWS, some, across=1),
        *(told if len(some) < len(every) else []),
    ]


def warnings(paper):
    """Warnings, and what limits every comparison."""
    said = [paper.warning(one) for one in paper.found["warnings"]]
    lost_m3 = paper.found["interpolation_m3"]
    if lost_m3:
        volume = paper.number(lost_m3, "L", digits=2)
        said.append(paper.word("texts.interpolation", volume=volume))
    said += paper.words["standing_limits"].values()
    return [paper.heading("limits"), blocks.listing(said)]
