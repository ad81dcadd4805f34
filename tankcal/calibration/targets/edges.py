"""Edges of a black square with sub-pixel accuracy, and its corners as their intersections.

Along an edge with t from -1 to 1, at a signed distance d from the straight line through its ends
(positive towards the inside), a pixel of a blurred photograph has the grey value

    (1 + g t) { hi + (lo - hi) [F((d - e(t)) / s) - B(t) F((d - i) / s)]
                   + (out - hi) F((-i - d) / s) }

F is the normal distribution, s the blur, and e(t) = e0 + e1 t + e2 (t2 - 1/3) the edge. B is the
blurred row of code cells, which begins at the distance i, and `out` the grey value beyond a quiet
zone of one cell. i and B follow from the corners and the code; without them, cells only a few blurs
wide would shift the edge. e0, e1, e2, s, hi, lo, g and `out` are estimated by least squares from
the pixels, not from interpolated profiles. i and B are updated until the corners converge. Corners
are intersections of two edges. Pixels next to a corner are not used, because blur rounds it.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from scipy.special import ndtr

CURVED_FROM_PX = 40.0  # length from which a curvature is estimated; below, noise exceeds distortion
BAND_PX = 6.0  # largest half-width of the band of pixels used, px
CELL_SHARE = 0.95  # largest half-width of the band, as a share of a cell
BEYOND_WEIGHT = 0.02  # weight of the weak condition `beyond = high`
MAX_ITERATIONS = 20  # largest number of iterations
FIXED_PIXELS_FROM = 3  # iteration from which the pixels are fixed, to allow convergence
LARGEST_LAST_PX = 0.05  # largest accepted last change of a corner, px
CONVERGED_PX, CONVERGED_SDS = 0.002, 0.1  # change at convergence, px, and in standard deviations
MOST_MOVED_PX = 6.0  # largest change in one iteration, px
SHORTEST_PX = 5.0  # least length of an edge between the excluded ends, px
START_BLUR_PX = 1.2  # initial blur, px
SHARPEST_PX, SOFTEST_PX = 0.15, 12.0  # least and largest blur, px
_ROOT = np.sqrt(2 * np.pi)  # normalisation of the normal density


class NoEdge(Exception):
    """An expected edge could not be fitted."""


@dataclass(frozen=True)
class Edge:
    """Fitted edge.

    Attributes
    ----------
    start, along, inward : ndarray, shape (2,)
        First end of the reference line, px; unit vectors along the line and inwards.
    length_px : float
        Length of the reference line, px.
    curve : ndarray, shape (3,)
        e0, e1, e2, px.
    cofactor_px2 : ndarray, shape (3, 3)
        Covariance matrix of `curve`, px2; zero for e2 if it is not estimated.
    blur_px : float
        Blur s, px.
    levels : ndarray, shape (4,)
        hi, lo, g, out.
    rms : float
        Root mean square of the residuals, grey values.
    """

    start: np.ndarray
    along: np.ndarray
    inward: np.ndarray
    length_px: float
    curve: np.ndarray
    cofactor_px2: np.ndarray
    blur_px: float
    levels: np.ndarray
    rms: float

    @property
    def contrast(self):
        """White minus black, grey values."""
        return float(self.levels[0] - self.levels[1])

    def offset(self, place):
        """Distance of a point (2,) from the edge (px), its gradient (2,) and variance (px2)."""
        q = place - self.start
        t = 2 * (q @ self.along) / self.length_px - 1
        row = np.array([1.0, t, t * t - 1 / 3])
        slope = (self.curve[1] + 2 * self.curve[2] * t) * 2 / self.length_px
        distance = q @ self.inward - row @ self.curve
        return distance, self.inward - slope * self.along, row @ self.cofactor_px2 @ row


def fit_corners(image, corners, cells):
    """Measure the corners of a marker as intersections of its fitted edges.

    Parameters
    ----------
    image : ndarray, shape (lines, columns)
        Grey values.
    corners : array_like, shape (4, 2)
        Corners with an accuracy of one or two pixels, clockwise from the top left as printed, px.
    cells : ndarray, shape (n, n)
        Cells as printed, including the black border: 0 black, 1 white.

    Returns
    -------
    places : ndarray, shape (4, 2)
        Corners, px.
    covariance : ndarray, shape (4, 2, 2)
        Covariance matrices of the corners, px2.
    edges : list of Edge
        The four edges.

    Raises
    ------
    NoEdge
        If an edge cannot be fitted, or the corners do not converge.
    """
    places, blur = np.asarray(corners, dtype=float), START_BLUR_PX
    edges, pixels = [None] * 4, [None] * 4
    for iteration in range(MAX_ITERATIONS):
        lines = [_reference_line(places, side, len(cells)) for side in range(4)]
        if iteration <= FIXED_PIXELS_FROM:
            margin = 2.5 * max(blur, 0.7) + (0.5 if iteration else 1.5)
            pixels = [
                _select_pixels(image, line, margin, _band_width(line, blur, iteration > 0))
                for line in lines
            ]
        edges = [
            _fit_edge(image, lines[side], pixels[side], np.rot90(cells, side)[1], edges[side], blur)
            for side in range(4)
        ]
        blur = float(np.median([edge.blur_px for edge in edges]))
        meeting = [_intersect(edges[k - 1], edges[k], places[k]) for k in range(4)]
        before, places = places, np.array([place for place, _ in meeting])
        covariance = np.array([spread for _, spread in meeting])
        moved = np.abs(places - before).max()
        if not moved < MOST_MOVED_PX:
            break
        sd = np.sqrt(np.trace(covariance, axis1=1, axis2=2).min() / 2)
        if iteration > 1 and moved < max(CONVERGED_PX, CONVERGED_SDS * sd):
            break
    if not moved < LARGEST_LAST_PX:
        raise NoEdge("unsteady")
    return places, covariance + moved**2 * np.eye(2), edges


@dataclass(frozen=True)
class _Line:
    """Straight line of an edge, and the inner line of the border.

    `inner` (2, 2) contains the inner ends of the cells of the border, px. `cells` is the number of
    cells along the edge.
    """

    start: np.ndarray
    along: np.ndarray
    inward: np.ndarray
    length: float
    inner: np.ndarray
    cells: int

    @property
    def depths(self):
        """Width of the border at both ends of `inner`, shape (2,), px."""
        return (self.inner - self.start) @ self.inward


def _reference_line(corners, side, cells):
    corners = np.roll(corners, -side, axis=0)
    start, end = corners[:2]
    length = float(np.hypot(*(end - start)))
    if not length > SHORTEST_PX:
        raise NoEdge("short")
    along = (end - start) / length
    inward = np.array([-along[1], along[0]])
    return _Line(start, along, inward, length, _inner_line(corners, cells), cells)


def _fit_edge(image, line, pixels, bits, before, blur):
    """Fit an Edge along a _Line to pixels (lines, columns), starting from the edge `before`."""
    x, y = pixels[1] - line.start[0], pixels[0] - line.start[1]
    t = x * line.along[0] + y * line.along[1]
    d = x * line.inward[0] + y * line.inward[1]
    grey = image[pixels].astype(float)
    places = (line.inner - line.start) @ line.along
    columns = np.interp(t, places, (1.0, line.cells - 1.0))
    depth = np.interp(t, places, line.depths)
    t = 2 * t / line.length - 1
    model = _Model(t, d, grey, depth, columns, bits, line.cells / line.length)
    levels = None if before is None else before.levels
    result = model.fit(blur, levels, line.length >= CURVED_FROM_PX)
    return Edge(line.start, line.along, line.inward, line.length, *result)


def _band_width(line, blur, is_final):
    """Half-width of the band of pixels used, px."""
    wanted = min(3.5 * blur + 0.5 if is_final else BAND_PX, BAND_PX)
    return max(min(wanted, CELL_SHARE * float(line.depths.min())), 2.0)


def _inner_line(corners, count):
    """Images (2, 2) of the inner ends of the cells of the border at the first edge, px."""
    p0, p1, p2, p3 = corners
    # Third row of the homography of the unit square, from the deviation from a parallelogram
    defect = p0 - p1 + p2 - p3
    g, h = np.linalg.solve(np.column_stack([p1 - p2, p3 - p2]), defect)
    across, down = p1 - p0 + g * p1, p3 - p0 + h * p3
    u = np.array([1 / count, 1 - 1 / count])
    v = 1 / count
    return (p0 + u[:, None] * across + v * down) / (1 + g * u + h * v)[:, None]


def _select_pixels(image, line, margin, band):
    """Lines and columns of the pixels near an edge, except near its ends."""
    margin = min(margin, max(line.length / 4, (line.length - SHORTEST_PX) / 2))
    ends = line.start + np.outer([0, line.length], line.along)
    low = np.maximum(np.floor(ends.min(axis=0) - band - 1), 0).astype(int)
    high = np.ceil(ends.max(axis=0) + band + 1).astype(int)
    high = np.minimum(high, np.array(image.shape)[::-1] - 1)
    if (high <= low).any():
        raise NoEdge("outside")
    row, column = np.mgrid[low[1] : high[1] + 1, low[0] : high[0] + 1]
    x, y = column - line.start[0], row - line.start[1]
    t = x * line.along[0] + y * line.along[1]
    d = x * line.inward[0] + y * line.inward[1]
    is_used = (t >= margin) & (t <= line.length - margin) & (np.abs(d) <= band)
    if is_used.sum() < 20:
        raise NoEdge("short")
    return row[is_used], column[is_used]


class _Model:
    """Model of the grey values of the pixels near an edge, with derivatives."""

    def __init__(self, t, d, grey, depth, columns, bits, cells_per_px):
        self.t, self.d, self.grey, self.depth = t, d, grey, depth
        self.columns, self.bits, self.cells_per_px = columns, bits, cells_per_px
        self.rows = np.column_stack([np.ones_like(t), t, t * t - 1 / 3])

    def fit(self, blur, levels, is_curved):
        """Fit the model; return curve, cofactor, blur, levels and rms as in Edge."""
        self.degree = k = 3 if is_curved else 2
        self.row_of_code = self._blur_code(blur)
        if levels is None:
            levels = self._estimate_levels()
        start = np.concatenate([np.zeros(k), [np.log(blur)], levels])
        fit = scipy.optimize.least_squares(
            self.residuals, start, self.jacobian, method="lm", x_scale="jac", max_nfev=60
        )
        e, dof = fit.x, len(self.grey) - len(start)
        blur = float(np.exp(np.clip(e[k], -9, 9)))
        if dof <= 0 or not SHARPEST_PX < blur < SOFTEST_PX or not np.isfinite(e).all():
            raise NoEdge("blur")
        variance = float(2 * fit.cost / dof)
        cofactor = np.zeros((3, 3))
        cofactor[:k, :k] = variance * _inverse_normal(fit.jac)[:k, :k]
        curve = np.append(e[:k], np.zeros(3 - k))
        return curve, cofactor, blur, e[k + 1 :], np.sqrt(variance)

    def _estimate_levels(self):
        outside, inside = self.grey[self.d < -1], self.grey[self.d > 1]
        if not (len(outside) and len(inside)):
            raise NoEdge("short")
        high, low = np.percentile(outside, 75), np.percentile(inside, 25)
        return np.array([high, low, 0.0, high])

    def _blur_code(self, blur):
        """Row of code cells next to the border, blurred along the edge, at each pixel (n,)."""
        s = max(blur, 0.3) * self.cells_per_px
        steps = ndtr((self.columns[:, None] - np.arange(len(self.bits) + 1)) / s)
        return (steps[:, :-1] - steps[:, 1:]) @ self.bits

    def _evaluate(self, e):
        k = self.degree
        s = np.exp(np.clip(e[k], -3, 3))
        z = (self.d - self.rows[:, :k] @ e[:k]) / s
        inner = (self.d - self.depth) / s
        outer = (-self.depth - self.d) / s
        return k, s, z, inner, outer, ndtr(z) - self.row_of_code * ndtr(inner), ndtr(outer)

    def residuals(self, e):
        """Computed minus measured grey values, and the weak condition `beyond = high`."""
        k, *_, dark, out = self._evaluate(e)
        high, low, gradient, beyond = e[k + 1 :]
        grey = high + (low - high) * dark + (beyond - high) * out
        misclosure = (1 + gradient * self.t) * grey - self.grey
        return np.append(misclosure, BEYOND_WEIGHT * (beyond - high))

    def jacobian(self, e):
        """Derivatives of the residuals by the parameters, shape (n + 1, parameters)."""
        k, s, z, inner, outer, dark, out = self._evaluate(e)
        high, low, gradient, beyond = e[k + 1 :]
        gain = 1 + gradient * self.t
        # The derivative of F is the normal density; the chain rule applies to each term.
        density, of_code, of_outer = (np.exp(-q * q / 2) / _ROOT for q in (z, inner, outer))
        of_code = self.row_of_code * of_code
        slope = gain * (low - high)
        by_blur = (
            -slope * (density * z - of_code * inner) - gain * (beyond - high) * of_outer * outer
        )
        by_edge = -(slope * density / s)[:, None] * self.rows[:, :k]
        value = high + (low - high) * dark + (beyond - high) * out
        rows = np.column_stack(
            [by_edge, by_blur, gain * (1 - dark - out), gain * dark, self.t * value, gain * out]
        )
        last = np.zeros(rows.shape[1])
        last[k + 1], last[-1] = -BEYOND_WEIGHT, BEYOND_WEIGHT
        return np.vstack([rows, last])


def _inverse_normal(jacobian):
    """(J'J)^-1, computed with columns of equal norm."""
    scale = np.linalg.norm(jacobian, axis=0)
    if not (scale > 0).all():
        raise NoEdge("flat")
    scaled = jacobian / scale
    normal = scaled.T @ scaled
    if np.linalg.cond(normal) > 1e12:
        raise NoEdge("flat")
    return np.linalg.inv(normal) / np.outer(scale, scale)


def _intersect(before, after, start):
    """Intersection (2,) of two edges, px, and its covariance matrix (2, 2), px2."""
    place = np.array(start, dtype=float)
    # Newton iteration for the point at distance zero from both curves
    for _ in range(6):
        first, second = before.offset(place), after.offset(place)
        gradient = np.array([first[1], second[1]])
        if abs(np.linalg.det(gradient)) < 0.05:
            raise NoEdge("parallel")
        place = place - np.linalg.solve(gradient, [first[0], second[0]])
    inverse = np.linalg.inv(gradient)
    return place, inverse @ np.diag([first[2], second[2]]) @ inverse.T
