"""What was found, how and under what conditions: measurementResults of the certificate's XML."""

from tankcal.report import certificate as papers
from tankcal.report.dcc.administrative import identification, software
from tankcal.report.dcc.elements import (
    CELSIUS,
    CUBIC_METRE,
    DEGREE,
    DENSITY,
    KILOGRAM,
    METRE,
    ONE,
    PER_KELVIN,
    SQUARE_METRE,
    child,
    clean,
    contents,
    real,
    real_list,
    state_uncertainty,
    words_list,
)
from tankcal.report.tables import overrulings
from tankcal.report.uncertainty.stated import k_of_rows, stated_U_m3

_UNITS = {  # by the unit that a size is shown in; its value is in SI, but of an angle in degrees
    "m": METRE,
    "mm": METRE,
    "mm/m": ONE,
    "deg": DEGREE,
    "m3": CUBIC_METRE,
    "kg": KILOGRAM,
    "kg/m3": DENSITY,
    "": ONE,
}
_PUBLISHERS = ("ISO", "IEC", "OIML", "API", "EN", "ABNT", "JCGM")


def measured_results(parent, tongues, digest):
    """Fill the element: one result, the table, with all that belongs to it."""
    found = child(parent, "measurementResult", refType="tankcal_calibration")
    contents(found, "name", tongues.word("titles.certificate"))
    _methods(child(found, "usedMethods"), tongues)
    _software(child(found, "usedSoftware"), tongues.record)
    used = papers.instruments_of(tongues.record)
    if used:
        _equipment(child(found, "measuringEquipments"), tongues, used)
    _conditions(child(found, "influenceConditions"), tongues)
    _results(child(found, "results"), tongues)
    _meta_data(child(found, "measurementMetaData"), tongues, digest)


def _methods(parent, tongues):
    """The method, as the job names it, with the standards of its corrections; then that of U."""
    given, record = tongues.job["certificate"], tongues.record
    method = child(parent, "usedMethod", refType="tankcal_method")
    contents(method, "name", tongues.label("method"))
    contents(method, "description", tongues.or_not_stated(_joined(given, "method", "procedure")))
    for source in _sources(record):
        is_norm = source.split()[0] in _PUBLISHERS
        child(method, "norm" if is_norm else "reference", source)
    uncertain = child(parent, "usedMethod", refType="basic_methodMeasurementUncertainty")
    contents(uncertain, "name", tongues.word("headings.uncertainty"))
    child(uncertain, "norm", "JCGM 100:2008")
    if record.get("monte_carlo"):
        child(uncertain, "norm", "JCGM 101:2008")


def _joined(given, *keys):
    return "; ".join(clean(given.get(key)) for key in keys if clean(given.get(key)))


def _sources(record):
    """Where the formulas of the applied corrections stand, norms first, each once."""
    named = [one["source"] for one in record["corrections"] if one["applied"] and one["source"]]
    single = dict.fromkeys(clean(part) for source in named for part in source.split(";"))
    return sorted(filter(None, single), key=lambda one: one.split()[0] not in _PUBLISHERS)


def _software(parent, record):
    software(parent, "tankcal", record["tankcal"], "application")
    for name, release in record["versions"].items():
        software(parent, name, release, "library")


def _equipment(parent, tongues, used):
    for name, certificate in used.items():
        one = child(parent, "measuringEquipment", refType="tankcal_instrument")
        contents(one, "name", name)
        if clean(certificate):
            identified = child(one, "identifications")
            names = tongues.word("dcc.certificate_of_instrument")
            identification(identified, clean(certificate), names, "tankcal_certificate")


def _conditions(parent, tongues):
    """What the table refers to, and how the tank was surveyed."""
    table, survey = tongues.job["table"], tongues.job["survey"]
    given = {
        "reference_temperature": (table["reference_temperature_c"], CELSIUS),
        "table_density": (table["liquid_density_kg_m3"] or None, DENSITY),
        "shell_temperature": (survey["shell_temperature_c"], CELSIUS),
        "liquid_level": (survey["liquid_level_m"], METRE),
        "liquid_density": (survey["liquid_density_kg_m3"], DENSITY),
        "expansion": (tongues.job["material"]["expansion_per_k"], PER_KELVIN),
    }
    for key, (value, unit) in given.items():
        if value is not None:
            _condition(parent, tongues, key, value, unit)


def _condition(parent, tongues, key, value, unit):
    found = child(parent, "influenceCondition", refType=f"tankcal_{key}")
    contents(found, "name", tongues.label(key))
    real(child(found, "data"), key, value, unit, tongues.label(key))


# ---- results


def _results(parent, tongues):
    """The table first; then what the tank was found to be."""
    _capacity(_result(parent, "capacity", tongues.word("headings.capacity")), tongues)
    record = tongues.record
    if record["courses"]:
        of = _result(parent, "courses", tongues.word("headings.courses"))
        for course in record["courses"]:
            _course(of, tongues, course)
    for name in ("solid", "bottom", "top", "roof"):
        if record.get(name):
            _described(parent, tongues, name)
    if record["deadwood"]:
        of = _result(parent, "deadwood", tongues.word("captions.deadwood"))
        for thing in record["deadwood"]:
            _thing(of, tongues, thing)


def _result(parent, name, names):
    """The data of a new result."""
    found = child(parent, "result", refType=f"tankcal_{name}Result")
    contents(found, "name", names)
    return child(found, "data")


def _capacity(parent, tongues):
    """The table: dips, volumes with their uncertainty in every row, which rows are for use."""
    capacity, job = tongues.record["capacity"], tongues.job
    table = child(parent, "list", refType="tankcal_table")
    contents(table, "name", tongues.word("headings.capacity"))
    said = tongues.each(lambda paper: _said_of_table(paper, capacity))
    contents(table, "description", said)
    real_list(table, "dip", capacity["height_m"], METRE, tongues.word("dcc.dip"))
    names = tongues.word("dcc.volume")
    numbers = real_list(
        table, "volume", capacity["volume_m3"], CUBIC_METRE, names, kind="basic_measuredValue"
    )
    stated, factors = stated_U_m3(capacity), k_of_rows(capacity)
    probability = job["table"]["coverage_probability"]
    if any(stated) and not state_uncertainty(numbers, stated, factors, capacity, probability):
        U, k = tongues.word("dcc.U"), tongues.word("dcc.k")
        real_list(table, "expandedUncertainty", stated, CUBIC_METRE, U)
        real_list(table, "coverageFactor", factors, ONE, k)
    if not all(capacity["for_use"]):
        use = ["yes" if one else "no" for one in capacity["for_use"]]
        words_list(table, "forUse", use, tongues.word("dcc.for_use"))
    for one in tongues.record["densities"]:
        density = tongues.each(_density(one["density_kg_m3"]))
        real_list(table, "volumeOfDensity", one["volume_m3"], CUBIC_METRE, density)


def _density(value):
    """For a paper: that the volumes are those for a liquid of another density."""
    return lambda paper: paper.word(
        "captions.capacity_density", density=paper.number(value, "kg/m3", digits=4)
    )


def _said_of_table(paper, capacity):
    """What heights count from, and how the table is read between its rows."""
    zero = f"{paper.label('zero')}: {paper.word('zeros.' + capacity['zero'])}"
    return " ".join([f"{zero}.", *paper.choices("interpolation")])


def _course(parent, tongues, course):
    found = child(parent, "list", refType="tankcal_course")
    contents(found, "name", tongues.word("dcc.course", name=course["course"]))
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
        names = tongues.word(f"dcc.course_{name}")
        real(found, name, course[key], unit, names, course[u] if u else None)


def _described(parent, tongues, name):
    """Sizes of a part as numbers; all that is said of it stands in the description, too."""
    heading = "dimensions" if name == "solid" else "inside"
    found = child(parent, "result", refType=f"tankcal_{name}Result")
    contents(found, "name", tongues.word(f"headings.{heading}"))
    details = tongues.record[name]
    contents(found, "description", tongues.each(lambda paper: _sizes(paper, details)))
    data = child(found, "data")
    sized = [one for one in details if one["unit"] in _UNITS]
    for one in sized:
        real(data, one["code"], one["value"], _UNITS[one["unit"]], tongues.label(one["code"]))
    if not sized:
        contents(data, "text", tongues.each(lambda paper: _sizes(paper, details)))


def _sizes(paper, details):
    return "; ".join(f"{paper.label(one['code'])}: {paper.size_text(one)}" for one in details)


def _thing(parent, tongues, thing):
    found = child(parent, "list", refType="tankcal_thing")
    contents(found, "name", thing["name"])
    real(found, "bottom", thing["bottom_m"], METRE, tongues.word("dcc.course_bottom"))
    real(found, "top", thing["top_m"], METRE, tongues.word("dcc.course_top"))
    names = tongues.word("dcc.volume_of_thing")
    real(found, "volume", thing["volume_m3"], CUBIC_METRE, names, thing["u_m3"])


# ---- what it rests on


def _meta_data(parent, tongues, digest):
    """The record and the files that it was made of, by their hashes; then what is told."""
    made = {"file": "record.json", "sha256": digest}
    _file(parent, tongues.word("dcc.record"), made, "tankcal_record")
    for one in tongues.record["files"]:
        _file(parent, tongues.word("dcc.input_file"), one, "tankcal_inputFile")
    choices = tongues.each(lambda paper: " ".join(paper.choices()))
    _said(parent, tongues.word("headings.choices"), choices, "tankcal_assumptions")
    for number in range(len(overrulings.decisions_of(tongues.record))):
        told = tongues.each(lambda paper, at=number: overrulings.sentences(paper)[at])
        _said(parent, tongues.word("headings.overrulings"), told, "tankcal_overruling")
    for number in range(len(tongues.record["warnings"])):
        told = tongues.each(lambda paper, at=number: _warning(paper.record["warnings"][at]))
        _said(parent, tongues.word("headings.warnings"), told, "tankcal_warning")


def _file(parent, names, file, kind):
    """A file by its name and its SHA-256, which stands alone in `reference`."""
    found = child(parent, "metaData", refType=kind)
    contents(found, "name", names)
    contents(found, "description", file["file"])
    child(found, "reference", f"sha256:{file['sha256']}")


def _said(parent, names, declared, kind):
    found = child(parent, "metaData", refType=kind)
    contents(found, "name", names)
    contents(found, "declaration", declared)


def _warning(one):
    place = ", ".join(part for part in (one["file"], one["column"]) if part)
    return f"{place}: {one['text']}"
