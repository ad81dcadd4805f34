"""[roof]: complete or not at all, and of a credible size for the tank."""

from tankcal.job.checks.common import is_not_given, tell
from tankcal.job.checks.settings import RELATIVE_DENSITY
from tankcal.job.contract import KEYS

LIGHTEST_KG_M2, HEAVIEST_KG_M2 = 1.0, 1000.0  # aluminium skins have 5, steel double decks 120


def check_roof(roof, extent, raw, log):
    """All keys or none; critical heights in order and within the shell; a mass that can float."""
    names = [field.name for field in KEYS["roof"]]
    given = [name for name in names if not is_not_given(raw, "roof", name)]
    for name in names:
        if given and name not in given:
            tell(log.problem, raw, "roof", name, f"missing; expected beside {given[0]}")
    low, high = roof["critical_bottom_m"], roof["critical_top_m"]
    if None not in (low, high) and low >= high:
        expected = f"found {high:g}; expected above critical_bottom_m = {low:g}"
        tell(log.problem, raw, "roof", "critical_top_m", expected)
        return
    if extent.top_m is not None:
        for name in ("critical_bottom_m", "critical_top_m"):
            if roof[name] is not None and roof[name] > extent.top_m:
                expected = f"found {roof[name]:g}; expected a dip within the shell, at most"
                expected = f"{expected} {extent.top_m:.4g} m: in another unit?"
                tell(log.problem, raw, "roof", name, expected)
    if roof["mass_kg"] is not None and extent.area_m2 is not None:
        _check_mass(roof, extent.area_m2, raw, log)


def _check_mass(roof, area, raw, log):
    mass, density = roof["mass_kg"], roof["reference_density_kg_m3"]
    if not LIGHTEST_KG_M2 <= mass / area <= HEAVIEST_KG_M2:
        guess = "in tonnes?" if mass / area < LIGHTEST_KG_M2 else "in grams?"
        expected = (
            f"found {mass:g}, which is {mass / area:.3g} kg for each m2 of the tank; expected"
            f" {LIGHTEST_KG_M2:g} to {HEAVIEST_KG_M2:g}: {guess}"
        )
        tell(log.problem, raw, "roof", "mass_kg", expected)
        return
    low, high = roof["critical_bottom_m"], roof["critical_top_m"]
    if None in (density, low, high) or density < RELATIVE_DENSITY:
        return
    draught = mass / (density * area)
    if draught > high - low:
        expected = (
            f"{high - low:.4g} m above critical_bottom_m; expected more, for a roof of {mass:g} kg"
            f" floats only when {draught:.3g} m of it are in the liquid"
        )
        tell(log.problem, raw, "roof", "critical_top_m", expected)
