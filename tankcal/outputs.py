"""Everything that a run leaves behind, written all or nothing."""

import shutil
import tempfile
from pathlib import Path

import pandas as pd

from tankcal import record as records
from tankcal import report, workbook
from tankcal.errors import InputError, Problem

DATA_FILES = ("record.json", "points.csv", "sections.csv", "capacity.csv", "capacity.xlsx")
FILES = DATA_FILES + report.FILES


def write(result, directory, progress=None):
    """Write record, CSV files, workbook, notebook, PDFs and HTML of a `chain.Result`.

    directory  made when missing; earlier results there are replaced when all is written, and a
               folder that holds anything else is refused
    progress   called as progress(text, done, total)
    Returns the paths. Raises InputError for a folder that is not tankcal's to replace.
    """
    refuse_foreign(directory)
    target = Path(directory).resolve()  # where a link points to
    tell = progress or (lambda text, done, total: None)
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=".tankcal-", dir=target.parent))
    try:
        tell("writing the record and the workbook", 0, 1)
        record = records.record_of(result)
        records.save(record, temporary / "record.json")
        _write_tables(record, temporary)
        workbook.write(record, temporary / "capacity.xlsx")
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


def _write_tables(record, directory):
    """points.csv, sections.csv and capacity.csv: the record's tables, those that have rows."""
    reason = {row["point"]: row["reason"] for row in record["rejected"]}
    points = pd.DataFrame(
        [
            {
                **{key: row[key] for key in ("point", "x_m", "y_m", "z_m")},
                **_sds_mm(row["cov_m2"]),
                "course": row["course"],
                "section": row["section"],
                "generatrix": row["generatrix"],
                "residual_mm": None if row["residual_m"] is None else 1000 * row["residual_m"],
                "used": "yes" if row["used"] else "no",
                "reason": reason.get(row["point"], ""),
            }
            for row in record["points"]
        ]
    )
    sections = pd.DataFrame(record["sections"]).drop(
        columns=["points", "azimuth_deg", "residual_m", "outline", "modes"], errors="ignore"
    )
    for name, table in (
        ("points", points),
        ("sections", sections),
        ("capacity", _capacity_table(record)),
    ):
        if len(table):
            table.to_csv(
                directory / f"{name}.csv", index=False, float_format="%.6f", lineterminator="\n"
            )


def _capacity_table(record):
    """Rows in metres and cubic metres; further columns only where the job asks for them."""
    capacity, spec = record["capacity"], record["job"]["table"]
    columns = {key: capacity[key] for key in ("height_m", "volume_m3", "u_m3", "k", "U_m3")}
    if spec["height_unit"] != "m":
        columns["dip"] = capacity["dip"]
    for other in record["densities"]:
        columns[f"volume_m3_at_{other['density_kg_m3']:g}_kg_m3"] = other["volume_m3"]
    if not all(capacity["for_use"]):
        columns["for_use"] = ["yes" if good else "no" for good in capacity["for_use"]]
    return pd.DataFrame(columns)


def _sds_mm(covariance):
    diagonal = [None] * 3 if covariance is None else [covariance[i][i] for i in range(3)]
    return {
        f"s{axis}_mm": None if variance is None else 1000 * variance**0.5
        for axis, variance in zip("xyz", diagonal, strict=True)
    }
