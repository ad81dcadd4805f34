"""The bottom in an inspection: settlement of each epoch and between them, its edge."""

from tankcal.report import blocks
from tankcal.report.inspection import bottom_figures as figures
from tankcal.report.inspection.paper import epoch_name
from tankcal.report.inspection.tables import CHECKS, EDGES, POINTS, READING
from tankcal.report.saved_paper import bearable
from tankcal.report.tables import Column

FEW_POINTS = 32
SHORT_NAME = 8  # letters of a point: up to so many there is room for two tables side by side
USED = Column("used", decimals=0)
SETTLEMENT = ("settlement_cosine", "settlement_all", "settlement_subset", "settlement_curvature",
              "settlement_de_beer")  # fmt: skip


def settlements(paper):
    """Each epoch, then the differences; before them all epochs in one figure."""
    found = paper.found["settlements"]
    if not found:
        return []
    more = len(found) > 1
    return [
        paper.heading("settlement"),
        *([paper.figure(figures.epochs(paper), "epochs")] if more else []),
        paper.paragraph("settlement"),
        *([paper.paragraph("estimates")] if _has_estimates(paper) else []),
        *(block for one in found for block in settlement(paper, one)),
    ]


def _has_estimates(paper):
    return any(one["reading"] is not None for one in paper.found["checks"])


def settlement(paper, one):
    """The figure, the plane, the verdicts side by side."""
    name, epoch = bearable(epoch_name(one)), bearable(one["epoch"])
    if one["since"] is None:
        heading = paper.word("headings.epoch", epoch=epoch)
        told = paper.word("texts.epoch_as_built")
    else:
        since = bearable(one["since"])
        heading = paper.word("headings.difference", epoch=epoch, since=since)
        told = paper.word("texts.epoch_difference", since=since)
    return [
        blocks.heading(heading, 2),
        paper.figure(figures.settlement(paper, one), "settlement_figure", epoch=name),
        blocks.paragraph(f"{told} {_plane(paper, one)} {_limits(paper, one)}"),
        *_verdicts(paper, one),
    ]


def _plane(paper, one):
    """The plane in one sentence, with U where it is known, and what it explains."""
    mm, two = "image mm", {"decimals": 2}
    values = {
        "b": paper.number(one["b_mm"], mm, **two),
        "azimuth": paper.azimuth(one["highest_azimuth_deg"]),
        "tilt": f"{paper.number(one['tilt_mm_per_m'], **two)}\N{NO-BREAK SPACE}mm/m",
        "share": paper.number(one["R2"], decimals=4),
        "a": paper.number(one["a_mm"], mm, **two),
        "p": paper.number(one["p_mm"], mm, **two),
        "q": paper.number(one["q_mm"], mm, **two),
    }
    if one["U_b_mm"] is None:
        return paper.word("texts.plane_without_u", **values)
    return paper.word("texts.plane", U=paper.number(one["U_b_mm"], mm, **two), **values)


def _limits(paper, one):
    """How the limit of S depends on the points that are taken: with all, and with every second."""
    if one["limit_mm"] is None:
        return paper.word("texts.no_settlement_limit")
    values = {
        "points": len(one["points"]),
        "limit": paper.number(one["limit_mm"], "image mm", decimals=2),
        "arc": paper.number(one["arc_m"], "m", decimals=2),
    }
    if one["limit_half_mm"] is None:
        return paper.word("texts.limit_by_points", **values)
    half = paper.number(one["limit_half_mm"], "image mm", decimals=2)
    return paper.word("texts.limit_by_half", half=half, fewer=len(one["points"]) // 2, **values)


def _verdicts(paper, one):
    """The verdicts of this epoch beside each other, each with the points that it used."""
    name = epoch_name(one)
    own = [c for c in paper.found["checks"] if c["code"] in SETTLEMENT and c["epoch"] == name]
    if not own:
        return []
    columns = [c for c in CHECKS.on_paper() if c.key not in ("place", "probability")]
    of_reading = [READING] if any(c["reading"] is not None for c in own) else []
    return [
        paper.table("settlement_verdicts", own, [columns[0], USED, *of_reading, *columns[1:]],
                    epoch=name),
    ]  # fmt: skip


def points(paper):
    """The points of every settlement, last of all: tables of many rows fill the pages."""
    found = paper.found["settlements"]
    if not found:
        return []
    tables = [
        paper.show(POINTS, one["points"], across=_across(one["points"]),
                   epoch=bearable(epoch_name(one)))
        for one in found
    ]  # fmt: skip
    return [paper.heading("points"), *tables]


def _across(points):
    """How many columns of the page few points are set in; more go on from page to page."""
    short = all(len(point["point"]) <= SHORT_NAME for point in points)
    return 2 if short and len(points) <= FEW_POINTS else None


def edges(paper):
    """The profiles of the edge, and the drop of each."""
    found = paper.found["edges"]
    if not found:
        return []
    return [
        paper.heading("edges"),
        paper.figure(figures.edges(paper), "edges_figure"),
        blocks.with_next(paper.paragraph("edges")),
        paper.show(EDGES, found),
    ]
