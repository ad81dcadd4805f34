"""Results of an adjustment: points, check points, cameras, photographs, instruments, systems."""

import numpy as np

from tankcal.record.columns import ArrayRows, as_columns
from tankcal.report import blocks
from tankcal.report.paper import Column
from tankcal.report.survey.quality import MOST_ROWS, with_note
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

MOST_CAMERAS = 12  # largest number of shown sets of camera parameters
STEEP_DEG = 80.0  # |phi| beyond which omega and kappa are hardly separable


def precision(paper):
    """Block of the precision of all points together."""
    values, number = paper.record["adjustment"]["precision"], paper.number
    if values is None:
        return [paper.paragraph("all_fixed")]
    axes = ", ".join(
        f"{axis}\N{NO-BREAK SPACE}{number(sd_m, 'mm', digits=3)}"
        for axis, sd_m in zip("xyz", values["axis_sd_m"], strict=True)
    )
    ranges = ", ".join(
        f"{axis} {number(low, 'mm', digits=2)} – {number(high, 'mm', digits=2)}"
        for axis, low, high in zip(
            "xyz", values["smallest_sd_m"], values["largest_sd_m"], strict=True
        )
    )
    factors = ", ".join(
        paper.word(
            "texts.ellipsoid_factor",
            probability=paper.percent(row["probability"]),
            factor=number(row["factor"], decimals=2),
        )
        for row in values["ellipsoid_factors"]
    )
    facts = paper.facts(
        [
            ("mean_sd", number(values["mean_sd_m"], "mm", digits=3)),
            ("axis_sd", axes),
            ("range_sd", ranges),
            ("spherical_sd", number(values["spherical_sd_m"], "mm", digits=3)),
            ("quadratic_sd", number(values["quadratic_sd_m"], "mm", digits=3)),
            ("extent", number(values["extent_m"], "m", decimals=1)),
            ("proportional", f"1 : {number(values['proportional'], digits=3) or NOTHING}"),
            ("ellipsoid_factors", factors),
        ]
    )
    return [facts]


def points(paper):
    """Table of the adjusted points, largest standard deviation first, at most MOST_ROWS."""
    record = paper.record
    points, adjusted = as_columns(record["points"]), as_columns(record["adjustment"]["points"])
    weakest = np.argsort(-adjusted.arrays["quadratic_sd_m"], kind="stable")[:MOST_ROWS]
    index = {name: i for i, name in enumerate(points["point"])}
    names = adjusted.take(weakest)["point"]
    shown = point_rows(record, ArrayRows(points.take([index[name] for name in names])))
    if not record["adjustment"]["photos"]:
        shown = [{key: value for key, value in row.items() if key != "rays"} for row in shown]
    precision = record["adjustment"]["precision"]
    probability = paper.percent(precision["ellipse_probability"]) if precision else ""
    block = paper.show(POINTS, shown, on="weakest_points", probability=probability)
    return with_note(paper, block, shown, record["adjustment"]["points"])


def check_points(paper):
    """Facts on all check points, and a table, largest difference first; [] without any."""
    check, number = paper.record["adjustment"]["check_points"], paper.number
    if not check:
        return []
    facts = paper.facts(
        [
            ("check_count", number(len(check["points"]), decimals=0)),
            ("r_xyz", number(check["r_xyz_m"], "mm", digits=3)),
            ("largest_difference", number(check["largest_m"], "mm", digits=3)),
            ("mean_difference", number(check["mean_m"], "mm", digits=3)),
        ]
    )
    rows = sorted(check["points"], key=lambda row: -row["size_m"])
    shown = rows[:MOST_ROWS]
    block = paper.show(CHECK_POINTS, shown)
    return [facts, *with_note(paper, block, shown, rows)]


# ---- cameras and photographs


def cameras(paper):
    """Tables of values and correlations for the first MOST_CAMERAS sets of interior parameters."""
    sets = paper.record["adjustment"]["cameras"]
    contents = []
    for camera in sets[:MOST_CAMERAS]:
        contents += [_parameters(paper, camera), *_correlations(paper, camera)]
    if len(sets) > MOST_CAMERAS:
        contents.append(paper.paragraph("only_first_cameras", shown=MOST_CAMERAS, all=len(sets)))
    return contents


def _camera_name(paper, camera):
    """Return the name of a camera, with the photos of a set for some of its photos."""
    if camera["photos"] is None:
        return camera["camera"]
    return f"{camera['camera']} ({list_names(paper.words, camera['photos'])})"


def _parameters(paper, camera):
    corner = paper.word(
        "texts.edge" if camera["edge_known"] else "texts.edge_seen",
        x=paper.number(camera["edge_mm"][0], decimals=1),
        y=paper.number(camera["edge_mm"][1], decimals=1),
    )
    return paper.show(
        CAMERA,
        camera_rows(camera),
        camera=_camera_name(paper, camera),
        convention=paper.word(f"conventions.{camera['convention']}"),
        corner=corner,
    )


def _correlations(paper, camera):
    """Table of the lower triangle of the correlations; [] for fewer than two free parameters."""
    codes = camera["free"]
    if len(codes) < 2:
        return []
    names = [paper.words["parameters"].get(code, code) for code in codes]
    rows = [
        [name, *(fixed(r, 2, paper.marks) if k <= i else "" for k, r in enumerate(row))]
        for i, (name, row) in enumerate(zip(names, camera["correlation"], strict=True))
    ]
    align = ["left", *["right"] * len(names)]
    caption = paper.word("captions.correlations", camera=_camera_name(paper, camera))
    return [blocks.table(["", *names], rows, caption, align)]


def photos(paper):
    """Tables of positions, angles and readings of the photos, limited to those that fit worst."""
    rows = shown = paper.record["adjustment"]["photos"]
    if not rows:
        return []
    if len(rows) > MOST_ROWS:
        shown = sorted(rows, key=lambda row: -(row["rms_mm"] or 0.0))[:MOST_ROWS]
    positions = paper.show(PHOTOS, shown)
    angles = paper.show(PHOTOS, shown, on="photo_angles")
    contents = [*with_note(paper, positions, shown, rows), angles]
    if any(abs(row["phi_deg"]) > STEEP_DEG for row in shown):
        contents.append(paper.paragraph("steep_photos"))
    return contents + image_coordinates(paper)


def image_coordinates(paper):
    """Blocks on repeated readings, fiducial marks and depth of field; [] without any."""
    return [*_repeated_readings(paper), *_fiducials(paper), *_depth_of_field(paper)]


def _repeated_readings(paper):
    """Sentence and table on image points that were read several times; [] if there are none."""
    repeats = paper.record["adjustment"]["image_readings"]
    if repeats is None:
        return []
    text = paper.paragraph(
        "repeated_readings",
        points=repeats["points"],
        readings=repeats["readings"],
        x=paper.number(repeats["mean_sd_x_um"], decimals=1),
        y=paper.number(repeats["mean_sd_y_um"], decimals=1),
    )
    if repeats["limit_um"] is None:
        return [text, paper.paragraph("no_reading_limit")]
    limit = paper.number(repeats["limit_um"], decimals=1)
    rejected = sorted(repeats["rejected"], key=lambda row: -max(row["sd_x_um"], row["sd_y_um"]))
    if not rejected:
        return [text, paper.paragraph("no_rejected_readings", limit=limit)]
    shown = rejected[:MOST_ROWS]
    block = paper.table("rejected_readings", shown, _scatter_columns("point"), limit=limit)
    return [text, *with_note(paper, block, shown, rejected)]


def _scatter_columns(key):
    """Columns of the scatter of repeated readings of a point or mark in a photo."""
    return [
        Column("photo"),
        Column(key),
        Column("n", decimals=0, heading="count_of_readings"),
        *(Column(f"sd_{axis}_um", "um", decimals=1) for axis in "xy"),
        Column("row", decimals=0),
    ]


def _fiducials(paper):
    """Table of the transformations of photos read on a comparator; [] if there are none."""
    fiducials = paper.record["adjustment"]["fiducials"]
    if not fiducials:
        return []
    rows = [row | {"marks": len(row["marks"])} for row in fiducials]
    shown = sorted(rows, key=lambda row: -row["largest_um"])[:MOST_ROWS]
    block = paper.table(
        "fiducials",
        shown,
        [
            Column("photo"),
            Column("transformation", words="transformations"),
            Column("marks", decimals=0),
            Column("largest_um", "um", decimals=1, heading="largest_residual"),
            Column("sigma0", decimals=2),
            Column("redundancy", decimals=0, heading="degrees_of_freedom"),
            Column("growth", decimals=2, heading="growth_of_sd"),
        ],
    )
    contents = with_note(paper, block, shown, rows)
    rejected = [row for photo in fiducials for row in photo["rejected"]]
    if rejected:
        columns = _scatter_columns("mark")
        contents.append(paper.table("rejected_marks", rejected[:MOST_ROWS], columns))
    return contents


def _depth_of_field(paper):
    """Paragraph on the correction for depth of field; [] if it was not requested."""
    depth = paper.record["adjustment"]["depth_of_field"]
    if depth is None:
        return []
    return [
        paper.paragraph(
            "depth_of_field",
            rounds=depth["rounds"],
            largest=paper.number(depth["largest_um"], digits=2),
            rms=paper.number(depth["rms_um"], digits=2),
        )
    ]


# ---- instruments and systems


def instruments(paper):
    """Table of estimated and declared scales and offsets of the instruments."""
    if not estimate_rows(paper.record):
        exact = paper.paragraph("instruments_exact")
        return [exact] if paper.record["adjustment"]["instruments"] else []
    return [paper.show(ESTIMATES)]


def systems(paper):
    """Table of the transformations of further coordinate systems of the control."""
    return [paper.show(SYSTEMS)] if paper.record["adjustment"]["systems"] else []
