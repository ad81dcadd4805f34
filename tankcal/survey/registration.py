"""Poses of scans from targets shared with a survey and with other scans.

A scan s measures p, and a target t of it has the position

    X_t = c_s + exp(w_s) R_s b (d' - o) / ((1 + m) d),     b = p - (position of the scanner),

with d = |b|, d' the distance after the certificate, c_s the position of the scanner, w_s a small
rotation about the axes of the tank, m the scale of the scanner, and o its offset on targets. One
least squares adjustment estimates all poses. Surveyed targets enter with their full covariance,
targets shared by scans only are unknowns, and m and o have the uncertainty of their certificate.
The offset on paint differs from that on targets, so o does not determine the offset on the wall.

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
        Position by the pose minus adjusted position of the target, in the frame of the tank, m.
    w : float
        Largest normalized residual of the three coordinates; nan: the target is not controlled.
    mdb_m : float
        Minimal detectable bias along each axis with a power of 80 %; inf: not detectable.
    removed : bool
        True: rejected; residual and w are then predicted from the remaining targets.
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
    """Poses of S scans and scales of K scanners, with their joint covariance.

    Attributes
    ----------
    scans : tuple of ScanSetup
    scanners : tuple of str
    place_m : ndarray, shape (S, 3)
        Position of each scanner in the frame of the tank.
    rotation : ndarray, shape (S, 3, 3)
        From the frame of the scan to that of the tank.
    scale : ndarray, shape (K,)
        Relative excess of the measured ranges after correction by the certificate.
    covariance : ndarray, shape (6 S + K, 6 S + K)
        Of position (m) and rotation about x, y, z (rad) of each scan, then of the scales.
    ties : tuple of str
        For each scan: NETWORK (targets), FRAME (it defines the frame) or DECLARED.
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
        """Standard deviations (translation m, rotation rad) of a scan: root mean variance of its
        axes."""
        variances = self.covariance.diagonal()[6 * scan : 6 * scan + 6]
        return float(np.sqrt(variances[:3].mean())), float(np.sqrt(variances[3:].mean()))


def register(scans, tools, targets=(), known=None):
    """Estimate the poses of scans.

    Parameters
    ----------
    scans : sequence of ScanSetup
    tools : dict
        {scanner: RangingInstrument}.
    targets : sequence of ScanTarget
    known : KnownTargets, optional
        Targets surveyed in the frame of the tank.

    Returns
    -------
    Registration
        A scan with three usable targets takes its pose from them alone and ignores its declared
        pose. Other scans keep their declared pose and standard deviations. Without any known
        target, the first declared scan defines the frame.

    Raises
    ------
    SolutionError
        If the misfit of the targets can only come from wrong names, a wrong frame or a wrong unit,
        or if a scan is not tied.

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
    is_used = np.ones(len(network.targets), dtype=bool)
    try:
        solution = network.solve(is_used)
    except SolutionError:
        # A divergence may have a simple cause, which makes the better message.
        network.refuse_misnamed()
        raise
    # Search for outliers only after the global test fails: single tests would also reject valid
    # targets.
    if solution.dof > 0 and solution.chi2 > chdtri(solution.dof, ALPHA):
        network.refuse_misnamed()
        is_used, solution = _reject_blunders(network, is_used, solution)
    return _registration(network, solution, is_used)


def _reject_blunders(network, is_used, solution):
    """Reject the worst target repeatedly while one exceeds the limit; return mask and solution."""
    for _ in range(len(network.targets)):
        w, _ = network.tests(is_used)
        worst = int(np.argmax(np.nan_to_num(w)))
        if not np.nan_to_num(w)[worst] > CRITICAL:
            break
        fewer = is_used.copy()
        fewer[worst] = False
        try:
            solution = network.solve(fewer)
        # The target is needed to determine a pose.
        except SolutionError:
            break
        is_used = fewer
    return is_used, solution


def _registration(network, solution, is_used):
    """The `Registration` of the last solution of a `PoseNetwork`."""
    s, k = len(network.scans), len(network.scanners)
    _, state, cofactor = network.last
    pose = state[: 6 * s].reshape(s, 6)
    # The state holds rotation vectors; the left Jacobian converts their covariance to rotations
    # about the axes.
    by_tangent = scipy.linalg.block_diag(
        *(
            block
            for parameters in pose
            for block in (np.eye(3), left_jacobian(parameters[None, 3:])[0])
        ),
        np.eye(k),
    )
    cofactor_of_poses = cofactor[: 6 * s + k, : 6 * s + k]
    return Registration(
        network.scans,
        network.scanners,
        pose[:, :3].copy(),
        apply_small_rotation(network.rotation, pose[:, 3:]),
        state[6 * s : 6 * s + k].copy(),
        by_tangent @ cofactor_of_poses @ by_tangent.T,
        tuple(network.ties),
        _residuals(network, is_used),
        solution.dof,
        float(solution.chi2),
    )


def _residuals(network, is_used):
    """TargetResidual of each target."""
    w, mdb = network.tests(is_used)
    misclosure = network.misclosures()
    return tuple(
        TargetResidual(
            item.scan,
            item.target,
            misclosure[i],
            float(w[i]),
            float(mdb[i]),
            not is_used[i],
            item.row,
        )
        for i, item in enumerate(network.targets)
    )
