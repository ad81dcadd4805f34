"""Decision rules, per jurisdiction, and their verdicts on a capacity table."""

from tankcal.tank.rules.deviation import DeviationVerdict, StatedVolume, conformity_probability
from tankcal.tank.rules.expanded import UncertaintyVerdict
from tankcal.tank.rules.model import TANKS, DeviationLimit, PrintedU, Rule, UncertaintyLimit
from tankcal.tank.rules.verdict import RuleVerdict, deliveries_to_check, judge

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
    "conformity_probability",
    "deliveries_to_check",
    "judge",
]
