"""Rules of an inspection as files: the shipped ones, and a house rule of one's own.

A rule is a TOML file (docs/inspection.md): [rule] says what it is, every other section holds the
limits of one kind of check. A rule may lack any of them: a check without limit is a bare figure.
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

DEFAULT = "api_653"
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
    """What an inspection is judged by.

    Attributes
    ----------
    name, source, remark : str
    file : str
        Name of its file.
    sections : dict
        {section: {key: value or None}} of its limits; `verified` of each filled in.
    """

    name: str
    source: str
    remark: str
    file: str
    sections: dict

    @property
    def verified(self):
        """Whether every value was read in the text itself."""
        return all(one["verified"] for one in self.sections.values())


def parse_rule(file, data, log):
    """The Rule in the bytes of a TOML file, or None after telling `log` every problem of it."""
    told = len(log.problems)
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
            sections=[f"[{one}]" for one in SECTIONS],
            hint=nearest(section, (*SECTIONS, "rule")),
        )
        log.problem(file, expected, rows.get(section), f"[{section}]")
    if len(log.problems) == told and not sections:
        expected = message(
            "no_limits_of_inspection", "no limits; expected sections such as [roundness]"
        )
        log.problem(file, expected)
    if len(log.problems) > told:
        return None
    for values in sections.values():
        if values["verified"] is None:
            values["verified"] = bool(head["verified"])
        values["clause"] = values["clause"] or ""
    return Rule(head["name"], head["source"], head["remark"] or "", file, sections)


_SHIPPED = ShippedRules("inspection/rules", parse_rule)
shipped_names, shipped_rule = _SHIPPED.names, _SHIPPED.rule


def find_rule(name, log):
    """The Rule of a shipped rule's name or the path of a file; None after telling `log`.

    name  such as "api_653" or "rules/house.toml"
    """
    found = _SHIPPED.named(name, log)
    return None if found is None else found[0]


def limit_of(rule, code, *, diameter_m=None, height_m=None):
    """The `InspectionLimit` of a check of the wall; None: the rule has none, or lacks a size.

    Parameters
    ----------
    rule : Rule or None
    code : str
        "plumbness_axis", "plumbness_generatrix", "plumbness_course", "roundness_low",
        "roundness_high", "peaking" or "banding".
    diameter_m : float, optional
        Nominal, of the tank: the radii are limited by it.
    height_m : float, optional
        Of the shell, or of a course: the plumb is limited by it.

    Examples
    --------
    >>> rule = shipped_rule("api_653")
    >>> [limit_of(rule, "plumbness_axis", height_m=one).value for one in (9.5, 14.0)]
    [95.0, 127.0]
    >>> [limit_of(rule, "roundness_low", diameter_m=one).value for one in (11, 12, 80)]
    [13.0, 19.0, 32.0]
    """
    section = _SECTION_OF.get(code, code)
    found = None if rule is None else rule.sections.get(section)
    if found is None:
        return None
    value = _VALUE_OF[section](found, code, diameter_m, height_m)
    if value is None:
        return None
    return InspectionLimit(code, float(value), found["clause"], found["verified"])


_SECTION_OF = {
    "plumbness_axis": "plumbness",
    "plumbness_generatrix": "plumbness",
    "roundness_low": "roundness",
    "roundness_high": "roundness",
}


def _of_height(found, code, diameter_m, height_m):
    if height_m is None:
        return None
    most = found.get("most_mm")
    value = 1000 * found["part_of_height"] * height_m
    return value if most is None else min(value, most)


def _of_diameter(found, code, diameter_m, height_m):
    times = 1.0 if code == "roundness_low" else found["times_higher"]
    if diameter_m is None or times is None:
        return None
    steps = sorted(found["by_diameter"] or ())
    return times * next((most for below, most in steps if diameter_m < below), found["above_mm"])


def _fixed(found, code, diameter_m, height_m):
    return found["most_mm"]


_VALUE_OF = {
    "plumbness": _of_height,
    "plumbness_course": _of_height,
    "roundness": _of_diameter,
    "peaking": _fixed,
    "banding": _fixed,
}
