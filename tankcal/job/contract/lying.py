"""[horizontal] and [sphere]: their keys; sizes complete, consistent, and said once."""

from tankcal.job.checking import is_not_given, missing_beside, settings_place, tell
from tankcal.job.contract.shorthand import choice, number, positive
from tankcal.messages import message

HORIZONTAL_ONLY = ("horizontal",)
SPHERE_ONLY = ("sphere",)
END_FORMS = ("flat", "conical", "ellipsoidal", "torispherical", "spherical")


def _length(name, note, kinds, high=100.0, required=False):
    return positive(name, note, high, required=required, kinds=kinds)


def _end(letter):
    """The keys of one end of a horizontal cylinder."""
    name = f"end {letter.upper()}"
    return (
        choice(f"end_{letter}", f"form of {name}", END_FORMS, required=True, kinds=HORIZONTAL_ONLY),
        _length(
            f"end_{letter}_depth_m",
            f"{name}: depth along the axis, metres; conical, ellipsoidal, spherical only",
            HORIZONTAL_ONLY,
            20,
        ),
        _length(
            f"end_{letter}_dish_radius_m",
            f"{name}: radius of the dish, metres; torispherical only",
            HORIZONTAL_ONLY,
        ),
        _length(
            f"end_{letter}_knuckle_radius_m",
            f"{name}: radius of the knuckle, metres; torispherical only",
            HORIZONTAL_ONLY,
            20,
        ),
    )


def _thickness(kinds):
    return number(
        "thickness_mm",
        "plate and paint together, millimetres: subtracted from what was measured outside",
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
        "length of the cylinder, without the ends, metres; nothing is subtracted from it",
        HORIZONTAL_ONLY,
        200,
        required=True,
    ),
    *_end("a"),
    *_end("b"),
    number(
        "tilt_mm_per_m",
        "rise of end B over end A, millimetres per metre of axis; negative: A is higher; blank: 0;"
        " not with points",
        -200,
        200,
        kinds=HORIZONTAL_ONLY,
    ),
    number(
        "roll_deg",
        "turn of an elliptical cross-section about the axis, degrees, clockwise seen from A;"
        " blank: 0",
        -90,
        90,
        kinds=HORIZONTAL_ONLY,
    ),
    number(
        "dip_from_a_m",
        "dip point: along the axis from the start of the cylinder at A, metres; blank: half the"
        " length, where there is no tilt",
        0,
        200,
        kinds=HORIZONTAL_ONLY,
    ),
    choice(
        "dip_direction",
        "dips are read plumb, or square to the axis; blank: plumb",
        ("plumb", "square"),
        kinds=HORIZONTAL_ONLY,
    ),
    _thickness(HORIZONTAL_ONLY),
    number(
        "azimuth_deg",
        "direction from A to B, degrees clockwise from +y, so that the points know which end is A;"
        " only with points",
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
        "only with great_circles: standard deviation of how oval and how flat the sphere is, where"
        " no strap tells it, millimetres; blank: 0.1 % of its radius",
        0,
        500,
        above_low=True,
        kinds=SPHERE_ONLY,
    ),
    number(
        "form_mm",
        "only with great_circles: standard deviation of its radius beyond the ellipsoid (plates,"
        " seams, legs), millimetres; blank: 4.3",
        0,
        500,
        kinds=SPHERE_ONLY,
    ),
)

KEYS = {"horizontal": HORIZONTAL, "sphere": SPHERE}

STRONG_TILT_MM_PER_M = 50
DEEPEST_END = 2.0  # diameters
SIZES = ("diameter_m", "width_m", "height_m")
RADII = ("dish_radius_m", "knuckle_radius_m")
ROUND_ONLY = ("torispherical", "spherical")


def check_horizontal(values, wall, raw, log, height_m=None):
    """Sizes, ends, tilt and dip point of a horizontal cylinder.

    wall      what it comes from: "points", "straps", or None: the sizes
    height_m  of the cylinder where a tape tells it, about
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
        _check_end(given, end, wall is not None, raw, log)
    _check_dip(given, height_m, raw, log)


def _check_ringed(given, raw, log):
    """Rings have sizes and plates of their own; thickness_mm is of the ends alone."""
    for key in (*SIZES, "roll_deg"):
        if given[key]:
            expected = message(
                "size_beside_rings",
                "given together with circumferences by tape; expected only one of them: the rings"
                " are round, and have their sizes from these",
            )
            tell(log.problem, raw, "horizontal", key, expected)
    curved = any(given[end] not in (None, "flat") for end in ("end_a", "end_b"))
    if curved and is_not_given(raw, "horizontal", "thickness_mm"):
        expected = message(
            "end_thickness_missing",
            "missing; expected plate and paint of the ends, which are subtracted from their depths"
            " or radii (0: these are inside)",
        )
        tell(log.problem, raw, "horizontal", "thickness_mm", expected)


def _refuse_given(given, keys, raw, log, section="horizontal"):
    for key in keys:
        if given[key] is not None:
            expected = message(
                "size_beside_points",
                "given together with points.csv; expected only one of them: the size comes "
                "from the points",
            )
            tell(log.problem, raw, section, key, expected)


def _check_sizes(given, raw, log):
    """A diameter, or width and height."""

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
    """Plates count for what was measured outside only, and there they must be said."""
    if side == "outside" and is_not_given(raw, section, "thickness_mm"):
        expected = message(
            "thickness_missing",
            "missing, but survey.side = outside; expected plate and paint (0: none)",
        )
        tell(log.problem, raw, section, "thickness_mm", expected)
    elif side != "outside" and given["thickness_mm"]:
        expected = message(
            "thickness_unused",
            "expected only with survey.side = outside: with side = inside nothing is subtracted",
        )
        tell(log.problem, raw, section, "thickness_mm", expected)


def _check_end(given, end, has_points, raw, log):
    def tell_problem(key, expected):
        tell(log.problem, raw, "horizontal", key, expected)

    form, depth = given[end], given[f"{end}_depth_m"]
    height = given["height_m"] or given["diameter_m"]
    width = given["width_m"] or given["diameter_m"]
    if form is None:
        return
    if form in ROUND_ONLY and None not in (height, width) and height != width:
        tell_problem(
            end,
            message(
                "round_ends_only",
                "found {form}; expected another form: this one is for round cylinders only",
                form=form,
            ),
        )
    needs_depth = form in ("conical", "ellipsoidal", "spherical")
    if needs_depth and is_not_given(raw, "horizontal", f"{end}_depth_m"):
        tell_problem(
            f"{end}_depth_m",
            message(
                "end_depth_missing", "missing; expected the depth of the {form} end", form=form
            ),
        )
    if depth is not None and not needs_depth:
        expected = message(
            "end_has_no_depth",
            "given for a {form} end; expected a blank: such an end has no depth",
            form=form,
        )
        if form == "torispherical":
            expected = message(
                "end_depth_from_radii",
                "given for a {form} end; expected a blank: its radii determine it",
                form=form,
            )
        tell_problem(f"{end}_depth_m", expected)
    elif depth is not None and height is not None:
        deepest = height / 2 if form == "spherical" else DEEPEST_END * height
        if depth > deepest * (1 + 1e-9):
            expected = message(
                "end_too_deep",
                "found {depth:g}; expected at most {deepest:g} m for a {form} end",
                depth=depth,
                deepest=deepest,
                form=form,
            )
            tell_problem(f"{end}_depth_m", expected)
    _check_radii(given, end, form, None if has_points else height, raw, log)


def _check_radii(given, end, form, diameter, raw, log):
    for radius in RADII:
        key = f"{end}_{radius}"
        if form == "torispherical" and is_not_given(raw, "horizontal", key):
            expected = message("end_radius_missing", "missing; expected for a torispherical end")
            tell(log.problem, raw, "horizontal", key, expected)
        elif form != "torispherical" and given[key] is not None:
            expected = message(
                "end_radius_unused",
                "given for a {form} end; expected only for a torispherical one",
                form=form,
            )
            tell(log.problem, raw, "horizontal", key, expected)
    dish, knuckle = (given[f"{end}_{radius}"] for radius in RADII)
    if form != "torispherical" or None in (dish, knuckle, diameter):
        return
    if dish <= diameter / 2:
        expected = message(
            "dish_too_small",
            "found {dish:g}; expected more than half the diameter, {half:g} m",
            dish=dish,
            half=diameter / 2,
        )
        tell(log.problem, raw, "horizontal", f"{end}_dish_radius_m", expected)
    if knuckle > diameter / 2:
        expected = message(
            "knuckle_too_large",
            "found {knuckle:g}; expected at most half the diameter, {half:g} m",
            knuckle=knuckle,
            half=diameter / 2,
        )
        tell(log.problem, raw, "horizontal", f"{end}_knuckle_radius_m", expected)


def _check_dip(given, height_m, raw, log):
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
    if given["roll_deg"] and given["diameter_m"] is not None:
        expected = message("roll_of_round_tank", "it has no effect on a round cylinder")
        tell(log.warning, raw, "horizontal", "roll_deg", expected)
    if tilt and is_not_given(raw, "horizontal", "dip_from_a_m"):
        expected = message(
            "dip_missing", "missing; expected the place of the dip point, because the tank leans"
        )
        tell(log.problem, raw, "horizontal", "dip_from_a_m", expected)
    if tilt and abs(tilt) > STRONG_TILT_MM_PER_M:
        expected = message(
            "large_tilt",
            "{tilt_mm_per_m:g} mm/m is large; tanks lean by 5 to 20: is it in another unit?",
            tilt_mm_per_m=tilt,
        )
        tell(log.warning, raw, "horizontal", "tilt_mm_per_m", expected)


def check_sphere(values, has_points, has_circles, is_loaded, raw, log):
    """The diameter, points of the wall, or great circles; plates where something loads them."""
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
            "missing or 0, but a pressure or a density is given; expected the plates, which give"
            " way to it",
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
