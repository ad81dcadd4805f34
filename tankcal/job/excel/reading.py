"""Content of a workbook as plain cells, sheet by sheet."""

import posixpath
from dataclasses import dataclass

from tankcal.job.excel.archive import Unreadable, damaged, open_archive
from tankcal.job.excel.markup import parse
from tankcal.job.excel.values import Values, read_formats, read_strings
from tankcal.job.excel.worksheet import Grid, read_grid

_BOOK = "xl/workbook.xml"
_RELATIONS = "xl/_rels/workbook.xml.rels"


@dataclass(frozen=True)
class Sheet:
    """A sheet with its title; is_hidden: its tab is hidden."""

    title: str
    is_hidden: bool
    grid: Grid


def read_sheets(data, is_wanted):
    """Read the sheets of a workbook.

    Parameters
    ----------
    data : bytes
        Content of the workbook.
    is_wanted : callable
        is_wanted(title) returns False for sheets that are not parsed.

    Returns
    -------
    list of Sheet

    Raises
    ------
    Unreadable
        If the workbook cannot be read, with the reason.
    """
    archive = open_archive(data)
    try:
        return _sheets(archive, is_wanted)
    except Unreadable:
        raise
    except Exception:  # a damaged part may contain any value
        raise damaged() from None


def _sheets(archive, is_wanted):
    listed, epoch = _read_book(archive)
    parts = _read_relations(archive)
    strings = formats = ()
    for kind, member in parts.values():
        if kind == "sharedStrings":
            strings = read_strings(archive, member)
        elif kind == "styles":
            formats = read_formats(archive, member)
    values = Values(strings, formats, epoch)
    sheets = []
    for title, is_hidden, relation in listed:
        kind, member = parts[relation]
        if kind == "worksheet" and is_wanted(title):
            sheets.append(Sheet(title, is_hidden, read_grid(archive, member, values, title)))
    return sheets


def _read_book(archive):
    """([(title, is it hidden, its relation)], first day of the calendar of dates)."""
    from openpyxl.utils.datetime import CALENDAR_MAC_1904, CALENDAR_WINDOWS_1900

    listed, epochs = [], [CALENDAR_WINDOWS_1900]

    def sheet(attributes):
        relation = next(value for key, value in attributes.items() if key.endswith(":id"))
        is_hidden = attributes.get("state", "visible") != "visible"
        listed.append((attributes["name"], is_hidden, relation))

    def properties(attributes):
        if attributes.get("date1904") in ("1", "true"):
            epochs.append(CALENDAR_MAC_1904)

    parse(archive, _BOOK, {"sheet": sheet, "workbookPr": properties}, {})
    return listed, epochs[-1]


def _read_relations(archive):
    """{relation: (kind of part, its name in the archive)}."""
    parts = {}

    def relation(attributes):
        target = posixpath.normpath(posixpath.join("/xl", attributes["Target"]))
        kind = attributes["Type"].rpartition("/")[2]
        parts[attributes["Id"]] = (kind, target.lstrip("/"))

    parse(archive, _RELATIONS, {"Relationship": relation}, {})
    return parts
