"""`assess`: all requirements compared with the evidence, with or without a record.

Agreement of the printed certificate with its record, and of all files with each other.

The certificate is set again from the record, and each of its texts is searched in the PDF. So each
value of the record must be printed as the record states it: number, dates, headline, every row of
every table, every assumption. A certificate printed by another version of tankcal may use other
sentences; its labels with values, tables and results are compared, not its sentences.

Checks of a certificate without record: its text, from any laboratory and in six languages.

Words are searched, so a requirement that is not found may be met in other words. The capacity table
is examined by the linter.
"""

import re
from dataclasses import dataclass
from datetime import date

from tankcal import __version__
from tankcal.errors import InputError
from tankcal.messages import message
from tankcal.products.assess import checks
from tankcal.products.assess.checks import (
    LABELS,
    check_lint,
    claim_text,
    find_claim,
    find_interval,
    interval_text,
)
from tankcal.products.assess.evidence import compact, read_evidence
from tankcal.products.assess.requirements import (
    GUM,
    GUM_S1,
    ILAC_G8,
    ILAC_P14,
    ISO_17025,
    MAJOR,
    MEMORY,
    MET,
    MINOR,
    NOT_CHECKED,
    NOT_MET,
    OBSERVATION,
    OBSERVED,
    READ,
    RULE,
    SUMMARY,
    Finding,
    Requirement,
    is_available,
)
from tankcal.products.linter.linting import lint
from tankcal.report.outputs import RECORD
from tankcal.report.verification import verify
from tankcal.report.verified_files import INPUT_CODES
from tankcal.version import find_version

_VALUES = ("key_values", "result", "table", "columns_table", "masthead", "hash_code")
LONGEST_TEXT = 90  # letters of a missing text in a finding


def check_print(evidence):
    """Yield each section of the certificate that lacks texts of the record."""
    is_same_version = evidence.record["tankcal"] == __version__
    body, heading = evidence.certificate.body, ""
    for block in evidence.blocks:
        if block["kind"] == "heading":
            heading = block["text"]
        if block["kind"] not in _VALUES and not is_same_version:
            continue
        texts = list(_texts_of(block))
        missing = [text for text in texts if compact(text) not in body]
        if missing:
            text = message(
                "assess_differs",
                "{count} of {all} texts of the record are not printed as recorded, such as: {text}",
                count=len(missing), all=len(texts), text=missing[0][:LONGEST_TEXT],
            )  # fmt: skip
            yield Finding(text, file=evidence.certificate.name, section=heading)


def check_files(evidence):
    """Yield disagreements of hashes and embedded files, as `tankcal verify` finds them."""
    for problem in verify(evidence.source, hashes_only=True).problems:
        if getattr(problem.expected, "code", "") in INPUT_CODES:
            continue  # input files are not part of a certificate
        text = message("assess_files", "{problem}", problem=problem.expected)
        yield Finding(text, file=problem.file or RECORD)


def _texts_of(block):
    """Yield the texts of a block, as they follow each other in the PDF."""
    kind = block["kind"]
    if kind == "key_values":
        yield from (f"{name} {value}" for name, value in block["items"] if value)
    elif kind in ("table", "columns_table"):
        formulas = {*block.get("formulas", ())}
        for row in block["rows"]:
            # A typeset formula has no text to compare: the cells around it are compared.
            for cells in _split_at(row, formulas):
                yield " ".join(map(str, cells))
    elif kind == "result":
        yield from (block["label"], block["text"], block["note"])
    elif kind == "masthead":
        yield from (block["title"], block["subtitle"], block["number"])
    elif kind == "hash_code":
        yield from (block["text"], block["code"])
    elif kind == "list":
        yield from block["items"]
    elif kind == "signature":
        yield from block["labels"]
    elif kind in ("paragraph", "notice", "heading", "end"):
        yield block["text"]


def _split_at(row, formulas):
    """Yield the runs of cells between the columns of formulas."""
    cells = []
    for column, cell in enumerate(row):
        if column in formulas:
            yield cells
            cells = []
        else:
            cells.append(cell)
    yield cells


# Expanded uncertainty with its number, such as "U = 0.5634 m³" or "± 1,234 L".
_STATED_U = re.compile(r"(?:\bU\s*=|±)\s*(\d+(?:[.,]\d+)?)(?!\d|\s*°|\s*K\b)")
# Value and U of a result, such as "1369.66 m³ ± 0.56 m³" or "V = ... with U = ...".
_RESULT = re.compile(
    r"(\d+[.,]\d+|\d+)\s*(m³|m3|L|l|bbl)\s+(?:±|with\s+U\s*=|com\s+U\s*=|con\s+U\s*=)\s*"
    r"(\d+[.,]\d+|\d+)\s*\2"
)
_RULES = re.compile(r"decision rule|regra de decisão|regla de decisión|règle de décision|ILAC-?G8"
                    r"|guard band|banda de guarda|entscheidungsregel", re.IGNORECASE)  # fmt: skip
MOST_DIGITS = 2  # significant digits of U, ILAC-P14


def check_labels(evidence):
    """Yield each requirement whose words the text does not contain."""
    text = "\n".join(evidence.certificate.pages)
    for name, pattern in LABELS.items():
        if not re.search(pattern, text, re.IGNORECASE):
            missing = message("assess_not_found", "no words for it in the text")
            yield Finding(missing, MINOR, evidence.certificate.name, section=name)


def check_claims(evidence):
    """Yield a statement of conformity without a decision rule in the text."""
    if any(map(_RULES.search, evidence.certificate.pages)):
        return
    for page, text in enumerate(evidence.certificate.pages, 1):
        if words := find_claim(" ".join(text.split())):
            yield Finding(claim_text(words), MAJOR, evidence.certificate.name, page)


def check_interval(evidence):
    """Yield an interval of calibration that a page states without its reason."""
    for page, text in enumerate(evidence.certificate.pages, 1):
        if words := find_interval(" ".join(text.split())):
            yield Finding(interval_text(words), MINOR, evidence.certificate.name, page)


def check_digits(evidence):
    """Yield printed U with more than two significant digits, and values with other decimals."""
    for page, text in enumerate(evidence.certificate.pages, 1):
        for match in _STATED_U.finditer(text):
            if count_digits(match[1]) > MOST_DIGITS:
                long = message(
                    "assess_digits", "U has more than two significant digits: {text}",
                    text=" ".join(match[0].split()),
                )  # fmt: skip
                yield Finding(long, MAJOR, evidence.certificate.name, page)
        for match in _RESULT.finditer(text):
            if _decimals(match[1]) != _decimals(match[3]):
                apart = message(
                    "assess_decimals", "the value and its U end at different decimals: {text}",
                    text=" ".join(match[0].split()),
                )  # fmt: skip
                yield Finding(apart, MINOR, evidence.certificate.name, page)


def check_table(evidence):
    """Yield the errors of the capacity table; an observation if there is no table."""
    certificate = evidence.certificate
    try:
        findings = lint(certificate.path).findings
    except InputError:
        text = message("assess_no_rows", "no capacity table could be read from the text")
        yield Finding(text, OBSERVATION, certificate.name)
        return
    yield from check_lint(findings, certificate.name)


def count_digits(number):
    """Count the significant digits of a printed number, without final zeros of an integer.

    Examples
    --------
    >>> [count_digits(number) for number in ("0.56", "0.5634", "420", "1,50", "0.050")]
    [2, 4, 2, 3, 2]
    """
    digits = re.sub(r"[.,]", "", number).lstrip("0")
    return len(digits if re.search(r"[.,]", number) else digits.rstrip("0"))


def _decimals(number):
    return len(re.split(r"[.,]", number)[1]) if re.search(r"[.,]", number) else 0


_PRINTED, _RULED, _TEXT = ("record", "certificate"), ("record", "rule"), ("text_alone",)
REQUIREMENTS = (
    Requirement("presence", ISO_17025, "7.8.1", MEMORY, checks.check_presence),
    Requirement("entries", ISO_17025, "7.8.2, 7.8.4", SUMMARY, checks.check_entries),
    Requirement("placeholders", ISO_17025, "7.8.2", SUMMARY, checks.check_placeholders),
    Requirement("title", ISO_17025, "7.8.2", SUMMARY, checks.check_title, _PRINTED),
    Requirement("identity", ISO_17025, "7.8.2", SUMMARY, checks.check_identity, _PRINTED),
    Requirement("dates", ISO_17025, "7.8.2", SUMMARY, checks.check_dates),
    Requirement("statements", ISO_17025, "7.8.2", MEMORY, checks.check_statements, _PRINTED),
    Requirement("interval", ISO_17025, "7.8.4.3", MEMORY, checks.check_interval),
    Requirement("conditions", ISO_17025, "7.8.4", SUMMARY, checks.check_conditions),
    Requirement("traceability", ISO_17025, "7.8.4", SUMMARY, checks.check_traceability),
    Requirement("equipment", ISO_17025, "6.4", MEMORY, checks.check_calibration_dates),
    Requirement("references", "OIML R 71", "", MEMORY, checks.check_references),
    Requirement("size", "ISO 7507", "", MEMORY, checks.check_size),
    Requirement("overrulings", ISO_17025, "7.8.2", MEMORY, checks.check_overrulings),
    Requirement("notice", ISO_17025, "7.8.1", MEMORY, checks.check_notice),
    Requirement("print", ISO_17025, "7.8.1", MEMORY, check_print, _PRINTED),
    Requirement("files", ISO_17025, "7.5", MEMORY, check_files, _PRINTED),
    Requirement("table", ISO_17025, "7.8.1", MEMORY, checks.check_table),
    Requirement("rows", ISO_17025, "7.8.4", SUMMARY, checks.check_rows),
    Requirement("digits", ILAC_P14, "5", SUMMARY, check_digits, ("certificate",)),
    Requirement("coverage", ILAC_P14, "5", SUMMARY, checks.check_coverage),
    Requirement("capability", ILAC_P14, "5", SUMMARY, checks.check_capability,
                ("record", "letterhead")),
    Requirement("propagation", GUM, "5.2", READ, checks.check_propagation),
    Requirement("budgets", GUM, "5.1.3", READ, checks.check_budgets),
    Requirement("types", GUM, "4.2, 4.3", READ, checks.check_types),
    Requirement("defaults", GUM, "4.3", READ, checks.check_defaults),
    Requirement("undeclared", ISO_17025, "7.6.1", MEMORY, checks.check_undeclared),
    Requirement("bias", GUM, "3.2.4", MEMORY, checks.check_bias),
    Requirement("monte_carlo", GUM_S1, "8", READ, checks.check_monte_carlo),
    Requirement("stated", ISO_17025, "7.8.1", MEMORY, checks.check_stated),
    Requirement("input", ISO_17025, "7.7", MEMORY, checks.check_input),
    Requirement("claims", ISO_17025, "7.8.6", READ, checks.check_claims),
    Requirement("rule", ISO_17025, "7.8.6", READ, checks.check_rule, (*_PRINTED, "rule")),
    Requirement("verdicts", ISO_17025, "7.8.6", READ, checks.check_verdicts, _RULED),
    Requirement("rule_statements", RULE, "", MEMORY, checks.check_sentences,
                (*_PRINTED, "rule")),
    Requirement("rule_scope", RULE, "", MEMORY, checks.check_scope, _RULED),
    Requirement("rule_results", ILAC_G8, "4.2", READ, checks.check_results, _RULED),
    Requirement("labels", ISO_17025, "7.8.2, 7.8.4", SUMMARY, check_labels, _TEXT),
    Requirement("text_interval", ISO_17025, "7.8.4.3", MEMORY, check_interval, _TEXT),
    Requirement("text_claims", ISO_17025, "7.8.6", READ, check_claims, _TEXT),
    Requirement("text_table", ISO_17025, "7.8.1", MEMORY, check_table, _TEXT),
)  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """Result of a requirement: MET, OBSERVED, NOT_MET or NOT_CHECKED, and its findings."""

    requirement: Requirement
    outcome: str
    findings: tuple


@dataclass(frozen=True)
class Assessment:
    """Result of an assessment.

    Attributes
    ----------
    source : str
        Name of the assessed folder or file.
    day : date
        Day of the assessment.
    subject : dict
        tank, number and laboratory, as recorded; None: not known.
    language : str
        Language of the certificate.
    outcomes : tuple of Outcome
        In the order of REQUIREMENTS.
    """

    source: str
    day: date
    subject: dict
    language: str | None
    outcomes: tuple[Outcome, ...]

    @property
    def findings(self):
        """All findings as (Requirement, Finding), the gravest first."""
        pairs = [
            (outcome.requirement, finding)
            for outcome in self.outcomes
            for finding in outcome.findings
        ]
        order = (MAJOR, MINOR, OBSERVATION)
        return sorted(pairs, key=lambda pair: order.index(pair[1].grade))

    @property
    def nonconformities(self):
        """Number of nonconformities, major and minor."""
        return sum(finding.grade != OBSERVATION for _, finding in self.findings)


def assess(source, day=None):
    """Assess a certificate and its record.

    Parameters
    ----------
    source : path
        Folder of results, record.json, or the PDF of a certificate.
    day : date, optional
        Day of the assessment; None: today.

    Returns
    -------
    Assessment

    Raises
    ------
    InputError
        If neither a certificate nor a record with a capacity table can be read.
    """
    with read_evidence(source, day or date.today()) as evidence:
        record = evidence.record
        outcomes = tuple(
            _check(requirement, evidence)
            for requirement in REQUIREMENTS
            if record is None or requirement.needs != _TEXT
        )
        return Assessment(
            evidence.name,
            evidence.day,
            {
                "tank": record["job"]["tank"]["id"] if record else None,
                "number": evidence.entries.get("number"),
                "laboratory": evidence.entries.get("laboratory"),
                "software": record["tankcal"] if record else None,
            },
            evidence.certificate and evidence.certificate.language,
            outcomes,
        )


def plain_assessment(assessment):
    """Return the content of assessment.json (dict) of an `Assessment`."""
    from tankcal.messages import as_plain
    from tankcal.products.assess.requirements import ASSESSMENT

    requirements, findings = [], []
    for outcome in assessment.outcomes:
        requirement = outcome.requirement
        keys = ("code", "document", "clause", "basis")
        requirements.append(
            {key: getattr(requirement, key) for key in keys} | {"outcome": outcome.outcome}
        )
    for requirement, finding in assessment.findings:
        document, clause, basis = finding.clause or (
            requirement.document, requirement.clause, requirement.basis,
        )  # fmt: skip
        findings.append({
            "requirement": requirement.code, "grade": finding.grade, "document": document,
            "clause": clause, "basis": basis, "file": finding.file, "page": finding.page,
            "section": finding.section, "text": str(finding.text), **as_plain(finding.text),
        })  # fmt: skip
    return {
        "format": ASSESSMENT.format,
        "tankcal": find_version(),
        "notice": "",
        "source": assessment.source,
        "day": assessment.day.isoformat(),
        **assessment.subject,
        "language": assessment.language,
        "requirements": requirements,
        "findings": findings,
    }


def _check(requirement, evidence):
    if not all(is_available(evidence, need) for need in requirement.needs):
        return Outcome(requirement, NOT_CHECKED, ())
    findings = tuple(requirement.check(evidence))
    if any(finding.grade != OBSERVATION for finding in findings):
        return Outcome(requirement, NOT_MET, findings)
    return Outcome(requirement, OBSERVED if findings else MET, findings)
