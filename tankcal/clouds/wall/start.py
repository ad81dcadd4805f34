"""Approximate surface of the wall from a sample of a cloud, or the probable cause of a failure.

In the view along its axis a wall is a line. Squares of this view with points at many heights
belong to walls, not to floors or roofs; the circle is searched among them. `find_shell` of
`geometry.shell` determines the axis. A lying cylinder is first rotated to the upright position.

Approximate surfaces of a wall: upright or lying cylinder, and sphere.

`places` converts points to surface coordinates, and `points` converts them back. The coordinates
are u along the axis (m), the azimuth about the axis (0 to 2 pi) and the distance outwards from the
surface (m).
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.clouds.wall.cells import (
    BETTER_SHARE,
    CLEAR_SHARE,
    FILE,
    LEAST_WALL_SHARE,
    CoarseCells,
    hidden_wall_error,
)
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.geometry.primitives import fit_sphere
from tankcal.geometry.shell import consensus_circle, find_shell
from tankcal.messages import message
from tankcal.units import FOOT_M, FULL_TURN, INCH_M, MM_PER_M

LEVELS, LEAST_LEVELS = 24, 0.3  # levels of height; least share of levels with points in a square
SQUARE, LEAST_SQUARES = 1 / 75, 20  # side of a square as a share of the radius; least number
# Band of a surface as a share of the radius; share of the points in the band of another shape
CLEAR_BAND, MOST_OF_THEM = 0.01, 0.6
DIAGNOSED = 60_000  # points used to search the cause of a failure
AROUND, FITTED_LEVELS = 72, 24  # columns and rows of cells that give points for the fit of the axis
WIDE = 0.03  # tolerance of the nominal radius, and of points about the first circle, as a share
FEWEST = 500  # least number of points between the ends of the shell
UNITS = {"mm": MM_PER_M, "cm": 100.0, "ft": 1 / FOOT_M, "in": 1 / INCH_M}  # units in one metre
LEAST_ON_SPHERE = 0.3  # least share of the points on a sphere
# Random samples of four points; bands of successive fits as shares of the radius
SPHERE_TRIES, SPHERE_BANDS = 400, (0.03, 0.02, 0.01, 0.006, 0.006)


def find_surface(
    xyz_m, *, kind, ends_m, radius_m, azimuth_rad=0.0, outwards=None, is_unit_defined=False
):
    """Find the surface of a wall near a nominal radius in a sample of points.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
        Sample of points, m.
    kind : str
        "vertical", "horizontal" or "sphere".
    ends_m : tuple of float or None
        Heights of bottom and top of an upright shell, m. For a lying shell, its ends relative to
        the centre of the points; None for the extent of the points.
    radius_m : float
        Nominal radius on the scanned side, m.
    azimuth_rad : float, optional
        Azimuth of the axis of a lying cylinder, rad.
    outwards : ndarray of int, shape (n,), optional
        1 for points seen from inside, -1 for points seen from outside. By default the side is not
        known, and no screen is searched.
    is_unit_defined : bool, optional
        As for `find_cloud_wall`.

    Returns
    -------
    surface : CylinderSurface or SphereSurface
        Approximate surface of the wall.
    ends_m : tuple of float
        Coordinate u of the ends of the surface, m.

    Raises
    ------
    InputError
        If the points show no such wall; the error states the probable cause.
    """
    xyz_m = np.asarray(xyz_m, dtype=float)
    if len(xyz_m) < FEWEST:
        raise _cloud_error(
            message(
                "cloud_too_few",
                "found {count} points; a wall needs {least} at least",
                count=len(xyz_m),
                least=FEWEST,
            )
        )
    try:
        surface, ends_m_found = _fit_surface(xyz_m, kind, ends_m, radius_m, azimuth_rad)
        if outwards is not None and not (kind == "horizontal" and np.any(outwards < 0)):
            surface = _choose_surface(surface, ends_m_found, xyz_m, outwards, radius_m)
        if abs(surface.radius_m / radius_m - 1) > WIDE:
            raise SolutionError(_message_other_radius(radius_m, surface.radius_m))
        return surface, ends_m_found
    except SolutionError as error:
        units = {} if is_unit_defined else UNITS
        cause = _likely_cause(xyz_m[:DIAGNOSED], kind, ends_m, radius_m, azimuth_rad, units)
        raise _cloud_error(cause or error.args[0]) from None


def _fit_surface(xyz_m, kind, ends_m, radius_m, azimuth_rad):
    if kind == "sphere":
        surface = _fit_sphere(xyz_m, radius_m)
        low, high = surface.centre_m[2] - radius_m, surface.centre_m[2] + radius_m
        return surface, (low, high)
    if kind == "horizontal":
        return _fit_lying_cylinder(xyz_m, ends_m, radius_m, azimuth_rad)
    return _fit_cylinder(xyz_m, ends_m, radius_m, np.eye(3)), ends_m


def _fit_cylinder(xyz_m, ends_m, radius_m, frame):
    """Find a `CylinderSurface` along the third vector of a frame, between two ends (m)."""
    xyz = xyz_m @ frame.T
    inside = xyz[(xyz[:, 2] > ends_m[0]) & (xyz[:, 2] < ends_m[1])]
    if len(inside) < FEWEST:
        raise _error_beside_shell(xyz, ends_m, len(inside))
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
    return _fit_axis(_sample_evenly(near, x, y, joints), joints, radius_m, middle, frame)


def _fit_axis(sampled, joints_m, radius_m, middle, frame):
    """Fit a `CylinderSurface` to points (k, 3) of a wall, relative to `middle` in a frame."""
    shell = find_shell(sampled, joints_m, radius_m, snooping=False)
    axis = np.array([*shell.axis_m, shell.z_m])
    centred_surface = CylinderSurface(axis, 0.0, shell.slope)
    return CylinderSurface(
        (axis + middle) @ frame,
        float(np.median(centred_surface.places(sampled[shell.reason == ""])[2])),
        shell.slope,
        frame,
    )


def _choose_surface(first, ends_m, xyz_m, outwards, radius_m):
    """Choose between the first surface, which may be a screen, and a surface behind it.

    Raises InputError if no surface is clearly the wall.
    """
    cells = [
        CoarseCells(first, xyz_m[outwards == side], outwards[outwards == side], ends_m)
        for side in np.unique(outwards)
    ]
    worst = max(cells, key=lambda candidate: (not candidate.is_clear, candidate.rear_share))
    is_clear = worst.is_clear
    is_cylinder = isinstance(first, CylinderSurface) and len(worst.cell) >= LEAST_SQUARES
    if (is_clear and worst.wall_share > CLEAR_SHARE) or not is_cylinder:
        second = None
    else:
        second = _fit_rear_cylinder(first, ends_m, worst, radius_m)
    if second is not None:
        rear_cells = CoarseCells(second, worst.xyz_m, worst.outwards, ends_m)
        is_better = not is_clear or rear_cells.wall_share > worst.wall_share + BETTER_SHARE
        is_wall = rear_cells.is_clear and rear_cells.wall_share >= LEAST_WALL_SHARE
        if is_better and is_wall and abs(second.radius_m / radius_m - 1) < WIDE:
            return second
    if is_clear:
        return first
    raise hidden_wall_error(worst)


def _fit_rear_cylinder(first, ends_m, cells, radius_m):
    """Fit a `CylinderSurface` to the rearmost distances of coarse cells; None if this fails."""
    middle = np.array([*(first.frame @ first.centre_m)[:2], (ends_m[0] + ends_m[1]) / 2])
    near = cells.xyz_m[cells.find_near_rear()] @ first.frame.T - middle
    joints = np.array(ends_m) - middle[2]
    try:
        sampled = _sample_evenly(near, 0.0, 0.0, joints)
        return _fit_axis(sampled, joints, radius_m, middle, first.frame)
    except SolutionError:
        return None


def _message_other_radius(nominal_m, found_m):
    return message(
        "cloud_of_other_radius",
        "no wall near the nominal radius {nominal_m:.3f} m, but one of {radius_m:.3f} m: check "
        "nominal_diameter_m, the unit and the file",
        nominal_m=nominal_m,
        radius_m=found_m,
    )


def _error_beside_shell(xyz, ends_m, count):
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
    """Centres (k, 2) of the squares in the view along z that have points at many heights."""
    size = SQUARE * radius_m
    reach = 4 * radius_m
    local = local[np.all(np.abs(local[:, :2]) < reach, axis=1)]
    width = int(np.ceil(2 * reach / size)) + 1
    square = ((local[:, :2] + reach) / size).astype(np.int64)
    level = ((local[:, 2] - joints_m[0]) * (LEVELS / (joints_m[1] - joints_m[0]))).astype(np.int64)
    # A key identifies square and level; unique keys count the levels of each square.
    key = (square[:, 0] * width + square[:, 1]) * LEVELS + np.clip(level, 0, LEVELS - 1)
    squares, heights = np.unique(np.unique(key) // LEVELS, return_counts=True)
    chosen = squares[heights >= LEAST_LEVELS * LEVELS]
    return (np.column_stack(np.divmod(chosen, width)) + 0.5) * size - reach


def _sample_evenly(near, x, y, joints_m):
    """Select evenly distributed points: in each cell the point at the median distance."""
    dx, dy = near[:, 0] - x, near[:, 1] - y
    column = (np.arctan2(dx, dy) % FULL_TURN * (AROUND / FULL_TURN)).astype(np.int64) % AROUND
    share = (near[:, 2] - joints_m[0]) / (joints_m[1] - joints_m[0])
    cell = column * FITTED_LEVELS + (share * FITTED_LEVELS).astype(np.int64)
    order = np.lexsort((np.hypot(dx, dy), cell))
    _, first, count = np.unique(cell[order], return_index=True, return_counts=True)
    return near[order[first + count // 2]]


def _fit_lying_cylinder(xyz_m, ends_m, radius_m, azimuth_rad):
    """Find a lying `CylinderSurface` in a frame whose third vector is the nominal axis."""
    along = np.array([np.sin(azimuth_rad), np.cos(azimuth_rad), 0.0])
    frame = np.array([[along[1], -along[0], 0.0], [0.0, 0.0, -1.0], along])
    place = xyz_m @ along
    low, high = np.percentile(place, [1.0, 99.0])
    if ends_m is not None:
        low, high = np.add(ends_m, (place.min() + place.max()) / 2)
    return _fit_cylinder(xyz_m, (low, high), radius_m, frame), (float(low), float(high))


def _fit_sphere(xyz_m, radius_m):
    """Find a `SphereSurface` by consensus of spheres through four points, then by fits."""
    rng = np.random.default_rng(20_11)
    middle = np.median(xyz_m, axis=0)
    local = xyz_m - middle
    test_points = local[rng.choice(len(local), min(len(local), 4000), replace=False)]
    best = -1.0, None
    for four in local[rng.integers(len(local), size=(SPHERE_TRIES, 4))]:
        # |p - c|^2 = r^2 for four points; differences give linear equations for the centre c.
        a = 2 * (four[1:] - four[0])
        b = np.sum(four[1:] ** 2 - four[0] ** 2, axis=1)
        if abs(np.linalg.det(a)) < 1e-9 * radius_m**3:
            continue
        centre = np.linalg.solve(a, b)
        if abs(np.linalg.norm(four[0] - centre) / radius_m - 1) > WIDE:
            continue
        deviation = np.abs(np.linalg.norm(test_points - centre, axis=1) - radius_m)
        best = max(best, (float(np.mean(deviation < WIDE * radius_m)), tuple(centre)))
    if best[1] is None or best[0] < LEAST_ON_SPHERE:
        raise _error_no_sphere(radius_m, best[0], WIDE)
    centre, radius = np.array(best[1]), radius_m
    for band in SPHERE_BANDS:
        deviation = np.abs(np.linalg.norm(test_points - centre, axis=1) - radius)
        chosen = test_points[deviation < band * radius_m]
        fit = fit_sphere(chosen, np.ones(3 * len(chosen)))
        centre, radius = fit.centre_m, fit.radius_m
    share = np.mean(
        np.abs(np.linalg.norm(test_points - centre, axis=1) - radius) < CLEAR_BAND * radius
    )
    if share < LEAST_ON_SPHERE:
        raise _error_no_sphere(radius_m, share, CLEAR_BAND)
    return SphereSurface(centre + middle, radius)


def _error_no_sphere(radius_m, share, band):
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
    """Return a message about the probable cause of a failure, or None.

    The causes are tried in this order: another unit, a sphere, a lying cylinder of another azimuth,
    another radius.
    """
    middle = np.median(xyz_m, axis=0)
    for unit, factor in units.items():
        for origin in (np.zeros(3), middle):
            scaled = (xyz_m - origin) / factor + origin
            if has_wall(scaled, kind, ends_m, radius_m, azimuth_rad):
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
                sphere = _fit_sphere(xyz_m, radius_m * factor)
            except SolutionError:
                continue
            deviation = np.abs(sphere.places(xyz_m)[2])
            if np.mean(deviation < CLEAR_BAND * sphere.radius_m) > MOST_OF_THEM:
                return message(
                    "cloud_of_sphere",
                    "the points lie on a sphere of a radius of about {radius_m:.3f} m, not on a "
                    "cylinder: check tank.kind",
                    radius_m=sphere.radius_m,
                )
    for trial, turns, code in _alternative_kinds(kind, azimuth_rad):
        if any(has_wall(xyz_m, trial, None, radius_m, turn) for turn in turns):
            return code
    for factor in np.geomspace(0.4, 2.5, 33):
        trial = radius_m * factor
        try:
            surface, _ = _fit_surface(xyz_m, kind, ends_m, trial, azimuth_rad)
        except SolutionError:
            continue
        return _message_other_radius(radius_m, surface.radius_m)
    return None


def _alternative_kinds(kind, azimuth_rad):
    """Return other kinds of tank to try: (kind, azimuths, message if the wall is found)."""
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


def has_wall(xyz_m, kind, ends_m, radius_m, azimuth_rad=0.0):
    """Whether points (n, 3) show a wall, with the parameters of `find_surface`."""
    if len(xyz_m) < FEWEST:
        return False
    try:
        _fit_surface(xyz_m, kind, ends_m, radius_m, azimuth_rad)
    except SolutionError:
        return False
    return True


def _cloud_error(text):
    return InputError(Problem(FILE, text))


# ---- approximate surfaces of a wall: upright or lying cylinder, and sphere


def _turn(x, y):
    """Azimuth arctan2(x, y) from 0 to 2 pi; three times as fast as the remainder."""
    turn = np.arctan2(x, y)
    turn += FULL_TURN * (turn < 0)
    return turn


@dataclass(frozen=True)
class CylinderSurface:
    """Approximate cylinder; distances are normal to the third vector of its frame.

    Attributes
    ----------
    centre_m : ndarray, shape (3,)
        Point of the axis, m.
    radius_m : float
        Radius, m.
    slope : tuple of float
        Displacement of the axis along the first two vectors per metre along the third.
    frame : ndarray, shape (3, 3)
        Unit vectors in the rows. The azimuth is 0 along the second vector and increases towards the
        first. For an upright tank the vectors are x, y and z, and u is the height.
    """

    centre_m: np.ndarray
    radius_m: float
    slope: tuple[float, float] = (0.0, 0.0)
    frame: np.ndarray = field(default_factory=lambda: np.eye(3))

    def local(self, xyz_m):
        """Coordinates (3, n) of points in the frame, relative to the centre."""
        columns = np.ascontiguousarray((xyz_m - self.centre_m).T)
        if np.array_equal(self.frame, np.eye(3)):
            return columns
        # The rounding of a matrix product would depend on the number of points.
        x, y, z = columns
        return np.stack([a * x + b * y + c * z for a, b, c in self.frame])

    def places(self, xyz_m):
        """Convert points (n, 3) to u (m), azimuth (rad) and distance outwards (m), each (n,)."""
        x, y, z = self.local(xyz_m)
        x -= self.slope[0] * z
        y -= self.slope[1] * z
        distance = np.sqrt(x * x + y * y) - self.radius_m
        return z + self.origin, _turn(x, y), distance

    def points(self, u, turn, distance):
        """Convert u (m), azimuth (rad) and distance outwards (m), each (n,), to points (n, 3)."""
        z = u - self.origin
        r = self.radius_m + distance
        x, y = r * np.sin(turn) + self.slope[0] * z, r * np.cos(turn) + self.slope[1] * z
        return np.column_stack([x, y, z]) @ self.frame + self.centre_m

    @property
    def origin(self):
        """Coordinate u of the centre, m."""
        return float(self.frame[2] @ self.centre_m)

    def width_m(self, u):
        """Radius of the circle of a row at u, m."""
        return np.full(np.shape(u), self.radius_m)


@dataclass(frozen=True)
class SphereSurface:
    """Approximate sphere; u is the height on the sphere, so that equal rows have equal areas.

    Attributes
    ----------
    centre_m : ndarray, shape (3,)
        Centre, m.
    radius_m : float
        Radius, m.
    """

    centre_m: np.ndarray
    radius_m: float

    def places(self, xyz_m):
        """Convert points (n, 3) to u (m), azimuth (rad) and distance outwards (m), each (n,)."""
        x, y, z = np.ascontiguousarray((xyz_m - self.centre_m).T)
        distance = np.sqrt(x * x + y * y + z * z)
        up = self.radius_m * z / np.maximum(distance, np.finfo(float).tiny)
        return up + self.centre_m[2], _turn(x, y), distance - self.radius_m

    def points(self, u, turn, distance):
        """Convert u (m), azimuth (rad) and distance outwards (m), each (n,), to points (n, 3)."""
        sine = np.clip((u - self.centre_m[2]) / self.radius_m, -1, 1)
        level = np.sqrt(1 - sine**2)
        normal = np.column_stack([level * np.sin(turn), level * np.cos(turn), sine])
        return self.centre_m + (self.radius_m + distance)[:, None] * normal

    def width_m(self, u):
        """Radius of the circle of a row at u, m."""
        return np.sqrt(np.maximum(self.radius_m**2 - (np.asarray(u) - self.centre_m[2]) ** 2, 0))
