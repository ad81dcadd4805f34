"""Calibration by metered liquid in the documents: facts, tables of steps, misclosures, figures."""

import numpy as np

from tankcal.methods.liquid import tables
from tankcal.methods.liquid.tables import control_text, density_text, with_u
from tankcal.report import numbers
from tankcal.report.plots.style import FAINT, GREY, INK, RED, WIDTH, Drawing, set_margins, styled

MOST_ROWS = 16  # rows of the table of volumes in the documents; the workbook has all rows
MARKERS = "osD^vP*X"  # marker of each run, as matplotlib names it
BEYOND = 4.0  # largest half-height of the frame, in largest |difference| + U without geometry
COLOURS = {"geometry": FAINT, "liquid": RED, "joint": INK}


# ---- facts


def facts(paper):
    """Block of calibrating liquid, filled range, run effect, bottom, and the test of all steps."""
    liquid = paper.record["liquid"]
    return paper.facts(
        [
            ("liquid_certified", paper.word(f"liquid_tables.{liquid['certified']}")),
            ("liquid_beside", paper.word(f"liquid_beside.{liquid['geometry']}")),
            ("liquid_calibrating", density_text(paper, liquid)),
            ("liquid_expansion", with_u(paper, liquid, "expansion_per_k", "1/K")),
            ("liquid_temperature_sd", paper.number(liquid["u_temperature_c"], "", digits=2) + " K"),
            ("liquid_dip_zero", paper.number(liquid["u_dip_zero_m"], "mm", digits=2)),
            ("liquid_range", range_text(paper)),
            ("liquid_run_sd", _run_sd(paper, liquid)),
            ("liquid_below", _estimate(paper, liquid, "below_first_dip_m3", "L")),
            ("liquid_flex", _estimate(paper, liquid, "bottom_flex", "L/m")),
            ("liquid_test", _test(paper, liquid)),
            ("liquid_radius", paper.number(liquid["detectable_radius_m"], "mm", digits=2)),
            (
                "liquid_hidden",
                " ".join(control_text(paper, control) for control in liquid.get("controls") or ())
                or None,
            ),
        ]
    )


def range_text(paper):
    """Return the lowest and highest dip of the evaluation in words."""
    liquid = paper.record["liquid"]
    low, high = (paper.height(liquid[f"{end}_dip_m"]) for end in ("lowest", "highest"))
    return paper.word("texts.between_values", low=low, high=high)


def _run_sd(paper, liquid):
    """Return the standard deviation between runs in words, with its degrees of freedom."""
    sd = paper.number(liquid["run_sd"], "share ppm", digits=2)
    if liquid["run_dof"] is None:
        return paper.word("texts.liquid_run_declared", sd=sd)
    dof = numbers.degrees_of_freedom(liquid["run_dof"], paper.marks)
    return paper.word("texts.liquid_run_found", sd=sd, dof=dof)


def _estimate(paper, liquid, key, unit):
    """Return an estimate with its u in words; None if it was not estimated."""
    value, u = liquid[key], liquid[f"u_{key}"]
    if value is None:
        return None
    value, u = (paper.number(number, unit, u=u) for number in (value, u))
    return paper.word("texts.liquid_with_u", value=value, u=u)


def _test(paper, liquid):
    chi2 = paper.number(liquid["chi2"], decimals=1)
    dof = paper.number(liquid["dof"], decimals=0)
    probability = paper.number(liquid["probability"], decimals=3)
    return paper.word("texts.liquid_test", chi=chi2, dof=dof, probability=probability)


# ---- tables


def steps(paper):
    """Tables of the steps: volumes at reference conditions, misclosures, residuals of batches."""
    names = ("liquid_steps", "liquid_misclosures", "liquid_residuals")
    return [paper.show(tables.STEPS, on=name) for name in names]


def unknowns(paper):
    """Tables of possible causes of misclosures and of sizes that the liquid changed."""
    shown = [paper.show(tables.CAUSES)]
    if tables.SIZES.rows(paper.record):
        shown.append(paper.show(tables.SIZES))
    return shown


def volumes(paper):
    """Table of volumes from geometry, liquid and both, at selected heights."""
    record = paper.record
    table = tables.volumes_table(record)
    rows = table.rows(record)
    shown = [rows[place] for place in chosen_rows(record)]
    return paper.show(table, shown, shown=len(shown), all=len(rows))


def chosen_rows(record):
    """Indices of the rows in the papers: evenly spaced rows and the ends of the filled range."""
    heights, liquid = np.array(record["capacity"]["height_m"]), record["liquid"]
    even = np.linspace(0, len(heights) - 1, min(MOST_ROWS, len(heights))).round().astype(int)
    # A tolerance of 1e-9 m includes rows at the ends of the filled range.
    low = np.searchsorted(heights, liquid["lowest_dip_m"] - 1e-9)
    high = np.searchsorted(heights, liquid["highest_dip_m"] + 1e-9) - 1
    ends = [place for place in (low, high) if 0 <= place < len(heights)]
    return sorted({int(place) for place in (*even, *ends)})


# ---- figures


@styled
def misclosures(paper):
    """Figure of the misclosures of the steps, liquid minus geometry, with U, against the dip."""
    steps = paper.record["liquid"]["steps"]
    figure = Drawing(figsize=(WIDTH, 2.9))
    ax = figure.subplots()
    ax.axhline(0, color=GREY, linewidth=0.6)
    runs = list(dict.fromkeys(step["run"] for step in steps))
    colours = (INK, RED, FAINT)
    shift = _least_gap(steps) * 0.12  # separates the error bars of runs at equal dips
    for number, run in enumerate(runs):
        run_steps = [step for step in steps if step["run"] == run]
        dips = np.array([step["to_dip_m"] for step in run_steps])
        dips = dips + shift * (number - (len(runs) - 1) / 2) if len(runs) <= len(MARKERS) else dips
        ax.errorbar(
            dips,
            [1000 * step["misclosure_m3"] for step in run_steps],
            [1000 * step["misclosure_U_m3"] for step in run_steps],
            color=colours[number % len(colours)],
            marker=MARKERS[number % len(MARKERS)],
            markersize=3,
            linestyle="",
            elinewidth=0.7,
            capsize=1.5,
            label=paper.word("axes.liquid_run", run=run),
        )
    ax.set_xlabel(paper.word("axes.liquid_dip"))
    ax.set_ylabel(paper.word("axes.liquid_misclosure"))
    ax.grid(True)
    if 1 < len(runs) <= len(MARKERS):
        figure.legend(loc="upper center", ncols=min(len(runs), 6), frameon=False, fontsize=8)
    set_margins(figure, left=0.7, right=0.12, bottom=0.42, top=0.32)
    return figure


def _least_gap(steps):
    """Smallest distance between dips of a run, m."""
    gaps = []
    for run in {step["run"] for step in steps}:
        dips = np.sort([step["to_dip_m"] for step in steps if step["run"] == run])
        gaps += np.diff(dips)[np.diff(dips) > 0].tolist()
    return min(gaps, default=0.0)


@styled
def differences(paper):
    """Figure of the three tables minus the joint table, each with its U."""
    record = paper.record
    rows = tables.rows_beside(record)
    column = {key: np.array([row[key] for row in rows], dtype=float) for key in rows[0]}
    height, joint = column["height_m"], column["joint_volume_m3"]
    bands = {
        kind: (column[f"{kind}_volume_m3"] - joint, column[f"{kind}_U_m3"]) for kind in tables.KINDS
    }
    low, high = (record["liquid"][f"{end}_dip_m"] for end in ("lowest", "highest"))
    filled = (height >= low - 1e-9) & (height <= high + 1e-9)
    # The first of two panels shows the filled range only.
    panels = [np.full(len(height), True)]
    if np.count_nonzero(filled) > 1 and not filled.all():
        panels = [filled, *panels]
    figure = Drawing(figsize=(WIDTH, 3.0))
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    for ax, inside in zip(axes, panels, strict=True):
        shown_bands = {kind: (middle[inside], U[inside]) for kind, (middle, U) in bands.items()}
        _draw_bands(ax, height[inside], shown_bands, lambda kind: paper.word(f"axes.liquid_{kind}"))
        ax.set_xlabel(paper.word("axes.height"))
    axes[0].set_ylabel(paper.word("axes.liquid_difference"))
    figure.legend(
        *axes[0].get_legend_handles_labels(), loc="upper center", ncols=3, frameon=False, fontsize=8
    )
    set_margins(figure, left=0.7, right=0.12, bottom=0.42, top=0.32, wspace=0.24)
    return figure


def _draw_bands(ax, height, bands, name_of):
    """Draw differences with their U; a wide band of the geometry may exceed the frame."""
    reach = {}
    for kind, (middle, U) in bands.items():
        if not np.isfinite(middle).any():
            continue
        reach[kind] = np.nanmax(np.abs(middle) + U)
        colour = COLOURS[kind]
        ax.plot(height, middle, color=colour, linewidth=1.2, label=name_of(kind))
        ax.fill_between(height, middle - U, middle + U, color=colour, alpha=0.18, linewidth=0)
    needed = max(size for kind, size in reach.items() if kind != "geometry")
    limit = max(needed, min(reach["geometry"], BEYOND * needed))
    if limit:
        ax.set_ylim(-1.08 * limit, 1.08 * limit)
    ax.set_xlim(height[0], height[-1])
    ax.grid(True)
