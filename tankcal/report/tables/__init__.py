"""Tables, declared once: columns with key, unit, digits and headings, for every medium.

A `Table` says which columns it has, and what of the record its rows are. Who writes it:

    paper (notebook, PDF, web page, terminal)  `plain.PlainPaper.show`, which makes a block
    workbook                                   `workbook.tables.columns_of`
    CSV                                        `outputs.csv_files.write_table`

A new column is a line in one of the modules here, and its heading in the words of each language.
"""

from tankcal.report.tables.table import Column, Table, decimals_of_cells

__all__ = ["Column", "Table", "decimals_of_cells"]
