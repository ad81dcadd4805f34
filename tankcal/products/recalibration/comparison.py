"""Comparison of two tables of a tank, and the verdict: keep, recompute or recalibrate.

recalibrate  a value exceeds the limit of the rule, |E_n| exceeds 1, or the former table is older
             than the rule allows. Also if all volumes differ by an undeclared zero larger than the
             limit of the rule for the reference height.
recompute    the tank agrees; zero, temperature, head or roof differ from those of the new table
keep         no difference

`tankcal compare`: compare a former and a new table of one tank on a common basis.

The input comprises two tables, declared facts, courses and a rule.
"""

from dataclasses import dataclass, replace
from datetime import date
from hashlib import sha256
from pathlib import Path

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job.folder import parsed_toml
from tankcal.job.rule_files import named_rule
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.products.recalibration.agreement import (
    compare_courses,
    compare_deliveries,
    coverage_factor,
    critical_correlation,
    find_worst_by_error,
    find_worst_by_share,
    interpolate_uncertainty,
    normalized_error,
)
from tankcal.products.recalibration.basis import bring_to_one_basis, collect_facts, rounding_sd_m3
from tankcal.products.recalibration.former import read_courses
from tankcal.products.recalibration.reading import read_former
from tankcal.record.recalibration import (
    ComparedDelivery,
    ComparedRows,
    ComparedTable,
    ComparisonFile,
    ComparisonRule,
    Correlation,
    LegalNumber,
    Material,
    ReadOut,
    Reason,
    RoofInTable,
    TableAge,
    Waterfall,
)
from tankcal.record.schema import fill_from, warnings_of
from tankcal.tank.capacity import Quantity
from tankcal.tank.rules import StatedVolume, judge_volume

DAYS_OF_YEAR = 365.25
USUAL_LIMIT_M = 5e-3  # limit of an undeclared zero for rules without a limit
ON_BASIS = ("zero", "temperature", "head", "roof")  # differences corrected by recomputation
FAILED = ("fails", "guard_band")


@dataclass(frozen=True)
class Verdict:
    """The verdict, its reasons, and whether all its limits were verified in the rule's text."""

    code: str | None
    verified: bool
    reasons: tuple[Reason, ...]


@dataclass(frozen=True)
class WorstError:
    """The judged row or delivery with the largest |E_n|.

    Attributes
    ----------
    E_n, at_half : float
        With the declared c, or c = 0; with c = 0.5.
    low_m : float or None
        Lower dip of a delivery.
    high_m : float
    d_m3, U_new_m3, U_former_m3, c_limit : float
    """

    E_n: float
    at_half: float
    low_m: float | None
    high_m: float
    d_m3: float
    U_new_m3: float
    U_former_m3: float
    c_limit: float

    @property
    def place(self):
        """{name: value} of its position, for a Reason; without low_m for a row."""
        low = {} if self.low_m is None else {"low_m": self.low_m}
        return low | {"high_m": self.high_m, "d_m3": self.d_m3}


def tank_kind_of_rules(facts, former, new):
    """Kind of tank in the terms of the rules."""
    if facts.kind == "vertical":
        has_roof = former.roof is not None or new.roof is not None
        return "vertical_floating_roof" if has_roof else "vertical_fixed_roof"
    return facts.kind if facts.kind in ("horizontal", "sphere") else "other"


# ---- limits of a rule


def judge_limits(rule, tank, former, new, basis, new_U):
    """Return the `LegalNumber` of each limit of a rule for a kind of tank.

    Parameters
    ----------
    rule : Rule
    tank : str
        Kind of tank in the terms of the rules.
    former, new : FormerTable
    basis : OneBasis
    new_U : TableUncertainty
        Uncertainty of the new table at the rows.
    """
    numbers = [
        _deviation(limit.in_service(), basis, new_U)  # the former table is in use
        for limit in rule.deviation
        if limit.applies_to(tank) and basis.usable.any()
    ]
    heights = [limit for limit in rule.reference_height if limit.applies_to(tank)]
    return [*numbers, *(_reference_height(height, former, new) for height in heights)]


def _deviation(limit, basis, new_U):
    """Judge the deviation of the new volume from the former one on the basis of the new table.

    The deviation from the former volume as printed is stated, but not judged.
    """
    use = np.flatnonzero(basis.usable)
    low, high, code = _find_judged_rows(limit, basis, use)
    stated = _volume(basis.on_basis_m3, low, high)
    value = _volume(basis.new_m3, low, high)
    U = (
        new_U.rows()[high]
        if low is None
        else new_U.deliveries(np.array([low]), np.array([high]))[0]
    )
    # Without a known U, a rule without guard band is still judged; see `unknown` below.
    known = 0.0 if np.isnan(U) else float(U)
    dips = [float(basis.height_m[dip]) for dip in (low, high) if dip is not None]
    judged = judge_volume(
        limit,
        StatedVolume(stated, dips[-1], dips[0] if low is not None else None),
        Quantity(value, known / new_U.k, np.inf, new_U.k, known),
        known,
    )
    printed = _volume(basis.former_m3, low, high)
    if limit.limit is not None:
        unit, size = "%", 100 * limit.limit
        numbers = 100 * (value - stated) / abs(stated), 100 * (value - printed) / abs(printed)
    else:
        unit, size = "m3", limit.limit_m3
        numbers = value - stated, value - printed
    unknown = limit.guard == "U" and np.isnan(U)
    return LegalNumber(
        code=code,
        limit=float(size),
        unit=unit,
        value=float(numbers[0]),
        as_printed=float(numbers[1]),
        at_m=dips,
        verdict="not_judged" if unknown else judged.code,
        clause=limit.clause,
        verified=limit.verified,
    )


def _find_judged_rows(limit, basis, use):
    """Rows (low or None, high, code) at which a limit is judged."""
    if limit.of == "capacity":
        return None, use[-1], "top"
    if limit.of == "deliveries":
        return use[0], use[-1], "range"
    share = np.abs(basis.new_m3 - basis.on_basis_m3)[use]
    share = share / np.maximum(basis.on_basis_m3[use], 1e-9)
    if limit.limit is None:
        share = np.abs(basis.new_m3 - basis.on_basis_m3)[use]
    return None, use[int(np.argmax(share))], "row"


def _volume(volumes, low, high):
    return float(volumes[high] - (0.0 if low is None else volumes[low]))


def _reference_height(limit, former, new):
    value = None
    if former.reference_height_m is not None and new.reference_height_m is not None:
        value = 1000 * (new.reference_height_m - former.reference_height_m)
    verdict = "not_judged"
    if value is not None:
        kept = abs(value) <= 1000 * limit.limit_m * (1 + 1e-9)
        verdict = "conforms" if kept else "fails"
    return LegalNumber(
        code="reference_height",
        limit=1000 * limit.limit_m,
        unit="mm",
        value=value,
        as_printed=value,
        at_m=[],
        verdict=verdict,
        clause=limit.clause,
        verified=limit.verified,
    )


def judge_ages(rule, tank, former, new):
    """Return the `TableAge` of each period of a rule for a kind of tank."""
    years = _years_between(former.date, new.date)
    return [
        TableAge(
            name=period.name,
            of=period.of,
            years=period.years,
            age_years=years,
            verdict="not_judged"
            if years is None
            else "fails"
            if years > period.years
            else "conforms",
            clause=period.clause,
            verified=period.verified,
        )
        for period in rule.periods
        if period.applies_to(tank)
    ]


def _years_between(before, after):
    """Years between two dates given as text; None if one is unknown, or the order is wrong."""
    try:
        first, last = (date.fromisoformat(str(text)[:10]) for text in (before, after))
    except ValueError:
        return None
    years = (last - first).days / DAYS_OF_YEAR
    return None if years < 0 else years


# ---- the verdict


def find_zero_limit(rule, tank):
    """Largest undeclared zero, m, by the rule or by default."""
    return min((limit.limit_m for limit in rule.reference_height if limit.applies_to(tank)),
               default=USUAL_LIMIT_M)  # fmt: skip


def decide(legal, ages, basis, worst, c, zero_limit_m):
    """Return the Verdict.

    Parameters
    ----------
    legal : sequence of LegalNumber
    ages : sequence of TableAge
    basis : OneBasis
    worst : WorstError or None
        None: a U is unknown.
    c : float or None
        FormerFacts correlation.
    zero_limit_m : float
        Largest zero that may be fitted without declaration; a larger one may be a changed bottom.
    """
    steps, zero = basis.steps, basis.zero
    grave = [*_limit_reasons(legal), *_difference_reasons(worst, c)]
    if zero.source == "fitted" and abs(zero.height_m) > zero_limit_m:
        volumes = {"d_m3": zero.volume_m3, "zero_mm": 1000 * zero.height_m}
        grave.append(Reason("zero_not_explained", volumes | {"most_mm": 1000 * zero_limit_m}))
    grave += _age_reasons(ages)
    judged = [item for item in (*legal, *ages) if item.verdict != "not_judged"]
    differing = [name for name in ON_BASIS if steps[name].state == "done"]
    undone = {
        name: list(step.lacking)
        for name, step in steps.items()
        if step.state in ("not_declared", "not_possible")
    }
    mild = []
    if differing:
        mild.append(Reason("basis_differs", {"steps": differing}))
    mild += [Reason("step_not_done", {"step": n, "lacking": what}) for n, what in undone.items()]
    mild += _agreement_reasons(worst, c)
    kept = [number.code for number in legal if number.verdict == "conforms"]
    if kept:
        mild.append(Reason("limits_kept", {"limits": kept}))
    mild += [
        Reason("limit_not_judged", {"limit": number.code})
        for number in legal
        if number.verdict == "not_judged"
    ]
    mild += [
        Reason("age_not_judged", {"of": age.of, "years": age.years})
        for age in ages
        if age.verdict == "not_judged"
    ]
    code = "recalibrate" if grave else "recompute" if differing else "keep"
    if not (grave or worst or any(item in legal for item in judged)):
        code, grave = None, [Reason("nothing_to_judge", {})]
    return Verdict(code, all(item.verified for item in judged), (*grave, *mild))


def _limit_reasons(legal):
    return [
        Reason(
            "limit_exceeded" if number.verdict == "fails" else "in_guard_band",
            {
                "limit": number.code,
                "value": number.value,
                "most": number.limit,
                "unit": number.unit,
            },
        )
        for number in legal
        if number.verdict in FAILED
    ]


def _age_reasons(ages):
    return [
        Reason(
            "age_of_bottom_course_exceeded" if age.of == "bottom_course" else "age_exceeded",
            {"age": age.age_years, "years": age.years},
        )
        for age in ages
        if age.verdict == "fails"
    ]


def _difference_reasons(worst, c):
    if worst is None or not abs(worst.E_n) > 1:
        return []
    return [
        Reason(
            "tank_differs",
            {"E_n": worst.E_n if np.isfinite(worst.E_n) else None, "c": c or 0.0, **worst.place},
        )
    ]


def _agreement_reasons(worst, c):
    reasons = []
    if worst is None:
        return [Reason("E_n_not_known", {})]
    if abs(worst.E_n) <= 1:
        reasons.append(Reason("tank_agrees", {"E_n": worst.E_n, "c": c or 0.0, **worst.place}))
    if c is None:
        limit = None if np.isnan(worst.c_limit) else worst.c_limit
        reasons.append(Reason("c_not_declared", {"c_limit": limit}))
    return reasons


MINIMUM_M = (1.5, 2.0, 3.0)  # smallest heights of deliveries
DEFAULT_RULE = "france_2020_recalibration"
JUDGED_PART = 0.1  # share of the range above which rows of a low tank are judged
MOST_APART = 0.2  # largest relative difference of volumes of one tank
PARTS_OF_HEIGHT = (0.2, 0.4, 0.6, 0.8, 1.0)  # relative heights of the rows of the waterfall
ZERO_APART = 3.0  # significant difference of fitted and declared zero, standard uncertainties
LEAST_ZERO_M = 1e-3  # smallest reported difference of zeros
BEFORE_ZERO = ("temperature", "head", "roof")  # steps that bias a fitted zero if omitted
RECORD = "record.json"


@dataclass(frozen=True)
class _Agreement:
    """Uncertainties and correlation from which E_n is computed."""

    c: float | None
    former_U: object
    new_U: object
    E_n: np.ndarray
    c_limit: np.ndarray

    @property
    def used_c(self):
        return 0.0 if self.c is None else self.c


def compare(former, new, *, rule=None, courses=None, fingerprints=("", "")):
    """Compare a former table with a new table of one tank.

    Parameters
    ----------
    former, new : FormerTable
        See `recalibration.reading.read_former`. `common` of either table is the correlation of
        their errors.
    rule : (Rule, file name), optional
        Rule by which the new table is judged; None: the French rule of 2020.
    courses : (heights, thicknesses), optional
        Courses of an upright tank, m, (n,) each, if neither table is a record with courses.
    fingerprints : (str, str)
        SHA-256 of both files.

    Returns
    -------
    record.recalibration.ComparisonFile

    Raises
    ------
    InputError
        For tables of different kinds of tank, without a common range, or with volumes too different
        for one tank or one unit.

    Examples
    --------
    >>> import numpy as np
    >>> from tankcal.products.recalibration.former import FormerTable
    >>> dips = np.linspace(0.0, 8.0, 81)
    >>> former = FormerTable("old.csv", dips, 100 * dips, U_m3=0.2 * dips, common=0.0)
    >>> new = FormerTable("new.csv", dips, 100.05 * dips, U_m3=0.15 * dips)
    >>> result = compare(former, new)
    >>> result.verdict, round(float(result.rows.d_m3[-1]), 3), round(float(result.rows.E_n[-1]), 2)
    ('keep', 0.4, 0.2)
    """
    c = _find_correlation(former, new)
    _refuse_other_kinds(former, new)
    facts = collect_facts(former, new, courses)
    chosen, file = rule or named_rule(DEFAULT_RULE, Log())
    basis = bring_to_one_basis(former, new, facts)
    _refuse_other_tanks(former, new, basis)
    agreement = _agreement(former, new, basis, c)
    deliveries = _deliveries(basis, agreement)
    from_m, worst = _find_worst_error(basis, agreement, deliveries)
    tank = tank_kind_of_rules(facts, former, new)
    legal = judge_limits(chosen, tank, former, new, basis, agreement.new_U)
    ages = judge_ages(chosen, tank, former, new)
    verdict = decide(legal, ages, basis, worst, c, find_zero_limit(chosen, tank))
    return ComparisonFile(
        tank=_tank_id(former, new),
        notice=_notice(former, new),
        former=_table(former, fingerprints[0], agreement.former_U),
        new=_table(new, fingerprints[1], agreement.new_U),
        material=Material(facts.expansion_per_k, facts.modulus_pa, facts.material_source),
        low_m=float(basis.height_m[0]),
        high_m=float(basis.height_m[-1]),
        interpolation_m3=basis.interpolation_m3,
        steps=basis.basis_steps,
        zero=basis.zero,
        rows=ComparedRows(
            height_m=basis.height_m,
            former_m3=basis.former_m3,
            former_on_basis_m3=basis.on_basis_m3,
            new_m3=basis.new_m3,
            d_m3=basis.new_m3 - basis.on_basis_m3,
            U_former_m3=agreement.former_U.rows(),
            U_new_m3=agreement.new_U.rows(),
            E_n=agreement.E_n,
            c_limit=agreement.c_limit,
            for_use=basis.usable,
        ),
        waterfall=_waterfall(basis),
        deliveries=deliveries,
        courses=compare_courses(
            facts,
            basis,
            agreement.former_U,
            agreement.new_U,
            agreement.used_c,
            float(rounding_sd_m3(former, new)),
        ),
        correlation=Correlation(
            c=agreement.c,
            source="not_declared" if agreement.c is None else "declared",
            worst_E_n=worst and worst.E_n,
            worst_E_n_at_half=worst and worst.at_half,
            c_limit=worst and worst.c_limit,
            coverage_k=agreement.new_U.k if worst else None,
        ),
        judged_from_m=from_m,
        legal=legal,
        ages=ages,
        rule=fill_from(ComparisonRule, chosen, file=file, is_default=rule is None),
        verdict=verdict.code,
        verified=verdict.verified,
        reasons=list(verdict.reasons),
        read=_list_estimated_values(former, new, basis),
        warnings=warnings_of(_warnings(former, new, basis)),
    )


# ---- tables that cannot be compared


def _find_correlation(former, new):
    """FormerFacts correlation of the tables, or None."""
    former_c, new_c = former.common, new.common
    if former_c is not None and new_c is not None and former_c != new_c:
        expected = message(
            "compare_two_correlations",
            "common is {one:g} there and {two:g} for {other}; expected one correlation of both",
            one=new_c,
            two=former_c,
            other=former.name,
        )
        raise InputError(Problem(new.name, expected))
    return former_c if former_c is not None else new_c


def _refuse_other_kinds(former, new):
    if None in (former.kind, new.kind) or former.kind == new.kind:
        return
    expected = message(
        "compare_other_kind",
        "a {kind} tank, but {other} is of a {other_kind} one; expected two tables of one tank",
        kind=new.kind,
        other=former.name,
        other_kind=former.kind,
    )
    raise InputError(Problem(new.name, expected))


def _refuse_other_tanks(former, new, basis):
    former_m3, new_m3, dip = basis.former_m3[-1], basis.new_m3[-1], basis.height_m[-1]
    if abs(new_m3 - former_m3) <= MOST_APART * max(abs(former_m3), abs(new_m3)):
        return
    expected = message(
        "compare_other_tank",
        "{new:.6g} m3 at {dip:g} m, but {former:.6g} m3 in {other}; expected two tables of one "
        "tank, in the units that their headings name",
        new=float(new_m3),
        dip=float(dip),
        former=float(former_m3),
        other=former.name,
    )
    raise InputError(Problem(new.name, expected))


# ---- the agreement


def _agreement(former, new, basis, c):
    """Return U of both tables at the rows, of one coverage, and E_n of the rows."""
    k = coverage_factor(new if new.U_m3 is not None else former)
    dips = basis.height_m
    former_U = interpolate_uncertainty(
        former, dips + basis.zero.height_m, basis.on_basis_m3, k, basis.interpolation_m3
    )
    new_U = interpolate_uncertainty(new, dips, basis.new_m3, k)
    d, U = basis.new_m3 - basis.on_basis_m3, (new_U.rows(), former_U.rows())
    E_n = normalized_error(d, *U, 0.0 if c is None else c)
    return _Agreement(c, former_U, new_U, E_n, critical_correlation(d, *U))


def _deliveries(basis, agreement):
    """Return the worst deliveries of each minimum height, by |d| / V and by |E_n|."""
    deliveries = []
    U = agreement.former_U, agreement.new_U, agreement.used_c
    use = np.flatnonzero(basis.usable)
    for minimum in MINIMUM_M:
        pair = find_worst_by_share(basis, minimum)
        if pair is None:
            continue
        by_share = compare_deliveries(basis, *U, *pair)
        deliveries.append(_delivery(basis, minimum, "relative", by_share))
        worst = find_worst_by_error(basis, *U, minimum, also=(pair, (use[0], use[-1])))
        if worst is not None:
            deliveries.append(_delivery(basis, minimum, "E_n", worst))
    return deliveries


def _delivery(basis, minimum, by, worst):
    low, high = int(worst.low[0]), int(worst.high[0])
    d, former = float(worst.d_m3[0]), float(worst.former_m3[0])
    return ComparedDelivery(
        minimum_m=minimum,
        by=by,
        low_m=float(basis.height_m[low]),
        high_m=float(basis.height_m[high]),
        former_m3=former,
        new_m3=former + d,
        d_m3=d,
        relative=d / former if former else np.nan,
        U_former_m3=float(worst.U_former_m3[0]),
        U_new_m3=float(worst.U_new_m3[0]),
        E_n=float(worst.E_n[0]),
        c_limit=float(worst.c_limit[0]),
    )


def _find_worst_error(basis, agreement, deliveries):
    """Return the lowest judged dip, and the WorstError or None of rows and deliveries."""
    dips = basis.height_m
    reach = dips[-1] - dips[0]
    from_m = float(dips[0] + (MINIMUM_M[0] if reach > 2 * MINIMUM_M[0] else JUDGED_PART * reach))
    judged = np.flatnonzero(basis.usable & (dips >= from_m - 1e-9))
    candidates = []
    if len(judged) and not np.isnan(agreement.E_n[judged]).all():
        row = int(judged[np.nanargmax(np.abs(agreement.E_n[judged]))])
        d = float(basis.new_m3[row] - basis.on_basis_m3[row])
        U = float(agreement.new_U.rows()[row]), float(agreement.former_U.rows()[row])
        candidates.append((agreement.E_n[row], None, dips[row], d, *U, agreement.c_limit[row]))
    candidates += [
        (
            delivery.E_n,
            delivery.low_m,
            delivery.high_m,
            delivery.d_m3,
            delivery.U_new_m3,
            delivery.U_former_m3,
            delivery.c_limit,
        )
        for delivery in deliveries
        if not np.isnan(delivery.E_n)
    ]
    if not candidates:
        return from_m, None
    E_n, low, high, d, U_new, U_former, c_limit = max(
        candidates, key=lambda candidate: abs(candidate[0])
    )
    half = float(normalized_error(d, U_new, U_former, 0.5))
    return from_m, WorstError(
        float(E_n), half, low, float(high), d, U_new, U_former, float(c_limit)
    )  # fmt: skip


# ---- content of the file


def _waterfall(basis):
    """Return rows at given parts of the range, each the nearest row for use."""
    use = np.flatnonzero(basis.usable)
    dips = basis.height_m[use]
    at = [dips[0] + part * (dips[-1] - dips[0]) for part in PARTS_OF_HEIGHT]
    chosen = dict.fromkeys(int(use[np.argmin(np.abs(dips - index))]) for index in at)
    return [
        Waterfall(
            height_m=float(basis.height_m[row]),
            former_m3=float(basis.former_m3[row]),
            **{f"{name}_m3": float(step.added_m3[row]) for name, step in basis.steps.items()},
            tank_m3=float(basis.new_m3[row] - basis.on_basis_m3[row]),
            new_m3=float(basis.new_m3[row]),
        )
        for row in chosen
    ]


def _table(table, fingerprint, U):
    return fill_from(
        ComparedTable,
        table,
        sha256=fingerprint,
        origin="table" if table.record is None else "record",
        rows=len(table.height_m),
        low_m=float(table.height_m[0]),
        high_m=float(table.height_m[-1]),
        top_volume_m3=float(table.volume_m3[-1]),
        roof=fill_from(RoofInTable, table.roof),
        k=None if table.U_m3 is None else table.k,
        U_top_m3=None if table.U_m3 is None else float(table.U_m3[-1]),
        U_of_deliveries=U.deliveries_by,
    )


def _tank_id(former, new):
    for table in (new, former):
        if table.record is not None:
            return table.record["job"]["tank"].get("id")
    return None


def _notice(former, new):
    """Notice in the report of the new table, else of the former table; "" if none."""
    records = [table.record for table in (new, former) if table.record is not None]
    notices = [str(record["job"]["certificate"].get("notice") or "") for record in records]
    return next(filter(None, notices), "")


def _list_estimated_values(former, new, basis):
    """Return the values that were estimated from the tables because they are not declared."""
    estimates = []
    for name, density in zip(("former", "new"), basis.densities, strict=True):
        if density.head is not None:
            sure = "sure" if density.head != "undecided" else "doubtful"
            used, value, u = density.source == "read", density.read_kg_m3, density.u_kg_m3
            estimates.append(ReadOut(name, f"head_{density.head}", value, u, "kg/m3", sure, used))
    zero = basis.zero
    if zero.fitted_m is not None:
        is_seen = abs(zero.fitted_m) > ZERO_APART * (zero.fitted_u_m or 0.0)
        is_seen &= all(basis.steps[step].state in ("done", "same") for step in BEFORE_ZERO)
        estimates.append(
            ReadOut(
                "former", "zero", zero.fitted_m, zero.fitted_u_m, "m",
                "sure" if is_seen else "doubtful", zero.source == "fitted",
            )
        )  # fmt: skip
    for name, table in (("former", former), ("new", new)):
        if table.record is None:
            digit = table.volume_quantum_m3
            estimates.append(ReadOut(name, "rounding_volume", digit, None, "m3", "sure", True))
    return estimates


def _warnings(former, new, basis):
    """Return the warnings of both tables and of their zeros."""
    problems = [*former.warnings, *new.warnings]
    if former.date and new.date and str(former.date)[:10] > str(new.date)[:10]:
        text = message(
            "compare_dates_turned",
            "of {date}, later than {other} of {newer}: is the former table the new one? no age is "
            "judged",
            date=str(former.date)[:10],
            other=new.name,
            newer=str(new.date)[:10],
        )
        problems.append(Problem(former.name, text))
    zero = basis.zero
    if zero.source == "fitted":
        text = message(
            "compare_zero_or_bottom",
            "all volumes differ by {volume:.4g} m3, as if the zero had moved by {height:+.1f} mm "
            "(+: up); a bottom that has changed looks the same: declare both reference heights to "
            "tell",
            volume=zero.volume_m3,
            height=1000 * zero.height_m,
        )
        problems.append(Problem(new.name, text))
    if zero.source == "reference_heights" and zero.fitted_m is not None:
        apart = abs(zero.fitted_m - zero.height_m)
        if apart > max(LEAST_ZERO_M, ZERO_APART * zero.fitted_u_m):
            text = message(
                "compare_zero_apart",
                "the reference heights put the zero {declared:.1f} mm higher, the volumes "
                "{fitted:.1f} mm; expected both alike, unless the bottom has changed",
                declared=1000 * zero.height_m,
                fitted=1000 * zero.fitted_m,
            )
            problems.append(Problem(new.name, text))
    return problems


@dataclass(frozen=True)
class Asked:
    """Paths of the tables to compare.

    Attributes
    ----------
    old, new : path
        Tables in any form that `read_former` reads, or folders of results.
    former, new_former : path or None
        former.toml of each table.
    courses : path or None
        courses.csv.
    rule : str or None
        Name of a shipped rule, or path of a file.
    """

    old: str | Path
    new: str | Path
    former: str | Path | None = None
    new_former: str | Path | None = None
    courses: str | Path | None = None
    rule: str | None = None


def compare_files(asked) -> ComparisonFile:
    """Compare the tables in two files; report all problems of all files together.

    Returns
    -------
    record.recalibration.ComparisonFile

    Raises
    ------
    InputError
        With every problem of the tables, their former.toml, courses.csv and the rule; or if the
        tables cannot be compared (`comparison.compare`).
    """
    log = Log()
    old, former = _read_table(asked.old, asked.former, log)
    recent, new = _read_table(asked.new, asked.new_former, log)
    courses = None if asked.courses is None else read_course_sizes(asked.courses, log)
    rule = None if asked.rule is None else named_rule(asked.rule, log)
    log.stop_if_problems()
    if former.name == new.name:
        former, new = _name_with_folders((old, former), (recent, new))
    fingerprints = tuple(
        sha256(rows_file(source).read_bytes()).hexdigest() for source in (old, recent)
    )
    return compare(former, new, rule=rule, courses=courses, fingerprints=fingerprints)


def _read_table(source, declared, log):
    """Return (path, FormerTable or None) of a file, or of the record in a folder of results."""
    path = Path(source)
    if path.is_dir():
        folder, path = path, path / RECORD
        if not path.is_file():
            expected = message(
                "compare_no_record",
                "a folder without record.json; expected a table, or a folder of results",
            )
            log.problem(folder.name or str(folder), expected)
            return path, None
    try:
        return path, read_former(path, declared)
    except InputError as error:
        log.problems += error.problems
        return path, None


def _name_with_folders(*tables):
    """Return both FormerTables, with enough folders in their names to make the names differ."""
    folders = [path.resolve().parent.parts for path, _ in tables]
    for count in range(1, max(map(len, folders))):
        first, second = ("/".join(parts[-count:]) for parts in folders)
        if first != second:
            return [
                replace(table, name=f"{folder}/{table.name}")
                for folder, (_, table) in zip((first, second), tables, strict=True)
            ]
    return [table for _, table in tables]


def rows_file(path):
    """Path of the file with the rows: for a former.toml, the file that it names."""
    if path.suffix.lower() != ".toml":
        return path
    content, _ = parsed_toml(path.name, path.read_bytes(), Log())
    return path.parent / content["former"]["file"]


def read_course_sizes(path, log):
    """Return (heights, thicknesses) of a courses.csv, m, from the bottom up.

    None after problems.
    """
    courses = read_courses(path, log)
    if courses is None:
        return None
    if np.isnan(courses.heights_m).any():
        expected = message(
            "compare_no_height",
            "heights that are not known; expected all of them: tankcal read-table finds the seams",
        )
        log.problem(courses.file, expected, None, "height_m")
    return courses.heights_m, courses.thickness_m
