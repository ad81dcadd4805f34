"""The adjustment that `registration` is: start of poses, rows of targets, tests of these."""

import numpy as np
import scipy.linalg

from tankcal.adjust import adjust
from tankcal.errors import SolutionError
from tankcal.geometry.rotations import apply_small_rotation, vector_derivatives
from tankcal.messages import message
from tankcal.survey.beams import by_turn
from tankcal.survey.misnamed_targets import FEWEST, fit_motion, refuse_misnamed
from tankcal.survey.readings import certified_distance_m
from tankcal.survey.sighting import FRAME, NETWORK

DECLARED = "declared"  # beside NETWORK (targets) and FRAME: what ties a scan
EXACT_M = 1e-6  # the sd of a target that is held: its covariance is inverted
LOOSE_OFFSET_M = 0.01  # of an offset on targets that nobody knows
DETECTED = 4.13  # sds of a reading whose test is passed in 20 % of cases: 3.29 + 0.84
LIKE_A_LINE = 0.02  # of the spread of targets along them: across it they tell no turn


class PoseNetwork:
    """The unknowns of a registration: poses, scales and offsets on targets, places of targets.

    State: place and turn of each scan (6 S), scales (K), offsets (K), targets (3 T).
    """

    def __init__(self, scans, tools, targets, known):
        self.scans, self.known, self.targets = scans, known, targets
        self.scanners = tuple(dict.fromkeys(one.scanner for one in scans))
        self.tools = [tools[name] for name in self.scanners]
        place = {one.name: i for i, one in enumerate(scans)}
        self.scan = np.array([place[one.scan] for one in targets], dtype=int)
        self.tool = np.array([self.scanners.index(one.scanner) for one in scans], dtype=int)
        self.names = tuple(dict.fromkeys((*known.names, *(one.target for one in targets))))
        self.target = np.array([self.names.index(one.target) for one in targets], dtype=int)
        self.beam = self._beams()
        self.sd_m = np.array([one.sd_m for one in targets])
        self.rotation = np.array([_pose(one)[:3, :3] for one in scans])
        self.place_m = np.array([_pose(one)[:3] @ [*one.beam_from_m, 1.0] for one in scans])
        self.at_m = np.full((len(self.names), 3), np.nan)
        self.at_m[: len(known.names)] = known.xyz_m
        self.ties = [None] * len(scans)

    def _beams(self):
        """(n, 3) from scanner to target in the frame of its scan, after the certificate."""
        found = np.zeros((len(self.targets), 3))
        for i, one in enumerate(self.targets):
            away = one.xyz_m - self.scans[self.scan[i]].beam_from_m
            distance = max(float(np.linalg.norm(away)), 1e-9)
            found[i] = away * certified_distance_m(distance, self.tools[self.tool[self.scan[i]]])
            found[i] /= distance
        return found

    # start

    def tie(self):
        """Start values, and what ties each scan: from what is known outwards, scan by scan."""
        while None in self.ties:
            best = self._best_tied()
            if best is not None:
                self._take_from_targets(best)
                continue
            held = [
                i for i, one in enumerate(self.scans) if self.ties[i] is None and one.is_declared
            ]
            if not held:
                self._refuse_untied()
            counts = [np.count_nonzero(self.scan == i) for i in held]
            first = held[int(np.argmax(np.array(counts) > 0))]  # of those with targets, if any
            alone = not np.isfinite(self.at_m).any() and FRAME not in self.ties
            self.ties[first] = FRAME if alone else DECLARED
            self._place_targets(first)

    def _best_tied(self):
        """The scan with most targets whose places are known by now; None: none has three."""
        there = np.isfinite(self.at_m[self.target, 0])
        counts = np.bincount(self.scan[there], minlength=len(self.scans))
        counts[[tie is not None for tie in self.ties]] = 0
        best = int(np.argmax(counts))
        return best if counts[best] >= FEWEST else None

    def _take_from_targets(self, scan):
        mine = (self.scan == scan) & np.isfinite(self.at_m[self.target, 0])
        self._refuse_line(scan, self.beam[mine])
        fit = fit_motion(self.beam[mine], self.at_m[self.target[mine]])
        self.rotation[scan], self.place_m[scan] = fit.rotation, fit.shift_m
        self.ties[scan] = NETWORK
        self._place_targets(scan)

    def _place_targets(self, scan):
        mine = (self.scan == scan) & np.isnan(self.at_m[self.target, 0])
        self.at_m[self.target[mine]] = self.beam[mine] @ self.rotation[scan].T + self.place_m[scan]

    def _refuse_line(self, scan, places):
        spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
        if spread[1] < LIKE_A_LINE * spread[0]:
            text = message(
                "targets_on_line",
                "the targets of scan {scan!r} stand in one line; expected three that do not: the"
                " turn about that line is open",
                scan=self.scans[scan].name,
            )
            raise SolutionError(text)

    def _refuse_untied(self):
        left = [one.name for one, tie in zip(self.scans, self.ties, strict=True) if tie is None]
        text = message(
            "scans_untied",
            "nothing ties scans {scans}: expected three targets of each that a survey or another"
            " scan knows, or s_translation_mm and s_rotation_arcsec in clouds.toml",
            scans=left,
        )
        raise SolutionError(text)

    # adjustment

    def solve(self, chosen):
        """`adjust.Adjustment` with the chosen targets (n,) of the scans."""
        s, k, t = len(self.scans), len(self.scanners), len(self.names)
        state = np.zeros(6 * s + 2 * k + 3 * t)
        state[6 * s + 2 * k :] = self.at_m.ravel()
        state[: 6 * s].reshape(s, 6)[:, :3] = self.place_m
        prior_rows, prior, covariance = self._priors()
        used = np.flatnonzero(chosen)
        held = self._held(used)
        free = np.flatnonzero(~held)
        at_start = state.copy()

        def model(x, l):
            now = at_start.copy()
            now[free] = x
            misclosure, by_state = self._target_rows(now, used)
            rows = np.vstack([by_state, np.eye(len(now))[prior_rows]])
            w = np.concatenate([misclosure, now[prior_rows]]) - l
            return w, rows[:, free], None

        observed = np.concatenate([np.zeros(3 * len(used)), prior])
        own = scipy.linalg.block_diag(np.diag(np.repeat(self.sd_m[used] ** 2, 3)), *covariance)
        done = adjust(model, state[free], observed, own)
        whole = at_start.copy()
        whole[free] = done.unknowns
        cofactor = np.zeros((len(whole), len(whole)))
        cofactor[np.ix_(free, free)] = done.cofactor
        self.last = used, whole, cofactor
        return done

    def _held(self, used):
        """(u,) which unknowns nothing may move: exact poses, scales and offsets, unseen targets."""
        s, k, t = len(self.scans), len(self.scanners), len(self.names)
        held = np.zeros(6 * s + 2 * k + 3 * t, dtype=bool)
        for i, one in enumerate(self.scans):
            if self.ties[i] != NETWORK:
                held[6 * i : 6 * i + 3] = one.s_translation_m == 0
                held[6 * i + 3 : 6 * i + 6] = one.s_rotation_rad == 0
        for i, tool in enumerate(self.tools):
            held[6 * s + i] = tool.u_scale == 0
            held[6 * s + k + i] = tool.u_offset_m == 0 or not np.any(
                self.tool[self.scan[used]] == i
            )
        seen = np.isin(np.arange(t), [*range(len(self.known.names)), *self.target[used]])
        held[6 * s + 2 * k :] = np.repeat(~seen, 3)
        return held

    def _priors(self):
        """Places in the state that are observed, their values, and blocks of their covariance."""
        s, k, rows, values, blocks = len(self.scans), len(self.scanners), [], [], []
        for i, one in enumerate(self.scans):
            if self.ties[i] == NETWORK:
                continue
            for first, sd, given in (
                (0, one.s_translation_m, self.place_m[i]),
                (3, one.s_rotation_rad, np.zeros(3)),
            ):
                if sd > 0:
                    rows += range(6 * i + first, 6 * i + first + 3)
                    values += [*given]
                    blocks.append(sd**2 * np.eye(3))
        for i, tool in enumerate(self.tools):
            u_offset = LOOSE_OFFSET_M if np.isnan(tool.u_offset_m) else tool.u_offset_m
            for at, u in ((6 * s + i, tool.u_scale), (6 * s + k + i, u_offset)):
                if u > 0:
                    rows.append(at)
                    values.append(0.0)
                    blocks.append([[u**2]])
        first = 6 * s + 2 * k
        rows += range(first, first + 3 * len(self.known.names))
        values += [*self.known.xyz_m.ravel()]
        if len(self.known.names):
            exact = EXACT_M**2 * np.eye(3 * len(self.known.names))
            blocks.append(self.known.covariance_m2 + exact)
        return np.array(rows, dtype=int), np.array(values), blocks

    def _target_rows(self, state, used):
        """(3n,) by the pose minus place of each target, and (3n, u) its derivative."""
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
        away = ((distance - offset) / (1 + scale))[:, None] * ray
        at = state[first:].reshape(-1, 3)
        misclosure = pose[scan, :3] + away - at[target]
        by, one = np.zeros((n, 3, len(state))), np.arange(n)
        for axis in range(3):
            by[one, axis, 6 * scan + axis] = 1.0
            by[one, axis, first + 3 * target + axis] = -1.0
        moved = by_turn(away) @ left_jacobian(pose[scan, 3:])
        for axis in range(3):
            by[one, :, 6 * scan + 3 + axis] = moved[:, :, axis]
        by[one, :, 6 * s + tool] = -away / (1 + scale)[:, None]
        by[one, :, 6 * s + k + tool] = -ray / (1 + scale)[:, None]
        return misclosure.ravel(), by.reshape(3 * n, len(state))

    def misclosures(self):
        """(n, 3) by the poses minus adjusted place of each target of the last solution, m."""
        return self._target_rows(self.last[1], np.arange(len(self.targets)))[0].reshape(-1, 3)

    def tests(self, chosen):
        """(n,) largest |w| of the coordinates of each target, and (n,) the blunder that shows
        along each axis of the tank, m; those set aside by what they would have.
        """
        _, state, cofactor = self.last
        every = np.arange(len(self.targets))
        misclosure, by = self._target_rows(state, every)
        own = np.einsum("ij,jk,ik->i", by, cofactor, by).reshape(-1, 3)
        sd2, left = self.sd_m[:, None] ** 2, misclosure.reshape(-1, 3)
        variance = np.where(chosen[:, None], sd2 - own, sd2 + own)
        checked = variance > 1e-9 * sd2
        safe = np.sqrt(np.where(checked, variance, 1.0))
        w = np.where(checked, np.abs(left) / safe, np.nan)
        mdb = np.where(checked, DETECTED * np.where(chosen[:, None], sd2 / safe, safe), np.inf)
        worst = np.argmax(np.nan_to_num(w, nan=-1.0), axis=1) if len(w) else np.zeros(0, dtype=int)
        return w[every, worst], mdb.max(axis=1)

    # what is wrong

    def refuse_misnamed(self):
        """Raise SolutionError where a mirror, a unit or two exchanged names explain the misfit."""
        for scan, one in enumerate(self.scans):
            mine = np.flatnonzero(self.scan == scan)
            own, there = self.beam[mine], self._places_without(scan)[self.target[mine]]
            keep = np.isfinite(there[:, 0])
            if np.count_nonzero(keep) >= FEWEST:
                names = [self.names[self.target[i]] for i in mine[keep]]
                refuse_misnamed(one.name, own[keep], there[keep], names, self.sd_m[mine][keep])

    def _places_without(self, scan):
        """(T, 3) places of targets that are known without a scan; nan: none is."""
        at = np.full_like(self.at_m, np.nan)
        at[: len(self.known.names)] = self.known.xyz_m
        for i in np.flatnonzero(self.scan != scan):
            if np.isnan(at[self.target[i], 0]):
                other = self.scan[i]
                at[self.target[i]] = self.rotation[other] @ self.beam[i] + self.place_m[other]
        return at


def _pose(scan):
    return np.eye(4) if scan.pose is None else scan.pose


def left_jacobian(vectors):
    """(n, 3, 3) of turns: the small turn that follows by a change of their vector."""
    return np.linalg.inv(vector_derivatives(vectors))
