"""The figures of scores: errors along the height with U, and Youden's plot of two tanks."""

from math import ceil

import numpy as np
from matplotlib.figure import Figure

from tankcal.pipeline.plot_style import FAINT, GREY, WIDTH, set_margins
from tankcal.report.camera.drawings import COLOURS, line_style, styled
from tankcal.report.scores.paper import EVERY

MOST_PANELS, ACROSS, PANEL_IN = 9, 3, 1.75
MARKS = "osD^v<>PX*"


def methods_of(found):
    """Methods that were answered, in the order of the scores."""
    return list(dict.fromkeys(one["method"] for one in found["methods"] if one["method"] != EVERY))


@styled
def errors(paper, method):
    """Errors in ppm of the tank against the height: a panel for each tank, a line a participant."""
    found = paper.found
    tables = [one for one in found["tables"] if one["method"] == method]
    tanks = list(dict.fromkeys(one["tank"] for one in tables))[:MOST_PANELS]
    down = ceil(len(tanks) / ACROSS)
    across = min(len(tanks), ACROSS)
    figure = Figure(figsize=(WIDTH, PANEL_IN * down + 0.75))
    grid = figure.subplots(down, across, squeeze=False)
    for place, ax in enumerate(grid.ravel()):
        if place >= len(tanks):
            ax.axis("off")
            continue
        for one in tables:
            if one["tank"] == tanks[place]:
                _line(ax, paper, one)
        ax.axhline(0, color=GREY, linewidth=0.6)
        ax.set_title(tanks[place], loc="left")
        if place % across == 0:
            ax.set_ylabel(paper.word("axes.error_ppm"))
        if place >= len(tanks) - across:
            ax.set_xlabel(paper.word("axes.height_scored"))
    set_margins(figure, 0.65, 0.1, 0.75, 0.25, wspace=0.3, hspace=0.45)
    _legend(figure, grid[0, 0])
    return figure


def _line(ax, paper, one):
    rows, style = one["rows"], line_style(one["participant"])
    full = rows["true_m3"][-1] / 1e6
    height, error = np.array(rows["height_m"]), np.array(rows["error_m3"]) / full
    U = np.array([np.nan if x is None else x for x in rows["U_m3"]], float) / full
    ax.fill_between(height, error - U, error + U, color=style["color"], alpha=0.15, linewidth=0)
    ax.plot(height, error, linewidth=1.0, label=paper.participant(one), **style)


@styled
def youden(paper, first, second):
    """Errors at the top of two tanks: what both share lies on the diagonal."""
    found = paper.found
    tops = {
        (one["participant"], one["method"], one["tank"]): one["top_error_ppm"]
        for one in found["tables"]
        if one["top_error_ppm"] is not None
    }
    figure = Figure(figsize=(4.6, 3.6))
    ax = figure.subplots()
    methods, seen = methods_of(found), [1.0]
    for who in range(len(found["participants"])):
        for number, method in enumerate(methods):
            pair = [tops.get((who, method, tank)) for tank in (first, second)]
            if None in pair:
                continue
            seen += [abs(one) for one in pair]
            label = paper.method(method)
            if len(found["participants"]) > 1:
                label = f"{paper.participant({'participant': who})}, {label}"
            ax.plot(*pair, MARKS[number % len(MARKS)], color=COLOURS[who % len(COLOURS)],
                    markersize=5, label=label, linestyle="")  # fmt: skip
    reach = 1.15 * max(seen)
    ax.plot([-reach, reach], [-reach, reach], color=FAINT, linewidth=0.6)
    ax.axhline(0, color=GREY, linewidth=0.6)
    ax.axvline(0, color=GREY, linewidth=0.6)
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    ax.set_xlabel(paper.word("axes.error_of", tank=first))
    ax.set_ylabel(paper.word("axes.error_of", tank=second))
    set_margins(figure, 0.65, 1.7, 0.55, 0.1)
    ax.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize=7)
    return figure


def tanks_of_youden(found):
    """The two tanks that most participants and methods answered; None: no two have one in common.

    Of equal pairs the first.
    """
    answered = {}
    for one in found["tables"]:
        if one["top_error_ppm"] is not None:
            answered.setdefault(one["tank"], set()).add((one["participant"], one["method"]))
    names = sorted(answered)
    pairs = [(len(answered[a] & answered[b]), -i, -j, a, b) for i, a in enumerate(names)
             for j, b in enumerate(names) if i < j]  # fmt: skip
    best = max(pairs, default=None)
    return best[3:] if best and best[0] > 0 else None


def _legend(figure, ax):
    lines, labels = ax.get_legend_handles_labels()
    if len(labels) > 1:
        figure.legend(lines, labels, loc="lower center", ncols=min(3, len(labels)), fontsize=7)
