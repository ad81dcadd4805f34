"""Links of a workbook: those of the index on the first sheet."""


def is_in_index(cell, book):
    """Whether a cell links to a sheet of the book, and shows the name of that sheet."""
    link = cell.hyperlink
    if link is None or link.target is not None or cell.parent is not book.worksheets[0]:
        return False
    return cell.value in book.sheetnames and link.location == f"'{cell.value}'!A1"
