"""Reading length of the pages: `make check` runs this.

    python tests/house/page_counts.py            fails where a page or the sum is above its limit
    python tests/house/page_counts.py --lower    writes smaller counts as the new limits
    python tests/house/page_counts.py --list     words of each page

A page takes at most ten minutes at 220 words a minute. The sum is of tutorials, guides, reference
and explanation in English; its goal is 60 000 words. Studies, pages for developers and the
generated reference are not counted.
"""

import argparse
import re
import sys
from pathlib import Path

from prose_counts import compare_with_limits

ROOT = Path(__file__).parents[2]
LIMITS = Path(__file__).with_suffix(".toml")
LONGEST = 2200  # words: ten minutes
STEP = 500  # the sum counts in such steps, so that a sentence more in a page is no fault
GENERATED = ("job-format.md", "plausible-values.md", "saved-keys.md", "record-format.md")
OTHER_KINDS = ("Studies", "For developers")  # headings of docs/index.md outside the sum
FOREIGN = re.compile(r"(?:comece|empiece|glossary|-es\b|-pt-BR\b)")
SUM, TRANSLATIONS = "words of all pages in English", "words of all translations"


def count_words(text):
    """Number of words of a page, as `wc -w` counts them."""
    return len(text.split())


def list_kinds(text):
    """{page: heading} of the pages that docs/index.md lists, outside the generated reference."""
    kinds = {}
    for heading, body in re.findall(r"^## (.+)\n((?:(?!^## ).*\n?)*)", text, flags=re.M):
        for name in re.findall(r"\]\(([\w.-]+\.md)\)", body):
            if name not in GENERATED:
                kinds.setdefault(name, heading)
    return kinds


def count_pages(folder):
    """{name: words}: pages above LONGEST, and the sums of all pages by language."""
    kinds = list_kinds((folder / "index.md").read_text(encoding="utf-8"))
    words = {name: count_words((folder / name).read_text(encoding="utf-8")) for name in kinds}
    read = {name: words[name] for name, kind in kinds.items() if kind not in OTHER_KINDS}
    counts = {f"docs/{name}": number for name, number in read.items() if number > LONGEST}
    counts[SUM] = sum(number for name, number in read.items() if not FOREIGN.search(name))
    counts[TRANSLATIONS] = sum(number for name, number in read.items() if FOREIGN.search(name))
    return counts, words


def main(arguments=None):
    """Compare with the limits; exit status 1 if a page or the sum is above its limit."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--lower", action="store_true", help="write smaller counts as limits")
    parser.add_argument("--list", action="store_true", help="print the words of each page")
    options = parser.parse_args(arguments)
    counts, words = count_pages(ROOT / "docs")
    if options.list:
        for name, number in sorted(words.items(), key=lambda item: -item[1]):
            print(f"{number:6d}  {name}")
        print(f"{counts[SUM]:6d}  {SUM}\n{counts[TRANSLATIONS]:6d}  {TRANSLATIONS}")
        return 0
    counts[SUM] = -(-counts[SUM] // STEP) * STEP
    del counts[TRANSLATIONS]  # without a limit: a further language is no fault
    return compare_with_limits(
        counts, LIMITS, options.lower, "cut, or move trials to docs/studies", LONGEST
    )


if __name__ == "__main__":
    sys.exit(main())
