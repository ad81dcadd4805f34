"""Declarations of tables: columns with key, unit, digits and headings, for every medium.

A `Table` defines its columns and the rows that it takes from a record. The writers are:

    paper (notebook, PDF, web page, terminal)  `plain.PlainPaper.show`, which returns a block
    workbook                                   `workbook.tables.columns_of`
    CSV                                        `outputs.write_table`

A new column requires a line in a module of this package, or in `tables` of a method, and a heading
in each language.
"""

from tankcal.methods.base import find_method
from tankcal.report.tables.table import Column, Table, decimals_of_cells

__all__ = ["Column", "Table", "decimals_of_cells"]


def __getattr__(name):
    # The cells of the notebook import the tables of every method from here.
    method = find_method(name)
    if method is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return method.report_tables()
