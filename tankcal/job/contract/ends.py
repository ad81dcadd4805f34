"""Keys and checks of the ends of horizontal tanks and of the heads of vertical tanks."""

from tankcal.errors import SolutionError
from tankcal.job.checking import is_not_given, tell
from tankcal.job.fields import choice, positive
from tankcal.messages import message
from tankcal.tank.heads import KINDS, STANDARDS, End, depth_of, standard_end

HORIZONTAL_ONLY = ("horizontal",)
RADII = ("dish_radius_m", "knuckle_radius_m")
DEEPEST_END = 2.0  # largest depth of an end over the diameter
# Forms of ends that elliptical cylinders cannot have.
ROUND_ONLY = ("torispherical", "spherical", "guppy")


def end_keys(letter):
    """Return the keys of one end of a horizontal cylinder."""
    name = f"end {letter.upper()}"
    return (
        choice(f"end_{letter}", f"form of {name}", KINDS, required=True, kinds=HORIZONTAL_ONLY),
        positive(
            f"end_{letter}_depth_m",
            f"{name}: depth along the axis, metres; blank for flat ends",
            20,
            kinds=HORIZONTAL_ONLY,
        ),
        *torispherical_keys(f"end_{letter}_", f"{name}: ", HORIZONTAL_ONLY),
    )


def torispherical_keys(prefix, name, kinds):
    """Return the keys of the sizes of torispherical ends and heads.

    Parameters
    ----------
    prefix : str
        Prefix of the keys.
    name : str
        Text before the notes, with its separator.
    kinds : tuple of str
        Kinds of tank that have these keys.

    Returns
    -------
    tuple of Field
    """
    return (
        positive(
            f"{prefix}dish_radius_m",
            f"{name}radius of the dish, metres; torispherical only",
            100,
            kinds=kinds,
        ),
        positive(
            f"{prefix}knuckle_radius_m",
            f"{name}radius of the knuckle, metres; torispherical only",
            20,
            kinds=kinds,
        ),
        choice(
            f"{prefix}standard",
            f"{name}standard that defines both radii from the diameter; torispherical only",
            tuple(STANDARDS),
            kinds=kinds,
        ),
    )


def check_end(given, end, has_points, raw, log):
    """Check form and sizes of one end of a horizontal cylinder.

    Parameters
    ----------
    given : dict
        Values of [horizontal].
    end : {"end_a", "end_b"}
    has_points : bool
        Whether the diameter comes from a survey, and not from [horizontal].
    raw, log
        Raw job, and log of its problems.
    """

    def tell_problem(key, expected):
        tell(log.problem, raw, "horizontal", key, expected)

    form, depth, key = given[end], given[f"{end}_depth_m"], f"{end}_depth_m"
    height = given["height_m"] or given["diameter_m"]
    width = given["width_m"] or given["diameter_m"]
    if form is None:
        return
    if form in ROUND_ONLY and None not in (height, width) and height != width:
        expected = message(
            "round_ends_only",
            "found {form}, an end for round cylinders only; expected another form",
            form=form,
        )
        tell_problem(end, expected)
    if form not in ("flat", "torispherical") and is_not_given(raw, "horizontal", key):
        tell_problem(key, depth_missing(form))
    if depth is not None and form == "flat":
        expected = message(
            "end_has_no_depth",
            "given for a {form} end, which has no depth; expected a blank",
            form=form,
        )
        tell_problem(key, expected)
    elif depth is not None and height is not None and form != "torispherical":
        deepest = height / 2 if form == "spherical" else DEEPEST_END * height
        if depth > deepest * (1 + 1e-9):
            tell_problem(key, too_deep(depth, deepest, form))
    diameter = None if has_points else height
    check_radii("horizontal", given, form, key, depth, diameter, raw, log, prefix=f"{end}_")


def depth_missing(form):
    """Return the message for an end or head without the depth required by its form."""
    return message("end_depth_missing", "missing; expected the depth of the {form} end", form=form)


def too_deep(depth, deepest, form):
    """Return the message for an end or head deeper than its form permits."""
    return message(
        "end_too_deep",
        "found {depth:g}; expected at most {deepest:g} m for a {form} end",
        depth=depth,
        deepest=deepest,
        form=form,
    )


def check_radii(section, given, form, depth_key, depth, diameter, raw, log, *, prefix=""):
    """Check the sizes of a torispherical end or head, and refuse them for other forms.

    Two of depth, dish radius and knuckle radius are required, or a standard.

    Parameters
    ----------
    section : str
        Section of job.toml.
    given : dict
        Values of the section.
    form : str
        Form of the end.
    depth_key : str
        Key of the depth.
    depth : float or None
        Depth from the edge to the tip, m.
    diameter : float or None
        Diameter of the tank, m; None if unknown.
    raw, log
        Raw job, and log of its problems.
    prefix : str, optional
        Prefix of the keys.
    """
    names = {name: f"{prefix}{name}" for name in (*RADII, "standard")}
    if form != "torispherical":
        for key in names.values():
            if given[key] is not None:
                expected = message(
                    "end_radius_unused",
                    "given for a {form} end; expected only for a torispherical end",
                    form=form,
                )
                tell(log.problem, raw, section, key, expected)
        return
    present, problems = _find_sizes(section, names, depth_key, raw)
    for key, expected in problems:
        tell(log.problem, raw, section, key, expected)
    if diameter is not None and present:
        values = {name: given[key] for name, key in names.items()}
        _check_sizes(section, values, names, present, depth_key, depth, diameter, raw, log)


def _find_sizes(section, names, depth_key, raw):
    """Determine which sizes of a torispherical end are given, and which are missing or redundant.

    Returns
    -------
    present : list of str
        Names of the given radii, or "standard"; empty if they do not suffice.
    problems : list of (str, str)
        Key and message of each problem.
    """
    has_depth = not is_not_given(raw, section, depth_key)
    present = [name for name in RADII if not is_not_given(raw, section, names[name])]
    if not is_not_given(raw, section, names["standard"]):
        beside = message(
            "end_radius_beside_standard",
            "given together with {standard}, which determines it; expected only one of them",
            standard=names["standard"],
        )
        return ["standard"], [(names[name], beside) for name in present]
    if has_depth and not present:
        alone = message(
            "end_depth_alone",
            "missing; expected one of {names} beside the depth of a torispherical end, or one of "
            "its radii",
            names=list(STANDARDS),
        )
        return [], [(names["standard"], alone)]
    if not present:
        neither = message(
            "end_standard_missing",
            "missing; expected one of {names} for a torispherical end, or its two radii",
            names=list(STANDARDS),
        )
        return [], [(names["standard"], neither)]
    if has_depth and len(present) == 2:
        over = message(
            "end_sizes_over",
            "given together with both radii; expected two of these three sizes of a torispherical "
            "end: they determine the third",
        )
        return [], [(depth_key, over)]
    missing = message("end_radius_missing", "missing; expected for a torispherical end")
    lacking = [] if has_depth else [name for name in RADII if name not in present]
    return present, [(names[name], missing) for name in lacking]


def _check_sizes(section, values, names, present, depth_key, depth, diameter, raw, log):
    """Check radii and depth against the diameter."""
    dish, knuckle = (values[name] for name in RADII)
    half = diameter / 2
    if dish is not None and dish <= half:
        expected = message(
            "dish_too_small",
            "found {dish:g}; expected more than half the diameter, {half:g} m",
            dish=dish,
            half=half,
        )
        tell(log.problem, raw, section, names["dish_radius_m"], expected)
        return
    if knuckle is not None and knuckle > half:
        expected = message(
            "knuckle_too_large",
            "found {knuckle:g}; expected at most half the diameter, {half:g} m",
            knuckle=knuckle,
            half=half,
        )
        tell(log.problem, raw, section, names["knuckle_radius_m"], expected)
        return
    if depth is None:
        return
    if present == ["standard"]:
        if values["standard"] is None:  # unknown standard, reported elsewhere
            return
        knuckle = STANDARDS[values["standard"]][1] * diameter
    # The end is deeper than the cap of its dish over the whole diameter, and than its knuckle.
    least = knuckle if dish is None else dish - (dish**2 - half**2) ** 0.5
    if least is not None and not least < depth < half:
        expected = message(
            "end_depth_off_radius",
            "{depth:g} m deep; expected more than {least:.4g} and less than {half:g} m for a "
            "torispherical end of that radius",
            depth=depth,
            least=least,
            half=half,
        )
        tell(log.problem, raw, section, depth_key, expected)


def depth_of_head(given, depth, diameter):
    """Return the depth of a vertical tank's head, m, declared or from radii; None if unknown."""
    if depth is not None or given["form"] != "torispherical":
        return depth
    end = End("torispherical", 0.0, given["dish_radius_m"], given["knuckle_radius_m"])
    if given["standard"] is not None:
        end = standard_end(End("torispherical"), given["standard"], diameter)
    try:
        return depth_of(end, diameter / 2)
    except SolutionError:  # reported by the checks of the sizes
        return None
