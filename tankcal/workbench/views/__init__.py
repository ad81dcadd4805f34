"""What a notebook shows of a result: table, calculators, wall with rejected points, budget.

results_view(result)                      in the language of the job
results_view(result, on_overrule=decide)  with buttons that call decide(point, decision, reason)
"""

from importlib.util import find_spec

from tankcal.record import record_of
from tankcal.report.paper import Paper
from tankcal.workbench.views.page import SavedView

__all__ = ["results_view"]


def results_view(result, record=None, language=None, on_overrule=None):
    """What can be looked at of a result, as an object that displays itself.

    Parameters
    ----------
    result : Result
        Of `tankcal.run`.
    record : dict, optional
        Its record; None: it is made.
    language : str, optional
        None: that which the job asks for.
    on_overrule : callable, optional
        on_overrule(point, decision, reason) is called when somebody decides about a point,
        decision "keep" or "leave_out"; None: nobody can.

    Returns
    -------
    ipywidgets.Widget or SavedView
        A widget where ipywidgets is installed; else the same as a page without buttons, which
        `SavedView` gives as HTML.

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
    from tankcal.workbench.views.panels import live_view  # takes long to load

    return live_view(result, paper, on_overrule)
