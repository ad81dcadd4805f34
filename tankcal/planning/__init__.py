"""Survey planning: predict the uncertainty of a capacity table before the survey is made.

Names are imported when they are first used.
"""

from importlib import import_module

_MODULE_OF = {
    "Plan": "model",
    "Prediction": "prediction",
    "greedy": "improvements",
    "load_plan": "reading",
    "predict": "prediction",
    "smallest": "improvements",
    "what_helps": "improvements",
}

__all__ = [*_MODULE_OF]


def __getattr__(name):
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'tankcal.planning' has no attribute {name!r}")
    return getattr(import_module(f"tankcal.planning.{_MODULE_OF[name]}"), name)
