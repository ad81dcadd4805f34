"""Tables of the field sheets of a plan of targets: rows and columns, for paper and workbook.

Lengths are in metres, angles in radians. A text that is a code is looked up in the words.
"""

import numpy as np

from tankcal.camera.model import PARAMETERS
from tankcal.geometry.rotations import view_of_rotation
from tankcal.planning.places import angle_of_base_rad, base_m, joints_m, place_of
from tankcal.planning.wall.model import WallPlan
from tankcal.report.plain import Column

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
