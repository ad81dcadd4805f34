"""Metered runs on paper: what was filled, misclosures by dip, three tables beside each other."""

import numpy as np

from tankcal.pipeline.plot_style import FAINT, GREY, INK, RED, WIDTH, Drawing, set_margins, styled
from tankcal.report import numbers
from tankcal.report.metered_liquid import control_text, density_text, with_u
from tankcal.report.tables import liquid as tables

MOST_ROWS = 16  # of the table of volumes on paper; all are in the workbook
MARKERS = "osD^vP*X"
BEYOND = 4.0  # of the largest U of joint table and liquid: a wider band of geometry is cut off
COLOURS = {"geometry": FAINT, "liquid": RED, "joint": INK}


# ---- facts


def facts(paper):
    """The calibrating liquid, what was filled, run effect, bottom, and the test of all steps."""
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
            ("liquid_hidden", _hidden(paper, liquid)),
        ]
    )


def _hidden(paper, liquid):
    """What the steps would not show of errors that change all volumes; None of older records."""
    return " ".join(control_text(paper, one) for one in liquid.get("controls") or ()) or None


def range_text(paper):
    """The dips that count, from the lowest to the highest."""
    liquid = paper.record["liquid"]
    low, high = (paper.height(liquid[f"{end}_dip_m"]) for end in ("lowest", "highest"))
    return paper.word("texts.between_values", low=low, high=high)


def _run_sd(paper, liquid):
    sd = paper.number(liquid["run_sd"], "share ppm", digits=2)
    if liquid["run_dof"] is None:
        return paper.word("texts.liquid_run_declared", sd=sd)
    dof = numbers.degrees_of_freedom(liquid["run_dof"], paper.marks)
    return paper.word("texts.liquid_run_found", sd=sd, dof=dof)


def _estimate(paper, liquid, key, unit):
    """An unknown with its u; None where it was none."""
    value, u = liquid[key], liquid[f"u_{key}"]
    if value is None:
        return None
    value, u = (paper.number(one, unit, u=u) for one in (value, u))
    return paper.word("texts.liquid_with_u", value=value, u=u)


def _test(paper, liquid):
    chi2 = paper.number(liquid["chi2"], decimals=1)
    dof = paper.number(liquid["dof"], decimals=0)
    probability = paper.number(liquid["probability"], decimals=3)
    return paper.word("texts.liquid_test", chi=chi2, dof=dof, probability=probability)


# ---- tables


def steps(paper):
    """The steps three times: brought to the reference, against geometry, each batch tested."""
    names = ("liquid_steps", "liquid_misclosures", "liquid_residuals")
    return [paper.show(tables.STEPS, on=name) for name in names]


def unknowns(paper):
    """Causes that misclosures may have, and the sizes that the liquid moved, where it did."""
    found = [paper.show(tables.CAUSES)]
    if tables.SIZES.rows(paper.record):
        found.append(paper.show(tables.SIZES))
    return found


def volumes(paper):
    """Rows of the three tables: evenly chosen, with the ends of what was filled."""
    record = paper.record
    table = tables.volumes_table(record)
    rows = table.rows(record)
    shown = [rows[place] for place in chosen_rows(record)]
    return paper.show(table, shown, shown=len(shown), all=len(rows))


def chosen_rows(record):
    """Places of the rows that paper shows: the ends of the filled dips, the top, some between."""
    heights, liquid = np.array(record["capacity"]["height_m"]), record["liquid"]
    even = np.linspace(0, len(heights) - 1, min(MOST_ROWS, len(heights))).round().astype(int)
    low = np.searchsorted(heights, liquid["lowest_dip_m"] - 1e-9)
    high = np.searchsorted(heights, liquid["highest_dip_m"] + 1e-9) - 1
    ends = [place for place in (low, high) if 0 <= place < len(heights)]
    return sorted({int(place) for place in (*even, *ends)})


# ---- figures


@styled
def misclosures(paper):
    """Misclosures of the steps, liquid less geometry, with U, over the dip at their end."""
    found = paper.record["liquid"]["steps"]
    figure = Drawing(figsize=(WIDTH, 2.9))
    ax = figure.subplots()
    ax.axhline(0, color=GREY, linewidth=0.6)
    runs = list(dict.fromkeys(one["run"] for one in found))
    colours = (INK, RED, FAINT)
    shift = _least_gap(found) * 0.12
    for number, run in enumerate(runs):
        mine = [one for one in found if one["run"] == run]
        at = np.array([one["to_dip_m"] for one in mine])
        at = at + shift * (number - (len(runs) - 1) / 2) if len(runs) <= len(MARKERS) else at
        ax.errorbar(
            at,
            [1000 * one["misclosure_m3"] for one in mine],
            [1000 * one["misclosure_U_m3"] for one in mine],
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


def _least_gap(found):
    """The least distance between dips of one run, m."""
    gaps = []
    for run in {one["run"] for one in found}:
        at = np.sort([one["to_dip_m"] for one in found if one["run"] == run])
        gaps += np.diff(at)[np.diff(at) > 0].tolist()
    return min(gaps, default=0.0)


@styled
def differences(paper):
    """The three tables less the joint one, each with its U: over the filled dips, and over all."""
    record = paper.record
    rows = tables.rows_beside(record)
    column = {key: np.array([row[key] for row in rows], dtype=float) for key in rows[0]}
    height, joint = column["height_m"], column["joint_volume_m3"]
    bands = {
        kind: (column[f"{kind}_volume_m3"] - joint, column[f"{kind}_U_m3"]) for kind in tables.KINDS
    }
    low, high = (record["liquid"][f"{end}_dip_m"] for end in ("lowest", "highest"))
    filled = (height >= low - 1e-9) & (height <= high + 1e-9)
    panels = [np.full(len(height), True)]
    if np.count_nonzero(filled) > 1 and not filled.all():
        panels = [filled, *panels]
    figure = Drawing(figsize=(WIDTH, 3.0))
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    for ax, inside in zip(axes, panels, strict=True):
        here = {kind: (middle[inside], U[inside]) for kind, (middle, U) in bands.items()}
        _draw_bands(ax, height[inside], here, lambda kind: paper.word(f"axes.liquid_{kind}"))
        ax.set_xlabel(paper.word("axes.height"))
    axes[0].set_ylabel(paper.word("axes.liquid_difference"))
    figure.legend(
        *axes[0].get_legend_handles_labels(), loc="upper center", ncols=3, frameon=False, fontsize=8
    )
    set_margins(figure, left=0.7, right=0.12, bottom=0.42, top=0.32, wspace=0.24)
    return figure


def _draw_bands(ax, height, bands, name_of):
    """Differences with their U; the frame holds all of joint table and liquid."""
    reach = {}
    for kind, (middle, U) in bands.items():
        if not np.isfinite(middle).any():
            continue
        reach[kind] = np.nanmax(np.abs(middle) + U)
        colour = COLOURS[kind]
        ax.plot(height, middle, color=colour, linewidth=1.2, label=name_of(kind))
        ax.fill_between(height, middle - U, middle + U, color=colour, alpha=0.18, linewidth=0)
    needed = max(one for kind, one in reach.items() if kind != "geometry")
    limit = max(needed, min(reach["geometry"], BEYOND * needed))
    if limit:
        ax.set_ylim(-1.08 * limit, 1.08 * limit)
    ax.set_xlim(height[0], height[-1])
    ax.grid(True)
