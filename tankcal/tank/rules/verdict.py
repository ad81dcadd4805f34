"""All limits of a rule on a table: one verdict for each, and one for the whole."""

from dataclasses import dataclass

import numpy as np

from tankcal.tank.rules.deviation import DeviationVerdict, judge_deviation
from tankcal.tank.rules.expanded import UncertaintyVerdict, deliveries_to_judge, judge_uncertainty
from tankcal.tank.rules.model import TANKS, Rule
from tankcal.tank.rules.printed import printed_of_table


@dataclass(frozen=True)
class RuleVerdict:
    """What a Rule says of a table.

    Attributes
    ----------
    rule : Rule
        The Rule.
    tank : str
        Kind of tank that it was asked for.
    code : str
        "passed": every limit is kept everywhere; "passed_in_part": the uncertainty keeps its limits
        from some level on; "failed"; "not_accepted": nothing fails, but a deviation lies in a guard
        band; "stated": nothing is limited; "nothing_to_judge"; "not_all_judged": nothing failed,
        but `unjudged` limits had nothing to be held against; "not_for_this_tank": no limit for the
        kind or capacity.
    verified : bool
        Whether every value that was used was read in the legal text itself.
    capacity_m3 : float
        Volume of the highest row for use; nan: none is.
    uncertainty, deviation
        Verdicts of the limits for this kind of tank.
    unjudged : tuple of str
        Names of those of its limits that no row, delivery or stated volume is for.
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
    """RuleVerdict of a Rule for a Capacity of a kind of tank.

    Parameters
    ----------
    tank
        One of tankcal.tank.rules.TANKS.
    lowest_m : optional
        Dip of the start of the calibrated zone, see `judge_uncertainty`.
    stated : optional
        StatedVolumes that the deviations are judged against.
    printed : optional
        `Printed` uncertainties, such as Monte Carlo's; None: the table's.

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
    rows = np.flatnonzero(table.for_use(table.height_m))
    capacity = float(table.volume_m3[rows[-1]]) if len(rows) else np.nan
    is_too_large = rule.largest_capacity_m3 is not None and capacity > rule.largest_capacity_m3
    limits = [] if is_too_large else [one for one in rule.uncertainty if _is_for(one, tank)]
    others = [] if is_too_large else [one for one in rule.deviation if _is_for(one, tank)]
    uncertainty = tuple(judge_uncertainty(one, table, lowest_m, printed) for one in limits)
    pairs = [judge_deviation(limit, table, one, printed) for limit in others for one in stated]
    deviation = tuple(verdict for verdict in pairs if verdict is not None)
    verdicts = (*uncertainty, *deviation)
    used = [verdict.limit for verdict in verdicts]
    judged = [v.limit for v in verdicts if v.code not in ("nothing_to_judge", "not_for_use")]
    unjudged = tuple(one.name for one in (*limits, *others) if one not in judged)
    return RuleVerdict(
        rule=rule,
        tank=tank,
        code=_code(verdicts, unjudged) if limits or others else "not_for_this_tank",
        verified=all(limit.verified for limit in used) if used else rule.verified,
        capacity_m3=capacity,
        uncertainty=uncertainty,
        deviation=deviation,
        unjudged=unjudged,
    )


def deliveries_to_check(rule, table, tank):
    """The deliveries that a rule's limits are decided by, each once.

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
    limits = [one for one in rule.uncertainty if one.of == "deliveries" and _is_for(one, tank)]
    pairs = [pair for limit in limits for pair in deliveries_to_judge(limit, table)]
    return tuple(dict.fromkeys(pairs))


def _is_for(limit, tank):
    return not limit.tanks or tank in limit.tanks


def _code(verdicts, unjudged):
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
