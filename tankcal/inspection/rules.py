"""Rules of an inspection: shipped rule files and rule files of the user.

A rule is a TOML file (docs/inspection.md). [rule] describes the rule, and every other section
contains the limits of one kind of check. Each of these sections is optional. A check without a
limit yields a value without a verdict.
"""

from dataclasses import dataclass

from tankcal.inspection.settlement_limits import BULGE, EDGE, SETTLEMENT, SOURCE
from tankcal.job.contract.shorthand import positive
from tankcal.job.entries import read_section
from tankcal.job.fields import Field
from tankcal.job.folder import read_toml
from tankcal.job.rule_files import ShippedRules
from tankcal.job.tables import nearest
from tankcal.messages import message
from tankcal.record.inspection import InspectionLimit

DEFAULT = "api_653"  # rule of an inspection that names no rule
HEAD = (
    Field("name", "text", "name of the rule", required=True),
    Field("source", "text", "where its values were read", required=True),
    Field("verified", "flag", "whether they were read in the text itself"),
    Field("remark", "text", "anything that is to stand beside it"),
)
_OF_HEIGHT = positive("part_of_height", "limit as a part of the height", 1, required=True)
_MOST = positive("most_mm", "largest size, mm", 1e4, required=True)
SECTIONS = {
    "plumbness": (_OF_HEIGHT, positive("most_mm", "and at most, mm", 1e4), *SOURCE),
    "plumbness_course": (_OF_HEIGHT, *SOURCE),
    "roundness": (
        Field("by_diameter", "rows", "diameter in m below which a limit in mm holds", width=2,
              low=0, above_low=True),
        positive("above_mm", "limit of larger diameters, mm", 1e4, required=True),
        positive("times_higher", "factor of the limit higher up; blank: no limit there", 100),
        *SOURCE,
    ),
    "peaking": (_MOST, *SOURCE),
    "banding": (_MOST, *SOURCE),
    "settlement": SETTLEMENT,
    "edge": EDGE,
    "bulge": BULGE,
}  # fmt: skip


@dataclass(frozen=True)
class Rule:
    """Limits of an inspection, as read from a rule file.

    Attributes
    ----------
    name, source, remark : str
        Name of the rule, source of its values, and a remark, "" if none.
    file : str
        Name of the rule file.
    sections : dict
        Limits, {section: {key: value or None}}. Each section has a value of `verified`.
    """

    name: str
    source: str
    remark: str
    file: str
    sections: dict

    @property
    def verified(self):
        """Whether all values were read in the text of the standard itself."""
        return all(section["verified"] for section in self.sections.values())


def parse_rule(file, data, log):
    """Parse the `Rule` in the bytes of a TOML file.

    Parameters
    ----------
    file : str
        Name of the file, for messages.
    data : bytes
        Content of the file.
    log : Log
        Receives the problems of the file.

    Returns
    -------
    Rule or None
        None if the file has problems.
    """
    problem_count = len(log.problems)
    settings, rows = read_toml(file, data, log)
    if settings is None:
        return None
    given = settings.pop("rule", {})
    head = read_section(file, "rule", HEAD, given, rows.get("rule"), log)
    sections = {}
    for section, values in settings.items():
        if section in SECTIONS:
            sections[section] = read_section(
                file, section, SECTIONS[section], values, rows.get(section), log
            )
            continue
        expected = message(
            "unknown_section_of_inspection",
            "unknown section; expected [rule] or one of {sections}{hint}",
            sections=[f"[{name}]" for name in SECTIONS],
            hint=nearest(section, (*SECTIONS, "rule")),
        )
        log.problem(file, expected, rows.get(section), f"[{section}]")
    if len(log.problems) == problem_count and not sections:
        expected = message(
            "no_limits_of_inspection", "no limits; expected sections such as [roundness]"
        )
        log.problem(file, expected)
    if len(log.problems) > problem_count:
        return None
    # A section without `verified` or `clause` takes `verified` of the whole rule, and no clause.
    for values in sections.values():
        if values["verified"] is None:
            values["verified"] = bool(head["verified"])
        values["clause"] = values["clause"] or ""
    return Rule(head["name"], head["source"], head["remark"] or "", file, sections)


_SHIPPED = ShippedRules("inspection/rules", parse_rule)
shipped_names, shipped_rule = _SHIPPED.names, _SHIPPED.rule


def find_rule(name, log):
    """Read a shipped `Rule` by its name, or a rule file by its path.

    The name is such as "api_653" or "rules/house.toml". If the rule is missing or invalid, `log`
    receives the problems, and None is returned.
    """
    rules = _SHIPPED.named(name, log)
    return None if rules is None else rules[0]


def limit_of(rule, code, *, diameter_m=None, height_m=None):
    """Compute the `InspectionLimit` of a check of the wall.

    Parameters
    ----------
    rule : Rule or None
        Rule with the limits; None for no limits.
    code : str
        "plumbness_axis", "plumbness_generatrix", "plumbness_course", "roundness_low",
        "roundness_high", "peaking" or "banding".
    diameter_m : float, optional
        Nominal diameter of the tank, m; required for the roundness.
    height_m : float, optional
        Height of the shell or of a course, m; required for the plumbness.

    Returns
    -------
    InspectionLimit or None
        None if the rule has no limit of the check, or if a required size is not given.

    Examples
    --------
    >>> rule = shipped_rule("api_653")
    >>> [limit_of(rule, "plumbness_axis", height_m=height).value for height in (9.5, 14.0)]
    [95.0, 127.0]
    >>> [limit_of(rule, "roundness_low", diameter_m=size).value for size in (11, 12, 80)]
    [13.0, 19.0, 32.0]
    """
    section = _SECTIONS_BY_CODE.get(code, code)
    limits = None if rule is None else rule.sections.get(section)
    if limits is None:
        return None
    value = _LIMITS_BY_SECTION[section](limits, code, diameter_m, height_m)
    if value is None:
        return None
    return InspectionLimit(code, float(value), limits["clause"], limits["verified"])


# Section of a rule for each check whose code is not the name of its section.
_SECTIONS_BY_CODE = {
    "plumbness_axis": "plumbness",
    "plumbness_generatrix": "plumbness",
    "roundness_low": "roundness",
    "roundness_high": "roundness",
}


def _height_limit_mm(limits, code, diameter_m, height_m):
    """Limit in mm, a share of the height up to `most_mm`; None without a height."""
    if height_m is None:
        return None
    most = limits.get("most_mm")
    value = 1000 * limits["part_of_height"] * height_m
    return value if most is None else min(value, most)


def _diameter_limit_mm(limits, code, diameter_m, height_m):
    """Limit in mm by steps of the diameter; None without a diameter or a limit higher up."""
    factor = 1.0 if code == "roundness_low" else limits["times_higher"]
    if diameter_m is None or factor is None:
        return None
    steps = sorted(limits["by_diameter"] or ())
    return factor * next((most for below, most in steps if diameter_m < below), limits["above_mm"])


def _fixed_limit_mm(limits, code, diameter_m, height_m):
    """Limit in mm that depends on no size of the tank."""
    return limits["most_mm"]


# Function that computes the limit of each section, in mm.
_LIMITS_BY_SECTION = {
    "plumbness": _height_limit_mm,
    "plumbness_course": _height_limit_mm,
    "roundness": _diameter_limit_mm,
    "peaking": _fixed_limit_mm,
    "banding": _fixed_limit_mm,
}
