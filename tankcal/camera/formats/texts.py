"""Functions shared by the readers of camera files: numbers, counts, names and problems.

File sizes are limited, so that a hostile file is rejected before it is parsed.
"""

import math
import re
from xml.etree import ElementTree

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.text.naming import MAX_NAME, is_name

LONGEST = 4_000_000  # largest number of bytes in a file, or of characters in a text
MOST_PIXELS = 1_000_000  # largest number of columns or lines
NAME_IS = message(
    "convert_name_is",
    "a name of at most {most} letters, digits, spaces or _ - . ( ) / #",
    most=MAX_NAME,
)


class Notes:
    """Collection of the problems of a file."""

    def __init__(self, file):
        """Start a collection for a file with this name for the user."""
        self.file = file
        self.problems = []

    def add(self, expected, row=None, key=None):
        """Add a problem."""
        self.problems.append(Problem(self.file, expected, row, key))

    def raise_problems(self):
        """Raise InputError if any problem was added."""
        if self.problems:
            raise InputError(self.problems)

    def number(self, text, row=None, key=None, above=None):
        """Finite number from a text or number; nan after adding a problem.

        Parameters
        ----------
        text : str or float
            Text or number.
        row, key : optional
            Place of the text.
        above : float, optional
            The number must exceed this value.

        Returns
        -------
        float
        """
        try:
            # bool is a subclass of int, but no number here.
            value = math.nan if isinstance(text, bool) else float(text)
        except (TypeError, ValueError, OverflowError):
            value = math.nan
        # Python accepts "1_000" as a number; camera files do not.
        if not math.isfinite(value) or (isinstance(text, str) and "_" in text):
            self.add(
                message(
                    "convert_finite", "{found}; expected a finite number", found=short_text(text)
                ),
                row,
                key,
            )
            return math.nan
        if above is not None and value <= above:
            self.add(
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
        """Number of pixels, 2 to MOST_PIXELS; 2 after adding a problem."""
        problem_count = len(self.problems)
        value = self.number(text, row, key)
        if len(self.problems) > problem_count:
            return 2
        if value != round(value) or not 2 <= value <= MOST_PIXELS:
            self.add(
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
        """Name of a camera; "camera" after adding a problem."""
        text = text.strip()
        if is_name(text):
            return text
        self.add(
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
    """Root element of an XML text, or None; problems are added to `notes`."""
    # Entities can expand without limit.
    lower = text.lower()
    if "<!doctype" in lower or "<!entity" in lower:
        notes.add(
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
        notes.add(
            message(
                "convert_no_xml", "not readable XML ({error}); is the file complete?", error=error
            ),
            row,
        )
        return None


def report_wrong_root(root, expected, notes):
    """Add a problem for an XML file with the wrong root element."""
    notes.add(
        message(
            "convert_outermost",
            "{found} as the outermost element; {expected}",
            found=short_text(root.tag),
            expected=expected,
        )
    )


def duplicate_message():
    """Message for a repeated key."""
    return message("convert_given_twice", "given twice; expected once")


def short_text(value):
    """Text of a value, shortened for a message."""
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 40 else text[:37] + "..."


def make_valid_name(text):
    """Valid name derived from a file name, or "camera" if no valid character remains."""
    # Characters outside the rules for names become underscores.
    name = re.sub(r"[^\w .()/#-]", "_", text).strip(" ._-()/#")[:MAX_NAME]
    return name or "camera"


def exact_text(value):
    """Shortest text of a number that reads back as the same number."""
    return repr(float(value))
