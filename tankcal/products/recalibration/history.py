"""History of the tables of one tank: volumes and radii on one basis, and changes between tables.

Every table is compared with the newest one (`recalibration.comparison.compare`), which brings it
to the newest basis. Each table is also compared with the one before it, which shows the changes
between them. All results are results of these comparisons.
"""

from dataclasses import dataclass
from datetime import date
from itertools import pairwise

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.recalibration.agreement import coverage_factor, normalized_error
from tankcal.products.recalibration.comparison import PARTS_OF_HEIGHT, compare
from tankcal.products.recalibration.former import FormerTable
from tankcal.record.history import (
    CertificateInHistory,
    HistoryFile,
    RadiusChange,
    RadiusInHistory,
    TableChange,
    VolumeInHistory,
)
from tankcal.record.texts import warnings_of

DAYS_OF_YEAR = 365.25
MOST_WARNINGS = 100
SAME_M = 1e-3  # largest difference of equal dimensions and reference heights


@dataclass(frozen=True)
class DatedTable:
    """A capacity table of a tank, with its date.

    Attributes
    ----------
    table : FormerTable
        Its name is its location.
    sha256 : str
        SHA-256 of its file.
    day : date
    """

    table: FormerTable
    sha256: str
    day: date

    @property
    def tank(self):
        """Id of the tank in the record; None without a record."""
        record = self.table.record
        return None if record is None else record["job"]["tank"].get("id")


def history_of(
    tables,
    inspections=(),
    months=(),
    *,
    dips_m=None,
    courses=None,
    register=None,
    left_out=(),
    warnings=(),
    progress=None,
):
    """Return the history of a tank.

    Parameters
    ----------
    tables : sequence of DatedTable
        At least one table, in any order.
    inspections : sequence of InspectionInHistory
    months : sequence of MonthInHistory
    dips_m : sequence of float, optional
        Dips of the volumes shown; None: fifths of the common range of all tables.
    courses : (heights, thicknesses), optional
        Courses of an upright tank, m, if no record has them.
    register : dict, optional
        {number: RegisteredCertificate} of `products.register`; None: states are not known.
    left_out, warnings : sequence of Problem
        Problems met while files were searched and read.
    progress : callable, optional
        progress(text, done, total)

    Returns
    -------
    record.history.HistoryFile

    Raises
    ------
    InputError
        With every pair of tables that cannot be of one tank, and every dip outside all tables.

    Examples
    --------
    >>> import numpy as np
    >>> dips = np.linspace(0.0, 8.0, 81)
    >>> def table(year, area):
    ...     rows = FormerTable(f"{year}.csv", dips, area * dips, U_m3=0.2 * dips)
    ...     return DatedTable(rows, "", date(year, 5, 1))
    >>> history = history_of([table(2020, 100.05), table(2010, 100.0)])
    >>> [entry.date for entry in history.certificates], round(history.changes[0].top_d_m3, 3)
    (['2010-05-01', '2020-05-01'], 0.4)
    """
    ordered = sorted(tables, key=_sort_key)
    progress = progress or (lambda text, done, total: None)
    on_newest, successive = _comparisons(ordered, courses, progress)
    k = coverage_factor(_newest_with_U(ordered))
    rows = _select_dips(on_newest, dips_m)
    newest = ordered[-1].table
    problems = [*warnings, *_table_warnings(ordered), *_register_warnings(ordered, register)]
    return HistoryFile(
        notice=_notice(newest),
        tank=next((table.tank for table in reversed(ordered) if table.tank), None),
        kind=newest.kind or ordered[0].table.kind,
        coverage_k=k,
        certificates=_certificates(ordered, register),
        dips_m=rows,
        volumes=[
            volume
            for number, comparison in enumerate(on_newest, 1)
            for volume in _volumes(number, comparison, rows)
        ],
        radii=[
            radius
            for number, comparison in enumerate(on_newest, 1)
            for radius in _radii(number, comparison, k)
        ],
        changes=[
            _change(number, comparison, ordered[number - 1 : number + 1], k)
            for number, comparison in enumerate(successive, 1)
        ],
        inspections=sorted(
            inspections,
            key=lambda inspection: (inspection.date is None, inspection.date, inspection.file),
        ),
        months=sorted(months, key=lambda month: (month.month, month.file)) or None,
        left_out=warnings_of(left_out),
        warnings=_warnings(problems, successive),
    )


def _sort_key(table):
    """Sort key: date, then number, program and file, so that the order is reproducible."""
    record = table.table.record or {}
    return table.day, str(table.table.number or ""), record.get("tankcal") or "", table.table.name


def _newest_with_U(ordered):
    """Newest table with U, else the newest table."""
    known = [table.table for table in ordered if table.table.U_m3 is not None]
    return known[-1] if known else ordered[-1].table


def _comparisons(ordered, courses, progress):
    """Compare each table with the newest, and with the one before: two lists of ComparisonFile."""
    newest, problems, comparisons = ordered[-1].table, {}, ([], [])
    pairs = [(0, table.table, newest) for table in ordered]
    pairs += [(1, a.table, b.table) for a, b in pairwise(ordered)]
    for done, (role, former, new) in enumerate(pairs):
        text = message("history_comparing", "comparing {count} tables", count=len(ordered))
        progress(text, done, len(pairs))
        try:
            comparisons[role].append(compare(former, new, courses=courses))
        except InputError as error:
            problems |= dict.fromkeys(error.problems)
    if problems:
        raise InputError(list(problems))
    return comparisons


def _warnings(problems, comparisons):
    """Return problems and warnings of the comparisons as WarningRecords, without duplicates."""
    records = warnings_of(problems)
    for comparison in comparisons:
        records += [
            warning for warning in comparison.warnings if warning.code != "compare_dates_turned"
        ]
    return list({(record.file, record.text): record for record in records}.values())[:MOST_WARNINGS]


def _notice(table):
    certificate = (table.record or {}).get("job", {}).get("certificate") or {}
    return str(certificate.get("notice") or "")


# ---- content of the file


def _register_warnings(ordered, register):
    """Yield a Problem for each certificate whose number the register has for another record."""
    for dated in ordered:
        entry = (register or {}).get(str(dated.table.number or "").strip())
        if entry and dated.table.record is not None and entry.record_sha256 != dated.sha256:
            text = message(
                "history_other_record",
                "number {number} is registered for another record; expected the record that the "
                "register names",
                number=entry.number,
            )
            yield Problem(dated.table.name, text)


def _state(table, register):
    """Return the state of a certificate and its date, as keys of CertificateInHistory."""
    if register is None:
        return {}
    entry = register.get(str(table.number or "").strip())
    if entry is None:
        return {"state": "not_registered"}
    return {"state": entry.state, "state_since": entry.since}


def _certificates(ordered, register):
    days = [table.day.isoformat() for table in ordered]
    certificates = []
    for number, (dated, after) in enumerate(zip(ordered, [*days[1:], None], strict=True), 1):
        table, record = dated.table, dated.table.record
        tank = {} if record is None else record["job"]["tank"]
        rule = None if record is None else record.get("rule")
        fit = None if record is None else record.get("adjustment")
        certificates.append(
            CertificateInHistory(
                certificate=number,
                file=table.name,
                sha256=dated.sha256,
                origin="table" if record is None else "record",
                tank=dated.tank,
                date=dated.day.isoformat(),
                superseded=after,
                number=table.number,
                laboratory=table.laboratory,
                method=table.method,
                tankcal=None if record is None else record["tankcal"],
                nominal_diameter_m=tank.get("nominal_diameter_m"),
                nominal_height_m=tank.get("nominal_height_m"),
                reference_temperature_c=table.reference_temperature_c,
                liquid_density_kg_m3=table.liquid_density_kg_m3,
                reference_height_m=table.reference_height_m,
                zero=None if record is None else record["capacity"].get("zero"),
                top_dip_m=float(table.height_m[-1]),
                top_volume_m3=float(table.volume_m3[-1]),
                U_top_m3=None if table.U_m3 is None else float(table.U_m3[-1]),
                k=None if table.U_m3 is None else table.k,
                rule=rule and rule["rule"]["name"],
                rule_verdict=rule and rule["code"],
                sigma0=fit and fit["sigma0"],
                global_test_passed=fit and fit["passed"] if fit and fit["redundancy"] else None,
                **_state(table, register),
            )
        )
    return certificates


def _select_dips(on_newest, dips_m):
    """Dips of the newest table, for use in all comparisons, at which volumes are shown."""
    common = None
    for comparison in on_newest:
        use = set(
            np.asarray(comparison.rows.height_m)[np.asarray(comparison.rows.for_use)].tolist()
        )
        common = use if common is None else common & use
    dips = np.array(sorted(common))
    if not len(dips):
        expected = message("history_no_range", "no dip that every table has; expected one")
        raise InputError(Problem(on_newest[-1].new.name, expected))
    if dips_m is None:
        wanted = [dips[0] + part * (dips[-1] - dips[0]) for part in PARTS_OF_HEIGHT]
    else:
        wanted = list(dips_m)
        outside = [dip for dip in wanted if not dips[0] - 1e-9 <= dip <= dips[-1] + 1e-9]
        if outside:
            raise InputError([
                Problem(
                    "--at",
                    message(
                        "history_dip_outside",
                        "found {dip:g} m; expected {low:g} to {high:g} m, which every table has",
                        dip=dip, low=float(dips[0]), high=float(dips[-1]),
                    ),
                )
                for dip in outside
            ])  # fmt: skip
    nearest = dict.fromkeys(float(dips[np.argmin(np.abs(dips - dip))]) for dip in wanted)
    return sorted(nearest)


def _volumes(number, comparison, rows_m):
    rows = comparison.rows
    places = {float(dip): place for place, dip in enumerate(rows.height_m)}
    c = comparison.correlation.c or 0.0
    for dip in rows_m:
        at = places[dip]
        d = 0.0 - float(rows.d_m3[at])
        U, of_newest = _none_if_nan(rows.U_former_m3[at]), _none_if_nan(rows.U_new_m3[at])
        E_n = None if None in (U, of_newest) else float(normalized_error(d, U, of_newest, c))
        yield VolumeInHistory(number, dip, float(rows.former_on_basis_m3[at]), U, d, E_n)


def _none_if_nan(value):
    return None if np.isnan(value) else float(value)


def _radii(number, comparison, k):
    for course in comparison.courses:
        U = None if course.u_former_m is None else float(k * course.u_former_m)
        yield RadiusInHistory(
            number, course.course, course.bottom_m, course.top_m, course.former_m, U
        )


def _change(number, comparison, pair, k):
    rows, worst = comparison.rows, comparison.correlation
    c = worst.c or 0.0
    U = [_none_if_nan(of[-1]) for of in (rows.U_former_m3, rows.U_new_m3)]
    U_top = None if None in U else float(np.sqrt(U[0] ** 2 + U[1] ** 2 - 2 * c * U[0] * U[1]))
    if U_top is not None and worst.coverage_k is not None:
        U_top *= k / worst.coverage_k
    former, new = pair
    return TableChange(
        former=number,
        new=number + 1,
        years=(new.day - former.day).days / DAYS_OF_YEAR,
        low_m=comparison.low_m,
        high_m=comparison.high_m,
        top_d_m3=float(rows.d_m3[-1]),
        U_top_m3=U_top,
        worst_E_n=worst.worst_E_n,
        c=worst.c,
        zero_m=comparison.zero.height_m,
        zero_source=comparison.zero.source,
        not_made=[
            step.code for step in comparison.steps if step.state in ("not_declared", "not_possible")
        ],
        verdict=comparison.verdict,
        rule=comparison.rule.name,
        radii=[
            RadiusChange(
                course.course,
                course.d_m,
                None if course.u_m is None else float(k * course.u_m),
                None if course.w is None else course.w / k,
            )
            for course in comparison.courses
        ],
    )


# ---- warnings about the tables


def _table_warnings(ordered):
    """Compare each table (DatedTable, oldest first) with the one before it; return Problems.

    Examples
    --------
    >>> from datetime import date
    >>> from tankcal.products.recalibration.former import FormerTable
    >>> from tankcal.products.recalibration.history import DatedTable
    >>> tables = [
    ...     DatedTable(FormerTable("a.csv", [0, 1], [0, 1], reference_height_m=x), "", date.min)
    ...     for x in (9.1, 9.2)
    ... ]
    >>> [problem.expected.code for problem in _table_warnings(tables)]
    ['history_same_day', 'history_reference_height']
    """
    problems = []
    for before, after in pairwise(ordered):
        problems += _pair_warnings(before, after)
    return problems


def _pair_warnings(before, after):
    name, other = after.table.name, before.table.name
    if before.day == after.day:
        text = message(
            "history_same_day",
            "of {date}, as {other}: which of them came first is not known; is one of them to be "
            "left out?",
            date=after.day.isoformat(),
            other=other,
        )
        yield Problem(name, text)
    if None not in (before.tank, after.tank) and before.tank != after.tank:
        text = message(
            "history_other_id",
            "of tank {tank}, {other} of tank {other_tank}: taken as one tank, as wanted",
            tank=after.tank,
            other=other,
            other_tank=before.tank,
        )
        yield Problem(name, text)
    yield from _size_warnings(name, other, _tank(before), _tank(after))
    heights = before.table.reference_height_m, after.table.reference_height_m
    if None not in heights and abs(heights[1] - heights[0]) > SAME_M:
        text = message(
            "history_reference_height",
            "reference height {new:.4f} m, {old:.4f} m in {other}: the volumes are brought to one "
            "zero by these; has the dip plate or the reference point been moved?",
            new=heights[1],
            old=heights[0],
            other=other,
        )
        yield Problem(name, text)
    zeros = _zero(before), _zero(after)
    if None not in zeros and zeros[0] != zeros[1]:
        text = message(
            "history_other_zero",
            "dips count from {new}, from {old} in {other}",
            new=zeros[1],
            old=zeros[0],
            other=other,
        )
        yield Problem(name, text)


def _tank(table):
    return {} if table.table.record is None else table.table.record["job"]


def _zero(table):
    return None if table.table.record is None else table.table.record["capacity"].get("zero")


def _size_warnings(name, former_name, was, now):
    """Report changed nominal dimensions or courses."""
    for key in ("nominal_diameter_m", "nominal_height_m"):
        sizes = [(job.get("tank") or {}).get(key) for job in (was, now)]
        if None not in sizes and abs(sizes[1] - sizes[0]) > SAME_M:
            text = message(
                "history_other_size",
                "{key} {new:g}, {old:g} in {other}; expected the sizes of one tank",
                key=key,
                new=sizes[1],
                old=sizes[0],
                other=former_name,
            )
            yield Problem(name, text)
    heights = [[course["height_m"] for course in job.get("courses") or ()] for job in (was, now)]
    if not all(heights):
        return
    same = len(heights[0]) == len(heights[1])
    if not same or np.abs(np.subtract(*heights)).max() > SAME_M:
        text = message(
            "history_other_courses",
            "courses of other heights than {other}: radii are compared by those of the newer one",
            other=former_name,
        )
        yield Problem(name, text)
