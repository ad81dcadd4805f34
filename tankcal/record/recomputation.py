"""Comparison of a record with the record of the same job computed again.

Each number is compared with the number in the same place. The tolerance between two machines is
relative to the largest number of the same key (over all rows of a list): 1e-9 in the capacity
table, and 1e-6 elsewhere, where a number may be a small difference of large numbers (residuals,
correlations).

Two quantities are compared by their meaning. The standard uncertainties of the inputs in each row,
`capacity.factor`, are a square root F of the covariances F F' of the volumes, which is not unique
(the axes of an ellipsoid have no sign, the axes of a sphere no direction). F F' is therefore
compared, for each kind of input. Volumes, and results of the simulation, are equal within 1e-14 of
the largest volume, the resolution of floating-point numbers.
"""

import os
import shutil
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from operator import attrgetter
from pathlib import Path, PurePosixPath

import numpy as np

from tankcal.record.columns import NO_INTEGER, Texts
from tankcal.record.covariance_factor import factor_of
from tankcal.record.long_tables import BY_COLUMNS, long_pairs
from tankcal.record.making import record_of, record_of_adjustment

TABLE, TABLE_TOLERANCE, TOLERANCE = "capacity.", 1e-9, 1e-6
FACTORS, DRAWN, VOLUMES = "capacity.factor_m3[][]", "monte_carlo.", "_m3"
ROUNDING = 1e-14  # difference of volumes by rounding, relative to the largest volume
PROBES = 50  # largest number of rows whose covariances with all rows are compared
MOST_COPIED = 500_000_000  # largest size of a copied input file, bytes; tables are smaller
UNCOMPARED = (
    "format", "tankcal", "versions", "job.source",  # origin of the record
    # Places of maxima, which move far if the maximum is flat.
    "interpolation.at_m", "proportional_parts.zones[].at_m",
)  # fmt: skip
WORDS = ("text", "words", "formula")  # texts, which a later version may word otherwise


@dataclass(frozen=True)
class NumberDifference:
    """A number that differs between two records.

    Attributes
    ----------
    place : str
        Place in the record, such as "capacity.volume_m3[130]".
    recorded, computed : float
        The number in both records.
    relative : float
        NumberDifference over the largest number of the key; inf if that is 0.
    tolerance : float
        Largest permissible value of `relative`.
    """

    place: str
    recorded: float
    computed: float
    relative: float
    tolerance: float

    @property
    def excess(self):
        """Relative difference over its tolerance."""
        return self.relative / self.tolerance


@dataclass(frozen=True)
class Recomputation:
    """Result of the comparison of a record with its recomputation.

    Attributes
    ----------
    made_by, computed_by : dict
        {"tankcal", "python", "numpy", "scipy": version} of the record and of the recomputation.
    numbers : int
        Number of compared numbers.
    different : int
        Number of compared numbers that are not equal bit for bit.
    largest : NumberDifference or None
        Difference with the largest excess; None if all numbers are equal, apart from rounding.
    beyond : tuple of NumberDifference
        Largest difference of each key that exceeds its tolerance.
    otherwise : tuple of (str, str, str)
        Place, recorded value and computed value of other differences: values that are no numbers,
        and keys that are in one of the records only.
    """

    made_by: dict
    computed_by: dict
    numbers: int
    different: int
    largest: NumberDifference | None
    beyond: tuple
    otherwise: tuple

    @property
    def agrees(self):
        """Whether all numbers are within their tolerances, and all other values are equal."""
        return not self.beyond and not self.otherwise


def compute_again(record, job, step=None, part=None, cluster="auto"):
    """Compute the job of a record again, and compare the records.

    Parameters
    ----------
    record : dict
        Record of `tankcal.record.load`.
    job : path
        Folder of the input files; only files that the record lists are read.
    step : callable, optional
        Called with a line of text at the beginning of each step.
    part : callable, optional
        Called as part(text, done, total) within a long step.
    cluster : str or int, optional
        Workers that read point clouds, as in `tankcal run`.

    Returns
    -------
    Recomputation
        Result of the comparison.
    survey.Adjustment or None
        Adjustment of the survey, if it has one.

    Raises
    ------
    TankcalError
        If this version refuses the job, or finds no valid solution.
    """
    if record.get("upkeep"):
        # A product above this package computes such a record, so it is named by a text.
        product = import_module("tankcal.products.upkeep.new_record")
        return product.compute_record_again(record, job), None
    from tankcal.job import load
    from tankcal.pipeline.chain import adjust_job, run

    with tempfile.TemporaryDirectory(prefix="tankcal-") as folder:
        place = _copy_job(record, Path(job), Path(folder))
        if record["capacity"] is None:
            read_job = load(place, only="adjustment")
            adjustment = adjust_job(read_job, step)
            computed = record_of_adjustment(read_job, adjustment)
        else:
            # The record may lack Monte Carlo although the job asks for it.
            simulated = None if record["monte_carlo"] else False
            options = {"part_progress": part, "simulated": simulated, "cluster": cluster}
            result = run(load(place), step, **options)
            computed, adjustment = record_of(result), result.adjustment
    return compare_records(record, computed), adjustment


def _copy_job(record, folder, temporary):
    """Copy the input files of a record from `folder`, and return the path of this job.

    A job with files outside its folder (clouds) is not copied.
    """
    names = [file["file"] for file in record["files"]]
    paths = [PurePosixPath(name) for name in names]
    if any(path.is_absolute() or ".." in path.parts for path in paths):
        return folder
    for name in names:
        place, source = temporary / name, (folder / name).resolve()
        place.parent.mkdir(parents=True, exist_ok=True)
        if source.stat().st_size <= MOST_COPIED:  # a job refuses tables that are links
            shutil.copyfile(source, place)
            continue
        try:
            os.symlink(source, place)  # a cloud
        except OSError:  # the system does not allow links
            shutil.copyfile(source, place)
    books = [name for name in names if name.lower().endswith(".xlsx")]
    return temporary if "job.toml" in names or not books else temporary / books[0]


def input_folder(folder):
    """Return the folder of the input files of a job, given as a folder or as a workbook."""
    folder = Path(folder)
    return folder.parent if folder.is_file() else folder


def compare_records(record, computed):
    """Compare two records, number by number.

    Parameters
    ----------
    record, computed : dict
        The record and its recomputation, in the same version of the format.

    Returns
    -------
    Recomputation

    Examples
    --------
    >>> versions = {"python": "3.12", "numpy": "2.1", "scipy": "1.14"}
    >>> old = {"tankcal": "0.1.0", "versions": versions, "capacity": {"volume_m3": [0.0, 500.0]}}
    >>> new = old | {"capacity": {"volume_m3": [0.0, 500.0000001]}}
    >>> result = compare_records(old, new)
    >>> result.numbers, result.different, result.largest.place, result.agrees
    (2, 1, 'capacity.volume_m3[1]', True)
    """
    tables, record, computed = long_pairs(*map(_expand_factor, (record, computed)))
    recorded_values, computed_values = _sort_values(record), _sort_values(computed)
    rounding_m3 = ROUNDING * _largest_volume_m3(record)
    compared = []  # (count, largest NumberDifference or None, number of differences) of each key
    for key, numbers in recorded_values.numbers.items():
        others = computed_values.numbers.get(key, {})
        largest, changed = _compare_key(key, numbers, others, rounding_m3)
        if key == FACTORS and largest is not None:
            largest = _compare_factors(record["capacity"], computed["capacity"], largest)
        compared.append((len(numbers), largest, changed))
    is_same_version = record["tankcal"] == computed["tankcal"]
    of_tables = [_compare_columns(place, *pair, is_same_version) for place, pair in tables.items()]
    compared += [column for columns, _ in of_tables for column in columns]
    differences = [largest for _, largest, _ in compared if largest is not None]
    beyond = [number for number in differences if number.relative > number.tolerance]
    return Recomputation(
        made_by={"tankcal": record["tankcal"], **record["versions"]},
        computed_by={"tankcal": computed["tankcal"], **computed["versions"]},
        numbers=sum(count for count, _, _ in compared),
        different=sum(changed for _, _, changed in compared),
        largest=max(differences, key=attrgetter("excess"), default=None),
        beyond=tuple(sorted(beyond, key=attrgetter("excess"), reverse=True)),
        otherwise=(
            *_compare_others(recorded_values, computed_values, is_same_version),
            *(other for _, others in of_tables for other in others),
        ),
    )


def _expand_factor(record):
    """Return the record with `factor_m3` in place of its blocks, which are not unique."""
    capacity = record.get("capacity") or {}
    if "factor" not in capacity:
        return record
    other = {name: value for name, value in capacity.items() if name != "factor"}
    return record | {"capacity": other | {"factor_m3": factor_of(capacity).tolist()}}


def _largest_volume_m3(record):
    """Return the largest volume of the table of a record, m3; 0 without table."""
    table = record.get("capacity") or {}
    return max(np.abs(np.array(table.get("volume_m3") or [0.0], dtype=float)))


@dataclass(frozen=True)
class _Values:
    """Values of a record: {key: {place: number}}, and {place: value} of all other values.

    A key is a path without the places in lists, such as "capacity.volume_m3[]".
    """

    numbers: dict
    others: dict


def _sort_values(record):
    """Return the `_Values` of a record."""
    values = _Values({}, {})
    _add_values(record, "", "", values)
    return values


def _add_values(value, key, place, values):
    if key in UNCOMPARED:
        return
    if isinstance(value, dict):
        for name, item in value.items():
            _add_values(item, f"{key}.{name}".lstrip("."), f"{place}.{name}".lstrip("."), values)
    elif isinstance(value, list | tuple):
        for number, item in enumerate(value):
            _add_values(item, f"{key}[]", f"{place}[{number}]", values)
        values.others[f"{place}[]"] = len(value)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        values.numbers.setdefault(key, {})[place] = value
    else:
        values.others[place] = value


def _compare_key(key, recorded, computed, rounding_m3):
    """Return the largest NumberDifference of a key, or None, and the number of differences.

    Differences up to `rounding_m3` of volumes and of results of the simulation do not count.
    """
    places = [place for place in recorded if place in computed]
    if not places:
        return None, 0
    old, new = (
        np.array([values[place] for place in places], dtype=float)
        for values in (recorded, computed)
    )
    difference = np.abs(old - new)
    changed = int(np.count_nonzero(difference))
    if DRAWN in key or key.rstrip("[]").endswith(VOLUMES):
        difference[difference <= rounding_m3] = 0.0
    if not difference.any():
        return None, changed
    worst, scale = int(np.argmax(difference)), float(np.abs(old).max())
    relative = float(difference[worst]) / scale if scale else np.inf
    tolerance = TABLE_TOLERANCE if key.startswith(TABLE) else TOLERANCE
    return NumberDifference(
        places[worst], float(old[worst]), float(new[worst]), relative, tolerance
    ), changed  # fmt: skip


def _compare_factors(recorded, computed, by_number):
    """Return the largest NumberDifference of the covariances F F' of two tables, or None.

    Parameters
    ----------
    recorded, computed : dict
        Parts `capacity` of both records, with `factor_m3`.
    by_number : NumberDifference
        Result for tables with other inputs: the largest difference of the numbers of F.
    """
    if recorded["inputs"] != computed["inputs"]:
        return by_number
    F, G = (np.array(capacity["factor_m3"], dtype=float) for capacity in (recorded, computed))
    if F.shape != G.shape:
        return by_number
    kinds = np.array([name.rstrip(" 0123456789") for name in recorded["inputs"]])
    # All rows with some rows: the whole matrix of covariances would be too large.
    probes = np.unique(np.linspace(0, len(F) - 1, min(PROBES, len(F))).astype(int))
    scale, differences = float(np.max(np.sum(F**2, axis=1), initial=0.0)), []
    for kind in dict.fromkeys(kinds):
        f, g = F[:, kinds == kind], G[:, kinds == kind]
        old, new = f @ f[probes].T, g @ g[probes].T
        row, probe = np.unravel_index(np.argmax(np.abs(old - new)), old.shape)
        difference = float(np.abs(old - new)[row, probe])
        if difference:
            place = f"capacity.factor_m3[{row}]'[{probes[probe]}] of {kind}"
            relative = difference / scale if scale else np.inf
            numbers = float(old[row, probe]), float(new[row, probe])
            differences.append(NumberDifference(place, *numbers, relative, TABLE_TOLERANCE))
    return max(differences, key=attrgetter("excess"), default=None)


def _compare_columns(place, recorded, computed, is_same_version):
    """Compare a long table, column by column.

    Parameters
    ----------
    place : str
        Place of the table in the record.
    recorded, computed : ArrayColumns
        The table of both records.
    is_same_version : bool
        Whether both records have all columns.

    Returns
    -------
    numbers : list of tuple
        (count, largest NumberDifference or None, number of differences) of each column of numbers.
    others : list of tuple
        (place, recorded value, computed value) of the first difference of each other column.
    """
    numbers, others = [], []
    if recorded.count != computed.count:
        return numbers, [(f"{place}[]", str(recorded.count), str(computed.count))]
    for name in dict.fromkeys((*recorded, *computed)):
        name_place = _place_namer(place, name)
        if name not in computed.arrays:
            others.append((name_place(0), _format_value(recorded[name][0]), "-"))
            continue
        if name not in recorded.arrays:
            if is_same_version:
                others.append((name_place(0), "-", _format_value(computed[name][0])))
            continue
        old, new = (_numbers_of(table.arrays[name]) for table in (recorded, computed))
        are_numbers = old is not None and new is not None and old.shape == new.shape
        if not are_numbers or (np.isfinite(old) != np.isfinite(new)).any():
            others += _first_difference(name_place, recorded[name], computed[name], are_numbers)
        if are_numbers:
            numbers.append(_compare_numbers(name_place, old, new))
    return numbers, others


def _numbers_of(column):
    """Return the numbers of a column, nan for null; None for texts and booleans."""
    if isinstance(column, Texts) or column.dtype == bool:
        return None
    return np.where(column == NO_INTEGER, np.nan, column)


def _first_difference(name_place, recorded, computed, are_numbers):
    """Return the first different value, [(place, recorded, computed)] or [].

    Numbers are compared only by being null.
    """
    for row, (old, new) in enumerate(zip(recorded, computed, strict=True)):
        if ((old is None) != (new is None)) if are_numbers else old != new:
            return [(name_place(row), _format_value(old), _format_value(new))]
    return []


def _compare_numbers(name_place, old, new):
    """Return count, largest NumberDifference and number of differences of a column of numbers."""
    count, are_known = int(np.isfinite(old).sum()), np.isfinite(old) & np.isfinite(new)
    old, new = np.where(are_known, old, 0.0), np.where(are_known, new, 0.0)
    difference = np.abs(old - new)
    if not difference.any():
        return count, None, 0
    worst = np.unravel_index(np.argmax(difference), difference.shape)
    relative = float(difference[worst] / np.abs(old).max()) if old.any() else np.inf
    place = name_place(worst[0]) + "".join(f"[{i}]" for i in worst[1:])
    largest = NumberDifference(place, float(old[worst]), float(new[worst]), relative, TOLERANCE)
    return count, largest, int(np.count_nonzero(difference))


def _place_namer(place, name):
    """Return a function of a row: place of the value of a column, such as "points[3].x_m"."""
    if place in BY_COLUMNS:
        return lambda row: f"{place}.{name}[{row}]"
    return lambda row: f"{place}[{row}].{name}"


def _compare_others(recorded, computed, is_same_version):
    """Yield (place, recorded, computed) of values that are no numbers, or in one record only."""
    flat = [
        {**{k: v for places in values.numbers.values() for k, v in places.items()}, **values.others}
        for values in (recorded, computed)
    ]
    number_places = [set().union(*values.numbers.values()) for values in (recorded, computed)]
    for place in dict.fromkeys((*flat[0], *flat[1])):
        name = place.rpartition(".")[2]
        if name.split("[")[0] in WORDS and not is_same_version:
            continue
        is_recorded, is_computed = place in flat[0], place in flat[1]
        if is_recorded and is_computed:
            if place in number_places[0] and place in number_places[1]:
                continue
            if flat[0][place] != flat[1][place]:
                yield place, _format_value(flat[0][place]), _format_value(flat[1][place])
        elif is_same_version or is_recorded:
            yield (
                place,
                *(_format_value(values[place]) if place in values else "-" for values in flat),
            )


def _format_value(value):
    with suppress(TypeError, ValueError):
        return f"{float(value):.10g}" if not isinstance(value, str | bool) else str(value)
    return "null" if value is None else str(value)
