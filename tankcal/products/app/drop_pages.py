"""Pages of a dropped file that belongs to no job: record, certificate, former table."""

import asyncio
import hashlib
import shutil
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from starlette.exceptions import HTTPException
from starlette.responses import HTMLResponse

from tankcal.errors import InputError
from tankcal.products.app import folders
from tankcal.products.app.guard import REPORT_POLICY
from tankcal.products.app.pages import language_of, read_record, redirect, render, upload_of
from tankcal.products.app.site import MOST_UPLOAD
from tankcal.products.desk.jobs import free_folder
from tankcal.record.manifest import digest_of

MOST_LINES = 200  # findings on the page


async def show_upload(request):
    """Kind and findings of an uploaded file, and the jobs to which it may belong."""
    stored, site = upload_of(request), request.app.state.site
    reader = site.reader(language_of(request))
    kind, content = await asyncio.to_thread(_examine, site, stored, reader)
    jobs = await asyncio.to_thread(site.list_recent)
    comparable = [
        (key, item) for key, item in jobs
        if item.state.record_sha256 and (kind in COMPARABLE or content["record"])
    ]  # fmt: skip
    known = [(key, item) for key, item in jobs if content["sha256"] & set(_digests(item))]
    return render(
        request, "upload", kind=str(kind), name=stored.name, jobs=jobs, comparable=comparable,
        known=known, upload=request.path_params["upload"], **content,
    )  # fmt: skip


COMPARABLE = ("pdf", "table", "record")


def _digests(item):
    """SHA-256 of the record and of the settings or workbook of a `RecentJob`."""
    if item.state.record_sha256:
        yield item.state.record_sha256
    with suppress(OSError):
        yield digest_of(item.source / "job.toml" if item.source.is_dir() else item.source)


def _examine(site, stored, reader):
    """Kind of a file, and the content of its page."""
    from tankcal.products.desk.proposals import Kind, kind_of

    content = {"lines": [], "summaries": [], "record": "", "sha256": set()}
    files = folders.list_folder(stored.path, MOST_UPLOAD)
    if folders.find_job_file(files) or folders.find_results(files) is not None:
        return _examine_folder(site, stored, files, reader, content)
    data = stored.path.read_bytes()
    kind = kind_of(data)
    if kind is Kind.RECORD:
        content["sha256"] = {hashlib.sha256(data).hexdigest()}
    if kind not in (Kind.PDF, Kind.TABLE):
        return kind, content
    with TemporaryDirectory() as folder:
        path = _copy_with_name(stored, folder, kind)
        if kind is Kind.PDF:
            record = read_embedded_record(path)
            if record is not None:
                _keep_record(site, record, content)
        examine = _assess if content["record"] else _lint
        try:
            content |= examine(path, reader)
        except InputError as error:
            if kind is Kind.PDF:  # any table of measurements fails as a capacity table
                content["lines"] = [reader.say(text) for text in error.texts]
    return kind, content


def _keep_record(site, record, content):
    """Add a record (bytes) to the content of the page."""
    key, stored = site.new_upload("record.json")
    stored.path.write_bytes(record)
    content["record"] = key
    content["sha256"].add(hashlib.sha256(record).hexdigest())


def _examine_folder(site, stored, files, reader, content):
    """Kind of a sent folder, and the content of its page: record and findings of its results."""
    job_file, results = folders.find_job_file(files), folders.find_results(files)
    if job_file:
        data = folders.read_member(stored.path, files[job_file])
        content["sha256"].add(hashlib.sha256(data).hexdigest())
    if results is not None:
        with TemporaryDirectory() as folder:
            for name in (folders.RECORD, folders.CERTIFICATE):
                if results + name in files:
                    data = folders.read_member(stored.path, files[results + name])
                    (Path(folder) / name).write_bytes(data)
            _keep_record(site, (Path(folder) / folders.RECORD).read_bytes(), content)
            try:
                content |= _assess(folder, reader)
            except InputError as error:
                content["lines"] = [reader.say(text) for text in error.texts]
    return "job_folder" if job_file else "folder", content


async def open_sent_job(request):
    """Copy an uploaded job, a workbook or a folder, to the workspace, and open it."""
    stored, site = upload_of(request), request.app.state.site
    files = folders.list_folder(stored.path, MOST_UPLOAD)
    if folders.find_job_file(files):
        folder = await asyncio.to_thread(
            folders.copy_sent_job, stored.path, files, site.workspace, stored.name
        )
    else:
        folder = free_folder(site.workspace, Path(stored.name).stem)
        folder.mkdir(parents=True)
        (folder / "job.xlsx").write_bytes(stored.path.read_bytes())
    return redirect(request, f"/job/{site.add(folder)}/")


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
