"""Decision rules, per jurisdiction, and their verdicts on a capacity table."""

from tankcal.rules.deviation import DeviationVerdict, StatedVolume, conformity_probability
from tankcal.rules.expanded import UncertaintyVerdict
from tankcal.rules.judging import RuleVerdict, deliveries_judged, judge
from tankcal.rules.model import TANKS, DeviationLimit, Rule, UncertaintyLimit
from tankcal.rules.plain import as_json
from tankcal.rules.printed import Printed

__all__ = [
    "TANKS",
    "DeviationLimit",
    "DeviationVerdict",
    "Printed",
    "Rule",
    "RuleVerdict",
    "StatedVolume",
    "UncertaintyLimit",
    "UncertaintyVerdict",
    "as_json",
    "conformity_probability",
    "deliveries_judged",
    "judge",
]
