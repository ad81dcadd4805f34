"""From the keys of a camera to network.Camera, and from image coordinates to photo coordinates.

From the keys of a camera to network.Camera: values, form of the distortion, adjusted parameters.

The adjustment of a parameter follows from [adjustment.camera] and its standard deviation:

scope and state   the key of the parameter; else `default`, for the default set (c x0 y0 K1 K2 K3
                  P1 P2 and the affinity); else off
sd 0              held at its value, whatever `default` states
off               not an unknown; keeps the value of cameras.toml, or 0 without a value

From image coordinates as read to photo coordinates: comparator, pixels, film.

Order of the steps: repeated readings of fiducial marks are rejected if they scatter too much; the
other readings determine the transformation of their photo; the transformation is applied to the
image points; finally the image points are corrected for the unflatness of the film.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.camera.comparator import (
    Surface,
    fit_transformation,
    flatten_film,
    group_readings,
    heights_at,
)
from tankcal.camera.model import PARAMETERS, RADIAL, Form, Lens
from tankcal.errors import SolutionError
from tankcal.job.contract.registers import (
    AFFINITIES_BY_AUTHOR,
    FOCUS_CALIBRATIONS,
    MARKS,
    PARAMETER_KEYS,
    SECOND_NAMES,
    sd_key,
)
from tankcal.messages import message
from tankcal.survey.measurements import CameraSetup, FiducialFit, RejectedReadings
from tankcal.survey.network.survey import DEFAULT_SCOPE, Camera

# Datum points as written in the settings: P7, P7:xy.

AXES = "xyz"


def datum_point(text):
    """(name, axes) of a datum point such as P7 or P7:xy; axes are "" if they are invalid."""
    name, colon, axes = text.rpartition(":")
    if not colon:
        return text, AXES
    is_valid = axes and set(axes) <= set(AXES) and len(set(axes)) == len(axes)
    return name.strip(), "".join(axis for axis in AXES if axis in axes) if is_valid else ""


ASSUMED_CONVENTION = "distortion_of_ideal"  # sign convention if none is given


@dataclass(frozen=True)
class Parameter:
    """One parameter of one camera, with its role in the adjustment.

    Attributes
    ----------
    name : str
        Name in camera.model.PARAMETERS.
    key, sd_key : str
        Keys of value and standard deviation in cameras.toml, whether given or not.
    value, sd : float or None
        None: not given.
    scope, state : str
        Role in the adjustment.
    is_own : bool
        True if the role is set by a key of its own in [adjustment.camera].
    setting : str
        Name of this key.
    """

    name: str
    key: str
    sd_key: str
    value: float | None
    sd: float | None
    scope: str
    state: str
    is_own: bool
    setting: str


def parameters_of(given, settings):
    """Parameters of a camera.

    Parameters
    ----------
    given : dict
        {key: value} of cameras.toml.
    settings : dict
        {key: value} of [adjustment.camera].

    Returns
    -------
    list of Parameter, length 13
    """
    given = focus_distortion(given)
    return [_parameter(name, given, settings) for name in PARAMETERS]


def focus_keys():
    """Keys of the calibrations at two focus distances: the distances, then K1, K2, K3."""
    return tuple(
        f"{FOCUS_CALIBRATIONS}.{key}"
        for key in ("distance_m", *(PARAMETER_KEYS[name][0] for name in RADIAL))
    )


def lens_of(given):
    """`Lens` of the keys of a camera; None if they do not determine a lens."""
    distances, *radial = (given[key] for key in focus_keys())
    focal, focus = given["lens_focal_length_mm"], given["focus_m"]
    is_complete = None not in (distances, focal, focus) and any(radial)
    if not is_complete or any(len(pair) != 2 for pair in (distances, *filter(None, radial))):
        return None
    # Equal distances determine no slope; an object within the focal length has no image.
    if distances[0] == distances[1] or min(*distances, focus) * 1000 <= focal:
        return None
    pairs = [pair or (0.0, 0.0) for pair in radial]
    return Lens(focal, 1000 * focus, 1000 * np.array(distances), np.array(pairs).T)


def focus_distortion(given):
    """Keys of a camera, with K1, K2, K3 at its focus where two calibrations determine them."""
    lens = lens_of(given)
    if lens is None:
        return given
    values = zip(RADIAL, lens.radial_in_focus.tolist(), strict=True)
    return given | {PARAMETER_KEYS[name][0]: value for name, value in values}


def _parameter(name, given, settings):
    key, key_of_sd, setting = PARAMETER_KEYS[name][0], sd_key(name), name
    # Several parameters have a second name; use it if only the second name is filled in.
    alias = SECOND_NAMES.get(name)
    if alias is not None and given[key] is None and given[alias] is not None:
        key = alias
    if alias is not None and given[key_of_sd] is None:
        key_of_sd = sd_key(alias)
    if alias is not None and settings[setting] is None and settings[alias] is not None:
        setting = alias
    own_setting, default = settings[setting], settings["default"] or "camera free"
    # `default` applies to the default set of parameters only.
    if own_setting is None and DEFAULT_SCOPE[PARAMETERS.index(name)] == "off":
        default = "off"
    scope, _, state = (own_setting or default).partition(" ")
    sd = given[key_of_sd]
    if sd == 0 and scope != "off":
        state = "fixed"
    return Parameter(
        name,
        key,
        key_of_sd,
        given[key],
        sd,
        scope,
        state or "free",
        own_setting is not None,
        setting,
    )


def is_adjusted(parameter):
    """Return True if the parameter is an unknown of the adjustment."""
    return parameter.scope != "off" and parameter.state != "fixed"


def affinity_of(given):
    """Form of the affinity, given by its name or by its author; default b1_b2."""
    name = given["affinity"] or "b1_b2"
    return AFFINITIES_BY_AUTHOR.get(name, name)


def format_of(given):
    """(format_mm, pixel_mm) of a camera, each (2,); None for a size that the keys do not determine.

    If format_mm, format_px and pixel_um are all given, the format follows from the pixels, because
    the image coordinates refer to the centre of the pixel array.
    """
    pixel = _pair(given["pixel_um"], 1e-3)
    size_mm, size_px = _pair(given["format_mm"]), _pair(given["format_px"])
    if size_px is None:
        return size_mm, None
    if pixel is None and size_mm is not None:
        pixel = size_mm / size_px
    return size_mm if pixel is None else size_px * pixel, pixel


def _pair(values, factor=1.0):
    """Array (2,) of two numbers, or of a single number for both axes."""
    return None if values is None else factor * np.array([*values, *values][:2], dtype=float)


def make_camera(name, given, settings, weights="measured"):
    """Build the CameraSetup of a checked camera.

    Parameters
    ----------
    name : str
        Name of the camera.
    given : dict
        {key: value} of cameras.toml.
    settings : dict
        {key: value} of [adjustment.camera].
    weights : str, optional
        Weights of image coordinates, as in `camera.model.Form`.
    """
    parameters = parameters_of(given, settings)
    form = Form(
        convention=given["convention"] or ASSUMED_CONVENTION,
        affinity=affinity_of(given),
        radial_balance_mm=given["radial_balance_mm"] or 0.0,
        weights=weights,
    )
    roles = [_role(parameter) for parameter in parameters]
    camera = Camera(
        values=np.array([parameter.value or 0.0 for parameter in parameters]),
        form=form,
        sd=np.array([np.nan if parameter.sd is None else parameter.sd for parameter in parameters]),
        scope=tuple(scope for scope, _ in roles),
        state=tuple(state for _, state in roles),
        name=name,
    )
    format_mm, pixel_mm = format_of(given)
    return CameraSetup(camera, format_mm, pixel_mm, lens_of(given))


def _role(parameter):
    """(scope, state) for network.Camera.

    network.Camera drops parameters that are off, so a nonzero value that is kept becomes fixed.
    """
    if parameter.scope == "off" and parameter.value:
        return "camera", "fixed"
    return parameter.scope, parameter.state


def image_frames(table, photos, cameras):
    """Format and pixel size of the camera of each image point.

    Parameters
    ----------
    table : ColumnValues
        image_points, n rows.
    photos : ColumnValues or None
        photos.
    cameras : dict
        {name: {key: value}} of cameras.toml.

    Returns
    -------
    size_mm, pixel_mm : ndarray, shape (n, 2)
        nan where not known.
    """
    frames = {None: np.full(4, np.nan)}
    if photos is not None:
        for photo, camera in zip(photos.of("photo"), photos.of("camera"), strict=True):
            frames[photo] = _frame(cameras.get(camera))
    names = [name if name in frames else None for name in table.of("photo")]
    places = {name: place for place, name in enumerate(frames)}
    frame_of_rows = np.array(list(frames.values()))[[places[name] for name in names]]
    return frame_of_rows[:, :2], frame_of_rows[:, 2:]


def _frame(given):
    """Format and pixel size of a camera, mm, as an array (4,); nan where not known."""
    size, pixel = (None, None) if given is None else format_of(given)
    return np.concatenate([np.full(2, np.nan) if pair is None else pair for pair in (size, pixel)])


def image_coordinates(table, size_mm, pixel_mm):
    """Image coordinates from coordinates in millimetres or in pixels.

    x points to the right and y upwards, from the centre of the format. The centre of the first
    pixel is column 0, line 0:

        x = (column - (columns - 1) / 2) pixel      y = -(line - (lines - 1) / 2) pixel

    Parameters
    ----------
    table : ColumnValues
        image_points, n rows.
    size_mm, pixel_mm : ndarray, shape (n, 2)
        Format and pixel size, mm.

    Returns
    -------
    ndarray, shape (n, 2)
        Image coordinates, mm.
    """
    middle = (np.round(size_mm / pixel_mm) - 1) / 2
    in_mm = np.column_stack([table.numbers("x_mm"), table.numbers("y_mm")])
    in_pixels = np.column_stack([table.numbers("column_px"), table.numbers("line_px")])
    return np.where(np.isnan(in_mm), (in_pixels - middle) * pixel_mm * [1, -1], in_mm)


FEWEST_HEIGHTS = 3  # smallest number of heights that determine the surface of a film
FLAT = 1e-6  # smallest ratio of width to length of the positions of heights on a film


@dataclass(frozen=True)
class Imagery:
    """Image points in the photo system, in the order of image_points.

    Attributes
    ----------
    xy_mm : ndarray, shape (n, 2)
        Photo coordinates; nan where they cannot be determined.
    sd_mm : ndarray, shape (n, 2)
        Standard deviations of the readings.
    shared_sd_mm : ndarray, shape (n, 2), or None
        Standard deviations from the transformations.
    fits : dict of {str: FiducialFit}
        Transformation of each photo.
    outside : dict
        {owner of a film: (number of image points outside the hull of its heights, number of all)}.
    """

    xy_mm: np.ndarray
    sd_mm: np.ndarray
    shared_sd_mm: np.ndarray | None = None
    fits: dict = field(default_factory=dict)
    outside: dict = field(default_factory=dict)


def imagery_of(tables, cameras, adjustment):
    """Photo coordinates of a survey; invalid parts of the tables are left out.

    Parameters
    ----------
    tables : dict of {str: ColumnValues or None}
        Tables by name.
    cameras : dict
        {name: {key: value}} of cameras.toml.
    adjustment : dict or None
        {key: value} of [adjustment].

    Returns
    -------
    Imagery
    """
    images, photos = tables["image_points"], tables["photos"]
    size, pixel = image_frames(images, photos, cameras)
    xy = image_coordinates(images, size, pixel)
    sd = np.column_stack([images.numbers("sx_um"), images.numbers("sy_um")]) / 1000
    sd = np.where(np.isnan(sd), images.numbers("s_px")[:, None] * pixel, sd)
    imagery = Imagery(xy, sd)
    if photos is None:
        return imagery
    if tables["fiducials"] is not None:
        imagery = _transform_by_marks(imagery, tables, cameras, adjustment or {})
    if tables["film"] is not None:
        imagery = _correct_unflatness(imagery, tables, cameras)
    return imagery


def cameras_of_photos(photos, cameras):
    """{photo: (name of its camera, {key: value} of the camera)}, without unknown cameras."""
    rows = zip(photos.of("photo"), photos.of("camera"), strict=True)
    return {photo: (name, cameras[name]) for photo, name in rows if photo and name in cameras}


def _transform_by_marks(imagery, tables, cameras, adjustment):
    """Apply the transformations of the fiducial marks to the image points."""
    images = tables["image_points"]
    default = (adjustment.get("image_sd_um") or np.nan) / 1000
    fits = fiducial_fits(tables["fiducials"], tables["photos"], cameras, adjustment)
    xy, sd, shared = imagery.xy_mm.copy(), imagery.sd_mm.copy(), np.zeros_like(imagery.xy_mm)
    photos_with_marks, points_of = set(tables["fiducials"].of("photo")), images.of("point")
    for photo, rows_of_photo in rows_by(images.of("photo")).items():
        if photo not in photos_with_marks:
            continue
        if photo not in fits:
            xy[rows_of_photo] = np.nan
            continue
        fit = fits[photo].transformation
        points = [points_of[i] for i in rows_of_photo.tolist()]
        readings, reading_sd = (
            xy[rows_of_photo],
            fit.propagate_sds(np.where(np.isnan(sd[rows_of_photo]), default, sd[rows_of_photo])),
        )
        added = np.einsum("nii->ni", fit.parameter_covariance(readings))
        # The mean of repeated readings has a smaller variance; the transformation adds to it.
        repeated = group_readings(points, readings)
        variance = reading_sd**2 / repeated.count[repeated.group][:, None]
        growth = np.sqrt(1 + added / variance)
        xy[rows_of_photo], sd[rows_of_photo], shared[rows_of_photo] = (
            fit.transform(readings),
            reading_sd,
            np.sqrt(added),
        )
        if np.isfinite(growth).any():
            fits[photo] = replace(fits[photo], growth=float(np.nanmax(growth)))
    return replace(imagery, xy_mm=xy, sd_mm=sd, shared_sd_mm=shared, fits=fits)


def rows_by(names):
    """{name: indices (n,) of its rows}, without None."""
    groups = {}
    for place, name in enumerate(names):
        if name is not None:
            groups.setdefault(name, []).append(place)
    return {name: np.array(places) for name, places in groups.items()}


def fiducial_fits(table, photos, cameras, adjustment):
    """{photo: FiducialFit}, without photos whose marks do not determine a transformation."""
    of_photos, fits = cameras_of_photos(photos, cameras), {}
    for photo, readings in readings_of_marks(table, of_photos, adjustment).items():
        try:
            fits[photo] = readings.fit(photo, of_photos[photo][0])
        except SolutionError:
            continue
    return fits


def readings_of_marks(table, of_photos, adjustment):
    """Readings of the fiducial marks of each photo.

    Parameters
    ----------
    table : ColumnValues
        fiducials.
    of_photos : dict
        Cameras of the photos, see `cameras_of_photos`.
    adjustment : dict
        {key: value} of [adjustment].

    Returns
    -------
    dict of {str: MarkReadings}
        Photos whose camera is known. Readings without a standard deviation are left out.
    """
    default = adjustment.get("image_sd_um") or np.nan
    limit = adjustment.get("reading_limit_um")
    xy = np.column_stack([table.numbers("x_mm"), table.numbers("y_mm")])
    sd = table.numbers("s_um")
    sd = np.where(np.isnan(sd), default, sd) / 1000
    is_valid = np.isfinite(xy).all(axis=1) & np.isfinite(sd)
    readings, marks = {}, table.of("mark")
    for photo, rows in rows_by(table.of("photo")).items():
        if photo not in of_photos:
            continue
        given = of_photos[photo][1]
        known = {mark: place for mark, place in given[MARKS].items() if len(place) == 2}
        rows = np.array([i for i in rows.tolist() if is_valid[i] and marks[i] in known], dtype=int)
        names = tuple(marks[i] for i in rows)
        places = np.array([known[name] for name in names]).reshape(-1, 2)
        kind = given["fiducial_transformation"] or "affine"
        of_photo = MarkReadings(rows, names, xy[rows], places, sd[rows], kind)
        readings[photo] = of_photo.within(
            None if limit is None else limit / 1000, photo, table.rows
        )
    return readings


@dataclass(frozen=True)
class MarkReadings:
    """Valid readings of the marks of one photo, in the order of their rows.

    Attributes
    ----------
    rows : ndarray, shape (n,)
        Indices in the table.
    names : tuple of str, length n
        Marks.
    xy_mm : ndarray, shape (n, 2)
        Readings.
    marks_mm : ndarray, shape (n, 2)
        Calibrated coordinates.
    sd_mm : ndarray, shape (n,)
        Standard deviations of the readings.
    kind : str
        Kind of the transformation.
    rejected : tuple of RejectedReadings
        Marks whose readings scatter too much.
    """

    rows: np.ndarray
    names: tuple
    xy_mm: np.ndarray
    marks_mm: np.ndarray
    sd_mm: np.ndarray
    kind: str
    rejected: tuple = ()

    def within(self, limit_mm, photo, numbers):
        """Reject the marks whose readings scatter more than a limit.

        Parameters
        ----------
        limit_mm : float or None
            Limit; None: no limit.
        photo : str
            Name of the photo.
        numbers : sequence of int
            Row in the file of each index in the table.

        Returns
        -------
        MarkReadings
            The remaining readings, with the others in `rejected`.
        """
        repeated = self.repeats
        is_rejected = repeated.exceeds(limit_mm)
        rejected = tuple(
            RejectedReadings(
                photo,
                self.names[repeated.first[i]],
                int(repeated.count[i]),
                repeated.sd[i],
                numbers[self.rows[repeated.first[i]]],
            )
            for i in np.flatnonzero(is_rejected)
        )
        kept = np.flatnonzero(~is_rejected[repeated.group])
        return MarkReadings(
            self.rows[kept],
            tuple(self.names[i] for i in kept),
            self.xy_mm[kept],
            self.marks_mm[kept],
            self.sd_mm[kept],
            self.kind,
            rejected,
        )

    @property
    def repeats(self):
        """Repeated readings of the marks (comparator.Repeats)."""
        return group_readings(self.names, self.xy_mm)

    def fit(self, photo, camera):
        """Fit the transformation; raises SolutionError if the marks do not determine it."""
        repeated = self.repeats
        if not len(self.rows):
            raise SolutionError(message("no_marks", "no marks"))
        fitted = fit_transformation(self.xy_mm, self.marks_mm, self.sd_mm[:, None], self.kind)
        calibrated = self.marks_mm[repeated.first]
        return FiducialFit(
            photo=photo,
            camera=camera,
            marks=tuple(self.names[i] for i in repeated.first),
            calibrated_mm=calibrated,
            count=repeated.count,
            mean_mm=repeated.mean,
            sd_mm=repeated.sd,
            residual_mm=fitted.transform(repeated.mean) - calibrated,
            transformation=fitted,
            rejected=self.rejected,
        )


def surfaces_of(table):
    """{("camera" or "photo", name): (Surface, first row)} of film.csv, valid or not."""
    xy = np.column_stack([table.numbers("x_mm"), table.numbers("y_mm")])
    height = table.numbers("height_um") / 1000
    owners = {}
    for i, (camera, photo) in enumerate(zip(table.of("camera"), table.of("photo"), strict=True)):
        if (camera is None) != (photo is None) and np.isfinite([*xy[i], height[i]]).all():
            owner = ("camera", camera) if photo is None else ("photo", photo)
            owners.setdefault(owner, []).append(i)
    return {
        owner: (Surface(xy[rows], height[rows]), table.rows[rows[0]])
        for owner, rows in owners.items()
    }


def is_surface(surface):
    """Return True for at least three different positions that are not on one line."""
    xy = surface.xy_mm
    if len(xy) < FEWEST_HEIGHTS or len(np.unique(xy, axis=0)) < len(xy):
        return False
    spread = np.linalg.svd(xy - xy.mean(axis=0), compute_uv=False)
    return bool(spread[1] > FLAT * spread[0])


def _correct_unflatness(imagery, tables, cameras):
    """Correct the image points for unflatness; the film of a photo replaces that of its camera."""
    surfaces = {
        owner: surface for owner, (surface, _) in surfaces_of(tables["film"]).items()
        if is_surface(surface)
    }  # fmt: skip
    xy, outside = imagery.xy_mm.copy(), {}
    rows = rows_by(tables["image_points"].of("photo"))
    for photo, (camera, given) in cameras_of_photos(tables["photos"], cameras).items():
        owner = ("photo", photo) if ("photo", photo) in surfaces else ("camera", camera)
        if owner not in surfaces or given["c_mm"] is None or photo not in rows:
            continue
        rows_of_photo = rows[photo]
        height, is_outside = heights_at(surfaces[owner], xy[rows_of_photo])
        interior = (given["c_mm"], given["x0_mm"] or 0.0, given["y0_mm"] or 0.0)
        xy[rows_of_photo] = flatten_film(xy[rows_of_photo], height, interior)
        counts = outside.get(owner, (0, 0))
        outside[owner] = (counts[0] + int(is_outside.sum()), counts[1] + len(rows_of_photo))
    return replace(imagery, xy_mm=xy, outside=outside)
