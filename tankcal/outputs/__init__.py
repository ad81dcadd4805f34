"""Everything that a run leaves behind, written all or nothing."""

import shutil
import tempfile
from pathlib import Path

from tankcal import record as records
from tankcal import report, workbook
from tankcal.errors import InputError, Problem
from tankcal.outputs import tables

WORKBOOKS = ("capacity.xlsx", "adjustment.xlsx")
FILES = ("record.json", *tables.FILES, *WORKBOOKS, *report.FILES)


def write(result, directory, progress=None):
    """Write record, CSV files, workbook, notebook, PDFs and HTML of a `chain.Result`.

    directory  made when missing; earlier results there are replaced when all is written, and a
               folder that holds anything else is refused
    progress   called as progress(text, done, total)
    Returns the paths. Raises InputError for a folder that is not tankcal's to replace.
    """
    return _write(
        lambda: records.record_of(result),
        result.adjustment,
        "capacity.xlsx",
        directory,
        progress,
    )


def write_adjustment(job, adjustment, directory, progress=None):
    """The same for a survey that was only adjusted (`surveys.Adjustment` of a `Job`)."""
    return _write(
        lambda: records.record_of_adjustment(job, adjustment),
        adjustment,
        "adjustment.xlsx",
        directory,
        progress,
    )


def _write(make_record, adjustment, workbook_name, directory, progress):
    refuse_foreign(directory)
    target = Path(directory).resolve()  # where a link points to
    tell = progress or (lambda text, done, total: None)
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=".tankcal-", dir=target.parent))
    try:
        tell("writing the record and the workbook", 0, 1)
        record = make_record()
        records.save(record, temporary / "record.json")
        tables.write_tables(record, temporary)
        if adjustment is not None:
            tables.write_covariance(adjustment, temporary)
        workbook.write(record, temporary / workbook_name)
        report.build(
            temporary / "record.json",
            temporary,
            lambda done, total: tell("writing the report", done, total),
        )
        temporary.chmod(0o755)
        _swap(temporary, target)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return [Path(directory) / name for name in FILES if (target / name).exists()]


def refuse_foreign(directory):
    """Raise InputError when `directory` exists and holds anything but results of tankcal."""
    directory = Path(directory)
    if not directory.exists():
        return
    if not directory.is_dir():
        raise InputError(Problem(directory.name, "is a file; expected a folder for the results"))
    foreign = sorted(path.name for path in directory.iterdir() if path.name not in FILES)
    if foreign:
        raise InputError(
            Problem(
                directory.name,
                f"holds {foreign[0]!r}, which tankcal did not write; expected an empty folder or "
                "one with earlier results only: move your files away or choose another --out",
            )
        )


def _swap(temporary, directory):
    """Put `temporary` in the place of `directory`; the old one goes last."""
    if not directory.exists():
        temporary.rename(directory)
        return
    aside = Path(tempfile.mkdtemp(prefix=".tankcal-old-", dir=directory.parent))
    try:
        directory.rename(aside / directory.name)
        try:
            temporary.rename(directory)
        except OSError:
            (aside / directory.name).rename(directory)
            raise
    finally:
        shutil.rmtree(aside, ignore_errors=True)
