"""Plumbness and roundness of a wall, from its shape in a record.

The place with the largest `verdict.severity` decides a check: a tank passes only if all its places
pass.
"""

from dataclasses import dataclass
from math import atan2, degrees, hypot

import numpy as np

from tankcal.gum.conformity import severity
from tankcal.products.inspection.rules import PROBABILITY, Figure, limit_of
from tankcal.record.inspection import Generatrices, InspectedLevel
from tankcal.uncertainty import coverage_factor

WALL_CHECKS = (
    "plumbness_axis", "plumbness_generatrix", "plumbness_course", "roundness_low",
    "roundness_high",
)  # fmt: skip


LEAST_READ = 8  # number of generatrices with readings at both ends, from which others are omitted


@dataclass(frozen=True)
class Sizes:
    """Nominal sizes of a tank for the checks of its wall.

    Attributes
    ----------
    nominal_radius_m : float or None
        Radius that the measured radii are compared with, m; None for their mean.
    height_m : float
        Height of the shell, m.
    courses_m : tuple of float
        Heights of the courses, m.
    diameter_m : float or None
        Nominal diameter that determines limits, m; None if not given.
    """

    nominal_radius_m: float | None
    height_m: float
    courses_m: tuple[float, ...]
    diameter_m: float | None = None


@dataclass(frozen=True)
class Spread:
    """Values at n places with expanded uncertainty, coverage factor and degrees of freedom."""

    value: np.ndarray
    U: np.ndarray
    k: np.ndarray
    dof: np.ndarray

    def times(self, factor):
        """Values and expanded uncertainties times a factor."""
        return Spread(factor * self.value, factor * self.U, self.k, self.dof)

    def at(self, place):
        """Value, U, k and degrees of freedom at a place, as arguments of a `Figure`."""
        return {
            "value": float(self.value[place]),
            "U": float(self.U[place]),
            "k": float(self.k[place]),
            "dof": float(self.dof[place]),
        }


def spread_of(value, u, dof):
    """Build a `Spread`.

    Parameters
    ----------
    value, u : sequence of float, length n
        Values and standard uncertainties, in the same unit.
    dof : sequence of float or None, length n
        Degrees of freedom; None for infinite.
    """
    dof = np.array([np.inf if nu is None else nu for nu in dof], dtype=float)
    k = coverage_factor(PROBABILITY, dof)
    return Spread(np.array(value, dtype=float), k * np.array(u, dtype=float), k, dof)


def deciding_place(value, U, limit):
    """Index of the place that decides a check of many places.

    Parameters
    ----------
    value, U : ndarray, shape (n,)
        Values and expanded uncertainties, in the unit of the limit.
    limit : float or None
        Limit of the check; None for no limit.

    Returns
    -------
    int

    Examples
    --------
    >>> values, U = np.array([3.0, -7.0, 6.5]), np.array([1.0, 1.0, 2.0])
    >>> [deciding_place(values, U, limit) for limit in (6.0, 9.0, None)]
    [1, 2, 1]
    """
    return max(range(len(value)), key=lambda i: severity(value[i], U[i], limit))


def inspect_shape(shape, sizes, rule):
    """Compute the figures of plumbness and roundness, and the data of their charts.

    Parameters
    ----------
    shape : dict
        A `record.wall_shape.WallShapeRecord` as plain data.
    sizes : Sizes
        Nominal sizes of the tank.
    rule : rules.Rule or None
        Rule with the limits.

    Returns
    -------
    figures : list of Figure
        Each of WALL_CHECKS, in their order.
    generatrices : Generatrices or None
        None if fewer than two levels have a known centre.
    levels : list of InspectedLevel
        Radii of all levels.
    """
    levels = [_level(level, sizes.nominal_radius_m) for level in shape["levels"]]
    figures = [
        _axis(shape["axis"], sizes, rule),
        _generatrix(shape, sizes, rule),
        _courses(shape, sizes, rule),
        _roundness("roundness_low", shape, sizes, rule),
        _roundness("roundness_high", shape, sizes, rule),
    ]
    return figures, _generatrices(shape), levels


def empty_wall_figures(rule, sizes, remark):
    """Figures of the checks of a wall that was not surveyed, without values."""
    return [_empty_figure(code, _limit(rule, code, sizes), remark) for code in WALL_CHECKS]


def _limit(rule, code, sizes, course=None):
    """Limit of a check; the limit of a course depends on the height of this course."""
    height = sizes.height_m
    if code == "plumbness_course":
        height = None if course is None else sizes.courses_m[course - 1]
    return limit_of(rule, code, diameter_m=sizes.diameter_m, height_m=height)


def _empty_figure(code, limit, remark):
    """Figure without a value."""
    return Figure(
        code=code, unit="mm", value=None, U=None, k=None, dof=np.inf, limit=limit, remark=remark
    )


# ---- plumbness


def _axis(axis, sizes, rule):
    """Figure of the axis: offset of the top centre from the bottom centre, over the shell."""
    # The offset between two levels is extrapolated to the height of the shell.
    limit = _limit(rule, "plumbness_axis", sizes)
    if axis is None:
        return _empty_figure("plumbness_axis", limit, "one_level")
    distance_m = axis["high_m"] - axis["low_m"]
    offset = spread_of([hypot(axis["x_mm"], axis["y_mm"])], [axis["u_mm"]], [axis["dof"]])
    offset = offset.times(sizes.height_m / distance_m)
    azimuth_deg = degrees(atan2(axis["x_mm"], axis["y_mm"])) % 360
    return Figure(
        code="plumbness_axis",
        unit="mm",
        **offset.at(0),
        limit=limit,
        azimuth_deg=azimuth_deg,
        used=2,
        **_lean_remark(offset.value[0], sizes.height_m, axis),
    )


def _generatrix(shape, sizes, rule):
    """Figure of the generatrices: offset of the top from the bottom, over the shell."""
    limit = _limit(rule, "plumbness_generatrix", sizes)
    if not shape["plumbs"]:
        return _empty_figure("plumbness_generatrix", limit, "one_level")
    top = shape["plumbs"][-1]
    return _plumb_figure("plumbness_generatrix", top, sizes.height_m, limit)


def _courses(shape, sizes, rule):
    """Figure of the deciding course: offset of the top of its generatrices from the bottom."""
    figures = []
    for item in shape["courses"]:
        limit = _limit(rule, "plumbness_course", sizes, item["course"])
        height = sizes.courses_m[item["course"] - 1]
        figures.append(_plumb_figure("plumbness_course", item, height, limit, item["course"]))
    if not figures:
        return _empty_figure("plumbness_course", None, "one_level_a_course")
    used = sum(item.used for item in figures)
    worst = max(
        figures, key=lambda item: severity(item.value, item.U, item.limit and item.limit.value)
    )
    return Figure(**(vars(worst) | {"used": used}))


def _plumb_figure(code, plumb, height_m, limit, course=None):
    """Figure of the deciding generatrix between two levels, extrapolated to `height_m`."""
    distance_m = plumb["high_m"] - plumb["low_m"]
    chosen = np.array(plumb["is_read"], dtype=bool)
    # With enough generatrices that have readings, interpolated generatrices are omitted.
    if np.count_nonzero(chosen) < LEAST_READ:
        chosen[:] = True
    rows = [[plumb[name][i] for i in np.flatnonzero(chosen)]
            for name in ("azimuth_deg", "departure_mm", "u_mm", "dof")]  # fmt: skip
    azimuth_deg, departures = rows[0], spread_of(*rows[1:]).times(height_m / distance_m)
    place = deciding_place(departures.value, departures.U, limit and limit.value)
    return Figure(
        code=code,
        unit="mm",
        **departures.at(place),
        limit=limit,
        course=course,
        azimuth_deg=azimuth_deg[place] % 360,
        used=len(departures.value),
        **_lean_remark(departures.value[place], height_m, plumb),
    )


def _lean_remark(value_mm, height_m, levels):
    """Remark with the two levels, the tilt in mm per metre, and the tilt as 1 in n."""
    per_m = float(value_mm) / height_m
    one_in = 1000 / abs(per_m) if per_m else None
    values = {"low_m": levels["low_m"], "high_m": levels["high_m"], "mm_per_m": per_m,
              "one_in": one_in, "over_m": height_m}  # fmt: skip
    return {"remark": "plumb_between", "remark_values": values}


def _generatrices(shape):
    """`Generatrices` of all levels with a centre, relative to the lowest of these levels."""
    if not shape["plumbs"]:
        return None
    course_by_height = {item["height_m"]: item["course"] for item in shape["levels"]}
    low = shape["plumbs"][0]["low_m"]
    rows = [spread_of(item["departure_mm"], item["u_mm"], item["dof"]) for item in shape["plumbs"]]
    heights = [low, *(item["high_m"] for item in shape["plumbs"])]
    azimuth = shape["plumbs"][0]["azimuth_deg"]
    zeros = np.zeros(len(azimuth))
    return Generatrices(
        azimuth_deg=[item % 360 for item in azimuth],
        height_m=heights,
        course=[course_by_height[item] for item in heights],
        departure_mm=[zeros, *(item.value for item in rows)],
        U_mm=[zeros, *(item.U for item in rows)],
    )


# ---- roundness


def _departures(level, nominal_m):
    """`Spread` of the radii of a level less the nominal radius, or less their mean for None, mm."""
    radius = np.array(level["radius_m"])
    nominal_m = radius.mean() if nominal_m is None else nominal_m
    return spread_of(1000 * (radius - nominal_m), level["u_mm"], level["dof"])


def _level(level, nominal_m):
    """`InspectedLevel` of a level of the shape."""
    departures = _departures(level, nominal_m)
    return InspectedLevel(
        height_m=level["height_m"],
        course=level["course"],
        mean_radius_m=float(np.mean(level["radius_m"])),
        centre_x_m=level["centre_x_m"],
        centre_y_m=level["centre_y_m"],
        azimuth_deg=[angle % 360 for angle in level["azimuth_deg"]],
        departure_mm=departures.value,
        U_mm=departures.U,
    )


def _roundness(code, shape, sizes, rule):
    """Figure of the roundness of the low levels, or of all higher levels."""
    is_low = code == "roundness_low"
    limit = _limit(rule, code, sizes)
    levels = [item for item in shape["levels"] if item["is_low"] == is_low]
    if not levels:
        return _empty_figure(code, limit, "no_level_there")
    spreads = [_departures(item, sizes.nominal_radius_m) for item in levels]
    whole = Spread(*(np.concatenate([getattr(item, name) for item in spreads])
                     for name in ("value", "U", "k", "dof")))  # fmt: skip
    place = deciding_place(whole.value, whole.U, limit and limit.value)
    places = [(item, azimuth) for item in levels for azimuth in item["azimuth_deg"]]
    level, azimuth = places[place]
    # A low level without a centre was estimated from the levels above it.
    is_measured = level["centre_x_m"] is not None or not is_low
    mean = 1000 * (np.mean(level["radius_m"]) - (sizes.nominal_radius_m or 0.0))
    remark = {}
    higher = [item["height_m"] for item in shape["levels"] if not item["is_low"]]
    if not is_measured and higher:
        nearest = min(higher, key=lambda height: abs(height - level["height_m"]))
        remark = {"remark": "low_level_estimated", "remark_values": {"nearest_m": nearest}}
    elif is_measured and sizes.nominal_radius_m is not None:
        remark = {"remark": "mean_departure", "remark_values": {"mean_mm": float(mean)}}
    return Figure(
        code=code,
        unit="mm",
        **whole.at(place),
        limit=limit,
        course=level["course"],
        height_m=level["height_m"],
        azimuth_deg=azimuth % 360,
        used=len(whole.value),
        **remark,
    )
