"""Geometry of an upright tank from its capacity table.

Rows below the highest point of the bottom, and rows in the critical zone of a roof, are excluded.
The other rows are adjusted (`table_fit.fit`). Fittings are sought as pairs of kinks
(`seams.find_fittings`), in turn, until no pair explains more than rounding can by chance. The
rows then decide whether the table includes a head, where its zero is, and whether the seams agree
with the declared ones.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.products.recalibration.table_fit import (
    Rows,
    State,
    are_kinks_fixed,
    roughness,
    row_sds,
    try_fit,
    u_factors,
)
from tankcal.products.recalibration.upright_search import (
    LEAST_GAIN,
    SAME_ZERO,
    drop_insignificant_fittings,
    drop_phantom_fittings,
    search,
)

STEEL_PA = 206e9
START_DENSITY_KG_M3 = 500.0
USUAL_KG_M3 = 450.0, 450.0  # prior mean and sd of a density that the table does not determine
DECLARED_SD_KG_M3 = 10.0
HELD_SD_KG_M3 = 0.1  # standard deviation of a fixed density
LIQUID_KG_M3 = 500.0  # density of a light liquid; a head not detectable at it is undecided
LIGHTEST_KG_M3 = 100.0  # smallest density of a possible liquid
DENSEST_KG_M3 = 2000.0  # largest density of a stored liquid; sulphuric acid has 1840
FEWEST_ROWS = 3  # fewest rows of a ring
BY_ORDER = 1.0  # smallest reduction of chi2 for which the head of second order is used
ORDER_IS_CLEAR = 9.0


@dataclass(frozen=True)
class TableEstimate:
    """A value estimated from a table, and its standard uncertainty by rounding."""

    value: float
    u: float


@dataclass(frozen=True)
class FittingEstimate:
    """A fitting deducted or added in a table.

    Attributes
    ----------
    bottom_m, top_m, volume_m3 : TableEstimate
        Dips and volume; u is nan for an end outside the rows used.
    """

    bottom_m: TableEstimate
    top_m: TableEstimate
    volume_m3: TableEstimate


@dataclass(frozen=True)
class UprightGeometry:
    """Geometry of an upright tank estimated from a table.

    Attributes
    ----------
    name : str
        Name of the table.
    radii_m, u_m : ndarray, shape (n,)
        Inside radii of the empty shell at the table's temperature; u by rounding only.
    covariance_m2 : ndarray, shape (n, n)
        Covariance of the radii.
    heights_m, thickness_m : ndarray, shape (n,)
        Rings within the table.
    zero_m : TableEstimate
        Dip of the bottom of the first ring. u is 0 if the table is empty at its zero and begins
        there; nan if unknown because the seams are estimated as well.
    seams_m : tuple of TableEstimate
        Dips of the seams, each estimated separately; u is large if the area does not jump there.
    seams_source : {"declared", "found"}
        Which seams the radii refer to.
    density_kg_m3 : TableEstimate
    head : {"with", "without", "undecided"}
    t : float
        Density over its u.
    fittings : tuple of FittingEstimate
    roof_m3 : TableEstimate or None
        Effect of a declared roof above its critical zone; negative.
    base_m3 : TableEstimate
        Volume at `lowest_m`, the lowest row used.
    lowest_m : float
    used : ndarray of bool, shape (rows,)
    left_m3 : ndarray, shape (rows,)
        Table minus geometry, at each row.
    rms_m3, largest_m3, expected_m3 : float
        Rms and largest residual of the rows used; rms expected from rounding.
    without_head : (rms, largest, radii) or None
        Results without a head: m3, m3, (n,) m.
    roughness : float
        Factor of u because residuals exceed rounding; 1 if they do not.
    state : State
        The complete model, as a function of the dip.
    independent_u : (float, ndarray)
        Standard deviations of density and (n,) radii for independent rounding of each row; u is
        never smaller (`table_fit.u_factors`).
    """

    name: str
    radii_m: np.ndarray
    u_m: np.ndarray
    covariance_m2: np.ndarray
    heights_m: np.ndarray
    thickness_m: np.ndarray
    zero_m: TableEstimate
    seams_m: tuple[TableEstimate, ...]
    seams_source: str
    density_kg_m3: TableEstimate
    head: str
    t: float
    fittings: tuple[FittingEstimate, ...]
    roof_m3: TableEstimate | None
    base_m3: TableEstimate
    lowest_m: float
    used: np.ndarray
    left_m3: np.ndarray
    rms_m3: float
    largest_m3: float
    expected_m3: float
    without_head: tuple[float, float, np.ndarray] | None
    roughness: float
    state: State
    independent_u: tuple[float, np.ndarray]


def read_upright(
    former,
    heights_m,
    thickness_m,
    *,
    modulus_pa=STEEL_PA,
    lowest_m=None,
    seams_known=True,
):
    """Estimate radii, density of the head, zero and fittings from a table.

    Parameters
    ----------
    former : FormerTable
    heights_m, thickness_m : array_like, shape (n,)
        Rings from the bottom up; the table must reach all of them.
    modulus_pa : float
    lowest_m : float, optional
        Dip of the highest point of the bottom; None: estimated.
    seams_known : bool
        False: `heights_m` are start values only.

    Returns
    -------
    UprightGeometry

    Raises
    ------
    SolutionError
        If there are too few rows, or they do not determine the radii.
    """
    heights, plates = np.asarray(heights_m, float), np.asarray(thickness_m, float)
    rows = Rows(former.height_m, former.volume_m3, row_sds(former))
    zone = former.roof.critical_m if former.roof else None
    used = np.ones(len(rows.dip_m), dtype=bool)
    if zone is not None:
        used = (rows.dip_m < zone[0]) | (rows.dip_m > zone[1])
    empty = rows.volume_m3 <= 0
    if np.count_nonzero(empty) > 1:  # dips below the bottom
        used &= ~empty
    usable = rows.select(used)
    state = _start(usable, heights, plates, modulus_pa, zone)
    solution = search(usable, state, lowest_m, _usual_density(former))
    used &= rows.dip_m >= solution.state.lowest_m - 1e-9
    return _geometry(former, solution, rows, used, seams_known)


def _start(rows, heights, plates, modulus, zone):
    """Return the initial State, with radii from the mean area of each ring."""
    edges = np.concatenate([[0.0], np.cumsum(heights)])
    radii = np.zeros(len(heights))
    # Mean area of each ring: the rise of the volume over the rise of the dip.
    for k in range(len(heights)):
        inside = np.flatnonzero((rows.dip_m >= edges[k]) & (rows.dip_m <= edges[k + 1]))
        if len(inside) < FEWEST_ROWS:
            raise SolutionError(
                message(
                    "former_few_rows",
                    "{count} rows in course {course}; expected {fewest} or more to read its radius",
                    count=len(inside),
                    course=k + 1,
                    fewest=FEWEST_ROWS,
                )
            )
        # The lower half of the first ring may contain the bottom.
        upper = inside[len(inside) // 2 :] if k == 0 and len(inside) > 5 else inside
        rise = rows.volume_m3[upper[-1]] - rows.volume_m3[upper[0]]
        area = rise / (rows.dip_m[upper[-1]] - rows.dip_m[upper[0]])
        radii[k] = np.sqrt(max(area, 1e-6) / np.pi)
    return State(
        base_m3=float(rows.volume_m3[0]),
        radii_m=radii,
        density_kg_m3=START_DENSITY_KG_M3,
        zero_m=0.0,
        seams_m=edges[1:-1],
        rings_top_m=float(edges[-1]),
        thickness_m=plates,
        modulus_pa=modulus,
        lowest_m=float(rows.dip_m[0]),
        highest_m=float(rows.dip_m[-1]),
        roof_zone_m=zone,
    )


def _geometry(former, solution, rows, used, seams_known):
    """Decide on zero, head, seams and fittings of a Fit, and return the UprightGeometry."""
    chosen, quantum = rows.select(used), former.volume_quantum_m3
    solution = _fix_known_zero(chosen, former, solution)
    is_bulged = solution.state.bulges_m is not None
    # Profiles absorb the order of the head and small shifts of the seams, so both are kept.
    other_order = seams = None
    if not is_bulged:
        solution = drop_insignificant_fittings(chosen, solution, quantum)
        solution, other_order = _choose_order(chosen, solution)
        seams = solution if "seams" in solution.state.free else _fit_free_seams(chosen, solution)
    if seams is not None and (not seams_known or _do_seams_differ(solution, seams)):
        solution = seams = drop_phantom_fittings(chosen, seams, quantum)
    seams_source = "found" if "seams" in solution.state.free else "declared"
    # The density decides on the head. Its u includes rounding and the unknown order of the head.
    layout, factors = solution.state.layout, u_factors(solution, chosen, quantum)
    u_density = np.hypot(
        (solution.sd("density") * factors[layout["density"]])[0],
        _order_effect(solution, other_order)[0],
    )
    density = TableEstimate(solution.state.density_kg_m3, float(u_density))
    is_rough = is_bulged or roughness(solution, chosen) > 1
    head = _decide_head(density, former.liquid_density_kg_m3, is_rough)
    # for independent rounding of each row, before the factors of u
    independent_u = float(solution.sd("density")[0]), solution.sd("radii")
    # Without a determined density, the radii are those of a usual density, or of no head.
    dry, without_head = _fit_without_head(chosen, solution), None
    if head != "without":
        without_head = (*_rms_and_largest(dry.left_m3), dry.state.radii_m)
    if head == "undecided":
        solution, other_order = _fit_usual_density(chosen, former, solution, dry), None
    if head == "without":
        solution, other_order = dry, None
    solution = drop_phantom_fittings(chosen, solution, quantum)
    u_seams = None
    if seams is not None:
        factors = u_factors(seams, chosen, quantum)
        u_seams = seams.sd("seams") * factors[seams.state.layout["seams"]]
    return _make_geometry(
        former, solution, rows, used,
        factors=u_factors(solution, chosen, quantum), density=density, head=head,
        without_head=without_head,
        seams=_seam_estimates(seams.state if seams else solution.state, u_seams),
        seams_source=seams_source, order_effect=_order_effect(solution, other_order)[1],
        independent_u=independent_u,
    )  # fmt: skip


def _choose_order(rows, solution):
    """Return the Fit with the order of the head that fits better, and the Fit with the other order.

    The first order is used if both fit equally. The second Fit is None if it is clearly worse.
    """
    second = try_fit(rows, replace(solution.state, is_first_order=False))
    if second is None:
        return solution, None
    gain = solution.chi2 - second.chi2
    best, other = (second, solution) if gain > BY_ORDER else (solution, second)
    return best, other if abs(gain) < ORDER_IS_CLEAR else None


def _order_effect(solution, other_order):
    """Contribution of the unknown order of the head to the sds of density and radii (n,).

    The difference d of the two orders is the half width of a rectangular distribution: d / sqrt(3).
    """
    if other_order is None:
        return 0.0, np.zeros(len(solution.state.radii_m))
    density = abs(solution.state.density_kg_m3 - other_order.state.density_kg_m3)
    return density / np.sqrt(3), (solution.state.radii_m - other_order.state.radii_m) / np.sqrt(3)


def _fix_known_zero(rows, former, solution):
    """Return the Fit of a tank empty at dip 0, the bottom of the first ring, if rows allow it."""
    if not (rows.dip_m[0] == 0 and rows.volume_m3[0] == 0) or former.volume_quantum_m3 == 0:
        return solution
    free = solution.state.free - {"zero", "base"}
    fixed = try_fit(rows, replace(solution.state, zero_m=0.0, base_m3=0.0, free=free))
    # two unknowns fewer raise chi2 by 2 on average
    is_as_good = fixed is not None and fixed.chi2 - solution.chi2 < SAME_ZERO**2 + 2
    return fixed if is_as_good else solution


def _fit_free_seams(rows, solution):
    """Return the Fit with separately estimated seams; None if it has no solution."""
    if not len(solution.state.seams_m):
        return None
    free = (solution.state.free | {"seams"}) - {"zero"}
    seams = try_fit(rows, replace(solution.state, free=free))
    is_rising = seams is not None and np.all(np.diff(seams.state.rings.edges_m) > 0)
    return seams if is_rising else None


def _do_seams_differ(solution, seams):
    """Whether seams differ from the declared ones: one of them clearly, or all together by chi2."""
    apart = np.abs(seams.state.seams_m - solution.state.seams_m)
    count = len(apart)
    return bool(np.any(apart > CRITICAL * seams.sd("seams"))) and (
        solution.chi2 - seams.chi2 > LEAST_GAIN + count
    )


def _fit_without_head(rows, solution):
    """Return the Fit without a head."""
    free = solution.state.free - {"density"}
    dry = replace(solution.state, density_kg_m3=0.0, free=free)
    solution = try_fit(rows, dry) or try_fit(rows, replace(dry, free=free - {"kinks"}))
    return solution or rows.adjust(replace(dry, free=free - {"kinks", "zero"}))


def _usual_density(former):
    """Return (density, sd) of the declared head, or the prior of an unknown head."""
    declared = former.liquid_density_kg_m3
    return USUAL_KG_M3 if declared is None else (declared, DECLARED_SD_KG_M3)


def _fit_usual_density(rows, former, solution, dry):
    """Return the Fit with the prior density, as the table does not determine it."""
    usual, sd = _usual_density(former)
    state = replace(
        solution.state, density_kg_m3=usual, usual_density_kg_m3=usual, density_sd_kg_m3=sd
    )
    again = try_fit(rows, state) or solution
    density = again.state.density_kg_m3
    if LIGHTEST_KG_M3 <= density <= DENSEST_KG_M3:
        return again
    # The density is impossible: use the shell at the nearest possible density, and keep u.
    if density > DENSEST_KG_M3:
        nearest = try_fit(rows, replace(state, density_sd_kg_m3=HELD_SD_KG_M3)) or dry
    else:
        nearest = dry
    possible = replace(nearest.state, free=again.state.free)
    return replace(again, state=possible, left_m3=nearest.left_m3, chi2=nearest.chi2)


def _decide_head(density, declared_kg_m3, is_rough):
    """Decide whether a table includes a head: "with", "without" or "undecided".

    A bulging wall, or rows with errors beyond rounding, resemble a head. A declared density then
    takes precedence. An impossible density counts as no head.
    """
    if is_rough and declared_kg_m3 is not None:
        return "undecided" if declared_kg_m3 > 0 else "without"
    if not is_possible(density):
        return "undecided"
    if density.value > CRITICAL * density.u:
        return "with"
    return "without" if CRITICAL * density.u < LIQUID_KG_M3 else "undecided"


def is_possible(density):
    """Whether the density of a TableEstimate is possible for a liquid, within its u."""
    reach = CRITICAL * density.u
    return -reach <= density.value <= DENSEST_KG_M3 + reach


def _rms_and_largest(residuals):
    return float(np.sqrt(np.mean(residuals**2))), float(np.abs(residuals).max())


def _make_geometry(former, solution, rows, used, *, factors, density, head, without_head, seams,
                   seams_source, order_effect, independent_u):  # fmt: skip
    """Return the UprightGeometry of a Fit, with standard deviations multiplied by `factors`."""
    state, layout = solution.state, solution.state.layout
    radii = layout["radii"]
    covariance = solution.cofactor[radii, radii] * np.outer(factors[radii], factors[radii])
    covariance = covariance + np.outer(order_effect, order_effect)
    sd = {name: solution.sd(name) * factors[part] for name, part in layout.items()}
    rms, largest = _rms_and_largest(solution.left_m3)
    chosen = rows.select(used)
    return UprightGeometry(
        name=former.name,
        radii_m=state.radii_m,
        u_m=np.sqrt(np.diag(covariance)),
        covariance_m2=covariance,
        heights_m=np.diff(state.rings.edges_m),
        thickness_m=state.thickness_m,
        zero_m=_zero_estimate(state, sd["zero"]),
        seams_m=seams,
        seams_source=seams_source,
        density_kg_m3=density,
        head=head,
        t=float(density.value / density.u),
        fittings=_fitting_estimates(state, sd["fittings"]),
        roof_m3=TableEstimate(state.roof_m3, *sd["roof"]) if state.roof_zone_m else None,
        base_m3=TableEstimate(state.base_m3, *sd["base"])
        if len(sd["base"])
        else TableEstimate(0.0, 0.0),
        lowest_m=state.lowest_m,
        used=used,
        left_m3=former.volume_m3 - state.volume_m3(former.height_m),
        rms_m3=rms,
        largest_m3=largest,
        expected_m3=float(np.sqrt(np.mean(chosen.sd_m3**2))),
        without_head=without_head,
        roughness=roughness(solution, chosen),
        state=state,
        independent_u=independent_u,
    )


def _zero_estimate(state, sds):
    """TableEstimate of the zero.

    U is 0 if the table is empty at its zero, nan if the seams are unknown.
    """
    if len(sds):
        return TableEstimate(state.zero_m, float(sds[0]))
    return TableEstimate(state.zero_m, np.nan if "base" in state.free else 0.0)


def _seam_estimates(state, sds):
    dips = state.rings.edges_m[1:-1]
    sds = np.full(len(dips), np.nan) if sds is None else sds
    return tuple(TableEstimate(float(d), float(u)) for d, u in zip(dips, sds, strict=True))


def _fitting_estimates(state, sds):
    fittings = []
    for k, fitting in enumerate(state.fittings):
        held = are_kinks_fixed(state, fitting)
        u = [np.nan if h else s for h, s in zip(held, sds[3 * k : 3 * k + 2], strict=True)]
        volume = TableEstimate(fitting.volume_m3, float(sds[3 * k + 2]))
        fittings.append(
            FittingEstimate(
                TableEstimate(fitting.bottom_m, u[0]), TableEstimate(fitting.top_m, u[1]), volume
            )
        )
    return tuple(sorted(fittings, key=lambda fitting: fitting.bottom_m.value))
