"""Figures: uncertainty of deliveries, and comparison of GUM and Monte Carlo."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from tankcal.record.covariance_factor import factor_of, norms_of_rows
from tankcal.report.plots.style import FAINT, INK, RED, WIDTH, set_margins, styled

_SHORT_AXIS = 20  # ratio of the ends of an axis up to which minor ticks have numbers
_MOST = 98  # smallest percentage of the differences within the frame


@styled
def delivery_curve(paper):
    """Figure of the standard uncertainty of volumes, and of deliveries from the full tank.

    With the covariance factor F, Cov = F F^T, the standard uncertainty of a delivery is the norm
    of the difference of two rows of F.
    """
    capacity = paper.record["capacity"]
    height_m, volume_m3, u_m3 = (
        np.array(capacity[key]) for key in ("height_m", "volume_m3", "u_m3")
    )
    factor = factor_of(capacity)
    delivered = {
        "height": height_m[-1] - height_m[:-1],
        "volume": volume_m3[-1] - volume_m3[:-1],
        "u": norms_of_rows(lambda rows: factor[-1] - factor[rows], len(factor) - 1),
    }
    below = {"height": height_m[1:], "volume": volume_m3[1:], "u": u_m3[1:]}
    deliveries = [
        entry["at_minimum"] for entry in paper.record["deliveries"] if entry["at_minimum"]
    ]
    worst = {
        "height": np.array([delivery["high_m"] - delivery["low_m"] for delivery in deliveries]),
        "volume": np.array([delivery["volume_m3"] for delivery in deliveries]),
        "u": np.array([delivery["u_m3"] for delivery in deliveries]),
    }
    figure = Figure(figsize=(WIDTH, 2.9))
    left, right = figure.subplots(1, 2)
    for curve, look, name in (
        (below, {"color": FAINT}, "volume_below"),
        (delivered, {"color": INK}, "delivery_from_full"),
        (worst, {"color": RED, "marker": "o", "markersize": 3, "linestyle": ""}, "worst"),
    ):
        left.plot(
            curve["height"],
            paper.volume_factor * curve["u"],
            label=paper.word(f"axes.{name}"),
            **look,
        )
        right.plot(curve["height"], 100 * curve["u"] / curve["volume"], **look)
    left.set_ylabel(paper.word("axes.u_m3").replace("m³", paper.volume_symbol))
    left.set_ylim(bottom=0)
    right.set_ylabel(paper.word("axes.u_percent"))
    right.set_yscale("log")
    right.yaxis.set_major_formatter(ScalarFormatter())
    right.yaxis.set_minor_formatter(_few_decades(right))
    for ax in (left, right):
        ax.set_xlabel(paper.word("axes.delivery_height"))
        ax.set_xlim(0, height_m[-1])
        ax.grid(True)
    figure.legend(loc="upper center", ncols=3, frameon=False, fontsize=8)
    set_margins(figure, left=0.65, right=0.12, bottom=0.42, top=0.32, wspace=0.3)
    return figure


def _few_decades(ax):
    """Return the formatter of minor ticks of a logarithmic axis: numbers on a short axis only."""
    low, high = ax.get_ylim()
    return ScalarFormatter() if high / low < _SHORT_AXIS else NullFormatter()


@styled
def interval_differences(paper):
    """Figure of the differences between Monte Carlo and GUM intervals, in percent of U."""
    capacity, rows = paper.record["capacity"], paper.record["monte_carlo"]["rows"]
    volume, U, height = (np.array(capacity[key]) for key in ("volume_m3", "U_m3", "height_m"))
    tolerance = np.array(rows["tolerance"], dtype=float)  # None becomes nan
    known = (U > 0) & np.isfinite(tolerance)
    percent = 100 / U[known]
    ends = {
        "lower_end": (np.array(rows["low"]) - (volume - U))[known] * percent,
        "upper_end": (np.array(rows["high"]) - (volume + U))[known] * percent,
    }
    allowed = tolerance[known] * percent
    largest = np.percentile(np.abs([*ends.values()]), _MOST, axis=1).max(initial=0.0)
    limit = 1.2 * max(largest, np.median(allowed))
    figure = Figure(figsize=(WIDTH, 2.7))
    ax = figure.subplots()
    for sign in (-1, 1):
        ax.plot(height[known], sign * allowed, color=FAINT, linewidth=0.7)
    for (name, difference), colour in zip(ends.items(), (INK, RED), strict=True):
        ax.plot(height[known], difference, color=colour, label=paper.word(f"axes.{name}"))
    ax.set_ylim(-limit, limit)
    ax.set_xlim(height[0], height[-1])
    ax.set_xlabel(paper.word("axes.height"))
    ax.set_ylabel(paper.word("axes.ends_percent"))
    ax.grid(True)
    figure.legend(loc="upper center", ncols=2, frameon=False, fontsize=8)
    set_margins(figure, left=0.65, right=0.12, bottom=0.42, top=0.32)
    return figure
