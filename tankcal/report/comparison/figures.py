"""Figures of a comparison: the waterfall, the remaining differences with U, and E_n by dip."""

import textwrap

import numpy as np
from matplotlib.figure import Figure

from tankcal.report.camera.figures import styled
from tankcal.report.comparison.tables import FINE, shown_steps
from tankcal.report.plots.style import FAINT, GREY, INK, PALE, RED, WIDTH, set_margins
from tankcal.text.digits import fixed

LABEL_LETTERS = 20  # letters in a line of the label below a bar
ROOM = 0.14  # space for the numbers above the bars, relative to the span of the bars
HEIGHT_IN = 2.3  # height of a figure by dip, inches
LEAST_E_N = 1.25  # smallest limit of an axis of E_n, so that the lines at 1 are inside


@styled
def waterfall(paper):
    """Draw bars from the former to the new volume at the highest dip, and their sum."""
    last = paper.record["waterfall"][-1]
    codes = [*shown_steps(paper.record), "tank"]
    sizes = np.array([last[f"{code}_m3"] for code in codes])
    ends = np.concatenate([[0.0], np.cumsum(sizes)])
    names = [paper.word(f"steps.{code}") for code in (*codes, "all")]
    # Each bar reaches from the end of the bar before it; the last bar shows the sum from zero.
    lows = np.append(np.minimum(ends[:-1], ends[1:]), min(ends[-1], 0.0))
    highs = np.append(np.maximum(ends[:-1], ends[1:]), max(ends[-1], 0.0))
    figure = Figure(figsize=(WIDTH, 2.6))
    ax = figure.subplots()
    places = np.arange(len(names))
    colours = [INK if size >= 0 else RED for size in sizes] + [GREY]
    ax.bar(places, highs - lows, bottom=lows, color=colours, width=0.6)
    ax.hlines(ends[1:], places[:-1] + 0.3, places[1:] - 0.3, color=FAINT, linewidth=0.6)
    ax.axhline(0, color=GREY, linewidth=0.6)
    span = float(highs.max() - lows.min()) or 1.0
    for place, high, size in zip(places, highs, [*sizes, ends[-1]], strict=True):
        text = ("+" if size > 0 else "") + fixed(size, FINE, paper.marks)
        ax.text(place, high + 0.02 * span, text, ha="center", va="bottom", fontsize=8)
    ax.set_ylim(min(lows.min() - 0.04 * span, 0.0), highs.max() + ROOM * span)
    labels = [textwrap.fill(name, LABEL_LETTERS, break_long_words=False) for name in names]
    ax.set_xticks(places, labels, parse_math=False, fontsize=8)
    ax.tick_params(axis="x", length=0)
    ax.set_ylabel(paper.word("axes.step"))
    ax.grid(True, axis="y")
    ax.set_axisbelow(True)
    bottom = 0.28 if all("\n" not in label for label in labels) else 0.42
    set_margins(figure, left=0.65, right=0.1, bottom=bottom, top=0.08)
    return figure


@styled
def differences(paper):
    """Draw the new minus the former volume at each dip, over the bands of U of both tables."""
    rows = _rows(paper)
    height_m, d_m3 = rows["height_m"], rows["d_m3"]
    figure, ax = _figure_by_dip(paper, "axes.d")
    for key, colour in (("U_former_m3", FAINT), ("U_new_m3", PALE)):
        known = np.isfinite(rows[key])
        if known.any():
            u_m3 = rows[key][known]
            label = paper.word(f"legend.{key}")
            ax.fill_between(
                height_m[known], -u_m3, u_m3, color=colour, alpha=0.45, linewidth=0, label=label
            )
    ax.plot(height_m, d_m3, color=INK, label=paper.word("legend.d"))
    ax.axhline(0, color=GREY, linewidth=0.6)
    _shade_unusable_rows(paper, ax, rows)
    _add_legend(figure, ax)
    return figure


@styled
def normalised(paper):
    """Draw E_n at each dip with lines at +-1; rows that are not judged are pale."""
    rows = _rows(paper)
    height_m, e_n = rows["height_m"], rows["E_n"]
    judged = height_m >= paper.record["judged_from_m"]
    figure, ax = _figure_by_dip(paper, "axes.E_n")
    ax.plot(
        height_m,
        np.where(judged, e_n, np.nan),
        color=INK,
        label=typeset_E_n(paper.word("legend.judged")),
    )
    if (~judged & np.isfinite(e_n)).any():
        # The pale line includes the lowest judged row, so that both lines meet.
        below = height_m <= height_m[judged].min(initial=np.inf)
        label = paper.word("legend.not_judged")
        ax.plot(height_m, np.where(below, e_n, np.nan), color=PALE, label=label, zorder=1)
    draw_E_n_limits(ax, float(np.nanmax(np.abs(e_n), initial=0.0)))
    _shade_unusable_rows(paper, ax, rows)
    _add_legend(figure, ax)
    return figure


def draw_E_n_limits(ax, largest):
    """Draw lines at E_n = -1, 0 and 1; the axis includes the largest |E_n|."""
    for limit in (-1.0, 1.0):
        ax.axhline(limit, color=RED, linewidth=0.9, linestyle="--")
    ax.axhline(0, color=GREY, linewidth=0.6)
    reach = max(LEAST_E_N, 1.1 * largest)
    ax.set_ylim(-reach, reach)


def typeset_E_n(text):
    """Return a label of a figure with the index of E_n as mathematical text."""
    return text.replace("E\N{LATIN SUBSCRIPT SMALL LETTER N}", r"$E_\mathrm{n}$")


def _rows(paper):
    """Return {column: values of the rows (rows,)}; nan for None."""
    return {key: np.array(values, dtype=float) for key, values in paper.record["rows"].items()}


def _figure_by_dip(paper, name):
    figure = Figure(figsize=(WIDTH, HEIGHT_IN))
    ax = figure.subplots()
    ax.set_xlabel(paper.word("axes.dip"))
    ax.set_ylabel(typeset_E_n(paper.word(name)))
    ax.set_xlim(paper.record["low_m"], paper.record["high_m"])
    ax.grid(True)
    set_margins(figure, left=0.65, right=0.12, bottom=0.42, top=0.28)
    return figure, ax


def _shade_unusable_rows(paper, ax, rows):
    """Shade the ranges of dips in which a roof is partly afloat."""
    edges = np.diff(np.concatenate([[0], rows["for_use"] == 0, [0]]).astype(int))
    label = {"label": paper.word("legend.not_for_use")}
    for first, last in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0) - 1, strict=True):
        low, high = rows["height_m"][[first, last]]
        ax.axvspan(low, high, color=FAINT, alpha=0.25, linewidth=0, **label)
        label = {}  # one entry in the legend


def _add_legend(figure, ax):
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper right", ncols=4, fontsize=7.5, frameon=False)
