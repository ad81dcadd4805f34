"""Safe reading of workbooks (.xlsx) from any source, in bounded time and memory."""

from tankcal.job.excel.archive import MAX_FILE_BYTES, Unreadable
from tankcal.job.excel.worksheet import MAX_COLUMNS, Sheet, column_letters, read_sheets

__all__ = [
    "MAX_COLUMNS",
    "MAX_FILE_BYTES",
    "Sheet",
    "Unreadable",
    "column_letters",
    "read_sheets",
]
