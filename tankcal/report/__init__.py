"""Reports of a record: notebook, PDFs, web page, workbook, CSV files and digital certificate.

The reports format the values of the record and compute no results (docs/report.md).
"""
