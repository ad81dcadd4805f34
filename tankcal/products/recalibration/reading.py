"""Read a former table: rows with the linter's readers, other facts from former.toml."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tankcal.errors import InputError
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.products.linter.rows import read_rows
from tankcal.products.recalibration.former import (
    FormerFacts,
    FormerRoof,
    FormerTable,
    read_former_facts,
)
from tankcal.record import load
from tankcal.record.covariance_factor import factor_of

MOST_FINDINGS = 20  # largest number of linter findings listed in an error
USUAL_K = 2.0
_RECORD_VALUES = (
    "reference_temperature_c", "liquid_density_kg_m3", "reference_height_m", "date", "method",
    "laboratory", "number", "kind", "dip_from_a_m",
)  # fmt: skip


def read_former(path, former_toml=None) -> FormerTable:
    """Read a former capacity table.

    Parameters
    ----------
    path : path
        A CSV file, an Excel workbook (.xlsx), a PDF with a text table, or a record.json of
        tankcal; heights in any unit that its headings name, feet and inches, or ullages. Or a
        former.toml that names such a file under `file`.
    former_toml : path, optional
        former.toml with other facts about the table (docs/read-table.md).

    Returns
    -------
    FormerTable
        Table in SI units, with rising dips, and the warnings of the linter.

    Raises
    ------
    InputError
        With all problems: of former.toml, of an unreadable file, errors found by the linter, and
        undetermined units, columns or reference heights.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from tankcal.products.recalibration.reading import read_former
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "old.csv")
    ...     size = path.write_text("Dip (cm);Volume (L)\\n0;0\\n10;1629\\n20;3259\\n30;4889\\n")
    ...     former = read_former(path)
    >>> former.height_m.tolist(), former.volume_m3.tolist(), former.volume_quantum_m3
    ([0.0, 0.1, 0.2, 0.3], [0.0, 1.629, 3.259, 4.889], 0.001)
    """
    path, log = Path(path), Log()
    declared = FormerFacts()
    if former_toml is None and path.suffix.lower() == ".toml":
        former_toml = path
        declared = read_former_facts(path, log)
        path = _find_named_file(declared, path, log)
    elif former_toml is not None:
        declared = read_former_facts(former_toml, log)
        _check_name(declared, path, log)
    rows, warnings = _read_rows(path, declared, log)
    if rows is None:
        log.stop_if_problems()
        raise AssertionError("no rows and no problem")
    with path.open("rb") as file:
        start = file.read(64).lstrip(b"\xef\xbb\xbf \t\r\n")
    record = load(path) if path.suffix.lower() == ".json" or start[:1] == b"{" else None
    if record is None:
        former = _table_from_rows(rows, declared, log)
    else:
        former = _table_from_record(path, record, declared, log)
    log.stop_if_problems()
    return replace(former, warnings=warnings + tuple(log.warnings))


def _find_named_file(declared, path, log):
    """Return the file of the table named in a former.toml; raise InputError if none is named."""
    if declared["file"] is None:
        if not log.problems:
            expected = message("former_no_file", "missing; expected the table's file")
            declared.tell(log, "file", expected)
        log.stop_if_problems()
    named = Path(declared["file"])
    if named.name != declared["file"] or named.name in (".", ".."):
        expected = message(
            "former_file_elsewhere",
            "found {found}; expected the plain name of a file beside former.toml",
            found=declared["file"],
        )
        declared.tell(log, "file", expected)
        log.stop_if_problems()
    return path.parent / named


def _check_name(declared, path, log):
    if declared["file"] is not None and Path(declared["file"]).name != path.name:
        expected = message(
            "former_other_file",
            "found {found}, but the table is {name}; expected what is known of that one",
            found=declared["file"],
            name=path.name,
        )
        declared.tell(log, "file", expected)


def _read_rows(path, declared, log):
    """Return (TableRows or None, warnings); errors of the linter are reported to `log`."""
    try:
        rows, report = read_rows(
            path, log, declared["sheet"], declared.units, declared["volume_column"]
        )
    except InputError as error:
        log.problems += error.problems[:MOST_FINDINGS]
        return None, ()
    errors = [finding.problem for finding in report.findings if finding.severity == "error"]
    if errors:
        expected = message(
            "former_is_wrong",
            "the table has errors ({count}), so nothing is computed from it; correct them first "
            "(tankcal lint shows all)",
            count=len(errors),
        )
        log.problem(path.name, expected)
        log.problems += errors[:MOST_FINDINGS]
        return None, ()
    return rows, tuple(finding.problem for finding in report.findings)


def _table_from_rows(rows, declared, log):
    """Return the FormerTable of rows and of declared facts."""
    height = rows.height_m
    if rows.is_ullage:
        height = _dips(rows, declared, log)
    U, k = _uncertainty(rows, declared, log)
    quantum = declared["rounding_m3"] or rows.volume_quantum_m3
    return FormerTable(
        name=str(rows.name),
        height_m=height,
        volume_m3=rows.volume_m3,
        height_quantum_m=rows.height_quantum_m,
        volume_quantum_m3=quantum,
        U_m3=U,
        k=k,
        common=declared["common"],
        roof=declared.roof,
        height_rounding_m=rows.height_rounding_m,
        row=rows.row,
        **{key: declared[key] for key in _RECORD_VALUES},
    )


def _dips(rows, declared, log):
    """Return dips (rows,) from ullages and the reference height."""
    reference = declared["reference_height_m"]
    if reference is None:
        expected = message(
            "former_ullages",
            "a table of ullages; expected reference_height_m in former.toml, from the dip plate "
            "to the point that ullages count from",
        )
        log.problem(rows.name, expected)
        return rows.height_m
    dips = np.round(reference + rows.height_m, 9)
    lowest = float(dips[0])
    if lowest < -rows.height_quantum_m - 1e-9:
        expected = message(
            "former_low_reference",
            "the largest ullage is {ullage:g} m, {below:g} m more than reference_height_m; "
            "expected a reference height of at least that",
            ullage=-float(rows.height_m[0]),
            below=-lowest,
        )
        log.problem(rows.name, expected, int(rows.row[0]))
    return dips


def _uncertainty(rows, declared, log):
    """Return ((rows,) U in m3 or None, k), from the table or as declared."""
    k = rows.k if rows.k is not None else declared["k"]
    in_table = rows.U_m3 is not None or rows.u_m3 is not None
    if declared.uncertainty is not None and in_table:
        expected = message(
            "former_U_twice",
            "given, but the table has a column of uncertainties; expected only one of them",
        )
        declared.tell(log, declared.uncertainty[0], expected)
        return None, USUAL_K
    if not in_table and declared.uncertainty is None:
        return None, k or USUAL_K
    if k is None:
        k = USUAL_K
        if rows.U_m3 is not None:
            text = message(
                "former_no_factor",
                "expanded uncertainties without a coverage factor: taken as k = {k:g}",
                k=k,
            )
            log.warning(rows.name, text)
    if rows.U_m3 is not None:
        return rows.U_m3, k
    if rows.u_m3 is not None:
        return k * rows.u_m3, k
    key, value = declared.uncertainty
    scale = rows.volume_m3 / 100 if key.endswith("percent") else np.ones(len(rows.volume_m3))
    return (value if key.startswith("U") else k * value) * scale, k


def _table_from_record(path, record, declared, log):
    """Return the FormerTable of a record; declared facts must not contradict it."""
    table, job = record["capacity"], record["job"]
    certificate, choices = job.get("certificate") or {}, _choices(record)
    density = choices.get("head", job["table"].get("liquid_density_kg_m3"))
    survey = job.get("survey") or {}
    values = {
        "reference_temperature_c": job["table"].get("reference_temperature_c"),
        "liquid_density_kg_m3": density if isinstance(density, int | float) else 0.0,
        "reference_height_m": (job.get("datum") or {}).get("reference_height_m"),
        "date": survey.get("date"),
        "method": certificate.get("method") or choices.get("survey"),
        "laboratory": certificate.get("laboratory"),
        "number": certificate.get("number"),
        "kind": job["tank"].get("kind"),
        "dip_from_a_m": (job.get("horizontal") or {}).get("dip_from_a_m"),
    }
    for key in _RECORD_VALUES:
        stated = declared[key]
        if values[key] is None:
            values[key] = stated
        elif stated is not None and not _are_equal(stated, values[key]):
            expected = message(
                "former_against_record",
                "found {found}, but the record has {has}; expected no such key: it is taken from "
                "the record",
                found=str(stated),
                has=str(values[key]),
            )
            declared.tell(log, key, expected)
    for key in ("U_m3", "U_percent", "u_m3", "u_percent", "k", "rounding_m3"):
        if declared[key] is not None:
            expected = message(
                "former_known_to_record",
                "given for a record of tankcal, which has it; expected no such key",
            )
            declared.tell(log, key, expected)
    return FormerTable(
        name=path.name,
        height_m=np.array(table["height_m"], dtype=float),
        volume_m3=np.array(table["volume_m3"], dtype=float),
        U_m3=np.array(table["stated_U_m3"], dtype=float),
        k=float(np.median(table["k"])),
        common=declared["common"],
        roof=_roof_of_record(record) or declared.roof,
        factor_m3=factor_of(table),
        record=record,
        **values,
    )


def _choices(record):
    return {choice["code"]: choice["value"] for choice in record["choices"]}


def _are_equal(stated, has):
    if isinstance(stated, int | float) and isinstance(has, int | float):
        return abs(stated - has) <= 1e-9 * max(abs(stated), abs(has))
    return stated == has


def _roof_of_record(record):
    """Return the FormerRoof deducted in the record's table, or None."""
    details = {roof["code"]: roof["value"] for roof in record.get("roof") or ()}
    if not details or _choices(record).get("roof") == "off":
        return None
    critical = details.get("roof_critical_bottom"), details.get("roof_critical_top")
    return FormerRoof(
        float(details["roof_mass"]),
        float(details["roof_reference_density"]),
        details["roof_weighing"],
        None if None in critical else tuple(map(float, critical)),
    )
