"""Plumb and roundness of a wall, out of the shape that a record keeps of it.

The gravest place decides a check (`verdict.gravity`): a tank passes only where every place does.
"""

from dataclasses import dataclass
from math import atan2, degrees, hypot

import numpy as np

from tankcal.inspection.figures import PROBABILITY, Figure
from tankcal.inspection.rules import limit_of
from tankcal.inspection.verdict import gravity
from tankcal.record.inspection import Generatrices, InspectedLevel
from tankcal.uncertainty import coverage_factor

WALL_CHECKS = (
    "plumbness_axis", "plumbness_generatrix", "plumbness_course", "roundness_low",
    "roundness_high",
)  # fmt: skip


LEAST_READ = 8  # generatrices with a reading at both ends, that others are left out for


@dataclass(frozen=True)
class Sizes:
    """Sizes of a tank that its wall is judged by.

    Attributes
    ----------
    nominal_radius_m : float or None
        That the radii are compared with; None: their mean.
    height_m : float
        Of the shell.
    courses_m : tuple of float
        Heights of the courses.
    diameter_m : float or None
        Nominal, that limits go by; None: not given.
    """

    nominal_radius_m: float | None
    height_m: float
    courses_m: tuple[float, ...]
    diameter_m: float | None = None


@dataclass(frozen=True)
class Spread:
    """Values at many places, with their expanded uncertainty and its coverage factor."""

    value: np.ndarray
    U: np.ndarray
    k: np.ndarray
    dof: np.ndarray

    def times(self, factor):
        """The same by a factor."""
        return Spread(factor * self.value, factor * self.U, self.k, self.dof)


def spread_of(value, u, dof):
    """`Spread` of values, standard uncertainties and degrees of freedom (None: infinite)."""
    dof = np.array([np.inf if one is None else one for one in dof], dtype=float)
    k = coverage_factor(PROBABILITY, dof)
    return Spread(np.array(value, dtype=float), k * np.array(u, dtype=float), k, dof)


def deciding_place(value, U, limit):
    """Index of the place that decides a check of many.

    Parameters
    ----------
    value, U : ndarray, shape (n,)
    limit : float or None

    Examples
    --------
    >>> values, U = np.array([3.0, -7.0, 6.5]), np.array([1.0, 1.0, 2.0])
    >>> [deciding_place(values, U, one) for one in (6.0, 9.0, None)]
    [1, 2, 1]
    """
    return max(range(len(value)), key=lambda i: gravity(value[i], U[i], limit))


def inspect_shape(shape, sizes, rule):
    """Figures of plumb and roundness, and what is drawn of them.

    Parameters
    ----------
    shape : dict
        A `record.wall_shape.WallShapeRecord` as plain data.
    sizes : Sizes
    rule : rules.Rule or None

    Returns
    -------
    figures : list of Figure
        Each of WALL_CHECKS, in their order.
    generatrices : Generatrices or None
        None: no two levels have a known centre.
    levels : list of InspectedLevel
    """
    levels = [_level(one, sizes.nominal_radius_m) for one in shape["levels"]]
    found = [
        _axis(shape["axis"], sizes, rule),
        _generatrix(shape, sizes, rule),
        _courses(shape, sizes, rule),
        _roundness("roundness_low", shape, sizes, rule),
        _roundness("roundness_high", shape, sizes, rule),
    ]
    return found, _generatrices(shape), levels


def not_surveyed(rule, sizes, remark):
    """Figures of the checks of a wall that nothing is known of."""
    return [_undetermined(code, _limit(rule, code, sizes), remark) for code in WALL_CHECKS]


def _limit(rule, code, sizes, course=None):
    """Limit of a check; of a course by its own height."""
    height = sizes.height_m
    if code == "plumbness_course":
        height = None if course is None else sizes.courses_m[course - 1]
    return limit_of(rule, code, diameter_m=sizes.diameter_m, height_m=height)


def _undetermined(code, limit, remark):
    return Figure(
        code=code, unit="mm", value=None, U=None, k=None, dof=np.inf, limit=limit, remark=remark
    )


# ---- the plumb


def _axis(axis, sizes, rule):
    """The centre of the top against that of the bottom, over the height of the shell."""
    limit = _limit(rule, "plumbness_axis", sizes)
    if axis is None:
        return _undetermined("plumbness_axis", limit, "one_level")
    over = axis["high_m"] - axis["low_m"]
    size = spread_of([hypot(axis["x_mm"], axis["y_mm"])], [axis["u_mm"]], [axis["dof"]])
    size = size.times(sizes.height_m / over)
    towards = degrees(atan2(axis["x_mm"], axis["y_mm"])) % 360
    return Figure(
        code="plumbness_axis",
        unit="mm",
        **_at(size, 0),
        limit=limit,
        azimuth_deg=towards,
        used=2,
        **_lean(size.value[0], sizes.height_m, axis),
    )


def _generatrix(shape, sizes, rule):
    """The top of each generatrix against its bottom, over the height of the shell."""
    limit = _limit(rule, "plumbness_generatrix", sizes)
    if not shape["plumbs"]:
        return _undetermined("plumbness_generatrix", limit, "one_level")
    top = shape["plumbs"][-1]
    return _of_plumb("plumbness_generatrix", top, sizes.height_m, limit)


def _courses(shape, sizes, rule):
    """The worst course: the top of each of its generatrices against its bottom, over its height."""
    found = []
    for one in shape["courses"]:
        limit = _limit(rule, "plumbness_course", sizes, one["course"])
        height = sizes.courses_m[one["course"] - 1]
        found.append(_of_plumb("plumbness_course", one, height, limit, one["course"]))
    if not found:
        return _undetermined("plumbness_course", None, "one_level_a_course")
    used = sum(one.used for one in found)
    worst = max(found, key=lambda one: gravity(one.value, one.U, one.limit and one.limit.value))
    return Figure(**(vars(worst) | {"used": used}))


def _of_plumb(code, plumb, height_m, limit, course=None):
    over = plumb["high_m"] - plumb["low_m"]
    chosen = np.array(plumb["is_read"], dtype=bool)
    if np.count_nonzero(chosen) < LEAST_READ:  # else what a level does between readings is no part
        chosen[:] = True
    rows = [[plumb[name][i] for i in np.flatnonzero(chosen)]
            for name in ("azimuth_deg", "departure_mm", "u_mm", "dof")]  # fmt: skip
    azimuth_deg, found = rows[0], spread_of(*rows[1:]).times(height_m / over)
    place = deciding_place(found.value, found.U, limit and limit.value)
    return Figure(
        code=code,
        unit="mm",
        **_at(found, place),
        limit=limit,
        course=course,
        azimuth_deg=azimuth_deg[place] % 360,
        used=len(found.value),
        **_lean(found.value[place], height_m, plumb),
    )


def _lean(value_mm, height_m, levels):
    """Remark: between which levels, per metre, and one in how much."""
    per_m = float(value_mm) / height_m
    one_in = 1000 / abs(per_m) if per_m else None
    values = {"low_m": levels["low_m"], "high_m": levels["high_m"], "mm_per_m": per_m,
              "one_in": one_in, "over_m": height_m}  # fmt: skip
    return {"remark": "plumb_between", "remark_values": values}


def _at(spread, place):
    """Value, U, k and degrees of freedom at a place."""
    return {
        "value": float(spread.value[place]),
        "U": float(spread.U[place]),
        "k": float(spread.k[place]),
        "dof": float(spread.dof[place]),
    }


def _generatrices(shape):
    """`Generatrices` of all levels with a centre, the lowest of them the plumb of all."""
    if not shape["plumbs"]:
        return None
    of_height = {one["height_m"]: one["course"] for one in shape["levels"]}
    low = shape["plumbs"][0]["low_m"]
    rows = [spread_of(one["departure_mm"], one["u_mm"], one["dof"]) for one in shape["plumbs"]]
    heights = [low, *(one["high_m"] for one in shape["plumbs"])]
    azimuth = shape["plumbs"][0]["azimuth_deg"]
    nothing = np.zeros(len(azimuth))
    return Generatrices(
        azimuth_deg=[one % 360 for one in azimuth],
        height_m=heights,
        course=[of_height[one] for one in heights],
        departure_mm=[nothing, *(one.value for one in rows)],
        U_mm=[nothing, *(one.U for one in rows)],
    )


# ---- roundness


def _departures(level, nominal_m):
    """`Spread` of the radii of a level less the nominal one, mm; None: less their mean."""
    radius = np.array(level["radius_m"])
    nominal_m = radius.mean() if nominal_m is None else nominal_m
    return spread_of(1000 * (radius - nominal_m), level["u_mm"], level["dof"])


def _level(level, nominal_m):
    found = _departures(level, nominal_m)
    return InspectedLevel(
        height_m=level["height_m"],
        course=level["course"],
        mean_radius_m=float(np.mean(level["radius_m"])),
        centre_x_m=level["centre_x_m"],
        centre_y_m=level["centre_y_m"],
        azimuth_deg=[one % 360 for one in level["azimuth_deg"]],
        departure_mm=found.value,
        U_mm=found.U,
    )


def _roundness(code, shape, sizes, rule):
    is_low = code == "roundness_low"
    limit = _limit(rule, code, sizes)
    levels = [one for one in shape["levels"] if one["is_low"] == is_low]
    if not levels:
        return _undetermined(code, limit, "no_level_there")
    every = [_departures(one, sizes.nominal_radius_m) for one in levels]
    whole = Spread(*(np.concatenate([getattr(one, name) for one in every])
                     for name in ("value", "U", "k", "dof")))  # fmt: skip
    place = deciding_place(whole.value, whole.U, limit and limit.value)
    at = [(one, azimuth) for one in levels for azimuth in one["azimuth_deg"]]
    level, azimuth = at[place]
    is_measured = level["centre_x_m"] is not None or not is_low
    mean = 1000 * (np.mean(level["radius_m"]) - (sizes.nominal_radius_m or 0.0))
    remark = {}
    if not is_measured:
        nearest = min((one["height_m"] for one in shape["levels"] if not one["is_low"]),
                      key=lambda height: abs(height - level["height_m"]))  # fmt: skip
        remark = {"remark": "low_level_estimated", "remark_values": {"nearest_m": nearest}}
    elif sizes.nominal_radius_m is not None:
        remark = {"remark": "mean_departure", "remark_values": {"mean_mm": float(mean)}}
    return Figure(
        code=code,
        unit="mm",
        **_at(whole, place),
        limit=limit,
        course=level["course"],
        height_m=level["height_m"],
        azimuth_deg=azimuth % 360,
        used=len(whole.value),
        **remark,
    )
