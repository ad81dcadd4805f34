"""Is what is held fixed wrong? A survey adjusted again with control or one scale released.

Nothing is changed: where the survey then fits, and what was released is sure of its difference,
that is told.
"""

from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from tankcal.adjust import CRITICAL, noncentrality
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message
from tankcal.survey.diagnosis.diagnoses import find_swapped_points
from tankcal.survey.diagnosis.outlier_attribution import LEVEL, LISTED, count_set_aside
from tankcal.survey.measurements import Instrument
from tankcal.survey.network import adjust, snoop
from tankcal.survey.network.snooping import start_from_adjusted
from tankcal.survey.observations import ControlCoordinates

FEWER = 0.5  # share of the values set aside that may be left by what explains them
RELEASED_M = 0.001  # sd of fixed control while it is doubted
SCALED = 6.0  # sds that a scale must differ from one
SOUND = 2.0  # sigma0 of a survey that fits, where there is none to compare with
LIKELY = 0.5  # share of the largest reaction, from which a held coordinate is released for once
TRIED = 12  # held coordinates that are
MOST = 25  # iterations of such a trial
ALIKE = 1.5  # times the smallest sigma0, within which suppositions explain as much


def wrongly_held(measurements, sigma0, gone, run):
    """Problem rows on scales and fixed control without which the survey fits.

    sigma0  without data snooping, inf when the survey could not be adjusted
    gone    number of values that data snooping set aside, inf likewise
    run     run(measurements, snooping=False) -> (network.Adjusted, Gathered)
    """
    found = []
    if np.isfinite(gone):
        limit = FEWER * sigma0 if np.isfinite(sigma0) else SOUND
        found += _explaining(_with_free_scales(measurements), limit, run)
        found += _explaining(_with_free_cameras(measurements), limit, run)
    return found


def wrong_control(measurements, gone, run):
    """Problem rows on fixed control without which far fewer values are set aside; see above.

    Returns them with the number of values that would still be set aside, those of the control
    among them; inf: no such control.
    """
    control = measurements.control
    if control is None or not (control.sd_m == 0).any():
        return [], np.inf
    released = replace(control, sd_m=np.where(control.sd_m == 0, RELEASED_M, control.sd_m))
    try:
        trial, gathered = run(replace(measurements, control=released), snooping=True)
    except (SolutionError, InputError):
        return [], np.inf
    swapped = find_swapped_points(trial.survey.points, trial.xyz_m, gathered.known)
    if swapped or count_set_aside(trial.survey) > FEWER * gone:
        return swapped, np.inf
    release = _Release(trial)
    found, rows = release.candidates()
    left = release.left(rows)
    if left > FEWER * gone:  # no single point: what the trial set aside, all together
        found, rows = release.set_aside()
        left = release.left(rows)
    if left > FEWER * gone:
        return [], np.inf
    return [_wrong(trial, gathered.known, *one) for one in found[: 2 * LISTED]], left


class _Release:
    """Held control of a trial in which it was weighted, held again but for what is released.

    The readings that the trial set aside stay aside.
    """

    def __init__(self, trial):
        self.survey = start_from_adjusted(trial.survey, trial)
        self.number, one = next(
            (i, one)
            for i, one in enumerate(trial.survey.observations)
            if isinstance(one, ControlCoordinates) and (one.sd == RELEASED_M).any()
        )
        self.doubted = one.sd == RELEASED_M
        self.gone = ~one.in_use
        self.xyz_m, sd = trial.xyz_m, np.where(self.doubted, 0.0, one.sd)
        self.control = replace(one, sd=sd, use=np.where(self.doubted | ~self.gone, 1.0, 0.0))
        self.limit = CRITICAL**2 * max(1.0, np.nan_to_num(trial.sigma0) ** 2)

    def _without(self, rows):
        use = self.control.use.copy()
        use[list(rows)] = 0.0
        observations = list(self.survey.observations)
        observations[self.number] = replace(self.control, use=use)
        return replace(self.survey, observations=tuple(observations))

    def adjusted(self, rows):
        """Adjusted without some rows of control, None: it could not be adjusted."""
        try:
            with np.errstate(all="ignore"):  # a trial may go astray
                return adjust(self._without(rows), max_iterations=MOST)
        except SolutionError:
            return None

    def left(self, rows):
        """Number of values that must be set aside without these rows of control, they included."""
        if not len(rows):
            return np.inf
        try:
            with np.errstate(all="ignore"):
                found = snoop(self._without(rows), robust=False, max_iterations=MOST)
        except SolutionError:
            return np.inf
        return count_set_aside(found.adjusted.survey)

    def candidates(self):
        """What explains as much: (point, axis, here, given) of each, and the rows of the best one.

        One coordinate after the other is released, then one whole point after the other where no
        single coordinate will do.
        """
        one = self.control
        single = self._tried([(row,) for row in self._likely()])
        points = dict.fromkeys(int(one.point[rows[0]]) for rows, _ in single)
        whole = self._tried(
            [np.flatnonzero(self.doubted & (one.point == point)) for point in points]
        )
        if whole and single[0][1].chi2 - whole[0][1].chi2 > self.limit:
            single = whole
        if not single:
            return [], ()
        found = [
            (one.point[row], one.axis[row], found.xyz_m[one.point[row], one.axis[row]],
             one.value[row])
            for rows, found in single
            if found.chi2 - single[0][1].chi2 < self.limit
            for row in rows
            if len(rows) == 1 or self._moved(found, row)
        ]  # fmt: skip
        return found, single[0][0]

    def _likely(self):
        """Rows of held coordinates whose reactions are the largest, those first."""
        found = self.adjusted(())
        if found is None:
            return np.flatnonzero(self.doubted & self.gone)[:TRIED]
        table = next(t for t in found.residuals if t.exact and t.source == self.number)
        size = np.zeros(len(self.control))
        size[table.rows] = table.test_statistic
        most = size.max(initial=0.0)
        order = np.argsort(-size, kind="stable")
        return order[(size[order] > LIKELY * most) & (most > CRITICAL)][:TRIED]

    def _tried(self, trials):
        """[(rows, Adjusted without them)] of trials that could be adjusted, the best first."""
        found = [(rows, self.adjusted(rows)) for rows in trials]
        found = [(rows, adjusted) for rows, adjusted in found if adjusted is not None]
        return sorted(found, key=lambda pair: pair[1].chi2)

    def _moved(self, found, row):
        """Whether a released coordinate moved by more than its sd allows."""
        point, axis = self.control.point[row], self.control.axis[row]
        away = found.xyz_m[point, axis] - self.control.value[row]
        return away**2 > self.limit * found.point_covariances_m2[point, axis, axis]

    def set_aside(self):
        """The same of what the trial set aside, all of it together."""
        one, rows = self.control, np.flatnonzero(self.doubted & self.gone)
        return [
            (one.point[i], one.axis[i], self.xyz_m[one.point[i], one.axis[i]], one.value[i])
            for i in rows
        ], rows


def _wrong(adjusted, known, point, axis, here_m, value_m):
    """The Problem of a held coordinate that the readings put elsewhere."""
    name = adjusted.survey.points[point]
    text = message(
        "wrongly_held",
        "{axis} of {point} is held fixed at {value_m:.4f}, but the readings give "
        "{here_m:.4f}; if it were not held, far fewer readings would be rejected: this "
        "value, or another one that is held, may be wrong",
        axis="xyz"[axis],
        point=name,
        value_m=value_m,
        here_m=here_m,
    )
    return Problem("control.csv", text, known.row.get(name), f"{'xyz'[axis]}_m")


def strained(readings, known):
    """Problem rows on held coordinates that the readings contradict: all that explain as much.

    readings  Readings, those of held coordinates among them     known  Known control

    A held coordinate is not doubted where a reading explains the contradiction better.
    """
    held = list(readings.where(_are_tested(readings)))
    limit = -float(ndtri(0.5 * LEVEL / max(len(held), 1)))
    most = max((abs(one.w) for one in held), default=0.0)
    if most <= limit:
        return []
    # what explains as much as the best of all is named though it alone would not be tested
    used = np.abs(readings.columns["w"][~readings.removed & ~readings.check])
    least = max(most, used[~np.isnan(used)].max(initial=0.0)) ** 2 - CRITICAL**2
    found = [one for one in held if one.w**2 > least]
    return [_strained(one) for one in sorted(found, key=lambda one: -abs(one.w))[: 2 * LISTED]]


def _are_tested(readings):
    """(n,) whether Readings are held control coordinates that others test."""
    found = readings.columns
    return readings.are("control coordinate") & (found["sd"] == 0) & np.isfinite(found["mdb"])


def _strained(one):
    """The Problem of a held coordinate with a large reaction."""
    sd = one.mdb / noncentrality()
    text = message(
        "held_contradicted",
        "{axis} of {point} is held fixed at {value_m:.4f}, but if it alone is released it becomes "
        "{here_m:.4f} (standard deviation {sd_mm:.1f} mm, w = {w:.1f}): it may be wrong",
        axis=one.element,
        point=one.ids[0],
        value_m=one.value,
        here_m=one.value + one.w * sd,
        sd_mm=1e3 * sd,
        w=one.w,
    )
    return Problem(one.file, text, one.row, f"{one.element}_m")


def _explaining(trials, limit, run):
    """Problem rows of trials with which the survey fits, and that what was set free is sure of.

    trials  (changed measurements, difference), the latter a function of the network.Adjusted: what
            was set free less what it was held at, its sd, and the Problem that says so; or None
    """
    found = []
    for changed, difference in trials:
        try:
            adjusted, _ = run(changed)
        except (SolutionError, InputError):
            continue
        told = difference(adjusted) if adjusted.sigma0 < limit else None
        if told is not None:
            away, sd, problem = told
            if abs(away) > SCALED * max(adjusted.sigma0, 1.0) * sd:
                found.append((adjusted.sigma0, problem))
    best = min((sigma0 for sigma0, _ in found), default=np.inf)
    return [problem for sigma0, problem in found if sigma0 < ALIKE * best]


def _sd_of(adjusted, column):
    if column < 0:
        return 0.0
    return float(adjusted.solution.cofactor.among(np.array([column]))[0, 0]) ** 0.5


def _scale(name):
    """What an adjustment says of the free scale of an instrument."""

    def difference(adjusted):
        names = [one.name for one in adjusted.survey.instruments]
        if name not in names:
            return None  # it measured no distance
        i = names.index(name)
        scale = float(adjusted.solution.unknowns.nuisance["scale"][i])
        sd = _sd_of(adjusted, adjusted.problem.layout.nuisance["scale"][i])
        text = message(
            "scale_explains",
            "the distances of {name} fit if all of them are {scale_ppm:+.0f} ppm off (standard "
            "uncertainty {u_ppm:.0f} ppm): check its certificate, its unit and its u_scale_ppm",
            name=name,
            scale_ppm=1e6 * scale,
            u_ppm=1e6 * sd,
        )
        return scale, sd, Problem("instruments.toml", text, None, name)

    return difference


def _principal_distance(name, held_mm):
    """What an adjustment says of the free principal distance of a camera."""

    def difference(adjusted):
        names = [one.name for one in adjusted.survey.cameras]
        if name not in names:
            return None  # it took no photo
        photo = int(np.flatnonzero(adjusted.survey.photos.camera == names.index(name))[0])
        place = adjusted.problem.interior_of[photo, 0]
        c = float(adjusted.solution.unknowns.interior[place])
        sd = _sd_of(adjusted, adjusted.problem.layout.interior[place])
        text = message(
            "principal_distance_explains",
            "the images fit if c is {c_mm:.3f} mm (standard uncertainty {u_mm:.3f} mm) "
            "instead of {held_mm:.3f} mm",
            c_mm=c,
            u_mm=sd,
            held_mm=held_mm,
        )
        return c - held_mm, sd, Problem("cameras.toml", text, None, name)

    return difference


def _with_free_cameras(measurements):
    """Trials with the principal distance of one camera free."""
    for number, one in enumerate(measurements.cameras):
        camera = one.camera
        if camera.scope[0] not in ("off", "photo") and camera.state[0] == "free":
            continue
        free = replace(
            camera, scope=("camera", *camera.scope[1:]), state=("free", *camera.state[1:])
        )
        cameras = list(measurements.cameras)
        cameras[number] = replace(one, camera=free)
        changed = replace(measurements, cameras=tuple(cameras))
        yield changed, _principal_distance(camera.name, camera.values[0])


def _with_free_scales(measurements):
    """Trials with the scale of one instrument free.

    Readings without one are taken for those of one instrument that bears the name of their file.
    """
    for tool in measurements.instruments:
        if np.isfinite(tool.u_scale):
            others = tuple(one for one in measurements.instruments if one is not tool)
            freed = (*others, replace(tool, u_scale=np.nan))
            yield replace(measurements, instruments=freed), _scale(tool.name)
    for table in measurements.readings:
        if table.table == "distances" and None in (table.instrument or (None,)):
            names = tuple(one or table.file for one in table.instrument or (None,) * len(table.end))
            free = Instrument(table.file, "other", u_scale=np.nan)
            readings = tuple(
                replace(one, instrument=names) if one is table else one
                for one in measurements.readings
            )
            tools = (*measurements.instruments, free)
            yield replace(measurements, instruments=tools, readings=readings), _scale(table.file)
