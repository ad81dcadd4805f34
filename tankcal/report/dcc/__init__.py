"""Digital calibration certificate: elements of its XML, administrative data, and the whole file.

The digital calibration certificate: XML of the German metrology institute (PTB), schema 3.3.0.

The certificate contains data of the record only. Elements that the schema requires and the job
lacks are "not stated" (docs/certificate-digital.md). This module writes the element
measurementResults: methods, conditions, results, provenance.
"""

import math
from xml.etree import ElementTree

import tankcal
from tankcal.job.certificate_entries import missing_entries
from tankcal.report.blocks import without_controls
from tankcal.report.certificate import (
    doubts_of,
    entry_labels,
    instruments_of,
    next_verification_text,
)
from tankcal.report.paper import Paper
from tankcal.report.tables import survey as overrulings
from tankcal.report.tables.facts import CERTIFICATE, REFERENCES, tank_facts
from tankcal.report.uncertainty.stated import k_of_rows, limit_rows, stated_U_m3
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import language_of, load_words

DCC = "https://ptb.de/dcc"
SI = "https://ptb.de/si"
VERSION = "3.3.0"  # of the schema; with D-SI 2.2
ROOT = "digitalCalibrationCertificate"
_XSI = "http://www.w3.org/2001/XMLSchema-instance"

METRE, SQUARE_METRE, CUBIC_METRE = r"\metre", r"\metre\tothe{2}", r"\metre\tothe{3}"
CELSIUS, DENSITY, PER_KELVIN = r"\degreecelsius", r"\kilogram\metre\tothe{-3}", r"\kelvin\tothe{-1}"
DEGREE, KILOGRAM, ONE = r"\degree", r"\kilogram", r"\one"
LEAST_K = 1.0  # smallest coverage factor of D-SI


class Languages:
    """Words and sentences in each language; the first language is authoritative."""

    def __init__(self, papers):
        self.papers = {paper.words["language"]["code"].split("-")[0]: paper for paper in papers}

    def word(self, name, /, **values):
        """Return the word or sentence "group.key", {language: text}."""
        return self.each(lambda paper: paper.word(name, **values))

    def label(self, key):
        """Return the label of a fact, {language: text}; a key of the user is its own label."""
        return self.each(lambda paper: paper.label(key))

    def each(self, write):
        """Return {language: write(paper)} with the Paper of each language."""
        return {language: write(paper) for language, paper in self.papers.items()}

    def or_not_stated(self, text):
        """Return a text of the job, or "not stated" in each language."""
        return clean(text) or self.word("dcc.not_stated")


class Translations(Languages):
    """Words and sentences on a record in each language."""

    def __init__(self, record, words):
        super().__init__(Paper(record, words=group) for group in words)
        self.record = record
        self.job = record["job"]


def clean(text):
    """Return a text in one line without control characters; "" for None."""
    return " ".join(without_controls(str(text)).split()) if text not in (None, "") else ""


def make_root(name):
    """Return the root of a document, with the version of its schema."""
    for prefix, space in (("dcc", DCC), ("si", SI), ("xsi", _XSI)):
        ElementTree.register_namespace(prefix, space)
    place = f"{DCC} {DCC}/v{VERSION}/dcc.xsd"
    attributes = {"schemaVersion": VERSION, f"{{{_XSI}}}schemaLocation": place}
    return ElementTree.Element(f"{{{DCC}}}{name}", attributes)


def serialize(root):
    """Return the document as bytes."""
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def add_child(parent, name, text=None, space=DCC, **attributes):
    """Add an element below `parent`, and return it; None leaves it empty."""
    element = ElementTree.SubElement(parent, f"{{{space}}}{name}", attributes)
    element.text = text
    return element


def add_text(parent, name, texts, **attributes):
    """Add an element with a text, {language: text} or a text of the job, and return it."""
    element = add_child(parent, name, **attributes)
    for language, text in texts.items() if isinstance(texts, dict) else ((None, texts),):
        code = {"lang": language} if language else {}
        add_child(element, "content", clean(text), **code)
    return element


def add_contact(parent, name, contact_name, address):
    """Add a person or body with its name and location, both texts of `add_text`."""
    element = add_child(parent, name)
    add_text(element, "name", contact_name)
    add_text(add_child(element, "location"), "further", address)
    return element


# ---- quantities


def add_real(
    parent, name, value, unit, names, standard=None, of="quantity", kind=None, expanded=None
):
    """Add a number with unit and uncertainty, unless the value is None or not finite.

    `standard` is a standard uncertainty, `expanded` is (U, k, probability).
    """
    if value is None or not math.isfinite(value):
        return
    element = _add_named(parent, of, names, kind or f"tankcal_{name}")
    number = add_child(element, "real", space=SI)
    add_child(number, "value", repr(float(value)), space=SI)
    add_child(number, "unit", unit, space=SI)
    if standard is not None and math.isfinite(standard):
        uncertainty = add_child(number, "measurementUncertaintyUnivariate", space=SI)
        stated = add_child(uncertainty, "standardMU", space=SI)
        add_child(stated, "valueStandardMU", repr(float(standard)), space=SI)
    if expanded is not None:
        uncertainty = add_child(number, "measurementUncertaintyUnivariate", space=SI)
        stated = add_child(uncertainty, "expandedMU", space=SI)
        names_of = ("valueExpandedMU", "coverageFactor", "coverageProbability")
        for name_of, figure in zip(names_of, expanded, strict=True):
            add_child(stated, name_of, repr(float(figure)), space=SI)


def add_real_list(parent, name, values, unit, names, kind=None):
    """Add a column of numbers of one unit, and return its element for an uncertainty."""
    element = _add_named(parent, "quantity", names, kind or f"tankcal_{name}")
    numbers = add_child(element, "realListXMLList", space=SI)
    add_child(numbers, "valueXMLList", _row(values), space=SI)
    add_child(numbers, "unitXMLList", unit, space=SI)
    return numbers


def add_words(parent, name, values, names):
    """Add a column of words without blanks."""
    element = _add_named(parent, "quantity", names, f"tankcal_{name}")
    add_child(element, "charsXMLList", " ".join(values))


def add_uncertainty(numbers, stated_U, factors, capacity, probability):
    """Add the uncertainty of all rows of a table: U with k, or interval ends with u.

    The ends are necessary if a row has no k, since its U results from Monte Carlo, or a k below 1,
    which the schema refuses.

    Parameters
    ----------
    numbers : Element
        Element of `add_real_list`.
    stated_U : list of float, length n
        Stated U of the rows, m3.
    factors : list of float or None, length n
        Coverage factors of the rows.
    capacity : dict
        Table of the record.
    probability : float
        Coverage probability.

    Returns
    -------
    bool
        Whether the element contains U and k.
    """
    uncertainty = add_child(numbers, "measurementUncertaintyUnivariateXMLList", space=SI)
    is_with_k = all(k is not None and k >= LEAST_K for k in factors)
    if is_with_k:
        kind = "expandedMUXMLList"
        columns = {"valueExpandedMUXMLList": stated_U, "coverageFactorXMLList": factors}
    else:
        kind = "coverageIntervalMUXMLList"
        columns = {"valueStandardMUXMLList": capacity["u_m3"]}
        columns |= {"intervalMinXMLList": capacity["low_m3"]}
        columns |= {"intervalMaxXMLList": capacity["high_m3"]}
    listed = add_child(uncertainty, kind, space=SI)
    for name, values in columns.items():
        add_child(listed, name, _row(values), space=SI)
    add_child(listed, "coverageProbabilityXMLList", _row([probability] * len(stated_U)), space=SI)
    return is_with_k


def _add_named(parent, of, names, kind):
    element = add_child(parent, of, refType=kind)
    add_text(element, "name", names)
    return element


def _row(values):
    return " ".join("NaN" if value is None else repr(float(value)) for value in values)


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
        doubts = languages.each(lambda paper: " ".join(doubts_of(paper.record["warnings"])))
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
            kind = "".join(c if c.isascii() and c.isalnum() else "_" for c in key)
            add_statement(parent, languages.label(key), certificate[key], f"tankcal_{kind}")
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


__all__ = ["DCC", "FILE", "certificate_xml", "language_with"]
FILE = "certificate.xml"
_UNITS = {  # {printed unit: unit of the value}; values are in SI, angles in degrees
    "m": METRE,
    "mm": METRE,
    "mm/m": ONE,
    "deg": DEGREE,
    "m3": CUBIC_METRE,
    "kg": KILOGRAM,
    "kg/m3": DENSITY,
    "": ONE,
}


def certificate_xml(record, digest, language=None):
    """Return the digital calibration certificate of a record with a capacity table.

    Names and sentences are in all languages. The language of the reports comes first and is
    authoritative (`mandatoryLangCodeISO639_1`). Texts of the job have no language.

    Parameters
    ----------
    record : dict
        Record of `record.load`.
    digest : str
        SHA-256 of the bytes of record.json, in hexadecimal digits.
    language : str, optional
        One of LANGUAGES; None: language of the job.

    Returns
    -------
    bytes
        UTF-8; equal bytes for equal records.
    """
    first = language or language_of(record)
    codes = [first, *(code for code in LANGUAGES if code != first)]
    languages = Translations(record, [load_words(code) for code in codes])
    root = make_root(ROOT)
    add_administrative_data(add_child(root, "administrativeData"), languages, digest)
    add_results(add_child(root, "measurementResults"), languages, digest)
    return serialize(root)


def language_with(code):
    """Return the language of LANGUAGES with a two-letter code of the certificate, or None."""
    return next((language for language in LANGUAGES if language.split("-")[0] == code), None)


def add_results(parent, languages, digest):
    """Fill the element with one calibration, whose first result is the table."""
    element = add_child(parent, "measurementResult", refType="tankcal_calibration")
    add_text(element, "name", languages.word("titles.certificate"))
    _methods(add_child(element, "usedMethods"), languages)
    _software(add_child(element, "usedSoftware"), languages.record)
    listed = languages.job.get("equipment") or ()
    used = instruments_of(languages.record)
    # An instrument of the register is stated once, with the certificate of the register.
    used = {name: (name, used[name], None) for name in used} | {
        item["name"]: (f"{item['name']}: {item['description']}", item["certificate"],
                       item["serial_number"]) for item in listed
    }  # fmt: skip
    if used:
        _equipment(add_child(element, "measuringEquipments"), languages, used.values())
    _conditions(add_child(element, "influenceConditions"), languages)
    _results(add_child(element, "results"), languages)
    _meta_data(add_child(element, "measurementMetaData"), languages, digest)


def _methods(parent, languages):
    """Add the method of the job with the standard that it declares, and the method of U."""
    record = languages.record
    method = add_child(parent, "usedMethod", refType="tankcal_method")
    add_text(method, "name", languages.label("method"))
    names = (clean(languages.job["certificate"].get(key)) for key in ("method", "procedure"))
    add_text(method, "description", languages.or_not_stated("; ".join(filter(None, names))))
    if standard := clean(languages.job["certificate"].get("standard")):
        add_child(method, "norm", standard)
    uncertain = add_child(parent, "usedMethod", refType="basic_methodMeasurementUncertainty")
    add_text(uncertain, "name", languages.word("headings.uncertainty"))
    add_child(uncertain, "norm", "JCGM 100:2008")
    if record.get("monte_carlo"):
        add_child(uncertain, "norm", "JCGM 101:2008")


def _software(parent, record):
    add_software(parent, "tankcal", record["tankcal"], "application")
    for name, release in record["versions"].items():
        add_software(parent, name, release, "library")


def _equipment(parent, languages, used):
    """Add each instrument: (name, number of its certificate, its serial number)."""
    certificate_names = languages.word("dcc.certificate_of_instrument")
    serial_names = languages.label("serial_number")
    for name, certificate, serial_number in used:
        element = add_child(parent, "measuringEquipment", refType="tankcal_instrument")
        add_text(element, "name", name)
        if not (clean(certificate) or clean(serial_number)):
            continue
        identified = add_child(element, "identifications")
        if clean(certificate):
            add_identification(
                identified, clean(certificate), certificate_names, "tankcal_certificate"
            )
        if clean(serial_number):
            add_identification(identified, clean(serial_number), serial_names, "tankcal_serial")


def _conditions(parent, languages):
    """Add the reference conditions of the table and the conditions of the survey."""
    table, survey = languages.job["table"], languages.job["survey"]
    conditions = {
        "reference_temperature": (table["reference_temperature_c"], CELSIUS),
        "table_density": (table["liquid_density_kg_m3"] or None, DENSITY),
        "shell_temperature": (survey["shell_temperature_c"], CELSIUS),
        "liquid_level": (survey["liquid_level_m"], METRE),
        "liquid_density": (survey["liquid_density_kg_m3"], DENSITY),
        "expansion": (languages.job["material"]["expansion_per_k"], PER_KELVIN),
    }
    for key, (value, unit) in conditions.items():
        if value is not None:
            element = add_child(parent, "influenceCondition", refType=f"tankcal_{key}")
            add_text(element, "name", languages.label(key))
            add_real(add_child(element, "data"), key, value, unit, languages.label(key))


# ---- results


def _results(parent, languages):
    """Add the table, the operating levels, the courses, the parts of the tank, and deadwood."""
    _capacity(_result(parent, "capacity", languages.word("headings.capacity")), languages)
    record = languages.record
    if limits := limit_rows(record):
        of = _result(parent, "limits", languages.word("headings.limits_of_tank"))
        for limit in limits:
            _limit(of, languages, limit)
    if record["courses"]:
        of = _result(parent, "courses", languages.word("headings.courses"))
        for course in record["courses"]:
            _course(of, languages, course)
    for name in ("solid", "bottom", "top", "roof"):
        if record.get(name):
            _part(parent, languages, name)
    if record["deadwood"]:
        of = _result(parent, "deadwood", languages.word("captions.deadwood"))
        for thing in record["deadwood"]:
            _thing(of, languages, thing)


def _result(parent, name, names):
    """Add a result, and return the element of its data."""
    element = add_child(parent, "result", refType=f"tankcal_{name}Result")
    add_text(element, "name", names)
    return add_child(element, "data")


def _capacity(parent, languages):
    """Add the table: dips, volumes with the uncertainty of each row, and rows for use."""
    capacity, job = languages.record["capacity"], languages.job
    table = add_child(parent, "list", refType="tankcal_table")
    add_text(table, "name", languages.word("headings.capacity"))
    text = languages.each(lambda paper: _table_description(paper, capacity))
    add_text(table, "description", text)
    add_real_list(table, "dip", capacity["height_m"], METRE, languages.word("dcc.dip"))
    if job["table"].get("ullage"):
        reference = job["datum"]["reference_height_m"]
        ullages = [round(reference - height, 6) for height in capacity["height_m"]]
        add_real_list(table, "ullage", ullages, METRE, languages.word("table_headings.ullage_m"))
    names = languages.word("dcc.volume")
    numbers = add_real_list(
        table, "volume", capacity["volume_m3"], CUBIC_METRE, names, kind="basic_measuredValue"
    )
    stated, factors = stated_U_m3(capacity), k_of_rows(capacity)
    probability = job["table"]["coverage_probability"]
    if any(stated) and not add_uncertainty(numbers, stated, factors, capacity, probability):
        U, k = languages.word("dcc.U"), languages.word("dcc.k")
        add_real_list(table, "expandedUncertainty", stated, CUBIC_METRE, U)
        add_real_list(table, "coverageFactor", factors, ONE, k)
    if not all(capacity["for_use"]):
        use = ["yes" if is_for_use else "no" for is_for_use in capacity["for_use"]]
        add_words(table, "forUse", use, languages.word("dcc.for_use"))
    if rows := languages.record.get("on_high_legs"):
        _high_legs(parent, languages, rows)
    if corrections := languages.record.get("roof_corrections"):
        _roof_corrections(parent, languages, corrections)
    for volumes in languages.record["densities"]:
        names = languages.each(_density_writer(volumes["density_kg_m3"]))
        add_real_list(table, "volumeOfDensity", volumes["volume_m3"], CUBIC_METRE, names)


def _high_legs(parent, languages, rows):
    """Add the rows with the roof on high legs."""
    element = add_child(parent, "list", refType="tankcal_onHighLegs")
    add_text(element, "name", languages.word("headings.on_high_legs"))
    for name, key, unit, word in (
        ("dip", "height_m", METRE, "dip"),
        ("volume", "volume_m3", CUBIC_METRE, "volume"),
        ("expandedUncertainty", "U_m3", CUBIC_METRE, "U"),
        ("coverageFactor", "k", ONE, "k"),
    ):
        values = [row[key] for row in rows]
        add_real_list(element, name, values, unit, languages.word(f"dcc.{word}"))
    use = ["yes" if row["for_use"] else "no" for row in rows]
    add_words(element, "forUse", use, languages.word("dcc.for_use"))


def _roof_corrections(parent, languages, corrections):
    """Add the corrections for the density of the liquid on which the roof floats."""
    element = add_child(parent, "list", refType="tankcal_roofCorrections")
    add_text(element, "name", languages.word("headings.roof_corrections"))
    for name, key, unit in (
        ("density", "density_kg_m3", DENSITY),
        ("correction", "correction_m3", CUBIC_METRE),
    ):
        values = [row[key] for row in corrections]
        add_real_list(element, name, values, unit, languages.word(f"table_headings.{key}"))


def _density_writer(value):
    """Return a function of a paper: caption of the volumes for another density of the liquid."""
    return lambda paper: paper.word(
        "captions.capacity_density", density=paper.number(value, "kg/m3", digits=4)
    )


def _table_description(paper, capacity):
    """Return sentences on the zero of the heights and on interpolation between rows."""
    zero = f"{paper.label('zero')}: {paper.word('zeros.' + capacity['zero'])}"
    return " ".join([f"{zero}.", *paper.choices("interpolation")])


def _limit(parent, languages, limit):
    """Add an operating level, or two, with the volume below or between them and its U."""
    element = add_child(parent, "list", refType="tankcal_limit")
    add_text(element, "name", languages.word(f"tank_limits.{limit['tank_limit']}"))
    low = limit["low_m"]
    dip, volume = ("dip", "volume") if low is None else ("dip_high", "volume_between")
    add_real(element, "lowDip", low, METRE, languages.word("dcc.dip_low"))
    add_real(element, "dip", limit["high_m"], METRE, languages.word(f"dcc.{dip}"))
    # The schema refuses k below 1; without k, the interval of Monte Carlo has no multiple of u.
    k, U = limit["k"], limit["U_m3"]
    probability = languages.job["table"]["coverage_probability"]
    has_k = U > 0 and k is not None and k >= LEAST_K
    add_real(
        element, "volume", limit["volume_m3"], CUBIC_METRE, languages.word(f"dcc.{volume}"),
        kind="basic_measuredValue", expanded=(U, k, probability) if has_k else None,
    )  # fmt: skip
    if U > 0 and not has_k:
        add_real(element, "expandedUncertainty", U, CUBIC_METRE, languages.word("dcc.U"))


def _course(parent, languages, course):
    element = add_child(parent, "list", refType="tankcal_course")
    add_text(element, "name", languages.word("dcc.course", name=course["course"]))
    for key, unit, u in (
        ("bottom_m", METRE, None),
        ("top_m", METRE, None),
        ("thickness_m", METRE, None),
        ("radius_m", METRE, "radius_sd_m"),
        ("inside_radius_m", METRE, None),
        ("area_m2", SQUARE_METRE, "area_sd_m2"),
        ("volume_m3", CUBIC_METRE, "u_m3"),
    ):
        name = key.rpartition("_")[0]
        names = languages.word(f"dcc.course_{name}")
        add_real(element, name, course[key], unit, names, course[u] if u else None)


def _part(parent, languages, name):
    """Add a part of the tank: sizes as numbers, and a description of all its details."""
    heading = "dimensions" if name == "solid" else "inside"
    element = add_child(parent, "result", refType=f"tankcal_{name}Result")
    add_text(element, "name", languages.word(f"headings.{heading}"))
    details = languages.record[name]
    add_text(element, "description", languages.each(lambda paper: _details_text(paper, details)))
    data = add_child(element, "data")
    sizes = [detail for detail in details if detail["unit"] in _UNITS]
    for size in sizes:
        code, unit = size["code"], _UNITS[size["unit"]]
        add_real(data, code, size["value"], unit, languages.label(code))
    if not sizes:
        add_text(data, "text", languages.each(lambda paper: _details_text(paper, details)))


def _details_text(paper, details):
    return "; ".join(
        f"{paper.label(detail['code'])}: {paper.size_text(detail)}" for detail in details
    )


def _thing(parent, languages, thing):
    element = add_child(parent, "list", refType="tankcal_thing")
    add_text(element, "name", thing["name"])
    add_real(element, "bottom", thing["bottom_m"], METRE, languages.word("dcc.course_bottom"))
    add_real(element, "top", thing["top_m"], METRE, languages.word("dcc.course_top"))
    names = languages.word("dcc.volume_of_thing")
    add_real(element, "volume", thing["volume_m3"], CUBIC_METRE, names, thing["u_m3"])


# ---- provenance


def _meta_data(parent, languages, digest):
    """Add the record and its input files with their hashes, and the sentences of the report."""
    record_file = {"file": "record.json", "sha256": digest}
    _file(parent, languages.word("dcc.record"), record_file, "tankcal_record")
    for file in languages.record["files"]:
        _file(parent, languages.word("dcc.input_file"), file, "tankcal_inputFile")
    choices = languages.each(lambda paper: " ".join(paper.choices()))
    _declaration(parent, languages.word("headings.choices"), choices, "tankcal_assumptions")
    for i in range(len(overrulings.decisions_of(languages.record))):
        sentence = languages.each(lambda paper, i=i: overrulings.sentences(paper)[i])
        _declaration(parent, languages.word("headings.overrulings"), sentence, "tankcal_overruling")
    for i in range(len(languages.record["warnings"])):
        text = languages.each(lambda paper, i=i: _warning_text(paper.record["warnings"][i]))
        _declaration(parent, languages.word("headings.warnings"), text, "tankcal_warning")


def _file(parent, names, file, kind):
    """Add a file with its name; `reference` contains only its SHA-256."""
    element = add_child(parent, "metaData", refType=kind)
    add_text(element, "name", names)
    add_text(element, "description", file["file"])
    add_child(element, "reference", f"sha256:{file['sha256']}")


def _declaration(parent, names, declaration, kind):
    element = add_child(parent, "metaData", refType=kind)
    add_text(element, "name", names)
    add_text(element, "declaration", declaration)


def _warning_text(warning):
    place = ", ".join(part for part in (warning["file"], warning["column"]) if part)
    return f"{place}: {warning['text']}"
