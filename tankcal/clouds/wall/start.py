"""Where the wall is, roughly, from a sample of a cloud: its surface, or in words why there is none.

A wall seen along its axis is a line: squares of that view whose points stand at many heights are
what the circle is looked for among, floors and roofs are not. `geometry.shell.find_shell` gives the
axis. A lying cylinder is turned upright for it.
"""

import numpy as np

from tankcal.clouds.wall.screens import (
    BETTER_SHARE,
    CLEAR_SHARE,
    FILE,
    LEAST_WALL_SHARE,
    CoarseCells,
    undecided,
)
from tankcal.clouds.wall.surfaces import CylinderSurface, SphereSurface
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.geometry.outlines import FULL_TURN
from tankcal.geometry.primitives import fit_sphere
from tankcal.geometry.shell import consensus_circle, find_shell
from tankcal.messages import message

LEVELS, LEAST_LEVELS = 24, 0.3  # heights that squares of the view are told by, and how many of them
SQUARE, LEAST_SQUARES = 1 / 75, 20  # of the radius; of them, with points at many heights
CLEAR_BAND, MOST_OF_THEM = 0.01, 0.6  # of the radius; of the points of another shape
DIAGNOSED = 60_000  # points that a cause is looked for with
AROUND, FITTED_LEVELS = 72, 24  # cells of the points that the axis is fitted to
WIDE = 0.03  # of the radius: how far from the first circle points may be of the wall
FEWEST = 500  # points between the ends of the shell
UNITS = {"mm": 1000.0, "cm": 100.0, "ft": 1 / 0.3048, "in": 1 / 0.0254}
LEAST_ON_SPHERE = 0.3  # of the points
SPHERE_TRIES, SPHERE_BANDS = 400, (0.03, 0.02, 0.01, 0.006, 0.006)


def find_surface(
    xyz_m, *, kind, ends_m, radius_m, azimuth_rad=0.0, outwards=None, is_unit_defined=False
):
    """The surface that a sample of points shows, near a nominal radius.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
    kind : str
        "vertical", "horizontal" or "sphere".
    ends_m : tuple of float or None
        Heights of bottom and top of an upright shell, m; along a lying one, from the middle of the
        points (None: as far as they go).
    radius_m : float
        Nominal, on the side that the scans saw.
    azimuth_rad : float, optional
        Of the axis of a lying cylinder.
    outwards : ndarray of int, shape (n,), optional
        1 of points seen from inside, -1 from outside; None: not known, and no screen is looked for.
    is_unit_defined : bool, optional
        As for `find_cloud_wall`.

    Returns
    -------
    surface : CylinderSurface or SphereSurface
    ends_m : tuple of float
        u of its first and last row.

    Raises
    ------
    InputError
        Where there is no such wall, with the likely cause.
    """
    xyz_m = np.asarray(xyz_m, dtype=float)
    if len(xyz_m) < FEWEST:
        raise _problem(
            message(
                "cloud_too_few",
                "found {count} points; a wall needs {least} at least",
                count=len(xyz_m),
                least=FEWEST,
            )
        )
    try:
        surface, ends_m_found = _surface(xyz_m, kind, ends_m, radius_m, azimuth_rad)
        if outwards is not None and not (kind == "horizontal" and np.any(outwards < 0)):
            surface = _rear_surface(surface, ends_m_found, xyz_m, outwards, radius_m)
        _refuse_radius(surface, radius_m)
        return surface, ends_m_found
    except SolutionError as error:
        units = {} if is_unit_defined else UNITS
        cause = _likely_cause(xyz_m[:DIAGNOSED], kind, ends_m, radius_m, azimuth_rad, units)
        raise _problem(cause or error.args[0]) from None


def _surface(xyz_m, kind, ends_m, radius_m, azimuth_rad):
    if kind == "sphere":
        surface = _sphere(xyz_m, radius_m)
        low, high = surface.centre_m[2] - radius_m, surface.centre_m[2] + radius_m
        return surface, (low, high)
    if kind == "horizontal":
        return _lying(xyz_m, ends_m, radius_m, azimuth_rad)
    return _standing(xyz_m, ends_m, radius_m, np.eye(3)), ends_m


def _standing(xyz_m, ends_m, radius_m, frame):
    """`CylinderSurface` along the third vector of a frame, between two places along it."""
    xyz = xyz_m @ frame.T
    inside = xyz[(xyz[:, 2] > ends_m[0]) & (xyz[:, 2] < ends_m[1])]
    if len(inside) < FEWEST:
        raise _beside_shell(xyz, ends_m, len(inside))
    middle = np.array([*np.median(inside[:, :2], axis=0), (ends_m[0] + ends_m[1]) / 2])
    local, joints = inside - middle, np.array(ends_m) - middle[2]
    squares = _upright_squares(local, joints, radius_m)
    if len(squares) < LEAST_SQUARES:
        raise SolutionError(
            message(
                "cloud_nothing_upright",
                "nothing along the axis of the tank was found in {count} points near its nominal "
                "radius of {nominal_m:.3f} m: check the unit, the axes and the frame",
                count=len(inside),
                nominal_m=radius_m,
            )
        )
    x, y, r = consensus_circle(squares, radius_m)
    distance = np.hypot(local[:, 0] - x, local[:, 1] - y) - r
    near = local[np.abs(distance) < WIDE * radius_m]
    return _through(_spread(near, x, y, joints), joints, radius_m, middle, frame)


def _through(some, joints_m, radius_m, middle, frame):
    """`CylinderSurface` through points (k, 3) of a wall, about a middle in a frame."""
    shell = find_shell(some, joints_m, radius_m, snooping=False)
    axis = np.array([*shell.axis_m, shell.z_m])
    found = CylinderSurface(axis, 0.0, shell.slope)
    return CylinderSurface(
        (axis + middle) @ frame,
        float(np.median(found.places(some[shell.reason == ""])[2])),
        shell.slope,
        frame,
    )


def _rear_surface(first, ends_m, xyz_m, outwards, radius_m):
    """The wall where the surface that was found first may be a screen before it.

    Raises InputError for several surfaces of which none is clearly the wall.
    """
    cells = [
        CoarseCells(first, xyz_m[outwards == side], outwards[outwards == side], ends_m)
        for side in np.unique(outwards)
    ]
    worst = max(cells, key=lambda one: (not one.is_clear, one.rear_share))
    is_clear = worst.is_clear
    is_cylinder = isinstance(first, CylinderSurface) and len(worst.cell) >= LEAST_SQUARES
    if (is_clear and worst.wall_share > CLEAR_SHARE) or not is_cylinder:
        second = None
    else:
        second = _behind(first, ends_m, worst, radius_m)
    if second is not None:
        found = CoarseCells(second, worst.xyz_m, worst.outwards, ends_m)
        is_better = not is_clear or found.wall_share > worst.wall_share + BETTER_SHARE
        is_wall = found.is_clear and found.wall_share >= LEAST_WALL_SHARE
        if is_better and is_wall and abs(second.radius_m / radius_m - 1) < WIDE:
            return second
    if is_clear:
        return first
    raise undecided(worst)


def _behind(first, ends_m, cells, radius_m):
    """`CylinderSurface` through the rearmost distances of coarse cells; None: they show none."""
    middle = np.array([*(first.frame @ first.centre_m)[:2], (ends_m[0] + ends_m[1]) / 2])
    near = cells.xyz_m[cells.near_rear()] @ first.frame.T - middle
    joints = np.array(ends_m) - middle[2]
    try:
        some = _spread(near, 0.0, 0.0, joints)
        return _through(some, joints, radius_m, middle, first.frame)
    except SolutionError:
        return None


def _refuse_radius(surface, radius_m):
    """Raise SolutionError where the wall departs from its nominal radius by more than 3 %."""
    if abs(surface.radius_m / radius_m - 1) > WIDE:
        raise SolutionError(_other_radius(radius_m, surface.radius_m))


def _other_radius(nominal_m, found_m):
    return message(
        "cloud_of_other_radius",
        "no wall near the nominal radius {nominal_m:.3f} m, but one of {radius_m:.3f} m: check "
        "nominal_diameter_m, the unit and the file",
        nominal_m=nominal_m,
        radius_m=found_m,
    )


def _beside_shell(xyz, ends_m, count):
    low, high = np.percentile(xyz[:, 2], [0.5, 99.5])
    return SolutionError(
        message(
            "cloud_beside_shell",
            "{count} of {all} points stand between the bottom ({bottom_m:.3f} m) and the top "
            "({top_m:.3f} m) of the shell; found heights of {low_m:.3f} to {high_m:.3f} m: "
            "check the frame, the unit and bottom_z_m",
            count=count,
            all=len(xyz),
            bottom_m=ends_m[0],
            top_m=ends_m[1],
            low_m=low,
            high_m=high,
        )
    )


def _upright_squares(local, joints_m, radius_m):
    """(k, 2) middles of the squares of the view along z whose points stand at many heights."""
    size = SQUARE * radius_m
    reach = 4 * radius_m
    local = local[np.all(np.abs(local[:, :2]) < reach, axis=1)]
    width = int(np.ceil(2 * reach / size)) + 1
    square = ((local[:, :2] + reach) / size).astype(np.int64)
    level = ((local[:, 2] - joints_m[0]) * (LEVELS / (joints_m[1] - joints_m[0]))).astype(np.int64)
    key = (square[:, 0] * width + square[:, 1]) * LEVELS + np.clip(level, 0, LEVELS - 1)
    squares, heights = np.unique(np.unique(key) // LEVELS, return_counts=True)
    chosen = squares[heights >= LEAST_LEVELS * LEVELS]
    return (np.column_stack(np.divmod(chosen, width)) + 0.5) * size - reach


def _spread(near, x, y, joints_m):
    """Points even over the wall: of each cell that of the median distance from the circle."""
    dx, dy = near[:, 0] - x, near[:, 1] - y
    column = (np.arctan2(dx, dy) % FULL_TURN * (AROUND / FULL_TURN)).astype(np.int64) % AROUND
    share = (near[:, 2] - joints_m[0]) / (joints_m[1] - joints_m[0])
    cell = column * FITTED_LEVELS + (share * FITTED_LEVELS).astype(np.int64)
    order = np.lexsort((np.hypot(dx, dy), cell))
    _, first, count = np.unique(cell[order], return_index=True, return_counts=True)
    return near[order[first + count // 2]]


def _lying(xyz_m, ends_m, radius_m, azimuth_rad):
    along = np.array([np.sin(azimuth_rad), np.cos(azimuth_rad), 0.0])
    frame = np.array([[along[1], -along[0], 0.0], [0.0, 0.0, -1.0], along])
    place = xyz_m @ along
    low, high = np.percentile(place, [1.0, 99.0])
    if ends_m is not None:
        low, high = np.add(ends_m, (place.min() + place.max()) / 2)
    return _standing(xyz_m, (low, high), radius_m, frame), (float(low), float(high))


def _sphere(xyz_m, radius_m):
    rng = np.random.default_rng(20_11)
    middle = np.median(xyz_m, axis=0)
    local = xyz_m - middle
    judges = local[rng.choice(len(local), min(len(local), 4000), replace=False)]
    best = -1.0, None
    for four in local[rng.integers(len(local), size=(SPHERE_TRIES, 4))]:
        a = 2 * (four[1:] - four[0])
        b = np.sum(four[1:] ** 2 - four[0] ** 2, axis=1)
        if abs(np.linalg.det(a)) < 1e-9 * radius_m**3:
            continue
        centre = np.linalg.solve(a, b)
        if abs(np.linalg.norm(four[0] - centre) / radius_m - 1) > WIDE:
            continue
        away = np.abs(np.linalg.norm(judges - centre, axis=1) - radius_m)
        best = max(best, (float(np.mean(away < WIDE * radius_m)), tuple(centre)))
    if best[1] is None or best[0] < LEAST_ON_SPHERE:
        raise _no_sphere(radius_m, best[0], WIDE)
    centre, radius = np.array(best[1]), radius_m
    for band in SPHERE_BANDS:
        away = np.abs(np.linalg.norm(judges - centre, axis=1) - radius)
        chosen = judges[away < band * radius_m]
        fit = fit_sphere(chosen, np.ones(3 * len(chosen)))
        centre, radius = fit.centre_m, fit.radius_m
    share = np.mean(np.abs(np.linalg.norm(judges - centre, axis=1) - radius) < CLEAR_BAND * radius)
    if share < LEAST_ON_SPHERE:
        raise _no_sphere(radius_m, share, CLEAR_BAND)
    return SphereSurface(centre + middle, radius)


def _no_sphere(radius_m, share, band):
    return SolutionError(
        message(
            "no_sphere_in_cloud",
            "no sphere within {band:.0f} % of the nominal radius {nominal_m:.3f} m holds a third "
            "of the points (best {share:.0f} %): check the diameter and the unit",
            band=100 * band,
            nominal_m=radius_m,
            share=100 * max(share, 0.0),
        )
    )


def _likely_cause(xyz_m, kind, ends_m, radius_m, azimuth_rad, units):
    """What would explain that no wall is found; None: nothing that was tried."""
    middle = np.median(xyz_m, axis=0)
    for unit, factor in units.items():
        for origin in (np.zeros(3), middle):
            scaled = (xyz_m - origin) / factor + origin
            if shows_wall(scaled, kind, ends_m, radius_m, azimuth_rad):
                return message(
                    "cloud_in_other_unit",
                    "no wall near the nominal radius {nominal_m:.3f} m, but one if the "
                    "coordinates are {unit}: check `unit`",
                    nominal_m=radius_m,
                    unit=unit,
                )
    if kind != "sphere":
        for factor in (1.0, 1.3, 0.8):
            try:
                sphere = _sphere(xyz_m, radius_m * factor)
            except SolutionError:
                continue
            off = np.abs(sphere.places(xyz_m)[2])
            if np.mean(off < CLEAR_BAND * sphere.radius_m) > MOST_OF_THEM:
                return message(
                    "cloud_of_sphere",
                    "the points lie on a sphere of a radius of about {radius_m:.3f} m, not on a "
                    "cylinder: check tank.kind",
                    radius_m=sphere.radius_m,
                )
    for other, turns, code in _other_kinds(kind, azimuth_rad):
        if any(shows_wall(xyz_m, other, None, radius_m, turn) for turn in turns):
            return code
    for factor in np.geomspace(0.4, 2.5, 33):
        other = radius_m * factor
        try:
            found, _ = _surface(xyz_m, kind, ends_m, other, azimuth_rad)
        except SolutionError:
            continue
        return _other_radius(radius_m, found.radius_m)
    return None


def _other_kinds(kind, azimuth_rad):
    """Lying cylinders to try: kind, azimuths, and what it would mean."""
    turns = azimuth_rad + np.arange(0, np.pi, np.radians(3))
    if kind == "horizontal":
        elsewhere = message(
            "cloud_axis_elsewhere",
            "the points lie on a cylinder that runs elsewhere: check horizontal.azimuth_deg",
        )
        return [("horizontal", turns, elsewhere)]
    if kind == "vertical":
        lies = message("cloud_lies", "the points lie on a lying cylinder: check tank.kind")
        return [("horizontal", turns, lies)]
    return []


def shows_wall(xyz_m, kind, ends_m, radius_m, azimuth_rad=0.0):
    """Whether points show a wall; arguments as of `find_surface`."""
    if len(xyz_m) < FEWEST:
        return False
    try:
        _surface(xyz_m, kind, ends_m, radius_m, azimuth_rad)
    except SolutionError:
        return False
    return True


def _problem(text):
    return InputError(Problem(FILE, text))
