"""Checks of the entries of a certificate and of its statements: ISO/IEC 17025:2017, 7.8."""

from datetime import date

from tankcal.messages import message
from tankcal.products.assess.evidence import CERTIFICATE, compact
from tankcal.products.assess.requirements import (
    ISO_17025,
    MEMORY,
    MINOR,
    OBSERVATION,
    Finding,
)
from tankcal.products.assess.wording import (
    PLACEHOLDER,
    claim_text,
    find_claim,
    find_interval,
    interval_text,
    statement_text,
)
from tankcal.report.certificate import instruments_of, missing_keys
from tankcal.report.outputs import RECORD

_DATES = ("date_of_issue", "survey_end")


def check_presence(evidence):
    """Yield a finding if the results lack the printed certificate."""
    if evidence.certificate is None:
        text = message("assess_no_certificate", "the results contain no printed certificate")
        yield Finding(text, file=CERTIFICATE)


def check_entries(evidence):
    """Yield each required entry that the record lacks."""
    text = message("assess_missing", "blank, but required in a certificate")
    for key in missing_keys(evidence.paper):
        yield entry_finding(key, text)


def check_placeholders(evidence):
    """Yield each entry that contains a placeholder."""
    values = {
        f"certificate.{key}": value for key, value in evidence.entries.items() if key not in _DATES
    }
    values["tank.id"] = evidence.record["job"]["tank"]["id"]
    values |= {
        f"instruments.{name}.certificate": certificate
        for name, certificate in instruments_of(evidence.record).items()
        if certificate
    }
    for section, value in values.items():
        if PLACEHOLDER.fullmatch(str(value).strip()):
            text = message("assess_placeholder", "found {value!r}, a placeholder", value=str(value))
            yield Finding(text, file=RECORD, section=section)


def check_dates(evidence):
    """Yield dates of survey and issue that are missing, or in an impossible order."""
    survey = evidence.record["job"]["survey"] or {}
    start, end = survey.get("date"), evidence.entries.get("survey_end")
    issue = evidence.entries.get("date_of_issue")
    if not start:
        text = message("assess_no_survey_date", "no date of the survey")
        yield Finding(text, file=RECORD, section="survey.date")
        return
    last = str(end or start)
    if last < str(start):
        text = message(
            "assess_survey_order",
            "the survey ends on {last}, before its first day, {start}",
            last=last,
            start=str(start),
        )
        yield entry_finding("survey_end", text)
    if issue and str(issue) < last:
        text = message(
            "assess_issued_early",
            "issued on {issue}, before the end of the survey on {last}",
            issue=str(issue),
            last=last,
        )
        yield entry_finding("date_of_issue", text)
    if issue and date.fromisoformat(str(issue)[:10]) > evidence.day:
        text = message(
            "assess_issued_late",
            "issued on {issue}, after the day of this assessment, {day}",
            issue=str(issue),
            day=evidence.day.isoformat(),
        )
        yield entry_finding("date_of_issue", text)


def check_title(evidence):
    """Yield a title that is not that of a certificate."""
    if compact(evidence.paper.word("titles.certificate")) not in evidence.certificate.body:
        text = message("assess_title", "the first page has no title of a calibration certificate")
        yield Finding(text, file=evidence.certificate.name, page=1)


def check_identity(evidence):
    """Yield pages without the number of the certificate, page numbers, or the end mark."""
    certificate, pages = evidence.certificate, len(evidence.certificate.pages)
    number, footer = evidence.entries.get("number"), evidence.paper.words["page"]["footer"]
    for page, lines in enumerate(certificate.lines, 1):
        text = compact("".join(lines))
        if number and compact(str(number)) not in text:
            lacking = message(
                "assess_no_number", "the page lacks the number of the certificate, {number}",
                number=str(number),
            )  # fmt: skip
            yield Finding(lacking, file=certificate.name, page=page)
        if compact(footer.format(page=page, pages=pages)) not in text:
            lacking = message(
                "assess_page_number", "the page is not numbered as page {page} of {pages}",
                page=page, pages=pages,
            )  # fmt: skip
            yield Finding(lacking, file=certificate.name, page=page)
    if compact(evidence.paper.word("page.end")) not in certificate.body:
        lacking = message("assess_no_end", "no mark at the end of the certificate")
        yield Finding(lacking, file=certificate.name, page=pages)


def check_statements(evidence):
    """Yield standing sentences that the certificate does not state."""
    words = ["certificate.only_items", "texts.copy", "certificate.not_in_u"]
    if evidence.entries.get("customer_data"):
        words.append("certificate.data_of_customer")
    for word in words:
        sentence = evidence.paper.word(word)
        if compact(sentence) not in evidence.certificate.body:
            yield Finding(statement_text(sentence), file=evidence.certificate.name)


def check_interval(evidence):
    """Yield entries that recommend an interval of calibration."""
    for key, value in evidence.entries.items():
        if words := find_interval(str(value)):
            yield entry_finding(key, interval_text(words))


def check_claims(evidence):
    """Yield entries that claim conformity although the record has no decision rule."""
    for key, value in evidence.entries.items():
        if (words := find_claim(str(value))) and not evidence.rule:
            yield entry_finding(key, claim_text(words))


def check_traceability(evidence):
    """Yield instruments and equipment without a calibration certificate."""
    equipment = evidence.record["job"].get("equipment") or ()
    certificates = {name: ("instruments", certificate) for name, certificate
                    in instruments_of(evidence.record).items()}  # fmt: skip
    certificates |= {item["name"]: ("equipment", item["certificate"]) for item in equipment}
    for name, (section, certificate) in certificates.items():
        if not str(certificate or "").strip():
            text = message("assess_no_trace", "{name}: no calibration certificate", name=name)
            yield Finding(text, file=RECORD, section=section)


def check_references(evidence):
    """Yield dips without a reference height, and calibrations known by their number only."""
    job = evidence.record["job"]
    if job["datum"]["reference_height_m"] is None:
        text = message(
            "assess_no_reference_height",
            "no reference height: nobody can check by a dip whether the tank has moved",
        )
        yield Finding(text, OBSERVATION, RECORD, section="datum.reference_height_m")
    if not job.get("equipment"):
        text = message(
            "assess_no_register",
            "the calibrations of the instruments have no laboratory and no date",
        )
        clause = (ISO_17025, "7.8.4", MEMORY)
        yield Finding(text, OBSERVATION, RECORD, section="equipment", clause=clause)


def check_calibration_dates(evidence):
    """Yield equipment whose calibration was due before, or made after, the survey."""
    survey = evidence.record["job"]["survey"] or {}
    first = str(survey.get("date") or "")
    last = str(evidence.entries.get("survey_end") or first)
    for item in evidence.record["job"].get("equipment") or () if first else ():
        if item.get("due") and item["due"] < last:
            text = message(
                "assess_due",
                "{name}: its calibration was due on {due}, before the survey of {day}",
                name=item["name"], due=item["due"], day=last,
            )  # fmt: skip
            yield Finding(text, file=RECORD, section="equipment")
        if item.get("date") and item["date"] > first:
            text = message(
                "assess_calibrated_late",
                "{name}: calibrated on {date}, after the survey of {day}",
                name=item["name"], date=item["date"], day=first,
            )  # fmt: skip
            yield Finding(text, MINOR, RECORD, section="equipment")


def check_conditions(evidence):
    """Yield an unknown temperature of the shell, on which the volumes depend."""
    survey = evidence.record["job"]["survey"] or {}
    # A survey by liquid measures the temperature of the liquid instead.
    if survey.get("shell_temperature_c") is None and not evidence.record.get("liquid"):
        text = message("assess_no_temperature", "no temperature of the shell during the survey")
        yield Finding(text, MINOR, RECORD, section="survey.shell_temperature_c")


def check_notice(evidence):
    """Yield a notice, which a certificate for use does not carry."""
    if notice := evidence.entries.get("notice"):
        text = message(
            "assess_notice", "every page has the notice {notice}: not for use", notice=notice
        )
        yield Finding(text, OBSERVATION, RECORD, section="certificate.notice")


def check_overrulings(evidence):
    """Yield decisions on single readings without the person who decided."""
    overrulings = evidence.record.get("overrulings") or {"each": ()}
    unsigned = [row for row in overrulings["each"] if not row["by"]]
    if unsigned:
        text = message(
            "assess_overruled", "{count} decisions on readings do not name a person",
            count=len(unsigned),
        )  # fmt: skip
        yield Finding(text, MINOR, RECORD, section="overrulings")


def entry_finding(key, text):
    """Return the finding of a key of [certificate]."""
    return Finding(text, file=RECORD, section=f"certificate.{key}")
