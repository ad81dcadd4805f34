"""Spelling of the pages: `make check` runs this.

    python tests/house/spelling.py        fails where a word is misspelt or not known

English pages are checked by codespell against common misspellings, Portuguese and Spanish pages by
the dictionaries of pyspellchecker. Further words are those of the reports (report_templates/words)
and of `spelling.toml`.
"""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

from page_counts import FOREIGN

ROOT = Path(__file__).parents[2]
WORDS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
LANGUAGES = {"pt-BR": "pt", "es": "es"}  # of our words, of the dictionary
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
CODE = re.compile(
    r"`[^`]*`|\]\([^)]*\)|^    .*$|\[[^\]]*\]\((?!\S*(?:-es|-pt-BR|aqui)\.md)[^)]*\)", re.M
)
WORD = re.compile(r"[^\W\d_]{3,}")


def language_of(name):
    """Language of a page, by its name."""
    if re.search(r"-es\.md|empiece", name):
        return "es"
    return "pt-BR" if FOREIGN.search(name) else "en"


def list_pages():
    """Paths of the pages, without the generated ones and the history."""
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
    pages += [*ROOT.glob("docs/*.md"), *ROOT.glob("docs/studies/*.md")]
    return sorted(page for page in pages if page.name not in ("saved-keys.md", "glossary.md"))


def words_of(text):
    """Set of the words of a page in lower case, without code and titles of English pages."""
    return {word.lower() for word in WORD.findall(CODE.sub(" ", FENCE.sub("", text)))}


def check_english(pages):
    """Lines of codespell, one for each misspelling."""
    ignored = ",".join(WORDS["en"])
    command = [sys.executable, "-m", "codespell_lib", "-L", ignored, *map(str, pages)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return (done.stdout + done.stderr).splitlines()


def unknown_words(texts, language):
    """Words that neither the dictionary nor our words of a language contain, sorted."""
    from spellchecker import SpellChecker

    path = ROOT / f"report_templates/words/{language}.toml"
    known = {word.lower() for word in WORD.findall(path.read_text(encoding="utf-8"))}
    known |= set(WORDS[language]) | set(WORDS["names"])
    words = set().union(*map(words_of, texts)) - known
    return sorted(SpellChecker(language=LANGUAGES[language]).unknown(words))


def main():
    """Print each misspelt or unknown word; exit status 1 if there is any."""
    by_language = {}
    for page in list_pages():
        by_language.setdefault(language_of(page.name), []).append(page)
    problems = check_english(by_language.pop("en"))
    for language, pages in by_language.items():
        texts = [page.read_text(encoding="utf-8") for page in pages]
        problems += [f"{language}: {word}" for word in unknown_words(texts, language)]
    for problem in problems:
        print(f"{problem}; correct it, or add it to tests/house/spelling.toml")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
