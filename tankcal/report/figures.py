"""The figures of the working papers: the record's numbers drawn, in print style.

Each function takes a Paper and gives a matplotlib Figure, or a list of them when there are many
sections. Lengths of the page are inches.
"""

import logging
import textwrap
from math import ceil, floor, log10

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import Formatter, ScalarFormatter

from tankcal.report.uncertainty.stated import stated_U_m3

logging.getLogger("matplotlib").setLevel(logging.ERROR)  # no remark about its font cache on paper

STYLE = {
    "font.family": ["STIXGeneral", "DejaVu Serif"],
    "font.size": 8.5,
    "axes.linewidth": 0.5,
    "axes.edgecolor": "#445566",
    "axes.unicode_minus": True,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "grid.linewidth": 0.3,
    "grid.color": "#c3cad2",
    "lines.linewidth": 0.9,
}
INK, RED, PALE = "#1f4e79", "#b03a2e", "#9db8d2"
LEAST_SHARE = 1e-3  # of the variance: less is no bar
WIDTH = 6.5
LETTERS_OF_A_BAR = 46  # in a line of its name
_TURN = (-4, 364)  # degrees: points at north are not cut off
MANY = 500  # points in a panel: from here on their picture is smaller than their outlines


def residuals(paper, most=8):
    """Residuals in mm against azimuth, one panel a section, up to `most` panels a figure."""
    groups = even_groups(paper.record["sections"], most)
    largest = max(max(map(abs, s["residual_m"]), default=0.0) for s in paper.record["sections"])
    return [_residual_panels(paper, group, 1.1e3 * largest or 1.0) for group in groups]


def _residual_panels(paper, sections, limit_mm):
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, 0.55 * len(sections) + 0.55))
        axes = figure.subplots(len(sections), 1, sharex=True, squeeze=False)[:, 0]
        for ax, section in zip(axes, sections, strict=True):
            residual_mm = 1e3 * np.array(section["residual_m"])
            azimuth = section["azimuth_deg"]
            if len(azimuth) <= 72:
                ax.vlines(azimuth, 0, residual_mm, color=INK, linewidth=0.8)
            ax.plot(azimuth, residual_mm, "o", color=INK, markersize=2.2, **_light(azimuth))
            ax.axhline(0, color="#445566", linewidth=0.5)
            ax.set(xlim=_TURN, ylim=(-limit_mm, limit_mm), xticks=range(0, 361, 45))
            ax.grid(True)
            title = ", ".join(_section_title(paper, section))
            ax.set_title(title, loc="left", fontsize=8, pad=2, parse_math=False)
        axes[-1].set_xlabel(paper.word("axes.azimuth"))
        figure.supylabel(paper.word("axes.residual"), fontsize=8.5, x=0.005)
        set_margins(figure, left=0.55, right=0.12, bottom=0.42, top=0.2, hspace=0.6)
    return figure


def polar_factor(paper):
    """How many times larger than the tank the deviations of `polar` are drawn: 1, 2 or 5·10^n."""
    sections = paper.record["sections"]
    largest = max(max(_deviations(s), default=0.0) / s["radius_m"] for s in sections)
    if largest <= 0:
        return 1
    return round_factor(0.25 / largest)


def round_factor(wanted):
    """The largest of 1, 2, 5 times a power of ten that is at most `wanted`, and at least 1."""
    power = 10.0 ** floor(log10(wanted))
    return max(1, round(power * max(step for step in (1, 2, 5) if step * power <= wanted)))


def polar(paper, most=12):
    """The sections about their circles, deviations enlarged by `polar_factor`."""
    factor = polar_factor(paper)
    groups = even_groups(paper.record["sections"], most)
    return [_polar_panels(paper, group, factor) for group in groups]


def _polar_panels(paper, sections, factor):
    across = 3 if len(sections) <= 6 else 4
    down = ceil(len(sections) / across)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, 5.4 / across * down))
        axes = figure.subplots(down, across, squeeze=False).ravel()
        turn = np.linspace(0, 2 * np.pi, 361)
        for ax, section in zip(axes, sections, strict=False):
            ax.plot(np.sin(turn), np.cos(turn), color="#9aa5b1", linewidth=0.6)
            outline = section["outline"]
            line = _enlarged(section, outline["azimuth_deg"], _outline_deviation(section), factor)
            closed = np.concatenate([line, line[:, :1]], axis=1)
            ax.plot(*closed, color=INK)
            points = _enlarged(section, section["azimuth_deg"], section["residual_m"], factor)
            few = points.shape[1] <= 200  # many would hide the outline: smaller, and below it
            style = {"markersize": 2.2, "zorder": 3} if few else {"markersize": 1.0, "zorder": 1}
            ax.plot(*points, ".", color=RED, **style, **_light(points[0]))
            ax.set(aspect="equal", xlim=(-1.32, 1.32), ylim=(-1.32, 1.32))
            title = "\n".join(_section_title(paper, section))
            ax.text(0, 0, title, ha="center", va="center", fontsize=8, parse_math=False)
        for ax in axes:
            ax.axis("off")
        figure.subplots_adjust(left=0, right=1, bottom=0, top=1, wspace=0, hspace=0)
    return figure


def _enlarged(section, azimuth_deg, deviation_m, factor):
    azimuth = np.radians(azimuth_deg)
    radius = 1 + factor * np.asarray(deviation_m) / section["radius_m"]
    return np.array([radius * np.sin(azimuth), radius * np.cos(azimuth)])


def _outline_deviation(section):
    return np.array(section["outline"]["radius_m"]) - section["radius_m"]


def _deviations(section):
    return [*np.abs(_outline_deviation(section)), *map(abs, section["residual_m"])]


def deviation_map(paper):
    """The wall unrolled: azimuth by height, every accepted point coloured by its residual."""
    record = paper.record
    z_m = {point["point"]: point["z_m"] for point in record["points"]}
    names = [name for section in record["sections"] for name in section["points"]]
    height_m = np.array([z_m[name] for name in names]) - record["job"]["datum"]["bottom_z_m"]
    azimuth = [a for section in record["sections"] for a in section["azimuth_deg"]]
    residual_mm = [1e3 * r for section in record["sections"] for r in section["residual_m"]]
    limit = max(map(abs, residual_mm), default=0.0) or 1.0
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, 2.6))
        ax = figure.subplots()
        size = 14 if len(azimuth) <= 300 else 6
        if len(azimuth) > 3000:  # no room for edges: grey behind the points shows the white ones
            size = 2
            ax.set_facecolor("#d5dae0")
        shown = ax.scatter(
            azimuth, height_m, c=residual_mm, s=size, cmap="RdBu_r", vmin=-limit, vmax=limit,
            edgecolors="#445566", linewidths=0.25 if size > 2 else 0, zorder=3, **_light(azimuth),
        )  # fmt: skip
        joints = [course["bottom_m"] for course in record["courses"]]
        joints.append(record["courses"][-1]["top_m"])
        ax.hlines(joints, *_TURN, color="#445566", linewidth=0.5)
        ax.set(xlim=_TURN, xticks=range(0, 361, 45))
        ax.set_xlabel(paper.word("axes.azimuth"))
        ax.set_ylabel(paper.word("axes.height"))
        bar = figure.colorbar(shown, ax=ax, pad=0.02, aspect=30)
        bar.set_label(paper.word("axes.residual"))
        figure.subplots_adjust(left=0.075, right=1.04, bottom=0.14, top=0.98)
    return figure


def capacity_curves(paper):
    """Litres per centimetre, and U, against height."""
    capacity = paper.record["capacity"]
    height_m = capacity["height_m"]
    litres_per_cm = 10.0 * np.array(capacity["area_m2"], dtype=float)  # 1 m2 is 10 L/cm
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, 2.4))
        left, right = figure.subplots(1, 2)
        left.plot(height_m, litres_per_cm, color=INK)
        left.set_ylabel(paper.word("axes.litres_per_cm"))
        left.ticklabel_format(useOffset=False)
        right.plot(height_m, stated_U_m3(capacity), color=INK)
        right.set_ylabel(paper.word("axes.U_m3"))
        right.set_ylim(bottom=0)
        for ax in (left, right):
            ax.set_xlabel(paper.word("axes.height"))
            ax.set_xlim(height_m[0], height_m[-1])
            ax.grid(True)
        set_margins(figure, left=0.65, right=0.12, bottom=0.42, top=0.08, wspace=0.3)
    return figure


def budget_bars(paper):
    """The share of the variance of each input, in percent; defaults are pale."""
    budget = [row for row in paper.record["budget"] if abs(row["share"]) >= LEAST_SHARE]
    budget.sort(key=lambda row: -row["share"])
    names = [textwrap.fill(paper.input_name(row), LETTERS_OF_A_BAR) for row in budget]
    high = 0.24 if not any("\n" in name for name in names) else 0.32
    colours = [PALE if row.get("is_default") else INK for row in budget]
    lowest = min((row["share"] for row in budget), default=0)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, high * len(budget) + 0.6))
        ax = figure.subplots()
        shares = [100 * row["share"] for row in budget]
        ax.barh(range(len(budget)), shares, color=colours, height=0.6)
        ax.set_yticks(range(len(budget)), names, parse_math=False)
        ax.invert_yaxis()
        ax.set_xlabel(paper.word("axes.share"))
        ax.set_xlim(min(0, 110 * lowest), max([100, *(1.05 * share for share in shares)]))
        ax.grid(True, axis="x")
        ax.set_axisbelow(True)
        set_margins(figure, left=2.9, right=0.2, bottom=0.42, top=0.05)
    return figure


def even_groups(sections, most):
    """The sections in figures, or the columns in tables, of nearly equal size."""
    count = max(1, ceil(len(sections) / most))
    size = max(1, ceil(len(sections) / count))
    return [sections[i : i + size] for i in range(0, len(sections), size)]


def _light(points):
    """Very many points are drawn as a picture inside the figure."""
    return {"rasterized": len(points) > MANY}


def _section_title(paper, section):
    height = paper.number(section["height_m"], "m", decimals=3)
    return [
        paper.word("axes.section", section=section["section"]),
        paper.word("axes.section_height", height=height),
    ]


def set_margins(figure, left, right, bottom, top, **spaces):
    """Margins in inches."""
    width, height = figure.get_size_inches()
    figure.subplots_adjust(
        left=left / width, right=1 - right / width, bottom=bottom / height, top=1 - top / height,
        **spaces,
    )  # fmt: skip


def with_decimal_mark(figure, mark):
    """The figure with this decimal mark in the numbers at its axes; names there stay."""
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            if isinstance(axis.get_major_formatter(), ScalarFormatter):
                axis.set_major_formatter(_Marked(axis.get_major_formatter(), mark))
            if isinstance(axis.get_minor_formatter(), ScalarFormatter):
                axis.set_minor_formatter(_Marked(axis.get_minor_formatter(), mark))
    return figure


class _Marked(Formatter):
    """The numbers of another formatter with a decimal mark."""

    def __init__(self, of_numbers, mark):
        self._of_numbers, self._mark = of_numbers, mark

    def __call__(self, x, pos=None):
        return self._of_numbers(x, pos).replace(".", self._mark)

    def get_offset(self):
        return self._of_numbers.get_offset().replace(".", self._mark)

    def set_locs(self, locs):
        self._of_numbers.set_locs(locs)
