"""Requirements of an assessment, their sources, the findings, and their saved form.

The basis of a requirement states how its text is known: "read" in the text itself; "summary" from a
public guidance page on the clause; "memory", never compared with the text; "internal", a rule of
tankcal. Only a clause that was read is evidence of itself (docs/assess.md).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from tankcal.messages import Message
from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Saved, key

MAJOR, MINOR, OBSERVATION = GRADES = ("major", "minor", "observation")
READ, SUMMARY, MEMORY = "read", "summary", "memory"
BASES = (READ, SUMMARY, MEMORY)
MET, OBSERVED, NOT_MET, NOT_CHECKED = "met", "observed", "not_met", "not_checked"
ISO_17025, ILAC_P14, ILAC_G8 = "ISO/IEC 17025:2017", "ILAC-P14:09/2020", "ILAC-G8:09/2019"
GUM, GUM_S1 = "JCGM 100:2008", "JCGM 101:2008"
RULE = "rule"  # document and clause are those of the rule of the record


@dataclass(frozen=True)
class Finding:
    """A nonconformity or an observation.

    Attributes
    ----------
    text : Message
        The facts; its code is the key of the remedy.
    grade : str
        Element of GRADES.
    file : str
        Name of the file.
    page : int or None
        Page of the file.
    section : str
        Key of the job, part of the record, or heading of the certificate; "": none.
    clause : tuple of (str, str, str), optional
        Document, clause and basis, if they differ from those of the requirement.
    """

    text: Message
    grade: str = MAJOR
    file: str = ""
    page: int | None = None
    section: str = ""
    clause: tuple | None = None


@dataclass(frozen=True)
class Requirement:
    """A requirement and its check.

    Attributes
    ----------
    code : str
        Key of its name in the words.
    document, clause, basis : str
        Source.
    check : callable
        check(evidence) yields each `Finding`.
    needs : tuple of str
        Parts of the evidence without which it cannot be checked, see `is_available`.
    """

    code: str
    document: str
    clause: str
    basis: str
    check: Callable[..., Iterator[Finding]]
    needs: tuple[str, ...] = ("record",)


def is_available(evidence, need):
    """Return whether a part of the evidence is available.

    Parameters
    ----------
    evidence : Evidence
    need : str
        "record", "certificate", "text_alone" (a certificate without record), "rule" or
        "letterhead".

    Returns
    -------
    bool
    """
    if need == "text_alone":
        return evidence.record is None
    if need == "certificate":
        return evidence.certificate is not None
    if evidence.record is None:
        return False
    return need == "record" or bool(getattr(evidence, need))


ASSESSMENT = SavedFormat(
    "tankcal-assessment", 1, "assessment.json", schemas=Path(__file__).with_name("schemas")
)


class RequirementRecord(Saved):
    """A requirement and its outcome."""

    code: str = key("name of the requirement")
    document: str = key('document of the requirement; "rule": that of the record')
    clause: str = key("clause of the document")
    basis: str = key('"read" in the text, "summary": from a guidance page, or "memory"')
    outcome: str = key(
        '"met", "observed" (observations only), "not_met", or "not_checked" (evidence is missing)'
    )


class FindingRecord(Saved):
    """A nonconformity or an observation."""

    requirement: str = key("code of the requirement")
    grade: str = key('"major", "minor" or "observation"')
    document: str = key("document of the requirement")
    clause: str = key("clause of the document")
    basis: str = key('"read", "summary" or "memory", as for the requirement')
    file: str = key("file of the finding")
    page: int | None = key("page of a PDF; null: not known")
    section: str = key('key of the job, part of the record or heading; "": none')
    text: str = key("the facts, in English")
    code: str | None = key("of the text, for its translation and its remedy")
    values: dict = key("of the text")


class AssessmentFile(Saved):
    """An assessment, as written to assessment.json."""

    format: str = key("name and version of the format")
    tankcal: str = key("version of tankcal")
    notice: str = key('"" (an assessment has no notice)')
    source: str = key("assessed folder or file")
    day: str = key("day of the assessment")
    tank: str | None = key("tank of the certificate; null: not known")
    number: str | None = key("number of the certificate; null: not known")
    laboratory: str | None = key("laboratory of the certificate; null: not known")
    software: str | None = key("version of tankcal that computed the record; null: no record")
    language: str | None = key("of the certificate; null: no certificate")
    requirements: list[RequirementRecord] = key("all requirements, in their order")
    findings: list[FindingRecord] = key("all findings, the gravest first")
