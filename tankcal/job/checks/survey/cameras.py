"""cameras.toml and [adjustment.camera]: format, form of the distortion, what is adjusted."""

import numpy as np

from tankcal.job.cameras import (
    ASSUMED_CONVENTION,
    affinity_of,
    at_focus,
    format_of,
    is_adjusted,
    parameters_of,
)
from tankcal.job.checking import same_parameter, tell
from tankcal.job.checks.survey.focus import check_focus
from tankcal.job.contract.registers import PARAMETER_KEYS, SECOND_NAMES, sd_key
from tankcal.messages import message

SAME_SIZE = 0.01
SMALLEST_PIXEL_UM, LARGEST_FORMAT_MM = 0.1, 1000
PART_OF_PIXEL = 0.1  # by which a format in mm may miss a whole number of pixels
CREDIBLE_LENGTHS = (0.1, 100)  # principal distance, in diagonals of the format
POSSIBLE_LENGTHS = (0.05, 200)
RADIAL_TERMS, DECENTRING_TERMS = ("K1", "K2", "K3", "K4"), ("P1", "P2", "P3", "P4")
DOUBTFUL_DISTORTION, IMPOSSIBLE_DISTORTION = 0.1, 0.5  # at the corner, part of the radius


def check_cameras(files):
    """Each camera by itself, and with the settings of [adjustment.camera]."""
    settings = None if files.values is None else files.values["adjustment.camera"]
    if settings is not None:
        _refuse_two_names(files, settings)
        _refuse_two_blocks(files, settings)
    for name, given in files.registers["cameras"].items():
        is_sound = _check_format(files, name, given)
        _check_affinity(files, name, given)
        check_focus(files, name, given)
        if settings is not None:
            parameters = parameters_of(given, settings)
            _check_convention(files, name, given, parameters)
            _check_states(files, name, parameters)
        if is_sound:
            _check_sizes(files, name, given)


def check_calibrations(files, in_pixels=True):
    """Each camera by itself, of a file of cameras that belongs to no job.

    in_pixels  whether the size of a pixel must be known
    """
    none_adjusted = dict.fromkeys((*PARAMETER_KEYS, *SECOND_NAMES.values())) | {"default": "off"}
    for name, given in files.registers["cameras"].items():
        is_sound = _check_format(files, name, given)
        _check_affinity(files, name, given)
        check_focus(files, name, given)
        _check_convention(files, name, given, parameters_of(given, none_adjusted))
        if is_sound:
            _check_pixels(files, name, given, in_pixels)
            _check_sizes(files, name, given)


def _check_pixels(files, name, given, in_pixels):
    """The size of a pixel is known, and the format is a whole number of them."""
    if given["format_px"] is not None:
        return
    if given["pixel_um"] is None:
        if in_pixels and not files.is_given("cameras", name, "pixel_um"):
            expected = message(
                "pixel_missing",
                "missing, but format_mm is given; expected the size of a pixel, or format_px",
            )
            files.tell_key(files.log.problem, "cameras", name, "pixel_um", expected)
        return
    pixels = np.array(given["format_mm"]) / np.broadcast_to(given["pixel_um"], 2) * 1000
    if np.any(np.abs(pixels - np.round(pixels)) > PART_OF_PIXEL):
        columns, lines = pixels
        expected = message(
            "pixels_not_whole",
            "of {columns:.8g} x {lines:.8g} pixels; expected whole ones, or format_px",
            columns=columns,
            lines=lines,
        )
        files.tell_key(files.log.problem, "cameras", name, "format_mm", expected)


def _refuse_two_names(files, settings):
    for name, second in SECOND_NAMES.items():
        if settings[name] is not None and settings[second] is not None:
            expected = same_parameter(name)
            tell(files.log.problem, files.raw, "adjustment.camera", second, expected)


def _refuse_two_blocks(files, settings):
    """One unknown of the whole block cannot be declared with two values."""
    cameras = {
        name: parameters_of(given, settings) for name, given in files.registers["cameras"].items()
    }
    for same in zip(*cameras.values(), strict=True):
        if same[0].scope != "block" or same[0].state != "weighted":
            continue
        for name, parameter in zip(cameras, same, strict=True):
            if (parameter.value or 0.0, parameter.sd) != (same[0].value or 0.0, same[0].sd):
                first = next(iter(cameras))
                expected = message(
                    "block_of_two_values",
                    "its value or standard deviation is not that of {first!r}; expected the "
                    "same: adjustment.camera.{setting} is block weighted",
                    first=first,
                    setting=parameter.setting,
                )
                files.tell_key(files.log.problem, "cameras", name, parameter.key, expected)


def _check_format(files, name, given):
    """Returns whether the format is known."""

    def problem(key, expected):
        files.tell_key(files.log.problem, "cameras", name, key, expected)

    for key, allowed in (("format_mm", (2,)), ("format_px", (2,)), ("pixel_um", (1, 2))):
        if given[key] is not None and len(given[key]) not in allowed:
            expected = message(
                "format_of_two",
                "{count} numbers; expected two, such as [6000, 4000]",
                count=len(given[key]),
            )
            problem(key, expected)
            return False
    has_mm, has_px, has_pixel = (
        files.is_given("cameras", name, key) for key in ("format_mm", "format_px", "pixel_um")
    )
    if not has_mm and not has_px:
        problem(
            "format_mm",
            message(
                "format_missing", "missing; expected [width, height], or format_px with pixel_um"
            ),
        )
        return False
    if has_px and not has_mm and not has_pixel:
        problem(
            "pixel_um",
            message(
                "pixel_missing_beside_px",
                "missing, but format_px is given; expected the size of a pixel, micrometres",
            ),
        )
        return False
    size = format_of(given)[0]
    if size is None:
        return False  # what is wrong is told
    in_px, in_mm = given["format_px"], given["format_mm"]
    if in_px is not None and any(number != round(number) for number in in_px):
        problem("format_px", message("whole_pixels", "expected whole numbers of pixels"))
    if in_px is not None and in_mm is not None and np.any(np.abs(size / in_mm - 1) > SAME_SIZE):
        width, height = size
        expected = message(
            "two_formats",
            "format_px times pixel_um is {width:g} x {height:g} mm; expected the same, or one of "
            "the three left out",
            width=width,
            height=height,
        )
        problem("format_mm", expected)
        return False
    return _check_unit(files, name, given, size)


def _check_unit(files, name, given, size_mm):
    """Is a pixel as large as micrometres make it? Returns whether it is."""
    pixel = given["pixel_um"]
    if pixel is None or (min(pixel) >= SMALLEST_PIXEL_UM and max(size_mm) <= LARGEST_FORMAT_MM):
        return True
    side_um, (width, height) = min(pixel), size_mm
    expected = message(
        "pixel_in_other_unit",
        "found {side_um:g} micrometres makes a format of {width:.4g} x {height:.4g} mm; expected "
        "micrometres: is it in another unit?",
        side_um=side_um,
        width=width,
        height=height,
    )
    if side_um < SMALLEST_PIXEL_UM:
        expected = message(
            "pixel_in_millimetres",
            "found {side_um:g} micrometres makes a format of {width:.4g} x {height:.4g} mm; "
            "expected micrometres: is it in millimetres?",
            side_um=side_um,
            width=width,
            height=height,
        )
    files.tell_key(files.log.problem, "cameras", name, "pixel_um", expected)
    return False


def _check_affinity(files, name, given):
    form = given["affinity"]
    for first, second in SECOND_NAMES.items():
        for one, other in ((first, second), (sd_key(first), sd_key(second))):
            if given[one] is not None and given[other] is not None:
                expected = same_parameter(one)
                files.tell_key(files.log.problem, "cameras", name, other, expected)
        if given[second] and affinity_of(given) != "b1_b2":
            expected = message(
                "affinity_of_other_form",
                "given with affinity = {form}; expected {first}, or affinity = b1_b2",
                form=form,
                first=first,
            )
            files.tell_key(files.log.problem, "cameras", name, second, expected)
        if given[first] and not files.is_given("cameras", name, "affinity"):
            expected = message(
                "affinity_missing",
                "missing, but {first} is given; expected the form: both_y, both_x, b1_b2 or "
                "before_distortion",
                first=first,
            )
            files.tell_key(files.log.problem, "cameras", name, "affinity", expected)


def _check_convention(files, name, given, parameters):
    if files.is_given("cameras", name, "convention"):
        return
    lens = [parameter for parameter in parameters if parameter.name[0] in "KPAB"]
    with_value = [one.key for one in lens if one.value and one.name[0] in "KP"]
    if with_value:
        expected = message(
            "convention_missing",
            "missing, but {keys} is given; expected correction_added, correction_subtracted "
            "or distortion_of_ideal: sources differ in sign",
            keys=[*with_value],
        )
        files.tell_key(files.log.problem, "cameras", name, "convention", expected)
    elif any(parameter.value or is_adjusted(parameter) for parameter in lens):
        expected = message(
            "convention_assumed",
            "missing; K, P and the affinity are taken as {convention}",
            convention=ASSUMED_CONVENTION,
        )
        files.tell_key(files.log.warning, "cameras", name, "convention", expected)


def _check_states(files, name, parameters):
    unused = []
    for parameter in parameters:
        section = f"adjustment.camera.{parameter.setting}"
        asked = f"{parameter.scope} {parameter.state}"
        if parameter.scope == "off":
            _warn_held(files, name, parameter)
        elif parameter.state == "weighted" and parameter.sd is None:
            if not files.is_given("cameras", name, parameter.sd_key):
                expected = message(
                    "parameter_sd_missing",
                    "missing; expected a value above 0: the parameter is {asked}",
                    asked=asked,
                )
                files.tell_key(files.log.problem, "cameras", name, parameter.sd_key, expected)
        elif parameter.sd == 0 and parameter.is_own and _asks_free(files, parameter):
            expected = message(
                "held_and_free",
                "found 0, which holds the parameter fixed, but {section} has it free; "
                "expected only one of them",
                section=section,
            )
            files.tell_key(files.log.problem, "cameras", name, parameter.sd_key, expected)
        elif parameter.sd and parameter.state != "weighted":
            unused.append(parameter)
    if unused:
        expected = message(
            "sd_not_weighted",
            "without effect: the parameter is not weighted ({keys}); [adjustment.camera] "
            "{example} would use it",
            keys=[parameter.sd_key for parameter in unused],
            example=f'{unused[0].setting} = "{unused[0].scope} weighted"',
        )
        files.tell_key(files.log.warning, "cameras", name, unused[0].sd_key, expected)


def _asks_free(files, parameter):
    value = files.values["adjustment.camera"][parameter.setting]
    return value is not None and value.endswith("free")


def _warn_held(files, name, parameter):
    if parameter.value and parameter.is_own:
        expected = message(
            "parameter_held",
            "{key} is off: the parameter is held at this value",
            key=f"adjustment.camera.{parameter.setting}",
        )
        files.tell_key(files.log.warning, "cameras", name, parameter.key, expected)


def _check_sizes(files, name, given):
    """Interior parameters and standard deviations of a credible size for the format."""
    size_mm = format_of(given)[0]
    _check_principal_distance(files, name, given, size_mm)
    _check_principal_point(files, name, given, size_mm)
    _check_distortion(files, name, given, size_mm)
    _check_sds(files, name, given, size_mm)


def _check_principal_distance(files, name, given, size_mm):
    c, across = given["c_mm"], float(np.hypot(*size_mm))
    if c is None or _is_between(c / across, CREDIBLE_LENGTHS):
        return
    if _is_between(c / across, POSSIBLE_LENGTHS):
        expected = message(
            "strange_principal_distance",
            "found {c_mm:g} with a format of {across_mm:.4g} mm across: is it in another unit?",
            c_mm=c,
            across_mm=across,
        )
        files.tell_key(files.log.warning, "cameras", name, "c_mm", expected)
        return
    low, high = (across * limit for limit in POSSIBLE_LENGTHS)
    expected = message(
        "principal_distance_impossible",
        "found {c:g} with a format of {across:.4g} mm across; expected {low:.3g} to {high:.5g} "
        "mm: is it in another unit?",
        c=c,
        across=across,
        low=low,
        high=high,
    )
    files.tell_key(files.log.problem, "cameras", name, "c_mm", expected)


def _is_between(value, limits):
    low, high = limits
    return low <= value <= high


def _check_principal_point(files, name, given, size_mm):
    """The principal point is in the frame."""
    for key, length in zip(("x0_mm", "y0_mm"), size_mm, strict=True):
        if abs(given[key] or 0.0) > length / 2:
            found, half = given[key], length / 2
            expected = message(
                "principal_point_too_high",
                "found {found:g}, outside the format, whose height is {length:.4g} mm; expected "
                "at most {half:.4g} from its middle: is it in another unit?",
                found=found,
                length=length,
                half=half,
            )
            if key == "x0_mm":
                expected = message(
                    "principal_point_too_wide",
                    "found {found:g}, outside the format, whose width is {length:.4g} mm; "
                    "expected at most {half:.4g} from its middle: is it in another unit?",
                    found=found,
                    length=length,
                    half=half,
                )
            files.tell_key(files.log.problem, "cameras", name, key, expected)


def _check_distortion(files, name, given, size_mm):
    """No term moves the corner of the image by an incredible part of its radius.

    Of radial and of decentring terms the worst is told.
    """
    values = at_focus(given)
    for names in (RADIAL_TERMS, DECENTRING_TERMS):
        keys = [PARAMETER_KEYS[one][0] for one in names]
        parts = _parts_at_corner([values[key] or 0.0 for key in keys], names, size_mm)
        worst = int(np.argmax(parts))
        if parts[worst] > DOUBTFUL_DISTORTION:
            is_problem = parts[worst] > IMPOSSIBLE_DISTORTION
            to = files.log.problem if is_problem else files.log.warning
            expected = message(
                "large_distortion",
                "moves the corner of the image by {percent:.3g} % of its radius; expected "
                "less: is it in another unit than millimetres, or for normalised coordinates?",
                percent=100 * parts[worst],
            )
            files.tell_key(to, "cameras", name, keys[worst], expected)


def _parts_at_corner(values, names, size_mm):
    """What each K or P moves the corner of the image by, in parts of its radius.

    names  of the values, RADIAL_TERMS or DECENTRING_TERMS

    With (x, y) the corner and r its radius: |K1| r^2, |K2| r^4, ...; of P1 (r^2 + 2 x^2, 2 x y) and
    of P2 (2 x y, r^2 + 2 y^2) the length is |P| r sqrt(r^2 + 8 x^2) and the same with y; P3 r^2 and
    P4 r^4 are factors of both, taken as adding up.
    """
    radius, size = np.hypot(*size_mm) / 2, np.abs(values)
    squares = radius ** (2 * np.arange(1, 5))
    if names == RADIAL_TERMS:
        return size * squares
    decentring = size[:2] * np.sqrt(radius**2 + 2 * np.square(size_mm))
    return np.concatenate([decentring, size[2:] * squares[:2] * decentring.sum()])


def _check_sds(files, name, given, size_mm):
    """No standard deviation of the principal distance or point is larger than the format."""
    across = float(np.hypot(*size_mm))
    for key in map(sd_key, ("c", "x0", "y0")):
        if (given[key] or 0.0) > across:
            expected = message(
                "camera_sd_too_large",
                "found {given:g} with a format of {across:.4g} mm across; expected less: is "
                "it in another unit? For an unknown value, leave it out",
                given=given[key],
                across=across,
            )
            files.tell_key(files.log.problem, "cameras", name, key, expected)
