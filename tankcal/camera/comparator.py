"""Refinement of image points: comparator readings with fiducial marks, unflatness of film.

    affine      x' = a1 x + a2 y + a3,   y' = a4 x + a5 y + a6
    similarity  the same with a5 = a1 and a4 = -a2

The readings of the marks are the observations. Their calibrated coordinates (x', y') are exact. The
parameters follow by least squares (tankcal.adjust). The covariance of a transformed point has two
parts, its own covariance in the photo system and the covariance of the parameters:

    C = M C_point M' + J C_parameters J',   M = [[a1, a2], [a4, a5]]

The second part is common to all points of a photo, and averaging of readings does not reduce it.
All lengths are in mm.

Source: Silva 1995 (59); Mikhail & Ackermann 1976, ch. 9.

Unflatness of film
------------------

The surface of the film has the height h above this plane at the point (x, y), positive towards the
lens. The ray through the projection centre, at the principal distance c, that meets the surface at
this point meets the plane at

    x' = x c / (c - h),   dx = x h / (c - h)

with coordinates from the principal point, and likewise for y. dx = (x/c) h (Silva 60) is the
first-order term. On a film that rises towards the lens, image points are too close to the middle,
and the correction moves them outwards. All lengths are in mm.

Source: Silva 1995 (60).
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tankcal.adjust import adjust
from tankcal.errors import SolutionError
from tankcal.messages import message

KINDS = {"affine": 3, "similarity": 2}  # least number of marks
GROSS = 0.002  # residual of a mark, relative to the extent; larger than any film shrinkage
SHEAR = 0.01  # largest ratio of the scales of an affine transformation, minus 1
LINE_RATIO = 0.01  # ratio of width to length below which the marks lie on a line
SCALES = (0.8, 1.25)  # limits of the scale: a comparator measures the photo itself, in mm


@dataclass(frozen=True)
class Repeats:
    """Repeated readings of n distinct points, in the order of their first readings.

    Attributes
    ----------
    group : ndarray of int, shape (readings,)
        Number of the point of each reading.
    first, count : ndarray of int, shape (n,)
        Index of the first reading, and number of readings.
    mean : ndarray, shape (n, 2)
        Unweighted mean.
    sd : ndarray, shape (n, 2)
        Sample standard deviation of one reading; nan for a single reading.
    """

    group: np.ndarray
    first: np.ndarray
    count: np.ndarray
    mean: np.ndarray
    sd: np.ndarray

    def exceeds(self, limit):
        """True (n,) where the standard deviation of x or y exceeds a limit; None: no limit."""
        with np.errstate(invalid="ignore"):
            return (self.sd > (np.inf if limit is None else limit)).any(axis=1)


def group_readings(names, values):
    """Group repeated readings by name.

    Parameters
    ----------
    names : sequence of hashable, length m
        Name of the point of each reading.
    values : array_like, shape (m, 2)
        Readings.

    Returns
    -------
    Repeats
        In the unit of the readings.

    Examples
    --------
    >>> readings = group_readings(["A", "B", "A"], [[0, 0], [5, 5], [0.002, 0]])
    >>> readings.count, readings.mean[:, 0].tolist()
    (array([2, 1]), [0.001, 5.0])
    """
    numbers = {}
    group = np.array([numbers.setdefault(name, len(numbers)) for name in names], dtype=int)
    values = np.asarray(values, dtype=float).reshape(len(group), 2)
    count = np.bincount(group, minlength=len(numbers))
    first = np.unique(group, return_index=True)[1]
    # Subtracting the first reading avoids cancellation in the sum of squares.
    deviations = values - values[first][group]
    sums = np.zeros((2, len(numbers), 2))
    np.add.at(sums[0], group, deviations)
    mean = sums[0] / count[:, None]
    np.add.at(sums[1], group, (deviations - mean[group]) ** 2)
    dof = np.where(count > 1, count - 1, np.nan)[:, None]
    return Repeats(group, first, count, values[first] + mean, np.sqrt(sums[1] / dof))


@dataclass(frozen=True)
class Transformation:
    """Plane transformation from readings to the photo system, with its covariance.

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
        Covariance of a1, a2, x', a4, a5, y' for variance factor 1, with (x', y') the image of the
        centre.
    residuals_mm : ndarray, shape (n, 2)
        Residuals in the photo system, transformed minus calibrated, mm.
    chi2, dof : float, int
        Weighted sum of squared residuals, and degrees of freedom.
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
        """Square root of the a-posteriori variance factor; nan without redundancy."""
        return float(np.sqrt(self.chi2 / self.dof)) if self.dof > 0 else np.nan

    @property
    def parameters(self):
        """Parameters a1 to a6 of the affine form by name; a3 and a6 in mm."""
        (a1, a2), (a4, a5) = self.matrix
        return dict(zip(_NAMES, (a1, a2, self.shift_mm[0], a4, a5, self.shift_mm[1]), strict=True))

    @property
    def parameter_sds(self):
        """Standard deviations of a1 to a6 by name."""
        # a3 = x' - M centre: the covariance refers to the image of the centre, not to the shift.
        turn = np.eye(6)
        turn[2, :2], turn[5, 3:5] = -self.centre_mm, -self.centre_mm
        return dict(zip(_NAMES, np.sqrt(np.diag(turn @ self.covariance @ turn.T)), strict=True))

    @property
    def is_mirrored(self):
        """Whether the transformation mirrors the image."""
        return bool(np.linalg.det(self.matrix) < 0)

    @property
    def scales(self):
        """Largest and smallest scale (2,) over all directions."""
        return np.linalg.svd(self.matrix, compute_uv=False)

    def transform(self, xy_mm):
        """Photo coordinates (n, 2) of readings (n, 2)."""
        return (np.asarray(xy_mm) - self.centre_mm) @ self.matrix.T + (
            self.matrix @ self.centre_mm + self.shift_mm
        )

    def propagate_sds(self, sd_mm):
        """Standard deviations (n, 2) in the photo system, from those along the comparator axes."""
        return np.sqrt(np.asarray(sd_mm) ** 2 @ (self.matrix**2).T)

    def parameter_covariance(self, xy_mm):
        """Covariance (n, 2, 2), mm2, of points read at (n, 2) caused by the parameters."""
        # J C J', the part that is common to all points of the photo.
        rows = _design_rows(np.asarray(xy_mm, dtype=float) - self.centre_mm).reshape(-1, 2, 6)
        return np.einsum("nik,kl,njl->nij", rows, self.covariance, rows)


_NAMES = ("a1", "a2", "a3", "a4", "a5", "a6")
_TO_AFFINE = {  # derivatives of a1, a2, x', a4, a5, y' by the parameters of each kind
    "affine": np.eye(6),
    "similarity": np.array(
        [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1]],
        dtype=float,
    ),
}


def fit_transformation(readings_mm, marks_mm, sd_mm, kind="affine"):
    """Determine the transformation from readings of marks to their calibrated coordinates.

    Parameters
    ----------
    readings_mm : array_like, shape (n, 2)
        Readings, mm; a mark may occur repeatedly.
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
        If the marks are too few, or lie on a line (affine).

    Examples
    --------
    >>> readings = [[1, 1], [11, 1], [1, 11], [11, 11]]
    >>> result = fit_transformation(readings, [[0, 0], [10, 0], [0, 10], [10, 10]], 0.005)
    >>> result.transform([[6.0, 6.0]]).round(9), result.dof
    (array([[5., 5.]]), 2)
    """
    readings = np.asarray(readings_mm, dtype=float)
    marks = np.asarray(marks_mm, dtype=float)
    start = _fit_linear(readings, marks, kind)
    # Readings relative to their centre reduce the correlation of shift and matrix.
    centre, to_affine = readings.mean(axis=0), _TO_AFFINE[kind]
    variance = np.broadcast_to(np.asarray(sd_mm, dtype=float) ** 2, readings.shape).ravel()

    def model(p, observed):
        affine = to_affine @ p
        # Conditions f = J p - mark = 0, with B the matrix M for each reading.
        a = _design_rows(observed.reshape(-1, 2) - centre)
        b = np.kron(np.eye(len(readings)), affine[[0, 1, 3, 4]].reshape(2, 2))
        return a @ affine - marks.ravel(), a @ to_affine, b

    result = adjust(model, start, readings.ravel(), variance)
    affine = to_affine @ result.unknowns
    matrix = affine[[0, 1, 3, 4]].reshape(2, 2)
    return Transformation(
        kind=kind,
        matrix=matrix,
        shift_mm=affine[[2, 5]] - matrix @ centre,
        centre_mm=centre,
        covariance=to_affine @ result.cofactor @ to_affine.T,
        residuals_mm=(readings - centre) @ matrix.T + affine[[2, 5]] - marks,
        chi2=result.chi2,
        dof=result.dof,
    )


def _design_rows(centred):
    """Derivatives (2n, 6) of the image of centred points (n, 2) by a1, a2, x', a4, a5, y'."""
    x, y = centred.T
    zeros, ones = np.zeros_like(x), np.ones_like(x)
    stacked = np.array([[x, y, ones, zeros, zeros, zeros], [zeros, zeros, zeros, x, y, ones]])
    return stacked.transpose(2, 0, 1).reshape(-1, 6)


def _fit_linear(readings, marks, kind):
    """Least-squares parameters (6,) or (4,) in the photo system; raises SolutionError."""
    centred = readings - readings.mean(axis=0)
    if len(readings) < KINDS[kind]:
        raise SolutionError(
            message(
                "fiducials_too_few",
                "{count} marks: at least {needed} are needed",
                count=len(readings),
                needed=KINDS[kind],
            )
        )
    rows = _design_rows(centred) @ _TO_AFFINE[kind]
    # Singular values of the centred readings: length and width of the marks.
    sizes = np.linalg.svd(centred, compute_uv=False)
    if sizes[0] == 0 or (kind == "affine" and sizes[1] < LINE_RATIO * sizes[0]):
        raise SolutionError(
            message(
                "marks_on_a_line",
                "the marks lie on one line: they do not determine the transformation",
            )
        )
    return np.linalg.lstsq(rows, marks.ravel(), rcond=None)[0]


@dataclass(frozen=True)
class MarkError:
    """Suspected error in the marks of a photo.

    Attributes
    ----------
    what : str
        "mirrored" (whole plate), "exchanged" (two marks), "wrong" (one mark), "misfit" (unknown
        mark), "unit" (scale other than 1), or "sheared".
    marks : tuple of tuples of int
        Indices of the marks, a tuple for each possible correction; for "misfit", the mark with the
        largest residual; else ().
    size : float
        Largest residual relative to the extent of the marks; for "unit" and "sheared", the scale.
    """

    what: str
    marks: tuple
    size: float


def find_mark_error(readings_mm, marks_mm, kind="affine"):
    """Search for an error in the marks of a photo, each with a single reading.

    An error is suspected if the fit is worse than the distortion of film, or if no comparator can
    cause the transformation. The error is located by trial: mirrored plate, exchange of two marks,
    omission of one mark.

    Parameters
    ----------
    readings_mm, marks_mm : array_like, shape (n, 2)
        Readings and calibrated coordinates, mm.
    kind : str, optional
        One of KINDS.

    Returns
    -------
    MarkError or None

    Examples
    --------
    >>> readings = [[0, 0], [10, 0], [0, 10], [10, 10], [5, 0]]
    >>> error = find_mark_error(readings, [[10, 0], [0, 0], [0, 10], [10, 10], [5, 0]])
    >>> error.what, error.marks
    ('exchanged', ((0, 1),))
    """
    readings, marks = np.asarray(readings_mm, dtype=float), np.asarray(marks_mm, dtype=float)
    fit = _fit_marks(readings, marks, kind)
    if fit is None:
        return None
    if fit.is_good and fit.scale_error is None:
        return None
    n = len(marks)
    mirrored = _fit_marks(readings * [-1, 1], marks, kind)
    # A similarity cannot mirror, so that a mirrored plate gives a bad fit.
    if kind == "similarity" and mirrored is not None and mirrored.is_good:
        return MarkError("mirrored", (), fit.misfit)
    pairs = tuple(
        p for p in combinations(range(n), 2) if _fits_after_exchange(readings, marks, kind, p)
    )
    # More than two possible exchanges do not locate the error.
    if 0 < len(pairs) < 3:
        return MarkError("exchanged", pairs, fit.misfit)
    if fit.is_good:
        return fit.scale_error
    # Without a mark, at least one redundant mark must remain to confirm the fit.
    is_ambiguous = n < KINDS[kind] + 2 or pairs
    wrong_marks = (
        [] if is_ambiguous else [k for k in range(n) if _fits_without(readings, marks, kind, k)]
    )
    if len(wrong_marks) == 1:
        return MarkError("wrong", ((wrong_marks[0],),), fit.misfit)
    return MarkError("misfit", ((fit.worst,),), fit.misfit)


@dataclass(frozen=True)
class _Fit:
    """Fit in the photo system.

    Attributes
    ----------
    matrix : ndarray, shape (2, 2)
        M.
    distance_mm : ndarray, shape (n,)
        Distances from the calibrated marks, mm.
    extent_mm : float
        Diagonal of the marks, mm.
    """

    matrix: np.ndarray
    distance_mm: np.ndarray
    extent_mm: float

    @property
    def worst(self):
        """Index of the mark with the largest residual."""
        return int(np.argmax(self.distance_mm))

    @property
    def misfit(self):
        """Largest residual relative to the extent of the marks."""
        return float(self.distance_mm.max() / self.extent_mm)

    @property
    def is_good(self):
        """Whether the misfit is below GROSS."""
        return self.misfit < GROSS

    @property
    def scale_error(self):
        """MarkError of impossible scales, or None."""
        # Singular values are the extreme scales.
        large, small = np.linalg.svd(self.matrix, compute_uv=False)
        if large > (1 + SHEAR) * small:
            return MarkError("sheared", (), float(large / small))
        if not SCALES[0] <= small <= large <= SCALES[1]:
            return MarkError("unit", (), float(np.sqrt(large * small)))
        return None

    @property
    def is_valid(self):
        """Whether the fit is good, possible and not mirrored."""
        return self.is_good and self.scale_error is None and np.linalg.det(self.matrix) > 0


def _fit_marks(readings, marks, kind):
    """_Fit of readings to marks, each with one reading; None if the marks are insufficient."""
    try:
        affine = _TO_AFFINE[kind] @ _fit_linear(readings, marks, kind)
    except SolutionError:
        return None
    centred = readings - readings.mean(axis=0)
    distances = np.linalg.norm((_design_rows(centred) @ affine).reshape(-1, 2) - marks, axis=1)
    extent = float(np.linalg.norm(np.ptp(marks, axis=0)))
    return _Fit(affine[[0, 1, 3, 4]].reshape(2, 2), distances, extent)


def _fits_after_exchange(readings, marks, kind, pair):
    """Whether the fit is valid after an exchange of two marks."""
    order = np.arange(len(marks))
    order[list(pair)] = pair[::-1]
    fit = _fit_marks(readings[order], marks, kind)
    return fit is not None and fit.is_valid


def _fits_without(readings, marks, kind, number):
    """Whether the fit is valid without one mark."""
    is_kept = np.arange(len(marks)) != number
    fit = _fit_marks(readings[is_kept], marks[is_kept], kind)
    return fit is not None and fit.is_valid


@dataclass(frozen=True)
class Surface:
    """Measured heights of a film or plate.

    Attributes
    ----------
    xy_mm : ndarray, shape (n, 2)
        Positions in the photo system, mm.
    height_mm : ndarray, shape (n,)
        Heights at these positions, mm, positive towards the lens.
    """

    xy_mm: np.ndarray
    height_mm: np.ndarray


def heights_at(surface, xy_mm):
    """Heights of a film, interpolated linearly within triangles.

    Outside the convex hull of the measured positions, the height of the nearest position is used.

    Parameters
    ----------
    surface : Surface
        At least three positions, not on a line.
    xy_mm : array_like, shape (m, 2)
        Positions in the photo system, mm; nan gives nan.

    Returns
    -------
    height_mm : ndarray, shape (m,)
        Heights, mm.
    outside : ndarray of bool, shape (m,)
        True outside the convex hull; False for nan.

    Examples
    --------
    >>> surface = Surface(np.array([[0, 0], [10, 0], [0, 10]]), np.array([0, 0.1, 0]))
    >>> heights_at(surface, [[5, 0], [20, 0]])
    (array([0.05, 0.1 ]), array([False,  True]))
    """
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import cKDTree

    xy_mm = np.asarray(xy_mm, dtype=float)
    # Points without a measurement stay nan.
    is_finite = np.isfinite(xy_mm).all(axis=1)
    heights = np.full(len(xy_mm), np.nan)
    if is_finite.any():
        heights[is_finite] = LinearNDInterpolator(surface.xy_mm, surface.height_mm)(
            xy_mm[is_finite]
        )
    # The interpolator returns nan outside the convex hull.
    outside = is_finite & np.isnan(heights)
    if outside.any():
        nearest = cKDTree(surface.xy_mm).query(xy_mm[outside])[1]
        heights[outside] = surface.height_mm[nearest]
    return heights, outside


def flatten_film(xy_mm, height_mm, interior):
    """Project image points on an uneven film onto the plane of the photo system.

    Parameters
    ----------
    xy_mm : array_like, shape (n, 2)
        Measured image points, mm.
    height_mm : ndarray, shape (n,)
        Height of the film at each point, mm.
    interior : sequence of three
        c, x0, y0, mm, each a number or an array (n,).

    Returns
    -------
    ndarray, shape (n, 2)
        Image points in the plane, mm.

    Notes
    -----
    x' = x + (x - x0) h / (c - h), and likewise for y.

    Examples
    --------
    >>> flatten_film([[50.0, 0.0]], np.array([0.1]), (100.0, 0.0, 0.0))
    array([[50.05005005,  0.        ]])
    """
    c, x0, y0 = (np.asarray(value, dtype=float) for value in interior)
    # Similar triangles with the projection centre at the distance c.
    factor = height_mm / (c - height_mm)
    x, y = np.asarray(xy_mm, dtype=float).T
    return np.column_stack([x + (x - x0) * factor, y + (y - y0) * factor])
