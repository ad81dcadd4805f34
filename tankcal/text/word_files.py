"""Files of words (report_templates/words/), one per language. This module imports fast."""

import pickle
import re
import tomllib
from functools import cache

from tankcal.errors import TankcalError
from tankcal.text.languages import DEFAULT
from tankcal.text.shipped import shipped_folder

_TABLE = re.compile(r"^\[([^].]+)", re.MULTILINE)  # the head of a table, and the group it is of


def load_words(language=DEFAULT, groups=None):
    """Load the words of one language: {group: {code: template, or {value: template}}}.

    Parameters
    ----------
    language : str
    groups : collection of str, optional
        Groups to load, if only a few are needed. None: all groups.

    Raises
    ------
    TankcalError
        No words are shipped in this language.
    """
    folder = shipped_folder("report_templates") / "words"
    known = {path.stem: path for path in sorted(folder.glob("*.toml"))}
    if language not in known:
        raise TankcalError(
            f"there are no words in language {language!r}; shipped: {', '.join(known) or 'none'}"
        )
    return pickle.loads(_load_pickled(known[language], groups and frozenset(groups)))


@cache
def _load_pickled(path, groups):
    """Return the pickled words of a file: unpickling is 20 times faster and gives a new copy."""
    text = path.read_text(encoding="utf-8")
    return pickle.dumps(tomllib.loads(text if groups is None else _tables_of(text, groups)))


def _tables_of(text, groups):
    """Return the tables of these groups in a TOML text; no string in it begins a line with [."""
    heads = list(_TABLE.finditer(text))
    ends = [head.start() for head in heads[1:]] + [len(text)]
    return "".join(
        text[head.start() : end] for head, end in zip(heads, ends, strict=True) if head[1] in groups
    )
