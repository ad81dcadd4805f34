"""The figures of the adjustment: plan with error ellipses, residuals of the photos, test values."""

from math import ceil

import matplotlib
import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from tankcal.pipeline.plot_style import (
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
from tankcal.record.columns import as_columns
from tankcal.report.survey.readings import adjusted
from tankcal.text.labels import MARK, Label, write_labels

MOST_PHOTOS = 12
MOST_NAMES = 60  # places whose names are written in the plan
MOST_AT_A_PLACE = 4  # names beside one place
LARGEST_ELLIPSE = 0.04  # of the plan
SAME_PLACE = 0.015  # of the plan
PLAN_POINTS = 300  # typographic points that the plan measures
_BEHIND = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.3}
_MARKS = {"control": ("^", INK), "check": ("s", "#6b4c9a"), "station": ("D", "#2e7d32")}


def plan_factor(paper):
    """How many times larger than the plan its ellipses are drawn: 1, 2 or 5 times 10^n."""
    points = as_columns(paper.record["adjustment"]["points"])
    largest = points.arrays["ellipse_m"][:, 0].max() if points.count else 0.0
    return round_factor(LARGEST_ELLIPSE * _extent(paper) / largest) if largest > 0 else 1


def _places(paper):
    """{point: (x, y)}, m."""
    points = as_columns(paper.record["points"])
    return dict(zip(points["point"], zip(points["x_m"], points["y_m"], strict=True), strict=True))


def _extent(paper):
    """Size of the plan, m."""
    photos = [(one["x_m"], one["y_m"]) for one in paper.record["adjustment"]["photos"]]
    xy = np.array([*_places(paper).values(), *photos])
    return float(np.ptp(xy, axis=0).max()) or 1.0


def plan_name(paper):
    """Name of the caption: of very many points only the weakest have an ellipse."""
    return "plan_many" if len(paper.record["adjustment"]["points"]) > MANY else "plan"


@styled
def plan(paper):
    """The network from above: points with their error ellipses, stations, photos, distances."""
    adjustment, places = paper.record["adjustment"], _places(paper)
    points = as_columns(adjustment["points"])
    xy = np.array([places[name] for name in points["point"]])
    origin = np.floor(xy.min(axis=0) / 1000) * 1000 if np.abs(xy).max() > 1e5 else np.zeros(2)
    factor, extent = plan_factor(paper), _extent(paper)
    figure = Figure(figsize=(WIDTH, 4.6))
    ax = figure.subplots()
    _lines(ax, paper, places, origin)
    _ellipses(ax, points, xy - origin, factor)
    _marks(ax, paper, points, xy - origin)
    photos = _photos(ax, paper, adjustment["photos"], origin)
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.margins(0.06)
    ax.set_xlabel(_axis(paper, "x", origin[0]))
    ax.set_ylabel(_axis(paper, "y", origin[1]))
    ax.grid(True)
    ax.set_axisbelow(True)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=5, frameon=False)
    set_margins(figure, left=0.65, right=0.1, bottom=0.75, top=0.08)
    labels = _names(points, xy - origin, factor, extent)
    labels += _photo_names(adjustment["photos"], photos)
    marks = np.vstack([xy - origin, photos])
    largest = factor * points.arrays["ellipse_m"][:, 0]
    ellipses = 0.75 * _on_page(largest, extent)
    room = np.maximum([*ellipses, *(0.0 for _ in photos)], MARK)
    write_labels(ax, labels, marks, size=6, room=room, color=GREY, zorder=5, bbox=_BEHIND)
    return figure


def _ellipses(ax, points, xy, factor):
    """Error ellipses, of very many points those of the weakest."""
    axes = points.arrays["ellipse_m"]
    weakest = np.argsort(-axes[:, 0], kind="stable")[:MANY]
    turn = 90 - points.arrays["ellipse_azimuth_deg"][weakest]
    size = 2 * factor * axes[weakest]
    ellipses = EllipseCollection(
        size[:, 0], size[:, 1], turn, units="xy", offsets=xy[weakest], transOffset=ax.transData,
        facecolors="none", edgecolors=RED, linewidths=0.6,
    )  # fmt: skip
    ax.add_collection(ellipses)


def _axis(paper, axis, origin):
    text = paper.word(f"axes.{axis}")
    return f"{text} − {paper.number(origin, 'm', decimals=0)}" if origin else text


def _lines(ax, paper, places, origin):
    """Distances and sights between points, thin, where there are not too many to see any."""
    setups = paper.record["adjustment"]["setups"]
    station = {one["setup"]: one["station"] for one in setups}
    ends = set()
    drawn = ~_are_of(paper.readings, "image coordinate", "plumb line")
    for ids in paper.readings.take(drawn)["ids"]:
        if len(ids) > 1:
            ends.add((station.get(ids[0], ids[0]), ids[-1]))
    ends = {pair for pair in ends if pair[0] in places and pair[1] in places}
    if len(ends) > MANY:
        return
    for start, end in sorted(ends):
        (x0, y0), (x1, y1) = places[start], places[end]
        ax.plot(
            [x0 - origin[0], x1 - origin[0]], [y0 - origin[1], y1 - origin[1]],
            color=FAINT, linewidth=0.4, zorder=1,
        )  # fmt: skip


def _are_of(readings, *kinds):
    """(n,) whether readings are of these kinds."""
    found = readings.arrays["kind"]
    return np.array([kind in kinds for kind in found.texts], dtype=bool)[found.codes]


def _marks(ax, paper, points, xy):
    kinds = np.array(points["kind"])
    plain = kinds == "point"
    ax.plot(*xy[plain].T, ".", color=GREY, markersize=2, zorder=3,
            label=paper.word("plan.point"), **rasterize_many(xy[plain]))  # fmt: skip
    for kind, (mark, colour) in _MARKS.items():
        own = kinds == kind
        if own.any():
            ax.plot(*xy[own].T, mark, color=colour, markersize=3.5, zorder=4,
                    label=paper.word(f"plan.{kind}"), **rasterize_many(xy[own]))  # fmt: skip


def _on_page(length_m, extent_m):
    """A length in a plan of that extent in typographic points, about."""
    return PLAN_POINTS * length_m / extent_m


def _names(points, xy, factor, extent_m):
    """Names beside the ellipses, outwards; points above one another share a line.

    Those of stations, control and check points find their places first.
    """
    middle = xy.mean(axis=0)
    kinds, all_names = points["kind"], points["point"]
    groups = _at_one_place(kinds, xy, SAME_PLACE * extent_m)
    groups.sort(key=lambda numbers: all(kinds[n] == "point" for n in numbers))
    found = []
    for numbers in groups:
        names = [all_names[n] for n in numbers]
        ellipse = factor * points.arrays["ellipse_m"][numbers, 0].max()
        clear = 3 + 0.75 * _on_page(ellipse, extent_m)
        forms = tuple(_shortened(names, most) for most in (MOST_AT_A_PLACE, 1))
        away = tuple(np.sign(xy[numbers[0]] - middle) + 1e-3 * (xy[numbers[0]] - middle))
        found.append(Label(*xy[numbers[0]], forms, clear, away))
    return found


def _shortened(names, most):
    """The first names, and how many more there are."""
    more = [f"+{len(names) - most}"] if len(names) > most else []
    return ", ".join([*names[:most], *more])[:60]


def _at_one_place(kinds, xy, near):
    """Lists of the numbers of points that share a name tag; of too many places the stations."""
    groups, places = [], np.zeros((0, 2))
    for number, place in enumerate(xy):
        away = np.linalg.norm(places - place, axis=1)
        if len(away) and away.min() < near:
            groups[int(away.argmin())].append(number)
        elif len(groups) == MOST_NAMES:
            return [[n] for n, kind in enumerate(kinds) if kind == "station"]
        else:
            groups.append([number])
            places = np.vstack([places, place])
    return groups


def _photos(ax, paper, photos, origin):
    """Mark where the photographs were taken; their places (n, 2)."""
    xy = np.array([[one["x_m"], one["y_m"]] for one in photos]).reshape(-1, 2) - origin
    if photos:
        ax.plot(*xy.T, "v", color="white", markeredgecolor=INK, markersize=6, zorder=4,
                label=paper.word("plan.photo"))  # fmt: skip
    return xy


def _photo_names(photos, xy):
    if len(photos) > MOST_NAMES:
        return []
    return [Label(*place, (one["photo"],), 5.0) for one, place in zip(photos, xy, strict=True)]


@styled
def distributions(paper):
    """Histogram of w against the normal distribution, and of the redundancy numbers."""
    found = adjusted(paper).arrays
    w = found["w"][found["controlled"] & np.isfinite(found["w"])]
    redundancy = found["redundancy"][np.isfinite(found["redundancy"])]
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


def shown_photos(paper):
    """The photos whose residuals are drawn: all, or those that fit worst, in their order."""
    photos = [one for one in paper.record["adjustment"]["photos"] if one["points"]]
    worst = sorted(photos, key=lambda one: -(one["rms_mm"] or 0.0))[:MOST_PHOTOS]
    names = {one["photo"] for one in worst}
    return [one for one in photos if one["photo"] in names]


def vectors_factor(paper, of_photo=None):
    """How many times larger than the image its residuals are drawn.

    of_photo  as `image_residuals` gives it
    """
    of_photo = image_residuals(paper) if of_photo is None else of_photo
    size = [np.abs(v).max(initial=0.0) for _, v, _ in of_photo.values()]
    half = max(_half(paper))
    return round_factor(0.4 * half / max(size)) if max(size, default=0.0) > 0 else 1


@styled
def photo_residuals(paper, of_photo=None):
    """Residuals of the image points as vectors, one panel a photo; crosses were rejected.

    of_photo  as `image_residuals` gives it
    """
    of_photo = image_residuals(paper) if of_photo is None else of_photo
    photos, factor, half = shown_photos(paper), vectors_factor(paper, of_photo), _half(paper)
    across = 4
    down = ceil(len(photos) / across)
    shape = half[1] / half[0]
    height = WIDTH / across * shape + 0.22
    figure = Figure(figsize=(WIDTH, down * height))
    axes = figure.subplots(down, across, squeeze=False).ravel()
    for ax, photo in zip(axes, photos, strict=False):
        xy, v, aside = of_photo[photo["photo"]]
        ax.add_patch(
            matplotlib.patches.Rectangle(
                (-half[0], -half[1]), 2 * half[0], 2 * half[1], fill=False, linewidth=0.5,
                edgecolor=GREY,
            )
        )  # fmt: skip
        many = rasterize_many(xy)
        ends = xy + factor * v
        vectors = np.stack([xy, ends, np.full_like(xy, np.nan)], axis=1)  # one broken line
        ax.plot(*vectors.reshape(-1, 2).T, color=INK, linewidth=0.6, **many)
        ax.plot(*xy.T, ".", color=INK, markersize=1.6, **many)
        ax.plot(*aside.T, "x", color=RED, markersize=3.5, markeredgewidth=0.8,
                **rasterize_many(aside))  # fmt: skip
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
    """Half width and height of the largest image, mm."""
    edges = [camera["edge_mm"] for camera in paper.record["adjustment"]["cameras"]]
    return np.maximum(np.max(edges, axis=0), 1e-6)


def image_residuals(paper):
    """{photo: (xy (n, 2), residuals (n, 2), xy rejected (m, 2))}, mm, of the photos shown."""
    wanted = [one["photo"] for one in shown_photos(paper)]
    readings = paper.readings
    readings = readings.take(_are_of(readings, "image coordinate") & ~readings.arrays["check"])
    ids = readings.arrays["ids"]
    photo = np.array([wanted.index(name) if name in wanted else -1 for name in ids.texts])
    photo = photo[ids.codes[:, 0]]
    readings, photo = readings.take(photo >= 0), photo[photo >= 0]
    return {name: _of_photo(readings.take(photo == i)) for i, name in enumerate(wanted)}


def _of_photo(readings):
    """Of the readings of one photo: image points, residuals, those that were rejected."""
    found = readings.arrays
    keys = np.column_stack([found["ids"].codes[:, 1], found["row"]])
    _, first, point = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    order = np.empty(len(first), dtype=int)
    order[np.argsort(first)] = np.arange(len(first))
    point = order[point.ravel()]
    is_y = np.array([text == "y" for text in found["element"].texts], dtype=bool)
    axis = is_y[found["element"].codes].astype(int)
    values, residuals = np.zeros((2, len(first), 2))
    values[point, axis] = found["value"]
    residuals[point, axis] = np.nan_to_num(found["residual"])
    aside = np.zeros(len(first), dtype=bool)
    aside[point[found["removed"]]] = True
    return values[~aside], residuals[~aside], values[aside]
