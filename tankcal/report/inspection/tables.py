"""The tables of an inspection, declared once for paper and workbook; their rows."""

from tankcal.report.inspection.paper import epoch_name, unit_of
from tankcal.report.saved_paper import bearable
from tankcal.report.tables import Column, Table
from tankcal.text.digits import NOTHING

MM = "image mm"  # a value that is in millimetres already
MOST_GAPS = 12  # of each kind that a page shows: the largest
_SHOWN = {"sheet": True, "width": 11}


def _mm(key, decimals=1, **more):
    return Column(key, MM, decimals=decimals, **_SHOWN, **more)


def _azimuth(**more):
    return Column("azimuth_deg", "deg", decimals=1, **_SHOWN, **more)


def _said(key, say, **more):
    """A column of texts; a check without one has a dash."""
    return Column(key, text=lambda paper, row: say(paper, row) or NOTHING, **more)


def _format(row):
    """The number format of a check's figures in the workbook, in the unit of the file."""
    return "0.00E+00" if row["unit"] == "1/m" else unit_of(row)[2]


CHECKS = Table(
    "checks",
    (
        _said("check", lambda paper, row: paper.check_name(row["code"])),
        _said("place", lambda paper, row: paper.place(row)),
        _said("value", lambda paper, row: paper.value(row), align="right"),
        _said("U", lambda paper, row: paper.in_unit(row, row["U"]), align="right"),
        _said("limit", lambda paper, row: paper.limit(row), align="right"),
        _said("verdict", lambda paper, row: paper.verdict(row)),
        _said("probability", lambda paper, row: paper.probability(row), align="right"),
    ),
    rows=lambda found: found["checks"],
)

READING = _said("reading", lambda paper, row: paper.reading(row), align="right")

LIMITS = Table(
    "limits",
    (
        _said("check", lambda paper, row: row["check"]),
        _said("limit", lambda paper, row: row["limit"], align="right"),
        _said("clause", lambda paper, row: bearable(row["clause"])),
        Column("verified", words="read"),
    ),
)

SHEET_OF_CHECKS = Table(
    "inspection_checks",
    (
        Column("check", sheet=True, width=34),
        Column("epoch", sheet=True, width=11),
        Column("course", decimals=0, sheet=True, width=6),
        Column("height_m", "m", decimals=3, sheet=True, width=7),
        Column("azimuth_deg", "deg", decimals=1, sheet=True, width=8),
        Column("value", decimals=_format, sheet=True, width=9),
        Column("U", decimals=_format, sheet=True, width=9),
        Column("k", decimals=2, sheet=True, width=5),
        Column("reading", decimals=_format, sheet=True, width=9),
        Column("U_reading", decimals=_format, sheet=True, width=9),
        Column("limit", decimals=_format, sheet=True, width=9),
        Column("unit", sheet=True, width=6),
        Column("verdict", sheet=True, width=16),
        Column("probability", "share", decimals=1, sheet=True, width=8),
        Column("used", decimals=0, sheet=True, width=7),
        Column("clause", sheet=True, width=26),
        Column("verified", words="read", sheet=True, width=8),
    ),
)

COURSES = Table(
    "inspected_courses",
    (
        Column("course", decimals=0, **_SHOWN),
        _mm("plumb_least"),
        _mm("plumb_most"),
        _mm("plumb_U"),
        _mm("round_worst"),
        _mm("round_U"),
        _mm("peaking", optional=True),
        _mm("banding", optional=True),
    ),
)

LEVELS = Table(
    "inspected_levels",
    (
        Column("height_m", "m", decimals=3, **_SHOWN),
        Column("course", decimals=0, **_SHOWN),
        Column("mean_radius_m", "m", decimals=4, **_SHOWN),
        Column("centre_x_m", "m", decimals=4, **_SHOWN),
        Column("centre_y_m", "m", decimals=4, **_SHOWN),
        _mm("least"),
        _mm("most"),
        _mm("U"),
        _mm("limit"),
    ),
)

PLACES = Table(
    "level_places",
    (
        Column("height_m", "m", decimals=3, **_SHOWN),
        Column("course", decimals=0, **_SHOWN),
        _azimuth(),
        _mm("departure", 2),
        _mm("U", 2),
    ),
)

GENERATRICES = Table(
    "generatrices",
    (
        Column("height_m", "m", decimals=3, **_SHOWN),
        Column("course", decimals=0, **_SHOWN),
        _azimuth(),
        _mm("plumb", 2),
        _mm("U", 2),
    ),
)

GAPS = Table(
    "weld_gaps",
    (
        Column("kind", words="kinds_of_gaps", sheet=True, width=12),
        Column("course", decimals=0, **_SHOWN),
        Column("height_m", "m", decimals=3, **_SHOWN),
        _azimuth(),
        _mm("gap_mm", heading="gap"),
        _mm("U_mm", heading="U"),
    ),
    rows=lambda found: gap_rows(found),
)

POINTS = Table(
    "settlement_points",
    (
        Column("epoch", on="", sheet=True, width=16),
        Column("point", sheet=True, width=12, text=lambda paper, row: bearable(row["point"])),
        _azimuth(),
        _mm("z_mm", 2, heading="z"),
        _mm("s_mm", 2, heading="s", on=""),
        _mm("fitted_mm", 2, heading="fitted", on=""),
        _mm("U_i_mm", 2, heading="U_i"),
        _mm("S_i_mm", 2, heading="S_i"),
        _mm("U_S_mm", 2, heading="U_S"),
        Column("in_subset", heading="subset", sheet=True, width=10),
    ),
)

PLANES = Table(
    "settlement_planes",
    (
        Column("epoch", sheet=True, width=16),
        _mm("a_mm", 2, heading="a"),
        _mm("p_mm", 2, heading="p"),
        _mm("q_mm", 2, heading="q"),
        _mm("b_mm", 2, heading="b"),
        _mm("U_b_mm", 2, heading="U"),
        Column("highest_azimuth_deg", "deg", decimals=1, heading="highest", **_SHOWN),
        Column("tilt_mm_per_m", decimals=3, heading="tilt", **_SHOWN),
        Column("R2", decimals=4, **_SHOWN),
        _mm("limit_mm", 2, heading="limit_all"),
        _mm("limit_half_mm", 2, heading="limit_half"),
        _mm("subset_limit_mm", 2, heading="limit_subset"),
    ),
)

EDGES = Table(
    "edge_profiles",
    (
        _azimuth(),
        Column("break_radius_m", "m", decimals=3, heading="break_radius", **_SHOWN),
        Column("width_m", "m", decimals=3, heading="width", **_SHOWN),
        _mm("drop_mm", heading="drop"),
        _mm("U_mm", heading="U"),
        _mm("limit_mm", heading="limit"),
    ),
    rows=lambda found: found["edges"],
)

READINGS = Table(
    "edge_readings",
    (
        _azimuth(),
        Column("radius_m", "m", decimals=3, heading="radius", **_SHOWN),
        _mm("z", 2),
    ),
)


# ---- rows


def limit_rows(paper):
    """Each limit once, with the checks that it is of, its clause, and whether it was read."""
    found = {}
    for one in paper.found["checks"]:
        bound = one["limit"]
        if bound is not None:
            key = (one["code"], paper.limit(one), bound["clause"], bound["verified"])
            found.setdefault(key, one)
    return [
        {"check": paper.check_name(code), "limit": limit, "clause": clause, "verified": verified}
        for code, limit, clause, verified in found
    ]


def sheet_rows(paper):
    """The checks with their numbers as numbers, in the unit of the file."""
    return [_sheet_row(paper, one) for one in paper.found["checks"]]


def _sheet_row(paper, one):
    bound = one["limit"] or {"value": None, "clause": None, "verified": None}
    return one | {
        "check": paper.check_name(one["code"]),
        "verdict": paper.verdict(one),
        "limit": bound["value"],
        "clause": bound["clause"],
        "verified": bound["verified"],
        "unit": one["unit"] or None,
    }


def gap_rows(found):
    """The gaps; a horizontal weld without one has no azimuth, for its boards go all round."""
    return [
        one | {"azimuth_deg": None} if one["kind"] == "banding" and one["gap_mm"] is None else one
        for one in found["gaps"]
    ]


def checks_of(found, *codes):
    """The checks of these codes, in their order."""
    return [one for one in found["checks"] if one["code"] in codes]


def limit_mm(found, *codes):
    """The limit of the first check of these codes that has one in mm; None: there is none."""
    limits = [
        one["limit"]["value"]
        for one in checks_of(found, *codes)
        if one["limit"] is not None and one["unit"] == "mm"
    ]
    return limits[0] if limits else None


def is_low(found, level):
    """Whether a level is the one above the bottom weld, which has a limit of its own."""
    heights = [
        one["height_m"] for one in checks_of(found, "roundness_low") if one["height_m"] is not None
    ]
    if not heights:
        return level is found["levels"][0]
    nearest = min(found["levels"], key=lambda one: abs(one["height_m"] - heights[0]))
    return level["height_m"] == nearest["height_m"]


def limit_of_level(found, level):
    """The limit of the radius of a level, mm; None: there is none."""
    return limit_mm(found, "roundness_low" if is_low(found, level) else "roundness_high")


def worst_place(departures):
    """Place of the largest departure, either way."""
    return max(range(len(departures)), key=lambda place: abs(departures[place]))


def level_rows(found):
    """The levels, from the bottom up, with the range of their departures."""
    return [
        one
        | {
            "least": min(one["departure_mm"]),
            "most": max(one["departure_mm"]),
            "U": one["U_mm"][worst_place(one["departure_mm"])],
            "limit": limit_of_level(found, one),
        }
        for one in found["levels"]
        if one["departure_mm"]
    ]


def place_rows(found):
    """Every place of every level."""
    return [
        {"height_m": one["height_m"], "course": one["course"], "azimuth_deg": azimuth,
         "departure": departure, "U": U}
        for one in found["levels"]
        for azimuth, departure, U in zip(
            one["azimuth_deg"], one["departure_mm"], one["U_mm"], strict=True
        )
    ]  # fmt: skip


def generatrix_rows(found):
    """Every place of the generatrices, from the lowest height."""
    wall = found["generatrices"]
    if wall is None:
        return []
    return [
        {"height_m": height, "course": course, "azimuth_deg": azimuth, "plumb": plumb, "U": U}
        for height, course, departures, uncertainties in zip(
            wall["height_m"], wall["course"], wall["departure_mm"], wall["U_mm"], strict=True
        )
        for azimuth, plumb, U in zip(
            wall["azimuth_deg"], departures, uncertainties, strict=True
        )
    ]  # fmt: skip


def course_rows(found):
    """What each course departs by, from the bottom up: selected, not computed."""
    walls, levels, gaps = generatrix_rows(found), place_rows(found), found["gaps"]
    numbers = {one["course"] for one in (*walls, *levels, *gaps)}
    return [_course_row(number, walls, levels, gaps) for number in sorted(numbers)]


def _course_row(number, walls, levels, gaps):
    wall, level, gaps = ([o for o in of if o["course"] == number] for of in (walls, levels, gaps))
    row = {"course": number}
    if wall:
        row["plumb_least"] = min(one["plumb"] for one in wall)
        row["plumb_most"] = max(one["plumb"] for one in wall)
        row["plumb_U"] = max(one["U"] for one in wall)
    if level:
        worst = max(level, key=lambda one: abs(one["departure"]))
        row |= {"round_worst": worst["departure"], "round_U": worst["U"]}
    for kind in ("peaking", "banding"):
        known = [one["gap_mm"] for one in gaps if one["kind"] == kind]
        known = [one for one in known if one is not None]
        row |= {kind: max(known, key=abs)} if known else {}
    return row


def largest_gaps(found, kind, most=MOST_GAPS):
    """The largest gaps of a kind that are determined, the largest first."""
    known = [one for one in found["gaps"] if one["kind"] == kind and one["gap_mm"] is not None]
    return sorted(known, key=lambda one: -abs(one["gap_mm"]))[:most]


def point_rows(found):
    """Every point of every settlement."""
    return [
        {"epoch": epoch_name(one)} | point
        for one in found["settlements"]
        for point in one["points"]
    ]


def plane_rows(found):
    """The plane of every settlement."""
    return [one | {"epoch": epoch_name(one)} for one in found["settlements"]]


def reading_rows(found):
    """Every reading of the profiles of the bottom's edge."""
    return [
        {"azimuth_deg": one["azimuth_deg"], "radius_m": radius, "z": z}
        for one in found["edges"]
        for radius, z in zip(one["radius_m"], one["z_mm"], strict=True)
    ]
