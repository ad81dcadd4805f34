"""What all readers of camera files share: numbers, counts and names, every problem told.

Sizes of files are limited, so that a hostile one is refused before it is parsed.
"""

import math
import re
from xml.etree import ElementTree

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.text.naming import MAX_NAME, is_name

LONGEST = 4_000_000  # bytes of a file, letters of a text
MOST_PIXELS = 1_000_000
NAME_IS = message(
    "convert_name_is",
    "a name of at most {most} letters, digits, spaces or _ - . ( ) / #",
    most=MAX_NAME,
)


class Notes:
    """Collects the problems of one file; `stop` raises them all."""

    def __init__(self, file):
        """Of the file that its user calls `file`."""
        self.file = file
        self.problems = []

    def tell(self, expected, row=None, key=None):
        """One more problem."""
        self.problems.append(Problem(self.file, expected, row, key))

    def stop(self):
        """Raise InputError when there is a problem."""
        if self.problems:
            raise InputError(self.problems)

    def number(self, text, row=None, key=None, above=None):
        """A finite number of a text or number; nan after telling what is wrong.

        above  the number must be larger
        """
        try:
            value = math.nan if isinstance(text, bool) else float(text)
        except (TypeError, ValueError, OverflowError):
            value = math.nan
        if not math.isfinite(value) or (isinstance(text, str) and "_" in text):
            self.tell(
                message(
                    "convert_finite", "{found}; expected a finite number", found=short_text(text)
                ),
                row,
                key,
            )
            return math.nan
        if above is not None and value <= above:
            self.tell(
                message(
                    "convert_above",
                    "{found}; expected a number above {least:g}",
                    found=short_text(text),
                    least=above,
                ),
                row,
                key,
            )
            return math.nan
        return value

    def count(self, text, row=None, key=None):
        """A number of pixels, 2 to MOST_PIXELS; 2 after telling what is wrong."""
        before = len(self.problems)
        value = self.number(text, row, key)
        if len(self.problems) > before:
            return 2
        if value != round(value) or not 2 <= value <= MOST_PIXELS:
            self.tell(
                message(
                    "convert_pixels",
                    "{found}; expected whole pixels, 2 to {most}",
                    found=short_text(text),
                    most=MOST_PIXELS,
                ),
                row,
                key,
            )
            return 2
        return int(value)

    def name(self, text, row=None, key=None):
        """A name of a camera; "camera" after telling that it is none."""
        text = text.strip()
        if is_name(text):
            return text
        self.tell(
            message(
                "convert_name",
                "{found}; expected {expected}",
                found=short_text(text),
                expected=NAME_IS,
            ),
            row,
            key,
        )
        return "camera"


def xml_root(text, notes):
    """Outermost element of an XML text without a document type, or None; problems go to notes."""
    lower = text.lower()
    if "<!doctype" in lower or "<!entity" in lower:
        notes.tell(
            message(
                "convert_doctype",
                "a document type or entities; expected XML as the program saves it",
            )
        )
        return None
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        row = getattr(error, "position", (None,))[0]
        notes.tell(
            message(
                "convert_no_xml", "not readable XML ({error}); is the file complete?", error=error
            ),
            row,
        )
        return None


def tell_outermost(root, expected, notes):
    """Report an XML file whose outermost element is another one."""
    notes.tell(
        message(
            "convert_outermost",
            "{found} as the outermost element; {expected}",
            found=short_text(root.tag),
            expected=expected,
        )
    )


def given_twice():
    """What is wrong with a key that stands there twice."""
    return message("convert_given_twice", "given twice; expected once")


def short_text(value):
    """What was found, short enough for a message."""
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 40 else text[:37] + "..."


def only_letters(text, instead="camera"):
    """A name made of the end of a file's name, or `instead` when nothing of it is left."""
    kept = re.sub(r"[^\w .()/#-]", "_", text).strip(" ._-()/#")[:MAX_NAME]
    return kept or instead


def exact_text(value):
    """The shortest text of a number that reads back as the same number."""
    return repr(float(value))
