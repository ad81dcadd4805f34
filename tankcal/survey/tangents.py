"""Tangents to a wall from set-ups round it: each limb a line of sight that touches the wall.

From a set-up S = (x, y) a sight of the azimuth t touches the wall where its outward normal has

    right limb: f = t + 90 deg,      left limb: f = t - 90 deg,      S . n(f) = p(f).

The foot of the axis on the sight is a place of the wall to the first order: its distance from the
axis is p(f), which a set-up moves by its own shift along n and by its turn times the length of the
tangent L. Along the sight the place is not observed, and nothing depends on it. It lies at

    z = z of the instrument + L cot(zenith angle).

Source: ISO 7507-3; API MPMS 2.2C (method).
"""

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg

from tankcal.geometry.support import SupportCurve, fit_support
from tankcal.survey.points import Points
from tankcal.survey.results import Cause
from tankcal.survey.sighting import Poses

LEAST_RISE = 0.05  # sine of the zenith angle: a sight steeper than that touches no wall
ROUNDS, FAR_SDS = 30, 2.0  # of the robust circle, and from which residual on a tangent counts less


@dataclass(frozen=True)
class Tangents:
    """Sights to the limbs of a wall, in the order of their file; n sights.

    Attributes
    ----------
    setup : tuple of str, length n
    set : tuple of str or None, length n
        Of directions within the set-up.
    course : tuple of str, length n
    level_m : ndarray, shape (n,)
        Height above the table's zero that was aimed at.
    is_right : ndarray of bool, shape (n,)
        The limb as seen from the set-up.
    direction_rad : ndarray, shape (n,)
    zenith_rad : ndarray, shape (n,)
        nan: not read, the sight is at its level.
    sd_rad : ndarray, shape (n,)
        Of either angle.
    check : ndarray of bool, shape (n,)
        Only compared.
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
    stations: dict = field(default_factory=dict)  # the network has them

    def __len__(self):
        return len(self.setup)

    @property
    def instrument(self):
        """(n,) name of the instrument of each sight; "": nobody said."""
        return tuple(self.setups[name].instrument or "" for name in self.setup)

    @property
    def levels(self):
        """(n,) place of the level of each sight among the distinct ones, from the bottom up, and
        (course, level_m) of these.
        """
        pairs = list(zip(self.course, self.level_m.tolist(), strict=True))
        found = sorted(set(pairs), key=lambda one: one[1])
        place = {one: i for i, one in enumerate(found)}
        return np.array([place[one] for one in pairs], dtype=int), found


@dataclass(frozen=True)
class Hull:
    """Convex hull of the wall, which tangents touch, at n tangents.

    Attributes
    ----------
    excess_m : ndarray, shape (n,)
        By how much the hull is expected to stand outside the wall at the normal of the tangent, m.
    common_sd_m : ndarray, shape (n,)
        Standard uncertainty of the excess that all tangents share, m.
    own_sd_m : ndarray, shape (n,)
        Standard deviation of the sights from a set-up to one limb about the expected excess, m.
    slope_m : ndarray, shape (n,)
        Derivative p'(f) of the support function, m/rad: the tangent touches the wall at this
        distance from the foot of the axis, in the direction of growing azimuths.
    """

    excess_m: np.ndarray
    common_sd_m: np.ndarray
    own_sd_m: np.ndarray
    slope_m: np.ndarray


def round_hull(count):
    """`Hull` of a circular wall at so many tangents."""
    return Hull(*np.zeros((4, count)))


def halfway(first, second):
    """Mean of two `Hull`s of the same tangents."""
    pairs = ((getattr(first, name), getattr(second, name)) for name in Hull.__annotations__)
    return Hull(*((one + other) / 2 for one, other in pairs))


@dataclass(frozen=True)
class Touching:
    """Tangents as places of the wall.

    Attributes
    ----------
    points : Points
        Of all n sights; those that are only compared are among them.
    poses : Poses
    pose : ndarray of int, shape (n,)
        Of each sight.
    azimuth_rad : ndarray, shape (n,)
        Of the sight.
    normal_rad : ndarray, shape (n,)
        Azimuth f of the outward normal.
    support_m : ndarray, shape (n,)
        p, about `origin_m`.
    length_m : ndarray, shape (n,)
        Of the tangent, in plan.
    origin_m : ndarray, shape (2,)
        In the middle of the tank, about.
    seen_right : ndarray of bool, shape (n,)
        The limb that the sight passes at.
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
    """(n,) azimuth of the outward normal where sights of these azimuths touch, and (n, 2) it."""
    f = np.asarray(azimuth_rad) + np.where(is_right, np.pi / 2, -np.pi / 2)
    return f, np.column_stack([np.sin(f), np.cos(f)])


def circle_of_sights(station_m, azimuth_rad, nominal_m):
    """The circle that sights touch: `SupportCurve`, which limb each is at, and (n,) residuals.

    Parameters
    ----------
    station_m : ndarray, shape (n, 2)
        Where each sight is taken from.
    azimuth_rad : ndarray, shape (n,)
    nominal_m : float
        Its radius, about.

    Notes
    -----
    Which limb a sight is at follows from the centre. That is where the bisectors of the stations
    meet, and then that of least sum of absolute residuals, about: single slips do not move it.
    """
    centre = _of_bisectors(station_m, azimuth_rad)
    curve = SupportCurve(nominal_m, *map(float, centre), np.zeros(0), np.zeros(0))
    weight = np.ones(len(azimuth_rad))
    for _ in range(ROUNDS):
        right = _is_right(station_m, azimuth_rad, (curve.x_m, curve.y_m))
        f, normal = normals_of(azimuth_rad, right)
        support = np.sum(station_m * normal, axis=1)
        try:
            after = fit_support(f, support, sd_m=weight**-0.5)
        except np.linalg.LinAlgError:
            return curve, right, support - curve.support_m(f)
        moved = np.hypot(after.x_m - curve.x_m, after.y_m - curve.y_m)
        moved = max(moved, abs(after.radius_m - curve.radius_m))
        curve, left = after, support - after.support_m(f)
        if moved < 1e-10 * nominal_m:
            break
        spread = max(1.4826 * float(np.median(np.abs(left))), 1e-9 * nominal_m)
        weight = np.minimum(1.0, FAR_SDS * spread / np.maximum(np.abs(left), 1e-12))
    return curve, right, left


def _of_bisectors(station_m, azimuth_rad):
    """(2,) where the mean sights of the stations meet."""
    places, of = np.unique(station_m, axis=0, return_inverse=True)
    of = of.ravel()
    mean = [np.angle(np.mean(np.exp(1j * azimuth_rad[of == i]))) for i in range(len(places))]
    across = np.column_stack([np.cos(mean), -np.sin(mean)])
    return np.linalg.lstsq(across, np.sum(across * places, axis=1), rcond=1e-6)[0]


def _is_right(station_m, azimuth_rad, centre):
    """(n,) whether the tank lies to the left of each sight, so that it is at the right limb."""
    away = np.asarray(centre) - station_m
    return away[:, 0] * np.cos(azimuth_rad) - away[:, 1] * np.sin(azimuth_rad) < 0


def touch(tangents, poses, *, zero_z_m, nominal_m, tools=(), hull=None):
    """`Touching` of tangents from known poses.

    Parameters
    ----------
    tangents : Tangents
    poses : Poses
        With the instruments of the network.
    zero_z_m : float
        z of the table's zero, of levels without a zenith angle.
    nominal_m : float
        Radius of the tank.
    tools : tuple of (float, float)
        Standard deviation of scale and of offset (m) of each of the instruments, as they were known
        beforehand; nan: free.
    hull : Hull, optional
        None: the wall is circular.
    """
    hull = round_hull(len(tangents)) if hull is None else hull
    pose = poses.place_of(tangents)
    azimuth = poses.orientation_rad[pose] + tangents.direction_rad
    station = poses.xyz_m[pose]
    origin = _of_bisectors(station[:, :2], azimuth)
    local = station[:, :2] - origin
    centre, seen = _centres(tangents, local, azimuth, nominal_m)
    sight = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
    length = np.sum((centre - local) * sight, axis=1)
    f, normal = normals_of(azimuth, seen)
    # right limbs look towards falling azimuths, left limbs towards growing ones
    to_wall = length + np.where(seen, -hull.slope_m, hull.slope_m)
    z, by_zenith = _heights(tangents, station[:, 2], to_wall, zero_z_m)
    xyz = np.column_stack(
        [station[:, :2] + length[:, None] * sight - hull.excess_m[:, None] * normal, z]
    )
    by = _by_poses(poses, pose, normal, np.where(seen, length, -length), by_zenith != 0)
    own = _own(tangents, length, by_zenith)
    causes = _causes(poses, by, tools)
    shared = np.pad(-hull.common_sd_m[:, None] * normal, ((0, 0), (0, 1))).ravel()
    covariance = scipy.linalg.block_diag(*own) + by @ poses.covariance @ by.T
    bridged = np.repeat(hull.own_sd_m, 3)[:, None] * _by_limbs(tangents, normal)
    covariance += bridged @ bridged.T
    if hull.common_sd_m.any():
        size_mm = 1e3 * float(hull.common_sd_m.mean())
        causes += (Cause("", "tangent_excess", size_mm, "mm", shared),)
        covariance += np.outer(shared, shared)
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
        seen_right=seen,
        hull=hull,
    )


def _centres(tangents, local, azimuth, nominal_m):
    """(n, 2) centre of the level of each sight, and (n,) which limb it is at."""
    place, levels = tangents.levels
    centre, seen = np.zeros((len(tangents), 2)), np.zeros(len(tangents), dtype=bool)
    whole = circle_of_sights(local, azimuth, nominal_m)[0]
    for one in range(len(levels)):
        mine = place == one
        curve = circle_of_sights(local[mine], azimuth[mine], nominal_m)[0]
        middle = np.array([curve.x_m, curve.y_m])
        if np.hypot(*(middle - (whole.x_m, whole.y_m))) > nominal_m / 4:  # too few of its own
            middle = np.array([whole.x_m, whole.y_m])
        centre[mine] = middle
        seen[mine] = _is_right(local[mine], azimuth[mine], middle)
    return centre, seen


def _heights(tangents, from_z_m, length_m, zero_z_m):
    """(n,) z of the touching points, and its derivative by the zenith angle; 0 without one."""
    zenith = np.where(np.isnan(tangents.zenith_rad), np.pi / 2, tangents.zenith_rad)
    sine = np.maximum(np.sin(zenith), LEAST_RISE)
    z = from_z_m + length_m * np.cos(zenith) / sine
    read = np.isfinite(tangents.zenith_rad)
    return np.where(read, z, zero_z_m + tangents.level_m), np.where(read, length_m / sine**2, 0.0)


def _by_poses(poses, pose, normal, turn_m, rises):
    """(3 n, u) derivative of the places by the poses: across the sight, and up."""
    n = len(pose)
    by = np.zeros((n, 3, len(poses.covariance)))
    one = np.arange(n)
    across = normal[:, :, None] * normal[:, None, :]
    for axis in range(2):
        by[one, :2, 4 * pose + axis] = across[:, :, axis]
    by[one, 2, 4 * pose + 2] = rises
    by[one, :2, 4 * pose + 3] = turn_m[:, None] * normal
    return by.reshape(3 * n, -1)


def _by_limbs(tangents, normal):
    """(3 n, l) outwards, of all sights from a set-up to one limb: a valley that they bridge there
    may run up the whole shell, and repeated sights bridge the same one.
    """
    keys = list(zip(tangents.setup, tangents.is_right.tolist(), strict=True))
    limbs = {key: i for i, key in enumerate(dict.fromkeys(keys))}
    found = np.zeros((len(keys), 3, len(limbs)))
    for i, key in enumerate(keys):
        found[i, :2, limbs[key]] = normal[i]
    return found.reshape(-1, len(limbs))


def _own(tangents, length_m, by_zenith_m):
    """(n, 3, 3) covariance of what each sight has of its own; as large along it as across."""
    across = (tangents.sd_rad * length_m) ** 2
    own = np.zeros((len(tangents), 3, 3))
    own[:, 0, 0] = own[:, 1, 1] = across
    own[:, 2, 2] = (tangents.sd_rad * by_zenith_m) ** 2
    return own


def _causes(poses, by, tools):
    """Scale and offset of the instruments of the network, as its stations have them."""
    found, p = [], len(poses.keys)
    for i, (name, sds) in enumerate(zip(poses.instruments, tools, strict=True)):
        for k, what, factor, unit in (
            (0, "instrument_scale", 1e6, "ppm"),
            (1, "instrument_offset", 1e3, "mm"),
        ):
            at = 4 * p + 2 * i + k
            if sds[k] > 0 and np.isfinite(sds[k]):
                column = by @ poses.covariance[:, at] / sds[k]
                if column.any():
                    found.append(Cause(name, what, factor * sds[k], unit, column))
    return tuple(found)
