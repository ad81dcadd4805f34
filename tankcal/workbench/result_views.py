"""Results of the last computation of a desk, shown by `tankcal.workbench.views`."""

from html import escape

from tankcal.record import record_of
from tankcal.workbench.findings import DOUBTFUL
from tankcal.workbench.plain import list_page


def live_results(desk):
    """Widget of the last computation; decisions about points are passed to the desk."""
    from tankcal.workbench.views import results_view

    result = desk.last_run.result
    return results_view(result, record_of(result), desk.reader.language, desk.overrule)


def warnings_page(desk):
    """HTML of warnings of the last computation that the check did not give, or ""."""
    result = desk.last_run.result
    known = {warning.text for warning in result.job.warnings}
    warnings = [warning for warning in result.warnings if warning.text not in known]
    return (
        list_page([(DOUBTFUL, desk.reader.line(warning)) for warning in warnings], "")
        if warnings
        else ""
    )


def results_page(desk):
    """HTML of the last computation, without buttons, below the list of written files."""
    from tankcal.report.paper import Paper
    from tankcal.workbench.views.page import SavedView

    paper = Paper(record_of(desk.last_run.result), language=desk.reader.language)
    names = ", ".join(path.name for path in desk.last_run.files)
    written = desk.reader.word("written", folder=str(desk.out.resolve()), files=names)
    above = f"<p>{escape(written)}</p>{warnings_page(desk)}"
    return f"{above}{SavedView(paper)._repr_html_()}"
