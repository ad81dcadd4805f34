"""Saved data, declared once as dataclasses: JSON schema, conversion to plain data, texts.

A dataclass is a JSON object. Its fields are the keys, in their order, with the unit in the name. A
float may be null, since NaN and infinity are written as null; other values are null only if their
type includes None. A Message `x` is written as `x`, and as `x_code` and `x_values` at the end of
its object.
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
from tankcal.messages import Message, as_plain, message

DRAFT = "https://json-schema.org/draft/2020-12/schema"
MOST_PROBLEMS = 20  # largest number of reported problems of a file
Finite = Annotated[float, "finite"]  # a number that is never null
_SCALARS = {bool: "boolean", int: "integer", str: "string"}
_JSON_CONSTANTS = {"None": "null", "True": "true", "False": "false"}
LARGEST = 1e100  # no quantity in SI units is as large, and axes of figures overflow beyond
_TYPES = {  # types of Python for each type of JSON
    "boolean": {bool}, "integer": {int}, "number": {int, float}, "string": {str},
    "null": {type(None)}, "array": {list}, "object": {dict},
}  # fmt: skip


@dataclass(frozen=True)
class Columns:
    """Mark of a dict of columns, {key: values}, whose keys are the fields of the dataclass `of`."""

    of: type


@dataclass_transform(frozen_default=True)
class Saved:
    """Base class of saved objects; each subclass is a frozen dataclass."""

    def __init_subclass__(cls, kw_only=False):
        dataclass(frozen=True, kw_only=kw_only)(cls)


def key(doc, *, of=None, times=None, named=None, optional=False, kind=None, parts=None, **options):
    """Declare a field that is saved.

    Parameters
    ----------
    doc : str
        Description of the value in one line.
    of : str, optional
        Attribute from which `fill_from` takes the value, such as "wall.shell.tilt"; None: the
        attribute with the name of the field.
    times : float, optional
        Factor between the attribute and the value, for another unit.
    named : str, optional
        The key, if it is no valid name in Python, such as "from".
    optional : bool, optional
        Whether the key is omitted if the value is None.
    kind : callable, optional
        Function that returns the type, for a type whose module is loaded only for the schema; the
        annotation of the field is `Any`.
    parts : callable, optional
        For a field that is a dict: function that returns {key: (kind, description)}. The entries
        of the dict are saved in place of the field; a missing entry is omitted.
    **options
        Further arguments of `dataclasses.field`.
    """
    about = {"doc": doc, "of": of, "times": times, "named": named, "optional": optional}
    about |= {"kind": kind, "parts": parts}
    return field(metadata=about, **options)


def fill_from(cls, source, **values):
    """Make an object of `cls` from the given values and the attributes of another object.

    Parameters
    ----------
    cls : type
        Dataclass of the result.
    source : object or None
        Object with the attributes (see `key`).
    **values
        Values of fields that are not attributes of `source`.

    Returns
    -------
    object or None
        None if `source` is None. Fields with a default keep it unless `values` has them.
    """
    if source is None:
        return None
    for declared in fields(cls):
        if declared.name not in values and not _has_default(declared):
            value = attrgetter(declared.metadata.get("of") or declared.name)(source)
            times = declared.metadata.get("times")
            scales = times is not None and value is not None
            values[declared.name] = times * value if scales else value
    return cls(**values)


def _has_default(declared):
    return declared.default is not MISSING or declared.default_factory is not MISSING


# ---- keys of a dataclass


@dataclass(frozen=True)
class Key:
    """A key: its name in JSON, the name of its field, its type, and its description or ""."""

    key: str
    name: str
    kind: Any  # the type, or a function that returns it
    doc: str = ""
    required: bool = True
    is_part: bool = False  # an entry of the dict that is the field
    is_late: bool = False  # whether `kind` is a function

    @property
    def type(self):
        """Type of the value; its module is loaded if necessary."""
        kind = self.kind() if self.is_late else self.kind
        return kind | None if self.is_part else kind

    def value_in(self, instance):
        """Value of the key in an instance of the dataclass; None for a missing entry."""
        value = getattr(instance, self.name)
        return value.get(self.key) if self.is_part else value


@cache
def keys_of(cls):
    """Return the keys of a dataclass in the order of writing (tuple of Key)."""
    hints, attribute_docs = get_type_hints(cls, include_extras=True), _attribute_docs(cls)
    keys = []
    for declared in fields(cls):
        if declared.metadata.get("parts"):
            keys += [
                Key(name, declared.name, kind, doc, required=False, is_part=True, is_late=True)
                for name, (kind, doc) in declared.metadata["parts"]().items()
            ]
            continue
        late = declared.metadata.get("kind")
        keys.append(
            Key(
                declared.metadata.get("named") or declared.name,
                declared.name,
                late or hints[declared.name],
                declared.metadata.get("doc") or attribute_docs.get(declared.name, ""),
                not declared.metadata.get("optional", False),
                is_late=late is not None,
            )
        )
    for text in [item for item in keys if item.kind is Message]:
        keys.append(Key(f"{text.key}_code", "", str | None, f"code of `{text.key}`"))
        keys.append(Key(f"{text.key}_values", "", dict, f"values of `{text.key}`"))
    return tuple(keys)


def _attribute_docs(cls):
    """Return {attribute: description} of the section Attributes of the docstring of a class."""
    section = re.search(r"\n\nAttributes\n-+\n(.*?\n)(?:\n|$)", f"{getdoc(cls)}\n", re.DOTALL)
    # An entry has names, optionally a type, and indented lines of text.
    entry = r"^(\w+(?:, \w+)*)(?: :.*)?\n((?: +.+\n)+)"
    entries = re.findall(entry, section[1], re.MULTILINE) if section else ()
    return {
        name: " ".join(text.split()).rstrip(".")
        for names, text in entries
        for name in names.split(", ")
    }


# ---- JSON schema


def json_schema(cls, title=None):
    """Return the JSON schema of the plain data of a dataclass, from the types of its fields.

    Parameters
    ----------
    cls : type
        The dataclass.
    title : str, optional
        Name of the format.

    Returns
    -------
    dict
        Draft 2020-12. Each dataclass that occurs in `cls` is under `$defs`.
    """
    definitions = {}
    schema = _schema_of(cls, definitions)
    head = {"$schema": DRAFT} | ({"title": title} if title else {})
    return head | schema | {"$defs": dict(sorted(definitions.items()))}


def _schema_of(kind, definitions):
    """Return the schema of a type; dataclasses are added to `definitions`."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        base, mark = arguments
        if isinstance(mark, Columns):
            columns = {
                item.key: {"type": "array", "items": _schema_of(item.type, definitions)}
                for item in keys_of(mark.of)
            }
            return {"type": "object", "properties": columns, "required": list(columns)}
        return {"type": "number"} if mark == "finite" else _schema_of(base, definitions)
    if origin in (Union, types.UnionType):
        return _union_schema(arguments, definitions)
    if kind in _SCALARS:
        return {"type": _SCALARS[kind]}
    if kind is float:
        return {"type": ["number", "null"]}
    if kind is Message:
        return {"type": "string"}
    if is_dataclass(kind):
        return _reference(kind, definitions)
    if origin in (tuple, list):
        return _array_schema(origin, arguments, definitions)
    if kind in (tuple, list, np.ndarray):
        return {"type": "array"}
    if origin is dict:
        return {"type": "object", "additionalProperties": _schema_of(arguments[1], definitions)}
    return {"type": "object"} if kind is dict else {}


def _union_schema(arguments, definitions):
    """Return the schema of a union of types, at most one of which is no scalar."""
    schemas = [_schema_of(kind, definitions) for kind in arguments if kind is not type(None)]
    nullable = ["null"] if type(None) in arguments else []
    if all(set(schema) == {"type"} for schema in schemas):
        names = [name for schema in schemas for name in np.atleast_1d(schema["type"]).tolist()]
        return {"type": list(dict.fromkeys(names + nullable))}
    return {"anyOf": [*schemas, *({"type": name} for name in nullable)]}


def _array_schema(origin, arguments, definitions):
    items = _schema_of(arguments[0], definitions)
    if origin is list or Ellipsis in arguments:
        return {"type": "array", "items": items}
    length = len(arguments)
    return {"type": "array", "items": items, "minItems": length, "maxItems": length}


def _reference(cls, definitions):
    """Return a reference to the schema of a dataclass, and add the schema to `definitions`."""
    if cls.__name__ not in definitions:
        definitions[cls.__name__] = {}
        definitions[cls.__name__] = {
            # The sections of the docstring, such as Attributes, are not part of the description.
            "description": re.split(r"\n\n\w+\n---", getdoc(cls))[0],
            "type": "object",
            "properties": {item.key: _property(item, definitions) for item in keys_of(cls)},
            "required": [item.key for item in keys_of(cls) if item.required],
        }
    return {"$ref": f"#/$defs/{cls.__name__}"}


def _property(item, definitions):
    schema = _schema_of(item.type, definitions)
    return {"description": item.doc} | schema if item.doc else schema


# ---- comparison of data with a schema


def check_data(data, schema, name):
    """Compare data with a schema.

    Parameters
    ----------
    data : object
        Plain data.
    schema : dict
        JSON schema of `json_schema`.
    name : str
        Name of the file, for the problems.

    Returns
    -------
    missing : list of str
        Sorted paths of missing keys; `[]` is any row, as in "sections[].modes".
    problems : list of Problem
        A problem for each wrong value, at most MOST_PROBLEMS of them.
    """
    missing, problems = set(), []
    for path, expected in _find_faults(data, schema, schema, ""):
        if expected is None:
            missing.add(re.sub(r"\[\d+\]", "[]", path))
        elif len(problems) < MOST_PROBLEMS:
            problems.append(Problem(name, expected, column=path))
        else:
            more = message("record_has_more", "further values are not as expected either")
            return sorted(missing), [*problems, Problem(name, more)]
    return sorted(missing), problems


def _find_faults(value, schema, root, path):
    """Yield (path, expected value) of each wrong value, and (path, None) of each missing key.

    In each object and list the missing keys come before the wrong values.
    """
    if value is None and {"type": "null"} in schema.get("anyOf", ()):
        return
    schema = _resolve(schema, root)
    names = schema.get("type", ())
    names = [names] if isinstance(names, str) else names
    if names and not any(type(value) in _TYPES[name] for name in names):
        if names == ["object"] and schema.get("required"):  # all its keys are missing
            yield from ((_join_path(path, name), None) for name in schema["required"])
        elif names == ["array"]:
            yield path, None
        else:
            yield path, _expected_value(names, value)
    elif isinstance(value, dict):
        yield from _find_faults_of_object(value, schema, root, path)
    elif isinstance(value, list):
        yield from _find_faults_of_array(value, schema, root, path)
    elif type(value) in (int, float) and not _are_usable([value]):
        yield path, _expected_value(names, value)


def _resolve(schema, root):
    """Return the schema behind a reference; for a nullable object the schema of the object."""
    if "anyOf" in schema:
        schema = schema["anyOf"][0]
    while "$ref" in schema:
        schema = root["$defs"][schema["$ref"].rpartition("/")[2]]
    return schema


def _find_faults_of_object(value, schema, root, path):
    for name in schema.get("required", ()):
        if name not in value:
            yield _join_path(path, name), None
    properties, other = schema.get("properties", {}), schema.get("additionalProperties")
    for name, item in value.items():
        item_schema = properties.get(name, other)
        if item_schema is not None:
            yield from _find_faults(item, item_schema, root, _join_path(path, name))


def _find_faults_of_array(value, schema, root, path):
    length = schema.get("minItems")
    if length is not None and len(value) != length:
        yield path, message("record_length", "found {found} values, expected {length}",
                            found=len(value), length=length)  # fmt: skip
    items = schema.get("items", {})
    if items and not _are_valid(value, items):
        for number, item in enumerate(value):
            yield from _find_faults(item, items, root, f"{path}[{number}]")


def _are_valid(values, items):
    """Return whether all values are certainly valid, by their types at once.

    A list may have 200 000 values, too many for a check of each.
    """
    kinds = set(map(type, values))
    if kinds == {list} and items.get("type") == "array" and "minItems" not in items:
        return not items.get("items") or _are_valid([*chain.from_iterable(values)], items["items"])
    names = items.get("type", ())
    names = [names] if isinstance(names, str) else names
    allowed = set().union(*(_TYPES[name] for name in names))
    if not kinds <= allowed - {list, dict}:
        return False
    return not kinds & {int, float} or _are_usable(values)


def _are_usable(values):
    """Return whether all numbers among the values are finite and of a possible size."""
    numbers = [value for value in values if type(value) in (int, float)]
    try:
        return all(map(isfinite, numbers)) and max(map(abs, numbers), default=0) < LARGEST
    except OverflowError:  # an integer that no float can represent
        return False


def _join_path(path, name):
    return f"{path}.{name}" if path else name


def _expected_value(names, value):
    """Return the message on a value that has none of the types `names`."""
    found = repr(value) if not isinstance(value, list | dict) else type(value).__name__
    found = _JSON_CONSTANTS.get(found, found)
    found = found if len(found) <= 40 else f"{found[:37]}..."
    match next(name for name in names if name != "null"):
        case "number" if type(value) in (int, float) and value == value:  # not NaN
            expected = message("record_size", "a number smaller than {most:g}", most=LARGEST)
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


# ---- to plain data

_PLAIN = {str, int, bool, type(None)}


def to_plain(value):
    """Convert a value to data that JSON can represent; numbers that are not finite become null.

    Parameters
    ----------
    value : object
        A dataclass of this module, or dicts, lists, tuples and arrays of plain values and of
        dataclasses. `ArrayColumns` and `ArrayRows` remain unchanged.

    Returns
    -------
    object
        Dicts, lists, texts, numbers, booleans and None.
    """
    kind = type(value)
    if kind is float:  # first, since most of a million values are floats
        return value if isfinite(value) else None
    if kind in _PLAIN:
        return value
    if isinstance(value, dict):
        return {str(name): to_plain(item) for name, item in value.items()}
    if isinstance(value, np.ndarray):
        return to_plain(value.tolist())
    if isinstance(value, list | tuple):
        kinds = set(map(type, value))  # a long column has a single type: convert it at once
        if kinds <= _PLAIN:
            return list(value)
        if kinds == {float}:
            return [item if isfinite(item) else None for item in value]
        return [to_plain(item) for item in value]
    if is_dataclass(value):
        return _object_to_plain(value)
    if isinstance(value, np.generic):
        return to_plain(value.item())
    if isinstance(value, str):  # a Message
        return str(value)
    if isinstance(value, float) and not isfinite(value):
        return None
    return value


def _object_to_plain(value):
    keys = [item for item in keys_of(type(value)) if item.name]
    values = {item.key: item.value_in(value) for item in keys}
    plain = {
        item.key: to_plain(values[item.key])
        for item in keys
        if item.required or values[item.key] is not None
    }
    for item in keys:
        if item.kind is Message:
            text = as_plain(values[item.key])
            plain[f"{item.key}_code"] = text["code"]
            plain[f"{item.key}_values"] = to_plain(text["values"])
    return plain


# ---- from plain data


def from_plain(cls, data, name="data"):
    """Convert plain data to a dataclass, and check their types.

    Parameters
    ----------
    cls : type
        The dataclass.
    data : dict
        Data as parsed from JSON.
    name : str, optional
        Name of the file, for the problems.

    Returns
    -------
    object
        An object of `cls`.

    Raises
    ------
    InputError
        With a line for each problem: "record.json, capacity.volume_m3[3]: expected a number".
    """
    missing, problems = check_data(data, json_schema(cls), name)
    if missing:
        what = message("record_key_missing", "missing")
        problems = [Problem(name, what, column=path) for path in missing]
    if problems:
        raise InputError(problems)
    return _convert(cls, data)


def _convert(kind, data):
    converter = _converter(kind)
    return data if converter is None else converter(data)


@cache  # a table has millions of numbers of a few types
def _converter(kind):
    """Return the function that converts plain data to a type; None: no conversion is needed."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return None if isinstance(arguments[1], Columns) else _converter(arguments[0])
    if origin in (Union, types.UnionType):
        others = [argument for argument in arguments if argument is not type(None)]
        convert = None if len(others) > 1 else _converter(others[0])
        return convert and (lambda data: None if data is None else convert(data))
    if kind is float:
        return lambda data: np.nan if data is None else float(data)
    if is_dataclass(kind):
        return partial(_convert_object, kind)
    if origin in (tuple, list):
        if len(arguments) > 1 and Ellipsis not in arguments:
            pairs = partial(zip, arguments, strict=True)
            return lambda data: origin(_convert(argument, item) for argument, item in pairs(data))
        convert = _converter(arguments[0])
        return origin if convert is None else (lambda data: origin(map(convert, data)))
    if kind is np.ndarray:
        return _convert_array
    return tuple if kind is tuple else None


def _convert_array(data):
    """Return an array of any shape; null becomes NaN in an array of numbers."""
    array = np.array(data)
    return array if array.dtype != object else np.array(data, dtype=float)


def _convert_object(cls, data):
    values = {}
    for item in keys_of(cls):
        if not item.name or item.key not in data:
            continue
        value = data[item.key]
        if item.kind is Message:
            text = Message(value)
            text.code, text.values = data[f"{item.key}_code"], data[f"{item.key}_values"]
            values[item.name] = text
        elif item.is_part:
            values.setdefault(item.name, {})[item.key] = _convert(item.type, value)
        else:
            values[item.name] = _convert(item.type, value)
    for declared in fields(cls):
        # A missing optional key without default is None.
        if declared.name not in values and not _has_default(declared):
            values[declared.name] = None
    return cls(**values)


class Text(Saved):
    """A text in English, with its code and the values in it."""

    text: str = key("in English")
    code: str | None = key("of its translation; null: none")
    values: dict = key("of the placeholders: numbers, texts, lists of these, and texts with a code")


class WarningRecord(Saved):
    """A problem that did not stop the job."""

    file: str = key("name")
    row: int | None = key("of the file")
    column: str | None = key("of the file, or key")
    text: str = key("in English")
    code: str | None = key("of its translation; null: none")
    values: dict = key("of the placeholders: numbers, texts, lists of these, and texts with a code")


def text_of(message):
    """Return the `Text` of a Message or of any text."""
    return Text(str(message), **as_plain(message))


def warnings_of(problems):
    """Return the `WarningRecord` of each `errors.Problem`."""
    return [
        fill_from(WarningRecord, problem, text=str(problem.expected), **as_plain(problem.expected))
        for problem in problems
    ]
