"""Least-squares fit of a lying tank or a sphere to the rows of its capacity table.

Volumes are those of `tankcal.tank.solids`. Volumes rounded to q have a standard deviation of
q / sqrt(12). Rounded dips contribute their own standard deviation times the area of the surface.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message
from tankcal.tank.heads import End, standard_end
from tankcal.tank.solids import LyingTank, Sphere

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
    covariance : (unknowns, unknowns) ndarray
    residuals_m3 : (rows,) ndarray
        Table minus solid.
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
        """Value and u of an unknown."""
        k = self.names.index(name)
        return float(self.values[k]), float(self.u[k])

    @property
    def below_bottom_m(self):
        """Height of the inside bottom above the zero of the dips, m; 0 if not larger than u.

        A job has no dip plate below the bottom. Its dips are smaller than those of the table by
        this height.
        """
        zero, u = self["zero"]
        return max(-zero, 0.0) if -zero > 3 * u else 0.0

    @property
    def mirrored(self):
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
    def of(cls, former):
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

    def thinned(self):
        """Return at most MOST_ROWS evenly chosen rows."""
        if len(self.height) <= MOST_ROWS:
            return self
        kept = np.unique(np.linspace(0, len(self.height) - 1, MOST_ROWS).round().astype(int))
        return replace(self, height=self.height[kept], volume=self.volume[kept], sd=self.sd[kept])


def flat_start(rows):
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
        raise SolutionError(no_fit())
    at_limit = (solved.x - low < _BOUND * scale) | (high - solved.x < _BOUND * scale)
    if np.any(at_limit):
        raise SolutionError(no_fit())
    chi2, dof = float(solved.fun @ solved.fun), len(rows.height) - len(names)
    # Scaled unknowns of similar size make the rank decision independent of their units.
    covariance, u = _covariance(solved.jac * scale, scale, _variance_factor(chi2, dof))
    left = solved.fun * rows.sd
    return SolidFit(
        kind, ends, names, solved.x, u, covariance, left, float(np.sqrt(np.mean(left**2))), chi2,
        dof, solid(solved.x),
    )  # fmt: skip


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


def _covariance(jacobian, scale, factor):
    """Return (covariance, u) of the unknowns; inf if the rows do not determine one of them."""
    _, values, rows = np.linalg.svd(jacobian, full_matrices=False)
    good = values > _STEEP * values[0]
    inverse = (rows[good].T / values[good] ** 2) @ rows[good]
    # unknowns with a share in the undetermined directions
    lost = (rows[~good] ** 2).sum(axis=0) > 1e-6
    covariance = factor * inverse * np.outer(scale, scale)
    return covariance, np.where(lost, np.inf, np.sqrt(np.diag(covariance)))


def _volumes(tank, dips_m):
    """Volumes at dips.

    Those of the empty tank below the bottom, and of the full tank above the top.
    """
    return tank.volume_m3(np.clip(dips_m, 0.0, tank.top_m))


def no_fit():
    """Return the message that no solid fits."""
    return message("former_no_solid", "no tank of this kind fits the volumes of the table")
