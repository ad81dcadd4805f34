"""Linter for capacity tables in CSV files, Excel workbooks, PDFs, or records of tankcal.

grids, headings, numbers, layout   from a file to pairs of height and volume
heights                            order, steps, missing, doubled and swapped rows
volumes, examination               rounding, falls, rows that disagree with their neighbours
screening, hypotheses, suggestions   detection, explanation and likely intended values
linting, totals, parts             units, total, last row; proportional parts
"""

from tankcal.linter.linting import Finding, Report, lint
from tankcal.linter.totals import Nominal

__all__ = ["Finding", "Nominal", "Report", "lint"]
