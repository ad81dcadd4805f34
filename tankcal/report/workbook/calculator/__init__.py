"""The dip calculator: a form of live formulas, and the sheets that it reads.

A dip gives the volume with U, in service and at the temperature of the product; a volume gives its
dip; two dips a delivery with its own U. Everything is refused in words that the table cannot give.
"""

from tankcal.report.workbook.calculator.factor import factor_sheet
from tankcal.report.workbook.calculator.form import calculator_sheets

__all__ = ["calculator_sheets", "factor_sheet"]
