"""Settings that hang together: heights of the datum, the survey's liquid, densities, points."""

from tankcal.job.checks.common import has_wall_points, is_not_given, loads_the_shell, tell
from tankcal.job.plausibility import DENSITIES_KG_M3
from tankcal.messages import message

MAX_DIP_OFFSET_M = 1.0
RELATIVE_DENSITY = 20  # smaller numbers are no densities in kg/m3
DENSITIES = (
    ("survey", "liquid_density_kg_m3"),
    ("table", "liquid_density_kg_m3"),
    ("table", "other_densities_kg_m3"),
    ("roof", "reference_density_kg_m3"),
)


def check_settings(values, tables, extent, kind, raw, log):
    """Heights of the datum and of deliveries, pairs of keys, densities."""
    datum, table = values["datum"], values["table"]
    _check_dip_plate(values, tables, kind, raw, log)
    for given, lacking in (("dip_x_m", "dip_y_m"), ("dip_y_m", "dip_x_m")):
        if datum[given] is not None and is_not_given(raw, "datum", lacking):
            tell(log.problem, raw, "datum", lacking, f"missing; expected beside {given}")
    _check_survey_liquid(values["survey"], extent, raw, log)
    _check_densities(values, raw, log)
    if table["other_densities_kg_m3"] and not loads_the_shell(values):
        expected = "given with corrections.head = false; expected one or the other"
        tell(log.problem, raw, "table", "other_densities_kg_m3", expected)
    _check_deliveries(table["minimum_delivery_m"] or (), extent, raw, log)
    issued, surveyed = values["certificate"].get("date_of_issue"), values["survey"]["date"]
    if issued and surveyed and issued < surveyed:
        expected = f"found {issued}, before the survey of {surveyed}; expected no earlier day"
        tell(log.problem, raw, "certificate", "date_of_issue", expected)


def _check_deliveries(heights, extent, raw, log):
    """Each height of a least delivery once, and no more than the tank has."""
    for place, height in enumerate(heights):
        expected = ""
        if extent.height_m is not None and height > extent.height_m:
            expected = f"expected at most the height of the tank, {extent.height_m:g} m"
        elif height in heights[:place]:
            expected = "expected it once"
        if expected:
            expected = f"found {height:g}; {expected}"
            tell(log.problem, raw, "table", "minimum_delivery_m", expected)


def _check_dip_plate(values, tables, kind, raw, log):
    """The plate lies on the bottom, or nearly so; of a scan the bottom is not known yet."""
    plate, bottoms = values["datum"]["dip_plate_z_m"], bottoms_z(values, tables, kind)
    if plate is None or not bottoms:
        return
    low, high = min(bottoms), max(bottoms)
    if low - MAX_DIP_OFFSET_M <= plate <= high + MAX_DIP_OFFSET_M:
        return
    where = f"{plate - high:g} m above" if plate > high else f"{low - plate:g} m below"
    edge = values["datum"]["bottom_z_m"]
    of_edge = "" if edge is None else f" (bottom_z_m = {edge:g})"
    expected = (
        f"{where} the bottom{of_edge}; expected at most {MAX_DIP_OFFSET_M:g} m: another unit or"
        " frame?"
    )
    tell(log.problem, raw, "datum", "dip_plate_z_m", expected)


def bottoms_z(values, tables, kind):
    """Heights at which a bottom is known to lie, m, in the frame of the points."""
    if kind in ("horizontal", "sphere"):
        return [] if has_wall_points(tables) else [0.0]
    if values["datum"]["bottom_z_m"] is None:
        return []
    surveyed = [] if tables["bottom"] is None else tables["bottom"].of("z_m")
    found = [values["datum"]["bottom_z_m"], values["bottom"]["centre_z_m"], *surveyed]
    return [z for z in found if z is not None]


def _check_survey_liquid(survey, extent, raw, log):
    level, density = survey["liquid_level_m"], survey["liquid_density_kg_m3"]
    if density and is_not_given(raw, "survey", "liquid_level_m"):
        expected = "a density without liquid_level_m; set both to 0 when the tank was empty"
        tell(log.problem, raw, "survey", "liquid_density_kg_m3", expected)
    if level and (density == 0 or is_not_given(raw, "survey", "liquid_density_kg_m3")):
        expected = f"missing beside liquid_level_m = {level:g}; expected the liquid's density"
        tell(log.problem, raw, "survey", "liquid_density_kg_m3", expected)
    if level and extent.top_m is not None and level > extent.top_m:
        expected = (
            f"found {level:g}; expected at most the top of the shell, {extent.top_m:g} m above the"
            " table's zero: in another unit?"
        )
        tell(log.problem, raw, "survey", "liquid_level_m", expected)


def _check_densities(values, raw, log):
    lightest, heaviest = DENSITIES_KG_M3
    for section, key in DENSITIES:
        found = values[section][key]
        for density in found if isinstance(found, tuple) else (found,):
            if not density:
                continue
            if density < RELATIVE_DENSITY:
                expected = f"found {density:g}; expected kg/m3, such as 850: is it in g/cm3?"
                tell(log.problem, raw, section, key, expected)
            elif not lightest <= density <= heaviest:
                expected = message(
                    "strange_density",
                    "{density_kg_m3:g} kg/m3; liquids in tanks have {least:g} to {most:g}",
                    density_kg_m3=density,
                    least=lightest,
                    most=heaviest,
                )
                tell(log.warning, raw, section, key, expected)
    table = values["table"]
    all_of_table = [*(table["other_densities_kg_m3"] or ()), table["liquid_density_kg_m3"]]
    if len(set(all_of_table)) < len(all_of_table):
        expected = "a density twice, or the one of liquid_density_kg_m3 again; expected others"
        tell(log.problem, raw, "table", "other_densities_kg_m3", expected)
    own, of_roof = table["liquid_density_kg_m3"], values["roof"]["reference_density_kg_m3"]
    if own and of_roof and own != of_roof:
        text = message(
            "roof_density",
            "{roof_kg_m3:g} kg/m3 beside {table_kg_m3:g} kg/m3 of the table: its roof is that of"
            " another liquid than its head",
            roof_kg_m3=of_roof,
            table_kg_m3=own,
        )
        tell(log.warning, raw, "roof", "reference_density_kg_m3", text)
