"""Keys of [horizontal] and [sphere], and checks that sizes are complete and consistent."""

from tankcal.job.checking import is_not_given, missing_beside, settings_place, tell
from tankcal.job.contract.ends import HORIZONTAL_ONLY, check_end, end_keys
from tankcal.job.fields import choice, number, positive
from tankcal.job.plausibility import STRONG_ROLL_DEG
from tankcal.messages import message

SPHERE_ONLY = ("sphere",)


def _length(name, note, kinds, high=100.0, required=False):
    """Return a key for a length above 0, metres."""
    return positive(name, note, high, required=required, kinds=kinds)


def _thickness(kinds):
    """Return the key of the thickness of plate and paint."""
    return number(
        "thickness_mm",
        "thickness of plate and paint together, millimetres; subtracted from outside measurements",
        0,
        100,
        kinds=kinds,
    )


HORIZONTAL = (
    _length(
        "diameter_m",
        "diameter, metres: FILL IN this, or width_m and height_m, or the points",
        HORIZONTAL_ONLY,
        20,
    ),
    _length("width_m", "width of an elliptical cylinder, metres", HORIZONTAL_ONLY, 20),
    _length("height_m", "height of an elliptical cylinder, metres", HORIZONTAL_ONLY, 20),
    _length(
        "length_m",
        "length of the cylinder without the ends, metres; no thickness is subtracted",
        HORIZONTAL_ONLY,
        200,
        required=True,
    ),
    *end_keys("a"),
    *end_keys("b"),
    number(
        "tilt_mm_per_m",
        "rise of end B above end A, millimetres per metre of axis; negative: A is higher;"
        " blank: 0; blank if points are given",
        -200,
        200,
        kinds=HORIZONTAL_ONLY,
    ),
    number(
        "roll_deg",
        "rotation of an elliptical cross-section, or of guppy ends, about the axis, degrees,"
        " clockwise seen from A; blank: 0",
        -90,
        90,
        kinds=HORIZONTAL_ONLY,
    ),
    number(
        "dip_from_a_m",
        "distance of the dip point along the axis from the start of the cylinder at A, metres;"
        " blank: half the length, only without tilt",
        0,
        200,
        kinds=HORIZONTAL_ONLY,
    ),
    choice(
        "dip_direction",
        "direction of the dips: plumb, or square (perpendicular to the axis); blank: plumb",
        ("plumb", "square"),
        kinds=HORIZONTAL_ONLY,
    ),
    number(
        "tube_angle_deg",
        "angle of the gauge tube of a rolled round tank from the vertical, in the plane"
        " perpendicular to the axis, degrees; above 0: its top leans to the right, seen from A;"
        " blank: 0",
        -60,
        60,
        kinds=HORIZONTAL_ONLY,
    ),
    number(
        "tube_offset_m",
        "distance of the gauge tube from the axis of a round tank, metres; above 0: to the"
        " right, seen from A; blank: 0",
        -10,
        10,
        kinds=HORIZONTAL_ONLY,
    ),
    _thickness(HORIZONTAL_ONLY),
    number(
        "azimuth_deg",
        "azimuth of the axis from A to B, degrees clockwise from +y, which identifies end A in"
        " the points; only with points",
        0,
        360,
        kinds=HORIZONTAL_ONLY,
    ),
)
SPHERE = (
    _length(
        "diameter_m", "diameter, metres: FILL IN this, or the points, or great circles", SPHERE_ONLY
    ),
    _thickness(SPHERE_ONLY),
    number(
        "ovality_mm",
        "only with great_circles: standard deviation of ovality and flattening where the great"
        " circles do not determine them, millimetres; blank: 0.1 % of the radius",
        0,
        500,
        above_low=True,
        kinds=SPHERE_ONLY,
    ),
    number(
        "form_mm",
        "only with great_circles: standard deviation of the radius about the ellipsoid (plates,"
        " seams, legs), millimetres; blank: 3.9",
        0,
        500,
        kinds=SPHERE_ONLY,
    ),
)

KEYS = {"horizontal": HORIZONTAL, "sphere": SPHERE}

STRONG_TILT_MM_PER_M = 50  # warning above
ROUND_TUBE = message(
    "tube_round_only", "expected only for a round cylinder: diameter_m, or points.csv"
)
RINGS_WITHOUT_TUBE = message(
    "tube_beside_rings",
    "cannot be given with rings.csv; expected a blank: dips in a tank of rings are taken"
    " through its axis",
)
SIZES = ("diameter_m", "width_m", "height_m")


def check_horizontal(values, wall, raw, log, height_m=None):
    """Check sizes, ends, tilt and dip point of a horizontal cylinder.

    Parameters
    ----------
    values : dict
        Values of job.toml.
    wall : {"points", "straps"} or None
        Source of the cylinder; None: sizes of [horizontal].
    raw, log
        Raw job, and log of its problems.
    height_m : float, optional
        Approximate height of the cylinder, m, if determined by tape.
    """
    has_points = wall == "points"

    def tell_problem(key, expected):
        tell(log.problem, raw, "horizontal", key, expected)

    given = values["horizontal"]
    if wall == "straps":
        _check_ringed(given, raw, log)
    else:
        _check_thickness(given, values["survey"]["side"], "horizontal", raw, log)
    if has_points:
        _refuse_given(given, (*SIZES, "tilt_mm_per_m"), raw, log)
        for key, expected in (
            (
                "azimuth_deg",
                message(
                    "azimuth_missing",
                    "missing; expected the direction from A to B, clockwise from +y",
                ),
            ),
            (
                "dip_from_a_m",
                message(
                    "dip_missing_beside_points",
                    "missing; expected the place of the dip point, because the points "
                    "determine a tilt",
                ),
            ),
        ):
            if is_not_given(raw, "horizontal", key):
                tell_problem(key, expected)
    else:
        if wall is None:
            _check_sizes(given, raw, log)
        if given["azimuth_deg"] is not None:
            tell_problem(
                "azimuth_deg",
                message(
                    "azimuth_without_points",
                    "given without points.csv; expected only with points",
                ),
            )
    for end in ("end_a", "end_b"):
        check_end(given, end, wall is not None, raw, log)
    _check_dip(given, height_m, raw, log)
    if wall != "straps":
        _check_tube(given, has_points, raw, log)


def _check_ringed(given, raw, log):
    """Refuse sizes beside rings, and require thickness_mm for curved ends.

    Rings have their own sizes and plates; thickness_mm then applies to the ends only.
    """
    for key in (*SIZES, "roll_deg"):
        if given[key]:
            expected = message(
                "size_beside_rings",
                "given together with circumferences by tape; expected only one of them: the"
                " rings are round, with sizes from the tape",
            )
            tell(log.problem, raw, "horizontal", key, expected)
    for key in ("tube_angle_deg", "tube_offset_m"):
        if given[key]:
            tell(log.problem, raw, "horizontal", key, RINGS_WITHOUT_TUBE)
    curved = any(given[end] not in (None, "flat") for end in ("end_a", "end_b"))
    if curved and is_not_given(raw, "horizontal", "thickness_mm"):
        expected = message(
            "end_thickness_missing",
            "missing; expected plate and paint of the ends, which are subtracted from their"
            " depths or radii (0: inside sizes)",
        )
        tell(log.problem, raw, "horizontal", "thickness_mm", expected)


def _refuse_given(given, keys, raw, log, section="horizontal"):
    """Refuse sizes that are determined by points.csv."""
    for key in keys:
        if given[key] is not None:
            expected = message(
                "size_beside_points",
                "given together with points.csv; expected only one of them: the size comes "
                "from the points",
            )
            tell(log.problem, raw, section, key, expected)


def _check_sizes(given, raw, log):
    """Check that either a diameter, or width and height, are given."""

    def missing(key):
        return is_not_given(raw, "horizontal", key)

    if not missing("diameter_m"):
        for key in ("width_m", "height_m"):
            if not missing(key):
                expected = message(
                    "size_beside_diameter",
                    "given together with diameter_m; expected the diameter, or width and height",
                )
                tell(log.problem, raw, "horizontal", key, expected)
        return
    if missing("width_m") and missing("height_m"):
        expected = message(
            "horizontal_size_missing",
            "missing; expected it, or width_m and height_m, or points.csv",
        )
        tell(log.problem, raw, "horizontal", "diameter_m", expected)
        return
    for key, other in (("width_m", "height_m"), ("height_m", "width_m")):
        if missing(key):
            tell(log.problem, raw, "horizontal", key, missing_beside(other))


def _check_thickness(given, side, section, raw, log):
    """Require thickness_mm with an outside survey, and refuse it with an inside survey."""
    if side == "outside" and is_not_given(raw, section, "thickness_mm"):
        expected = message(
            "thickness_missing",
            "missing, but survey.side = outside; expected plate and paint (0: none)",
        )
        tell(log.problem, raw, section, "thickness_mm", expected)
    elif side != "outside" and given["thickness_mm"]:
        expected = message(
            "thickness_unused",
            "expected only with survey.side = outside: no thickness is subtracted from inside"
            " sizes",
        )
        tell(log.problem, raw, section, "thickness_mm", expected)


def _check_dip(given, height_m, raw, log):
    """Check that the dip point lies within the cylinder, and that tilt and roll are plausible."""
    dip, length, tilt = (given[key] for key in ("dip_from_a_m", "length_m", "tilt_mm_per_m"))
    height = given["height_m"] or given["diameter_m"] or height_m
    if None not in (dip, length):
        is_plumb = given["dip_direction"] != "square" and None not in (tilt, height)
        at_top = dip + (tilt / 1000 * height if is_plumb else 0.0)
        if not (dip <= length and 0 <= at_top <= length):
            expected = message(
                "dip_outside",
                "found {dip:g}; expected a dip within the cylinder, 0 to {length:g} m from A",
                dip=dip,
                length=length,
            )
            if dip <= length:
                expected = message(
                    "dip_leaves_top",
                    "found {dip:g}; expected a dip within the cylinder, 0 to {length:g} m "
                    "from A; it would leave the top at {at_top:.3f} m",
                    dip=dip,
                    length=length,
                    at_top=at_top,
                )
            tell(log.problem, raw, "horizontal", "dip_from_a_m", expected)
    has_guppy = "guppy" in (given["end_a"], given["end_b"])
    if given["roll_deg"] and given["diameter_m"] is not None and not has_guppy:
        expected = message("roll_of_round_tank", "it has no effect on a round cylinder")
        tell(log.warning, raw, "horizontal", "roll_deg", expected)
    if tilt and is_not_given(raw, "horizontal", "dip_from_a_m"):
        expected = message(
            "dip_missing",
            "missing; expected the place of the dip point, because the tank is tilted",
        )
        tell(log.problem, raw, "horizontal", "dip_from_a_m", expected)
    if tilt and abs(tilt) > STRONG_TILT_MM_PER_M:
        expected = message(
            "large_tilt",
            "{tilt_mm_per_m:g} mm/m is large; typical tilts are 5 to 20 mm/m: is it in another"
            " unit?",
            tilt_mm_per_m=tilt,
        )
        tell(log.warning, raw, "horizontal", "tilt_mm_per_m", expected)


def _check_tube(given, has_points, raw, log):
    """Check that a gauge tube crosses a round tank, and does not lean in a tilted tank."""
    keys = [key for key in ("tube_angle_deg", "tube_offset_m") if given[key]]
    diameter = given["diameter_m"]
    for key in keys:
        if None not in (given["width_m"], given["height_m"]):
            tell(log.problem, raw, "horizontal", key, ROUND_TUBE)
    if "tube_offset_m" in keys and diameter and abs(given["tube_offset_m"]) >= diameter / 2:
        expected = message(
            "tube_outside",
            "found {offset:g}; expected a tube that crosses the tank: less than half the diameter,"
            " {half:g} m",
            offset=given["tube_offset_m"],
            half=diameter / 2,
        )
        tell(log.problem, raw, "horizontal", "tube_offset_m", expected)
    leans = has_points or given["tilt_mm_per_m"]
    if "tube_angle_deg" in keys and leans and given["dip_direction"] != "square":
        expected = message(
            "tube_of_tilted_tank",
            "expected square with tube_angle_deg: in a tilted tank, a tube that leans in the"
            " plane perpendicular to the axis is not vertical",
        )
        tell(log.problem, raw, "horizontal", "dip_direction", expected)
    if abs(given["tube_angle_deg"] or 0.0) > STRONG_ROLL_DEG:
        expected = message(
            "large_roll",
            "{angle_deg:g} degrees is large; typical rolls are 1 to 10 degrees: is it the angle"
            " from the vertical?",
            angle_deg=given["tube_angle_deg"],
        )
        tell(log.warning, raw, "horizontal", "tube_angle_deg", expected)


def check_sphere(values, has_points, has_circles, is_loaded, raw, log):
    """Check that a sphere has one source of its diameter, and plates if it is loaded.

    Parameters
    ----------
    values : dict
        Values of job.toml.
    has_points, has_circles : bool
        Whether the job has points.csv, or great_circles.csv.
    is_loaded : bool
        Whether a pressure or a density loads the sphere.
    raw, log
        Raw job, and log of its problems.
    """
    given = values["sphere"]
    if not is_loaded or values["survey"]["side"] == "outside":
        _check_thickness(given, values["survey"]["side"], "sphere", raw, log)
    if (
        is_loaded
        and not given["thickness_mm"]
        and not log.has(*settings_place(raw, "sphere", "thickness_mm"))
    ):
        expected = message(
            "thickness_of_loaded_sphere",
            "missing or 0, but a pressure or a density is given; expected the plate thickness:"
            " the plates stretch under this load",
        )
        tell(log.problem, raw, "sphere", "thickness_mm", expected)
    if has_points:
        _refuse_given(given, ("diameter_m",), raw, log, "sphere")
    elif is_not_given(raw, "sphere", "diameter_m") and not has_circles:
        tell(
            log.problem,
            raw,
            "sphere",
            "diameter_m",
            message(
                "sphere_size_missing", "missing; expected it, or points.csv, or great_circles.csv"
            ),
        )
