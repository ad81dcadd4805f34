"""Verdict of a comparison by a rule and by agreement: keep, recompute or recalibrate.

recalibrate  a value exceeds the limit of the rule, |E_n| exceeds 1, or the former table is older
             than the rule allows. Also if all volumes differ by an undeclared zero larger than the
             limit of the rule for the reference height.
recompute    the tank agrees; zero, temperature, head or roof differ from those of the new table
keep         no difference
"""

from dataclasses import dataclass
from datetime import date

import numpy as np

from tankcal.record.comparison import LegalNumber, Reason, TableAge
from tankcal.tank.capacity import Quantity
from tankcal.tank.rules.verdict import StatedVolume, judge_volume

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
