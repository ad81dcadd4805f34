"""Tangents to a wall from set-ups round it: each limb is a line of sight that touches the wall.

From a set-up S = (x, y) a sight of azimuth t touches the wall where the outward normal has azimuth

    right limb: f = t + 90 deg,      left limb: f = t - 90 deg,      S . n(f) = p(f).

To first order, the foot of the axis on the sight is a point of the wall. Its distance from the axis
is p(f). A shift of the set-up changes it by the component along n, a rotation by the rotation times
the length of the tangent L. The position along the sight is not observed and has no effect. The
height is

    z = z of the instrument + L cot(zenith angle).

Source: ISO 7507-3; API MPMS 2.2C (method).

Support function of a closed curve
----------------------------------

The tangent whose outward normal has the azimuth f is the line x sin f + y cos f = p(f),

    p(f) = rho + xc sin f + yc cos f + sum over k >= 2 of (p_k cos kf + q_k sin kf),
    P = 2 pi rho,      A = pi rho^2 - (pi/2) sum (k^2 - 1) (p_k^2 + q_k^2).

The support function is linear in all parameters, so no start values are required. It describes only
the convex hull. To first order, p_k and q_k are the waves of the outline.

Source: Cauchy's formula for the perimeter; Santalo 1976, section 1.1.
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.covariance import PointCovariance
from tankcal.messages import message
from tankcal.survey.points import Points
from tankcal.survey.results import Cause
from tankcal.survey.wall_hits import Poses
from tankcal.units import FULL_TURN

MOST_TANGENTS = 25_000  # largest number that was verified, see docs/studies/sizes.md
MOST_LEVELS = 300  # each level has a centre, from at least five of the 1600 sites of the wall
FEWEST_SETUPS = 3  # smallest number of set-ups of a level, with two sights each
LEAST_RISE = 0.05  # smallest sine of the zenith angle: a steeper sight touches no wall
ROUNDS, FAR_SDS = 30, 2.0  # of the robust circle; residuals, in sds, from which weights fall


def too_many_levels(count):
    """Message about more levels than the wall can have centres."""
    return message(
        "too_many_levels",
        "{count} levels; expected at most {most}: sight more limbs at fewer levels",
        count=count,
        most=MOST_LEVELS,
    )


def too_many_tangents(count):
    """Message about more tangents than can be used."""
    return message(
        "too_many_tangents",
        "{count} tangents; expected at most {most}, the largest number that was"
        " verified: take every second one",
        count=count,
        most=MOST_TANGENTS,
    )


@dataclass(frozen=True)
class Tangents:
    """n sights to the limbs of a wall, in the order of their file.

    Attributes
    ----------
    setup : tuple of str, length n
    set : tuple of str or None, length n
        Set of directions within the set-up.
    course : tuple of str, length n
    level_m : ndarray, shape (n,)
        Height of the sighted level above the zero of the table.
    is_right : ndarray of bool, shape (n,)
        Right limb as seen from the set-up.
    direction_rad : ndarray, shape (n,)
    zenith_rad : ndarray, shape (n,)
        nan: not read, the sight is at its level.
    sd_rad : ndarray, shape (n,)
        Standard deviation of each angle.
    check : ndarray of bool, shape (n,)
        True: compared only.
    setups : dict
        {name: measurements.Setup}.
    certificates : dict
        {instrument: number of its certificate, "": not given}.
    rows : tuple of int
    file : str
    """

    setup: tuple
    set: tuple
    course: tuple
    level_m: np.ndarray
    is_right: np.ndarray
    direction_rad: np.ndarray
    zenith_rad: np.ndarray
    sd_rad: np.ndarray
    check: np.ndarray
    setups: dict
    certificates: dict = field(default_factory=dict)
    rows: tuple = ()
    file: str = "tangents.csv"
    stations: dict = field(default_factory=dict)  # {}: the network has the stations

    def __len__(self):
        return len(self.setup)

    @property
    def instrument(self):
        """Names (n,) of the instruments of the sights; "": not given."""
        return tuple(self.setups[name].instrument or "" for name in self.setup)

    @property
    def levels(self):
        """Index (n,) of the level of each sight, and the levels (course, level_m) from the
        bottom up."""
        pairs = list(zip(self.course, self.level_m.tolist(), strict=True))
        levels = sorted(set(pairs), key=lambda level: level[1])
        place = {level: i for i, level in enumerate(levels)}
        return np.array([place[level] for level in pairs], dtype=int), levels


@dataclass(frozen=True)
class Hull:
    """Convex hull of the wall, touched by n tangents.

    Attributes
    ----------
    excess_m : ndarray, shape (n,)
        Expected distance of the hull outside the wall at the normal of the tangent, m.
    common_sd_m : ndarray, shape (n,)
        Standard uncertainty of the excess common to all tangents, m.
    own_sd_m : ndarray, shape (n,)
        Standard deviation of the sights from a set-up to one limb about the expected excess, m.
    slope_m : ndarray, shape (n,)
        Derivative p'(f) of the support function, m/rad: distance of the point of contact from the
        foot of the axis, in the direction of increasing azimuth.
    """

    excess_m: np.ndarray
    common_sd_m: np.ndarray
    own_sd_m: np.ndarray
    slope_m: np.ndarray


def round_hull(count):
    """`Hull` of a circular wall with `count` tangents."""
    return Hull(*np.zeros((4, count)))


def halfway(first, second):
    """Mean of two `Hull`s of the same tangents."""
    pairs = ((getattr(first, name), getattr(second, name)) for name in Hull.__annotations__)
    return Hull(*((value + other_value) / 2 for value, other_value in pairs))


@dataclass(frozen=True)
class Touching:
    """Tangents as points of the wall.

    Attributes
    ----------
    points : Points
        All n sights, including those compared only.
    poses : Poses
    pose : ndarray of int, shape (n,)
        Index of the pose of each sight.
    azimuth_rad : ndarray, shape (n,)
        Azimuth of the sight.
    normal_rad : ndarray, shape (n,)
        Azimuth f of the outward normal.
    support_m : ndarray, shape (n,)
        Support function p relative to `origin_m`.
    length_m : ndarray, shape (n,)
        Length of the tangent in plan.
    origin_m : ndarray, shape (2,)
        Approximate centre of the tank.
    seen_right : ndarray of bool, shape (n,)
        Limb that the sight passes.
    hull : Hull
    """

    points: Points
    poses: Poses
    pose: np.ndarray
    azimuth_rad: np.ndarray
    normal_rad: np.ndarray
    support_m: np.ndarray
    length_m: np.ndarray
    origin_m: np.ndarray
    seen_right: np.ndarray
    hull: Hull


def normals_of(azimuth_rad, is_right):
    """Outward normals at the points of contact of sights.

    Parameters
    ----------
    azimuth_rad : array_like, shape (n,)
        Azimuths of the sights.
    is_right : ndarray of bool, shape (n,)

    Returns
    -------
    azimuth_rad : ndarray, shape (n,)
    normal : ndarray, shape (n, 2)
    """
    f = np.asarray(azimuth_rad) + np.where(is_right, np.pi / 2, -np.pi / 2)
    return f, np.column_stack([np.sin(f), np.cos(f)])


def circle_of_sights(station_m, azimuth_rad, nominal_m):
    """Fit the circle that sights touch.

    The centre determines the limb of each sight. It starts at the intersection of the bisectors of
    the stations and moves to the approximate minimum of the sum of absolute residuals, so that
    single blunders do not move it.

    Parameters
    ----------
    station_m : ndarray, shape (n, 2)
        Station of each sight.
    azimuth_rad : ndarray, shape (n,)
    nominal_m : float
        Approximate radius.

    Returns
    -------
    curve : SupportCurve
    is_right : ndarray of bool, shape (n,)
        Limb of each sight.
    residuals : ndarray, shape (n,)
        In metres.
    """
    centre = _intersect_bisectors(station_m, azimuth_rad)
    curve = SupportCurve(nominal_m, *map(float, centre), np.zeros(0), np.zeros(0))
    weight = np.ones(len(azimuth_rad))
    for _ in range(ROUNDS):
        right = _is_right(station_m, azimuth_rad, (curve.x_m, curve.y_m))
        f, normal = normals_of(azimuth_rad, right)
        support = np.sum(station_m * normal, axis=1)
        try:
            after = fit_support(f, support, sd_m=weight**-0.5)
        # Too few sights determine no circle; keep the last estimate.
        except np.linalg.LinAlgError:
            return curve, right, support - curve.support_m(f)
        moved = np.hypot(after.x_m - curve.x_m, after.y_m - curve.y_m)
        moved = max(moved, abs(after.radius_m - curve.radius_m))
        curve, residuals = after, support - after.support_m(f)
        if moved < 1e-10 * nominal_m:
            break
        spread = max(SD_OVER_MEDIAN * float(np.median(np.abs(residuals))), 1e-9 * nominal_m)
        # Huber weights: residuals beyond FAR_SDS robust standard deviations have limited influence.
        weight = np.minimum(1.0, FAR_SDS * spread / np.maximum(np.abs(residuals), 1e-12))
    return curve, right, residuals


def _intersect_bisectors(station_m, azimuth_rad):
    """Least squares intersection (2,) of the mean sights of the stations."""
    places, station_of_sight = np.unique(station_m, axis=0, return_inverse=True)
    station_of_sight = station_of_sight.ravel()
    # The mean of unit vectors avoids the jump of azimuths at a full turn.
    mean = [
        np.angle(np.mean(np.exp(1j * azimuth_rad[station_of_sight == i])))
        for i in range(len(places))
    ]
    across = np.column_stack([np.cos(mean), -np.sin(mean)])
    return np.linalg.lstsq(across, np.sum(across * places, axis=1), rcond=1e-6)[0]


def _is_right(station_m, azimuth_rad, centre):
    """Mask (n,), True where the tank lies left of the sight, which then passes its right limb."""
    away = np.asarray(centre) - station_m
    # Sign of the cross product of sight and direction to the centre.
    return away[:, 0] * np.cos(azimuth_rad) - away[:, 1] * np.sin(azimuth_rad) < 0


def touch(tangents, poses, *, zero_z_m, nominal_m, tools=(), hull=None):
    """Compute the points of tangents from known poses.

    Parameters
    ----------
    tangents : Tangents
    poses : Poses
        With the instruments of the network.
    zero_z_m : float
        z of the zero of the table, for levels without a zenith angle.
    nominal_m : float
        Radius of the tank, m.
    tools : tuple of (float, float)
        A priori standard deviations of scale and offset (m) of the instruments; nan: free.
    hull : Hull, optional
        None: the wall is circular.

    Returns
    -------
    Touching
    """
    hull = round_hull(len(tangents)) if hull is None else hull
    pose = poses.place_of(tangents)
    azimuth = poses.orientation_rad[pose] + tangents.direction_rad
    station = poses.xyz_m[pose]
    origin = _intersect_bisectors(station[:, :2], azimuth)
    local = station[:, :2] - origin
    centre, is_right_limb = _centres(tangents, local, azimuth, nominal_m)
    sight = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
    length = np.sum((centre - local) * sight, axis=1)
    f, normal = normals_of(azimuth, is_right_limb)
    # A right limb faces decreasing azimuths, a left limb increasing ones.
    to_wall = length + np.where(is_right_limb, -hull.slope_m, hull.slope_m)
    z, by_zenith = _heights(tangents, station[:, 2], to_wall, zero_z_m)
    xyz = np.column_stack(
        [station[:, :2] + length[:, None] * sight - hull.excess_m[:, None] * normal, z]
    )
    jacobian = _derivative_by_poses(
        poses, pose, normal, np.where(is_right_limb, length, -length), by_zenith != 0
    )
    own_covariance = _independent_covariance(tangents, length, by_zenith)
    causes = _causes(poses, jacobian, tools)
    # The common excess moves all tangents along their normals.
    shared = np.pad(-hull.common_sd_m[:, None] * normal, ((0, 0), (0, 1))).ravel()
    covariance = PointCovariance(own_covariance, jacobian, poses.covariance)
    # Sights from a set-up to one limb bridge the same valley of the wall: one error each.
    bridged = np.repeat(hull.own_sd_m, 3)[:, None] * _columns_of_limbs(tangents, normal)
    covariance = covariance.add_columns(bridged, np.eye(bridged.shape[1]))
    if hull.common_sd_m.any():
        size_mm = 1e3 * float(hull.common_sd_m.mean())
        causes += (Cause("", "tangent_excess", size_mm, "mm", shared),)
        covariance = covariance.add_columns(shared[:, None], np.eye(1))
    count, rows = len(tangents), tangents.rows or range(1, len(tangents) + 1)
    points = Points(
        names=tuple(f"{name} {row}" for name, row in zip(tangents.setup, rows, strict=True)),
        xyz_m=xyz,
        sd_m=None,
        covariance_m2=covariance,
        section=tuple(
            f"{course} {level:.3f}"
            for course, level in zip(tangents.course, tangents.level_m, strict=True)
        ),
        generatrix=(None,) * count,
        rows=tuple(rows),
        causes=causes,
        from_adjustment=True,
        file=tangents.file,
    )
    support = np.sum(local * normal, axis=1)
    return Touching(
        points=points,
        poses=poses,
        pose=pose,
        azimuth_rad=azimuth,
        normal_rad=f,
        support_m=support,
        length_m=length,
        origin_m=origin,
        seen_right=is_right_limb,
        hull=hull,
    )


def _centres(tangents, local, azimuth, nominal_m):
    """Centre (n, 2) of the level of each sight, and limb (n,) of each sight."""
    place, levels = tangents.levels
    centre, is_right_limb = np.zeros((len(tangents), 2)), np.zeros(len(tangents), dtype=bool)
    overall = circle_of_sights(local, azimuth, nominal_m)[0]
    for level in range(len(levels)):
        is_at_level = place == level
        curve = circle_of_sights(local[is_at_level], azimuth[is_at_level], nominal_m)[0]
        middle = np.array([curve.x_m, curve.y_m])
        # A level with too few sights has no centre of its own and takes that of all sights.
        if np.hypot(*(middle - (overall.x_m, overall.y_m))) > nominal_m / 4:
            middle = np.array([overall.x_m, overall.y_m])
        centre[is_at_level] = middle
        is_right_limb[is_at_level] = _is_right(local[is_at_level], azimuth[is_at_level], middle)
    return centre, is_right_limb


def _heights(tangents, from_z_m, length_m, zero_z_m):
    """Heights z (n,) of the points of contact, and their derivatives by the zenith angle; 0 if
    not read."""
    zenith = np.where(np.isnan(tangents.zenith_rad), np.pi / 2, tangents.zenith_rad)
    sine = np.maximum(np.sin(zenith), LEAST_RISE)
    z = from_z_m + length_m * np.cos(zenith) / sine
    # Without a zenith angle the sight is at the height of its level.
    read = np.isfinite(tangents.zenith_rad)
    return np.where(read, z, zero_z_m + tangents.level_m), np.where(read, length_m / sine**2, 0.0)


def _derivative_by_poses(poses, pose, normal, turn_m, rises):
    """Derivative (3 n, u) of the points by the poses: across the sight, and vertical."""
    n = len(pose)
    jacobian = np.zeros((n, 3, len(poses.covariance)))
    rows = np.arange(n)
    # Only the component along the normal counts; the position along the sight is not observed.
    across = normal[:, :, None] * normal[:, None, :]
    for axis in range(2):
        jacobian[rows, :2, 4 * pose + axis] = across[:, :, axis]
    jacobian[rows, 2, 4 * pose + 2] = rises
    jacobian[rows, :2, 4 * pose + 3] = turn_m[:, None] * normal
    return jacobian.reshape(3 * n, -1)


def _columns_of_limbs(tangents, normal):
    """Outward unit columns (3 n, l), one for each set-up and limb.

    A valley of the wall may extend over the whole height, and repeated sights bridge the same
    valley.
    """
    keys = list(zip(tangents.setup, tangents.is_right.tolist(), strict=True))
    limbs = {key: i for i, key in enumerate(dict.fromkeys(keys))}
    columns = np.zeros((len(keys), 3, len(limbs)))
    for i, key in enumerate(keys):
        columns[i, :2, limbs[key]] = normal[i]
    return columns.reshape(-1, len(limbs))


def _independent_covariance(tangents, length_m, by_zenith_m):
    """Independent covariance (n, 3, 3) of each sight, equal along and across the sight."""
    across = (tangents.sd_rad * length_m) ** 2
    covariance = np.zeros((len(tangents), 3, 3))
    covariance[:, 0, 0] = covariance[:, 1, 1] = across
    covariance[:, 2, 2] = (tangents.sd_rad * by_zenith_m) ** 2
    return covariance


def _causes(poses, jacobian, tools):
    """Scale and offset of the instruments of the network, transferred by its stations."""
    causes, p = [], len(poses.keys)
    for i, (name, sds) in enumerate(zip(poses.instruments, tools, strict=True)):
        for k, what, factor, unit in (
            (0, "instrument_scale", 1e6, "ppm"),
            (1, "instrument_offset", 1e3, "mm"),
        ):
            at = 4 * p + 2 * i + k
            if sds[k] > 0 and np.isfinite(sds[k]):
                column = jacobian @ poses.covariance[:, at] / sds[k]
                if column.any():
                    causes.append(Cause(name, what, factor * sds[k], unit, column))
    return tuple(causes)


@dataclass(frozen=True)
class SupportCurve:
    """Convex curve by its support function; lengths in m.

    Attributes
    ----------
    radius_m : float
        Mean of the support function.
    x_m, y_m : float
        Centre.
    p_m, q_m : ndarray, shape (orders - 1,)
        Cosine and sine amplitudes of the waves k = 2 ...
    """

    radius_m: float
    x_m: float
    y_m: float
    p_m: np.ndarray
    q_m: np.ndarray

    @property
    def perimeter_m(self):
        """Length of the curve, m."""
        return FULL_TURN * self.radius_m

    @property
    def area_m2(self):
        """Enclosed area, m2."""
        k = np.arange(2, len(self.p_m) + 2)
        waves = np.sum((k**2 - 1) * (self.p_m**2 + self.q_m**2))
        return np.pi * self.radius_m**2 - np.pi / 2 * waves

    def support_m(self, azimuth_rad):
        """Return p (n,) at azimuths (n,) of the normal, m."""
        columns = support_columns(azimuth_rad, len(self.p_m) + 1)
        waves = np.column_stack([self.p_m, self.q_m]).ravel()
        return columns @ np.concatenate([[self.radius_m, self.x_m, self.y_m], waves])


def support_columns(azimuth_rad, order):
    """Return derivatives (n, 2 order + 1) of p by rho, xc, yc, then p_k and q_k from k = 2."""
    f = np.asarray(azimuth_rad, dtype=float)
    waves = [function(k * f) for k in range(2, order + 1) for function in (np.cos, np.sin)]
    return np.column_stack([np.ones_like(f), np.sin(f), np.cos(f), *waves])


def fit_support(azimuth_rad, support_m, order=1, sd_m=1.0):
    """Fit a `SupportCurve` by least squares.

    Parameters
    ----------
    azimuth_rad : ndarray, shape (n,)
        Azimuths of the outward normals of tangents.
    support_m : ndarray, shape (n,)
        Distances of the tangents from the origin, m.
    order : int
        Highest wave; 1: a circle.
    sd_m : float or ndarray, shape (n,)
        Standard deviations of the distances, up to a common factor.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the tangents do not determine the curve.

    Examples
    --------
    >>> f = np.radians([0, 90, 180, 270])
    >>> fit_support(f, 5 + 0.1 * np.sin(f)).perimeter_m / np.pi
    10.0
    """
    # Rows divided by the standard deviations: ordinary least squares of the scaled equations.
    weight = 1 / np.broadcast_to(np.asarray(sd_m, dtype=float), np.shape(azimuth_rad))
    columns = support_columns(azimuth_rad, order)
    parameters, _, rank, _ = np.linalg.lstsq(
        weight[:, None] * columns, weight * support_m, rcond=1e-9
    )
    if rank < columns.shape[1]:
        raise np.linalg.LinAlgError("the tangents do not determine the curve")
    return SupportCurve(*map(float, parameters[:3]), parameters[3::2], parameters[4::2])
