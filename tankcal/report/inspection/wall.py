"""The wall in an inspection: departures unrolled, levels, courses, gaps at the welds."""

from tankcal.report import blocks
from tankcal.report.inspection import figures
from tankcal.report.inspection.tables import (
    COURSES,
    GAPS,
    LEVELS,
    MOST_GAPS,
    course_rows,
    generatrix_rows,
    largest_gaps,
    level_rows,
)

KINDS = ("peaking", "banding")


def departures(paper):
    """The map of departures along the generatrices, with their U."""
    found = paper.found
    rows = generatrix_rows(found)
    if not rows:
        return []
    median, largest = figures.largest_U_mm(found)
    worst = max(rows, key=lambda row: abs(row["plumb"]))
    values = {
        "median": paper.number(median, "image mm", decimals=1),
        "largest": paper.number(largest, "image mm", decimals=1),
    }
    said = paper.paragraph(
        "departures", generatrices=len(found["generatrices"]["azimuth_deg"]),
        heights=len(found["generatrices"]["height_m"]),
        departure=paper.number(worst["plumb"], "image mm", decimals=1),
        U=paper.number(worst["U"], "image mm", decimals=1),
        height=paper.number(worst["height_m"], "m", decimals=2),
        azimuth=paper.azimuth(worst["azimuth_deg"]),
    )  # fmt: skip
    drawn = figures.has_map(found)
    return [
        paper.heading("departures"),
        *([paper.figure(figures.departures(paper), "departures", **values)] if drawn else []),
        said,
    ]


def levels(paper):
    """The levels about the nominal circle, low ones and some higher, and the table of all."""
    rows = level_rows(paper.found)
    if not rows:
        return []
    factor = paper.number(figures.enlargement(paper.found), decimals=0)
    return [
        paper.heading("levels"),
        paper.figure(figures.levels(paper), "levels", factor=factor),
        blocks.with_next(paper.paragraph("levels")),
        paper.show(LEVELS, rows),
    ]


def courses(paper):
    """What each course departs by."""
    rows = course_rows(paper.found)
    if all(value is None for row in rows for key, value in row.items() if key != "course"):
        return []
    said = paper.word("texts.courses")
    if any(kind in row for row in rows for kind in KINDS):
        said = f"{said} {paper.word('texts.courses_gaps')}"
    return [
        paper.heading("courses"),
        blocks.with_next(blocks.paragraph(said)),
        paper.show(COURSES, rows),
    ]


def welds(paper):
    """Peaking and banding: profiles of the worst boards, the largest gaps, how many are open.

    Nothing where no gap is known: the checks and their remarks have said so, and why.
    """
    found = paper.found
    if all(one["gap_mm"] is None for one in found["gaps"]):
        return []
    rows = [row for kind in KINDS for row in largest_gaps(found, kind)]
    drawn = any(figures.profiles_of(found, kind) for kind in KINDS)
    known = sum(one["gap_mm"] is not None for one in found["gaps"])
    said = paper.word("texts.gaps", known=known, all=len(found["gaps"]))
    if known > len(rows):
        said = f"{said} {paper.word('texts.largest_gaps', most=MOST_GAPS)}"
    return [
        paper.heading("welds"),
        *([paper.figure(figures.welds(paper), "welds")] if drawn else []),
        blocks.paragraph(said),
        *([paper.show(GAPS, rows, across=2 if len(rows) > MOST_GAPS else None)] if rows else []),
    ]
