"""Words, phrases and names that our English should lose, counted: `make check` runs this.

    python tests/house/prose_counts.py           fails where a count is above its limit
    python tests/house/prose_counts.py --lower   writes smaller counts as the new limits
    python tests/house/prose_counts.py --where "set aside"   files with the most of it

Prose is the English pages, and the docstrings, comments and texts of the package. Names are the
identifiers of the package; the first word of a function's name should be a verb.
"""

import argparse
import ast
import io
import re
import sys
import tokenize
import tomllib
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
LIMITS = Path(__file__).with_suffix(".toml")
FOREIGN = re.compile(r"comece|empiece|-(?:es|pt-BR)\.md|glossary|saved-keys")
PHRASES = {
    "one": r"one",
    "what is, what the, what it": r"what (?:is|the|it|was)",
    "says, said": r"says?|said",
    "tells, told": r"tells?|told",
    "nothing": r"nothing",
    "stands": r"stands?",
    "the same": r"the same",
    "set aside": r"set aside",
    "sound": r"sound",
    "beforehand": r"beforehand",
    "departs, departure": r"departs?|departures?",
    "as it is": r"as (?:it|they) (?:is|are|stands?)",
    "at all": r"at all",
    "by itself": r"by (?:it|them)sel(?:f|ves)",
    "told apart": r"told apart",
    "by lot": r"by lot",
    "papers": r"papers?",
}
NAMES = ("one", "found", "told", "mine", "own", "those", "given", "made")
PARTICIPLE = re.compile(
    r"(?!need|feed|seed|speed|embed|exceed)\w\w+ed|found|made|given|taken|told|said|held|kept|"
    "written|drawn|judged|asked|shown|done|gone|left|seen|known|meant|sent|laid|built|begun|broken|"
    "chosen|fallen|hidden"
)
PREPOSITION = re.compile(
    "of|in|on|at|by|from|to|with|without|within|into|onto|over|under|above|below|between|among|"
    "for|as|per|after|before|beside|beyond|through|against|across|along|around|until|since|than|"
    "out|off"
)
LONGEST_SENTENCE = 25  # words


def count_phrases(text):
    """Counter of PHRASES in a text."""
    return Counter(
        {
            name: len(re.findall(rf"\b(?:{pattern})\b", text, re.IGNORECASE))
            for name, pattern in PHRASES.items()
        }
    )


def prose_of_page(text):
    """The prose of a Markdown page: no code, no tables, no addresses."""
    text = re.sub(r"(?ms)^ *(```|~~~).*?^ *\1", "", text)
    lines = [line for line in text.splitlines() if not line.lstrip().startswith(("|", "    "))]
    text = re.sub(r"\]\([^)]*\)|`[^`]*`|https?://\S+", "", "\n".join(lines))
    return re.sub(r"[*_#\[\]]", "", text)


def count_long_sentences(text):
    """Number of sentences of more than LONGEST_SENTENCE words in the prose of a page."""
    sentences = re.split(r"(?<=[.!?:;])\s+|\n\s*\n|\n\s*[-0-9]", text)
    return sum(len(re.findall(r"\w[\w'-]*", one)) > LONGEST_SENTENCE for one in sentences)


def count_module(source):
    """Counter of PHRASES in comments, docstrings and texts of a module, and of its names.

    Names are NAMES as identifiers, and functions whose first word is no verb.
    """
    tokens = list(tokenize.generate_tokens(io.StringIO(source).readline))
    texts = (token.string for token in tokens if token.type in (tokenize.COMMENT, tokenize.STRING))
    counts = count_phrases("\n".join(texts))
    names = Counter(token.string for token in tokens if token.type == tokenize.NAME)
    counts.update({f"name {name}": names[name] for name in NAMES})
    for node in ast.parse(source).body:
        if isinstance(node, ast.FunctionDef):
            first = node.name.strip("_").split("_")[0]
            counts["function participle"] += PARTICIPLE.fullmatch(first) is not None
            counts["function preposition"] += PREPOSITION.fullmatch(first) is not None
    return counts


def count_file(path):
    """Counter of everything in a page or a module, by names such as "docs: stands"."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        prose = prose_of_page(text)
        counts = count_phrases(prose)
        counts[f"sentences of more than {LONGEST_SENTENCE} words"] = count_long_sentences(prose)
        return Counter({f"docs: {name}": count for name, count in counts.items()})
    return Counter({f"package: {name}": count for name, count in count_module(text).items()})


def list_files():
    """Paths of the English pages and of the modules of the package."""
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
    pages += [path for path in (ROOT / "docs").glob("*.md") if not FOREIGN.search(path.name)]
    pages += (ROOT / "docs/studies").glob("*.md")
    return sorted(pages) + sorted((ROOT / "tankcal").rglob("*.py"))


def compare_with_limits(counts, path, is_lowering, remedy, unnamed=sys.maxsize):
    """Print counts above their limits in a TOML file; 1 if there are any, else 0.

    With is_lowering, and no count above its limit, the counts become the limits. `unnamed` is the
    limit of counts that the file does not name.
    """
    limits = tomllib.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    above = {name: n for name, n in counts.items() if n > limits.get(name, unnamed)}
    for name, count in sorted(above.items()):
        print(f"{name}: {count}, limit {limits.get(name, unnamed)}; {remedy} (CONTRIBUTING.md)")
    if is_lowering and not above:
        lines = [f'"{name}" = {count}\n' for name, count in sorted(counts.items())]
        heading = "# Written with --lower by the script of this name: counts may only fall\n"
        path.write_text(heading + "".join(lines), encoding="utf-8")
    return 1 if above else 0


def main(arguments=None):
    """Compare with the limits; exit status 1 if a count is above its limit."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--lower", action="store_true", help="write smaller counts as limits")
    parser.add_argument("--where", metavar="TEXT", help="list the files with the most of it")
    options = parser.parse_args(arguments)
    by_file = {path: count_file(path) for path in list_files()}
    if options.where:
        for path, counts in by_file.items():
            count = sum(n for name, n in counts.items() if options.where in name)
            if count:
                print(f"{count:6d}  {path.relative_to(ROOT)}")
        return 0
    counts = Counter()
    for file_counts in by_file.values():
        counts.update(file_counts)  # unlike +, keeps the words that are no longer used
    return compare_with_limits(counts, LIMITS, options.lower, "write it in other words")


if __name__ == "__main__":
    sys.exit(main())
