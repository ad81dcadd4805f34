"""How large a tank is before anything is computed, and where its wall comes from."""

from dataclasses import dataclass

import numpy as np

from tankcal.job.checking import has_rows, zero_z
from tankcal.job.contract.bottom import OF_CLOUD, rise_of_bottom
from tankcal.job.contract.observations import READINGS
from tankcal.job.contract.top import depth_of_top


def has_survey(tables):
    """Are there observations to be adjusted, readable or not?"""
    return any(has_rows(tables[name]) for name in ("image_points", "stadia", *READINGS))


def is_strapped(tables):
    """Was a tape put round the tank?"""
    return has_rows(tables["circumferences"])


def tells_by_tape(tables):
    """Does a tape tell something of the wall, other than to be compared with it?"""
    return is_strapped(tables) and any(use != "check" for use in tables["circumferences"].of("use"))


def has_hits(tables):
    """Was the bare wall hit by a total station?"""
    return has_rows(tables["wall_hits"])


def has_tangents(tables):
    """Were the limbs of the tank sighted from a traverse round it?"""
    return has_rows(tables["tangents"])


def has_clouds(tables):
    """Was the wall scanned?"""
    return has_rows(tables.get("clouds"))


def is_metered(tables):
    """Was metered liquid filled in, or drawn off, between dips?"""
    return has_rows(tables.get("liquid"))


def has_great_circles(tables):
    """Was a tape put round a sphere?"""
    return has_rows(tables.get("great_circles"))


def has_radii(tables):
    """Are there radii of a former table, a record or a declaration?"""
    return has_rows(tables.get("radii"))


def is_surveyed(tables):
    """Did somebody measure the wall of an upright tank, or some courses of it?"""
    return has_wall_points(tables) or is_strapped(tables)


def has_radii_alone(tables):
    """Is nothing but declared radii known of the wall?"""
    return has_radii(tables) and not is_surveyed(tables)


def is_metered_alone(tables):
    """Is liquid all that tells the tank, beside the sizes of its drawing?"""
    return is_metered(tables) and not is_surveyed(tables)


def is_sighted(tables):
    """Does the wall come from sights that name no target, or from scans?"""
    return has_hits(tables) or has_tangents(tables) or has_clouds(tables)


def may_be_hit_from_both_sides(tables):
    """Are there hits from more set-ups than one, which may stand in and round the tank?"""
    return has_hits(tables) and len(set(tables["wall_hits"].of("setup"))) > 1


def has_wall_points(tables):
    """Does the wall come from points, handed in, sighted or to be adjusted?"""
    return has_rows(tables["points"]) or has_survey(tables) or is_sighted(tables)


def wall_of(tables):
    """What the wall of a lying tank comes from: "points", "straps", or None: its sizes alone."""
    if has_wall_points(tables):
        return "points"
    return "straps" if is_strapped(tables) or has_rows(tables.get("rings")) else None


def height_of_rings(tables):
    """About the inside diameter of strapped rings, m; None: nothing tells it."""
    if not is_strapped(tables) or not has_rows(tables.get("rings")):
        return None
    readings = [one for one in tables["circumferences"].of("reading_m") if one is not None]
    plates = [one for one in tables["rings"].of("thickness_mm") if one is not None]
    if not readings:
        return None
    return float(np.median(readings) / np.pi - 2e-3 * (np.median(plates) if plates else 0.0))


@dataclass(frozen=True)
class Extent:
    """What is known of a tank's size before anything is computed; None: not known.

    height_m          from its lowest to its highest inside point at the dip point
    lowest_m, top_m   dips of its lowest and highest inside points, from the table's zero
    area_m2           the largest free surface
    """

    height_m: float | None = None
    lowest_m: float | None = None
    top_m: float | None = None
    area_m2: float | None = None


def extent_of(values, tables, kind):
    """The Extent of a tank of the kind; nothing is known of a mesh, or of an unknown kind."""
    if kind == "vertical":
        return _of_vertical(values, tables["bottom"])
    if kind == "horizontal":
        return _of_horizontal(values["horizontal"], values, wall_of(tables) is not None)
    if kind == "sphere":
        diameter = values["sphere"]["diameter_m"] or values["tank"]["nominal_diameter_m"]
        if diameter is None and has_great_circles(tables):
            readings = tables["great_circles"].numbers("reading_m")
            diameter = np.nanmedian(readings) / np.pi if np.any(readings > 0) else None
        area = None if diameter is None else np.pi / 4 * diameter**2
        return _lying(diameter, 0.0, area, values, has_wall_points(tables))
    return Extent()


def _of_vertical(values, bottom):
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
        from tankcal.clouds.inside.floor_cells import reach_of_floor

        lowest.append(shell_z - zero - reach_of_floor(diameter / 2))  # how deep it is looked for
    over = depth_of_top(values)
    top = None if None in (height, over) else shell_z + height + over - zero
    return Extent(height, min(lowest), top, area)


def _of_horizontal(given, values, has_points):
    height = given["height_m"] or given["diameter_m"] or values["tank"]["nominal_diameter_m"]
    width = given["width_m"] or height
    length = given["length_m"]
    if None in (height, width, length):
        return Extent(height)
    length += sum(given[f"end_{end}_depth_m"] or height / 2 for end in "ab")
    tilt = abs(given["tilt_mm_per_m"] or 0.0) / 1000
    return _lying(height, tilt * length, width * length, values, has_points)


def _lying(height, reach, area, values, has_points):
    """reach: how much the ends may lie above or below the place of the dip point, m."""
    if height is None or has_points:
        return Extent(height, area_m2=area)
    zero = values["datum"]["dip_plate_z_m"] or 0.0
    return Extent(height, -reach - zero, height + reach - zero, area)
