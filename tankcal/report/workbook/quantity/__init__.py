"""The sheet Quantity: from two dips to the quantity of product and its U, by formulas.

The formulas compute the steps of `tankcal ticket` (docs/ticket.md): volume corrections in closed
form or by Newton iterations, and U by analytic sensitivities. Results outside a range are refused.
"""

from tankcal.report.workbook.quantity.form import quantity_sheets

__all__ = ["quantity_sheets"]
