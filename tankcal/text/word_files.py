"""The files of words (report_templates/words/), one for each language. Nothing heavy is loaded."""

import tomllib

from tankcal.errors import TankcalError
from tankcal.text.languages import DEFAULT
from tankcal.text.shipped import shipped_folder


def load_words(language=DEFAULT):
    """The words of one language: {group: {code: template, or {value: template}}}.

    Raises TankcalError when no words are shipped in that language.
    """
    folder = shipped_folder("report_templates") / "words"
    known = {path.stem: path for path in sorted(folder.glob("*.toml"))}
    if language not in known:
        raise TankcalError(
            f"there are no words in language {language!r}; shipped: {', '.join(known) or 'none'}"
        )
    return tomllib.loads(known[language].read_text(encoding="utf-8"))
