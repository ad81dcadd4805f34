"""The ticket as XML, in the elements of the digital calibration certificate (docs/ticket.md)."""

import tankcal
from tankcal.report.dcc import (
    CELSIUS,
    CUBIC_METRE,
    DENSITY,
    KILOGRAM,
    METRE,
    NAMESPACE,
    ONE,
    ROOT,
    UNKNOWN_COUNTRY,
    Languages,
    add_child,
    add_contact,
    add_identification,
    add_real,
    add_software,
    add_statement,
    add_text,
    clean,
    make_root,
    serialize,
)
from tankcal.report.ticket.pages import (
    QUANTITY_UNITS,
    comparison_text,
    notes,
    source_of,
    warnings_text,
)
from tankcal.text.shipped import LANGUAGES

_UNITS = {"m3": CUBIC_METRE, "kg": KILOGRAM, "kg/m3": DENSITY, "degC": CELSIUS, "": ONE}
_READINGS = {"level_m": METRE, "water_dip_m": METRE, "temperature_c": CELSIUS,
             "ambient_c": CELSIUS}  # fmt: skip
_LINK = "docs/ticket.md"  # page of tankcal on its types


def ticket_xml(paper):
    """Return the ticket as XML; its language comes first and is authoritative.

    Returns
    -------
    bytes
        UTF-8; equal bytes for equal tickets.
    """
    first = paper.words["language"]["code"]
    codes = [first, *(code for code in LANGUAGES if code != first)]
    languages = Languages(type(paper)(paper.saved, code) for code in codes)
    root = make_root(ROOT)
    _administrative(add_child(root, "administrativeData"), languages, paper)
    _results(add_child(root, "measurementResults"), languages, paper.record)
    return serialize(root)


def _administrative(parent, languages, paper):
    saved = paper.record
    add_software(add_child(parent, "dccSoftware"), "tankcal", tankcal.__version__, "application")
    types = add_child(add_child(parent, "refTypeDefinitions"), "refTypeDefinition")
    add_text(types, "name", NAMESPACE)
    add_text(types, "description", languages.word("dcc.types"))
    add_child(types, "namespace", NAMESPACE)
    add_child(types, "link", _LINK)
    add_child(types, "release", f"v{tankcal.__version__}")
    core = add_child(parent, "coreData")
    add_child(core, "countryCodeISO3166_1", UNKNOWN_COUNTRY)
    for language in languages.papers:
        add_child(core, "usedLangCodeISO639_1", language)
    add_child(core, "mandatoryLangCodeISO639_1", next(iter(languages.papers)))
    add_child(core, "uniqueIdentifier", clean(saved["number"]))
    record = f"sha256:{saved['table']['sha256']}"
    names = languages.word("dcc.record")
    add_identification(add_child(core, "identifications"), record, names, "tankcal_record")
    for name in ("beginPerformanceDate", "endPerformanceDate") if saved["date"] else ():
        add_child(core, name, saved["date"])
    add_child(core, "performanceLocation", "other")
    item = add_child(add_child(parent, "items"), "item")
    add_text(item, "name", languages.word(f"kinds.{saved['table']['kind']}"))
    tank = add_child(item, "identifications")
    add_identification(tank, clean(saved["tank"]), languages.label("ticket_tank"), "tankcal_tank")
    not_stated = languages.word("dcc.not_stated")
    add_contact(add_child(parent, "calibrationLaboratory"), "contact",
                clean(saved["table"]["laboratory"]) or not_stated, not_stated)  # fmt: skip
    signs = add_child(add_child(parent, "respPersons"), "respPerson")
    add_text(add_child(signs, "person"), "name", clean(saved["by"]) or not_stated)
    add_text(signs, "description", languages.label("ticket_by"))
    add_child(signs, "mainSigner", "true")
    add_contact(parent, "customer", clean(saved["customer"]) or not_stated, not_stated)
    _statements(add_child(parent, "statements"), languages, saved)


def _statements(parent, languages, saved):
    if saved["notice"]:
        names = languages.word("dcc.notice")
        add_statement(parent, names, saved["notice"], "tankcal_notice")
    texts = languages.each(lambda paper: " ".join(notes(paper)))
    add_statement(parent, languages.word("headings.limits"), texts, "tankcal_limits")
    if saved["warnings"]:
        names = languages.word("headings.checks")
        add_statement(parent, names, languages.each(warnings_text), "tankcal_warnings")
    comparison = saved["comparison"]
    if comparison is not None:
        element = add_statement(
            parent, languages.word("headings.comparison"), languages.each(comparison_text),
            "tankcal_comparison",
        )  # fmt: skip
        if comparison["agrees"] is not None:
            add_child(element, "conformity", "pass" if comparison["agrees"] else "fail")


def _results(parent, languages, saved):
    element = add_child(parent, "measurementResult", refType="tankcal_ticket")
    add_text(element, "name", languages.word("titles.ticket"))
    method = add_child(add_child(element, "usedMethods"), "usedMethod", refType="tankcal_method")
    add_text(method, "name", languages.label("correction"))
    add_text(method, "description", languages.each(lambda paper: paper.correction()))
    results = add_child(element, "results")
    for gauging in saved["gaugings"]:
        _gauging(results, languages, saved, gauging)
    for state in dict.fromkeys(row["state"] for row in saved["quantities"]):
        _quantities(results, languages, saved, state)
    if rooms := saved.get("rooms"):
        result = add_child(results, "result", refType="tankcal_roomResult")
        add_text(result, "name", languages.label("ticket_rooms"))
        data = add_child(result, "data")
        for row in rooms:
            add_real(
                data, row["name"], row["value"], CUBIC_METRE,
                languages.label(f"ticket_{row['name']}"), kind="basic_measuredValue",
                expanded=(row["U"], row["k"], saved["probability"]),
            )  # fmt: skip


def _gauging(parent, languages, saved, gauging):
    """Add the readings of a gauging and its steps."""
    state = gauging["state"]
    result = add_child(parent, "result", refType=f"tankcal_{state}Steps")
    add_text(result, "name", languages.label(f"gauging_{state}"))
    data = add_child(result, "data")
    for key, unit in _READINGS.items():
        add_real(data, key, gauging[key], unit, languages.word(f"reading_names.{key}"))
    for step in saved["steps"]:
        names = languages.each(_step_writer(step["step"]))
        add_real(data, step["step"], step[state], _UNITS[step["unit"]], names)


def _step_writer(step):
    """Return a function of a document: name and source of a step."""

    def write(paper):
        name, source = paper.words["steps"][step], source_of(paper, step)
        return f"{name} ({source})"

    return write


def _quantities(parent, languages, saved, state):
    """Add the quantities of a state with their expanded uncertainties."""
    result = add_child(parent, "result", refType=f"tankcal_{state}Result")
    add_text(result, "name", languages.word(f"states.{state}"))
    data = add_child(result, "data")
    for row in saved["quantities"]:
        if row["state"] == state:
            add_real(
                data, row["quantity"], row["value"], _UNITS[QUANTITY_UNITS[row["quantity"]]],
                languages.word(f"quantities.{row['quantity']}"), kind="basic_measuredValue",
                expanded=(row["U"], row["k"], saved["probability"]),
            )  # fmt: skip
