"""Words and numbers of a paper, for comparisons between versions of tankcal and of packages.

The bytes of a paper depend on the packages that wrote it. Its numbers depend on the record. Its
words depend on the record and on the version of tankcal.
"""

import html
import io
import re
import warnings
import zipfile
from collections import Counter
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import PurePath

NUMBER = re.compile(r"(?<![\w.,])\d[\d.,]*")
WORD = re.compile(r"[^\W\d_]{2,}")
PICTURE = re.compile(r"[A-Za-z0-9+/=\\n]{200,}")  # base64
# Parts of a page that show something other than its text.
_SHOWING_TAGS = frozenset(("applet", "base", "embed", "frame", "iframe", "link", "object"))
_SHOWING_PART = re.compile(
    r"xl/(?:comments|threadedComments|externalLinks|embeddings|activeX|vba).*"
)
_TEXT_OF_STYLE = re.compile(r"content\s*:\s*([\"'][^\"']*\w[^\"']*[\"'])")
_FORMAT_OF_CELLS = re.compile(r'formatCode="([^"]*)"')
_PRINTED_DIGITS = re.compile(r'"[^"]*\d[^"]*"|\\\d')  # digits that a cell shows for any number
DIGITS = 5  # numbers with at least so many digits do not agree by chance


@dataclass(frozen=True)
class PaperContent:
    """Numbers and words of a paper in their printed order and form.

    Attributes
    ----------
    numbers, words : list of str
    is_paged : bool
        Whether line and page breaks can change the order.
    elements : frozenset of str
        Parts that can cover or replace the text on the screen, such as annotations and scripts.
    """

    numbers: list[str]
    words: list[str]
    is_paged: bool
    elements: frozenset[str] = frozenset()

    def missing_in(self, other, *, same_version):
        """Return the words and numbers of this paper that `other` lacks (list of str).

        Parameters
        ----------
        other : PaperContent
            Content of the other paper.
        same_version : bool
            Whether one version of tankcal wrote both papers. If so, all words and numbers must
            agree. Otherwise only numbers with many digits are compared.
        """
        if not same_version:
            known = set(other.numbers)
            return sorted({number for number in self.numbers if _is_long(number)} - known)
        if self.is_paged:  # line and page breaks may differ, which changes the order and hyphens
            numbers = Counter(filter(_is_long, self.numbers)) - Counter(other.numbers)
            return [*numbers, *sorted(set(self.words) - set(other.words))]
        pairs = ((self.numbers, other.numbers), (self.words, other.words))
        return [text for texts, others in pairs for text in _first_apart(texts, others)]


def _first_apart(texts, others):
    """Return the first of `texts` that differs from its counterpart, as a list of at most one."""
    for text, other in zip(texts, others, strict=False):
        if text != other:
            return [text]
    return texts[len(others) :][:1]


def _is_long(number):
    return sum(character.isdigit() for character in number) >= DIGITS


def content_of_paper(name, content, ignored=()):
    """Return the `PaperContent` of a file.

    Parameters
    ----------
    name : str
        Name of the file; its suffix determines the format.
    content : bytes
        Content of the file.
    ignored : collection of str, optional
        Words and numbers to omit, such as versions of packages.

    Returns
    -------
    PaperContent

    Raises
    ------
    ValueError
        If the file cannot be read.

    Examples
    --------
    >>> content_of_paper("a.csv", b"height_m,volume_m3\\n1.00,132.47\\n").numbers
    ['1.00', '132.47']
    """
    suffix = PurePath(name).suffix
    read = _READERS.get(suffix, _plain)
    try:
        text = read(content)
        elements = frozenset(_ELEMENTS[suffix](content)) if suffix in _ELEMENTS else frozenset()
    except Exception as error:  # a broken file can raise any exception
        raise ValueError(f"{name}: {type(error).__name__}") from error
    for word in sorted(ignored, key=len, reverse=True):
        text = text.replace(word, " ")
    numbers = [number.rstrip(".,") for number in NUMBER.findall(text)]
    return PaperContent(numbers, WORD.findall(text), suffix == ".pdf", elements)


def _plain(content):
    return PICTURE.sub(" ", content.decode("utf-8", errors="replace"))


def _read_csv(content):
    return _plain(content).replace(",", "\n")


def _read_pdf(content):
    import pypdf

    pages = [page.extract_text() for page in pypdf.PdfReader(io.BytesIO(content)).pages]
    # Join words that the typesetter hyphenated.
    return re.sub(r"-\n(?=[^\W\d_])", "", "\n".join(pages))


def _read_workbook(content):
    import openpyxl

    with warnings.catch_warnings():  # charts and formats are not read
        warnings.simplefilter("ignore")
        book = openpyxl.load_workbook(io.BytesIO(content), read_only=True)
        return _texts_of_cells(book)


def _texts_of_cells(book):
    cells = (
        cell
        for sheet in book.worksheets
        for row in sheet.iter_rows(values_only=True)
        for cell in row
        if cell is not None
    )
    return "\n".join(map(str, cells))


def _read_page(content):
    reader = _Text()
    reader.feed(_plain(content))
    reader.close()
    return "\n".join(reader.parts)


class _Text(HTMLParser):
    """Parser for the texts of a page and of its scripts, without drawings."""

    def __init__(self):
        super().__init__()
        self.parts, self.elements, self._depth = [], set(), 0

    def handle_starttag(self, tag, attrs):
        self._depth += tag == "svg"
        names = {name for name, _ in attrs}
        if tag in _SHOWING_TAGS or (tag == "meta" and "http-equiv" in names):
            self.elements.add(f"<{tag}>")
        self.elements.update(name for name in names if name.startswith("on"))

    def handle_endtag(self, tag):
        self._depth -= tag == "svg"

    def handle_data(self, data):
        if not self._depth:
            self.parts.append(data)


def _elements_of_page(content):
    text = _plain(content)
    reader = _Text()
    reader.feed(text)
    reader.close()
    return reader.elements | set(_TEXT_OF_STYLE.findall(text))


def _elements_of_pdf(content):
    import pypdf

    reader = pypdf.PdfReader(io.BytesIO(content))
    root = reader.trailer["/Root"]
    yield from (key for key in ("/OpenAction", "/AA") if key in root)
    yield from (key for key in ("/JavaScript",) if key in root.get("/Names", {}))
    for page in reader.pages:
        for annotation in page.get("/Annots") or ():
            kind = annotation.get_object().get("/Subtype", "")
            if kind not in ("/Link", "/Widget"):
                yield kind


def _elements_of_workbook(content):
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        yield from filter(_SHOWING_PART.fullmatch, archive.namelist())
        styles = archive.read("xl/styles.xml").decode("utf-8", "replace")
    for code in map(html.unescape, _FORMAT_OF_CELLS.findall(styles)):
        yield from _PRINTED_DIGITS.findall(code)


_READERS = {".csv": _read_csv, ".pdf": _read_pdf, ".xlsx": _read_workbook, ".html": _read_page}
_ELEMENTS = {
    ".pdf": _elements_of_pdf, ".xlsx": _elements_of_workbook, ".html": _elements_of_page
}  # fmt: skip
