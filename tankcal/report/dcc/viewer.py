"""Page that shows a digital calibration certificate (DCC) of any laboratory.

The page repeats the content of the XML file, in blocks of a report. It computes no number and
checks neither the schema nor a signature.
"""

import re
from math import isnan
from xml.etree import ElementTree

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.report import blocks
from tankcal.report.dcc import DCC, ONE, ROOT, clean
from tankcal.text.digits import NOTHING

MOST_BYTES = 50_000_000
DIGITS = 9  # significant digits of a shown number
MOST_SEARCHED = (
    5  # columns of a table with a field for searching; a wider table has the whole width
)
_SYMBOLS = {  # of units of D-SI; the name of any other unit is shown
    "metre": "m",
    "kilogram": "kg",
    "gram": "g",
    "second": "s",
    "kelvin": "K",
    "litre": "L",
    "degreecelsius": "°C",
    "degree": "°",
    "percent": "%",
    ONE[1:]: "",
    "pascal": "Pa",
    "bar": "bar",
    "radian": "rad",
    "newton": "N",
    "volt": "V",
    "ampere": "A",
    "ohm": "Ω",
    "hertz": "Hz",
    "milli": "m",
    "micro": "µ",
    "kilo": "k",
    "centi": "c",
    "mega": "M",
    "nano": "n",
}
_PREFIXES = ("milli", "micro", "kilo", "centi", "mega", "nano")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_LISTS = ("realListXMLList", "charsXMLList", "complexListXMLList", "hybrid")
_NAMED = ("name", "description")  # children of a list or quantity that are no data


def read_certificate(path):
    """Return the root element of a DCC.

    Raises
    ------
    InputError
        For a file that is too large, no XML, or no DCC, and for XML with a document type, which
        can contain entities that grow without bound.
    """
    data = path.read_bytes()[: MOST_BYTES + 1]
    if len(data) > MOST_BYTES:
        raise _refusal(path, message("dcc_too_large", "larger than 50 MB; expected a certificate"))
    if re.search(rb"<!(DOCTYPE|ENTITY)", data, re.IGNORECASE) or b"\x00" in data:
        text = message("dcc_doctype", "with a document type or entities; expected plain XML")
        raise _refusal(path, text)
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        text = message("dcc_no_xml", "is no XML ({error})", error=str(error))
        raise _refusal(path, text) from error
    if root.tag != f"{{{DCC}}}{ROOT}":
        text = message("dcc_other_root", "is no digital calibration certificate ({ns})", ns=DCC)
        raise _refusal(path, text)
    return root


def _refusal(path, text):
    return InputError(Problem(path.name, text))


def certificate_blocks(root, words_of, language, digest):
    """Return the blocks of the page.

    Parameters
    ----------
    root : Element
        Of `read_certificate`.
    words_of : PlainPaper
        Words of the headings.
    language : str
        Language of the headings, and of the contents as far as the certificate has it.
    digest : str
        SHA-256 of the file.

    Returns
    -------
    list of Block
    """
    view = _View(root, words_of, language.split("-")[0])
    core = view.find(root, "administrativeData", "coreData")
    number = view.plain(core, "uniqueIdentifier")
    shown = [
        blocks.document(
            title=f"DCC {number}",
            language=language,
            running=["DCC", number],
            date=view.plain(core, "issueDate") or view.plain(core, "endPerformanceDate"),
        ),
        blocks.masthead(
            words_of.word("dcc_view.title"),
            words_of.word("dcc_view.schema", version=clean(root.get("schemaVersion"))),
            number_label=words_of.word("page.number"),
            number=number,
        ),
        blocks.paragraph(words_of.word("dcc_view.note", digest=digest)),
    ]
    if any(_name(element) == "Signature" for element in root):
        shown.append(blocks.paragraph(words_of.word("dcc_view.signature")))
    shown += view.administrative(view.find(root, "administrativeData"))
    for result in view.all(view.find(root, "measurementResults"), "measurementResult"):
        shown += view.measurement(result)
    return shown


def _name(element):
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


class _View:
    """Blocks of the parts of a certificate in a language."""

    def __init__(self, root, paper, code):
        self.root, self.paper, self.code = root, paper, code

    # ---- access by local names: prefixes and versions of the schema differ

    def find(self, element, *names):
        """Return the first descendant by a path of local names; None if absent."""
        for name in names:
            element = next(self.all(element, name), None)
        return element

    def all(self, element, name):
        """Yield the children with a local name; none for None."""
        return (child for child in (() if element is None else element) if _name(child) == name)

    def plain(self, element, *names):
        """Return the text of a descendant; "" if absent."""
        part = self.find(element, *names)
        return "" if part is None else clean(part.text)

    def text(self, element, *names):
        """Return a text with translations in the language of the page, or in the first language."""
        part = self.find(element, *names)
        contents = [child for child in self.all(part, "content") if clean(child.text)]
        for wanted in (self.code, None):
            texts = [clean(child.text) for child in contents if child.get("lang") == wanted]
            if texts:
                return " ".join(texts)
        return clean(contents[0].text) if contents else ""

    def word(self, name, **values):
        return self.paper.word(f"dcc_view.{name}", **values)

    # ---- administrative data

    def administrative(self, data):
        """Blocks of core data, parties, items and statements."""
        core = self.find(data, "coreData")
        facts = [
            (self.word(name), self.plain(core, name))
            for name in (
                "uniqueIdentifier",
                "countryCodeISO3166_1",
                "receiptDate",
                "beginPerformanceDate",
                "endPerformanceDate",
                "performanceLocation",
                "issueDate",
            )
        ]
        facts += [
            (self.text(entry, "name") or self.word("identification"), self.plain(entry, "value"))
            for entry in self.all(self.find(core, "identifications"), "identification")
        ]
        laboratory = self.find(data, "calibrationLaboratory")
        facts.append((self.word("calibrationLaboratory"), self._contact(laboratory, "contact")))
        code = self.plain(laboratory, "calibrationLaboratoryCode")
        facts.append((self.word("calibrationLaboratoryCode"), code))
        facts.append((self.word("customer"), self._contact(data, "customer")))
        for person in self.all(self.find(data, "respPersons"), "respPerson"):
            role = self.text(person, "description") or self.word("respPerson")
            named = [self._contact(person, "person"), self.plain(person, "role")]
            facts.append((role, ", ".join(filter(None, named))))
        for software in self.all(self.find(data, "dccSoftware"), "software"):
            facts.append((self.word("software"), self._software(software)))
        shown = [blocks.heading(self.word("administrative")), self._facts(facts)]
        for item in self.all(self.find(data, "items"), "item"):
            shown += self._item(item)
        statements = [
            (self.text(entry, "name") or self.word("statement"), self._statement(entry))
            for entry in self.all(self.find(data, "statements"), "statement")
        ]
        if statements:
            shown += [blocks.heading(self.word("statements")), self._facts(statements)]
        return shown

    def _facts(self, facts):
        return blocks.key_values([(label, text) for label, text in facts if text])

    def _contact(self, element, name):
        """Name and address of a contact, separated by commas."""
        contact = self.find(element, name)
        place = self.find(contact, "location")
        parts = [self.text(contact, "name")]
        for part in place if place is not None else ():
            parts.append(self.text(part) if len(part) else clean(part.text))
        parts += [self.plain(contact, key) for key in ("eMail", "phone", "link")]
        return ", ".join(dict.fromkeys(filter(None, parts)))

    def _software(self, element):
        return f"{self.text(element, 'name')} {self.plain(element, 'release')}".strip()

    def _item(self, item):
        facts = [
            (self.text(entry, "name") or self.word("identification"), self.plain(entry, "value"))
            for entry in self.all(self.find(item, "identifications"), "identification")
        ]
        facts += [
            (self.word("manufacturer"), self._contact(item, "manufacturer")),
            (self.word("model"), self.plain(item, "model")),
            (self.word("owner"), self._contact(item, "owner")),
            (self.word("description"), self.text(item, "description")),
        ]
        shown = [blocks.heading(self.text(item, "name") or self.word("item")), self._facts(facts)]
        return shown + self._values(list(self.find(item, "itemQuantities") or ()))

    def _statement(self, entry):
        """Declaration of a statement or of meta data, with its references."""
        parts = [self.text(entry, "declaration"), self.text(entry, "description")]
        parts += [
            clean(child.text)
            for name in ("norm", "reference", "conformity")
            for child in self.all(entry, name)
        ]
        return "; ".join(dict.fromkeys(filter(None, parts)))

    # ---- results

    def measurement(self, element):
        """Blocks of a measurement result: methods, equipment, conditions, results, meta data."""
        shown = [blocks.heading(self.text(element, "name") or self.word("measurement"))]
        facts = [
            (self.text(entry, "name"), self._statement(entry))
            for entry in self.all(self.find(element, "usedMethods"), "usedMethod")
        ]
        facts += [
            (self.word("software"), self._software(entry))
            for entry in self.all(self.find(element, "usedSoftware"), "software")
        ]
        for entry in self.all(self.find(element, "measuringEquipments"), "measuringEquipment"):
            values = [
                f"{self.text(part, 'name')} {self.plain(part, 'value')}".strip()
                for part in self.all(self.find(entry, "identifications"), "identification")
            ]
            facts.append((self.text(entry, "name"), "; ".join(values) or NOTHING))
        shown.append(self._facts(facts))
        conditions = [
            (self.text(entry, "name"), child)
            for entry in self.all(self.find(element, "influenceConditions"), "influenceCondition")
            for child in (self.find(entry, "data") or ())
        ]
        if conditions:
            shown.append(blocks.heading(self.word("conditions"), level=2))
            shown += self._values([child for _, child in conditions])
        for result in self.all(self.find(element, "results"), "result"):
            shown += self._result(result)
        notes = [
            (self.text(entry, "name") or self.word("statement"), self._statement(entry))
            for entry in self.all(self.find(element, "measurementMetaData"), "metaData")
        ]
        if notes:
            shown += [blocks.heading(self.word("metadata"), level=2), self._facts(notes)]
        return shown

    def _result(self, result):
        shown = [blocks.heading(self.text(result, "name") or self.word("result"), level=2)]
        if text := self.text(result, "description"):
            shown.append(blocks.paragraph(text))
        return shown + self._data(self.find(result, "data"))

    def _data(self, data):
        """Blocks of the children of `data` or of a list: texts, single values, tables."""
        shown, values = [], []
        for child in data if data is not None else ():
            name = _name(child)
            if name == "quantity" and not self._is_column(child):
                values.append(child)
            elif name == "list":
                shown += self._list(child)
            elif name == "text":
                shown.append(blocks.paragraph(self.text(child) or self._text_of(child)))
            elif name not in (*_NAMED, "quantity"):
                shown.append(blocks.paragraph(self.word("not_shown", element=name)))
        return self._values(values) + shown

    def _text_of(self, element):
        return " ".join(filter(None, (clean(part) for part in element.itertext())))

    def _list(self, element):
        """Blocks of a list: its name, its columns as a table, and everything else."""
        columns = [child for child in self.all(element, "quantity") if self._is_column(child)]
        shown = []
        if text := self.text(element, "description"):
            shown.append(blocks.paragraph(text))
        if columns:
            shown += self._table(columns, self.text(element, "name"))
            rest = [child for child in element if child not in columns]
            return shown + self._data(rest)
        if name := self.text(element, "name"):
            shown.insert(0, blocks.heading(name, level=3))
        return shown + self._data(element)

    def _is_column(self, quantity):
        return any(_name(child) in _LISTS for child in quantity)

    def _table(self, quantities, caption):
        """Table of quantities with a value for each row, and its long headings as a paragraph."""
        heads, columns = [], []
        for quantity in quantities:
            name = self.text(quantity, "name") or clean(quantity.get("refType"))
            content = next(child for child in quantity if _name(child) in _LISTS)
            if _name(content) == "charsXMLList":
                heads.append([name, ""])
                columns.append(clean(content.text).split())
                continue
            unit = _unit(self.plain(content, "unitXMLList"))
            heads.append([name, unit])
            columns.append(_numbers(self.plain(content, "valueXMLList")))
            for key, values in self._uncertainties(content):
                heads.append([self.word(key), "" if key in _BARE else unit])
                columns.append(values)
        count = max(map(len, columns), default=0)
        # A list with a single value applies to each row.
        columns = [values * count if len(values) == 1 else values for values in columns]
        rows = [
            [values[i] if i < len(values) else None for values in columns] for i in range(count)
        ]
        align = ["right"] * len(heads)
        shown = [[name.partition(";")[0], unit] for name, unit in heads]
        if count > 1 and len(heads) <= MOST_SEARCHED:
            table = blocks.columns_table(shown, rows, caption, align, across=1)
        else:
            table = blocks.table(shown, rows, caption, align)
        longer = [name for name, _ in heads if ";" in name]  # names with an explanation
        return [table, *([blocks.paragraph(". ".join(longer))] if longer else [])]

    def _uncertainties(self, content):
        """Yield (word, texts) of each list of uncertainties of a column."""
        for group in self.find(content, "measurementUncertaintyUnivariateXMLList") or ():
            for part in group:
                key = _name(part).removesuffix("XMLList")
                if key in _UNCERTAINTIES:
                    yield key, _numbers(clean(part.text))

    def _values(self, quantities):
        """Table of single quantities with their uncertainty; [] without any."""
        rows = []
        for quantity in quantities:
            real = self.find(quantity, "real")
            if real is None:
                continue
            parts = {_name(part): part for part in real.iter()}
            numbers = {name: clean(parts[name].text) for name in _UNCERTAINTIES if name in parts}
            U = numbers.get("valueExpandedMU")
            cells = [
                self.text(quantity, "name") or clean(quantity.get("refType")),
                _number(self.plain(real, "value")),
                _unit(self.plain(real, "unit")) or None,
                _number(U) if U else None,
                _number(numbers["coverageFactor"]) if "coverageFactor" in numbers else None,
                _number(numbers["valueStandardMU"]) if "valueStandardMU" in numbers else None,
            ]
            rows.append(cells)
        if not rows:
            return []
        keys = ("value", "unit", "valueExpandedMU", "coverageFactor", "valueStandardMU")
        used = [0, 1, 2, *(i for i in (3, 4, 5) if any(row[i] for row in rows))]
        heads = ["", *(self.word(key) for key in keys)]
        align = ["left", "right", "left", "right", "right", "right"]
        return [
            blocks.table(
                [heads[i] for i in used],
                [[row[i] for i in used] for row in rows],
                align=[align[i] for i in used],
            )
        ]


_UNCERTAINTIES = (
    *("valueExpandedMU", "coverageFactor", "coverageProbability", "valueStandardMU"),
    *("intervalMin", "intervalMax"),
)
_BARE = ("coverageFactor", "coverageProbability")  # numbers without a unit


def _numbers(text):
    return [_number(part) for part in text.split()]


def _number(text):
    """Return a number with at most DIGITS significant digits; None for NaN; else the text."""
    try:
        value = float(text)
    except ValueError:
        return text or None
    return None if isnan(value) else f"{value:.{DIGITS}g}"


def _unit(text):
    r"""Return the symbol of a unit of D-SI: "\metre\tothe{3}" becomes "m³"."""
    symbols = []
    first = text.split()[0] if text.split() else ""
    for name, power in re.findall(r"\\([A-Za-z]+)(?:\{(-?\d+)\})?", first):
        if name == "tothe" and symbols:
            symbols[-1] += power.translate(_RAISED)
        elif symbols and symbols[-1] in _PREFIXES:
            symbols[-1] = _SYMBOLS[symbols[-1]] + _SYMBOLS.get(name, name)
        else:
            symbols.append(name if name in _PREFIXES else _SYMBOLS.get(name, name))
    return "·".join(filter(None, symbols))
