"""White circles on a dark background: centre of the ellipse of each circle in a photograph.

A pixel near the edge has the grey value black + (white - black) F(-d / s), plus a gradient. F is
the normal distribution, s the blur and d the distance from the ellipse. To first order
d = (|L p| - 1) / |grad|, with p relative to the centre and L symmetric. Centre, L, s, white, black
and gradient are estimated by least squares from the pixels. Blur moves the edge of a small circle
inwards uniformly: the semi-axes are slightly too short, but the centre is unbiased.
"""

import numpy as np
import scipy
from scipy.special import ndtr

from tankcal.calibration.targets.results import Circle, PhotoTargets, RefusedTarget, opencv

WINDOWS = (0.03, 0.1, 0.3)  # windows of the local threshold, as shares of the smaller side
THRESHOLD_GREY = 7  # local threshold, grey values
LEAST_RATIO = 0.2  # least ratio of the semi-axes: view at up to 78 degrees
OFF_ELLIPSE = 0.12  # largest rms of the outline before the fit, as a share of the smaller semi-axis
LEAST_CONTRAST = 15.0  # grey values
MOST_RESIDUAL = 0.12  # largest rms of the residuals as a share of the contrast
BORDER_PX = 2.0  # least distance from the edge of the photo, px
BEYOND_SEEN = 0.5  # tolerance of white and black outside the range of grey values, as a share of it
SD_FLOOR_PX = 0.005  # standard deviation added to that of the fit, px
START_BLUR_PX = 1.0  # initial blur, px
MOST_BLUR_PX = 12.0  # largest blur, px
SCALES = np.array([0.3, 0.3, 0.1, 0.1, 0.1, 0.3, 10.0, 10.0, 5.0, 5.0])  # scales of the unknowns


def read_circles(image, smallest_px=6.0, largest_px=None):
    """Measure white circular targets in a photograph.

    Parameters
    ----------
    image : ndarray, shape (lines, columns)
        Grey values, uint8 or float up to 255.
    smallest_px : float, optional
        Least length of the minor axis (diameter), px.
    largest_px : float, optional
        Largest length of the major axis, px; by default a tenth of the smaller side of the photo,
        but at least 30 px.

    Returns
    -------
    PhotoTargets
        Circles without names, from top to bottom, and refused candidates.

    Raises
    ------
    InputError
        If OpenCV is missing.
    """
    image = np.asarray(image)
    if largest_px is None:
        largest_px = max(30.0, min(image.shape) / 10)
    kept, refused = [], []
    for start in _propose_ellipses(image, smallest_px, largest_px):
        if not _is_distinct(image, *start):
            continue
        item = _measure_circle(image, start, smallest_px)
        if isinstance(item, RefusedTarget):
            refused.append(item)
        elif not any(
            (np.hypot(*(item.centre_px - other.centre_px)) < 0.5 * other.semi_axes_px[1])
            for other in kept
        ):
            kept.append(item)
    refused = [
        item
        for item in refused
        if not any(
            np.hypot(*(item.place_px - other.centre_px)) < other.semi_axes_px[0] for other in kept
        )
    ]
    kept.sort(key=lambda item: tuple(item.centre_px[::-1]))
    return PhotoTargets(tuple(kept), tuple(refused), image.shape[::-1])


def _propose_ellipses(image, smallest, largest):
    """Yield (centre, semi-axes, rotation) of outlines that are nearly ellipses, bright inside."""
    cv2 = opencv()
    grey = image if image.dtype == np.uint8 else np.clip(np.round(image), 0, 255).astype(np.uint8)
    grey = np.ascontiguousarray(grey)
    rows_seen = np.zeros((0, 4))
    for part in WINDOWS:
        window = max(int(part * min(image.shape)) // 2 * 2 + 1, 7)
        bright = cv2.adaptiveThreshold(
            grey, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY, window, -THRESHOLD_GREY
        )
        for outline in cv2.findContours(bright, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]:
            ellipse = _fit_outline(outline[:, 0], smallest, largest)
            if ellipse is None:
                continue
            row = np.array([*ellipse[0], *ellipse[1]])
            if len(rows_seen) and (np.abs(rows_seen - row).max(axis=1) < 0.7).any():
                continue
            rows_seen = np.vstack([rows_seen, row])
            yield ellipse


def _fit_outline(outline, smallest, largest):
    """Return (centre, semi-axes, rotation) of an outline (n, 2), or None if it is no ellipse."""
    extent = outline.max(axis=0) - outline.min(axis=0) + 1
    if len(outline) < 8 or extent.max() > 1.2 * largest or extent.max() < smallest - 1:
        return None
    (x, y), (first_axis, second_axis), turn = opencv().fitEllipse(outline.astype(np.float32))
    turn, axes = np.radians(turn), np.array([first_axis, second_axis]) / 2
    if axes[0] < axes[1]:
        axes, turn = axes[::-1], turn + np.pi / 2
    if not (np.isfinite([x, y, *axes]).all() and axes[1] > 0.35 * smallest):
        return None
    if axes[0] > largest / 2 or axes[1] < 0.8 * LEAST_RATIO * axes[0]:
        return None
    centre = np.array([x, y])
    deviation = _distances(outline - centre, _ellipse_matrix(axes, turn))
    if np.sqrt(np.mean(deviation**2)) > OFF_ELLIPSE * axes[1] + 0.6:
        return None
    return centre, axes + 0.5, turn


def _ellipse_matrix(axes, turn):
    """Elements 11, 12, 22 of L = R diag(1/a, 1/b) R', shape (3,)."""
    c, s = np.cos(turn), np.sin(turn)
    p, q = 1 / axes
    return np.array([c * c * p + s * s * q, c * s * (p - q), s * s * p + c * c * q])


def _distances(places, elements):
    """Distances (n,) of points (n, 2) from the ellipse |L p| = 1, to first order."""
    p, q, r = elements
    u = p * places[:, 0] + q * places[:, 1]
    v = q * places[:, 0] + r * places[:, 1]
    size = np.hypot(u, v) + 1e-12
    slope = np.hypot(p * u + q * v, q * u + r * v) / size + 1e-12
    return (size - 1) / slope


def _measure_circle(image, start, smallest):
    """Fit a candidate twice; return a Circle, or RefusedTarget with the reason."""
    centre, axes, turn = start
    blur = START_BLUR_PX
    for _ in range(2):
        # Distance of the ellipse from the edge of the photo, px.
        last = np.array(image.shape[::-1]) - 1
        distance = float(min(centre.min(), (last - centre).min()) - axes[0])
        if distance < BORDER_PX:
            return RefusedTarget("at_border", centre, None, {"room_px": distance})
        fit = _fit_ellipse(image, centre, axes, turn, blur)
        if fit is None:
            return RefusedTarget("edges", centre, None, {"half_axis_px": float(axes[1])})
        centre, axes, turn, blur, white, black, rms, sd = fit
    contrast = white - black
    if contrast < LEAST_CONTRAST:
        return RefusedTarget("contrast", centre, None, {"contrast": contrast})
    if 2 * axes[1] < smallest:
        return RefusedTarget("too_small", centre, None, {"smaller_axis_px": float(2 * axes[1])})
    if axes[1] < LEAST_RATIO * axes[0]:
        return RefusedTarget("shape", centre, None, {"ratio": float(axes[1] / axes[0])})
    unevenness = max(rms, _unevenness(image, centre, axes, turn, blur))
    if unevenness > MOST_RESIDUAL * contrast:
        return RefusedTarget("edges", centre, None, {"rms": unevenness, "contrast": contrast})
    sd = float(np.hypot(sd, SD_FLOOR_PX))
    return Circle(centre, sd, axes, float(turn % np.pi), blur, contrast, rms)


def _is_distinct(image, centre, axes, turn):
    """Whether the contrast of inside and surroundings exceeds the scatter of both."""
    places, grey = _pixels_around(image, centre, 1.6 * axes[0] + 2)
    share = _distances(places, _ellipse_matrix(axes, turn)) / axes[1]
    inside, around = grey[share < -0.3], grey[(share > 0.25) & (share < 0.6)]
    if len(inside) < 3 or len(around) < 5:
        return False
    contrast = inside.mean() - around.mean()
    return contrast > max(LEAST_CONTRAST / 2, 2.5 * max(inside.std(), around.std()))


def _pixels_around(image, centre, reach):
    """Positions (n, 2) relative to the centre and grey values (n,) of pixels within `reach` px."""
    low = np.maximum(np.floor(centre - reach), 0).astype(int)
    high = np.minimum(np.ceil(centre + reach), np.array(image.shape[::-1]) - 1).astype(int)
    line, column = np.mgrid[low[1] : high[1] + 1, low[0] : high[0] + 1]
    places = np.column_stack([column.ravel() - centre[0], line.ravel() - centre[1]])
    return places, image[line.ravel(), column.ravel()].astype(float)


def _fit_ellipse(image, centre, axes, turn, blur):
    """Fit the model of the module docstring to the pixels around an ellipse.

    Returns centre, semi-axes, rotation, blur, white, black, rms of the residuals and standard
    deviation of the centre, or None if the fit fails.
    """
    outside = min(3.5 * blur + 1, max(0.6 * axes[1], 2.0))
    places, grey = _pixels_around(image, centre, axes[0] + outside + 1)
    elements = _ellipse_matrix(axes, turn)
    d = _distances(places, elements)
    is_used = (d < outside) & (d > -max(3.5 * blur + 1, 2.0))
    places, grey, d = places[is_used], grey[is_used], d[is_used]
    if is_used.sum() < 25 or not ((d > 0.5).any() and (d < -0.5).any()):
        return None
    unit = 1 / axes[0]

    # Unknowns e: shift of the centre (2), relative changes of L (3), log blur, white, black, and
    # gradient (2)
    def misclosures(e):
        distance = _distances(places - e[:2], elements * (1 + e[2:5]))
        share = ndtr(-distance / np.exp(np.clip(e[5], -3, 3)))
        return e[7] + (e[6] - e[7]) * share + places @ e[8:] * unit - grey

    levels = np.percentile(grey[d < -0.5], 75), np.percentile(grey[d > 0.5], 25)
    elements = np.where(np.abs(elements) < 1e-3 * unit, 1e-3 * unit, elements)
    start = np.concatenate([np.zeros(5), [np.log(blur)], levels, [0.0, 0.0]])
    fit = scipy.optimize.least_squares(
        misclosures, start, method="lm", x_scale=SCALES, ftol=1e-7, xtol=1e-6, max_nfev=300
    )
    beyond = BEYOND_SEEN * np.ptp(grey)
    if not (fit.x[6] < grey.max() + beyond and fit.x[7] > grey.min() - beyond):
        return None
    return _evaluate_fit(fit, centre, elements, len(grey))


def _evaluate_fit(fit, centre, elements, count):
    """Results of a fit as in `_fit_ellipse`, or None for an implausible or undetermined ellipse."""
    e, dof = fit.x, count - len(fit.x)
    blur = float(np.exp(np.clip(e[5], -3, 3)))
    p, q, r = elements * (1 + e[2:5])
    values, vectors = np.linalg.eigh([[p, q], [q, r]])
    if dof < 5 or not np.isfinite(e).all() or values[0] <= 0 or blur > MOST_BLUR_PX:
        return None
    axes = 1 / values
    if np.hypot(*e[:2]) > axes[0]:
        return None
    # Covariance of the centre, variance (J'J)^-1, from the pseudo-inverse of the scaled Jacobian
    variance = 2 * fit.cost / dof
    scale = np.linalg.norm(fit.jac, axis=0)
    if not (scale > 0).all():
        return None
    inverse, rank = np.linalg.lstsq(fit.jac / scale, np.eye(count), rcond=1e-9)[0::2]
    if rank < len(e):
        return None
    rows = inverse[:2] / scale[:2, None]
    sd = float(np.sqrt(variance * (rows**2).sum() / 2))
    turn = np.arctan2(vectors[1, 0], vectors[0, 0])
    return centre + e[:2], axes, turn, blur, float(e[6]), float(e[7]), np.sqrt(variance), sd


def _unevenness(image, centre, axes, turn, blur):
    """Standard deviation of the grey values inside the edge; 0 for too few pixels."""
    places, grey = _pixels_around(image, centre, axes[0])
    inside = grey[_distances(places, _ellipse_matrix(axes, turn)) < -3 * blur]
    return float(inside.std()) if len(inside) > 8 else 0.0


def eccentricity_px(centre, normal, radius, focal_px):
    """Centre of the ellipse minus the image of the centre of the circle; it is not corrected.

    X is the centre, n the normal and D = r2 (I - n n') - X X', in the frame of the camera. The
    centre of the ellipse is f D[:2, 2] / D[2, 2], and the image of X is f X[:2] / X[2].

    Parameters
    ----------
    centre : array_like, shape (3,)
        Centre of the circle, in any unit, with the depth along the third axis.
    normal : array_like, shape (3,)
        Normal of the plane of the circle.
    radius : float
        Radius, in the unit of `centre`.
    focal_px : float
        Principal distance in pixels, without distortion.

    Returns
    -------
    ndarray, shape (2,)
        Eccentricity, px.

    Examples
    --------
    A circle of 0.2 m diameter at a depth of 5 m, seen obliquely:

    >>> round(float(eccentricity_px([0.0, 0.0, 5.0], [0.0, 0.6, 0.8], 0.1, 4000.0)[1]), 3)
    0.768
    """
    x, n = np.asarray(centre, dtype=float), np.asarray(normal, dtype=float)
    n = n / np.linalg.norm(n)
    dual = radius**2 * (np.eye(3) - np.outer(n, n)) - np.outer(x, x)
    return focal_px * (dual[:2, 2] / dual[2, 2] - x[:2] / x[2])
