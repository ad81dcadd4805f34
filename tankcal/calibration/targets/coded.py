"""Coded targets (ArUco, AprilTag) in a photograph: found by OpenCV, measured by their edges.

OpenCV proposes squares and their codes. Everything else is ours: the code is read again through
the fitted corners, cell by cell; corners come from `edges`; what is in doubt is refused with a
reason. OpenCV's own corners lie 0.2 to 1 px beside the truth (blur rounds a corner inwards).
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.calibration.targets.dictionaries import dictionary_of
from tankcal.calibration.targets.edges import NoEdge, corners_of
from tankcal.calibration.targets.found import Found, Marker, Refused
from tankcal.calibration.targets.opencv import opencv

CELL_PX = 2.5  # least mean width of a cell
LEAST_CLARITY = 0.7
LEAST_CONTRAST = 12.0  # grey values of 255
LEAST_TO_NOISE = 4.0  # contrast, in rms of the edges' residuals
BORDER_PX = 3.0
MOST_SLANTED = 0.2  # sine of the sharpest corner
SD_FLOOR_PX = 0.015  # lens within a target, print, pixels that are no points, odd blur
NEAR = 0.5  # of a side: two squares nearer than that are in one place
DETECTION_ERRORS = 0.6  # what OpenCV may repair: such codes are told, not accepted
SAMPLES = np.linspace(-0.25, 0.25, 3)  # within a cell


@dataclass(frozen=True)
class _Reading:
    """The photograph, its dictionary and the limits."""

    image: np.ndarray
    dictionary: object
    bit_errors: int
    smallest_px: float


def read_coded(image, dictionary="DICT_4X4_50", listed=None, bit_errors=0, smallest_px=None):
    """Coded targets of a photograph: Found with Markers.

    Parameters
    ----------
    image : ndarray, shape (lines, columns)
        Grey values, uint8 or float up to 255.
    dictionary : optional
        Its name in OpenCV, with or without "DICT_".
    listed : optional
        Ids that there are, or None: all of the dictionary.
    bit_errors : optional
        Cells that may be wrong; 0: none.
    smallest_px : optional
        Least mean side; None: 2.5 px a cell.

    Raises
    ------
    InputError
        For a dictionary that is not known, or without OpenCV.
    """
    known = dictionary_of(dictionary)
    smallest = CELL_PX * known.cells.shape[1] if smallest_px is None else smallest_px
    reading = _Reading(np.asarray(image), known, bit_errors, smallest)
    measured = [_measured(reading, number, corners) for number, corners in _squares(reading, False)]
    targets = [one for one in measured if isinstance(one, Marker)]
    refused = [one for one in measured if isinstance(one, Refused)]
    targets, doubled = _apart(targets)
    refused += doubled + _mirrored(reading, targets + refused)
    targets, doubts = _without_doubts(reading, targets, refused, listed)
    size = reading.image.shape[::-1]
    doubtful = tuple(one.id for one in targets if one.id in known.mirrored)
    return Found(
        tuple(sorted(targets, key=lambda one: one.id)), (*refused, *doubts), size, doubtful
    )


def _squares(reading, is_flipped):
    """[(id, (4, 2) corners)] as OpenCV proposes them, of the photo or of its mirror image."""
    cv2 = opencv()
    aruco, image = cv2.aruco, reading.image
    if image.dtype != np.uint8:
        image = np.clip(np.round(image), 0, 255).astype(np.uint8)
    settings = aruco.DetectorParameters()
    settings.cornerRefinementMethod = aruco.CORNER_REFINE_NONE
    settings.errorCorrectionRate = DETECTION_ERRORS
    settings.minMarkerPerimeterRate = min(3.0 * reading.smallest_px / max(image.shape), 1.0)
    settings.minDistanceToBorder = 1
    codes = aruco.getPredefinedDictionary(getattr(aruco, reading.dictionary.name))
    if is_flipped:
        image = np.ascontiguousarray(image[:, ::-1])
    corners, numbers, _ = aruco.ArucoDetector(codes, settings).detectMarkers(image)
    if numbers is None:
        return []
    places = [np.asarray(four, dtype=float).reshape(4, 2) for four in corners]
    return list(zip((int(number) for number in np.ravel(numbers)), places, strict=True))


def _measured(reading, number, corners):
    """Marker, or Refused."""
    cells = reading.dictionary.cells[number]
    code, detail = _unfit(reading, corners)
    if code:
        return Refused(code, corners.mean(axis=0), number, detail)
    try:
        fitted, covariance, edges = corners_of(reading.image, corners, cells)
    except NoEdge as reason:
        return Refused("edges", corners.mean(axis=0), number, {str(reason): 1})
    contrast = float(np.mean([edge.contrast for edge in edges]))
    rms = max(edge.rms for edge in edges)
    if contrast < max(LEAST_CONTRAST, LEAST_TO_NOISE * rms):
        detail = {"contrast": contrast, "rms": rms}
        return Refused("contrast", fitted.mean(axis=0), number, detail)
    code, detail = _unfit(reading, fitted)
    if code:
        return Refused(code, fitted.mean(axis=0), number, detail)
    errors, clarity = _read_cells(reading.image, fitted, cells)
    if errors > reading.bit_errors:
        return Refused("bit_errors", fitted.mean(axis=0), number, {"bit_errors": errors})
    if clarity < LEAST_CLARITY:
        return Refused("unclear_cells", fitted.mean(axis=0), number, {"clarity": clarity})
    sd = np.sqrt(np.trace(covariance, axis1=1, axis2=2) / 2 + SD_FLOOR_PX**2)
    blur = float(np.mean([edge.blur_px for edge in edges]))
    return Marker(number, fitted, sd, errors, _side(fitted), blur, clarity)


def _side(corners):
    return float(np.hypot(*(np.roll(corners, -1, axis=0) - corners).T).mean())


def _unfit(reading, corners):
    """(code, detail) of a shape that is refused, or (None, None)."""
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(*sides.T)
    if not lengths.min() > 0:
        return "shape", {"side_px": 0.0}
    side = float(lengths.mean())
    if side < reading.smallest_px:
        return "too_small", {"side_px": side}
    units = sides / lengths[:, None]
    following = np.roll(units, -1, axis=0)
    turns = units[:, 0] * following[:, 1] - units[:, 1] * following[:, 0]
    if turns.min() < MOST_SLANTED:
        return "shape", {"sine": float(turns.min())}
    last = np.array(reading.image.shape[::-1]) - 1
    room = float(min(corners.min(), (last - corners).min()))
    if room < BORDER_PX:
        return "at_border", {"room_px": room}
    return None, None


def _read_cells(image, corners, cells):
    """Cells that differ from the code, and how black and white they are (clarity, up to 1).

    Each cell is the mean of nine places of its middle half; black and white are the means of the
    cells that should be. Clarity is the correlation of the cells with the code.
    """
    cv2 = opencv()
    n = len(cells)
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


def _apart(targets):
    """(targets, Refused): one square proposed twice is one; two codes in one place are none."""
    kept, refused = [], []
    for one in targets:
        twins = [
            i
            for i, other in enumerate(kept)
            if other.id == one.id and np.abs(other.corners_px - one.corners_px).max() < 1.0
        ]
        if not twins:
            kept.append(one)
    middles = np.array([one.centre_px for one in kept]).reshape(-1, 2)
    for i, one in enumerate(kept):
        near = np.hypot(*(middles - middles[i]).T) < NEAR * one.side_px
        if near.sum() > 1:
            refused.append(Refused("overlap", middles[i], one.id, {"targets": int(near.sum())}))
    bad = {tuple(one.place_px) for one in refused}
    return [one for one in kept if tuple(one.centre_px) not in bad], refused


def _mirrored(reading, known):
    """Refused for the codes that can be read in the mirror image only."""
    places = np.array(
        [one.centre_px if isinstance(one, Marker) else one.place_px for one in known]
    ).reshape(-1, 2)
    last = reading.image.shape[1] - 1
    flipped = replace(reading, image=reading.image[:, ::-1], bit_errors=0)
    refused = []
    for number, corners in _squares(reading, True):
        one = _measured(flipped, number, corners)
        if isinstance(one, Refused):
            continue
        place = one.centre_px * [-1, 1] + [last, 0]
        if len(places) and np.hypot(*(places - place).T).min() < NEAR * one.side_px:
            continue
        refused.append(Refused("mirrored", place, number, {"side_px": one.side_px}))
    return refused


def _without_doubts(reading, targets, refused, listed):
    """(targets, Refused): codes that are not listed, seen twice, or without a turn of their own."""
    known = reading.dictionary
    counts = {}
    seen = [*targets, *(one for one in refused if one.code in ("overlap", "at_border", "edges"))]
    for one in seen:
        counts[one.id] = counts.get(one.id, 0) + 1
    is_flipped = any(one.code == "mirrored" for one in refused)
    kept, doubts = [], []
    for one in targets:
        code, detail = None, {}
        if listed is not None and one.id not in listed:
            code = "not_listed"
        elif counts[one.id] > 1:
            code, detail = "duplicate", {"times": counts[one.id]}
        elif one.id in known.turning:
            code = "turn_doubt"
        elif is_flipped and one.id in known.mirrored:
            code = "mirror_doubt"
        if code is None:
            kept.append(one)
        else:
            doubts.append(Refused(code, one.centre_px, one.id, detail))
    return kept, doubts
