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
from tankcal.recalibration.bulges import no_bulges, show_bulges
from tankcal.recalibration.fittings import find_fittings, in_other_pairs
from tankcal.recalibration.rounding import ROUGH, roughness, rounded_again, scale_of_u
from tankcal.recalibration.table_fit import DENSITY_SD_KG_M3, tried
from tankcal.recalibration.zero import FARTHEST_M, find_zeros, move_seams

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

    Returns
    -------
    Fit

    Raises
    ------
    SolutionError
        If the rows do not determine the radii.
    """
    edges = state.rings.edges_m
    shows_bulges = show_bulges(rows.dip_m, rows.volume_m3, rows.sd_m3, edges)
    if shows_bulges:
        found = _search_bulged(rows, state, lowest_m, *usual_density)
        if found is not None and not _is_straight(rows, found):
            return found
    found = _search_straight(rows, state, lowest_m)
    if shows_bulges or _is_plain(found) or _is_by_rounding(found):
        return found
    # In a coarse table, bulges look like many fittings, or like fittings that end at joints.
    bulged = _search_bulged(rows, state, lowest_m, *usual_density)
    is_simpler = bulged is not None and (
        len(bulged.state.fittings) < len(found.state.fittings) and _cost(bulged) < _cost(found)
    )
    return bulged if is_simpler else found


def _search_straight(rows, state, lowest_m):
    """Return the Fit of straight courses; the arguments are those of `search`."""
    if lowest_m is not None:
        rows = rows.above(lowest_m)
        return _with_moved_seams(rows, _with_fittings(rows, state))
    lowest = _lowest_row(rows, state)
    found = _with_moved_seams(rows.above(lowest), _with_fittings(rows.above(lowest), state))
    if lowest > rows.dip_m[0]:
        more = replace(found.state, lowest_m=float(rows.dip_m[0]))
        try:
            whole = _with_fittings(rows, more, at_most=len(found.state.fittings) + 1)
        except SolutionError:
            return found
        if _is_by_rounding(whole) and _is_enough(rows, found, whole):
            return whole
    return found


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
    some = rows.above(lowest).thinned(MOST_BULGED_ROWS)
    best = None
    for zero in USUAL_ZEROS_M:
        other = _with_free_zero(some.above(zero + NEAR_M), replace(start, zero_m=zero), zero)
        if other and (best is None or _cost(other) < _cost(best) - LEAST_GAIN):
            best = other
    if best is None:
        return None
    about = best.state.zero_m
    some = some.above(best.state.lowest_m)
    while len(best.state.fittings) < MOST_FITTINGS:
        again = _with_one_more(some, best, LONGEST_BULGED_M, about, rough=True)
        if again is None:
            break
        best = again
    best = tried(rows.above(max(lowest, best.state.lowest_m)), _without_unsure(some, best).state)
    return best and _with_lower_rows(rows.above(lowest), best)


def _is_straight(rows, found):
    """Whether straight courses with the same fittings fit as well as profiles."""
    state = replace(
        found.state,
        bulges_m=None,
        usual_density_kg_m3=None,
        density_sd_kg_m3=DENSITY_SD_KG_M3,
    )
    rows = rows.above(found.state.lowest_m)
    free_zero = replace(state, free=state.free | {"zero"})  # profiles absorb an error of the zero
    tries = (tried(rows, one) for one in (state, free_zero))
    return any(one is not None and one.chi2 < found.cost + PRICE for one in tries)


def _without_unsure(rows, found):
    """Return the Fit without insignificant fittings, where courses bulge."""
    while found.state.fittings:
        sds = found.sd("fittings")[2::3] * roughness(found, rows)
        sizes = np.abs([one.volume_m3 for one in found.state.fittings]) / np.maximum(sds, 1e-12)
        worst = int(np.argmin(sizes))
        rest = found.state.fittings[:worst] + found.state.fittings[worst + 1 :]
        again = tried(rows, replace(found.state, fittings=rest))
        if sizes[worst] >= SURE_OF_BULGED or again is None:
            break
        found = again
    return found


def _is_of_joint(state, thing):
    """Whether a fitting adds volume, or resembles plates drawn in at a joint."""
    joints = state.rings.edges_m
    ends = np.array([[thing.bottom_m], [thing.top_m]])
    girth = 2 * np.pi * float(state.radii_m[0])
    thickness = -thing.volume_m3 / (girth * max(thing.top_m - thing.bottom_m, 1e-9))
    is_near = bool(np.any(np.abs(ends - joints) < JOINT_M))
    return thickness <= 0 or (is_near and thickness < DRAWN_IN_M)


def _with_moved_seams(rows, found):
    """Return the Fit with seams from the rows, if this removes fittings that resemble seams."""
    if _is_plain(found) or not len(found.state.seams_m):
        return found
    zero = found.state.zero_m
    edges = found.state.rings.edges_m[1:-1]
    moved = move_seams(rows.dip_m, rows.volume_m3, rows.sd_m3, edges) - zero
    if np.any(np.diff(moved) <= 0):
        return found
    state = replace(found.state, seams_m=moved, fittings=(), free=frozenset(SEAMS_FREE))
    other = _from_zero(rows.above(zero + NEAR_M), state, MOST_FITTINGS)
    price = LEAST_GAIN * len(moved) / 2
    is_better = other is not None and _cost(other) + price < _cost(found)
    return _with_lower_rows(rows, other) if is_better else found


def _is_enough(rows, found, whole):
    """Whether the reduction of chi2 is large for the number of new unknowns."""
    return len(rows.dip_m) - len(found.left_m3) > 10 * (
        len(whole.state.unknowns) - len(found.state.unknowns)
    )


def _is_by_rounding(found):
    """Whether all residuals are within rounding: as a whole, and at the worst row."""
    worst = np.abs(found.left_m3 / found.sd_m3).max()
    return found.chi2 < ROUGH**2 * max(found.dof, 1) and worst < np.sqrt(3) * 1.25


def _lowest_row(rows, state, degree=2):
    """Lowest dip above the highest point of the bottom: rows from there on fit one cross section.

    The result is the lowest row of the first ring above which a polynomial leaves only rounding.
    Its degree is 2, or higher for bulging courses.
    """
    first = rows.dip_m <= state.seams_m[0] - EDGE_M if len(state.seams_m) else rows.dip_m >= 0
    ring = rows.of(first)
    length = max(CUT_M, CUT_ROWS * float(np.median(np.diff(rows.dip_m))))
    tries = np.flatnonzero(ring.dip_m <= ring.dip_m[-1] - length) if len(ring.dip_m) else ()
    if len(tries) == 0:
        return float(rows.dip_m[0])
    for place in [int(tries[0]), *_halving(tries)]:
        dip = ring.dip_m[place]
        window = ring.of((ring.dip_m >= dip) & (ring.dip_m <= dip + length + 1e-9))
        if _is_one_cut(window, degree):
            return float(dip)
    return float(rows.dip_m[0])


def _halving(tries):
    """At most BOTTOM_TRIES of the rows, rising, closer together near the bottom."""
    last = len(tries) - 1
    places = np.round(last * np.linspace(0, 1, BOTTOM_TRIES) ** 1.5).astype(int)
    return tries[np.unique(places)]


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


def _with_fittings(rows, state, at_most=MOST_FITTINGS):
    """Return the Fit with the fittings in the rows, for the zero that needs the fewest of them.

    With a wrong zero, seams resemble fittings. Other zeros are therefore tried if there are many
    fittings, or if the fittings do not explain the rows.
    """
    zeros = find_zeros(rows.dip_m, rows.volume_m3, rows.sd_m3, state.seams_m)
    best, tried = None, 0
    for zero in (state.zero_m,) if state.fittings else (zeros[0], *USUAL_ZEROS_M, *zeros[1:]):
        most = at_most if best is None else min(at_most, _most_fittings(best))
        other = _from_zero(rows.above(zero + NEAR_M), replace(state, zero_m=zero), most)
        if other and (best is None or _cost(other) < _cost(best) - SAME_COST):
            best = other
        if best and _is_plain(best) and _is_by_rounding(best):
            break
        tried += other is None or len(other.state.fittings) >= at_most
        if tried > 1:
            break
    if best is None:
        raise SolutionError(
            message("former_undetermined", "the rows of the table do not determine the radii")
        )
    if len(best.state.fittings) > FEW_FITTINGS and not _is_by_rounding(best):
        bare = replace(
            best.state, fittings=()
        )  # fittings of unlimited height also explain other effects
        best = _with_free_zero(rows.above(best.state.lowest_m), bare, bare.zero_m) or best
    return _with_lower_rows(rows, best)


def _with_lower_rows(rows, found):
    """Return the Fit with rows that were excluded because the first ring might begin among them."""
    more = len(rows.dip_m) - len(found.left_m3)
    for lowest in rows.dip_m[:more]:
        chosen = rows.above(lowest)
        again = tried(chosen, replace(found.state, base_m3=float(chosen.volume_m3[0])))
        if again and _is_possible(again):
            gain = again.chi2 - found.chi2
            if gain < len(chosen.dip_m) - len(found.left_m3) + SAME_ZERO**2:
                return again
    return found


def _most_fittings(best):
    """Largest number of fittings with which another Fit may cost less."""
    return max(int((_cost(best) - LEAST_CHI2 * best.dof) / PRICE), 0)


def _is_plain(found):
    """Whether there are few fittings, and none resembles a seam of a wrong zero."""
    seams = found.state.rings.edges_m[1:-1]
    return len(found.state.fittings) <= FEW_FITTINGS and all(
        one.volume_m3 < 0
        and one.top_m - one.bottom_m < LENGTHS_M[0]
        and not np.any(np.abs(seams - one.bottom_m) < NEAR_M)
        and not np.any(np.abs(seams - one.top_m) < NEAR_M)
        for one in found.state.fittings
    )


def _cost(found):
    return found.cost + PRICE * len(found.state.fittings)


def _from_zero(rows, start, at_most):
    """Return the Fit with fittings and the zero free about its start value, or None.

    Low fittings are sought first: two kinks of two fittings, one above the other, resemble one
    fitting.
    """
    about = start.zero_m
    found = _with_free_zero(rows, start, about)
    for longest in LENGTHS_M if found else ():
        while len(found.state.fittings) < at_most and found.dof > 6:
            again = _with_one_more(rows, found, longest, about)
            if again is None:
                break
            found = again
    return _tidied(rows, found, about) if found else None


def _with_one_more(rows, found, longest, about, rough=False):
    """Return the Fit with the fitting that explains most; None if no fitting explains enough.

    rough: whether residuals exceed rounding; the required gain is then relative to the residuals.
    """
    design, left, sds = (
        found.bulges
    )  # prior observations do not depend on a fitting: place them at the lowest row
    candidates = find_fittings(
        np.append(np.full(len(sds), rows.dip_m[0]), rows.dip_m),
        np.append(left, found.left_m3),
        np.vstack([design, found.design]),
        np.append(sds, rows.sd_m3),
        longest,
    )
    for thing, gain in candidates:
        if gain < LEAST_GAIN:
            break
        more = replace(found.state, fittings=(*found.state.fittings, thing))
        again = _with_free_zero(rows, more, about)
        factor = roughness(again, rows) ** 2 if rough and again else 1.0
        if (
            again
            and found.cost - again.cost > LEAST_GAIN * factor
            and _is_large(rows, again.state.fittings[-1])
            and not (rough and _is_of_joint(again.state, again.state.fittings[-1]))
        ):
            return again
    return None


def _is_large(rows, thing):
    """Whether a fitting is larger than the effect of two rounded digits."""
    return abs(thing.volume_m3) > LEAST_SIZE * np.sqrt(12) * float(np.median(rows.sd_m3))


def _tidied(rows, found, about):
    """Return the Fit with fewer fittings, if fewer fit equally well."""
    if len(found.state.fittings) > 1:
        near = 1.6 * float(np.median(np.diff(rows.dip_m)))
        for share in SAME_SLOPES:
            pairs = in_other_pairs(found.state.fittings, near, share)
            found = _cheaper(rows, found, pairs, about)
    for one in sorted(found.state.fittings, key=lambda one: abs(one.volume_m3)):
        rest = tuple(f for f in found.state.fittings if f.volume_m3 != one.volume_m3)
        found = _cheaper(rows, found, rest, about)
    return found


def with_sure_fittings(rows, found, quantum_m3):
    """Return the Fit without fittings whose volume does not exceed its uncertainty."""
    found = without_phantoms(rows, found, quantum_m3)
    while found.state.fittings:
        things = found.state.fittings
        sizes = _sizes(rows, found, quantum_m3)
        worst = int(np.argmin(sizes))
        rest = things[:worst] + things[worst + 1 :]
        again = tried(rows, replace(found.state, fittings=rest))
        rise = np.inf if again is None else again.chi2 - found.chi2
        limit = 2 * LEAST_GAIN if sizes[worst] < CRITICAL else LEAST_GAIN
        if limit < rise < DOUBTFUL_GAIN and quantum_m3 > 0:
            limit = MARGIN * _gain_by_chance(again, rows, quantum_m3)
        if rise > limit:
            break
        found = again
    return found


def without_phantoms(rows, found, quantum_m3):
    """Return the Fit without fittings whose u exceeds their volume.

    They are removed even if they explain residuals, which are then reported as excess residuals.
    Free seams can leave such fittings when they replace a kink.
    """
    while found.state.fittings:
        sizes = _sizes(rows, found, quantum_m3)
        worst = int(np.argmin(sizes))
        if sizes[worst] >= 1:
            break
        things = found.state.fittings
        bare = replace(found.state, fittings=things[:worst] + things[worst + 1 :])
        held = replace(bare, free=bare.free - {"kinks", "zero"})
        again = tried(rows, bare) or tried(rows, held)
        if again is None:
            break
        found = again
    return found


def _sizes(rows, found, quantum_m3):
    """Volumes of fittings over their u, shape (fittings,); 0 if u is unknown."""
    scale = scale_of_u(found, rows, quantum_m3)[found.state.layout["fittings"]]
    sds = (found.sd("fittings") * scale)[2::3]
    sizes = np.abs([one.volume_m3 for one in found.state.fittings]) / sds
    return np.nan_to_num(sizes, nan=0.0)


def _gain_by_chance(found, rows, quantum):
    """Largest reduction of chi2 by a fitting in simulations of correlated rounding."""
    q = np.linalg.qr(found.design / rows.sd_m3[:, None])[0]
    gains = []
    for error in rounded_again(found, rows, quantum, CHANCES):
        left = error / rows.sd_m3
        left = (left - q @ (q.T @ left)) * rows.sd_m3
        best = find_fittings(rows.dip_m, left, found.design, rows.sd_m3, most=1)
        gains.append(best[0][1] if best else 0.0)
    return max(gains)


def _cheaper(rows, found, fittings, about):
    if len(fittings) > len(found.state.fittings):
        return found
    other = _with_free_zero(rows, replace(found.state, fittings=fittings), about)
    return other if other and _cost(other) < _cost(found) else found


def _is_possible(found):
    state = found.state
    cut = np.pi * state.radii_m[0] ** 2
    largest = LOW_SHARE * cut
    return abs(state.zero_m) <= FARTHEST_M and all(
        one.bottom_m < one.top_m
        and -TAKEN_SHARE * cut < one.volume_m3 / (one.top_m - one.bottom_m) < GIVEN_SHARE * cut
        and (
            one.bottom_m > state.lowest_m + LOW_M
            or abs(one.volume_m3) < largest * (one.top_m - one.bottom_m)
        )
        for one in state.fittings
    )


def _with_free_zero(rows, state, about):
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
        again = tried(rows, replace(start, free=free))
        if again and _is_possible(again) and abs(again.state.zero_m - about) <= NEAR_M:
            return again
    return None
