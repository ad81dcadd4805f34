"""The dip calculator: a form with formulas, and the sheets that the formulas read.

The form computes the volume of a dip with U, in service and at the temperature of the product. It
also computes the dip of a volume, and a delivery between two dips with its U. Input outside the
table is refused with a message.
"""

from tankcal.report.workbook.calculator.form import calculator_sheets
from tankcal.report.workbook.calculator.table import factor_sheet

__all__ = ["calculator_sheets", "factor_sheet"]
