"""What a crew will read of a wall, row by row: straps, lines, offsets, hits, set-ups, tangents."""

import datetime

import numpy as np

from tankcal.planning.wall.changes import instruments_read
from tankcal.planning.wall.nominal_readings import place_stations
from tankcal.planning.wall.reading import lengths_of_bars, tables_of
from tankcal.report.plain import Column
from tankcal.report.planning.filling import RUNS, rows_of_runs
from tankcal.report.planning.tables import BASES, INSTRUMENTS
from tankcal.survey.stadia import angle_of_distance_rad

HEIGHT = Column("height_m", "m", decimals=3)
LEVEL = Column("level_m", "m", decimals=3)
IN_COURSE = Column("height_in_course_m", "m", decimals=3)
COURSE, COUNT = Column("course"), Column("readings", decimals=0)
AZIMUTH = Column("azimuth_rad", "rad deg", decimals=1)
INSTRUMENT, AS_READ = Column("instrument"), Column("value", nothing="_" * 14, words="marks")
BY_PEN = {"nothing": "_" * 11, "words": "marks"}  # filled in on site
SHORT = BY_PEN | {"nothing": "_" * 8}
SD = Column("sd_m", "mm", decimals=2)
SD_ARCSEC = Column("sd_rad", "rad arcsec", decimals=1, heading="sd_m")
STRAPS = (
    Column("circumference"), COURSE, IN_COURSE, LEVEL, Column("expected_m", "m", decimals=3), SD,
    INSTRUMENT, Column("reading", decimals=0), AS_READ, Column("temperature", nothing="_" * 6),
)  # fmt: skip
LINES = (Column("line"), AZIMUTH, INSTRUMENT)
OFFSET_READINGS = (
    Column("line"), COURSE, LEVEL, Column("reference", words="marks"),
    Column("reading", decimals=0), Column("face_1", **SHORT), Column("face_2", **SHORT),
)  # fmt: skip
OFFSETS = (COURSE, IN_COURSE, LEVEL, Column("reference", words="marks"), COUNT, SD)
SETUPS = (
    Column("setup"), AZIMUTH, Column("from_axis_m", "m", decimals=2), HEIGHT, INSTRUMENT,
)  # fmt: skip
HITS = (COURSE, IN_COURSE, HEIGHT, Column("setups", decimals=0), Column("hits", decimals=0))
TIES = (Column("point"), Column("setup"))
CONTROL = (
    Column("setup"), Column("point"), Column("after_min", decimals=0), Column("time", **BY_PEN),
    Column("direction", **BY_PEN), Column("zenith", **BY_PEN), Column("distance", **BY_PEN),
)  # fmt: skip
STANDS = (
    *SETUPS[:-1],
    Column("expected_m", "m", decimals=2, heading="from_neighbours"),
    INSTRUMENT,
)
TRAVERSE = (
    Column("setup"), Column("to"), Column("expected_m", "m", decimals=2),
    Column("direction", **BY_PEN), Column("zenith", **BY_PEN), Column("distance", **BY_PEN),
    Column("target_height", nothing="_" * 6, words="marks"),
)  # fmt: skip
TANGENTS = (
    Column("setup"), COURSE, IN_COURSE, LEVEL, Column("side", words="marks"),
    Column("expected_rad", "rad deg", decimals=2, heading="expected_zenith"), SD_ARCSEC,
    Column("direction", **BY_PEN), Column("zenith", **BY_PEN),
)  # fmt: skip
COURSES = (
    COURSE, Column("straps", decimals=0), Column("offsets", decimals=0), Column("hits", decimals=0),
    Column("tangents", decimals=0), Column("radius_m", "mm", digits=2),
)  # fmt: skip


def field_tables_of_wall(plan):
    """{name: (rows, columns)} of every table of the field sheets that has rows."""
    found = {
        "circumferences": (_straps(plan), STRAPS),
        "sight_lines": (_lines(plan), LINES),
        "offsets": (_offsets(plan), OFFSETS),
        "offset_readings": (_offset_readings(plan), _columns_of_offsets(plan)),
        "hit_setups": (_setups(plan), SETUPS),
        "hit_levels": (_hits(plan), HITS),
        "shared_targets": (_ties(plan), TIES),
        "control_targets": (_control(plan), CONTROL),
        "tangent_stations": (_stands(plan), STANDS),
        "traverse": (_traverse(plan), _columns_of_traverse(plan)),
        "bases": (_bases(plan), BASES),
        "tangents": (_tangents(plan), TANGENTS),
        "runs": (rows_of_runs(plan), RUNS),
        "instruments": (_instruments(plan), INSTRUMENTS),
    }
    return {name: table for name, table in found.items() if table[0]}


def _feet(plan):
    """{course: height of its lower edge above the table's zero}."""
    heights = np.cumsum([0.0] + [one.height_m for one in plan.job.courses])
    zero = plan.job.datum.plate_level_m
    return {one.name: low - zero for one, low in zip(plan.job.courses, heights, strict=False)}


def _straps(plan):
    given, feet, seen = plan.job.strapping, _feet(plan), {}
    rows = []
    for one in () if given is None else given.straps:
        seen[one.name] = seen.get(one.name, 0) + 1
        rows.append(
            {
                "circumference": one.name,
                "course": one.course,
                "height_in_course_m": one.level_m - feet[one.course],
                "level_m": one.level_m,
                "expected_m": one.reading_m,
                "sd_m": one.sd_m,
                "instrument": one.tape,
                "reading": seen[one.name],
            }
        )
    return rows


def _lines(plan):
    given = plan.job.lines
    return [
        {"line": one.name, "azimuth_rad": one.azimuth_rad, "instrument": one.instrument}
        for one in (() if given is None else given.lines.values())
    ]


def _offsets(plan):
    """Each level once, with how often it is read on each line."""
    given, feet, rows = plan.job.lines, _feet(plan), {}
    for one in () if given is None else given.offsets:
        rows.setdefault(
            (one.course, one.level_m),
            {
                "course": one.course,
                "height_in_course_m": one.level_m - feet[one.course],
                "level_m": one.level_m,
                "reference": "reference" if one.reference else None,
                "readings": plan.design.lines.faces * plan.design.lines.readings,
                "sd_m": one.sd_m,
            },
        )
    return list(rows.values())


def _offset_readings(plan):
    """Each level on each line, as often as one face reads it."""
    given, seen, rows = plan.job.lines, {}, []
    for one in () if given is None else given.offsets:
        if one.face == 1:
            place = one.line, one.course, one.level_m
            seen[place] = seen.get(place, 0) + 1
            rows.append(
                {
                    "line": one.line,
                    "course": one.course,
                    "level_m": one.level_m,
                    "reference": "reference" if one.reference else None,
                    "reading": seen[place],
                }
            )
    return rows


def _columns_of_offsets(plan):
    """Those of OFFSET_READINGS, without a second face or a number where there is one of them."""
    lines = plan.design.lines
    left_out = set()
    if lines is not None:
        left_out |= {"face_2"} if lines.faces == 1 else set()
        left_out |= {"reading"} if lines.readings == 1 else set()
    return tuple(one for one in OFFSET_READINGS if one.key not in left_out)


def _instruments(plan):
    """Instruments that read something, and the masters of tapes, as instruments.toml has them."""
    register = plan.given.registers.get("instruments")
    used, rows = instruments_read(plan.job), []
    for name, entry in {} if register is None else register.entries.items():
        given = {key: one.raw for key, one in entry.items()}
        scale = given.get("u_scale_ppm")
        if name in used:
            rows.append(
                {
                    "instrument": name,
                    "kind": str(given.get("kind", "")).strip().lower(),
                    "certificate": str(given.get("certificate", "")),
                    "u_scale": scale / 1e6 if isinstance(scale, int | float) and scale else None,
                }
            )
    return rows


def _setups(plan):
    hits = plan.job.hits
    rows = []
    for name, one in {} if hits is None else hits.setups.items():
        x, y, _ = hits.stations[one.station]
        rows.append(
            {
                "setup": name,
                "azimuth_rad": float(np.arctan2(x, y) % (2 * np.pi)),
                "from_axis_m": float(np.hypot(x, y)),
                "height_m": one.height_m,
                "instrument": one.instrument,
            }
        )
    return rows


def _hits(plan):
    """Each level once, with its set-ups and the hits of each."""
    rows, foot = [], 0.0
    for course in plan.job.courses:
        for ring in plan.design.hits:
            for percent in ring.at_percent if course.name in ring.courses else ():
                inner = percent / 100 * course.height_m
                rows.append(
                    {
                        "course": course.name,
                        "height_in_course_m": inner,
                        "height_m": foot + inner,
                        "setups": ring.setups,
                        "hits": ring.hits,
                    }
                )
        foot += course.height_m
    return rows


def _control(plan):
    """Each reading of a control target, and when it is due after the first."""
    table = tables_of(plan).get("control_readings")
    rows, first = [], {}
    for cells in () if table is None else table.rows:
        row = dict(zip(table.headings, cells, strict=True))
        time = datetime.datetime.fromisoformat(row["time"])
        since = time - first.setdefault(row["setup"], time)
        rows.append(
            {"setup": row["setup"], "point": row["target"], "after_min": since.seconds / 60}
        )
    return rows


def _stands(plan):
    tangents = plan.job.tangents
    if tangents is None:
        return []
    places = place_stations(plan.job)
    beside = {row["setup"]: row["expected_m"] for row in _traverse(plan)}
    return [
        {
            "setup": name,
            "azimuth_rad": float(np.arctan2(x, y) % (2 * np.pi)),
            "from_axis_m": float(np.hypot(x, y)),
            "height_m": tangents.setups[name].height_m,
            "expected_m": beside[name],
            "instrument": tangents.setups[name].instrument,
        }
        for name, (x, y, _) in places.items()
    ]


def _of_traverse(plan):
    """{table: Readings} between neighbouring stations, all in the same order."""
    return {one.table: one for one in plan.job.measurements.readings}


def _traverse(plan):
    """Each sight between neighbouring stations."""
    if plan.job.tangents is None:
        return []
    given = _of_traverse(plan)
    sighted, ranged = given["directions"], given.get("slope_distances") or given["distances"]
    pairs = zip(sighted.setup, sighted.end, ranged.value, strict=True)
    return [{"setup": name, "to": end, "expected_m": float(m)} for name, end, m in pairs]


def _columns_of_traverse(plan):
    """Those of TRAVERSE; without distances where a stadia alone tells them."""
    ring = plan.design.tangents
    is_ranged = ring is not None and ring.traverse[0] is not None
    return tuple(one for one in TRAVERSE if is_ranged or one.key != "distance")


def _bases(plan):
    """Each angle to the ends of a stadia over a neighbouring station."""
    ring = plan.design.tangents
    if ring is None or ring.bar is None:
        return []
    read, lengths = _of_traverse(plan)["distances"], lengths_of_bars(plan.given)
    pairs = zip(_traverse(plan), read.value, read.instrument, strict=True)
    return [
        {
            "setup": row["setup"],
            "to": row["to"],
            "bar": bar,
            "expected_m": float(base),
            "expected_rad": float(angle_of_distance_rad(base, lengths[bar])),
            "angle_sd_rad": np.radians(ring.bar[1] / 3600),
            "reading": 1,
        }
        for row, base, bar in pairs
    ]


def _tangents(plan):
    tangents, feet = plan.job.tangents, _feet(plan)
    if tangents is None:
        return []
    columns = (
        *(tangents.setup, tangents.course, tangents.level_m, tangents.is_right),
        *(tangents.zenith_rad, tangents.sd_rad),
    )
    return [
        {
            "setup": setup,
            "course": course,
            "height_in_course_m": level - feet[course],
            "level_m": level,
            "side": "right" if is_right else "left",
            "expected_rad": zenith,
            "sd_rad": sd,
        }
        for setup, course, level, is_right, zenith, sd in zip(*columns, strict=True)
    ]


def _ties(plan):
    found = {}
    measurements = None if plan.job.tangents is not None else plan.job.measurements
    for one in () if measurements is None else measurements.readings:
        for setup, target in zip(one.setup or (), one.end, strict=True):
            found.setdefault(target, dict.fromkeys(())).setdefault(setup)
    return [{"point": name, "setup": ", ".join(setups)} for name, setups in found.items()]


def courses_of(prediction):
    """A row for each course: its readings, and the standard deviation of its mean radius."""
    return [
        {
            "course": one.name,
            "straps": one.straps or None,
            "offsets": one.offsets or None,
            "hits": one.hits or None,
            "tangents": one.tangents or None,
            "radius_m": one.radius_sd_m,
        }
        for one in prediction.courses
    ]
