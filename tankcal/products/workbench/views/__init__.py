"""Views of a result in a notebook: table, calculators, wall with rejected points, budget.

results_view(result)                      in the language of the job
results_view(result, on_overrule=decide)  with buttons that call decide(point, decision, reason)
"""

from importlib.util import find_spec

from tankcal.products.workbench.views.page import SavedView
from tankcal.record import record_of
from tankcal.report.paper import Paper

__all__ = ["results_view"]


def results_view(result, record=None, language=None, on_overrule=None):
    """Build a view of a result that a notebook displays.

    Parameters
    ----------
    result : Result
        Result of `tankcal.run`.
    record : dict, optional
        Record of the result; by default it is computed.
    language : str, optional
        Language of the texts; by default the language of the job.
    on_overrule : callable, optional
        Function on_overrule(point, decision, reason) that receives the user's decision about a
        point, "keep" or "leave_out". By default there are no buttons for decisions.

    Returns
    -------
    ipywidgets.Widget or SavedView
        A widget if ipywidgets is installed, else a `SavedView`, an HTML page without buttons.

    Examples
    --------
    >>> import tankcal
    >>> result = tankcal.run(tankcal.load("examples/silva-1995"), simulated=False)
    >>> type(results_view(result)).__name__ in ("VBox", "SavedView")
    True
    """
    paper = Paper(record_of(result) if record is None else record, language=language)
    if find_spec("ipywidgets") is None:
        return SavedView(paper)
    from tankcal.products.workbench.views.panels import live_view  # takes long to load

    return live_view(result, paper, on_overrule)
