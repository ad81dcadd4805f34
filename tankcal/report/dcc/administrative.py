"""Who calibrated what, for whom, when: administrativeData of the certificate's XML."""

import tankcal
from tankcal.report import certificate as papers
from tankcal.report.dcc.elements import CUBIC_METRE, METRE, child, clean, contact, contents, real
from tankcal.report.tables.facts import CERTIFICATE, REFERENCES, tank_facts

UNKNOWN_COUNTRY = "ZZ"  # no country has it in ISO 3166-1: an element for users, "not stated"
NAMESPACE = "tankcal"
_LINK = "docs/certificate-digital.md"  # of tankcal: what its types are
_SAID_ELSEWHERE = (
    *("number", "country", "date_of_issue", "method", "procedure", "accreditation_number"),
    *("laboratory", "laboratory_address", "customer", "customer_address"),
    *("authorised_by", "authorised_role", "operator", "notice"),
)
_NEEDED = (
    "country",
    "laboratory",
    "laboratory_address",
    "authorised_by",
    "customer",
    "customer_address",
)
_VERDICTS = {"passed": "pass", "failed": "fail", "not_accepted": "noPass"}


def administrative_data(parent, tongues, digest):
    """Fill the element: software, types, core data, the tank, laboratory, persons, customer."""
    software(child(parent, "dccSoftware"), "tankcal", tankcal.__version__, "application")
    _types(child(parent, "refTypeDefinitions"), tongues)
    _core_data(child(parent, "coreData"), tongues, digest)
    _tank(child(child(parent, "items"), "item"), tongues)
    _laboratory(child(parent, "calibrationLaboratory"), tongues)
    _persons(child(parent, "respPersons"), tongues)
    given = tongues.job["certificate"]
    who, where = (tongues.or_not_stated(given.get(f"customer{of}")) for of in ("", "_address"))
    contact(parent, "customer", who, where)
    _statements(child(parent, "statements"), tongues)


def software(parent, name, release, kind):
    """A program with its version, added to a list of software."""
    found = child(parent, "software")
    contents(found, "name", name)
    child(found, "release", f"v{release}")
    child(found, "type", kind)


def country_of(certificate):
    """The country of issue, two letters; None where the job does not state it."""
    given = clean(certificate.get("country")).upper()
    return given if len(given) == 2 and given.isascii() and given.isalpha() else None


def _types(parent, tongues):
    found = child(parent, "refTypeDefinition")
    contents(found, "name", NAMESPACE)
    contents(found, "description", tongues.word("dcc.types"))
    child(found, "namespace", NAMESPACE)
    child(found, "link", _LINK)
    child(found, "release", f"v{tankcal.__version__}")


def _core_data(parent, tongues, digest):
    certificate, day = tongues.job["certificate"], tongues.job["survey"]["date"]
    child(parent, "countryCodeISO3166_1", country_of(certificate) or UNKNOWN_COUNTRY)
    for language in tongues.papers:
        child(parent, "usedLangCodeISO639_1", language)
    child(parent, "mandatoryLangCodeISO639_1", next(iter(tongues.papers)))
    child(parent, "uniqueIdentifier", clean(certificate.get("number")) or f"sha256:{digest}")
    identified = child(parent, "identifications")
    identification(identified, f"sha256:{digest}", tongues.word("dcc.record"), "tankcal_record")
    child(parent, "beginPerformanceDate", day)
    child(parent, "endPerformanceDate", day)
    child(parent, "performanceLocation", "other")
    if certificate.get("date_of_issue"):
        child(parent, "issueDate", str(certificate["date_of_issue"]))


def identification(parent, value, names, kind):
    """A name or number that something goes by; by whom it was given is not known."""
    found = child(parent, "identification", refType=kind)
    child(found, "issuer", "other")
    child(found, "value", value)
    contents(found, "name", names)


def _tank(parent, tongues):
    tank = tongues.job["tank"]
    contents(parent, "name", tongues.word(f"kinds.{tank['kind']}"))
    contents(parent, "description", tongues.each(_facts_of_tank))
    identified = child(parent, "identifications")
    identification(identified, clean(tank["id"]), tongues.label("tank_id"), "tankcal_tank")
    sizes = {"diameter": METRE, "height": METRE, "volume": CUBIC_METRE}
    given = {key: tank.get(f"nominal_{key}_{'m3' if key == 'volume' else 'm'}") for key in sizes}
    if any(value is not None for value in given.values()):
        nominal = child(parent, "itemQuantities")
        for key, value in given.items():
            names = tongues.label(f"nominal_{key}")
            real(
                nominal, key, value, sizes[key], names, of="itemQuantity", kind="basic_nominalValue"
            )


def _facts_of_tank(paper):
    """What the tank is, and what its table refers to, as the certificate says it, in one text."""
    shown = [
        fact
        for table in (tank_facts(paper.record), REFERENCES)
        for fact in paper.facts_of(table, CERTIFICATE)
    ]
    return "; ".join(f"{paper.label(key)}: {text}" for key, text in shown if text)


def _laboratory(parent, tongues):
    given = tongues.job["certificate"]
    if clean(given.get("accreditation_number")):
        child(parent, "calibrationLaboratoryCode", clean(given["accreditation_number"]))
    who, where = (tongues.or_not_stated(given.get(f"laboratory{of}")) for of in ("", "_address"))
    contact(parent, "contact", who, where)


def _persons(parent, tongues):
    given = tongues.job["certificate"]
    signs = child(parent, "respPerson")
    contents(child(signs, "person"), "name", tongues.or_not_stated(given.get("authorised_by")))
    contents(signs, "description", tongues.label("authorised_by"))
    if clean(given.get("authorised_role")):
        child(signs, "role", clean(given["authorised_role"]))
    child(signs, "mainSigner", "true")
    if clean(given.get("operator")):
        surveyed = child(parent, "respPerson")
        contents(child(surveyed, "person"), "name", given["operator"])
        contents(surveyed, "description", tongues.label("operator"))


def _statements(parent, tongues):
    """What a job says beside: its notice first, what it does not state, the verdict of its rule."""
    given = tongues.job["certificate"]
    if clean(given.get("notice")):
        statement(parent, tongues.word("dcc.notice"), given["notice"], "tankcal_notice")
    if papers.doubts_of(tongues.record["warnings"]):
        doubts = tongues.each(_doubts)
        statement(parent, tongues.word("certificate.doubtful"), doubts, "tankcal_doubt")
    statement(
        parent, tongues.word("dcc.validity"), tongues.word("certificate.only_items"),
        "tankcal_validity",
    )  # fmt: skip
    missing = [key for key in _NEEDED if not clean(given.get(key))]
    if missing:
        names = tongues.each(lambda paper: ", ".join(map(paper.label, missing)))
        statement(parent, tongues.word("dcc.not_stated"), names, "tankcal_notStated")
    for key in given:
        if key not in _SAID_ELSEWHERE and clean(given[key]):
            statement(parent, tongues.label(key), given[key], f"tankcal_{_kind(key)}")
    rule = tongues.record.get("rule")
    if rule:
        _verdict(parent, tongues, rule)


def _doubts(paper):
    return " ".join(papers.doubts_of(paper.record["warnings"]))


def statement(parent, names, declared, kind):
    """A statement: what it is about, and what is declared; gives its element."""
    found = child(parent, "statement", refType=kind)
    contents(found, "name", names)
    contents(found, "declaration", declared)
    return found


def _verdict(parent, tongues, rule):
    """The verdict of the decision rule; its code only where the schema has a word for it."""
    said = tongues.word(f"rule_codes.{rule['code']}")
    found = child(parent, "statement", refType="tankcal_rule")
    contents(found, "name", tongues.word("headings.rule"))
    child(found, "norm", clean(rule["rule"]["name"]))
    child(found, "reference", clean(rule["rule"]["source"]))
    contents(found, "declaration", said)
    if rule["code"] in _VERDICTS:
        child(found, "conformity", _VERDICTS[rule["code"]])


def _kind(key):
    """A key as part of a type's name."""
    return "".join(one if one.isascii() and one.isalnum() else "_" for one in key)
