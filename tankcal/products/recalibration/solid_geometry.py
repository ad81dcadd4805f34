"""Dimensions of lying tanks and spheres from their capacity table, and a job that declares them.

A lying tank has diameter D, length L, the zero of its dips, and ends. Each form of the ends is
fitted by least squares (`fit_ends`); the quality of the fits decides between them (`fit_lying`).

Volumes are those of `tankcal.tank.solids`. Volumes rounded to q have a standard deviation of
q / sqrt(12). Rounded dips contribute their own standard deviation times the area of the surface.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message
from tankcal.products.recalibration.former import FormerTable
from tankcal.tank.heads import End, standard_end
from tankcal.tank.solids import LyingTank, Sphere

EXCLUDING_CHI2 = 9.0  # excess of chi-squared that excludes a form: three sds of one unknown
TILTS = (-0.005, 0.005)  # start values
NEAR = 4.0  # excess of chi-squared at the limits of a tilt: two standard deviations
LARGEST_RATIO = 1.1  # largest ratio of diameters that fit equally well
LARGEST_U_OF_DIAMETER = 0.1  # relative; a less certain diameter is not determined
_HALVINGS = 6
_SURE = 20  # tilt over its standard deviation, above which the model is linear in the tilt
FEWEST_ROWS = 8
MOST_ROWS = 120  # rows used to choose ends and tilt; all rows determine the dimensions
LARGEST_TILT = 0.1
HIGHEST_PART = 30.0  # largest ratio of diameter to highest row of a table
_SPREAD = 0.8  # variance of the squared rounding error, relative to the squared variance
_FINEST = 1e-9  # relative precision of a table without rounding
_BOUND = 1e-4  # distance from a limit of the form of an end, relative to D, that counts as zero
_STEEP = 1e-6  # relative size below which an unknown is not determined


def _proportional_end(kind, depth):
    """Return an end of fixed proportions, with its depth as a share of the diameter."""
    return lambda diameter, _: End(kind, depth * diameter)


def _standard_end(name):
    """Return a torispherical end of a standard form."""
    return lambda diameter, _: standard_end(End("torispherical"), name, diameter)


def _free_end(kind):
    """Return an end with an independent depth."""
    return lambda _, depth: End(kind, depth)


# name: (End as a function of D and depth, whether depth is an unknown, start depth over D)
ENDS = {
    "flat": (lambda *_: End("flat"), False, 0.0),
    "hemispherical": (_proportional_end("spherical", 0.5), False, 0.5),
    "ellipsoidal_2_to_1": (_proportional_end("ellipsoidal", 0.25), False, 0.25),
    "torispherical_din_28011": (_standard_end("din_28011"), False, 0.19),
    "torispherical_din_28013": (_standard_end("din_28013"), False, 0.25),
    "torispherical_asme": (_standard_end("asme"), False, 0.17),
    "spherical": (_free_end("spherical"), True, 0.15),
    "ellipsoidal": (_free_end("ellipsoidal"), True, 0.2),
    "conical": (_free_end("conical"), True, 0.15),
}


@dataclass(frozen=True)
class SolidFit:
    """A solid fitted to a table.

    Attributes
    ----------
    kind : {"horizontal", "sphere"}
    ends : str or None
        Form of the ends of a lying tank, a name of `ENDS`.
    names : tuple of str
        Unknowns: "diameter", "length", "zero", "end_depth", "tilt".
    values, u : (unknowns,) ndarray
        Values in m (tilt: tangent) and standard uncertainties by rounding only. If the residuals
        exceed rounding, u is scaled by the residuals. inf: not determined.
    rms_m3 : float
        Root mean square of the residuals, table minus solid.
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
    rms_m3: float
    chi2: float
    dof: int
    tank: LyingTank | Sphere

    def __getitem__(self, name):
        """Value and u of an unknown."""
        k = self.names.index(name)
        return float(self.values[k]), float(self.u[k])

    @property
    def zero_depth_m(self):
        """Height of the inside bottom above the zero of the dips, m; 0 if not larger than u.

        A job has no dip plate below the bottom. Its dips are smaller than those of the table by
        this height.
        """
        zero, u = self["zero"]
        return max(-zero, 0.0) if -zero > 3 * u else 0.0

    @property
    def mirror_image(self):
        """Tilt of opposite sign, and the zero with which it gives the same volumes."""
        tilt, tank = self["tilt"][0], self.tank
        shift = tilt * (tank.length_m / 2 - tank.dip_from_a_m) / np.hypot(1.0, tilt)
        return -tilt, self["zero"][0] - 2 * shift

    @property
    def variance_factor(self):
        """chi2 over dof if it exceeds the range expected from rounding, else 1."""
        return _variance_factor(self.chi2, self.dof)


@dataclass(frozen=True)
class WetRows:
    """Rows with liquid, and their standard deviations by rounding."""

    height: np.ndarray
    volume: np.ndarray
    sd: np.ndarray

    @classmethod
    def from_table(cls, former):
        """Return the wet rows of a `FormerTable`; raise InputError for fewer than 8."""
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

    def thin(self):
        """Return at most MOST_ROWS evenly chosen rows."""
        if len(self.height) <= MOST_ROWS:
            return self
        kept = np.unique(np.linspace(0, len(self.height) - 1, MOST_ROWS).round().astype(int))
        return replace(self, height=self.height[kept], volume=self.volume[kept], sd=self.sd[kept])


def find_flat_start(rows):
    """Return (D, L, 0) of the flat-ended tank with the nearest volumes, D on a grid."""
    candidates = []
    for part in np.append(np.linspace(0.98, 2.0, 103), np.geomspace(2.05, HIGHEST_PART, 60)):
        diameter = part * rows.height[-1]
        unit = _volumes(LyingTank(diameter, diameter, 1.0), rows.height)
        length = float(unit @ rows.volume / (unit @ unit))
        candidates.append((np.sum((length * unit - rows.volume) ** 2), diameter, length))
    _, diameter, length = min(candidates)
    return diameter, length, 0.0


def fit_ends(rows, name, diameter, length, zero, dip_from_a_m, rest=(), tilt=None, is_held=False):
    """Return the SolidFit with ends of one form, or None if there is no solution.

    Parameters
    ----------
    rows : WetRows
    name : str
        Form of the ends, a name of `ENDS`.
    diameter, length, zero : float
        Start values, m.
    dip_from_a_m : float or None
        Position of the dip along the axis; None: half the length.
    rest : sequence of float, optional
        Start value of the depth of the ends.
    tilt : float, optional
        None for a level tank, else the start value of the tilt, or its fixed value.
    is_held : bool, optional
        Whether the tilt is fixed.
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
        return fit_solid(rows, "horizontal", name, names, np.array(start, dtype=float), solid)
    except SolutionError:
        return None


def fit_solid(rows, kind, ends, names, start, solid):
    """Return the least-squares SolidFit; raise SolutionError if the unknowns leave their range.

    Parameters
    ----------
    rows : WetRows
    kind : {"horizontal", "sphere"}
    ends : str or None
    names : tuple of str
        Names of the unknowns.
    start : ndarray, shape (unknowns,)
        Start values.
    solid : callable
        Function of the unknowns that returns the tank.
    """
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
        raise SolutionError(no_solid_message())
    at_limit = (solved.x - low < _BOUND * scale) | (high - solved.x < _BOUND * scale)
    if np.any(at_limit):
        raise SolutionError(no_solid_message())
    chi2, dof = float(solved.fun @ solved.fun), len(rows.height) - len(names)
    # Scaled unknowns of similar size make the rank decision independent of their units.
    u = _standard_uncertainties(solved.jac * scale, scale, _variance_factor(chi2, dof))
    rms_m3 = float(np.sqrt(np.mean((solved.fun * rows.sd) ** 2)))
    return SolidFit(kind, ends, names, solved.x, u, rms_m3, chi2, dof, solid(solved.x))


def _variance_factor(chi2, dof):
    factor = chi2 / dof
    # The factor applies only if it exceeds its expectation by three standard deviations.
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


def _standard_uncertainties(jacobian, scale, factor):
    """Return u (unknowns,); inf for an unknown that the rows do not determine.

    jacobian  of the scaled unknowns
    factor    variance factor
    """
    # (J' J)^-1 by the singular values of J, without the undetermined directions
    _, values, rows = np.linalg.svd(jacobian, full_matrices=False)
    good = values > _STEEP * values[0]
    inverse = (rows[good].T / values[good] ** 2) @ rows[good]
    # unknowns with a share in the undetermined directions
    lost = (rows[~good] ** 2).sum(axis=0) > 1e-6
    covariance = factor * inverse * np.outer(scale, scale)
    return np.where(lost, np.inf, np.sqrt(np.diag(covariance)))


def _volumes(tank, dips_m):
    """Volumes at dips.

    Those of the empty tank below the bottom, and of the full tank above the top.
    """
    return tank.volume_m3(np.clip(dips_m, 0.0, tank.top_m))


def no_solid_message():
    """Return the message that no solid fits."""
    return message("former_no_solid", "no tank of this kind fits the volumes of the table")


# ---- choice of the ends, tilt, and the job


@dataclass(frozen=True)
class LyingGeometry:
    """Dimensions of a lying tank estimated from a table.

    Attributes
    ----------
    best : SolidFit
        Ends with the fewest unknowns among the forms that fit equally well.
    chi2_excess : dict
        {name of ends: excess of chi-squared over the minimum, divided by its variance factor}, in
        rising order. The rows do not exclude forms below `EXCLUDING_CHI2`.
    tilted : SolidFit or None
        Fit with these ends and a tilt. None if no tilt fits better than a level tank, or if its
        size is not determined. The zero absorbs nearly all of a tilt, and both signs fit equally
        (`SolidFit.mirror_image`); this is the fit with the smaller zero. It equals `best` if no
        level tank explains the rows within their rounding, and this fit does.
    tilt_gain : float
        Reduction of chi-squared by the tilt, scaled as in `chi2_excess`.
    tilt_size : (float, float)
        Smallest and largest size of a tilt (tangent) with an excess of chi-squared below `NEAR`:
        (0, 0.003) if the tank may be level.
    """

    best: SolidFit
    chi2_excess: dict
    tilted: SolidFit | None
    tilt_gain: float
    tilt_size: tuple[float, float]

    @property
    def equally_good_ends(self):
        """Names of the ends that fit as well as the best."""
        return tuple(
            name
            for name, worse in self.chi2_excess.items()
            if worse < EXCLUDING_CHI2 and name != self.best.ends
        )


def fit_sphere(former: FormerTable) -> SolidFit:
    """Estimate diameter and zero of a spherical tank from its table.

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
    rows = WetRows.from_table(former)
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
    all_rows = WetRows.from_table(former)
    rows = all_rows.thin()
    fits = _level_fits(rows, dip_from_a_m)
    best, worse = _choose_ends(fits)
    if best.variance_factor > 1:  # a tilt may explain residuals that no form of ends explains
        leaning = {
            name: fit_ends(rows, name, *fit.values[:3], dip_from_a_m, fit.values[3:], TILTS[-1])
            for name, fit in fits.items()
        }
        leaning = {name: fitted for name, fitted in leaning.items() if fitted is not None}
        if any(fitted.variance_factor == 1 for fitted in leaning.values()):
            fits = leaning
            best, worse = _choose_ends(fits)
    _refuse_low_rows(
        former, rows, [fits[name] for name, by in worse.items() if by < EXCLUDING_CHI2]
    )
    whole = _repeat_fit(all_rows, best, dip_from_a_m)
    if whole is None:
        raise SolutionError(no_solid_message())
    if not whole.u[0] <= LARGEST_U_OF_DIAMETER * whole.values[0]:  # also inf and nan
        raise SolutionError(
            message(
                "read_undetermined",
                "{name}: the rows up to {last:.4g} m do not reach high enough to separate "
                "diameter from length and ends",
                name=str(former.name),
                last=float(rows.height[-1]),
            )
        )
    return LyingGeometry(whole, worse, *_tilt(rows, all_rows, best, whole, dip_from_a_m))


def _refuse_low_rows(former, rows, fits):
    """Raise SolutionError if tanks of very different diameters fit equally well."""
    diameters = [float(fit.values[0]) for fit in fits]
    if max(diameters) > LARGEST_RATIO * min(diameters):
        raise SolutionError(
            message(
                "read_low_rows",
                "{name}: the rows up to {last:.4g} m do not reach high enough to tell diameter "
                "from length and ends: diameters such as {least:.3g} and {most:.3g} m fit "
                "equally well",
                name=str(former.name),
                last=float(rows.height[-1]),
                least=min(diameters),
                most=max(diameters),
            )
        )


def _level_fits(rows, dip_from_a_m):
    """Return {ends: SolidFit} of level tanks."""
    flat = fit_ends(rows, "flat", *find_flat_start(rows), dip_from_a_m)
    if flat is None:
        raise SolutionError(no_solid_message())
    fits, (diameter, length, zero) = {"flat": flat}, flat.values
    for name, (_, _, part) in ENDS.items():
        if name != "flat":
            shorter = max(length - 1.2 * part * diameter, 0.2 * length)
            fits[name] = fit_ends(rows, name, diameter, shorter, zero, dip_from_a_m)
    return {name: fit for name, fit in fits.items() if fit is not None}


def _choose_ends(fits):
    """Return the SolidFit with the fewest unknowns among equally good fits, and {ends: excess}."""
    least = min(fits.values(), key=lambda fit: fit.chi2)
    worse = {name: (fit.chi2 - least.chi2) / least.variance_factor for name, fit in fits.items()}
    same = [name for name, by in worse.items() if by < EXCLUDING_CHI2]
    chosen = min(same, key=lambda name: (len(fits[name].names), worse[name]))
    return fits[chosen], dict(sorted(worse.items(), key=lambda entry: entry[1]))


def _repeat_fit(rows, fitted, dip_from_a_m):
    """Repeat a fit with other rows; of two mirrored tilts, return that with the smaller zero."""
    (diameter, length, zero), rest, tilt = fitted.values[:3], fitted.values[3:], None
    if "tilt" in fitted.names:
        rest, tilt = fitted.values[3:-1], fitted.values[-1]
        if abs(fitted.mirror_image[1]) < abs(zero):
            tilt, zero = fitted.mirror_image
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


def size_sections(fit: SolidFit) -> dict:
    """Return the sections of job.toml with the dimensions: [horizontal] or [sphere], and [datum].

    Returns
    -------
    dict
        {section: {key: value}}. A zero below the bottom (`SolidFit.zero_depth_m`) is replaced by
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


def uncertainty_rows(fit: SolidFit, former: FormerTable) -> list[dict]:
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
