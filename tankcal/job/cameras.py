"""From the keys of a camera to network.Camera: values, form of the distortion, what is adjusted.

scope and state   [adjustment.camera]: the parameter's own key, else `default` for the default
                  set (c x0 y0 K1 K2 K3 P1 P2 and the affinity), else off
sd 0              held at its value, whatever `default` says
off               no unknown; the value given in cameras.toml, 0 where there is none, is kept
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

# The points of a datum as they are written: P7, P7:xy.

AXES = "xyz"


def datum_point(text):
    """(name, axes) of a datum point such as P7 or P7:xy; axes "" where they make no sense."""
    name, colon, axes = text.rpartition(":")
    if not colon:
        return text, AXES
    sound = axes and set(axes) <= set(AXES) and len(set(axes)) == len(axes)
    return name.strip(), "".join(axis for axis in AXES if axis in axes) if sound else ""


ASSUMED_CONVENTION = "distortion_of_ideal"


@dataclass(frozen=True)
class Parameter:
    """One parameter of one camera as the job has it: key and value (None: not given) and more.

    key, sd_key   as given in cameras.toml, or as they would be
    value, sd     None: not given
    scope, state  what the adjustment does with it
    is_own        whether a key of its own in [adjustment.camera] says so; setting is that key
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
    """The 13 Parameter of a camera.

    given     {key: value} of cameras.toml     settings  {key: value} of [adjustment.camera]
    """
    given = at_focus(given)
    return [_parameter(name, given, settings) for name in PARAMETERS]


def focus_keys():
    """Keys of the focus calibrations: the distances, then K1, K2, K3."""
    return tuple(
        f"{FOCUS_CALIBRATIONS}.{key}"
        for key in ("distance_m", *(PARAMETER_KEYS[name][0] for name in RADIAL))
    )


def lens_of(given):
    """The focus.Lens of a camera {key: value}; None where its keys do not make one."""
    distances, *radial = (given[key] for key in focus_keys())
    focal, focus = given["lens_focal_length_mm"], given["focus_m"]
    whole = None not in (distances, focal, focus) and any(radial)
    if not whole or any(len(one) != 2 for one in (distances, *filter(None, radial))):
        return None
    if distances[0] == distances[1] or min(*distances, focus) * 1000 <= focal:
        return None
    pairs = [one or (0.0, 0.0) for one in radial]
    return Lens(focal, 1000 * focus, 1000 * np.array(distances), np.array(pairs).T)


def at_focus(given):
    """The keys of a camera, with K1, K2, K3 for its focus where a Lens tells them."""
    lens = lens_of(given)
    if lens is None:
        return given
    values = zip(RADIAL, lens.focused.tolist(), strict=True)
    return given | {PARAMETER_KEYS[name][0]: value for name, value in values}


def _parameter(name, given, settings):
    key, key_of_sd, setting = PARAMETER_KEYS[name][0], sd_key(name), name
    second = SECOND_NAMES.get(name)
    if second is not None and given[key] is None and given[second] is not None:
        key = second
    if second is not None and given[key_of_sd] is None:
        key_of_sd = sd_key(second)
    if second is not None and settings[setting] is None and settings[second] is not None:
        setting = second
    own, default = settings[setting], settings["default"] or "camera free"
    if own is None and DEFAULT_SCOPE[PARAMETERS.index(name)] == "off":
        default = "off"
    scope, _, state = (own or default).partition(" ")
    sd = given[key_of_sd]
    if sd == 0 and scope != "off":
        state = "fixed"
    return Parameter(
        name, key, key_of_sd, given[key], sd, scope, state or "free", own is not None, setting
    )


def is_adjusted(parameter):
    """Is it an unknown of the adjustment?"""
    return parameter.scope != "off" and parameter.state != "fixed"


def affinity_of(given):
    """Name of the form of the affinity: as named, by itself or by its author, else b1_b2."""
    name = given["affinity"] or "b1_b2"
    return AFFINITIES_BY_AUTHOR.get(name, name)


def format_of(given):
    """(format_mm, pixel_mm) of a camera, pairs; None where the keys do not say it.

    With all three keys format_mm is that of the pixels: it is where their middle is.
    """
    pixel = _pair(given["pixel_um"], 1e-3)
    size_mm, size_px = _pair(given["format_mm"]), _pair(given["format_px"])
    if size_px is None:
        return size_mm, None
    if pixel is None and size_mm is not None:
        pixel = size_mm / size_px
    return size_mm if pixel is None else size_px * pixel, pixel


def _pair(values, factor=1.0):
    """(2,) of two numbers, or of one that stands for both."""
    return None if values is None else factor * np.array([*values, *values][:2], dtype=float)


def make_camera(name, given, settings, weights="measured"):
    """CameraSetup of a checked camera; `weights` as `camera.Form` has them."""
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
    """(scope, state) for network.Camera, which drops what is off: a value that is kept is fixed."""
    if parameter.scope == "off" and parameter.value:
        return "camera", "fixed"
    return parameter.scope, parameter.state


def image_frames(table, photos, cameras):
    """(n, 2) format and (n, 2) pixel, mm, for each row of image_points; nan where not known.

    table, photos  ColumnValues of image_points and photos, or photos None
    cameras        {name: {key: value}}
    """
    frames = {None: np.full(4, np.nan)}
    if photos is not None:
        for photo, camera in zip(photos.of("photo"), photos.of("camera"), strict=True):
            frames[photo] = _frame(cameras.get(camera))
    names = [name if name in frames else None for name in table.of("photo")]
    places = {name: place for place, name in enumerate(frames)}
    both = np.array(list(frames.values()))[[places[name] for name in names]]
    return both[:, :2], both[:, 2:]


def _frame(given):
    size, pixel = (None, None) if given is None else format_of(given)
    return np.concatenate([np.full(2, np.nan) if two is None else two for two in (size, pixel)])


def image_coordinates(table, size_mm, pixel_mm):
    """(n, 2) image coordinates, mm, x to the right and y up from the middle of the format.

    The centre of the first pixel is column 0, line 0:

        x = (column - (columns - 1) / 2) pixel      y = -(line - (lines - 1) / 2) pixel
    """
    middle = (np.round(size_mm / pixel_mm) - 1) / 2
    in_mm = np.column_stack([table.numbers("x_mm"), table.numbers("y_mm")])
    in_pixels = np.column_stack([table.numbers("column_px"), table.numbers("line_px")])
    return np.where(np.isnan(in_mm), (in_pixels - middle) * pixel_mm * [1, -1], in_mm)
