"""Text of a PDF in its layout, extracted with pypdf in a child process.

PDF libraries may hang or exhaust the memory. The child process limits the damage.
"""

import contextlib
import json
import subprocess
import sys

from tankcal.messages import message

MOST_PAGES = 300
MOST_CONTENT = 2_500_000  # largest size of the page content, bytes; layout takes some ten seconds
MOST_SECONDS = 15  # processor time of the child; a table of 200 pages takes about 6
LONGEST_WAIT_S = 120  # by the clock, on a busy machine
ENDED_BY_CPU_LIMIT = -24  # exit status: SIGXCPU
MEMORY_LIMIT = 2 << 30  # address space of the child, bytes
PAGES, ENCRYPTED, MANY_PAGES, LONG_TEXT = "pages", "encrypted", "many", "long"
DAMAGED, SLOW = "damaged", "slow"
_CODE = (
    "import json, sys; request = json.loads(sys.argv[1]); sys.path[:] = request['sys_path']; "
    "from tankcal.products.linter.pdf_text import main; main(request)"
)


def read_pages(path, log):
    """Return the text of each page in its layout.

    None after reporting to `log` why there is none.
    """
    kind, answer = _ask_child(path)
    if kind == PAGES and any(page.strip() for page in answer):
        return tuple(answer)
    log.problem(path.name, _refusal(kind, answer))
    return None


def _refusal(kind, answer):
    """Message that a PDF has no readable text."""
    if kind == PAGES:
        return message(
            "lint_scanned_pdf",
            "no text in it: is it a scan? expected a PDF whose text can be selected, or the table "
            "typed as CSV or workbook",
        )
    if kind == ENCRYPTED:
        return message("lint_encrypted_pdf", "a PDF with a password; expected one without")
    if kind == MANY_PAGES:
        return message(
            "lint_long_pdf",
            "{count} pages; expected at most {most}: only those of the table",
            count=answer,
            most=MOST_PAGES,
        )
    if kind == LONG_TEXT:
        return message(
            "lint_much_text",
            "more than {most:.1f} MB of text and drawings on its pages; expected only the pages of "
            "the table",
            most=MOST_CONTENT / 1e6,
        )
    if kind == SLOW:
        return message(
            "lint_slow_pdf",
            "not read within {most} seconds; expected only the pages of the table",
            most=MOST_SECONDS,
        )
    return message("lint_damaged_pdf", "not a PDF that can be read, or damaged")


def _ask_child(path):
    """Return the answer of a child process: (kind, pages or message)."""
    request = {"path": str(path.resolve()), "sys_path": sys.path, "seconds": MOST_SECONDS}
    try:
        done = subprocess.run(
            [sys.executable, "-c", _CODE, json.dumps(request)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=LONGEST_WAIT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return SLOW, None
    except OSError:
        return DAMAGED, None
    if done.returncode == ENDED_BY_CPU_LIMIT:
        return SLOW, None
    try:
        kind, answer = json.loads(done.stdout)
    except ValueError:
        return DAMAGED, None
    return kind, answer


def main(request):
    """Print [kind, answer] for the PDF of a request, as JSON."""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
        limit = request["seconds"]
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
    try:
        answer = _answer(request["path"])
    except Exception as error:
        answer = [DAMAGED, type(error).__name__]
    sys.stdout.write(json.dumps(answer))


def _answer(path):
    """Answer of the child process: kind, and the text of the pages or None."""
    import pypdf

    reader = pypdf.PdfReader(path)
    if reader.is_encrypted and not reader.decrypt(""):
        return [ENCRYPTED, None]
    if len(reader.pages) > MOST_PAGES:
        return [MANY_PAGES, len(reader.pages)]
    if not _is_short(reader.pages):
        return [LONG_TEXT, None]
    return [PAGES, [page.extract_text(extraction_mode="layout") for page in reader.pages]]


def _is_short(pages):
    """Whether the page content is at most MOST_CONTENT; counting is fast, the layout is slow."""
    size = 0
    for page in pages:
        content = page.get_contents()
        size += len(content.get_data()) if content is not None else 0
        if size > MOST_CONTENT:
            return False
    return True
