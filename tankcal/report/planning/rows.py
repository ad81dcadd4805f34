"""What has to be marked, set up, taken and read, row by row: the same on paper and in sheets.

Lengths are metres, angles radians; a text that is a code is looked up in words.
"""

import numpy as np

from tankcal.camera.model import PARAMETERS
from tankcal.geometry.rotations import view_of_rotation
from tankcal.planning.bases import angle_of_base_rad, base_m
from tankcal.planning.places import joints_m, place_of
from tankcal.planning.wall.model import WallPlan

LEVEL = 0.01  # rise over run, or run over rise, of what is called level or upright
SD_KEYS = ("direction_sd_rad", "zenith_sd_rad", "distance_sd_m")


def lost_points(prediction):
    """Names of the points that the planned survey does not determine."""
    return {one.name for one in prediction.undetermined}


def lost_ties(prediction):
    """Names of tapes, levelled heights and plumb lines with an end that is not determined."""
    lost = lost_points(prediction)
    return {one.name for one in prediction.plan.ties if {one.start, one.end} & lost}


def targets(prediction):
    """Every target, with its height above the bottom of its course and its arc."""
    plan, lost = prediction.plan, lost_points(prediction)
    found, joints = plan.targets, joints_m(plan)
    columns = zip(
        found.names, found.section, found.generatrix, found.course.tolist(),
        found.height_m.tolist(), found.arc_m.tolist(), strict=True,
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
    """The rows of targets, from the bottom up."""
    found = {}
    for one in targets(prediction):
        found.setdefault(one["row"], one | {"targets": 0})["targets"] += 1
    return sorted(found.values(), key=lambda one: one["height_m"])


def lines(prediction):
    """The vertical lines of targets, by their arcs; a line that bends is there at each arc."""
    found = {(one["line"], round(one["arc_m"], 4)): one for one in targets(prediction)}
    return sorted(found.values(), key=lambda one: one["arc_m"])


def others(prediction):
    """Points that are no targets: ends of tapes, marks, control off the wall."""
    plan, lost = prediction.plan, lost_points(prediction)
    setups = {one.name for one in plan.setups}
    return [
        {"point": name, "done": "unseen" if name in lost else None} | _at(plan, xyz)
        for name, xyz in plan.extra.items()
        if name not in setups
    ]


def _at(plan, xyz_m):
    place = place_of(plan, xyz_m)
    return {
        "arc_m": place.arc_m,
        "azimuth_rad": place.azimuth_rad,
        "off_m": place.off_m,
        "height_m": place.height_m,
    }


def stations(plan):
    """Photo stations, with the number of exposures and the turns about the camera's axis."""
    found = []
    for name in plan.stations:
        mine = [one for one in plan.photos if one.station == name]
        rolls = dict.fromkeys(round(np.degrees(float(_angles(plan, one)[2]))) for one in mine)
        row = {"station": name, "camera": mine[0].camera, "photographs": len(mine)}
        rolled = ", ".join(f"{roll}°" for roll in rolls)
        found.append(row | {"rolls": rolled} | _at(plan, mine[0].xyz_m))
    return found


def photographs(prediction):
    """Every exposure: where it points to, how it is rolled, how many points it should show."""
    plan, found = prediction.plan, []
    for one, seen in zip(plan.photos, prediction.seen.on_photo, strict=True):
        turn, tilt, roll = map(float, _angles(plan, one))
        found.append(
            {
                "photo": one.name, "station": one.station, "camera": one.camera,
                "turn_rad": turn, "tilt_rad": tilt, "roll_rad": roll,
                "points": int(seen.sum()), "readings": one.readings, "done": None,
            }
        )  # fmt: skip
    return found


def _angles(plan, photo):
    """Turn to the right of the axis of the tank, tilt, roll, rad."""
    azimuth, tilt, roll = view_of_rotation(photo.rotation)
    east, north = plan.shell.axis_m - photo.xyz_m[:2]
    turn = np.angle(np.exp(1j * (azimuth - np.arctan2(east, north))))
    return turn, tilt, roll


def setups(prediction):
    """Set-ups of total stations, and which others each can sight."""
    plan = prediction.plan
    number = {name: i for i, name in enumerate(prediction.seen.points)}
    return [
        {
            "setup": one.name, "instrument": one.instrument, "sets": one.sets,
            "sights": [name for name in one.sights if seen[number[name]]] or None,
            "points": int(seen.sum()),
        }
        | {key: getattr(one, key) for key in SD_KEYS}
        | _at(plan, one.xyz_m)
        for one, seen in zip(plan.setups, prediction.seen.on_setup, strict=True)
    ]  # fmt: skip


def ties(prediction):
    """Tapes, levelled heights and plumb lines, a row for each reading."""
    plan, lost = prediction.plan, lost_ties(prediction)
    found, points = [], plan.points
    for one in plan.ties:
        rise = points[one.end] - points[one.start]
        row = {
            "tape": one.name, "what": _kind(one, rise), "from": one.start, "to": one.end,
            "expected_m": _expected(one, rise), "sd_m": one.sd_m,
            "instrument": one.instrument or "",
            "temperature": None if one.table == "distances" else "",
            "value": "on_one_line" if one.table == "plumb_lines" else None,
        }  # fmt: skip
        if one.name in lost:
            row |= {"temperature": "", "value": "unseen_end"}
        found += [row | {"reading": number} for number in range(1, one.readings + 1)]
    return found


def bases(prediction):
    """Angles to the ends of a stadia, a row for each reading."""
    plan, lost = prediction.plan, lost_points(prediction)
    return [
        {
            "setup": one.setup,
            "to": one.to,
            "bar": one.bar,
            "expected_m": base_m(plan, one),
            "expected_rad": angle_of_base_rad(plan, one),
            "angle_sd_rad": one.angle_sd_rad,
            "reading": number,
            "value": "unseen_end" if {one.setup, one.to} & lost else None,
        }
        for one in plan.bases
        for number in range(1, one.readings + 1)
    ]


def _kind(tie, rise):
    if tie.table != "distances":
        return tie.table
    if tie.kind == "horizontal":
        return "horizontal"
    flat, high = np.hypot(rise[0], rise[1]), abs(rise[2])
    if flat < LEVEL * high:
        return "upright"
    return "level" if high < LEVEL * flat else "spatial"


def _expected(tie, rise):
    if tie.table == "plumb_lines":
        return None
    if tie.table == "height_differences":
        return float(rise[2])
    return float(np.linalg.norm(rise[:2] if tie.kind == "horizontal" else rise))


def control(plan):
    """Control points, with the sds that their coordinates need; 0: held, None: not needed."""
    return [
        {"point": one.name}
        | {
            f"s{axis}_m": float(sd) if np.isfinite(sd) else None
            for axis, sd in zip("xyz", one.sd_m, strict=True)
        }
        | _at(plan, one.xyz_m)
        for one in plan.known
    ]


def cameras(plan):
    """Cameras that take photographs."""
    found, c = [], PARAMETERS.index("c")
    for one in plan.job.measurements.cameras:
        mine = [photo for photo in plan.photos if photo.camera == one.camera.name]
        if mine:
            width, height = one.format_mm.tolist()
            found.append(
                {
                    "camera": one.camera.name, "width_mm": width, "height_mm": height,
                    "c_mm": float(one.camera.values[c]), "photographs": len(mine),
                    "sd_mm": max(photo.sd_mm for photo in mine),
                    "readings": max(photo.readings for photo in mine),
                }
            )  # fmt: skip
    return found


def instruments(plan):
    """Instruments that measure something, with their certificates."""
    used = {one.instrument for one in (*plan.ties, *plan.setups)} | {one.bar for one in plan.bases}
    return [
        {
            "instrument": one.name,
            "kind": one.kind,
            "certificate": str(one.details.get("certificate", "")),
            "u_scale": one.u_scale if one.u_scale and np.isfinite(one.u_scale) else None,
        }
        for one in plan.job.measurements.instruments
        if one.name in used
    ]


def place_of_change(change):
    """Where what a `changes.Change` adds stands: {key: m}, {} for what has no single place.

    A tape hangs or lies about its middle; its height is that of its lowest end.
    """
    plan, name = change.plan, change.name
    of_wall = isinstance(plan, WallPlan)
    if of_wall or change.action != "add" or change.item not in _ADDED:
        return {}
    return _at(plan, _ADDED[change.item](plan, name))


def _of_tape(plan, name):
    tie = named(plan.ties, name)
    ends = np.array([plan.points[tie.start], plan.points[tie.end]])
    return np.array([*ends[:, :2].mean(axis=0), ends[:, 2].min()])


def named(found, name):
    """The first thing of that name, or None."""
    return next((one for one in found if one.name == name), None)


_ADDED = {
    "photo_station": lambda plan, name: next(
        one.xyz_m for one in plan.photos if one.station == name
    ),
    "setup": lambda plan, name: named(plan.setups, name).xyz_m,
    "control_point": lambda plan, name: named(plan.known, name).xyz_m,
    "tape": _of_tape,
}
