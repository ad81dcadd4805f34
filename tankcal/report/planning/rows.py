"""Tables of the field sheets of a plan: rows and columns, for paper, CSV files and workbook.

Lengths are in metres, angles in radians. A text that is a code is looked up in the words.
"""

import datetime

import numpy as np

from tankcal.camera.model import PARAMETERS
from tankcal.geometry.rotations import view_of_rotation
from tankcal.planning.model import WallPlan
from tankcal.planning.places import angle_of_base_rad, base_m, joints_m, place_of
from tankcal.planning.wall.changes import instruments_in_use
from tankcal.planning.wall.nominal_readings import place_stations
from tankcal.planning.wall.reading import lengths_of_bars, tables_of
from tankcal.report.plain import Column
from tankcal.survey.measurements import angle_of_distance_rad

ARC, OFF, HEIGHT = (Column(key, "m", decimals=3) for key in ("arc_m", "off_m", "height_m"))
AZIMUTH = Column("azimuth_rad", "rad deg", decimals=1)
IN_COURSE = Column("height_in_course_m", "m", decimals=3)
POINT, DONE = Column("point"), Column("done", nothing="____", words="marks")
LEVELS = (Column("row"), Column("course"), IN_COURSE, HEIGHT, Column("targets", decimals=0))
LINES = (Column("line"), ARC)
TARGETS = (POINT, Column("course"), IN_COURSE, HEIGHT, ARC, DONE)
OTHERS = (POINT, ARC, OFF, HEIGHT, DONE)
STATIONS = (
    Column("station"), ARC, OFF, HEIGHT, AZIMUTH, Column("camera"),
    Column("photographs", decimals=0), Column("rolls"),
)  # fmt: skip
PHOTOGRAPHS = (
    Column("photo"), Column("station"), Column("turn_rad", "rad deg", decimals=1),
    Column("tilt_rad", "rad deg", decimals=1), Column("roll_rad", "rad deg", decimals=0),
    Column("points", decimals=0), Column("file", nothing="_" * 12), DONE,
)  # fmt: skip
SETUPS = (
    Column("setup"), ARC, OFF, HEIGHT, Column("instrument"), Column("sets", decimals=0),
    Column("points", decimals=0), Column("sights"),
    Column("direction_sd_rad", "rad arcsec", decimals=1),
    Column("zenith_sd_rad", "rad arcsec", decimals=1), Column("distance_sd_m", "mm", decimals=1),
)  # fmt: skip
TIES = (
    Column("tape"), Column("what", words="ties"), Column("from"), Column("to"),
    Column("expected_m", "m", decimals=2), Column("sd_m", "mm", decimals=1),
    Column("instrument"), Column("reading", decimals=0),
    Column("value", nothing="_" * 14, words="marks"), Column("temperature", nothing="_" * 6),
)  # fmt: skip
BASES = (
    Column("setup"), Column("to"), Column("bar"),
    Column("expected_m", "m", decimals=2, heading="base"),
    Column("expected_rad", "rad deg", decimals=3, heading="expected_m"),
    Column("angle_sd_rad", "rad arcsec", decimals=1, heading="sd_m"),
    Column("reading", decimals=0), Column("value", nothing="_" * 14, words="marks"),
)  # fmt: skip
CONTROL = (
    POINT, ARC, OFF, HEIGHT, Column("sx_m", "mm", decimals=1), Column("sy_m", "mm", decimals=1),
    Column("sz_m", "mm", decimals=1),
)  # fmt: skip
CAMERAS = (
    Column("camera"), Column("width_mm", "image mm", decimals=1),
    Column("height_mm", "image mm", decimals=1), Column("c_mm", "image mm", decimals=2),
    Column("photographs", decimals=0), Column("readings", decimals=0),
    Column("sd_mm", "image um", decimals=1),
)  # fmt: skip
INSTRUMENTS = (
    Column("instrument"), Column("kind", words="instruments"), Column("certificate"),
    Column("u_scale", "share ppm", digits=3),
)  # fmt: skip
LEVEL = 0.01  # largest slope of a level line, and of an upright line from the vertical
SD_KEYS = ("direction_sd_rad", "zenith_sd_rad", "distance_sd_m")


def field_tables(prediction):
    """Return {name: (rows, columns)} of all tables of the field sheets that have rows."""
    plan = prediction.plan
    tables = {
        "levels": (levels(prediction), LEVELS),
        "lines": (lines(prediction), LINES),
        "targets": (targets(prediction), TARGETS),
        "others": (others(prediction), OTHERS),
        "stations": (stations(plan), STATIONS),
        "photographs": (photographs(prediction), PHOTOGRAPHS),
        "setups": (setups(prediction), SETUPS),
        "ties": (ties(prediction), TIES),
        "bases": (bases(prediction), BASES),
        "control": (control(plan), CONTROL),
        "cameras": (cameras(plan), CAMERAS),
        "instruments": (instruments(plan), INSTRUMENTS),
    }
    return {name: table for name, table in tables.items() if table[0]}


def lost_points(prediction):
    """Names of the points that the planned survey does not determine."""
    return {point.name for point in prediction.undetermined}


def lost_ties(prediction):
    """Names of tapes, levelled heights and plumb lines with an undetermined end."""
    lost = lost_points(prediction)
    return {tie.name for tie in prediction.plan.ties if {tie.start, tie.end} & lost}


def targets(prediction):
    """Return a row for each target, with its height above the bottom of its course and its arc."""
    plan, lost = prediction.plan, lost_points(prediction)
    planned, joints = plan.targets, joints_m(plan)
    columns = zip(
        planned.names, planned.section, planned.generatrix, planned.course.tolist(),
        planned.height_m.tolist(), planned.arc_m.tolist(), strict=True,
    )  # fmt: skip
    return [
        {
            "point": name,
            "row": section,
            "line": line,
            "course": plan.job.courses[course].name,
            "height_in_course_m": height - float(joints[course]),
            "height_m": height,
            "arc_m": arc,
            "done": "unseen" if name in lost else None,
        }
        for name, section, line, course, height, arc in columns
    ]


def levels(prediction):
    """Return the rows of targets on the wall with their numbers of targets, from the bottom up."""
    by_row = {}
    for target in targets(prediction):
        by_row.setdefault(target["row"], target | {"targets": 0})["targets"] += 1
    return sorted(by_row.values(), key=lambda level: level["height_m"])


def lines(prediction):
    """Return the vertical lines of targets by their arcs; a bent line is listed at each arc."""
    by_arc = {(target["line"], round(target["arc_m"], 4)): target for target in targets(prediction)}
    return sorted(by_arc.values(), key=lambda line: line["arc_m"])


def others(prediction):
    """Return a row for each point that is no target: tape ends, marks, control off the wall."""
    plan, lost = prediction.plan, lost_points(prediction)
    setup_names = {setup.name for setup in plan.setups}
    return [
        {"point": name, "done": "unseen" if name in lost else None} | vars(place_of(plan, xyz))
        for name, xyz in plan.extra.items()
        if name not in setup_names
    ]


def stations(plan):
    """Return a row for each photo station, with its exposures and the rolls of the camera."""
    rows = []
    for name in plan.stations:
        exposures = [photo for photo in plan.photos if photo.station == name]
        rolls = dict.fromkeys(
            round(np.degrees(float(_angles(plan, photo)[2]))) for photo in exposures
        )
        first = exposures[0]
        row = {"station": name, "camera": first.camera, "photographs": len(exposures)}
        row["rolls"] = ", ".join(f"{roll}°" for roll in rolls)
        rows.append(row | vars(place_of(plan, first.xyz_m)))
    return rows


def photographs(prediction):
    """Return a row for each exposure, with its orientation and the number of visible points."""
    plan, rows = prediction.plan, []
    for photo, seen in zip(plan.photos, prediction.visibility.on_photo, strict=True):
        turn, tilt, roll = map(float, _angles(plan, photo))
        rows.append(
            {
                "photo": photo.name, "station": photo.station, "camera": photo.camera,
                "turn_rad": turn, "tilt_rad": tilt, "roll_rad": roll,
                "points": int(seen.sum()), "readings": photo.readings, "done": None,
            }
        )  # fmt: skip
    return rows


def _angles(plan, photo):
    """Turn to the right of the axis of the tank, tilt and roll of a photograph, rad."""
    azimuth, tilt, roll = view_of_rotation(photo.rotation)
    east, north = plan.shell.axis_m - photo.xyz_m[:2]
    turn = np.angle(np.exp(1j * (azimuth - np.arctan2(east, north))))
    return turn, tilt, roll


def setups(prediction):
    """Return a row for each set-up of a total station, with the other set-ups in sight."""
    plan = prediction.plan
    number = {name: i for i, name in enumerate(prediction.visibility.points)}
    return [
        {
            "setup": setup.name, "instrument": setup.instrument, "sets": setup.sets,
            "sights": [name for name in setup.sights if seen[number[name]]] or None,
            "points": int(seen.sum()),
        }
        | {key: getattr(setup, key) for key in SD_KEYS}
        | vars(place_of(plan, setup.xyz_m))
        for setup, seen in zip(plan.setups, prediction.visibility.on_setup, strict=True)
    ]  # fmt: skip


def ties(prediction):
    """Return a row for each reading of a tape, a levelled height or a plumb line."""
    plan, lost = prediction.plan, lost_ties(prediction)
    rows, points = [], plan.points
    for tie in plan.ties:
        rise = points[tie.end] - points[tie.start]
        row = {
            "tape": tie.name, "what": _kind_of_tie(tie, rise), "from": tie.start, "to": tie.end,
            "expected_m": _expected_m(tie, rise), "sd_m": tie.sd_m,
            "instrument": tie.instrument or "",
            "temperature": None if tie.table == "distances" else "",
            "value": "on_one_line" if tie.table == "plumb_lines" else None,
        }  # fmt: skip
        if tie.name in lost:
            row |= {"temperature": "", "value": "unseen_end"}
        rows += [row | {"reading": number} for number in range(1, tie.readings + 1)]
    return rows


def _kind_of_tie(tie, rise):
    if tie.table != "distances":
        return tie.table
    if tie.kind == "horizontal":
        return "horizontal"
    flat, high = np.hypot(rise[0], rise[1]), abs(rise[2])
    if flat < LEVEL * high:
        return "upright"
    return "level" if high < LEVEL * flat else "spatial"


def _expected_m(tie, rise):
    if tie.table == "plumb_lines":
        return None
    if tie.table == "height_differences":
        return float(rise[2])
    return float(np.linalg.norm(rise[:2] if tie.kind == "horizontal" else rise))


def bases(prediction):
    """Return a row for each reading of the angle between the ends of a stadia."""
    plan, lost = prediction.plan, lost_points(prediction)
    return [
        {
            "setup": base.setup,
            "to": base.to,
            "bar": base.bar,
            "expected_m": base_m(plan, base),
            "expected_rad": angle_of_base_rad(plan, base),
            "angle_sd_rad": base.angle_sd_rad,
            "reading": number,
            "value": "unseen_end" if {base.setup, base.to} & lost else None,
        }
        for base in plan.bases
        for number in range(1, base.readings + 1)
    ]


def control(plan):
    """Return a row for each control point, with the sds that its coordinates require.

    An sd of 0 means held exactly, None not required.
    """
    return [
        {"point": known.name}
        | {
            f"s{axis}_m": float(sd) if np.isfinite(sd) else None
            for axis, sd in zip("xyz", known.sd_m, strict=True)
        }
        | vars(place_of(plan, known.xyz_m))
        for known in plan.known
    ]


def cameras(plan):
    """Return a row for each camera that takes photographs."""
    rows, c = [], PARAMETERS.index("c")
    for setup in plan.job.measurements.cameras:
        camera = setup.camera
        photos = [photo for photo in plan.photos if photo.camera == camera.name]
        if photos:
            width, height = setup.format_mm.tolist()
            rows.append(
                {
                    "camera": camera.name, "width_mm": width, "height_mm": height,
                    "c_mm": float(camera.values[c]), "photographs": len(photos),
                    "sd_mm": max(photo.sd_mm for photo in photos),
                    "readings": max(photo.readings for photo in photos),
                }
            )  # fmt: skip
    return rows


def instruments(plan):
    """Return a row for each instrument in use, with its certificate."""
    used = {item.instrument for item in (*plan.ties, *plan.setups)}
    used |= {base.bar for base in plan.bases}
    return [
        {
            "instrument": tool.name,
            "kind": tool.kind,
            "certificate": str(tool.details.get("certificate", "")),
            "u_scale": tool.u_scale if tool.u_scale and np.isfinite(tool.u_scale) else None,
        }
        for tool in plan.job.measurements.instruments
        if tool.name in used
    ]


def place_of_change(change):
    """Return the position {key: m} of the item that a `Change` adds; {} if it has no position.

    The position of a tape is its middle in plan and the height of its lowest end.
    """
    plan, name = change.plan, change.name
    if isinstance(plan, WallPlan) or change.action != "add":
        return {}
    if change.item == "photo_station":
        xyz = next(photo.xyz_m for photo in plan.photos if photo.station == name)
    elif change.item == "setup":
        xyz = find_by_name(plan.setups, name).xyz_m
    elif change.item == "control_point":
        xyz = find_by_name(plan.known, name).xyz_m
    elif change.item == "tape":
        tie = find_by_name(plan.ties, name)
        ends = np.array([plan.points[tie.start], plan.points[tie.end]])
        xyz = np.array([*ends[:, :2].mean(axis=0), ends[:, 2].min()])
    else:
        return {}
    return vars(place_of(plan, xyz))


def find_by_name(items, name):
    """Return the first item of a name, or None."""
    return next((item for item in items if item.name == name), None)


WALL_HEIGHT = Column("height_m", "m", decimals=3)
WALL_LEVEL = Column("level_m", "m", decimals=3)
COURSE, COUNT = Column("course"), Column("readings", decimals=0)
INSTRUMENT, AS_READ = Column("instrument"), Column("value", nothing="_" * 14, words="marks")
BY_PEN = {"nothing": "_" * 11, "words": "marks"}  # filled in on site
SHORT = BY_PEN | {"nothing": "_" * 8}
SD = Column("sd_m", "mm", decimals=2)
SD_ARCSEC = Column("sd_rad", "rad arcsec", decimals=1, heading="sd_m")
STRAPS = (
    Column("circumference"), COURSE, IN_COURSE, WALL_LEVEL, Column("expected_m", "m", decimals=3),
    SD, INSTRUMENT, Column("reading", decimals=0), AS_READ, Column("temperature", nothing="_" * 6),
)  # fmt: skip
WALL_LINES = (Column("line"), AZIMUTH, INSTRUMENT)
OFFSET_READINGS = (
    Column("line"), COURSE, WALL_LEVEL, Column("reference", words="marks"),
    Column("reading", decimals=0), Column("face_1", **SHORT), Column("face_2", **SHORT),
)  # fmt: skip
OFFSETS = (COURSE, IN_COURSE, WALL_LEVEL, Column("reference", words="marks"), COUNT, SD)
WALL_SETUPS = (
    Column("setup"), AZIMUTH, Column("from_axis_m", "m", decimals=2), WALL_HEIGHT, INSTRUMENT,
)  # fmt: skip
HITS = (COURSE, IN_COURSE, WALL_HEIGHT, Column("setups", decimals=0), Column("hits", decimals=0))
WALL_TIES = (Column("point"), Column("setup"))
WALL_CONTROL = (
    Column("setup"), Column("point"), Column("after_min", decimals=0), Column("time", **BY_PEN),
    Column("direction", **BY_PEN), Column("zenith", **BY_PEN), Column("distance", **BY_PEN),
)  # fmt: skip
STANDS = (
    *WALL_SETUPS[:-1],
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
    Column("setup"), COURSE, IN_COURSE, WALL_LEVEL, Column("side", words="marks"),
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
        "sight_lines": (_lines(plan), WALL_LINES),
        "offsets": (_offsets(plan), OFFSETS),
        "offset_readings": (_offset_readings(plan), _columns_of_offsets(plan)),
    },
    "hits": lambda plan: {
        "hit_setups": (_setups(plan), WALL_SETUPS),
        "hit_levels": (_hits(plan), HITS),
        "shared_targets": (_ties(plan), WALL_TIES),
        "control_targets": (_control(plan), WALL_CONTROL),
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
