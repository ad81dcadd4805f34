"""Reports of a record: notebook, PDFs, web page, workbook, CSV files and digital certificate.

The reports format the values of the record and compute no results (docs/report.md).
"""

from tankcal.methods.base import find_method


def __getattr__(name):
    # The cells of the notebook import the figures of a method from here.
    method = find_method(name)
    if method is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return method.report_figures()
