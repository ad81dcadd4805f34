"""Cameras: which parameters belong, are two calibrations the same, what does a wrong one do.

Names are resolved when they are first used.
"""

from importlib import import_module

_ROOM_OF = {
    "analyse_job": "calibration.parameters.analysis",
    "analyse_record": "calibration.parameters.analysis",
    "compare": "calibration.stability.comparison",
    "read_cameras": "job.calibrations",
}

__all__ = [*_ROOM_OF]


def __getattr__(name):
    if name not in _ROOM_OF:
        raise AttributeError(f"module 'tankcal.calibration' has no attribute {name!r}")
    return getattr(import_module(f"tankcal.{_ROOM_OF[name]}"), name)
