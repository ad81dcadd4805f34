"""A linter for any capacity table: CSV, Excel workbook, or a record of tankcal.

grids, headings, numbers, layout   from a file to pairs of height and volume
heights                            order, steps, rows missing, doubled or swapped
volumes, examination               rounding, falls, rows that are not where the others put them
screening, hypotheses, suggestions   how that is found, how it is explained, what was meant
linting, totals, parts             units, total, last row; proportional parts
"""

from tankcal.linter.linting import Finding, Report, lint
from tankcal.linter.totals import Nominal

__all__ = ["Finding", "Nominal", "Report", "lint"]
