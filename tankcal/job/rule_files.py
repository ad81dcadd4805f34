"""Decision rules as files: rules shipped with tankcal, and rules of a user beside the job.

A rule is a TOML file (docs/job-format.md). [rule] describes it. Each [uncertainty.NAME] limits the
expanded uncertainty. Each [deviation.NAME] limits the deviation from a stated volume.
[reference_height.NAME] and [period.NAME] apply to a new table compared with a former table.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tankcal.job.entries import read_section
from tankcal.job.fields import Field, choice, is_blank, positive
from tankcal.job.folder import MAX_SETTINGS_BYTES, read_toml
from tankcal.job.tables import Log, fingerprint, nearest, read_beside, read_bytes
from tankcal.messages import message
from tankcal.tank.rules import (
    DEVIATION_OF,
    FROM_LEVEL,
    GUARDS,
    LAYOUT,
    PERIOD_OF,
    PLATE,
    RELATIVE_TO,
    SIDES,
    TANKS,
    UNCERTAINTY_OF,
    DeviationLimit,
    Period,
    ReferenceHeightLimit,
    Rule,
    UncertaintyLimit,
)
from tankcal.text.shipped import shipped_folder

# Keys that all rule files share: [rule], and the source of each limit.
HEAD = (
    Field("name", "text", "name of the rule", required=True),
    Field("source", "text", "where its values were read", required=True),
    Field("verified", "flag", "whether they were read in the legal or technical text itself"),
    Field("remark", "text", "anything that is to stand beside it"),
    Field("country", "text", "country of the rule, two letters of ISO 3166-1; blank: several"),
    Field("title", "text", "title of the text"),
    Field("number", "text", "number of the text"),
    Field("date", "date", "date of the text, year-month-day"),
)
SOURCE = (
    Field("clause", "text", "where it stands in the text; blank: article and quotation"),
    Field("article", "text", "article or clause of the text"),
    Field("quotation", "text", "its words, at most 25"),
    Field("read_by", "text", "person or project that read it"),
    Field("read_on", "date", "day on which it was read, year-month-day"),
    Field("verified", "flag", "whether it was read in the legal or technical text itself"),
)
# Keys of the file of a decision rule: [rule], and [PART.NAME] for the parts of LIMITS.
RULE = (
    *HEAD,
    positive("largest_capacity_m3", "largest tank it is for", 1e9),
    Field("statements", "names", "sentences that it requires in a certificate, in its language"),
    Field("plate", "names", "entries of the identification plate that it requires, in their order"),
    Field("layout", "names", "layouts that it requires of the table"),
)
_SHARED = (Field("tanks", "names", "kinds of tank that it is for"), *SOURCE)
_PERCENT = positive("limit_percent", "limit in percent", 100)
MOST_QUOTED = 25  # words of a quotation
LIMITS = {
    "uncertainty": (
        choice("of", "what is limited", UNCERTAINTY_OF, required=True),
        _PERCENT,
        choice("relative_to", "what the limit is a part of", RELATIVE_TO),
        positive("minimum_height_m", "least height of a delivery", 100),
        choice("from_level", "level from which the limit is valid; blank: everywhere", FROM_LEVEL),
        *_SHARED,
    ),
    "deviation": (
        choice("of", "what is limited", DEVIATION_OF, required=True),
        _PERCENT,
        positive("limit_m3", "limit as a volume", 1e9),
        choice("side", "which deviations are limited", SIDES),
        choice("guard", "width of the guard band", GUARDS, required=True),
        positive("in_service_factor", "factor of the limit for a table in use", 10),
        *_SHARED,
    ),
    "reference_height": (
        positive("limit_mm", "largest change of the reference height", 1e4, required=True),
        *_SHARED,
    ),
    "period": (
        choice("of", "what may become so old", PERIOD_OF, required=True),
        positive("years", "oldest that a table may become", 1e3, required=True),
        *_SHARED,
    ),
}


_ENDING, _OF_TABLE = ".toml", "table.rule"


@dataclass(frozen=True)
class RuleFiles:
    """Rule files of one kind: shipped with tankcal, or written by a laboratory.

    Attributes
    ----------
    folder : str
        Folder of the shipped rules within the package.
    head : tuple of Field
        Keys of [rule].
    sections : dict
        {section: fields} of the limits.
    make : callable
        make(head, limits, file) returns the rule; `limits` has (section, name, {key: value}) of
        each section in the order of the file.
    example : str
        A section, for the message about a file without limits.
    has_names : bool
        Whether the sections are [SECTION.NAME], so that a kind of limit may occur repeatedly.
    check : callable, optional
        check(file, part, section, values, keys, row, log) reports contradictions in a section.
    """

    folder: str
    head: tuple
    sections: dict
    make: Callable
    example: str
    has_names: bool = False
    check: Callable | None = None

    def parse(self, file, data, log):
        """Rule in the bytes of a TOML file; None, with every problem in `log`, if invalid."""
        problems_before = len(log.problems)
        settings, rows = read_toml(file, data, log)
        if settings is None:
            return None
        head = read_section(
            file, "rule", self.head, settings.pop("rule", {}), rows.get("rule"), log
        )
        limits = []
        for section, keys in settings.items():
            part, _, name = section.partition(".") if self.has_names else (section, "", section)
            row = rows.get(section)
            if part not in self.sections or "." in name:
                log.problem(file, self._expect_sections(part), row, f"[{section}]")
            elif name:
                values = read_section(file, section, self.sections[part], keys, row, log)
                _tell_quotation(file, section, values, keys, log)
                if self.check:
                    self.check(file, part, section, values, keys, row, log)
                limits.append((part, name, values))
            elif keys:
                expected = message(
                    "in_no_limit",
                    "is in no limit; expected in one, such as [{part}.volumes]",
                    part=part,
                )
                log.problem(file, expected, row, f"[{section}]")
        for key, known in (("plate", PLATE), ("layout", LAYOUT)):
            _tell_unknown_entries(file, key, head.get(key), known, rows.get("rule"), log)
        if len(log.problems) == problems_before and not limits:
            expected = message(
                "no_limits",
                "no limits; expected sections such as [{section}]",
                section=self.example,
            )
            log.problem(file, expected)
        if len(log.problems) > problems_before:
            return None
        # A limit without `verified` or `clause` takes `verified` of the whole rule, and no clause.
        for _, _, values in limits:
            if values["verified"] is None:
                values["verified"] = bool(head["verified"])
            cited = filter(None, (values["article"], values["quotation"]))
            values["clause"] = values["clause"] or ": ".join(cited)
        head["remark"] = head["remark"] or ""
        return self.make(head, limits, file)

    def _expect_sections(self, part):
        """Message that lists the sections beside an unknown one."""
        ending = ".NAME" if self.has_names else ""
        return message(
            "unknown_section_of_rule",
            "unknown section; expected [rule] or one of {sections}{hint}",
            sections=[f"[{known}{ending}]" for known in self.sections],
            hint=nearest(part, (*self.sections, "rule")),
        )

    def names(self):
        """Names of the shipped rules."""
        return tuple(sorted(path.stem for path in shipped_folder(self.folder).glob(f"*{_ENDING}")))

    def rule(self, name):
        """Shipped rule of this name; raises ValueError for an unknown name."""
        if name not in self.names():
            raise ValueError(f"no rule {name!r}; expected one of {', '.join(self.names())}")
        path, log = shipped_folder(self.folder) / f"{name}{_ENDING}", Log()
        rule = self.parse(path.name, path.read_bytes(), log)
        log.stop_if_problems()
        return rule

    def named(self, name, log):
        """(rule, file name) of the option --rule, a shipped name or a path; None with a problem."""
        if name in self.names():
            return self.rule(name), f"{name}{_ENDING}"
        path = Path(name)
        if name.lower().endswith(_ENDING) and path.is_file():
            data = read_bytes(path, log, MAX_SETTINGS_BYTES)
            rule = None if data is None else self.parse(path.name, data, log)
            return None if rule is None else (rule, path.name)
        missing = message("no_rule_file_there", "no such file: {file}", file=name)
        _tell_unknown("--rule", None, None, name, missing, self.names(), log)
        return None


def _tell_unknown_entries(file, key, entries, known, row, log):
    """Report unknown entries of the identification plate or of the layout."""
    for entry in entries or ():
        if entry not in known:
            expected = message(
                "unknown_rule_entry",
                "found {entry!r}; expected some of {entries}{hint}",
                entry=entry,
                entries=[*known],
                hint=nearest(entry, known),
            )
            log.problem(file, expected, row, f"rule.{key}")


def tell_layout(raw, values, rule, log):
    """Report settings of [table] that differ from the layout that a rule requires."""
    for key, expected in (LAYOUT[layout] for layout in rule.layout):
        if values["table"][key] != expected:
            differs = message(
                "layout_of_rule",
                "the rule {rule} requires {expected}",
                rule=rule.name,
                expected=str(expected).lower() if expected is True else expected,
            )
            entry = raw.settings["table"].get(key)
            log.problem(raw.settings_file, differs, entry and entry.row, f"table.{key}")


def _tell_quotation(file, section, values, keys, log):
    """Report a quotation that is too long."""
    count = len((values["quotation"] or "").split())
    if count > MOST_QUOTED:
        expected = message(
            "long_quotation",
            "{count} words; expected at most {most}",
            count=count,
            most=MOST_QUOTED,
        )
        log.problem(file, expected, keys["quotation"].row, f"{section}.quotation")


def limits_one_table(rule):
    """Whether a rule limits a property of a single table; rules of periods compare two tables."""
    return bool(rule.uncertainty or rule.deviation)


def rules_of_one_table():
    """Names of the shipped rules that a job may name."""
    return tuple(name for name in shipped_names() if limits_one_table(shipped_rule(name)))


def find_rule(raw, name, log, key="table.rule"):
    """Find the rule named by a key of the job.

    Parameters
    ----------
    raw : RawJob
        Job as read; a rule of the user lies in its folder.
    name : str
        Name of a shipped rule or of a file, without a path, as checked by the field.
    log : Log
        Receives the problems.
    key : str, optional
        "table.rule" for a rule of a table, "certificate.next_verification_rule" for a rule with
        a period.

    Returns
    -------
    tuple or None
        (Rule, (file, SHA-256, size in bytes)); the second is None for a shipped rule. None if no
        valid rule was found.
    """
    section, _, entry = key.partition(".")
    place = (raw.settings_file, raw.settings[section][entry].row, key)
    if name in shipped_names():
        return _check_rule_of_key(shipped_rule(name), None, place, log)
    path = raw.folder / name
    is_file_name = name.lower().endswith(_ENDING)
    if not (is_file_name and path.exists()):
        missing = message("no_rule_file", "no such file beside the job")
        known = rules_of_one_table() if key == _OF_TABLE else shipped_names()
        _tell_unknown(*place, name, missing, known, log)
        return None
    data = read_beside(raw.folder, name, log, MAX_SETTINGS_BYTES)
    rule = None if data is None else parse_rule(name, data, log)
    return None if rule is None else _check_rule_of_key(rule, fingerprint(name, data), place, log)


def _check_rule_of_key(rule, file, place, log):
    """(Rule, file) if the rule has the limits or the period that the key needs, else None."""
    if limits_one_table(rule) if place[-1] == _OF_TABLE else rule.periods:
        return rule, file
    expected = message(
        "rule_of_two_tables",
        "limits nothing of one table; expected [uncertainty.NAME] or [deviation.NAME] in it (rules "
        "of periods are for tankcal compare)",
    )
    if place[-1] != _OF_TABLE:
        expected = message(
            "rule_without_period",
            "the rule has no period; expected a rule with [period.NAME], or next_verification, the "
            "date for which the customer asked",
        )
    log.problem(place[0], expected, *place[1:])
    return None


def _tell_unknown(file, row, column, name, no_file, rules, log):
    is_file_name = name.lower().endswith(_ENDING)
    missing = no_file if is_file_name else message("found_rule", "found {name!r}", name=name)
    expected = message(
        "no_such_rule",
        "{missing}; expected a .toml file there, or one of {rules}{hint}",
        missing=missing,
        rules=[*rules],
        hint=nearest(name.removesuffix(_ENDING), rules),
    )
    log.problem(file, expected, row, column)


def _tell_contradictions(file, part, section, values, keys, row, log):
    """Report keys that contradict each other or are missing, and unknown kinds of tank."""

    def is_given(key):
        return key in keys and not is_blank(keys[key].raw)

    def tell(key, expected):
        place = keys[key].row if key in keys else row
        log.problem(file, expected, place or row, f"{section}.{key}")

    for tank in values["tanks"] or ():
        if tank not in TANKS:
            expected = message(
                "unknown_tanks",
                "found {tank!r}; expected some of {tanks}{hint}",
                tank=tank,
                tanks=[*TANKS],
                hint=nearest(tank, TANKS),
            )
            tell("tanks", expected)
    if part == "deviation":
        if is_given("limit_percent") and is_given("limit_m3"):
            tell(
                "limit_m3",
                message(
                    "two_limits", "given together with limit_percent; expected only one of them"
                ),
            )
        elif not (is_given("limit_percent") or is_given("limit_m3")):
            tell(
                "limit_percent",
                message("neither_limit", "missing; expected limit_percent or limit_m3"),
            )
    elif part == "uncertainty":
        _tell_heights(values, is_given, tell)


def _tell_heights(values, is_given, tell):
    """Report a minimum height or a percentage that a limit of U lacks or must not have."""
    is_delivery = values["of"] == "deliveries"
    if is_delivery and not is_given("minimum_height_m"):
        tell(
            "minimum_height_m",
            message(
                "no_least_height", "missing; expected the least height of a delivery (a number)"
            ),
        )
    if values["of"] in ("volumes", "capacity"):
        if is_given("minimum_height_m"):
            tell(
                "minimum_height_m",
                message(
                    "only_for_deliveries", "is for deliveries; expected of = 'deliveries' beside it"
                ),
            )
        if not is_given("limit_percent"):
            tell(
                "limit_percent", message("no_limit_percent", "missing; expected a limit in percent")
            )


def _make_rule(head, limits, file):
    """Rule of a file; percentages become fractions, millimetres metres."""
    by_part = {part: [] for part in LIMITS}
    for part, name, values in limits:
        shared = {key: values[key] for key in ("clause", "verified")}
        by_part[part].append((values, {"name": name, "tanks": values["tanks"] or ()} | shared))
    return Rule(
        name=head["name"],
        source=head["source"],
        verified=all(values["verified"] for _, _, values in limits),
        remark=head["remark"],
        largest_capacity_m3=head["largest_capacity_m3"],
        statements=head["statements"] or (),
        plate=head["plate"] or (),
        layout=head["layout"] or (),
        uncertainty=tuple(
            UncertaintyLimit(
                of=values["of"],
                limit=_part(values["limit_percent"]),
                relative_to=values["relative_to"] or "itself",
                minimum_height_m=values["minimum_height_m"],
                from_level=values["from_level"],
                **shared,
            )
            for values, shared in by_part["uncertainty"]
        ),
        deviation=tuple(
            DeviationLimit(
                of=values["of"],
                limit=_part(values["limit_percent"]),
                limit_m3=values["limit_m3"],
                side=values["side"] or "both",
                guard=values["guard"],
                in_service_factor=values["in_service_factor"] or 1.0,
                **shared,
            )
            for values, shared in by_part["deviation"]
        ),
        reference_height=tuple(
            ReferenceHeightLimit(limit_m=values["limit_mm"] / 1000, **shared)
            for values, shared in by_part["reference_height"]
        ),
        periods=tuple(
            Period(of=values["of"], years=values["years"], **shared)
            for values, shared in by_part["period"]
        ),
    )


def _part(percent):
    """Fraction from a percentage; None if not given."""
    return None if percent is None else percent / 100


_FILES = RuleFiles(
    "job/rule_tables",
    RULE,
    LIMITS,
    _make_rule,
    "uncertainty.volumes",
    has_names=True,
    check=_tell_contradictions,
)
parse_rule = _FILES.parse
shipped_names, shipped_rule, named_rule = _FILES.names, _FILES.rule, _FILES.named
