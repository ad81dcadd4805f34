"""The files of words (report_templates/words/), one for each language. Nothing heavy is loaded."""

import pickle
import re
import tomllib
from functools import cache

from tankcal.errors import TankcalError
from tankcal.text.languages import DEFAULT
from tankcal.text.shipped import shipped_folder

_TABLE = re.compile(r"^\[([^].]+)", re.MULTILINE)  # the head of a table, and the group it is of


def load_words(language=DEFAULT, groups=None):
    """The words of one language: {group: {code: template, or {value: template}}}.

    Parameters
    ----------
    language : str
    groups : collection of str, optional
        The only groups that are read, where a few are wanted of many languages; None: all.

    Raises
    ------
    TankcalError
        When no words are shipped in that language.
    """
    folder = shipped_folder("report_templates") / "words"
    known = {path.stem: path for path in sorted(folder.glob("*.toml"))}
    if language not in known:
        raise TankcalError(
            f"there are no words in language {language!r}; shipped: {', '.join(known) or 'none'}"
        )
    return pickle.loads(_pickled(known[language], groups and frozenset(groups)))


@cache
def _pickled(path, groups):
    """The words of a file, parsed once: to be unpickled takes a twentieth, and gives own copies."""
    text = path.read_text(encoding="utf-8")
    return pickle.dumps(tomllib.loads(text if groups is None else _tables_of(text, groups)))


def _tables_of(text, groups):
    """The tables of a TOML text that are of these groups; no string of it begins a line with [."""
    heads = list(_TABLE.finditer(text))
    ends = [head.start() for head in heads[1:]] + [len(text)]
    return "".join(
        text[head.start() : end] for head, end in zip(heads, ends, strict=True) if head[1] in groups
    )
