"""Adjustment of the rows of a table (rings, head, zero, seams, fittings), and its uncertainty.

    V(h) = V_0 + W(h) - W(h_0) + sum over fittings of v share(h) + roof, if h is above its zone

V_0 is the volume at the lowest row h_0 used. The model is linear except in the positions of kinks.

Uncertainty by rounding
-----------------------

As independent errors of q / sqrt(12), q the last digit, rounding gives the covariance of the
adjustment. But rounding errors of successive rows are correlated: in a ring of 1630.0448 L/cm, the
errors grow by 0.0448 L per row and fall back every 22 rows. The table is therefore rounded again at
many offsets of its last digit, with the steps of possible tanks. The effect on the unknowns is a
second estimate; the larger estimate is used.

Tables with proportional parts
------------------------------

Old tables were computed every decimetre; linear interpolation gave the centimetres. Interpolated
rows contain no information on the shell. A seam or deadwood between computed rows looks like
several kinks. So only the computed rows are used.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.adjust import adjust
from tankcal.errors import SolutionError
from tankcal.products.recalibration.seams import Fitting
from tankcal.products.recalibration.upright_shell import (
    Rings,
    bulge_derivatives,
    bulge_volume_m3,
    prior_sds,
)

ZERO_SD_M, SEAM_SD_M, KINK_SD_M = 0.1, 0.05, 1.0  # weak priors, which prevent singularity
BULGED_ZERO_SD_M = 0.03  # prior of the zero with profiles, which hide the joints
DENSITY_SD_KG_M3 = 1e5
MOST_ROUNDS, MOST_HALVINGS, SETTLED = 15, 6, 1e-3  # iterations, halvings, final change of chi2
ROUGH = 1.15  # largest rms residual over rms rounding error of rows without other errors
DRAWS, SEED = 150, 21  # number of simulated roundings, and seed
USUAL_STEPS_M = (  # steps of computed rows; longer ones give too few rows per course
    0.2, 0.1524, 0.1, 0.0762, 0.0508, 0.05, 0.0254, 0.02, 0.0127, 0.01, 0.005
)  # fmt: skip
FEWEST_STEPS = 8  # fewest steps between computed rows
LEAST_PART = 0.75  # smallest share of rows; rows of the bottom may be computed row by row
FEWEST_PARTS = 5  # fewest rows of a step; in shorter steps, exact rows look linear
FEWEST_UNEVEN = 30  # fewest uneven steps that prove interpolation
# Largest distance from a chord, in last digits: chords of printed and of exact volumes.
INTERPOLATED, LINEAR = 0.5, 1.0
ROUNDING = 1e-6
LEAST_GAIN = 25.0  # smallest reduction of chi2 by interpolation


@dataclass(frozen=True)
class State:
    """Model of a table, with the values of its unknowns.

    Attributes
    ----------
    base_m3 : float
        V_0, at `lowest_m`.
    radii_m : ndarray, shape (n,)
    density_kg_m3 : float
    zero_m : float
        Dip of the bottom of the first ring.
    seams_m : ndarray, shape (n - 1,)
        Heights of the seams above the bottom of the first ring.
    rings_top_m : float
        Height of the top of the last ring above the bottom of the first ring.
    thickness_m : ndarray, shape (n,)
    modulus_pa : float
    lowest_m, highest_m : float
        Dips of the lowest and highest rows used.
    fittings : tuple of Fitting
    roof_m3, roof_zone_m : float, (float, float) or None
        Effect of the roof above its critical zone; None: no roof.
    free : frozenset of str
        Unknowns besides radii and volumes, among "base", "density", "zero", "seams", "kinks".
    is_first_order : bool
        Whether the head is of first order.
    density_sd_kg_m3 : float
        Prior standard deviation of the density.
    usual_density_kg_m3 : float or None
        Prior density; None: the start value of an adjustment.
    bulges_m : ndarray, shape (n, degrees), or None
        Profiles of the courses (`upright_shell`); None: straight courses.
    """

    base_m3: float
    radii_m: np.ndarray
    density_kg_m3: float
    zero_m: float
    seams_m: np.ndarray
    rings_top_m: float
    thickness_m: np.ndarray
    modulus_pa: float
    lowest_m: float
    highest_m: float
    fittings: tuple[Fitting, ...] = ()
    roof_m3: float = 0.0
    roof_zone_m: tuple[float, float] | None = None
    free: frozenset = frozenset({"base", "density"})
    is_first_order: bool = True
    density_sd_kg_m3: float = DENSITY_SD_KG_M3
    usual_density_kg_m3: float | None = None
    bulges_m: np.ndarray | None = None

    @property
    def rings(self):
        """The Rings, at dips."""
        heights = np.concatenate([[0.0], self.seams_m, [self.rings_top_m]])
        return Rings(self.zero_m + heights, self.thickness_m, self.modulus_pa, self.is_first_order)

    def volume_m3(self, dips_m):
        """Volume below each dip, shape (rows,), m3."""
        dips = np.append(dips_m, self.lowest_m)
        shell = self.shell_m3(dips)
        volume = self.base_m3 + shell[:-1] - shell[-1]
        for fitting in self.fittings:
            below = fitting.volume_below_m3(dips)
            volume = volume + below[:-1] - below[-1]
        return volume + self._roof_share(dips_m) * self.roof_m3

    def shell_m3(self, dips_m):
        """Volume of the courses below each dip, shape (rows,), m3."""
        volume = self.rings.volume_m3(dips_m, self.radii_m, self.density_kg_m3)
        if self.bulges_m is None:
            return volume
        return volume + bulge_volume_m3(self.rings, dips_m, self.radii_m, self.bulges_m)

    def _roof_share(self, dips_m):
        if self.roof_zone_m is None:
            return np.zeros(len(dips_m))
        low, high = self.roof_zone_m
        return np.clip((np.asarray(dips_m) - low) / max(high - low, 1e-9), 0.0, 1.0)

    @property
    def layout(self):
        """{name: slice} of the unknowns; each fitting has three: bottom, top, volume."""
        sizes = {
            "base": int("base" in self.free),
            "radii": len(self.radii_m),
            "density": int("density" in self.free),
            "zero": int("zero" in self.free),
            "seams": len(self.seams_m) * ("seams" in self.free),
            "bulges": 0 if self.bulges_m is None else self.bulges_m.size,
            "fittings": 3 * len(self.fittings),
            "roof": int(self.roof_zone_m is not None),
        }
        ends = np.cumsum(list(sizes.values()))
        return {
            name: slice(int(end - size), int(end))
            for (name, size), end in zip(sizes.items(), ends, strict=True)
        }

    @property
    def unknowns(self):
        """Values of the unknowns, shape (u,)."""
        things = [(f.bottom_m, f.top_m, f.volume_m3) for f in self.fittings]
        values = {
            "base": [self.base_m3],
            "radii": self.radii_m,
            "density": [self.density_kg_m3],
            "zero": [self.zero_m],
            "seams": self.seams_m,
            "bulges": [] if self.bulges_m is None else self.bulges_m.ravel(),
            "fittings": np.ravel(things),
            "roof": [self.roof_m3],
        }
        return np.concatenate(
            [values[name][: part.stop - part.start] for name, part in self.layout.items()]
        )

    def replace_unknowns(self, unknowns):
        """Return the state with other values of the unknowns."""
        values = {name: unknowns[part] for name, part in self.layout.items()}
        changes = {"radii_m": values["radii"]}
        for name, key in (("base", "base_m3"), ("density", "density_kg_m3"), ("zero", "zero_m"),
                          ("roof", "roof_m3")):  # fmt: skip
            if len(values[name]):
                changes[key] = float(values[name][0])
        if len(values["seams"]):
            changes["seams_m"] = values["seams"]
        if self.bulges_m is not None:
            changes["bulges_m"] = values["bulges"].reshape(self.bulges_m.shape)
        things = values["fittings"].reshape(-1, 3)
        changes["fittings"] = tuple(Fitting(*map(float, fitting)) for fitting in things)
        return replace(self, **changes)

    def design(self, dips_m):
        """Derivatives (rows, u) of `volume_m3` by the unknowns, in the order of `layout`."""
        # The last row is h_0: the model contains W(h) - W(h_0), and so do its derivatives.
        dips = np.append(dips_m, self.lowest_m)
        by_radius, by_density, by_edge = self.rings.derivatives(
            dips, self.radii_m, self.density_kg_m3
        )
        # A higher zero shifts all edges together.
        by_bulge, by_zero = np.zeros((len(dips), 0)), by_edge.sum(axis=1, keepdims=True)
        if self.bulges_m is not None:
            by_bulge, *more = bulge_derivatives(self.rings, dips, self.radii_m, self.bulges_m)
            by_radius, by_edge, by_zero = (
                derivatives + also
                for derivatives, also in zip((by_radius, by_edge, by_zero), more, strict=True)
            )
        columns = [by_radius]
        if "density" in self.free:
            columns.append(by_density[:, None])
        if "zero" in self.free:
            columns.append(by_zero)
        if "seams" in self.free:
            columns.append(by_edge[:, 1:])
        columns += [by_bulge]
        columns += [fitting.derivatives(dips) for fitting in self.fittings]
        columns_of_rows = np.hstack(columns)
        parts = [columns_of_rows[:-1] - columns_of_rows[-1]]
        if "base" in self.free:
            parts.insert(0, np.ones((len(dips_m), 1)))
        if self.roof_zone_m is not None:
            parts.append(self._roof_share(dips_m)[:, None])
        return np.hstack(parts)


@dataclass(frozen=True)
class Fit:
    """A State adjusted to rows.

    Attributes
    ----------
    state : State
    cofactor : ndarray, shape (u, u)
        Covariance of the unknowns by rounding only.
    left_m3 : ndarray, shape (rows,)
        Table minus state.
    sd_m3 : ndarray, shape (rows,)
        Standard deviations by rounding.
    design : ndarray, shape (rows, u)
    chi2 : float
        chi2 of the rows.
    bulges : (ndarray, ndarray, ndarray)
        Prior of the bulges: (k, u) derivatives, (k,) discrepancies, (k,) sds.
    """

    state: State
    cofactor: np.ndarray
    left_m3: np.ndarray
    sd_m3: np.ndarray
    design: np.ndarray
    chi2: float
    bulges: tuple[np.ndarray, np.ndarray, np.ndarray]

    @property
    def cost(self):
        """chi2 of rows and bulges."""
        return self.chi2 + float(np.sum((self.bulges[1] / self.bulges[2]) ** 2))

    @property
    def dof(self):
        """Rows minus unknowns that are not fixed."""
        return len(self.left_m3) - int(np.count_nonzero(np.diag(self.cofactor)))

    def sd(self, name):
        """Standard deviations of the unknowns of one name (`State.layout`)."""
        part = self.state.layout[name]
        return np.sqrt(np.diag(self.cofactor)[part])


def fit(state, dips_m, volumes_m3, sd_m3):
    """Adjust a `State` to rows of a table.

    Parameters
    ----------
    state : State
        Start values. Seams and kinks have weak priors about them, the zero about 0.
    dips_m, volumes_m3, sd_m3 : (rows,) ndarray

    Returns
    -------
    Fit

    Raises
    ------
    SolutionError
        If the rows do not determine the unknowns.
    """
    # Unknowns that the rows cannot determine are fixed; all others move.
    held, known, about, sds = _priors(state)
    moving = np.setdiff1d(np.arange(len(state.unknowns)), held)
    observed = np.concatenate([volumes_m3, about])
    variances = np.concatenate([sd_m3**2, sds**2])
    # Weak priors are added as observations of the unknowns themselves.
    rows = np.eye(len(state.unknowns))[known][:, moving]

    def misclosure(now):
        """Model minus observations, of the rows and of the priors."""
        return np.concatenate([now.volume_m3(dips_m), now.unknowns[known]]) - observed

    now, w = state, misclosure(state)
    for _ in range(MOST_ROUNDS):
        design = np.vstack([now.design(dips_m)[:, moving], rows])
        # Linear model of the step: f = w + design x - l, with observations l = 0.
        adjusted = adjust(
            lambda x, l, w=w, design=design: (w + design @ x - l, design, None),
            np.zeros(len(moving)),
            np.zeros(len(w)),
            variances,
        )
        before, cost = now, w @ (w / variances)
        step = np.zeros(len(now.unknowns))
        step[moving] = adjusted.unknowns
        # Gauss-Newton step, halved until the cost does not rise.
        for _ in range(MOST_HALVINGS):
            now = before.replace_unknowns(before.unknowns + step)
            w = misclosure(now)
            if w @ (w / variances) <= cost + SETTLED:
                break
            step /= 2
        if abs(cost - w @ (w / variances)) < SETTLED:
            break
    cofactor = np.zeros((len(state.unknowns), len(state.unknowns)))
    cofactor[np.ix_(moving, moving)] = adjusted.cofactor
    left = volumes_m3 - now.volume_m3(dips_m)
    chi2 = float(np.sum((left / sd_m3) ** 2))
    bulges = _bulge_prior(now)
    return Fit(now, cofactor, left, sd_m3, now.design(dips_m), chi2, bulges)


def _bulge_prior(state):
    """Derivatives, discrepancies and sds of the bulges as prior observations."""
    part = np.eye(len(state.unknowns))[state.layout["bulges"]]
    if not len(part):
        return part, np.zeros(0), np.zeros(0)
    return part, -state.bulges_m.ravel(), prior_sds(state.bulges_m).ravel()


def _priors(state):
    """Return fixed unknowns, and unknowns with weak priors, their values and sds."""
    layout = state.layout
    sds, held = {}, []  # sds: {place of the unknown: sd of its prior}
    density_sd = state.density_sd_kg_m3
    zero_sd = ZERO_SD_M if state.bulges_m is None else BULGED_ZERO_SD_M
    for name, sd in (("zero", zero_sd), ("seams", SEAM_SD_M), ("density", density_sd)):
        sds |= dict.fromkeys(range(layout[name].start, layout[name].stop), sd)
    if state.bulges_m is not None:
        places = range(layout["bulges"].start, layout["bulges"].stop)
        sds |= dict(zip(places, prior_sds(state.bulges_m).ravel(), strict=True))
    for k, fitting in enumerate(state.fittings):
        place = layout["fittings"].start + 3 * k
        for edge, is_held in enumerate(are_kinks_fixed(state, fitting)):
            if is_held:
                held.append(place + edge)
            else:
                sds[place + edge] = KINK_SD_M
    known = np.array(list(sds), dtype=int)
    # Priors are centred on the start values, those of zero and bulges on 0.
    about = state.unknowns[known]
    for name in ("zero", "bulges"):
        about[np.isin(known, np.arange(len(state.unknowns))[layout[name]])] = 0.0
    if state.usual_density_kg_m3 is not None:
        is_density = np.isin(known, np.arange(len(state.unknowns))[layout["density"]])
        about[is_density] = state.usual_density_kg_m3
    return np.array(held, dtype=int), known, about, np.array(list(sds.values()))


def are_kinks_fixed(state, fitting):
    """Whether (bottom, top) kinks of a fitting lie outside the rows and are therefore fixed."""
    if "kinks" not in state.free:
        return True, True
    return fitting.bottom_m <= state.lowest_m, fitting.top_m >= state.highest_m


@dataclass(frozen=True)
class Rows:
    """Rows of a table.

    Attributes
    ----------
    dip_m, volume_m3, sd_m3 : (rows,) ndarray
        sd_m3: by rounding.
    """

    dip_m: np.ndarray
    volume_m3: np.ndarray
    sd_m3: np.ndarray

    def select_above(self, dip_m):
        """Return the rows from a dip upwards."""
        return self.select(self.dip_m >= dip_m - 1e-9)

    def select(self, mask):
        """Return the rows of a mask."""
        return Rows(self.dip_m[mask], self.volume_m3[mask], self.sd_m3[mask])

    def thin(self, most):
        """Return at most `most` evenly chosen rows, including the first and the last."""
        chosen = np.zeros(len(self.dip_m), dtype=bool)
        chosen[np.unique(np.linspace(0, len(self.dip_m) - 1, most).round().astype(int))] = True
        return self.select(chosen)

    def adjust(self, state):
        """Return the Fit of a State to the rows."""
        lowest, highest = float(self.dip_m[0]), float(self.dip_m[-1])
        state = replace(state, lowest_m=lowest, highest_m=highest)
        return fit(state, self.dip_m, self.volume_m3, self.sd_m3)


def try_fit(rows, state):
    """Return the Fit of a State to Rows, or None if the rows do not determine it."""
    try:
        return rows.adjust(state)
    except SolutionError:
        return None


def row_sds(former):
    """Standard deviations (rows,) of a table's volumes by its last digits, m3.

    Dips with even steps are exact; other dips contribute their own rounding.
    """
    dips, volumes = former.height_m, former.volume_m3
    finest = 1e-7 + 1e-12 * float(np.abs(volumes).max())
    sd = max(former.volume_quantum_m3, finest) / np.sqrt(12)
    if former.height_rounding_m is None:
        return np.full(len(dips), sd)
    return np.hypot(sd, np.gradient(volumes, dips) * former.height_rounding_m / np.sqrt(3))


def simulate_rounding(solution, rows, quantum_m3, draws=DRAWS):
    """Rounding errors of tanks compatible with a Fit, m3.

    Parameters
    ----------
    solution : Fit
    rows : Rows
    quantum_m3 : float
        Value of the last printed digit.
    draws : int, optional

    Returns
    -------
    (draws, rows) ndarray
    """
    sds = np.sqrt(np.diag(solution.cofactor))
    random = np.random.default_rng(SEED)
    safe = np.where(sds > 0, sds, 1.0)
    # Root of the covariance through the correlation matrix, which is better conditioned.
    values, vectors = np.linalg.eigh(solution.cofactor / np.outer(safe, safe))
    roots = vectors * np.sqrt(np.maximum(values, 0)) * safe[:, None]
    moves = random.normal(size=(draws, len(sds))) @ (solution.design @ roots).T
    # A common offset of all rows gives other rounding errors of an equally likely table.
    shifts = random.uniform(0, 1, (draws, 1))
    places = (solution.state.volume_m3(rows.dip_m) + moves) / quantum_m3 + shifts
    return (np.round(places) - places) * quantum_m3


def u_factors(solution, rows, quantum_m3):
    """Factors (u,) of the standard deviations of the unknowns of a Fit, 1 or more.

    Parameters
    ----------
    solution : Fit
    rows : Rows
    quantum_m3 : float
        Value of the last printed digit; 0: not rounded.
    """
    return np.maximum(_simulate_factors(solution, rows, quantum_m3), roughness(solution, rows))


def _simulate_factors(solution, rows, quantum):
    sds = np.sqrt(np.diag(solution.cofactor))
    if quantum <= 0 or solution.dof <= 0:
        return np.ones(len(sds))
    # Errors of the unknowns by errors of the rows: Q A' P.
    gain = solution.cofactor @ (solution.design / rows.sd_m3[:, None] ** 2).T
    errors = simulate_rounding(solution, rows, quantum) @ gain.T
    moved = np.sqrt(np.mean(errors**2, axis=0))
    return np.maximum(moved / np.where(sds > 0, sds, np.inf), 1.0)


def roughness(solution, rows):
    """Factor of u: 1, or more if the residuals exceed the rounding errors.

    Correlated residuals count as fewer rows: a correlation c of neighbours gives the factor
    sqrt((1 + c) / (1 - c)).
    """
    left = solution.left_m3 / rows.sd_m3
    size = np.sqrt(solution.chi2 / solution.dof) if solution.dof > 0 else 1.0
    if size < ROUGH:
        return 1.0
    # lag-one autocorrelation of the residuals
    c = np.clip(left[1:] @ left[:-1] / (left @ left), 0.0, 0.99)
    return float(size * np.sqrt((1 + c) / (1 - c)))


@dataclass(frozen=True)
class ComputedRows:
    """Rows of a table that may have been computed, while the other rows are linear between them.

    Attributes
    ----------
    rows : (n,) ndarray of int
        Numbers of the computed rows, from the bottom up.
    lowest : int
        Number of the row above which the other rows are linear.
    step_m : float
        Step between computed rows.
    is_certain : bool
        Whether rounding proves that the other rows were interpolated between printed volumes.
    """

    rows: np.ndarray
    lowest: int
    step_m: float
    is_certain: bool

    def table(self, former):
        """Return the FormerTable of these rows."""
        optional = {
            name: None if getattr(former, name) is None else getattr(former, name)[self.rows]
            for name in ("U_m3", "factor_m3", "height_rounding_m", "row")
        }
        return replace(
            former,
            height_m=former.height_m[self.rows],
            volume_m3=former.volume_m3[self.rows],
            **optional,
        )

    def is_confirmed(self, former, state, sd_m3):
        """Whether interpolation explains the rows better than a `State` at each row does.

        Parameters
        ----------
        former : FormerTable
        state : State
            State estimated from the computed rows.
        sd_m3 : (rows,) ndarray
            Standard deviations of all rows, by rounding.
        """
        if self.is_certain:
            return True
        dips = former.height_m
        lowest = max(state.lowest_m, dips[self.lowest])
        between = (dips >= lowest) & (dips <= dips[self.rows[-1]])
        linear = np.interp(dips, dips[self.rows], state.volume_m3(dips)[self.rows])
        by_parts = float(np.sum(((former.volume_m3 - linear) / sd_m3)[between] ** 2))
        # Computed rows may locate seams and zero poorly, so all rows estimate them again.
        exact = try_fit(Rows(dips, former.volume_m3, sd_m3).select(between), state)
        return exact is not None and exact.chi2 - by_parts > LEAST_GAIN


def find_computed_rows(former):
    """Return the ComputedRows of the longest step with linear rows in between, or None."""
    dips, quantum = former.height_m, former.volume_quantum_m3
    steps = np.diff(dips)
    step = float(np.median(steps))
    count = len(dips) if abs(steps[-1] - step) < ROUNDING else len(dips) - 1  # the top is uneven
    if quantum <= 0 or np.any(np.abs(steps[: count - 1] - step) > ROUNDING):
        return None
    volumes = former.volume_m3[:count] / quantum
    candidates = []
    for long_step in USUAL_STEPS_M:
        parts = round(long_step / step)
        is_multiple = abs(parts * step - long_step) < ROUNDING
        if not is_multiple or not FEWEST_PARTS <= parts <= count // FEWEST_STEPS:
            continue
        first = _first_linear_row(volumes, parts)
        if first is not None:
            rows = np.arange(first % parts, count, parts)
            is_certain = _is_interpolated(volumes, first, parts)
            candidates.append(ComputedRows(rows, first, long_step, is_certain))
    return max(
        candidates, key=lambda candidate: (candidate.is_certain, candidate.step_m), default=None
    )


def _first_linear_row(volumes, parts):
    """Lowest computed row above which the rows in between are linear, or None.

    The middle of each step is first compared with its chord, for all offsets together.
    """
    count, middle = len(volumes), parts // 2
    starts = np.arange(count - parts)
    share = middle / parts
    chord = volumes[:-parts] * (1 - share) + volumes[parts:] * share
    is_bent = np.abs(volumes[middle : middle + len(starts)] - chord) > LINEAR + ROUNDING
    highest_bent = np.full(parts, -1)
    np.maximum.at(highest_bent, starts[is_bent] % parts, starts[is_bent])
    for offset in np.argsort(highest_bent, kind="stable"):
        if highest_bent[offset] > (1 - LEAST_PART) * count:
            return None
        bent = np.any(
            np.abs(_chord_distances(volumes, int(offset), parts)) > LINEAR + ROUNDING, axis=1
        )
        above = int(np.flatnonzero(bent)[-1]) + 1 if bent.any() else 0
        if above * parts + offset <= (1 - LEAST_PART) * count:
            return int(above * parts + offset)
    return None


def _chord_distances(volumes, first, parts):
    """Distances (steps, parts - 1) of the rows between computed rows from their chords."""
    steps = (len(volumes) - 1 - first) // parts
    ends = volumes[first : first + steps * parts + 1 : parts]
    share = np.arange(1, parts) / parts
    inner = volumes[first : first + steps * parts].reshape(steps, parts)[:, 1:]
    return inner - ends[:-1, None] * (1 - share) - ends[1:, None] * share


def _is_interpolated(volumes, first, parts):
    """Whether all rows in between lie within half a digit of the chord of printed volumes.

    Volumes computed at each row deviate by up to a whole digit where steps are uneven.
    """
    steps = (len(volumes) - 1 - first) // parts
    rises = np.diff(volumes[first : first + steps * parts + 1]).reshape(steps, parts)
    uneven = np.count_nonzero(np.ptp(rises, axis=1) > 0.5)
    left = np.abs(_chord_distances(volumes, first, parts))
    return bool(uneven >= FEWEST_UNEVEN and left.max() <= INTERPOLATED + ROUNDING)
