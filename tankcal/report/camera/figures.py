"""Figures of the camera reports.

They show comparisons of calibrations, parameters, check points, and the influence of calibrations.
"""

import re
from functools import partial
from math import ceil, floor, log10

import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from tankcal.calibration.interiors import decentring_profile, radial_curve
from tankcal.camera.model import KEYS, PARAMETERS, Form
from tankcal.report import numbers
from tankcal.report.camera.influence import label, list_adjusted_runs
from tankcal.report.camera.paper import number_names
from tankcal.report.camera.parameters import is_in_pixels
from tankcal.report.camera.product import unit_of
from tankcal.report.camera.stability import number_calibrations
from tankcal.report.plots import style as plot_style
from tankcal.report.plots.style import FAINT, GREY, INK, RED, WIDTH, even_groups, set_margins
from tankcal.text.digits import fixed

COLOURS = (INK, RED, "#3b7d4f", "#b8860b", "#6a4c93", "#1b998b", "#8a5a44", "#555555")
DASHES = ("-", "--", ":")
LUMA = (0.299, 0.587, 0.114)  # weights of red, green and blue in the brightness: ITU-R BT.601
DARK = 0.55  # brightness below which white text is easier to read than black
styled = partial(plot_style.styled, **{"mathtext.fontset": "stix"})
MAPS_IN_ROW, MOST_MAPS = 6, 36  # of a figure
WIDE_RANGE_OF_MAPS = 8.0  # largest difference over threshold from which colours are logarithmic
RADII = 81  # number of radii of a curve
BAND = 2.0  # half-width of a band, in standard deviations
BAR = 0.26  # height of a bar of one axis
TALLEST_BARS = 8.0  # height of all bars, inches
WIDE_RANGE_OF_BARS = 30  # largest over smallest bar from which the scale is logarithmic
SEQUENTIAL, DIVERGING = "viridis", "RdBu_r"  # colour maps


# ---- style, colours and common elements of figures


def line_style(number):
    """Colour and dash of a line; the first 24 numbers have different styles."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": DASHES[number // len(COLOURS) % len(DASHES)],
    }


def widen_to_decades(ax):
    """Extend a logarithmic x axis of less than a decade to powers of ten, which have ticks."""
    low, high = ax.get_xlim()
    if ax.get_xscale() == "log" and high < 10 * low:
        ax.set_xlim(10.0 ** floor(log10(low)), 10.0 ** ceil(log10(high)))


def typeset_indices(text):
    """Text of tankcal in which letters with an index, such as "K₁", are set as mathematics."""
    return re.sub(
        "([A-Za-z])([₀-₉])",
        lambda match: rf"$\mathrm{{{match[1]}}}_{{{ord(match[2]) - ord('₀')}}}$",
        text,
    )


def draw_matrix(ax, values, texts, labels, heads, parse_math=False, **scale):
    """Draw a matrix as colours with a text in each cell.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Axes of the figure.
    values : ndarray, shape (rows, columns)
        Values; nan for an empty cell.
    texts : list of list of str
        Text of each cell.
    labels, heads : list of str
        Names of rows and of columns.
    parse_math : bool, optional
        Whether names may contain mathematics; False for texts of a user.
    **scale
        cmap, and vmin and vmax or norm.

    Returns
    -------
    matplotlib.image.AxesImage
        Image for a colour bar.
    """
    image = ax.imshow(values, aspect="auto", **scale)
    for i, row in enumerate(texts):
        for k, text in enumerate(row):
            if text:
                brightness = float(np.dot(image.to_rgba(values[i][k])[:3], LUMA))
                ink = "white" if brightness < DARK else "black"
                ax.text(k, i, text, ha="center", va="center", fontsize=7, color=ink)
    ax.set_xticks(range(len(heads)), heads, parse_math=parse_math)
    ax.set_yticks(range(len(labels)), labels, parse_math=parse_math)
    ax.tick_params(length=0, labeltop=True, labelbottom=False)
    ax.set_frame_on(False)
    return image


# ---- figures of the camera papers


# ---- comparison of calibrations


def maps(paper):
    """Figures with a map of the difference for each pair.

    Returns
    -------
    list of (Figure, int, int)
        Figure, and numbers of its first and last pair, from 1.
    """
    pairs = paper.result["pairs"]
    norm = _scale_of_differences(paper, [np.max(row["difference_px"]) for row in pairs])
    figures, first = [], 1
    for group in even_groups(pairs, MOST_MAPS):
        figures.append((_draw_maps(paper, group, norm), first, first + len(group) - 1))
        first += len(group)
    return figures


def _scale_of_differences(paper, largest):
    threshold, top = paper.result["threshold_px"], max(largest)
    if top > WIDE_RANGE_OF_MAPS * threshold:
        return LogNorm(threshold / 5, top, clip=True)
    return Normalize(0, max(top, threshold))


@styled
def _draw_maps(paper, pairs, norm):
    """Figure with a map of each pair; contours show the threshold."""
    width, height = paper.result["cameras"][0]["format_px"]
    names = [camera["name"] for camera in paper.result["cameras"]]
    heads = number_names(names)[1]
    across = min(MAPS_IN_ROW, max(len(pairs), 2))
    down = ceil(len(pairs) / across)
    # A map has the proportions of the frame, plus its title.
    map_width = (WIDTH - 0.75) / across
    row_height = map_width * 0.94 * height / width + 0.27
    figure = Figure(figsize=(WIDTH, down * row_height + 0.12))
    axes = figure.subplots(down, across, squeeze=False).ravel()
    column_px, line_px = _grid_lines(paper.result["grid"])
    threshold = paper.result["threshold_px"]
    is_smooth = paper.result["terrain"] is None  # random heights make the differences rough
    for ax, pair in zip(axes, pairs, strict=False):
        values = np.array(pair["difference_px"])
        edges = _image_edges(column_px, line_px)
        image = ax.imshow(values, extent=edges, norm=norm, cmap=SEQUENTIAL, aspect="equal")
        if is_smooth and min(values.shape) > 1 and values.min() < threshold < values.max():
            ax.contour(column_px, line_px, values, [threshold], colors="white", linewidths=0.8)
        ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xticks=[], yticks=[])
        title = paper.word("axes.pair", **{key: heads[names.index(pair[key])] for key in "ab"})
        ax.set_title(title, fontsize=6.5, pad=2, parse_math=False)
    for ax in axes[len(pairs) :]:
        ax.axis("off")
    set_margins(figure, left=0.02, right=0.78, bottom=0.04, top=0.24, wspace=0.06, hspace=0.3)
    _draw_colour_bar(paper, figure, image)
    return figure


def _draw_colour_bar(paper, figure, image):
    """Draw a colour bar at the right edge of a figure."""
    width, height = figure.get_size_inches()
    tall = min(height - 0.3, 2.4)
    place = [1 - 0.68 / width, (height - 0.2 - tall) / height, 0.11 / width, tall / height]
    bar = figure.colorbar(image, cax=figure.add_axes(place))
    if isinstance(image.norm, LogNorm):
        ticks = [t for p in range(-4, 6) for t in (10.0**p, 2 * 10.0**p, 5 * 10.0**p)]
        inside = [t for t in ticks if image.norm.vmin <= t <= image.norm.vmax]
        bar.set_ticks(inside, labels=[paper.plain(t) for t in inside])
        bar.ax.minorticks_off()
    bar.ax.tick_params(labelsize=7)
    bar.set_label(paper.word("axes.difference"), fontsize=7.5)


def _grid_lines(grid):
    x, y = grid["start_px"]
    step = grid["step_px"]
    return x + step * np.arange(grid["columns"]), y + step * np.arange(grid["rows"])


def _image_edges(column_px, line_px):
    """Left, right, bottom and top of an image, half a step beyond the outer points, px."""
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
def figure_matrix(paper):
    """Matrix of the figures of all pairs as colours, with frames around similar pairs."""
    names = [camera["name"] for camera in paper.result["cameras"]]
    labels, heads = number_names(names)
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
    norm = _scale_of_differences(paper, [np.nanmax(values)])
    image = draw_matrix(ax, values, texts, labels[1:], heads[:-1], norm=norm, cmap=SEQUENTIAL)
    for k, i in similar:
        ax.add_patch(Rectangle((k - 0.46, i - 0.42), 0.92, 0.84, fill=False, ec="#b03a2e", lw=1.4))
    left = 0.15 + 0.065 * max(map(len, labels))
    set_margins(figure, left=left, right=max(4.9 - left - 0.52 * count, 0.9), bottom=0.08, top=0.26)
    _draw_colour_bar(paper, figure, image)
    return figure


@styled
def curves(paper):
    """Radial curves with bands of twice their standard deviation, and decentring profiles."""
    figure = Figure(figsize=(WIDTH, 3.0))
    left, right = figure.subplots(1, 2)
    labels = number_calibrations(paper)
    for number, camera in enumerate(paper.result["cameras"]):
        pixel_mm = np.mean(camera["pixel_um"]) / 1e3
        half_mm = np.hypot(*(np.array(camera["format_px"]) * camera["pixel_um"])) / 2e3
        radius_mm = np.linspace(0, half_mm, RADII)
        interior = [camera[KEYS[name]] for name in PARAMETERS]
        form = Form(camera["convention"], camera["affinity"], camera["radial_balance_mm"])
        radial_mm, sd_mm = radial_curve(radius_mm, interior, form, _radial_covariance(camera))
        style, name = line_style(number), labels[number]
        left.plot(radius_mm, radial_mm / pixel_mm, label=name.replace("$", r"\$"), **style)
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
    """Covariance (4, 4) of uncorrelated K1 to K4, or None without standard deviations."""
    sds = [camera["sd"][KEYS[name]] for name in ("K1", "K2", "K3", "K4")]
    if all(sd is None for sd in sds):
        return None
    return np.diag([(sd or 0.0) ** 2 for sd in sds])


@styled
def drift(paper):
    """Focal lengths and principal points, with bars of twice their standard deviation."""
    cameras = paper.result["cameras"]
    figure = Figure(figsize=(WIDTH, 2.6))
    left, right = figure.subplots(1, 2)
    _, heads = number_names([camera["name"] for camera in cameras])
    for number, (camera, head) in enumerate(zip(cameras, heads, strict=True)):
        c, x0, y0 = (camera[KEYS[name]] for name in ("c", "x0", "y0"))
        sd_c, sd_x, sd_y = (BAND * (camera["sd"][KEYS[n]] or 0.0) for n in ("c", "x0", "y0"))
        style = {"fmt": "o", "color": INK, "markersize": 3, "elinewidth": 0.7, "capsize": 2}
        left.errorbar(number, c, sd_c, **style)
        right.errorbar(x0, y0, sd_y, sd_x, **style)
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
    left.set_ylabel(typeset_indices(paper.word("axes.focal")))
    right.set_xlabel(typeset_indices(paper.word("axes.x0")))
    right.set_ylabel(typeset_indices(paper.word("axes.y0")))
    set_margins(figure, left=0.72, right=0.12, bottom=0.42, top=0.1, wspace=0.4)
    return figure


# ---- parameters of a camera


@styled
def correlations(paper):
    """Lower triangle of the correlation matrix as colours with its numbers."""
    names = paper.result["names"]
    values = _matrix_with_nan(paper.result["correlation"])
    is_upper = np.triu(np.ones_like(values, dtype=bool))
    heads = _parameter_names(paper, names[:-1])
    return _draw_signed_matrix(paper, np.where(is_upper, np.nan, values)[1:, :-1], names[1:], heads)


@styled
def loadings(paper):
    """Loadings of the components as colours with their numbers."""
    components = paper.result["components"]
    heads = [str(number) for number in range(1, len(components["names"]) + 1)]
    values = _matrix_with_nan(components["loadings"])
    return _draw_signed_matrix(paper, values, components["names"], heads)


def _matrix_with_nan(rows):
    return np.array(
        [[np.nan if value is None else value for value in row] for row in rows], dtype=float
    )


def _parameter_names(paper, names):
    return [typeset_indices(paper.words["parameters"].get(name, name)) for name in names]


def _draw_signed_matrix(paper, values, names, heads):
    """Draw values from -1 to 1; `names` are the parameters of the rows."""
    is_empty = np.isnan(values)
    texts = [
        ["" if np.isnan(value) else fixed(value, 2, paper.marks) for value in row] for row in values
    ]
    figure = Figure(figsize=(WIDTH, 0.25 * len(names) + 0.4))
    ax = figure.subplots()
    scale = {"cmap": DIVERGING, "vmin": -1, "vmax": 1}
    labels = _parameter_names(paper, names)
    image = draw_matrix(ax, np.where(is_empty, 0, values), texts, labels, heads, True, **scale)
    image.set_alpha(np.where(is_empty, 0.0, 1.0))
    set_margins(figure, left=0.4, right=0.05, bottom=0.05, top=0.27)
    return figure


@styled
def scree(paper):
    """Shares of the components as bars, and their cumulative sum."""
    components = paper.result["components"]
    places = np.arange(1, len(components["eigenvalues"]) + 1)
    figure = Figure(figsize=(WIDTH, 2.3))
    ax = figure.subplots()
    ax.bar(places, components["share_percent"], color=INK, width=0.6)
    ax.plot(places, components["cumulative_percent"], "o-", color=RED, markersize=3)
    ax.set(xticks=places, ylim=(0, 105))
    ax.set_xlabel(paper.word("axes.component"))
    ax.set_ylabel(paper.word("axes.share_of_component"))
    ax.grid(True, axis="y")
    ax.set_axisbelow(True)
    set_margins(figure, left=0.55, right=0.12, bottom=0.42, top=0.08)
    return figure


@styled
def effects(paper):
    """Shift of the corner by each parameter, and its F, on logarithmic scales."""
    unit = "px" if is_in_pixels(paper.result) else "um"
    rows = [row for row in paper.result["parameters"] if row["edge"]["own"]]
    figure = Figure(figsize=(WIDTH, 0.26 * len(rows) + 0.75))
    left, right = figure.subplots(1, 2, sharey=True)
    places = np.arange(len(rows))
    own = [abs(row["edge"]["own"][f"corner_{unit}"]) for row in rows]
    rest = [abs((row["edge"]["left"] or {}).get(f"corner_{unit}") or np.nan) for row in rows]
    _draw_log_bars(left, places - 0.19, own, INK, paper.word("axes.own"), 0.36)
    _draw_log_bars(left, places + 0.19, rest, FAINT, paper.word("axes.left"), 0.36)
    f = [np.nan if row["F"] is None else row["F"] for row in rows]
    _draw_log_bars(right, places, f, INK, None, 0.5)
    accuracy = paper.result["image_accuracy"]
    if accuracy and accuracy[unit]:
        left.axvline(accuracy[unit], color=RED, linewidth=0.9)
    for row, place in zip(rows, places, strict=True):
        if row["critical"] is not None:
            right.plot([row["critical"]] * 2, [place - 0.4, place + 0.4], color=RED, linewidth=0.9)
    left.set_yticks(places, _parameter_names(paper, [row["name"] for row in rows]))
    left.invert_yaxis()
    left.set_xlabel(paper.word(f"axes.effect_{unit}"))
    right.set_xlabel(paper.word("axes.f"))
    for ax in (left, right):
        widen_to_decades(ax)
        ax.grid(True, axis="x")
        ax.set_axisbelow(True)
    figure.legend(loc="upper left", ncols=2, fontsize=7.5, frameon=False)
    set_margins(figure, left=0.4, right=0.12, bottom=0.42, top=0.25, wspace=0.08)
    return figure


def _draw_log_bars(ax, places, sizes, colour, name, height):
    """Draw bars on a logarithmic scale; a size of 0 has no bar."""
    if any(size > 0 for size in sizes):
        ax.set_xscale("log")
    sizes = [size if size > 0 else np.nan for size in sizes]
    ax.barh(places, sizes, height, color=colour, label=name)


# ---- influence of calibrations


def bars_name(paper):
    """Name of the figure of bars, from the results to be drawn; None without results."""
    parts = _parts_of_bars(list_adjusted_runs(paper))
    if len(parts) == 2:
        return "bars"
    return f"bars_{parts[0]}" if parts else None


def _parts_of_bars(runs):
    return [part for part in ("product", "volume") if any(run[part] for run in runs)]


@styled
def bars(paper):
    """RMSE at check points by axis, and change of the volume, for each run."""
    runs = list_adjusted_runs(paper)
    parts = _parts_of_bars(runs)
    figure = Figure(figsize=(WIDTH, min(0.3 * len(runs), TALLEST_BARS) + 0.75))
    axes = figure.subplots(1, len(parts), sharey=True, squeeze=False)[0]
    places = np.arange(len(runs))
    for ax, part in zip(axes, parts, strict=True):
        if part == "product":
            _draw_rmse(paper, ax, runs, places)
        else:
            _draw_volume_changes(paper, ax, runs, places)
        ax.grid(True, axis="x")
        ax.set_axisbelow(True)
    labels = [label(paper, run) for run in runs]
    axes[0].set_yticks(places, labels, parse_math=False)
    axes[0].invert_yaxis()
    if "product" in parts:
        figure.legend(loc="upper right", ncols=3, fontsize=7.5, frameon=False)
    left = 0.25 + 0.062 * max(map(len, labels))
    set_margins(figure, left=left, right=0.15, bottom=0.42, top=0.25, wspace=0.1)
    return figure


def _draw_rmse(paper, ax, runs, places):
    """Draw the RMSE of each axis and run."""
    units = {unit_of(run["product"]) for run in runs if run["product"]}
    unit = numbers.unit("m" if "m" in units else "mm")
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
    widths = [bar.get_width() for bar in ax.patches if bar.get_width() > 0]
    if widths and max(widths) > WIDE_RANGE_OF_BARS * min(widths):
        ax.set_xscale("log")
    ax.set_xlabel(paper.word("axes.rmse", unit=unit.symbol))


def _draw_volume_changes(paper, ax, runs, places):
    """Draw the change of the volume in each run, and the band of U of the reference."""
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


# ---- check points


@styled
def differences(paper):
    """Differences at check points in plan and in height."""
    result = paper.result
    unit = numbers.unit(unit_of(result))
    values = {
        row["axis"]: np.array(
            [np.nan if point[key] is None else point[key] for point in result["differences"]],
            dtype=float,
        )
        * unit.factor
        for row in result["axes"]
        for key in [f"d{row['axis']}_m"]
    }
    figure = Figure(figsize=(WIDTH, 2.8))
    has_plan = {"x", "y"} <= set(values)
    others = [axis for axis in values if not (has_plan and axis in "xy")]
    axes = figure.subplots(1, has_plan + bool(others), squeeze=False)[0].tolist()
    if has_plan:
        _draw_plan(paper, axes.pop(0), values, unit.symbol)
    if others:
        _draw_by_number(paper, axes.pop(0), {axis: values[axis] for axis in others}, unit.symbol)
    set_margins(figure, left=0.62, right=0.12, bottom=0.42, top=0.12, wspace=0.3)
    return figure


def _draw_plan(paper, ax, values, unit):
    """Draw differences in plan, with a cross at their mean."""
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


def _draw_by_number(paper, ax, values, unit):
    """Draw differences against the number of the point, with lines at their means."""
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
