"""Photographs of targets, rendered with known truth: perspective, lens, blur, noise, gamma.

A pixel (column, line) covers the square of half a pixel about it, so the centre of the first one is
(0, 0). Each one is the mean of OVERSAMPLING^2 samples of the plane, blurred before that mean is
taken: light is added up, not positions. Rows of samples are shifted against one another by the
golden ratio: on a regular grid an edge along a line of pixels would be up to half a cell, 0.1 px,
beside its true place. Nothing here comes from the code that reads targets.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

OVERSAMPLING = 5
GOLDEN = (np.sqrt(5) - 1) / 2
WHITE, BLACK, GREY = 200.0, 30.0, 120.0


@dataclass(frozen=True)
class Pattern:
    """A flat target.

    plane_of  function of pixels (n, 2): their places (n, 2) in the target's plane
    value     function of places (n, 2): grey values (n,), nan beyond the target
    window    (4,) first column, last column, first line, last line of where it may be seen
    """

    plane_of: callable
    value: callable
    window: tuple


def homography(plane, image):
    """(3, 3) of four places (4, 2) of a plane to their images (4, 2)."""
    rows = []
    for (x, y), (u, v) in zip(plane, image, strict=True):
        rows.append([x, y, 1, 0, 0, 0, -u * x, -u * y, -u])
        rows.append([0, 0, 0, x, y, 1, -v * x, -v * y, -v])
    return np.linalg.svd(np.array(rows))[2][-1].reshape(3, 3)


def through(matrix, points):
    """Points (n, 2) through a homography."""
    q = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return q[:, :2] / q[:, 2:]


def code_value(matrix, quiet=1.0, white=WHITE, black=BLACK):
    """Grey values of a marker: its cells fill the unit square, y downwards, quiet zone around.

    matrix  (n, n) 0 and 1, as printed, the black border included
    quiet   width of the white zone, cells
    """
    n = len(matrix)

    def value(places):
        x, y = places.T * n
        found = np.full(len(places), np.nan)
        found[(x > -quiet) & (x < n + quiet) & (y > -quiet) & (y < n + quiet)] = white
        inside = (x >= 0) & (x < n) & (y >= 0) & (y < n)
        bits = matrix[y[inside].astype(int), x[inside].astype(int)]
        found[inside] = np.where(bits > 0, white, black)
        return found

    return value


def disc_value(ground=2.0, white=WHITE, black=BLACK):
    """Grey values of a white disc of radius 1 on a black one of radius `ground`."""

    def value(places):
        r = np.hypot(*places.T)
        return np.where(r < 1, white, np.where(r < ground, black, np.nan))

    return value


def flat(value, image, plane=((0, 0), (1, 0), (1, 1), (0, 1)), reach=0.5):
    """Pattern that a pinhole camera sees, by the images (4, 2) of four places of its plane."""
    image = np.asarray(image, dtype=float)
    back = np.linalg.inv(homography(plane, image))
    low, high = image.min(axis=0), image.max(axis=0)
    pad = reach * (high - low) + 8
    window = (low[0] - pad[0], high[0] + pad[0], low[1] - pad[1], high[1] + pad[1])
    return Pattern(lambda pixels: through(back, pixels), value, window)


def rendered(
    size, patterns, blur_px=1.0, noise=0.0, seed=0, background=GREY, oversampling=OVERSAMPLING
):
    """Photograph (lines, columns), float grey values, not rounded.

    size        (columns, lines)
    background  a number, or an image (lines, columns)
    """
    columns, lines = size
    image = np.array(np.broadcast_to(np.asarray(background, dtype=float), (lines, columns)))
    for pattern in patterns:
        _paint(image, pattern, blur_px, oversampling)
    return image + noise * np.random.default_rng(seed).normal(size=image.shape)


def _paint(image, pattern, blur_px, fineness):
    lines, columns = image.shape
    pad = int(np.ceil(4 * blur_px + 2))
    c0, c1, l0, l1 = (round(x) for x in pattern.window)
    c0, l0 = max(c0 - pad, 0), max(l0 - pad, 0)
    c1, l1 = min(c1 + pad, columns - 1), min(l1 + pad, lines - 1)
    if c1 < c0 or l1 < l0:
        return
    fine = (np.arange(fineness) + 0.5) / fineness - 0.5
    across = (np.arange(c0, c1 + 1)[:, None] + fine).ravel()
    down = (np.arange(l0, l1 + 1)[:, None] + fine).ravel()
    x, y = np.meshgrid(across, down)
    shifts = [np.arange(len(axis)) * GOLDEN % 1.0 - 0.5 for axis in (down, across)]
    x, y = x + shifts[0][:, None] / fineness, y + shifts[1] / fineness
    values = pattern.value(pattern.plane_of(np.column_stack([x.ravel(), y.ravel()])))
    values = values.reshape(x.shape)
    covered = ~np.isnan(values)
    by_line = _blurring(l1 - l0 + 1, fineness, blur_px)
    by_column = _blurring(c1 - c0 + 1, fineness, blur_px)
    share, light = (
        (by_column @ (by_line @ part).T).T
        for part in (covered.astype(float), np.where(covered, values, 0.0))
    )
    window = image[l0 : l1 + 1, c0 : c1 + 1]
    window[:] = (1 - share) * window + light


def _blurring(count, fineness, blur_px):
    """(count, count fineness) sparse: fine values blurred by a Gaussian, then averaged by pixel.

    The lens is cut off at 5 sds; at the ends the values are mirrored.
    """
    sd = blur_px * fineness
    reach = int(5 * sd + 0.5)
    lens = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sd) ** 2)
    weights = np.convolve(lens / lens.sum(), np.full(fineness, 1 / fineness))
    fine = count * fineness
    places = fineness * np.arange(count)[:, None] + np.arange(-reach, reach + fineness)
    places = np.minimum(places % (2 * fine), (-1 - places) % (2 * fine))
    rows = np.repeat(np.arange(count), len(weights))
    entries = np.tile(weights, count), (rows, places.ravel())
    return scipy.sparse.csr_array(entries, shape=(count, fine))


def eight_bit(image):
    """Grey values rounded to 0..255."""
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def tilted_square(centre, side_px, incidence_deg=0.0, turn_deg=0.0, axis_deg=90.0, distance=8.0):
    """Images (4, 2) of the corners of a square, clockwise from its top left, under perspective.

    side_px    its side if it stood square to the view    distance  of the camera, in sides
    turn_deg   clockwise, within its plane, before it leans by incidence_deg about axis_deg
    """
    square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    square = square @ _turn(turn_deg - axis_deg).T
    lean = np.radians(incidence_deg)
    seen = np.column_stack([square[:, 0], square[:, 1] * np.cos(lean)])
    depth = distance + square[:, 1] * np.sin(lean)
    seen = distance * seen / depth[:, None] @ _turn(axis_deg).T
    return np.asarray(centre) + side_px * seen


def _turn(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s], [s, c]])
