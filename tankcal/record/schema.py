"""The layout of what is saved, declared once: dataclasses, from which its JSON schema follows.

A dataclass is an object of JSON, its fields are the keys, in their order, with the unit in the
name. A float may be null, for NaN and infinity are written so; anything else only where its type
has None. A Message `x` is written as `x`, and as `x_code` and `x_values` at the end of its object.
"""

import re
import types
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import cache, partial
from inspect import getdoc
from itertools import chain
from math import isfinite
from operator import attrgetter
from typing import Annotated, Any, Union, dataclass_transform, get_args, get_origin, get_type_hints

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import Message, message

DRAFT = "https://json-schema.org/draft/2020-12/schema"
MOST_TOLD = 20  # problems of one file
Finite = Annotated[float, "finite"]  # a number that is never null
_SCALARS = {bool: "boolean", int: "integer", str: "string"}
_WORDS = {"None": "null", "True": "true", "False": "false"}  # of JSON, for those of Python
_TYPES = {  # of Python, for a type of JSON
    "boolean": {bool}, "integer": {int}, "number": {int, float}, "string": {str},
    "null": {type(None)}, "array": {list}, "object": {dict},
}  # fmt: skip


@dataclass(frozen=True)
class Columns:
    """Marks a dict of columns, {key: values}, whose keys are the fields of a dataclass."""

    of: type


@dataclass_transform(frozen_default=True)
class Saved:
    """An object of what is saved: each class below it is a frozen dataclass."""

    def __init_subclass__(cls, kw_only=False):
        dataclass(frozen=True, kw_only=kw_only)(cls)


def key(doc, *, of=None, times=None, named=None, optional=False, parts=None, **options):
    """A field that is a key of what is saved.

    doc    what it holds, in one line
    of     the attribute that `filled_from` takes it from ("wall.shell.tilt"); None: of its own name
    times  factor that it is multiplied by: of another unit
    named  the key, where that is no name of Python ("from")
    optional  whether the key is left out where the value is None
    parts  of a field that is a dict: function that returns {key: (type, doc)}. The entries of the
           dict are written in place of the field, each left out where it is missing
    """
    about = {"doc": doc, "of": of, "times": times, "named": named, "optional": optional}
    about["parts"] = parts
    return field(metadata=about, **options)


def filled_from(cls, source, **values):
    """A `cls` with these values, the others being attributes of `source`; None of None.

    Fields that have a default keep it.
    """
    if source is None:
        return None
    for one in fields(cls):
        if one.name not in values and one.default is one.default_factory is MISSING:
            found = attrgetter(one.metadata.get("of") or one.name)(source)
            times = one.metadata.get("times")
            scaled = times is not None and found is not None
            values[one.name] = times * found if scaled else found
    return cls(**values)


# ---- the keys of a dataclass


@dataclass(frozen=True)
class Key:
    """One key: its name as written, the field, its type, and what it holds ("": not said)."""

    key: str
    name: str
    type: Any
    doc: str = ""
    required: bool = True
    is_part: bool = False  # an entry of the dict that is the field

    def value_in(self, instance):
        """Value of the key in an instance of the dataclass; None for a missing entry."""
        value = getattr(instance, self.name)
        return value.get(self.key) if self.is_part else value


@cache
def keys_of(cls):
    """Keys of a dataclass, as they are written."""
    hints, said = get_type_hints(cls, include_extras=True), _said_of_attributes(cls)
    found = []
    for one in fields(cls):
        if one.metadata.get("parts"):
            found += [
                Key(name, one.name, kind | None, doc, required=False, is_part=True)
                for name, (kind, doc) in one.metadata["parts"]().items()
            ]
            continue
        optional = one.metadata.get("optional", False)
        doc = one.metadata.get("doc") or said.get(one.name, "")
        named = one.metadata.get("named") or one.name
        found.append(Key(named, one.name, hints[one.name], doc, not optional))
    told = [one for one in found if one.type is Message]
    for one in told:
        found.append(Key(f"{one.key}_code", "", str | None, f"code of `{one.key}`"))
        found.append(Key(f"{one.key}_values", "", dict, f"values of `{one.key}`"))
    return tuple(found)


# ---- its JSON schema


def json_schema(cls, title=None):
    """The JSON schema of what `to_plain` makes of a dataclass, from the types of its fields.

    Parameters
    ----------
    cls : type
        The dataclass.
    title : str, optional
        Name of the format.

    Returns
    -------
    dict
        Draft 2020-12; each dataclass below `cls` stands once, under `$defs`.
    """
    definitions = {}
    schema = _schema_of(cls, definitions)
    head = {"$schema": DRAFT} | ({"title": title} if title else {})
    return head | schema | {"$defs": dict(sorted(definitions.items()))}


def _schema_of(kind, definitions):
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        base, mark = arguments
        if isinstance(mark, Columns):
            return _columns(mark.of, definitions)
        return {"type": "number"} if mark == "finite" else _schema_of(base, definitions)
    if origin in (Union, types.UnionType):
        return _either(arguments, definitions)
    if kind in _SCALARS:
        return {"type": _SCALARS[kind]}
    if kind is float:
        return {"type": ["number", "null"]}
    if kind is Message:
        return {"type": "string"}
    if is_dataclass(kind):
        return _reference(kind, definitions)
    if origin in (tuple, list):
        return _array(origin, arguments, definitions)
    if kind in (tuple, list, np.ndarray):
        return {"type": "array"}
    if origin is dict:
        return {"type": "object", "additionalProperties": _schema_of(arguments[1], definitions)}
    return {"type": "object"} if kind is dict else {}


def _either(arguments, definitions):
    """One of several types, at most one of which is no scalar."""
    found = [_schema_of(one, definitions) for one in arguments if one is not type(None)]
    nullable = ["null"] if type(None) in arguments else []
    if all(set(one) == {"type"} for one in found):
        names = [name for one in found for name in np.atleast_1d(one["type"]).tolist()]
        return {"type": list(dict.fromkeys(names + nullable))}
    return {"anyOf": [*found, *({"type": one} for one in nullable)]}


def _array(origin, arguments, definitions):
    items = _schema_of(arguments[0], definitions)
    if origin is list or Ellipsis in arguments:
        return {"type": "array", "items": items}
    length = len(arguments)
    return {"type": "array", "items": items, "minItems": length, "maxItems": length}


def _reference(cls, definitions):
    if cls.__name__ not in definitions:
        definitions[cls.__name__] = {}
        properties = {one.key: _property(one, definitions) for one in keys_of(cls)}
        definitions[cls.__name__] = {
            "description": _said_of(cls),
            "type": "object",
            "properties": properties,
            "required": [one.key for one in keys_of(cls) if one.required],
        }
    return {"$ref": f"#/$defs/{cls.__name__}"}


def _said_of(cls):
    """What a class says of itself before the sections of its docstring."""
    return re.split(r"\n\n\w+\n---", getdoc(cls))[0]


def _said_of_attributes(cls):
    """{attribute: what the section Attributes of the docstring says of it}."""
    section = re.search(r"\n\nAttributes\n-+\n(.*?\n)(?:\n|$)", f"{getdoc(cls)}\n", re.DOTALL)
    entry = r"^(\w+(?:, \w+)*)(?: :.*)?\n((?: +.+\n)+)"  # names, their type, lines of text
    entries = re.findall(entry, section[1], re.MULTILINE) if section else ()
    return {
        name: " ".join(text.split()).rstrip(".")
        for names, text in entries
        for name in names.split(", ")
    }


def _property(one, definitions):
    schema = _schema_of(one.type, definitions)
    return {"description": one.doc} | schema if one.doc else schema


def _columns(cls, definitions):
    columns = {
        one.key: {"type": "array", "items": _schema_of(one.type, definitions)}
        for one in keys_of(cls)
    }
    return {"type": "object", "properties": columns, "required": list(columns)}


# ---- what is wrong with data


def checked(data, schema, name):
    """What is wrong with data: the keys that are missing, and a Problem for each wrong value.

    name  of the file

    Returns sorted paths of the former, `[]` being any row ("sections[].modes"), and the first
    MOST_TOLD of the latter.
    """
    missing, problems = set(), []
    for path, expected in _faults(data, schema, schema, ""):
        if expected is None:
            missing.add(re.sub(r"\[\d+\]", "[]", path))
        elif len(problems) < MOST_TOLD:
            problems.append(Problem(name, expected, column=path))
        else:
            more = message("record_has_more", "further values are not as expected either")
            return sorted(missing), [*problems, Problem(name, more)]
    return sorted(missing), problems


def _faults(value, schema, root, path):
    """(path, what was expected) of each fault; None in place of the latter where a key is missing.

    The keys that are missing come before values that are wrong, in each object and list.
    """
    if value is None and {"type": "null"} in schema.get("anyOf", ()):
        return
    schema = _resolved(schema, root)
    names = schema.get("type", ())
    names = [names] if isinstance(names, str) else names
    if names and not any(type(value) in _TYPES[one] for one in names):
        if names == ["object"] and schema.get("required"):  # it has none of its keys
            yield from ((_below(path, one), None) for one in schema["required"])
        elif names == ["array"]:
            yield path, None
        else:
            yield path, _expected(names, value)
    elif isinstance(value, dict):
        yield from _faults_of_object(value, schema, root, path)
    elif isinstance(value, list):
        yield from _faults_of_array(value, schema, root, path)
    elif type(value) in (int, float) and not _are_finite([value]):
        yield path, _expected(names, value)


def _resolved(schema, root):
    """The schema that is referred to, and of several that of what is not null."""
    if "anyOf" in schema:
        schema = schema["anyOf"][0]
    while "$ref" in schema:
        schema = root["$defs"][schema["$ref"].rpartition("/")[2]]
    return schema


def _faults_of_object(value, schema, root, path):
    for one in schema.get("required", ()):
        if one not in value:
            yield _below(path, one), None
    properties, other = schema.get("properties", {}), schema.get("additionalProperties")
    for one, item in value.items():
        below = properties.get(one, other)
        if below is not None:
            yield from _faults(item, below, root, _below(path, one))


def _faults_of_array(value, schema, root, path):
    length = schema.get("minItems")
    if length is not None and len(value) != length:
        yield path, message("record_length", "found {found} values, expected {length}",
                            found=len(value), length=length)  # fmt: skip
    items = schema.get("items", {})
    if items and not _are_sound(value, items):
        for number, item in enumerate(value):
            yield from _faults(item, items, root, f"{path}[{number}]")


def _are_sound(values, items):
    """Whether no value, or value of lists of them, needs a look: there may be 200 000 of them."""
    found = set(map(type, values))
    if found == {list} and items.get("type") == "array" and "minItems" not in items:
        return not items.get("items") or _are_sound([*chain.from_iterable(values)], items["items"])
    names = items.get("type", ())
    allowed = set().union(*(_TYPES[one] for one in ([names] if isinstance(names, str) else names)))
    if not found <= allowed - {list, dict}:
        return False
    return not found & {int, float} or _are_finite(values)


def _are_finite(values):
    """Whether all numbers among values are such that a float holds."""
    try:
        return all(map(isfinite, (one for one in values if type(one) in (int, float))))
    except OverflowError:
        return False


def _below(path, one):
    return f"{path}.{one}" if path else one


def _expected(names, value):
    found = repr(value) if not isinstance(value, list | dict) else type(value).__name__
    found = _WORDS.get(found, found)
    found = found if len(found) <= 40 else f"{found[:37]}..."
    match next(one for one in names if one != "null"):
        case "number":
            expected = message("record_number", "a number")
        case "integer":
            expected = message("record_integer", "a whole number")
        case "string":
            expected = message("record_string", "a text")
        case "boolean":
            expected = message("record_boolean", "true or false")
        case "array":
            expected = message("record_array", "a list")
        case _:
            expected = message("record_object", "an object with keys")
    return message("record_value", "found {found}, expected {expected}",
                   found=found, expected=expected)  # fmt: skip


# ---- from plain data


def from_plain(cls, data, name="data"):
    """The dataclass that plain data hold, its types checked.

    Parameters
    ----------
    cls : type
        The dataclass.
    data : dict
        As parsed from JSON.
    name : str, optional
        Name of the file, for problems.

    Raises
    ------
    InputError
        With one line for each problem: "record.json, capacity.volume_m3[3]: expected a number".
    """
    missing, problems = checked(data, json_schema(cls), name)
    if missing:
        what = message("record_key_missing", "missing")
        problems = [Problem(name, what, column=path) for path in missing]
    if problems:
        raise InputError(problems)
    return _made(cls, data)


def _made(kind, data):
    make = _maker(kind)
    return data if make is None else make(data)


@cache  # a table has millions of numbers of a few types
def _maker(kind):
    """The function that makes a value of a type from plain data; None: the plain data are it."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return None if isinstance(arguments[1], Columns) else _maker(arguments[0])
    if origin in (Union, types.UnionType):
        others = [one for one in arguments if one is not type(None)]
        make = None if len(others) > 1 else _maker(others[0])
        return make and (lambda data: None if data is None else make(data))
    if kind is float:
        return lambda data: np.nan if data is None else float(data)
    if is_dataclass(kind):
        return partial(_object, kind)
    if origin in (tuple, list):
        if len(arguments) > 1 and Ellipsis not in arguments:
            pairs = partial(zip, arguments, strict=True)
            return lambda data: origin(_made(one, item) for one, item in pairs(data))
        make = _maker(arguments[0])
        return origin if make is None else (lambda data: origin(map(make, data)))
    if kind is np.ndarray:
        return _array_of
    return tuple if kind is tuple else None


def _array_of(data):
    """An array of any shape; of numbers NaN stands for null."""
    found = np.array(data)
    return found if found.dtype != object else np.array(data, dtype=float)


def _object(cls, data):
    values = {}
    for one in keys_of(cls):
        if not one.name or one.key not in data:
            continue
        value = data[one.key]
        if one.type is Message:
            text = Message(value)
            text.code, text.values = data[f"{one.key}_code"], data[f"{one.key}_values"]
            values[one.name] = text
        elif one.is_part:
            values.setdefault(one.name, {})[one.key] = _made(one.type, value)
        else:
            values[one.name] = _made(one.type, value)
    for one in fields(cls):  # an optional key that is not there
        if one.name not in values and one.default is MISSING and one.default_factory is MISSING:
            values[one.name] = None
    return cls(**values)
