"""Sizes of lying tanks and spheres out of their capacity table, by least squares over its rows.

A lying tank has D, L, the zero of its dips and ends that are told apart by how well they fit; the
volumes are those of `tankcal.tank.solids`. Weights: volumes rounded to q have a standard deviation
of q / sqrt(12), and rounded dips one of their own times the area of the surface.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message
from tankcal.recalibration.former import FormerTable
from tankcal.tank.heads import End, standard_end
from tankcal.tank.solids import LyingTank, Sphere

FEWEST_ROWS = 8
TOLD_APART = 9.0  # chi-squared above the least: three standard deviations of one unknown
MOST_ROWS = 120  # that ends and tilt are chosen by; the sizes are of all rows
TILTS = (-0.005, 0.005)  # to start from
LARGEST_TILT = 0.1
NEAR = 4.0  # chi-squared above the least: two standard deviations
_HALVINGS = 6
_SURE = 20  # standard deviations: a tilt that is linear over them
_SPREAD = 0.8  # variance of the square of a rounding error over its own variance
_FINEST = 1e-9  # of the highest volume: what a table without rounding is exact to
_BOUND = 1e-4  # of D: an end that comes so near to a limit of its form is at it
_STEEP = 1e-6  # relative: below, an unknown is not determined


def _tied(kind, depth):
    """End of fixed proportions: its depth a part of the diameter."""
    return lambda diameter, _: End(kind, depth * diameter)


def _standard(name):
    """Torispherical end of a standard form."""
    return lambda diameter, _: standard_end(End("torispherical"), name, diameter)


def _free(kind):
    """End of a depth of its own."""
    return lambda _, depth: End(kind, depth)


# name: (its End of D and depth, whether the depth is an unknown, depth to start from in D)
ENDS = {
    "flat": (lambda *_: End("flat"), False, 0.0),
    "hemispherical": (_tied("spherical", 0.5), False, 0.5),
    "ellipsoidal_2_to_1": (_tied("ellipsoidal", 0.25), False, 0.25),
    "torispherical_din_28011": (_standard("din_28011"), False, 0.19),
    "torispherical_din_28013": (_standard("din_28013"), False, 0.25),
    "torispherical_asme": (_standard("asme"), False, 0.17),
    "spherical": (_free("spherical"), True, 0.15),
    "ellipsoidal": (_free("ellipsoidal"), True, 0.2),
    "conical": (_free("conical"), True, 0.15),
}


@dataclass(frozen=True)
class SolidFit:
    """A solid fitted to a table.

    Attributes
    ----------
    kind : {"horizontal", "sphere"}
    ends : str or None
        Of a lying tank, a name of `ENDS`.
    names : tuple of str
        Of the unknowns: "diameter", "length", "zero", "end_depth", "tilt".
    values, u : (unknowns,) ndarray
        In m (the tilt: its tangent) with standard uncertainties by rounding alone; where the
        residuals are larger than rounding allows, by the residuals. inf: not determined.
    covariance : (unknowns, unknowns) ndarray
    residuals_m3 : (rows,) ndarray
        Table less solid.
    rms_m3 : float
    chi2 : float
        Sum of squares of the residuals over their standard deviations by rounding.
    dof : int
    tank : LyingTank or Sphere
    """

    kind: str
    ends: str | None
    names: tuple[str, ...]
    values: np.ndarray
    u: np.ndarray
    covariance: np.ndarray
    residuals_m3: np.ndarray
    rms_m3: float
    chi2: float
    dof: int
    tank: LyingTank | Sphere

    def __getitem__(self, name):
        """(value, u) of an unknown."""
        k = self.names.index(name)
        return float(self.values[k]), float(self.u[k])

    @property
    def below_bottom_m(self):
        """How far the table's dips begin below the inside bottom; 0 where that is no more than u.

        A job has no dip plate there: its dips are less than the table's by this.
        """
        zero, u = self["zero"]
        return max(-zero, 0.0) if -zero > 3 * u else 0.0

    @property
    def mirrored(self):
        """(tilt, zero) that give the same volumes: a tilt the other way, of another zero."""
        tilt, tank = self["tilt"][0], self.tank
        shift = tilt * (tank.length_m / 2 - tank.dip_from_a_m) / np.hypot(1.0, tilt)
        return -tilt, self["zero"][0] - 2 * shift

    @property
    def variance_factor(self):
        """chi2 over dof where that is more than rounding may leave, else 1."""
        return _variance_factor(self.chi2, self.dof)


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
    rows = _Rows.of(former)
    middle = len(rows.height) // 2
    h, v = max(rows.height[middle], 1e-3), rows.volume[middle]
    start = np.array([max(2 * (3 * v / (np.pi * h**2) + h) / 3, rows.height[-1]), 0.0])
    return _fit(rows, "sphere", None, ("diameter", "zero"), start, lambda x: Sphere(x[0]))


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
    all_rows = _Rows.of(former)
    rows = all_rows.thinned()
    fits = _level_fits(rows, dip_from_a_m)
    best, worse = _chosen(fits)
    if best.variance_factor > 1:  # a tilt may be what no ends explain
        leaning = {
            name: _fit_ends(rows, name, *one.values[:3], dip_from_a_m, one.values[3:], TILTS[-1])
            for name, one in fits.items()
        }
        leaning = {name: one for name, one in leaning.items() if one is not None}
        if any(one.variance_factor == 1 for one in leaning.values()):
            best, worse = _chosen(leaning)
    whole = _again(all_rows, best, dip_from_a_m)
    if whole is None:
        raise SolutionError(_no_fit())
    return LyingGeometry(whole, worse, *_tilt(rows, all_rows, best, whole, dip_from_a_m))


def _level_fits(rows, dip_from_a_m):
    """{ends: SolidFit} of a level tank."""
    flat = _fit_ends(rows, "flat", *_start(rows), dip_from_a_m)
    if flat is None:
        raise SolutionError(_no_fit())
    fits, (diameter, length, zero) = {"flat": flat}, flat.values
    for name, (_, _, part) in ENDS.items():
        if name != "flat":
            shorter = max(length - 1.2 * part * diameter, 0.2 * length)
            fits[name] = _fit_ends(rows, name, diameter, shorter, zero, dip_from_a_m)
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
    return _fit_ends(rows, one.ends, diameter, length, zero, dip_from_a_m, rest, tilt)


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


@dataclass(frozen=True)
class _Rows:
    """Rows with liquid, and their standard deviations by rounding."""

    height: np.ndarray
    volume: np.ndarray
    sd: np.ndarray

    @classmethod
    def of(cls, former):
        quantum = former.volume_quantum_m3
        sd = np.full(len(former.volume_m3), quantum / np.sqrt(12))
        if former.height_rounding_m is not None:
            area = np.gradient(former.volume_m3, former.height_m)
            sd = np.hypot(sd, area * former.height_rounding_m / np.sqrt(3))
        sd = np.maximum(sd, _FINEST * former.volume_m3[-1])
        wet = former.volume_m3 > 0
        if wet.sum() < FEWEST_ROWS:
            expected = message(
                "former_few_wet_rows",
                "{count} rows with liquid; expected {fewest} or more",
                count=int(wet.sum()),
                fewest=FEWEST_ROWS,
            )
            raise InputError(Problem(former.name, expected))
        return cls(former.height_m[wet], former.volume_m3[wet], sd[wet])

    def thinned(self):
        """At most MOST_ROWS of them, evenly."""
        if len(self.height) <= MOST_ROWS:
            return self
        kept = np.unique(np.linspace(0, len(self.height) - 1, MOST_ROWS).round().astype(int))
        return replace(self, height=self.height[kept], volume=self.volume[kept], sd=self.sd[kept])


def _start(rows):
    """(D, L, 0) of the flat-ended tank of the nearest volumes, D on a grid."""
    found = []
    for part in np.linspace(0.98, 2.0, 103):
        diameter = part * rows.height[-1]
        unit = _volumes(LyingTank(diameter, diameter, 1.0), rows.height)
        length = float(unit @ rows.volume / (unit @ unit))
        found.append((np.sum((length * unit - rows.volume) ** 2), diameter, length))
    _, diameter, length = min(found)
    return diameter, length, 0.0


def _fit_ends(rows, name, diameter, length, zero, dip_from_a_m, rest=(), tilt=None, is_held=False):
    """SolidFit with ends of a kind, or None where there is none.

    tilt  None: level; else an unknown that starts there, or that is held there
    """
    end_of, is_free, part = ENDS[name]
    names = ("diameter", "length", "zero")
    start = [diameter, length, zero]
    if is_free:
        names += ("end_depth",)
        start += [rest[0] if len(rest) else part * diameter]
    is_unknown = tilt is not None and not is_held
    if is_unknown:
        names += ("tilt",)
        start += [tilt]

    def solid(x):
        end = end_of(x[0], x[3] if is_free else None)
        lean = x[-1] if is_unknown else tilt or 0.0
        place = x[1] / 2 if dip_from_a_m is None else dip_from_a_m
        return LyingTank(x[0], x[0], x[1], end, end, lean, 0.0, place)

    try:
        return _fit(rows, "horizontal", name, names, np.array(start, dtype=float), solid)
    except SolutionError:
        return None


def _tilt(rows, all_rows, best, whole, dip_from_a_m):
    """(SolidFit with a tilt or None, gain, (least, largest) size of a tilt)."""
    count = len(best.names) - ("tilt" in best.names)

    def fit(values, tilt, is_held=False):
        sizes, rest = values[:3], values[3:count]
        return _fit_ends(rows, best.ends, *sizes, dip_from_a_m, rest, tilt, is_held)

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


def _fit(rows, kind, ends, names, start, solid):
    """SolidFit by least squares; SolutionError where the unknowns leave what a tank can be."""
    far, zero = 1e6 * np.ones(len(rows.height)), names.index("zero")

    def residuals(x):
        try:
            return (rows.volume - _volumes(solid(x), rows.height + x[zero])) / rows.sd
        except SolutionError:
            return far

    low, high = _limits(names, start)
    scale = np.array([start[0] if name != "tilt" else 0.1 for name in names])
    solved = scipy.optimize.least_squares(
        residuals, np.clip(start, low, high), bounds=(low, high), x_scale=scale, xtol=1e-11,
        ftol=1e-11, gtol=1e-14, max_nfev=60,
    )  # fmt: skip
    if not np.all(np.isfinite(solved.x)) or np.array_equal(solved.fun, far):
        raise SolutionError(_no_fit())
    at_limit = (solved.x - low < _BOUND * scale) | (high - solved.x < _BOUND * scale)
    if np.any(at_limit):
        raise SolutionError(_no_fit())
    chi2, dof = float(solved.fun @ solved.fun), len(rows.height) - len(names)
    covariance, u = _covariance(solved.jac * scale, scale, _variance_factor(chi2, dof))
    left = solved.fun * rows.sd
    return SolidFit(
        kind, ends, names, solved.x, u, covariance, left, float(np.sqrt(np.mean(left**2))), chi2,
        dof, solid(solved.x),
    )  # fmt: skip


def _variance_factor(chi2, dof):
    factor = chi2 / dof
    return factor if factor > 1 + 3 * np.sqrt(_SPREAD / dof) else 1.0


def _limits(names, start):
    size = start[0]
    limits = {
        "diameter": (0.5 * size, 3 * size),
        "length": (1e-3 * size, 1e3 * size),
        "zero": (-0.5 * size, 0.5 * size),
        "end_depth": (1e-3 * size, 1.5 * size),
        "tilt": (-LARGEST_TILT, LARGEST_TILT),
    }
    return np.array([limits[name] for name in names]).T


def _covariance(jacobian, scale, factor):
    """(covariance, u) of the unknowns; inf where the rows do not determine one."""
    _, values, rows = np.linalg.svd(jacobian, full_matrices=False)
    good = values > _STEEP * values[0]
    inverse = (rows[good].T / values[good] ** 2) @ rows[good]
    lost = (rows[~good] ** 2).sum(axis=0) > 1e-6
    covariance = factor * inverse * np.outer(scale, scale)
    return covariance, np.where(lost, np.inf, np.sqrt(np.diag(covariance)))


def _volumes(tank, dips_m):
    """Volumes at dips, those below the bottom and above the top as there."""
    return tank.volume_m3(np.clip(dips_m, 0.0, tank.top_m))


def _no_fit():
    return message("former_no_solid", "no tank of this kind fits the volumes of the table")


def _rounded(value):
    return float(f"{value:.7f}")


__all__ = [
    "ENDS", "LyingGeometry", "SolidFit", "declared_sizes", "declared_uncertainties", "fit_lying",
    "fit_sphere",
]  # fmt: skip
