"""Checks for one point in two spellings: P1, p1, P 1, P-1, P01."""

import re

from tankcal.job.checking import has_rows
from tankcal.job.contract.observations import READINGS
from tankcal.messages import message

KNOWN = (("control", "point"), ("check", "point"), ("targets", "point"), ("setups", "station"))


def _columns():
    """(table, column) of all names of observed points."""
    yield "image_points", "point"
    yield "stadia", "to"
    for name in READINGS:
        for column in ("at", "from", "to"):
            yield name, column


def observed_names(files):
    """{name: number of rows} of the observed points and of the stations."""
    counts = {}
    for name, column in (*_columns(), ("setups", "station")):
        table = files.tables[name]
        if has_rows(table) and column in table.columns:
            for point in table.of(column):
                counts[point] = counts.get(point, 0) + 1
    return counts


def all_points(files):
    """Names of all points of the survey, in the order of its files."""
    counts = observed_names(files)
    for name, column in KNOWN:
        if has_rows(files.tables[name]):
            counts |= dict.fromkeys(files.tables[name].of(column), 1)
    return [name for name in counts if name is not None]


def plain(name):
    """Common form of the spellings of one name: P1 for p1, P 1, P-1, P_01."""
    text = re.sub(r"[\s_.\-/#()]+", "-", name.casefold())
    text = re.sub(r"(?<=[^\W\d])-(?=\d)|(?<=\d)-(?=[^\W\d])", "", text)
    return re.sub(r"(?<!\d)0+(?=\d)", "", text).strip("-")


def check_names(files):
    """Report similar spellings; a spelling in a single row is a problem.

    A point in a single row cannot be determined; a point in several rows may be another point.
    """
    places = {}
    for name, column in (*KNOWN, *_columns()):
        table = files.tables[name]
        if has_rows(table) and column in table.columns:
            for row, point in zip(table.rows, table.of(column), strict=True):
                if point is not None:
                    entry = places.setdefault(point, [table.file, row, column, 0])
                    entry[3] += 1
    similar = {}
    for point in places:
        similar.setdefault(plain(point), []).append(point)
    for spellings in similar.values():
        if len(spellings) > 1:
            _tell(files, sorted(spellings, key=lambda point: -places[point][3]), places)


def _tell(files, spellings, places):
    most_frequent, *others = spellings
    for point in others:
        file, row, column, count = places[point]
        if count == 1:
            rows_of_other = places[most_frequent][3]
            expected = message(
                "spelt_once",
                "{point!r} is in 1 row, {other!r} in {rows} rows; expected one spelling of "
                "one point, or another name",
                point=point,
                other=most_frequent,
                rows=rows_of_other,
            )
            if rows_of_other == 1:
                expected = message(
                    "each_spelt_once",
                    "{point!r} is in 1 row, {other!r} in 1 row; expected one spelling of one "
                    "point, or another name",
                    point=point,
                    other=most_frequent,
                )
            files.log.problem(file, expected, row, column)
        else:
            expected = message(
                "two_spellings",
                "{point!r} is in {rows} rows, {other!r} in {rows_of_other} rows: is it one "
                "point in two spellings?",
                point=point,
                rows=count,
                other=most_frequent,
                rows_of_other=places[most_frequent][3],
            )
            files.log.warning(file, expected, row, column)
