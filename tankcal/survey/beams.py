"""Points of a wall from means of a point cloud, with the errors they share.

A reading of scan s, transformed to the frame of the tank by the pose of s, lies at X = c_s + d r,
where c_s is the position of the scanner, d the distance and r the unit vector of the beam. Errors
shared with other readings displace it by

    dX = dc_s + dw_s x (X - c_s) - d r dm - r do - r g(inc) dq,      g(inc) = 1 / cos(inc) - 1.

These are the position and rotation of the scan (six parameters, with the joint covariance of all
scans), the scale m and offset o of the scanner, and its incidence bias q on a surface. They form
columns of the covariance: averaging more points does not reduce them.
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.covariance import PointCovariance
from tankcal.survey.points import Points
from tankcal.survey.results import Cause
from tankcal.survey.wall_hits import NETWORK, bias_by_incidence

NOTHING = 1e-12  # share of the largest variance of a covariance, below which a column is rounding


@dataclass(frozen=True)
class BeamPoints:
    """Readings of a cloud as points, with the incidence of their beams on the wall.

    Attributes
    ----------
    points : Points
    incidence_rad : ndarray, shape (n,)
        Angle between the beam and the normal of the wall.
    estimated_m : dict
        {scanner: offset estimated from the wall and already subtracted, m}.
    """

    points: Points
    incidence_rad: np.ndarray
    estimated_m: dict = field(default_factory=dict)


def points_of_beams(xyz_m, sd_m, scan, normal, registration, tools, *, file="", estimated_m=None):
    """Convert means of a cloud to points of the wall.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
        Coordinates in the frame of the tank, by the poses of the registration, after correction by
        the certificates.
    sd_m : ndarray, shape (n,)
        Independent standard deviation, equal in all directions.
    scan : ndarray of int, shape (n,)
        Index of the scan of each reading in the registration.
    normal : ndarray, shape (n, 3)
        Unit normals of the wall.
    registration : Registration
    tools : dict
        {scanner: (RangingInstrument, whether its offset is assumed, whether its scale is assumed)}.
    file : str
        Source of the points in messages.
    estimated_m : dict, optional
        {scanner: offset estimated from the wall, m}.

    Returns
    -------
    BeamPoints
        Points with their full covariance. An offset without any estimate is excluded from the
        covariance and listed in `unbound`.
    """
    shared = shared_by_beams(xyz_m, scan, normal, registration, tools, estimated_m=estimated_m)
    n = len(xyz_m)
    # Covariance = sum of column column' over the shared causes + the independent variances.
    columns = np.column_stack([cause.column_m for cause in shared.causes] or [np.zeros(3 * n)])
    covariance = PointCovariance.convert(np.repeat(sd_m**2, 3), 3).add_columns(
        columns, np.eye(columns.shape[1])
    )
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
    return BeamPoints(points, np.arccos(shared.cosine), estimated_m or {})


@dataclass(frozen=True)
class Shared:
    """Shared causes of a set of places in scans.

    Attributes
    ----------
    xyz_m : ndarray, shape (n, 3)
        Coordinates after subtraction of the estimated offsets.
    causes, unbound : tuple of Cause
        As in `Points`.
    cosine : ndarray, shape (n,)
        Cosine of the incidence.
    """

    xyz_m: np.ndarray
    causes: tuple
    unbound: tuple
    cosine: np.ndarray


def shared_by_beams(xyz_m, scan, normal, registration, tools, *, estimated_m=None):
    """Compute the shared causes of places in scans.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
        Coordinates in the frame of the tank.
    scan : ndarray of int, shape (n,)
        Index of the scan of each place in the registration.
    normal : ndarray, shape (n, 3)
        Unit normals of the wall.
    registration : Registration
    tools : dict
        {scanner: (RangingInstrument, whether its offset is assumed, whether its scale is assumed)}.
    estimated_m : dict, optional
        {scanner: offset estimated from the wall, m}.

    Returns
    -------
    Shared
    """
    estimated_m = estimated_m or {}
    n, s = len(xyz_m), len(registration.scans)
    tool = tool_of(registration)[scan]
    beam = xyz_m - registration.place_m[scan]
    distance = np.maximum(np.linalg.norm(beam, axis=1), 1e-9)
    ray = beam / distance[:, None]
    offset_m = np.array([estimated_m.get(name, 0.0) for name in registration.scanners])
    # Invert reading = (1 + scale) true + offset, with the estimated offset and scale.
    distance = (distance - offset_m[tool]) / (1 + registration.scale[tool])
    beam = distance[:, None] * ray
    cosine = np.clip(np.abs(np.sum(ray * normal, axis=1)), 0, 1)
    jacobian = np.zeros((n, 3, 6 * s + len(registration.scanners)))
    rows, by_rotation = np.arange(n), by_turn(beam)
    for axis in range(3):
        jacobian[rows, axis, 6 * scan + axis] = 1.0
        jacobian[rows, :, 6 * scan + 3 + axis] = by_rotation[:, :, axis]
    jacobian[rows, :, 6 * s + tool] = -beam
    jacobian = jacobian.reshape(3 * n, -1)
    causes, unbound = _scanner_causes(registration, tools, jacobian, scan, ray, cosine)
    causes += _registration_causes(registration, jacobian, causes)
    xyz = registration.place_m[scan] + beam
    return Shared(xyz, tuple(causes), tuple(unbound), cosine)


def tool_of(registration):
    """Index of the scanner of each scan, shape (S,), in the list of scanners of a registration."""
    return np.array([registration.scanners.index(scan.scanner) for scan in registration.scans])


def by_turn(away_m):
    """Derivative (n, 3, 3) of vectors (n, 3) from a scanner by its rotations about x, y and z."""
    x, y, z = away_m.T
    zero = np.zeros_like(x)
    rows = [[zero, z, -y], [-z, zero, x], [y, -x, zero]]
    return np.array(rows).transpose(2, 0, 1)


def _scanner_causes(registration, tools, jacobian, scan, ray, cosine):
    """Return the causes of the scanners (scale, offset, incidence bias) and the unbound causes."""
    causes, unbound, s = [], [], len(registration.scans)
    surface = np.array([one.surface for one in registration.scans])
    tool = tool_of(registration)[scan]
    for i, name in enumerate(registration.scanners):
        known, offset_assumed, scale_assumed = tools[name]
        is_of_scanner, column_of_scale = tool == i, 6 * s + i
        if known.u_scale > 0:
            # Effect of one standard uncertainty of the a priori scale after the registration: dX/dx
            # Q e / u.
            column = jacobian @ registration.covariance[:, column_of_scale] / known.u_scale
            u = 1e6 * known.u_scale
            causes.append(Cause(name, "instrument_scale", u, "ppm", column, scale_assumed))
        # A positive offset makes the reading too long, so the corrected point moves towards the
        # scanner.
        along = (np.where(is_of_scanner, -1.0, 0.0)[:, None] * ray).ravel()
        if np.isnan(known.u_offset_m):
            unbound.append(Cause(name, "instrument_offset", np.inf, "mm", along))
        elif known.u_offset_m > 0:
            column, u = known.u_offset_m * along, 1e3 * known.u_offset_m
            causes.append(Cause(name, "instrument_offset", u, "mm", column, offset_assumed))
        if known.u_incidence_m > 0:
            causes += _incidence_causes(known, surface[scan], is_of_scanner, ray, cosine)
    return causes, unbound


def _incidence_causes(known, surface, is_of_scanner, ray, cosine):
    """Return one incidence cause for each surface scanned by a scanner."""
    bias, causes = known.u_incidence_m * bias_by_incidence(cosine), []
    for name_of_surface in dict.fromkeys(surface[is_of_scanner].tolist()):
        column = (
            np.where(is_of_scanner & (surface == name_of_surface), -bias, 0.0)[:, None] * ray
        ).ravel()
        if np.any(column):
            name, u = f"{known.name} {name_of_surface}".strip(), 1e3 * known.u_incidence_m
            causes.append(Cause(name, "incidence", u, "mm", column))
    return causes


def _registration_causes(registration, jacobian, causes):
    """Return the causes of the registration, one for each column of its Cholesky factor.

    The joint covariance, less the contribution of the scanner scales, equals L L'. Column i of L
    contains the part of scan i that is independent of the scans before it.
    """
    size = len(registration.covariance)
    # The scale of a scanner is a cause of its own; counting it here again would double it.
    remainder = registration.covariance.copy()
    s = len(registration.scans)
    known = {cause.name: cause for cause in causes if cause.what == "instrument_scale"}
    for i, name in enumerate(registration.scanners):
        if name in known:
            effect_of_scale = registration.covariance[:, 6 * s + i] / (known[name].u / 1e6)
            remainder -= np.outer(effect_of_scale, effect_of_scale)
    lower = semidefinite_cholesky(remainder)
    new_causes = []
    for column_number in range(size):
        if np.any(lower[:, column_number]):
            which = min(column_number // 6, s - 1)
            # Columns beyond 6 S belong to the scales and are attributed to the last scan.
            scan = registration.scans[which]
            assumed = scan.is_assumed and registration.ties[which] != NETWORK
            column = jacobian @ lower[:, column_number]
            new_causes.append(Cause(scan.name, "registration", None, None, column, assumed))
    return new_causes


def semidefinite_cholesky(covariance):
    """Lower triangular L with L L' = covariance; singular directions have zero columns.

    Examples
    --------
    >>> semidefinite_cholesky(np.array([[4.0, 2.0], [2.0, 1.0]]))
    array([[2., 0.],
           [1., 0.]])
    """
    remainder = np.array(covariance, dtype=float)
    least = NOTHING * np.maximum(np.diag(remainder), 0.0)
    lower = np.zeros_like(remainder)
    for i in range(len(remainder)):
        if remainder[i, i] > least[i]:
            lower[:, i] = remainder[:, i] / np.sqrt(remainder[i, i])
            remainder -= np.outer(lower[:, i], lower[:, i])
        # Clear row and column i: rounding would otherwise accumulate in the later pivots.
        remainder[i], remainder[:, i] = 0.0, 0.0
    return lower
