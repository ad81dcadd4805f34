"""Input workbooks of `tankcal new`, filled in as a person does: below the headings."""

import shutil
import subprocess

import openpyxl
import pytest


def headings_of(sheet):
    """({heading: number of its column}, row of the headings): the first row without a #."""
    for row in sheet.iter_rows():
        mark = str(row[0].value or "")
        if not mark.startswith("#") and any(cell.value for cell in row):
            return {cell.value: cell.column for cell in row if cell.value}, row[0].row
    raise AssertionError(f"no headings in {sheet.title}")


def first_row(sheet):
    """The first row for values: below the headings and the examples."""
    _, row = headings_of(sheet)
    while str(sheet.cell(row + 1, 1).value or "").startswith("#"):
        row += 1
    return row + 1


def place_of(sheet, key):
    """The cell of a setting, "tank.id", in the sheet job, cameras or instruments."""
    columns, heading = headings_of(sheet)
    owner = next(
        name for name in ("section", "camera", "instrument", "cloud", "meter") if name in columns
    )
    for row in range(heading + 1, sheet.max_row + 1):
        names = (sheet.cell(row, columns[name]).value for name in (owner, "key"))
        if ".".join(str(name) for name in names) == key:
            return sheet.cell(row, columns["value"])
    raise AssertionError(f"no row for {key}")


def fill_form(path, settings, tables):
    """Fill in a workbook: settings {"tank.id": value}, tables {name: [headings, *rows]}."""
    book = openpyxl.load_workbook(path)
    for key, value in settings.items():
        place_of(book["job"], key).value = value
    for name, (names, *rows) in tables.items():
        sheet = book[name]
        columns, _ = headings_of(sheet)
        for number, row in enumerate(rows, first_row(sheet)):
            for heading, value in zip(names, row, strict=True):
                if value is not None:
                    sheet.cell(number, columns[heading]).value = value
    book.save(path)


def saved_by_libreoffice(path, folder, by_way_of=()):
    """The workbook as LibreOffice saves it, through other formats when asked; skips without it."""
    soffice = shutil.which("soffice") or shutil.which("libreoffice")
    if soffice is None:
        pytest.skip("LibreOffice (soffice) is not installed: no workbook can be saved by it")
    profile = f"-env:UserInstallation={(folder / 'profile').as_uri()}"
    for step, ending in enumerate((*by_way_of, "xlsx")):
        out = folder / f"saved-{step}"
        command = [soffice, profile, "--headless", "--convert-to", ending, "--outdir", str(out)]
        subprocess.run([*command, str(path)], check=True, capture_output=True, timeout=200)
        path = out / f"{path.stem}.{ending}"
    return path
