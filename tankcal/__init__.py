"""tankcal: from what was measured on a storage tank to its capacity table, with its uncertainty.

>>> import tankcal
>>> job = tankcal.load("examples/silva-1995")  # a job folder or a job workbook
>>> result = tankcal.run(job)
>>> result.capacity.shape  # the capacity table, one row a height
(951, 8)
>>> print(result.at(4.217))  # a dip between two rows
554.6 m3, U = 1.2 m3 (k = 1.96)
>>> print(result.delivery(2.0, 7.5))
723.56 m3, U = 0.78 m3 (k = 1.96)

`result.plot("sections")` is a drawing; `tankcal.plot` names them all. Measurements without a tank:
`tankcal.adjust_job(tankcal.load("survey", only="adjustment"))` gives points and covariance.

Names are resolved when they are first used, so importing tankcal loads nothing heavy.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # what a type checker reads; nothing of it runs
    from tankcal.errors import HeightError, InputError, SolutionError, TankcalError
    from tankcal.job import Job, load
    from tankcal.pipeline.chain import Result, adjust_job, run
    from tankcal.products.linter.linting import lint
    from tankcal.products.quantity.ticketing import ticket
    from tankcal.report.outputs import write
    from tankcal.report.plots.views import plot
    from tankcal.survey import Adjustment

    __version__: str

_MODULE_OF = {
    "load": "job",
    "Job": "job",
    "run": "pipeline.chain",
    "adjust_job": "pipeline.chain",
    "Result": "pipeline.chain",
    "Adjustment": "survey",
    "plot": "report.plots.views",
    "write": "report.outputs",
    "lint": "products.linter.linting",
    "ticket": "products.quantity.ticketing",
    "TankcalError": "errors",
    "InputError": "errors",
    "SolutionError": "errors",
    "HeightError": "errors",
}

__all__ = [
    "Adjustment",
    "HeightError",
    "InputError",
    "Job",
    "Result",
    "SolutionError",
    "TankcalError",
    "__version__",
    "adjust_job",
    "lint",
    "load",
    "plot",
    "run",
    "ticket",
    "write",
]


def __getattr__(name: str):
    if name == "__version__":
        return import_module("tankcal.version").find_version()
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'tankcal' has no attribute {name!r}")
    return getattr(import_module(f"tankcal.{_MODULE_OF[name]}"), name)


def __dir__():
    return sorted(__all__)
