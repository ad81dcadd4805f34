"""Routes of the app. A handler finds its job, calls the desk, and renders a page."""

import asyncio
import hashlib
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import quote

import jinja2
from markupsafe import Markup
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.responses import (
    FileResponse,
    HTMLResponse,
    JSONResponse,
    RedirectResponse,
    Response,
    StreamingResponse,
)
from starlette.routing import Mount, Route

from tankcal.errors import InputError, TankcalError
from tankcal.products.app.access import APPROVE, EDIT, LANGUAGE_COOKIE, REPORT_POLICY, RUN
from tankcal.products.app.office_pages import (
    add_logs,
    compare_upload,
    create_from_chart,
    create_service,
    decide,
    draw_chart,
    end_session,
    issue_certificate,
    list_services,
    open_sent_job,
    send_document,
    send_register,
    show_chart,
    show_login,
    show_register,
    show_review,
    show_service,
    show_services,
    show_upload,
    start_session,
    take_over,
    view_record,
    withdraw_certificate,
)
from tankcal.products.app.pages import (
    THEME_COOKIE,
    THEMES,
    find_asked_fields,
    job_of,
    language_of,
    list_results,
    permit,
    person_of,
    places_of,
    read_action,
    read_form,
    read_paper,
    redirect,
    render,
    render_job,
    show_error,
    show_failure,
    show_refusal,
    upload_of,
)
from tankcal.products.app.site import pack_sent_folder
from tankcal.text.shipped import LANGUAGES, shipped_folder

FOLDER = Path(__file__).parent
PING_S = 15  # interval of signs of life to a window
EXAMPLES = ("silva-1995", "strapping", "sphere-straps")  # offered as copies
SURVEYS = {  # ways of measuring that a new job offers, {kind: {code: survey}}
    "vertical": {
        "points": None,
        "strapping": "strapping",
        "reference_line": "reference-line",
        "total_station": "total-station",
        "wall_hits": "wall-hits",
        "cloud": "cloud",
        "photos": "photos",
        "liquid": "liquid",
        "radii": "radii",
    },
    "horizontal": {"points": None, "strapping": "strapping", "liquid": "liquid"},
    "sphere": {"points": None, "strapping": "strapping", "liquid": "liquid"},
}
DOCUMENTS = {  # documents of a run, in the order of the page
    "certificate.pdf": "certificate",
    "report.pdf": "report",
    "field-table.pdf": "field_table",
    "working-papers.pdf": "working_papers",
    "report.html": "web_report",
    "capacity.xlsx": "workbook",
    "certificate.xml": "digital_certificate",
}
SHOWN_DOCUMENTS = ("certificate.pdf", "report.pdf", "field-table.pdf", "report.html")


def make_application(site, base=""):
    """Build the application without its guard.

    Parameters
    ----------
    site : Site
        Jobs and folders.
    base : str
        Prefix of all addresses, such as "/tankcal"; "" without a prefix.
    """
    job, name = "/job/{key:str}", "{name:str}"
    get, post = ["GET"], ["POST"]
    routes = [
        Route("/", show_home, methods=get),
        Route("/recent", show_recent, methods=get),
        Route("/look", choose_look, methods=post),
        Route("/static/{version:str}/{name:str}", send_static, methods=get),
        Route("/new", show_new, methods=get),
        Route("/new", permit(EDIT, create), methods=post),
        Route("/example/{name:str}", permit(EDIT, copy_example), methods=post),
        Route("/open", show_places, methods=get),
        Route("/open", permit(EDIT, open_place), methods=post),
        Route("/upload", permit(EDIT, upload), methods=post),
        Route("/import/{upload:str}", show_upload, methods=get),
        Route("/import/{upload:str}/job", permit(EDIT, open_sent_job), methods=post),
        Route("/import/{upload:str}/view", view_record, methods=get),
        Route("/import/{upload:str}/compare/{key:str}", compare_upload, methods=get),
        Route("/field-sheet/{survey:str}", send_field_sheet, methods=get),
        Route("/keys", show_keys, methods=get),
        Route(f"{job}/", show_settings, methods=get),
        Route(f"{job}/forget", permit(EDIT, forget), methods=post),
        Route(f"{job}/table/{name}", show_table, methods=get),
        Route(f"{job}/grid/{name}", send_grid, methods=get),
        Route(f"{job}/changes", send_changes, methods=get),
        Route(f"{job}/events", send_events, methods=get),
        Route(f"{job}/act", permit(EDIT, act), methods=post),
        Route(f"{job}/add-table", permit(EDIT, add_table), methods=post),
        Route(f"{job}/recover", permit(EDIT, recover), methods=post),
        Route(f"{job}/problems", show_problems, methods=get),
        Route(f"{job}/import/{{upload:str}}", show_import, methods=get),
        Route(f"{job}/import/{{upload:str}}", permit(EDIT, import_upload), methods=post),
        Route(f"{job}/results", show_results, methods=get),
        Route(f"{job}/run", permit(RUN, run), methods=post),
        Route(f"{job}/stop", permit(RUN, stop), methods=post),
        Route(f"{job}/overrule", permit(EDIT, overrule), methods=post),
        Route(f"{job}/file/{name}", send_file, methods=get),
        Route(f"{job}/view/{name}", send_view, methods=get),
        Route(f"{job}/zip", send_zip, methods=get),
        Route(f"{job}/quantity", show_quantity, methods=get),
        Route(f"{job}/what-if", show_what_if, methods=get),
        Route(f"{job}/review", show_review, methods=get),
        Route(f"{job}/review", permit("", decide), methods=post),
        Route(f"{job}/issue", permit(APPROVE, issue_certificate), methods=post),
        Route(f"{job}/take-over", permit(EDIT, take_over), methods=post),
        Route("/run-all", permit(RUN, run_all), methods=post),
        Route("/register", show_register, methods=get),
        Route("/register.csv", send_register, methods=get),
        Route("/register/withdraw", permit(APPROVE, withdraw_certificate), methods=post),
        Route("/service", show_services, methods=get),
        Route("/service", permit(EDIT, create_service), methods=post),
        Route("/service/{key:str}", show_service, methods=get),
        Route("/service/{key:str}", permit(EDIT, add_logs), methods=post),
        Route("/service/{key:str}/{name:str}", send_document, methods=get),
        Route("/chart", show_chart, methods=get),
        Route("/chart/job", permit(EDIT, create_from_chart), methods=post),
        Route("/chart.pdf", draw_chart, methods=get),
        Route("/login", show_login, methods=get),
        Route("/login", start_session, methods=post),
        Route("/logout", end_session, methods=post),
    ]
    handlers = {
        HTTPException: show_error,
        TankcalError: show_refusal,
        Exception: show_failure,
    }
    if base:
        routes = [Mount(base, routes=routes)]
    application = Starlette(routes=routes, exception_handlers=handlers)
    application.state.site, application.state.base = site, base
    # A browser keeps scripts and styles until their content changes.
    content = b"".join(path.read_bytes() for _, path in sorted(static_files().items()))
    application.state.version = hashlib.sha256(content).hexdigest()[:12]
    loader = jinja2.FileSystemLoader(FOLDER / "templates")
    application.state.templates = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    return application


# ---- language, theme, scripts and styles


async def choose_look(request):
    """Choose language or theme, and return to the page."""
    form = await read_form(request)
    back = form.get("back", "/")
    # Only a path of this server, so that a link cannot lead to another site.
    back = back if back.startswith("/") and not back.startswith(("//", "/\\")) else "/"
    answer = RedirectResponse(back, 303)
    year_s = 365 * 24 * 3600
    if form.get("language") in LANGUAGES:
        answer.set_cookie(LANGUAGE_COOKIE, form["language"], year_s, samesite="strict")
    if form.get("theme") in THEMES:
        answer.set_cookie(THEME_COOKIE, form["theme"], year_s, samesite="strict")
    return answer


def static_files():
    """Scripts and styles, {name: path}; the grid is that of the notebook."""
    desk = FOLDER.parent / "desk"
    files = {path.name: path for path in (FOLDER / "static").iterdir()}
    return files | {name: desk / name for name in ("grid.js", "grid.css")}


async def send_static(request):
    """Send a script or style; the version in the address lets the browser keep it."""
    name, files = request.path_params["name"], static_files()
    if name not in files:
        raise HTTPException(404)
    return FileResponse(files[name], headers={"Cache-Control": "max-age=31536000, immutable"})


# ---- home, new job, folders, uploads


async def show_home(request):
    """Home page; the list of jobs follows, because the model takes time to load."""
    return render(request, "home", examples=EXAMPLES)


async def show_recent(request):
    """List of recent jobs."""
    jobs = await asyncio.to_thread(request.app.state.site.list_recent)
    return render(request, "recent", jobs=jobs)


async def show_new(request):
    """Form of a new job: kind, survey, name."""
    return render(
        request, "new", surveys=SURVEYS, upload=request.query_params.get("upload", ""),
        workspace=str(request.app.state.site.workspace),
    )  # fmt: skip


async def create(request):
    """Create a job and show its settings, or the import of the upload that it was made for."""
    from tankcal.products.desk.jobs import create_job

    form, site = await read_form(request), request.app.state.site
    kind, way = form.get("kind", ""), form.get("survey", "")
    if way not in SURVEYS.get(kind, {}):
        raise HTTPException(400)
    folder = create_job(
        site.workspace, form.get("tank", "")[:64], kind, SURVEYS[kind][way], language_of(request)
    )
    key = site.add(folder)
    upload = form.get("upload", "")
    if site.upload(upload) is not None:
        return redirect(request, f"/job/{key}/import/{upload}")
    return redirect(request, f"/job/{key}/")


async def copy_example(request):
    """Copy an example to the workspace and show it."""
    from tankcal.products.desk.jobs import copy_job

    name, site = request.path_params["name"], request.app.state.site
    if name not in EXAMPLES:
        raise HTTPException(404)
    source = shipped_folder("examples") / name
    folder = await asyncio.to_thread(copy_job, source, site.workspace, name)
    return redirect(request, f"/job/{site.add(folder)}/")


async def show_places(request):
    """Folders of this computer, from which a job is opened."""
    path, places = request.app.state.site.list_places(request.query_params.get("at", ""))
    return render(request, "places", path="" if path is None else str(path), places=places)


async def open_place(request):
    """Open the job of a listed folder."""
    site = request.app.state.site
    path = site.place((await read_form(request)).get("at", ""))
    if path is None:
        raise HTTPException(404)
    return redirect(request, f"/job/{site.add(path)}/")


async def upload(request):
    """Receive a file or a folder as the body, and answer with the address of its import."""
    from tankcal.products.app.site import MOST_UPLOAD

    site = request.app.state.site
    key, stored = site.new_upload(request.query_params.get("name", "file"))
    size, is_folder = 0, request.query_params.get("folder") == "yes"
    try:
        with stored.path.open("wb") as file:
            async for part in request.stream():
                size += len(part)
                if size > MOST_UPLOAD:
                    raise HTTPException(413)
                await asyncio.to_thread(file.write, part)
        if is_folder:
            await asyncio.to_thread(pack_sent_folder, stored.path)
    except BaseException:
        stored.path.unlink(missing_ok=True)
        raise
    job = "" if is_folder else request.query_params.get("job", "")
    place = f"/job/{job}/import/{key}" if site.path(job) is not None else f"/import/{key}"
    service = request.query_params.get("service", "")
    if service in list_services(site):
        place = f"/service/{service}?upload={key}"
    return JSONResponse({"address": f"{request.app.state.base}{place}"})


async def send_field_sheet(request):
    """Printable sheets for a survey."""
    from tankcal.report.field_forms import is_filled_by_pen, write_field_sheets

    survey = request.path_params["survey"]
    if not is_filled_by_pen(survey):
        raise HTTPException(404)

    def make():
        with TemporaryDirectory() as folder:
            path = Path(folder) / "field-sheets.pdf"
            write_field_sheets(path, survey, language_of(request))
            return path.read_bytes()

    return Response(await asyncio.to_thread(make), media_type="application/pdf")


async def show_keys(request):
    """List of the keyboard shortcuts."""
    return render(request, "keys")


# ---- a job: settings, tables, problems


async def show_settings(request):
    """Form of the settings in groups."""
    from tankcal.products.desk.display import Group, form_of

    job = job_of(request)
    await job.check()
    fields = form_of(job.desk)
    groups = {group: [item for item in fields if item.group is group] for group in Group}
    sections = job.desk.reader.words["input"]["sections"]
    return render_job(request, job, "settings", groups=groups, sections=sections, tab="settings")


async def show_table(request):
    """Page of a table or a list with its grid."""
    job, name = job_of(request), request.path_params["name"]
    if name not in (*job.desk.names, *job.desk.lists):
        raise HTTPException(404)
    reader = job.desk.reader
    return render_job(
        request, job, "table", name=name, heading=reader.title(name), note=reader.note(name),
        tab=name, takes_rows=name in job.desk.names,
    )  # fmt: skip


async def send_grid(request):
    """Content of a grid."""
    from tankcal.products.desk.display import describe_grid, describe_state

    job, name = job_of(request), request.path_params["name"]
    if name not in (*job.desk.names, *job.desk.lists):
        raise HTTPException(404)
    await job.check()
    words = job.desk.reader.words["workbench"]["grid"] | job.desk.reader.words["app"]["grid"]
    content = {"name": name, "label": job.desk.reader.title(name), "words": words}
    content |= {"shows_units": True, "passes_keys": True}
    content |= describe_grid(job.desk, name) | describe_state(job.desk)
    content["locked"] |= not person_of(request).may(EDIT)
    return JSONResponse(content)


def answer_changes(job, name, since, entered=()):
    """Differences of a table since a revision, with the state of the job."""
    from tankcal.products.desk.display import describe_changes

    return JSONResponse(job.describe() | describe_changes(job.desk, name, since, entered))


async def send_changes(request):
    """Differences of a table since the revision that a window shows."""
    job = job_of(request)
    try:
        since = int(request.query_params.get("since", -1))
    except ValueError:
        since = -1
    return answer_changes(job, request.query_params.get("name"), since)


async def send_events(request):
    """Events of a job for a window, which then asks for its differences."""
    job = job_of(request)
    queue = job.subscribe()

    async def events():
        try:
            yield "retry: 1000\n\n"
            while True:
                with suppress(TimeoutError):
                    await asyncio.wait_for(queue.get(), PING_S)
                    yield "data: changed\n\n"
                    continue
                yield ": alive\n\n"
        finally:
            job.unsubscribe(queue)

    return StreamingResponse(events(), media_type="text/event-stream")


async def act(request):
    """Carry out an action on a table or on the settings, and answer with the differences."""
    from tankcal.products.desk.display import enter_setting

    job, content = job_of(request), await read_action(request)
    desk, name, since = job.desk, content.get("name"), content.get("since", -1)
    action, entered = content.get("action") or {}, ()
    if not isinstance(action, dict) or not isinstance(since, int):
        raise HTTPException(400)
    if content.get("desk", job.reading) != job.reading:  # its revisions are not ours
        return JSONResponse({"error": ""}, 412)
    kind, client = action.get("kind"), str(content.get("client", ""))
    before = desk.draft.revision
    try:
        if kind == "save":
            job.save()
        elif kind == "autosave":
            job.is_autosaved = bool(action["value"])
        elif kind in ("undo", "redo"):
            desk.act("job", {"kind": kind})
        elif kind == "setting":
            enter_setting(desk, action["section"], action["key"], str(action["text"]))
        elif name in (*desk.names, *desk.lists):
            entered = desk.act(name, action, job.seen_revision(content.get("revision"), client))
        else:
            raise HTTPException(404)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise HTTPException(400) from error
    except InputError as error:
        lines = [desk.reader.say(text) for text in error.texts]
        return JSONResponse({"error": "\n".join(lines)}, 409)
    job.note_edits(before, client)
    if kind in ("save", "autosave", "every"):
        job.publish()
    else:
        job.follow_edit()
    if kind == "every":
        since = -1  # the rows differ
    return answer_changes(job, name, since, entered)


async def add_table(request):
    """Add a table and show it."""
    job, name = job_of(request), (await read_form(request)).get("table", "")
    if name not in job.desk.addable:
        raise HTTPException(404)
    job.desk.draft.add_table(name)
    job.desk.mark_edited()
    job.follow_edit()
    return redirect(request, f"/job/{job.key}/table/{name}")


async def recover(request):
    """Repeat or discard the unsaved edits of an earlier session."""
    job, form = job_of(request), await read_form(request)
    if job.desk.unsaved is not None:
        if form.get("decision") == "recover":
            job.desk.recover()
            job.follow_edit()
        else:
            job.desk.discard_unsaved()
    return redirect(request, f"/job/{job.key}/")


async def forget(request):
    """Remove a job from the list; its files remain."""
    site = request.app.state.site
    path = site.path(request.path_params["key"])
    if path is not None:
        site.recent.remove(path)
    return redirect(request, "/")


async def show_problems(request):
    """Problems and warnings, each with a link to its cell."""
    job = job_of(request)
    await job.check()
    check, places = job.desk.outcome, places_of(job.desk.outcome)
    words = request.app.state.site.words(language_of(request))
    lists = [
        (level, [describe_problem(job.desk, words, problem, places.get(id(problem)))
                 for problem in some])
        for level, some in (("bad", check.problems), ("doubtful", check.warnings))
    ]  # fmt: skip
    return render_job(request, job, "problems", lists=lists, tab="problems")


def describe_problem(desk, words, problem, place):
    """Text of a problem with the labels of its place, and its link."""
    from tankcal.products.desk.keys import field_of

    if place is None:
        return desk.reader.line(problem), ""
    name, row, column = place
    if name == "job":
        field = field_of(name, row, column) if row and column else None
        parts = [words["settings"], field and desk.reader.label(row, field)]
    else:
        field = desk.draft.fields(name).get(column) if name in desk.draft.tables else None
        is_row = isinstance(row, int)
        parts = [
            desk.reader.title(name), is_row and f"{words['review']['row'].lower()} {row + 1}",
            desk.reader.label("", field) if field else column,
        ]  # fmt: skip
    text = desk.reader.say(problem.expected)
    return f"{', '.join(str(part) for part in parts if part)}: {text}", link_of(place)


def link_of(place):
    """Relative address of a place (table, row, column) of a problem, or ""."""
    if place is None:
        return ""
    name, row, column = place
    if name == "job":
        return f"./#{quote(f'{row}.{column}')}" if row and column else "./"
    cell = "" if not isinstance(row, int) else f"#{row},{quote(str(column or ''))}"
    return f"table/{quote(name)}{cell}"


# ---- import into a job


async def show_import(request):
    """Proposal for the import of a file into a job."""
    from tankcal.job.contract import columns_of
    from tankcal.job.headings import LENGTHS
    from tankcal.products.desk.proposals import ENCODINGS, Kind

    job, stored = job_of(request), upload_of(request)
    tables = [name for name in (*job.desk.names, *job.desk.addable)]
    proposal, name = await asyncio.to_thread(make_proposal, request, job, stored)
    reader = job.desk.reader
    labels = {}
    if proposal.kind is Kind.TABLE:
        labels = {
            field.name: f"{reader.label('', field)} ({field.name})"
            for field in columns_of(name, job.desk.draft.kind)
        }
    return render_job(
        request, job, "import", proposal=proposal, kind=str(proposal.kind), name=name,
        file=stored.name, labels=labels, encodings=ENCODINGS, units=tuple(LENGTHS), tab="import",
        tables=[(item, reader.title(item)) for item in tables],
        upload=request.path_params["upload"],
        count=len(job.desk.draft.tables[name].rows) if name in job.desk.names else 0,
    )  # fmt: skip


def make_proposal(request, job, stored):
    """`Proposal` with the choices of the user in the query, and the name of its table."""
    from tankcal.products.desk.proposals import ENCODINGS, SEPARATORS, propose

    query = request.query_params
    known = (*job.desk.names, *job.desk.addable)
    name = query.get("table") if query.get("table") in known else known[0]
    marks = {
        "encoding": query.get("encoding") if query.get("encoding") in ENCODINGS else "",
        "separator": {"tab": "\t", "space": " "}.get(
            query.get("separator"), query.get("separator", "")
        ),
        "decimal": query.get("decimal") if query.get("decimal") in (".", ",") else "",
    }
    marks["separator"] = marks["separator"] if marks["separator"] in SEPARATORS else ""
    targets = units = None
    # Columns chosen for another table, or for another division of the lines, no longer apply.
    if query.get("for") == f"{name}|{query.get('separator', '')}|{query.get('encoding', '')}":
        targets, units = query.getlist("target"), query.getlist("unit")
    data = stored.path.read_bytes()
    return propose(data, name, **marks, targets=targets, units=units or ()), name


async def import_upload(request):
    """Import a file with the choices of the query, as a single edit."""
    from tankcal.products.desk.proposals import Kind

    job, stored, form = job_of(request), upload_of(request), await read_form(request)
    proposal, name = await asyncio.to_thread(make_proposal, request, job, stored)
    is_replacing = form.get("rows") == "replace"
    if proposal.kind is Kind.FIELD_BOOK:
        return await import_field_book(request, job, stored, is_replacing)
    if proposal.kind is not Kind.TABLE or not any(column.target for column in proposal.columns):
        raise HTTPException(400)
    headings, rows = await asyncio.to_thread(proposal.convert)
    job.desk.import_rows(name, headings, rows, is_replacing)
    job.follow_edit()
    return redirect(request, f"/job/{job.key}/table/{name}")


async def import_field_book(request, job, stored, is_replacing):
    """Import a field book of an instrument into the tables of a job folder."""
    from tankcal.products.desk.jobs import folder_name
    from tankcal.products.fieldbooks.importing import import_fieldbooks

    job.desk.save()

    def read():
        with TemporaryDirectory() as folder:
            # The messages name the file, and its ending may belong to the format.
            path = Path(folder) / folder_name(stored.name)
            path.write_bytes(stored.path.read_bytes())
            return import_fieldbooks([path], job.source, replace_tables=is_replacing)

    imported = await asyncio.to_thread(read)
    site = request.app.state.site
    site.forget(job.key)
    job = site.job(job.key, language_of(request))
    say = job.desk.reader.say
    lines = [say(text) for text in imported.summary]
    warnings = [job.desk.reader.line(problem) for problem in imported.warnings]
    return render_job(request, job, "imported", lines=lines, warnings=warnings, tab="import")


# ---- computation and results


async def run(request):
    """Save and compute a job, and show its results page."""
    job, form = job_of(request), await read_form(request)
    await job.check()
    job.start(form.get("documents") == "yes")
    return redirect(request, f"/job/{job.key}/results")


async def run_all(request):
    """Compute all listed jobs that are ready or older than their data; two at a time."""
    from tankcal.products.desk.jobs import State

    site = request.app.state.site
    jobs = await asyncio.to_thread(site.list_recent)
    for key, item in jobs:
        if item.state.state in (State.READY, State.STALE):
            job = site.job(key, language_of(request))
            with suppress(TankcalError):  # the page of the job shows its problems
                await job.check()
                job.start()
    return redirect(request, "/")


async def stop(request):
    """Stop the computation."""
    job = job_of(request)
    if job.run is not None:
        await job.run.stop()
    return redirect(request, f"/job/{job.key}/results")


async def show_results(request):
    """Results with documents, rejected points and files; progress while they are computed."""
    from tankcal.products.desk.jobs import state_of_results

    job = job_of(request)
    await job.check()
    files, desk = list_results(job), job.desk
    values = {"headline": "", "points": [], "warnings": []}
    folder = job.source.parent if job.source.is_file() else job.source
    state = state_of_results(folder, desk.out) if "record.json" in files else None
    if state is not None:
        values = await asyncio.to_thread(describe_results, job, language_of(request))
    documents = [(name, code) for name, code in DOCUMENTS.items() if name in files]
    return render_job(
        request, job, "results", tab="results", files=files, documents=documents,
        shown=[name for name in SHOWN_DOCUMENTS if name in files], results="" if state is None
        else str(state), blocking=desk.outcome.problems[:5],
        asked=[field.label for field in find_asked_fields(desk)], **values,
    )  # fmt: skip


def describe_results(job, language):
    """Headline, rejected points and warnings of a record."""
    from tankcal.report.saved_document import message_sentence
    from tankcal.report.web.wall_map import list_inspected, reason_text

    paper = read_paper(job, language)
    record = paper.record
    capacity = record["capacity"]
    volume, U, k = (capacity[name][-1] for name in ("volume_m3", "U_m3", "k"))
    headline = paper.word(
        "app.headline",
        volume=paper.number(volume, "m3", u=U),
        height=paper.height(capacity["height_m"][-1]),
        U=paper.number(U, "m3", u=U),
        k=paper.number(k, decimals=2),
    )
    points = []
    for point in list_inspected(record)[:200]:
        off = "" if point.off_m is None else paper.number(point.off_m, "mm", decimals=1)
        points.append((point.name, off, reason_text(paper, point), point.is_kept))
    warnings = [
        f"{item['file']}: "
        + message_sentence(paper.words, item["text"], item["code"], item["values"])
        for item in record["warnings"]
    ]
    return {"headline": headline, "points": points, "warnings": warnings}


async def overrule(request):
    """Enter a decision about a rejected point, which the next run applies."""
    from tankcal.job.contract.overrulings import DECISIONS

    job, form = job_of(request), await read_form(request)
    point, reason = form.get("point", ""), " ".join(form.get("reason", "").split())
    if form.get("decision") not in DECISIONS or not point or not reason:
        raise HTTPException(400)
    job.desk.overrule(point, form["decision"], reason)
    job.follow_edit()
    return redirect(request, f"/job/{job.key}/results#points")


async def send_file(request):
    """Send a file of the results, to be shown or stored."""
    job, name = job_of(request), request.path_params["name"]
    files = list_results(job)
    if name not in files:
        raise HTTPException(404)
    if "store" in request.query_params:
        stem = job.desk.draft.value("tank", "id") or job.source.stem
        return FileResponse(files[name], filename=f"{stem} {name}")
    headers = {}
    if name.endswith((".html", ".xml", ".svg")):
        headers["Content-Security-Policy"] = REPORT_POLICY
    kind = None if name.endswith((".pdf", ".html")) else "text/plain; charset=utf-8"
    return FileResponse(files[name], headers=headers, media_type=kind)


async def send_view(request):
    """Send a page of the record: table with calculators, or wall."""
    job, language = job_of(request), language_of(request)
    name = request.path_params["name"]
    if name not in ("table", "wall", "budget", "whole") or "record.json" not in list_results(job):
        raise HTTPException(404)

    def make():
        from tankcal.products.desk import result_pages

        return getattr(result_pages, f"{name}_page")(read_paper(job, language))

    html = await asyncio.to_thread(make)
    if html is None:
        raise HTTPException(404)
    return HTMLResponse(html, headers={"Content-Security-Policy": REPORT_POLICY})


async def send_zip(request):
    """Send all results in an archive."""
    from tankcal.products.desk.jobs import pack

    job = job_of(request)
    files = list_results(job)
    if not files:
        raise HTTPException(404)
    data = await asyncio.to_thread(pack, list(files.values()), job.desk.out)
    stem = job.desk.draft.value("tank", "id") or job.source.stem
    disposition = f"attachment; filename*=UTF-8''{quote(stem)}.zip"
    return Response(
        data, media_type="application/zip", headers={"Content-Disposition": disposition}
    )


async def show_quantity(request):
    """Quantities of product from dips, with the table of the results."""
    job, language = job_of(request), language_of(request)
    if "record.json" not in list_results(job):
        raise HTTPException(404)

    def make():
        from tankcal.products.desk.calculators import answer_ticket, ticket_sections

        paper = read_paper(job, language)
        return ticket_sections(paper), *answer_ticket(paper, dict(request.query_params))

    sections, answer, problems = await asyncio.to_thread(make)
    return render_job(
        request, job, "quantity", tab="results", sections=sections, problems=problems,
        answer=Markup(answer), texts=dict(request.query_params),
    )  # fmt: skip


async def show_what_if(request):
    """Budget of a volume with a factor for each standard uncertainty."""
    job, language = job_of(request), language_of(request)
    if "record.json" not in list_results(job):
        raise HTTPException(404)
    query = request.query_params

    def make():
        from tankcal.products.desk import calculators

        paper = read_paper(job, language)
        known = calculators.list_recorded_budgets(paper)
        numbers = {str(number): number for number, _ in known}
        if not numbers:
            return {"budgets": [], "number": None, "lines": [], "sentences": [], "table": ""}
        number = numbers.get(query.get("budget"), known[0][0])
        changed = calculators.change_recorded_budget(paper, number, read_factors(query))
        return {
            "budgets": known, "number": number, "sentences": calculators.budget_sentences(
                paper, changed), "table": Markup(calculators.table_html(paper, changed)),
            "lines": [(name, factor, paper.number(factor, decimals=2))
                      for name, factor in zip(changed.names, changed.factors, strict=True)],
        }  # fmt: skip

    values = await asyncio.to_thread(make)
    return render_job(request, job, "what-if", tab="results", **values)


def read_factors(query):
    """Factors {index of a line: factor} of a query, within the range of the sliders."""
    from tankcal.products.desk.calculators import LARGEST

    factors = {}
    for name, text in query.items():
        with suppress(ValueError):
            if name.startswith("f") and name[1:].isdecimal() and 0 <= float(text) <= LARGEST:
                factors[int(name[1:])] = float(text)
    return factors
