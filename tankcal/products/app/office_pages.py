"""Pages beside the jobs: register of certificates, chart from a drawing, log in and out."""

import asyncio
import hashlib
import shutil
from contextlib import suppress
from datetime import date
from pathlib import Path
from tempfile import TemporaryDirectory

from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, HTMLResponse, Response

from tankcal.errors import InputError
from tankcal.products.app import folders
from tankcal.products.app.guard import REPORT_POLICY
from tankcal.products.app.pages import (
    language_of,
    person_of,
    read_form,
    read_record,
    redirect,
    render,
    upload_of,
)
from tankcal.products.app.people import APPROVE
from tankcal.products.app.site import MOST_UPLOAD
from tankcal.products.desk.jobs import free_folder
from tankcal.record.manifest import digest_of

_checks = asyncio.Semaphore(2)  # passwords that are checked at a time, 32 MB each


# ---- register


async def show_register(request):
    """Certificates issued, replaced and withdrawn."""
    site = request.app.state.site
    try:
        certificates, problems = list(site.read_register().values()), []
    except InputError as error:
        say = site.reader(language_of(request)).say
        certificates, problems = [], [say(text) for text in error.texts]
    return render(
        request, "register", certificates=certificates, problems=problems, path=site.register,
        may_withdraw=person_of(request).may(APPROVE),
    )  # fmt: skip


async def send_register(request):
    """Send the register as a file."""
    path = request.app.state.site.register
    if not path.is_file():
        raise HTTPException(404)
    return FileResponse(path, filename=path.name, media_type="text/csv; charset=utf-8")


async def withdraw_certificate(request):
    """Register a certificate as withdrawn."""
    from tankcal.products.register.certificates import withdraw

    form, site = await read_form(request), request.app.state.site
    reason = " ".join(form.get("reason", "").split())
    if not reason or form.get("number", "") not in site.read_register():
        raise HTTPException(400)
    await asyncio.to_thread(
        withdraw, site.register, form["number"], reason, date.today().isoformat()
    )
    return redirect(request, "/register")


# ---- chart from a drawing


async def show_chart(request):
    """Form for the sizes of a drawing, with the chart."""
    from tankcal.products.desk import drawing_chart

    texts = dict(request.query_params)
    drawing, problems, facts, rows = None, [], [], []
    if texts:
        drawing, problems = drawing_chart.read_drawing(texts)
    if drawing is not None:
        facts, rows = await asyncio.to_thread(
            drawing_chart.describe_chart, drawing, language_of(request)
        )
    return render(
        request, "chart", texts=texts, problems=problems, drawing=drawing, facts=facts, rows=rows,
        kinds=drawing_chart.KINDS, ends=drawing_chart.ENDS, steps=drawing_chart.STEPS_CM,
        query=request.url.query, limits=drawing_chart.LIMITS,
    )  # fmt: skip


async def draw_chart(request):
    """PDF of the chart."""
    from tankcal.products.desk import drawing_chart

    texts = dict(request.query_params)
    drawing, _ = drawing_chart.read_drawing(texts)
    if drawing is None:
        raise HTTPException(400)
    tank = texts.get("tank", "")[:64]
    content = await asyncio.to_thread(
        drawing_chart.write_drawing_chart, drawing, tank, language_of(request), date.today()
    )
    headers = {"Content-Disposition": 'attachment; filename="chart.pdf"'}
    return Response(content, media_type="application/pdf", headers=headers)


async def create_from_chart(request):
    """Create a job with the sizes of the drawing, for a survey later."""
    from tankcal.products.desk import drawing_chart
    from tankcal.products.desk.draft import Draft
    from tankcal.products.desk.jobs import create_job

    texts, site = await read_form(request), request.app.state.site
    drawing, _ = drawing_chart.read_drawing(texts)
    if drawing is None:
        raise HTTPException(400)
    tank = texts.get("tank", "")[:64]
    folder = create_job(site.workspace, tank, drawing.kind, None, language_of(request))
    draft = Draft(folder)
    for section, key, value in drawing_chart.list_settings(drawing):
        draft.set_value("job", section, key, value)
    draft.save()
    return redirect(request, f"/job/{site.add(folder)}/")


# ---- users


async def show_login(request, status=200, problem=""):
    """Form for name and password."""
    site = request.app.state.site
    if site.people is None:
        raise HTTPException(404)
    back = request.query_params.get("back", "")
    return render(request, "login", status, back=back, problem=problem)


async def start_session(request):
    """Begin a session."""
    site, form = request.app.state.site, await read_form(request)
    request.state.content = None  # a password is noted nowhere
    if site.people is None:
        raise HTTPException(404)
    address = request.client.host if request.client else ""
    name, password = form.get("name", ""), form.get("password", "")
    try:
        async with _checks:
            token = await asyncio.to_thread(site.people.begin, name, password, address)
    except PermissionError:
        return await show_login(request, 429, "login_often")
    if token is None:
        return await show_login(request, 403, "login_wrong")
    back = form.get("back", "")
    base = request.app.state.base
    # Only a path of this app, so that a link cannot lead to another site.
    is_inside = back.startswith(f"{base}/") and not back.startswith(("//", "/\\"))
    answer = redirect(request, back.removeprefix(base) if is_inside else "/")
    answer.set_cookie(request.scope["cookie"], token, httponly=True, samesite="strict", secure=True)
    return answer


async def end_session(request):
    """End the session."""
    people = request.app.state.site.people
    if people is None:
        raise HTTPException(404)
    people.end(request.cookies.get(request.scope["cookie"], ""))
    answer = redirect(request, "/login")
    answer.delete_cookie(request.scope["cookie"])
    return answer


# ---- pages of a dropped file that belongs to no job: record, certificate, former table


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
