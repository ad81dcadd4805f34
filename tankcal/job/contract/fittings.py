"""Columns of deadwood.csv and keys of [roof], with their checks."""

import re

from tankcal.job.checking import (
    RELATIVE_DENSITY,
    is_not_given,
    missing_beside,
    refuse_repeated,
    tell,
)
from tankcal.job.fields import VERTICAL, Field, choice, number, positive
from tankcal.job.plausibility import GIVES_ROOM, ROOF_KG_M2, TAKES_ROOM
from tankcal.messages import message
from tankcal.methods.base import methods

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
    takes, gives = (
        any(re.search(rf"\b{re.escape(word)}", name.lower()) for word in words)
        for words in (TAKES_ROOM, GIVES_ROOM)
    )
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


KEYS = (
    positive(
        "mass_kg",
        "floating roof: mass of the roof and all that floats with it, kilograms; blank: no"
        " floating roof",
        1e7,
        kinds=VERTICAL,
    ),
    number(
        "critical_bottom_m",
        "dip at which the liquid first touches the roof, from the table's zero, metres",
        0,
        100,
        kinds=VERTICAL,
    ),
    number(
        "critical_top_m",
        "dip at which the roof floats freely, from the table's zero, metres",
        0,
        100,
        kinds=VERTICAL,
    ),
    positive(
        "reference_density_kg_m3",
        "density of the liquid for the table, kg/m3",
        3000,
        kinds=VERTICAL,
    ),
    choice(
        "weighing",
        "mass as weighed in, or reduced to, air or vacuum",
        ("air", "vacuum"),
        kinds=VERTICAL,
    ),
    number(
        "high_critical_bottom_m",
        "critical_bottom_m with the legs in their high position; blank: a single position",
        0,
        100,
        kinds=VERTICAL,
    ),
    number(
        "high_critical_top_m",
        "critical_top_m with the legs in their high position",
        0,
        100,
        kinds=VERTICAL,
    ),
)
ZONES = (  # keys of the critical zone, with the legs in their usual and in their high position
    ("critical_bottom_m", "critical_top_m"),
    ("high_critical_bottom_m", "high_critical_top_m"),
)

# Possible mass per area of the tank; aluminium skins have 5 kg/m2, steel double decks 120 kg/m2.
LIGHTEST_KG_M2, HEAVIEST_KG_M2 = 1.0, 1000.0


def upside_down(low, high):
    """Return the message for a critical_top_m that is not above critical_bottom_m."""
    return message(
        "roof_upside_down",
        "found {high:g}; expected above critical_bottom_m = {low:g}",
        high=high,
        low=low,
    )


def check_roof(roof, extent, raw, log):
    """Check that all keys are given or none, and critical heights and mass are plausible."""
    names = [field.name for field in KEYS if field.name not in ZONES[1]]
    given = [name for name in names if not is_not_given(raw, "roof", name)]
    for name in names:
        if given and name not in given:
            tell(log.problem, raw, "roof", name, missing_beside(given[0]))
    if not _check_zones(roof, raw, log):
        return
    if extent.top_m is not None:
        for name in (*ZONES[0], *ZONES[1]):
            if roof[name] is not None and roof[name] > extent.top_m:
                expected = message(
                    "roof_above_shell",
                    "found {dip:g}; expected a dip within the shell, at most {top_m:.4g} m: "
                    "is it in another unit?",
                    dip=roof[name],
                    top_m=extent.top_m,
                )
                tell(log.problem, raw, "roof", name, expected)
    if roof["mass_kg"] is not None and extent.area_m2 is not None:
        _check_mass(roof, extent.area_m2, raw, log)


def _check_zones(roof, raw, log):
    """Check the critical zones of both positions of the legs; return False for a reversed zone."""
    for name, other in (ZONES[1], ZONES[1][::-1]):
        if roof[name] is not None and roof[other] is None and is_not_given(raw, "roof", other):
            tell(log.problem, raw, "roof", other, missing_beside(name))
    for bottom, top in ZONES:
        low, high = roof[bottom], roof[top]
        if None not in (low, high) and low >= high:
            tell(log.problem, raw, "roof", top, upside_down(low, high))
            return False
    usual, high_legs = (roof[bottom] for bottom, _ in ZONES)
    if None not in (usual, high_legs) and high_legs <= usual:
        expected = message(
            "high_legs_below",
            "found {high:g}; expected above critical_bottom_m = {low:g}, with the legs in their "
            "usual position",
            high=high_legs,
            low=usual,
        )
        tell(log.problem, raw, "roof", ZONES[1][0], expected)
    supplements = {table for method in methods() if method.is_supplement for table in method.tables}
    if high_legs is not None and supplements & set(raw.tables):
        expected = message(
            "high_legs_with_liquid",
            "given beside metered liquid; expected a single position of the legs",
        )
        tell(log.problem, raw, "roof", ZONES[1][0], expected)
    return True


def _check_mass(roof, area, raw, log):
    """Check the mass against the cross-section of the tank, m2, and the draught of the roof."""
    mass, density = roof["mass_kg"], roof["reference_density_kg_m3"]
    if not LIGHTEST_KG_M2 <= mass / area <= HEAVIEST_KG_M2:
        guess = message("in_grams", "is it in grams?")
        if mass / area < LIGHTEST_KG_M2:
            guess = message("in_tonnes", "is it in tonnes?")
        expected = message(
            "roof_mass",
            "found {mass:g}, which is {per_m2:.3g} kg for each m2 of the tank; expected "
            "{least:g} to {most:g}: {guess}",
            mass=mass,
            per_m2=mass / area,
            least=LIGHTEST_KG_M2,
            most=HEAVIEST_KG_M2,
            guess=guess,
        )
        tell(log.problem, raw, "roof", "mass_kg", expected)
        return
    least, most = (each * area for each in ROOF_KG_M2)
    if not least <= mass <= most:
        text = message(
            "roof_mass_strange",
            "{found_kg:g} kg, expected {least_kg:.3g} to {most_kg:.3g} kg for a roof of "
            "{area_m2:.4g} m2: is it in another unit?",
            found_kg=mass,
            least_kg=least,
            most_kg=most,
            area_m2=area,
        )
        tell(log.warning, raw, "roof", "mass_kg", text)
    low, high = roof["critical_bottom_m"], roof["critical_top_m"]
    if None in (density, low, high) or density < RELATIVE_DENSITY:
        return
    draught = mass / (density * area)
    if draught > high - low:
        expected = message(
            "roof_cannot_float",
            "{above:.4g} m above critical_bottom_m; expected more: a roof of {mass:g} kg "
            "floats only when {draught:.3g} m of it are in the liquid",
            above=high - low,
            mass=mass,
            draught=draught,
        )
        tell(log.problem, raw, "roof", "critical_top_m", expected)
