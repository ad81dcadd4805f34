"""What a desk shows of its last run: the views of `tankcal.workbench.views`."""

from html import escape

from tankcal.record import record_of
from tankcal.workbench.findings import DOUBTFUL
from tankcal.workbench.plain import list_page


def live_results(desk):
    """The widget of the last run of a desk; who decides about a point there, the desk notes."""
    from tankcal.workbench.views import results_view

    result = desk.last_run.result
    return results_view(result, record_of(result), desk.reader.language, desk.overrule)


def warnings_page(desk):
    """What the last run of a desk warns of beyond the check of the job, as HTML; "": nothing."""
    result = desk.last_run.result
    known = {one.text for one in result.job.warnings}
    found = [one for one in result.warnings if one.text not in known]
    return list_page([(DOUBTFUL, desk.reader.line(one)) for one in found], "") if found else ""


def results_page(desk):
    """The same as HTML without buttons, with what was written above it."""
    from tankcal.report.paper import Paper
    from tankcal.workbench.views.page import SavedView

    paper = Paper(record_of(desk.last_run.result), language=desk.reader.language)
    names = ", ".join(path.name for path in desk.last_run.files)
    written = desk.reader.word("written", folder=str(desk.out.resolve()), files=names)
    above = f"<p>{escape(written)}</p>{warnings_page(desk)}"
    return f"{above}{SavedView(paper)._repr_html_()}"
