"""Checks of statements of conformity: ISO/IEC 17025:2017, 7.8.6, ILAC-G8 and the rule itself.

The verdicts are judged again from the table of the record.
"""

import math

import numpy as np

from tankcal.gum.conformity import decide
from tankcal.messages import message
from tankcal.products.assess.evidence import compact
from tankcal.products.assess.requirements import (
    ILAC_G8,
    MEMORY,
    MINOR,
    OBSERVATION,
    READ,
    Finding,
)
from tankcal.products.assess.wording import statement_text
from tankcal.report.outputs import RECORD
from tankcal.report.uncertainty.rule import deviation_limit_text, limit_text
from tankcal.report.uncertainty.stated import stated_U_m3

_SAME = 1e-9  # relative tolerance of limits
_OF_DECISION = {"passed": "conforms", "guard_band": "guard_band"}  # others: "fails"


def check_rule(evidence):
    """Yield a rule that the certificate does not name, or names without its text read."""
    rule, name = evidence.rule["rule"], evidence.certificate.name
    is_named = compact(rule["name"]) in evidence.certificate.body
    if evidence.rule["verified"] and not is_named:
        text = message("assess_rule_unnamed", "does not name the rule {rule}", rule=rule["name"])
        yield Finding(text, file=name)
    if not evidence.rule["verified"] and is_named:
        text = message(
            "assess_rule_unread",
            "states {rule}, whose values were not checked against its text",
            rule=rule["name"],
        )
        yield Finding(text, file=name)


def check_sentences(evidence):
    """Yield sentences that the rule requires and the certificate does not state."""
    for sentence in evidence.rule["rule"].get("statements", ()):
        if compact(sentence) not in evidence.certificate.body:
            yield Finding(
                statement_text(sentence),
                file=evidence.certificate.name,
                clause=_clause(evidence),
            )


def check_scope(evidence):
    """Yield a tank that is larger than the rule allows."""
    rule, top_m3 = evidence.rule["rule"], evidence.record["capacity"]["volume_m3"][-1]
    largest = rule["largest_capacity_m3"]
    if largest is not None and top_m3 > largest:
        text = message(
            "assess_too_large", "the capacity of {capacity:.6g} m3 exceeds {largest:.6g} m3",
            capacity=top_m3, largest=largest,
        )  # fmt: skip
        yield Finding(text, MINOR, RECORD, section="rule", clause=_clause(evidence))


def check_verdicts(evidence):
    """Yield verdicts of the record that its table does not support."""
    capacity = evidence.record["capacity"]
    for result in evidence.rule["uncertainty"]:
        is_judged = result["code"] != "nothing_to_judge" and result["limit"] is not None
        if not is_judged or result["of"] == "deliveries":
            continue
        recorded, (computed, passed) = result["from_m"], _judge_again(capacity, result)
        if result["code"] == "holds_accurate":  # the limit is valid from this level only
            passed = computed is not None
        heights = ["-" if height is None else f"{height:.4f}" for height in (recorded, computed)]
        if heights[0] != heights[1] or result["passed"] is not passed:
            text = message(
                "assess_verdict",
                "{limit}: met from {recorded} m by the record, from {computed} m by its table",
                limit=limit_text(evidence.paper, result),
                recorded=heights[0], computed=heights[1],
            )  # fmt: skip
            yield Finding(text, file=RECORD, section=f"rule.{result['name']}")
    for result in evidence.rule["deviation"]:
        guard = result["U_m3"] if result["guard"] == "U" else 0.0
        lower, upper = (
            sign * math.inf if limit is None else limit
            for sign, limit in zip((-1, 1), result["tolerance_m3"], strict=True)
        )
        code = _OF_DECISION.get(decide(result["volume_m3"], lower, upper, guard), "fails")
        if result["code"] not in (code, "not_for_use"):
            text = message(
                "assess_decision",
                "{limit}: the record has the verdict {recorded}, its numbers give {computed}",
                limit=deviation_limit_text(evidence.paper, result),
                recorded=result["code"], computed=code,
            )  # fmt: skip
            yield Finding(text, file=RECORD, section=f"rule.{result['name']}")


def check_results(evidence):
    """Yield limits of the rule that no row meets, or that a value meets without its U."""
    limits = [(limit_text, result) for result in evidence.rule["uncertainty"]]
    limits += [(deviation_limit_text, result) for result in evidence.rule["deviation"]]
    for describe, result in limits:
        limit, section = describe(evidence.paper, result), f"rule.{result['name']}"
        # A limit of U that is met from some level on is a result, not a failure.
        if result["passed"] is False and result.get("from_m") is None:
            text = message("assess_limit_not_met", "not met: {limit}", limit=limit)
            clause = _clause(evidence, result)
            yield Finding(text, OBSERVATION, RECORD, section=section, clause=clause)
        elif result["passed"] and "tolerance_m3" in result and _is_risky(result):
            text = message(
                "assess_simple_acceptance",
                "{limit}: accepted although U reaches beyond the limit; the rule has no guard band",
                limit=limit,
            )
            clause = (ILAC_G8, "4.2.1", READ)
            yield Finding(text, OBSERVATION, RECORD, section=section, clause=clause)


def _clause(evidence, result=None):
    """Return document, clause and basis of a limit; without a limit, of the whole rule."""
    rule = evidence.rule["rule"]
    is_read = (result or rule)["verified"]
    return rule["name"], (result or {}).get("clause", ""), READ if is_read else MEMORY


def _is_risky(result):
    """Whether a value is within its tolerance, but not by U."""
    lower, upper = result["tolerance_m3"]
    low = math.inf if lower is None else result["volume_m3"] - lower
    high = math.inf if upper is None else upper - result["volume_m3"]
    return min(low, high) < result["U_m3"] * (1 - _SAME)


def _judge_again(capacity, result):
    """Judge a limit of U at the rows for use.

    Returns
    -------
    from_m : float or None
        Lowest dip from which on all rows meet the limit; None: no such dip.
    passed : bool
        Whether all rows meet the limit.
    """
    volume, U = np.array(capacity["volume_m3"]), np.array(stated_U_m3(capacity))
    judged = np.flatnonzero(capacity["for_use"])
    relative_to = volume[judged[-1]] if result["relative_to"] == "capacity" else volume
    is_met = result["limit"] * relative_to * (1 + _SAME) >= U
    if result["of"] == "capacity":
        judged = judged[-1:]
    failing = judged[~is_met[judged]]
    later = judged[judged > failing[-1]] if len(failing) else judged
    return (capacity["height_m"][later[0]] if len(later) else None), not len(failing)
