"""Figures of an adjustment: plan with error ellipses, residuals of the photos, test values.

Placement of labels
-------------------

A label takes the first free position around its mark. If no form of the label fits, it is left out.
Text sizes are estimated, because the viewer renders the text.
"""

from dataclasses import dataclass
from math import ceil

import matplotlib
import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from tankcal.record.columns import as_columns
from tankcal.report.plots.style import (
    FAINT,
    GREY,
    INK,
    MANY,
    PALE,
    RED,
    WIDTH,
    rasterize_many,
    round_factor,
    set_margins,
    styled,
)
from tankcal.report.survey.quality import select_adjusted

MOST_PHOTOS = 12  # largest number of photos whose residuals are drawn
MOST_NAMES = 60  # largest number of places with names in the plan
MOST_AT_A_PLACE = 4  # largest number of names at one place
LARGEST_ELLIPSE = 0.04  # semi-axis of the largest ellipse, relative to the plan
SAME_PLACE = 0.015  # distance of points that share a place, relative to the plan
PLAN_POINTS = 300  # approximate size of the plan, in typographic points
_BEHIND = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.3}
_MARKS = {"control": ("^", INK), "check": ("s", "#6b4c9a"), "station": ("D", "#2e7d32")}
LETTER, LINE = 0.56, 1.15  # mean letter width and line height, relative to the type size
MARK = 2.5  # free radius around a mark, points
AROUND = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
FARTHER = (1.0, 2.2)  # multiples of the smallest distance from the mark
_SIDES = {-1: "right", 0: "center", 1: "left"}
_ENDS = {-1: "top", 0: "center", 1: "bottom"}


def plan_factor(paper):
    """Return the enlargement of the ellipses relative to the plan: 1, 2 or 5 times 10^n."""
    points = as_columns(paper.record["adjustment"]["points"])
    largest = points.arrays["ellipse_m"][:, 0].max() if points.count else 0.0
    return round_factor(LARGEST_ELLIPSE * _extent(paper) / largest) if largest > 0 else 1


def _positions(paper):
    """Return {point: (x, y)}, m."""
    points = as_columns(paper.record["points"])
    return dict(zip(points["point"], zip(points["x_m"], points["y_m"], strict=True), strict=True))


def _extent(paper):
    """Return the size of the plan, m."""
    photos = [(photo["x_m"], photo["y_m"]) for photo in paper.record["adjustment"]["photos"]]
    xy = np.array([*_positions(paper).values(), *photos])
    return float(np.ptp(xy, axis=0).max()) or 1.0


def plan_name(paper):
    """Return the name of the caption; among very many points only the weakest have an ellipse."""
    return "plan_many" if len(paper.record["adjustment"]["points"]) > MANY else "plan"


@styled
def plan(paper):
    """Figure of the network from above: points with error ellipses, stations, photos, sights."""
    adjustment, positions = paper.record["adjustment"], _positions(paper)
    points = as_columns(adjustment["points"])
    xy = np.array([positions[name] for name in points["point"]])
    # Coordinates of a national grid are reduced to whole kilometres for short axis labels.
    origin = np.floor(xy.min(axis=0) / 1000) * 1000 if np.abs(xy).max() > 1e5 else np.zeros(2)
    factor, extent = plan_factor(paper), _extent(paper)
    figure = Figure(figsize=(WIDTH, 4.6))
    ax = figure.subplots()
    _draw_sights(ax, paper, positions, origin)
    _draw_ellipses(ax, points, xy - origin, factor)
    _draw_points(ax, paper, points, xy - origin)
    photos = _draw_photos(ax, paper, adjustment["photos"], origin)
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.margins(0.06)
    ax.set_xlabel(_axis_label(paper, "x", origin[0]))
    ax.set_ylabel(_axis_label(paper, "y", origin[1]))
    ax.grid(True)
    ax.set_axisbelow(True)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=5, frameon=False)
    set_margins(figure, left=0.65, right=0.1, bottom=0.75, top=0.08)
    labels = _point_labels(points, xy - origin, factor, extent)
    labels += _photo_labels(adjustment["photos"], photos)
    marks = np.vstack([xy - origin, photos])
    largest = factor * points.arrays["ellipse_m"][:, 0]
    ellipses = 0.75 * _scale_to_page(largest, extent)
    room = np.maximum([*ellipses, *(0.0 for _ in photos)], MARK)
    write_labels(ax, labels, marks, size=6, room=room, color=GREY, zorder=5, bbox=_BEHIND)
    return figure


def _draw_ellipses(ax, points, xy, factor):
    """Draw the error ellipses; among very many points only those of the weakest."""
    axes = points.arrays["ellipse_m"]
    weakest = np.argsort(-axes[:, 0], kind="stable")[:MANY]
    turn = 90 - points.arrays["ellipse_azimuth_deg"][weakest]
    size = 2 * factor * axes[weakest]
    ellipses = EllipseCollection(
        size[:, 0], size[:, 1], turn, units="xy", offsets=xy[weakest], transOffset=ax.transData,
        facecolors="none", edgecolors=RED, linewidths=0.6,
    )  # fmt: skip
    ax.add_collection(ellipses)


def _axis_label(paper, axis, origin):
    text = paper.word(f"axes.{axis}")
    return f"{text} − {paper.number(origin, 'm', decimals=0)}" if origin else text


def _draw_sights(ax, paper, positions, origin):
    """Draw thin lines for distances and sights, unless they are too many to be distinguished."""
    setups = paper.record["adjustment"]["setups"]
    stations = {setup["setup"]: setup["station"] for setup in setups}
    ends = set()
    is_line = ~_are_of_kind(paper.readings, "image coordinate", "plumb line")
    for ids in paper.readings.take(is_line)["ids"]:
        if len(ids) > 1:
            ends.add((stations.get(ids[0], ids[0]), ids[-1]))
    ends = {pair for pair in ends if pair[0] in positions and pair[1] in positions}
    if len(ends) > MANY:
        return
    for start, end in sorted(ends):
        (x0, y0), (x1, y1) = positions[start], positions[end]
        ax.plot(
            [x0 - origin[0], x1 - origin[0]], [y0 - origin[1], y1 - origin[1]],
            color=FAINT, linewidth=0.4, zorder=1,
        )  # fmt: skip


def _are_of_kind(readings, *kinds):
    """Return whether readings are of some kinds, shape (n,)."""
    column = readings.arrays["kind"]
    return np.array([kind in kinds for kind in column.texts], dtype=bool)[column.codes]


def _draw_points(ax, paper, points, xy):
    """Draw a mark for each point; stations, control and check points have marks of their kind."""
    kinds = np.array(points["kind"])
    plain = kinds == "point"
    ax.plot(*xy[plain].T, ".", color=GREY, markersize=2, zorder=3,
            label=paper.word("plan.point"), **rasterize_many(xy[plain]))  # fmt: skip
    for kind, (mark, colour) in _MARKS.items():
        is_kind = kinds == kind
        if is_kind.any():
            ax.plot(*xy[is_kind].T, mark, color=colour, markersize=3.5, zorder=4,
                    label=paper.word(f"plan.{kind}"), **rasterize_many(xy[is_kind]))  # fmt: skip


def _scale_to_page(length_m, extent_m):
    """Return the approximate length on the page, in typographic points."""
    return PLAN_POINTS * length_m / extent_m


def _point_labels(points, xy, factor, extent_m):
    """Return labels outside the ellipses; points above one another share a label.

    Labels of stations, control and check points come first, so that they are placed first.
    """
    middle = xy.mean(axis=0)
    kinds, names = points["kind"], points["point"]
    groups = _group_places(kinds, xy, SAME_PLACE * extent_m)
    groups.sort(key=lambda group: all(kinds[i] == "point" for i in group))
    labels = []
    for group in groups:
        ellipse = factor * points.arrays["ellipse_m"][group, 0].max()
        clear = 3 + 0.75 * _scale_to_page(ellipse, extent_m)
        forms = tuple(
            _shorten_names([names[i] for i in group], most) for most in (MOST_AT_A_PLACE, 1)
        )
        away = tuple(np.sign(xy[group[0]] - middle) + 1e-3 * (xy[group[0]] - middle))
        labels.append(Label(*xy[group[0]], forms, clear, away))
    return labels


def _shorten_names(names, most):
    """Return the first names, and the number of further names."""
    more = [f"+{len(names) - most}"] if len(names) > most else []
    return ", ".join([*names[:most], *more])[:60]


def _group_places(kinds, xy, near):
    """Return the indices of the points of each label; for too many places only the stations."""
    groups, places = [], np.zeros((0, 2))
    for index, position in enumerate(xy):
        distances = np.linalg.norm(places - position, axis=1)
        if len(distances) and distances.min() < near:
            groups[int(distances.argmin())].append(index)
        elif len(groups) == MOST_NAMES:
            return [[i] for i, kind in enumerate(kinds) if kind == "station"]
        else:
            groups.append([index])
            places = np.vstack([places, position])
    return groups


def _draw_photos(ax, paper, photos, origin):
    """Draw a mark for each projection centre, and return their positions, shape (n, 2)."""
    xy = np.array([[photo["x_m"], photo["y_m"]] for photo in photos]).reshape(-1, 2) - origin
    if photos:
        ax.plot(*xy.T, "v", color="white", markeredgecolor=INK, markersize=6, zorder=4,
                label=paper.word("plan.photo"))  # fmt: skip
    return xy


def _photo_labels(photos, xy):
    if len(photos) > MOST_NAMES:
        return []
    return [
        Label(*position, (photo["photo"],), 5.0) for photo, position in zip(photos, xy, strict=True)
    ]


@styled
def distributions(paper):
    """Figure of the histograms of w, with the normal distribution, and of redundancy numbers."""
    readings = select_adjusted(paper).arrays
    w = readings["w"][readings["controlled"] & np.isfinite(readings["w"])]
    redundancy = readings["redundancy"][np.isfinite(readings["redundancy"])]
    figure = Figure(figsize=(WIDTH, 2.5))
    left, right = figure.subplots(1, 2)
    edges = np.arange(-5, 5.01, 0.5 if len(w) < 400 else 0.25)
    left.hist(np.clip(w, -4.99, 4.99), edges, color=PALE, edgecolor="white", linewidth=0.4)
    x = np.linspace(-5, 5, 201)
    step = edges[1] - edges[0]
    left.plot(x, len(w) * step * np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi), color=RED)
    left.set_xlim(-5, 5)
    left.set_xlabel(paper.word("axes.w"))
    left.set_ylabel(paper.word("axes.readings"))
    right.hist(redundancy, np.arange(0, 1.01, 0.05), color=PALE, edgecolor="white",
               linewidth=0.4)  # fmt: skip
    right.set_xlim(0, 1)
    right.set_xlabel(paper.word("axes.redundancy"))
    for ax in (left, right):
        ax.grid(True, axis="y")
        ax.set_axisbelow(True)
    set_margins(figure, left=0.6, right=0.12, bottom=0.42, top=0.08, wspace=0.2)
    return figure


def select_photos(paper):
    """Select the photos whose residuals are drawn: MOST_PHOTOS with the largest residuals."""
    photos = [photo for photo in paper.record["adjustment"]["photos"] if photo["points"]]
    worst = sorted(photos, key=lambda photo: -(photo["rms_mm"] or 0.0))[:MOST_PHOTOS]
    names = {photo["photo"] for photo in worst}
    return [photo for photo in photos if photo["photo"] in names]


def vectors_factor(paper, of_photo=None):
    """Return the enlargement of the residuals relative to the image.

    `of_photo` is the result of `image_residuals`; None: computed here.
    """
    of_photo = image_residuals(paper) if of_photo is None else of_photo
    size = [np.abs(v).max(initial=0.0) for _, v, _ in of_photo.values()]
    half = max(_half(paper))
    return round_factor(0.4 * half / max(size)) if max(size, default=0.0) > 0 else 1


@styled
def photo_residuals(paper, of_photo=None):
    """Figure of the residuals of image points, a panel per photo; crosses are rejected points.

    `of_photo` is the result of `image_residuals`; None: computed here.
    """
    of_photo = image_residuals(paper) if of_photo is None else of_photo
    photos, factor, half = select_photos(paper), vectors_factor(paper, of_photo), _half(paper)
    across = 4
    down = ceil(len(photos) / across)
    shape = half[1] / half[0]
    height = WIDTH / across * shape + 0.22
    figure = Figure(figsize=(WIDTH, down * height))
    axes = figure.subplots(down, across, squeeze=False).ravel()
    for ax, photo in zip(axes, photos, strict=False):
        xy, v, rejected = of_photo[photo["photo"]]
        ax.add_patch(
            matplotlib.patches.Rectangle(
                (-half[0], -half[1]), 2 * half[0], 2 * half[1], fill=False, linewidth=0.5,
                edgecolor=GREY,
            )
        )  # fmt: skip
        many = rasterize_many(xy)
        ends = xy + factor * v
        # All vectors are one line, broken at nan: faster than a line for each.
        vectors = np.stack([xy, ends, np.full_like(xy, np.nan)], axis=1)
        ax.plot(*vectors.reshape(-1, 2).T, color=INK, linewidth=0.6, **many)
        ax.plot(*xy.T, ".", color=INK, markersize=1.6, **many)
        ax.plot(*rejected.T, "x", color=RED, markersize=3.5, markeredgewidth=0.8,
                **rasterize_many(rejected))  # fmt: skip
        ax.set(aspect="equal", xlim=(-1.03 * half[0], 1.03 * half[0]),
               ylim=(-1.03 * half[1], 1.03 * half[1]))  # fmt: skip
        rms = paper.number(photo["rms_mm"], "image um", decimals=1)
        title = paper.word("axes.photo", photo=photo["photo"], rms=rms)
        ax.set_title(title, fontsize=8, pad=2, parse_math=False)
    for ax in axes:
        ax.axis("off")
    figure.subplots_adjust(
        left=0.005, right=0.995, bottom=0.005, top=1 - 0.18 / (down * height), wspace=0.04,
        hspace=0.22 / (height - 0.22),
    )  # fmt: skip
    return figure


def _half(paper):
    """Return half width and half height of the largest image, mm."""
    edges = [camera["edge_mm"] for camera in paper.record["adjustment"]["cameras"]]
    return np.maximum(np.max(edges, axis=0), 1e-6)


def image_residuals(paper):
    """Return {photo: (xy (n, 2), residuals (n, 2), rejected xy (m, 2))}, mm, of drawn photos."""
    names = [photo["photo"] for photo in select_photos(paper)]
    readings = paper.readings
    readings = readings.take(_are_of_kind(readings, "image coordinate") & ~readings.arrays["check"])
    ids = readings.arrays["ids"]
    photo = np.array([names.index(text) if text in names else -1 for text in ids.texts])
    photo = photo[ids.codes[:, 0]]
    readings, photo = readings.take(photo >= 0), photo[photo >= 0]
    return {name: _join_coordinates(readings.take(photo == i)) for i, name in enumerate(names)}


def _join_coordinates(readings):
    """Return positions and residuals of used points, and positions of rejected points."""
    columns = readings.arrays
    # A point is a name with a row of the file; points keep the order of their first reading.
    keys = np.column_stack([columns["ids"].codes[:, 1], columns["row"]])
    _, first, point = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    order = np.empty(len(first), dtype=int)
    order[np.argsort(first)] = np.arange(len(first))
    point = order[point.ravel()]
    is_y = np.array([text == "y" for text in columns["element"].texts], dtype=bool)
    axis = is_y[columns["element"].codes].astype(int)
    xy, residuals = np.zeros((2, len(first), 2))
    xy[point, axis] = columns["value"]
    residuals[point, axis] = np.nan_to_num(columns["residual"])
    is_rejected = np.zeros(len(first), dtype=bool)
    is_rejected[point[columns["removed"]]] = True
    return xy[~is_rejected], residuals[~is_rejected], xy[is_rejected]


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
