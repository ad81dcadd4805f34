"""Test of held quantities: adjust again with control or one scale released.

No result is changed. A warning is given if the survey then fits and the released quantity differs
significantly from its held value.
"""

from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from tankcal.adjust import CRITICAL, noncentrality
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message
from tankcal.survey.diagnosis.blunders import LEVEL, LISTED, count_set_aside
from tankcal.survey.diagnosis.diagnoses import find_swapped_points
from tankcal.survey.measurements import Instrument
from tankcal.survey.network import adjust, snoop
from tankcal.survey.network.snooping import start_from_adjusted
from tankcal.survey.observations import ControlCoordinates

FEWER = 0.5  # largest remaining share of rejected values under a valid explanation
RELEASED_M = 0.001  # sd of fixed control under test
SCALED = 6.0  # standard deviations by which a scale must differ from one
SOUND = 2.0  # sigma0 of a survey that fits, where no other value is available for comparison
LIKELY = 0.5  # share of the largest reaction, above which a held coordinate is released on trial
TRIED = 12  # held coordinates released on trial
MOST = 25  # iterations of a trial
ALIKE = 1.5  # ratio to the smallest sigma0, within which explanations are equivalent


def wrongly_held(measurements, sigma0, rejected, run):
    """Problem rows on scales and cameras without which the survey fits.

    Parameters
    ----------
    measurements : Measurements
    sigma0 : float
        Without data snooping; inf if the survey could not be adjusted.
    gone : int
        Number of values rejected by data snooping; inf likewise.
    run : callable
        run(measurements, snooping=False) returns (network.Adjusted, GatheredSurvey).

    Returns
    -------
    list of Problem
    """
    problems = []
    if np.isfinite(rejected):
        limit = FEWER * sigma0 if np.isfinite(sigma0) else SOUND
        problems += _explaining(_free_scales(measurements), limit, run)
        problems += _explaining(_free_cameras(measurements), limit, run)
    return problems


def wrong_control(measurements, rejected, run):
    """Problem rows on fixed control without which far fewer values are rejected.

    Parameters
    ----------
    measurements : Measurements
    gone : int
        Number of values rejected by data snooping.
    run : callable
        See `wrongly_held`.

    Returns
    -------
    problems : list of Problem
    left : int
        Number of values still rejected, including the control; inf: no such control.
    """
    control = measurements.control
    if control is None or not (control.sd_m == 0).any():
        return [], np.inf
    # A small standard deviation lets data snooping reject control that is otherwise exact.
    released = replace(control, sd_m=np.where(control.sd_m == 0, RELEASED_M, control.sd_m))
    try:
        trial, gathered = run(replace(measurements, control=released), snooping=True)
    except (SolutionError, InputError):
        return [], np.inf
    # Exchanged axes explain a point completely, so they are reported first.
    swapped = find_swapped_points(trial.survey.points, trial.xyz_m, gathered.known)
    if swapped or count_set_aside(trial.survey) > FEWER * rejected:
        return swapped, np.inf
    release = _Release(trial)
    found, rows = release.candidates()
    left = release.left(rows)
    # No single point suffices: release everything that the trial rejected.
    if left > FEWER * rejected:
        found, rows = release.set_aside()
        left = release.left(rows)
    if left > FEWER * rejected:
        return [], np.inf
    return [_wrong(trial, gathered.known, *coordinate) for coordinate in found[: 2 * LISTED]], left


class _Release:
    """Held control of a trial with weighted control, held again except for the released rows.

    Readings rejected in the trial stay rejected.
    """

    def __init__(self, trial):
        self.survey = start_from_adjusted(trial.survey, trial)
        self.number, control = next(
            (i, control)
            for i, control in enumerate(trial.survey.observations)
            if isinstance(control, ControlCoordinates) and (control.sd == RELEASED_M).any()
        )
        self.doubted = control.sd == RELEASED_M
        self.gone = ~control.in_use
        self.xyz_m, sd = trial.xyz_m, np.where(self.doubted, 0.0, control.sd)
        self.control = replace(control, sd=sd, use=np.where(self.doubted | ~self.gone, 1.0, 0.0))
        self.limit = CRITICAL**2 * max(1.0, np.nan_to_num(trial.sigma0) ** 2)

    def _survey_without(self, rows):
        """The survey without the given rows of control."""
        use = self.control.use.copy()
        use[list(rows)] = 0.0
        observations = list(self.survey.observations)
        observations[self.number] = replace(self.control, use=use)
        return replace(self.survey, observations=tuple(observations))

    def adjusted(self, rows):
        """Adjust without some rows of control; None if the adjustment fails."""
        try:
            with np.errstate(all="ignore"):  # a trial may diverge
                return adjust(self._survey_without(rows), max_iterations=MOST)
        except SolutionError:
            return None

    def left(self, rows):
        """Number of values rejected without the given rows of control, including these rows."""
        if not len(rows):
            return np.inf
        try:
            with np.errstate(all="ignore"):
                cleaned = snoop(self._survey_without(rows), robust=False, max_iterations=MOST)
        except SolutionError:
            return np.inf
        return count_set_aside(cleaned.adjusted.survey)

    def candidates(self):
        """Return equivalent explanations (point, axis, here, given), and the rows of the best one.

        Single coordinates are released one at a time. Whole points follow if no single coordinate
        suffices.
        """
        control = self.control
        single = self._adjust_trials([(row,) for row in self._likely()])
        points = dict.fromkeys(int(control.point[rows[0]]) for rows, _ in single)
        of_points = self._adjust_trials(
            [np.flatnonzero(self.doubted & (control.point == point)) for point in points]
        )
        if of_points and single[0][1].chi2 - of_points[0][1].chi2 > self.limit:
            single = of_points
        if not single:
            return [], ()
        explanations = [
            (control.point[row], control.axis[row],
             trial.xyz_m[control.point[row], control.axis[row]], control.value[row])
            for rows, trial in single
            if trial.chi2 - single[0][1].chi2 < self.limit
            for row in rows
            if len(rows) == 1 or self._has_moved(trial, row)
        ]  # fmt: skip
        return explanations, single[0][0]

    def _likely(self):
        """Rows of held coordinates with the largest reactions, in decreasing order."""
        adjusted = self.adjusted(())
        if adjusted is None:
            return np.flatnonzero(self.doubted & self.gone)[:TRIED]
        # If the adjustment converged, reactions rank the coordinates.
        table = next(t for t in adjusted.residuals if t.exact and t.source == self.number)
        size = np.zeros(len(self.control))
        size[table.rows] = table.test_statistic
        most = size.max(initial=0.0)
        order = np.argsort(-size, kind="stable")
        return order[(size[order] > LIKELY * most) & (most > CRITICAL)][:TRIED]

    def _adjust_trials(self, trials):
        """[(rows, Adjusted without them)] of trials that could be adjusted, the best first."""
        results = [(rows, self.adjusted(rows)) for rows in trials]
        results = [(rows, adjusted) for rows, adjusted in results if adjusted is not None]
        return sorted(results, key=lambda pair: pair[1].chi2)

    def _has_moved(self, adjusted, row):
        """Whether a released coordinate moved significantly."""
        point, axis = self.control.point[row], self.control.axis[row]
        away = adjusted.xyz_m[point, axis] - self.control.value[row]
        return away**2 > self.limit * adjusted.point_covariances_m2[point, axis, axis]

    def set_aside(self):
        """Candidates as in `candidates`, from all control rejected in the trial."""
        control, rows = self.control, np.flatnonzero(self.doubted & self.gone)
        return [
            (
                control.point[i],
                control.axis[i],
                self.xyz_m[control.point[i], control.axis[i]],
                control.value[i],
            )
            for i in rows
        ], rows


def _wrong(adjusted, known, point, axis, here_m, value_m):
    """Problem of a held coordinate that contradicts the readings."""
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


def find_strained_control(readings, known):
    """Problem rows on held coordinates that the readings contradict, all equivalent ones.

    A held coordinate is not suspected where a reading explains the contradiction better.

    Parameters
    ----------
    readings : Readings
        Including held coordinates.
    known : Known

    Returns
    -------
    list of Problem
    """
    held = list(readings.where(_are_tested(readings)))
    # Bonferroni: the level of one test is LEVEL over the number of held coordinates.
    limit = -float(ndtri(0.5 * LEVEL / max(len(held), 1)))
    most = max((abs(reading.w) for reading in held), default=0.0)
    if most <= limit:
        return []
    # Coordinates that explain as much as the best are listed even if not significant themselves.
    used = np.abs(readings.columns["w"][~readings.removed & ~readings.check])
    least = max(most, used[~np.isnan(used)].max(initial=0.0)) ** 2 - CRITICAL**2
    suspects = [reading for reading in held if reading.w**2 > least]
    return [
        _strain_problem(reading)
        for reading in sorted(suspects, key=lambda reading: -abs(reading.w))[: 2 * LISTED]
    ]


def _are_tested(readings):
    """Mask (n,) of held control coordinates with redundancy."""
    data = readings.columns
    return readings.are("control coordinate") & (data["sd"] == 0) & np.isfinite(data["mdb"])


def _strain_problem(reading):
    """Problem of a held coordinate with a large reaction."""
    # The MDB is delta0 times the standard deviation of the released coordinate.
    sd = reading.mdb / noncentrality()
    text = message(
        "held_contradicted",
        "{axis} of {point} is held fixed at {value_m:.4f}, but if it alone is released it becomes "
        "{here_m:.4f} (standard deviation {sd_mm:.1f} mm, w = {w:.1f}): it may be wrong",
        axis=reading.element,
        point=reading.ids[0],
        value_m=reading.value,
        here_m=reading.value + reading.w * sd,
        sd_mm=1e3 * sd,
        w=reading.w,
    )
    return Problem(reading.file, text, reading.row, f"{reading.element}_m")


def _explaining(trials, limit, run):
    """Problem rows of trials in which the survey fits and the released quantity differs
    significantly.

    Parameters
    ----------
    trials : iterable
        (changed measurements, difference). difference(network.Adjusted) returns released minus held
        value, its standard deviation and a Problem; or None.
    limit : float
        sigma0 below which the survey fits.
    run : callable
    """
    explained = []
    for changed, difference in trials:
        try:
            adjusted, _ = run(changed)
        except (SolutionError, InputError):
            continue
        released = difference(adjusted) if adjusted.sigma0 < limit else None
        if released is not None:
            away, sd, problem = released
            # sigma0 above 1 enlarges the uncertainty of the difference.
            if abs(away) > SCALED * max(adjusted.sigma0, 1.0) * sd:
                explained.append((adjusted.sigma0, problem))
    best = min((sigma0 for sigma0, _ in explained), default=np.inf)
    return [problem for sigma0, problem in explained if sigma0 < ALIKE * best]


def _sd_of(adjusted, column):
    """A priori standard deviation of an unknown; 0 for a fixed one."""
    if column < 0:
        return 0.0
    return float(adjusted.solution.cofactor.among(np.array([column]))[0, 0]) ** 0.5


def _scale(name):
    """Difference function of the free scale of an instrument, for `_explaining`."""

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
    """Difference function of the free principal distance of a camera, for `_explaining`."""

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


def _free_cameras(measurements):
    """Yield trials with the principal distance of one camera free."""
    for number, setup in enumerate(measurements.cameras):
        camera = setup.camera
        if camera.scope[0] not in ("off", "photo") and camera.state[0] == "free":
            continue
        free = replace(
            camera, scope=("camera", *camera.scope[1:]), state=("free", *camera.state[1:])
        )
        cameras = list(measurements.cameras)
        cameras[number] = replace(setup, camera=free)
        changed = replace(measurements, cameras=tuple(cameras))
        yield changed, _principal_distance(camera.name, camera.values[0])


def _free_scales(measurements):
    """Yield trials with the scale of one instrument free.

    Readings without an instrument form one instrument, named after their file.
    """
    for tool in measurements.instruments:
        if np.isfinite(tool.u_scale):
            others = tuple(item for item in measurements.instruments if item is not tool)
            freed = (*others, replace(tool, u_scale=np.nan))
            yield replace(measurements, instruments=freed), _scale(tool.name)
    for table in measurements.readings:
        if table.table == "distances" and None in (table.instrument or (None,)):
            names = tuple(
                item or table.file for item in table.instrument or (None,) * len(table.end)
            )
            free = Instrument(table.file, "other", u_scale=np.nan)
            readings = tuple(
                replace(item, instrument=names) if item is table else item
                for item in measurements.readings
            )
            tools = (*measurements.instruments, free)
            yield replace(measurements, instruments=tools, readings=readings), _scale(table.file)
