"""The network: all observations of a site in one adjustment.

Names are imported on first use, so that reading a job imports a Camera but not the solver.
"""

from importlib import import_module

_MODULE_OF = {
    "Adjusted": "adjustment",
    "Camera": "survey",
    "CleanedSurvey": "snooping",
    "Instrument": "survey",
    "Photos": "survey",
    "Residuals": "reliability",
    "Survey": "survey",
    "System": "survey",
    "adjust": "adjustment",
    "correlations": "adjustment",
    "predict": "adjustment",
    "snoop": "snooping",
}

__all__ = [*_MODULE_OF]


def __getattr__(name):
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'tankcal.survey.network' has no attribute {name!r}")
    return getattr(import_module(f"tankcal.survey.network.{_MODULE_OF[name]}"), name)
