"""Camera calibration: choice of parameters, stability, and influence on the capacity.

Functions are imported when they are first used.
"""

from importlib import import_module

_MODULES = {
    "analyse_job": "calibration.parameters.analysis",
    "analyse_record": "calibration.parameters.analysis",
    "compare": "calibration.stability.comparison",
    "read_cameras": "job.calibrations",
}

__all__ = [*_MODULES]


def __getattr__(name):
    if name not in _MODULES:
        raise AttributeError(f"module 'tankcal.calibration' has no attribute {name!r}")
    return getattr(import_module(f"tankcal.{_MODULES[name]}"), name)
