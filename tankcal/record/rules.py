"""A rule's verdict as plain lists and dicts, ready for JSON.

rule         {name, source, verified, remark, largest_capacity_m3 (null: none)}
tank, code, verified, capacity_m3 (null: no row is for use)     as of a RuleVerdict
uncertainty  [{name, of, limit (part of relative_to, null: only stated), relative_to,
               minimum_height_m, clause, verified, code, passed (true, false, null), from_m,
               from_m3, worst_low_m, worst_m, worst_m3, worst_U_m3, worst_ratio (null: also
               infinite)}]
deviation    [{name, of, limit, limit_m3, side, guard, clause, verified, stated_m3, low_m, high_m,
               code, passed, volume_m3, u_m3, U_m3, k, dof (null: infinite), deviation_m3,
               tolerance_m3 [T_L, T_U], accepted_m3 [A_L, A_U] (null: not limited), guard_m3,
               probability}]
unjudged     [name of a limit that nothing was held against]
"""

from dataclasses import asdict

from tankcal.record.plain_data import plain

_RULE = ("name", "source", "verified", "remark", "largest_capacity_m3")


def as_json(verdict):
    """The dict of a RuleVerdict, as the head of this module describes it."""
    return plain(
        {
            "rule": {key: getattr(verdict.rule, key) for key in _RULE},
            "tank": verdict.tank,
            "code": verdict.code,
            "verified": verdict.verified,
            "capacity_m3": verdict.capacity_m3,
            "uncertainty": [_one(item) for item in verdict.uncertainty],
            "deviation": [_one(item) for item in verdict.deviation],
            "unjudged": verdict.unjudged,
        }
    )


def _one(item):
    values = asdict(item)
    limit, stated = values.pop("limit"), values.pop("stated", None)
    limit.pop("tanks")
    if stated is not None:
        stated = {
            "stated_m3": stated["volume_m3"],
            "low_m": stated["low_m"],
            "high_m": stated["high_m"],
        }
    return limit | (stated or {}) | values
