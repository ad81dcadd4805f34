"""Editing of keys and values: job.toml, and the lists of cameras, instruments, clouds, meters.

The state is the text of the file. An edit changes one value in the text (tomlkit), and preserves
comments, order and spaces. A file that is no valid TOML cannot be edited here.
"""

import datetime
import tomllib
from dataclasses import dataclass, field, replace

from tankcal.job.contract import KEYS, REGISTER_KEYS
from tankcal.job.contract.registers import FAMILIES, SHORT_KEYS
from tankcal.job.fields import Field
from tankcal.text.numerals import NUMBER
from tankcal.workbench.tables import AmbiguousNumber

SETTINGS = "job"  # name of the settings
READ_ONLY_SECTIONS = ("csv",)  # define the format of files


@dataclass(frozen=True)
class Entry:
    """Value of a key of a section, or of a camera or instrument (`owner`)."""

    owner: str
    key: str
    text: str


@dataclass(frozen=True)
class EditedKeys:
    """State of a file of keys.

    Attributes
    ----------
    name, file : str
        "job" or the name of a list, and the name of the file, such as "job.toml".
    text : str
        Text of the file.
    ambiguous : dict
        Ambiguous values that are not written, {(owner, key): text}.
    """

    name: str
    file: str
    text: str
    ambiguous: dict = field(default_factory=dict)

    decimal = "."

    @property
    def entries(self):
        """Entries of the file in its order, including values that are not written."""
        entries = [
            Entry(owner, key, self.ambiguous.get((owner, key)) or _text_of(value))
            for owner, given in self._owners(tomllib.loads(self.text))
            for key, value in given.items()
        ]
        known = {(entry.owner, entry.key) for entry in entries}
        new = [Entry(*place, text) for place, text in self.ambiguous.items() if place not in known]
        return entries + new

    def _owners(self, content):
        """Yield (owner, {key: value}); a key in a section of an entry is named section.key."""
        if self.name != SETTINGS:
            entries = content.get(self.name)
            for owner, given in (entries if isinstance(entries, dict) else {}).items():
                if isinstance(given, dict):
                    yield owner, dict(_flat(given))
            return
        pending = [(name, given) for name, given in content.items() if isinstance(given, dict)]
        while pending:
            name, given = pending.pop(0)
            inner = [(key, item) for key, item in given.items() if isinstance(item, dict)]
            yield name, {key: item for key, item in given.items() if not isinstance(item, dict)}
            pending += [(f"{name}.{key}", item) for key, item in inner]

    def set_value(self, owner, key, text):
        """New state with the value of a key; a blank value of an existing key becomes ""."""
        import tomlkit

        ambiguous = {place: item for place, item in self.ambiguous.items() if place != (owner, key)}
        if isinstance(text, AmbiguousNumber):
            ambiguous[owner, key] = text
            text = ""
        document = tomlkit.parse(self.text)
        place, last = self._table_of(document, owner, key, bool(text))
        if place is not None and (text or last in place):
            new_value = toml_value(field_of(self.name, owner, key), text, place.get(last))
            old_value = place.get(last)
            if old_value != new_value or type(old_value) is not type(new_value):
                place[last] = new_value  # preserves its comment
        return replace(self, text=tomlkit.dumps(document), ambiguous=ambiguous)

    def _table_of(self, document, owner, key, is_added):
        """Table of the document that contains a key, or None, and the key in this table.

        With `is_added`, missing tables are added.
        """
        import tomlkit

        path = owner.split(".") if self.name == SETTINGS else [self.name, owner]
        first, dot, last = key.partition(".")
        if dot and self.name != SETTINGS:
            path, key = [*path, first], last
        place = document
        for depth, part in enumerate(path):
            if part not in place:
                if not is_added:
                    return None, key
                is_super = self.name != SETTINGS and depth == 0
                if depth < len(path) - 1 or is_super:
                    place[part] = tomlkit.table(is_super_table=True)
                else:
                    if document.as_string() and not document.as_string().endswith("\n\n"):
                        document.add(tomlkit.nl())
                    place[part] = tomlkit.table()
            place = place[part]
        return place, key

    def render(self):
        """Bytes of the file, and None for row numbers, as problems state owner and key."""
        return self.text.encode("utf-8"), None


def _flat(values):
    """Yield keys and values, with keys of inner tables as table.key."""
    for key, value in values.items():
        if isinstance(value, dict):
            yield from ((f"{key}.{inner}", item) for inner, item in value.items())
        else:
            yield key, value


def field_of(name, owner, key):
    """`Field` of a key, or None for an unknown key."""
    if name == SETTINGS:
        fields = KEYS.get(owner, ())
    else:
        fields = REGISTER_KEYS.get(name, ())
        family = FAMILIES.get(name, {}).get(key.partition(".")[0])
        if "." in key and family is not None:
            return family
        long_names = {short: long for long, short in SHORT_KEYS[name].items()}
        key = long_names.get(key, key)
    return next((field for field in fields if field.name == key), None)


def _text_of(value):
    """Text of a TOML value in one line; lists are separated by ;, pairs are low-high."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, list):
        if value and all(isinstance(item, list) for item in value):
            pairs = all(len(item) == 2 for item in value)
            return "; ".join(("-" if pairs else " ").join(map(_text_of, item)) for item in value)
        return "; ".join(map(_text_of, value))
    if isinstance(value, datetime.datetime | datetime.date | datetime.time):
        return value.isoformat()
    return str(value)


def toml_value(key_field: Field | None, text: str, before=None):
    """Convert an entered text to a TOML value.

    Parameters
    ----------
    key_field : Field or None
        Field of the key; None for an unknown key.
    text : str
        Entered text.
    before : object, optional
        Previous value; a date or a list that was a string stays a string.

    Returns
    -------
    tomlkit item
        Number, flag, date or list if the text is valid for the field, else a string.

    Examples
    --------
    >>> toml_value(Field("step_m", "number", ""), "0.010").as_string()
    '0.010'
    >>> toml_value(Field("step_m", "number", ""), "a lot")
    'a lot'
    """
    import tomlkit

    kind = key_field.kind if key_field is not None else "text"
    words = text.strip().lower()
    if kind == "flag" and words in ("true", "false"):
        return tomlkit.item(words == "true")
    if kind == "number" and NUMBER.fullmatch(text):
        return _toml_number(text)
    if kind == "date" and not isinstance(before, str):
        try:
            return tomlkit.item(datetime.date.fromisoformat(text))
        except ValueError:
            pass
    if kind in ("numbers", "ranges", "rows", "names") and isinstance(before, list):
        parts = _list_of(kind, text)
        if parts is not None:
            return tomlkit.item(parts)
    return tomlkit.item(text)


def _toml_number(text):
    """TOML number with the digits of the text."""
    import tomlkit

    try:
        return tomlkit.value(text)
    except ValueError:  # 5. and 007 are numbers, but not in TOML
        return tomlkit.item(float(text))


def _list_of(kind, text):
    """List of a text with parts separated by ;, or None if the text is no such list."""
    parts = [part.strip() for part in text.split(";")]
    if kind == "names":
        return parts
    mark = {"numbers": None, "ranges": "-", "rows": " "}[kind]
    rows = [[item] if mark is None else item.split(mark) for item in parts]
    if not all(NUMBER.fullmatch(item.strip()) for row in rows for item in row):
        return None
    rows = [[float(item) for item in row] for row in rows]
    return [row[0] for row in rows] if mark is None else rows
