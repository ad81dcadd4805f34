"""Start values of a gathered survey, from control, the nominal tank and the observations.

Approximate values of photos, points and circles from all observations.

Certain knowledge (control, fixed or weighted photos) grows first: photos by resection, points by
intersection, stations and points in plan, heights. Approximate values (nominal coordinates) follow,
in a frame of their own where enough is common to transform it. Local frames come last: photos by
relative orientation, set-ups by their own readings.
"""

from dataclasses import replace

import numpy as np

from tankcal.errors import Problem, SolutionError
from tankcal.messages import message
from tankcal.survey.network.snooping import start_from_adjusted as started_from
from tankcal.survey.observations import ControlCoordinates, Distances, SystemCoordinates
from tankcal.survey.readings import bend_per_m
from tankcal.survey.start.loose_frames import join_local_frames
from tankcal.survey.start.photographs import (
    SURE,
    add_points,
    agreed_error,
    bearings,
    grow_by_photos,
    image_errors,
    sights_of,
)
from tankcal.survey.start.pieces import (
    BAD_JOINT,
    Clues,
    certain_places,
    grow_piece,
    hinted_places,
    joint,
    similarity,
)
from tankcal.survey.start.plan_frames import find_plan_positions
from tankcal.survey.start.polar import medians, orient_circles, plan_of
from tankcal.survey.start.single_points import (
    LISTED,
    loose_frame_sentence,
    refuse_missing,
    sought_point,
    unfixed_point_error,
)

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


# ---- approximation from all observations

TRIALS = 3  # with other samples, while the images contradict the result
ODDS = 0.05  # largest share of photos and known points that may contradict the images
KEPT_ERROR = 0.05  # error over c of a given photo above which its values are computed anew
MOSTLY = 0.5  # share of given photos that must agree for any to be trusted
KEPT_SHARE = 0.05  # of the extent: given values farther from the computed ones are replaced
ENOUGH = 3  # common places of two frames
MENDING = 2  # rounds in which poorly fitting photos are recomputed
AT_ODDS = 0.02  # error over c above which a photo or a known point is wrong
WORSE = 5.0  # ratio to the median error of the photos, above which a photo fits poorly
SMALL_ERROR = 3e-3  # error over c that is always accepted: 0.3 mm at c = 100 mm


def nominal_places(generatrix, generatrices, z_m, radius_m, offset_m=0.0):
    """Nominal coordinates (n, 3) of targets; generatrices count clockwise from +y, starting at 1.

    Parameters
    ----------
    generatrix : array_like, shape (n,)
    generatrices : int
        Number of generatrices.
    z_m : array_like, shape (n,)
    radius_m : float
    offset_m : float or array_like, shape (n,)
        From the wall outwards.

    Returns
    -------
    ndarray, shape (n, 3)
    """
    azimuth = 2 * np.pi * (np.asarray(generatrix) - 1) / generatrices
    r = radius_m + np.asarray(offset_m)
    return np.column_stack([r * np.sin(azimuth), r * np.cos(azimuth), z_m])


def approximate(survey, seed=0, wall=None):
    """Compute start values of all points, photos and direction sets without one (nan).

    Given values that contradict the image points are replaced unless they are fixed or observed.

    Parameters
    ----------
    survey : network.Survey
    seed : int
        Of the random samples.
    wall : Wall, optional
        Wall of the points in the frame of the survey, which selects the pose of a photo with three
        known points. None: fitted to the known points where they lie on a wall.

    Returns
    -------
    network.Survey

    Raises
    ------
    SolutionError
        If unknowns remain without start value; the message names them and the reasons.
    """
    sure, hints = certain_places(survey), hinted_places(survey)
    if _complete(survey, hints.piece):
        return survey
    centre = _centre(sure, hints)
    # Coordinates relative to the centre keep rounding small.
    sure, hints = sure.shifted(-centre), hints.shifted(-centre)
    if wall is not None:
        wall = replace(wall, centre_m=wall.centre_m - centre[:2])
    results = []
    for trial in range(TRIALS):
        clues = Clues(
            survey,
            sights_of(survey),
            plan_of(survey),
            wall,
            np.random.default_rng([seed, trial]),
            trial,
        )
        piece, reasons = _grow_all(clues, sure, hints)
        known = np.isfinite(sure.piece.xyz_m).all(axis=1)
        missing = float(np.mean(~piece.oriented)) if len(piece.oriented) else 0.0
        # A trial is scored by missing photos and by contradictions with the images.
        odds = missing + contradictions(clues.sights, piece, known)
        results.append((odds, trial, piece, reasons))
        if odds < ODDS:
            break
    _, _, piece, reasons = min(results, key=lambda result: result[:2])
    return _fill_start_values(clues, piece, sure, hints, centre, reasons)


def _grow_all(clues, sure, hints):
    """Compute a Piece of all reachable places, and sentences about parts that did not join."""
    piece, reasons = sure.piece, []
    for least in (SURE, 3):  # photos with few known points are placed better by other photos first
        piece = grow_piece(clues, piece, least)
        piece = _extend_by_hints(clues, piece, sure, hints, least)
        known_points = int(piece.known.sum())
        piece, reasons = join_local_frames(clues, piece, hints.piece.place_m, least)
        if clues.survey.photos is None and piece.known.sum() == known_points:
            break  # without photographs and new points the second pass equals the first
    soft = hints.piece.known & ~np.isfinite(sure.piece.xyz_m).any(axis=1)
    piece = add_points(clues.sights, replace(piece, by_photos=piece.by_photos | soft))
    piece = repair_photos(clues.sights, piece, sure.piece.oriented, clues.rng, clues.wall)
    return guess_places(clues.sights, piece), reasons


def _complete(survey, given_piece):
    """Whether all start values exist and no photo contradicts its image points."""
    if np.isnan(survey.xyz_m).any() or np.isnan(survey.sets).any():
        return False
    if survey.photos is None:
        return True
    if not given_piece.oriented.all():
        return False
    errors = [photo_error(sight, given_piece, i) for i, sight in enumerate(sights_of(survey))]
    return bool(np.all(np.nan_to_num(errors) < KEPT_ERROR))


def _centre(sure, hints):
    """Mean (3,) of the known coordinates, separately for each axis."""
    places = np.vstack([coordinates for known in (sure, hints)
                        for coordinates in (known.piece.xyz_m, known.piece.place_m)])  # fmt: skip
    count = np.isfinite(places).sum(axis=0)
    return np.nansum(places, axis=0) / np.maximum(count, 1)


def _extend_by_hints(clues, piece, sure, hints, least):
    """Extend a Piece by approximate values, joined by common places or used directly."""
    if (piece.known.all() and piece.oriented.all()) or hints.nothing:
        return piece
    if (piece.known.sum() + piece.oriented.sum()) >= ENOUGH:
        local = grow_piece(clues, _credible(clues, hints.without(sure).piece), least)
        common = (local.known & piece.known).sum() + (local.oriented & piece.oriented).sum()
        motion = joint(local, piece, clues.rng) if common >= ENOUGH else None
        # A good joint shows that the hints only have another frame.
        if motion is not None and motion.misfit_m < BAD_JOINT * piece.extent:
            joined = piece.fill_from(local.moved(motion))
            return grow_piece(clues, add_points(clues.sights, joined), least)
    merged = _credible(clues, piece.fill_from(hints.piece), piece.oriented)
    return grow_piece(clues, merged, least)


def _credible(clues, piece, held=False):
    """Remove photos whose image points contradict the points of the Piece and other photos.

    If most photos are wrong, the agreement of the others may be accidental, and all are removed.

    Parameters
    ----------
    clues : Clues
    piece : Piece
    held : ndarray of bool, shape (photos,)
        Photos that are never removed.
    """
    removable = piece.oriented & ~np.asarray(held)
    remaining = removable.copy()
    while remaining.any():
        piece = _remove_photos(piece, removable & ~remaining)
        trial, photos = add_points(clues.sights, piece), np.flatnonzero(remaining)
        errors = np.array([photo_error(clues.sights[i], trial, i) for i in photos])
        bad = errors > KEPT_ERROR
        if not bad.any():
            break
        # Remove the worst half at most: the others may look bad because of them.
        order = np.argsort(-np.nan_to_num(errors, nan=np.inf))
        remaining[photos[order[: max(1, bad.sum() // 2)]]] = False
        if remaining.sum() < MOSTLY * removable.sum():
            remaining[:] = False
    return _remove_photos(piece, removable & ~remaining)


def _remove_photos(piece, photos):
    """The Piece without the photos of a mask (photos,)."""
    return replace(
        piece,
        place_m=np.where(photos[:, None], np.nan, piece.place_m),
        rotation=np.where(photos[:, None, None], np.nan, piece.rotation),
    )


def _fill_start_values(clues, piece, sure, hints, centre, reasons):
    """The Survey with the start values; given values stay where they agree with the computed
    ones."""
    survey, given_piece = clues.survey, hints.piece
    xyz = np.where(np.isfinite(sure.piece.xyz_m), sure.piece.xyz_m, piece.xyz_m)
    off = np.linalg.norm(given_piece.xyz_m - xyz, axis=1)
    keep = np.isfinite(given_piece.xyz_m) & ~(off > KEPT_SHARE * piece.extent)[:, None]
    untouched = keep | (np.isfinite(survey.xyz_m) & np.isnan(given_piece.xyz_m))
    xyz = np.where(untouched, survey.xyz_m - centre, xyz)
    zeros = orient_circles(clues.plan, xyz[:, :2])[: len(survey.sets)]
    zeros = np.where(clues.plan.at[: len(zeros)] < 0, 0.0, zeros)  # circles without readings
    sets = np.where(np.isfinite(survey.sets), survey.sets, zeros)
    refusals = {}
    if np.isnan(xyz[:, :2]).any():
        refusals = _errors_of_tied_points(clues, xyz, centre)
        # Repeat the search in plan to name the frames that did not join.
        _, apart = find_plan_positions(clues.plan, xyz[:, :2], xyz[:, 2], clues.rng)
        reasons = reasons + [
            loose_frame_sentence(survey, local.known, np.isfinite(xyz[:, 0]))
            for local in apart
            if not (local.known & np.isnan(xyz[:, 0]))[list(refusals)].any()
        ]
    xyz = refuse_missing(survey, clues.sights, xyz, piece, sets, reasons, refusals.get)
    xyz = np.where(untouched, survey.xyz_m, xyz + centre)
    if survey.fixed is not None:
        xyz = np.where(survey.fixed & np.isfinite(survey.xyz_m), survey.xyz_m, xyz)
    return replace(survey, xyz_m=xyz, photos=_photos(survey, piece, given_piece, centre), sets=sets)


def _errors_of_tied_points(clues, xyz_m, centre):
    """{point: error} of points tied to known points that are not determined by these ties."""
    errors = {}
    for point in np.flatnonzero(np.isnan(xyz_m[:, :2]).any(axis=1))[:LISTED]:
        found = sought_point(clues.survey, clues.plan, xyz_m, point, clues.sought)
        if found.rows:
            errors[int(point)] = unfixed_point_error(clues.survey, found, point, centre)
    return errors


def _photos(survey, piece, given_piece, centre):
    """The Photos with start values; given photos that were kept are unchanged."""
    photos = survey.photos
    if photos is None:
        return None
    stayed = (piece.place_m == given_piece.place_m).all(axis=1)
    held = np.zeros((len(stayed), 4), dtype=bool) if photos.fixed is None else photos.fixed
    place = np.where(stayed[:, None] | held[:, :3], photos.xyz_m, piece.place_m + centre)
    rotation = np.where(held[:, 3, None, None], photos.rotation, piece.rotation)
    return replace(photos, xyz_m=place, rotation=rotation)


# ---- agreement of a piece with its images, and repair of photos that contradict it


def repair_photos(sights, piece, held, rng, wall=None):
    """Recompute photos that fit far worse than the others.

    Parameters
    ----------
    sights : sequence of Sight
    piece : Piece
    held : ndarray of bool, shape (photos,)
        Photos that stay.
    rng : numpy.random.Generator
    wall : Wall, optional

    Returns
    -------
    Piece
    """
    for _ in range(MENDING):
        errors = photo_errors(sights, piece)
        bad = errors > max(
            WORSE * (float(np.nanmedian(errors)) if np.isfinite(errors).any() else 0.0), SMALL_ERROR
        )
        bad &= piece.oriented & ~held
        if not bad.any():
            return piece
        # Points from photos may be spoilt by the bad ones, so they are recomputed as well.
        less = replace(
            piece,
            xyz_m=np.where(piece.by_photos[:, None], np.nan, piece.xyz_m),
            place_m=np.where(bad[:, None], np.nan, piece.place_m),
            rotation=np.where(bad[:, None, None], np.nan, piece.rotation),
        )
        again = grow_by_photos(sights, less, rng, wall)
        # A repair that loses photos is not one.
        if again.oriented.sum() < piece.oriented.sum():
            return piece
        piece = again
    return piece


def photo_errors(sights, piece):
    """Errors (photos,) over c met by more than half of the points of each photo; nan: not
    oriented."""
    photos = zip(range(len(sights)), piece.oriented, strict=True)
    return np.array(
        [
            photo_error(sights[i], piece, i, most=True) if is_oriented else np.nan
            for i, is_oriented in photos
        ]
    )


def contradictions(sights, piece, sure):
    """Share of photos, plus share of known points, that contradict the images.

    Parameters
    ----------
    sights : sequence of Sight
    piece : Piece
    sure : ndarray of bool, shape (points,)
        Points with certain positions.
    """
    if not sights:
        return 0.0
    errors = photo_errors(sights, piece)
    errors_of_photos = [_errors(sights[i], piece, i) for i in np.flatnonzero(piece.oriented)]
    number = np.concatenate([part for part, _ in errors_of_photos] + [np.zeros(0, dtype=int)])
    off = np.concatenate([part for _, part in errors_of_photos] + [np.zeros(0)])
    is_sure = sure[number]
    _, middle = medians(number[is_sure], np.minimum(off[is_sure], 1e3))
    wrong = float(np.mean(middle > AT_ODDS)) if len(middle) else 0.0
    return float(np.mean(~(errors < AT_ODDS))) + wrong


def _errors(sight, piece, photo):
    """Known points (n,) in a photo, and their errors (n,) over c."""
    known = piece.known[sight.point]
    points, ideal = piece.xyz_m[sight.point[known]], sight.ideal[known]
    pose = piece.place_m[photo][None], piece.rotation[photo][None]
    return sight.point[known], image_errors(points, ideal, *pose)[0]


def guess_places(sights, piece):
    """Place points on a ray if their rays from two or more photos do not intersect."""
    photos = np.flatnonzero(piece.oriented)
    rays = np.bincount(
        np.concatenate([sights[i].point for i in photos] + [np.zeros(0, dtype=int)]),
        minlength=len(piece.xyz_m),
    )
    xyz, known = piece.xyz_m.copy(), piece.known
    for photo in photos:
        sight = sights[photo]
        is_known = known[sight.point]
        unplaced = ~is_known & (rays[sight.point] > 1) & np.isnan(xyz[sight.point]).all(axis=1)
        if is_known.any() and unplaced.any():
            away = xyz[sight.point[is_known]] - piece.place_m[photo]
            # The median distance of the known points in the photo is the best guess of the depth.
            far = np.median(np.linalg.norm(away, axis=1))
            ray = bearings(sight.ideal[unplaced]) @ piece.rotation[photo]
            xyz[sight.point[unplaced]] = piece.place_m[photo] + far * ray
    return replace(piece, xyz_m=xyz)


def photo_error(sight, piece, photo, most=False):
    """Median error over c of a photo's known points; nan: no such point.

    Parameters
    ----------
    sight : Sight
    piece : Piece
    photo : int
    most : bool
        True: the error met by more than half of the points, as in resection.
    """
    errors = _errors(sight, piece, photo)[1][None]
    if not errors.size:
        return np.nan
    return float(agreed_error(errors)[0] if most else np.median(errors))
