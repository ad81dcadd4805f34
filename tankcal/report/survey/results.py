"""What was found: points, check points, cameras, photographs, instruments, systems."""

import numpy as np

from tankcal.record.columns import ArrayRows, as_columns
from tankcal.report import blocks
from tankcal.report.survey.common import MOST_CAMERAS, MOST_ROWS, with_note
from tankcal.report.survey.images import images
from tankcal.report.tables.survey import (
    CAMERA,
    CHECK_POINTS,
    ESTIMATES,
    PHOTOS,
    POINTS,
    SYSTEMS,
    camera_rows,
    estimate_rows,
    point_rows,
)
from tankcal.text.digits import NOTHING, fixed
from tankcal.text.words import list_names

STEEP_DEG = 80.0  # of phi: beyond, omega and kappa are hardly told apart


def precision(paper):
    """The precision of all points together."""
    p, number = paper.record["adjustment"]["precision"], paper.number
    if p is None:
        return [paper.paragraph("all_fixed")]
    axes = ", ".join(
        f"{axis}\N{NO-BREAK SPACE}{number(value, 'mm', digits=3)}"
        for axis, value in zip("xyz", p["axis_sd_m"], strict=True)
    )
    ranges = ", ".join(
        f"{axis} {number(low, 'mm', digits=2)} – {number(high, 'mm', digits=2)}"
        for axis, low, high in zip("xyz", p["smallest_sd_m"], p["largest_sd_m"], strict=True)
    )
    factors = ", ".join(
        paper.word(
            "texts.ellipsoid_factor",
            probability=paper.percent(one["probability"]),
            factor=number(one["factor"], decimals=2),
        )
        for one in p["ellipsoid_factors"]
    )
    facts = paper.facts(
        [
            ("mean_sd", number(p["mean_sd_m"], "mm", digits=3)),
            ("axis_sd", axes),
            ("range_sd", ranges),
            ("spherical_sd", number(p["spherical_sd_m"], "mm", digits=3)),
            ("quadratic_sd", number(p["quadratic_sd_m"], "mm", digits=3)),
            ("extent", number(p["extent_m"], "m", decimals=1)),
            ("proportional", f"1 : {number(p['proportional'], digits=3) or NOTHING}"),
            ("ellipsoid_factors", factors),
        ]
    )
    return [facts]


def points(paper):
    """Tables of the adjusted points, the weakest first, cut to MOST_ROWS."""
    record = paper.record
    points, adjusted = as_columns(record["points"]), as_columns(record["adjustment"]["points"])
    weakest = np.argsort(-adjusted.arrays["quadratic_sd_m"], kind="stable")[:MOST_ROWS]
    place = {name: i for i, name in enumerate(points["point"])}
    names = adjusted.take(weakest)["point"]
    shown = point_rows(record, ArrayRows(points.take([place[name] for name in names])))
    if not record["adjustment"]["photos"]:
        shown = [{key: value for key, value in row.items() if key != "rays"} for row in shown]
    precision = record["adjustment"]["precision"]
    probability = paper.percent(precision["ellipse_probability"]) if precision else ""
    block = paper.show(POINTS, shown, on="weakest_points", probability=probability)
    return with_note(paper, block, shown, record["adjustment"]["points"])


def check_points(paper):
    """Check points: figures of all of them, and a table, the largest difference first."""
    found, number = paper.record["adjustment"]["check_points"], paper.number
    if not found:
        return []
    facts = paper.facts(
        [
            ("check_count", number(len(found["points"]), decimals=0)),
            ("r_xyz", number(found["r_xyz_m"], "mm", digits=3)),
            ("largest_difference", number(found["largest_m"], "mm", digits=3)),
            ("mean_difference", number(found["mean_m"], "mm", digits=3)),
        ]
    )
    rows = sorted(found["points"], key=lambda row: -row["size_m"])
    shown = rows[:MOST_ROWS]
    block = paper.show(CHECK_POINTS, shown)
    return [facts, *with_note(paper, block, shown, rows)]


def cameras(paper):
    """Values and correlations of each set of interior parameters, cut to the first few."""
    found = []
    sets = paper.record["adjustment"]["cameras"]
    for camera in sets[:MOST_CAMERAS]:
        found += [_camera(paper, camera), *_correlations(paper, camera)]
    if len(sets) > MOST_CAMERAS:
        found.append(paper.paragraph("only_first_cameras", shown=MOST_CAMERAS, all=len(sets)))
    return found


def _name_of(paper, camera):
    if camera["photos"] is None:
        return camera["camera"]
    return f"{camera['camera']} ({list_names(paper.words, camera['photos'])})"


def _camera(paper, camera):
    corner = paper.word(
        "texts.edge" if camera["edge_known"] else "texts.edge_seen",
        x=paper.number(camera["edge_mm"][0], decimals=1),
        y=paper.number(camera["edge_mm"][1], decimals=1),
    )
    return paper.show(
        CAMERA,
        camera_rows(camera),
        camera=_name_of(paper, camera),
        convention=paper.word(f"conventions.{camera['convention']}"),
        corner=corner,
    )


def _correlations(paper, camera):
    names = camera["free"]
    if len(names) < 2:
        return []
    known = paper.words["parameters"]
    heads = ["", *(known.get(name, name) for name in names)]
    rows = [
        [known.get(name, name)]
        + [
            fixed(camera["correlation"][i][k], 2, paper.marks) if k <= i else ""
            for k in range(len(names))
        ]
        for i, name in enumerate(names)
    ]
    align = ["left", *["right"] * len(names)]
    caption = paper.word("captions.correlations", camera=_name_of(paper, camera))
    return [blocks.table(heads, rows, caption, align)]


def photos(paper):
    """Positions, angles, sds and readings of the photos, cut to those that fit worst."""
    rows = shown = paper.record["adjustment"]["photos"]
    if not rows:
        return []
    if len(rows) > MOST_ROWS:
        shown = sorted(rows, key=lambda row: -(row["rms_mm"] or 0.0))[:MOST_ROWS]
    places = paper.show(PHOTOS, shown)
    angles = paper.show(PHOTOS, shown, on="photo_angles")
    found = [*with_note(paper, places, shown, rows), angles]
    if any(abs(row["phi_deg"]) > STEEP_DEG for row in shown):
        found.append(paper.paragraph("steep_photos"))
    return found + images(paper)


def instruments(paper):
    """Scale and offset of the instruments, estimated against declared."""
    if not estimate_rows(paper.record):
        exact = paper.paragraph("instruments_exact")
        return [exact] if paper.record["adjustment"]["instruments"] else []
    return [paper.show(ESTIMATES)]


def systems(paper):
    """Transformations of the further coordinate systems of the control."""
    return [paper.show(SYSTEMS)] if paper.record["adjustment"]["systems"] else []
