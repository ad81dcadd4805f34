"""Agreement of tangents with the wall and with each other, of a survey or a plan."""

from dataclasses import dataclass

import numpy as np

from tankcal.adjust import noncentrality
from tankcal.pipeline.checks.levels import girth_m
from tankcal.pipeline.checks.moved_setups import moved_setups, tested
from tankcal.pipeline.checks.survey_limits import limit_at
from tankcal.pipeline.wall.cause_correlations import noise_of_wall

RULES = "tangents"
SUSPECT = 2.0  # w of the worst set-up above which it is tested by the other set-ups


@dataclass(frozen=True)
class TangentTests:
    """Tests of n sights, in the order of their file.

    Attributes
    ----------
    used : ndarray of bool, shape (n,)
        Whether the sight determines the wall.
    departure_m : ndarray, shape (n,)
        Outward discrepancy from the wall of the other sights, m; nan for check sights.
    w : ndarray, shape (n,)
        Discrepancy over its standard deviation; nan if not tested.
    redundancy : ndarray, shape (n,)
        Share of an error of the reading that appears in the discrepancy; nan if not tested.
    mdb_m : ndarray, shape (n,)
        Minimal detectable bias of the tangent's distance, m; nan if not tested.
    setups : dict
        {set-up: (w of movement, rotation in rad, displacement (2,) in m)} (`moved_setups`).
    """

    used: np.ndarray
    departure_m: np.ndarray
    w: np.ndarray
    redundancy: np.ndarray
    mdb_m: np.ndarray
    setups: dict


def least_tangents(job):
    """Recommended number of tangents per level for the circumference of the tank."""
    return limit_at(RULES, "tangents", "least", girth_m(job))


def judge_tangents(job, wall, touching):
    """`TangentTests` of the tangents of a wall."""
    n = len(job.tangents)
    adjusted = np.flatnonzero(~job.tangents.check)  # in the order of the job's points
    departure, w, redundancy, mdb = np.full((4, n), np.nan)
    departure[adjusted], w[adjusted] = wall.shell.residual_m, wall.shell.w
    used = np.zeros(n, dtype=bool)
    used[adjusted[wall.accepted]] = True
    order = np.concatenate([section.group.members for section in wall.sections])
    sites = len(wall.field.radius_m) - len(wall.readings)
    if sites != len(order):  # several sights share a cell
        return TangentTests(used, departure, w, redundancy, mdb, {})
    sight = adjusted[wall.accepted[order]]  # sight of each reading of the field
    field = wall.field
    # A field of points alone has its noise section by section; the tests include all covariances.
    covariance = field.covariance_m2 + noise_of_wall(wall) - field.noise_m2
    precision, pull = tested(field, covariance, sites)
    weight = np.maximum(np.diag(precision), 1e-300)
    # Leave-one-out discrepancy P y / P_ii, and w = P y / sqrt(P_ii), as in data snooping.
    departure[sight], w[sight] = pull / weight, pull / np.sqrt(weight)
    variance_m2 = (job.tangents.sd_rad * touching.length_m) ** 2 + touching.hull.own_sd_m**2
    redundancy[sight] = np.clip(variance_m2[sight] * weight, 0, 1)
    mdb[sight] = noncentrality() / np.sqrt(weight)
    setups = moved_setups(
        field, covariance, np.array(job.tangents.setup)[sight], _columns(touching, sight), SUSPECT
    )
    return TangentTests(used, departure, w, redundancy, mdb, setups)


def _columns(touching, sights):
    """Derivatives (k, 3) of tangents by the rotation of the circle and shift of the station."""
    azimuth = touching.normal_rad[sights]
    length = np.where(touching.seen_right[sights], 1.0, -1.0) * touching.length_m[sights]
    return np.column_stack([length, np.sin(azimuth), np.cos(azimuth)])
