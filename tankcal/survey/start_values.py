"""Start values of a gathered survey, from control, the nominal tank and the observations."""

from dataclasses import replace

import numpy as np

from tankcal.errors import Problem, SolutionError
from tankcal.messages import message
from tankcal.survey.network.snooping import start_from_adjusted as started_from
from tankcal.survey.observations import ControlCoordinates, Distances, SystemCoordinates
from tankcal.survey.readings import bend_per_m
from tankcal.survey.start.approximation import approximate, nominal_places
from tankcal.survey.start.pieces import similarity

MIRRORED_BETTER = 0.3  # misfit ratio below which a reflection is accepted


def plan_fit(points, source, target):
    """Fit points by a rotation in plan and a shift in three dimensions.

    A reflection in plan is used if it fits far better and at least three points confirm it.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
    source, target : ndarray, shape (k, 3)
        Corresponding places in both frames.

    Returns
    -------
    points : ndarray, shape (n, 3)
        In the frame of target.
    misfit : float
        Largest distance between corresponding places.
    """
    return _plan_fit(points, source, target, -1.0 if is_turned_over(source, target) else 1.0)


def is_turned_over(source, target):
    """Whether a reflection in plan maps points (k, 3) onto others far better than a rotation."""
    if len(source) < 3:
        return False
    straight, over = (_plan_fit(source, source, target, side)[1] for side in (1.0, -1.0))
    return over < MIRRORED_BETTER * straight


def _plan_fit(points, source, target, side):
    """`plan_fit` with a given side: 1 rotation, -1 reflection."""
    flip = np.array([side, 1.0, 1.0])
    middle, goal = (source * flip).mean(axis=0), target.mean(axis=0)
    a, b = source * flip - middle, target - goal
    # Complex numbers make the least squares rotation the argument of a sum of products.
    u, v = a[:, 0] + 1j * a[:, 1], b[:, 0] + 1j * b[:, 1]
    turn = np.sum(np.conj(u) * v)
    turn = turn / abs(turn) if abs(turn) > 0 else 1.0

    def moved(xyz):
        d = xyz * flip - middle
        w = (d[:, 0] + 1j * d[:, 1]) * turn
        return goal + np.column_stack([w.real, w.imag, d[:, 2]])

    return moved(points), float(np.linalg.norm(moved(source) - target, axis=1).max())


TRUST_M = 0.01  # sd of control in the search for start values
AGREES = 0.1  # share of the radius within which nominal coordinates agree with control


def add_start_values(gathered, measurements):
    """Return the network survey with start values for all unknowns.

    Control determines the frame; nominal coordinates are transformed to it. Photos and points
    without values receive them from the observations.

    Parameters
    ----------
    gathered : GatheredSurvey
    measurements : Measurements

    Returns
    -------
    network.Survey

    Raises
    ------
    SolutionError
        If unknowns remain without start value; the message names them.
    """
    survey, known = gathered.survey, gathered.known.xyz_m
    failure = None
    observations = survey.observations + _control_observations(survey, known, measurements.settings)
    for xyz, photos in _attempts(survey, known, measurements):
        try:
            started = approximate(
                replace(survey, xyz_m=xyz, photos=photos, observations=observations)
            )
        except SolutionError as error:
            # The first attempt is the most credible, so its message is reported.
            failure = failure or error
            continue
        started = replace(started, observations=survey.observations)
        return finish_start_values(started, gathered, measurements)
    raise failure


def start_like(adjusted, gathered, measurements):
    """Start a survey from an adjusted survey of the same points and photos.

    Parameters
    ----------
    adjusted : network.Adjusted
    gathered : GatheredSurvey
    measurements : Measurements

    Returns
    -------
    network.Survey or None
        None if the points differ or the adjustment lost a point.
    """
    survey, previous = gathered.survey, adjusted.survey
    photos = () if survey.photos is None else survey.photos.names
    is_alike = survey.points == previous.points and len(survey.sets) == len(previous.sets)
    is_alike = is_alike and photos == (() if previous.photos is None else previous.photos.names)
    if not is_alike or not np.isfinite(adjusted.xyz_m).all():
        return None
    return finish_start_values(started_from(survey, adjusted), gathered, measurements)


def _control_observations(survey, known, settings):
    """Control as observations for the start values, where the datum does not use it."""
    point, axis = np.nonzero(np.isfinite(known))
    if settings.datum == "control" or not len(point):
        return ()
    return (ControlCoordinates(known[point, axis], np.full(len(point), TRUST_M), point, axis),)


def _attempts(survey, known, measurements):
    """Yield start coordinates and photos to try, the most reliable first."""
    nominal = nominal_points(measurements, survey.points)
    idle = survey.fixed & np.isnan(known)
    base = np.where(idle, 0.0, known)
    choices = []
    if nominal is not None:
        placed = _move_to_frame_of(known, nominal, measurements.nominal.radius_m)
        if placed is not None:
            choices.append(np.where(np.isnan(base), placed, base))
    control = np.isfinite(known).all(axis=1).sum()
    # More than three control points that contradict the nominal tank outweigh it; otherwise try the
    # tank first.
    choices.insert(0 if control > 3 and nominal is not None and placed is None else 1, base)
    if nominal is not None and placed is None:
        choices.append(np.where(np.isnan(base), nominal, base))
    photos = survey.photos
    for xyz in choices:
        yield xyz, photos
    if photos is not None and np.isfinite(photos.xyz_m).any():
        # Given photos may be wrong: last, try without their values.
        unknown = replace(
            photos,
            xyz_m=np.full_like(photos.xyz_m, np.nan),
            rotation=np.full_like(photos.rotation, np.nan),
        )
        for xyz in choices:
            yield xyz, unknown


def nominal_points(measurements, points):
    """Nominal coordinates of targets with generatrices numbered from 1.

    Parameters
    ----------
    measurements : Measurements
    points : sequence of str

    Returns
    -------
    ndarray, shape (points, 3), or None
        nan where unknown; None without a nominal tank or generatrices.
    """
    targets, tank = measurements.targets, measurements.nominal
    if targets is None or tank is None:
        return None
    generatrix = np.array([_whole(name) for name in targets.generatrix])
    section = np.array([_whole(name) for name in targets.section])
    if not np.isfinite(generatrix).any() or np.nanmin(generatrix) < 1:
        return None
    z = np.array(targets.z_m, dtype=float)
    if np.isfinite(section).any():
        bottom = 0.0 if tank.bottom_z_m is None else tank.bottom_z_m
        # Without a measured height, sections are assumed evenly spaced from the bottom.
        z_nominal = bottom + tank.height_m * (section - 0.5) / np.nanmax(section)
        z = np.where(np.isnan(z), z_nominal, z)
    places = nominal_places(generatrix, np.nanmax(generatrix), z, tank.radius_m)
    place = dict(zip(targets.point, places, strict=True))
    nowhere = np.full(3, np.nan)
    return np.array([place.get(name, nowhere) for name in points])


def mirrored_targets(xyz_m, points, measurements):
    """Problem rows if adjusted points (points, 3) are a mirror image of the nominal tank."""
    nominal = nominal_points(measurements, points)
    if nominal is None:
        return []
    common = np.isfinite(nominal).all(axis=1) & np.isfinite(xyz_m).all(axis=1)
    if not is_turned_over(nominal[common], xyz_m[common]):
        return []
    text = message(
        "mirrored_generatrices",
        "the adjusted points are a mirror image of the generatrices: these are numbered "
        "anticlockwise (correct if that is intended), or images are mirrored, or x and y of "
        "control are swapped",
    )
    return [Problem("targets.csv", text, None, "generatrix")]


def _whole(name):
    """Value of a name that is a whole number, or nan."""
    return float(name) if name is not None and str(name).strip().isdigit() else np.nan


def _move_to_frame_of(known, nominal, radius_m):
    """Nominal coordinates in the frame of control; None if they cannot be fitted."""
    common = np.isfinite(known).all(axis=1) & np.isfinite(nominal).all(axis=1)
    if not common.any():
        return None if np.isfinite(known).all(axis=1).any() else nominal
    if np.linalg.norm(known[common] - nominal[common], axis=1).max() < AGREES * radius_m:
        return nominal
    if common.sum() < 2:
        return None
    placed, worst = plan_fit(nominal, nominal[common], known[common])
    return placed if worst < AGREES * radius_m else None


def finish_start_values(survey, gathered, measurements):
    """Complete start values: known coordinates, systems, and curvature of the earth.

    Parameters
    ----------
    survey : network.Survey
    gathered : GatheredSurvey
    measurements : Measurements

    Returns
    -------
    network.Survey
    """
    known, photos = gathered.known.xyz_m, survey.photos
    acting = survey.fixed & np.isfinite(known)
    xyz = np.where(acting | (gathered.idle & np.isfinite(known)), known, survey.xyz_m)
    # A coordinate without observation does not affect the others; 0 keeps the equations finite.
    xyz = np.where(gathered.idle & np.isnan(xyz), 0.0, xyz)
    survey = replace(survey, xyz_m=xyz)
    if photos is not None:
        survey = replace(survey, photos=_set_fixed_elements(photos, gathered.survey.photos))
    survey = replace(survey, systems=_systems(survey))
    return _bent(survey, gathered, measurements)


def _set_fixed_elements(photos, original):
    """Photos with their fixed elements at the given values."""
    is_fixed = original.fixed[:, :3] & np.isfinite(original.xyz_m)
    turned = original.fixed[:, 3] & np.isfinite(original.rotation).all(axis=(1, 2))
    return replace(
        photos,
        xyz_m=np.where(is_fixed, original.xyz_m, photos.xyz_m),
        rotation=np.where(turned[:, None, None], original.rotation, photos.rotation),
        fixed=original.fixed,
    )


def _systems(survey):
    """Systems with start values of their transformations, from points known in both frames."""
    completed = list(survey.systems)
    for coordinates in survey.observations:
        if not isinstance(coordinates, SystemCoordinates):
            continue
        for number, system in enumerate(survey.systems):
            rows = np.flatnonzero(coordinates.system == number)
            theirs = np.full((len(survey.points), 3), np.nan)
            theirs[coordinates.point[rows], coordinates.axis[rows]] = coordinates.value[rows]
            common = np.isfinite(theirs).all(axis=1) & np.isfinite(survey.xyz_m).all(axis=1)
            # A rigid transformation needs three points.
            if common.sum() < 3:
                raise SolutionError(
                    message(
                        "system_of_few",
                        "system {name}: its transformation needs 3 points with x, y and z that "
                        "are also measured, {count} were given",
                        name=system.name,
                        count=common.sum(),
                    )
                )
            here, xyz_of_system = survey.xyz_m[common], theirs[common]
            rotation = similarity(here, xyz_of_system).rotation
            shift = xyz_of_system.mean(axis=0) - rotation @ here.mean(axis=0)
            completed[number] = replace(system, rotation=rotation, shift_m=shift)
    return tuple(completed)


def _bent(survey, gathered, measurements):
    """Slope distances with the curvature of the earth (less refraction) added to the rise of
    their sights."""
    bend = bend_per_m(measurements.settings.refraction)
    if not bend:
        return survey
    observations = list(survey.observations)
    for number, distances in enumerate(observations):
        slope = isinstance(distances, Distances) and not distances.horizontal
        if slope and distances.trace.table == "slope_distances":
            # Curvature depends on approximate coordinates only, so it is computed once, here.
            rise = 0.0 if distances.rise_m is None else distances.rise_m
            line = (survey.xyz_m[distances.end] - survey.xyz_m[distances.start])[:, :2]
            observations[number] = replace(distances, rise_m=rise + bend * np.sum(line**2, axis=1))
    return replace(survey, observations=tuple(observations))
