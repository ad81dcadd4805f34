"""One fit of a lying tank or a sphere to the rows of its capacity table, by least squares.

The volumes are those of `tankcal.tank.solids`. Weights: volumes rounded to q have a standard
deviation of q / sqrt(12), and rounded dips one of their own times the area of the surface.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message
from tankcal.tank.heads import End, standard_end
from tankcal.tank.solids import LyingTank, Sphere

FEWEST_ROWS = 8
MOST_ROWS = 120  # that ends and tilt are chosen by; the sizes are of all rows
LARGEST_TILT = 0.1
HIGHEST_PART = 30.0  # diameter over the highest row: a table may end near the bottom
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
class WetRows:
    """Rows with liquid, and their standard deviations by rounding."""

    height: np.ndarray
    volume: np.ndarray
    sd: np.ndarray

    @classmethod
    def of(cls, former):
        """Those of a `FormerTable`; InputError for fewer than 8."""
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


def flat_start(rows):
    """(D, L, 0) of the flat-ended tank of the nearest volumes, D on a grid."""
    found = []
    for part in np.append(np.linspace(0.98, 2.0, 103), np.geomspace(2.05, HIGHEST_PART, 60)):
        diameter = part * rows.height[-1]
        unit = _volumes(LyingTank(diameter, diameter, 1.0), rows.height)
        length = float(unit @ rows.volume / (unit @ unit))
        found.append((np.sum((length * unit - rows.volume) ** 2), diameter, length))
    _, diameter, length = min(found)
    return diameter, length, 0.0


def fit_ends(rows, name, diameter, length, zero, dip_from_a_m, rest=(), tilt=None, is_held=False):
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
        return fit_solid(rows, "horizontal", name, names, np.array(start, dtype=float), solid)
    except SolutionError:
        return None


def fit_solid(rows, kind, ends, names, start, solid):
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
        raise SolutionError(no_fit())
    at_limit = (solved.x - low < _BOUND * scale) | (high - solved.x < _BOUND * scale)
    if np.any(at_limit):
        raise SolutionError(no_fit())
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


def no_fit():
    """Message where no solid fits."""
    return message("former_no_solid", "no tank of this kind fits the volumes of the table")
