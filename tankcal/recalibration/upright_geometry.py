"""The geometry of an upright tank out of its capacity table.

Rows below the highest point of the bottom, and those of a roof's critical zone, are left out; the
others are adjusted (`table_fit.fit`). What stands in the tank is looked for as pairs of kinks
(`fittings.find_fitting`), one after the other, until none explains more than rounding does by
chance. Then the table is asked whether it has a head, where its zero is, and whether the seams are
where they were declared to be.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.recalibration.fittings import Fitting, find_fitting
from tankcal.recalibration.table_fit import State, fit, held_kinks

STEEL_PA = 206e9
LEAST_GAIN = 25.0  # of chi2 by a thing: less is what the best of all pairs gains by chance
MOST_FITTINGS = 12
ZEROS_M = np.arange(-0.3, 0.31, 0.05)
START_DENSITY_KG_M3 = 500.0
LIQUID_KG_M3 = 500.0  # a head that a table could not have shown of any liquid is undecided
BY_ORDER = 9.0  # of chi2, by which a head of second order has to fit better
ROUGH = 1.15  # rms over what rounding leaves: above it, rows have more in them than rounding
FEWEST_ROWS = 3  # of a ring
SAME_ZERO = 3.0  # standard deviations
BOTTOM_SHARE = 0.6  # of the first ring, that a bottom may reach up to
BOTTOM_TRIES = 40
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
        Dip of the bottom of the first ring.
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
    former, heights_m, thickness_m, *, modulus_pa=STEEL_PA, known=(), lowest_m=None, seams_known=True
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
    usable = rows._of(used)
    state = _start(usable, heights, plates, modulus_pa, zone)
    found = _search(usable, state, lowest_m)
    used &= rows.dip_m >= found.state.lowest_m - 1e-9
    return _geometry(former, found, rows, used, seams_known)


def sd_of_rows(former):
    """(rows,) standard deviations of a table's volumes by its last digits.

    Dips on a regular step are what the table was made for; others were rounded, too.
    """
    dips, volumes = former.height_m, former.volume_m3
    finest = 1e-7 + 1e-12 * float(np.abs(volumes).max())
    own = max(former.volume_quantum_m3, finest) / np.sqrt(12)
    step = np.diff(dips)
    usual = np.median(step)
    count = np.round(step / usual)
    is_even = np.abs(step - count * usual) < 0.01 * max(former.height_quantum_m, 1e-7)
    if is_even.mean() > 0.9:
        return np.full(len(dips), own)
    slope = np.gradient(volumes, dips)
    return np.hypot(own, slope * former.height_quantum_m / np.sqrt(12))


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
        return _with_fittings(rows.above(lowest_m), state)
    lowest = _lowest_row(rows, state)
    found = _with_fittings(rows.above(lowest), state)
    if lowest > rows.dip_m[0]:
        more = replace(found.state, lowest_m=float(rows.dip_m[0]))
        try:
            whole = _with_fittings(rows, more, at_most=len(found.state.fittings) + 1)
        except SolutionError:
            return found
        if _is_by_rounding(rows, whole) and _is_enough(rows, found, whole):
            return whole
    return found


def _is_enough(rows, found, whole):
    """Whether rows far more than their new unknowns are explained by these."""
    return len(rows.dip_m) - len(found.left_m3) > 10 * (
        len(whole.state.unknowns) - len(found.state.unknowns)
    )


def _is_by_rounding(rows, found):
    """Whether nothing is left but rounding: as a whole, and at the worst row."""
    worst = np.abs(found.left_m3 / rows.sd_m3).max()
    return found.chi2 < ROUGH**2 * max(found.dof, 1) and worst < np.sqrt(3) * 1.25


def _lowest_row(rows, state):
    """Dip from which on the first ring's rows are those of one cut: above the bottom's highest.

    A parabola through the upper rows of the ring is taken downwards as far as it leaves rounding.
    """
    first = rows.dip_m <= state.seams_m[0] - EDGE_M if len(state.seams_m) else rows.dip_m >= 0
    ring = rows._of(first)
    most = BOTTOM_SHARE * ring.dip_m[-1]
    tries = np.flatnonzero(ring.dip_m <= most)
    if len(ring.dip_m) < 8 or len(tries) == 0:
        return float(rows.dip_m[0])
    if _is_one_cut(ring):
        return float(ring.dip_m[0])
    for place in _halving(tries):
        if _is_one_cut(ring.above(ring.dip_m[place])):
            return float(ring.dip_m[place])
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
    """The Fit with the things that the rows show, one looked for after the other."""
    found = _with_zero(rows, state)
    while len(found.state.fittings) < at_most:
        thing, gain = find_fitting(rows.dip_m, found.left_m3, found.design, rows.sd_m3)
        rough = max(found.chi2 / max(found.dof, 1), 1.0) if found.dof else 1.0
        if gain < LEAST_GAIN or found.dof < 6 or gain < 0.02 * rough * found.dof:
            break
        again = _with_thing(rows, found, thing)
        if again is None or found.chi2 - again.chi2 < LEAST_GAIN:
            break
        found = again
    return found


def _with_thing(rows, found, thing):
    """The Fit with one thing more: where it is found to be, or else where it was looked for."""
    state = replace(found.state, fittings=(*found.state.fittings, thing))
    free = state.free | {"kinks"}
    for kinds in (free, free - {"kinks"}):
        try:
            again = rows.adjust(replace(state, free=kinds))
        except SolutionError:
            continue
        if all(one.bottom_m < one.top_m for one in again.state.fittings):
            return again
    return None


def _with_zero(rows, state):
    """The Fit from the best of some zeros; free from there on, where that can be found."""
    held = replace(state, free=state.free - {"zero", "kinks"})
    zeros = ZEROS_M if len(state.seams_m) else [0.0]
    tried = []
    for zero in [state.zero_m, *zeros]:
        try:
            tried.append(rows.adjust(replace(held, zero_m=float(zero))))
        except SolutionError:
            continue
    if not tried:
        return rows.adjust(held)
    best = min(tried, key=lambda one: one.chi2)
    kinks = {"kinks"} if state.fittings else set()
    if not len(state.seams_m):
        return best
    try:
        return rows.adjust(replace(best.state, free=best.state.free | {"zero"} | kinks))
    except SolutionError:
        return best


def _geometry(former, found, rows, used, seams_known):
    chosen = rows._of(used)
    found = _with_order(chosen, found)
    found = _with_known_zero(chosen, former, found)
    seams = _free_seams(chosen, found)
    seams_are = "declared"
    if seams is not None and (not seams_known or _are_elsewhere(found, seams)):
        found, seams_are = seams, "found"
    roughness = _roughness(chosen, found)
    u_density = float(found.sd("density")[0]) * roughness
    t = found.state.density_kg_m3 / u_density
    head, without = _decide_head(t, u_density), None
    dry = _without_head(chosen, found)
    if head != "without":
        without = _remainders(dry.left_m3) + (dry.state.radii_m,)
    density = Reading(found.state.density_kg_m3, u_density)
    if head == "without":
        found, roughness = dry, _roughness(chosen, dry)
    return _as_geometry(
        former, found, rows, used,
        roughness=roughness, density=density, head=head, t=t, without=without, seams=seams,
        seams_are=seams_are,
    )  # fmt: skip


def _with_order(rows, found):
    """The Fit with the head of the order that the table was made with; the first, when it is mum."""
    try:
        other = rows.adjust(replace(found.state, is_first_order=False))
    except SolutionError:
        return found
    return other if found.chi2 - other.chi2 > BY_ORDER else found


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
    return rows.adjust(replace(found.state, density_kg_m3=0.0, free=free))


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
                 seams_are):  # fmt: skip
    state, layout = found.state, found.state.layout
    covariance = found.cofactor[layout["radii"], layout["radii"]] * roughness**2
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
        zero_m=Reading(state.zero_m, *sd["zero"]) if len(sd["zero"]) else Reading(state.zero_m, 0.0),
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
