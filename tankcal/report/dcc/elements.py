"""Elements of the certificate's XML: texts that cannot break it, and quantities with SI units."""

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
LEAST_K = 1.0  # D-SI has no coverage factor below it


class Tongues:
    """What a record says, in each language: the first of them is the one that counts."""

    def __init__(self, record, words):
        self.papers = {
            one["language"]["code"].split("-")[0]: Paper(record, words=one) for one in words
        }
        self.record = record
        self.job = record["job"]

    def word(self, name, /, **values):
        """{language: the word or sentence called "group.key"}."""
        return self.each(lambda paper: paper.word(name, **values))

    def label(self, key):
        """{language: the label of a fact}; a field of the user's own has its name in all."""
        return self.each(lambda paper: paper.label(key))

    def each(self, say):
        """{language: say(paper of it)}."""
        return {language: say(paper) for language, paper in self.papers.items()}

    def or_not_stated(self, text):
        """A text of the job, or in each language that it is not stated."""
        return clean(text) or self.word("dcc.not_stated")


def clean(text):
    """A text in one line without what XML cannot hold; "" for nothing."""
    return " ".join(without_controls(str(text)).split()) if text not in (None, "") else ""


def root_of(name):
    """The root of a document, with the version of its schema."""
    for prefix, space in (("dcc", DCC), ("si", SI), ("xsi", _XSI)):
        ElementTree.register_namespace(prefix, space)
    place = f"{DCC} {DCC}/v{VERSION}/dcc.xsd"
    attributes = {"schemaVersion": VERSION, f"{{{_XSI}}}schemaLocation": place}
    return ElementTree.Element(f"{{{DCC}}}{name}", attributes)


def written(root):
    """The document as bytes."""
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def child(parent, name, text=None, space=DCC, **attributes):
    """A new element below `parent`; a text of None leaves it empty."""
    found = ElementTree.SubElement(parent, f"{{{space}}}{name}", attributes)
    found.text = text
    return found


def contents(parent, name, texts, **attributes):
    """An element that holds a text: {language: text}, or a text of the job, in no language."""
    found = child(parent, name, **attributes)
    for language, text in texts.items() if isinstance(texts, dict) else ((None, texts),):
        spoken = {"lang": language} if language else {}
        child(found, "content", clean(text), **spoken)
    return found


def contact(parent, name, who, where):
    """A person or body: its name and where it is, both as `contents` takes them."""
    found = child(parent, name)
    contents(found, "name", who)
    contents(child(found, "location"), "further", where)
    return found


# ---- quantities


def real(parent, name, value, unit, names, standard=None, of="quantity", kind=None):
    """A number with its unit, and its standard uncertainty; a value of None writes nothing."""
    if value is None or not math.isfinite(value):
        return
    found = _named(parent, of, names, kind or f"tankcal_{name}")
    number = child(found, "real", space=SI)
    child(number, "value", repr(float(value)), space=SI)
    child(number, "unit", unit, space=SI)
    if standard is not None and math.isfinite(standard):
        uncertainty = child(number, "measurementUncertaintyUnivariate", space=SI)
        stated = child(uncertainty, "standardMU", space=SI)
        child(stated, "valueStandardMU", repr(float(standard)), space=SI)


def real_list(parent, name, values, unit, names, kind=None):
    """A column of numbers of one unit; gives its element, for an uncertainty."""
    found = _named(parent, "quantity", names, kind or f"tankcal_{name}")
    numbers = child(found, "realListXMLList", space=SI)
    child(numbers, "valueXMLList", _row(values), space=SI)
    child(numbers, "unitXMLList", unit, space=SI)
    return numbers


def words_list(parent, name, values, names):
    """A column of words, none of which has a blank."""
    found = _named(parent, "quantity", names, f"tankcal_{name}")
    child(found, "charsXMLList", " ".join(values))


def state_uncertainty(numbers, stated, factors, capacity, probability):
    """The uncertainty of every row of a table: U with k, or the ends of its interval with u.

    The ends stand there where a row has no k, for its U is that of a Monte Carlo interval, or one
    below 1, which the schema refuses. Gives whether all is said: that it is U with k.
    """
    uncertainty = child(numbers, "measurementUncertaintyUnivariateXMLList", space=SI)
    is_with_k = all(k is not None and k >= LEAST_K for k in factors)
    if is_with_k:
        kind = "expandedMUXMLList"
        columns = {"valueExpandedMUXMLList": stated, "coverageFactorXMLList": factors}
    else:
        kind = "coverageIntervalMUXMLList"
        columns = {"valueStandardMUXMLList": capacity["u_m3"]}
        columns |= {"intervalMinXMLList": capacity["low_m3"]}
        columns |= {"intervalMaxXMLList": capacity["high_m3"]}
    listed = child(uncertainty, kind, space=SI)
    for name, values in columns.items():
        child(listed, name, _row(values), space=SI)
    child(listed, "coverageProbabilityXMLList", _row([probability] * len(stated)), space=SI)
    return is_with_k


def _named(parent, of, names, kind):
    found = child(parent, of, refType=kind)
    contents(found, "name", names)
    return found


def _row(values):
    return " ".join("NaN" if one is None else repr(float(one)) for one in values)
