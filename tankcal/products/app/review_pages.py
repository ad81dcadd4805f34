"""Page of the review of a job: what a reviewer reads, decisions, issue of the certificate."""

import asyncio

from starlette.exceptions import HTTPException

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.app.access import APPROVE, EDIT, REVIEW
from tankcal.products.app.pages import (
    find_asked_fields,
    job_of,
    language_of,
    list_results,
    person_of,
    read_form,
    read_paper,
    redirect,
    render_job,
)
from tankcal.products.desk import jobs
from tankcal.products.desk.jobs import Act, State, state_of_results

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
