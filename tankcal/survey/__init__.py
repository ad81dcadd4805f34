"""Surveys: from the measurements on site to adjusted points with their covariance.

Names are imported on first use, so that reading a job imports the measurements but not the solver.
"""

from importlib import import_module

_MODULE_OF = {
    "Adjustment": "results",
    "Cause": "results",
    "Dependence": "results",
    "Nominal": "adjustment",
    "Predicted": "adjustment",
    "Reading": "results",
    "adjust_survey": "adjustment",
    "datum_dependence": "results",
    "predict_survey": "adjustment",
    "wall_points": "points",
}

__all__ = [*_MODULE_OF]


def __getattr__(name):
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'tankcal.survey' has no attribute {name!r}")
    return getattr(import_module(f"tankcal.survey.{_MODULE_OF[name]}"), name)


def __dir__():
    return sorted(__all__)
