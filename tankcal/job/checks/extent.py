"""Size of a tank before the calculation, and origin of its wall."""

from dataclasses import dataclass

import numpy as np

from tankcal.job.checking import has_rows, zero_z
from tankcal.job.contract.bottom import OF_CLOUD, rise_of_bottom
from tankcal.job.contract.observations import READINGS
from tankcal.job.contract.top import depth_of_top
from tankcal.job.entries import kind_of
from tankcal.methods.base import methods, methods_for


def has_survey(tables):
    """Return True if there are observations to be adjusted, readable or not."""
    return any(has_rows(tables[name]) for name in ("image_points", "stadia", *READINGS))


def is_strapped(tables):
    """Return True if circumferences of the tank were taped."""
    return has_rows(tables["circumferences"])


def tells_by_tape(tables):
    """Return True if circumferences determine the wall, not only as a check."""
    return is_strapped(tables) and any(use != "check" for use in tables["circumferences"].of("use"))


def is_supplemented(tables):
    """Return True if readings supplement a survey or the drawing, such as metered liquid."""
    return any(method.is_supplement and method.is_given(tables) for method in methods())


def is_surveyed(tables):
    """Return True if the wall of a vertical tank, or some of its courses, was measured."""
    return has_wall_points(tables) or is_strapped(tables)


def has_shape(tables):
    """Return True if measurements other than points.csv determine the wall of a vertical tank."""
    has_readings = has_survey(tables) or is_strapped(tables) or is_sighted(tables)
    return has_readings or any(method.replaces_points for method in _find_methods(tables))


def is_completed(tables):
    """Return True if a method supplies the courses that a survey does not measure."""
    return any(method.completes_survey for method in _find_methods(tables))


def has_inside_sizes(tables):
    """Return True if the only data of the wall are sizes of the inside."""
    return any(method.is_inside for method in _find_methods(tables)) and not is_surveyed(tables)


def _find_methods(tables):
    """Methods for vertical tanks that have readings in a job."""
    return [method for method in methods_for("vertical") if method.is_given(tables)]


def is_unsurveyed(tables):
    """Return True if only such readings and nominal dimensions determine the tank."""
    return is_supplemented(tables) and not is_surveyed(tables)


def is_sighted(tables):
    """Return True if sights without targets, or scans, determine the wall."""
    return any(sights_given(tables))


def sights_given(tables):
    """Return the names of the tables of sighting methods that have rows."""
    sighted = [method for method in methods() if method.is_sighted]
    return [method.readings_table for method in sighted if method.is_given(tables)]


def may_be_seen_from_both_sides(tables):
    """Return True if the sights of a method may be on both sides of the wall."""
    given = [method for method in methods() if method.is_given(tables)]
    return any(method.may_see_both_sides(tables) for method in given)


def has_wall_points(tables):
    """Return True if points, given, sighted or to be adjusted, determine the wall."""
    return has_rows(tables["points"]) or has_survey(tables) or is_sighted(tables)


def wall_of(tables):
    """Origin of the wall of a lying tank: "points", "straps", or None for its dimensions."""
    if has_wall_points(tables):
        return "points"
    of_wall = (method for method in methods_for("horizontal") if not method.is_supplement)
    is_measured = any(method.is_given(tables) for method in of_wall)
    return "straps" if is_strapped(tables) or is_measured else None


def estimate_diameter_m(kind, tables):
    """Approximate diameter of a tank of one solid from its readings, m; None if unknown."""
    given = (method for method in methods_for(kind) if method.is_given(tables))
    diameters = (method.estimate_diameter_m(tables) for method in given)
    return next((diameter for diameter in diameters if diameter is not None), None)


@dataclass(frozen=True)
class Extent:
    """Size of a tank known before the calculation; None: not known.

    Attributes
    ----------
    height_m : float or None
        Height from its lowest to its highest inside point at the dip point.
    lowest_m, top_m : float or None
        Dips of its lowest and highest inside points, from the zero of the table.
    area_m2 : float or None
        Largest free surface.
    """

    height_m: float | None = None
    lowest_m: float | None = None
    top_m: float | None = None
    area_m2: float | None = None


def extent_of(values, tables, kind):
    """Extent of a tank of this kind; unknown for a mesh and for an unknown kind."""
    if kind == "vertical":
        return _measure_vertical(values, tables["bottom"])
    if kind == "horizontal":
        return _measure_horizontal(values["horizontal"], values, wall_of(tables) is not None)
    if kind == "sphere":
        diameter = values["sphere"]["diameter_m"] or values["tank"]["nominal_diameter_m"]
        if diameter is None:
            diameter = estimate_diameter_m(kind, tables)
        area = None if diameter is None else np.pi / 4 * diameter**2
        return _lying(diameter, 0.0, area, values, has_wall_points(tables))
    return Extent()


def _measure_vertical(values, bottom):
    height, diameter = (values["tank"][f"nominal_{name}_m"] for name in ("height", "diameter"))
    shell_z, zero = values["datum"]["bottom_z_m"], zero_z(values)
    area = None if diameter is None else np.pi / 4 * diameter**2
    if None in (shell_z, zero):
        return Extent(height, area_m2=area)
    rise = rise_of_bottom(values)
    lowest = [shell_z - zero] if rise is None else [shell_z - zero, shell_z + rise - zero]
    if bottom is not None:
        lowest += [z - zero for z in bottom.of("z_m") if z is not None]
        lowest += [level for level in bottom.of("level_m") if level is not None]
    if values["bottom"]["form"] == OF_CLOUD and diameter is not None:
        from tankcal.clouds.inside.bottom import floor_reach

        lowest.append(
            shell_z - zero - floor_reach(diameter / 2)
        )  # depth to which scans are searched for the bottom
    depth = depth_of_top(values)
    top = None if None in (height, depth) else shell_z + height + depth - zero
    return Extent(height, min(lowest), top, area)


def _measure_horizontal(given, values, has_points):
    height = given["height_m"] or given["diameter_m"] or values["tank"]["nominal_diameter_m"]
    width = given["width_m"] or height
    length = given["length_m"]
    if None in (height, width, length):
        return Extent(height)
    # An end without a depth is taken as half a sphere.
    length += sum(given[f"end_{end}_depth_m"] or height / 2 for end in "ab")
    tilt = abs(given["tilt_mm_per_m"] or 0.0) / 1000
    return _lying(height, tilt * length, width * length, values, has_points)


def _lying(height, reach, area, values, has_points):
    """Extent of a lying tank or a sphere; reach: height of the ends above the dip point, m."""
    if height is None or has_points:
        return Extent(height, area_m2=area)
    zero = values["datum"]["dip_plate_z_m"] or 0.0
    return Extent(height, -reach - zero, height + reach - zero, area)


# ---- approximate volume below a dip from nominal dimensions, only for the detection of wrong


def volume_by_sizes(values, raw):
    """Function of a dip (m) that returns m3; None if nominal dimensions are missing."""
    kind = kind_of(raw)
    diameter = values["tank"]["nominal_diameter_m"]
    if kind == "vertical":
        area = None if diameter is None else np.pi / 4 * diameter**2
        shell, zero = values["datum"]["bottom_z_m"], zero_z(values)
        low = 0.0 if None in (shell, zero) else shell - zero
        return None if area is None else lambda dip: area * max(dip - low, 0.0)
    zero = values["datum"]["dip_plate_z_m"] or 0.0
    if kind == "sphere":
        diameter = values["sphere"]["diameter_m"] or diameter
        return None if diameter is None else lambda dip: _cap(dip + zero, diameter / 2)
    if kind == "horizontal":
        given = values["horizontal"]
        height = given["height_m"] or given["diameter_m"] or diameter
        width, length = given["width_m"] or height, given["length_m"]
        if None in (height, width, length):
            return None
        depths = sum(given[f"end_{end}_depth_m"] or 0.0 for end in "ab")
        section = width * (
            length + 2 / 3 * depths
        )  # half an ellipsoid has 2/3 of the volume of its cylinder
        return lambda dip: section * height / 4 * _segment((dip + zero) / height)
    return None


def _cap(depth, radius):
    depth = min(max(depth, 0.0), 2 * radius)
    return np.pi * depth**2 * (radius - depth / 3)


def _segment(fraction):
    """Area of a circle of diameter 2 below a fraction of its height."""
    half = np.arccos(1 - 2 * min(max(fraction, 0.0), 1.0))
    return float(half - np.sin(half) * np.cos(half))
