"""XML of an E57 file as a tree of nodes, with limits against harmful input."""

import math
import re
from dataclasses import dataclass, field
from xml.parsers import expat

from tankcal.messages import message

DEEPEST = 40  # largest depth of nested elements; files of scanners have about ten
MOST_ELEMENTS = 200_000  # largest number of elements
LONGEST_TEXT = 1000  # letters kept from the text of an element
NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")


@dataclass
class Node:
    """One element: name, attributes, text, children."""

    name: str
    attributes: dict
    text: str = ""
    children: list = field(default_factory=list)

    @property
    def kind(self):
        """Type of the element, such as "Float"."""
        return self.attributes.get("type", "")

    @property
    def is_single(self):
        """Whether the element is a 32-bit float."""
        return self.kind == "Float" and self.attributes.get("precision") == "single"

    def find(self, name):
        """First child of that name, or None."""
        return next((child for child in self.children if child.name == name), None)

    def child(self, name):
        """First child of that name, or an empty node."""
        return self.find(name) or Node(name, {})

    def whole(self, attribute, default):
        """Attribute as int; the default if it is missing or not a whole number."""
        text = self.attributes.get(attribute, "").strip()
        return int(text) if re.fullmatch(r"[+-]?\d{1,20}", text) else default

    def real(self, attribute, default):
        """Attribute as float; the default if it is missing, nan if it is not a number."""
        text = self.attributes.get(attribute)
        return default if text is None else _real(text)

    def number_of(self, name):
        """Number in a child; 0 if it is missing or empty, nan if it is not a number."""
        text = self.child(name).text.strip()
        return _real(text) if text else 0.0


def _real(text):
    text = text.strip()
    return float(text) if NUMBER.fullmatch(text) else math.nan


def parse_xml(file, data):
    """Parse the XML to its root `Node`; raise InputError for malformed or harmful XML."""
    builder = _Builder(file)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.characters
    parser.StartDoctypeDeclHandler = builder.doctype
    parser.EntityDeclHandler = builder.doctype
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError, LookupError) as error:
        line = getattr(error, "lineno", None)
        raise file.refusal(
            message(
                "cloud_file_xml",
                "its XML is not well formed (line {line}): damaged",
                line=str(line or "?"),
            )
        ) from error
    root = builder.root
    if root is None or root.name != "e57Root" or root.find("data3D") is None:
        raise file.refusal(message("cloud_file_e57_root", "its XML names no scans (data3D)"))
    return root


class _Builder:
    def __init__(self, file):
        self.file, self.root, self.stack, self.count = file, None, [], 0

    def start(self, name, attributes):
        self.count += 1
        node = Node(name, attributes)
        if self.stack:
            self.stack[-1].children.append(node)
        else:
            self.root = node
        self.stack.append(node)
        if len(self.stack) > DEEPEST or self.count > MOST_ELEMENTS:
            raise self.file.refusal(
                message(
                    "cloud_file_xml_size",
                    "its XML has {count} elements or more, {depth} in each other; expected at most "
                    "{most}, and {deepest}",
                    count=self.count,
                    depth=len(self.stack),
                    most=MOST_ELEMENTS,
                    deepest=DEEPEST,
                )
            )

    def end(self, name):
        self.stack.pop()

    def characters(self, text):
        node = self.stack[-1]
        if len(node.text) < LONGEST_TEXT:
            node.text += text[:LONGEST_TEXT]

    def doctype(self, *_):
        raise self.file.refusal(
            message(
                "cloud_file_xml_entities",
                "its XML declares a document type or entities; expected none in a file of scans",
            )
        )
