"""Means of a point cloud as points of a wall, with all that they share.

A reading of scan s, brought into the frame of the tank by the pose of s, lies at X = c_s + d r from
the place c_s of its scanner, r the beam. What it shares with others moves it by

    dX = dc_s + dw_s x (X - c_s) - d r dm - r do - r g(inc) dq,      g(inc) = 1 / cos(inc) - 1,

place and turn of the scan (six, with the joint covariance of all scans), scale m and offset o of
the scanner, and q of the scanner on a surface. They are columns of the covariance: however many
points a reading is the mean of, they do not get smaller.
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.survey.points import Points
from tankcal.survey.results import Cause
from tankcal.survey.sighting import NETWORK, bias_by_incidence

NOTHING = 1e-12  # of the largest variance of a covariance: a column below it is rounding


@dataclass(frozen=True)
class Beamed:
    """Readings of a cloud as points, and how their beams met the wall.

    Attributes
    ----------
    points : Points
    incidence_rad : ndarray, shape (n,)
        Between the beam and the wall's normal.
    told_m : dict
        {scanner: offset that the wall told of it}, m, as it was taken off.
    """

    points: Points
    incidence_rad: np.ndarray
    told_m: dict = field(default_factory=dict)


def points_of_beams(xyz_m, sd_m, scan, normal, registration, tools, *, file="", told_m=None):
    """`Beamed` of means of a cloud.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
        In the frame of the tank, by the poses of the registration, after the certificates.
    sd_m : ndarray, shape (n,)
        Of what is independent, the same in all directions.
    scan : ndarray of int, shape (n,)
        Place of the scan of each among those of the registration.
    normal : ndarray, shape (n, 3)
        Of the wall, unit vectors.
    registration : Registration
    tools : dict
        {scanner: (RangingInstrument, whether its offset is assumed, whether its scale is)}.
    file : str
        Where messages say that the points come from.
    told_m : dict, optional
        {scanner: offset that the wall has told of it}, m.

    Returns
    -------
    Beamed
        Its points have their whole covariance; an offset that nothing has told is among their
        `unbound`, not in it.
    """
    shared = shared_by_beams(xyz_m, scan, normal, registration, tools, told_m=told_m)
    n = len(xyz_m)
    columns = np.column_stack([one.column_m for one in shared.causes] or [np.zeros(3 * n)])
    covariance = columns @ columns.T
    covariance[np.diag_indices(3 * n)] += np.repeat(sd_m**2, 3)
    names = tuple(registration.scans[i].name for i in scan)
    points = Points(
        names=tuple(f"{name} {i + 1}" for i, name in enumerate(names)),
        xyz_m=shared.xyz_m,
        sd_m=None,
        covariance_m2=covariance,
        section=(None,) * n,
        generatrix=(None,) * n,
        rows=tuple(range(1, n + 1)),
        causes=shared.causes,
        from_adjustment=True,
        unbound=shared.unbound,
        file=file,
    )
    return Beamed(points, np.arccos(shared.cosine), told_m or {})


@dataclass(frozen=True)
class Shared:
    """What places in scans have in common.

    Attributes
    ----------
    xyz_m : ndarray, shape (n, 3)
        The places, with the told offsets taken off.
    causes, unbound : tuple of Cause
        As those of `Points`.
    cosine : ndarray, shape (n,)
        Of the incidence.
    """

    xyz_m: np.ndarray
    causes: tuple
    unbound: tuple
    cosine: np.ndarray


def shared_by_beams(xyz_m, scan, normal, registration, tools, *, told_m=None):
    """`Shared` of places in scans; arguments as of `points_of_beams`."""
    told_m = told_m or {}
    n, s = len(xyz_m), len(registration.scans)
    tool = tool_of(registration)[scan]
    beam = xyz_m - registration.place_m[scan]
    distance = np.maximum(np.linalg.norm(beam, axis=1), 1e-9)
    ray = beam / distance[:, None]
    told = np.array([told_m.get(name, 0.0) for name in registration.scanners])
    distance = (distance - told[tool]) / (1 + registration.scale[tool])
    beam = distance[:, None] * ray
    cosine = np.clip(np.abs(np.sum(ray * normal, axis=1)), 0, 1)
    by = np.zeros((n, 3, 6 * s + len(registration.scanners)))
    one, turned = np.arange(n), by_turn(beam)
    for axis in range(3):
        by[one, axis, 6 * scan + axis] = 1.0
        by[one, :, 6 * scan + 3 + axis] = turned[:, :, axis]
    by[one, :, 6 * s + tool] = -beam
    by = by.reshape(3 * n, -1)
    causes, unbound = _of_scanners(registration, tools, by, scan, ray, cosine)
    causes += _of_scans(registration, by, causes)
    xyz = registration.place_m[scan] + beam
    return Shared(xyz, tuple(causes), tuple(unbound), cosine)


def tool_of(registration):
    """(S,) place of the scanner of each scan among those of a registration."""
    return np.array([registration.scanners.index(one.scanner) for one in registration.scans])


def by_turn(away_m):
    """(n, 3, 3) derivative of places away (n, 3) from a scanner by a turn of it, axis by axis."""
    x, y, z = away_m.T
    zero = np.zeros_like(x)
    rows = [[zero, z, -y], [-z, zero, x], [y, -x, zero]]
    return np.array(rows).transpose(2, 0, 1)


def _of_scanners(registration, tools, by, scan, ray, cosine):
    """Causes of the scanners: scale, offset, bias by incidence; and those that nothing binds."""
    causes, unbound, s = [], [], len(registration.scans)
    surface = np.array([one.surface for one in registration.scans])
    tool = tool_of(registration)[scan]
    for i, name in enumerate(registration.scanners):
        known, offset_assumed, scale_assumed = tools[name]
        mine, at = tool == i, 6 * s + i
        if known.u_scale > 0:  # by what a shift of the value known beforehand does to all
            column = by @ registration.covariance[:, at] / known.u_scale
            u = 1e6 * known.u_scale
            causes.append(Cause(name, "instrument_scale", u, "ppm", column, scale_assumed))
        along = (np.where(mine, -1.0, 0.0)[:, None] * ray).ravel()
        if np.isnan(known.u_offset_m):
            unbound.append(Cause(name, "instrument_offset", np.inf, "mm", along))
        elif known.u_offset_m > 0:
            column, u = known.u_offset_m * along, 1e3 * known.u_offset_m
            causes.append(Cause(name, "instrument_offset", u, "mm", column, offset_assumed))
        if known.u_incidence_m > 0:
            causes += _of_surfaces(known, surface[scan], mine, ray, cosine)
    return causes, unbound


def _of_surfaces(known, surface, mine, ray, cosine):
    """Of the bias by incidence: one cause for each surface that a scanner saw."""
    bias, found = known.u_incidence_m * bias_by_incidence(cosine), []
    for one in dict.fromkeys(surface[mine].tolist()):
        column = (np.where(mine & (surface == one), -bias, 0.0)[:, None] * ray).ravel()
        if np.any(column):
            name, u = f"{known.name} {one}".strip(), 1e3 * known.u_incidence_m
            found.append(Cause(name, "incidence", u, "mm", column))
    return found


def _of_scans(registration, by, causes):
    """Causes of the registration: of each scan what those before it do not share with it.

    The joint covariance, less what the scales of the scanners have in it, is L L', scan by scan.
    """
    size = len(registration.covariance)
    left = registration.covariance.copy()
    s = len(registration.scans)
    known = {one.name: one for one in causes if one.what == "instrument_scale"}
    for i, name in enumerate(registration.scanners):
        if name in known:
            own = registration.covariance[:, 6 * s + i] / (known[name].u / 1e6)
            left -= np.outer(own, own)
    lower = semidefinite_cholesky(left)
    found = []
    for at in range(size):
        if np.any(lower[:, at]):
            which = min(at // 6, s - 1)
            scan = registration.scans[which]
            assumed = scan.is_assumed and registration.ties[which] != NETWORK
            column = by @ lower[:, at]
            found.append(Cause(scan.name, "registration", None, None, column, assumed))
    return found


def semidefinite_cholesky(covariance):
    """Lower L with L L' = covariance, which may be singular: a column of 0 for each direction.

    Examples
    --------
    >>> semidefinite_cholesky(np.array([[4.0, 2.0], [2.0, 1.0]]))
    array([[2., 0.],
           [1., 0.]])
    """
    left = np.array(covariance, dtype=float)
    least = NOTHING * np.maximum(np.diag(left), 0.0)
    lower = np.zeros_like(left)
    for i in range(len(left)):
        if left[i, i] > least[i]:
            lower[:, i] = left[:, i] / np.sqrt(left[i, i])
            left -= np.outer(lower[:, i], lower[:, i])
        left[i], left[:, i] = 0.0, 0.0
    return lower
