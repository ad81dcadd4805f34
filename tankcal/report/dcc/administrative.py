"""Element administrativeData of the XML certificate: laboratory, customer, tank, dates."""

import tankcal
from tankcal.job.certificate_entries import missing_entries
from tankcal.report.certificate import doubts_of, entry_labels, next_verification_text
from tankcal.report.dcc.elements import (
    CUBIC_METRE,
    METRE,
    add_child,
    add_contact,
    add_real,
    add_text,
    clean,
)
from tankcal.report.tables.facts import CERTIFICATE, REFERENCES, tank_facts

UNKNOWN_COUNTRY = "ZZ"  # not stated: a code that ISO 3166-1 reserves for users
NAMESPACE = "tankcal"
_LINK = "docs/certificate-digital.md"  # page of tankcal on its types
_OTHER_ELEMENTS = (  # keys of the certificate with elements of their own
    *(
        "number",
        "country",
        "date_of_issue",
        "method",
        "standard",
        "procedure",
        "accreditation_number",
    ),
    *("laboratory", "laboratory_address", "customer", "customer_address"),
    *("authorised_by", "authorised_role", "operator", "notice", "survey_end"),
    *("next_verification", "next_verification_rule"),
)
SEAL_TEXTS = ("place", "mark", "secures", "attached")  # texts of a seal, in their order
# Codes of the schema for verdicts.
_CONFORMITY = {"passed": "pass", "failed": "fail", "not_accepted": "noPass"}


def add_administrative_data(parent, languages, digest):
    """Fill the element: software, types, core data, tank, laboratory, persons, customer."""
    add_software(add_child(parent, "dccSoftware"), "tankcal", tankcal.__version__, "application")
    _types(add_child(parent, "refTypeDefinitions"), languages)
    _core_data(add_child(parent, "coreData"), languages, digest)
    _tank(add_child(add_child(parent, "items"), "item"), languages)
    _laboratory(add_child(parent, "calibrationLaboratory"), languages)
    _persons(add_child(parent, "respPersons"), languages)
    _add_contact_of(parent, "customer", languages, "customer")
    _statements(add_child(parent, "statements"), languages)


def add_software(parent, name, release, kind):
    """Add a program with its version to a list of software."""
    element = add_child(parent, "software")
    add_text(element, "name", name)
    add_child(element, "release", f"v{release}")
    add_child(element, "type", kind)


def country_of(certificate):
    """Return the country of issue, two letters; None if the job does not state it."""
    code = clean(certificate.get("country")).upper()
    return code if len(code) == 2 and code.isascii() and code.isalpha() else None


def _types(parent, languages):
    element = add_child(parent, "refTypeDefinition")
    add_text(element, "name", NAMESPACE)
    add_text(element, "description", languages.word("dcc.types"))
    add_child(element, "namespace", NAMESPACE)
    add_child(element, "link", _LINK)
    add_child(element, "release", f"v{tankcal.__version__}")


def _core_data(parent, languages, digest):
    certificate, day = languages.job["certificate"], languages.job["survey"]["date"]
    add_child(parent, "countryCodeISO3166_1", country_of(certificate) or UNKNOWN_COUNTRY)
    for language in languages.papers:
        add_child(parent, "usedLangCodeISO639_1", language)
    add_child(parent, "mandatoryLangCodeISO639_1", next(iter(languages.papers)))
    add_child(parent, "uniqueIdentifier", clean(certificate.get("number")) or f"sha256:{digest}")
    identified = add_child(parent, "identifications")
    names = languages.word("dcc.record")
    add_identification(identified, f"sha256:{digest}", names, "tankcal_record")
    add_child(parent, "beginPerformanceDate", day)
    add_child(parent, "endPerformanceDate", str(certificate.get("survey_end") or day))
    add_child(parent, "performanceLocation", "other")
    if certificate.get("date_of_issue"):
        add_child(parent, "issueDate", str(certificate["date_of_issue"]))
    if replaced := clean(certificate.get("replaces")):
        substituted = add_child(parent, "reportAmendedSubstituted")
        add_child(substituted, "typeOfChange", "substituted")
        add_child(substituted, "replacedUniqueIdentifier", replaced)


def add_identification(parent, value, names, kind):
    """Add an identifying name or number; its issuer is not known."""
    element = add_child(parent, "identification", refType=kind)
    add_child(element, "issuer", "other")
    add_child(element, "value", value)
    add_text(element, "name", names)


def _tank(parent, languages):
    tank = languages.job["tank"]
    add_text(parent, "name", languages.word(f"kinds.{tank['kind']}"))
    add_text(parent, "description", languages.each(_facts_of_tank))
    identified = add_child(parent, "identifications")
    add_identification(identified, clean(tank["id"]), languages.label("tank_id"), "tankcal_tank")
    sizes = {"diameter": METRE, "height": METRE, "volume": CUBIC_METRE}
    values = {key: tank.get(f"nominal_{key}_{'m3' if key == 'volume' else 'm'}") for key in sizes}
    if any(value is not None for value in values.values()):
        nominal = add_child(parent, "itemQuantities")
        for key, value in values.items():
            names = languages.label(f"nominal_{key}")
            add_real(
                nominal, key, value, sizes[key], names, of="itemQuantity", kind="basic_nominalValue"
            )


def _facts_of_tank(paper):
    """Return the facts of the certificate on the tank and its reference conditions as a text."""
    shown = [
        fact
        for table in (tank_facts(paper.record), REFERENCES)
        for fact in paper.facts_of(table, CERTIFICATE)
    ]
    return "; ".join(f"{paper.label(key)}: {text}" for key, text in shown if text)


def _laboratory(parent, languages):
    certificate = languages.job["certificate"]
    if clean(certificate.get("accreditation_number")):
        add_child(parent, "calibrationLaboratoryCode", clean(certificate["accreditation_number"]))
    _add_contact_of(parent, "contact", languages, "laboratory")


def _add_contact_of(parent, name, languages, role):
    """Add the contact of the laboratory or customer (`role`) as the element `name`."""
    certificate = languages.job["certificate"]
    texts = (languages.or_not_stated(certificate.get(key)) for key in (role, f"{role}_address"))
    add_contact(parent, name, *texts)


def _persons(parent, languages):
    certificate = languages.job["certificate"]
    signs = add_child(parent, "respPerson")
    name = languages.or_not_stated(certificate.get("authorised_by"))
    add_text(add_child(signs, "person"), "name", name)
    add_text(signs, "description", languages.label("authorised_by"))
    if clean(certificate.get("authorised_role")):
        add_child(signs, "role", clean(certificate["authorised_role"]))
    add_child(signs, "mainSigner", "true")
    if clean(certificate.get("operator")):
        surveyed = add_child(parent, "respPerson")
        add_text(add_child(surveyed, "person"), "name", certificate["operator"])
        add_text(surveyed, "description", languages.label("operator"))


def _statements(parent, languages):
    """Add the statements: notice, doubts, missing data, further keys of the job, verdict."""
    certificate = languages.job["certificate"]
    if clean(certificate.get("notice")):
        add_statement(parent, languages.word("dcc.notice"), certificate["notice"], "tankcal_notice")
    if doubts_of(languages.record["warnings"]):
        doubts = languages.each(_doubts)
        add_statement(parent, languages.word("certificate.doubtful"), doubts, "tankcal_doubt")
    add_statement(
        parent, languages.word("dcc.validity"), languages.word("certificate.only_items"),
        "tankcal_validity",
    )  # fmt: skip
    missing = missing_entries(certificate, languages.job["tank"]["details"].get("location"))
    missing += [] if clean(certificate.get("country")) else ["country"]
    if missing:
        names = languages.each(lambda paper: ", ".join(entry_labels(paper, missing)))
        add_statement(parent, languages.word("dcc.not_stated"), names, "tankcal_notStated")
    for key in certificate:
        if key not in _OTHER_ELEMENTS and clean(certificate[key]):
            add_statement(parent, languages.label(key), certificate[key], f"tankcal_{_kind(key)}")
    if languages.job.get("next_verification"):
        text = languages.each(next_verification_text)
        names = languages.label("next_verification")
        add_statement(parent, names, text, "tankcal_nextVerification")
    for seal in languages.job.get("seals") or ():
        text = "; ".join(seal[key] for key in SEAL_TEXTS if seal[key])
        add_statement(parent, languages.word("headings.seals"), text, "tankcal_seal")
    rule = languages.record.get("rule")
    if rule:
        _verdict(parent, languages, rule)


def _doubts(paper):
    return " ".join(doubts_of(paper.record["warnings"]))


def add_statement(parent, names, declared, kind):
    """Add a statement with its subject and declaration, and return its element."""
    element = add_child(parent, "statement", refType=kind)
    add_text(element, "name", names)
    add_text(element, "declaration", declared)
    return element


def _verdict(parent, languages, rule):
    """Add the verdict of the decision rule; its code only if the schema has an equivalent."""
    text = languages.word(f"rule_codes.{rule['code']}")
    element = add_child(parent, "statement", refType="tankcal_rule")
    add_text(element, "name", languages.word("headings.rule"))
    add_child(element, "norm", clean(rule["rule"]["name"]))
    add_child(element, "reference", clean(rule["rule"]["source"]))
    add_text(element, "declaration", text)
    if rule["code"] in _CONFORMITY:
        add_child(element, "conformity", _CONFORMITY[rule["code"]])


def _kind(key):
    """Return a key as a part of the name of a type."""
    return "".join(sign if sign.isascii() and sign.isalnum() else "_" for sign in key)
