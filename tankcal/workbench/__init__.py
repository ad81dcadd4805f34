"""Workbench: edit, check and compute a job in a notebook (docs/notebook.md)."""

from tankcal.workbench.computing import Refusal
from tankcal.workbench.desk import Desk, open_job

__all__ = ["Desk", "Refusal", "open_job"]
