"""Elements of the XML certificate: escaped texts, and quantities with SI units."""

import math
from xml.etree import ElementTree

from tankcal.report.blocks import without_controls
from tankcal.report.paper import Paper

DCC = "https://ptb.de/dcc"
SI = "https://ptb.de/si"
VERSION = "3.3.0"  # of the schema; with D-SI 2.2
CERTIFICATE = "digitalCalibrationCertificate"
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
