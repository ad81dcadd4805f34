"""Scans of a wall: declared position, scanner and targets, and poses from shared targets.

Targets are shared with a survey and with other scans. A scan s measures p, and a target t of it has
the position

    X_t = c_s + exp(w_s) R_s b (d' - o) / ((1 + m) d),     b = p - (position of the scanner),

with d = |b|, d' the distance after the certificate, c_s the position of the scanner, w_s a small
rotation about the axes of the tank, m the scale of the scanner, and o its offset on targets. One
least squares adjustment estimates all poses. Surveyed targets enter with their full covariance,
targets shared by scans only are unknowns, and m and o have the uncertainty of their certificate.
The offset on paint differs from that on targets, so o does not determine the offset on the wall.
Targets with wrong names, a wrong frame or a wrong unit are detected by rigid motions of a scan.

Source: Mikhail & Ackermann 1976, ch. 9 (least squares); Arun et al. 1987 (start); Baarda 1968 (w).
"""

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg
from scipy.special import chdtri

from tankcal.adjust import ALPHA, CRITICAL, adjust
from tankcal.errors import SolutionError
from tankcal.geometry.rotations import apply_small_rotation, vector_derivatives
from tankcal.messages import message
from tankcal.survey.beams import by_turn
from tankcal.survey.wall_hits import FRAME, NETWORK, RangingInstrument, certified_distance_m


@dataclass(frozen=True)
class ScanSetup:
    """A scan with its scanner and its declared pose.

    Attributes
    ----------
    name : str
        Unique name of the scan.
    scanner : str
    surface : str
        Surface scanned, "" if all are alike; each surface has its own incidence bias.
    pose : ndarray, shape (4, 4), or None
        From the frame of the scan to that of the tank, m; None: not given.
    beam_from_m : ndarray, shape (3,)
        Position of the scanner in the frame of the scan.
    s_translation_m, s_rotation_rad : float
        Standard deviations of the pose along and about each axis of the tank; nan: not declared.
    is_assumed : bool
        Whether one of these is an assumption of the program.
    """

    name: str
    scanner: str
    surface: str = ""
    pose: np.ndarray | None = None
    beam_from_m: np.ndarray = field(default_factory=lambda: np.zeros(3))
    s_translation_m: float = np.nan
    s_rotation_rad: float = np.nan
    is_assumed: bool = False

    @property
    def is_declared(self):
        """Whether both standard deviations of the pose are declared."""
        return not (np.isnan(self.s_translation_m) or np.isnan(self.s_rotation_rad))


@dataclass(frozen=True)
class ScanTarget:
    """A target of a scan: its position in the frame of the scan, and the sd of each axis, m."""

    scan: str
    target: str
    xyz_m: np.ndarray
    sd_m: float
    row: int | None = None


@dataclass(frozen=True)
class KnownTargets:
    """Targets with known positions, for example from a total station.

    Attributes
    ----------
    names : tuple of str
    xyz_m : ndarray, shape (k, 3)
        In the frame of the tank.
    covariance_m2 : ndarray, shape (3k, 3k)
    """

    names: tuple = ()
    xyz_m: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    covariance_m2: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True)
class Scanners:
    """Scanners by name, and the scanners with an assumed offset or scale."""

    tools: dict[str, RangingInstrument]
    assumed: tuple = ()


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
    >>> from tankcal.survey.registration import ScanSetup
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


# ---- adjustment and its tests

DECLARED = "declared"  # tie of a scan, besides NETWORK (targets) and FRAME
EXACT_M = 1e-6  # sd of a held target, which makes its covariance invertible
LOOSE_OFFSET_M = 0.01  # sd of an unknown offset on targets
DETECTED = 4.13  # noncentrality, in sds: 3.29 (level 0.1 %) + 0.84 (power 80 %)
# breadth over length of targets, below which they do not determine the rotation about their line
LIKE_A_LINE = 0.02
FEWEST = 3  # targets that determine a pose
FAR_BETTER = 5.0  # ratio of misfits that makes a wrong name, frame or unit credible
LEAST_CHANGE = 0.01  # scale error larger than that of any scanner: indicates another unit


class PoseNetwork:
    """Unknowns of a registration: poses, scales, offsets on targets, positions of targets.

    The state vector contains position and rotation of each scan (6 S), scales (K), offsets (K) and
    targets (3 T).
    """

    def __init__(self, scans, tools, targets, known):
        self.scans, self.known, self.targets = scans, known, targets
        self.scanners = tuple(dict.fromkeys(item.scanner for item in scans))
        self.tools = [tools[name] for name in self.scanners]
        place = {item.name: i for i, item in enumerate(scans)}
        self.scan = np.array([place[item.scan] for item in targets], dtype=int)
        self.tool = np.array([self.scanners.index(item.scanner) for item in scans], dtype=int)
        self.names = tuple(dict.fromkeys((*known.names, *(item.target for item in targets))))
        self.target = np.array([self.names.index(item.target) for item in targets], dtype=int)
        self.beam = self._beams()
        self.sd_m = np.array([item.sd_m for item in targets])
        self.rotation = np.array([_pose(item)[:3, :3] for item in scans])
        self.place_m = np.array([_pose(item)[:3] @ [*item.beam_from_m, 1.0] for item in scans])
        self.at_m = np.full((len(self.names), 3), np.nan)
        self.at_m[: len(known.names)] = known.xyz_m
        self.ties = [None] * len(scans)

    def _beams(self):
        """Vectors (n, 3) from scanner to target in the frame of the scan, after the certificate."""
        beams = np.zeros((len(self.targets), 3))
        for i, target in enumerate(self.targets):
            away = target.xyz_m - self.scans[self.scan[i]].beam_from_m
            distance = max(float(np.linalg.norm(away)), 1e-9)
            beams[i] = away * certified_distance_m(distance, self.tools[self.tool[self.scan[i]]])
            beams[i] /= distance
        return beams

    # start

    def tie(self):
        """Compute start values and the tie of each scan, outwards from known targets."""
        while None in self.ties:
            # Targets come first; declared poses are used only where targets do not suffice.
            best = self._best_tied()
            if best is not None:
                self._take_from_targets(best)
                continue
            declared = [
                i for i, scan in enumerate(self.scans) if self.ties[i] is None and scan.is_declared
            ]
            if not declared:
                self._refuse_untied()
            counts = [np.count_nonzero(self.scan == i) for i in declared]
            first = declared[int(np.argmax(np.array(counts) > 0))]  # prefers a scan with targets
            # Without any known target the first declared scan defines the frame.
            alone = not np.isfinite(self.at_m).any() and FRAME not in self.ties
            self.ties[first] = FRAME if alone else DECLARED
            self._place_targets(first)

    def _best_tied(self):
        """Scan with most targets at known positions; None if no scan has three."""
        is_known = np.isfinite(self.at_m[self.target, 0])
        counts = np.bincount(self.scan[is_known], minlength=len(self.scans))
        counts[[tie is not None for tie in self.ties]] = 0
        best = int(np.argmax(counts))
        return best if counts[best] >= FEWEST else None

    def _take_from_targets(self, scan):
        """Set the pose of a scan from its targets at known positions."""
        is_used = (self.scan == scan) & np.isfinite(self.at_m[self.target, 0])
        self._refuse_line(scan, self.beam[is_used])
        fit = fit_motion(self.beam[is_used], self.at_m[self.target[is_used]])
        self.rotation[scan], self.place_m[scan] = fit.rotation, fit.shift_m
        self.ties[scan] = NETWORK
        self._place_targets(scan)

    def _place_targets(self, scan):
        """Set the positions of the unknown targets of a scan from its pose."""
        is_new = (self.scan == scan) & np.isnan(self.at_m[self.target, 0])
        self.at_m[self.target[is_new]] = (
            self.beam[is_new] @ self.rotation[scan].T + self.place_m[scan]
        )

    def _refuse_line(self, scan, places):
        spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
        # The second singular value is the breadth of the targets across their line.
        if spread[1] < LIKE_A_LINE * spread[0]:
            text = message(
                "targets_on_line",
                "the targets of scan {scan!r} stand in one line; expected three that do not: the"
                " turn about that line is open",
                scan=self.scans[scan].name,
            )
            raise SolutionError(text)

    def _refuse_untied(self):
        untied = [scan.name for scan, tie in zip(self.scans, self.ties, strict=True) if tie is None]
        text = message(
            "scans_untied",
            "nothing ties scans {scans}: expected three targets of each that a survey or another"
            " scan knows, or s_translation_mm and s_rotation_arcsec in clouds.toml",
            scans=untied,
        )
        raise SolutionError(text)

    # adjustment

    def solve(self, chosen):
        """Adjust with the chosen targets.

        Parameters
        ----------
        chosen : ndarray of bool, shape (n,)
            Targets of the scans to use.

        Returns
        -------
        adjust.Adjustment
        """
        s, k, t = len(self.scans), len(self.scanners), len(self.names)
        state = np.zeros(6 * s + 2 * k + 3 * t)
        state[6 * s + 2 * k :] = self.at_m.ravel()
        state[: 6 * s].reshape(s, 6)[:, :3] = self.place_m
        prior_rows, prior, covariance = self._priors()
        used = np.flatnonzero(chosen)
        # Held unknowns are removed from the vector rather than given a large weight.
        held = self._held_mask(used)
        free = np.flatnonzero(~held)
        at_start = state.copy()

        def model(x, l):
            trial = at_start.copy()
            trial[free] = x
            misclosure, by_state = self._target_rows(trial, used)
            rows = np.vstack([by_state, np.eye(len(trial))[prior_rows]])
            w = np.concatenate([misclosure, trial[prior_rows]]) - l
            return w, rows[:, free], None

        # Observations: the misclosure of each target is zero, then the a priori values.
        observed = np.concatenate([np.zeros(3 * len(used)), prior])
        covariance_of_rows = scipy.linalg.block_diag(
            np.diag(np.repeat(self.sd_m[used] ** 2, 3)), *covariance
        )
        adjustment = adjust(model, state[free], observed, covariance_of_rows)
        whole = at_start.copy()
        whole[free] = adjustment.unknowns
        cofactor = np.zeros((len(whole), len(whole)))
        cofactor[np.ix_(free, free)] = adjustment.cofactor
        self.last = used, whole, cofactor
        return adjustment

    def _held_mask(self, used):
        """Mask (u,) of constant unknowns: exact poses, scales and offsets, unobserved targets."""
        s, k, t = len(self.scans), len(self.scanners), len(self.names)
        held = np.zeros(6 * s + 2 * k + 3 * t, dtype=bool)
        for i, scan in enumerate(self.scans):
            if self.ties[i] != NETWORK:
                held[6 * i : 6 * i + 3] = scan.s_translation_m == 0
                held[6 * i + 3 : 6 * i + 6] = scan.s_rotation_rad == 0
        for i, tool in enumerate(self.tools):
            held[6 * s + i] = tool.u_scale == 0
            # An offset without a used target has no observation and would make the normal matrix
            # singular.
            held[6 * s + k + i] = tool.u_offset_m == 0 or not np.any(
                self.tool[self.scan[used]] == i
            )
        is_observed = np.isin(np.arange(t), [*range(len(self.known.names)), *self.target[used]])
        held[6 * s + 2 * k :] = np.repeat(~is_observed, 3)
        return held

    def _priors(self):
        """Return indices of a priori observed unknowns, their values, and covariance blocks."""
        s, k, rows, values, blocks = len(self.scans), len(self.scanners), [], [], []
        for i, scan in enumerate(self.scans):
            if self.ties[i] == NETWORK:
                continue
            for first, sd, prior in (
                (0, scan.s_translation_m, self.place_m[i]),
                (3, scan.s_rotation_rad, np.zeros(3)),
            ):
                if sd > 0:
                    rows += range(6 * i + first, 6 * i + first + 3)
                    values += [*prior]
                    blocks.append(sd**2 * np.eye(3))
        for i, tool in enumerate(self.tools):
            u_offset = LOOSE_OFFSET_M if np.isnan(tool.u_offset_m) else tool.u_offset_m
            for index, u in ((6 * s + i, tool.u_scale), (6 * s + k + i, u_offset)):
                if u > 0:
                    rows.append(index)
                    values.append(0.0)
                    blocks.append([[u**2]])
        first = 6 * s + 2 * k
        rows += range(first, first + 3 * len(self.known.names))
        values += [*self.known.xyz_m.ravel()]
        if len(self.known.names):
            # The covariance of known targets may be singular (held coordinates); EXACT_M
            # regularizes it.
            exact = EXACT_M**2 * np.eye(3 * len(self.known.names))
            blocks.append(self.known.covariance_m2 + exact)
        return np.array(rows, dtype=int), np.array(values), blocks

    def _target_rows(self, state, used):
        """Misclosures (3n,) of targets, position by the pose minus adjusted, and derivatives (3n,
        u)."""
        s, k = len(self.scans), len(self.scanners)
        n, first = len(used), 6 * s + 2 * k
        scan, target = self.scan[used], self.target[used]
        tool = self.tool[scan]
        pose = state[: 6 * s].reshape(s, 6)
        turned = apply_small_rotation(self.rotation, pose[:, 3:])
        scale, offset = state[6 * s : 6 * s + k][tool], state[6 * s + k : first][tool]
        beam = np.einsum("nij,nj->ni", turned[scan], self.beam[used])
        distance = np.linalg.norm(beam, axis=1)
        ray = beam / distance[:, None]
        # Corrected distance d = (reading - offset) / (1 + scale).
        away = ((distance - offset) / (1 + scale))[:, None] * ray
        positions = state[first:].reshape(-1, 3)
        misclosure = pose[scan, :3] + away - positions[target]
        jacobian, rows = np.zeros((n, 3, len(state))), np.arange(n)
        for axis in range(3):
            jacobian[rows, axis, 6 * scan + axis] = 1.0
            jacobian[rows, axis, first + 3 * target + axis] = -1.0
        # Derivative by the rotation vector: the left Jacobian converts its change to a small
        # rotation.
        moved = by_turn(away) @ left_jacobian(pose[scan, 3:])
        for axis in range(3):
            jacobian[rows, :, 6 * scan + 3 + axis] = moved[:, :, axis]
        jacobian[rows, :, 6 * s + tool] = -away / (1 + scale)[:, None]
        jacobian[rows, :, 6 * s + k + tool] = -ray / (1 + scale)[:, None]
        return misclosure.ravel(), jacobian.reshape(3 * n, len(state))

    def misclosures(self):
        """Misclosures (n, 3) of the last solution: position by the pose minus adjusted, m."""
        return self._target_rows(self.last[1], np.arange(len(self.targets)))[0].reshape(-1, 3)

    def tests(self, chosen):
        """Test the targets of the last solution.

        Parameters
        ----------
        chosen : ndarray of bool, shape (n,)
            Targets used in the solution; rejected targets are tested by their predicted residuals.

        Returns
        -------
        w : ndarray, shape (n,)
            Largest |w| of the three coordinates of each target; nan: not controlled.
        mdb : ndarray, shape (n,)
            Minimal detectable bias along the worst axis of the tank, m.
        """
        _, state, cofactor = self.last
        every = np.arange(len(self.targets))
        misclosure, jacobian = self._target_rows(state, every)
        variance_of_model = np.einsum("ij,jk,ik->i", jacobian, cofactor, jacobian).reshape(-1, 3)
        sd2, residuals = self.sd_m[:, None] ** 2, misclosure.reshape(-1, 3)
        # Var(residual) = s^2 - a Q a' of an adjusted reading, s^2 + a Q a' of a rejected one.
        variance = np.where(chosen[:, None], sd2 - variance_of_model, sd2 + variance_of_model)
        checked = variance > 1e-9 * sd2
        safe = np.sqrt(np.where(checked, variance, 1.0))
        w = np.where(checked, np.abs(residuals) / safe, np.nan)
        # MDB = delta0 s^2 / sd(residual); for a rejected reading delta0 sd(residual).
        mdb = np.where(checked, DETECTED * np.where(chosen[:, None], sd2 / safe, safe), np.inf)
        worst = np.argmax(np.nan_to_num(w, nan=-1.0), axis=1) if len(w) else np.zeros(0, dtype=int)
        return w[every, worst], mdb.max(axis=1)

    # wrong names, frames and units

    def refuse_misnamed(self):
        """Raise SolutionError if a mirror, a unit or two exchanged names explain the misfit."""
        for scan, setup in enumerate(self.scans):
            indices = np.flatnonzero(self.scan == scan)
            beams, positions = self.beam[indices], self._places_without(scan)[self.target[indices]]
            keep = np.isfinite(positions[:, 0])
            if np.count_nonzero(keep) >= FEWEST:
                names = [self.names[self.target[i]] for i in indices[keep]]
                refuse_misnamed(
                    setup.name, beams[keep], positions[keep], names, self.sd_m[indices][keep]
                )

    def _places_without(self, scan):
        """Positions (T, 3) of targets known without a given scan; nan: unknown."""
        positions = np.full_like(self.at_m, np.nan)
        positions[: len(self.known.names)] = self.known.xyz_m
        for i in np.flatnonzero(self.scan != scan):
            if np.isnan(positions[self.target[i], 0]):
                other_scan = self.scan[i]
                positions[self.target[i]] = (
                    self.rotation[other_scan] @ self.beam[i] + self.place_m[other_scan]
                )
        return positions


def _pose(scan):
    return np.eye(4) if scan.pose is None else scan.pose


def left_jacobian(vectors):
    """Left Jacobians (n, 3, 3): small rotation per change of a rotation vector."""
    return np.linalg.inv(vector_derivatives(vectors))


@dataclass(frozen=True)
class Fit:
    """Similarity between two sets of places, with its rms misfit in metres."""

    rotation: np.ndarray
    shift_m: np.ndarray
    scale: float
    rms_m: float


def fit_motion(scan_m, tank_m, *, scaled=False, mirrored=False):
    """Fit the rigid motion that maps places of a scan to places of the tank.

    Parameters
    ----------
    own_m, there_m : ndarray, shape (n, 3)
        Places in the frame of the scan and in the frame of the tank.
    scaled : bool
        Whether to estimate a scale.
    mirrored : bool
        Whether one frame is left-handed.

    Returns
    -------
    Fit

    Examples
    --------
    >>> places = np.array([[0.0, 0, 0], [3, 0, 0], [0, 2, 0], [1, 1, 4]])
    >>> found = fit_motion(1000 * places, places + [5, 0, 1], scaled=True)
    >>> round(found.scale, 6), round(found.rms_m, 9)
    (0.001, 0.0)
    """
    # Centring both sets separates the rotation from the translation.
    middle, centre = scan_m.mean(axis=0), tank_m.mean(axis=0)
    a, b = scan_m - middle, tank_m - centre
    u, size, v = np.linalg.svd(b.T @ a)
    turn = np.linalg.det(u) * np.linalg.det(v)
    # Arun et al. 1987: the sign of the smallest singular direction selects rotation or reflection.
    sign = np.array([1.0, 1.0, -turn if mirrored else turn])
    rotation = (u * sign) @ v
    # Least squares scale: trace(S D) over the sum of squared coordinates (Umeyama 1991).
    scale = float(sign @ size / max(np.sum(a**2), 1e-30)) if scaled else 1.0
    shift = centre - scale * rotation @ middle
    residuals = tank_m - scale * scan_m @ rotation.T - shift
    return Fit(rotation, shift, scale, float(np.sqrt(np.mean(np.sum(residuals**2, axis=1)))))


def refuse_misnamed(scan, scan_m, tank_m, names, sd_m):
    """Raise SolutionError if targets fit far better mirrored, scaled or with exchanged names.

    Parameters
    ----------
    scan : str
    own, there : ndarray, shape (n, 3)
        Places of the targets in the frame of the scan and in the frame of the tank, m.
    names : sequence of str, length n
    sd_m : array_like, shape (n,)
        Standard deviations of the targets.
    """
    plain = fit_motion(scan_m, tank_m).rms_m
    far_better = plain / FAR_BETTER
    limit = max(3 * float(np.max(sd_m)), 1e-6)
    # Three points and their mirror image are congruent; only a fourth point shows the difference.
    if len(scan_m) > FEWEST and fit_motion(scan_m, tank_m, mirrored=True).rms_m < min(
        far_better, limit
    ):
        text = message(
            "targets_mirrored",
            "the targets of scan {scan!r} fit as their mirror image only; expected a right-handed"
            " frame: was an axis turned round, or x and y exchanged?",
            scan=scan,
        )
        raise SolutionError(text)
    scaled = fit_motion(scan_m, tank_m, scaled=True)
    if abs(scaled.scale - 1) > LEAST_CHANGE and scaled.rms_m < far_better:
        text = message(
            "targets_in_other_unit",
            "the targets of scan {scan!r} are {factor:.4g} times as far apart as those of the"
            " survey; expected the same: is its unit another one?",
            scan=scan,
            factor=1 / scaled.scale,
        )
        raise SolutionError(text)
    # Try every exchange of two names.
    swaps = []
    for i in range(len(scan_m)):
        for j in range(i + 1, len(scan_m)):
            order = np.arange(len(scan_m))
            order[[i, j]] = j, i
            swaps.append((fit_motion(scan_m[order], tank_m).rms_m, i, j))
    swaps.sort()
    if swaps and swaps[0][0] < min(far_better, limit):
        text = message(
            "targets_exchanged",
            "targets {one!r} and {other!r} of scan {scan!r} fit with their names exchanged;"
            " expected each under its own",
            scan=scan,
            one=names[swaps[0][1]],
            other=names[swaps[0][2]],
        )
        raise SolutionError(text)
