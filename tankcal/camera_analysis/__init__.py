"""Cameras: which parameters belong, are two calibrations the same, what does a wrong one do.

Names are resolved when they are first used.
"""

from importlib import import_module

from tankcal.camera_analysis.versions import CAMERA

FORMAT = CAMERA.format  # of the plain data that every analysis gives

_ROOM_OF = {
    "analyse_job": "camera_analysis.parameters.analysing",
    "analyse_record": "camera_analysis.parameters.analysing",
    "compare": "camera_analysis.stability.comparing",
    "read_cameras": "job.calibrations",
}

__all__ = ["FORMAT", *_ROOM_OF]


def __getattr__(name):
    if name not in _ROOM_OF:
        raise AttributeError(f"module 'tankcal.camera_analysis' has no attribute {name!r}")
    return getattr(import_module(f"tankcal.{_ROOM_OF[name]}"), name)
