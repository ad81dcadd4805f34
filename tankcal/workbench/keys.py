"""Keys and values under edit: job.toml, and the lists of cameras, instruments, clouds, meters.

The text of the file is the state: an edit changes one value in it (tomlkit), so that comments,
order and spaces of all else stay. What is no TOML is not edited here.
"""

import datetime
import tomllib
from dataclasses import dataclass, field, replace

from tankcal.job.contract import KEYS, REGISTER_KEYS
from tankcal.job.contract.registers import FAMILIES, SHORT_KEYS
from tankcal.job.fields import Field
from tankcal.text.numerals import NUMBER
from tankcal.workbench.decimals import Unwritten

SETTINGS = "job"
NOT_HERE = ("csv",)  # sections that say how the other files are written


@dataclass(frozen=True)
class Entry:
    """A value: of a key, of a section or of a camera or instrument (`owner`)."""

    owner: str
    key: str
    text: str


@dataclass(frozen=True)
class EditedKeys:
    """A file of keys in one state.

    Attributes
    ----------
    name, file : str
        "job" or the name of a list; "job.toml".
    text : str
        Of the file.
    unwritten : dict
        {(owner, key): entry that is not written}.
    """

    name: str
    file: str
    text: str
    unwritten: dict = field(default_factory=dict)

    decimal = "."

    @property
    def entries(self):
        """The Entries of the file, in its order, with what is not written in their place."""
        found = [
            Entry(owner, key, self.unwritten.get((owner, key)) or _text_of(value))
            for owner, given in self._owners(tomllib.loads(self.text))
            for key, value in given.items()
        ]
        known = {(one.owner, one.key) for one in found}
        new = [Entry(*place, text) for place, text in self.unwritten.items() if place not in known]
        return found + new

    def _owners(self, content):
        """Pairs (owner, {key: value}); keys of a section within an entry as section.key."""
        if self.name != SETTINGS:
            inside = content.get(self.name)
            for owner, given in (inside if isinstance(inside, dict) else {}).items():
                if isinstance(given, dict):
                    yield owner, dict(_flat(given))
            return
        todo = [(name, given) for name, given in content.items() if isinstance(given, dict)]
        while todo:
            name, given = todo.pop(0)
            within = [(key, one) for key, one in given.items() if isinstance(one, dict)]
            yield name, {key: one for key, one in given.items() if not isinstance(one, dict)}
            todo += [(f"{name}.{key}", one) for key, one in within]

    def set_value(self, owner, key, text):
        """The state after one value; a blank one stays as "" where the key is there."""
        import tomlkit

        waiting = {place: one for place, one in self.unwritten.items() if place != (owner, key)}
        if isinstance(text, Unwritten):
            waiting[owner, key] = text
            text = ""
        document = tomlkit.parse(self.text)
        place, last = self._table_of(document, owner, key, bool(text))
        if place is not None and (text or last in place):
            made = toml_value(field_of(self.name, owner, key), text, place.get(last))
            if last not in place or place[last] != made or type(place[last]) is not type(made):
                place[last] = made  # its comment stays
        return replace(self, text=tomlkit.dumps(document), unwritten=waiting)

    def _table_of(self, document, owner, key, is_made):
        """(table of the document that holds a key, the key there); None: there is none."""
        import tomlkit

        path = owner.split(".") if self.name == SETTINGS else [self.name, owner]
        first, dot, last = key.partition(".")
        if dot and self.name != SETTINGS:
            path, key = [*path, first], last
        place = document
        for depth, part in enumerate(path):
            if part not in place:
                if not is_made:
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
        """The bytes of the file, and no numbers of rows: problems name owner and key."""
        return self.text.encode("utf-8"), None


def _flat(given):
    for key, value in given.items():
        if isinstance(value, dict):
            yield from ((f"{key}.{inner}", one) for inner, one in value.items())
        else:
            yield key, value


def field_of(name, owner, key):
    """The Field of a key, None of one that is not known."""
    if name == SETTINGS:
        fields = KEYS.get(owner, ())
    else:
        fields = REGISTER_KEYS.get(name, ())
        family = FAMILIES.get(name, {}).get(key.partition(".")[0])
        if "." in key and family is not None:
            return family
        long = {short: one for one, short in SHORT_KEYS[name].items()}
        key = long.get(key, key)
    return next((one for one in fields if one.name == key), None)


def _text_of(value):
    """A value of a TOML file as one line: lists with ; between, pairs as low-high."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, list):
        if value and all(isinstance(one, list) for one in value):
            pairs = all(len(one) == 2 for one in value)
            return "; ".join(("-" if pairs else " ").join(map(_text_of, one)) for one in value)
        return "; ".join(map(_text_of, value))
    if isinstance(value, datetime.datetime | datetime.date | datetime.time):
        return value.isoformat()
    return str(value)


def toml_value(of: Field | None, text: str, before=None):
    """A typed text as a value of TOML: a number where it is one, else a text.

    Examples
    --------
    >>> toml_value(Field("step_m", "number", ""), "0.010").as_string()
    '0.010'
    >>> toml_value(Field("step_m", "number", ""), "a lot")
    'a lot'
    """
    import tomlkit

    kind = of.kind if of is not None else "text"
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
    import tomlkit

    try:
        return tomlkit.value(text)
    except ValueError:  # 5. and 007 are numbers, but not in TOML
        return tomlkit.item(float(text))


def _list_of(kind, text):
    """A list as TOML has it, of a text with ; between its parts; None: it is none."""
    parts = [part.strip() for part in text.split(";")]
    if kind == "names":
        return parts
    between = {"numbers": None, "ranges": "-", "rows": " "}[kind]
    rows = [[one] if between is None else one.split(between) for one in parts]
    if not all(NUMBER.fullmatch(one.strip()) for row in rows for one in row):
        return None
    rows = [[float(one) for one in row] for row in rows]
    return [row[0] for row in rows] if between is None else rows
