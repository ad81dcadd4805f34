"""What stands or floats in the tank: signs of deadwood, mass of the roof."""

import re

from tankcal.job.checks.common import tell
from tankcal.job.plausibility import GIVES_ROOM, ROOF_KG_M2, TAKES_ROOM
from tankcal.messages import message


def check_contents(values, deadwood, extent, raw, log):
    """Signs by the names of things; a roof of a credible mass."""
    if deadwood is not None:
        _check_signs(deadwood, log)
    mass = values["roof"]["mass_kg"]
    if None in (mass, extent.area_m2):
        return
    least, most = (each * extent.area_m2 for each in ROOF_KG_M2)
    if not least <= mass <= most:
        text = message(
            "roof_mass_strange",
            "{found_kg:g} kg, expected {least_kg:.3g} to {most_kg:.3g} kg for a roof of"
            " {area_m2:.4g} m2: in another unit?",
            found_kg=mass,
            least_kg=least,
            most_kg=most,
            area_m2=extent.area_m2,
        )
        tell(log.warning, raw, "roof", "mass_kg", text)


def _check_signs(table, log):
    for row, name, volume in zip(
        table.rows, table.of("name"), table.of("volume_m3"), strict=True
    ):  # fmt: skip
        if name is None or not volume:
            continue
        if volume > 0 and _is_of(name, TAKES_ROOM) and not _is_of(name, GIVES_ROOM):
            text = message(
                "deadwood_takes",
                "{volume_m3:+g} m3 gives room, and {name} is a thing that takes it: expected a"
                " negative volume",
                volume_m3=volume,
                name=name,
            )
            log.warning(table.file, text, row, "volume_m3")
        elif volume < 0 and _is_of(name, GIVES_ROOM):
            text = message(
                "deadwood_gives",
                "{volume_m3:+g} m3 takes room, and {name} is a thing that gives it: expected a"
                " positive volume",
                volume_m3=volume,
                name=name,
            )
            log.warning(table.file, text, row, "volume_m3")


def _is_of(name, words):
    """Does the name begin a word with one of these?"""
    return any(re.search(rf"\b{re.escape(word)}", name.lower()) for word in words)
