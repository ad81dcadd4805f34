"""Texts that know what they say: a code and values, so that paper says it in any language.

The English stands where a text is made; the other languages stand in their words, by the code.
"""

import re
import string

# what a terminal obeys instead of showing it: C0, C1, directions of writing, separators of lines,
# and halves of characters, which names of files that are no UTF-8 hold
_OBEYED = "\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff"
_CONTROL, _CONTROL_OR_BREAK = re.compile(f"[{_OBEYED}]"), re.compile(f"[{_OBEYED}\t\n]")


class Message(str):
    """An English text that `message` made.

    code    its name in the words of the other languages
    values  {name: number, text, Message or list of these}, as its template asks for them
    """

    code: str
    values: dict


def message(code, template, **values):
    """The Message of an English template, "known to {sd_mm:.1f} mm", and its values."""
    text = Message(fill_template(template, values))
    text.code, text.values = code, values
    return text


def printable(text):
    """A text with its control characters spelt out, so that no name of a file acts on a terminal.

    >>> printable("a.csv\\x1b[2K")
    'a.csv\\\\x1b[2K'
    """
    return _CONTROL_OR_BREAK.sub(_spell, str(text))


def printable_lines(text):
    """The same of a text that may have several lines."""
    return _CONTROL.sub(_spell, str(text))


def _spell(found):
    return ascii(found[0])[1:-1]


def list_some(names, most):
    """Names as they stand in a sentence: all of them, or the first and how many more."""
    names = [one if isinstance(one, str) else str(one) for one in names]
    if len(names) <= most:
        return names
    more = len(names) - most
    return message("and_more", "{names} and {more} more", names=names[:most], more=more)


def join_with_and(parts):
    """Parts in a row with "and" before the last; one alone is itself."""
    *first, last = parts
    return message("and", "{first} and {last}", first=first, last=last) if first else last


def join_with_or(parts):
    """The same with "or"."""
    *first, last = parts
    return message("or", "{first} or {last}", first=first, last=last) if first else last


def fill_template(template, values, number=format, said=str):
    """A template with its values; those of a list stand in a row.

    number  number(value, spec) -> how a number is written
    said    said(value) -> the text of a Message, or of one from a record
    """
    return _Filler(number, said).vformat(template, (), values)


def fields_of(template):
    """Names of the values that a template uses."""
    return {name for _, name, _, _ in string.Formatter().parse(template) if name is not None}


def as_plain(text):
    """{code, values} of a Message for the record, {code: null, values: {}} of any other text."""
    values = {name: _plain(value) for name, value in getattr(text, "values", {}).items()}
    return {"code": getattr(text, "code", None), "values": values}


def _plain(value):
    if isinstance(value, Message):
        return {**as_plain(value), "text": str(value)}
    if hasattr(value, "tolist"):  # a number or an array of numpy, which JSON cannot hold
        value = value.tolist()
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value


class _Filler(string.Formatter):
    def __init__(self, number, said):
        self._number, self._said = number, said

    def convert_field(self, value, conversion):
        is_quoted = conversion == "r" and isinstance(value, str)
        return repr(str(value)) if is_quoted else super().convert_field(value, conversion)

    def format_field(self, value, spec):
        if isinstance(value, list | tuple):
            return ", ".join(self.format_field(one, spec) for one in value)
        if isinstance(value, Message | dict):
            return self._said(value)
        return printable_lines(value) if isinstance(value, str) else self._number(value, spec)
