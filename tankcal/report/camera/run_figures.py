"""Figures of check points and of the influence of calibrations."""

import numpy as np
from matplotlib.figure import Figure

from tankcal.pipeline.plot_style import FAINT, GREY, INK, RED, WIDTH, set_margins
from tankcal.report import numbers
from tankcal.report.camera.drawings import line_style, styled
from tankcal.report.camera.influence import adjusted, label
from tankcal.report.camera.product import unit_of

BAR = 0.26


TALLEST = 8.0  # inches of bars
WIDE_RANGE = 30  # of bars, from which on they are drawn to a logarithmic scale


def bars_name(paper):
    """The name of the figure of bars by what there is to be drawn; None: nothing."""
    found = [part for part in ("product", "volume") if any(r[part] for r in adjusted(paper))]
    if len(found) == 2:
        return "bars"
    return f"bars_{found[0]}" if found else None


@styled
def bars(paper):
    """RMSE at check points by axis, and change of the volume, for each run."""
    runs = adjusted(paper)
    parts = [part for part in ("product", "volume") if any(run[part] for run in runs)]
    figure = Figure(figsize=(WIDTH, min(0.3 * len(runs), TALLEST) + 0.75))
    axes = figure.subplots(1, len(parts), sharey=True, squeeze=False)[0]
    places = np.arange(len(runs))
    for ax, part in zip(axes, parts, strict=True):
        if part == "product":
            _rmse(paper, ax, runs, places)
        else:
            _volumes(paper, ax, runs, places)
        ax.grid(True, axis="x")
        ax.set_axisbelow(True)
    axes[0].set_yticks(places, [label(paper, run) for run in runs], parse_math=False)
    axes[0].invert_yaxis()
    if "product" in parts:
        figure.legend(loc="upper right", ncols=3, fontsize=7.5, frameon=False)
    widest = max(len(label(paper, run)) for run in runs)
    left = 0.25 + 0.062 * widest
    set_margins(figure, left=left, right=0.15, bottom=0.42, top=0.25, wspace=0.1)
    return figure


def _rmse(paper, ax, runs, places):
    unit = numbers.unit(rmse_unit(runs))
    for k, axis in enumerate("xyz"):
        sizes = [
            next(
                (
                    row["rmse_m"] * unit.factor
                    for row in (run["product"] or {}).get("axes", [])
                    if row["axis"] == axis and row["rmse_m"] is not None
                ),
                np.nan,
            )
            for run in runs
        ]
        if not np.all(np.isnan(sizes)):
            name = paper.word(f"axis_names.{axis}")
            colour = line_style(k)["color"]
            ax.barh(places + (k - 1) * BAR, sizes, BAR, color=colour, label=name)
    drawn = [bar.get_width() for bar in ax.patches if bar.get_width() > 0]
    if drawn and max(drawn) > WIDE_RANGE * min(drawn):
        ax.set_xscale("log")
    ax.set_xlabel(paper.word("axes.rmse", unit=unit.symbol))


def rmse_unit(runs):
    """The unit of the check points of all runs together."""
    units = {unit_of(run["product"]) for run in runs if run["product"]}
    return "m" if "m" in units else "mm"


def _volumes(paper, ax, runs, places):
    changes = [
        ((run["shifts"] or {}).get("volume") or {}).get("difference_m3", np.nan) for run in runs
    ]
    ax.barh(places, np.array(changes, dtype=float), 0.5, color=INK)
    ax.axvline(0, color=GREY, linewidth=0.6)
    reference = runs[0]["volume"]
    if runs[0]["calibration"] is None and reference and reference["U_m3"]:
        u_m3 = reference["U_m3"]
        ax.axvspan(-u_m3, u_m3, color=FAINT, alpha=0.25, linewidth=0)
    ax.set_xlabel(paper.word("axes.volume_change"))


@styled
def differences(paper):
    """Differences at check points: the plan, and the heights."""
    found = paper.result
    unit = numbers.unit(unit_of(found))
    values = {
        row["axis"]: np.array(
            [np.nan if one[key] is None else one[key] for one in found["differences"]], dtype=float
        )
        * unit.factor
        for row in found["axes"]
        for key in [f"d{row['axis']}_m"]
    }
    figure = Figure(figsize=(WIDTH, 2.8))
    in_plan = {"x", "y"} <= set(values)
    others = [axis for axis in values if not (in_plan and axis in "xy")]
    axes = figure.subplots(1, in_plan + bool(others), squeeze=False)[0].tolist()
    if in_plan:
        _plan(paper, axes.pop(0), values, unit.symbol)
    if others:
        _along(paper, axes.pop(0), {axis: values[axis] for axis in others}, unit.symbol)
    set_margins(figure, left=0.62, right=0.12, bottom=0.42, top=0.12, wspace=0.3)
    return figure


def _plan(paper, ax, values, unit):
    x, y = values["x"], values["y"]
    limit = 1.15 * np.nanmax(np.abs([x, y]), initial=0.0) or 1.0
    ax.axhline(0, color=FAINT, linewidth=0.6)
    ax.axvline(0, color=FAINT, linewidth=0.6)
    ax.plot(x, y, "o", color=INK, markersize=2.6)
    both = ~np.isnan(x) & ~np.isnan(y)
    if both.any():
        ax.plot(x[both].mean(), y[both].mean(), "x", color=RED, markersize=7)
    ax.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal")
    ax.set_xlabel(paper.word("axes.difference_x", unit=unit))
    ax.set_ylabel(paper.word("axes.difference_y", unit=unit))
    ax.grid(True)


def _along(paper, ax, values, unit):
    for number, column in enumerate(values.values()):
        style = {"color": line_style(number)["color"], "markersize": 2.6}
        ax.plot(np.arange(1, len(column) + 1), column, "o", **style)
        if not np.all(np.isnan(column)):
            ax.axhline(np.nanmean(column), color=RED, linewidth=0.8, linestyle="--")
    ax.axhline(0, color=FAINT, linewidth=0.6)
    ax.set_xlabel(paper.word("axes.number"))
    names = ", ".join(paper.word(f"axis_names.{axis}") for axis in values)
    ax.set_ylabel(paper.word("axes.difference_of", axis=names, unit=unit))
    ax.grid(True)
