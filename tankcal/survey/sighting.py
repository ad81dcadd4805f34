"""Bare hits of a wall by a total station: no target, no name, each a place on the wall.

From a set-up S whose circle has its zero at azimuth w, with a distance d as the certificate has it,

    d' = (d - offset - q g(inc)) / (1 + scale),     g(inc) = 1 / cos(inc) - 1,
    hit = S + d' (sin zen sin(w + dir), sin zen cos(w + dir), cos zen),

inc the angle between the sight and the wall's normal and q the bias of ranging at 60 degrees. What
the hits of a set-up share, its place and the zero of its circle, and what all hits of an instrument
share, scale, offset and q, are columns of their covariance: one unknown each.

Source: ISO 7507-4; API MPMS 2.2D (method).
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.geometry.circles import taubin_circle
from tankcal.survey.points import Points
from tankcal.survey.readings import certified_distance_m
from tankcal.survey.results import Cause

NETWORK, FRAME, WALL = "network", "frame", "wall"  # what ties a set-up
STEEPEST = np.cos(np.radians(85))  # of the incidence: beyond, 1 / cos says nothing


@dataclass(frozen=True)
class Poses:
    """Where instruments stood and where the zeros of their circles pointed; p poses, k instruments.

    Attributes
    ----------
    keys : tuple of (str, str or None)
        (set-up, set) of each.
    xyz_m : ndarray, shape (p, 3)
        Where their axes cross.
    orientation_rad : ndarray, shape (p,)
        Azimuth of the zero.
    instruments : tuple of str
    scale, offset_m : ndarray, shape (k,)
        As known: reading = (1 + scale) true + offset.
    covariance : ndarray, shape (4 p + 2 k, 4 p + 2 k)
        Of x, y, z, orientation of each pose, then of scale and offset of each instrument; 0 for an
        offset that nothing has told, and for poses that the wall alone ties.
    ties : tuple of str
        Of each pose: NETWORK, FRAME (it is the frame itself) or WALL (the wall alone).
    """

    keys: tuple
    xyz_m: np.ndarray
    orientation_rad: np.ndarray
    instruments: tuple
    scale: np.ndarray
    offset_m: np.ndarray
    covariance: np.ndarray
    ties: tuple

    def place_of(self, hits):
        """(n,) place of the pose of each hit among these."""
        place = {key: i for i, key in enumerate(self.keys)}
        return np.array([place[key] for key in zip(hits.setup, hits.set, strict=True)])


@dataclass(frozen=True)
class Beside:
    """Targets of the wall beside sights that name none.

    Attributes
    ----------
    points : Points
        k targets on the wall, as the network has them.
    with_poses : ndarray, shape (u, 3 k)
        Covariance of all that `Poses.covariance` is of with their coordinates, m2.
    """

    points: Points
    with_poses: np.ndarray

    def after(self, sights, by_poses):
        """`Points` of n sights, and then of the targets: with one covariance, and each cause once.

        by_poses  (3 n, u) derivative of the sights
        """
        own, count = self.points, len(sights.names)
        across = by_poses @ self.with_poses
        covariance = np.block([[sights.covariance_m2, across], [across.T, own.covariance_m2]])
        more = 3 * len(own.names)

        def longer(column):
            return np.pad(column, (0, more))

        causes = {(one.name, one.what): replace(one, column_m=longer(one.column_m))
                  for one in sights.causes}  # fmt: skip
        for one in own.causes:
            key, column = (one.name, one.what), np.pad(one.column_m, (3 * count, 0))
            known = causes.get(key)
            both = column if known is None else known.column_m + column
            causes[key] = replace(known or one, column_m=both)
        return replace(
            sights,
            names=sights.names + own.names,
            xyz_m=np.vstack([sights.xyz_m, own.xyz_m]),
            covariance_m2=covariance,
            section=sights.section + own.section,
            generatrix=sights.generatrix + own.generatrix,
            rows=sights.rows + (None,) * len(own.names),
            causes=tuple(causes.values()),
            unbound=tuple(replace(one, column_m=longer(one.column_m)) for one in sights.unbound),
            by_inputs={name: longer(one) for name, one in sights.by_inputs.items()},
        )


@dataclass(frozen=True)
class Sighting:
    """Hits as points, and how they came about.

    Attributes
    ----------
    points : Points
        Of all n hits; those that are only compared are among them. Of a `Result` without their
        covariance, which may be half a gigabyte: `sight` makes it of hits and poses.
    poses : Poses
    pose : ndarray of int, shape (n,)
        Of each hit.
    incidence_rad : ndarray, shape (n,)
        Between the sight and the wall's normal, from the circle through all hits in plan.
    is_inside : ndarray of bool, shape (n,)
        Whether its set-up stands within that circle.
    normal : ndarray, shape (n, 3)
        Of that circle, outwards.
    told_m : dict
        {instrument: offset that the wall told of it}, m, as it was taken off.
    told : tuple of ToldCause
        What the wall says of offsets and scales; (): it was not asked yet.
    by_poses : ndarray, shape (3 n, u)
        Derivative of the points by all that `Poses.covariance` is of.
    beside : Beside or None
        Targets of the wall from the same network.
    """

    points: Points
    poses: Poses
    pose: np.ndarray
    incidence_rad: np.ndarray
    is_inside: np.ndarray
    normal: np.ndarray
    told_m: dict = field(default_factory=dict)
    told: tuple = ()
    by_poses: np.ndarray | None = None
    beside: "Beside | None" = None


def sight(hits, poses, told_m=None):
    """`Sighting` of hits from known poses.

    Parameters
    ----------
    hits : WallHits
    poses : Poses
    told_m : dict, optional
        {instrument: offset that the wall has told of it}, m.

    Returns
    -------
    Sighting
        Its points with their full covariance; an offset that nothing has told, and poses that the
        wall alone ties, are not in it, but among the `unbound` of the points.
    """
    told_m = told_m or {}
    told = np.array([told_m.get(name, 0.0) for name in poses.instruments])
    poses = replace(poses, offset_m=poses.offset_m + told)
    pose = poses.place_of(hits)
    tool = np.array([poses.instruments.index(name) for name in hits.instrument])
    distance = (certified_m(hits) - poses.offset_m[tool]) / (1 + poses.scale[tool])
    azimuth = poses.orientation_rad[pose] + hits.direction_rad
    ray, by_azimuth, by_zenith = rays(azimuth, hits.zenith_rad)
    xyz = poses.xyz_m[pose] + distance[:, None] * ray
    cosine, inside, normal = incidence_in_plan(xyz, poses.xyz_m[pose], ray)
    # by x, y, z, orientation of each pose, then by scale and offset of each instrument
    n, p, k = len(hits), len(poses.keys), len(poses.instruments)
    by = np.zeros((n, 3, 4 * p + 2 * k))
    one = np.arange(n)
    for axis in range(3):
        by[one, axis, 4 * pose + axis] = 1.0
    along = distance[:, None] * by_azimuth
    by[one, :, 4 * pose + 3] = along
    stretch = 1 + poses.scale[tool]
    by[one, :, 4 * p + 2 * tool] = -(distance / stretch)[:, None] * ray
    by[one, :, 4 * p + 2 * tool + 1] = -ray / stretch[:, None]
    by = by.reshape(3 * n, -1)
    own = np.stack(
        [
            hits.sd_m[:, None] * ray,
            hits.sd_rad[:, None] * distance[:, None] * by_zenith,
            hits.sd_rad[:, None] * along,
        ],
        axis=2,
    )
    causes, unbound = _causes(hits, poses, by, tool, ray, cosine)
    unbound += _of_untied(poses, by)
    biases = [cause.column_m for cause in causes if cause.what == "incidence"]
    covariance = (
        np.column_stack([by @ poses.covariance, *biases]) @ np.column_stack([by, *biases]).T
    )
    covariance.reshape(n, 3, n, 3)[one, :, one] += own @ own.transpose(0, 2, 1)
    points = Points(
        names=tuple(f"{name} {row}" for name, row in zip(hits.setup, _rows(hits), strict=True)),
        xyz_m=xyz,
        sd_m=None,
        covariance_m2=covariance,
        section=(None,) * n,
        generatrix=(None,) * n,
        rows=tuple(_rows(hits)),
        causes=tuple(causes),
        from_adjustment=True,
        unbound=tuple(unbound),
        file=hits.file,
    )
    return Sighting(points, poses, pose, np.arccos(cosine), inside, normal, told_m, by_poses=by)


def _rows(hits):
    return hits.rows or range(1, len(hits) + 1)


def certified_m(hits):
    """(n,) distances of hits after the certificates of their instruments."""
    read = zip(hits.distance_m, hits.instrument, strict=True)
    return np.array([certified_distance_m(one, hits.instruments[name]) for one, name in read])


def rays(azimuth_rad, zenith_rad):
    """(n, 3) direction of each sight, and its derivatives by azimuth and zenith angle."""
    sin, cos = np.sin(azimuth_rad), np.cos(azimuth_rad)
    down, up = np.sin(zenith_rad), np.cos(zenith_rad)
    ray = np.column_stack([down * sin, down * cos, up])
    by_azimuth = np.column_stack([down * cos, -down * sin, np.zeros_like(up)])
    return ray, by_azimuth, np.column_stack([up * sin, up * cos, -down])


def bias_by_incidence(cosine):
    """(n,) g = 1 / cos(incidence) - 1: 1 at 60 degrees, and no more than at 85 degrees."""
    return 1 / np.maximum(cosine, STEEPEST) - 1


def incidence_in_plan(xyz, station, ray):
    """(n,) cosine of the incidence, whether the station is within the circle through all, and
    (n, 3) its normal.
    """
    middle = np.median(xyz[:, :2], axis=0)
    x, y, radius = taubin_circle(xyz[:, :2] - middle)
    centre = middle + [x, y]
    normal = xyz[:, :2] - centre
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    cosine = np.abs(np.sum(ray[:, :2] * normal, axis=1))
    inside = np.linalg.norm(station[:, :2] - centre, axis=1) < radius
    return np.clip(cosine, 0, 1), inside, np.pad(normal, ((0, 0), (0, 1)))


def _causes(hits, poses, by, tool, ray, cosine):
    """Causes that hits share, as the covariance has them, and those that nothing binds."""
    causes, unbound, p = [], [], len(poses.keys)
    for i, name in enumerate(poses.instruments):
        known = hits.instruments[name]
        for what, at, u, factor, unit in (
            ("instrument_scale", 4 * p + 2 * i, known.u_scale, 1e6, "ppm"),
            ("instrument_offset", 4 * p + 2 * i + 1, known.u_offset_m, 1e3, "mm"),
        ):
            if np.isnan(u):
                if poses.covariance[at, at] == 0:
                    unbound.append(Cause(name, what, np.inf, unit, by[:, at]))
            elif u > 0:  # by what a shift of the value known beforehand does to all
                column = by @ poses.covariance[:, at] / u
                causes.append(Cause(name, what, factor * u, unit, column))
        if known.u_incidence_m:
            causes += _of_surfaces(hits, known, tool == i, ray, cosine)
    return causes, unbound


def _of_untied(poses, by):
    """x, y and orientation of poses that the wall alone ties: unknowns of the wall."""
    return [
        Cause(name, "pose", np.inf, unit, by[:, 4 * i + k])
        for i, ((name, _), tie) in enumerate(zip(poses.keys, poses.ties, strict=True))
        if tie == WALL
        for k, unit in ((0, "m"), (1, "m"), (3, "rad"))
    ]


def _of_surfaces(hits, known, mine, ray, cosine):
    """Of the bias by incidence: one unknown for each surface that an instrument saw."""
    bias = known.u_incidence_m * bias_by_incidence(cosine)
    surface, found = np.array([one or "" for one in hits.surface]), []
    for one in dict.fromkeys(surface[mine].tolist()):
        column = (np.where(mine & (surface == one), -bias, 0.0)[:, None] * ray).ravel()
        if np.any(column):
            name = f"{known.name} {one}".strip()
            found.append(Cause(name, "incidence", 1e3 * known.u_incidence_m, "mm", column))
    return found
