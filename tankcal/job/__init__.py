"""The job: what the user hands in, read, checked and converted to SI (docs/job-format.md)."""

from tankcal.job.loading import load
from tankcal.job.model import (
    Course,
    Datum,
    DeclaredInput,
    InputFile,
    Job,
    Material,
    Points,
    Survey,
    TableSpec,
    Tank,
)

__all__ = [
    "Course",
    "Datum",
    "DeclaredInput",
    "InputFile",
    "Job",
    "Material",
    "Points",
    "Survey",
    "TableSpec",
    "Tank",
    "load",
]
