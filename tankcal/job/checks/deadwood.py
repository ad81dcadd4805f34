"""deadwood.csv: things that are in the tank, of a size that fits into it, with the right sign."""

import re

from tankcal.job.checks.common import is_not_given, missing_beside, refuse_repeated, tell
from tankcal.job.checks.settings import RELATIVE_DENSITY
from tankcal.job.contract import KEYS
from tankcal.job.plausibility import GIVES_ROOM, ROOF_KG_M2, TAKES_ROOM
from tankcal.messages import message

# [roof]: complete or not at all, and of a credible size for the tank.

LIGHTEST_KG_M2, HEAVIEST_KG_M2 = 1.0, 1000.0  # aluminium skins have 5, steel double decks 120


def check_roof(roof, extent, raw, log):
    """All keys or none; critical heights in order and within the shell; a mass that can float."""
    names = [field.name for field in KEYS["roof"]]
    given = [name for name in names if not is_not_given(raw, "roof", name)]
    for name in names:
        if given and name not in given:
            tell(log.problem, raw, "roof", name, missing_beside(given[0]))
    low, high = roof["critical_bottom_m"], roof["critical_top_m"]
    if None not in (low, high) and low >= high:
        expected = message(
            "roof_upside_down",
            "found {high:g}; expected above critical_bottom_m = {low:g}",
            high=high,
            low=low,
        )
        tell(log.problem, raw, "roof", "critical_top_m", expected)
        return
    if extent.top_m is not None:
        for name in ("critical_bottom_m", "critical_top_m"):
            if roof[name] is not None and roof[name] > extent.top_m:
                expected = message(
                    "roof_above_shell",
                    "found {dip:g}; expected a dip within the shell, at most {top_m:.4g} m: in "
                    "another unit?",
                    dip=roof[name],
                    top_m=extent.top_m,
                )
                tell(log.problem, raw, "roof", name, expected)
    if roof["mass_kg"] is not None and extent.area_m2 is not None:
        _check_mass(roof, extent.area_m2, raw, log)


def _check_mass(roof, area, raw, log):
    mass, density = roof["mass_kg"], roof["reference_density_kg_m3"]
    if not LIGHTEST_KG_M2 <= mass / area <= HEAVIEST_KG_M2:
        guess = message("in_grams", "in grams?")
        if mass / area < LIGHTEST_KG_M2:
            guess = message("in_tonnes", "in tonnes?")
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
            "{found_kg:g} kg, expected {least_kg:.3g} to {most_kg:.3g} kg for a roof of"
            " {area_m2:.4g} m2: in another unit?",
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
            "{above:.4g} m above critical_bottom_m; expected more, for a roof of {mass:g} kg "
            "floats only when {draught:.3g} m of it are in the liquid",
            above=high - low,
            mass=mass,
            draught=draught,
        )
        tell(log.problem, raw, "roof", "critical_top_m", expected)


TOLERANCE_M = 0.05  # by which a thing may stick out of the drawing's tank
LEAST_HEIGHT_M = 0.05  # of a thing that is given as if it had none
SUMP_M = 2.0  # what gives room may lie below the bottom
LARGE_SHARE = 0.1  # of what the tank holds beside it
SLACK = 1.05  # the drawing's cross-section is not the real one


def check_deadwood(table, extent, log):
    """Names once; bottom below top, both in the tank; a volume that its slice can hold."""
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
    """What gives room says so by its name; what takes it is negative."""
    takes, gives = (_is_of(name, words) for words in (TAKES_ROOM, GIVES_ROOM))
    values = {"volume_m3": volume, "name": name}
    if volume > 0 and takes and not gives:
        text = message(
            "deadwood_takes",
            "{volume_m3:+g} m3 gives room, and {name} is a thing that takes it: expected a"
            " negative volume",
            **values,
        )
    elif volume > 0 and not gives:
        text = message(
            "deadwood_sign_unsaid",
            "{volume_m3:+g} m3 gives room, and the name {name} does not say how: expected a"
            " negative volume for what stands in the tank, or the name of what gives room, such as"
            " manhole or sump",
            **values,
        )
    elif volume < 0 and gives:
        text = message(
            "deadwood_gives",
            "{volume_m3:+g} m3 takes room, and {name} is a thing that gives it: expected a"
            " positive volume",
            **values,
        )
    else:
        return
    log.warning(table.file, text, row, "volume_m3")


def _is_of(name, words):
    """Does the name begin a word with one of these?"""
    return any(re.search(rf"\b{re.escape(word)}", name.lower()) for word in words)


def _check_place(table, row, bottom, top, volume, extent, log):
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
    if volume == 0:
        expected = message("deadwood_of_nothing", "found 0; a volume of nothing")
        log.warning(table.file, expected, row, "volume_m3")
    if extent.area_m2 is None:
        return
    full = extent.area_m2 * max(height, LEAST_HEIGHT_M)
    if abs(volume) > SLACK * full:
        expected = message(
            "deadwood_too_large",
            "found {volume:g}; the whole tank holds {full:.4g} m3 between bottom_m and top_m, "
            "expected less, in cubic metres: in litres?",
            volume=volume,
            full=full,
        )
        log.problem(table.file, expected, row, "volume_m3")
    elif abs(volume) > LARGE_SHARE * full:
        expected = message(
            "deadwood_large",
            "found {volume_m3:g}; the whole tank holds {full_m3:.4g} m3 between bottom_m and"
            " top_m: in litres?",
            volume_m3=volume,
            full_m3=full,
        )
        log.warning(table.file, expected, row, "volume_m3")
