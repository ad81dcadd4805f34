"""Pages and answers of the app: language, rendering, errors, and bodies of requests."""

import json
from collections import Counter
from contextlib import suppress
from urllib.parse import parse_qs, quote

from starlette.exceptions import HTTPException
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse

from tankcal.products.app.access import EDIT, LANGUAGE_COOKIE, Person
from tankcal.text.shipped import DEFAULT, LANGUAGES, nearest_language

THEME_COOKIE = "tankcal-theme"
THEMES = ("", "light", "dark")  # "": that of the system
NOBODY = Person("", ())
MOST_BODY = 20_000_000  # bytes of a form or an action; a paste of 5000 rows has less than 1 MB


def language_of(request):
    """Language of the pages: that of the cookie, or the first known language of the browser."""
    chosen = request.cookies.get(LANGUAGE_COOKIE)
    if chosen in LANGUAGES:
        return chosen
    for part in request.headers.get("accept-language", "").split(","):
        language = nearest_language(part.split(";")[0])
        if language:
            return language
    return DEFAULT


def render(request, template, status=200, **values):
    """Render a page."""
    state, language = request.app.state, language_of(request)
    theme = request.cookies.get(THEME_COOKIE, "")
    common = {
        "w": state.site.words(language),
        "base": state.base,
        "language": language,
        "languages": LANGUAGES,
        "theme": theme if theme in THEMES else "",
        "version": state.version,
        "person": person_of(request),
        "has_people": state.site.people is not None,
        "here": request.url.path + (f"?{request.url.query}" if request.url.query else ""),
        "quote": lambda text: quote(text, safe=""),
    }
    page = state.templates.get_template(f"{template}.html").render(common | values)
    return HTMLResponse(page, status)


def person_of(request):
    """`Person` of the request; `NOBODY` before the session begins."""
    return request.scope.get("person") or NOBODY


def permit(permission, handler):
    """Handler that only persons with a permission reach; their changes are noted."""

    async def handle(request):
        person, site = person_of(request), request.app.state.site
        if not person.may(permission):
            raise HTTPException(403)
        answer = await handler(request)
        if site.people is not None:
            source = site.path(request.path_params.get("key", ""))
            content = getattr(request.state, "content", None)
            site.log.add(person, request.url.path, source and str(source), content)
        return answer

    return handle


async def show_error(request, error):
    """Page of an error of HTTP, or its text for a script."""
    code = error.status_code
    if request.method == "GET" or "form" in request.headers.get("content-type", ""):
        return render(request, "error", code, code=code, lines=[])
    texts = request.app.state.site.words(language_of(request))["errors"]
    return JSONResponse({"error": texts.get(str(code), texts["400"])}, code)


async def show_failure(request, error):
    """Page of an error in the program; the server prints its traceback."""
    line = f"{type(error).__name__}: {error}"
    if "json" in request.headers.get("content-type", ""):
        return JSONResponse({"error": line}, 500)
    return render(request, "error", 500, code=500, lines=[line])


async def show_refusal(request, error):
    """Answer to a request that the model refuses: its messages in the language."""
    say = request.app.state.site.reader(language_of(request)).say
    texts = [say(text) for text in getattr(error, "texts", [str(error)])]
    lines = [line for text in texts for line in text.splitlines()]
    if "json" in request.headers.get("content-type", ""):
        return JSONResponse({"error": "\n".join(lines)}, 409)
    return render(request, "error", 409, code=409, lines=lines)


def job_of(request):
    """`OpenJob` of the request; 404 if it is not in the list."""
    job = request.app.state.site.job(request.path_params["key"], language_of(request))
    if job is None:
        raise HTTPException(404)
    return job


async def read_body(request):
    """Body of a request, 413 if it is too large."""
    content = b""
    async for part in request.stream():
        content += part
        if len(content) > MOST_BODY:
            raise HTTPException(413)
    return content


async def read_form(request):
    """Fields of a form, {name: last value}."""
    content = (await read_body(request)).decode("utf-8", "replace")
    form = {name: values[-1] for name, values in parse_qs(content, True).items()}
    request.state.content = form
    return form


async def read_action(request):
    """Object of a request with JSON; 400 for other content."""
    try:
        content = json.loads(await read_body(request))
    except ValueError:
        content = None
    if not isinstance(content, dict):
        raise HTTPException(400)
    request.state.content = content.get("action")
    return content


def redirect(request, path):
    """Redirection to a page of the app."""
    return RedirectResponse(f"{request.app.state.base}{path}", 303)


def upload_of(request):
    """`Upload` of the request; 404 if there is none."""
    stored = request.app.state.site.upload(request.path_params["upload"])
    if stored is None:
        raise HTTPException(404)
    return stored


def places_of(check):
    """Places (table, row, column) of the problems and warnings of a check, by their id."""
    places = {}
    for name, marks in check.marks.items():
        for (row, column), items in marks.items():
            for mark in items:
                places.setdefault(id(mark.problem), (name, row, column))
    return places


def count_problems(check):
    """Number of problems of each table."""
    if check is None:
        return Counter()
    places = places_of(check)
    known = [places.get(id(problem)) for problem in check.problems]
    return Counter(place[0] for place in known if place is not None)


def render_job(request, job, template, **values):
    """Render a page of a job, with its navigation."""
    desk = job.desk
    counts = count_problems(desk.present_check)
    tabs = [(name, desk.reader.title(name), counts[name]) for name in (*desk.names, *desk.lists)]
    addable = [(name, desk.reader.title(name)) for name in desk.addable]
    common = {
        "may_edit": desk.draft.locked is None and person_of(request).may(EDIT),
        "holder": job.holder,
        "job": job,
        "title": desk.draft.value("tank", "id") or job.source.stem,
        "tabs": tabs,
        "addable": addable,
        "state": job.describe(),
        "unsaved": desk.unsaved,
        "steps": [] if desk.unsaved is None else list(map(desk.reader.step, desk.unsaved.edits)),
        "locked": "" if desk.draft.locked is None else desk.reader.say(desk.draft.locked),
        "unreadable": [desk.reader.line(problem) for problem in desk.draft.unreadable],
    }
    return render(request, template, **(common | values))


def list_results(job):
    """Files of the results, {name: path}."""
    with suppress(OSError):
        return {path.name: path for path in sorted(job.desk.out.iterdir()) if path.is_file()}
    return {}


def read_record(path, language):
    """Record as a report; slow, for a thread."""
    from tankcal.report.paper import Paper

    return Paper(path, language=language)


def read_paper(job, language):
    """Record of a job as a report; slow, for a thread."""
    return read_record(job.out / "record.json", language)


def find_asked_fields(desk):
    """Fields of the certificate that ISO/IEC 17025 requires and that are blank."""
    from tankcal.products.desk.display import form_of

    return [field for field in form_of(desk) if field.is_asked]
