"""Translatable texts: a message holds its English text, a code and its values.

The English text is written where the message is created. The translations are stored by language,
under the code of the message.
"""

import re
import string

# Characters that a terminal executes instead of displaying: C0, C1, writing directions, line
# separators, and surrogates, which occur in file names that are not UTF-8.
_OBEYED = "\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff"
_CONTROL, _CONTROL_OR_BREAK = re.compile(f"[{_OBEYED}]"), re.compile(f"[{_OBEYED}\t\n]")


class Message(str):
    """English text of a message with the data for its translation.

    Attributes
    ----------
    code : str
        Key of the translations.
    values : dict of {str: number, str, Message or list}
        Values of the template.

    Notes
    -----
    `message` creates instances.
    """

    code: str
    values: dict


def message(code, template, **values):
    """Create a Message from an English template and its values.

    Parameters
    ----------
    code : str
        Key of the translations.
    template : str
        Format string, for example "known to {sd_mm:.1f} mm".
    **values
        Values of the template.

    Examples
    --------
    >>> message("known_to", "known to {sd_mm:.1f} mm", sd_mm=0.52)
    'known to 0.5 mm'
    """
    text = Message(fill_template(template, values))
    text.code, text.values = code, values
    return text


def printable(text):
    """Escape the control characters of a text, so that a file name cannot control a terminal.

    Returns
    -------
    str

    Examples
    --------
    >>> printable("a.csv\\x1b[2K")
    'a.csv\\\\x1b[2K'
    """
    return _CONTROL_OR_BREAK.sub(_spell, str(text))


def printable_lines(text):
    """Escape the control characters of a text, except tabs and line breaks.

    Returns
    -------
    str
    """
    return _CONTROL.sub(_spell, str(text))


def _spell(match):
    return ascii(match[0])[1:-1]


def list_some(names, most):
    """Shorten a list of names to the first few and the number of remaining names.

    Parameters
    ----------
    names : iterable
        The names.
    most : int
        Largest number of names shown.

    Returns
    -------
    list of str, or Message
        All names, or a Message "a, b and 3 more".
    """
    names = [name if isinstance(name, str) else str(name) for name in names]
    if len(names) <= most:
        return names
    more = len(names) - most
    return message("and_more", "{names} and {more} more", names=names[:most], more=more)


def join_with_and(parts):
    """Join texts with "and" before the last text; a single text is returned unchanged.

    Returns
    -------
    Message or str
    """
    *first, last = parts
    return message("and", "{first} and {last}", first=first, last=last) if first else last


def join_with_or(parts):
    """Join texts with "or" before the last text; a single text is returned unchanged.

    Returns
    -------
    Message or str
    """
    *first, last = parts
    return message("or", "{first} or {last}", first=first, last=last) if first else last


def fill_template(template, values, number=format, said=str):
    """Fill a template with values; the items of a list are separated by commas.

    Parameters
    ----------
    template : str
        Format string.
    values : dict
        Values by name.
    number : callable, optional
        number(value, spec) -> the text of a number.
    said : callable, optional
        said(value) -> the text of a Message, or of a message from a record.

    Returns
    -------
    str
    """
    # str.format cannot write lists and messages as required.
    return _Filler(number, said).vformat(template, (), values)


def fields_of(template):
    """Names of the values in a template, as a set."""
    return {name for _, name, _, _ in string.Formatter().parse(template) if name is not None}


def as_plain(text):
    """Code and values of a text, as plain data for the record.

    Parameters
    ----------
    text : str
        Message, or any other text.

    Returns
    -------
    dict
        {"code", "values"}; the code is None and the values are empty for a text that is no Message.
    """
    # Any other text has no values.
    values = {name: _plain(value) for name, value in getattr(text, "values", {}).items()}
    return {"code": getattr(text, "code", None), "values": values}


def _plain(value):
    if isinstance(value, Message):
        return {**as_plain(value), "text": str(value)}
    if hasattr(value, "tolist"):  # NumPy numbers and arrays, which JSON cannot represent
        value = value.tolist()
    # Values may be nested lists.
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


class _Filler(string.Formatter):
    def __init__(self, number, said):
        self._number, self._said = number, said

    def convert_field(self, value, conversion):
        is_quoted = conversion == "r" and isinstance(value, str)
        return repr(str(value)) if is_quoted else super().convert_field(value, conversion)

    def format_field(self, value, spec):
        if isinstance(value, list | tuple):
            return ", ".join(self.format_field(item, spec) for item in value)
        if isinstance(value, Message | dict):
            return self._said(value)
        # Text values may come from files; their control characters are escaped.
        return printable_lines(value) if isinstance(value, str) else self._number(value, spec)
