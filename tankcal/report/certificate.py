"""What a certificate says beside its results: ISO/IEC 17025:2017, 7.8.2.1 and 7.8.4.1.

Printed when given, never invented: what is not given is a line to write on, or named as missing.
"""

from tankcal.job.plausibility_table import CODES
from tankcal.report import blocks
from tankcal.report.metered_liquid import hidden_errors
from tankcal.report.tables.facts import (
    CERTIFICATE,
    REFERENCES,
    SURVEY,
    SURVEY_DATE,
    tank_facts,
)

TO_WRITE_ON = ""
_ELSEWHERE = ("number", "notice", "authorised_by", "authorised_role")
_PARTIES = (
    *("laboratory", "laboratory_address", "country", "accreditation_number"),
    *("customer", "customer_address", "customer_contact", "place", "date_of_issue", "replaces"),
)
_WRITTEN_BY_HAND = ("laboratory", "laboratory_address", "customer", "customer_address", "place")
_CALIBRATION = (
    *("method", "procedure", "deviations", "operator", "equipment", "instruments"),
    *("traceability", "conditions", "condition_of_tank", "external_results", "customer_data"),
)
_ASKED_FOR = ("method", "traceability", "conditions", "condition_of_tank")


def parties(paper):
    """Who issues the certificate, for whom, where and when; then what a job adds of its own."""
    certificate = paper.record["job"]["certificate"]
    given = certificate | {
        "place": certificate.get("place") or paper.record["job"]["tank"]["details"].get("location"),
        "date_of_issue": paper.day(certificate.get("date_of_issue")),
    }
    keys = [key for key in _PARTIES if not _in_the_head(paper, key, certificate)]
    own = [key for key in certificate if key not in (*_PARTIES, *_CALIBRATION, *_ELSEWHERE)]
    return _facts(paper, given, [*keys, *own], (*_WRITTEN_BY_HAND, "date_of_issue"))


def _in_the_head(paper, key, certificate):
    """Whether the head of the first page says it: the laboratory, the letterhead's address."""
    if key == "laboratory":
        return bool(certificate.get(key) or paper.letterhead)
    return key == "laboratory_address" and paper.letterhead and not certificate.get(key)


def doubtful_input(paper):
    """Implausible input, and what no reading checks, under the result; [] where there is neither.

    Such a number may move the volume by far more than U says: it stands where nobody misses it.
    """
    told, hidden, found = doubts_of(paper.record["warnings"]), hidden_errors(paper), []
    if told:
        found += [
            blocks.notice(paper.word("certificate.doubtful")),
            blocks.paragraph(paper.word("certificate.implausible")),
            blocks.listing(told),
        ]
    if hidden:
        found += [blocks.notice(paper.word("certificate.unchecked")), blocks.listing(hidden)]
    return found


def doubts_of(warnings):
    """Lines of those warnings of a record that speak of implausible numbers."""
    return [_line(one) for one in warnings if one.get("code") in CODES]


def _line(warning):
    place = ", ".join(part for part in (warning["file"], warning["column"]) if part)
    return f"{place}: {warning['text']}"


def tank(paper):
    """The tank, and what its table refers to."""
    shown = (tank_facts(paper.record), REFERENCES)
    return paper.facts([fact for table in shown for fact in paper.facts_of(table, CERTIFICATE)])


def calibration(paper):
    """How, in which conditions and with what the tank was measured."""
    given = paper.record["job"]["certificate"] | {"instruments": _instruments(paper)}
    declared = [(key, given[key]) for key in _CALIBRATION if given.get(key)]
    date, measured = map(paper.facts_of, (SURVEY_DATE, SURVEY))
    return paper.facts([*date, *declared, *measured])


def _instruments(paper):
    """The instruments with their certificates in one text; "" where there are none."""
    return "; ".join(
        paper.word(
            "certificate.instrument",
            name=name,
            certificate=certificate or paper.word("certificate.no_certificate"),
        )
        for name, certificate in instruments_of(paper.record).items()
    )


def instruments_of(record):
    """{instrument: its certificate, or None} of an adjusted survey, of tapes, scanners, meters."""
    adjustment = record["adjustment"]
    strapping, lines = (record.get(key) for key in ("strapping", "lines"))
    sighted = (record.get("hits"), record.get("tangents"))
    used = {}
    for one in adjustment["instruments"] if adjustment else ():
        used[one["instrument"]] = one["details"].get("certificate")
    for one in lines["plummets"] if lines else ():
        if one["plummet"]:  # else nobody described it
            used[one["plummet"]] = one["certificate"]
    for one in (setup for sights in sighted if sights for setup in sights["setups"]):
        if one["instrument"]:
            used[one["instrument"]] = one["certificate"]
    for one in (record.get("clouds") or {}).get("scanners", ()):
        used[one["scanner"]] = one["certificate"]
    for one in (record.get("liquid") or {}).get("meters", ()):
        used[one["meter"]] = one["certificate"]
    taped = [one for one in (strapping, record.get("great_circles")) if one]
    for one in (tape for given in taped for tape in given["tapes"]):
        used[one["tape"]] = one["certificate"]
        if one["master"]:
            used[one["master"]] = one["master_certificate"]
    return used


def statements(paper):
    """What the results relate to, copies, and what is asked for and was not given."""
    certificate = paper.record["job"]["certificate"]
    missing = [paper.label(key) for key in _ASKED_FOR if not certificate.get(key)]
    said = [paper.word("certificate.only_items"), paper.word("texts.copy")]
    if missing:
        said.append(paper.word("certificate.not_given", missing=", ".join(missing)))
    return blocks.listing(said)


def authorisation(paper):
    """Lines to sign on; the name of who authorises stands below its line when it was given."""
    certificate = paper.record["job"]["certificate"]
    name, role = (certificate.get(key) for key in ("authorised_by", "authorised_role"))
    person = paper.label("authorised_by")
    if name:
        person = paper.word("certificate.authorised", name=name, role=role) if role else name
    labels = [paper.label("place_and_date"), person, paper.label("signature")]
    return blocks.signature(labels, paper.word("dcc.sign_here"))


def hash_of_record(paper):
    """The SHA-256 of the record that is printed, as a QR code; None without a file of it."""
    digest = paper.digest
    if digest is None:
        return None
    return blocks.hash_code(digest, paper.word("dcc.hash_of"), paper.words["dcc"]["code_alt"])


def _facts(paper, given, keys, to_write_on):
    """Names and values; one that is not given is a line to write on when it is of those."""
    return blocks.key_values(
        [
            (paper.label(key), given.get(key) or TO_WRITE_ON)
            for key in keys
            if given.get(key) or key in to_write_on
        ]
    )
