"""Temperatures, expansion and Young's modulus of the shell."""

from tankcal.job.checks.common import is_not_given, loads_the_shell, tell
from tankcal.job.plausibility import (
    AIR_C,
    AMBIENT,
    E_GPA,
    EXPANSION_PER_K,
    REFERENCE_C,
    SHELL_C,
    SHELL_OVER_AIR_K,
)
from tankcal.messages import message

FAHRENHEIT_ZERO, FAHRENHEIT_STEP = 32.0, 5 / 9
CARBON_STEEL = "carbon_steel"


def check_material(values, kind, raw, log):
    """Temperatures of the season and the service; constants of the metal that was named."""
    _check_temperatures(values, raw, log)
    shell = values["checks"]["shell"] or CARBON_STEEL
    _check_expansion(values, shell, raw, log)
    if kind == "vertical":
        _check_modulus(values, shell, raw, log)


def _celsius(fahrenheit):
    return (fahrenheit - FAHRENHEIT_ZERO) * FAHRENHEIT_STEP


def _beyond(value, bounds):
    return value is not None and not bounds[0] <= value <= bounds[1]


def _check_temperatures(values, raw, log):
    service = values["checks"]["service"] or AMBIENT
    shell, air = values["survey"]["shell_temperature_c"], values["checks"]["air_temperature_c"]
    reference = values["table"]["reference_temperature_c"]
    if _beyond(air, AIR_C):
        text = message(
            "air_temperature_strange",
            "{found_c:g} degC in the air, expected {low_c:g} to {high_c:g}: in degrees Fahrenheit,"
            " which would be {celsius_c:.1f} degC?",
            found_c=air,
            low_c=AIR_C[0],
            high_c=AIR_C[1],
            celsius_c=_celsius(air),
        )
        tell(log.warning, raw, "checks", "air_temperature_c", text)
    if _beyond(shell, SHELL_C[service]):
        low, high = SHELL_C[service]
        text = message(
            "shell_temperature_strange",
            "{found_c:g} degC of the shell on the survey day, expected {low_c:g} to {high_c:g}: in"
            " degrees Fahrenheit, which would be {celsius_c:.1f} degC? For a tank that is hot or"
            " cold by its service, say so in checks.service",
            found_c=shell,
            low_c=low,
            high_c=high,
            celsius_c=_celsius(shell),
        )
        tell(log.warning, raw, "survey", "shell_temperature_c", text)
    elif None not in (shell, air) and service == AMBIENT and _beyond(shell - air, SHELL_OVER_AIR_K):
        text = message(
            "shell_unlike_air",
            "{found_c:g} degC, and the air had {air_c:g} (checks.air_temperature_c): expected"
            " {low_k:g} to {high_k:+g} K from it; is one of them in degrees Fahrenheit?",
            found_c=shell,
            air_c=air,
            low_k=SHELL_OVER_AIR_K[0],
            high_k=SHELL_OVER_AIR_K[1],
        )
        tell(log.warning, raw, "survey", "shell_temperature_c", text)
    if _beyond(reference, REFERENCE_C[service]):
        low, high = REFERENCE_C[service]
        text = message(
            "reference_temperature_strange",
            "a table for {found_c:g} degC, expected {low_c:g} to {high_c:g}: in degrees Fahrenheit,"
            " which would be {celsius_c:.1f} degC? For a tank that is hot or cold by its service,"
            " say so in checks.service",
            found_c=reference,
            low_c=low,
            high_c=high,
            celsius_c=_celsius(reference),
        )
        tell(log.warning, raw, "table", "reference_temperature_c", text)


def _check_expansion(values, shell, raw, log):
    found, bounds = values["material"]["expansion_per_k"], EXPANSION_PER_K.get(shell)
    if found is None:
        corrected = values["survey"]["shell_temperature_c"] is not None
        is_on = corrected and values["corrections"]["temperature"] is not False
        if shell != CARBON_STEEL and is_on and is_not_given(raw, "material", "expansion_per_k"):
            text = message(
                "expansion_missing",
                "missing; expected the thermal expansion of {shell}, for what is taken where it is"
                " blank is that of carbon steel",
                shell=shell,
            )
            tell(log.problem, raw, "material", "expansion_per_k", text)
        return
    if bounds is None or not _beyond(found, bounds):
        return
    for other, (low, high) in EXPANSION_PER_K.items():
        if other != shell and low <= found <= high:
            hint = message(
                "is_of_metal", "that of {shell}? Then say so in checks.shell", shell=other
            )
            break
    else:
        hint = message("power_of_ten", "is a digit or a power of ten wrong?")
    text = message(
        "expansion_strange",
        "{found:g} 1/K, expected {low:g} to {high:g} for {shell}: {hint}",
        found=found,
        low=bounds[0],
        high=bounds[1],
        shell=shell,
        hint=hint,
    )
    tell(log.warning, raw, "material", "expansion_per_k", text)


def _check_modulus(values, shell, raw, log):
    found, bounds = values["material"]["e_gpa"], E_GPA.get(shell)
    if found is None:
        is_loaded = loads_the_shell(values) or values["survey"]["liquid_level_m"]
        if shell != CARBON_STEEL and is_loaded and is_not_given(raw, "material", "e_gpa"):
            text = message(
                "modulus_missing",
                "missing; expected Young's modulus of {shell}, for what is taken where it is blank"
                " is that of carbon steel",
                shell=shell,
            )
            tell(log.problem, raw, "material", "e_gpa", text)
    elif bounds is not None and _beyond(found, bounds):
        text = message(
            "modulus_strange",
            "{found_gpa:g} GPa, expected {low_gpa:g} to {high_gpa:g} for {shell}: another metal?"
            " Then say so in checks.shell",
            found_gpa=found,
            low_gpa=bounds[0],
            high_gpa=bounds[1],
            shell=shell,
        )
        tell(log.warning, raw, "material", "e_gpa", text)
