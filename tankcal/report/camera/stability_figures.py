"""The figures of a comparison of calibrations: maps of the differences, matrix, curves, drift."""

from math import ceil

import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from tankcal.calibration.curves import decentring_profile, radial_curve
from tankcal.camera.model import PARAMETERS, Form
from tankcal.pipeline.plot_style import FAINT, INK, WIDTH, even_groups, set_margins
from tankcal.report.camera.drawings import line_style, mathematical, matrix, styled
from tankcal.report.camera.naming import numbered
from tankcal.report.camera.stability import KEYS, numbered_labels
from tankcal.text.digits import fixed

ACROSS, MOST_PANELS = 6, 36
WIDE_RANGE = 8.0  # largest over threshold: from here on colours are logarithmic
RADII = 81
BAND = 2.0  # standard deviations
COLOUR_MAP = "viridis"


def maps(paper):
    """Figures with a map of the difference for each pair, and (first, last) numbers of each."""
    pairs = paper.result["pairs"]
    norm = _norm(paper, [np.max(row["difference_px"]) for row in pairs])
    found, first = [], 1
    for part in even_groups(pairs, MOST_PANELS):
        found.append((_panels(paper, part, norm), first, first + len(part) - 1))
        first += len(part)
    return found


def _norm(paper, largest):
    threshold, top = paper.result["threshold_px"], max(largest)
    if top > WIDE_RANGE * threshold:
        return LogNorm(threshold / 5, top, clip=True)
    return Normalize(0, max(top, threshold))


@styled
def _panels(paper, pairs, norm):
    width, height = paper.result["cameras"][0]["format_px"]
    across = min(ACROSS, max(len(pairs), 2))
    down = ceil(len(pairs) / across)
    one = (WIDTH - 0.75) / across
    row = one * 0.94 * height / width + 0.27
    figure = Figure(figsize=(WIDTH, down * row + 0.12))
    axes = figure.subplots(down, across, squeeze=False).ravel()
    column_px, line_px = _grid_lines(paper.result["grid"])
    for ax, pair in zip(axes, pairs, strict=False):
        values = np.array(pair["difference_px"])
        edges = _edges(column_px, line_px)
        shown = ax.imshow(values, extent=edges, norm=norm, cmap=COLOUR_MAP, aspect="equal")
        threshold = paper.result["threshold_px"]
        is_smooth = paper.result["terrain"] is None  # random heights make the differences rough
        if is_smooth and min(values.shape) > 1 and values.min() < threshold < values.max():
            ax.contour(column_px, line_px, values, [threshold], colors="white", linewidths=0.8)
        ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xticks=[], yticks=[])
        ax.set_title(_title(paper, pair), fontsize=6.5, pad=2, parse_math=False)
    for ax in axes[len(pairs) :]:
        ax.axis("off")
    set_margins(figure, left=0.02, right=0.78, bottom=0.04, top=0.24, wspace=0.06, hspace=0.3)
    _bar(paper, figure, shown)
    return figure


def _bar(paper, figure, shown):
    width, height = figure.get_size_inches()
    tall = min(height - 0.3, 2.4)
    place = [1 - 0.68 / width, (height - 0.2 - tall) / height, 0.11 / width, tall / height]
    bar = figure.colorbar(shown, cax=figure.add_axes(place))
    if isinstance(shown.norm, LogNorm):
        ticks = [t for p in range(-4, 6) for t in (10.0**p, 2 * 10.0**p, 5 * 10.0**p)]
        inside = [t for t in ticks if shown.norm.vmin <= t <= shown.norm.vmax]
        bar.set_ticks(inside, labels=[paper.plain(t) for t in inside])
        bar.ax.minorticks_off()
    bar.ax.tick_params(labelsize=7)
    bar.set_label(paper.word("axes.difference"), fontsize=7.5)


def _title(paper, pair):
    every = [camera["name"] for camera in paper.result["cameras"]]
    heads = numbered(every)[1]
    names = (heads[every.index(pair[key])] for key in "ab")
    return paper.word("axes.pair", **dict(zip("ab", names, strict=True)))


def _grid_lines(grid):
    x, y = grid["start_px"]
    step = grid["step_px"]
    return x + step * np.arange(grid["columns"]), y + step * np.arange(grid["rows"])


def _edges(column_px, line_px):
    """Left, right, bottom, top of the picture: half a step beyond the outer points."""
    half_x, half_y = (
        (part[1] - part[0]) / 2 if len(part) > 1 else 0.5 for part in (column_px, line_px)
    )
    return (
        column_px[0] - half_x,
        column_px[-1] + half_x,
        line_px[-1] + half_y,
        line_px[0] - half_y,
    )


@styled
def coloured_matrix(paper):
    """The matrix of the figures as colours."""
    names = [camera["name"] for camera in paper.result["cameras"]]
    labels, heads = numbered(names)
    count = len(names) - 1
    values = np.full((count, count), np.nan)
    texts = [[""] * count for _ in range(count)]
    similar = []
    for pair in paper.result["pairs"]:
        i, k = sorted((names.index(pair["a"]), names.index(pair["b"])), reverse=True)
        values[i - 1, k] = pair["figure_px"]
        texts[i - 1][k] = fixed(pair["figure_px"], 2, paper.marks)
        if pair["similar"]:
            similar.append((k, i - 1))
    figure = Figure(figsize=(WIDTH, 0.24 * count + 0.45))
    ax = figure.subplots()
    norm = _norm(paper, [np.nanmax(values)])
    shown = matrix(ax, values, texts, labels[1:], heads[:-1], norm=norm, cmap=COLOUR_MAP)
    for k, i in similar:
        ax.add_patch(Rectangle((k - 0.46, i - 0.42), 0.92, 0.84, fill=False, ec="#b03a2e", lw=1.4))
    widest = max(map(len, labels))
    left = 0.15 + 0.065 * widest
    set_margins(figure, left=left, right=max(4.9 - left - 0.52 * count, 0.9), bottom=0.08, top=0.26)
    _bar(paper, figure, shown)
    return figure


@styled
def curves(paper):
    """Radial curves with bands of twice their sd, and decentring profiles."""
    figure = Figure(figsize=(WIDTH, 3.0))
    left, right = figure.subplots(1, 2)
    labels = numbered_labels(paper)
    for number, camera in enumerate(paper.result["cameras"]):
        pixel_mm = np.mean(camera["pixel_um"]) / 1e3
        half_mm = np.hypot(*(np.array(camera["format_px"]) * camera["pixel_um"])) / 2e3
        radius_mm = np.linspace(0, half_mm, RADII)
        interior = [camera[KEYS[name]] for name in PARAMETERS]
        form = Form(camera["convention"], camera["affinity"], camera["radial_balance_mm"])
        radial_mm, sd_mm = radial_curve(radius_mm, interior, form, _radial_covariance(camera))
        style, label = line_style(number), labels[number]
        left.plot(radius_mm, radial_mm / pixel_mm, label=label.replace("$", r"\$"), **style)
        if sd_mm is not None:
            low, high = radial_mm - BAND * sd_mm, radial_mm + BAND * sd_mm
            left.fill_between(
                radius_mm, low / pixel_mm, high / pixel_mm, color=style["color"], alpha=0.13, lw=0
            )
        right.plot(radius_mm, decentring_profile(radius_mm, interior) / pixel_mm, **style)
    for ax, name in ((left, "radial"), (right, "decentring")):
        ax.set_xlabel(paper.word("axes.radius"))
        ax.set_ylabel(paper.word(f"axes.{name}"))
        ax.margins(x=0)
        ax.grid(True)
    count = len(paper.result["cameras"])
    rows = ceil(count / 4)
    figure.set_size_inches(WIDTH, 2.75 + 0.17 * rows)
    figure.legend(loc="upper center", ncols=min(count, 4), fontsize=7.5, frameon=False)
    set_margins(figure, left=0.6, right=0.12, bottom=0.42, top=0.12 + 0.17 * rows, wspace=0.26)
    return figure


def _radial_covariance(camera):
    """(4, 4) covariance of K1 .. K4 of a set, the sds taken as uncorrelated; None: no sds."""
    sds = [camera["sd"][KEYS[name]] for name in ("K1", "K2", "K3", "K4")]
    if all(sd is None for sd in sds):
        return None
    return np.diag([(sd or 0.0) ** 2 for sd in sds])


@styled
def drift(paper):
    """Focal lengths and principal points with bars of twice their sd."""
    cameras = paper.result["cameras"]
    figure = Figure(figsize=(WIDTH, 2.6))
    left, right = figure.subplots(1, 2)
    _, heads = numbered([camera["name"] for camera in cameras])
    for number, (camera, head) in enumerate(zip(cameras, heads, strict=True)):
        c, x0, y0 = (camera[KEYS[name]] for name in ("c", "x0", "y0"))
        sd_c, sd_x, sd_y = (BAND * (camera["sd"][KEYS[n]] or 0.0) for n in ("c", "x0", "y0"))
        bars = {"fmt": "o", "color": INK, "markersize": 3, "elinewidth": 0.7, "capsize": 2}
        left.errorbar(number, c, sd_c, **bars)
        right.errorbar(x0, y0, sd_y, sd_x, **bars)
        right.annotate(
            head, (x0, y0), (4, 3), textcoords="offset points", fontsize=7, parse_math=False
        )
    places = [(camera[KEYS["x0"]], camera[KEYS["y0"]]) for camera in cameras]
    right.plot(*zip(*places, strict=True), color=FAINT, linewidth=0.5, zorder=0)
    left.set_xticks(range(len(heads)), heads, parse_math=False)
    left.margins(x=0.08)
    for ax in (left, right):
        ax.ticklabel_format(axis="y", useOffset=False)
        ax.grid(True)
    right.ticklabel_format(axis="x", useOffset=False)
    right.locator_params(axis="x", nbins=5)
    right.margins(0.12)
    left.set_ylabel(mathematical(paper.word("axes.focal")))
    right.set_xlabel(mathematical(paper.word("axes.x0")))
    right.set_ylabel(mathematical(paper.word("axes.y0")))
    set_margins(figure, left=0.72, right=0.12, bottom=0.42, top=0.1, wspace=0.4)
    return figure
