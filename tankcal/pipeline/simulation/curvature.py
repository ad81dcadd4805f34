"""Second derivatives of the volumes by the declared inputs, from the tank itself.

    H_ab u_a u_b = [J_b(x_a + u_a) - J_b(x_a - u_a)] u_b / 2

The slopes J_b are those of the tank with input a moved by its standard uncertainty, or at dips
moved by that of the datum. A scale s of surveyed lengths gives V = s^2 times the volume of a tank
with plates 1/s as thick. Its second derivatives are the first derivatives by the other inputs:
twice for temperature and level, once for lengths that do not grow with the scale.

Stated interval of each volume, whichever method determined it.

Each interval is checked when it is created, not when it is printed:

    low <= V <= high,  low < high wherever the law of propagation gives u > 0

Source: JCGM 101:2008 clause 8.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import ProgramError, SolutionError
from tankcal.pipeline.tanks import body_of
from tankcal.tank.heads import RADII
from tankcal.tank.parts import sum_derivatives
from tankcal.uncertainty import ROUNDING

# Inputs that can be moved in a job, so that the tank itself gives the change of its volumes.

VARIED = (
    "plate_thickness",
    "paint",
    "shell_temperature",
    "expansion",
    "youngs_modulus",
    "liquid_density",
    "survey_level",
    "survey_density",
    "diameter",
    "length",
    "end_depth",
    "tilt",
    "dip_position",
    "pressure",
    "survey_pressure",
    "dish",
    "knuckle",
    "tube_angle",
    "tube_offset",
    "bottom_depth",
    "top_depth",
)


def vary_input(job, name, change):
    """Job with `change` (SI) added to the input `name` of VARIED; None without such an input."""
    if name in _OF_VALUES:
        part, key = _OF_VALUES[name]
        return _vary_value(job, part, key, change)
    kind = "courses" if job.courses else "rings"
    parts, key = (
        getattr(job, kind),
        {"plate_thickness": "thickness_m", "paint": "paint_m"}.get(name),
    )
    if parts and key:
        parts = tuple(replace(part, **{key: getattr(part, key) + change}) for part in parts)
        moved = replace(job, **{kind: parts})
        is_whole = job.courses or name == "paint"
        return moved if is_whole else _vary_solid(moved, name, change)
    if job.tank.kind == "vertical":
        return _vary_head(job, name, change)
    if job.points is not None:
        return None if name != "plate_thickness" else _vary_solid(job, name, change)
    return _vary_solid(job, name, change)


_OF_VALUES = {
    "shell_temperature": ("survey", "shell_temperature_c"),
    "expansion": ("material", "expansion_per_k"),
    "youngs_modulus": ("material", "e_pa"),
    "liquid_density": ("table", "liquid_density_kg_m3"),
    "survey_level": ("survey", "liquid_level_m"),
    "survey_density": ("survey", "liquid_density_kg_m3"),
    "pressure": ("table", "pressure_pa"),
    "survey_pressure": ("survey", "pressure_pa"),
}


def _vary_head(job, name, change):
    """Job with a changed size of its bottom, of its top head, or of both, or None."""
    bottom, top = job.bottom, job.top
    if name == "bottom_depth" and bottom.centre_z_m is not None:
        is_below = bottom.centre_z_m < job.datum.bottom_z_m
        return _vary_value(job, "bottom", "centre_z_m", -change if is_below else change)
    if name == "top_depth" and top is not None and top.depth_m:
        return _vary_value(job, "top", "depth_m", change)
    if name not in RADII:
        return None
    key = _OF_ENDS[name]
    sized = {
        part: replace(head, **{key: getattr(head, key) + change})
        for part, head in (("bottom", bottom), ("top", top))
        if head is not None and getattr(head, key)
    }
    return replace(job, **sized) if sized else None


_ABSENT = ("tube_angle_rad", "tube_offset_m")  # 0 if not given


def _vary_solid(job, name, change):
    """Job with a changed size of its horizontal cylinder or sphere; None without such a size."""
    if job.sphere is not None:
        key = {"diameter": "diameter_m", "plate_thickness": "thickness_m"}.get(name)
        return None if key is None else _vary_value(job, "sphere", key, change)
    if job.horizontal is None:
        return None
    lying = job.horizontal
    if name == "diameter":
        wider = replace(lying, width_m=lying.width_m + change, height_m=lying.height_m + change)
        return replace(job, horizontal=wider)
    if name in _OF_ENDS:
        ends = {key: _vary_end(getattr(lying, key), name, change) for key in ("end_a", "end_b")}
        return None if None in ends.values() else replace(job, horizontal=replace(lying, **ends))
    keys = {
        "tube_angle": "tube_angle_rad",
        "tube_offset": "tube_offset_m",
        "plate_thickness": "thickness_m",
        "length": "length_m",
        "tilt": "tilt",
        "dip_position": "dip_from_a_m",
    }
    return _vary_value(job, "horizontal", keys[name], change) if name in keys else None


_OF_ENDS = {
    "end_depth": "depth_m",
    "dish": "dish_radius_m",
    "knuckle": "knuckle_radius_m",
}


def _vary_end(end, name, change):
    """End with a changed size; None for the depth of a torispherical end that radii define."""
    key = _OF_ENDS[name]
    size = getattr(end, key)
    if size:
        return replace(end, **{key: size + change})
    return None if end.kind == "torispherical" and name == "end_depth" else end


def _vary_value(job, part, key, change):
    """Job with `change` added to one value of a part; None if the value is not given."""
    part_of_job = getattr(job, part)
    if getattr(part_of_job, key) is None and key not in _ABSENT:
        return None
    return replace(
        job, **{part: replace(part_of_job, **{key: (getattr(part_of_job, key) or 0.0) + change})}
    )


# Number of rows at which curvatures are computed, and of these next to the empty tank.
PICKED, FROM_EMPTY = 400, 40
STEPS = (1.0, 1 / 4, 1 / 16)  # steps of an input in u, tried until such a tank exists
SMALLEST = 1e-4  # second derivative, relative to u of a row, that is neglected
BY_SCALE = {
    **dict.fromkeys(("scale", "offset", "barrel", "plate_thickness", "paint"), 1.0),
    **dict.fromkeys(("datum", "shell_temperature", "expansion"), 2.0),
}


@dataclass(frozen=True)
class Curvature:
    """Second derivatives of the rows, times both standard uncertainties.

    Attributes
    ----------
    pairs : tuple of (str, str), length k
        Names of the inputs.
    values : ndarray, shape (rows, k)
        Values, m3.
    """

    pairs: tuple[tuple[str, str], ...]
    values: np.ndarray


def curvature(job, survey, body, levels_m, declared, least_m3):
    """`Curvature` of the rows by pairs of declared inputs.

    Parameters
    ----------
    job : Job
    survey : Wall, Scan, mesh or None
    body : Body
    levels_m : ndarray, shape (rows,)
        Levels of the rows, m.
    declared : dict
        {name: u in SI units} of inputs with one column each.
    least_m3 : ndarray, shape (rows,)
        u of each row, m3. Second derivatives below 1e-4 of it in all rows are neglected.
    """
    chosen_rows = _pick_rows(len(levels_m))
    columns_by_pair = {}
    for name in declared:
        columns = _curvature_by_input(job, survey, body, levels_m, chosen_rows, name, declared)
        for other, column in columns.items():
            columns_by_pair.setdefault(tuple(sorted((name, other))), []).append(column)
    u_of_rows = np.where(least_m3 > 0, least_m3, np.inf)
    means = {pair: sum(columns) / len(columns) for pair, columns in columns_by_pair.items()}
    kept_pairs = [
        pair for pair, mean in means.items() if np.max(np.abs(mean) / u_of_rows) > SMALLEST
    ]
    values = np.stack([means[pair] for pair in kept_pairs], axis=1) if kept_pairs else None
    empty = np.empty((len(levels_m), 0))
    return Curvature(tuple(kept_pairs), empty if values is None else values)


def _curvature_by_input(job, survey, body, levels_m, picked, name, declared):
    """{other input: second derivatives (rows,), times both u} by one input."""
    if name == "datum":
        return _curvature_by_datum(body, levels_m, declared)
    if name == "scale":
        return _curvature_by_scale(body, levels_m, declared) if body.shell is not None else {}
    if name == "tilt" and body.shell is not None:
        in_shell = np.minimum(levels_m, body.shell.volume.height_m)
        return {"tilt": body.shell.volume_m3(in_shell) * declared["tilt"] ** 2}
    if name not in VARIED:
        return {}
    for share in STEPS:
        try:
            # Smaller steps if a tank with the full step does not exist.
            ends = _slopes_of_moved(job, survey, levels_m[picked], name, share * declared[name])
        except SolutionError:  # no such tank exists, so such an error is impossible
            continue
        break
    else:
        return {}
    if ends is None:
        return {}
    place = np.arange(len(levels_m))
    return {
        other: np.interp(place, picked, (ends[0][other] - ends[1][other]) / (2 * share) * u)
        for other, u in declared.items()
        if other in ends[0] and other != "datum" and other != "scale"
    }


def _slopes_of_moved(job, survey, levels_m, name, step):
    """Derivatives of the tank with the input a step up and a step down; None without the input."""
    jobs = [vary_input(job, name, sign * step) for sign in (1, -1)]
    if None in jobs:
        return None
    tanks = [body_of(moved, survey, uncertain=False) for moved in jobs]
    return [tank.derivatives(np.minimum(levels_m, tank.highest_m)) for tank in tanks]


def _curvature_by_datum(body, levels_m, declared):
    """Second derivatives by the datum and each other input.

    Parts that move with the dips, such as deadwood, have none by the datum.
    """
    u = declared["datum"]
    upper_m = np.minimum(levels_m + u, body.highest_m)
    lower_m = np.maximum(levels_m - u, body.lowest_m)
    moving = [part for part in body.parts if not part.moves_with_zero]
    ends = [
        sum_derivatives(part.derivatives(levels) for part in moving)
        for levels in (upper_m, lower_m)
    ]
    span = np.where(upper_m > lower_m, (upper_m - lower_m) / u, 1.0)
    return {
        other: (ends[0][other] - ends[1][other]) / span * u_other
        for other, u_other in declared.items()
        if other in ends[0]
    }


def _curvature_by_scale(body, levels_m, declared):
    """Second derivatives by the scale and each other input."""
    slopes = body.derivatives(levels_m)
    return {
        other: multiplier * slopes[other] * declared[other] * declared["scale"]
        for other, multiplier in BY_SCALE.items()
        if other in declared and other in slopes
    }


def _pick_rows(rows):
    spread = np.linspace(0, rows - 1, min(rows, PICKED)).round().astype(int)
    return np.unique([*range(min(rows, FROM_EMPTY)), *spread])


# ---- stated interval of each volume, whichever method determined it


@dataclass(frozen=True)
class Intervals:
    """Stated interval and U of each volume, shape (rows,).

    Attributes
    ----------
    low_m3, high_m3 : ndarray
        Ends of the interval, m3.
    by_gum : ndarray of bool
        True: volume +- k u. False: Monte Carlo interval, where the propagation is not validated.
    U_m3 : ndarray
        U of the law of propagation, or the larger distance of the Monte Carlo ends from the volume,
        m3.
    """

    low_m3: np.ndarray
    high_m3: np.ndarray
    by_gum: np.ndarray
    U_m3: np.ndarray


def gum_intervals(volume_m3, u_m3, U_m3):
    """`Intervals` V +- U of volumes that were not simulated, from arrays of shape (rows,), m3.

    Raises ProgramError for an inconsistent interval.
    """
    intervals = Intervals(volume_m3 - U_m3, volume_m3 + U_m3, np.full(len(U_m3), True), U_m3)
    return check_intervals(intervals, volume_m3, u_m3)


def judged_intervals(judged, volume_m3, u_m3, U_m3, least_m3=-np.inf):
    """`Intervals` of simulated volumes: V +- U if validated, otherwise the Monte Carlo interval.

    V +- U is also replaced if it reaches below `least_m3`. A strong curvature moves the
    distribution away from the volume at the estimates. If the Monte Carlo interval excludes that
    volume, the interval is extended to it. The stated value is then inside, and a longer interval
    does not reduce the coverage.

    Parameters
    ----------
    judged : monte_carlo.Verdict
        Verdict on the volumes.
    volume_m3, u_m3, U_m3 : ndarray, shape (rows,)
        Volumes, standard and expanded uncertainties, m3.
    least_m3 : float
        Lower bound of a Monte Carlo interval, m3; the volume of a tank is not negative.

    Raises
    ------
    ProgramError
        For an inconsistent interval.
    """
    # An interval of the law of propagation must not reach below the least volume: of a validated
    # row, the simulation confirms the upper end.
    rounding_m3 = ROUNDING * np.max(np.abs(volume_m3), initial=0.0)
    by_gum = judged.validated & (judged.low >= least_m3 - rounding_m3)
    low = np.where(by_gum, judged.low, np.maximum(judged.low, least_m3))
    intervals = Intervals(low, judged.high, by_gum, judged.stated(volume_m3, U_m3))
    _refuse_without_width(intervals, volume_m3, u_m3)  # check before an end is moved
    low, high = np.minimum(low, volume_m3), np.maximum(judged.high, volume_m3)
    return check_intervals(Intervals(low, high, by_gum, intervals.U_m3), volume_m3, u_m3)


def check_intervals(intervals, volume_m3, u_m3):
    """Return the `Intervals`; raise ProgramError for an interval that excludes its volume."""
    low, high = intervals.low_m3, intervals.high_m3
    outside = ~((low <= volume_m3) & (volume_m3 <= high))
    _refuse(outside, intervals, volume_m3, u_m3)
    _refuse_without_width(intervals, volume_m3, u_m3)
    return intervals


def _refuse_without_width(intervals, volume_m3, u_m3):
    # Relative to the largest volume: that of the empty tank is a difference with rounding errors.
    """Raise ProgramError for intervals of zero width with a significant standard uncertainty."""
    varies = u_m3 > ROUNDING * np.max(np.abs(volume_m3), initial=0.0)
    _refuse(varies & ~(intervals.low_m3 < intervals.high_m3), intervals, volume_m3, u_m3)


def _refuse(wrong, intervals, volume_m3, u_m3):
    """Raise ProgramError for the first wrong interval."""
    if np.any(wrong):
        row = int(np.argmax(wrong))
        low, high = intervals.low_m3[row], intervals.high_m3[row]
        raise ProgramError(
            f"volume {row + 1} of {len(wrong)}, {volume_m3[row]:.6f} m3 with u = {u_m3[row]:.2g} "
            f"m3, has the interval from {low:.6f} to {high:.6f} m3"
        )
