"""Poses of scans from the targets that they share with a survey and with one another.

A scan s delivers p, and a target t of it stands at

    X_t = c_s + exp(w_s) R_s b (d' - o) / ((1 + m) d),     b = p - (where the scanner stood),

d = |b|, d' that after the certificate, c_s the place of the scanner, w_s a small turn about the
axes of the tank's frame, m the scale of the scanner, and o its offset on targets. All of it is one
least squares problem: targets that a survey knows come with their whole covariance, those that
scans alone share are unknowns, m and o come with their certificate. The offset on the wall's paint
is not that on a target, so that o tells nothing of it.

Source: Mikhail & Ackermann 1976, ch. 9 (least squares); Arun et al. 1987 (start); Baarda 1968 (w).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.special import chdtri

from tankcal.adjust import ALPHA, CRITICAL
from tankcal.errors import SolutionError
from tankcal.geometry.rotations import apply_small_rotation
from tankcal.survey.pose_network import PoseNetwork, left_jacobian
from tankcal.survey.scans import KnownTargets


@dataclass(frozen=True)
class TargetResidual:
    """A target of a scan after the adjustment.

    Attributes
    ----------
    scan, target : str
    residual_m : ndarray, shape (3,)
        By the pose minus adjusted place of the target, in the frame of the tank.
    w : float
        Of the worst of its three coordinates: residual over its standard deviation; nan: the
        target is not checked by anything.
    mdb_m : float
        Smallest blunder that the test shows in 80 % of cases along each axis; inf: none.
    removed : bool
        Set aside; residual and w are then those that it would have.
    row : int or None
    """

    scan: str
    target: str
    residual_m: np.ndarray
    w: float
    mdb_m: float
    removed: bool = False
    row: int | None = None


@dataclass(frozen=True)
class Registration:
    """Poses of S scans and scales of K scanners, with all that they have in common.

    Attributes
    ----------
    scans : tuple of ScanSetup
    scanners : tuple of str
    place_m : ndarray, shape (S, 3)
        Of each scanner, in the frame of the tank.
    rotation : ndarray, shape (S, 3, 3)
        From the scan's frame to that of the tank.
    scale : ndarray, shape (K,)
        By how much more than its certificate says a scanner ranges too long, relative.
    covariance : ndarray, shape (6 S + K, 6 S + K)
        Of place (m) and turn about x, y, z (rad) of each scan, then of the scales.
    ties : tuple of str
        Of each scan: NETWORK (targets), FRAME (it is the frame itself) or DECLARED.
    residuals : tuple of TargetResidual
    dof : int
    chi2 : float
    """

    scans: tuple
    scanners: tuple
    place_m: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray
    covariance: np.ndarray
    ties: tuple
    residuals: tuple = ()
    dof: int = 0
    chi2: float = 0.0

    def sd_of(self, scan):
        """(translation m, rotation rad) of a scan: root of the mean variance of its axes."""
        own = self.covariance.diagonal()[6 * scan : 6 * scan + 6]
        return float(np.sqrt(own[:3].mean())), float(np.sqrt(own[3:].mean()))


def register(scans, tools, targets=(), known=None):
    """`Registration` of scans.

    Parameters
    ----------
    scans : sequence of ScanSetup
    tools : dict
        {scanner: RangingInstrument}.
    targets : sequence of ScanTarget
    known : KnownTargets, optional
        Those that the survey of the tank knows.

    Returns
    -------
    Registration
        A scan that has three targets which tie it takes its pose from them alone, whatever was
        declared; the others have the pose and the standard deviations that were declared. Where no
        target is known, the first scan with declared ones is the frame.

    Raises
    ------
    SolutionError
        For targets that contradict one another so much that their names, their frame or their unit
        must be wrong, and for a scan that nothing ties.

    Examples
    --------
    >>> from tankcal.survey.scans import ScanSetup
    >>> from tankcal.survey.wall_hits import RangingInstrument
    >>> alone = ScanSetup("A", "S", s_translation_m=0.0, s_rotation_rad=5e-5)
    >>> found = register([alone], {"S": RangingInstrument("S", u_offset_m=0.001)})
    >>> found.ties, found.sd_of(0)
    (('frame',), (0.0, 5e-05))
    """
    network = PoseNetwork(tuple(scans), tools, tuple(targets), known or KnownTargets())
    network.tie()
    chosen = np.ones(len(network.targets), dtype=bool)
    try:
        done = network.solve(chosen)
    except SolutionError:
        network.refuse_misnamed()
        raise
    if done.dof > 0 and done.chi2 > chdtri(done.dof, ALPHA):
        network.refuse_misnamed()
        chosen, done = _without_blunders(network, chosen, done)
    return _registration(network, done, chosen)


def _without_blunders(network, chosen, done):
    """Which targets agree, and their solution: while one is over the limit, the worst goes."""
    for _ in range(len(network.targets)):
        w, _ = network.tests(chosen)
        worst = int(np.argmax(np.nan_to_num(w)))
        if not np.nan_to_num(w)[worst] > CRITICAL:
            break
        fewer = chosen.copy()
        fewer[worst] = False
        try:
            done = network.solve(fewer)
        except SolutionError:
            break
        chosen = fewer
    return chosen, done


def _registration(network, done, chosen):
    """The `Registration` of the last solution of a `PoseNetwork`."""
    s, k = len(network.scans), len(network.scanners)
    _, state, cofactor = network.last
    pose = state[: 6 * s].reshape(s, 6)
    by_tangent = scipy.linalg.block_diag(
        *(block for one in pose for block in (np.eye(3), left_jacobian(one[None, 3:])[0])),
        np.eye(k),
    )
    own = cofactor[: 6 * s + k, : 6 * s + k]
    return Registration(
        network.scans,
        network.scanners,
        pose[:, :3].copy(),
        apply_small_rotation(network.rotation, pose[:, 3:]),
        state[6 * s : 6 * s + k].copy(),
        by_tangent @ own @ by_tangent.T,
        tuple(network.ties),
        _residuals(network, chosen),
        done.dof,
        float(done.chi2),
    )


def _residuals(network, chosen):
    w, mdb = network.tests(chosen)
    misclosure = network.misclosures()
    return tuple(
        TargetResidual(
            one.scan, one.target, misclosure[i], float(w[i]), float(mdb[i]), not chosen[i], one.row
        )
        for i, one in enumerate(network.targets)
    )
