"""Sets of interior parameters of an adjustment or record, and their effect over the frame.

Effect of the parameters of a camera over its frame: shifts of image points, curves.

Three shifts are computed for a parameter:

    own          distortion with the value of the parameter less distortion without it
    left         remaining shift if the parameter is dropped and the other parameters compensate it:
                 difference of the two bundles of rays at the principal distance of the first,
                 corrected(x) - corrected'(x) c / c'
    left_turned  remaining shift after three small rotations of the second bundle; they correspond
                 to rotations of the photos and absorb most of a shift of the principal point

The frame is the declared format, or else the rectangle of the farthest image points, with GRID by
GRID points. Source: Pessoa 2017 (14-19) for the comparison of bundles.

Distortion curves
-----------------

The radial curve is the measured radius less the radius corrected by the radial terms alone. This
definition holds in every convention. The decentring profile is
sqrt(P1^2 + P2^2) r^2 (1 + P3 r^2 + P4 r^4). On the circle of radius r the largest shift is three
times the profile in the radial direction, and once the profile in the tangential direction.

Source: Brown 1971.

Photos with common parameters belong to one set.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.formats.frame import make_film_camera, make_framed_camera
from tankcal.camera.imaging import apply_first_affinity, distort, distortion_derivatives
from tankcal.camera.model import AFFINITIES, CONVENTIONS, PARAMETERS, Form, correct_image_points
from tankcal.errors import InputError, Problem, reason_of
from tankcal.messages import Message, list_some, message

GRID = 21  # points along each side of the frame
RADIAL = slice(PARAMETERS.index("K1"), PARAMETERS.index("K4") + 1)
DECENTRING = slice(PARAMETERS.index("P1"), PARAMETERS.index("P4") + 1)


@dataclass(frozen=True)
class Shift:
    """Size of a shift over the frame, in um and px; px is nan if the pixel size is not known.

    Attributes
    ----------
    corner_um, corner_px : float
        Largest shift at a corner.
    largest_um, largest_px : float
        Largest shift in the frame.
    rms_um, rms_px : float
        Root mean square over the frame.
    seen_um, seen_px : float
        Largest shift within the radius of the farthest image point; shifts beyond this radius are
        extrapolated.
    """

    corner_um: float
    corner_px: float
    largest_um: float
    largest_px: float
    rms_um: float
    rms_px: float
    seen_um: float
    seen_px: float


@dataclass(frozen=True)
class Frame:
    """Frame of an image.

    Attributes
    ----------
    half_mm : ndarray, shape (2,)
        Half the width and half the height, mm.
    reach_mm : float
        Distance of the farthest image point from the centre, mm; inf if it is not known.
    pixel_mm : ndarray, shape (2,), or None
        Sides of a pixel, mm; None if they are not known.
    """

    half_mm: np.ndarray
    reach_mm: float = np.inf
    pixel_mm: np.ndarray | None = None

    @property
    def corner_mm(self):
        """Distance of the corners from the centre, mm."""
        return float(np.hypot(*self.half_mm))


def own_shift(name, interior, form, frame):
    """Shift of image points by the value of one parameter.

    Parameters
    ----------
    name : str
        Name of the parameter.
    interior : array_like, shape (13,)
        Values of the interior parameters.
    form : tankcal.camera.model.Form
        Form of the distortion model.
    frame : Frame
        Frame of the image.

    Returns
    -------
    Shift or None
        None for the principal distance c, which changes only the scale.
    """
    if name == "c":
        return None
    q, number = np.array(interior, dtype=float), PARAMETERS.index(name)
    points = frame_points(frame.half_mm)
    if name in ("x0", "y0"):
        moved = np.zeros_like(points)
        moved[:, number - 1] = q[number]
        return _size_of_shift(moved, points, frame)
    # Difference of the distortion with the parameter and with the parameter set to zero
    q_without = np.where(np.arange(len(q)) == number, 0.0, q)
    x, y = (points - q[1:3]).T
    side = CONVENTIONS[form.convention] or 1.0

    def shifted(p):
        """Shift (2, n) by the affinity and then the distortion, with interior parameters p."""
        transformed = apply_first_affinity(x, y, p, form.numbers)
        return (
            np.array(transformed)
            - (x, y)
            + side * np.array(distort(*transformed, p, form.numbers)[:2])
        )

    shift_with, shift_without = shifted(q), shifted(q_without)
    return _size_of_shift((shift_with - shift_without).T, points, frame)


def left_shifts(interior, others, form, frame):
    """Shift between two cameras, before and after rotating the second to the best fit.

    Parameters
    ----------
    interior, others : array_like, shape (13,)
        Values of the interior parameters with and without the dropped parameter.
    form : tankcal.camera.model.Form
        Form of the distortion model.
    frame : Frame
        Frame of the image.

    Returns
    -------
    tuple of Shift
        Shift before and after the rotation.
    """
    q, p = np.array(interior, dtype=float), np.array(others, dtype=float)
    points = frame_points(frame.half_mm)
    ideal = correct_image_points(points, q, form)
    # Compare both bundles at the principal distance of the first camera.
    difference = correct_image_points(points, p, form) * (q[0] / p[0]) - ideal
    rotated = difference.ravel()
    rotations = _rotation_derivatives(ideal, q[0]).reshape(-1, 3)
    rotated = rotated - rotations @ np.linalg.lstsq(rotations, rotated, rcond=None)[0]
    return _size_of_shift(difference, points, frame), _size_of_shift(
        rotated.reshape(-1, 2), points, frame
    )


def frame_points(half_frame_mm):
    """Regular points of the frame including its four corners, shape (GRID GRID, 2), mm."""
    axis = np.linspace(-1.0, 1.0, GRID)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    return grid * np.asarray(half_frame_mm, dtype=float)


def _rotation_derivatives(ideal_mm, c_mm):
    """Derivatives (n, 2, 3) of ideal image points by rotations of the camera about x, y, z."""
    x, y = (ideal_mm / c_mm).T
    ones = np.ones_like(x)
    by_x = np.stack([x * y, ones + y * y], axis=1)
    by_y = np.stack([-ones - x * x, -x * y], axis=1)
    by_z = np.stack([y, -x], axis=1)
    return c_mm * np.stack([by_x, by_y, by_z], axis=2)


def _size_of_shift(moved_mm, points_mm, frame):
    corners = [0, GRID - 1, GRID * (GRID - 1), GRID * GRID - 1]
    is_in_reach = np.hypot(*points_mm.T) <= frame.reach_mm
    unknown = np.full(2, np.nan)
    pixel = unknown if frame.pixel_mm is None else np.asarray(frame.pixel_mm, dtype=float)
    um, px = (
        (size[corners].max(), size.max(), np.sqrt(np.mean(size**2)), size[is_in_reach].max())
        for size in (np.hypot(*(moved_mm / unit).T) for unit in (np.full(2, 1e-3), pixel))
    )
    return Shift(*(float(value) for pair in zip(um, px, strict=True) for value in pair))


def radial_curve(radius_mm, interior, form, covariance=None):
    """Radial distortion at measured radii, and its standard deviation.

    The standard deviation follows from the law of propagation of uncertainty.

    Parameters
    ----------
    radius_mm : ndarray, shape (n,)
        Radii in the image as measured, mm.
    interior : array_like, shape (13,)
        Interior parameters in the order of tankcal.camera.model.PARAMETERS.
    form : tankcal.camera.model.Form
        Form of the distortion model.
    covariance : ndarray, shape (4, 4), optional
        Covariance matrix of K1, K2, K3, K4.

    Returns
    -------
    curve_mm : ndarray, shape (n,)
        Radial distortion, mm.
    sd_mm : ndarray, shape (n,), or None
        Standard deviation of the radial distortion, mm; None without a covariance.
    """
    radius = np.asarray(radius_mm, dtype=float)
    radial = np.zeros(len(PARAMETERS))
    radial[RADIAL] = np.asarray(interior, dtype=float)[RADIAL]
    corrected = correct_image_points(
        np.column_stack([radius, np.zeros_like(radius)]), radial, form
    )[:, 0]
    if covariance is None:
        return radius - corrected, None
    # The polynomial is a function of the corrected or of the measured radius, by convention.
    is_of_ideal = form.convention == "distortion_of_ideal"
    radius_of_polynomial = corrected if is_of_ideal else radius
    slope = distort(radius_of_polynomial, 0.0 * radius_of_polynomial, radial, form.numbers)[2]
    by_k = np.array(
        distortion_derivatives(
            radius_of_polynomial, 0.0 * radius_of_polynomial, radial, form.numbers
        )[0][:4]
    )
    if is_of_ideal:  # derivative at a fixed measured radius, by implicit differentiation
        by_k = by_k / (1.0 + slope)
    variance = np.einsum("in,ij,jn->n", by_k, np.asarray(covariance, dtype=float), by_k)
    return radius - corrected, np.sqrt(variance)


def decentring_profile(radius_mm, interior):
    """Magnitude of the decentring profile, a third of the largest radial shift.

    Parameters
    ----------
    radius_mm : ndarray, shape (n,)
        Radii, mm.
    interior : ndarray, shape (13,)
        Interior parameters in the order of tankcal.camera.model.PARAMETERS.

    Returns
    -------
    ndarray, shape (n,)
        Decentring profile, mm.

    Examples
    --------
    >>> import numpy as np
    >>> interior = np.zeros(13)
    >>> interior[7] = 1e-5  # P1
    >>> decentring_profile(np.array([10.0]), interior)
    array([0.001])
    """
    r2 = np.asarray(radius_mm, dtype=float) ** 2
    p1, p2, p3, p4 = np.asarray(interior, dtype=float)[DECENTRING]
    return np.hypot(p1, p2) * r2 * np.abs(1.0 + p3 * r2 + p4 * r2**2)


MOST_NAMES = 20  # largest number of names in a message


@dataclass(frozen=True)
class Interior:
    """One set of interior parameters.

    Attributes
    ----------
    camera : str
        Name of the camera.
    photos : tuple of str or None
        Names of the photos of the set, or None for all photos of the camera.
    form : tankcal.camera.model.Form
        Form of the distortion model.
    values : ndarray, shape (13,)
        Values in the order of PARAMETERS, with lengths in mm.
    scope, state : tuple of str
        Scope and state of each parameter, as in network.Camera.
    free : tuple of str
        Names of the k adjusted parameters.
    covariance : ndarray, shape (k, k)
        Covariance matrix of the adjusted parameters.
    frame : Frame
        Frame of the images, from the farthest image points if the format is not known.
    frame_known : bool
        Whether the format was declared.
    format_mm : ndarray, shape (2,), or None
        Width and height of the image, mm.
    is_shared : bool
        Whether other sets share some of the parameters. Dropping a parameter then changes more
        than this set.
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
    is_shared: bool = False


def collect_interiors(adjustment, measurements=None):
    """Return the interior orientations of an adjustment, with covariances scaled as in it.

    Parameters
    ----------
    adjustment : survey.Adjustment
        The adjusted survey.
    measurements : job.Measurements, optional
        Measurements of the adjustment, for the formats of the images.

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
    setups = {setup.camera.name: setup for setup in getattr(measurements, "cameras", ())}
    cameras_of_sets = [camera for camera, _ in sets]
    return tuple(
        _make_interior(
            adjustment, setups, camera, photos, cameras_of_sets.count(camera) > 1, len(sets) > 1
        )
        for (camera, _), photos in sets.items()
    )


def _make_interior(adjustment, setups, number, photos, is_part, has_others):
    """Create an Interior.

    Parameters
    ----------
    adjustment : survey.Adjustment
        The adjusted survey.
    setups : dict
        {name: job.CameraSetup}.
    number : int
        Number of the camera in the survey.
    photos : list of int
        Numbers of the photos of the set.
    is_part : bool
        Whether the camera has other sets.
    has_others : bool
        Whether the adjustment has other sets.
    """
    adjusted = adjustment.adjusted
    camera = adjusted.survey.cameras[number]
    values, free, cofactors = adjusted.camera(photos[0])
    setup = setups.get(camera.name)
    size = _pair_of_setup(setup, "format_mm")
    is_common = has_others and any(scope == "block" for scope in camera.scope)
    # Without a declared format, the frame extends to the farthest image points.
    images = adjusted.survey.image_points
    is_used = np.isin(images.photo, photos) & images.in_use
    measured = images.value[is_used]
    half = np.abs(measured).max(axis=0, initial=0.0) if size is None else np.asarray(size) / 2
    return Interior(
        camera=camera.name,
        photos=tuple(adjusted.survey.photos.names[i] for i in photos) if is_part else None,
        form=camera.form,
        values=np.array([values[name] for name in PARAMETERS]),
        scope=tuple(camera.scope),
        state=tuple(camera.state),
        free=tuple(free),
        covariance=adjustment.cov_scale * np.asarray(cofactors),
        frame=Frame(
            half, float(np.hypot(*measured.T).max(initial=0.0)), _pair_of_setup(setup, "pixel_mm")
        ),
        frame_known=size is not None,
        format_mm=size,
        is_shared=is_part or is_common,
    )


def _pair_of_setup(setup, name):
    """Pair of values (2,) of a CameraSetup, or None if it is not known."""
    values = getattr(setup, name, None)
    return None if values is None else np.array(values, dtype=float)


def count_sets(measurements, camera=None, photo=None):
    """Predict the number of sets of interior parameters of an adjustment.

    Parameters
    ----------
    measurements : Measurements
        Measurements with cameras and photos.
    camera, photo : str, optional
        Names of a camera and a photo to which the count is restricted.

    Returns
    -------
    int
        One set per camera, or one set per photo for a camera with separate parameters in each
        photo.
    """
    photos = [item for item in measurements.photos if camera in (None, item.camera)]
    with_photo_scope = {
        item.camera.name
        for item in measurements.cameras
        if "photo" in [s for s in item.camera.scope if s != "off"]
    }
    separate = [
        item for item in photos if item.camera in with_photo_scope and photo in (None, item.name)
    ]
    return len(separate) + len({item.camera for item in photos} - with_photo_scope)


def read_photos(record):
    """Return {photo: camera} of a record (dict); raise InputError if the list is missing."""
    try:
        return {photo["photo"]: photo["camera"] for photo in record["adjustment"]["photos"]}
    except (KeyError, TypeError) as error:
        raise InputError(
            _problem(
                message("camera_no_list", "expected a list of photos, each with its camera"),
                "adjustment.photos",
            )
        ) from error


def refuse_unknown(photos, camera=None, photo=None):
    """Raise InputError for an unknown name of a camera or photo.

    Parameters
    ----------
    photos : dict
        {photo: camera}.
    camera, photo : str, optional
        Names to check.
    """
    cameras = list(dict.fromkeys(photos.values()))
    if camera is not None and camera not in cameras:
        raise InputError(Problem("--camera", _message_unknown(camera, cameras)))
    known_photos = [
        name for name, camera_of_photo in photos.items() if camera in (None, camera_of_photo)
    ]
    if photo is not None and photo not in known_photos:
        raise InputError(Problem("--photo", _message_unknown(photo, known_photos)))


def _message_unknown(name, known):
    return message(
        "camera_unknown_name",
        "found {found!r}; expected one of {names}",
        found=name,
        names=list_some(known, MOST_NAMES),
    )


def select_interiors(interiors, photos, camera=None, photo=None):
    """Select the sets of a camera and of a photo.

    Parameters
    ----------
    interiors : sequence of Interior
        Sets of interior parameters.
    photos : dict
        {photo: camera}.
    camera, photo : str, optional
        Names to select; by default all sets are returned.

    Returns
    -------
    tuple of Interior

    Raises
    ------
    InputError
        If a name is unknown.
    """
    refuse_unknown(photos, camera, photo)
    return tuple(
        interior
        for interior in interiors
        if camera in (None, interior.camera)
        and (
            photo is None
            or (photos[photo] == interior.camera and photo in (interior.photos or (photo,)))
        )
    )


def read_framed_cameras(record, pixel_mm=None):
    """Return the cameras of a record and their covariances.

    Parameters
    ----------
    record : dict
        Content of record.json.
    pixel_mm : float, optional
        Side of a pixel, mm, for cameras without pixels in the record (film). By default these
        cameras have no pixels.

    Returns
    -------
    cameras : list of (str, FramedCamera)
        Name and camera.
    covariances : list of ndarray, shape (13, 13)
        Covariance matrix of each camera; nan on the diagonal for parameters not adjusted.

    Raises
    ------
    InputError
        If the format of a camera is missing.
    """
    cameras, covariances, problems = [], [], []
    for interior in read_interiors(record):
        if interior.format_mm is None:
            problems.append(
                _problem(
                    message(
                        "camera_format_missing",
                        "camera {camera}: expected its format",
                        camera=interior.camera,
                    )
                )
            )
            continue
        cameras.append((interior.camera, _make_camera(interior, pixel_mm)))
        covariances.append(_embed_covariance(interior.free, interior.covariance))
    if problems:
        raise InputError(problems)
    return cameras, covariances


def _make_camera(interior, pixel_mm):
    """Create the FramedCamera of an Interior with a format; `pixel_mm` is used for a film."""
    pixel = interior.frame.pixel_mm
    if pixel is None and pixel_mm is None:
        return make_film_camera(interior.values, interior.form, interior.format_mm)
    pixel = np.full(2, pixel_mm) if pixel is None else pixel
    size_px = np.round(interior.format_mm / pixel).astype(int)
    return make_framed_camera(interior.values, interior.form, pixel, size_px)


def _embed_covariance(names, covariance):
    """Embed a covariance matrix in (13, 13); nan on the diagonal for the other parameters."""
    matrix = np.diag([0.0 if name in names else np.nan for name in PARAMETERS])
    indices = [PARAMETERS.index(name) for name in names]
    matrix[np.ix_(indices, indices)] = covariance
    return matrix


def read_interiors(record):
    """Return the Interior objects of a record (dict); raise InputError for an invalid record."""
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
    interiors, problems = [], []
    for number, entry in enumerate(cameras):
        try:
            interiors.append(_read_interior(entry, cameras))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            problems.append(_problem(_message_of_error(error), f"adjustment.cameras[{number}]"))
    if problems:
        raise InputError(problems)
    return tuple(interiors)


def _refuse_unknown_form(entry):
    """Raise ValueError for an unknown form of distortion or unknown parameters."""
    convention, affinity = entry["convention"], entry["affinity"]
    if convention not in CONVENTIONS or affinity not in AFFINITIES:
        raise ValueError(
            message(
                "camera_no_form",
                "found {convention!r} and {affinity!r}, expected a form of distortion",
                convention=convention,
                affinity=affinity,
            )
        )
    names, free = entry["parameters"], entry["free"]
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
    """Raise ValueError for values, variances or a frame that are not possible."""
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


def _read_interior(entry, cameras):
    """Read the Interior of one camera entry of a record."""
    _refuse_unknown_form(entry)
    names, free = entry["parameters"], tuple(entry["free"])
    value_of = dict(zip(names, entry["values"], strict=True))
    scope = dict(zip(names, entry["scopes"], strict=True))
    state = dict(zip(names, entry["states"], strict=True))
    covariance = np.array(entry["covariance"], dtype=float).reshape(len(free), len(free))
    values = np.array([value_of.get(name, 0.0) for name in PARAMETERS], dtype=float)
    half = np.array(entry["edge_mm"], dtype=float).reshape(2)
    _refuse_impossible(values, covariance, half)
    is_common = len(cameras) > 1 and "block" in scope.values()
    return Interior(
        camera=str(entry["camera"]),
        photos=None if entry["photos"] is None else tuple(entry["photos"]),
        form=Form(entry["convention"], entry["affinity"], float(entry["radial_balance_mm"])),
        values=values,
        scope=tuple(scope.get(name, "off") for name in PARAMETERS),
        state=tuple(state.get(name, "free") for name in PARAMETERS),
        free=free,
        covariance=covariance,
        frame=Frame(
            half, _read_reach(entry.get("reach_mm")), _positive_pair(entry.get("pixel_mm"))
        ),
        frame_known=bool(entry["edge_known"]),
        format_mm=_positive_pair(entry.get("format_mm")),
        is_shared=entry["photos"] is not None or is_common,
    )


def _positive_pair(values):
    """Check a pair of positive numbers; return it as ndarray (2,), or None for None."""
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


def _read_reach(value):
    """Distance of the farthest image point, mm; inf if the record does not contain it."""
    reach = np.inf if value is None else float(value)
    if not reach > 0:
        raise ValueError(
            message(
                "camera_reach", "found reach_mm {found}, expected a distance above 0", found=value
            )
        )
    return reach


def _message_of_error(error):
    """Message about an error while reading a camera entry."""
    if isinstance(error, KeyError):
        return message("camera_key_missing", "missing key {key!r}", key=str(error.args[0]))
    if error.args and isinstance(error.args[0], Message):
        return error.args[0]
    return message("camera_unreadable", "cannot be read: {error}", error=reason_of(error))


def _problem(expected, column=None):
    return Problem("record.json", expected, None, column)
