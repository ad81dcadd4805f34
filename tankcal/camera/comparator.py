"""From comparator readings to photo coordinates, through the fiducial or reseau marks of a photo.

    affine      x' = a1 x + a2 y + a3,   y' = a4 x + a5 y + a6
    similarity  the same with a5 = a1 and a4 = -a2

The readings of the marks are the observations, their calibrated coordinates (x', y') hold exactly;
least squares by tankcal.adjust. A transformed point carries its own covariance, turned into the
photo system, and that of the parameters:

    C = M C_point M' + J C_parameters J',   M = [[a1, a2], [a4, a5]]

The second part is common to all points of a photo, so it does not shrink when readings are
averaged. Millimetres throughout. Source: Silva 1995 (59); Mikhail & Ackermann 1976, ch. 9.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tankcal.adjust import adjust
from tankcal.errors import SolutionError
from tankcal.messages import message

KINDS = {"affine": 3, "similarity": 2}  # and the fewest marks that determine each
GROSS = 0.002  # residual of a mark over the extent of the marks: more than film ever shrinks
SHEAR = 0.01  # largest over smallest scale of an affine transformation, less 1
ONE_LINE = 0.01  # width of the marks over their length: below, they lie on one line
SCALES = (0.8, 1.25)  # a comparator reads the photo itself, in millimetres


@dataclass(frozen=True)
class Repeats:
    """Repeated readings of n different things, in the order of their first readings.

    Attributes
    ----------
    group : ndarray of int, shape (readings,)
        Number of the thing.
    first, count : ndarray of int, shape (n,)
        Number of its first reading, and how many there are.
    mean : ndarray, shape (n, 2)
        Mean without weights.
    sd : ndarray, shape (n, 2)
        Standard deviation of one reading, from the sample; nan for a single reading.
    """

    group: np.ndarray
    first: np.ndarray
    count: np.ndarray
    mean: np.ndarray
    sd: np.ndarray

    def beyond(self, limit):
        """(n,) True where the sd of x or of y exceeds a limit; None: nowhere."""
        with np.errstate(invalid="ignore"):
            return (self.sd > (np.inf if limit is None else limit)).any(axis=1)


def repeats(names, values):
    """Gather the repeated readings of things by their names.

    Parameters
    ----------
    names : sequence of m hashables
        What each reading is of.
    values : array_like, shape (m, 2)
        The readings.

    Returns
    -------
    Repeats
        In the unit of the readings.

    Examples
    --------
    >>> found = repeats(["A", "B", "A"], [[0, 0], [5, 5], [0.002, 0]])
    >>> found.count, found.mean[:, 0].tolist()
    (array([2, 1]), [0.001, 5.0])
    """
    numbers = {}
    group = np.array([numbers.setdefault(name, len(numbers)) for name in names], dtype=int)
    values = np.asarray(values, dtype=float).reshape(len(group), 2)
    count = np.bincount(group, minlength=len(numbers))
    first = np.unique(group, return_index=True)[1]
    away = values - values[first][group]  # the digits that readings have in common are taken off
    sums = np.zeros((2, len(numbers), 2))
    np.add.at(sums[0], group, away)
    mean = sums[0] / count[:, None]
    np.add.at(sums[1], group, (away - mean[group]) ** 2)
    dof = np.where(count > 1, count - 1, np.nan)[:, None]
    return Repeats(group, first, count, values[first] + mean, np.sqrt(sums[1] / dof))


@dataclass(frozen=True)
class Transformation:
    """A plane transformation from readings to the photo system, with its covariance.

    Attributes
    ----------
    kind : str
        One of KINDS.
    matrix : ndarray, shape (2, 2)
        M.
    shift_mm : ndarray, shape (2,)
        a3, a6, mm.
    centre_mm : ndarray, shape (2,)
        Centre of the readings, mm.
    covariance : ndarray, shape (6, 6)
        Of a1, a2, x', a4, a5, y': M's elements and the image of this centre; of variance factor 1.
    residuals_mm : ndarray, shape (n, 2)
        Of the readings in the photo system, transformed minus calibrated, mm.
    chi2, dof : float, int
        Of the residuals, in the declared standard deviations of the readings.
    """

    kind: str
    matrix: np.ndarray
    shift_mm: np.ndarray
    centre_mm: np.ndarray
    covariance: np.ndarray
    residuals_mm: np.ndarray
    chi2: float
    dof: int

    @property
    def sigma0(self):
        """A-posteriori root of the variance factor; nan when nothing is redundant."""
        return float(np.sqrt(self.chi2 / self.dof)) if self.dof > 0 else np.nan

    @property
    def parameters(self):
        """{name: value} a1 to a6 of the affine form, mm where they are shifts."""
        (a1, a2), (a4, a5) = self.matrix
        return dict(zip(_NAMES, (a1, a2, self.shift_mm[0], a4, a5, self.shift_mm[1]), strict=True))

    @property
    def parameter_sds(self):
        """{name: sd} of a1 to a6."""
        turn = np.eye(6)
        turn[2, :2], turn[5, 3:5] = -self.centre_mm, -self.centre_mm
        return dict(zip(_NAMES, np.sqrt(np.diag(turn @ self.covariance @ turn.T)), strict=True))

    @property
    def is_mirrored(self):
        """True when it turns the image over."""
        return bool(np.linalg.det(self.matrix) < 0)

    @property
    def scales(self):
        """(2,) largest and smallest scale over all directions."""
        return np.linalg.svd(self.matrix, compute_uv=False)

    def of(self, xy_mm):
        """(n, 2) photo coordinates of readings (n, 2)."""
        return (np.asarray(xy_mm) - self.centre_mm) @ self.matrix.T + (
            self.matrix @ self.centre_mm + self.shift_mm
        )

    def turned(self, sd_mm):
        """(n, 2) sds in the photo system of readings with sds (n, 2) along the comparator."""
        return np.sqrt(np.asarray(sd_mm) ** 2 @ (self.matrix**2).T)

    def added_covariance(self, xy_mm):
        """(n, 2, 2) mm2 that the parameters add to points read at (n, 2)."""
        rows = _rows(np.asarray(xy_mm, dtype=float) - self.centre_mm).reshape(-1, 2, 6)
        return np.einsum("nik,kl,njl->nij", rows, self.covariance, rows)


_NAMES = ("a1", "a2", "a3", "a4", "a5", "a6")
_SIX = {  # a1, a2, x', a4, a5, y' by the parameters of each kind
    "affine": np.eye(6),
    "similarity": np.array(
        [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1]],
        dtype=float,
    ),
}


def transformation(readings_mm, marks_mm, sd_mm, kind="affine"):
    """The transformation that takes readings of marks to their calibrated coordinates.

    Parameters
    ----------
    readings_mm : array_like, shape (n, 2)
        Readings, mm; a mark may be there several times.
    marks_mm : array_like, shape (n, 2)
        Calibrated coordinates, mm, exact.
    sd_mm : float or array_like, shape (n, 2)
        Standard deviations of the readings, mm.
    kind : str, optional
        One of KINDS.

    Returns
    -------
    Transformation

    Raises
    ------
    SolutionError
        When the marks are too few, or lie on one line (affine).

    Examples
    --------
    >>> readings = [[1, 1], [11, 1], [1, 11], [11, 11]]
    >>> found = transformation(readings, [[0, 0], [10, 0], [0, 10], [10, 10]], 0.005)
    >>> found.of([[6.0, 6.0]]).round(9), found.dof
    (array([[5., 5.]]), 2)
    """
    readings = np.asarray(readings_mm, dtype=float)
    marks = np.asarray(marks_mm, dtype=float)
    start = _linear(readings, marks, kind)
    centre, to_six = readings.mean(axis=0), _SIX[kind]
    variance = np.broadcast_to(np.asarray(sd_mm, dtype=float) ** 2, readings.shape).ravel()

    def model(p, observed):
        six = to_six @ p
        a = _rows(observed.reshape(-1, 2) - centre)
        b = np.kron(np.eye(len(readings)), six[[0, 1, 3, 4]].reshape(2, 2))
        return a @ six - marks.ravel(), a @ to_six, b

    found = adjust(model, start, readings.ravel(), variance)
    six = to_six @ found.unknowns
    matrix = six[[0, 1, 3, 4]].reshape(2, 2)
    return Transformation(
        kind=kind,
        matrix=matrix,
        shift_mm=six[[2, 5]] - matrix @ centre,
        centre_mm=centre,
        covariance=to_six @ found.cofactor @ to_six.T,
        residuals_mm=(readings - centre) @ matrix.T + six[[2, 5]] - marks,
        chi2=found.chi2,
        dof=found.dof,
    )


def _rows(away):
    """(2n, 6) image of places (n, 2), counted from the centre, by a1, a2, x', a4, a5, y'."""
    x, y = away.T
    zero, one = np.zeros_like(x), np.ones_like(x)
    both = np.array([[x, y, one, zero, zero, zero], [zero, zero, zero, x, y, one]])
    return both.transpose(2, 0, 1).reshape(-1, 6)


def _linear(readings, marks, kind):
    """Parameters (6,) or (4,) that fit best in the photo system; SolutionError where none do."""
    away = readings - readings.mean(axis=0)
    if len(readings) < KINDS[kind]:
        raise SolutionError(
            message(
                "fiducials_too_few",
                "{count} marks: at least {needed} are needed",
                count=len(readings),
                needed=KINDS[kind],
            )
        )
    rows = _rows(away) @ _SIX[kind]
    sizes = np.linalg.svd(away, compute_uv=False)
    if sizes[0] == 0 or (kind == "affine" and sizes[1] < ONE_LINE * sizes[0]):
        raise SolutionError(
            message(
                "marks_on_a_line",
                "the marks lie on one line: they do not determine the transformation",
            )
        )
    return np.linalg.lstsq(rows, marks.ravel(), rcond=None)[0]


@dataclass(frozen=True)
class Suspicion:
    """What is wrong with the marks of a photo, as far as they tell.

    Attributes
    ----------
    what : str
        "mirrored" (the whole plate), "exchanged" (two marks), "wrong" (one mark), "misfit" (nobody
        knows which), "unit" (of another scale than 1), "sheared".
    marks : tuple of tuples of int
        Numbers of marks, a tuple for each way that would mend it; of "misfit" the mark of the
        largest residual; else ().
    size : float
        Largest residual over the extent of the marks; of "unit" and "sheared" the scale.
    """

    what: str
    marks: tuple
    size: float


def suspicion(readings_mm, marks_mm, kind="affine"):
    """What is wrong with the marks of a photo, each read once, if anything is.

    A fit that is worse than film can be, or a transformation that no comparator makes. Which mark
    it is, is found by trial: the plate turned over, two marks exchanged, one mark left out.

    Parameters
    ----------
    readings_mm, marks_mm : array_like, shape (n, 2)
        Readings and calibrated coordinates, mm.
    kind : str, optional
        One of KINDS.

    Returns
    -------
    Suspicion or None

    Examples
    --------
    >>> readings = [[0, 0], [10, 0], [0, 10], [10, 10], [5, 0]]
    >>> found = suspicion(readings, [[10, 0], [0, 0], [0, 10], [10, 10], [5, 0]])
    >>> found.what, found.marks
    ('exchanged', ((0, 1),))
    """
    readings, marks = np.asarray(readings_mm, dtype=float), np.asarray(marks_mm, dtype=float)
    fit = _Fit.of(readings, marks, kind)
    if fit is None:
        return None
    if fit.is_good and fit.impossible is None:
        return None
    n = len(marks)
    turned = _Fit.of(readings * [-1, 1], marks, kind)
    if kind == "similarity" and turned is not None and turned.is_good:
        return Suspicion("mirrored", (), fit.misfit)
    pairs = tuple(p for p in combinations(range(n), 2) if _agrees(readings, marks, kind, p))
    if 0 < len(pairs) < 3:
        return Suspicion("exchanged", pairs, fit.misfit)
    if fit.is_good:
        return fit.impossible
    few = n < KINDS[kind] + 2 or pairs
    alone = [] if few else [k for k in range(n) if _spared(readings, marks, kind, k)]
    if len(alone) == 1:
        return Suspicion("wrong", ((alone[0],),), fit.misfit)
    return Suspicion("misfit", ((fit.worst,),), fit.misfit)


@dataclass(frozen=True)
class _Fit:
    """A fit in the photo system: matrix M, distances (n,) from the marks, extent of the marks."""

    matrix: np.ndarray
    away_mm: np.ndarray
    extent_mm: float

    @classmethod
    def of(cls, readings, marks, kind):
        """That of readings of marks, each once; None where they do not determine it."""
        try:
            six = _SIX[kind] @ _linear(readings, marks, kind)
        except SolutionError:
            return None
        away = (_rows(readings - readings.mean(axis=0)) @ six).reshape(-1, 2) - marks
        extent = float(np.linalg.norm(np.ptp(marks, axis=0)))
        return cls(six[[0, 1, 3, 4]].reshape(2, 2), np.linalg.norm(away, axis=1), extent)

    @property
    def worst(self):
        return int(np.argmax(self.away_mm))

    @property
    def misfit(self):
        return float(self.away_mm.max() / self.extent_mm)

    @property
    def is_good(self):
        return self.misfit < GROSS

    @property
    def impossible(self):
        """Suspicion about its scales, or None."""
        large, small = np.linalg.svd(self.matrix, compute_uv=False)
        if large > (1 + SHEAR) * small:
            return Suspicion("sheared", (), float(large / small))
        if not SCALES[0] <= small <= large <= SCALES[1]:
            return Suspicion("unit", (), float(np.sqrt(large * small)))
        return None

    @property
    def is_sound(self):
        return self.is_good and self.impossible is None and np.linalg.det(self.matrix) > 0


def _agrees(readings, marks, kind, pair):
    """Is all well when two marks change their names?"""
    order = np.arange(len(marks))
    order[list(pair)] = pair[::-1]
    fit = _Fit.of(readings[order], marks, kind)
    return fit is not None and fit.is_sound


def _spared(readings, marks, kind, number):
    """Is all well without one mark?"""
    kept = np.arange(len(marks)) != number
    fit = _Fit.of(readings[kept], marks[kept], kind)
    return fit is not None and fit.is_sound
