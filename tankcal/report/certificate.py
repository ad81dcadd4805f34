"""Statements of a certificate besides its results: ISO/IEC 17025:2017, 7.8.2.1 and 7.8.4.1.

The certificate prints only statements of the job. A missing statement becomes a blank line or is
listed as missing.
"""

from math import hypot

from tankcal.job.certificate_entries import missing_entries
from tankcal.job.plausibility import CODES
from tankcal.methods.base import methods
from tankcal.report import blocks
from tankcal.report.laboratory import find_capability, is_outside_scope
from tankcal.report.tables.facts import (
    CERTIFICATE,
    REFERENCES,
    SURVEY,
    SURVEY_DATE,
    tank_facts,
)
from tankcal.report.uncertainty.method import missing_inputs
from tankcal.report.uncertainty.stated import stated_U_m3

TO_WRITE_ON = ""  # value that the page style prints as a blank line
# Entries of [certificate] that other parts of the paper print.
_ELSEWHERE = (
    *("number", "notice", "survey_end", "authorised_by", "authorised_role"),
    *("next_verification", "next_verification_rule"),
)
_PARTIES = (
    *("laboratory", "laboratory_address", "country", "accreditation_number"),
    *("customer", "customer_address", "customer_contact", "place", "date_of_issue", "replaces"),
)
# Blank lines to fill in by hand if the job does not give these entries.
_WRITTEN_BY_HAND = ("laboratory", "laboratory_address", "customer", "customer_address", "place")
_CALIBRATION = (
    *("method", "standard", "procedure", "deviations", "operator", "equipment", "instruments"),
    *("traceability", "conditions", "condition_of_tank", "external_results", "customer_data"),
)


def parties(paper):
    """Block of laboratory, customer, place, date of issue, and additional entries of the job."""
    certificate = paper.record["job"]["certificate"]
    given = certificate | {
        "place": certificate.get("place") or paper.record["job"]["tank"]["details"].get("location"),
        "date_of_issue": paper.day(certificate.get("date_of_issue")),
    }
    keys = [key for key in _PARTIES if not _is_in_head(paper, key, certificate)]
    additional_keys = [
        key for key in certificate if key not in (*_PARTIES, *_CALIBRATION, *_ELSEWHERE)
    ]
    return _facts(paper, given, [*keys, *additional_keys], (*_WRITTEN_BY_HAND, "date_of_issue"))


def _is_in_head(paper, key, certificate):
    """Return whether the head of the first page prints this entry already."""
    if key == "laboratory":
        return bool(certificate.get(key) or paper.letterhead)
    return key == "laboratory_address" and paper.letterhead and not certificate.get(key)


def limits_of_u(paper):
    """Sentences (str) of the first page on what U does not include, and on effects not corrected.

    An effect whose correction is switched off has a known sign: the change of the capacity that
    the correction would make.
    """
    texts = [paper.word("certificate.not_in_u")]
    if missing := missing_inputs(paper):
        texts.append(paper.word("certificate.undeclared", missing="; ".join(missing)))
    effects = [
        paper.word(
            "certificate.effect",
            name=name,
            sign="+" if size_m3 > 0 else "",
            size=paper.number(size_m3, "m3", digits=3),
        )
        for name, size_m3 in _effects_without_correction(paper)
    ]
    if effects:
        texts.append(paper.word("certificate.not_corrected", effects="; ".join(effects)))
    return " ".join(texts)


def _effects_without_correction(paper):
    """Return name and size, m3, of each known effect that the table does not correct (list)."""
    record = paper.record
    effects = [
        (paper.word(f"corrections.{row['code']}"), row["size_m3"])
        for row in record["corrections"]
        if not row["applied"] and row["size_m3"]
    ]
    tilts = {choice["value"] for choice in record["choices"] if choice["code"] == "tilt"}
    lines = record.get("lines") or {}
    if "not_applied" in tilts and lines.get("lean_x") is not None:
        slope = hypot(lines["lean_x"], lines["lean_y"])
        # A horizontal cut of a shell of slope m is sqrt(1 + m^2) times the cut square to its axis.
        size_m3 = record["capacity"]["volume_m3"][-1] * (hypot(1.0, slope) - 1)
        shown = paper.number(slope, "mm/m", digits=3)
        effects.append((f"{paper.word('corrections.tilt')} ({shown})", size_m3))
    return effects


def doubtful_input(paper):
    """Blocks that warn of implausible input and of quantities without a check; [] if none.

    Such input can change the volume by far more than U. The blocks therefore follow the result.
    """
    hidden = [sentence for method in methods() for sentence in method.unchecked(paper)]
    lines, notices = doubts_of(paper.record["warnings"]), []
    if lines:
        notices += [
            blocks.notice(paper.word("certificate.doubtful")),
            blocks.paragraph(paper.word("certificate.implausible")),
            blocks.listing(lines),
        ]
    if hidden:
        notices += [blocks.notice(paper.word("certificate.unchecked")), blocks.listing(hidden)]
    return notices


def doubts_of(warnings):
    """Return a line of text for each warning of implausible input (list of str)."""
    return [_line(warning) for warning in warnings if warning.get("code") in CODES]


def _line(warning):
    place = ", ".join(part for part in (warning["file"], warning["column"]) if part)
    return f"{place}: {warning['text']}"


def tank(paper):
    """Block of the tank and of the reference conditions of its table."""
    shown = (tank_facts(paper.record), REFERENCES)
    return paper.facts([fact for table in shown for fact in paper.facts_of(table, CERTIFICATE)])


def calibration(paper):
    """Block of the calibration: method, conditions and instruments."""
    given = paper.record["job"]["certificate"] | {"instruments": _instruments(paper)}
    declared = [(key, given[key]) for key in _CALIBRATION if given.get(key)]
    date, measured = map(paper.facts_of, (SURVEY_DATE, SURVEY))
    return paper.facts([*date, *declared, *measured, *calibration_facts(paper)])


def calibration_facts(paper):
    """Labels and texts of everyday data, noise and next verification, as far as known."""
    facts = (
        ("upkeep", upkeep_text(paper)),
        ("section_noise", homogeneity_text(paper)),
        ("next_verification", next_verification_text(paper)),
    )
    return [(key, text) for key, text in facts if text]


def upkeep_text(paper):
    """Return the period of the everyday data in the table, and its meters; None without data."""
    upkeep = paper.record.get("upkeep")
    if not upkeep:
        return None
    meters = [f"{meter['name']} ({meter['certificate']})" for meter in upkeep["meters"]
              if meter["certificate"]]  # fmt: skip
    return paper.word(
        "certificate.upkeep", first=paper.day(upkeep["first"]), last=paper.day(upkeep["last"]),
        steps=upkeep["steps"], digest=upkeep["former_sha256"][:12], meters=", ".join(meters),
    )  # fmt: skip


def homogeneity_text(paper):
    """Return whether the noise of the sections is homogeneous, by Bartlett's test; None: no test.

    The report calls the noise inhomogeneous exactly where the run warns of it.
    """
    test = paper.record.get("homogeneity")
    if not test or test["p"] is None:
        return None
    warned = any(
        warning.get("code") == "sections_inhomogeneous" for warning in paper.record["warnings"]
    )
    word = "inhomogeneous" if warned else "homogeneous"
    return paper.word(f"certificate.{word}", p=paper.number(test["p"], digits=2))


def next_verification_text(paper):
    """Return the last day of the next verification with its rule, or the customer; None: none."""
    last = paper.record["job"].get("next_verification")
    if not last:
        return None
    if last["rule"] is None:
        return paper.word("certificate.verification_wished", day=paper.day(last["date"]))
    return paper.word(
        "certificate.verification_by_rule",
        day=paper.day(last["date"]),
        rule=last["rule"],
        clause=last["clause"],
    )


def plate(paper):
    """Blocks of the identification plate by the rule of the job, drawn; [] without entries.

    The certificate shows the plate of a rule that was compared with its text only.
    """
    from tankcal.report.plate import draw_plate  # loads matplotlib

    rule = (paper.record.get("rule") or {}).get("rule", {})
    if not rule.get("plate"):
        return []
    lines = []
    for entry in rule["plate"]:
        is_number = entry.startswith("certificate_number")
        label = paper.label("certificate_number" if is_number else entry)
        lines.append((label, _plate_text(paper, entry)))
    described = "; ".join(f"{label}: {text}" for label, text in lines)
    caption = paper.word("captions.plate", rule=rule["name"])
    alt = paper.word("captions.plate_alt", lines=described)
    return [paper.heading("plate"), blocks.figure(draw_plate(lines), caption, alt)]


def _plate_text(paper, entry):
    """Return an entry of the plate; a blank line for an entry that the job does not give."""
    record = paper.record
    job, certificate = record["job"], record["job"]["certificate"]
    number = certificate.get("number") or TO_WRITE_ON
    year = str(certificate.get("date_of_issue") or job["survey"]["date"])[2:4]
    height = job["datum"]["reference_height_m"]
    texts = {
        "laboratory": lambda: paper.laboratory(),
        "tank_id": lambda: job["tank"]["id"],
        "certificate_number": lambda: number,
        "certificate_number_and_year": lambda: f"{number} | {year}",
        "survey_date": lambda: paper.day(job["survey"]["date"]),
        "date_of_issue": lambda: paper.day(certificate.get("date_of_issue")),
        "nominal_volume": lambda: paper.plain(job["tank"]["nominal_volume_m3"], "m³"),
        "capacity": lambda: paper.number(
            record["capacity"]["volume_m3"][-1], "m3", u=stated_U_m3(record["capacity"])[-1] or None
        ),
        "zero": lambda: paper.word(f"zeros.{record['capacity']['zero']}"),
        "reference_height": lambda: height and paper.number(height, "m", decimals=3),
        "reference_temperature": lambda: paper.number(
            job["table"]["reference_temperature_c"], "degC", digits=3
        ),
    }
    return texts[entry]() or TO_WRITE_ON


def _instruments(paper):
    """Return a text of the instruments that the table of equipment does not contain."""
    listed = {item["name"] for item in paper.record["job"].get("equipment") or ()}
    return "; ".join(
        paper.word(
            "certificate.instrument",
            name=name,
            certificate=certificate or paper.word("certificate.no_certificate"),
        )
        for name, certificate in instruments_of(paper.record).items()
        if name not in listed
    )


def instruments_of(record):
    """Return {instrument: certificate or None} of all instruments of a record."""
    adjustment = record["adjustment"]
    used = {}
    for entry in adjustment["instruments"] if adjustment else ():
        used[entry["instrument"]] = entry["details"].get("certificate")
    for method in sorted(methods(), key=lambda method: method.comes_last):
        if record.get(method.name):
            used |= method.certificates(record[method.name])
    return used


def missing_keys(paper):
    """Return the keys of required entries that the certificate lacks (list of str)."""
    job = paper.record["job"]
    return missing_entries(
        job["certificate"], job["tank"]["details"].get("location"), bool(paper.letterhead)
    )


def entry_labels(paper, keys):
    """Return the labels of entries of [certificate] (list of str)."""
    return [paper.word("page.number") if key == "number" else paper.label(key) for key in keys]


def title(paper):
    """Return the title of the certificate; it names a draft if required entries are missing."""
    return paper.word("titles.draft" if missing_keys(paper) else "titles.certificate")


def statements(paper):
    """List of statements: items calibrated, copies of the certificate, and missing entries."""
    certificate = paper.record["job"]["certificate"]
    missing = entry_labels(paper, missing_keys(paper))
    rule = (paper.record.get("rule") or {}).get("rule", {})
    words = ("certificate.only_items", "texts.copy", "certificate.digits")
    sentences = [paper.word(word) for word in words]
    sentences += rule.get("statements", [])
    if is_outside_scope(paper.letterhead, paper.record):
        sentences.append(paper.word("certificate.outside_scope"))
    elif capability := find_capability(paper.letterhead, paper.record):
        sentences.append(paper.word("certificate.cmc", percent=f"{capability['percent']:g}"))
    if certificate.get("customer_data"):
        sentences.append(paper.word("certificate.data_of_customer"))
    if missing:
        sentences.append(paper.word("certificate.not_given", missing=", ".join(missing)))
    return blocks.listing(sentences)


def authorisation(paper):
    """Signature lines, with the name and role of the authorising person if given."""
    person = authorising_person(paper.record["job"]["certificate"]) or paper.label("authorised_by")
    labels = [paper.label("place_and_date"), person, paper.label("signature")]
    copy = [paper.word(f"certificate.{key}") for key in ("copy", "original")]
    return blocks.signature(labels, paper.word("dcc.sign_here"), copy)


def authorising_person(certificate):
    """Return the name and the function of the authorising person; "" if no name is given."""
    name, role = (certificate.get(key) for key in ("authorised_by", "authorised_role"))
    return ", ".join(filter(None, (name, role))) if name else ""


def hash_of_record(paper):
    """QR code of the SHA-256 of the record; None if the record has no file."""
    digest = paper.digest
    if digest is None:
        return None
    text = paper.word("dcc.hash_of", software=f"tankcal {paper.record['tankcal']}")
    return blocks.hash_code(digest, text, paper.words["dcc"]["code_alt"])


def _facts(paper, given, keys, to_write_on):
    """Block of names and values; a missing value of `to_write_on` becomes a blank line."""
    return blocks.key_values(
        [
            (paper.label(key), given.get(key) or TO_WRITE_ON)
            for key in keys
            if given.get(key) or key in to_write_on
        ]
    )
