"""courses.csv of a former table: rings whose heights may be unknown."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tankcal.job.checking import refuse_repeated
from tankcal.job.contract.courses import COLUMNS, SMALLEST_THICKNESS_MM, no_courses
from tankcal.job.entries import read_columns
from tankcal.job.folder import read_csv
from tankcal.job.tables import read_bytes
from tankcal.messages import message

FIELDS = tuple(
    replace(field, required=False) if field.name == "height_m" else field for field in COLUMNS
)


@dataclass(frozen=True)
class Courses:
    """The rings of a tank, from the bottom up.

    Attributes
    ----------
    file : str
    names : tuple of str
    heights_m : ndarray, shape (n,)
        nan if unknown.
    thickness_m : ndarray, shape (n,)
    """

    file: str
    names: tuple[str, ...]
    heights_m: np.ndarray
    thickness_m: np.ndarray

    def first(self, count):
        """Return the lowest `count` courses."""
        return replace(
            self,
            names=self.names[:count],
            heights_m=self.heights_m[:count],
            thickness_m=self.thickness_m[:count],
        )


def read_courses(path, log):
    """Return the `Courses` of a CSV file; None after reporting its problems to `log`."""
    path = Path(path)
    if not path.exists():
        log.problem(path.name, message("read_no_file", "not found; expected a file of courses"))
        return None
    data = read_bytes(path, log)
    if data is None:
        return None
    separator, decimal = (";", ",") if b";" in data[:2000] else (",", ".")
    table = read_csv(path.name, data, separator, decimal, log)
    if table is None:
        return None
    before = len(log.problems)
    values = read_columns("courses", table, log, FIELDS)
    if len(log.problems) > before or values.skipped:
        return None
    if values.is_empty:
        log.problem(path.name, no_courses())
        return None
    refuse_repeated(values, "course", log)
    plates = values.of("thickness_mm")
    for row, plate in zip(values.rows, plates, strict=True):
        if plate < SMALLEST_THICKNESS_MM:
            expected = message(
                "thin_course",
                "found {thickness:g}; expected millimetres, at least 1: is it in metres?",
                thickness=plate,
            )
            log.problem(path.name, expected, row, "thickness_mm")
    if len(log.problems) > before:
        return None
    heights = [np.nan if height is None else height for height in values.of("height_m")]
    return Courses(
        path.name, tuple(values.of("course")), np.array(heights), np.array(plates) / 1000
    )
