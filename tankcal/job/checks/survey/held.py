"""What is held (sd 0) twice: values that contradict each other, or that leave nothing to adjust."""

import numpy as np

from tankcal.job.checks.common import has_rows
from tankcal.job.contract.observations import ANGLES, READINGS
from tankcal.messages import joined, message

SAME_M, SAME_DEG = 1e-9, 1e-9
# table: axes that must be held at all its points before its value is held already
AXES_OF = {
    "distances": "xyz",
    "azimuths": "xy",
    "horizontal_angles": "xy",
    "vertical_angles": "xyz",
    "height_differences": "z",
    "plumb_lines": "xy",
}


def check_held(files):
    """Observations held exactly between points that are held, and held twice at two values."""
    held = _held_axes(files)
    for name in READINGS:
        table = files.tables[name]
        if not has_rows(table) or "setup" in table.columns or name == "vectors":
            continue
        sd = table.numbers("s_arcsec" if name in ANGLES else "s_mm")
        exact = (sd == 0) & np.array([use != "check" for use in table.of("use")], dtype=bool)
        if exact.any():
            places = np.flatnonzero(exact)
            _refuse_between_held(files, name, table, places, held)
            _refuse_two_values(files, name, table, places)


def _held_axes(files):
    """{point: text of its axes that control.csv holds}."""
    control = files.tables["control"]
    if not has_rows(control):
        return {}
    sds = [control.numbers(f"s{axis}_mm") == 0 for axis in "xyz"]
    rows = zip(control.of("point"), control.of("system"), control.of("use"), *sds, strict=True)
    return {
        point: "".join(axis for axis, is_held in zip("xyz", axes, strict=True) if is_held)
        for point, system, use, *axes in rows
        if system is None and use != "check"
    }


def _ends(name, table):
    columns = ("at", "from", "to") if name == "horizontal_angles" else ("from", "to")
    return [table.of(column) for column in columns]


def _refuse_between_held(files, name, table, places, held):
    sd = "s_arcsec" if name in ANGLES else "s_mm"
    is_horizontal = (
        [kind == "horizontal" for kind in table.of("kind")] if name == "distances" else None
    )
    ends = _ends(name, table)
    for place in places:
        points = [column[place] for column in ends]
        axes = "xy" if is_horizontal and is_horizontal[place] else AXES_OF[name]
        if all(set(axes) <= set(held.get(point, "")) for point in points):
            named = joined([repr(point) for point in points])
            expected = message(
                "held_already",
                "found 0, but {named} are held already ({axes} in control.csv); expected a "
                "standard deviation above 0, or no such row",
                named=named,
                axes=axes,
            )
            files.log.problem(table.file, expected, table.rows[place], sd)


def _refuse_two_values(files, name, table, places):
    """One quantity held at two values; of distances either direction is the same quantity."""
    if name == "plumb_lines":
        return
    if name in ANGLES:
        columns = [f"{ANGLES[name]}_{unit}" for unit in ("deg", "gon", "dms")]
        same = SAME_DEG
    else:
        columns, same = ["dz_m" if name == "height_differences" else "distance_m"], SAME_M
    values = np.column_stack([table.numbers(column) for column in columns])
    kinds = table.of("kind") if name == "distances" else [None] * len(values)
    ends, first = _ends(name, table), {}
    for place in places:
        points = tuple(column[place] for column in ends)
        if None in points:
            continue
        key = (kinds[place] or "spatial", *(sorted(points) if name == "distances" else points))
        before = first.setdefault(key, place)
        if not np.allclose(values[before], values[place], rtol=0, atol=same, equal_nan=True):
            expected = message(
                "held_at_two",
                "held at another value than in row {row}; expected one value, or a standard "
                "deviation above 0",
                row=table.rows[before],
            )
            files.log.problem(table.file, expected, table.rows[place], "to")
