"""Tables of an inspection for report and workbook, and their rows."""

from tankcal.report.inspection.paper import epoch_name, unit_of
from tankcal.report.saved_document import bearable
from tankcal.report.tables import Column, Table
from tankcal.text.digits import NOTHING

MM = "image mm"  # unit of a value in millimetres
MOST_GAPS = 12  # largest number of gaps of each kind in the report
_SHOWN = {"sheet": True, "width": 11}


def _mm(key, decimals=1, **more):
    """Column of values in millimetres."""
    return Column(key, MM, decimals=decimals, **_SHOWN, **more)


def _azimuth(**more):
    """Column of azimuths."""
    return Column("azimuth_deg", "deg", decimals=1, **_SHOWN, **more)


def _text_column(key, text_of, **more):
    """Column of texts, with a dash for a check without text."""
    return Column(key, text=lambda paper, row: text_of(paper, row) or NOTHING, **more)


def _format(row):
    """Number format of a check's figures in the workbook, in the unit of the file."""
    return "0.00E+00" if row["unit"] == "1/m" else unit_of(row)[2]


CHECKS = Table(
    "checks",
    (
        _text_column("check", lambda paper, row: paper.check_name(row["code"])),
        _text_column("place", lambda paper, row: paper.place(row)),
        _text_column("value", lambda paper, row: paper.value(row), align="right"),
        _text_column("U", lambda paper, row: paper.format_figure(row, row["U"]), align="right"),
        _text_column("limit", lambda paper, row: paper.limit(row), align="right"),
        _text_column("verdict", lambda paper, row: paper.verdict(row)),
        _text_column("probability", lambda paper, row: paper.probability(row), align="right"),
    ),
    rows=lambda inspection: inspection["checks"],
)

READING = _text_column("reading", lambda paper, row: paper.reading(row), align="right")

LIMITS = Table(
    "limits",
    (
        _text_column("check", lambda paper, row: row["check"]),
        _text_column("limit", lambda paper, row: row["limit"], align="right"),
        _text_column("clause", lambda paper, row: bearable(row["clause"])),
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
    rows=lambda inspection: gap_rows(inspection),
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
    rows=lambda inspection: inspection["edges"],
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
    """Each limit once, with its check, its clause, and whether it was read there."""
    limits = dict.fromkeys(
        (check["code"], paper.limit(check), check["limit"]["clause"], check["limit"]["verified"])
        for check in paper.record["checks"]
        if check["limit"] is not None
    )
    return [
        {"check": paper.check_name(code), "limit": text, "clause": clause, "verified": verified}
        for code, text, clause, verified in limits
    ]


def sheet_rows(paper):
    """Checks with numbers as numbers, in the unit of the file."""
    return [_sheet_row(paper, check) for check in paper.record["checks"]]


def _sheet_row(paper, check):
    """Row of a check in the workbook."""
    limit = check["limit"] or {"value": None, "clause": None, "verified": None}
    return check | {
        "check": paper.check_name(check["code"]),
        "verdict": paper.verdict(check),
        "limit": limit["value"],
        "clause": limit["clause"],
        "verified": limit["verified"],
        "unit": check["unit"] or None,
    }


def gap_rows(inspection):
    """Gaps at the welds; a horizontal weld without a determined gap has no azimuth."""
    return [
        gap | {"azimuth_deg": None} if gap["kind"] == "banding" and gap["gap_mm"] is None else gap
        for gap in inspection["gaps"]
    ]


def select_checks(inspection, *codes):
    """Select the checks with these codes, in their order."""
    return [check for check in inspection["checks"] if check["code"] in codes]


def limit_mm(inspection, *codes):
    """Limit of the first check with these codes that has a limit in mm, or None."""
    limits = [
        check["limit"]["value"]
        for check in select_checks(inspection, *codes)
        if check["limit"] is not None and check["unit"] == "mm"
    ]
    return limits[0] if limits else None


def is_low(inspection, level):
    """Whether a level is directly above the bottom weld; such a level has another limit."""
    heights = [
        item["height_m"]
        for item in select_checks(inspection, "roundness_low")
        if item["height_m"] is not None
    ]
    if not heights:
        return level is inspection["levels"][0]
    nearest = min(inspection["levels"], key=lambda item: abs(item["height_m"] - heights[0]))
    return level["height_m"] == nearest["height_m"]


def limit_of_level(inspection, level):
    """Limit of the radius of a level, mm, or None."""
    return limit_mm(inspection, "roundness_low" if is_low(inspection, level) else "roundness_high")


def worst_place(departures):
    """Index of the largest deviation in magnitude."""
    return max(range(len(departures)), key=lambda place: abs(departures[place]))


def level_rows(inspection):
    """Levels from the bottom up, with the range of their deviations."""
    return [
        level
        | {
            "least": min(level["departure_mm"]),
            "most": max(level["departure_mm"]),
            "U": level["U_mm"][worst_place(level["departure_mm"])],
            "limit": limit_of_level(inspection, level),
        }
        for level in inspection["levels"]
        if level["departure_mm"]
    ]


def place_rows(inspection):
    """All places of all levels."""
    return [
        {"height_m": level["height_m"], "course": level["course"], "azimuth_deg": azimuth,
         "departure": departure, "U": U}
        for level in inspection["levels"]
        for azimuth, departure, U in zip(
            level["azimuth_deg"], level["departure_mm"], level["U_mm"], strict=True
        )
    ]  # fmt: skip


def generatrix_rows(inspection):
    """All places of the generatrices, from the lowest height."""
    wall = inspection["generatrices"]
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


def course_rows(inspection):
    """Largest deviations of each course from the bottom up; selected, not computed."""
    walls, levels, gaps = generatrix_rows(inspection), place_rows(inspection), inspection["gaps"]
    numbers = {row["course"] for row in (*walls, *levels, *gaps)}
    return [_course_row(number, walls, levels, gaps) for number in sorted(numbers)]


def _course_row(number, walls, levels, gaps):
    """Largest deviations and gaps of a course."""
    wall, level, gaps = (
        [item for item in rows if item["course"] == number] for rows in (walls, levels, gaps)
    )
    row = {"course": number}
    if wall:
        row["plumb_least"] = min(item["plumb"] for item in wall)
        row["plumb_most"] = max(item["plumb"] for item in wall)
        row["plumb_U"] = max(item["U"] for item in wall)
    if level:
        worst = max(level, key=lambda item: abs(item["departure"]))
        row |= {"round_worst": worst["departure"], "round_U": worst["U"]}
    for kind in ("peaking", "banding"):
        known = [item["gap_mm"] for item in gaps if item["kind"] == kind]
        known = [item for item in known if item is not None]
        row |= {kind: max(known, key=abs)} if known else {}
    return row


def select_largest_gaps(inspection, kind, most=MOST_GAPS):
    """Select the largest determined gaps of a kind, the largest first."""
    known = [gap for gap in inspection["gaps"] if gap["kind"] == kind and gap["gap_mm"] is not None]
    return sorted(known, key=lambda gap: -abs(gap["gap_mm"]))[:most]


def point_rows(inspection):
    """All points of all epochs and differences."""
    return [
        {"epoch": epoch_name(settlement)} | point
        for settlement in inspection["settlements"]
        for point in settlement["points"]
    ]


def plane_rows(inspection):
    """Planes of all epochs and differences."""
    return [
        settlement | {"epoch": epoch_name(settlement)} for settlement in inspection["settlements"]
    ]


def reading_rows(inspection):
    """All readings of the profiles of the edge."""
    return [
        {"azimuth_deg": profile["azimuth_deg"], "radius_m": radius, "z": z}
        for profile in inspection["edges"]
        for radius, z in zip(profile["radius_m"], profile["z_mm"], strict=True)
    ]
