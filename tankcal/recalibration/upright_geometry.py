"""The geometry of an upright tank out of its capacity table.

Rows below the highest point of the bottom, and those of a roof's critical zone, are left out; the
others are adjusted (`table_fit.fit`). What stands in the tank is looked for as pairs of kinks
(`fittings.find_fittings`), one after the other, until none explains more than rounding does by
chance. Then the table is asked whether it has a head, where its zero is, and whether the seams are
where they were declared to be.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.recalibration.fittings import find_fittings, in_other_pairs
from tankcal.recalibration.table_fit import State, fit, held_kinks
from tankcal.recalibration.zero import FARTHEST_M, find_zeros, move_seams

STEEL_PA = 206e9
SEAMS_FREE = "base", "density", "seams"
LEAST_GAIN = 25.0  # of chi2 by a thing: less is what the best of all pairs gains by chance
MOST_FITTINGS, FEW_FITTINGS = 12, 4
SAME_COST = 1.0
LENGTHS_M = 1.0, 3.0, np.inf  # of things, in the order in which they are looked for
START_DENSITY_KG_M3 = 500.0
USUAL_KG_M3 = 450.0, 450.0  # of a head that a table cannot tell: about this, with this sd
DECLARED_SD_KG_M3 = 10.0
LIQUID_KG_M3 = 500.0  # a head that a table could not have shown of any liquid is undecided
ROUGH = 1.15  # rms over what rounding leaves: above it, rows have more in them than rounding
USUAL_ZEROS_M = 0.0, -0.04, 0.04  # that are tried, too, where things are many
NEAR_M = 0.025  # that the zero may go from where it was looked for
FEWEST_ROWS = 3  # of a ring
SAME_ZERO = 3.0  # standard deviations
BY_ORDER = 1.0  # of chi2, by which the head of second order has to fit better
ORDER_IS_CLEAR = 9.0
CUT_M, CUT_ROWS = 0.4, 9  # of the rows that have to be of one cut, so that the bottom is below
BOTTOM_TRIES = 60
LOW_M, LOW_SHARE = 0.15, 0.2  # things lower than this take no more of the cut: that is the bottom
EDGE_M = 0.1  # below the first seam: where rows of the first ring end, the zero being unknown


@dataclass(frozen=True)
class Reading:
    """A value that was read out of a table, and what rounding leaves uncertain of it (standard)."""

    value: float
    u: float


@dataclass(frozen=True)
class FoundFitting:
    """A thing that the table has deducted, or added.

    Attributes
    ----------
    bottom_m, top_m, volume_m3 : Reading
        Dips; u is nan where the end is beyond the rows that were used.
    """

    bottom_m: Reading
    top_m: Reading
    volume_m3: Reading


@dataclass(frozen=True)
class UprightGeometry:
    """What a table says of its tank.

    Attributes
    ----------
    name : str
        Of the table.
    radii_m, u_m : ndarray, shape (n,)
        Inside, of the empty shell, at the table's temperature; u by rounding alone.
    covariance_m2 : ndarray, shape (n, n)
        Of the radii.
    heights_m, thickness_m : ndarray, shape (n,)
        Of the rings that the table reaches.
    zero_m : Reading
        Dip of the bottom of the first ring; u is 0 where the table is empty at its zero and begins
        there, nan where that cannot be told because the seams are found, too.
    seams_m : tuple of Reading
        Dips of the seams, each looked for by itself; u is large where nothing jumps there.
    seams_are : {"declared", "found"}
        Which of them the radii are for.
    density_kg_m3 : Reading
    head : {"with", "without", "undecided"}
    t : float
        Density over its u.
    fittings : tuple of FoundFitting
    roof_m3 : Reading or None
        What a declared roof takes above its critical zone; negative.
    base_m3 : Reading
        Volume at `lowest_m`, the lowest row that is used.
    lowest_m : float
    used : ndarray of bool, shape (rows,)
    left_m3 : ndarray, shape (rows,)
        Table less what was read, at each row.
    rms_m3, largest_m3, expected_m3 : float
        Of the rows that are used; what rounding would leave.
    without_head : (rms, largest, radii) or None
        Of the same with the head left out: m3, m3, (n,) m.
    roughness : float
        What u was multiplied by because rows have more in them than rounding; 1: nothing.
    state : State
        All of it, as a function of the dip.
    """

    name: str
    radii_m: np.ndarray
    u_m: np.ndarray
    covariance_m2: np.ndarray
    heights_m: np.ndarray
    thickness_m: np.ndarray
    zero_m: Reading
    seams_m: tuple[Reading, ...]
    seams_are: str
    density_kg_m3: Reading
    head: str
    t: float
    fittings: tuple[FoundFitting, ...]
    roof_m3: Reading | None
    base_m3: Reading
    lowest_m: float
    used: np.ndarray
    left_m3: np.ndarray
    rms_m3: float
    largest_m3: float
    expected_m3: float
    without_head: tuple[float, float, np.ndarray] | None
    roughness: float
    state: State


@dataclass(frozen=True)
class _Rows:
    """The rows of a table that are used."""

    dip_m: np.ndarray
    volume_m3: np.ndarray
    sd_m3: np.ndarray

    def above(self, dip_m):
        return self._of(self.dip_m >= dip_m - 1e-9)

    def _of(self, mask):
        return _Rows(self.dip_m[mask], self.volume_m3[mask], self.sd_m3[mask])

    def adjust(self, state):
        lowest, highest = float(self.dip_m[0]), float(self.dip_m[-1])
        state = replace(state, lowest_m=lowest, highest_m=highest)
        return fit(state, self.dip_m, self.volume_m3, self.sd_m3)


def read_upright(
    former,
    heights_m,
    thickness_m,
    *,
    modulus_pa=STEEL_PA,
    known=(),
    lowest_m=None,
    seams_known=True,
):
    """Radii, density of the head, zero, things in the tank: out of a table.

    Parameters
    ----------
    former : FormerTable
    heights_m, thickness_m : array_like, shape (n,)
        Of the rings, from the bottom up; all must be reached by the table.
    modulus_pa : float
    known : sequence of Fitting
        Things that are known to be in the table, in its dips: taken out first.
    lowest_m : float, optional
        Dip of the highest point of the bottom; None: found.
    seams_known : bool
        False: `heights_m` are start values only.

    Returns
    -------
    UprightGeometry

    Raises
    ------
    SolutionError
        When rows are too few, or do not determine the radii.
    """
    heights, plates = np.asarray(heights_m, float), np.asarray(thickness_m, float)
    volume = former.volume_m3 - sum((one.volume_below_m3(former.height_m) for one in known), 0.0)
    rows = _Rows(former.height_m, volume, sd_of_rows(former))
    zone = former.roof.critical_m if former.roof else None
    used = np.ones(len(volume), dtype=bool)
    if zone is not None:
        used = (rows.dip_m < zone[0]) | (rows.dip_m > zone[1])
    empty = rows.volume_m3 <= 0
    if np.count_nonzero(empty) > 1:  # dips below the bottom
        used &= ~empty
    usable = rows._of(used)
    state = _start(usable, heights, plates, modulus_pa, zone)
    found = _search(usable, state, lowest_m)
    used &= rows.dip_m >= found.state.lowest_m - 1e-9
    return _geometry(former, found, rows, used, seams_known)


def sd_of_rows(former):
    """(rows,) standard deviations of a table's volumes by its last digits.

    Dips of an even step are what the table was made for; others were rounded, too.
    """
    dips, volumes = former.height_m, former.volume_m3
    finest = 1e-7 + 1e-12 * float(np.abs(volumes).max())
    own = max(former.volume_quantum_m3, finest) / np.sqrt(12)
    if former.height_rounding_m is None:
        return np.full(len(dips), own)
    return np.hypot(own, np.gradient(volumes, dips) * former.height_rounding_m / np.sqrt(3))


def _start(rows, heights, plates, modulus, zone):
    """The State before anything is adjusted: radii by the mean area of each ring."""
    edges = np.concatenate([[0.0], np.cumsum(heights)])
    radii = np.zeros(len(heights))
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


def _search(rows, state, lowest_m):
    """The Fit of all that is found in the rows."""
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


def _with_moved_seams(rows, found):
    """The Fit with seams where the rows show them, if that spares things that look like seams."""
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
    """Whether rows far more than their new unknowns are explained by these."""
    return len(rows.dip_m) - len(found.left_m3) > 10 * (
        len(whole.state.unknowns) - len(found.state.unknowns)
    )


def _is_by_rounding(found):
    """Whether nothing is left but rounding: as a whole, and at the worst row."""
    worst = np.abs(found.left_m3 / found.sd_m3).max()
    return found.chi2 < ROUGH**2 * max(found.dof, 1) and worst < np.sqrt(3) * 1.25


def _lowest_row(rows, state):
    """Dip from which on rows are those of one cut: above the highest point of the bottom.

    The lowest row of the first ring above which a parabola leaves nothing but rounding.
    """
    first = rows.dip_m <= state.seams_m[0] - EDGE_M if len(state.seams_m) else rows.dip_m >= 0
    ring = rows._of(first)
    length = max(CUT_M, CUT_ROWS * float(np.median(np.diff(rows.dip_m))))
    tries = np.flatnonzero(ring.dip_m <= ring.dip_m[-1] - length) if len(ring.dip_m) else ()
    if len(tries) == 0:
        return float(rows.dip_m[0])
    for place in [int(tries[0]), *_halving(tries)]:
        dip = ring.dip_m[place]
        window = ring._of((ring.dip_m >= dip) & (ring.dip_m <= dip + length + 1e-9))
        if _is_one_cut(window):
            return float(dip)
    return float(rows.dip_m[0])


def _halving(tries):
    """At most BOTTOM_TRIES of the rows, rising; closer together at the bottom."""
    last = len(tries) - 1
    places = np.round(last * np.linspace(0, 1, BOTTOM_TRIES) ** 1.5).astype(int)
    return tries[np.unique(places)]


def _is_one_cut(ring):
    """Whether a parabola leaves no more than rounding of rows."""
    if len(ring.dip_m) < 5:
        return False
    x = (ring.dip_m - ring.dip_m[0]) / (ring.dip_m[-1] - ring.dip_m[0])
    basis = np.vander(x, 3) / ring.sd_m3[:, None]
    value = (ring.volume_m3 - ring.volume_m3[0]) / ring.sd_m3
    left = value - basis @ np.linalg.lstsq(basis, value, rcond=None)[0]
    dof = len(x) - 3
    is_rounding = np.abs(left).max() < np.sqrt(3) * 1.25
    lower = left[: max(len(left) // 4, 2)]  # a bottom shows here first
    return (
        is_rounding
        and left @ left < dof + 4 * np.sqrt(dof)
        and abs(lower.sum()) < 4 * np.sqrt(len(lower))
    )


def _with_fittings(rows, state, at_most=MOST_FITTINGS):
    """The Fit with the things that the rows show, from the zero that needs the fewest of them.

    A zero that is far off lets seams look like things, so that others are tried where things are
    many, or do not explain the rows.
    """
    zeros = find_zeros(rows.dip_m, rows.volume_m3, rows.sd_m3, state.seams_m)
    best, tried = None, 0
    for zero in (state.zero_m,) if state.fittings else (zeros[0], *USUAL_ZEROS_M, *zeros[1:]):
        other = _from_zero(rows.above(zero + NEAR_M), replace(state, zero_m=zero), at_most)
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
        bare = replace(best.state, fittings=())  # things without end explain what is not their own
        best = _with_free_zero(rows.above(best.state.lowest_m), bare, bare.zero_m) or best
    return _with_lower_rows(rows, best)


def _with_lower_rows(rows, found):
    """The Fit with rows that were left out because the first ring might have begun among them."""
    more = len(rows.dip_m) - len(found.left_m3)
    for lowest in rows.dip_m[:more]:
        chosen = rows.above(lowest)
        again = _tried(chosen, replace(found.state, base_m3=float(chosen.volume_m3[0])))
        if again and _is_possible(again):
            gain = again.chi2 - found.chi2
            if gain < len(chosen.dip_m) - len(found.left_m3) + SAME_ZERO**2:
                return again
    return found


def _is_plain(found):
    """Whether its things are few, and none of them what seams look like from a wrong zero."""
    seams = found.state.rings.edges_m[1:-1]
    return len(found.state.fittings) <= FEW_FITTINGS and all(
        one.volume_m3 < 0
        and one.top_m - one.bottom_m < LENGTHS_M[0]
        and not np.any(np.abs(seams - one.bottom_m) < NEAR_M)
        and not np.any(np.abs(seams - one.top_m) < NEAR_M)
        for one in found.state.fittings
    )


def _cost(found):
    return found.chi2 + LEAST_GAIN * len(found.state.fittings)


def _from_zero(rows, start, at_most):
    """The Fit with things, the zero free about where it starts; None where rows do not do.

    Short things first: two kinks of two things, one above the other, look like one thing.
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


def _with_one_more(rows, found, longest, about):
    """The Fit with the thing that explains most; None where none explains enough."""
    candidates = find_fittings(rows.dip_m, found.left_m3, found.design, rows.sd_m3, longest)
    for thing, gain in candidates:
        if gain < LEAST_GAIN:
            break
        more = replace(found.state, fittings=(*found.state.fittings, thing))
        again = _with_free_zero(rows, more, about)
        if again and found.chi2 - again.chi2 > LEAST_GAIN:
            return again
    return None


def _tidied(rows, found, about):
    """The Fit with fewer things, where fewer explain the rows as well."""
    if len(found.state.fittings) > 1:
        near = 1.6 * float(np.median(np.diff(rows.dip_m)))
        pairs = in_other_pairs(found.state.fittings, near)
        found = _cheaper(rows, found, pairs, about)
    for one in sorted(found.state.fittings, key=lambda one: abs(one.volume_m3)):
        rest = tuple(f for f in found.state.fittings if f.volume_m3 != one.volume_m3)
        found = _cheaper(rows, found, rest, about)
    return found


def _with_sure_fittings(rows, found):
    """The Fit without things whose volume is no more than its uncertainty, the least sure first."""
    while found.state.fittings:
        things = found.state.fittings
        sizes = np.abs([one.volume_m3 for one in things]) / found.sd("fittings")[2::3]
        worst = int(np.argmin(sizes))
        if sizes[worst] > CRITICAL:
            break
        rest = things[:worst] + things[worst + 1 :]
        again = _tried(rows, replace(found.state, fittings=rest))
        if again is None:
            break
        found = again
    return found


def _cheaper(rows, found, fittings, about):
    if len(fittings) > len(found.state.fittings):
        return found
    other = _with_free_zero(rows, replace(found.state, fittings=fittings), about)
    return other if other and _cost(other) < _cost(found) else found


def _is_possible(found):
    state = found.state
    largest = LOW_SHARE * np.pi * state.radii_m[0] ** 2
    return abs(state.zero_m) <= FARTHEST_M and all(
        one.bottom_m < one.top_m
        and (
            one.bottom_m > state.lowest_m + LOW_M
            or abs(one.volume_m3) < largest * (one.top_m - one.bottom_m)
        )
        for one in state.fittings
    )


def _with_free_zero(rows, state, about):
    """The Fit with the zero free where it stays near, and with things where they are found to be.

    Where that fails, the zero is held, or things where they were looked for; None: all fails.
    """
    things = {"kinks"} if state.fittings else set()
    zero = {"zero"} if len(state.seams_m) and "seams" not in state.free else set()
    held = state.free - {"zero", "kinks"}
    for free in dict.fromkeys(
        map(frozenset, (held | things | zero, held | things, held | zero, held))
    ):
        start = state if "zero" in free else replace(state, zero_m=about)
        again = _tried(rows, replace(start, free=free))
        if again and _is_possible(again) and abs(again.state.zero_m - about) <= NEAR_M:
            return again
    return None


def _tried(rows, state):
    """The Fit, or None where the rows do not determine it."""
    try:
        return rows.adjust(state)
    except SolutionError:
        return None


def _geometry(former, found, rows, used, seams_known):
    chosen = rows._of(used)
    found = _with_sure_fittings(chosen, _with_known_zero(chosen, former, found))
    found, other = _with_order(chosen, found)
    seams = found if "seams" in found.state.free else _free_seams(chosen, found)
    if seams is not None and (not seams_known or _are_elsewhere(found, seams)):
        found = seams
    seams_are = "found" if "seams" in found.state.free else "declared"
    roughness = _roughness(chosen, found)
    u_density = float(np.hypot(found.sd("density")[0] * roughness, _by_order(found, other)[0]))
    t = found.state.density_kg_m3 / u_density
    head, without = _decide_head(t, u_density), None
    density = Reading(found.state.density_kg_m3, u_density)
    dry = _without_head(chosen, found)
    if head == "undecided":
        found, other = _with_usual_density(chosen, former, found), None
    if head == "without":
        found, other, roughness = dry, None, _roughness(chosen, dry)
    else:
        without = (*_remainders(dry.left_m3), dry.state.radii_m)
    return _as_geometry(
        former, found, rows, used,
        roughness=roughness, density=density, head=head, t=t, without=without, seams=seams,
        seams_are=seams_are, by_order=_by_order(found, other)[1],
    )  # fmt: skip


def _with_order(rows, found):
    """The Fit with the head of the order that leaves less, and that of the other one.

    The first order where both do as well; the other is None where it is clearly worse.
    """
    try:
        second = rows.adjust(replace(found.state, is_first_order=False))
    except SolutionError:
        return found, None
    better = found.chi2 - second.chi2
    first, last = (second, found) if better > BY_ORDER else (found, second)
    return first, last if abs(better) < ORDER_IS_CLEAR else None


def _by_order(found, other):
    """(sd of density, (n,) of radii) because the order of the head is not known."""
    if other is None:
        return 0.0, np.zeros(len(found.state.radii_m))
    density = abs(found.state.density_kg_m3 - other.state.density_kg_m3)
    return density / np.sqrt(3), (found.state.radii_m - other.state.radii_m) / np.sqrt(3)


def _with_known_zero(rows, former, found):
    """The Fit with an empty tank at dip 0, the bottom of the first ring: when nothing says no."""
    if not (rows.dip_m[0] == 0 and rows.volume_m3[0] == 0) or former.volume_quantum_m3 == 0:
        return found
    free = found.state.free - {"zero", "base"}
    try:
        held = rows.adjust(replace(found.state, zero_m=0.0, base_m3=0.0, free=free))
    except SolutionError:
        return found
    return held if held.chi2 - found.chi2 < SAME_ZERO**2 + 2 else found


def _free_seams(rows, found):
    """The Fit with each seam where it is found by itself; None where that fails."""
    if not len(found.state.seams_m):
        return None
    free = (found.state.free | {"seams"}) - {"zero"}
    try:
        seams = rows.adjust(replace(found.state, free=free))
    except SolutionError:
        return None
    return seams if np.all(np.diff(seams.state.rings.edges_m) > 0) else None


def _are_elsewhere(found, seams):
    """Whether seams are not where they were declared: one of them clearly, or all by chi2."""
    apart = np.abs(seams.state.seams_m - found.state.seams_m)
    count = len(apart)
    return bool(np.any(apart > CRITICAL * seams.sd("seams"))) and (
        found.chi2 - seams.chi2 > LEAST_GAIN + count
    )


def _without_head(rows, found):
    """The Fit of the same with the head left out."""
    free = found.state.free - {"density"}
    dry = replace(found.state, density_kg_m3=0.0, free=free)
    tried = _tried(rows, dry) or _tried(rows, replace(dry, free=free - {"kinks"}))
    return tried or rows.adjust(replace(dry, free=free - {"kinks", "zero"}))


def _with_usual_density(rows, former, found):
    """The Fit with the declared density, or that of some liquid or none: the table cannot tell."""
    usual, sd = USUAL_KG_M3
    if former.liquid_density_kg_m3 is not None:
        usual, sd = former.liquid_density_kg_m3, DECLARED_SD_KG_M3
    state = replace(found.state, density_kg_m3=usual, density_sd_kg_m3=sd)
    return _tried(rows, state) or found


def _decide_head(t, u_density):
    if t > CRITICAL:
        return "with"
    return "without" if CRITICAL * u_density < LIQUID_KG_M3 else "undecided"


def _remainders(left):
    return float(np.sqrt(np.mean(left**2))), float(np.abs(left).max())


def _roughness(rows, found):
    """What u is multiplied by: 1, or more where rows depart by more than their rounding.

    Departures that go on from row to row count for fewer rows than there are: with a correlation c
    of neighbours by sqrt((1 + c) / (1 - c)).
    """
    left = found.left_m3 / rows.sd_m3
    size = np.sqrt(found.chi2 / found.dof) if found.dof > 0 else 1.0
    if size < ROUGH:
        return 1.0
    c = np.clip(left[1:] @ left[:-1] / (left @ left), 0.0, 0.99)
    return float(size * np.sqrt((1 + c) / (1 - c)))


def _as_geometry(former, found, rows, used, *, roughness, density, head, t, without, seams,
                 seams_are, by_order):  # fmt: skip
    state, layout = found.state, found.state.layout
    covariance = found.cofactor[layout["radii"], layout["radii"]] * roughness**2
    covariance = covariance + np.outer(by_order, by_order)
    sd = {name: found.sd(name) * roughness for name in layout}
    rms, largest = _remainders(found.left_m3)
    chosen = rows._of(used)
    edges = state.rings.edges_m
    return UprightGeometry(
        name=former.name,
        radii_m=state.radii_m,
        u_m=np.sqrt(np.diag(covariance)),
        covariance_m2=covariance,
        heights_m=np.diff(edges),
        thickness_m=state.thickness_m,
        zero_m=_zero_reading(state, sd["zero"]),
        seams_m=_seam_readings(state if seams is None else seams.state, seams, roughness),
        seams_are=seams_are,
        density_kg_m3=density,
        head=head,
        t=float(t),
        fittings=_found_fittings(state, sd["fittings"]),
        roof_m3=Reading(state.roof_m3, *sd["roof"]) if state.roof_zone_m else None,
        base_m3=Reading(state.base_m3, *sd["base"]) if len(sd["base"]) else Reading(0.0, 0.0),
        lowest_m=state.lowest_m,
        used=used,
        left_m3=former.volume_m3 - state.volume_m3(former.height_m),
        rms_m3=rms,
        largest_m3=largest,
        expected_m3=float(np.sqrt(np.mean(chosen.sd_m3**2))),
        without_head=without,
        roughness=roughness,
        state=state,
    )


def _zero_reading(state, sds):
    """Zero, with u 0 where the table is empty at its zero, nan where seams are not known."""
    if len(sds):
        return Reading(state.zero_m, float(sds[0]))
    return Reading(state.zero_m, np.nan if "base" in state.free else 0.0)


def _seam_readings(state, seams, roughness):
    dips = state.rings.edges_m[1:-1]
    if seams is None:
        return tuple(Reading(float(dip), np.nan) for dip in dips)
    sds = seams.sd("seams") * roughness
    return tuple(Reading(float(d), float(u)) for d, u in zip(dips, sds, strict=True))


def _found_fittings(state, sds):
    found = []
    for k, one in enumerate(state.fittings):
        held = held_kinks(state, one)
        u = [np.nan if h else s for h, s in zip(held, sds[3 * k : 3 * k + 2], strict=True)]
        volume = Reading(one.volume_m3, float(sds[3 * k + 2]))
        found.append(FoundFitting(Reading(one.bottom_m, u[0]), Reading(one.top_m, u[1]), volume))
    return tuple(sorted(found, key=lambda one: one.bottom_m.value))
