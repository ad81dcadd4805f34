"""Requirements of an assessment, their sources, and the findings.

The basis of a requirement states how its text is known: "read" in the text itself; "summary" from a
public guidance page on the clause; "memory", never compared with the text; "internal", a rule of
tankcal. Only a clause that was read is evidence of itself (docs/assess.md).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from tankcal.messages import Message

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
