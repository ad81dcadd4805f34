"""Point clouds in the documents: facts, tables, and a map of the unrolled wall."""

from math import ceil

import matplotlib
import numpy as np
from matplotlib.patches import Rectangle

from tankcal.methods.clouds import tables
from tankcal.report.plots.style import GREY, WIDTH, Drawing, styled

FULL_COLOUR = 98  # percentile of absolute deviations that has the last colour
LEAST_LIMIT_MM = 0.5  # smallest deviation of the last colour
HIDDEN, EDGE, WELD = "#c9ced4", "#1b1b1b", "#e08a00"


def departures_mm(record):
    """Deviations of the wall map, mm, shape (rows, columns); nan where the wall is hidden."""
    tenths_mm = record["clouds"]["map"]["departure_tenths_mm"]
    return np.array(tenths_mm, dtype=float) / 10  # None becomes nan


def limit_mm(record):
    """Deviation of the last colour, mm, rounded up to half millimetres."""
    size = np.abs(departures_mm(record))
    size = size[np.isfinite(size)]
    wanted = float(np.percentile(size, FULL_COLOUR)) if len(size) else 0.0
    return max(LEAST_LIMIT_MM, ceil(2 * wanted) / 2)


def joints_m(record):
    """Heights of the course joints above the zero of the table, m; [] for tanks without courses."""
    courses = record["courses"]
    zero = record["capacity"]["zero_m"]
    ends = [course["bottom_m"] for course in courses] + [course["top_m"] for course in courses[-1:]]
    return [float(end - zero) for end in ends]


def azimuth_intervals(obstruction):
    """Azimuth intervals of an obstruction within 0 to 360 degrees, as (from, to) pairs."""
    low, high = obstruction["azimuth_from_deg"], obstruction["azimuth_to_deg"]
    return [(low, min(high, 360.0))] + ([(0.0, high - 360)] if high > 360 else [])


@styled
def cloud_map(paper):
    """Map of the unrolled wall with deviations, hidden cells (hatched) and obstructions."""
    record = paper.record
    wall_map = record["clouds"]["map"]
    lying = record["job"]["tank"]["kind"] == "horizontal"
    heights, turns = wall_map["height_edges_m"], wall_map["azimuth_edges_deg"]
    limit = limit_mm(record)
    figure = Drawing(figsize=(WIDTH, 3.0))
    ax = figure.subplots()
    with matplotlib.rc_context({"hatch.linewidth": 0.4, "hatch.color": GREY}):
        ax.add_patch(
            Rectangle(
                (0, heights[0]), 360, heights[-1] - heights[0], facecolor=HIDDEN, hatch="//////",
                edgecolor=GREY, linewidth=0, rasterized=True, zorder=0,
            )
        )  # fmt: skip
    shown = ax.pcolormesh(
        turns, heights, np.ma.masked_invalid(departures_mm(record)), cmap="RdBu_r", vmin=-limit,
        vmax=limit, rasterized=True, zorder=1,
    )  # fmt: skip
    ax.hlines(joints_m(record), 0, 360, color=GREY, linewidth=0.5, zorder=2)
    _obstructions(ax, record["clouds"]["obstructions"])
    _welds(ax, record)
    ax.set(xlim=(0, 360), xticks=range(0, 361, 45), ylim=(heights[0], heights[-1]))
    ax.set_xlabel(paper.word("axes.cloud_turn" if lying else "axes.azimuth"))
    ax.set_ylabel(paper.word("axes.cloud_along" if lying else "axes.height"))
    bar = figure.colorbar(shown, ax=ax, pad=0.02, aspect=30, extend="both")
    bar.set_label(paper.word("axes.cloud_departure"))
    figure.subplots_adjust(left=0.075, right=1.04, bottom=0.14, top=0.98)
    return figure


def _obstructions(ax, obstructions):
    """Draw the outlines of obstructions."""
    for obstruction in obstructions:
        for low, high in azimuth_intervals(obstruction):
            ax.add_patch(
                Rectangle(
                    (low, obstruction["bottom_m"]), high - low,
                    obstruction["top_m"] - obstruction["bottom_m"],
                    fill=False, edgecolor=EDGE, linewidth=0.8, zorder=3,
                )
            )  # fmt: skip


def _welds(ax, record):
    """Draw the vertical welds."""
    courses = {course["course"]: course for course in record["courses"]}
    zero = record["capacity"]["zero_m"]
    for weld in record["clouds"]["welds"]:
        course = courses.get(weld["course"])
        if course:
            ax.vlines(
                weld["azimuth_deg"], course["bottom_m"] - zero, course["top_m"] - zero, color=WELD,
                linewidth=0.9, linestyle=(0, (4, 3)), zorder=3,
            )  # fmt: skip


def facts(paper):
    """Block of U at the top, with and without errors common to all points, and the registration."""
    clouds = paper.record["clouds"]
    part, dof = clouds["shared_part"], clouds["registration_dof"]
    volumes = {
        "cloud_U": part["U_m3"],
        "cloud_without_U": part["without_U_m3"],
        "cloud_shared_u": part["shared_u_m3"],
    }
    tied = clouds["targets"] and paper.word(
        "texts.registration_test",
        chi_square=paper.number(clouds["registration_chi2"], decimals=1),
        dof=paper.number(dof, decimals=0),
    )
    return paper.facts(
        [(key, paper.number(value, "m3", u=value or None)) for key, value in volumes.items()]
        + [("cloud_registration", tied or None), *_facts_of_inside(paper)]
    )


def _facts_of_inside(paper):
    """Facts of the bottom and the roof in scans from inside; [] if not requested."""
    inside = paper.record["clouds"].get("inside")
    if inside is None:
        return []
    side = paper.number(inside["cell_m"], "m", decimals=2)
    items = [
        ("cloud_bottom_share", paper.number(inside["seen_share"], "share", decimals=1)),
        ("cloud_bottom_cells", f"{paper.number(inside['cells'], decimals=0)} × {side}"),
        ("cloud_bottom_scatter", paper.number(inside["scatter_mm"], "image mm", decimals=2)),
        ("cloud_bottom_mirrored", paper.number(inside["mirrored"], decimals=0)),
    ]
    if inside["roof_share"] is not None:
        ends = (paper.number(inside[key], "m", decimals=2) for key in ("roof_low_m", "roof_high_m"))
        items.append(("cloud_roof", " – ".join(ends)))
    return items


def blocks_of_tables(paper):
    """Blocks of the tables with rows, except the share of U, which `facts` contains."""
    return [
        paper.show(table)
        for table in tables.TABLES
        if table is not tables.SHARE_OF_U and table.rows(paper.record)
    ]


def cells_of_map(record):
    """Number of wall cells with a deviation in the map."""
    return int(np.isfinite(departures_mm(record)).sum())
