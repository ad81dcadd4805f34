"""The figures of a comparison: the waterfall, what is left at each dip with U, E_n by dip."""

import textwrap

import numpy as np
from matplotlib.figure import Figure

from tankcal.pipeline.plot_style import FAINT, GREY, INK, PALE, RED, WIDTH, set_margins
from tankcal.report.camera.drawings import styled
from tankcal.report.comparison.tables import FINE, steps_done
from tankcal.text.digits import fixed

LETTERS = 20  # in a line below a bar
ROOM = 0.14  # of the span of the bars: for the numbers over them
HIGH = 2.3  # inches of a figure by dip


@styled
def waterfall(paper):
    """Bars from the former volume to the new one at the highest dip, and their sum."""
    last = paper.found["waterfall"][-1]
    codes = [*steps_done(paper.found), "tank"]
    sizes = np.array([last[f"{code}_m3"] for code in codes])
    ends = np.concatenate([[0.0], np.cumsum(sizes)])
    names = [paper.word(f"steps.{code}") for code in (*codes, "all")]
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
    lines = [textwrap.fill(name, LETTERS, break_long_words=False) for name in names]
    ax.set_xticks(places, lines, parse_math=False, fontsize=8)
    ax.tick_params(axis="x", length=0)
    ax.set_ylabel(paper.word("axes.step"))
    ax.grid(True, axis="y")
    ax.set_axisbelow(True)
    below = 0.28 if all("\n" not in line for line in lines) else 0.42
    set_margins(figure, left=0.65, right=0.1, bottom=below, top=0.08)
    return figure


@styled
def differences(paper):
    """New less former on one basis at each dip, over the bands of U of either table."""
    rows = _rows(paper)
    height_m, d_m3 = rows["height_m"], rows["d_m3"]
    figure, ax = _by_dip(paper, "axes.d")
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
    _not_for_use(paper, ax, rows)
    _legend(figure, ax)
    return figure


@styled
def normalised(paper):
    """E_n at each dip with the lines at +-1; dips whose rows are not judged are pale."""
    rows = _rows(paper)
    height_m, e_n = rows["height_m"], rows["E_n"]
    judged = height_m >= paper.found["judged_from_m"]
    figure, ax = _by_dip(paper, "axes.E_n")
    ax.plot(
        height_m,
        np.where(judged, e_n, np.nan),
        color=INK,
        label=_mathematical(paper.word("legend.judged")),
    )
    if (~judged & np.isfinite(e_n)).any():
        below = height_m <= height_m[judged].min(initial=np.inf)
        label = paper.word("legend.not_judged")
        ax.plot(height_m, np.where(below, e_n, np.nan), color=PALE, label=label, zorder=1)
    for limit in (-1.0, 1.0):
        ax.axhline(limit, color=RED, linewidth=0.9, linestyle="--")
    ax.axhline(0, color=GREY, linewidth=0.6)
    largest = float(np.nanmax(np.abs(e_n), initial=0.0))
    ax.set_ylim(-max(1.25, 1.1 * largest), max(1.25, 1.1 * largest))
    _not_for_use(paper, ax, rows)
    _legend(figure, ax)
    return figure


def _rows(paper):
    """Columns of the rows as arrays; None is nan."""
    return {key: np.array(values, dtype=float) for key, values in paper.found["rows"].items()}


def _mathematical(text):
    """Words of ours for a figure, with the index of E set as one."""
    return text.replace("E\N{LATIN SUBSCRIPT SMALL LETTER N}", r"$E_\mathrm{n}$")


def _by_dip(paper, name):
    figure = Figure(figsize=(WIDTH, HIGH))
    ax = figure.subplots()
    ax.set_xlabel(paper.word("axes.dip"))
    ax.set_ylabel(_mathematical(paper.word(name)))
    ax.set_xlim(paper.found["low_m"], paper.found["high_m"])
    ax.grid(True)
    set_margins(figure, left=0.65, right=0.12, bottom=0.42, top=0.28)
    return figure, ax


def _not_for_use(paper, ax, rows):
    """Grey where a roof is partly afloat."""
    edges = np.diff(np.concatenate([[0], rows["for_use"] == 0, [0]]).astype(int))
    label = {"label": paper.word("legend.not_for_use")}
    for first, last in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0) - 1, strict=True):
        low, high = rows["height_m"][[first, last]]
        ax.axvspan(low, high, color=FAINT, alpha=0.25, linewidth=0, **label)
        label = {}


def _legend(figure, ax):
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper right", ncols=4, fontsize=7.5, frameon=False)
