"""Coded targets (ArUco, AprilTag) in a photograph: detection by OpenCV, measurement of the edges.

OpenCV proposes squares and their codes. The module `edges` measures the corners, and the code is
read again, cell by cell, from the fitted corners. Doubtful targets are refused with a reason. The
corners of OpenCV have errors of 0.2 to 1 px, because blur rounds a corner inwards.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.calibration.targets.edges import NoEdge, fit_corners
from tankcal.calibration.targets.opencv import load_dictionary, opencv
from tankcal.calibration.targets.results import Marker, PhotoTargets, RefusedTarget

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
