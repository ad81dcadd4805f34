"""Sizes of lying tanks and spheres out of their capacity table, and a job that declares them.

A lying tank has D, L, the zero of its dips and ends that are told apart by how well they fit. One
fit of one form is `tankcal.recalibration.solid_fit`.
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

TOLD_APART = 9.0  # chi-squared above the least: three standard deviations of one unknown
TILTS = (-0.005, 0.005)  # to start from
NEAR = 4.0  # chi-squared above the least: two standard deviations
LARGEST_RATIO = 1.1  # of diameters that fit as well
_HALVINGS = 6
_SURE = 20  # standard deviations: a tilt that is linear over them


@dataclass(frozen=True)
class LyingGeometry:
    """What a table says of a lying tank.

    Attributes
    ----------
    best : SolidFit
        Of the ends with the fewest unknowns among those that fit as well as any.
    worse_by : dict
        {name of ends: chi-squared above the least, over the variance factor of the least}, in
        rising order: below `TOLD_APART` the rows do not tell them apart.
    tilted : SolidFit or None
        The same ends with a tilt as one more unknown; None where none is found that fits better
        than a level tank, or nothing tells its size. The zero takes up nearly all of a tilt, and
        both of its signs fit alike (`SolidFit.mirrored`): this is the one with the nearer zero. It
        is `best` itself where no level tank explains the rows and this one does, to their rounding.
    tilt_gain : float
        By how much the tilt lowers chi-squared, as of `worse_by`.
    tilt_size : (float, float)
        Sizes of a tilt, as tangents, that raise chi-squared by less than `NEAR` over its least:
        (0, 0.003) where the tank may be level.
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
    """Diameter and zero of a spherical tank out of its table.

    Parameters
    ----------
    former : FormerTable

    Returns
    -------
    SolidFit
        Its zero is what has to be added to a dip of the table.

    Raises
    ------
    InputError
        For fewer than 8 rows with liquid.
    SolutionError
        Where no sphere fits.
    """
    rows = WetRows.of(former)
    middle = len(rows.height) // 2
    h, v = max(rows.height[middle], 1e-3), rows.volume[middle]
    start = np.array([max(2 * (3 * v / (np.pi * h**2) + h) / 3, rows.height[-1]), 0.0])
    return fit_solid(rows, "sphere", None, ("diameter", "zero"), start, lambda x: Sphere(x[0]))


def fit_lying(former: FormerTable, dip_from_a_m: float | None = None) -> LyingGeometry:
    """Sizes of a lying tank out of its table: D, L, zero and ends, and a tilt as an offer.

    Parameters
    ----------
    former : FormerTable
    dip_from_a_m : float, optional
        Place of the dip along the axis; None: half the length. There a tilt shows in its square
        only; elsewhere it is nearly the same as a zero.

    Returns
    -------
    LyingGeometry

    Raises
    ------
    InputError
        For fewer than 8 rows with liquid.
    SolutionError
        Where no lying tank fits.
    """
    all_rows = WetRows.of(former)
    rows = all_rows.thinned()
    fits = _level_fits(rows, dip_from_a_m)
    best, worse = _chosen(fits)
    if best.variance_factor > 1:  # a tilt may be what no ends explain
        leaning = {
            name: fit_ends(rows, name, *one.values[:3], dip_from_a_m, one.values[3:], TILTS[-1])
            for name, one in fits.items()
        }
        leaning = {name: one for name, one in leaning.items() if one is not None}
        if any(one.variance_factor == 1 for one in leaning.values()):
            fits = leaning
            best, worse = _chosen(fits)
    _refuse_low_rows(former, rows, [fits[name] for name, by in worse.items() if by < TOLD_APART])
    whole = _again(all_rows, best, dip_from_a_m)
    if whole is None:
        raise SolutionError(no_fit())
    return LyingGeometry(whole, worse, *_tilt(rows, all_rows, best, whole, dip_from_a_m))


def _refuse_low_rows(former, rows, fits):
    """SolutionError where tanks of very different diameters explain the rows as well."""
    diameters = [float(one.values[0]) for one in fits]
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
    """{ends: SolidFit} of a level tank."""
    flat = fit_ends(rows, "flat", *flat_start(rows), dip_from_a_m)
    if flat is None:
        raise SolutionError(no_fit())
    fits, (diameter, length, zero) = {"flat": flat}, flat.values
    for name, (_, _, part) in ENDS.items():
        if name != "flat":
            shorter = max(length - 1.2 * part * diameter, 0.2 * length)
            fits[name] = fit_ends(rows, name, diameter, shorter, zero, dip_from_a_m)
    return {name: one for name, one in fits.items() if one is not None}


def _chosen(fits):
    """(SolidFit with the fewest unknowns of those that fit as well as any, {ends: worse by})."""
    least = min(fits.values(), key=lambda one: one.chi2)
    worse = {name: (one.chi2 - least.chi2) / least.variance_factor for name, one in fits.items()}
    same = [name for name, by in worse.items() if by < TOLD_APART]
    chosen = min(same, key=lambda name: (len(fits[name].names), worse[name]))
    return fits[chosen], dict(sorted(worse.items(), key=lambda one: one[1]))


def _again(rows, one, dip_from_a_m):
    """The same fit to other rows; of two tilts that mirror each other that of the nearer zero."""
    (diameter, length, zero), rest, tilt = one.values[:3], one.values[3:], None
    if "tilt" in one.names:
        rest, tilt = one.values[3:-1], one.values[-1]
        if abs(one.mirrored[1]) < abs(zero):
            tilt, zero = one.mirrored
    return fit_ends(rows, one.ends, diameter, length, zero, dip_from_a_m, rest, tilt)


def _tilt(rows, all_rows, best, whole, dip_from_a_m):
    """(SolidFit with a tilt or None, gain, (least, largest) size of a tilt)."""
    count = len(best.names) - ("tilt" in best.names)

    def fit(values, tilt, is_held=False):
        sizes, rest = values[:3], values[3:count]
        return fit_ends(rows, best.ends, *sizes, dip_from_a_m, rest, tilt, is_held)

    found = [best] if "tilt" in best.names else [fit(best.values, tilt) for tilt in TILTS]
    found = [one for one in found if one is not None]
    if not found:
        return None, 0.0, (0.0, LARGEST_TILT)
    near = min(found, key=lambda one: one.chi2)
    level, is_best = fit(near.values, 0.0, True), near is best
    if not is_best and not _is_told(near, best):
        near = best
    limit = near.chi2 + NEAR * near.variance_factor

    def is_near(size):
        sign = near.values[-1] if "tilt" in near.names else 1.0
        one = fit(near.values, np.copysign(size, sign), True)
        return one is not None and one.chi2 < limit

    tilted = whole if is_best else _again(all_rows, near, dip_from_a_m)
    if "tilt" not in near.names or not (is_best or _is_told(tilted, whole)):
        return None, 0.0, (0.0, _edge(is_near, 0.0, LARGEST_TILT))
    size, u = abs(near["tilt"][0]), near["tilt"][1]
    gain = np.inf if level is None else (level.chi2 - near.chi2) / near.variance_factor
    if size > _SURE * u:
        sizes = (size - 2 * u, size + 2 * u)
    else:
        least = 0.0 if gain < NEAR else _edge(is_near, size, 0.0)
        sizes = (least, _edge(is_near, size, LARGEST_TILT))
    return tilted, float(gain), sizes


def _is_told(leaning, level):
    """Whether a tilt fits better than none, and the rows determine its size."""
    is_there = leaning is not None and leaning.chi2 <= level.chi2
    return is_there and bool(np.isfinite(leaning["tilt"][1]))


def _edge(is_near, inside, outside):
    """Where a size ceases to be near, by halving."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if is_near(middle) else (inside, middle)
    return 0.5 * (inside + outside)


def declared_sizes(fit: SolidFit) -> dict:
    """The sections of a job.toml that hold the sizes: [horizontal] or [sphere], and [datum].

    Parameters
    ----------
    fit : SolidFit

    Returns
    -------
    dict
        {section: {key: value}}. A zero below the bottom (`SolidFit.below_bottom_m`) becomes the
        bottom.
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
    """Rows of uncertainty.csv for a job with these sizes: rounding, and U of the former table.

    Parameters
    ----------
    fit : SolidFit
    former : FormerTable
        The relative U of its last row becomes one of the diameter, which all volumes share.

    Returns
    -------
    list of dict
        With the keys input, u, unit, note; sizes in mm.
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
