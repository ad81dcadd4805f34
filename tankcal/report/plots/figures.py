"""Drawings of a calibrated tank: sections, unrolled wall, capacity table and uncertainty budget.

The functions take plain numbers and return `Drawing`s in the style of
`tankcal.report.plots.style`. Axis labels come from WORDS, or from `words(key, **values)`.
"""

import textwrap
from dataclasses import dataclass
from math import ceil

import numpy as np
from matplotlib.collections import EllipseCollection

from tankcal.report.plots.style import (
    FAINT,
    GREY,
    INK,
    PALE,
    RED,
    STYLE,
    WIDTH,
    Drawing,
    even_groups,
    rasterize_many,
    round_factor,
    set_margins,
    styled,
)

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
LEAST_SHARE = 1e-3  # share of the variance below which no bar is drawn
LETTERS_OF_A_BAR = 46  # characters in a line of a bar's label
SHELL_SHARE = 0.03  # largest relative change of the area of a shell with height
BOTTOM_SHARE = 0.8  # area over that of the shell below which a bottom gets its own panel
_POLAR_HEIGHT = 2.64  # of the drawing of a section, in radii of its circle
_EIGHTHS = range(0, 361, 45)  # labelled azimuths, degrees
_GRID = {"color": STYLE["grid.color"], "linewidth": STYLE["grid.linewidth"], "zorder": 1.5}
_TURN = (-4, 364)  # azimuth axis in degrees; wider than a turn to show points at north whole


def english_label(key, **values):
    """Axis label from WORDS with its placeholders filled."""
    return WORDS[key].format(**values)


@dataclass(frozen=True)
class Ring:
    """A section to be drawn: its circle, its outline and the residuals of its points.

    Attributes
    ----------
    name, height : str
        Title of the drawing.
    radius_m : float
        Radius of the circle, m.
    azimuth_deg, residual_m : ndarray, shape (n,)
        Azimuths of the points, degrees, and distances from the circle, outwards positive, m.
    outline_deg, outline_m : ndarray, shape (m,)
        Azimuths of the outline, degrees, and radii about the centre of the circle, m.
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
        """Outline radii minus the radius of the circle, m, shape (m,)."""
        return np.asarray(self.outline_m) - self.radius_m

    def title(self, words):
        """Labels [name, height] of the drawing."""
        return [
            words("section", section=self.name),
            words("section_height", height=self.height),
        ]


def residual_panels(rings, words=english_label, most=8):
    """Plot residuals in mm against azimuth, with one panel per section.

    Parameters
    ----------
    rings : sequence of Ring
    words : callable, optional
        words(key, **values) gives the axis labels; English by default.
    most : int, default 8
        Largest number of panels in a figure.

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
    """Figure with one panel of residuals per section, all with the same limits."""
    figure = Drawing(figsize=(WIDTH, 0.55 * len(rings) + 0.55))
    axes = figure.subplots(len(rings), 1, sharex=True, squeeze=False)[:, 0]
    for ax, ring in zip(axes, rings, strict=True):
        residual_mm = 1e3 * np.asarray(ring.residual_m)
        azimuth = ring.azimuth_deg
        if len(azimuth) <= 72:
            ax.vlines(azimuth, 0, residual_mm, color=INK, linewidth=0.8)
        ax.plot(azimuth, residual_mm, "o", color=INK, markersize=2.2, **rasterize_many(azimuth))
        ax.axhline(0, color=GREY, linewidth=0.5)
        ax.set(xlim=_TURN, ylim=(-limit_mm, limit_mm))
        ax.grid(True, axis="y")
        # Lines drawn at once take a tenth of the time of the ticks of another axis.
        ax.vlines(_EIGHTHS, -limit_mm, limit_mm, **_GRID)
        ax.xaxis.set_visible(ax is axes[-1])
        ax.set_title(", ".join(ring.title(words)), loc="left", fontsize=8, pad=2, parse_math=False)
    axes[-1].set(xlabel=words("azimuth"), xticks=_EIGHTHS)
    figure.supylabel(words("residual"), fontsize=8.5, x=0.005)
    set_margins(figure, left=0.55, right=0.12, bottom=0.42, top=0.2, hspace=0.6)
    return figure


def polar_factor(rings):
    """Factor by which `polar` enlarges deviations: 1, 2 or 5 times a power of ten."""
    largest = max(
        max(
            np.max(np.abs(distances_m), initial=0.0)
            for distances_m in (ring.deviation_m, ring.residual_m)
        )
        / ring.radius_m
        for ring in rings
    )
    return round_factor(0.25 / largest) if largest > 0 else 1


def polar(rings, words=english_label, most=12):
    """Plot the sections about their circles, with deviations enlarged by `polar_factor`.

    Parameters
    ----------
    rings : sequence of Ring
    words : callable, optional
        words(key, **values) gives the labels; English by default.
    most : int, default 12
        Largest number of sections in a figure.

    Returns
    -------
    list of Drawing
    """
    factor = polar_factor(rings)
    return [_polar_panels(group, factor, words) for group in even_groups(rings, most)]


@styled
def _polar_panels(rings, factor, words):
    """Figure of sections about their circles, with a common enlargement."""
    columns = 3 if len(rings) <= 6 else 4
    rows = ceil(len(rings) / columns)
    size = 5.4 / columns
    figure = Drawing(figsize=(WIDTH, size * rows))
    # All sections share one Axes, since matplotlib takes 4 ms to make and draw an empty one.
    height, width = _POLAR_HEIGHT, _POLAR_HEIGHT * WIDTH / columns / size
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, columns * width), ylim=(-rows * height, 0))
    ax.axis("off")
    angle = np.linspace(0, 2 * np.pi, 361)
    for number, ring in enumerate(rings):
        row, column = divmod(number, columns)
        centre = np.array([[(column + 0.5) * width], [-(row + 0.5) * height]])
        ax.plot(*(centre + [np.sin(angle), np.cos(angle)]), color=FAINT, linewidth=0.6)
        line = centre + _enlarge(ring.outline_deg, ring.deviation_m / ring.radius_m, factor)
        ax.plot(*np.concatenate([line, line[:, :1]], axis=1), color=INK)
        residual = np.asarray(ring.residual_m) / ring.radius_m
        points = centre + _enlarge(ring.azimuth_deg, residual, factor)
        are_few = points.shape[1] <= 200  # many points would hide the outline
        style = {"markersize": 2.2, "zorder": 3} if are_few else {"markersize": 1.0, "zorder": 1}
        ax.plot(*points, ".", color=RED, **style, **rasterize_many(points[0]))
        title = "\n".join(ring.title(words))
        ax.text(*centre[:, 0], title, ha="center", va="center", fontsize=8, parse_math=False)
    return figure


def _enlarge(azimuth_deg, deviation, factor):
    """Plan coordinates (2, n) of unit-circle points with enlarged relative deviations."""
    azimuth = np.radians(azimuth_deg)
    radius = 1 + factor * deviation
    return np.array([radius * np.sin(azimuth), radius * np.cos(azimuth)])


@styled
def deviation_map(azimuth_deg, height_m, residual_m, joints_m, words=english_label):
    """Plot the unrolled wall, azimuth against height, with points coloured by their residuals.

    Parameters
    ----------
    azimuth_deg, height_m, residual_m : ndarray, shape (n,)
        Azimuths of the points, degrees, heights and residuals, m.
    joints_m : ndarray
        Heights of the joints between courses, m.
    words : callable, optional
        words(key, **values) gives the axis labels; English by default.

    Returns
    -------
    Drawing
    """
    residual_mm = 1e3 * np.asarray(residual_m)
    limit = np.max(np.abs(residual_mm), initial=0.0) or 1.0
    figure = Drawing(figsize=(WIDTH, 2.6))
    ax = figure.subplots()
    size = 14 if len(azimuth_deg) <= 300 else 6
    if len(azimuth_deg) > 3000:  # no edges: a grey background shows white points
        size = 2
        ax.set_facecolor("#d5dae0")
    dots = ax.scatter(
        azimuth_deg, height_m, c=residual_mm, s=size, cmap="RdBu_r", vmin=-limit, vmax=limit,
        edgecolors=GREY, linewidths=0.25 if size > 2 else 0, zorder=3,
        **rasterize_many(azimuth_deg),
    )  # fmt: skip
    ax.hlines(joints_m, *_TURN, color=GREY, linewidth=0.5)
    ax.set(xlim=_TURN, xticks=_EIGHTHS)
    return _label_unrolled(figure, ax, dots, words, "residual")


@styled
def field_map(azimuth_deg, height_m, departure_m, points, joints_m, words=english_label):
    """Plot the unrolled wall of the table: deviations of the radius from the mean of each course.

    Parameters
    ----------
    azimuth_deg : ndarray, shape (g,)
        Equally spaced azimuths, degrees.
    height_m : ndarray, shape (h,)
        Heights from the bottom upwards, m.
    departure_m : ndarray, shape (h, g)
        Radius minus the mean radius of the course, m.
    points : tuple of ndarray
        Azimuths, degrees, and heights, m, of the points.
    joints_m : ndarray
        Heights of the joints between courses, m.
    words : callable, optional
        words(key, **values) gives the axis labels; English by default.

    Returns
    -------
    Drawing
    """
    departure_mm = 1e3 * np.asarray(departure_m)
    limit = np.max(np.abs(departure_mm)) or 1.0
    figure = Drawing(figsize=(WIDTH, 2.6))
    ax = figure.subplots()
    mesh = ax.pcolormesh(
        azimuth_deg, height_m, departure_mm, cmap="RdBu_r", vmin=-limit, vmax=limit,
        shading="gouraud", rasterized=True,
    )  # fmt: skip
    ax.plot(*points, ".", color=GREY, markersize=1.2, **rasterize_many(points[0]))
    ax.hlines(joints_m, 0, 360, color=GREY, linewidth=0.5)
    ax.set(xlim=(0, 360), xticks=_EIGHTHS, ylim=(joints_m[0], joints_m[-1]))
    return _label_unrolled(figure, ax, mesh, words, "departure")


def _label_unrolled(figure, ax, mappable, words, colours):
    """Label the axes and the colour bar of an unrolled wall."""
    ax.set_xlabel(words("azimuth"))
    ax.set_ylabel(words("height"))
    bar = figure.colorbar(mappable, ax=ax, pad=0.02, aspect=30)
    bar.set_label(words(colours))
    figure.subplots_adjust(left=0.075, right=1.04, bottom=0.14, top=0.98)
    return figure


def bottom_rows(area_m2):
    """Number of table rows, from the lowest, that lie in a bottom.

    Above the bottom the cross-section hardly changes. On a common scale with the bottom,
    differences between courses would be invisible.

    Parameters
    ----------
    area_m2 : array_like, shape (rows,)
        Area of the cross-section at each row, m2.

    Returns
    -------
    int
        0 if the tank has no such bottom.

    Examples
    --------
    >>> bottom_rows([1.0, 5.0, 10.0, 10.0, 10.0, 10.0])
    2
    """
    area = np.array(area_m2, dtype=float)
    shell = np.median(area)
    differing = np.flatnonzero(np.abs(area - shell) > SHELL_SHARE * shell)
    if (
        not len(differing)
        or differing[-1] + 1 > len(area) / 2
        or area[: differing[-1] + 1].min() > BOTTOM_SHARE * shell
    ):
        return 0
    return int(differing[-1]) + 1


@styled
def capacity_curves(height_m, area_m2, U_m3, words=english_label):
    """Plot litres per centimetre and U against height, with a separate panel for a bottom.

    Parameters
    ----------
    height_m, area_m2, U_m3 : ndarray, shape (rows,)
        Dips of the table, m, area of the cross-section, m2, and expanded uncertainty, m3.
    words : callable, optional
        words(key, **values) gives the axis labels; English by default.

    Returns
    -------
    Drawing
    """
    height_m = np.asarray(height_m)
    litres_per_cm = 10.0 * np.array(area_m2, dtype=float)  # 1 m2 is 10 L/cm
    bottom_count = bottom_rows(area_m2)
    parts = [slice(bottom_count + 1), slice(bottom_count, None)] if bottom_count else [slice(None)]
    figure = Drawing(figsize=(WIDTH, 2.4))
    *left, right = figure.subplots(1, len(parts) + 1)
    for ax, rows in zip(left, parts, strict=True):
        ax.plot(height_m[rows], litres_per_cm[rows], color=INK)
        ax.ticklabel_format(useOffset=False)
        ax.set_xlim(height_m[rows][0], height_m[rows][-1])
    left[0].set_ylabel(words("litres_per_cm"))
    if bottom_count:
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
    """Plot the share of each input in the variance, in percent; default values are pale.

    Parameters
    ----------
    bars : iterable of tuple
        (name, share of the variance, whether it is a default) of each input.
    words : callable, optional
        words(key, **values) gives the axis labels; English by default.

    Returns
    -------
    Drawing
    """
    bars = sorted((bar for bar in bars if abs(bar[1]) >= LEAST_SHARE), key=lambda bar: -bar[1])
    names = [textwrap.fill(name, LETTERS_OF_A_BAR) for name, _, _ in bars]
    bar_height = 0.24 if not any("\n" in name for name in names) else 0.32
    colours = [PALE if is_default else INK for _, _, is_default in bars]
    shares = [100 * share for _, share, _ in bars]
    figure = Drawing(figsize=(WIDTH, bar_height * len(bars) + 0.6))
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
    """Plot points in plan with enlarged standard error ellipses.

    Parameters
    ----------
    names : sequence of str, length n
        Point names; written if there are at most `most_names`.
    xy_m : ndarray, shape (n, 2)
        Plan coordinates, m.
    covariance_m2 : ndarray, shape (n, 2, 2)
        Covariance of x and y of each point, m2.
    most_names : int
        Largest number of names that are written.

    Returns
    -------
    Drawing
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
    # Inclination of the major axis: `eigh` returns the larger eigenvalue last.
    angle_deg = np.degrees(np.arctan2(axes[:, 1, 1], axes[:, 0, 1]))
    ellipses = EllipseCollection(
        width, height, angle_deg, units="xy", offsets=xy_m, offset_transform=ax.transData,
        facecolors="none", edgecolors=RED, linewidths=0.6,
    )  # fmt: skip
    ax.add_collection(ellipses)
    ax.plot(*xy_m.T, ".", color=INK, markersize=2.5, **rasterize_many(xy_m))
    if len(names) <= most_names:
        for name, position_m in zip(names, xy_m, strict=True):
            ax.annotate(
                name, position_m, (2, 2), textcoords="offset points", fontsize=6, parse_math=False
            )
    ax.set(aspect="equal", xlabel="x / m", ylabel="y / m")
    ax.set_title(f"standard error ellipses, {factor} times", loc="left", fontsize=8)
    ax.grid(True)
    return figure
