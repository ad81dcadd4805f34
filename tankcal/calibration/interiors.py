"""The sets of interior parameters that an adjustment gave, or that a record keeps.

Photos with the same parameters share a set.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.calibration.edges import Frame
from tankcal.camera.formats.frame import make_film_camera, make_framed_camera
from tankcal.camera.model import AFFINITIES, CONVENTIONS, PARAMETERS, Form
from tankcal.errors import InputError, Problem, reason_of
from tankcal.messages import Message, list_some, message

MOST_NAMES = 20  # in a message


@dataclass(frozen=True)
class Interior:
    """One set of interior parameters.

    camera        name                 photos     names of those of the set, None: all of the camera
    form          camera.Form
    values        (13,) mm, in the order of PARAMETERS
    scope, state  (13,) as in network.Camera
    free          names (k,) of the parameters that were adjusted
    covariance    (k, k) of these
    frame         edges.Frame; of the farthest image point where the format is not known
    frame_known   whether it was declared
    format_mm     (2,) width and height, or None
    shared        whether other sets have some of the parameters in common, so that dropping one
                  changes more than this set
    """

    camera: str
    photos: tuple | None
    form: Form
    values: np.ndarray
    scope: tuple
    state: tuple
    free: tuple
    covariance: np.ndarray
    frame: Frame
    frame_known: bool
    format_mm: np.ndarray | None = None
    shared: bool = False


def interiors_of(adjustment, measurements=None):
    """Interior orientations of an adjustment, covariances scaled like its own.

    Parameters
    ----------
    adjustment : survey.Adjustment
        The adjusted survey.
    measurements : job.Measurements, optional
        What it was made from: formats of the images.

    Returns
    -------
    tuple of Interior
    """
    adjusted = adjustment.adjusted
    survey = adjusted.survey
    if survey.photos is None or not len(survey.photos.names):
        return ()
    sets = {}
    for photo, places in enumerate(adjusted.problem.interior_of.tolist()):
        sets.setdefault((int(survey.photos.camera[photo]), tuple(places)), []).append(photo)
    setups = {one.camera.name: one for one in getattr(measurements, "cameras", ())}
    return tuple(
        _interior(adjustment, setups, camera, photos, _several(sets, camera), len(sets) > 1)
        for (camera, _), photos in sets.items()
    )


def _several(sets, camera):
    return sum(one == camera for one, _ in sets) > 1


def _interior(adjustment, setups, number, photos, part, others):
    adjusted = adjustment.adjusted
    camera = adjusted.survey.cameras[number]
    values, free, cofactors = adjusted.camera(photos[0])
    setup = setups.get(camera.name)
    size = _of(setup, "format_mm")
    common = others and any(scope == "block" for scope in camera.scope)
    images = adjusted.survey.image_points
    mine = np.isin(images.photo, photos) & images.in_use
    seen = images.value[mine]
    half = np.abs(seen).max(axis=0, initial=0.0) if size is None else np.asarray(size) / 2
    return Interior(
        camera=camera.name,
        photos=tuple(adjusted.survey.photos.names[i] for i in photos) if part else None,
        form=camera.form,
        values=np.array([values[name] for name in PARAMETERS]),
        scope=tuple(camera.scope),
        state=tuple(camera.state),
        free=tuple(free),
        covariance=adjustment.cov_scale * np.asarray(cofactors),
        frame=Frame(half, float(np.hypot(*seen.T).max(initial=0.0)), _of(setup, "pixel_mm")),
        frame_known=size is not None,
        format_mm=size,
        shared=part or common,
    )


def _of(setup, name):
    """(2,) of a CameraSetup; None where it is not known."""
    values = getattr(setup, name, None)
    return None if values is None else np.array(values, dtype=float)


def sets_to_be(measurements, camera=None, photo=None):
    """How many sets of camera parameters an adjustment will give, known before it is run.

    Parameters
    ----------
    measurements : Measurements
    camera, photo : str, optional
        Only of this camera, of this photo.

    Returns
    -------
    int
        One for each camera, or one for each photo of a camera that has parameters of its own in
        each photo.
    """
    photos = [one for one in measurements.photos if camera in (None, one.camera)]
    alone = {
        one.camera.name
        for one in measurements.cameras
        if "photo" in [s for s in one.camera.scope if s != "off"]
    }
    own = [one for one in photos if one.camera in alone and photo in (None, one.name)]
    return len(own) + len({one.camera for one in photos} - alone)


def photos_in(record):
    """{photo: its camera} of a record (dict); InputError where it does not say them."""
    try:
        return {one["photo"]: one["camera"] for one in record["adjustment"]["photos"]}
    except (KeyError, TypeError) as error:
        raise InputError(
            _problem(
                message("camera_no_list", "expected a list of photos, each with its camera"),
                "adjustment.photos",
            )
        ) from error


def refuse_unknown(photos, camera=None, photo=None):
    """Raise InputError for the name of a camera, or of a photo of it, that is not there.

    photos  {photo: its camera}
    """
    cameras = list(dict.fromkeys(photos.values()))
    if camera is not None and camera not in cameras:
        raise InputError(Problem("--camera", _unknown(camera, cameras)))
    own = [name for name, of in photos.items() if camera in (None, of)]
    if photo is not None and photo not in own:
        raise InputError(Problem("--photo", _unknown(photo, own)))


def _unknown(name, known):
    return message(
        "camera_unknown_name",
        "found {found!r}; expected one of {names}",
        found=name,
        names=list_some(known, MOST_NAMES),
    )


def select_interiors(interiors, photos, camera=None, photo=None):
    """Those of a camera, and of a photo; all of them without names. InputError: there are none.

    photos  {photo: its camera}
    """
    refuse_unknown(photos, camera, photo)
    return tuple(
        one
        for one in interiors
        if camera in (None, one.camera)
        and (photo is None or (photos[photo] == one.camera and photo in (one.photos or (photo,))))
    )


def framed_in(record, pixel_mm=None):
    """Cameras of a record and their covariances.

    Parameters
    ----------
    record : dict
        A record as read.
    pixel_mm : float, optional
        Side of a pixel, mm, for cameras of which the record knows none (film); None: they stay
        without pixels.

    Returns
    -------
    cameras
        [(name, FramedCamera)].
    covariances
        (13, 13) of each, nan on its diagonal for what was not adjusted.

    Raises
    ------
    InputError
        For cameras without a format.
    """
    cameras, covariances, problems = [], [], []
    for one in interiors_in(record):
        if one.format_mm is None:
            problems.append(
                _problem(
                    message(
                        "camera_format_missing",
                        "camera {camera}: expected its format",
                        camera=one.camera,
                    )
                )
            )
            continue
        cameras.append((one.camera, _framed(one, pixel_mm)))
        covariances.append(_among_all(one.free, one.covariance))
    if problems:
        raise InputError(problems)
    return cameras, covariances


def _framed(interior, pixel_mm):
    """FramedCamera of an Interior with a format; pixel_mm: of a film, or None."""
    pixel = interior.frame.pixel_mm
    if pixel is None and pixel_mm is None:
        return make_film_camera(interior.values, interior.form, interior.format_mm)
    pixel = np.full(2, pixel_mm) if pixel is None else pixel
    size_px = np.round(interior.format_mm / pixel).astype(int)
    return make_framed_camera(interior.values, interior.form, pixel, size_px)


def _among_all(names, covariance):
    """(13, 13) with the covariance of some parameters; nan on the diagonal for the others."""
    found = np.diag([0.0 if name in names else np.nan for name in PARAMETERS])
    places = [PARAMETERS.index(name) for name in names]
    found[np.ix_(places, places)] = covariance
    return found


def interiors_in(record):
    """A tuple of Interior of a record (dict); InputError where it is no sound record of cameras."""
    adjustment = record.get("adjustment") if isinstance(record, dict) else None
    if not isinstance(adjustment, dict):
        raise InputError(
            _problem(
                message(
                    "camera_no_adjustment",
                    "this record has no adjustment, and so no cameras; expected a record "
                    "with photographs",
                )
            )
        )
    cameras = adjustment.get("cameras")
    if not isinstance(cameras, list) or not cameras:
        raise InputError(
            _problem(
                message(
                    "camera_none_adjusted",
                    "the adjustment of this record has no camera; expected a record with "
                    "photographs",
                )
            )
        )
    found, problems = [], []
    for number, one in enumerate(cameras):
        try:
            found.append(_read(one, cameras))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            problems.append(_problem(_why(error), f"adjustment.cameras[{number}]"))
    if problems:
        raise InputError(problems)
    return tuple(found)


def _refuse_unknown_form(one):
    convention, affinity = one["convention"], one["affinity"]
    if convention not in CONVENTIONS or affinity not in AFFINITIES:
        raise ValueError(
            message(
                "camera_no_form",
                "found {convention!r} and {affinity!r}, expected a form of distortion",
                convention=convention,
                affinity=affinity,
            )
        )
    names, free = one["parameters"], one["free"]
    if not set(names) <= set(PARAMETERS) or not set(free) <= set(names):
        raise ValueError(
            message(
                "camera_parameters_free",
                "found parameters {names} and free {free}; expected known parameters, and "
                "free ones among them",
                names=names,
                free=list(free),
            )
        )


def _refuse_impossible(values, covariance, half):
    if not (np.isfinite(covariance).all() and np.isfinite(values).all() and (half > 0).all()):
        raise ValueError(
            message(
                "camera_number_not_finite",
                "found a number that is not finite, or no "
                "frame; expected finite numbers and a frame",
            )
        )
    if (np.diag(covariance) < 0).any():
        raise ValueError(
            message("camera_negative_variance", "found a negative variance; expected 0 or more")
        )
    if not values[0] > 0:
        raise ValueError(
            message(
                "camera_no_principal_distance",
                "found c = {c:g}, expected a principal distance above 0",
                c=values[0],
            )
        )


def _read(one, cameras):
    _refuse_unknown_form(one)
    names, free = one["parameters"], tuple(one["free"])
    given = dict(zip(names, one["values"], strict=True))
    scope = dict(zip(names, one["scopes"], strict=True))
    state = dict(zip(names, one["states"], strict=True))
    covariance = np.array(one["covariance"], dtype=float).reshape(len(free), len(free))
    values = np.array([given.get(name, 0.0) for name in PARAMETERS], dtype=float)
    half = np.array(one["edge_mm"], dtype=float).reshape(2)
    _refuse_impossible(values, covariance, half)
    common = len(cameras) > 1 and "block" in scope.values()
    return Interior(
        camera=str(one["camera"]),
        photos=None if one["photos"] is None else tuple(one["photos"]),
        form=Form(one["convention"], one["affinity"], float(one["radial_balance_mm"])),
        values=values,
        scope=tuple(scope.get(name, "off") for name in PARAMETERS),
        state=tuple(state.get(name, "free") for name in PARAMETERS),
        free=free,
        covariance=covariance,
        frame=Frame(half, _reach(one.get("reach_mm")), _two(one.get("pixel_mm"))),
        frame_known=bool(one["edge_known"]),
        format_mm=_two(one.get("format_mm")),
        shared=one["photos"] is not None or common,
    )


def _two(values):
    """(2,) of a pair above 0, or None."""
    if values is None:
        return None
    pair = np.array(values, dtype=float).reshape(2)
    if not (np.isfinite(pair).all() and (pair > 0).all()):
        raise ValueError(
            message(
                "camera_two_numbers", "found {found}, expected two numbers above 0", found=values
            )
        )
    return pair


def _reach(value):
    """Distance of the farthest image point; inf where a record does not say it."""
    reach = np.inf if value is None else float(value)
    if not reach > 0:
        raise ValueError(
            message(
                "camera_reach", "found reach_mm {found}, expected a distance above 0", found=value
            )
        )
    return reach


def _why(error):
    if isinstance(error, KeyError):
        return message("camera_key_missing", "missing key {key!r}", key=str(error.args[0]))
    if error.args and isinstance(error.args[0], Message):
        return error.args[0]
    return message("camera_unreadable", "cannot be read: {error}", error=reason_of(error))


def _problem(expected, column=None):
    return Problem("record.json", expected, None, column)
