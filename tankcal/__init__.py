"""tankcal: from what was measured on a storage tank to its capacity table, with its uncertainty.

>>> import tankcal
>>> job = tankcal.load("examples/silva-1995")        # a job folder or a job workbook
>>> result = tankcal.run(job)
>>> result.capacity                                   # the capacity table, one row a height

>>> job = tankcal.load("survey", only="adjustment")   # measurements without a tank
>>> tankcal.adjust_job(job).xyz_m                     # adjusted points, with their covariance

Names are resolved when they are first used, so importing tankcal loads nothing heavy.
"""

from importlib import import_module

__version__ = "0.1.0"

_ROOM_OF = {
    "load": "job",
    "Job": "job",
    "run": "chain",
    "adjust_job": "chain",
    "Result": "chain",
    "write": "outputs",
    "TankcalError": "errors",
    "InputError": "errors",
    "SolutionError": "errors",
}

__all__ = ["__version__", *_ROOM_OF]


def __getattr__(name):
    if name not in _ROOM_OF:
        raise AttributeError(f"module 'tankcal' has no attribute {name!r}")
    return getattr(import_module(f"tankcal.{_ROOM_OF[name]}"), name)


def __dir__():
    return sorted(__all__)
