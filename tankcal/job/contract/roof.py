"""Keys of [roof], and checks that they are complete and plausible for the tank."""

from tankcal.job.checking import RELATIVE_DENSITY, is_not_given, missing_beside, tell
from tankcal.job.contract.shorthand import VERTICAL, choice, number, positive
from tankcal.job.plausibility import ROOF_KG_M2
from tankcal.messages import message
from tankcal.methods.base import methods

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
