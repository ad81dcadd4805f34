"""Pages of a dropped file that belongs to no job: record, certificate, former table."""

import asyncio
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from starlette.exceptions import HTTPException
from starlette.responses import HTMLResponse

from tankcal.errors import InputError
from tankcal.products.app.guard import REPORT_POLICY
from tankcal.products.app.pages import language_of, read_record, render, upload_of

MOST_LINES = 200  # findings on the page


async def show_upload(request):
    """Kind and findings of an uploaded file, and the jobs to which it may belong."""
    stored, site = upload_of(request), request.app.state.site
    reader = site.reader(language_of(request))
    kind, content = await asyncio.to_thread(_examine, site, stored, reader)
    jobs = await asyncio.to_thread(site.list_recent)
    comparable = [
        (key, item) for key, item in jobs if item.state.record_sha256 and kind in COMPARABLE
    ]
    return render(
        request, "upload", kind=str(kind), name=stored.name, jobs=jobs, comparable=comparable,
        upload=request.path_params["upload"], **content,
    )  # fmt: skip


COMPARABLE = ("pdf", "table", "record")


def _examine(site, stored, reader):
    """Kind of a file, and the content of its page."""
    from tankcal.products.desk.proposals import Kind, kind_of

    data, content = stored.path.read_bytes(), {"lines": [], "summaries": [], "record": ""}
    kind = kind_of(data)
    if kind not in (Kind.PDF, Kind.TABLE):
        return kind, content
    with TemporaryDirectory() as folder:
        path = _copy_with_name(stored, folder, kind)
        if kind is Kind.PDF:
            record = read_embedded_record(path)
            if record is not None:
                key, embedded = site.new_upload("record.json")
                embedded.path.write_bytes(record)
                content["record"] = key
        examine = _assess if content["record"] else _lint
        try:
            content |= examine(path, reader)
        except InputError as error:
            if kind is Kind.PDF:  # any table of measurements fails as a capacity table
                content["lines"] = [reader.say(text) for text in error.texts]
    return kind, content


def _copy_with_name(stored, folder, kind=""):
    """Copy of a file with the name of the user, because readers use its ending."""
    name = stored.name
    if kind == "pdf" and not name.lower().endswith(".pdf"):
        name += ".pdf"
    return Path(shutil.copy(stored.path, Path(folder) / name))


def read_embedded_record(path):
    """record.json inside a PDF (bytes); None without it, or if the PDF cannot be read."""
    import logging

    import pypdf

    logging.getLogger("pypdf").setLevel(logging.CRITICAL)
    try:
        attachments = pypdf.PdfReader(path).attachments
        return bytes(attachments["record.json"][-1]) if "record.json" in attachments else None
    except Exception:  # a broken file can raise any exception
        return None


def _assess(path, reader):
    """Findings of an assessor about a certificate of tankcal."""
    from tankcal.products.assess.assessing import assess, plain_assessment
    from tankcal.products.assess.paper import AssessmentPaper

    paper = AssessmentPaper(plain_assessment(assess(path)), reader.language)
    return {"lines": paper.lines()[:MOST_LINES], "summaries": [paper.verdict()]}


def _lint(path, reader):
    """Findings about the capacity table of a file."""
    from tankcal.products.linter.linting import lint

    report = lint(path)
    return {
        "lines": [reader.say(finding.text) for finding in report.findings[:MOST_LINES]],
        "summaries": [reader.say(summary) for summary in report.summaries],
    }


async def view_record(request):
    """Page of an uploaded record, without a job."""
    stored, language = upload_of(request), language_of(request)

    def make():
        from tankcal.products.desk.result_pages import whole_page

        with TemporaryDirectory() as folder:  # the reader knows a record by its name
            path = shutil.copy(stored.path, Path(folder) / "record.json")
            return whole_page(read_record(path, language))

    html = await asyncio.to_thread(make)
    return HTMLResponse(html, headers={"Content-Security-Policy": REPORT_POLICY})


async def compare_upload(request):
    """Comparison of an uploaded table with the results of a job."""
    stored, site, language = upload_of(request), request.app.state.site, language_of(request)
    job = site.job(request.path_params["key"], language)
    if job is None or not (job.out / "record.json").is_file():
        raise HTTPException(404)

    def make():
        from tankcal.products.desk.proposals import kind_of
        from tankcal.products.recalibration.comparison import Asked, compare_files
        from tankcal.record.schema import to_plain
        from tankcal.report.comparison import write_comparison

        with TemporaryDirectory() as folder:
            kind = kind_of(stored.path.read_bytes())
            old = _copy_with_name(stored, folder, kind)
            if kind == "record":
                old = old.rename(old.with_name("record.json"))
            comparison = to_plain(compare_files(Asked(old, job.out)))
            out = Path(folder) / "comparison"
            written = write_comparison(comparison, out, language, lambda *step: None)
            page = next(path for path in map(Path, written) if path.suffix == ".html")
            return (out / page.name).read_text(encoding="utf-8")

    html = await asyncio.to_thread(make)
    return HTMLResponse(html, headers={"Content-Security-Policy": REPORT_POLICY})
