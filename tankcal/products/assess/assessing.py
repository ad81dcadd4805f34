"""`assess`: all requirements compared with the evidence, as an `Assessment`."""

from dataclasses import dataclass
from datetime import date

from tankcal.products.assess import agreement, conformity, entries, results, text_alone
from tankcal.products.assess.evidence import read_evidence
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
    Requirement,
    is_available,
)
from tankcal.version import find_version

_PRINTED, _RULED, _TEXT = ("record", "certificate"), ("record", "rule"), ("text_alone",)
REQUIREMENTS = (
    Requirement("presence", ISO_17025, "7.8.1", MEMORY, entries.check_presence),
    Requirement("entries", ISO_17025, "7.8.2, 7.8.4", SUMMARY, entries.check_entries),
    Requirement("placeholders", ISO_17025, "7.8.2", SUMMARY, entries.check_placeholders),
    Requirement("title", ISO_17025, "7.8.2", SUMMARY, entries.check_title, _PRINTED),
    Requirement("identity", ISO_17025, "7.8.2", SUMMARY, entries.check_identity, _PRINTED),
    Requirement("dates", ISO_17025, "7.8.2", SUMMARY, entries.check_dates),
    Requirement("statements", ISO_17025, "7.8.2", MEMORY, entries.check_statements, _PRINTED),
    Requirement("interval", ISO_17025, "7.8.4.3", MEMORY, entries.check_interval),
    Requirement("conditions", ISO_17025, "7.8.4", SUMMARY, entries.check_conditions),
    Requirement("traceability", ISO_17025, "7.8.4", SUMMARY, entries.check_traceability),
    Requirement("equipment", ISO_17025, "6.4", MEMORY, entries.check_calibration_dates),
    Requirement("references", "OIML R 71", "", MEMORY, entries.check_references),
    Requirement("size", "ISO 7507", "", MEMORY, results.check_size),
    Requirement("overrulings", ISO_17025, "7.8.2", MEMORY, entries.check_overrulings),
    Requirement("notice", ISO_17025, "7.8.1", MEMORY, entries.check_notice),
    Requirement("print", ISO_17025, "7.8.1", MEMORY, agreement.check_print, _PRINTED),
    Requirement("files", ISO_17025, "7.5", MEMORY, agreement.check_files, _PRINTED),
    Requirement("table", ISO_17025, "7.8.1", MEMORY, results.check_table),
    Requirement("rows", ISO_17025, "7.8.4", SUMMARY, results.check_rows),
    Requirement("digits", ILAC_P14, "5", SUMMARY, text_alone.check_digits, ("certificate",)),
    Requirement("coverage", ILAC_P14, "5", SUMMARY, results.check_coverage),
    Requirement("capability", ILAC_P14, "5", SUMMARY, results.check_capability,
                ("record", "letterhead")),
    Requirement("propagation", GUM, "5.2", READ, results.check_propagation),
    Requirement("budgets", GUM, "5.1.3", READ, results.check_budgets),
    Requirement("types", GUM, "4.2, 4.3", READ, results.check_types),
    Requirement("defaults", GUM, "4.3", READ, results.check_defaults),
    Requirement("undeclared", ISO_17025, "7.6.1", MEMORY, results.check_undeclared),
    Requirement("bias", GUM, "3.2.4", MEMORY, results.check_bias),
    Requirement("monte_carlo", GUM_S1, "8", READ, results.check_monte_carlo),
    Requirement("stated", ISO_17025, "7.8.1", MEMORY, results.check_stated),
    Requirement("input", ISO_17025, "7.7", MEMORY, results.check_input),
    Requirement("claims", ISO_17025, "7.8.6", READ, entries.check_claims),
    Requirement("rule", ISO_17025, "7.8.6", READ, conformity.check_rule, (*_PRINTED, "rule")),
    Requirement("verdicts", ISO_17025, "7.8.6", READ, conformity.check_verdicts, _RULED),
    Requirement("rule_statements", RULE, "", MEMORY, conformity.check_sentences,
                (*_PRINTED, "rule")),
    Requirement("rule_scope", RULE, "", MEMORY, conformity.check_scope, _RULED),
    Requirement("rule_results", ILAC_G8, "4.2", READ, conformity.check_results, _RULED),
    Requirement("labels", ISO_17025, "7.8.2, 7.8.4", SUMMARY, text_alone.check_labels, _TEXT),
    Requirement("text_interval", ISO_17025, "7.8.4.3", MEMORY, text_alone.check_interval, _TEXT),
    Requirement("text_claims", ISO_17025, "7.8.6", READ, text_alone.check_claims, _TEXT),
    Requirement("text_table", ISO_17025, "7.8.1", MEMORY, text_alone.check_table, _TEXT),
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
    from tankcal.products.assess.saved import ASSESSMENT

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
