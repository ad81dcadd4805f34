"""Checks of the whole table: units, total and last row compared with the nominal tank."""

from dataclasses import dataclass
from itertools import product
from math import log10, pi, sqrt

from tankcal.messages import message

_USUAL_HEIGHT_UNITS_M, _USUAL_VOLUME_UNITS_M3 = [1.0, 0.01, 0.001], [1.0, 0.001]
_LEAST_VOLUME = 1e-9  # avoids division by zero for an empty table
_LOWEST_M, _HIGHEST_M = 0.5, 40.0  # range of usual tank heights
_SLIMMEST, _FLATTEST = 1 / 20, 30  # range of usual ratios of diameter to height
_CLOSE_DIAMETER, _CLOSE_VOLUME, _FAR = 0.02, 0.05, 0.2  # relative differences from nominal
_LEAST_GAP_M, _USUAL_GAP_M = 0.005, 0.02  # distance of the last row from the nominal height


@dataclass(frozen=True)
class Nominal:
    """Nominal volume, diameter and shell height of the tank; None: unknown.

    Attributes
    ----------
    volume_m3, diameter_m, height_m : float or None
    """

    volume_m3: float | None = None
    diameter_m: float | None = None
    height_m: float | None = None


NO_NOMINAL = Nominal()


@dataclass(frozen=True)
class Units:
    """Sizes of the units of a table, m and m3; None if unknown."""

    height_m: float | None
    volume_m3: float | None


NO_UNITS = Units(None, None)


def choose_units(table, volumes, log):
    """Return the `Units` from the headings, or those that give a tank of usual proportions."""
    pairs = _possible_units(table)
    if table.volume_choices:  # volumes do not distinguish gallons
        pairs = [pair for pair in pairs if pair.volume_m3 == table.volume_choices[0]]
        note = message(
            "lint_gallons",
            "gallons of no country: taken as US gallons (3.7854 L); imperial gallons (4.54609 L) "
            "give volumes 20 % larger; expected US gal or imp gal in the heading",
        )
        log.warning(table.name, note)
    units = min(pairs, key=lambda pair: _implausibility(volumes, pair))
    if len(pairs) > 1:
        text = message(
            "lint_no_units",
            "no unit in a heading: taken as heights in {height:g} m, volumes in {volume:g} m3",
            height=units.height_m,
            volume=units.volume_m3,
        )
        log.warning(table.name, text)
    return units


def likely_units(table, volumes):
    """Return the `Units` permitted by the headings that give a tank of usual proportions."""
    return [units for units in _possible_units(table) if _is_usual(volumes, units)]


def _possible_units(table):
    """Units that the headings permit."""
    heights, sizes = _USUAL_HEIGHT_UNITS_M, _USUAL_VOLUME_UNITS_M3
    if table.height_unit_m is not None:
        heights = [table.height_unit_m]
    if table.volume_choices:
        sizes = list(table.volume_choices)
    if table.volume_unit_m3 is not None:
        sizes = [table.volume_unit_m3]
    return [Units(*pair) for pair in product(heights, sizes)]


def _implausibility(volumes, units):
    """Measure of how unusual the proportions of a tank are; 0 for a usual tank."""
    height_m, ratio = _proportions(volumes, units)
    too_small, too_high = log10(_LOWEST_M / height_m), log10(height_m / _HIGHEST_M)
    return abs(log10(ratio)) + max(too_small, too_high, 0.0)


def _is_usual(volumes, units):
    """Whether the units give a tank of usual proportions."""
    height_m, ratio = _proportions(volumes, units)
    return _LOWEST_M <= height_m <= _HIGHEST_M and _SLIMMEST < ratio < _FLATTEST


def _proportions(volumes, units):
    """(height in m, diameter over height) of a table in given units."""
    height_m = float(volumes.height[-1] - volumes.height[0]) * units.height_m
    total = max(float(volumes.volume[-1]), _LEAST_VOLUME) * units.volume_m3
    return height_m, _slenderness(height_m, total)


def _slenderness(height_m, volume_m3):
    """Diameter over height of the upright cylinder with a given height and volume."""
    return sqrt(4 * volume_m3 / (pi * height_m)) / height_m


def check_totals(table, volumes, units, step, nominal, log):
    """Report disagreement with the nominal tank, or with any plausible tank."""
    height_m = float(abs(volumes.height[-1] - volumes.height[0])) * units.height_m
    total_m3 = float(volumes.volume[-1]) * units.volume_m3
    if total_m3 <= 0:
        expected = message(
            "lint_no_capacity",
            "the last volume is {volume:g}; expected the capacity of the tank",
            volume=volumes.volume[-1],
        )
        log.problem(table.name, expected)
        return
    has_nominal = nominal.volume_m3 is not None or nominal.diameter_m is not None
    if not has_nominal:
        _check_proportions(table, height_m, total_m3, log)
    if nominal.volume_m3 is not None:
        _check_total(table, total_m3, nominal.volume_m3, _CLOSE_VOLUME, log)
    if nominal.diameter_m is not None:
        expected = pi / 4 * nominal.diameter_m**2 * nominal.height_m
        _check_total(table, total_m3, expected, _CLOSE_DIAMETER, log)
    if nominal.height_m is not None:
        _check_top(table, volumes, units, step, nominal.height_m, log)


def _check_proportions(table, height_m, total_m3, log):
    """Warn about unusual proportions of the tank."""
    ratio = _slenderness(height_m, total_m3)
    if not _SLIMMEST < ratio < _FLATTEST:
        text = message(
            "lint_proportions",
            "{total:.6g} m3 in {height:.6g} m of height is a cylinder of {diameter:.4g} m "
            "diameter; expected the proportions of a tank: are the units right?",
            total=total_m3,
            height=height_m,
            diameter=ratio * height_m,
        )
        log.warning(table.name, text)


def _check_total(table, total_m3, expected_m3, close, log):
    """Report a total that differs from the nominal volume."""
    ratio = total_m3 / expected_m3
    if abs(ratio - 1) <= close:
        return
    power, hint = round(log10(ratio)), ""
    if power and abs(ratio / 10.0**power - 1) <= _FAR:
        hint = _hint_of_factor(power)
    text = message(
        "lint_total",
        "total {total:.6g} m3, expected about {nominal:.6g} m3 (nominal){hint}",
        total=total_m3,
        nominal=expected_m3,
        hint=hint,
    )
    report = log.warning if abs(ratio - 1) <= _FAR else log.problem
    report(table.name, text)


def _hint_of_factor(power):
    """Text that a power of ten is the likely cause of a difference."""
    factor = 10 ** abs(power)
    if power > 0:
        return message(
            "lint_times_larger",
            ": {factor} times larger; are the units, or thousands marks, right?",
            factor=factor,
        )
    return message(
        "lint_times_smaller",
        ": {factor} times smaller; are the units, or thousands marks, right?",
        factor=factor,
    )


def _check_top(table, volumes, units, step, nominal_m, log):
    """Report a last row that differs from the nominal height."""
    low, high = sorted(abs(float(h)) * units.height_m for h in volumes.height[[0, -1]])
    top_m = high if not table.is_ullage else high - low
    gap = nominal_m - top_m
    expected_gap = min(step * units.height_m * (1 - 1e-6), _USUAL_GAP_M)
    if abs(gap) < max(expected_gap, _LEAST_GAP_M):
        return
    hint = ""
    if gap > 0:
        hint = message("lint_last_rows", ": are the last rows missing?")
    text = message(
        "lint_top",
        "the table ends at {top:.6g} m, nominal height {nominal:.6g} m{hint}",
        top=top_m,
        nominal=nominal_m,
        hint=hint,
    )
    is_small = abs(gap) <= max(5 * step * units.height_m, _CLOSE_DIAMETER * nominal_m)
    report = log.warning if is_small else log.problem
    report(table.name, text)
