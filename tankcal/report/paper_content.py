"""Words and numbers of a paper, whatever its file: what two makers of it must have in common.

The bytes of a paper depend on the packages that made it. Its words and numbers depend on the record
and, for the words, on the version of tankcal.
"""

import io
import re
from collections import Counter
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import PurePath

NUMBER = re.compile(r"(?<![\w.,])\d[\d.,]*")
WORD = re.compile(r"[^\W\d_]{2,}")
PICTURE = re.compile(r"[A-Za-z0-9+/=\\n]{200,}")  # base64
DIGITS = 5  # numbers of so many do not occur in a paper by chance


@dataclass(frozen=True)
class PaperContent:
    """The numbers and words of a paper, in their order, as they are printed."""

    numbers: list[str]
    words: list[str]
    is_paged: bool

    def missing_in(self, other, *, same_version):
        """What this paper has and `other` has not, or not so often, or not in that order; texts.

        same_version  whether the same version of tankcal made both: then all words and numbers
                      agree; else only the numbers of many digits are looked for
        """
        if not same_version:
            there = set(other.numbers)
            return sorted({one for one in self.numbers if _is_long(one)} - there)
        if self.is_paged:  # other breaks of lines and pages: heads of pages elsewhere, hyphens
            numbers = Counter(filter(_is_long, self.numbers)) - Counter(other.numbers)
            return [*numbers, *sorted(set(self.words) - set(other.words))]
        pairs = ((self.numbers, other.numbers), (self.words, other.words))
        return [one for mine, theirs in pairs for one in _first_apart(mine, theirs)]


def _first_apart(mine, theirs):
    """The first of `mine` that is not the one of `theirs` in its place, in a list."""
    for one, other in zip(mine, theirs, strict=False):
        if one != other:
            return [one]
    return mine[len(theirs) :][:1]


def _is_long(number):
    return sum(one.isdigit() for one in number) >= DIGITS


def content_of_paper(name, content, ignored=()):
    """`PaperContent` of a file; raises ValueError for one that cannot be read.

    Parameters
    ----------
    name : str
        Of the file; its ending says how it is read.
    content : bytes
    ignored : collection of str
        Words and numbers that are left out: versions of packages.

    Examples
    --------
    >>> content_of_paper("a.csv", b"height_m,volume_m3\\n1.00,132.47\\n").numbers
    ['1.00', '132.47']
    """
    read = _READERS.get(PurePath(name).suffix, _plain)
    try:
        text = read(content)
    except Exception as error:  # of a broken file the libraries raise whatever came of it
        raise ValueError(f"{name}: {type(error).__name__}") from error
    for one in sorted(ignored, key=len, reverse=True):
        text = text.replace(one, " ")
    numbers = [one.rstrip(".,") for one in NUMBER.findall(text)]
    return PaperContent(numbers, WORD.findall(text), PurePath(name).suffix == ".pdf")


def _plain(content):
    return PICTURE.sub(" ", content.decode("utf-8", errors="replace"))


def _of_cells(content):
    return _plain(content).replace(",", "\n")


def _of_pdf(content):
    import pypdf

    pages = [page.extract_text() for page in pypdf.PdfReader(io.BytesIO(content)).pages]
    return re.sub(r"-\n(?=[^\W\d_])", "", "\n".join(pages))


def _of_workbook(content):
    import openpyxl

    book = openpyxl.load_workbook(io.BytesIO(content), read_only=True)
    cells = (
        cell
        for sheet in book.worksheets
        for row in sheet.iter_rows(values_only=True)
        for cell in row
        if cell is not None
    )
    return "\n".join(map(str, cells))


def _of_page(content):
    reader = _Text()
    reader.feed(_plain(content))
    reader.close()
    return "\n".join(reader.parts)


class _Text(HTMLParser):
    """The texts of a page, those of its scripts too, without its drawings."""

    def __init__(self):
        super().__init__()
        self.parts, self._depth = [], 0

    def handle_starttag(self, tag, attrs):
        self._depth += tag == "svg"

    def handle_endtag(self, tag):
        self._depth -= tag == "svg"

    def handle_data(self, data):
        if not self._depth:
            self.parts.append(data)


_READERS = {".csv": _of_cells, ".pdf": _of_pdf, ".xlsx": _of_workbook, ".html": _of_page}
