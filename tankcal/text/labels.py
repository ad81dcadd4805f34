"""Placement of labels beside the marks of a drawing without overlaps.

A label takes the first free position around its mark. If no form of the label fits, it is left out.
Text sizes are estimated, because the viewer renders the text.
"""

from dataclasses import dataclass

import numpy as np

LETTER, LINE = 0.56, 1.15  # mean letter width and line height, relative to the type size
MARK = 2.5  # free radius around a mark, points
AROUND = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
FARTHER = (1.0, 2.2)  # multiples of the smallest distance from the mark
_SIDES = {-1: "right", 0: "center", 1: "left"}
_ENDS = {-1: "top", 0: "center", 1: "bottom"}


@dataclass(frozen=True)
class Label:
    """Label of a position in a drawing.

    Attributes
    ----------
    x, y : float
        Position in the units of the axes.
    texts : tuple of str
        The name, then shorter forms.
    clear : float
        Smallest distance between position and label, typographic points.
    outward : tuple of float
        Preferred direction (2,).
    """

    x: float
    y: float
    texts: tuple[str, ...]
    clear: float = 3.0
    outward: tuple[float, float] = (1.0, 1.0)


def write_labels(ax, labels, marks, *, size, room=MARK, **style):
    """Write the labels that fit, in the given order; return the number of labels left out.

    Parameters
    ----------
    ax : matplotlib Axes
        With final limits and position.
    labels : sequence of Label
    marks : array_like (n, 2)
        Positions that no label may cover, in the units of the axes.
    size : float
        Type size, points.
    room : float or array_like (n,)
        Free radius around a mark, typographic points.

    Returns
    -------
    int
    """
    ax.apply_aspect()
    places = _convert_to_points(ax, np.array([[item.x, item.y] for item in labels]).reshape(-1, 2))
    around = _convert_to_points(ax, np.asarray(marks, dtype=float).reshape(-1, 2))
    half = np.broadcast_to(np.asarray(room, dtype=float), len(around))[:, None]
    taken = np.column_stack([around - half, around + half])
    frame = _convert_to_points(ax, np.array([[*ax.get_xlim()], [*ax.get_ylim()]]).T).ravel()
    left_out = 0
    for label, place in zip(labels, places, strict=True):
        position = _find_place(label, place, taken, frame, size)
        if position is None:
            left_out += 1
            continue
        text, side, offset, box = position
        taken = np.vstack([taken, box])
        ax.annotate(
            text, (label.x, label.y), textcoords="offset points", xytext=offset, fontsize=size,
            ha=_SIDES[side[0]], va=_ENDS[side[1]], parse_math=False, **style,
        )  # fmt: skip
    return left_out


def _convert_to_points(ax, xy):
    """Convert positions in the axes to typographic points of the figure."""
    return ax.transData.transform(xy) * 72 / ax.figure.dpi


def _find_place(label, place, taken, frame, size):
    """Return (text, side, offset, box) of the first free form and position, or None."""
    sides = sorted(AROUND, key=lambda side: -np.dot(side, label.outward) / np.hypot(*side))
    for text in label.texts:
        extent = np.array([LETTER * len(text), LINE]) * size
        for farther in FARTHER:
            for side in sides:
                offset = farther * label.clear * np.array(side, dtype=float)
                low = place + offset + extent * (np.array(side) - 1) / 2
                box = np.concatenate([low, low + extent])
                is_inside = (box[:2] >= frame[:2]).all() and (box[2:] <= frame[2:]).all()
                if is_inside and not _overlaps(box, taken).any():
                    return text, side, tuple(offset), box
    return None


def _overlaps(box, others):
    """Return whether a box [x0, y0, x1, y1] overlaps each of the others, shape (n,)."""
    x0, y0, x1, y1 = others.T
    beside = (x0 < box[2]) & (box[0] < x1)
    return beside & (y0 < box[3]) & (box[1] < y1)
