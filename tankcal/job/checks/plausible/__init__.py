"""Plausibility of single numbers: ranges and cross-checks of `tankcal.job.plausibility`."""

import numpy as np

from tankcal.job.checking import course_heights, has_rows, places_of, tell
from tankcal.job.checks.plausible.shell import (
    check_dates,
    check_levels,
    check_material,
    check_plates,
)
from tankcal.job.plausibility import (
    DISH_RADIUS,
    END_DEPTH,
    ENDS_DIFFER,
    ENDS_DIFFER_M,
    FLAT,
    HEMISPHERE,
    IMPOSSIBLE_MISS,
    KNUCKLE_RADIUS,
    LENGTH_OVER_DIAMETER,
    LEVEL_M,
    MIN_POINTS_PER_COURSE,
    MOST_LENGTH_OVER_DIAMETER,
    MOST_RINGS,
    NEAR_JOINT_M,
    RAISED,
    RING_GAP_M,
    SIZE_MISS,
    SIZE_MISS_M,
    SPHERE_M,
    TARGET_MM,
    side_doubt,
)
from tankcal.messages import message
from tankcal.tank.tips import FORMS as HEADS

__all__ = ["check_plausible"]


def check_plausible(values, tables, extent, kind, raw, log):
    """Run every plausibility check; parameters as for `checks.check_tank`."""
    check_dates(values, raw, log)
    check_material(values, kind, raw, log)
    check_sizes(values, kind, raw, log)
    check_plates(values, tables, kind, raw, log)
    check_levels(values, tables, extent, kind, raw, log)
    check_targets(values, tables, log)
    if kind == "vertical":
        check_rings(values, tables["points"], tables["courses"], log)


# Level rings of points, compared with the joints of the courses.


# ---- lying cylinders, spheres, heads, rings of points and targets


def check_rings(values, points, courses, log):
    """Warn about a ring of points at a joint, which indicates wrong heights or wrong order."""
    bottom = values["datum"]["bottom_z_m"]
    heights = course_heights(courses)
    if points is None or bottom is None or heights is None or len(heights) < 2:
        return
    rings = _rings(places_of(points)[:, 2]) - bottom
    if not len(rings):
        return
    joints = np.cumsum(heights)[:-1]
    distance, joint = _nearest(rings, joints)
    if distance > NEAR_JOINT_M:
        return
    hint = message("heights_right", "are the heights of the courses and datum.bottom_z_m right?")
    if _nearest(rings, np.cumsum(heights[::-1])[:-1])[0] > 2 * NEAR_JOINT_M:
        hint = message("from_top_down", "are the courses listed from the top down?")
    text = message(
        "ring_on_joint",
        "a ring of points lies {near_mm:.0f} mm from the joint above course {course}, which is"
        " {joint_m:.4g} m above datum.bottom_z_m; expected rings on plates: {hint}",
        near_mm=1000 * distance,
        course=courses.of("course")[joint],
        joint_m=joints[joint],
        hint=hint,
    )
    log.warning(courses.file, text, courses.rows[joint], "height_m")


def _nearest(rings, joints):
    """Smallest distance of a ring from a joint, and index of this joint."""
    distances = np.abs(rings[:, None] - joints).min(axis=0)
    return float(distances.min()), int(distances.argmin())


def _rings(z):
    """Heights of level rings; empty if the points do not form rings."""
    z = np.sort(z)
    parts = np.split(z, np.flatnonzero(np.diff(z) > RING_GAP_M) + 1)
    level = [part for part in parts if len(part) >= MIN_POINTS_PER_COURSE]
    if len(level) > MOST_RINGS or any(np.ptp(part) > LEVEL_M for part in level):
        return np.zeros(0)
    return np.array([np.median(part) for part in level])


RADII = (("dish_radius_m", DISH_RADIUS), ("knuckle_radius_m", KNUCKLE_RADIUS))
ALIKE = dict.fromkeys(END_DEPTH, ("depth_m",)) | {
    "torispherical": ("depth_m", *(name for name, _ in RADII))
}


def check_sizes(values, kind, raw, log):
    """Check the dimensions of tanks that are described by dimensions, and of heads."""
    if kind in ("sphere", "horizontal"):
        _check_inside(values, kind, raw, log)
    if kind == "sphere":
        _check_sphere(values, raw, log)
    if kind == "horizontal":
        _check_lying(values, raw, log)
    if kind == "vertical":
        # Check the depth of the head on a vertical tank.
        form, depth = values["top"]["form"], values["top"]["depth_m"]
        diameter = values["tank"]["nominal_diameter_m"]
        if None not in (form, depth, diameter):
            _check_depth("top", "depth_m", depth, HEADS[form], diameter, raw, log)


def _check_inside(values, kind, raw, log):
    """Compare a measured diameter with a nominal diameter of known definition."""
    found, side = values[kind]["diameter_m"], values["survey"]["side"]
    plate = (values[kind]["thickness_mm"] or 0.0) / 1000
    if None in (found, side):
        return
    inside = found - 2 * plate if side == "outside" else found
    nominal, drawn = values["tank"]["nominal_diameter_m"], values["checks"]["diameter_is"]
    text = side_doubt(inside, nominal, drawn, plate, side)
    if text is not None:
        tell(log.warning, raw, "checks", "diameter_is", text)


def _check_sphere(values, raw, log):
    found, nominal = values["sphere"]["diameter_m"], values["tank"]["nominal_diameter_m"]
    _compare(found, nominal, "sphere", "diameter_m", "tank.nominal_diameter_m", raw, log)
    if found is not None and found > SPHERE_M:
        text = message(
            "sphere_large",
            "{found_m:g} m, expected at most {most_m:g} m: is it in feet?",
            found_m=found,
            most_m=SPHERE_M,
        )
        tell(log.warning, raw, "sphere", "diameter_m", text)


def _check_lying(values, raw, log):
    given, nominal = values["horizontal"], values["tank"]["nominal_diameter_m"]
    drawn = "tank.nominal_diameter_m"
    _compare(given["diameter_m"], nominal, "horizontal", "diameter_m", drawn, raw, log)
    diameter = given["diameter_m"] or nominal
    if None not in (given["width_m"], given["height_m"]):
        diameter = float(np.sqrt(given["width_m"] * given["height_m"]))
    length = given["length_m"]
    drawn = values["checks"]["length_m"]
    _compare(length, drawn, "horizontal", "length_m", "checks.length_m", raw, log)
    if diameter is None:
        return
    if length is not None:
        _check_length(length, diameter, raw, log)
    for end in "ab":
        _check_end(given, end, diameter, raw, log)
    if given["end_a"] == given["end_b"]:
        _check_alike(given, ALIKE.get(given["end_a"], ()), raw, log)


def _compare(found, nominal, section, key, drawn, raw, log):
    """Compare a dimension with the drawing."""
    if None in (found, nominal) or abs(found - nominal) <= SIZE_MISS * nominal + SIZE_MISS_M:
        return
    text = message(
        "size_unlike_drawing",
        "{found_m:g} m, {drawn} is {nominal_m:g} m: they differ by {percent:+.1f} % (a radius, or"
        " another unit?)",
        found_m=found,
        drawn=drawn,
        nominal_m=nominal,
        percent=100 * (found / nominal - 1),
    )
    is_impossible = not 1 / (1 + IMPOSSIBLE_MISS) <= found / nominal <= 1 + IMPOSSIBLE_MISS
    tell(log.problem if is_impossible else log.warning, raw, section, key, text)


def _check_length(length, diameter, raw, log):
    ratio, (least, most) = length / diameter, LENGTH_OVER_DIAMETER
    if ratio > MOST_LENGTH_OVER_DIAMETER:
        text = message(
            "length_impossible",
            "found {found_m:g} m, {ratio:.3g} diameters; expected at most {most:g}: is it "
            "in decimetres?",
            found_m=length,
            ratio=ratio,
            most=MOST_LENGTH_OVER_DIAMETER,
        )
        tell(log.problem, raw, "horizontal", "length_m", text)
    elif not least <= ratio <= most:
        text = message(
            "length_strange",
            "{found_m:g} m is {ratio:.3g} diameters, expected {least:g} to {most:g}: is one of them"
            " in another unit, or a radius?",
            found_m=length,
            ratio=ratio,
            least=least,
            most=most,
        )
        tell(log.warning, raw, "horizontal", "length_m", text)


def _check_end(given, end, diameter, raw, log):
    form, key = given[f"end_{end}"], f"end_{end}_depth_m"
    if form in END_DEPTH and given[key] is not None:
        _check_depth("horizontal", key, given[key], form, diameter, raw, log)
    for name, (least, most) in RADII:
        radius = given[f"end_{end}_{name}"]
        if form == "torispherical" and radius is not None and not (
            least <= radius / diameter <= most
        ):  # fmt: skip
            text = message(
                "end_radius_strange",
                "{found_m:g} m is {ratio:.3g} diameters, expected {least:g} to {most:g}: is it the"
                " right radius, and is the diameter one?",
                found_m=radius,
                ratio=radius / diameter,
                least=least,
                most=most,
            )
            tell(log.warning, raw, "horizontal", f"end_{end}_{name}", text)


def _check_depth(section, key, depth, form, diameter, raw, log):
    (least, most), ratio = END_DEPTH[form], depth / diameter
    is_hemisphere = form == "spherical" and ratio >= HEMISPHERE
    if not least <= ratio <= most and not is_hemisphere:
        text = message(
            "end_depth_strange",
            "{found_m:g} m is {ratio:.3g} diameters, expected {least:g} to {most:g} for a"
            " {form} end: is it the depth, and of one end?",
            found_m=depth,
            ratio=ratio,
            least=least,
            most=most,
            form=form,
        )
        tell(log.warning, raw, section, key, text)


def _check_alike(given, sizes, raw, log):
    """Warn about different dimensions of two ends of one form."""
    for name in sizes:
        a, b = (given[f"end_{end}_{name}"] for end in "ab")
        if None in (a, b) or abs(a - b) < max(ENDS_DIFFER_M, (ENDS_DIFFER - 1) * min(a, b)):
            continue
        end, other = ("a", "b") if a > b else ("b", "a")
        text = message(
            "ends_differ",
            "{found_m:g} m, and {other_m:g} m at end {other}: expected equal ends where both "
            "have the same form",
            found_m=max(a, b),
            other=other.upper(),
            other_m=min(a, b),
        )
        tell(log.warning, raw, "horizontal", f"end_{end}_{name}", text)


def check_targets(values, tables, log):
    """Warn once about offsets that do not fit the kind of target.

    An offset is subtracted from every radius, and no reading of the survey contradicts it.
    """
    table = tables["targets"]
    if not has_rows(table):
        return
    kind = values["checks"]["targets"] or FLAT
    offset = np.nan_to_num(table.numbers("offset_mm"))
    least, most = TARGET_MM[kind]
    outliers = np.flatnonzero((offset < least) | (offset > most))
    if len(outliers) == 0:
        return
    worst = outliers[int(np.argmax(np.abs(offset[outliers])))]
    text = message(
        "target_offset_strange",
        "{found_mm:g} mm from the wall to the centre of the target, {count} targets of {all} so;"
        " expected {least_mm:g} to {most_mm:g} mm with checks.targets = {kind}: is it in another"
        " unit or the constant of a prism, or are the targets {other}?",
        found_mm=float(offset[worst]),
        count=len(outliers),
        all=len(offset),
        least_mm=least,
        most_mm=most,
        kind=kind,
        other=RAISED if kind == FLAT else FLAT,
    )
    log.warning(table.file, text, table.rows[worst], "offset_mm")
