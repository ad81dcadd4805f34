"""Linter for capacity tables in CSV files, Excel workbooks, PDFs, or records of tankcal.

grids                              cells of a file
headings, units, numbers           texts of headings and cells; feet and inches
layout, wide                       from cells to pairs of height and volume
heights                            order, steps, missing, doubled and swapped rows
volumes                            rounding, falls, likely intended values
examination                        rows that disagree with their neighbours, and explanations
totals                             units, total, last row
linting                            all checks of a file; proportional parts
rows                               rows of a table in SI units, for other packages
"""

from tankcal.products.base import Product


class Linter(Product):
    """Errors in capacity tables of any origin."""

    name = "linter"
    commands = (("lint", "tankcal.products.linter.command"),)
