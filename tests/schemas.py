"""The JSON schemas of what is saved, and the list of their keys, docs/saved-keys.md.

make schemas   writes both, from the dataclasses
"""

import json
from pathlib import Path

from tankcal.products.base import products
from tankcal.record.schema import json_schema

SAVED = tuple(saved for product in products() for saved in product.saved_types())


def schema_text(saved_format, kind, cls):
    """The JSON schema of a format, as its file holds it."""
    title = saved_format.format + (f", kind {kind}" if kind else "")
    return json.dumps(json_schema(cls, title), ensure_ascii=False, indent=1) + "\n"


def keys_in(saved, free=()):
    """Set of the paths of all keys that plain data have, in every row of their lists.

    free  paths of dicts with any keys: "job.certificate"
    """
    return set(_keys(saved, "", frozenset(free)))


def _keys(value, path, free):
    if path in free:
        yield f"{path}.*"
    elif isinstance(value, dict):
        for key, item in value.items():
            place = f"{path}.{key}".lstrip(".")
            yield place
            yield from _keys(item, place, free)
    elif isinstance(value, list):
        for item in value:
            if isinstance(item, dict | list):
                yield from _keys(item, path + "[]", free)


def keys_of_schema(schema, optional=False):
    """The same of a JSON schema: every key that must be there (or may be), `.*`: any may be."""
    return set(_keys_of_schema(schema, schema, "", "properties" if optional else "required"))


def _keys_of_schema(schema, root, path, which):
    schema = schema["anyOf"][0] if "anyOf" in schema else schema
    if "$ref" in schema:
        schema = root["$defs"][schema["$ref"].rpartition("/")[2]]
    for key in schema.get(which, ()):
        place = f"{path}.{key}".lstrip(".")
        yield place
        yield from _keys_of_schema(schema["properties"][key], root, place, which)
    if isinstance(schema.get("items"), dict):
        yield from _keys_of_schema(schema["items"], root, path + "[]", which)
    types = schema.get("type", ())
    if "object" in ([types] if isinstance(types, str) else types) and "required" not in schema:
        yield f"{path}.*"


DOCS = Path(__file__).parents[1] / "docs" / "saved-keys.md"
HEAD = """# Every key of a saved file

Made from the dataclasses that are saved (`make schemas`), as the JSON schemas in
`tankcal/record/schemas/` are. What belongs together is told in [the record](record-format.md). A
number may be `null` where it does not exist, unless it says *never null*.
"""


def documented():
    """The text of docs/saved-keys.md: a table for each dataclass, those of a format together."""
    parts, told = [HEAD], set()
    for saved_format, kind, cls in SAVED:
        title = f"`{saved_format.format}`" + (f', kind "{kind}"' if kind else "")
        schema = json_schema(cls)
        first = schema["$ref"].rpartition("/")[2]
        parts.append(f"## {title}\n")
        for name in (first, *(one for one in schema["$defs"] if one != first)):
            if name not in told:
                parts.append(_table(name, schema["$defs"][name]))
                told.add(name)
    return "\n".join(parts)


def _table(name, schema):
    rows = [
        f"| `{key}` | {_words(one)} | {one.get('description', '').replace('|', chr(92) + '|')} |"
        for key, one in schema["properties"].items()
    ]
    lead, _, rest = schema["description"].partition("\n")
    block = f"\n```text\n{rest.strip(chr(10))}\n```\n" if rest.strip() else ""
    head = "| key | type | what it holds |\n| --- | --- | --- |"
    return f"### {name}\n\n{lead}\n{block}\n{head}\n" + "\n".join(rows) + "\n"


def _words(schema):
    """The type of a key, as a reader says it."""
    if "anyOf" in schema:
        return f"{_words(schema['anyOf'][0])} or null"
    if "$ref" in schema:
        return f"[{(name := schema['$ref'].rpartition('/')[2])}](#{name.lower()})"
    types = schema.get("type", "anything")
    if types == "array":
        return f"list of {_words(schema['items'])}" if schema.get("items") else "list"
    if types == ["number", "null"]:
        return "number"
    if types == "number":
        return "number, never null"
    return types if isinstance(types, str) else " or ".join(types)


if __name__ == "__main__":
    for one in SAVED:
        path = one[0].schema_file(one[1])
        path.parent.mkdir(exist_ok=True)
        path.write_text(schema_text(*one), encoding="utf-8")
    DOCS.write_text(documented(), encoding="utf-8")
