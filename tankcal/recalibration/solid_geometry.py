"""Dimensions of lying tanks and spheres from their capacity table, and a job that declares them.

A lying tank has diameter D, length L, the zero of its dips, and ends whose form is chosen by the
quality of the fit. `tankcal.recalibration.solid_fit` fits one form.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.recalibration.former import FormerTable
from tankcal.recalibration.solid_fit import (
    ENDS,
    LARGEST_TILT,
    SolidFit,
    WetRows,
    fit_ends,
    fit_solid,
    flat_start,
    no_fit,
)
from tankcal.tank.solids import Sphere

TOLD_APART = 9.0  # excess of chi-squared that excludes a form: three sds of one unknown
TILTS = (-0.005, 0.005)  # start values
NEAR = 4.0  # excess of chi-squared at the limits of a tilt: two standard deviations
LARGEST_RATIO = 1.1  # largest ratio of diameters that fit equally well
_HALVINGS = 6
_SURE = 20  # tilt over its standard deviation, above which the model is linear in the tilt


@dataclass(frozen=True)
class LyingGeometry:
    """Dimensions of a lying tank estimated from a table.

    Attributes
    ----------
    best : SolidFit
        Ends with the fewest unknowns among the forms that fit equally well.
    worse_by : dict
        {name of ends: excess of chi-squared over the minimum, divided by its variance factor}, in
        rising order. The rows do not exclude forms below `TOLD_APART`.
    tilted : SolidFit or None
        Fit with these ends and a tilt. None if no tilt fits better than a level tank, or if its
        size is not determined. The zero absorbs nearly all of a tilt, and both signs fit equally
        (`SolidFit.mirrored`); this is the fit with the smaller zero. It equals `best` if no level
        tank explains the rows within their rounding, and this fit does.
    tilt_gain : float
        Reduction of chi-squared by the tilt, scaled as in `worse_by`.
    tilt_size : (float, float)
        Smallest and largest size of a tilt (tangent) with an excess of chi-squared below `NEAR`:
        (0, 0.003) if the tank may be level.
    """

    best: SolidFit
    worse_by: dict
    tilted: SolidFit | None
    tilt_gain: float
    tilt_size: tuple[float, float]

    @property
    def not_told_apart(self):
        """Names of the ends that fit as well as the best."""
        return tuple(
            name
            for name, worse in self.worse_by.items()
            if worse < TOLD_APART and name != self.best.ends
        )


def fit_sphere(former: FormerTable) -> SolidFit:
    """Estimate diameter and zero of a spherical tank from its table.

    Parameters
    ----------
    former : FormerTable

    Returns
    -------
    SolidFit
        Its zero is added to a dip of the table.

    Raises
    ------
    InputError
        For fewer than 8 rows with liquid.
    SolutionError
        If no sphere fits.
    """
    rows = WetRows.of(former)
    middle = len(rows.height) // 2
    h, v = max(rows.height[middle], 1e-3), rows.volume[middle]
    start = np.array([max(2 * (3 * v / (np.pi * h**2) + h) / 3, rows.height[-1]), 0.0])
    return fit_solid(rows, "sphere", None, ("diameter", "zero"), start, lambda x: Sphere(x[0]))


def fit_lying(former: FormerTable, dip_from_a_m: float | None = None) -> LyingGeometry:
    """Estimate the dimensions of a lying tank from its table.

    D, L, zero, ends, and a possible tilt.

    Parameters
    ----------
    former : FormerTable
    dip_from_a_m : float, optional
        Position of the dip along the axis; None: half the length. At half the length, a tilt has
        only a quadratic effect; elsewhere it is nearly equivalent to a zero.

    Returns
    -------
    LyingGeometry

    Raises
    ------
    InputError
        For fewer than 8 rows with liquid.
    SolutionError
        If no lying tank fits.
    """
    all_rows = WetRows.of(former)
    rows = all_rows.thinned()
    fits = _level_fits(rows, dip_from_a_m)
    best, worse = _chosen(fits)
    if best.variance_factor > 1:  # a tilt may explain residuals that no form of ends explains
        leaning = {
            name: fit_ends(rows, name, *fit.values[:3], dip_from_a_m, fit.values[3:], TILTS[-1])
            for name, fit in fits.items()
        }
        leaning = {name: fitted for name, fitted in leaning.items() if fitted is not None}
        if any(fitted.variance_factor == 1 for fitted in leaning.values()):
            fits = leaning
            best, worse = _chosen(fits)
    _refuse_low_rows(former, rows, [fits[name] for name, by in worse.items() if by < TOLD_APART])
    whole = _repeat_fit(all_rows, best, dip_from_a_m)
    if whole is None:
        raise SolutionError(no_fit())
    return LyingGeometry(whole, worse, *_tilt(rows, all_rows, best, whole, dip_from_a_m))


def _refuse_low_rows(former, rows, fits):
    """Raise SolutionError if tanks of very different diameters fit equally well."""
    diameters = [float(fit.values[0]) for fit in fits]
    if max(diameters) > LARGEST_RATIO * min(diameters):
        raise SolutionError(
            message(
                "read_low_rows",
                "{name}: the rows up to {last:.4g} m do not reach high enough to tell diameter "
                "from length and ends: diameters from {least:.3g} to {most:.3g} m fit as well",
                name=str(former.name),
                last=float(rows.height[-1]),
                least=min(diameters),
                most=max(diameters),
            )
        )


def _level_fits(rows, dip_from_a_m):
    """Return {ends: SolidFit} of level tanks."""
    flat = fit_ends(rows, "flat", *flat_start(rows), dip_from_a_m)
    if flat is None:
        raise SolutionError(no_fit())
    fits, (diameter, length, zero) = {"flat": flat}, flat.values
    for name, (_, _, part) in ENDS.items():
        if name != "flat":
            shorter = max(length - 1.2 * part * diameter, 0.2 * length)
            fits[name] = fit_ends(rows, name, diameter, shorter, zero, dip_from_a_m)
    return {name: fit for name, fit in fits.items() if fit is not None}


def _chosen(fits):
    """Return the SolidFit with the fewest unknowns among equally good fits, and {ends: excess}."""
    least = min(fits.values(), key=lambda fit: fit.chi2)
    worse = {name: (fit.chi2 - least.chi2) / least.variance_factor for name, fit in fits.items()}
    same = [name for name, by in worse.items() if by < TOLD_APART]
    chosen = min(same, key=lambda name: (len(fits[name].names), worse[name]))
    return fits[chosen], dict(sorted(worse.items(), key=lambda entry: entry[1]))


def _repeat_fit(rows, fitted, dip_from_a_m):
    """Repeat a fit with other rows; of two mirrored tilts, return the one with the smaller zero."""
    (diameter, length, zero), rest, tilt = fitted.values[:3], fitted.values[3:], None
    if "tilt" in fitted.names:
        rest, tilt = fitted.values[3:-1], fitted.values[-1]
        if abs(fitted.mirrored[1]) < abs(zero):
            tilt, zero = fitted.mirrored
    return fit_ends(rows, fitted.ends, diameter, length, zero, dip_from_a_m, rest, tilt)


def _tilt(rows, all_rows, best, whole, dip_from_a_m):
    """Return the SolidFit with a tilt or None, its gain, and (least, largest) size of the tilt."""
    count = len(best.names) - ("tilt" in best.names)

    def fit(values, tilt, is_held=False):
        sizes, rest = values[:3], values[3:count]
        return fit_ends(rows, best.ends, *sizes, dip_from_a_m, rest, tilt, is_held)

    fits = [best] if "tilt" in best.names else [fit(best.values, tilt) for tilt in TILTS]
    fits = [fitted for fitted in fits if fitted is not None]
    if not fits:
        return None, 0.0, (0.0, LARGEST_TILT)
    near = min(fits, key=lambda fitted: fitted.chi2)
    level, is_best = fit(near.values, 0.0, True), near is best
    if not is_best and not _is_significant(near, best):
        near = best
    limit = near.chi2 + NEAR * near.variance_factor

    def is_near(size):
        sign = near.values[-1] if "tilt" in near.names else 1.0
        held = fit(near.values, np.copysign(size, sign), True)
        return held is not None and held.chi2 < limit

    tilted = whole if is_best else _repeat_fit(all_rows, near, dip_from_a_m)
    if "tilt" not in near.names or not (is_best or _is_significant(tilted, whole)):
        return None, 0.0, (0.0, _edge(is_near, 0.0, LARGEST_TILT))
    size, u = abs(near["tilt"][0]), near["tilt"][1]
    gain = np.inf if level is None else (level.chi2 - near.chi2) / near.variance_factor
    if size > _SURE * u:
        sizes = (size - 2 * u, size + 2 * u)
    else:
        least = 0.0 if gain < NEAR else _edge(is_near, size, 0.0)
        sizes = (least, _edge(is_near, size, LARGEST_TILT))
    return tilted, float(gain), sizes


def _is_significant(leaning, level):
    """Whether a tilt fits better than a level tank, and the rows determine its size."""
    is_there = leaning is not None and leaning.chi2 <= level.chi2
    return is_there and bool(np.isfinite(leaning["tilt"][1]))


def _edge(is_near, inside, outside):
    """Find the size at which a tilt ceases to be near, by bisection."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if is_near(middle) else (inside, middle)
    return 0.5 * (inside + outside)


def declared_sizes(fit: SolidFit) -> dict:
    """Return the sections of job.toml with the dimensions: [horizontal] or [sphere], and [datum].

    Parameters
    ----------
    fit : SolidFit

    Returns
    -------
    dict
        {section: {key: value}}. A zero below the bottom (`SolidFit.below_bottom_m`) is replaced by
        the bottom.
    """
    datum = {"datum": {"dip_plate_z_m": _rounded(max(fit["zero"][0], 0.0))}}
    if fit.kind == "sphere":
        return {"sphere": {"diameter_m": _rounded(fit["diameter"][0])}} | datum
    tank = fit.tank
    keys = {"diameter_m": _rounded(tank.width_m), "length_m": _rounded(tank.length_m)}
    for letter, end in (("a", tank.end_a), ("b", tank.end_b)):
        keys[f"end_{letter}"] = end.kind
        if end.kind == "torispherical":
            keys[f"end_{letter}_dish_radius_m"] = _rounded(end.dish_radius_m)
            keys[f"end_{letter}_knuckle_radius_m"] = _rounded(end.knuckle_radius_m)
        elif end.kind != "flat":
            keys[f"end_{letter}_depth_m"] = _rounded(end.depth_m)
    if tank.tilt:
        keys |= {"tilt_mm_per_m": _rounded(1000 * tank.tilt), "dip_from_a_m": tank.dip_from_a_m}
    return {"horizontal": keys} | datum


def declared_uncertainties(fit: SolidFit, former: FormerTable) -> list[dict]:
    """Return rows of uncertainty.csv for these dimensions: rounding, and U of the former table.

    Parameters
    ----------
    fit : SolidFit
    former : FormerTable
        The relative U of its last row becomes an uncertainty of the diameter, common to all
        volumes.

    Returns
    -------
    list of dict
        With the keys input, u, unit, note; dimensions in mm.
    """
    units = {"zero": "datum", "diameter": "diameter", "length": "length", "end_depth": "end_depth"}
    rows = []
    for name, value, u in zip(fit.names, fit.values, fit.u, strict=True):
        if name not in units or not np.isfinite(u):
            continue
        note = "read from a table: its rounding"
        if name == "diameter" and former.U_m3 is not None:
            share = former.U_m3[-1] / former.k / former.volume_m3[-1]
            power = 3 if fit.kind == "sphere" else 2
            u = float(np.hypot(u, value * share / power))
            note = "read from a table: its rounding and U of its last row"
        rows.append({"input": units[name], "u": float(f"{1e3 * u:.3g}"), "unit": "mm",
                     "note": note})  # fmt: skip
    note = "sizes are at the reference temperature of the table"
    rows.append({"input": "shell_temperature", "u": 0, "unit": "K", "note": note})
    return rows


def _rounded(value):
    return float(f"{value:.7f}")
