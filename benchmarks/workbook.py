"""The workbook of the example beside pandas with openpyxl and with XlsxWriter: the same cells.

    python benchmarks/workbook.py

tankcal composes its sheets from the record, with styles, formulas, charts and names. pandas gets
the finished cells and writes their values only. Read again, all cells must be equal.
"""

import tempfile
import warnings
from pathlib import Path

import openpyxl
import pandas
from measured import ROOT, ROUNDS, Row, interleaved, tell

import tankcal
from tankcal.record import load
from tankcal.report import workbook

SAME = 16.0


def cells_of(path):
    """{(sheet, row, column): value} of a workbook; formulas as their text, empty cells left out."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of extensions that openpyxl leaves out
        book = openpyxl.load_workbook(path)
    return {
        (sheet.title, cell.row, cell.column): cell.value
        for sheet in book.worksheets
        for row in sheet.iter_rows()
        for cell in row
        if cell.value not in (None, "")
    }


def frame_of(cells, sheet):
    """The cells of a sheet as a table of pandas, from row 1 and column 1."""
    own = {
        (row - 1, column - 1): value
        for (name, row, column), value in cells.items()
        if name == sheet
    }
    rows, columns = (max(place) + 1 for place in zip(*own, strict=True))
    table = [[own.get((i, j)) for j in range(columns)] for i in range(rows)]
    return pandas.DataFrame(table, dtype=object)


def main():
    """A row for each engine of pandas."""
    with tempfile.TemporaryDirectory() as folder:
        result = tankcal.run(tankcal.load(ROOT / "examples" / "silva-1995"))
        tankcal.write(result, f"{folder}/results", papers=False)
        record, own = load(Path(folder) / "results" / "record.json"), Path(folder) / "own.xlsx"
        workbook.write(record, own)
        cells = cells_of(own)
        frames = {sheet: frame_of(cells, sheet) for sheet in dict.fromkeys(key[0] for key in cells)}

        def write(engine, path):
            with pandas.ExcelWriter(path, engine=engine) as file:
                for name, frame in frames.items():
                    frame.to_excel(file, sheet_name=name, header=False, index=False)

        tasks = {"tankcal": lambda: workbook.write(record, own)}
        for engine in ("openpyxl", "xlsxwriter"):
            path = Path(folder) / f"{engine}.xlsx"
            tasks[engine] = lambda engine=engine, path=path: write(engine, path)
        digits = {}
        for name, task in tasks.items():
            task()
            path = own if name == "tankcal" else Path(folder) / f"{name}.xlsx"
            digits[name] = SAME * (cells_of(path) == cells)
        spent = interleaved(tasks, ROUNDS)
    for engine in ("openpyxl", "xlsxwriter"):
        tell(Row("workbook of the example", f"{len(frames)} sheets, {len(cells)} cells",
                 spent["tankcal"], f"pandas with {engine}", pandas.__version__, spent[engine],
                 "all cells", (digits["tankcal"], digits[engine]), SAME,
                 note="values only"))  # fmt: skip


if __name__ == "__main__":
    main()
