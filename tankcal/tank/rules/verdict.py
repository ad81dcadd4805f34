"""All limits of a rule for a table: a verdict for each limit, and a verdict for the rule."""

from dataclasses import dataclass

import numpy as np

from tankcal.tank.rules.deviation import DeviationVerdict, judge_deviation
from tankcal.tank.rules.expanded import UncertaintyVerdict, deliveries_to_judge, judge_uncertainty
from tankcal.tank.rules.model import TANKS, Rule, printed_of_table


@dataclass(frozen=True)
class RuleVerdict:
    """Verdict of a Rule for a table.

    Attributes
    ----------
    rule : Rule
    tank : str
        Kind of tank.
    code : str
        "passed": every limit is met everywhere; "passed_in_part": the uncertainty meets its limits
        from some level on; "failed"; "not_accepted": no limit fails, but a deviation is in a guard
        band; "stated": the rule has no numerical limit; "nothing_to_judge"; "not_all_judged": no
        limit failed, but `unjudged` limits could not be applied; "not_for_this_tank": no limit for
        the kind or capacity.
    verified : bool
        Whether all values in use were read in the legal text itself.
    capacity_m3 : float
        Volume of the highest row for use; nan: no row is for use.
    uncertainty, deviation
        Verdicts of the limits for this kind of tank.
    unjudged : tuple of str
        Names of the limits without a row, delivery or stated volume.
    """

    rule: Rule
    tank: str
    code: str
    verified: bool
    capacity_m3: float
    uncertainty: tuple[UncertaintyVerdict, ...]
    deviation: tuple[DeviationVerdict, ...]
    unjudged: tuple[str, ...]


def judge(rule, table, tank, lowest_m=None, stated=(), printed=None):
    """Return the RuleVerdict of a Rule for a Capacity of a kind of tank.

    Parameters
    ----------
    rule : Rule
    table : Capacity
    tank : str
        One of tankcal.tank.rules.TANKS.
    lowest_m : float, optional
        Dip at the start of the calibrated zone, see `judge_uncertainty`.
    stated : sequence of StatedVolume, optional
        Stated volumes for the deviations.
    printed : PrintedU, optional
        Printed uncertainties, such as Monte Carlo's; None: those of the table.

    Returns
    -------
    RuleVerdict

    Raises
    ------
    ValueError
        For an unknown kind of tank.
    HeightError
        For a dip outside the table.
    """
    if tank not in TANKS:
        raise ValueError(f"kind of tank {tank!r}: expected one of {', '.join(TANKS)}")
    printed = printed or printed_of_table(table)
    # The capacity is the volume of the highest row for use.
    rows = np.flatnonzero(table.for_use(table.height_m))
    capacity = float(table.volume_m3[rows[-1]]) if len(rows) else np.nan
    is_too_large = rule.largest_capacity_m3 is not None and capacity > rule.largest_capacity_m3
    limits = [] if is_too_large else [item for item in rule.uncertainty if _applies_to(item, tank)]
    others = [] if is_too_large else [item for item in rule.deviation if _applies_to(item, tank)]
    uncertainty = tuple(judge_uncertainty(item, table, lowest_m, printed) for item in limits)
    pairs = [judge_deviation(limit, table, item, printed) for limit in others for item in stated]
    deviation = tuple(verdict for verdict in pairs if verdict is not None)
    verdicts = (*uncertainty, *deviation)
    applied = [verdict.limit for verdict in verdicts]
    judged_limits = [v.limit for v in verdicts if v.code not in ("nothing_to_judge", "not_for_use")]
    # A limit without any verdict must be visible to the user.
    unjudged = tuple(item.name for item in (*limits, *others) if item not in judged_limits)
    return RuleVerdict(
        rule=rule,
        tank=tank,
        code=_code(verdicts, unjudged) if limits or others else "not_for_this_tank",
        verified=all(limit.verified for limit in applied) if applied else rule.verified,
        capacity_m3=capacity,
        uncertainty=uncertainty,
        deviation=deviation,
        unjudged=unjudged,
    )


def deliveries_to_check(rule, table, tank):
    """Return the deliveries that decide the limits of a rule, each once.

    Parameters
    ----------
    rule : Rule
    table : Capacity
    tank : str
        Kind of tank.

    Returns
    -------
    tuple of (float, float)
        Lower and higher dip, m.
    """
    limits = [
        candidate
        for candidate in rule.uncertainty
        if candidate.of == "deliveries" and _applies_to(candidate, tank)
    ]
    pairs = [pair for limit in limits for pair in deliveries_to_judge(limit, table)]
    return tuple(dict.fromkeys(pairs))


def _applies_to(limit, tank):
    """Whether a limit applies to a kind of tank."""
    return not limit.tanks or tank in limit.tanks


def _code(verdicts, unjudged):
    """Return the code of the rule from the codes of its limits, the most severe first."""
    codes = {verdict.code for verdict in verdicts}
    if "fails" in codes:
        return "failed"
    if "guard_band" in codes:
        return "not_accepted"
    if "holds_from" in codes:
        return "passed_in_part"
    if any(verdict.passed for verdict in verdicts):
        return "not_all_judged" if unjudged else "passed"
    return "stated" if "stated" in codes else "nothing_to_judge"
