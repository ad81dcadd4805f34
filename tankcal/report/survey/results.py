"""What was found: points, check points, cameras, photographs, instruments, systems."""

from tankcal.report import blocks, numbers
from tankcal.report.paper import Column
from tankcal.report.survey.common import MOST_CAMERAS, MOST_ROWS, with_note
from tankcal.report.survey.images import images
from tankcal.text.digits import NOTHING, fixed
from tankcal.text.words import listed

STEEP_DEG = 80.0  # of phi: beyond, omega and kappa are hardly told apart
_ANGLES = ("omega", "phi", "kappa")
_DECIMALS = {  # without an sd, and at most
    "m": (4, 6),
    "mm": (2, 3),
    "deg": (4, 7),
    "deg arcsec": (1, 3),
}


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
    places = {row["point"]: row for row in paper.record["points"]}
    rows = []
    for point in sorted(
        paper.record["adjustment"]["points"], key=lambda one: -one["quadratic_sd_m"]
    ):
        place = places[point["point"]]
        sd = {f"s{a}_m": place["cov_m2"][i][i] ** 0.5 for i, a in enumerate("xyz")}
        ellipsoid = {f"e{i + 1}_m": axis for i, axis in enumerate(point["ellipsoid_m"])}
        rows.append(place | point | sd | ellipsoid)
    shown = rows[:MOST_ROWS]
    block = paper.table(
        "weakest_points",
        shown,
        [
            Column("point"),
            *([Column("rays", decimals=0)] if paper.record["adjustment"]["photos"] else []),
            *(_to_its_sd(f"{axis}_m", "m", f"s{axis}_m") for axis in "xyz"),
            *(_to_its_sd(f"s{axis}_m", "mm", f"s{axis}_m") for axis in "xyz"),
            *(_to_its_sd(f"e{i}_m", "mm", f"e{i}_m") for i in (1, 2, 3)),
        ],
        probability=paper.percent(paper.record["adjustment"]["precision"]["ellipse_probability"])
        if paper.record["adjustment"]["precision"]
        else "",
    )
    return with_note(paper, block, shown, rows)


def _to_its_sd(key, unit, sd):
    """A column of values, or of sds, to two digits of the sd."""
    decimals, most = _DECIMALS[unit]
    return Column(key, unit, u=sd, decimals=decimals, most=most)


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
    block = paper.table(
        "check_points",
        shown,
        [
            Column("point"),
            *(_to_its_sd(f"d{axis}_m", "mm", f"s{axis}_m") for axis in "xyz"),
            Column("size_m", "mm", decimals=2),
            *(_to_its_sd(f"s{axis}_m", "mm", f"s{axis}_m") for axis in "xyz"),
            Column("largest_w", decimals=1),
        ],
    )
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
    return f"{camera['camera']} ({listed(paper.words, camera['photos'])})"


def _camera(paper, camera):
    keys = {"parameter": "parameters", "value": "values", "sd": "sds", "unit": "units"}
    keys |= {"scope": "scopes", "state": "states", "edge_um": "edge_um"}
    rows = [
        {key: camera[many][i] for key, many in keys.items()}
        for i in range(len(camera["parameters"]))
    ]
    for row in rows:
        row["value"] = numbers.like_its_sd(row["value"], row["sd"], paper.marks)
        row["sd"] = paper.number(row["sd"], digits=2) if row["sd"] else None
        row["unit"] = numbers.powers(row["unit"]) or None
    corner = paper.word(
        "texts.edge" if camera["edge_known"] else "texts.edge_seen",
        x=paper.number(camera["edge_mm"][0], decimals=1),
        y=paper.number(camera["edge_mm"][1], decimals=1),
    )
    return paper.table(
        "camera",
        rows,
        [
            Column("parameter", words="parameters"),
            Column("value", align="right", heading="estimated"),
            Column("sd", align="right"),
            Column("unit", nothing=""),
            Column("scope", words="scopes"),
            Column("state", words="states"),
            Column("edge_um", "um", decimals=1, heading="edge_effect"),
        ],
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
    places = paper.table(
        "photos",
        shown,
        [
            Column("photo"),
            Column("camera"),
            *(_to_its_sd(f"{axis}_m", "m", f"s{axis}_m") for axis in "xyz"),
            *(_to_its_sd(f"s{axis}_m", "mm", f"s{axis}_m") for axis in "xyz"),
            Column("points", decimals=0),
            Column("rms_mm", "image um", decimals=1),
        ],
    )
    angles = paper.table(
        "photo_angles",
        shown,
        [
            Column("photo"),
            *(_to_its_sd(f"{a}_deg", "deg", f"s_{a}_deg") for a in _ANGLES),
            *(_to_its_sd(f"s_{a}_deg", "deg arcsec", f"s_{a}_deg") for a in _ANGLES),
        ],
    )
    found = [*with_note(paper, places, shown, rows), angles]
    if any(abs(row["phi_deg"]) > STEEP_DEG for row in shown):
        found.append(paper.paragraph("steep_photos"))
    return found + images(paper)


def instruments(paper):
    """Scale and offset of the instruments, estimated against declared."""
    rows = []
    for tool in paper.record["adjustment"]["instruments"]:
        kind = paper.words["instruments"].get(tool["kind"], tool["kind"])
        for what, unit in (("scale", "ppm"), ("offset", "mm")):
            declared_sd = tool[f"declared_{what}_sd_{unit}"]
            if declared_sd == 0:
                continue  # exact: not estimated
            rows.append(
                {
                    "instrument": tool["instrument"],
                    "kind": kind,
                    "what": what,
                    "declared": 0.0 + tool[f"declared_{what}_{unit}"],
                    "declared_sd": declared_sd,
                    "value": tool[f"{what}_{unit}"],
                    "sd": tool[f"{what}_sd_{unit}"],
                    "unit": unit,
                    "certificate": tool["details"].get("certificate"),
                }
            )
    if not rows:
        exact = paper.paragraph("instruments_exact")
        return [exact] if paper.record["adjustment"]["instruments"] else []
    return [
        paper.table(
            "instruments",
            rows,
            [
                Column("instrument"),
                Column("kind"),
                Column("certificate"),
                Column("what", words="instrument_parts"),
                Column("declared", u="declared_sd", decimals=2),
                Column("declared_sd", u="declared_sd", decimals=2, nothing="∞"),
                Column("value", u="sd", decimals=2, heading="estimated"),
                Column("sd", u="sd", decimals=2),
                Column("unit"),
            ],
        )
    ]


def systems(paper):
    """Transformations of the further coordinate systems of the control."""
    if not paper.record["adjustment"]["systems"]:
        return []
    columns = [
        Column("system"),
        *(Column(f"{axis}_m", "m", decimals=4) for axis in "xyz"),
        *(Column(f"{a}_deg", "deg", decimals=5) for a in _ANGLES),
        Column("scale_ppm", "ppm", u="scale_sd_ppm", decimals=1, heading="scale"),
        Column("scale_sd_ppm", "ppm", u="scale_sd_ppm", decimals=1, heading="sd"),
    ]
    return [paper.table("systems", paper.record["adjustment"]["systems"], columns)]
