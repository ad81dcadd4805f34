"""Trial adjustments of a survey that does not fit: held quantities released, files misread.

Test of held quantities: adjust again with control or one scale released.

No result is changed. A warning is given if the survey then fits and the released quantity differs
significantly from its held value.

Each trial changes the measurements as one common mistake would, and adjusts without data snooping.
The mistake that reduces sigma0 most is reported; no result is changed.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.special import ndtri

from tankcal.adjust import CRITICAL, noncentrality
from tankcal.camera.model import correct_image_points
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message
from tankcal.survey.diagnosis.blunders import LEVEL, LISTED, count_set_aside
from tankcal.survey.diagnosis.diagnoses import (
    GON,
    MIRROR,
    find_swapped_points,
    mirrored_fits,
    mirrored_photo,
)
from tankcal.survey.measurements import Instrument
from tankcal.survey.network import adjust, snoop
from tankcal.survey.network.snooping import start_from_adjusted
from tankcal.survey.observations import KINDS, ControlCoordinates
from tankcal.units import FOOT_M

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


BETTER = 0.2  # largest remaining share of sigma0 under a valid explanation
SOUND_SIGMA0 = 5.0  # sigma0 of a survey that fits moderately; a single blunder causes more
CERTAIN = 2.0  # sigma0 below which no other mistake is tried
OTHER_UNITS = (
    (FOOT_M, message("feet", "feet")),
    (0.001, message("millimetres", "millimetres")),
)
HORIZONTAL = ("directions", "horizontal_angles", "azimuths")
EXCHANGED = 7  # control points up to which all pairs are exchanged
CONTROL = "control.csv"
MOST_SETUPS = 30  # set-ups whose circles are tried in another unit
MOST_PHOTOS_OMITTED = 12  # photos left out one at a time
MOST_FAILURES = 20  # trials without a solution; more would only add to the waiting time
ALIKE_FAILURES = 6  # trials that fail like the survey itself: readings are then missing


def likely_mistake(measurements, sigma0, run, failure=None):
    """Problem rows: the common mistakes that explain a misfit best, or none.

    Parameters
    ----------
    measurements : Measurements
    sigma0 : float
        Without data snooping; inf if the survey could not be adjusted.
    run : callable
        run(measurements) returns (network.Adjusted, GatheredSurvey), without data snooping.
    failure : str, optional
        Error message of the failed adjustment.

    Returns
    -------
    list of Problem
    """
    limit = min(BETTER * sigma0, SOUND_SIGMA0)
    explained, failures, alike = [], 0, 0
    mistakes = (_mirror_mistakes, _files_in_other_unit, _name_exchanges, _setup_in_other_unit)
    for suppositions in mistakes:
        for problem, changed in suppositions(measurements):
            try:
                trial_sigma0 = run(changed)[0].sigma0
            except (SolutionError, InputError) as error:
                failures, alike = failures + 1, alike + (str(error) == failure)
                if not explained and (alike == ALIKE_FAILURES or failures == MOST_FAILURES):
                    return []
                continue
            if trial_sigma0 < limit:
                explained.append((trial_sigma0, problem))
        if any(trial_sigma0 < CERTAIN for trial_sigma0, _ in explained):
            break
    best = min((trial_sigma0 for trial_sigma0, _ in explained), default=np.inf)
    likely = [problem for trial_sigma0, problem in explained if trial_sigma0 < ALIKE * best]
    if measurements.settings.datum == "control":
        return likely
    # Coordinates that hold no datum serve as start values: swapped axes alone do no harm, a circle
    # does.
    return sorted(likely, key=lambda problem: problem.file == CONTROL)


def _mirror_mistakes(measurements):
    """Yield (Problem, corrected measurements) for mistakes that mirror the survey.

    The mistakes are not always distinguishable.
    """
    yield from _control_swapped(measurements)
    yield from _images_mirrored(measurements)
    for table_of_readings in measurements.readings:
        if table_of_readings.table in HORIZONTAL:
            text = message(
                "angles_anticlockwise",
                "the angles fit if the circle was read anticlockwise",
            )
            yield (
                Problem(table_of_readings.file, text),
                _times(measurements, [table_of_readings.table], -1.0),
            )


def _name_exchanges(measurements):
    """Yield (Problem, corrected measurements) for two control points with exchanged names."""
    control = measurements.control
    names = [] if control is None else list(control.point)
    if not 2 < len(names) <= EXCHANGED or measurements.image_points is not None:
        return  # photographs start too slowly for that many trials
    for i, j in combinations(range(len(names)), 2):
        if control.system[i] == control.system[j]:
            order = np.arange(len(names))
            order[[i, j]] = j, i
            text = message(
                "names_exchanged",
                "everything fits if {point} and {other} are exchanged",
                point=names[i],
                other=names[j],
            )
            changed = replace(control, xyz_m=control.xyz_m[order], sd_m=control.sd_m[order])
            row = control.rows[j] if control.rows else None
            yield Problem("control.csv", text, row, "point"), replace(measurements, control=changed)


def _files_in_other_unit(measurements):
    """Yield (Problem, corrected measurements) for files in another unit."""
    tables = measurements.readings
    angles = [
        readings_of_table.table
        for readings_of_table in tables
        if KINDS[readings_of_table.table].is_angle
    ]
    for factor, what in GON:
        if len(angles) > 1:
            template = "all angles together fit if they are {what}"
            text = message("all_angles_misread", template, what=what)
            yield Problem("job.toml", text), _times(measurements, angles, factor)
        text = message("angles_misread", "the angles fit if they are {what}", what=what)
        for table in angles:
            yield Problem(f"{table}.csv", text), _times(measurements, [table], factor)
    for table in ("distances", "slope_distances"):
        # A change of unit shows only if control or other distances fix the scale.
        if any(
            readings_of_table.table == table for readings_of_table in tables
        ) and _scale_is_known(measurements, table):
            for factor, what in OTHER_UNITS:
                template = "the distances fit if they are in {what}"
                text = message("distances_misread", template, what=what)
                yield Problem(f"{table}.csv", text), _times(measurements, [table], factor)


def _setup_in_other_unit(measurements):
    """Yield (Problem, corrected measurements) for the circles of one set-up in another unit."""
    tables = [item for item in measurements.readings if item.setup and KINDS[item.table].is_angle]
    names = list(dict.fromkeys(name for item in tables for name in item.setup))
    if not 1 < len(names) <= MOST_SETUPS or measurements.image_points is not None:
        return
    for name in names:
        tables_of_setup = [item for item in tables if name in item.setup]
        for factor, what in GON:
            text = message(
                "setup_misread",
                "the angles of set-up {setup} fit if they are {what}",
                setup=name,
                what=what,
            )
            for group in ([tables_of_setup] if len(tables_of_setup) > 1 else []) + [
                [item] for item in tables_of_setup
            ]:
                first = group[0]
                row = first.rows[first.setup.index(name)] if first.rows else None
                table_names = tuple(item.table for item in group)
                yield (
                    Problem(first.file, text, row),
                    _times(measurements, table_names, factor, name),
                )


def _control_swapped(measurements):
    """Yield trials with x and y of control exchanged, in all systems, then in each of several."""
    control = measurements.control
    if control is None:
        return
    system_of_row = np.array([name or "" for name in control.system], dtype=object)
    for system in (None, *sorted(set(system_of_row.tolist()))):
        is_in_system = (
            np.ones(len(system_of_row), dtype=bool) if system is None else system_of_row == system
        )
        if system is None or not is_in_system.all():
            xyz, sd = control.xyz_m.copy(), control.sd_m.copy()
            xyz[is_in_system], sd[is_in_system] = (
                xyz[is_in_system][:, [1, 0, 2]],
                sd[is_in_system][:, [1, 0, 2]],
            )
            text = message("all_coordinates_swapped", "all coordinates fit if x and y are swapped")
            if system:
                text = message(
                    "system_swapped",
                    "all coordinates of system {system} fit if x and y are swapped",
                    system=system,
                )
            changed = replace(control, xyz_m=xyz, sd_m=sd)
            yield Problem("control.csv", text), replace(measurements, control=changed)


def _images_mirrored(measurements):
    """Yield trials with mirrored images, of all cameras, then of each of several."""
    images = measurements.image_points
    if images is None:
        return
    camera_of = {item.name: item.camera for item in measurements.photos}
    camera_of_row = np.array([camera_of.get(name, "") for name in images.photo], dtype=object)
    for camera in (None, *sorted(set(camera_of_row.tolist()))):
        is_of_camera = (
            np.ones(len(camera_of_row), dtype=bool) if camera is None else camera_of_row == camera
        )
        if camera is None or not is_of_camera.all():
            xy = np.where(is_of_camera[:, None], images.xy_mm * [-1.0, 1.0], images.xy_mm)
            text = MIRROR
            if camera is not None:
                text = message(
                    "camera_mirrored", "camera {camera}: {why}", camera=camera, why=MIRROR
                )
            changed = replace(images, xy_mm=xy)
            yield Problem("image_points.csv", text), replace(measurements, image_points=changed)


def _scale_is_known(measurements, table):
    """Whether the scale of distances is controlled, so that a wrong unit causes a misfit."""
    free = {item.name for item in measurements.instruments if np.isnan(item.u_scale)}
    setups = {item.name: item.instrument for item in measurements.setups}
    readings_of_table = [item for item in measurements.readings if item.table == table]
    has_others = any(
        "distances" in item.table for item in measurements.readings if item.table != table
    )
    acting = measurements.control is not None and measurements.settings.datum == "control"
    return (acting or has_others) and not any(
        free & ({setups[name] for name in item.setup} | set(item.instrument))
        for item in readings_of_table
    )


def _times(measurements, tables, factor, setup=None):
    """Multiply the values of tables by a factor, or only those of one set-up."""

    def factor_of(item):
        if setup is None:
            return factor
        return np.where([name == setup for name in item.setup], factor, 1.0)

    readings = tuple(
        replace(item, value=item.value * factor_of(item)) if item.table in tables else item
        for item in measurements.readings
    )
    return replace(measurements, readings=readings)


def photos_that_do_not_fit(measurements, message, run):
    """Problem rows for photos without a pose that fit after mirroring.

    Parameters
    ----------
    measurements : Measurements
    message : str
        Error message, which names these photos.
    run : callable
        See `likely_mistake`.

    Returns
    -------
    list of Problem
    """
    images = measurements.image_points
    failed = [item.name for item in measurements.photos if f"photo {item.name} " in message][
        :MOST_PHOTOS_OMITTED
    ]
    if images is None or not failed or len(failed) == len(measurements.photos):
        return []
    is_kept = np.array([name not in failed for name in images.photo])
    try:
        adjusted, _ = run(replace(measurements, image_points=_some(images, is_kept)))
    except (SolutionError, InputError):
        return []
    return [mirrored_photo(name) for name in failed if _is_mirrored(measurements, name, adjusted)]


def _is_mirrored(measurements, name, adjusted):
    """Whether a photo left out of the adjustment fits the adjusted points after mirroring."""
    images = measurements.image_points
    number = {name: i for i, name in enumerate(adjusted.survey.points)}
    rows = [
        i
        for i, (photo, point) in enumerate(zip(images.photo, images.point, strict=True))
        if photo == name and point in number
    ]
    camera_name = next(item.camera for item in measurements.photos if item.name == name)
    camera = next(item.camera for item in measurements.cameras if item.camera.name == camera_name)
    xyz = adjusted.xyz_m[[number[images.point[i]] for i in rows]]
    is_adjusted = np.isfinite(xyz).all(axis=1)
    ideal = correct_image_points(images.xy_mm[rows], camera.values, camera.form) / camera.values[0]
    return mirrored_fits(xyz[is_adjusted], ideal[is_adjusted])


def _some(images, mask):
    """ImageReadings of the rows where a mask (n,) is True."""
    rows = np.flatnonzero(mask)
    return replace(
        images,
        photo=tuple(images.photo[i] for i in rows),
        point=tuple(images.point[i] for i in rows),
        xy_mm=images.xy_mm[rows],
        sd_mm=images.sd_mm[rows],
        check=np.asarray(images.check)[rows],
        rows=tuple(images.rows[i] for i in rows) if images.rows else (),
    )
