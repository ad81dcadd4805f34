"""Coded targets (ArUco, AprilTag) in a photograph: detection by OpenCV, measurement of the edges.

OpenCV proposes squares and their codes. The fit of their edges determines the corners, and the code
is read again, cell by cell, from these corners. Doubtful targets are refused with a reason. The
corners of OpenCV have errors of 0.2 to 1 px, because blur rounds a corner inwards.

Edges and corners of a square
-----------------------------

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

from dataclasses import dataclass, replace

import numpy as np
import scipy
from scipy.special import ndtr

from tankcal.calibration.targets.results import (
    Marker,
    PhotoTargets,
    RefusedTarget,
    load_dictionary,
    opencv,
)

CELL_PX = 2.5  # least mean width of a cell, px
LEAST_CLARITY = 0.7  # least correlation of the cells with the code
LEAST_CONTRAST = 12.0  # least contrast, grey values of 255
LEAST_TO_NOISE = 4.0  # least contrast, as a multiple of the rms of the residuals of the edges
BORDER_PX = 3.0  # least distance from the edge of the photo, px
MOST_SLANTED = 0.2  # least sine of a corner angle
SD_FLOOR_PX = 0.015  # effects of distortion in a target, print, pixel size and irregular blur, px
NEAR = 0.5  # distance below which two squares are in one place, as a share of a side
DETECTION_ERRORS = 0.6  # rate of errors that OpenCV may correct; such codes are reported as refused
SAMPLES = np.linspace(-0.25, 0.25, 3)  # positions of the samples within a cell
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


@dataclass(frozen=True)
class _Search:
    """Photograph, dictionary of its targets, and limits."""

    image: np.ndarray
    dictionary: object
    bit_errors: int
    smallest_px: float


def read_coded(image, dictionary="DICT_4X4_50", listed=None, bit_errors=0, smallest_px=None):
    """Measure coded targets in a photograph.

    Parameters
    ----------
    image : ndarray, shape (lines, columns)
        Grey values, uint8 or float up to 255.
    dictionary : str, optional
        Name of the dictionary in OpenCV, with or without "DICT_".
    listed : collection of int, optional
        Ids in use; by default all ids of the dictionary.
    bit_errors : int, optional
        Largest number of wrong cells.
    smallest_px : float, optional
        Least mean side, px; by default 2.5 px per cell.

    Returns
    -------
    PhotoTargets
        Markers in the order of their ids, and refused candidates.

    Raises
    ------
    InputError
        If the dictionary is unknown or OpenCV is missing.
    """
    known = load_dictionary(dictionary)
    smallest = CELL_PX * known.cells.shape[1] if smallest_px is None else smallest_px
    search = _Search(np.asarray(image), known, bit_errors, smallest)
    measured = [
        _measure_marker(search, number, corners)
        for number, corners in _propose_squares(search, False)
    ]
    targets = [target for target in measured if isinstance(target, Marker)]
    refused = [target for target in measured if isinstance(target, RefusedTarget)]
    targets, doubled = _merge_repeated(targets)
    refused += doubled + _find_mirrored(search, targets + refused)
    targets, doubts = _refuse_doubtful(search, targets, refused, listed)
    size = search.image.shape[::-1]
    doubtful = tuple(target.id for target in targets if target.id in known.mirrored)
    return PhotoTargets(
        tuple(sorted(targets, key=lambda target: target.id)), (*refused, *doubts), size, doubtful
    )


def _propose_squares(search, is_flipped):
    """Squares [(id, corners (4, 2))] that OpenCV proposes, in the photo or its mirror image."""
    cv2 = opencv()
    aruco, image = cv2.aruco, search.image
    if image.dtype != np.uint8:
        image = np.clip(np.round(image), 0, 255).astype(np.uint8)
    settings = aruco.DetectorParameters()
    settings.cornerRefinementMethod = aruco.CORNER_REFINE_NONE
    settings.errorCorrectionRate = DETECTION_ERRORS
    settings.minMarkerPerimeterRate = min(3.0 * search.smallest_px / max(image.shape), 1.0)
    settings.minDistanceToBorder = 1
    codes = aruco.getPredefinedDictionary(getattr(aruco, search.dictionary.name))
    if is_flipped:
        image = np.ascontiguousarray(image[:, ::-1])
    corners, numbers, _ = aruco.ArucoDetector(codes, settings).detectMarkers(image)
    if numbers is None:
        return []
    places = [np.asarray(four, dtype=float).reshape(4, 2) for four in corners]
    return list(zip((int(number) for number in np.ravel(numbers)), places, strict=True))


def _measure_marker(search, number, corners):
    """Measure a proposed square; return a Marker, or RefusedTarget with the reason."""
    cells = search.dictionary.cells[number]
    code, detail = _check_shape(search, corners)
    if code:
        return RefusedTarget(code, corners.mean(axis=0), number, detail)
    try:
        fitted, covariance, edges = fit_corners(search.image, corners, cells)
    except NoEdge as reason:
        return RefusedTarget("edges", corners.mean(axis=0), number, {str(reason): 1})
    contrast = float(np.mean([edge.contrast for edge in edges]))
    rms = max(edge.rms for edge in edges)
    if contrast < max(LEAST_CONTRAST, LEAST_TO_NOISE * rms):
        detail = {"contrast": contrast, "rms": rms}
        return RefusedTarget("contrast", fitted.mean(axis=0), number, detail)
    code, detail = _check_shape(search, fitted)
    if code:
        return RefusedTarget(code, fitted.mean(axis=0), number, detail)
    errors, clarity = _read_cells(search.image, fitted, cells)
    if errors > search.bit_errors:
        return RefusedTarget("bit_errors", fitted.mean(axis=0), number, {"bit_errors": errors})
    if clarity < LEAST_CLARITY:
        return RefusedTarget("unclear_cells", fitted.mean(axis=0), number, {"clarity": clarity})
    sd = np.sqrt(np.trace(covariance, axis1=1, axis2=2) / 2 + SD_FLOOR_PX**2)
    blur = float(np.mean([edge.blur_px for edge in edges]))
    side = float(np.hypot(*(np.roll(fitted, -1, axis=0) - fitted).T).mean())
    return Marker(number, fitted, sd, errors, side, blur, clarity)


def _check_shape(search, corners):
    """Return (code, detail) for a shape to refuse, or (None, None)."""
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(*sides.T)
    if not lengths.min() > 0:
        return "shape", {"side_px": 0.0}
    side = float(lengths.mean())
    if side < search.smallest_px:
        return "too_small", {"side_px": side}
    units = sides / lengths[:, None]
    following = np.roll(units, -1, axis=0)
    turns = units[:, 0] * following[:, 1] - units[:, 1] * following[:, 0]
    if turns.min() < MOST_SLANTED:
        return "shape", {"sine": float(turns.min())}
    last = np.array(search.image.shape[::-1]) - 1
    distance = float(min(corners.min(), (last - corners).min()))
    if distance < BORDER_PX:
        return "at_border", {"room_px": distance}
    return None, None


def _read_cells(image, corners, cells):
    """Count the cells that differ from the code, and compute the clarity (at most 1).

    The grey value of a cell is the mean of nine samples in its middle half. Black and white are the
    means of the black and of the white cells of the code. Clarity is the correlation of the cells
    with the code.
    """
    cv2 = opencv()
    n = len(cells)
    # The homography from cells to pixels gives the positions of the samples in the photo.
    square = np.array([[0, 0], [n, 0], [n, n], [0, n]], dtype=np.float32)
    matrix = cv2.getPerspectiveTransform(square, corners.astype(np.float32))
    middles = np.arange(n)[:, None] + 0.5 + SAMPLES
    y, x = np.meshgrid(middles.ravel(), middles.ravel(), indexing="ij")
    seen = np.stack([x, y], axis=-1).reshape(-1, 1, 2).astype(np.float32)
    places = cv2.perspectiveTransform(seen, matrix).reshape(x.shape + (2,)).astype(np.float32)
    grey = cv2.remap(image.astype(np.float32), places[..., 0], places[..., 1], cv2.INTER_LINEAR)
    grey = grey.reshape(n, len(SAMPLES), n, len(SAMPLES)).mean(axis=(1, 3))
    white, black = grey[cells > 0].mean(), grey[cells == 0].mean()
    errors = int(((grey > (white + black) / 2) != (cells > 0)).sum())
    spread = grey.std() * cells.std()
    clarity = float(np.mean((grey - grey.mean()) * (cells - cells.mean())) / max(spread, 1e-9))
    return errors, clarity


def _merge_repeated(targets):
    """Merge squares proposed twice, and refuse different codes in one place."""
    kept, refused = [], []
    for target in targets:
        twins = [
            i
            for i, other in enumerate(kept)
            if other.id == target.id and np.abs(other.corners_px - target.corners_px).max() < 1.0
        ]
        if not twins:
            kept.append(target)
    middles = np.array([target.centre_px for target in kept]).reshape(-1, 2)
    for i, target in enumerate(kept):
        near = np.hypot(*(middles - middles[i]).T) < NEAR * target.side_px
        if near.sum() > 1:
            refused.append(
                RefusedTarget("overlap", middles[i], target.id, {"targets": int(near.sum())})
            )
    bad = {tuple(target.place_px) for target in refused}
    return [target for target in kept if tuple(target.centre_px) not in bad], refused


def _find_mirrored(search, known):
    """Refuse codes that can be read in the mirror image only."""
    places = np.array(
        [target.centre_px if isinstance(target, Marker) else target.place_px for target in known]
    ).reshape(-1, 2)
    last = search.image.shape[1] - 1
    flipped = replace(search, image=search.image[:, ::-1], bit_errors=0)
    refused = []
    for number, corners in _propose_squares(search, True):
        target = _measure_marker(flipped, number, corners)
        if isinstance(target, RefusedTarget):
            continue
        place = target.centre_px * [-1, 1] + [last, 0]
        if len(places) and np.hypot(*(places - place).T).min() < NEAR * target.side_px:
            continue
        refused.append(RefusedTarget("mirrored", place, number, {"side_px": target.side_px}))
    return refused


def _refuse_doubtful(search, targets, refused, listed):
    """Refuse codes that are not listed, occur twice, or have no unique orientation."""
    known = search.dictionary
    counts = {}
    seen = [
        *targets,
        *(target for target in refused if target.code in ("overlap", "at_border", "edges")),
    ]
    for target in seen:
        counts[target.id] = counts.get(target.id, 0) + 1
    is_flipped = any(target.code == "mirrored" for target in refused)
    kept, doubts = [], []
    for target in targets:
        code, detail = None, {}
        if listed is not None and target.id not in listed:
            code = "not_listed"
        elif counts[target.id] > 1:
            code, detail = "duplicate", {"times": counts[target.id]}
        elif target.id in known.turning:
            code = "turn_doubt"
        elif is_flipped and target.id in known.mirrored:
            code = "mirror_doubt"
        if code is None:
            kept.append(target)
        else:
            doubts.append(RefusedTarget(code, target.centre_px, target.id, detail))
    return kept, doubts


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
