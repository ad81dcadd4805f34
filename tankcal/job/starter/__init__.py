"""Starter job of `tankcal new`: an empty form, as a folder of text files or as a workbook.

Both are written from the lists of `tankcal.job.contract`, so that they contain every key and
column.
"""

from tankcal.job.starter.writing import FilledForm, write_form, write_input_workbook, write_starter

__all__ = ["FilledForm", "write_form", "write_input_workbook", "write_starter"]
