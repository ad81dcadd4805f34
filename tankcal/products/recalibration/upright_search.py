"""Search for the components of an upright tank in its table: bottom, zero, fittings, seams.

Starting from the top of the first ring, rows are followed downwards while they fit one cross
section; the bottom is below. The zero is where the seams jump together (`zero.find_zeros`).
Fittings are sought as pairs of kinks, in turn, until no pair explains more than rounding can by
chance. If there are many fittings, or some may be seams of a wrong zero, other zeros and moved
seams are tried. The model with the fewest fittings is chosen.
"""

from dataclasses import replace

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.products.recalibration.seams import (
    FARTHEST_M,
    find_fittings,
    find_zeros,
    move_seams,
    pair_kinks_again,
)
from tankcal.products.recalibration.table_fit import (
    DENSITY_SD_KG_M3,
    ROUGH,
    roughness,
    simulate_rounding,
    try_fit,
    u_factors,
)
from tankcal.products.recalibration.upright_shell import no_bulges, show_bulges

SEAMS_FREE = "base", "density", "seams"
LEAST_GAIN = 25.0  # smallest reduction of chi2 by a fitting; the best pair gains less by chance
MOST_FITTINGS, FEW_FITTINGS = 12, 4
# A fitting with less gain than this is compared with simulated roundings: number and margin.
DOUBTFUL_GAIN, CHANCES, MARGIN = 300.0, 8, 1.2
LEAST_SIZE = 3.0  # smallest volume of a fitting, last digits of the table
PRICE = 50.0  # penalty of a fitting, added to chi2 in the choice of a model
SAME_COST = 1.0
LEAST_CHI2 = 0.8  # smallest chi2 per degree of freedom
SAME_SLOPES = 0.03, 0.15  # sizes of ignored kinks, relative to the largest, in other pairings
LENGTHS_M = 1.0, 3.0, np.inf  # largest heights of fittings in successive searches
USUAL_ZEROS_M = 0.0, -0.04, 0.04  # further zeros tried if there are many fittings
NEAR_M = 0.025  # largest distance of the zero from its start value
CUT_M, CUT_ROWS = 0.4, 9  # height and number of rows of one cross section above the bottom
BOTTOM_TRIES = 60
# Degree of the volume within CUT_M, and largest number of rows, for courses that bulge.
BULGED_DEGREE, MOST_BULGED_ROWS = 4, 400
SURE_OF_BULGED = 8.0  # smallest fitting where courses bulge, standard uncertainties
JOINT_M, DRAWN_IN_M = 0.15, 3e-3  # zone about a joint, and radial deformation of plates there
LONGEST_BULGED_M = 1.2  # highest fitting where courses bulge; a higher one resembles a profile
LOW_M, LOW_SHARE = 0.15, 0.2  # height of low fittings and their largest share of the area
TAKEN_SHARE, GIVEN_SHARE = 0.7, 0.1  # largest share of the area that a fitting removes or adds
EDGE_M = 0.1  # distance of the top row of the first ring below the first seam (unknown zero)
SAME_ZERO = 3.0  # standard deviations within which two zeros are equal


def search(rows, state, lowest_m, usual_density):
    """Return the Fit of all components found in rows.

    Parameters
    ----------
    rows : Rows
    state : State
        Start values.
    lowest_m : float or None
        Dip of the highest point of the bottom; None: estimated.
    usual_density : (float, float)
        Density of the head and its standard deviation, kg/m3, for bulging courses: a taper of the
        courses resembles a head.

    Raises
    ------
    SolutionError
        If the rows do not determine the radii.
    """
    edges = state.rings.edges_m
    shows_bulges = show_bulges(rows.dip_m, rows.volume_m3, rows.sd_m3, edges)
    if shows_bulges:
        solution = _search_bulged(rows, state, lowest_m, *usual_density)
        if solution is not None and not _is_straight(rows, solution):
            return solution
    solution = _search_straight(rows, state, lowest_m)
    if shows_bulges or _is_plain(solution) or _is_within_rounding(solution):
        return solution
    # In a coarse table, bulges look like many fittings, or like fittings that end at joints.
    bulged = _search_bulged(rows, state, lowest_m, *usual_density)
    is_simpler = bulged is not None and (
        len(bulged.state.fittings) < len(solution.state.fittings)
        and _cost(bulged) < _cost(solution)
    )
    return bulged if is_simpler else solution


def _search_straight(rows, state, lowest_m):
    """Return the Fit of straight courses; the arguments are those of `search`."""
    if lowest_m is not None:
        rows = rows.select_above(lowest_m)
        return _try_moved_seams(rows, _fit_fittings(rows, state))
    lowest = _lowest_row(rows, state)
    solution = _try_moved_seams(
        rows.select_above(lowest), _fit_fittings(rows.select_above(lowest), state)
    )
    if lowest > rows.dip_m[0]:
        more = replace(solution.state, lowest_m=float(rows.dip_m[0]))
        try:
            whole = _fit_fittings(rows, more, at_most=len(solution.state.fittings) + 1)
        except SolutionError:
            return solution
        if _is_within_rounding(whole) and _is_gain_large_enough(rows, solution, whole):
            return whole
    return solution


def _search_bulged(rows, state, lowest_m, density, density_sd):
    """Return the Fit of bulging courses with fittings that the profiles do not explain, or None.

    Seams are kept as declared. Residuals of the profiles are correlated from row to row, and two
    kinks explain part of them. A fitting must explain more.
    """
    lowest = _lowest_row(rows, state, BULGED_DEGREE) if lowest_m is None else lowest_m
    start = replace(
        state,
        bulges_m=no_bulges(len(state.radii_m)),
        density_kg_m3=density,
        usual_density_kg_m3=density,
        density_sd_kg_m3=density_sd,
    )
    chosen_rows = rows.select_above(lowest).thin(MOST_BULGED_ROWS)
    best = None
    for zero in USUAL_ZEROS_M:
        candidate = _fit_free_zero(
            chosen_rows.select_above(zero + NEAR_M), replace(start, zero_m=zero), zero
        )
        if candidate and (best is None or _cost(candidate) < _cost(best) - LEAST_GAIN):
            best = candidate
    if best is None:
        return None
    about = best.state.zero_m
    chosen_rows = chosen_rows.select_above(best.state.lowest_m)
    while len(best.state.fittings) < MOST_FITTINGS:
        again = _add_fitting(chosen_rows, best, LONGEST_BULGED_M, about, rough=True)
        if again is None:
            break
        best = again
    best = try_fit(
        rows.select_above(max(lowest, best.state.lowest_m)),
        _drop_unsure_fittings(chosen_rows, best).state,
    )
    return best and _add_lower_rows(rows.select_above(lowest), best)


def _is_straight(rows, solution):
    """Whether straight courses with the same fittings fit as well as profiles."""
    state = replace(
        solution.state,
        bulges_m=None,
        usual_density_kg_m3=None,
        density_sd_kg_m3=DENSITY_SD_KG_M3,
    )
    rows = rows.select_above(solution.state.lowest_m)
    free_zero = replace(state, free=state.free | {"zero"})  # profiles absorb an error of the zero
    tries = (try_fit(rows, start) for start in (state, free_zero))
    return any(trial is not None and trial.chi2 < solution.cost + PRICE for trial in tries)


def _drop_unsure_fittings(rows, solution):
    """Return the Fit without insignificant fittings, where courses bulge."""
    while solution.state.fittings:
        sds = solution.sd("fittings")[2::3] * roughness(solution, rows)
        volumes = np.abs([fitting.volume_m3 for fitting in solution.state.fittings])
        sizes = volumes / np.maximum(sds, 1e-12)
        worst = int(np.argmin(sizes))
        again = try_fit(rows, _drop_fitting(solution.state, worst))
        if sizes[worst] >= SURE_OF_BULGED or again is None:
            break
        solution = again
    return solution


def _drop_fitting(state, place):
    """Return the State without one of its fittings."""
    return replace(state, fittings=state.fittings[:place] + state.fittings[place + 1 :])


def _resembles_joint(state, fitting):
    """Whether a fitting adds volume, or resembles plates drawn in at a joint."""
    joints = state.rings.edges_m
    ends = np.array([[fitting.bottom_m], [fitting.top_m]])
    girth = 2 * np.pi * float(state.radii_m[0])
    thickness = -fitting.volume_m3 / (girth * max(fitting.top_m - fitting.bottom_m, 1e-9))
    is_near = bool(np.any(np.abs(ends - joints) < JOINT_M))
    return thickness <= 0 or (is_near and thickness < DRAWN_IN_M)


def _try_moved_seams(rows, solution):
    """Return the Fit with seams from the rows, if this removes fittings that resemble seams."""
    if _is_plain(solution) or not len(solution.state.seams_m):
        return solution
    zero = solution.state.zero_m
    edges = solution.state.rings.edges_m[1:-1]
    moved = move_seams(rows.dip_m, rows.volume_m3, rows.sd_m3, edges) - zero
    if np.any(np.diff(moved) <= 0):
        return solution
    state = replace(solution.state, seams_m=moved, fittings=(), free=frozenset(SEAMS_FREE))
    candidate = _fit_from_zero(rows.select_above(zero + NEAR_M), state, MOST_FITTINGS)
    price = LEAST_GAIN * len(moved) / 2
    is_better = candidate is not None and _cost(candidate) + price < _cost(solution)
    return _add_lower_rows(rows, candidate) if is_better else solution


def _is_gain_large_enough(rows, solution, larger):
    """Whether the reduction of chi2 is large for the number of new unknowns."""
    return len(rows.dip_m) - len(solution.left_m3) > 10 * (
        len(larger.state.unknowns) - len(solution.state.unknowns)
    )


def _is_within_rounding(solution):
    """Whether all residuals are within rounding: as a whole, and at the worst row."""
    worst = np.abs(solution.left_m3 / solution.sd_m3).max()
    return solution.chi2 < ROUGH**2 * max(solution.dof, 1) and worst < np.sqrt(3) * 1.25


def _lowest_row(rows, state, degree=2):
    """Lowest dip above the highest point of the bottom: rows from there on fit one cross section.

    The result is the lowest row of the first ring above which a polynomial leaves only rounding.
    Its degree is 2, or higher for bulging courses.
    """
    first = rows.dip_m <= state.seams_m[0] - EDGE_M if len(state.seams_m) else rows.dip_m >= 0
    ring = rows.select(first)
    length = max(CUT_M, CUT_ROWS * float(np.median(np.diff(rows.dip_m))))
    tries = np.flatnonzero(ring.dip_m <= ring.dip_m[-1] - length) if len(ring.dip_m) else ()
    if len(tries) == 0:
        return float(rows.dip_m[0])
    # At most BOTTOM_TRIES of the rows, rising, closer together near the bottom.
    last = len(tries) - 1
    places = np.round(last * np.linspace(0, 1, BOTTOM_TRIES) ** 1.5).astype(int)
    for place in [int(tries[0]), *tries[np.unique(places)]]:
        dip = ring.dip_m[place]
        window = ring.select((ring.dip_m >= dip) & (ring.dip_m <= dip + length + 1e-9))
        if _is_one_cut(window, degree):
            return float(dip)
    return float(rows.dip_m[0])


def _is_one_cut(ring, degree):
    """Whether a polynomial fits rows within rounding."""
    if len(ring.dip_m) < degree + 3:
        return False
    x = (ring.dip_m - ring.dip_m[0]) / (ring.dip_m[-1] - ring.dip_m[0])
    basis = np.vander(x, degree + 1) / ring.sd_m3[:, None]
    value = (ring.volume_m3 - ring.volume_m3[0]) / ring.sd_m3
    left = value - basis @ np.linalg.lstsq(basis, value, rcond=None)[0]
    dof = len(x) - degree - 1
    is_rounding = np.abs(left).max() < np.sqrt(3) * 1.25
    lower = left[: max(len(left) // 4, 2)]  # a bottom appears in the lowest rows first
    return (
        is_rounding
        and left @ left < dof + 4 * np.sqrt(dof)
        and abs(lower.sum()) < 4 * np.sqrt(len(lower))
    )


def _fit_fittings(rows, state, at_most=MOST_FITTINGS):
    """Return the Fit with the fittings in the rows, for the zero that needs the fewest of them.

    With a wrong zero, seams resemble fittings. Other zeros are therefore tried if there are many
    fittings, or if the fittings do not explain the rows.
    """
    zeros = find_zeros(rows.dip_m, rows.volume_m3, rows.sd_m3, state.seams_m)
    best, tried = None, 0
    for zero in (state.zero_m,) if state.fittings else (zeros[0], *USUAL_ZEROS_M, *zeros[1:]):
        most = at_most
        if best is not None:  # more fittings than these cost more than the best Fit
            most = min(at_most, max(int((_cost(best) - LEAST_CHI2 * best.dof) / PRICE), 0))
        candidate = _fit_from_zero(
            rows.select_above(zero + NEAR_M), replace(state, zero_m=zero), most
        )
        if candidate and (best is None or _cost(candidate) < _cost(best) - SAME_COST):
            best = candidate
        if best and _is_plain(best) and _is_within_rounding(best):
            break
        tried += candidate is None or len(candidate.state.fittings) >= at_most
        if tried > 1:
            break
    if best is None:
        raise SolutionError(
            message("former_undetermined", "the rows of the table do not determine the radii")
        )
    if len(best.state.fittings) > FEW_FITTINGS and not _is_within_rounding(best):
        # Fittings of unlimited height also explain other effects, such as a wrong cross section.
        bare = replace(best.state, fittings=())
        best = _fit_free_zero(rows.select_above(best.state.lowest_m), bare, bare.zero_m) or best
    return _add_lower_rows(rows, best)


def _add_lower_rows(rows, solution):
    """Return the Fit with rows that were excluded because the first ring might begin among them."""
    more = len(rows.dip_m) - len(solution.left_m3)
    for lowest in rows.dip_m[:more]:
        chosen = rows.select_above(lowest)
        again = try_fit(chosen, replace(solution.state, base_m3=float(chosen.volume_m3[0])))
        if again and _is_possible(again):
            gain = again.chi2 - solution.chi2
            if gain < len(chosen.dip_m) - len(solution.left_m3) + SAME_ZERO**2:
                return again
    return solution


def _is_plain(solution):
    """Whether there are few fittings, and none resembles a seam of a wrong zero."""
    seams = solution.state.rings.edges_m[1:-1]
    return len(solution.state.fittings) <= FEW_FITTINGS and all(
        fitting.volume_m3 < 0
        and fitting.top_m - fitting.bottom_m < LENGTHS_M[0]
        and not np.any(np.abs(seams - fitting.bottom_m) < NEAR_M)
        and not np.any(np.abs(seams - fitting.top_m) < NEAR_M)
        for fitting in solution.state.fittings
    )


def _cost(solution):
    return solution.cost + PRICE * len(solution.state.fittings)


def _fit_from_zero(rows, start, at_most):
    """Return the Fit with fittings and the zero free about its start value, or None.

    Low fittings are sought first: two kinks of two fittings, one above the other, resemble one
    fitting.
    """
    about = start.zero_m
    solution = _fit_free_zero(rows, start, about)
    for longest in LENGTHS_M if solution else ():
        while len(solution.state.fittings) < at_most and solution.dof > 6:
            again = _add_fitting(rows, solution, longest, about)
            if again is None:
                break
            solution = again
    return _simplify_fittings(rows, solution, about) if solution else None


def _add_fitting(rows, solution, longest, about, rough=False):
    """Return the Fit with the fitting that explains most; None if no fitting explains enough.

    rough: whether residuals exceed rounding; the required gain is then relative to the residuals.
    """
    # Prior observations do not depend on a fitting, so they are placed at the lowest row.
    design, left, sds = solution.bulges
    candidates = find_fittings(
        np.append(np.full(len(sds), rows.dip_m[0]), rows.dip_m),
        np.append(left, solution.left_m3),
        np.vstack([design, solution.design]),
        np.append(sds, rows.sd_m3),
        longest,
    )
    for fitting, gain in candidates:
        if gain < LEAST_GAIN:
            break
        more = replace(solution.state, fittings=(*solution.state.fittings, fitting))
        again = _fit_free_zero(rows, more, about)
        factor = roughness(again, rows) ** 2 if rough and again else 1.0
        if (
            again
            and solution.cost - again.cost > LEAST_GAIN * factor
            # larger than the effect of two rounded digits
            and abs(again.state.fittings[-1].volume_m3)
            > LEAST_SIZE * np.sqrt(12) * float(np.median(rows.sd_m3))
            and not (rough and _resembles_joint(again.state, again.state.fittings[-1]))
        ):
            return again
    return None


def _simplify_fittings(rows, solution, about):
    """Return the Fit with fewer fittings, if fewer fit equally well."""
    if len(solution.state.fittings) > 1:
        near = 1.6 * float(np.median(np.diff(rows.dip_m)))
        for share in SAME_SLOPES:
            pairs = pair_kinks_again(solution.state.fittings, near, share)
            solution = _choose_cheaper(rows, solution, pairs, about)
    for smallest in sorted(solution.state.fittings, key=lambda fitting: abs(fitting.volume_m3)):
        rest = tuple(f for f in solution.state.fittings if f.volume_m3 != smallest.volume_m3)
        solution = _choose_cheaper(rows, solution, rest, about)
    return solution


def drop_insignificant_fittings(rows, solution, quantum_m3):
    """Return the Fit without fittings whose volume does not exceed its uncertainty."""
    solution = drop_phantom_fittings(rows, solution, quantum_m3)
    while solution.state.fittings:
        sizes = _sizes(rows, solution, quantum_m3)
        worst = int(np.argmin(sizes))
        again = try_fit(rows, _drop_fitting(solution.state, worst))
        rise = np.inf if again is None else again.chi2 - solution.chi2
        limit = 2 * LEAST_GAIN if sizes[worst] < CRITICAL else LEAST_GAIN
        if limit < rise < DOUBTFUL_GAIN and quantum_m3 > 0:
            limit = MARGIN * _gain_by_chance(again, rows, quantum_m3)
        if rise > limit:
            break
        solution = again
    return solution


def drop_phantom_fittings(rows, solution, quantum_m3):
    """Return the Fit without fittings whose u exceeds their volume.

    They are removed even if they explain residuals, which are then reported as excess residuals.
    Free seams can leave such fittings when they replace a kink.
    """
    while solution.state.fittings:
        sizes = _sizes(rows, solution, quantum_m3)
        worst = int(np.argmin(sizes))
        if sizes[worst] >= 1:
            break
        bare = _drop_fitting(solution.state, worst)
        held = replace(bare, free=bare.free - {"kinks", "zero"})
        again = try_fit(rows, bare) or try_fit(rows, held)
        if again is None:
            break
        solution = again
    return solution


def _sizes(rows, solution, quantum_m3):
    """Volumes of fittings over their u, shape (fittings,); 0 if u is unknown."""
    scale = u_factors(solution, rows, quantum_m3)[solution.state.layout["fittings"]]
    sds = (solution.sd("fittings") * scale)[2::3]
    sizes = np.abs([fitting.volume_m3 for fitting in solution.state.fittings]) / sds
    return np.nan_to_num(sizes, nan=0.0)


def _gain_by_chance(solution, rows, quantum):
    """Largest reduction of chi2 by a fitting in simulations of correlated rounding."""
    # Residuals of simulated rounding: (1 - q q') e, as the adjustment absorbs the part in q.
    q = np.linalg.qr(solution.design / rows.sd_m3[:, None])[0]
    gains = []
    for error in simulate_rounding(solution, rows, quantum, CHANCES):
        left = error / rows.sd_m3
        left = (left - q @ (q.T @ left)) * rows.sd_m3
        best = find_fittings(rows.dip_m, left, solution.design, rows.sd_m3, most=1)
        gains.append(best[0][1] if best else 0.0)
    return max(gains)


def _choose_cheaper(rows, solution, fittings, about):
    if len(fittings) > len(solution.state.fittings):
        return solution
    candidate = _fit_free_zero(rows, replace(solution.state, fittings=fittings), about)
    return candidate if candidate and _cost(candidate) < _cost(solution) else solution


def _is_possible(solution):
    state = solution.state
    cut = np.pi * state.radii_m[0] ** 2
    largest = LOW_SHARE * cut
    return abs(state.zero_m) <= FARTHEST_M and all(
        fitting.bottom_m < fitting.top_m
        and -TAKEN_SHARE * cut
        < fitting.volume_m3 / (fitting.top_m - fitting.bottom_m)
        < GIVEN_SHARE * cut
        and (
            fitting.bottom_m > state.lowest_m + LOW_M
            or abs(fitting.volume_m3) < largest * (fitting.top_m - fitting.bottom_m)
        )
        for fitting in state.fittings
    )


def _fit_free_zero(rows, state, about):
    """Return the Fit with a free zero if it stays near, and with fittings at estimated positions.

    If that fails, the zero is fixed, or the fittings keep their start positions; None if all fail.
    """
    things = {"kinks"} if state.fittings else set()
    zero = {"zero"} if len(state.seams_m) and "seams" not in state.free else set()
    held = state.free - {"zero", "kinks"}
    for free in dict.fromkeys(
        map(frozenset, (held | things | zero, held | things, held | zero, held))
    ):
        start = state if "zero" in free else replace(state, zero_m=about)
        again = try_fit(rows, replace(start, free=free))
        if again and _is_possible(again) and abs(again.state.zero_m - about) <= NEAR_M:
            return again
    return None
