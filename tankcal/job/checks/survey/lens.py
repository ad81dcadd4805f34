"""Checks of the interior orientation in cameras.toml: distortion, states, plausible sizes."""

import numpy as np

from tankcal.job.cameras import (
    ASSUMED_CONVENTION,
    affinity_of,
    at_focus,
    format_of,
    is_adjusted,
)
from tankcal.job.checking import same_parameter
from tankcal.job.contract.registers import PARAMETER_KEYS, SECOND_NAMES, sd_key
from tankcal.messages import message

CREDIBLE_LENGTHS = (0.1, 100)  # plausible principal distance, in diagonals of the format
POSSIBLE_LENGTHS = (0.05, 200)  # possible principal distance, in diagonals of the format
RADIAL_TERMS, DECENTRING_TERMS = ("K1", "K2", "K3", "K4"), ("P1", "P2", "P3", "P4")
# Displacement of the corner of the image, as a share of its radius.
DOUBTFUL_DISTORTION, IMPOSSIBLE_DISTORTION = 0.1, 0.5


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
    values = at_focus(given)
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
