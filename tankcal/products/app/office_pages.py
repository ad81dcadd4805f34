"""Pages beside the jobs: reviews, certificates, chart from a drawing, and tanks in service."""

import asyncio
import fnmatch
import hashlib
import json
import os
import shutil
from contextlib import suppress
from datetime import date
from pathlib import Path
from tempfile import TemporaryDirectory

from markupsafe import Markup
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, HTMLResponse, Response

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.app.access import APPROVE, EDIT, REPORT_POLICY, REVIEW
from tankcal.products.app.pages import (
    find_asked_fields,
    job_of,
    language_of,
    list_results,
    person_of,
    read_form,
    read_paper,
    read_record,
    redirect,
    render,
    render_job,
    upload_of,
)
from tankcal.products.app.site import (
    CERTIFICATE,
    MOST_UPLOAD,
    RECORD,
    copy_sent_job,
    find_job_file,
    find_results,
    identifier,
    list_folder,
    read_member,
)
from tankcal.products.desk import jobs
from tankcal.products.desk.jobs import Act, State, free_folder, state_of_results
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
    files = list_folder(stored.path, MOST_UPLOAD)
    if find_job_file(files) or find_results(files) is not None:
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
    job_file, results = find_job_file(files), find_results(files)
    if job_file:
        data = read_member(stored.path, files[job_file])
        content["sha256"].add(hashlib.sha256(data).hexdigest())
    if results is not None:
        with TemporaryDirectory() as folder:
            for name in (RECORD, CERTIFICATE):
                if results + name in files:
                    data = read_member(stored.path, files[results + name])
                    (Path(folder) / name).write_bytes(data)
            _keep_record(site, (Path(folder) / RECORD).read_bytes(), content)
            try:
                content |= _assess(folder, reader)
            except InputError as error:
                content["lines"] = [reader.say(text) for text in error.texts]
    return "job_folder" if job_file else "folder", content


async def open_sent_job(request):
    """Copy an uploaded job, a workbook or a folder, to the workspace, and open it."""
    stored, site = upload_of(request), request.app.state.site
    files = list_folder(stored.path, MOST_UPLOAD)
    if find_job_file(files):
        folder = await asyncio.to_thread(
            copy_sent_job, stored.path, files, site.workspace, stored.name
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


SETTINGS, RESULTS, STATE = "upkeep.toml", "results", "state"
LOGS = {"levels": "levels-*", "meters": "sales-*", "deliveries": "tickets-*"}
NUMBERS = (("liquid", "expansion_per_k"), ("liquid", "base_c"), ("gauge", "resolution_mm"))
_computing = asyncio.Semaphore(1)  # estimates at a time


def list_services(site):
    """Folders of the workspace with a tank in service, {identifier: Path}."""
    places = sorted(site.workspace.glob(f"*/{SETTINGS}"))
    return {identifier(path.parent): path.parent for path in places}


def service_of(request):
    """Folder of the tank in service of a request; 404 without it."""
    folder = list_services(request.app.state.site).get(request.path_params["key"])
    if folder is None:
        raise HTTPException(404)
    return folder


async def show_services(request):
    """List of the tanks in service, and the form of a new one."""
    from tankcal.products.upkeep.logs import list_profiles
    from tankcal.text.words import load_words

    site = request.app.state.site
    jobs = await asyncio.to_thread(site.list_recent)
    computed = [(key, item) for key, item in jobs if item.state.record_sha256]
    return render(
        request, "services", services=list_services(site), jobs=computed, numbers=NUMBERS,
        logs=LOGS, profiles=list_profiles(), notes=load_words(language_of(request))["upkeep"],
    )  # fmt: skip


async def create_service(request):
    """Write upkeep.toml of a new tank in service, and show its page."""
    from tankcal.job.tables import Log
    from tankcal.products.desk.jobs import free_folder
    from tankcal.products.upkeep.reading import SECTIONS, read_sections

    form, site = await read_form(request), request.app.state.site
    name = " ".join(form.get("tank", "").split())[:64]
    job = site.job(form.get("job", ""), language_of(request))
    if not name or job is None:
        raise HTTPException(400)
    folder = free_folder(site.workspace, name)
    record = Path(os.path.relpath(job.out, folder)).as_posix()
    texts = {"upkeep": {"record": record, "timezone": form.get("timezone", "").strip(),
                        "service": form.get("service", "")}}  # fmt: skip
    for section, key in NUMBERS:
        text = form.get(key, "").strip().replace(",", ".")
        try:
            texts.setdefault(section, {})[key] = float(text)
        except ValueError:
            texts[section][key] = text  # the check names it
    for kind, pattern in LOGS.items():
        profile = form.get(f"profile_{kind}", "")
        texts[kind] = {"files": [pattern]} | ({"profile": profile} if profile else {})
    log = Log()
    read_sections(texts, SECTIONS, log, SETTINGS)
    log.stop_if_problems()
    lines = [f"[{section}]\n" + "".join(f"{key} = {json.dumps(value)}\n"
                                        for key, value in values.items())
             for section, values in texts.items()]  # fmt: skip
    folder.mkdir(parents=True)
    (folder / SETTINGS).write_text("\n".join(lines), encoding="utf-8")
    return redirect(request, f"/service/{identifier(folder)}")


async def show_service(request):
    """Logs, estimate, alarms, months and documents of a tank in service."""
    folder, language = service_of(request), language_of(request)
    key = request.query_params.get("upload", "")
    stored = request.app.state.site.upload(key)
    received = (
        [] if stored is None else await asyncio.to_thread(_examine_service_page, folder, stored)
    )
    blocks, documents = await asyncio.to_thread(_show_results, folder, language)
    return render(
        request, "service", tank=folder.name, service=request.path_params["key"], blocks=blocks,
        documents=documents, received=received, upload=key if received else "",
        is_usable=any(state == "new" for _, _, state in received),
        patterns=[pattern for _, pattern in _list_patterns(folder)],
    )  # fmt: skip


def _list_patterns(folder):
    """(log, pattern of its files) of upkeep.toml."""
    from tankcal.job.tables import Log
    from tankcal.products.upkeep.reading import SECTIONS, read_sections

    sections, _, _ = read_sections(folder / SETTINGS, SECTIONS, Log())
    return [(kind, pattern) for kind in (*LOGS, "events", "air")
            for pattern in sections[kind]["files"] or ()]  # fmt: skip


def _examine_service_page(folder, stored):
    """(name, log, state) of each sent file; the state is new, known, other or no_log."""
    patterns, result = _list_patterns(folder), []
    for name, content in _list_sent(stored):
        kind = next((kind for kind, pattern in patterns if fnmatch.fnmatch(name, pattern)), "")
        path, state = folder / name, "new" if kind else "no_log"
        if kind and path.is_file():
            state = "known" if path.read_bytes() == content else "other"
        result.append((name, kind, state))
    return result


def _list_sent(stored):
    """Yield (name, content) of a sent file, or of each file of a sent folder."""
    files = list_folder(stored.path, MOST_UPLOAD)
    if not files:
        yield stored.name, stored.path.read_bytes()
    for name, item in files.items():
        yield name.rpartition("/")[2], read_member(stored.path, item)


async def add_logs(request):
    """Add the new logs of an upload to the tank, and compute it; without a result they go again."""
    folder, form = service_of(request), await read_form(request)
    stored = request.app.state.site.upload(form.get("upload", ""))
    language = language_of(request)
    async with _computing:
        await asyncio.to_thread(_compute, folder, stored, language)
    return redirect(request, f"/service/{request.path_params['key']}")


def _compute(folder, stored, language):
    """Copy new logs and compute the tank; a refusal removes the copies."""
    from tankcal.products.upkeep.paper import DOCUMENT
    from tankcal.products.upkeep.reading import read_upkeep
    from tankcal.products.upkeep.saved import State
    from tankcal.products.upkeep.upkeep import keep_up
    from tankcal.record.schema import to_plain

    states = [] if stored is None else _examine_service_page(folder, stored)
    changed = [name for name, _, state in states if state == "other"]
    if changed:
        text = message("upkeep_other_log", "a log of this name has other content; expected another "
                       "name, or an equal log")  # fmt: skip
        raise InputError([Problem(name, text) for name in changed])
    new = {name for name, _, state in states if state == "new"}
    sent = dict(_list_sent(stored)) if new else {}
    try:
        for name in new:
            (folder / name).write_bytes(sent[name])
        inputs = read_upkeep(folder, State(folder / STATE))
        upkeep = to_plain(keep_up(inputs, State(folder / STATE)))
    except BaseException:
        for name in new:
            (folder / name).unlink(missing_ok=True)
        raise
    language = inputs.sections["upkeep"]["language"] or language
    DOCUMENT.write(upkeep, folder / RESULTS, language)


def _show_results(folder, language):
    """(blocks as HTML, names of the documents) of the results of a tank."""
    path = folder / RESULTS / "upkeep.json"
    if not path.is_file():
        return [], []
    from tankcal.products.upkeep.paper import DOCUMENT, UpkeepPaper, summary_blocks
    from tankcal.report.web import block_html

    paper = UpkeepPaper(json.loads(path.read_text(encoding="utf-8")), language)
    blocks = [_frame(block.data, Markup(block_html(block.data))) for block in summary_blocks(paper)]
    names = [name for name in DOCUMENT.files if (folder / RESULTS / name).is_file()]
    return blocks, names


def _frame(block, html):
    """HTML of a block; a table scrolls within its frame on a narrow page."""
    if "rows" not in block:
        return html
    frame = Markup('<div class="scroll" tabindex="0" role="region" aria-label="{}">{}</div>')
    return frame.format(block["caption"], html)


async def send_document(request):
    """Send a file of the results."""
    from tankcal.products.upkeep.paper import DOCUMENT

    name = request.path_params["name"]
    path = service_of(request) / RESULTS / name
    if name not in DOCUMENT.files or not path.is_file():
        raise HTTPException(404)
    return FileResponse(path, filename=name)


MOST_SHOWN = 200  # changes on the page
MOST_DIGITS = 9  # of the number of a remark
PERMISSION_OF = {
    Act.SUBMITTED: EDIT, Act.REMARK: REVIEW, Act.RESOLVED: EDIT, Act.RETURNED: REVIEW,
    Act.REVIEWED: REVIEW, Act.APPROVED: APPROVE, Act.REVISED: APPROVE,
}  # fmt: skip


async def show_review(request):
    """Changes, warnings, findings, remarks and decisions about the results of a job."""
    job, language = job_of(request), language_of(request)
    await job.check()
    values = await asyncio.to_thread(_describe_review, request, job, language)
    return render_job(request, job, "review", tab="review", **values)


def _describe_review(request, job, language):
    """Content of the page."""
    person, desk = person_of(request), job.desk
    try:
        events, problem = jobs.read_events(job.source), ""
    except InputError as error:
        events, problem = (), "\n".join(desk.reader.say(text) for text in error.texts)
    sha256 = jobs.record_digest(job.out)
    is_present = not desk.draft.is_changed and _is_present(job)
    decision = jobs.find_decision(events, sha256) if is_present else None
    acts = jobs.NEXT[decision and decision.act] if is_present and not problem else ()
    certificates = request.app.state.site.read_register() if is_present else {}
    certificate = next(
        (item for item in certificates.values() if item.record_sha256 == sha256), None
    )
    copy, path = jobs.find_copy(job.source, events, sha256 if is_present else "")
    changes = [] if copy is None else jobs.list_changes(path, desk.draft)
    values = {
        "events": [event for event in events if event.act in jobs.DECISIONS],
        "remarks": jobs.list_remarks(events),
        "review_problem": problem,
        "is_present": is_present,
        "decision": decision,
        "acts": [
            act for act in acts if person.may(PERMISSION_OF[act]) and job.holder is None
        ],
        "may_remark": person.may(REVIEW) and is_present,
        "may_resolve": person.may(EDIT),
        "may_issue": person.may(APPROVE) and decision is not None
        and decision.act is Act.APPROVED and certificate is None,
        "asked": [field.label for field in find_asked_fields(desk)],
        "certificate": certificate,
        "copy": copy,
        "changes": [(item, desk.reader.title(item.name)) for item in changes[:MOST_SHOWN]],
        "more": max(0, len(changes) - MOST_SHOWN),
        "name": person.name or desk.draft.value("certificate", "authorised_by"),
        "submitters": jobs.list_submitters(events, sha256),
        "record_sha256": sha256,
        "places": [(name, desk.reader.title(name)) for name in ("job", *desk.names)],
        "lines": [], "verdict": "", "rejected": 0, "warnings": [], "met": 0, "checked": 0,
        "signature": "",
    }  # fmt: skip
    if is_present:
        values |= _describe_findings(job, language)
    return values


def _is_present(job):
    """Whether the results belong to the files."""
    return state_of_results(job.folder, job.out) is State.COMPUTED


def _describe_findings(job, language):
    """Findings of an assessor, warnings and rejected points of the record."""
    from tankcal.products.assess.assessing import assess, plain_assessment
    from tankcal.products.assess.paper import AssessmentPaper
    from tankcal.products.assess.requirements import MET, NOT_CHECKED
    from tankcal.report.saved_document import message_sentence
    from tankcal.report.web.wall_map import list_inspected

    try:
        paper = read_paper(job, language)
        assessment = assess(job.out)
    except InputError as error:  # a record of another program or version
        return {"lines": [job.desk.reader.say(text) for text in error.texts]}
    shown = AssessmentPaper(plain_assessment(assessment), language)
    checked = [item for item in assessment.outcomes if item.outcome != NOT_CHECKED]
    return {
        "rejected": len(list_inspected(paper.record)),
        "warnings": [
            f"{item['file']}: "
            + message_sentence(paper.words, item["text"], item["code"], item["values"])
            for item in paper.record["warnings"]
        ],
        "signature": find_signature(job.out / "certificate.pdf"),
        "lines": shown.lines(),
        "verdict": shown.verdict(),
        "checked": len(checked),
        "met": sum(item.outcome == MET for item in checked),
    }


def find_signature(path):
    """ "none", "present" or "incomplete": whether a signature covers a whole PDF; "" without one.

    A signature covers the file if its byte range begins with the first byte and ends with the
    last. Whether it is valid is shown by a PDF reader with the certificate of the person.
    """
    import re

    if not path.is_file():
        return ""
    data = path.read_bytes()
    ranges = re.findall(rb"/ByteRange\s*\[\s*(\d+)\s+(\d+)\s+(\d+)\s+(\d+)\s*\]", data)
    if not ranges:
        return "none"
    first, _, start, length = map(int, ranges[-1])
    return "present" if first == 0 and start + length >= len(data.rstrip()) else "incomplete"


async def decide(request):
    """Add a decision or a remark to the review."""
    job, form, person = job_of(request), await read_form(request), person_of(request)
    try:
        act = Act(form.get("act", ""))
    except ValueError as error:
        raise HTTPException(400) from error
    if not person.may(PERMISSION_OF[act]) or job.holder is not None:
        raise HTTPException(403)
    sha256, draft = form.get("record", ""), job.desk.draft
    if act is not Act.RESOLVED:
        # The decision belongs to the results that the person has read, and they to the files.
        _refuse_other_results(job, sha256)
    name = person.name or form.get("name", "")
    if act is Act.APPROVED and not form.get("text", "").strip():
        _refuse_unexplained(job)
        _refuse_same_person(job, sha256, name)
    place = ", ".join(filter(None, (form.get(key, "").strip() for key in ("table", "row"))))
    number = form.get("number", "")
    jobs.add_event(
        draft, act, name, sha256, form.get("text", ""), place,
        int(number) if number.isdecimal() and len(number) <= MOST_DIGITS else 0,
    )  # fmt: skip
    job.follow_lock()
    if act is Act.REVISED:
        _prepare_revision(request, job, sha256, form.get("text", ""))
    job.publish()
    return redirect(request, f"/job/{job.key}/review")


def _refuse_other_results(job, sha256):
    """Raise InputError if the results are no longer those of the page, or not of the files."""
    is_same = sha256 and jobs.record_digest(job.out) == sha256
    if not is_same or job.desk.draft.is_changed or job.is_computing or not _is_present(job):
        text = message(
            "review_other_results",
            "the data or the results have changed meanwhile; compute and read them again",
        )
        raise InputError(Problem("record.json", text))


def _refuse_unexplained(job):
    """Raise InputError for an approval without a reason although there are nonconformities."""
    from tankcal.products.assess.assessing import assess

    count = assess(job.out).nonconformities
    if count:
        text = message(
            "review_unexplained",
            "{count} nonconformities are open; expected the reason why the results are approved",
            count=count,
        )
        raise InputError(Problem("text", text))


def _refuse_same_person(job, sha256, name):
    """Raise InputError for an approval by the person who submitted, without a reason."""
    name = " ".join(name.split())
    if name in jobs.list_submitters(jobs.read_events(job.source), sha256):
        text = message(
            "review_same_person",
            "{name} submitted these results; expected another person, or the reason for approving "
            "them alone",
            name=name,
        )
        raise InputError(Problem("text", text))


def _prepare_revision(request, job, sha256, reason):
    """Enter the issued certificate as replaced, and clear its number, in a revised job."""
    certificates = request.app.state.site.read_register().values()
    known = next((item for item in certificates if item.record_sha256 == sha256), None)
    if known is None:
        return
    with job.desk.draft.group_edits():
        for key, text in {"replaces": f"{known.number}: {reason}", "number": ""}.items():
            job.desk.draft.set_value("job", "certificate", key, text)
    job.desk.mark_edited()
    job.follow_edit()


async def issue_certificate(request):
    """Register the certificate of approved results as issued."""
    from tankcal.products.register.certificates import issue

    job, site, form = job_of(request), request.app.state.site, await read_form(request)
    sha256 = form.get("record", "")
    _refuse_other_results(job, sha256)
    decision = jobs.find_decision(jobs.read_events(job.source), sha256)
    if (
        decision is None
        or decision.act is not Act.APPROVED
        or "record.json" not in (list_results(job))
    ):
        raise HTTPException(403)
    site.workspace.mkdir(parents=True, exist_ok=True)
    await asyncio.to_thread(issue, site.register, [job.out], decision.name)
    return redirect(request, "/register")


async def take_over(request):
    """Take a job over from a program that has not renewed its lock."""
    job = job_of(request)
    job.follow_lock(by_force=True)
    job.publish()
    return redirect(request, f"/job/{job.key}/")
