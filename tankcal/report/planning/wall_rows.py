"""Tables of the field sheets of a plan of the bare wall: one row per reading, and the columns."""

import datetime

import numpy as np

from tankcal.planning.wall.changes import instruments_in_use
from tankcal.planning.wall.nominal_readings import place_stations
from tankcal.planning.wall.reading import lengths_of_bars, tables_of
from tankcal.report.plain import Column
from tankcal.report.planning.rows import BASES, INSTRUMENTS
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
DIP = Column("dip_m", "m", height=True, heading="dip")
RUNS = (
    Column("run"), Column("meter"), DIP, Column("batch_m3", "m3", decimals=2),
    Column("volume_read", **SHORT), Column("dip_read", **SHORT),
    Column("meter_c", nothing="_" * 5, words="marks"),
    Column("tank_c", nothing="_" * 5, words="marks"),
    Column("shell_c", nothing="_" * 5, words="marks"), Column("time", **SHORT),
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
    """Return {name: (rows, columns)} of all tables of the field sheets that have rows."""
    planned, tables = {part.section for part in plan.design.parts}, {}
    for section, tables_of_section in _TABLES_OF_SECTIONS.items():
        if section in planned:
            tables |= tables_of_section(plan)
    tables["instruments"] = _instruments(plan), INSTRUMENTS
    return {name: table for name, table in tables.items() if table[0]}


_TABLES_OF_SECTIONS = {  # {section of plan.toml: function that returns its tables}
    "straps": lambda plan: {"circumferences": (_straps(plan), STRAPS)},
    "lines": lambda plan: {
        "sight_lines": (_lines(plan), LINES),
        "offsets": (_offsets(plan), OFFSETS),
        "offset_readings": (_offset_readings(plan), _columns_of_offsets(plan)),
    },
    "hits": lambda plan: {
        "hit_setups": (_setups(plan), SETUPS),
        "hit_levels": (_hits(plan), HITS),
        "shared_targets": (_ties(plan), TIES),
        "control_targets": (_control(plan), CONTROL),
    },
    "tangents": lambda plan: {
        "tangent_stations": (_stations(plan), STANDS),
        "traverse": (_traverse(plan), _columns_of_traverse(plan)),
        "bases": (_bases(plan), BASES),
        "tangents": (_tangents(plan), TANGENTS),
    },
    "runs": lambda plan: {"runs": (rows_of_runs(plan), RUNS)},
}


def _feet(plan):
    """Return {course: height of its lower edge above the table's zero, m}."""
    courses = plan.job.courses
    heights = np.cumsum([0.0] + [course.height_m for course in courses])
    zero = plan.job.datum.plate_level_m
    return {course.name: low - zero for course, low in zip(courses, heights, strict=False)}


def _straps(plan):
    feet, count, rows = _feet(plan), {}, []
    for strap in plan.job.strapping.straps:
        count[strap.name] = count.get(strap.name, 0) + 1
        rows.append(
            {
                "circumference": strap.name,
                "course": strap.course,
                "height_in_course_m": strap.level_m - feet[strap.course],
                "level_m": strap.level_m,
                "expected_m": strap.reading_m,
                "sd_m": strap.sd_m,
                "instrument": strap.tape,
                "reading": count[strap.name],
            }
        )
    return rows


def _lines(plan):
    return [
        {"line": line.name, "azimuth_rad": line.azimuth_rad, "instrument": line.instrument}
        for line in plan.job.lines.lines.values()
    ]


def _offsets(plan):
    """Return a row for each level, with the number of its readings on each line."""
    feet, rows = _feet(plan), {}
    for offset in plan.job.lines.offsets:
        rows.setdefault(
            (offset.course, offset.level_m),
            {
                "course": offset.course,
                "height_in_course_m": offset.level_m - feet[offset.course],
                "level_m": offset.level_m,
                "reference": "reference" if offset.reference else None,
                "readings": plan.design.lines.faces * plan.design.lines.readings,
                "sd_m": offset.sd_m,
            },
        )
    return list(rows.values())


def _offset_readings(plan):
    """Return a row for each reading of a level on a line in the first face."""
    count, rows = {}, []
    for offset in plan.job.lines.offsets:
        if offset.face == 1:
            place = offset.line, offset.course, offset.level_m
            count[place] = count.get(place, 0) + 1
            rows.append(
                {
                    "line": offset.line,
                    "course": offset.course,
                    "level_m": offset.level_m,
                    "reference": "reference" if offset.reference else None,
                    "reading": count[place],
                }
            )
    return rows


def _columns_of_offsets(plan):
    """Return OFFSET_READINGS without the second face or the number of a reading if not needed."""
    lines = plan.design.lines
    omitted = {"face_2"} if lines.faces == 1 else set()
    omitted |= {"reading"} if lines.readings == 1 else set()
    return tuple(column for column in OFFSET_READINGS if column.key not in omitted)


def _instruments(plan):
    """Return a row for each instrument in use and each master of a tape, from instruments.toml."""
    register = plan.raw.registers.get("instruments")
    used, rows = instruments_in_use(plan.job), []
    for name, entry in {} if register is None else register.entries.items():
        values = {key: value.raw for key, value in entry.items()}
        scale = values.get("u_scale_ppm")
        if name in used:
            rows.append(
                {
                    "instrument": name,
                    "kind": str(values.get("kind", "")).strip().lower(),
                    "certificate": str(values.get("certificate", "")),
                    "u_scale": scale / 1e6 if isinstance(scale, int | float) and scale else None,
                }
            )
    return rows


def _polar(x, y):
    """Return azimuth and distance of a position from the axis of the tank."""
    azimuth = np.arctan2(x, y) % (2 * np.pi)
    return {"azimuth_rad": float(azimuth), "from_axis_m": float(np.hypot(x, y))}


def _setups(plan):
    hits, rows = plan.job.hits, []
    for name, setup in hits.setups.items():
        x, y, _ = hits.stations[setup.station]
        rows.append(
            {
                "setup": name,
                **_polar(x, y),
                "height_m": setup.height_m,
                "instrument": setup.instrument,
            }
        )
    return rows


def _hits(plan):
    """Return a row for each level, with the number of its set-ups and of the hits of each."""
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
    """Return a row for each reading of a control target, with its time after the first reading."""
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


def _stations(plan):
    """Return a row for each station of a traverse, with the distance to its neighbours."""
    places = place_stations(plan.job)
    to_neighbour = {row["setup"]: row["expected_m"] for row in _traverse(plan)}
    return [
        {
            "setup": name,
            **_polar(*places[name][:2]),
            "height_m": setup.height_m,
            "expected_m": to_neighbour[name],
            "instrument": setup.instrument,
        }
        for name, setup in plan.job.tangents.setups.items()
    ]


def _readings_of_traverse(plan):
    """Return {table: Readings} between neighbouring stations, all in one order."""
    return {readings.table: readings for readings in plan.job.measurements.readings}


def _traverse(plan):
    """Return a row for each sight between neighbouring stations."""
    read = _readings_of_traverse(plan)
    directions, distances = read["directions"], read.get("slope_distances") or read["distances"]
    sights = zip(directions.setup, directions.end, distances.value, strict=True)
    return [{"setup": name, "to": end, "expected_m": float(m)} for name, end, m in sights]


def _columns_of_traverse(plan):
    """Return TRAVERSE, without distances if only a stadia determines them."""
    is_ranged = plan.design.tangents.traverse[0] is not None
    return tuple(column for column in TRAVERSE if is_ranged or column.key != "distance")


def _bases(plan):
    """Return a row for each angle between the ends of a stadia over a neighbouring station."""
    ring = plan.design.tangents
    if ring.bar is None:
        return []
    read, lengths = _readings_of_traverse(plan)["distances"], lengths_of_bars(plan.raw)
    sights = zip(_traverse(plan), read.value, read.instrument, strict=True)
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
        for row, base, bar in sights
    ]


def _tangents(plan):
    tangents, feet = plan.job.tangents, _feet(plan)
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
    """Return a row for each target that neighbouring set-ups share."""
    setups_of = {}
    for readings in plan.job.network.readings:
        for setup, target in zip(readings.setup or (), readings.end, strict=True):
            setups_of.setdefault(target, {}).setdefault(setup)
    return [{"point": name, "setup": ", ".join(setups)} for name, setups in setups_of.items()]


def rows_of_runs(plan):
    """Return a row for each dip of each run, with the expected batch before it."""
    metering, rows = plan.job.liquid, []
    for place in range(0 if metering is None else len(metering)):
        run, dip = metering.run[place], float(metering.dip_m[place])
        is_first, is_dry = place == 0 or metering.run[place - 1] != run, np.isnan(dip)
        rows.append(
            {
                "run": run,
                "meter": metering.meter[place],
                "dip_m": None if is_dry else dip,
                "batch_m3": None if is_first else float(metering.volume_m3[place]),
                "volume_read": "start" if is_first else None,
                "dip_read": "dry" if is_dry else None,
            }
        )
    return rows


def courses_of(prediction):
    """Return a row for each course: its readings, and the standard deviation of its mean radius."""
    return [
        {
            "course": course.name,
            "straps": course.straps or None,
            "offsets": course.offsets or None,
            "hits": course.hits or None,
            "tangents": course.tangents or None,
            "radius_m": course.radius_sd_m,
        }
        for course in prediction.courses
    ]
