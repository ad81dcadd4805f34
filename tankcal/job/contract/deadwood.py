"""Columns of deadwood.csv, and checks of place, size and sign of the items."""

import re

from tankcal.job.checking import refuse_repeated
from tankcal.job.contract.shorthand import number
from tankcal.job.fields import Field
from tankcal.job.plausibility import GIVES_ROOM, TAKES_ROOM
from tankcal.messages import message

COLUMNS = (
    Field("name", "name", "name of the item, unique in the file", required=True),
    number(
        "bottom_m",
        "dip of the lowest point of the item, from the table's zero, metres",
        -100,
        100,
        required=True,
    ),
    number(
        "top_m",
        "dip of the highest point of the item, from the table's zero, metres",
        -100,
        100,
        required=True,
    ),
    number(
        "volume_m3",
        "volume of the item, cubic metres: negative if it reduces the capacity (a pipe),"
        " positive if it adds to it (a manhole)",
        -1e6,
        1e6,
        required=True,
    ),
    number("u_m3", "standard uncertainty of the volume, cubic metres", 0, 1e5),
)

TOLERANCE_M = 0.05  # permitted protrusion of an item from the nominal tank
LEAST_HEIGHT_M = 0.05  # height assumed for an item of zero height
SUMP_M = 2.0  # permitted depth below the bottom of an item that adds to the capacity
LARGE_SHARE = 0.1  # volume of an item over that of the tank at its height; warning above
SLACK = 1.05  # tolerance of the nominal cross-section


def check_deadwood(table, extent, log):
    """Check that names are unique, and place, volume and sign of each item plausible."""
    refuse_repeated(table, "name", log)
    columns = (table.of(name) for name in ("name", "bottom_m", "top_m", "volume_m3", "u_m3"))
    for row, name, bottom, top, volume, u in zip(table.rows, *columns, strict=True):
        if name is not None and volume:
            _check_sign(table, row, name, volume, log)
        if None in (bottom, top):
            continue
        if bottom > top:
            expected = message(
                "deadwood_upside_down",
                "found {top:g} below bottom_m = {bottom:g}; expected a top above it",
                top=top,
                bottom=bottom,
            )
            log.problem(table.file, expected, row, "top_m")
            continue
        _check_place(table, row, bottom, top, volume, extent, log)
        if volume is None:
            continue
        _check_volume(table, row, top - bottom, volume, extent, log)
        if u is not None and volume and u > abs(volume):
            expected = message(
                "deadwood_u_large",
                "u = {u_m3:g} m3 of a volume of {volume_m3:g} m3: is it the right unit?",
                u_m3=u,
                volume_m3=volume,
            )
            log.warning(table.file, expected, row, "u_m3")


def _check_sign(table, row, name, volume, log):
    """Check that the sign of the volume agrees with the name of the item."""
    takes, gives = (_has_word(name, words) for words in (TAKES_ROOM, GIVES_ROOM))
    values = {"volume_m3": volume, "name": name}
    if volume > 0 and takes and not gives:
        text = message(
            "deadwood_takes",
            "{volume_m3:+g} m3 adds to the capacity, but {name} reduces it: expected a negative"
            " volume",
            **values,
        )
    elif volume > 0 and not gives:
        text = message(
            "deadwood_sign_unsaid",
            "{volume_m3:+g} m3 adds to the capacity, but {name} is no known name of an added"
            " space: expected a negative volume for an object in the tank, or a name such as"
            " manhole or sump",
            **values,
        )
    elif volume < 0 and gives:
        text = message(
            "deadwood_gives",
            "{volume_m3:+g} m3 reduces the capacity, but {name} adds to it: expected a positive"
            " volume",
            **values,
        )
    else:
        return
    log.warning(table.file, text, row, "volume_m3")


def _has_word(name, words):
    """Determine whether a word of the name begins with any of `words`."""
    return any(re.search(rf"\b{re.escape(word)}", name.lower()) for word in words)


def _check_place(table, row, bottom, top, volume, extent, log):
    """Check that an item lies between the lowest point and the top of the tank."""
    if extent.top_m is not None and top > extent.top_m + TOLERANCE_M:
        expected = message(
            "deadwood_too_high",
            "found {top:g}; expected at most {top_m:.4g}, the top of the tank: dips in metres, "
            "from the table's zero",
            top=top,
            top_m=extent.top_m,
        )
        log.problem(table.file, expected, row, "top_m")
    lowest = extent.lowest_m
    if lowest is None:
        return
    if volume is not None and volume > 0:
        lowest -= SUMP_M
    if bottom < lowest - TOLERANCE_M:
        expected = message(
            "deadwood_too_low",
            "found {bottom:g}; expected {lowest:.4g} or more, the tank's lowest point: dips in "
            "metres, from the table's zero",
            bottom=bottom,
            lowest=lowest,
        )
        log.problem(table.file, expected, row, "bottom_m")


def _check_volume(table, row, height, volume, extent, log):
    """Check the volume of an item against the volume of the tank over its height."""
    if volume == 0:
        expected = message("deadwood_of_nothing", "found 0, which has no effect")
        log.warning(table.file, expected, row, "volume_m3")
    if extent.area_m2 is None:
        return
    full = extent.area_m2 * max(height, LEAST_HEIGHT_M)
    if abs(volume) > SLACK * full:
        expected = message(
            "deadwood_too_large",
            "found {volume:g}; the whole tank holds {full:.4g} m3 between bottom_m and "
            "top_m, expected less, in cubic metres: is it in litres?",
            volume=volume,
            full=full,
        )
        log.problem(table.file, expected, row, "volume_m3")
    elif abs(volume) > LARGE_SHARE * full:
        expected = message(
            "deadwood_large",
            "found {volume_m3:g}; the whole tank holds {full_m3:.4g} m3 between bottom_m and "
            "top_m: is it in litres?",
            volume_m3=volume,
            full_m3=full,
        )
        log.warning(table.file, expected, row, "volume_m3")
