"""The digital calibration certificate: XML of the German metrology institute (PTB), schema 3.3.0.

The certificate contains data of the record only. Elements that the schema requires and the job
lacks are "not stated" (docs/certificate-digital.md). This module writes the element
measurementResults: methods, conditions, results, provenance.
"""

from tankcal.report.certificate import instruments_of
from tankcal.report.dcc.administrative import (
    add_administrative_data,
    add_identification,
    add_software,
)
from tankcal.report.dcc.elements import (
    CELSIUS,
    CERTIFICATE,
    CUBIC_METRE,
    DCC,
    DEGREE,
    DENSITY,
    KILOGRAM,
    LEAST_K,
    METRE,
    ONE,
    PER_KELVIN,
    SQUARE_METRE,
    Translations,
    add_child,
    add_real,
    add_real_list,
    add_text,
    add_uncertainty,
    add_words,
    clean,
    make_root,
    serialize,
)
from tankcal.report.tables import overrulings
from tankcal.report.uncertainty.stated import k_of_rows, limit_rows, stated_U_m3
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import language_of, load_words

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
    root = make_root(CERTIFICATE)
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
