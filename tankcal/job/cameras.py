"""From the keys of a camera to network.Camera: values, form of the distortion, adjusted parameters.

The adjustment of a parameter follows from [adjustment.camera] and its standard deviation:

scope and state   the key of the parameter; else `default`, for the default set (c x0 y0 K1 K2 K3
                  P1 P2 and the affinity); else off
sd 0              held at its value, whatever `default` states
off               not an unknown; keeps the value of cameras.toml, or 0 without a value
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.focus import RADIAL, Lens
from tankcal.camera.model import PARAMETERS, Form
from tankcal.job.contract.registers import (
    AFFINITIES_BY_AUTHOR,
    FOCUS_CALIBRATIONS,
    PARAMETER_KEYS,
    SECOND_NAMES,
    sd_key,
)
from tankcal.survey.measurements import CameraSetup
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
    given = at_focus(given)
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


def at_focus(given):
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
