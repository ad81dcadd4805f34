"""Geometry of a plan: positions relative to the wall, and visibility of points.

A base is a distance from angles to a stadia over one station, read from another.

Visibility of points: inside the frame, incidence within the limit, line of sight free.

Also photographs and set-ups that see too little, and groups of set-ups that are not connected.

Obstacles to sight (boxes and vertical cylinders) and the lines of sight that they cut
--------------------------------------------------------------------------------------

A box cuts a line of sight from S to X if the slabs of its three axes overlap along the line. A
vertical cylinder cuts it if a part within the radius lies between bottom and top.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tankcal.camera.model import distort_image_points
from tankcal.job.checking import has_rows
from tankcal.job.checks.survey.readings import bars_used
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.planning.model import Base, Box, Pillar
from tankcal.quadrature import panels
from tankcal.survey.measurements import Readings, angle_of_distance_rad, distance_sd_m
from tankcal.units import ARCSEC

TOUCH_M = 0.02  # smallest distance between two target rows
ROUNDING_RAD = 1e-8  # rounding error of a full turn
STADIA_FILE = "stadia.csv"
NEW_SD_RAD = ARCSEC  # standard deviation of the angle of an added base if the plan has no base


@dataclass(frozen=True)
class Place:
    """A position relative to the tank.

    Attributes
    ----------
    arc_m : float
        Arc along the wall from the reference weld, clockwise seen from above.
    azimuth_rad : float
        Azimuth from the axis, clockwise from +y.
    off_m : float
        Distance from the wall, on the side of the survey.
    height_m : float
        Height above the bottom.
    """

    arc_m: float
    azimuth_rad: float
    off_m: float
    height_m: float


def place_of(plan, xyz_m):
    """Return the Place of a point.

    Parameters
    ----------
    plan : Plan
    xyz_m : array_like, shape (3,)
        Coordinates in the frame of the survey, m.
    """
    shell = plan.shell
    east, north = xyz_m[:2] - shell.axis_m
    azimuth = full_turn(np.arctan2(east, north))
    off = np.hypot(east, north) - wall_radius_m(plan, xyz_m[2] - shell.low_m)
    arc = full_turn(azimuth - reference_rad(plan)) * shell.radius_m
    height = float(xyz_m[2] - shell.low_m)
    return Place(float(arc), float(azimuth), float(off if shell.is_outside else -off), height)


def reference_rad(plan):
    """Azimuth of the reference weld: azimuth of a target minus its arc along the wall.

    Returns
    -------
    float
        rad, -pi to pi, clockwise from +y.
    """
    targets, shell = plan.targets, plan.shell
    east, north = targets.xyz_m[0, :2] - shell.axis_m
    azimuth = np.arctan2(east, north) - targets.arc_m[0] / shell.radius_m
    return float(np.angle(np.exp(1j * azimuth)))


def wall_radius_m(plan, height_m):
    """Radius of the wall on the side of the survey, m, at a height above the bottom."""
    courses, outside = plan.job.courses, plan.shell.is_outside
    course = courses[np.searchsorted(joints_m(plan)[1:-1], height_m, side="right")]
    return plan.shell.radius_m + plate_m(course, outside) - plate_m(courses[0], outside)


def joints_m(plan):
    """Heights of the joints of the courses above the bottom.

    Returns
    -------
    ndarray, shape (courses + 1,)
        m.
    """
    return joints_of(plan.job.courses)


def full_turn(angle_rad):
    """Reduce angles to 0 to 2 pi; a full turn within rounding becomes 0.

    Returns
    -------
    ndarray
        Angles, rad.

    Examples
    --------
    >>> full_turn(np.array([-1.0, 2 * np.pi])).round(6)
    array([5.283185, 0.      ])
    """
    turned = np.asarray(angle_rad) % (2 * np.pi)
    return np.where(2 * np.pi - turned < ROUNDING_RAD, 0.0, turned)


def places_around(axis_m, azimuth_rad, radius_m):
    """Positions at azimuths and distances from an axis.

    Parameters
    ----------
    axis_m : array_like, shape (2,)
        Position of the axis, m.
    azimuth_rad : array_like
        Azimuths, clockwise from +y, rad.
    radius_m : array_like
        Distances, m; broadcast against the azimuths.

    Returns
    -------
    ndarray, shape (..., 2)
        m.
    """
    azimuth, radius = np.broadcast_arrays(azimuth_rad, radius_m)
    return np.asarray(axis_m) + radius[..., None] * np.stack(
        [np.sin(azimuth), np.cos(azimuth)], axis=-1
    )


def joints_of(courses):
    """Heights (courses + 1,) of the joints above the bottom of the lowest course, m."""
    return np.cumsum([0.0] + [course.height_m for course in courses])


def row_heights_m(courses, levels, clearance_m):
    """Heights of target rows above the bottom, and the course of each row.

    Rows are at the Gauss levels of every course. Rows nearer to a weld than the clearance are moved
    to the clearance. A course too low for the clearance has one row in the middle.

    Parameters
    ----------
    courses : sequence of Course
    levels : int
        Number of Gauss levels per course.
    clearance_m : float
        Smallest distance from a weld.

    Returns
    -------
    heights : ndarray, shape (rows,)
        m.
    index : ndarray of int, shape (rows,)
        Index of the course.
    """
    joints = joints_of(courses)
    heights, index = [], []
    for number, (low, high) in enumerate(pairwise(joints)):
        room = high - low - 2 * clearance_m
        rows = panels([low, high], levels)[0] if room > 0 else np.array([(low + high) / 2])
        rows = np.clip(rows, low + min(clearance_m, (high - low) / 2), None)
        rows = np.unique(np.minimum(rows, max(high - clearance_m, (low + high) / 2)))
        rows = rows[np.append(True, np.diff(rows) >= TOUCH_M)]
        heights.append(rows)
        index.append(np.full(len(rows), number))
    return np.concatenate(heights), np.concatenate(index)


def plate_m(course, outside):
    """Thickness of plate and paint between the nominal inside radius and the observer; 0 inside."""
    return course.thickness_m + course.paint_m if outside else 0.0


def bases_of(table, bars):
    """Return the `Base`s of the rows of a plan's stadia.csv; () if it has no rows.

    Parameters
    ----------
    table : ColumnValues or None
    bars : dict
        {name: {key: value}} of the stadias in the instruments.
    """
    if not has_rows(table):
        return ()
    columns = (table.of("setup"), table.of("to"), bars_used(table, bars))
    columns += table.of("s_arcsec"), table.of("readings"), table.rows
    return tuple(
        Base(setup, to, bar, sd * ARCSEC, int(readings or 1), row)
        for setup, to, bar, sd, readings, row in zip(*columns, strict=True)
    )


def base_m(plan, base):
    """Nominal horizontal length of a Base of a Plan, m."""
    points = plan.points
    return float(np.hypot(*(points[base.to] - points[base.setup])[:2]))


def angle_of_base_rad(plan, base):
    """Angle between the ends of the bar of a Base at its nominal length, rad."""
    return float(angle_of_distance_rad(base_m(plan, base), plan.bars[base.bar]))


def base_sd_m(plan, base):
    """Standard deviation of the distance from one reading of a Base, m."""
    return float(
        distance_sd_m(angle_of_base_rad(plan, base), plan.bars[base.bar], base.angle_sd_rad)
    )


def readings_of_bases(plan, point_names):
    """Return the `Readings`, without values, of bases between the points `there`; () if no base.

    Repeated readings of a base are one value with the standard deviation of their mean.
    """
    bases = [base for base in plan.bases if {base.setup, base.to} <= point_names]
    if not bases:
        return ()
    n = len(bases)
    return (
        Readings(
            table="distances",
            value=np.zeros(n),
            sd=np.array([base_sd_m(plan, base) / np.sqrt(base.readings) for base in bases]),
            start=tuple(base.setup for base in bases),
            end=tuple(base.to for base in bases),
            check=np.zeros(n, dtype=bool),
            instrument=tuple(base.bar for base in bases),
            horizontal=np.ones(n, dtype=bool),
            temperature_c=np.full(n, np.nan),
            rows=tuple(base.row for base in bases),
            sheet=STADIA_FILE,
        ),
    )


def group_by_ends(bases):
    """Group `Base`s by their two ends, whichever end each is read from: {names of ends: bases}."""
    groups = {}
    for base in bases:
        ends = (base.setup, base.to)
        groups.setdefault(ends[::-1] if ends[::-1] in groups else ends, []).append(base)
    return groups


def new_bases(plan):
    """Return possible new pairs of `Base`s, read from both ends; () if the plan has no stadia.

    Each pair connects two set-ups that sight each other and have no base yet.
    """
    if not plan.bars:
        return ()
    template = plan.bases[0] if plan.bases else Base("", "", next(iter(plan.bars)), NEW_SD_RAD)
    connected = {frozenset((base.setup, base.to)) for base in plan.bases}
    pairs = {}
    for setup in plan.setups:
        for other in setup.sights:
            pairs.setdefault(frozenset((setup.name, other)), (setup.name, other))
    return tuple(
        tuple(replace(template, setup=a, to=b, row=None) for a, b in (ends, ends[::-1]))
        for key, ends in pairs.items()
        if key not in connected
    )


FEWEST_READINGS = 3  # for the three coordinates of a point
FEWEST_POINTS = 3  # fewest points on a photograph
FEWEST_SHARED = 2  # fewest common points that connect two levelled set-ups
AHEAD_M = 0.1  # smallest depth of a point in front of a camera
WIDEST = 1.3  # half formats; limit of undistorted image coordinates of points in the frame
GRAZE_M = 1e-3  # reduction of the tank radius, so that the tank does not hide its own targets


@dataclass(frozen=True)
class Visibility:
    """Points visible from each photograph and set-up.

    Attributes
    ----------
    points : tuple of str
        Names.
    place : ndarray of int, shape (photos,)
        Index of the position of each photograph.
    on_photo : ndarray of bool, shape (photos, points)
    image_mm : ndarray, shape (photos, points, 2)
        Image coordinates.
    on_setup : ndarray of bool, shape (setups, points)
    """

    points: tuple
    place: np.ndarray
    on_photo: np.ndarray
    image_mm: np.ndarray
    on_setup: np.ndarray

    @property
    def rays(self):
        """Number of rays to each point, shape (points,).

        Exposures from one position are one ray.
        """
        return self.photo_views.sum(axis=0) + self.on_setup.sum(axis=0)

    @property
    def photo_views(self):
        """Mask (positions, points): whether a photograph from the position shows the point."""
        mask = np.zeros((len(set(self.place.tolist())), len(self.points)), dtype=bool)
        np.logical_or.at(mask, self.place, self.on_photo)
        return mask


def find_visible(plan):
    """Return the Visibility of all points of a Plan from its photographs and set-ups."""
    points = plan.points
    xyz = np.array(list(points.values()), dtype=float).reshape(-1, 3)
    normals = np.full((len(xyz), 3), np.nan)
    normals[: len(plan.targets.names)] = plan.targets.outwards
    names = np.array(list(points), dtype=object)
    for name, out in plan.facing.items():
        normals[names == name] = out
    is_setup = np.isin(names, [setup.name for setup in plan.setups])
    cameras = {setup.camera.name: setup for setup in plan.job.measurements.cameras}
    on_photo = np.zeros((len(plan.photos), len(xyz)), dtype=bool)
    image = np.full((len(plan.photos), len(xyz), 2), np.nan)
    number, seen_from = {}, []
    for k, photo in enumerate(plan.photos):
        if number.setdefault(tuple(photo.xyz_m), len(number)) == len(seen_from):
            seen_from.append(find_in_sight(plan, photo.xyz_m, xyz, normals))
        image[k], inside = find_in_frame(cameras[photo.camera], photo, xyz)
        on_photo[k] = inside & seen_from[number[tuple(photo.xyz_m)]] & ~is_setup
    place = np.array([number[tuple(photo.xyz_m)] for photo in plan.photos], dtype=int)
    on_setup = np.zeros((len(plan.setups), len(xyz)), dtype=bool)
    for k, setup in enumerate(plan.setups):
        sighted = ~is_setup | np.isin(names, setup.sights)
        on_setup[k] = sighted & find_in_sight(plan, setup.xyz_m, xyz, normals)
    return Visibility(tuple(points), place, on_photo, image, on_setup)


def find_measurable(plan, seen):
    """Mask (points,): points with at least three readings, known coordinates included.

    Photographs from one position give no depth, however many there are. They therefore count once;
    otherwise a tape between two such points would seem to determine both.
    """
    names = {name: i for i, name in enumerate(seen.points)}
    count = 2 * seen.photo_views.sum(axis=0)
    for k, setup in enumerate(plan.setups):
        kinds = (setup.direction_sd_rad, setup.zenith_sd_rad, setup.distance_sd_m)
        count = count + seen.on_setup[k] * sum(sd is not None for sd in kinds)
        count[names[setup.name]] += FEWEST_READINGS
    for point in plan.known:
        if point.name in names:
            count[names[point.name]] += np.isfinite(point.sd_m).sum()
    return count >= FEWEST_READINGS


def find_in_frame(setup, photo, xyz_m):
    """Find the points in the frame of a photograph.

    Parameters
    ----------
    setup : CameraSetup
        Camera of the photograph.
    photo : Photograph
    xyz_m : ndarray, shape (n, 3)
        Points, m.

    Returns
    -------
    image : ndarray, shape (n, 2)
        Image coordinates, mm; nan far outside the frame.
    inside : ndarray of bool, shape (n,)
        Whether the points lie in the frame.
    """
    # camera coordinates; the camera looks along -w
    u, v, w = photo.rotation @ (xyz_m - photo.xyz_m).T
    camera, half = setup.camera, setup.format_mm / 2
    ahead = w < -AHEAD_M
    ideal = -camera.values[0] * np.column_stack([u, v]) / np.where(ahead, w, -1.0)[:, None]
    # Far outside the frame the distortion polynomial can fold points back into the frame.
    near = ahead & (np.abs(ideal) < WIDEST * half).all(axis=1)
    image = np.full((len(xyz_m), 2), np.nan)
    image[near] = distort_image_points(ideal[near], camera.values, camera.form)
    return image, near & (np.abs(np.nan_to_num(image, nan=np.inf)) < half).all(axis=1)


def find_in_sight(plan, place_m, xyz_m, normals):
    """Find the points visible from a position within the largest angle of incidence.

    Parameters
    ----------
    plan : Plan
    place_m : ndarray, shape (3,)
        Position of the observer.
    xyz_m : ndarray, shape (n, 3)
        Points.
    normals : ndarray, shape (n, 3)
        Normals of the wall, or of marks visible from one side; nan for other points.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    back = place_m - xyz_m
    distance = np.linalg.norm(back, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.einsum("ni,ni->n", normals, back) / distance
    on_wall = np.isfinite(normals[:, 0])
    seen = (distance > 0) & np.where(on_wall, cosine > np.cos(plan.limits.incidence_rad), True)
    if plan.shell.is_outside:
        shell = plan.shell
        tank = Pillar(shell.axis_m, shell.radius_m - GRAZE_M, shell.low_m, shell.high_m, "tank")
        seen &= on_wall | ~find_hidden(tank, place_m, xyz_m)
    else:
        away = np.hypot(*(xyz_m[:, :2] - plan.shell.axis_m).T)
        seen &= away < plan.shell.radius_m + GRAZE_M
    for obstacle in plan.obstacles:
        seen &= ~find_hidden(obstacle, place_m, xyz_m)
    return seen


def refuse_blind(plan, seen):
    """Raise InputError for photographs and set-ups that see too few points.

    One message per ring.
    """
    log, blind = Log(), {}
    for k, photo in enumerate(plan.photos):
        count, targets = (int(seen.on_photo[k, :n].sum()) for n in (None, len(plan.targets.names)))
        if count < FEWEST_POINTS or not targets:
            text = _describe_view(count, targets)
            blind.setdefault(photo.place, []).append(
                (message("plan_a_photograph", "photograph {photo}", photo=photo.name), text)
            )
    for k, setup in enumerate(plan.setups):
        if not seen.on_setup[k].any():
            blind.setdefault(setup.place, []).append(
                (message("plan_a_setup", "set-up {setup}", setup=setup.name), "nothing")
            )
    for (file, row, name), views in blind.items():
        who, text = views[0]
        more = (
            message("plan_more_of_ring", ", and {more} more of this ring", more=len(views) - 1)
            if len(views) > 1
            else ""
        )
        log.problem(
            file,
            message(
                "plan_sees_too_little",
                "{who} sees {found}{more}: targets are outside its frame, behind it, seen at too "
                "flat an angle (limits.incidence_deg) or hidden; expected it to see 3 points or "
                "more, targets among them",
                who=who,
                found=text,
                more=more,
            ),
            row,
            name,
        )
    log.stop_if_problems()


def _describe_view(count, targets):
    """Return the number of visible points in words; targets: number of targets among them."""
    if not count:
        return message("plan_nothing", "nothing")
    if not targets:
        return message("plan_no_target", "no target (other points: {count})", count=count)
    if count == 1:
        return message("plan_one_point_only", "{count} point only", count=count)
    return message("plan_points_only", "{count} points only", count=count)


def find_separate_bodies(plan, seen):
    """Return the groups of connected set-ups, each a tuple of names.

    Parameters
    ----------
    plan : Plan
    seen : Visibility

    Notes
    -----
    A set-up is a body: the points that it sees and its own position. Points known in x, y and z are
    another body. Bodies with two common points are merged.
    """
    fixed = {point.name for point in plan.known if np.isfinite(point.sd_m).all()}
    bodies = [([], fixed)]
    for k, setup in enumerate(plan.setups):
        seen_there = {seen.points[i] for i in np.flatnonzero(seen.on_setup[k])}
        bodies.append(([setup.name], seen_there | {setup.name}))
    while (pair := _find_connected(bodies)) is not None:
        first, second = pair
        bodies = [body for body in bodies if body is not first and body is not second]
        bodies.append((first[0] + second[0], first[1] | second[1]))
    return tuple(tuple(names) for names, _ in bodies if names)


def _find_connected(bodies):
    """Return two bodies with enough common points, or None."""
    for i, body in enumerate(bodies):
        for earlier in bodies[:i]:
            if len(body[1] & earlier[1]) >= FEWEST_SHARED:
                return earlier, body
    return None


def describe_separate_bodies(groups):
    """Return the message about the groups that `find_separate_bodies` returns."""
    listed = "; ".join(", ".join(names) for names in groups)
    return message(
        "plan_apart",
        "{count} groups of set-ups are not connected to the others: {told}; they share fewer "
        "than {shared} points and do not see each other: add marks or control points that "
        "neighbours both see, or set-ups between them",
        count=len(groups),
        told=listed,
        shared=FEWEST_SHARED,
    )


def check_obstacles(plan_input, log):
    """Check the keys of boxes and cylinders in a `Given`."""
    needed = {"box": {"from_m": 3, "to_m": 3}, "cylinder": {"axis_m": 2}}
    numbers = {"box": (), "cylinder": ("radius_m", "low_m", "high_m")}
    for entry in plan_input.sections["obstacles"]:
        for key, count in needed.get(entry["kind"], {}).items():
            if not entry.is_refused(key) and len(entry[key] or ()) != count:
                expected = message(
                    "plan_numbers_metres", "expected {count} numbers, metres", count=count
                )
                entry.report(log.problem, key, expected)
        for key in numbers.get(entry["kind"], ()):
            if key not in entry.filled_keys:
                expected = message("plan_number_metres", "missing; expected a number, metres")
                entry.report(log.problem, key, expected)
        if None not in (entry["low_m"], entry["high_m"]) and entry["high_m"] <= entry["low_m"]:
            expected = message(
                "plan_high_low",
                "found {high:g}; expected more than low_m, {low:g}",
                high=entry["high_m"],
                low=entry["low_m"],
            )
            entry.report(log.problem, "high_m", expected)
        if any(a == b for a, b in zip(entry["from_m"] or (), entry["to_m"] or (), strict=False)):
            expected = message(
                "plan_flat_box",
                "in a plane with from_m; expected a corner that differs in x, y and z",
            )
            entry.report(log.problem, "to_m", expected)


def obstacles_of(plan_input):
    """Return the `Box`es and `Pillar`s of valid [[obstacles]], a tuple."""
    return tuple(map(_obstacle, plan_input.sections["obstacles"]))


def _obstacle(entry):
    if entry["kind"] == "box":
        corners = np.array([entry["from_m"], entry["to_m"]])
        return Box(corners.min(axis=0), corners.max(axis=0), entry["name"])
    return Pillar(
        np.array(entry["axis_m"]), entry["radius_m"], entry["low_m"], entry["high_m"],
        entry["name"],
    )  # fmt: skip


def message_of_obstacle_at(obstacles, xyz_m):
    """Return the message about a position (3,) within an obstacle; "" if it is in none."""
    for obstacle in obstacles:
        if _contains(obstacle, xyz_m):
            return message(
                "plan_in_an_obstacle", "stands in the obstacle {obstacle}", obstacle=obstacle.name
            )
    return ""


def _contains(obstacle, xyz):
    if hasattr(obstacle, "radius_m"):
        near = np.hypot(*(xyz[:2] - obstacle.axis_m)) < obstacle.radius_m
        return bool(near and obstacle.low_m < xyz[2] < obstacle.high_m)
    return bool(((xyz > obstacle.low_m) & (xyz < obstacle.high_m)).all())


def message_of_misplaced_station(station, why):
    """Return the message about a station at an impossible position."""
    return message("plan_misplaced", "station {station} {why}", station=station, why=why)


def message_of_cut_line(start, end):
    """Return the message about an obstructed line between two stations."""
    return message(
        "plan_base_hidden",
        "the line from {one} to {other} is cut by the tank or an obstacle; expected it free",
        one=start,
        other=end,
    )


def find_hidden(obstacle, place_m, xyz_m):
    """Find the points hidden by an obstacle.

    Parameters
    ----------
    obstacle : Box or Pillar
    place_m : ndarray, shape (3,)
        Position of the observer.
    xyz_m : ndarray, shape (n, 3)
        Points.

    Returns
    -------
    ndarray of bool, shape (n,)
        Whether the obstacle cuts the line from the position to each point.
    """
    along = xyz_m - place_m
    if isinstance(obstacle, Box):
        first, last = _clip_to_slabs(place_m, along, obstacle.low_m, obstacle.high_m)
    else:
        low, high = np.full(3, -np.inf), np.full(3, np.inf)
        low[2], high[2] = obstacle.low_m, obstacle.high_m
        first, last = _clip_to_slabs(place_m, along, low, high)
        near, far = _clip_to_circle(place_m[:2] - obstacle.axis_m, along[:, :2], obstacle.radius_m)
        first, last = np.maximum(first, near), np.minimum(last, far)
    # The line parameter is 0 at the observer and 1 at the point.
    return np.maximum(first, 0.0) < np.minimum(last, 1.0)


def _clip_to_slabs(place, along, low, high):
    """First and last line parameters (n,), (n,) within the slabs of three axes."""
    still = along == 0  # parallel to a slab: inside it everywhere or nowhere
    step = np.where(still, 1.0, along)
    to_low, to_high = (low - place) / step, (high - place) / step
    inside = (place > low) & (place < high)
    first = np.where(still, np.where(inside, -np.inf, np.inf), np.minimum(to_low, to_high))
    last = np.where(still, np.where(inside, np.inf, -np.inf), np.maximum(to_low, to_high))
    return first.max(axis=1), last.min(axis=1)


def _clip_to_circle(place, along, radius):
    """First and last line parameters within a circle: |place + t along| < radius."""
    # a t^2 + 2 b t + c < 0 between the roots; a vertical line (a = 0) is inside if c < 0
    a, b = np.einsum("ni,ni->n", along, along), along @ place
    c = place @ place - radius**2
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(b * b - a * c)
        near, far = (-b - root) / a, (-b + root) / a
    near = np.where(a > 0, near, -np.inf if c < 0 else np.inf)
    far = np.where(a > 0, far, np.inf if c < 0 else -np.inf)
    misses = np.isnan(near)
    return np.where(misses, np.inf, near), np.where(misses, -np.inf, far)
