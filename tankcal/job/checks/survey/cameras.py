"""Checks of cameras.toml and [adjustment.camera]: format and pixels, names, block parameters."""

import numpy as np

from tankcal.camera.model import RADIAL
from tankcal.job.cameras import (
    ASSUMED_CONVENTION,
    affinity_of,
    focus_distortion,
    focus_keys,
    format_of,
    is_adjusted,
    lens_of,
    parameters_of,
)
from tankcal.job.checking import same_parameter, tell
from tankcal.job.contract.registers import PARAMETER_KEYS, SECOND_NAMES, sd_key
from tankcal.messages import message

SAME_SIZE = 0.01  # largest relative difference of two statements of the format
SMALLEST_PIXEL_UM, LARGEST_FORMAT_MM = 0.1, 1000  # limits of plausible units
PART_OF_PIXEL = 0.1  # largest difference of a format from whole pixels, in pixels
CREDIBLE_LENGTHS = (0.1, 100)  # plausible principal distance, in diagonals of the format
POSSIBLE_LENGTHS = (0.05, 200)  # possible principal distance, in diagonals of the format
RADIAL_TERMS, DECENTRING_TERMS = ("K1", "K2", "K3", "K4"), ("P1", "P2", "P3", "P4")
# Displacement of the corner of the image, as a share of its radius.
DOUBTFUL_DISTORTION, IMPOSSIBLE_DISTORTION = 0.1, 0.5
NEAREST = 2.0  # smallest distance of an object, in focal lengths
ALIKE = 0.3  # largest relative difference of c and the focal length
BESIDE = ("focus_m", "lens_focal_length_mm")


def check_cameras(files):
    """Check each camera alone and with the settings of [adjustment.camera]."""
    settings = None if files.values is None else files.values["adjustment.camera"]
    if settings is not None:
        _refuse_two_names(files, settings)
        _refuse_two_blocks(files, settings)
    for name, given in files.registers["cameras"].items():
        is_valid = _check_format(files, name, given)
        check_affinity(files, name, given)
        check_focus(files, name, given)
        if settings is not None:
            parameters = parameters_of(given, settings)
            check_convention(files, name, given, parameters)
            check_states(files, name, parameters)
        if is_valid:
            check_sizes(files, name, given)


def check_calibrations(files, in_pixels=True):
    """Check each camera of a file that belongs to no job.

    in_pixels is True if the size of a pixel is required.
    """
    none_adjusted = dict.fromkeys((*PARAMETER_KEYS, *SECOND_NAMES.values())) | {"default": "off"}
    for name, given in files.registers["cameras"].items():
        is_valid = _check_format(files, name, given)
        check_affinity(files, name, given)
        check_focus(files, name, given)
        check_convention(files, name, given, parameters_of(given, none_adjusted))
        if is_valid:
            _check_pixels(files, name, given, in_pixels)
            check_sizes(files, name, given)


def _check_pixels(files, name, given, in_pixels):
    """Require the size of a pixel, and a format of whole pixels."""
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
    """Refuse different values of a parameter that is common to the whole block."""
    cameras = {
        name: parameters_of(given, settings) for name, given in files.registers["cameras"].items()
    }
    for same_parameters in zip(*cameras.values(), strict=True):
        if same_parameters[0].scope != "block" or same_parameters[0].state != "weighted":
            continue
        for name, parameter in zip(cameras, same_parameters, strict=True):
            if (parameter.value or 0.0, parameter.sd) != (
                same_parameters[0].value or 0.0,
                same_parameters[0].sd,
            ):
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
    """Check the keys of the format; returns True if the format is known."""

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
        return False  # reported already
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
    """Return True if the size of a pixel is plausible in micrometres."""
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


# ---- checks of the interior orientation in cameras.toml: distortion, states, plausible sizes


def check_affinity(files, name, given):
    """Require one name for each parameter, and the form of a given affinity."""
    form = given["affinity"]
    for first, second in SECOND_NAMES.items():
        for key, other in ((first, second), (sd_key(first), sd_key(second))):
            if given[key] is not None and given[other] is not None:
                expected = same_parameter(key)
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


def check_convention(files, name, given, parameters):
    """Require the sign convention of K and P, in which sources differ."""
    if files.is_given("cameras", name, "convention"):
        return
    lens = [parameter for parameter in parameters if parameter.name[0] in "KPAB"]
    with_value = [term.key for term in lens if term.value and term.name[0] in "KP"]
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


def check_states(files, name, parameters):
    """Require the standard deviation of weighted parameters; warn about ineffective ones."""
    unused = []
    for parameter in parameters:
        section = f"adjustment.camera.{parameter.setting}"
        setting = files.values["adjustment.camera"][parameter.setting] or ""
        state = f"{parameter.scope} {parameter.state}"
        if parameter.scope == "off":
            _warn_held(files, name, parameter)
        elif parameter.state == "weighted" and parameter.sd is None:
            if not files.is_given("cameras", name, parameter.sd_key):
                expected = message(
                    "parameter_sd_missing",
                    "missing; expected a value above 0: the parameter is {asked}",
                    asked=state,
                )
                files.tell_key(files.log.problem, "cameras", name, parameter.sd_key, expected)
        elif parameter.sd == 0 and parameter.is_own and setting.endswith("free"):
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


def _warn_held(files, name, parameter):
    if parameter.value and parameter.is_own:
        expected = message(
            "parameter_held",
            "{key} is off: the parameter is held at this value",
            key=f"adjustment.camera.{parameter.setting}",
        )
        files.tell_key(files.log.warning, "cameras", name, parameter.key, expected)


def check_sizes(files, name, given):
    """Check interior parameters and standard deviations for values plausible for the format."""
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
    """Require a principal point within the format."""
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
    """Check the displacement of the image corner by each term of the distortion.

    The largest radial term and the largest decentring term are reported.
    """
    values = focus_distortion(given)
    for names in (RADIAL_TERMS, DECENTRING_TERMS):
        keys = [PARAMETER_KEYS[parameter][0] for parameter in names]
        shares = _parts_at_corner([values[key] or 0.0 for key in keys], names, size_mm)
        worst = int(np.argmax(shares))
        if shares[worst] > DOUBTFUL_DISTORTION:
            is_problem = shares[worst] > IMPOSSIBLE_DISTORTION
            report = files.log.problem if is_problem else files.log.warning
            expected = message(
                "large_distortion",
                "moves the corner of the image by {percent:.3g} % of its radius; expected "
                "less: is it in another unit than millimetres, or for normalised coordinates?",
                percent=100 * shares[worst],
            )
            files.tell_key(report, "cameras", name, keys[worst], expected)


def _parts_at_corner(values, names, size_mm):
    """Displacement of the image corner by each K or P, as a share of its radius.

    With the corner (x, y) and its radius r, the radial terms are |K1| r^2, |K2| r^4, ... The
    displacements by P1 (r^2 + 2 x^2, 2 x y) and by P2 (2 x y, r^2 + 2 y^2) have the lengths |P1| r
    sqrt(r^2 + 8 x^2) and |P2| r sqrt(r^2 + 8 y^2). P3 r^2 and P4 r^4 are factors of both, whose
    effects are added.

    Parameters
    ----------
    values : sequence of float, length 4
        Coefficients.
    names : tuple of str
        RADIAL_TERMS or DECENTRING_TERMS.
    size_mm : ndarray, shape (2,)
        Format.

    Returns
    -------
    ndarray, shape (4,)
    """
    radius, size = np.hypot(*size_mm) / 2, np.abs(values)
    squares = radius ** (2 * np.arange(1, 5))
    if names == RADIAL_TERMS:
        return size * squares
    decentring = size[:2] * np.sqrt(radius**2 + 2 * np.square(size_mm))
    return np.concatenate([decentring, size[2:] * squares[:2] * decentring.sum()])


def _check_sds(files, name, given, size_mm):
    """Require standard deviations of principal distance and point below the size of the format."""
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


# ---- checks of distance-dependent distortion: focus of a camera, [adjustment] depth_of_field


def check_focus(files, name, given):
    """Require all keys of the focus or none, distances in metres, and no additional K."""

    def problem(key, expected):
        files.tell_key(files.log.problem, "cameras", name, key, expected)

    distances, *radial = focus_keys()
    is_asked = any(files.is_given("cameras", name, key) for key in (distances, *radial))
    if not is_asked:
        for key in BESIDE:
            if given[key] is not None:
                expected = message(
                    "no_focus_calibrations",
                    "without effect: the camera has no focus_calibrations",
                )
                files.tell_key(files.log.warning, "cameras", name, key, expected)
        return
    for key in (distances, *BESIDE):
        if not files.is_given("cameras", name, key):
            problem(
                key,
                message(
                    "focus_missing",
                    "missing, but focus_calibrations are given; expected a value above 0",
                ),
            )
    if not any(files.is_given("cameras", name, key) for key in radial):
        problem(
            radial[0],
            message("radial_missing", "missing; expected K1 at both distances: [1.1e-7, 1.3e-7]"),
        )
    for key in (distances, *radial):
        if given[key] is not None and len(given[key]) != 2:
            problem(
                key,
                message(
                    "radial_of_two",
                    "{count} numbers; expected two, one for each distance",
                    count=len(given[key]),
                ),
            )
    _refuse_beside(files, name, given, problem)
    _check_sizes(given, distances, problem)


def _refuse_beside(files, name, given, problem):
    for parameter in RADIAL:
        key = PARAMETER_KEYS[parameter][0]
        if given[key] is not None:
            problem(
                key,
                message(
                    "beside_focus",
                    "given together with focus_calibrations, from which it follows; expected "
                    "only one of them",
                ),
            )
    if given["radial_balance_mm"]:
        problem(
            "radial_balance_mm",
            message(
                "balance_beside_focus",
                "cannot be used with focus_calibrations; expected the plain form",
            ),
        )
    if not files.is_given("cameras", name, "convention"):
        problem(
            "convention",
            message(
                "convention_of_focus",
                "missing, but focus_calibrations are given; expected the convention of their K",
            ),
        )


def _check_sizes(given, key, problem):
    distances, focal, c = given[key], given["lens_focal_length_mm"], given["c_mm"]
    if distances is not None and len(distances) == 2 and distances[0] == distances[1]:
        problem(
            key,
            message("one_focus_twice", "the same distance is given twice; expected two distances"),
        )
    if focal is None:
        return
    if c is not None and abs(focal / c - 1) > ALIKE:
        expected = message(
            "focal_length_off",
            "found {focal:g} with c_mm = {c:g}; expected about the same",
            focal=focal,
            c=c,
        )
        problem("lens_focal_length_mm", expected)
        return
    for place, values in ((key, distances), ("focus_m", (given["focus_m"],))):
        for value in values or ():
            if value is not None and 1000 * value <= NEAREST * focal:
                expected = message(
                    "focus_too_near",
                    "found {value:g} m, within {nearest:g} focal lengths; expected metres from "
                    "the lens to the object",
                    value=value,
                    nearest=NEAREST,
                )
                problem(place, expected)


def check_depth_of_field(files):
    """Report depth_of_field in [adjustment] for cameras without focus calibrations."""
    if files.values is None or not files.values["adjustment"]["depth_of_field"]:
        return
    cameras = files.registers["cameras"]
    without_lens = [name for name, given in cameras.items() if lens_of(given) is None]
    if len(without_lens) == len(cameras):
        expected = message(
            "no_focus_at_all",
            "found true, but no camera has focus_calibrations; expected them in cameras.toml",
        )
        tell(files.log.problem, files.raw, "adjustment", "depth_of_field", expected)
    elif without_lens:
        expected = message(
            "no_depth_of_field",
            "without effect on camera {cameras}: no focus_calibrations",
            cameras=without_lens,
        )
        tell(files.log.warning, files.raw, "adjustment", "depth_of_field", expected)
