"""Pages beside the jobs: register of certificates, chart from a drawing, log in and out."""

import asyncio
from datetime import date

from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, Response

from tankcal.errors import InputError
from tankcal.products.app.pages import (
    language_of,
    person_of,
    read_form,
    redirect,
    render,
)
from tankcal.products.app.people import APPROVE

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
