"""Decision rules, per jurisdiction, and their verdicts on a capacity table."""

from tankcal.tank.rules.model import TANKS, DeviationLimit, PrintedU, Rule, UncertaintyLimit
from tankcal.tank.rules.verdict import (
    DeviationVerdict,
    RuleVerdict,
    StatedVolume,
    UncertaintyVerdict,
    deliveries_to_check,
    judge,
)

__all__ = [
    "TANKS",
    "DeviationLimit",
    "DeviationVerdict",
    "PrintedU",
    "Rule",
    "RuleVerdict",
    "StatedVolume",
    "UncertaintyLimit",
    "UncertaintyVerdict",
    "deliveries_to_check",
    "judge",
]
