"""Checks of distance-dependent distortion: focus of a camera, [adjustment] depth_of_field."""

from tankcal.camera.focus import RADIAL
from tankcal.job.cameras import focus_keys, lens_of
from tankcal.job.checking import tell
from tankcal.job.contract.registers import PARAMETER_KEYS
from tankcal.messages import message

NEAREST = 2.0  # smallest distance of an object, in focal lengths
ALIKE = 0.3  # largest relative difference of c and the focal length
BESIDE = ("focus_m", "lens_focal_length_mm")


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
