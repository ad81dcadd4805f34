"""Jobs: input files, read, checked and converted to SI (docs/job-format.md).

Names are imported at first use, so that the command line responds before the dataclasses load.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # for type checkers only; not executed
    from tankcal.job.loading import load
    from tankcal.job.model import (
        Bottom,
        Course,
        Datum,
        Deadwood,
        DeclaredInput,
        End,
        Horizontal,
        InputFile,
        Job,
        Material,
        Mesh,
        Points,
        Roof,
        Sphere,
        StatedVolume,
        Survey,
        Switches,
        TableSpec,
        Tank,
    )

__all__ = [
    "Bottom",
    "Course",
    "Datum",
    "Deadwood",
    "DeclaredInput",
    "End",
    "Horizontal",
    "InputFile",
    "Job",
    "Material",
    "Mesh",
    "Points",
    "Roof",
    "Sphere",
    "StatedVolume",
    "Survey",
    "Switches",
    "TableSpec",
    "Tank",
    "load",
]


def __getattr__(name):
    if name not in __all__:
        raise AttributeError(f"module 'tankcal.job' has no attribute {name!r}")
    module = "loading" if name == "load" else "model"
    return getattr(import_module(f"tankcal.job.{module}"), name)


def __dir__():
    return sorted(__all__)
