"""Columns of stated.csv, and checks of its dips and volumes."""

from itertools import pairwise

from tankcal.job.checking import UNIT_FACTOR, tell
from tankcal.job.contract.shorthand import number, positive
from tankcal.job.fields import Field
from tankcal.messages import message

COLUMNS = (
    positive(
        "high_m",
        "dip from the table's zero, metres; the report states its volume, uncertainty and budget",
        100,
        required=True,
    ),
    number("low_m", "for a delivery: dip at its end, metres; blank: volume below high_m", 0, 100),
    positive(
        "volume_m3",
        "volume stated by an earlier table or a contract, cubic metres; for decision rules that"
        " limit deviations",
        1e6,
    ),
    Field("note", "text", "description of the volume"),
)
_ROUNDING_M = 1e-9  # tolerance of comparisons
_MOST_M = 100
KEYS = (
    positive("full_m", "dip of the full tank, such as the overflow, metres", _MOST_M),
    positive("maximum_m", "dip of the safe fill, metres", _MOST_M),
    positive("minimum_m", "lowest dip in operation, metres", _MOST_M),
    positive("pump_suction_m", "lowest dip that can be pumped, metres", _MOST_M),
)
_FROM_THE_TOP = tuple(key.name for key in KEYS)


def check_stated(table, extent, log):
    """Check that dips lie within the tank, pairs are unique, and volumes are in cubic metres."""
    first_row = {}
    columns = (table.of(name) for name in ("high_m", "low_m", "volume_m3"))
    for row, high, low, volume in zip(table.rows, *columns, strict=True):
        _check_within(table, row, high, low, extent, log)
        if high is None:
            continue
        if low is not None and low >= high:
            expected = message(
                "stated_upside_down",
                "found {low:g}; expected a dip below high_m = {high:g}",
                low=low,
                high=high,
            )
            log.problem(table.file, expected, row, "low_m")
        elif (high, low) in first_row:
            expected = message(
                "stated_twice",
                "this dip is already in row {first_row}; expected once",
                first_row=first_row[high, low],
            )
            log.problem(table.file, expected, row, "high_m")
        elif volume is not None:
            _check_volume(table, row, high, low, volume, extent, log)
        first_row.setdefault((high, low), row)


def _check_within(table, row, high, low, extent, log):
    """Check that the dips do not exceed the top of the tank."""
    for column, dip in (("high_m", high), ("low_m", low)):
        expected = dip_above_top(dip, extent)
        if expected:
            log.problem(table.file, expected, row, column)


def dip_above_top(dip, extent):
    """Return the message that a dip exceeds the top of the tank; "" if not, or if unknown."""
    top = extent.height_m if extent.top_m is None else extent.top_m
    if None in (dip, top) or dip <= top + _ROUNDING_M:
        return ""
    return message(
        "stated_above_top",
        "found {dip:g}; expected at most {top:.5g}, the top of the tank, in metres",
        dip=dip,
        top=top,
    )


def _check_volume(table, row, high, low, volume, extent, log):
    """Refuse volumes far larger than the tank or the delivery, which are in another unit."""
    height = extent.height_m if low is None else high - low
    if None in (height, extent.area_m2):
        return
    full = extent.area_m2 * height
    if volume > UNIT_FACTOR * full:
        expected = message(
            "stated_too_much",
            "found {volume:g}; the whole tank holds about {full:.4g} m3, expected m3: is it "
            "in litres?",
            volume=volume,
            full=full,
        )
        if low is not None:
            expected = message(
                "delivered_too_much",
                "found {volume:g}; the tank between low_m and high_m holds about {full:.4g} "
                "m3, expected m3: is it in litres?",
                volume=volume,
                full=full,
            )
        log.problem(table.file, expected, row, "volume_m3")


# ---- keys of [levels], the operating levels of a tank, and checks of their order


def check_levels(levels, extent, raw, log):
    """Check that the levels lie within the tank, in their order.

    The lowest dip in operation may be the lowest that can be pumped, and the safe fill may be the
    full tank. The maximum must be above both lower levels, because volumes between them are stated.
    """
    given = [(name, levels[name]) for name in _FROM_THE_TOP if levels[name] is not None]
    for name, dip in given:
        expected = dip_above_top(dip, extent)
        if expected:
            tell(log.problem, raw, "levels", name, expected)
    for (name, dip), (lower, low) in pairwise(given):
        if dip < low or (dip == low and name == "maximum_m"):
            expected = message(
                "level_below_lower_level",
                "found {level:g}; expected a dip above {lower} = {low:g}",
                level=dip,
                lower=lower,
                low=low,
            )
            tell(log.problem, raw, "levels", name, expected)
