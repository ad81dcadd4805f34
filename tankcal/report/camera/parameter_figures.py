"""The figures of the parameters of a camera: correlations, components, loadings, effects and F."""

import numpy as np
from matplotlib.figure import Figure

from tankcal.pipeline.plot_style import FAINT, INK, RED, WIDTH, set_margins
from tankcal.report.camera.drawings import mathematical, matrix, over_whole_decades, styled
from tankcal.report.camera.parameter_tests import in_pixels
from tankcal.text.digits import fixed

COLOUR_MAP = "RdBu_r"


@styled
def correlations(paper):
    """The correlation matrix as colours with its numbers."""
    names = paper.result["names"]
    values = _numbers(paper.result["correlation"])
    hidden = np.triu(np.ones_like(values, dtype=bool))
    return _square(paper, np.where(hidden, np.nan, values)[1:, :-1], names[1:], names[:-1])


@styled
def loadings(paper):
    """The loadings as colours with their numbers."""
    found = paper.result["components"]
    heads = [str(number) for number in range(1, len(found["names"]) + 1)]
    return _square(paper, _numbers(found["loadings"]), found["names"], heads, heads)


def _numbers(rows):
    return np.array([[np.nan if one is None else one for one in row] for row in rows], dtype=float)


def _square(paper, values, labels, heads, plain=None):
    known = paper.words["parameters"]
    texts = [["" if np.isnan(one) else fixed(one, 2, paper.marks) for one in row] for row in values]
    figure = Figure(figsize=(WIDTH, 0.25 * len(labels) + 0.4))
    ax = figure.subplots()
    heads = plain or [mathematical(known.get(name, name)) for name in heads]
    rows = [mathematical(known.get(name, name)) for name in labels]
    scale = {"cmap": COLOUR_MAP, "vmin": -1, "vmax": 1}
    shown = matrix(ax, np.where(np.isnan(values), 0, values), texts, rows, heads, True, **scale)
    shown.set_alpha(np.where(np.isnan(values), 0.0, 1.0))
    set_margins(figure, left=0.4, right=0.05, bottom=0.05, top=0.27)
    return figure


@styled
def scree(paper):
    """Bars of the components' shares, and their running sum."""
    found = paper.result["components"]
    places = np.arange(1, len(found["eigenvalues"]) + 1)
    figure = Figure(figsize=(WIDTH, 2.3))
    ax = figure.subplots()
    ax.bar(places, found["share_percent"], color=INK, width=0.6)
    ax.plot(places, found["cumulative_percent"], "o-", color=RED, markersize=3)
    ax.set(xticks=places, ylim=(0, 105))
    ax.set_xlabel(paper.word("axes.component"))
    ax.set_ylabel(paper.word("axes.share_of_component"))
    ax.grid(True, axis="y")
    ax.set_axisbelow(True)
    set_margins(figure, left=0.55, right=0.12, bottom=0.42, top=0.08)
    return figure


@styled
def effects(paper):
    """Shift of the frame's corner by each parameter beside its F, on logarithmic scales."""
    unit = "px" if in_pixels(paper.result) else "um"
    rows = [row for row in paper.result["parameters"] if row["edge"]["own"]]
    figure = Figure(figsize=(WIDTH, 0.26 * len(rows) + 0.75))
    left, right = figure.subplots(1, 2, sharey=True)
    places = np.arange(len(rows))
    own = [abs(row["edge"]["own"][f"corner_{unit}"]) for row in rows]
    rest = [abs((row["edge"]["left"] or {}).get(f"corner_{unit}") or np.nan) for row in rows]
    _bars(left, places - 0.19, own, INK, paper.word("axes.own"), 0.36)
    _bars(left, places + 0.19, rest, FAINT, paper.word("axes.left"), 0.36)
    f = [np.nan if row["F"] is None else row["F"] for row in rows]
    _bars(right, places, f, INK, None, 0.5)
    accuracy = paper.result["image_accuracy"]
    limit = accuracy and accuracy[unit]
    if limit:
        left.axvline(limit, color=RED, linewidth=0.9)
    for row, place in zip(rows, places, strict=True):
        if row["critical"] is not None:
            right.plot([row["critical"]] * 2, [place - 0.4, place + 0.4], color=RED, linewidth=0.9)
    names = [mathematical(paper.parameters([row["name"]])) for row in rows]
    left.set_yticks(places, names)
    left.invert_yaxis()
    left.set_xlabel(paper.word(f"axes.effect_{unit}"))
    right.set_xlabel(paper.word("axes.f"))
    for ax in (left, right):
        over_whole_decades(ax)
        ax.grid(True, axis="x")
        ax.set_axisbelow(True)
    figure.legend(loc="upper left", ncols=2, fontsize=7.5, frameon=False)
    set_margins(figure, left=0.4, right=0.12, bottom=0.42, top=0.25, wspace=0.08)
    return figure


def _bars(ax, places, sizes, colour, label, height):
    """Bars from the left edge of a logarithmic scale; nothing for 0."""
    seen = [size for size in sizes if size > 0]
    if seen:
        ax.set_xscale("log")
    ax.barh(
        places, [size if size > 0 else np.nan for size in sizes], height, color=colour, label=label
    )
