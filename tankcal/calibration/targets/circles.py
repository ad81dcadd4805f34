"""White circles on a dark ground: the centre of the ellipse that each one makes in a photograph.

A pixel near the edge has the grey value  black + (white - black) F(-d / s) + a slope across the
photo, with F the normal distribution, s the blur and d the distance from the ellipse (to first
order: (|L p| - 1) / |grad|, p from the centre, L symmetric). Centre, L, s, white, black and slope
by least squares of the pixels themselves. Blur moves the edge of a small circle inwards, all around
alike: half axes come out a little short, the centre does not move.
"""

import numpy as np
import scipy
from scipy.special import ndtr

from tankcal.calibration.targets.found import Circle, Found, Refused
from tankcal.calibration.targets.opencv import opencv

WINDOWS = (0.03, 0.1, 0.3)  # of the local threshold, as parts of the smaller side
THRESHOLD_GREY = 7
LEAST_RATIO = 0.2  # of the half axes: seen at up to 78 degrees
OFF_ELLIPSE = 0.12  # of the smaller half axis, of the outline before the fit
LEAST_CONTRAST = 15.0
MOST_RESIDUAL = 0.12  # rms, of the contrast
BORDER_PX = 2.0
BEYOND_SEEN = 0.5  # of the range of grey: what white and black may lie beyond it
SD_FLOOR_PX = 0.005
START_BLUR_PX = 1.0
MOST_BLUR_PX = 12.0
SCALES = np.array([0.3, 0.3, 0.1, 0.1, 0.1, 0.3, 10.0, 10.0, 5.0, 5.0])  # of the unknowns


def read_circles(image, smallest_px=6.0, largest_px=None):
    """White circular targets of a photograph: Found with Circles, without names.

    Parameters
    ----------
    image : ndarray, shape (lines, columns)
        Grey values, uint8 or float up to 255.
    smallest_px : optional
        Least smaller axis (diameter).
    largest_px : optional
        Most larger axis; None: a tenth of the photo's smaller side, 30 px at least.

    Raises
    ------
    InputError
        Without OpenCV.
    """
    image = np.asarray(image)
    if largest_px is None:
        largest_px = max(30.0, min(image.shape) / 10)
    kept, refused = [], []
    for start in _proposed(image, smallest_px, largest_px):
        if not _stands_out(image, *start):
            continue
        one = _measured(image, start, smallest_px)
        if isinstance(one, Refused):
            refused.append(one)
        elif not any(_is_same(one, other) for other in kept):
            kept.append(one)
    refused = [
        one
        for one in refused
        if not any(
            np.hypot(*(one.place_px - other.centre_px)) < other.semi_axes_px[0] for other in kept
        )
    ]
    kept.sort(key=lambda one: tuple(one.centre_px[::-1]))
    return Found(tuple(kept), tuple(refused), image.shape[::-1])


def _is_same(one, other):
    return np.hypot(*(one.centre_px - other.centre_px)) < 0.5 * other.semi_axes_px[1]


def _proposed(image, smallest, largest):
    """(centre, (2,) half axes, turn) of outlines that are nearly ellipses, brighter inside."""
    cv2 = opencv()
    grey = image if image.dtype == np.uint8 else np.clip(np.round(image), 0, 255).astype(np.uint8)
    grey = np.ascontiguousarray(grey)
    seen = np.zeros((0, 4))
    for part in WINDOWS:
        window = max(int(part * min(image.shape)) // 2 * 2 + 1, 7)
        bright = cv2.adaptiveThreshold(
            grey, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY, window, -THRESHOLD_GREY
        )
        for outline in cv2.findContours(bright, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]:
            found = _ellipse_of(outline[:, 0], smallest, largest)
            if found is None:
                continue
            row = np.array([*found[0], *found[1]])
            if len(seen) and (np.abs(seen - row).max(axis=1) < 0.7).any():
                continue
            seen = np.vstack([seen, row])
            yield found


def _ellipse_of(outline, smallest, largest):
    """(centre, half axes, turn) of an outline (n, 2), or None where it is none."""
    extent = outline.max(axis=0) - outline.min(axis=0) + 1
    if len(outline) < 8 or extent.max() > 1.2 * largest or extent.max() < smallest - 1:
        return None
    (x, y), (one, other), turn = opencv().fitEllipse(outline.astype(np.float32))
    turn, axes = np.radians(turn), np.array([one, other]) / 2
    if axes[0] < axes[1]:
        axes, turn = axes[::-1], turn + np.pi / 2
    if not (np.isfinite([x, y, *axes]).all() and axes[1] > 0.35 * smallest):
        return None
    if axes[0] > largest / 2 or axes[1] < 0.8 * LEAST_RATIO * axes[0]:
        return None
    centre = np.array([x, y])
    off = _distances(outline - centre, _matrix(axes, turn))
    if np.sqrt(np.mean(off**2)) > OFF_ELLIPSE * axes[1] + 0.6:
        return None
    return centre, axes + 0.5, turn


def _matrix(axes, turn):
    """L = R diag(1/a, 1/b) R', (3,) its elements 11, 12, 22."""
    c, s = np.cos(turn), np.sin(turn)
    p, q = 1 / axes
    return np.array([c * c * p + s * s * q, c * s * (p - q), s * s * p + c * c * q])


def _distances(places, elements):
    """Distances (n,) of places (n, 2) from the ellipse |L p| = 1, to first order."""
    p, q, r = elements
    u = p * places[:, 0] + q * places[:, 1]
    v = q * places[:, 0] + r * places[:, 1]
    size = np.hypot(u, v) + 1e-12
    slope = np.hypot(p * u + q * v, q * u + r * v) / size + 1e-12
    return (size - 1) / slope


def _measured(image, start, smallest):
    """Circle, or Refused."""
    centre, axes, turn = start
    blur = START_BLUR_PX
    for _ in range(2):
        room = _room(image, centre, axes)
        if room < BORDER_PX:
            return Refused("at_border", centre, None, {"room_px": room})
        fit = _fitted(image, centre, axes, turn, blur)
        if fit is None:
            return Refused("edges", centre, None, {"half_axis_px": float(axes[1])})
        centre, axes, turn, blur, white, black, rms, sd = fit
    contrast = white - black
    if contrast < LEAST_CONTRAST:
        return Refused("contrast", centre, None, {"contrast": contrast})
    if 2 * axes[1] < smallest:
        return Refused("too_small", centre, None, {"smaller_axis_px": float(2 * axes[1])})
    if axes[1] < LEAST_RATIO * axes[0]:
        return Refused("shape", centre, None, {"ratio": float(axes[1] / axes[0])})
    unlike = max(rms, _unevenness(image, centre, axes, turn, blur))
    if unlike > MOST_RESIDUAL * contrast:
        return Refused("edges", centre, None, {"rms": unlike, "contrast": contrast})
    sd = float(np.hypot(sd, SD_FLOOR_PX))
    return Circle(centre, sd, axes, float(turn % np.pi), blur, contrast, rms)


def _stands_out(image, centre, axes, turn):
    """Is it bright inside and dark around, well beyond the scatter of both?"""
    places, grey = _around(image, centre, 1.6 * axes[0] + 2)
    share = _distances(places, _matrix(axes, turn)) / axes[1]
    inside, around = grey[share < -0.3], grey[(share > 0.25) & (share < 0.6)]
    if len(inside) < 3 or len(around) < 5:
        return False
    contrast = inside.mean() - around.mean()
    return contrast > max(LEAST_CONTRAST / 2, 2.5 * max(inside.std(), around.std()))


def _room(image, centre, axes):
    """How far the ellipse stays from the edge of the photo, px."""
    last = np.array(image.shape[::-1]) - 1
    return float(min(centre.min(), (last - centre).min()) - axes[0])


def _around(image, centre, reach):
    """Places (n, 2) from the centre and grey values (n,) of the pixels within `reach` px."""
    low = np.maximum(np.floor(centre - reach), 0).astype(int)
    high = np.minimum(np.ceil(centre + reach), np.array(image.shape[::-1]) - 1).astype(int)
    line, column = np.mgrid[low[1] : high[1] + 1, low[0] : high[0] + 1]
    places = np.column_stack([column.ravel() - centre[0], line.ravel() - centre[1]])
    return places, image[line.ravel(), column.ravel()].astype(float)


def _fitted(image, centre, axes, turn, blur):
    """Centre, half axes, turn, blur, white, black, rms, sd of the centre; None without a fit."""
    outside = min(3.5 * blur + 1, max(0.6 * axes[1], 2.0))
    places, grey = _around(image, centre, axes[0] + outside + 1)
    elements = _matrix(axes, turn)
    d = _distances(places, elements)
    used = (d < outside) & (d > -max(3.5 * blur + 1, 2.0))
    places, grey, d = places[used], grey[used], d[used]
    if used.sum() < 25 or not ((d > 0.5).any() and (d < -0.5).any()):
        return None
    unit = 1 / axes[0]

    def misclosures(e):
        far = _distances(places - e[:2], elements * (1 + e[2:5]))
        share = ndtr(-far / np.exp(np.clip(e[5], -3, 3)))
        return e[7] + (e[6] - e[7]) * share + places @ e[8:] * unit - grey

    levels = np.percentile(grey[d < -0.5], 75), np.percentile(grey[d > 0.5], 25)
    elements = np.where(np.abs(elements) < 1e-3 * unit, 1e-3 * unit, elements)
    begin = np.concatenate([np.zeros(5), [np.log(blur)], levels, [0.0, 0.0]])
    fit = scipy.optimize.least_squares(
        misclosures, begin, method="lm", x_scale=SCALES, ftol=1e-7, xtol=1e-6, max_nfev=300
    )
    beyond = BEYOND_SEEN * np.ptp(grey)
    if not (fit.x[6] < grey.max() + beyond and fit.x[7] > grey.min() - beyond):
        return None
    return _result(fit, centre, elements, len(grey))


def _result(fit, centre, elements, count):
    e, dof = fit.x, count - len(fit.x)
    blur = float(np.exp(np.clip(e[5], -3, 3)))
    values, vectors = np.linalg.eigh(_full(elements * (1 + e[2:5])))
    if dof < 5 or not np.isfinite(e).all() or values[0] <= 0 or blur > MOST_BLUR_PX:
        return None
    axes = 1 / values
    if np.hypot(*e[:2]) > axes[0]:
        return None
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


def _full(elements):
    p, q, r = elements
    return np.array([[p, q], [q, r]])


def _unevenness(image, centre, axes, turn, blur):
    """Standard deviation of the grey values well inside; 0 where there is no such place."""
    places, grey = _around(image, centre, axes[0])
    inside = grey[_distances(places, _matrix(axes, turn)) < -3 * blur]
    return float(inside.std()) if len(inside) > 8 else 0.0


def eccentricity_px(centre, normal, radius, focal_px):
    """Centre of the ellipse minus the image of the circle's centre (2,): what is not corrected.

    With X the centre, n the normal and D = r2 (I - n n') - X X', all in the camera's frame, the
    centre of the ellipse is f D[:2, 2] / D[2, 2] and the image of X is f X[:2] / X[2].

    Parameters
    ----------
    centre : array_like, shape (3,)
        Of the circle, in any unit, depth along the third axis.
    normal : array_like, shape (3,)
        Of its plane.
    radius : float
        In the unit of `centre`.
    focal_px : float
        Principal distance in pixels, without distortion.

    Examples
    --------
    Of a circle of 0.2 m, 5 m ahead, that is seen askew:

    >>> round(float(eccentricity_px([0.0, 0.0, 5.0], [0.0, 0.6, 0.8], 0.1, 4000.0)[1]), 3)
    0.768
    """
    x, n = np.asarray(centre, dtype=float), np.asarray(normal, dtype=float)
    n = n / np.linalg.norm(n)
    dual = radius**2 * (np.eye(3) - np.outer(n, n)) - np.outer(x, x)
    return focal_px * (dual[:2, 2] / dual[2, 2] - x[:2] / x[2])
