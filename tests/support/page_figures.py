"""Figures in running text and tables of pages, and the sentences that tests compare with runs.

`figures_of` returns the figures of a sentence, which a test compares with a run, a closed form, a
constant of the code or a study. `untied_figures` lists the figures of a page that look like
results and are in no such sentence.
"""

import ast
import math
import re
from functools import cache

from page_sessions import FENCE, ROOT

NUMBER = r"[+−-]?(?:(?:\d{1,3}(?: \d{3})+|\d+)(?:[.,]\d+)?|\.\d+)"
UNIT = r"(?:m³|m3|m²|m2|mL|L|mm|µm|ppm|%|s|ms|minutes?|hours?|MB|GB|kB|px|pixels|U|u)(?![\w/³²])"
RESULT = re.compile(
    rf"(?<![\w.,])(?:{NUMBER} ?{UNIT}"  # a quantity
    rf"|{NUMBER} (?:of|in) {NUMBER}(?! ?(?:mm|m|L)\b)"  # a share of a number
    rf"|[+−-]?0?\.\d\d+(?![\d/]| ?m\b)"  # a share
    rf"|(?:U|u|k|w|rms|E_n)(?:\(\w+\)|/V)? (?:=|of|is) {NUMBER})"
)
PROBABILITY = re.compile(r"(?:95|99) %")  # coverage probability of an interval, not a result


def words_of(page):
    """Text of a page without blocks of code, with single spaces."""
    text = FENCE.sub("", (ROOT / page).read_text(encoding="utf-8"))
    return " ".join(text.split())


def pattern_of(sentence):
    """Regular expression of a sentence with () for each figure."""
    return f"({NUMBER})".join(map(re.escape, sentence.split("()")))


def figures_of(page, sentence):
    """The numbers of a sentence of a page, as texts; `sentence` has () for each number."""
    match = re.search(pattern_of(sentence), words_of(page))
    assert match, f"{page} has no sentence: {sentence}"
    return match.groups()


def value_of(text):
    """The number that a figure of a page states."""
    return float(text.replace(" ", "").replace("−", "-").replace(",", "."))


def rounded(values, like):
    """The values with as many decimals as the texts `like` have."""
    decimals = [len(text.partition(".")[2]) for text in like]
    return tuple(f"{value:.{n}f}" for value, n in zip(values, decimals, strict=True))


def agree(values, texts):
    """Whether each text is its value, rounded to the digits of the text."""
    steps = [10.0 ** -len(re.sub(r".*[.,]|^[^.,]*$", "", text)) for text in texts]
    return all(
        abs(value - value_of(text)) <= 0.5 * step * (1 + 1e-9)
        for value, text, step in zip(values, texts, steps, strict=True)
    )


@cache
def tied_sentences():
    """{page: sentences} that the tests name: ("docs/page.md", "sentence", ...) in any test."""
    sentences = {}
    for path in sorted((ROOT / "tests").glob("**/test_*.py")):
        source = path.read_text(encoding="utf-8")
        if '"docs/' not in source or "page_figures" not in source:
            continue
        for node in ast.walk(ast.parse(source)):
            items = node.args if isinstance(node, ast.Call) else getattr(node, "elts", [])
            texts = [getattr(item, "value", None) for item in items[:2]]
            if len(texts) == 2 and all(isinstance(text, str) for text in texts):
                sentences.setdefault(texts[0], []).append(texts[1])
    return sentences


def untied_figures(page, given=()):
    """Figures of a page that look like results and are in no sentence that a test names.

    `given`: phrases of the page whose figures are inputs, definitions or advice.
    """
    text = words_of(page)
    patterns = [pattern_of(one) for one in (*tied_sentences().get(page, ()), *given)]
    spans = [match.span() for one in patterns for match in re.finditer(one, text)]
    spans += [match.span() for match in re.finditer(r"`[^`]*`|\]\([^)]*\)", text)]
    return [
        text[max(match.start() - 60, 0) : match.end() + 20]
        for match in RESULT.finditer(text)
        if not PROBABILITY.fullmatch(match[0])
        and not any(low <= match.start() and match.end() <= high for low, high in spans)
    ]


def shares_agree(shares, texts, count, full):
    """Whether shares of `count` draws agree with stated shares of `full` draws.

    The limit is 3.3 standard errors of the difference: one in a thousand valid studies exceeds it.
    """
    for share, text in zip(shares, texts, strict=True):
        stated = value_of(text)
        pooled = (count * share + full * stated + 1) / (count + full + 2)
        error = math.sqrt(pooled * (1 - pooled) * (1 / count + 1 / full))
        if abs(share - stated) > 3.3 * error + 0.5e-3:
            return False
    return True


def ratios_agree(ratio, text, count, full):
    """Whether mean U over the rms error of `count` draws agrees with the ratio of `full` draws.

    The variance of a mean square of normal errors is its square times 2 / count.
    """
    error = math.sqrt((1 / count + 1 / full) / 2)
    return abs(math.log(ratio / value_of(text))) <= 3.3 * error
