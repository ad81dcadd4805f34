"""Drawings of a calibrated tank: sections, the wall unrolled, the table and its budget.

Plain numbers go in, `Drawing`s come out, in one style for notebooks and papers. Lengths of
the page are inches. The words at the axes are those of WORDS, or of `words(key, **values)`.
"""

import io
import logging
import textwrap
from dataclasses import dataclass
from functools import wraps
from math import ceil, floor, log10

import matplotlib
import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

logging.getLogger("matplotlib").setLevel(logging.ERROR)  # no remark about its font cache on paper

STYLE = {
    "font.family": ["STIXGeneral", "DejaVu Serif"],
    "font.size": 8.5,
    "axes.linewidth": 0.5,
    "axes.titley": 1.0,
    "axes.edgecolor": "#445566",
    "axes.unicode_minus": True,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "grid.linewidth": 0.3,
    "grid.color": "#c3cad2",
    "lines.linewidth": 0.9,
}
_DPI_ON_SCREEN = 110
WORDS = {
    "azimuth": "Azimuth / °",
    "residual": "Residual / mm",
    "departure": "Departure from the course's mean / mm",
    "height": "Height / m",
    "litres_per_cm": "Capacity / (L/cm)",
    "U_m3": "U / m³",
    "share": "Share of the variance / %",
    "section": "Section {section}",
    "section_height": "height {height}",
}
INK, RED, PALE = "#1f4e79", "#b03a2e", "#9db8d2"
GREY, FAINT = "#445566", "#9aa5b1"
LEAST_SHARE = 1e-3  # of the variance: less is no bar
WIDTH = 6.5
LETTERS_OF_A_BAR = 46  # in a line of its name
MANY = 500  # points in a panel: from here on their picture is smaller than their outlines
SHELL_SHARE = 0.03  # of its cut: so far the cut of a shell changes with height
BOTTOM_SHARE = 0.8  # of the cut of the shell: below it the curve of a bottom would hide the shell's
_TURN = (-4, 364)  # degrees: points at north are not cut off


def styled(draw, **more):
    """A function that draws in the one style of notebooks and papers; `more` adds to that style."""

    @wraps(draw)
    def drawing(*arguments, **options):
        with matplotlib.rc_context(STYLE | more):
            return draw(*arguments, **options)

    return drawing


class Drawing(Figure):
    """A matplotlib Figure that a notebook shows, whatever backend it has."""

    def _repr_png_(self):
        image = io.BytesIO()
        self.savefig(image, format="png", dpi=_DPI_ON_SCREEN)
        return image.getvalue()


def english_label(key, **values):
    """The word of WORDS at an axis, its places filled."""
    return WORDS[key].format(**values)


@dataclass(frozen=True)
class Ring:
    """A section as it is drawn: its circle, its outline, and the residuals of its points.

    Attributes
    ----------
    name, height : str
        What stands beside it.
    radius_m : float
        Of the circle, m.
    azimuth_deg, residual_m : ndarray, shape (n,)
        Of the points: azimuth, and distance from the circle, outwards positive, m.
    outline_deg, outline_m : ndarray, shape (m,)
        Azimuths of the outline and its radii about the centre of the circle, m.
    """

    name: str
    height: str
    radius_m: float
    azimuth_deg: np.ndarray
    residual_m: np.ndarray
    outline_deg: np.ndarray
    outline_m: np.ndarray

    @property
    def deviation_m(self):
        """(m,) the outline less the circle."""
        return np.asarray(self.outline_m) - self.radius_m

    def title(self, words):
        """[name, height] as they stand at its drawing."""
        return [
            words("section", section=self.name),
            words("section_height", height=self.height),
        ]


def residual_panels(rings, words=english_label, most=8):
    """Residuals in mm against azimuth, one panel a section.

    Parameters
    ----------
    rings : sequence of Ring
    words : callable, optional
        words(key, **values) gives the texts at the axes; English by default.
    most : int, default 8
        Panels in one figure.

    Returns
    -------
    list of Drawing
    """
    largest_m = max((np.max(np.abs(ring.residual_m), initial=0.0) for ring in rings), default=0.0)
    return [
        _residual_panels(group, 1.1e3 * largest_m or 1.0, words)
        for group in even_groups(rings, most)
    ]


@styled
def _residual_panels(rings, limit_mm, words):
    figure = Drawing(figsize=(WIDTH, 0.55 * len(rings) + 0.55))
    axes = figure.subplots(len(rings), 1, sharex=True, squeeze=False)[:, 0]
    for ax, ring in zip(axes, rings, strict=True):
        residual_mm = 1e3 * np.asarray(ring.residual_m)
        azimuth = ring.azimuth_deg
        if len(azimuth) <= 72:
            ax.vlines(azimuth, 0, residual_mm, color=INK, linewidth=0.8)
        ax.plot(azimuth, residual_mm, "o", color=INK, markersize=2.2, **rasterize_many(azimuth))
        ax.axhline(0, color=GREY, linewidth=0.5)
        ax.set(xlim=_TURN, ylim=(-limit_mm, limit_mm), xticks=range(0, 361, 45))
        ax.grid(True)
        ax.set_title(", ".join(ring.title(words)), loc="left", fontsize=8, pad=2, parse_math=False)
    axes[-1].set_xlabel(words("azimuth"))
    figure.supylabel(words("residual"), fontsize=8.5, x=0.005)
    set_margins(figure, left=0.55, right=0.12, bottom=0.42, top=0.2, hspace=0.6)
    return figure


def polar_factor(rings):
    """How many times `polar` enlarges the deviations: 1, 2 or 5 times a power of ten."""
    largest = max(
        max(np.max(np.abs(of), initial=0.0) for of in (ring.deviation_m, ring.residual_m))
        / ring.radius_m
        for ring in rings
    )
    return round_factor(0.25 / largest) if largest > 0 else 1


def round_factor(wanted):
    """The largest of 1, 2, 5 times a power of ten that is at most `wanted`, and at least 1.

    Parameters
    ----------
    wanted : float
        Above 0.

    Returns
    -------
    int

    Examples
    --------
    >>> round_factor(470.0), round_factor(0.3)
    (200, 1)
    """
    power = 10.0 ** floor(log10(wanted))
    return max(1, round(power * max(step for step in (1, 2, 5) if step * power <= wanted)))


def polar(rings, words=english_label, most=12):
    """The sections about their circles, deviations enlarged by `polar_factor`.

    Parameters
    ----------
    rings : sequence of Ring
    words : callable, optional
        words(key, **values) gives the texts; English by default.
    most : int, default 12
        Sections in one figure.

    Returns
    -------
    list of Drawing
    """
    factor = polar_factor(rings)
    return [_polar_panels(group, factor, words) for group in even_groups(rings, most)]


@styled
def _polar_panels(rings, factor, words):
    across = 3 if len(rings) <= 6 else 4
    down = ceil(len(rings) / across)
    figure = Drawing(figsize=(WIDTH, 5.4 / across * down))
    axes = figure.subplots(down, across, squeeze=False).ravel()
    turn = np.linspace(0, 2 * np.pi, 361)
    for ax, ring in zip(axes, rings, strict=False):
        ax.plot(np.sin(turn), np.cos(turn), color=FAINT, linewidth=0.6)
        line = _enlarged(ring.outline_deg, ring.deviation_m / ring.radius_m, factor)
        closed = np.concatenate([line, line[:, :1]], axis=1)
        ax.plot(*closed, color=INK)
        residual = np.asarray(ring.residual_m) / ring.radius_m
        points = _enlarged(ring.azimuth_deg, residual, factor)
        few = points.shape[1] <= 200  # many would hide the outline: smaller, and below it
        style = {"markersize": 2.2, "zorder": 3} if few else {"markersize": 1.0, "zorder": 1}
        ax.plot(*points, ".", color=RED, **style, **rasterize_many(points[0]))
        ax.set(aspect="equal", xlim=(-1.32, 1.32), ylim=(-1.32, 1.32))
        title = "\n".join(ring.title(words))
        ax.text(0, 0, title, ha="center", va="center", fontsize=8, parse_math=False)
    for ax in axes:
        ax.axis("off")
    figure.subplots_adjust(left=0, right=1, bottom=0, top=1, wspace=0, hspace=0)
    return figure


def _enlarged(azimuth_deg, deviation, factor):
    azimuth = np.radians(azimuth_deg)
    radius = 1 + factor * deviation
    return np.array([radius * np.sin(azimuth), radius * np.cos(azimuth)])


@styled
def deviation_map(azimuth_deg, height_m, residual_m, joints_m, words=english_label):
    """The wall unrolled: azimuth by height, every point coloured by its residual.

    Parameters
    ----------
    azimuth_deg, height_m, residual_m : ndarray, shape (n,)
        Of the points.
    joints_m : ndarray
        Heights of the joints between courses, m.
    words : callable, optional
        words(key, **values) gives the texts at the axes; English by default.

    Returns
    -------
    Drawing
    """
    residual_mm = 1e3 * np.asarray(residual_m)
    limit = np.max(np.abs(residual_mm), initial=0.0) or 1.0
    figure = Drawing(figsize=(WIDTH, 2.6))
    ax = figure.subplots()
    size = 14 if len(azimuth_deg) <= 300 else 6
    if len(azimuth_deg) > 3000:  # no room for edges: grey behind the points shows white ones
        size = 2
        ax.set_facecolor("#d5dae0")
    shown = ax.scatter(
        azimuth_deg, height_m, c=residual_mm, s=size, cmap="RdBu_r", vmin=-limit, vmax=limit,
        edgecolors=GREY, linewidths=0.25 if size > 2 else 0, zorder=3,
        **rasterize_many(azimuth_deg),
    )  # fmt: skip
    ax.hlines(joints_m, *_TURN, color=GREY, linewidth=0.5)
    ax.set(xlim=_TURN, xticks=range(0, 361, 45))
    return _unrolled(figure, ax, shown, words, "residual")


@styled
def field_map(azimuth_deg, height_m, departure_m, points, joints_m, words=english_label):
    """The wall that the table is made of, unrolled: what it departs from the mean of each course.

    Parameters
    ----------
    azimuth_deg : ndarray, shape (g,)
        Even.
    height_m : ndarray, shape (h,)
        From the bottom up, m.
    departure_m : ndarray, shape (h, g)
        Radius less the mean radius of the course, m.
    points : tuple of ndarray
        Azimuths, degrees, and heights, m, of the points.
    joints_m : ndarray
        Heights of the joints between courses, m.
    words : callable, optional
        words(key, **values) gives the texts at the axes; English by default.

    Returns
    -------
    Drawing
    """
    departure_mm = 1e3 * np.asarray(departure_m)
    limit = np.max(np.abs(departure_mm)) or 1.0
    figure = Drawing(figsize=(WIDTH, 2.6))
    ax = figure.subplots()
    shown = ax.pcolormesh(
        azimuth_deg, height_m, departure_mm, cmap="RdBu_r", vmin=-limit, vmax=limit,
        shading="gouraud", rasterized=True,
    )  # fmt: skip
    ax.plot(*points, ".", color=GREY, markersize=1.2, **rasterize_many(points[0]))
    ax.hlines(joints_m, 0, 360, color=GREY, linewidth=0.5)
    ax.set(xlim=(0, 360), xticks=range(0, 361, 45), ylim=(joints_m[0], joints_m[-1]))
    return _unrolled(figure, ax, shown, words, "departure")


def _unrolled(figure, ax, shown, words, colours):
    """The figure of a wall unrolled, with its axes and its bar of colours named."""
    ax.set_xlabel(words("azimuth"))
    ax.set_ylabel(words("height"))
    bar = figure.colorbar(shown, ax=ax, pad=0.02, aspect=30)
    bar.set_label(words(colours))
    figure.subplots_adjust(left=0.075, right=1.04, bottom=0.14, top=0.98)
    return figure


def bottom_rows(area_m2):
    """How many rows of a table, from the lowest on, lie in a bottom.

    Above it the cut hardly changes. Beside a cut that grows from nothing, what distinguishes the
    courses of a shell cannot be seen.

    Parameters
    ----------
    area_m2 : array_like, shape (rows,)
        Area of the cut at each row, m2.

    Returns
    -------
    int
        0: the tank has no such bottom.

    Examples
    --------
    >>> bottom_rows([1.0, 5.0, 10.0, 10.0, 10.0, 10.0])
    2
    """
    area = np.array(area_m2, dtype=float)
    shell = np.median(area)
    off = np.flatnonzero(np.abs(area - shell) > SHELL_SHARE * shell)
    if (
        not len(off)
        or off[-1] + 1 > len(area) / 2
        or area[: off[-1] + 1].min() > BOTTOM_SHARE * shell
    ):
        return 0
    return int(off[-1]) + 1


@styled
def capacity_curves(height_m, area_m2, U_m3, words=english_label):
    """Litres per centimetre, and U, against height; a bottom has a panel of its own.

    Parameters
    ----------
    height_m, area_m2, U_m3 : ndarray, shape (rows,)
        Of the table: dips, m, area of the cut, m2, and expanded uncertainty, m3.
    words : callable, optional
        words(key, **values) gives the texts at the axes; English by default.

    Returns
    -------
    Drawing
    """
    height_m = np.asarray(height_m)
    litres_per_cm = 10.0 * np.array(area_m2, dtype=float)  # 1 m2 is 10 L/cm
    of_bottom = bottom_rows(area_m2)
    parts = [slice(of_bottom + 1), slice(of_bottom, None)] if of_bottom else [slice(None)]
    figure = Drawing(figsize=(WIDTH, 2.4))
    *left, right = figure.subplots(1, len(parts) + 1)
    for ax, rows in zip(left, parts, strict=True):
        ax.plot(height_m[rows], litres_per_cm[rows], color=INK)
        ax.ticklabel_format(useOffset=False)
        ax.set_xlim(height_m[rows][0], height_m[rows][-1])
    left[0].set_ylabel(words("litres_per_cm"))
    if of_bottom:
        left[0].set_ylim(bottom=0)
    right.plot(height_m, U_m3, color=INK)
    right.set_ylabel(words("U_m3"))
    right.set_ylim(bottom=0)
    right.set_xlim(height_m[0], height_m[-1])
    for ax in (*left, right):
        ax.set_xlabel(words("height"))
        ax.grid(True)
    space = 0.3 if len(parts) == 1 else 0.45
    set_margins(figure, left=0.65, right=0.12, bottom=0.42, top=0.08, wspace=space)
    return figure


@styled
def budget_bars(bars, words=english_label):
    """The share of the variance of each input, in percent; defaults are pale.

    Parameters
    ----------
    bars : iterable of tuple
        (name, share of the variance, whether it is a default) of each input.
    words : callable, optional
        words(key, **values) gives the texts at the axes; English by default.

    Returns
    -------
    Drawing
    """
    bars = sorted((one for one in bars if abs(one[1]) >= LEAST_SHARE), key=lambda one: -one[1])
    names = [textwrap.fill(name, LETTERS_OF_A_BAR) for name, _, _ in bars]
    high = 0.24 if not any("\n" in name for name in names) else 0.32
    colours = [PALE if is_default else INK for _, _, is_default in bars]
    shares = [100 * share for _, share, _ in bars]
    figure = Drawing(figsize=(WIDTH, high * len(bars) + 0.6))
    ax = figure.subplots()
    ax.barh(range(len(bars)), shares, color=colours, height=0.6)
    ax.set_yticks(range(len(bars)), names, parse_math=False)
    ax.invert_yaxis()
    ax.set_xlabel(words("share"))
    ax.set_xlim(1.1 * min([0, *shares]), max([100, *(1.05 * share for share in shares)]))
    ax.grid(True, axis="x")
    ax.set_axisbelow(True)
    set_margins(figure, left=2.9, right=0.2, bottom=0.42, top=0.05)
    return figure


@styled
def network(names, xy_m, covariance_m2, most_names=60):
    """Points from above with their standard error ellipses, enlarged.

    names          (n,) of the points, written where there are at most `most_names`
    xy_m           (n, 2)
    covariance_m2  (n, 2, 2) of x and y of each point
    """
    xy_m = np.asarray(xy_m, dtype=float)
    variances, axes = np.linalg.eigh(covariance_m2)
    half_m = np.sqrt(np.maximum(variances, 0.0))
    extent = float(np.ptp(xy_m, axis=0).max()) or 1.0
    largest = float(half_m.max(initial=0.0))
    factor = round_factor(0.04 * extent / largest) if largest > 0 else 1
    figure = Drawing(figsize=(WIDTH, 4.6))
    ax = figure.subplots()
    width, height = 2 * factor * half_m[:, 1], 2 * factor * half_m[:, 0]
    turn = np.degrees(np.arctan2(axes[:, 1, 1], axes[:, 0, 1]))
    ellipses = EllipseCollection(
        width, height, turn, units="xy", offsets=xy_m, offset_transform=ax.transData,
        facecolors="none", edgecolors=RED, linewidths=0.6,
    )  # fmt: skip
    ax.add_collection(ellipses)
    ax.plot(*xy_m.T, ".", color=INK, markersize=2.5, **rasterize_many(xy_m))
    if len(names) <= most_names:
        for name, place in zip(names, xy_m, strict=True):
            ax.annotate(
                name, place, (2, 2), textcoords="offset points", fontsize=6, parse_math=False
            )
    ax.set(aspect="equal", xlabel="x / m", ylabel="y / m")
    ax.set_title(f"standard error ellipses, {factor} times", loc="left", fontsize=8)
    ax.grid(True)
    return figure


def even_groups(items, most):
    """Split items into groups of nearly equal size: sections into figures, columns into tables.

    Parameters
    ----------
    items : sequence
    most : int
        Items in one group.

    Returns
    -------
    list of sequence

    Examples
    --------
    >>> even_groups("abcde", 4)
    ['abc', 'de']
    """
    count = max(1, ceil(len(items) / most))
    size = max(1, ceil(len(items) / count))
    return [items[i : i + size] for i in range(0, len(items), size)]


def rasterize_many(points):
    """Very many points are drawn as a picture inside the figure."""
    return {"rasterized": len(points) > MANY}


def set_margins(figure, left, right, bottom, top, **spaces):
    """Margins of a figure in inches."""
    width, height = figure.get_size_inches()
    figure.subplots_adjust(
        left=left / width, right=1 - right / width, bottom=bottom / height, top=1 - top / height,
        **spaces,
    )  # fmt: skip
