"""Plausibility of temperatures, thermal expansion and Young's modulus of the shell."""

from tankcal.job.checking import is_not_given, loads_the_shell, tell
from tankcal.job.plausibility import (
    AIR_C,
    AMBIENT,
    CARBON_STEEL,
    E_GPA,
    EXPANSION_PER_K,
    REFERENCE_C,
    SHELL_C,
    SHELL_OVER_AIR_K,
)
from tankcal.messages import message

FAHRENHEIT_ZERO, FAHRENHEIT_STEP = 32.0, 5 / 9


def check_material(values, kind, raw, log):
    """Check temperatures for the service, and constants for the metal; as `check_plausible`."""
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
    _check_range(reference, REFERENCE_C[service], "table", "reference_temperature_c", raw, log)
    if _check_range(shell, SHELL_C[service], "survey", "shell_temperature_c", raw, log):
        _check_beside_air(shell, air, service, raw, log)


def _check_range(found, bounds, section, key, raw, log):
    """Return False, after a warning, if a temperature is implausible for the service."""
    if not _beyond(found, bounds):
        return True
    text = message(
        "temperature_strange",
        "{found_c:g} degC, expected {low_c:g} to {high_c:g}: in degrees Fahrenheit, which would be"
        " {celsius_c:.1f} degC? For a tank that is hot or cold by its service, say so in"
        " checks.service",
        found_c=found,
        low_c=bounds[0],
        high_c=bounds[1],
        celsius_c=_celsius(found),
    )
    tell(log.warning, raw, section, key, text)
    return False


def _check_beside_air(shell, air, service, raw, log):
    if None not in (shell, air) and service == AMBIENT and _beyond(shell - air, SHELL_OVER_AIR_K):
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


def _check_expansion(values, shell, raw, log):
    found, bounds = values["material"]["expansion_per_k"], EXPANSION_PER_K.get(shell)
    if found is None:
        corrected = values["survey"]["shell_temperature_c"] is not None
        if corrected and values["corrections"]["temperature"] is not False:
            _check_given("expansion_per_k", shell, raw, log)
    elif bounds is not None and _beyond(found, bounds):
        others = [metal for metal in EXPANSION_PER_K if not _beyond(found, EXPANSION_PER_K[metal])]
        hint = message("power_of_ten", "is a digit or a power of ten wrong?")
        if others:
            hint = message(
                "is_of_metal",
                "is the shell of {shell}? Then say so in checks.shell",
                shell=others[0],
            )
        _tell_strange("expansion_per_k", "1/K", found, bounds, shell, hint, raw, log)


def _check_modulus(values, shell, raw, log):
    found, bounds = values["material"]["e_gpa"], E_GPA.get(shell)
    if found is None:
        if loads_the_shell(values) or values["survey"]["liquid_level_m"]:
            _check_given("e_gpa", shell, raw, log)
    elif bounds is not None and _beyond(found, bounds):
        hint = message("another_metal", "is it another metal? Then say so in checks.shell")
        _tell_strange("e_gpa", "GPa", found, bounds, shell, hint, raw, log)


def _check_given(key, shell, raw, log):
    if shell == CARBON_STEEL or not is_not_given(raw, "material", key):
        return
    text = message(
        "constant_missing",
        "missing; expected the value of {shell}: where it is blank, that of carbon steel is taken",
        shell=shell,
    )
    tell(log.problem, raw, "material", key, text)


def _tell_strange(key, unit, found, bounds, shell, hint, raw, log):
    text = message(
        "constant_strange",
        "{found:g} {unit}, expected {low:g} to {high:g} for {shell}: {hint}",
        found=found,
        unit=unit,
        low=bounds[0],
        high=bounds[1],
        shell=shell,
        hint=hint,
    )
    tell(log.warning, raw, "material", key, text)
