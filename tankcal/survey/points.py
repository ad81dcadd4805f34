"""Surveyed points of a wall: read from a file, or adjusted from a survey."""

from dataclasses import dataclass, field

import numpy as np

from tankcal.covariance import PointCovariance
from tankcal.errors import SolutionError
from tankcal.geometry.circles import taubin_circle
from tankcal.messages import message
from tankcal.survey.results import Cause

LARGEST = 50_000  # points of an adjusted survey that were verified, as many as in points.csv


@dataclass(frozen=True)
class Points:
    """Surveyed points, in the order of the file.

    Attributes
    ----------
    names, rows : tuple
        Name of each point, and its row in the file for messages.
    xyz_m : ndarray, shape (n, 3)
        Coordinates.
    sd_m : ndarray, shape (n, 3), or None
        Standard deviations; None: not given (estimated from residuals).
    covariance_m2 : ndarray, shape (3n, 3n), PointCovariance, or None
        Matrix from a file, or the covariance of a survey; None: not given.
    section, generatrix : tuple
        Section and generatrix of each point, text or None.
    causes : tuple
        Named causes contained in the covariance (`survey.results.Cause`), with columns over the
        coordinates of these points: covariance = remainder + sum of column column'.
    from_adjustment : bool
        True: adjusted from a survey; the covariance has its final scale.
    unbound : tuple
        Causes without an estimate (a free offset). They are not in the covariance; their columns
        are derivatives.
    by_inputs : dict
        {input of an uncertainty budget: (3n,) derivative of the coordinates}.
    file : str
        Source of the points in messages; "": the file of the rows.
    """

    names: tuple
    xyz_m: np.ndarray
    sd_m: np.ndarray | None
    covariance_m2: np.ndarray | PointCovariance | None
    section: tuple
    generatrix: tuple
    rows: tuple
    causes: tuple = ()
    from_adjustment: bool = False
    unbound: tuple = ()
    by_inputs: dict = field(default_factory=dict)
    file: str = ""


# ---- conversion of adjusted targets to points of the wall, with their full covariance


def wall_points(adjustment, measurements, side):
    """Convert adjusted targets to points of the wall.

        wall = target - (+ inside) offset * horizontal normal of the wall, outwards

    With targets.csv the points listed there are used, otherwise all points except stations.

    Parameters
    ----------
    adjustment : Adjustment
    measurements : Measurements
        Measurements of the adjustment.
    side : str
        "outside" or "inside": position of the observer.

    Returns
    -------
    Points
        With covariance and causes.

    Raises
    ------
    SolutionError
        If no point or too many points remain.
    """
    targets = measurements.targets
    place = {name: i for i, name in enumerate(adjustment.names)}
    if targets is not None:
        rows = {name: i for i, name in enumerate(targets.point) if name in place}
    else:
        stations = {cause.station for cause in measurements.setups}
        rows = dict.fromkeys((name for name in place if name not in stations), None)
    names = tuple(rows)
    _refuse_size(len(names))
    indices = np.array([place[name] for name in names])
    xyz = adjustment.xyz_m[indices]
    section = generatrix = numbers = (None,) * len(names)
    if targets is not None:
        target_rows = list(rows.values())
        section = tuple(targets.section[i] for i in target_rows)
        generatrix = tuple(targets.generatrix[i] for i in target_rows)
        numbers = tuple(targets.rows[i] for i in target_rows) if targets.rows else numbers
        offset = np.nan_to_num(np.asarray(targets.offset_m, dtype=float)[target_rows])
        # Seen from inside, the target is on the inner side of the wall: the offset changes sign.
        xyz = move_to_wall(xyz, offset if side == "outside" else -offset)
    covariance = adjustment.covariance_of_points(names)
    coordinates = (3 * indices[:, None] + np.arange(3)).ravel()
    causes = tuple(
        Cause(cause.name, cause.what, cause.u, cause.unit, cause.column_m[coordinates])
        for cause in adjustment.causes
    )
    return Points(
        names=names, xyz_m=xyz, sd_m=None, covariance_m2=covariance, section=section,
        generatrix=generatrix, rows=numbers, causes=causes, from_adjustment=True,
    )  # fmt: skip


def move_to_wall(xyz_m, outwards_m):
    """Move points by -outwards_m along the horizontal normal, away from the axis.

    The axis is that of the circle through all points in plan (Taubin 1991). An error of a few
    centimetres in the axis is harmless: 0.1 m at a radius of 6.5 m turns a normal by 15 mrad, which
    changes an offset of 10 mm by 1 um.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
    outwards_m : ndarray, shape (n,)
        Offset of each target from the wall.

    Returns
    -------
    ndarray, shape (n, 3)

    Raises
    ------
    SolutionError
        If offsets are given for fewer than 3 points.
    """
    if not np.any(outwards_m):
        return xyz_m
    if len(xyz_m) < 3:
        raise SolutionError(
            message(
                "offsets_of_few",
                "offsets of targets need 3 points of the wall, {count} were given",
                count=len(xyz_m),
            )
        )
    # Centring limits rounding in the circle fit.
    middle = xyz_m[:, :2].mean(axis=0)
    x, y, _ = taubin_circle(xyz_m[:, :2] - middle)
    away = xyz_m[:, :2] - middle - [x, y]
    normal = away / np.linalg.norm(away, axis=1, keepdims=True)
    moved = xyz_m.copy()
    moved[:, :2] -= outwards_m[:, None] * normal
    return moved


def _refuse_size(n):
    """Raise SolutionError if a wall has no point, or more points than were verified."""
    if not n:
        raise SolutionError(
            message(
                "no_target_adjusted",
                "no target of targets.csv was adjusted: no point is left for the wall",
            )
        )
    if n > LARGEST:
        raise SolutionError(
            message(
                "wall_too_large",
                "{n} points of the wall were adjusted; expected at most {largest}, the largest"
                " number that was verified: name the targets to use in targets.csv",
                n=n,
                largest=LARGEST,
            )
        )
