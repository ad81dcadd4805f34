"""Pages of tanks in service: the logs of a month, rows read, estimate, alarms, documents."""

import asyncio
import fnmatch
import json
import os
from pathlib import Path

from markupsafe import Markup
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.app import folders
from tankcal.products.app.pages import language_of, read_form, redirect, render
from tankcal.products.app.site import MOST_UPLOAD, identifier

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
    from tankcal.products.upkeep.profiles import list_profiles
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
    received = [] if stored is None else await asyncio.to_thread(_examine, folder, stored)
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


def _examine(folder, stored):
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
    files = folders.list_folder(stored.path, MOST_UPLOAD)
    if not files:
        yield stored.name, stored.path.read_bytes()
    for name, item in files.items():
        yield name.rpartition("/")[2], folders.read_member(stored.path, item)


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
    from tankcal.products.upkeep.state import State
    from tankcal.products.upkeep.upkeep import keep_up
    from tankcal.record.schema import to_plain

    states = [] if stored is None else _examine(folder, stored)
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
    from tankcal.report.web.elements import block_html

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
