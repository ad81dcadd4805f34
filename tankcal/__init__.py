"""tankcal: from what was measured on a storage tank to its capacity table, with its uncertainty.

>>> import tankcal
>>> job = tankcal.load("examples/silva-1995")        # a job folder or a job workbook
>>> result = tankcal.run(job)
>>> result.capacity                                   # the capacity table, one row a height

>>> job = tankcal.load("survey", only="adjustment")   # measurements without a tank
>>> tankcal.adjust_job(job).xyz_m                     # adjusted points, with their covariance

>>> result.plot("sections")                           # a drawing; `tankcal.plot` names them all

Names are resolved when they are first used, so importing tankcal loads nothing heavy.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # what a type checker reads; nothing of it runs
    from tankcal.errors import HeightError, InputError, SolutionError, TankcalError
    from tankcal.job import Job, load
    from tankcal.linter import lint
    from tankcal.pipeline.chain import Result, adjust_job, run
    from tankcal.pipeline.views import plot
    from tankcal.report.outputs import write
    from tankcal.survey import Adjustment

__version__ = "0.1.0"

_ROOM_OF = {
    "load": "job",
    "Job": "job",
    "run": "pipeline.chain",
    "adjust_job": "pipeline.chain",
    "Result": "pipeline.chain",
    "Adjustment": "survey",
    "plot": "pipeline.views",
    "write": "report.outputs",
    "lint": "linter",
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
    "write",
]


def __getattr__(name: str):
    if name not in _ROOM_OF:
        raise AttributeError(f"module 'tankcal' has no attribute {name!r}")
    return getattr(import_module(f"tankcal.{_ROOM_OF[name]}"), name)


def __dir__():
    return sorted(__all__)
