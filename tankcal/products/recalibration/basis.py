"""Bring a former table to the basis of a new table: zero, temperature, head, roof, rounding.

Each step starts from the result of the steps before it. The steps and the remaining difference
therefore add up to the difference of the tables:

    zero         V(h + h0), h0 the height of the new zero above the former one
    temperature  areas are multiplied by (1 + a (T_new - T_old))^2; for a tank that is one solid, or
                 whose dips also expand, V s^3 at the dip h / s, s = 1 + a (T_new - T_old)
    head         head of the new density minus head of the former, in the rings of the former table
    roof         displacement in the former table minus displacement in the new table
    rounding     to the last digit of the new table

A step with unknown values is omitted; its state lists the missing values.

The facts about the tank besides its volumes are courses, material and head (`collect_facts`).
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.job.model import Material
from tankcal.messages import message
from tankcal.products.recalibration.agreement import adjust_difference, slopes_m2
from tankcal.products.recalibration.upright_geometry import read_upright
from tankcal.products.recalibration.upright_shell import Rings, estimate_radii
from tankcal.record.recalibration import BasisStep, ZeroShift
from tankcal.tank.fittings import floating_roof

MOST_ROWS = 900  # largest number of rows from which a density is estimated
ROUNDS = 5  # iterations of the zero; each reduces the error to a hundredth or less
SAME_ZERO_M = 1e-7  # convergence limit of the zero
FEWEST_ROWS = 2  # fewest common rows of both tables
SPARE = 1.1  # margin: a smooth curve may bend more between rows than at rows
# Smallest fitted zero that counts: in standard uncertainties, and in metres.
NOTICED, LEAST_ZERO_M = 2.0, 1e-4
UNITS = {"zero": "m", "temperature": "C", "head": "kg/m3", "roof": "m3", "rounding": "m3"}


@dataclass(frozen=True)
class TankFacts:
    """The tank of two tables.

    Attributes
    ----------
    kind : {"vertical", "horizontal", "sphere", "mesh"} or None
    heights_m, thickness_m : (courses,) ndarray or None
        Courses from the bottom up; None: unknown. A thickness of 0 means an unknown plate: its
        expansion by the head is not computed.
    bottom_m : float
        Dip of the bottom of the first course in the new table.
    modulus_pa, expansion_per_k : float
    material_source : {"record", "default"}
        Source of the two material constants.
    dips_expand : bool
        Whether dips also expand with the shell.
    inside_m : (courses,) ndarray or None
        Radii of the courses in the record of the new table.
    """

    kind: str | None = None
    heights_m: np.ndarray | None = None
    thickness_m: np.ndarray | None = None
    bottom_m: float = 0.0
    modulus_pa: float = Material.e_pa
    expansion_per_k: float = Material.expansion_per_k
    material_source: str = "default"
    dips_expand: bool = False
    inside_m: np.ndarray | None = None

    @property
    def is_shell(self):
        """Whether the tank is upright and its courses are known."""
        return self.kind == "vertical" and self.heights_m is not None

    @property
    def has_plates(self):
        """Whether all plate thicknesses are known, as the head requires."""
        return self.is_shell and bool(np.isfinite(self.thickness_m).all())

    def edges_m(self, zero_m=0.0):
        """Dips (courses + 1,) of the edges; `zero_m` is added to those of the new table."""
        return self.bottom_m + zero_m + np.concatenate([[0.0], np.cumsum(self.heights_m)])


def collect_facts(former, new, courses=None):
    """Return the TankFacts of two FormerTables.

    Parameters
    ----------
    former, new : FormerTable
        The record of the new table takes precedence.
    courses : (heights, thicknesses) or None
        FormerFacts courses, m, used if no record has them.
    """
    kind = new.kind or former.kind or ("vertical" if courses is not None else None)
    facts = {"kind": kind}
    if courses is not None:
        facts |= _shell(*courses)
    for table in (former, new):  # the new table last, so that it takes precedence
        if table.record is not None:
            facts |= _record_facts(table.record, is_new=table is new)
    return TankFacts(**facts)


def _record_facts(record, is_new):
    job = record["job"]
    material, table = job.get("material") or {}, job.get("table") or {}
    facts = {"dips_expand": bool(table.get("height_expansion"))}
    if material.get("e_pa") and material.get("expansion_per_k"):
        facts |= {
            "modulus_pa": float(material["e_pa"]),
            "expansion_per_k": float(material["expansion_per_k"]),
            "material_source": "record",
        }
    courses = job.get("courses") or []
    if courses:
        facts |= _shell(
            *([course[key] for course in courses] for key in ("height_m", "thickness_m"))
        )
        if is_new:
            facts["bottom_m"] = -float(record["capacity"]["zero_m"])
            surveyed = record.get("courses") or []
            if len(surveyed) == len(courses):
                facts["inside_m"] = np.array([key["inside_radius_m"] for key in surveyed], float)
    return facts


def _shell(heights_m, thickness_m):
    thickness = np.asarray(thickness_m, dtype=float)
    return {
        "heights_m": np.asarray(heights_m, dtype=float),
        "thickness_m": np.where(thickness > 0, thickness, np.inf),
    }


# ---- density of the head


@dataclass(frozen=True)
class Density:
    """Density of the liquid whose head a table includes.

    Attributes
    ----------
    kg_m3 : float or None
        0: no head; None: unknown.
    source : {"declared", "read"} or None
    u_kg_m3 : float or None
        Standard uncertainty of an estimated density, by rounding only.
    read_kg_m3 : float or None
        Estimate from the rows, whether or not it is used.
    head : {"with", "without", "undecided"} or None
        Estimated from the rows.
    """

    kg_m3: float | None = None
    source: str | None = None
    u_kg_m3: float | None = None
    read_kg_m3: float | None = None
    head: str | None = None


def find_densities(former, new, facts):
    """Return the Density of both tables, estimated from the rows if not declared."""
    return _find_density(former, facts), _find_density(new, facts)


def _find_density(table, facts):
    if table.liquid_density_kg_m3 is not None:
        return Density(float(table.liquid_density_kg_m3), "declared")
    if not facts.has_plates:
        return Density()
    try:
        geometry = read_upright(
            _thin_table(table), facts.heights_m, facts.thickness_m, modulus_pa=facts.modulus_pa
        )
    except SolutionError:
        return Density()
    read, head = geometry.density_kg_m3, geometry.head
    known = {"with": float(read.value), "without": 0.0, "undecided": None}[head]
    source = None if known is None else "read"
    return Density(known, source, float(read.u), float(read.value), head)


def _thin_table(table):
    """Return a table of at most MOST_ROWS evenly chosen rows, including the last."""
    every = -(-len(table.height_m) // MOST_ROWS)
    if every == 1:
        return table
    chosen = np.arange(len(table.height_m))[::-1][::every][::-1]
    rounding = table.height_rounding_m
    return replace(
        table,
        height_m=table.height_m[chosen],
        volume_m3=table.volume_m3[chosen],
        U_m3=None,
        factor_m3=None,
        row=None,
        height_rounding_m=None if rounding is None else rounding[chosen],
    )


@dataclass(frozen=True)
class Step:
    """One step from the former basis to the new basis.

    Attributes
    ----------
    added_m3 : (rows,) ndarray
        Change of the former volumes.
    state, source, former, new, lacking
        As in `record.recalibration.BasisStep`.
    """

    added_m3: np.ndarray
    state: str
    source: str | None = None
    former: float | None = None
    new: float | None = None
    lacking: tuple[str, ...] = ()


@dataclass(frozen=True)
class OneBasis:
    """Rows of a new table, and the former table on the basis of the new one.

    Attributes
    ----------
    height_m : (rows,) ndarray
        Dips of the new table within the range of both.
    rows : (rows,) ndarray of int
        Row numbers in the new table.
    former_m3, on_basis_m3, new_m3 : (rows,) ndarray
        Former table as printed; former table on the new basis; new table.
    steps : dict
        {name: Step}, in order.
    zero : ZeroShift
    usable : (rows,) ndarray of bool
        False where a roof is partly afloat.
    interpolation_m3 : float
        Largest interpolation error in the former table.
    densities : (Density, Density)
        Former and new table.
    """

    height_m: np.ndarray
    rows: np.ndarray
    former_m3: np.ndarray
    on_basis_m3: np.ndarray
    new_m3: np.ndarray
    steps: dict
    zero: ZeroShift
    usable: np.ndarray
    interpolation_m3: float
    densities: tuple[Density, Density]

    @property
    def basis_steps(self):
        """Return the `BasisStep` of each step."""
        return [_basis_step(name, step, self.height_m) for name, step in self.steps.items()]


def bring_to_one_basis(former, new, facts):
    """Return the `OneBasis` of two FormerTables of a tank.

    Parameters
    ----------
    former, new : FormerTable
    facts : TankFacts

    Raises
    ------
    InputError
        If the tables have fewer than two rows in common.
    """
    zero = _find_declared_zero(former, new)
    densities = find_densities(former, new, facts)
    fitted = _fit_zero(former, new, facts, densities)
    if zero is None and fitted is not None:
        least = max(NOTICED * fitted[1], LEAST_ZERO_M)
        zero = fitted[0] if abs(fitted[0]) > least else None
    rows = rows_in_both(former, new, zero or 0.0)
    steps, former_m3, basis = _steps(former, new, facts, densities, zero or 0.0, rows)
    shift = _zero_shift(former, new, zero, fitted, rows)
    steps["zero"] = _zero_step(steps["zero"], shift, former, new)
    return OneBasis(
        height_m=new.height_m[rows],
        rows=rows,
        former_m3=former_m3,
        on_basis_m3=basis,
        new_m3=new.volume_m3[rows],
        steps=steps,
        zero=shift,
        usable=_usable_rows(former, new, zero or 0.0, new.height_m[rows]),
        interpolation_m3=interpolation_error_m3(former, new.height_m[rows] + (zero or 0.0)),
        densities=densities,
    )


def rows_in_both(former, new, zero_m):
    """Indices of the new rows within the range of the former table, with and without a zero.

    Raises InputError if there are fewer than two.
    """
    low, high = former.height_m[0] - 1e-9, former.height_m[-1] + 1e-9
    dips = new.height_m
    inside = (dips >= low) & (dips <= high) & (dips + zero_m >= low) & (dips + zero_m <= high)
    rows = np.flatnonzero(inside)
    if len(rows) < FEWEST_ROWS:
        expected = message(
            "compare_no_common_range",
            "dips from {low:g} to {high:g} m; expected some in the range of {other}, {from_m:g} to "
            "{to_m:g} m",
            low=float(dips[0]),
            high=float(dips[-1]),
            other=former.name,
            from_m=float(former.height_m[0]),
            to_m=float(former.height_m[-1]),
        )
        raise InputError(Problem(new.name, expected))
    return rows


def interpolate_volume(table, dips_m):
    """Volumes (n,) of a table at dips, by linear interpolation as in a gauge, m3."""
    return np.interp(dips_m, table.height_m, table.volume_m3)


def interpolation_error_m3(table, dips_m):
    """Bound of the error of `interpolate_volume`, from distances of rows to chords beside them.

    The error is 0 at rows of the table; distances within one digit are ignored. On a smooth curve,
    a row is V'' s^2 / 2 off the chord, and the middle between rows a fourth of it. A kink between
    two rows moves them off their chords by p and q; the error at the kink is 2 p q / (p + q).
    """
    heights, volumes = table.height_m, table.volume_m3
    if len(heights) < 3:
        return 0.0
    part = np.diff(heights)[:-1] / (heights[2:] - heights[:-2])
    chord = volumes[:-2] + part * (volumes[2:] - volumes[:-2])
    off = np.maximum(np.abs(volumes[1:-1] - chord) - table.volume_quantum_m3, 0.0)
    # Four rows around each interval: rows next to a kink are further off than those beyond.
    off = np.pad(off, 2, mode="edge")  # from the row below the first to the row above the last
    four = np.array([off[k : len(off) - 3 + k] for k in range(4)])
    smooth = four.min(axis=0)  # part of the distance that a smooth curve explains
    below, above = four[1] - smooth, four[2] - smooth
    kink = 2 * below * above / np.maximum(below + above, 1e-300)
    bound = smooth / 4 * SPARE + kink
    upper = np.clip(np.searchsorted(heights, dips_m - 1e-9), 1, len(heights) - 1)
    nearest = np.minimum(np.abs(heights[upper] - dips_m), np.abs(heights[upper - 1] - dips_m))
    return float(bound[upper - 1][nearest > 1e-7].max(initial=0.0))


def rounding_sd_m3(former, new):
    """Standard deviation of a difference of rows by the last digits of both tables, m3."""
    return np.hypot(former.volume_quantum_m3, new.volume_quantum_m3) / np.sqrt(12)


# ---- the zero


def _find_declared_zero(former, new):
    if former.reference_height_m is None or new.reference_height_m is None:
        return None
    return former.reference_height_m - new.reference_height_m


def _fit_zero(former, new, facts, densities):
    """Fit the height of the new zero above the former one to the volumes: (height, u), or None."""
    zero, sd_m3 = 0.0, rounding_sd_m3(former, new)
    # The area depends on the zero, so the linear adjustment is repeated.
    for _ in range(ROUNDS):
        try:
            rows = rows_in_both(former, new, zero)
        except InputError:
            return None
        _, _, basis = _steps(former, new, facts, densities, zero, rows, until="roof")
        dips, volumes = new.height_m[rows], new.volume_m3[rows]
        usable = _usable_rows(former, new, zero, dips)
        difference = adjust_difference(facts, dips, volumes - basis, volumes, sd_m3, usable)
        if difference is None:
            return None
        zero += difference.zero_m
        if abs(difference.zero_m) < SAME_ZERO_M:
            break
    return (zero, difference.u_zero_m) if abs(zero) < former.height_m[-1] else None


def _zero_shift(former, new, zero, fitted, rows):
    is_declared = _find_declared_zero(former, new) is not None
    area = slopes_m2(new.height_m, new.volume_m3)[rows]
    source = "reference_heights" if is_declared else "none" if zero is None else "fitted"
    return ZeroShift(
        height_m=zero or 0.0,
        u_m=fitted[1] if source == "fitted" else None,
        source=source,
        fitted_m=fitted and fitted[0],
        fitted_u_m=fitted and fitted[1],
        volume_m3=fitted and float(fitted[0] * np.median(area)),
    )


def _zero_step(step, shift, former, new):
    if shift.source == "reference_heights":
        state = "done" if shift.height_m else "same"
        source = "declared" if shift.height_m else None
        heights = former.reference_height_m, new.reference_height_m
        return replace(step, state=state, source=source, former=heights[0], new=heights[1])
    if shift.source == "fitted":
        return replace(step, state="done", source="fitted")
    if shift.fitted_m is not None:
        return replace(step, state="same")
    return replace(step, state="not_declared", lacking=_missing_keys(
        ("former.reference_height_m", former.reference_height_m),
        ("new.reference_height_m", new.reference_height_m),
    ))  # fmt: skip


# ---- the steps


def _steps(former, new, facts, densities, zero, rows, until="rounding"):
    """Return the steps {name: Step}, and the former volumes as printed and on the new basis.

    Each step function takes the volumes on the basis of the steps before it. `until` is the name of
    the last step.
    """
    dips = new.height_m[rows]
    before = interpolate_volume(former, dips)
    basis = interpolate_volume(former, dips + zero)
    steps = {"zero": Step(basis - before, "done")}
    makers = {
        "temperature": lambda basis: _temperature_step(former, new, facts, dips, basis),
        "head": lambda basis: _head_step(former, facts, densities, zero, dips, basis),
        "roof": lambda _: _roof_step(former, new, zero, dips),
        "rounding": lambda basis: _rounding_step(former, new, dips, basis),
    }
    for name, make in makers.items():
        steps[name] = make(basis)
        basis = basis + steps[name].added_m3
        if name == until:
            break
    return steps, before, basis


def _no_change(dips, state, **more):
    """Return a Step that changes no volume."""
    return Step(np.zeros(len(dips)), state, **more)


def _missing_keys(*pairs):
    """Return the keys of (key, value) pairs without a value."""
    return tuple(name for name, value in pairs if value is None)


def _temperature_step(former, new, facts, dips, basis):
    former_c, new_c = former.reference_temperature_c, new.reference_temperature_c
    values = {"former": former_c, "new": new_c}
    lacking = _missing_keys(
        ("former.reference_temperature_c", former_c), ("new.reference_temperature_c", new_c)
    )
    if lacking:
        return _no_change(dips, "not_declared", lacking=lacking, **values)
    if former_c == new_c:
        return _no_change(dips, "same", **values)
    if facts.kind is None:
        return _no_change(dips, "not_declared", lacking=("kind",), **values)
    scale = 1 + facts.expansion_per_k * (new_c - former_c)
    if facts.kind == "vertical" and not facts.dips_expand:
        added = basis * (scale**2 - 1)  # only areas expand
    else:
        area = slopes_m2(dips, basis) if len(dips) > 2 else 0.0
        # V s^3 at the dip h / s, to first order in the change of the dip
        added = basis * (scale**3 - 1) + scale**3 * area * dips * (1 / scale - 1)
    return Step(added, "done", "declared", **values)


def _head_step(former, facts, densities, zero, dips, basis):
    former_head, new_head = densities
    values = {"former": former_head.kg_m3, "new": new_head.kg_m3}
    lacking = _missing_keys(
        ("former.liquid_density_kg_m3", former_head.kg_m3),
        ("new.liquid_density_kg_m3", new_head.kg_m3),
    )
    if lacking:
        return _no_change(dips, "not_declared", lacking=lacking, **values)
    if former_head.kg_m3 == new_head.kg_m3:
        return _no_change(dips, "same", **values)
    if not facts.has_plates:
        lacking = ("courses.thickness_mm",) if facts.is_shell else ("courses",)
        return _no_change(dips, "not_possible", lacking=lacking, **values)
    rings = Rings(facts.edges_m(), facts.thickness_m, facts.modulus_pa, is_first_order=False)
    zone = former.roof and former.roof.critical_m
    zone = zone and tuple(edge - zero for edge in zone)
    radii = estimate_radii(rings, dips, basis, former_head.kg_m3, zone)
    # The same unloaded rings, once under each head.
    before, after = (rings.volume_m3(dips, radii, head.kg_m3) for head in (former_head, new_head))
    source = "read" if "read" in (former_head.source, new_head.source) else "declared"
    return Step(after - before, "done", source, **values)


def _roof_step(former, new, zero, dips):
    former_roof, new_roof = former.roof, new.roof
    if former_roof is None and new_roof is None:
        return _no_change(dips, "same")
    lacking = _missing_keys(("former.roof", former_roof), ("new.roof", new_roof))
    if lacking:
        return _no_change(dips, "not_declared", lacking=lacking)
    former_m3, new_m3 = _displacement_m3(former_roof), _displacement_m3(new_roof)
    values = {"former": former_m3, "new": new_m3}
    zone = new_roof.critical_m or (
        former_roof.critical_m and tuple(x - zero for x in former_roof.critical_m)
    )
    if former_m3 == new_m3:
        return _no_change(dips, "same", **values)
    if zone is None:
        return _no_change(dips, "not_declared", lacking=("new.roof.critical_m",), **values)
    # The displaced volume counts fully above the critical zone, and in part within it.
    afloat = np.clip((dips - zone[0]) / max(zone[1] - zone[0], 1e-9), 0.0, 1.0)
    return Step((former_m3 - new_m3) * afloat, "done", "declared", **values)


def _displacement_m3(roof):
    """Volume displaced by a floating roof in the liquid for which it was computed, m3."""
    part = floating_roof(roof.mass_kg, 0.0, 1.0, roof.density_kg_m3, roof.weighing)
    return float(part.displacement_m3())


def _rounding_step(former, new, dips, basis):
    digit = new.volume_quantum_m3
    values = {"former": former.volume_quantum_m3, "new": digit}
    if digit == 0:
        return _no_change(dips, "same", **values)
    added = np.round(basis / digit) * digit - basis
    added[np.abs(added) < 1e-9 * digit] = 0.0
    state = "done" if added.any() else "same"
    return Step(added, state, "declared" if state == "done" else None, **values)


def _usable_rows(former, new, zero, dips):
    """Whether the roofs of both tables are aground or afloat at each dip, shape (rows,)."""
    usable = np.full(len(dips), True)
    for table, shift in ((former, zero), (new, 0.0)):
        if table.roof is not None and table.roof.critical_m is not None:
            low, high = table.roof.critical_m
            usable &= (dips + shift <= low + 1e-9) | (dips + shift >= high - 1e-9)
    return usable


def _basis_step(name, step, dips):
    most = int(np.argmax(np.abs(step.added_m3)))
    return BasisStep(
        code=name,
        state=step.state,
        source=step.source,
        former=step.former,
        new=step.new,
        unit=UNITS[name],
        lacking=list(step.lacking),
        top_m3=float(step.added_m3[-1]),
        largest_m3=float(step.added_m3[most]),
        largest_at_m=float(dips[most]),
    )
