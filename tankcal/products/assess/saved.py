"""Saved assessment: assessment.json."""

from pathlib import Path

from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Saved, key

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
