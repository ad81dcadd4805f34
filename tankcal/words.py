"""Codes of the record as sentences, in the reader's language (report_templates/words/)."""

import tomllib

from tankcal.errors import TankcalError
from tankcal.shipped import shipped


def load_words(language="en"):
    """The words of one language: {group: {code: template, or {value: template}}}.

    Raises TankcalError when no words are shipped in that language.
    """
    folder = shipped("report_templates") / "words"
    known = {path.stem: path for path in sorted(folder.glob("*.toml"))}
    if language not in known:
        raise TankcalError(
            f"there are no words in language {language!r}; shipped: {', '.join(known) or 'none'}"
        )
    return tomllib.loads(known[language].read_text(encoding="utf-8"))


class _Number(float):
    """A number that a plain {value} shows with six significant digits at most."""

    def __format__(self, spec):
        return super().__format__(spec or ".6g")


def sentence(words, group, code, value=None):
    """What `code` (with `value`) of the record says, as a sentence of `words[group]`.

    A template may use {value}: a list comes as its items joined by ", ", a number that has no
    format of its own with up to six digits. A table of templates is
    looked up by the value as text, then "none" for null or an empty list, then "other". A code or
    value without words comes back as "code: value", for an assumption is never hidden.
    """
    if isinstance(value, list | tuple):
        value = ", ".join(str(item) for item in value) or None
    shown = _Number(value) if isinstance(value, float) else value
    template = words.get(group, {}).get(code)
    if isinstance(template, dict):
        key = "none" if value is None else str(value)
        template = template.get(key, template.get("other"))
    if template is None:
        return code if value is None else f"{code}: {value}"
    return template.format(value=shown)


def choice_sentence(words, choice):
    """One choice {code, value} of the record as a sentence, its numbers in the reader's style."""
    value = choice["value"]
    if choice["code"] == "coverage":
        value = f"{100 * value:.6g}\N{NO-BREAK SPACE}%"
    elif isinstance(value, int | float):
        value = f"{value:.3g}"
    elif isinstance(value, list):
        return sentence(
            words, "choices", choice["code"], [words["inputs"].get(name, name) for name in value]
        )
    mark = words["language"]["decimal"]
    is_number = any(sign.isdigit() for sign in value)
    return sentence(
        words, "choices", choice["code"], value.replace(".", mark) if is_number else value
    )
