"""A record held against the same job computed again: do the same numbers come out?

Every number is held against the one in its place. What is allowed between two machines is a part
of the largest number of the same key (of all rows of a list): 1e-9 in the capacity table, 1e-6
elsewhere, where a number may be the small difference of large ones (residuals, correlations).
Two things are compared by what they say. The standard uncertainties of the inputs in each row,
`capacity.factor`, are one of many square roots F of the covariances F F' of the volumes (axes of
an ellipsoid have no sign, those of a sphere no place): F F' is compared, of each kind of input by
itself. And volumes, and what the draws found of them, are alike within 1e-14 of the fullest tank:
it is how finely a computer can write them down.
"""

import os
import shutil
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from tankcal.record.columns import NO_INTEGER, Texts
from tankcal.record.covariance_factor import factor_of
from tankcal.record.long_tables import BY_COLUMNS, long_pairs
from tankcal.record.making import record_of, record_of_adjustment

TABLE, TABLE_TOLERANCE, TOLERANCE = "capacity.", 1e-9, 1e-6
FACTORS, DRAWN, VOLUMES = "capacity.factor_m3[][]", "monte_carlo.", "_m3"
ROUNDING, PROBES = 1e-14, 50  # of the largest volume; rows whose covariances with all are compared
MOST_COPIED = 500_000_000  # bytes of an input file; tables and meshes are smaller
UNCOMPARED = (
    "format", "tankcal", "versions", "job.source",  # who computed, and where
    "interpolation.at_m", "proportional_parts.zones[].at_m",  # of maxima, flat ones; these are
)  # fmt: skip
WORDS = ("text", "words", "formula")  # of messages: a later version may say it otherwise


@dataclass(frozen=True)
class NumberApart:
    """A number that came out otherwise.

    Attributes
    ----------
    place : str
        Where it stands: "capacity.volume_m3[130]".
    recorded, computed : float
    relative : float
        Their difference over the largest number of that key; inf where that is 0.
    tolerance : float
        What is allowed of it.
    """

    place: str
    recorded: float
    computed: float
    relative: float
    tolerance: float


@dataclass(frozen=True)
class Recomputation:
    """What came out again.

    Attributes
    ----------
    made_by, computed_by : dict
        {"tankcal", "python", "numpy", "scipy": version} of the record, and of now.
    numbers : int
        That were compared.
    different : int
        Of them, those that are not the same bit for bit.
    largest : NumberApart or None
        The largest relative difference over its tolerance; None: all are the same, or others by
        rounding alone.
    beyond : tuple of NumberApart
        The largest of each key that is beyond its tolerance.
    otherwise : tuple of (str, str, str)
        Place, recorded and computed, of what is no number, or is not there in one of both.
    """

    made_by: dict
    computed_by: dict
    numbers: int
    different: int
    largest: NumberApart | None
    beyond: tuple
    otherwise: tuple

    @property
    def agrees(self):
        """Whether every number is within its tolerance, and all else the same."""
        return not self.beyond and not self.otherwise


def compute_again(record, job, step=None, part=None, cluster="auto"):
    """Compute the job of a record again and compare.

    Parameters
    ----------
    record : dict
        As `tankcal.record.load` gives it.
    job : path
        Folder of its input files: only those that the record names are read.
    step : callable, optional
        Called with a line of text as each step begins.
    part : callable, optional
        Called as part(text, done, total) within a long step.
    cluster : str or int, optional
        Who reads point clouds, as of `tankcal run`.

    Returns
    -------
    Recomputation, survey.Adjustment or None
        The latter of a survey that was adjusted.

    Raises
    ------
    TankcalError
        When this version refuses the job, or finds no sound solution of it.
    """
    from tankcal.job import load
    from tankcal.pipeline.chain import adjust_job, run

    with tempfile.TemporaryDirectory(prefix="tankcal-") as folder:
        place = _job_of(record, Path(job), Path(folder))
        if record["capacity"] is None:
            read = load(place, only="adjustment")
            adjustment = adjust_job(read, step)
            found = record_of_adjustment(read, adjustment)
        else:
            simulated = None if record["monte_carlo"] else False  # it may have been left out
            options = {"part_progress": part, "simulated": simulated, "cluster": cluster}
            result = run(load(place), step, **options)
            found, adjustment = record_of(result), result.adjustment
    return compare_records(record, found), adjustment


def _job_of(record, folder, temporary):
    """Path of a job of the record's input files alone, copies of those in `folder`.

    A job whose files lie elsewhere (clouds) is read where it is.
    """
    names = [one["file"] for one in record["files"]]
    paths = [PurePosixPath(name) for name in names]
    if any(path.is_absolute() or ".." in path.parts for path in paths):
        return folder
    for name in names:
        place, source = temporary / name, (folder / name).resolve()
        place.parent.mkdir(parents=True, exist_ok=True)
        if source.stat().st_size <= MOST_COPIED:  # a job follows no link to its tables
            shutil.copyfile(source, place)
            continue
        try:
            os.symlink(source, place)  # a cloud
        except OSError:  # where a system allows no links
            shutil.copyfile(source, place)
    books = [name for name in names if name.lower().endswith(".xlsx")]
    return temporary if "job.toml" in names or not books else temporary / books[0]


def input_folder(folder):
    """The folder of a job's input files that a path names: itself, or where a workbook lies."""
    folder = Path(folder)
    return folder.parent if folder.is_file() else folder


def compare_records(record, found):
    """Hold one record against another, number by number.

    Parameters
    ----------
    record, found : dict
        As recorded, and as computed now, of one version of the format.

    Returns
    -------
    Recomputation

    Examples
    --------
    >>> versions = {"python": "3.12", "numpy": "2.1", "scipy": "1.14"}
    >>> one = {"tankcal": "0.1.0", "versions": versions, "capacity": {"volume_m3": [0.0, 500.0]}}
    >>> other = one | {"capacity": {"volume_m3": [0.0, 500.0000001]}}
    >>> found = compare_records(one, other)
    >>> found.numbers, found.different, found.largest.place, found.agrees
    (2, 1, 'capacity.volume_m3[1]', True)
    """
    was, now = ({}, {}), ({}, {})
    tables, record, found = long_pairs(*map(_with_whole_factor, (record, found)))
    _sort(record, "", "", *was)
    _sort(found, "", "", *now)
    rounding = ROUNDING * _fullest(record)
    compared = []
    for key, places in was[0].items():
        worst, changed = _worst(key, places, now[0].get(key, {}), rounding)
        if key == FACTORS and worst is not None:
            worst = _of_factors(record["capacity"], found["capacity"], worst)
        compared.append((len(places), worst, changed))
    same_version = record["tankcal"] == found["tankcal"]
    of_tables = [_compare_columns(place, *pair, same_version) for place, pair in tables.items()]
    compared += [one for numbers, _ in of_tables for one in numbers]
    apart = [worst for _, worst, _ in compared if worst is not None]
    beyond = sorted((one for one in apart if one.relative > one.tolerance), key=_over, reverse=True)
    return Recomputation(
        made_by=_versions(record),
        computed_by=_versions(found),
        numbers=sum(count for count, _, _ in compared),
        different=sum(changed for _, _, changed in compared),
        largest=max(apart, key=_over, default=None),
        beyond=tuple(beyond),
        otherwise=(
            *_otherwise(was, now, same_version),
            *(one for _, others in of_tables for one in others),
        ),
    )


def _with_whole_factor(record):
    """The record with `factor_m3` in place of its blocks, whose rows and weights are a choice."""
    capacity = record.get("capacity") or {}
    if "factor" not in capacity:
        return record
    other = {name: value for name, value in capacity.items() if name != "factor"}
    return record | {"capacity": other | {"factor_m3": factor_of(capacity).tolist()}}


def _versions(record):
    return {"tankcal": record["tankcal"], **record["versions"]}


def _over(one):
    return one.relative / one.tolerance


def _sort(value, key, place, numbers, others):
    """Put every value into numbers {key: {place: value}} or others {place: value}.

    key    path without the places in lists: "capacity.volume_m3[]"
    """
    if key in UNCOMPARED:
        return
    if isinstance(value, dict):
        for name, item in value.items():
            _sort(item, f"{key}.{name}".lstrip("."), f"{place}.{name}".lstrip("."), numbers, others)
    elif isinstance(value, list | tuple):
        for number, item in enumerate(value):
            _sort(item, f"{key}[]", f"{place}[{number}]", numbers, others)
        others[f"{place}[]"] = len(value)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        numbers.setdefault(key, {})[place] = value
    else:
        others[place] = value


def _fullest(record):
    """Largest volume of a record's table; 0 without one."""
    table = record.get("capacity") or {}
    return max(np.abs(np.array(table.get("volume_m3") or [0.0], dtype=float)))


def _of_factors(was, now, by_number):
    """The NumberApart of what the inputs' standard uncertainties say, or None.

    was, now     keys `capacity` of both records
    by_number    NumberApart of the numbers themselves, for tables of other inputs
    """
    if was["inputs"] != now["inputs"]:
        return by_number
    F, G = (np.array(one["factor_m3"], dtype=float) for one in (was, now))
    if F.shape != G.shape:
        return by_number
    kinds = np.array([name.rstrip(" 0123456789") for name in was["inputs"]])
    probes = np.unique(np.linspace(0, len(F) - 1, min(PROBES, len(F))).astype(int))
    scale, found = float(np.max(np.sum(F**2, axis=1), initial=0.0)), []
    for kind in dict.fromkeys(kinds):
        f, g = F[:, kinds == kind], G[:, kinds == kind]
        one, two = f @ f[probes].T, g @ g[probes].T
        row, probe = np.unravel_index(np.argmax(np.abs(one - two)), one.shape)
        apart = float(np.abs(one - two)[row, probe])
        place = f"capacity.factor_m3[{row}]'[{probes[probe]}] of {kind}"
        relative = apart / scale if scale else np.inf
        numbers = float(one[row, probe]), float(two[row, probe])
        if apart:
            found.append(NumberApart(place, *numbers, relative, TABLE_TOLERANCE))
    return max(found, key=_over, default=None)


def _compare_columns(place, was, now, same_version):
    """What `compare_records` looks at of a long table, column by column.

    was, now  `ArrayColumns`      same_version  whether both have all columns

    Returns the (count, NumberApart or None, how many differ) of each column of numbers, and the
    first (place, recorded, computed) of each column whose other values are not the same.
    """
    numbers, others = [], []
    if was.count != now.count:
        return numbers, [(f"{place}[]", str(was.count), str(now.count))]
    for name in dict.fromkeys((*was, *now)):
        where = _places_of(place, name)
        if name not in now.arrays:
            others.append((where(0), _shown(was[name][0]), "-"))
            continue
        if name not in was.arrays:
            others += [(where(0), "-", _shown(now[name][0]))] * same_version
            continue
        one, two = (_numbers_of(table.arrays[name]) for table in (was, now))
        alike = one is not None and two is not None and one.shape == two.shape
        if not alike or (np.isfinite(one) != np.isfinite(two)).any():
            others += _first_other(where, was[name], now[name], alike)
        if alike:
            numbers.append(_compare_numbers(where, one, two))
    return numbers, others


def _numbers_of(column):
    """Numbers of a column, nan where it is null; None of texts and truths."""
    if isinstance(column, Texts) or column.dtype == bool:
        return None
    return np.where(column == NO_INTEGER, np.nan, column)


def _first_other(where, was, now, are_numbers):
    """[(place, recorded, computed)] of the first values that differ, of numbers in being null."""
    for row, (one, two) in enumerate(zip(was, now, strict=True)):
        if ((one is None) != (two is None)) if are_numbers else one != two:
            return [(where(row), _shown(one), _shown(two))]
    return []


def _compare_numbers(where, one, two):
    """How many numbers a column has, the NumberApart of it or None, and how many differ."""
    count, both = int(np.isfinite(one).sum()), np.isfinite(one) & np.isfinite(two)
    one, two = np.where(both, one, 0.0), np.where(both, two, 0.0)
    apart = np.abs(one - two)
    if not apart.any():
        return count, None, 0
    most = np.unravel_index(np.argmax(apart), apart.shape)
    relative = float(apart[most] / np.abs(one).max()) if one.any() else np.inf
    spot = where(most[0]) + "".join(f"[{i}]" for i in most[1:])
    worst = NumberApart(spot, float(one[most]), float(two[most]), relative, TOLERANCE)
    return count, worst, int(np.count_nonzero(apart))


def _places_of(place, name):
    """The place of a value of a column in the record: "points[3].x_m", or by columns."""
    if place in BY_COLUMNS:
        return lambda row: f"{place}.{name}[{row}]"
    return lambda row: f"{place}[{row}].{name}"


def _worst(key, places, found, rounding):
    """(NumberApart of the largest difference or None, how many differ) of one key.

    rounding    m3 that are none, of volumes and of what the draws found
    """
    there = [place for place in places if place in found]
    if not there:
        return None, 0
    one, two = (
        np.array([values[place] for place in there], dtype=float) for values in (places, found)
    )
    apart = np.abs(one - two)
    changed = int(np.count_nonzero(apart))
    if DRAWN in key or key.rstrip("[]").endswith(VOLUMES):
        apart[apart <= rounding] = 0.0
    if not apart.any():
        return None, changed
    most, scale = int(np.argmax(apart)), float(np.abs(one).max())
    relative = float(apart[most]) / scale if scale else np.inf
    tolerance = TABLE_TOLERANCE if key.startswith(TABLE) else TOLERANCE
    return NumberApart(
        there[most], float(one[most]), float(two[most]), relative, tolerance
    ), changed  # fmt: skip


def _otherwise(was, now, same_version):
    """(place, recorded, computed) of what is no number, or stands in one record only."""
    flat = [
        {**{k: v for places in numbers.values() for k, v in places.items()}, **others}
        for numbers, others in (was, now)
    ]
    is_number = [set().union(*numbers.values()) for numbers, _ in (was, now)]
    for place in dict.fromkeys((*flat[0], *flat[1])):
        name = place.rpartition(".")[2]
        if name.split("[")[0] in WORDS and not same_version:
            continue
        here, there = place in flat[0], place in flat[1]
        if here and there:
            if place in is_number[0] and place in is_number[1]:
                continue
            if flat[0][place] != flat[1][place]:
                yield place, _shown(flat[0][place]), _shown(flat[1][place])
        elif same_version or here:
            yield place, *(_shown(one[place]) if place in one else "-" for one in flat)


def _shown(value):
    with suppress(TypeError, ValueError):
        return f"{float(value):.10g}" if not isinstance(value, str | bool) else str(value)
    return "null" if value is None else str(value)
