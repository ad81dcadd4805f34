"""Reproduction of documents and numbers by `tankcal verify`.

Words and numbers of a paper, for comparisons between versions of tankcal and of packages.

The bytes of a paper depend on the packages that wrote it. Its numbers depend on the record. Its
words depend on the record and on the version of tankcal.
"""

import html
import io
import re
import tempfile
import warnings
import zipfile
from collections import Counter
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path, PurePath

from tankcal.errors import InputError, TankcalError
from tankcal.job.tables import COVARIANCE_FILE
from tankcal.messages import message
from tankcal.record import long_tables
from tankcal.record import manifest as manifests
from tankcal.report.laboratory import (
    CMC,
    LETTERHEAD_FILE,
    PLACE,
    Capability,
    Letterhead,
    Logo,
    read_saved,
)
from tankcal.report.verified_files import compare_inputs
from tankcal.text.shipped import LANGUAGES

MOST_TOLD = 10  # largest number of reported numbers, and of texts, that differ


def letterhead_of(folder):
    """Return the Letterhead in a folder of results, or None.

    An invalid file raises InputError.
    """
    path = Path(folder) / LETTERHEAD_FILE
    if not path.is_file():
        return None
    data = read_saved(path)
    logo, mark = (part if part in (None, PLACE) else Logo(**part)
                  for part in (data["logo"], data["mark"]))  # fmt: skip
    cmc = tuple(
        Capability(**{**capability, "tanks": tuple(capability["tanks"])})
        for capability in data.get(CMC, ())
    )
    return Letterhead(data["name"], tuple(data["address"]), logo, data["colours"], mark, cmc)


def make_papers_again(verification, folder, manifest, rebuild, versions=None):
    """Write the papers again and report the files that differ.

    SHA256SUMS states which versions of programs and packages wrote the papers. If these are the
    present versions, every byte is compared. Otherwise the words and numbers are compared. Since
    SHA256SUMS is not signed, a contradiction to the saved file is reported.

    Parameters
    ----------
    verification : Verification
        Receives the discrepancies.
    folder : path
        Folder of results.
    manifest : Manifest or None
        Content of SHA256SUMS.
    rebuild : callable
        rebuild(folder to write, language, letterhead) writes the papers from the saved file.
    versions : dict, optional
        {"tankcal", "python", "numpy", "scipy": version} that computed the saved file.
    """
    made_by = manifest.made_by if manifest else ""
    _refuse_contradiction(verification, made_by, versions)
    has_same_versions = made_by == manifests.describe_maker()
    with tempfile.TemporaryDirectory(prefix="tankcal-") as temporary:
        new_folder = Path(temporary) / "again"
        language = manifest.language if manifest else language_of_page(folder)
        try:
            rebuild(new_folder, language, letterhead_of(folder))
        except InputError as error:
            verification.problems += error.problems
            return
        except TankcalError as error:
            verification.tell(
                manifests.FILE,
                message(
                    "verify_papers_refused",
                    "the papers cannot be made again: {why}",
                    why="; ".join(map(str, error.texts)),
                ),
            )
            return
        verification.papers_again = True
        if not has_same_versions:
            _note_other_maker(verification, made_by)
        names = sorted({*manifests.files_below(folder), *manifests.files_below(new_folder)})
        for name in names:
            if name in (COVARIANCE_FILE, long_tables.FILE, verification.saved_file):
                continue  # copies cannot be reproduced
            if not (new_folder / name).is_file() or not (Path(folder) / name).is_file():
                continue  # the manifest reports missing and extra files
            verification.add_compared(name)
            verification.made_again.add(name)
            if verification.is_told(name) or _same(new_folder / name, Path(folder) / name):
                continue
            if has_same_versions:
                verification.tell(
                    name,
                    message(
                        "verify_other_paper",
                        "is not what {file} gives; expected every byte as tankcal makes it again",
                        file=verification.saved_file,
                    ),
                )
            else:
                _compare_content(
                    verification, name, Path(folder) / name, new_folder / name, made_by
                )


def language_of_page(folder):
    """Return the language of the web page in a folder of results, or None."""
    path = Path(folder) / "report.html"
    text = path.read_bytes()[:1000].decode("utf-8", "replace") if path.is_file() else ""
    match = re.search(r'<html lang="([\w-]+)"', text)
    return match[1] if match and match[1] in LANGUAGES else None


def _refuse_contradiction(verification, made_by, versions):
    """Report papers that claim to be older than their record."""
    paper_version = versions_in(made_by).get("tankcal")
    if versions and paper_version and _order(paper_version) < _order(versions["tankcal"]):
        verification.tell(
            manifests.FILE,
            message(
                "verify_older_papers",
                "names tankcal {said} as what made the papers; {file} is of tankcal {version}, "
                "and papers cannot be older than it",
                said=paper_version,
                version=versions["tankcal"],
                file=verification.saved_file,
            ),
        )


def _order(version):
    """Return the numbers of a version for comparisons, without suffixes of development."""
    return tuple(map(int, re.findall(r"\d+", version.partition("+")[0].partition(".dev")[0])))


def versions_in(made_by):
    """Return {name: version} of the line with the versions that wrote the files."""
    parts = (part.split(" ", 1) for part in made_by.split(", ") if " " in part)
    return {name: version for name, version in parts}


def _note_other_maker(verification, made_by):
    if not made_by:
        verification.note(
            message(
                "verify_maker_unknown",
                "no SHA256SUMS says what made the papers: their words and numbers were compared, "
                "their pictures not",
            )
        )
        return
    verification.note(
        message(
            "verify_other_maker",
            "the papers were made by other versions ({made_by}; here {here}): their words and "
            "numbers were compared, their pictures not",
            made_by=only_in(made_by, manifests.describe_maker()),
            here=only_in(manifests.describe_maker(), made_by),
        )
    )


def _compare_content(verification, name, path, new_path, made_by):
    """Compare words and numbers of a paper with the paper written again."""
    present_versions = versions_in(manifests.describe_maker())
    paper_versions = versions_in(made_by)
    same_version = (
        paper_versions.get("tankcal", present_versions["tankcal"]) == present_versions["tankcal"]
    )
    ignored = {*present_versions.values(), *paper_versions.values()} - {"-"}
    try:
        former, present = (
            content_of_paper(name, file.read_bytes(), ignored) for file in (path, new_path)
        )
    except ValueError:
        verification.tell(
            name, message("verify_unreadable", "cannot be read; expected a file of tankcal")
        )
        return
    elements = former.elements - present.elements
    if elements:
        verification.tell(
            name,
            message(
                "verify_other_elements",
                "holds {elements}, which tankcal {version} does not write; they can cover or "
                "replace its text",
                elements=", ".join(sorted(elements))[:80],
                version=present_versions["tankcal"],
            ),
        )
        return
    differences = former.missing_in(present, same_version=same_version)
    if not differences and same_version:
        differences = present.missing_in(former, same_version=True)
    if differences:
        verification.tell(
            name,
            message(
                "verify_other_words",
                "differs from what tankcal {version} makes of {file}, in {count} words or numbers; "
                "the first: {first!r}",
                version=present_versions["tankcal"],
                file=verification.saved_file,
                count=len(differences),
                first=differences[0][:40],
            ),
        )
    elif not same_version:
        verification.by_numbers.append(name)


def only_in(first, second):
    """Return the items of the first comma-separated list that the second lacks; "-" if none."""
    second_items = second.split(", ")
    return ", ".join(part for part in first.split(", ") if part not in second_items) or "-"


def _same(first, second):
    return (
        first.stat().st_size == second.stat().st_size and first.read_bytes() == second.read_bytes()
    )


def compute_numbers_again(verification, record, job, *, folder=None, step=None, part=None):
    """Compute the job of a record again and report differences.

    Parameters
    ----------
    verification : Verification
        Receives the discrepancies.
    record : dict
        Record of the job.
    job : path
        Folder of the input files, which agree with the record.
    folder : path, optional
        Folder of results, whose covariance file is compared.
    step, part : callable, optional
        Progress, as in `compute_again`.
    """
    from tankcal.record.recomputation import compute_again

    try:
        recomputation, adjustment = compute_again(record, job, step, part)
    except TankcalError as error:
        verification.tell(
            verification.saved_file,
            message(
                "verify_not_computed",
                "its job cannot be computed again by this version: {why}",
                why="; ".join(map(str, error.texts)),
            ),
        )
        return
    verification.recomputed = recomputation
    for number in recomputation.beyond[:MOST_TOLD]:
        verification.tell(
            verification.saved_file,
            message(
                "verify_number_apart",
                "{place} is {recorded}, computed again {computed}: {relative} of the largest "
                "number there, expected at most {tolerance}",
                place=number.place,
                recorded=f"{number.recorded:.10g}",
                computed=f"{number.computed:.10g}",
                relative=f"{number.relative:.1e}",
                tolerance=f"{number.tolerance:.0e}",
            ),
        )
    for place, recorded, computed in recomputation.otherwise[:MOST_TOLD]:
        verification.tell(
            verification.saved_file,
            message(
                "verify_text_apart",
                "{place} is {recorded!r}, computed again {computed!r}; expected the same",
                place=place,
                recorded=recorded[:100],
                computed=computed[:100],
            ),
        )
    more = len(recomputation.beyond[MOST_TOLD:]) + len(recomputation.otherwise[MOST_TOLD:])
    if more:
        verification.tell(
            verification.saved_file,
            message("verify_more_apart", "{count} further keys came out otherwise", count=more),
        )
    if folder is not None:
        _compare_covariance(verification, Path(folder) / COVARIANCE_FILE, adjustment)


def _compare_covariance(verification, path, adjustment):
    """Compare points_cov.npz, which the record does not contain, with the new covariance."""
    if adjustment is None or not path.is_file() or verification.is_told(path.name):
        return
    import numpy as np

    from tankcal.record.recomputation import TOLERANCE
    from tankcal.report.outputs import write_covariance

    with tempfile.TemporaryDirectory(prefix="tankcal-") as place:
        write_covariance(adjustment, Path(place))
        again = Path(place) / path.name
        if not again.is_file():
            return
        verification.add_compared(path.name)
        verification.made_again.add(path.name)
        if _same(again, path):
            return
        try:
            with np.load(path, allow_pickle=False) as former_file, np.load(again) as present_file:
                former, present = former_file["covariance_m2"], present_file["covariance_m2"]
                agrees = former.shape == present.shape and list(former_file["points"]) == list(
                    present_file["points"]
                )
                largest = float(np.abs(former).max(initial=0.0))
                agrees = (
                    agrees
                    and float(np.abs(former - present).max(initial=0.0)) <= TOLERANCE * largest
                )
        except Exception:  # a broken archive can raise any exception
            agrees = False
    if not agrees:
        verification.tell(
            path.name,
            message(
                "verify_covariance_apart",
                "does not hold the covariance that comes out when the survey is adjusted again",
            ),
        )


def verify_saved_folder(verification, folder, callbacks, manifest, inputs):
    """Verify a folder with a saved file other than a record; return whether it is such a folder.

    Comparisons, inspections, histories, tickets and gauges are written again from their saved file.
    Tickets and gauges are also computed again from their inputs. For plans, camera results and any
    other folder with SHA256SUMS, only the hashes are compared.

    Parameters
    ----------
    verification : Verification
        Receives the discrepancies.
    folder : path
        Folder to verify.
    callbacks : tuple or None
        Progress (step, part); None: compare hashes only.
    manifest : Manifest or None
        Content of SHA256SUMS.
    inputs : path
        Folder of the input files, with the record of a ticket.

    Returns
    -------
    bool
    """
    from tankcal.record.plan import PLAN
    from tankcal.record.versions import CAMERA
    from tankcal.report.saved_documents import find_document

    document, path = find_document(folder)
    if document is not None:
        content = document.load(path)
        _take(verification, path)
        if callbacks is not None:
            make_papers_again(
                verification, folder, manifest, _rebuild_of(document, path, callbacks[0])
            )
        if not document.recomputed_by:
            verification.note(_not_computed(path.name))
        elif callbacks is not None:
            _compute_document_again(verification, document, content, inputs)
        return True
    for name in (CAMERA.file, PLAN.file):
        path = Path(folder) / name
        if path.is_file():
            _take(verification, path)
            verification.note(_not_computed(name))
            return True
    if manifest is not None:
        verification.saved_file = manifests.FILE
        verification.note(
            message("verify_no_saved_file", "nothing here but hashes: no file says what is inside")
        )
    return manifest is not None


def _compute_document_again(verification, document, content, inputs):
    """Compute a saved file again from its record; report differences and changed input files."""
    compare_inputs(verification, content, inputs)
    try:
        count, problems, notes = document.compute_again(content, inputs)
    except InputError as error:
        verification.problems += error.problems
        return
    verification.problems += problems
    verification.notes += notes
    if count is not None and not problems:
        verification.made_again.add(verification.saved_file)
        verification.note(
            message("verify_values_again", "computed again: {count} values, all equal", count=count)
        )


def _rebuild_of(document, path, step):
    def rebuild(place, language, letterhead):
        document.rebuild(path, place, language, step, letterhead)

    return rebuild


def _take(verification, path):
    """Register the saved file from which all other files of the folder are derived."""
    verification.saved_file = path.name
    verification.digest = manifests.digest_of(path)
    verification.compared.append(path.name)


def _not_computed(name):
    return message(
        "verify_not_from_inputs",
        "{file} does not say where what it was computed from lies: its numbers were not computed "
        "again",
        file=name,
    )


# ---- content of a document

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
