"""Start values of a gathered survey: control, nominal tank, and what the observations give."""

from dataclasses import replace

import numpy as np

from tankcal.errors import Problem, SolutionError
from tankcal.messages import message
from tankcal.survey.network.snooping import start_from_adjusted as started_from
from tankcal.survey.observations import ControlCoordinates, Distances, SystemCoordinates
from tankcal.survey.readings import bend_per_m
from tankcal.survey.start.approximation import approximate, nominal_places
from tankcal.survey.start.pieces import similarity

MIRRORED_BETTER = 0.3  # a reflection is believed when it leaves less than this share


def plan_fit(points, source, target):
    """Points (n, 3) turned and shifted in plan, shifted in height, as source fits target (k, 3).

    Turned over (a reflection in plan) when that fits far better and three points say so. Returns
    the points and the largest distance that is left.
    """
    return _plan_fit(points, source, target, -1.0 if turned_over(source, target) else 1.0)


def turned_over(source, target):
    """Whether a reflection in plan brings points (k, 3) far better onto others than a turn."""
    if len(source) < 3:
        return False
    straight, over = (_plan_fit(source, source, target, side)[1] for side in (1.0, -1.0))
    return over < MIRRORED_BETTER * straight


def _plan_fit(points, source, target, side):
    flip = np.array([side, 1.0, 1.0])
    middle, goal = (source * flip).mean(axis=0), target.mean(axis=0)
    a, b = source * flip - middle, target - goal
    u, v = a[:, 0] + 1j * a[:, 1], b[:, 0] + 1j * b[:, 1]
    turn = np.sum(np.conj(u) * v)
    turn = turn / abs(turn) if abs(turn) > 0 else 1.0

    def moved(xyz):
        d = xyz * flip - middle
        w = (d[:, 0] + 1j * d[:, 1]) * turn
        return goal + np.column_stack([w.real, w.imag, d[:, 2]])

    return moved(points), float(np.linalg.norm(moved(source) - target, axis=1).max())


TRUST_M = 0.01  # sd of control while start values are sought
AGREES = 0.1  # of the radius: nominal coordinates further from control are in no common frame


def add_start_values(gathered, measurements):
    """The network survey with start values for all its unknowns.

    Control decides the frame; nominal coordinates are brought into it. Photos and points without
    values get them from the observations. Raises SolutionError naming what has none.
    """
    survey, known = gathered.survey, gathered.known.xyz_m
    failure = None
    observations = survey.observations + _trusted(survey, known, measurements.settings)
    for xyz, photos in _attempts(survey, known, measurements):
        try:
            found = approximate(
                replace(survey, xyz_m=xyz, photos=photos, observations=observations)
            )
        except SolutionError as error:
            failure = failure or error
            continue
        found = replace(found, observations=survey.observations)
        return finish_start_values(found, gathered, measurements)
    raise failure


def started_like(adjusted, gathered, measurements):
    """The survey started from another one of the same points and photos that was adjusted.

    None when it is not of the same, or when that one lost a point.
    """
    survey, other = gathered.survey, adjusted.survey
    photos = () if survey.photos is None else survey.photos.names
    same = survey.points == other.points and len(survey.sets) == len(other.sets)
    same = same and photos == (() if other.photos is None else other.photos.names)
    if not same or not np.isfinite(adjusted.xyz_m).all():
        return None
    return finish_start_values(started_from(survey, adjusted), gathered, measurements)


def _trusted(survey, known, settings):
    """Control as observations, for start values only, where the datum does not let it act."""
    point, axis = np.nonzero(np.isfinite(known))
    if settings.datum == "control" or not len(point):
        return ()
    return (ControlCoordinates(known[point, axis], np.full(len(point), TRUST_M), point, axis),)


def _attempts(survey, known, measurements):
    """Start coordinates and photos to try, the most trusted first."""
    nominal = nominal_points(measurements, survey.points)
    idle = survey.fixed & np.isnan(known)
    base = np.where(idle, 0.0, known)
    choices = []
    if nominal is not None:
        placed = _in_frame_of(known, nominal, measurements.nominal.radius_m)
        if placed is not None:
            choices.append(np.where(np.isnan(base), placed, base))
    control = np.isfinite(known).all(axis=1).sum()
    choices.insert(0 if control > 3 and nominal is not None and placed is None else 1, base)
    if nominal is not None and placed is None:
        choices.append(np.where(np.isnan(base), nominal, base))
    photos = survey.photos
    for xyz in choices:
        yield xyz, photos
    if photos is not None and np.isfinite(photos.xyz_m).any():
        unknown = replace(
            photos,
            xyz_m=np.full_like(photos.xyz_m, np.nan),
            rotation=np.full_like(photos.rotation, np.nan),
        )
        for xyz in choices:
            yield xyz, unknown


def nominal_points(measurements, points):
    """Nominal coordinates (points, 3) of targets with generatrices 1 to n; None without a tank."""
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
        z_nominal = bottom + tank.height_m * (section - 0.5) / np.nanmax(section)
        z = np.where(np.isnan(z), z_nominal, z)
    found = nominal_places(generatrix, np.nanmax(generatrix), z, tank.radius_m)
    place = dict(zip(targets.point, found, strict=True))
    nowhere = np.full(3, np.nan)
    return np.array([place.get(name, nowhere) for name in points])


def mirrored_targets(xyz_m, points, measurements):
    """Problem rows when adjusted points (points, 3) are a mirror image of the nominal tank."""
    nominal = nominal_points(measurements, points)
    if nominal is None:
        return []
    common = np.isfinite(nominal).all(axis=1) & np.isfinite(xyz_m).all(axis=1)
    if not turned_over(nominal[common], xyz_m[common]):
        return []
    text = message(
        "mirrored_generatrices",
        "the adjusted points are a mirror image of the generatrices: these are numbered "
        "anticlockwise (correct if that is intended), or images are mirrored, or x and y of "
        "control are swapped",
    )
    return [Problem("targets.csv", text, None, "generatrix")]


def _whole(name):
    """The number that a name is, or nan."""
    return float(name) if name is not None and str(name).strip().isdigit() else np.nan


def _in_frame_of(known, nominal, radius_m):
    """Nominal coordinates in the frame of control; None when the two cannot be brought together."""
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
    """A survey with starts: known coordinates as given, systems, the earth's bend."""
    known, photos = gathered.known.xyz_m, survey.photos
    acting = survey.fixed & np.isfinite(known)
    xyz = np.where(acting | (gathered.idle & np.isfinite(known)), known, survey.xyz_m)
    xyz = np.where(gathered.idle & np.isnan(xyz), 0.0, xyz)
    survey = replace(survey, xyz_m=xyz)
    if photos is not None:
        survey = replace(survey, photos=_with_fixed(photos, gathered.survey.photos))
    survey = replace(survey, systems=_systems(survey))
    return _bent(survey, gathered, measurements)


def _with_fixed(photos, given):
    """Photos with their fixed elements at the values given."""
    held = given.fixed[:, :3] & np.isfinite(given.xyz_m)
    turned = given.fixed[:, 3] & np.isfinite(given.rotation).all(axis=(1, 2))
    return replace(
        photos,
        xyz_m=np.where(held, given.xyz_m, photos.xyz_m),
        rotation=np.where(turned[:, None, None], given.rotation, photos.rotation),
        fixed=given.fixed,
    )


def _systems(survey):
    """Systems with start values of their transformations, from points that both frames know."""
    found = list(survey.systems)
    for one in survey.observations:
        if not isinstance(one, SystemCoordinates):
            continue
        for number, system in enumerate(survey.systems):
            rows = np.flatnonzero(one.system == number)
            theirs = np.full((len(survey.points), 3), np.nan)
            theirs[one.point[rows], one.axis[rows]] = one.value[rows]
            common = np.isfinite(theirs).all(axis=1) & np.isfinite(survey.xyz_m).all(axis=1)
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
            here, there = survey.xyz_m[common], theirs[common]
            rotation = similarity(here, there).rotation
            shift = there.mean(axis=0) - rotation @ here.mean(axis=0)
            found[number] = replace(system, rotation=rotation, shift_m=shift)
    return tuple(found)


def _bent(survey, gathered, measurements):
    """Slope distances with the earth's bend (less refraction) among the rises of their sights."""
    bend = bend_per_m(measurements.settings.refraction)
    if not bend:
        return survey
    observations = list(survey.observations)
    for number, one in enumerate(observations):
        slope = isinstance(one, Distances) and not one.horizontal
        if slope and one.trace.table == "slope_distances":
            rise = 0.0 if one.rise_m is None else one.rise_m
            line = (survey.xyz_m[one.end] - survey.xyz_m[one.start])[:, :2]
            observations[number] = replace(one, rise_m=rise + bend * np.sum(line**2, axis=1))
    return replace(survey, observations=tuple(observations))
