"""Plausibility of a calibration with liquid: temperatures, expansion, meters, flows, batches."""

import numpy as np

from tankcal.job.checking import tell
from tankcal.job.plausibility import (
    AMBIENT,
    BATCH_SD,
    LIQUID_C,
    LIQUID_EXPANSION_PER_K,
    METER_DRIFT,
    METER_OVER_TANK_K,
    MUCH_METER_DRIFT,
    SHELL_OVER_LIQUID_K,
    TANK_C_STEP_K,
)
from tankcal.messages import message
from tankcal.methods.liquid.checks import meters_read
from tankcal.methods.liquid.columns import TEMPERATURES
from tankcal.methods.liquid.runs import place_runs, steps_of

FAHRENHEIT_ZERO, FAHRENHEIT_STEP = 32.0, 5 / 9
L_MIN_PER_M3_H = 1000 / 60


def check_metering(values, tables, registers, raw, log):
    """Warn about implausible readings; parameters as for `checks.check_all`."""
    if not tables["liquid"].rows:
        return
    table, meters = tables["liquid"], registers["meters"]
    _check_expansion(values, raw, log)
    if not _check_ranges(table, values, log):
        _check_beside_one_another(table, log)
    _check_drift(meters, raw, log)
    names = meters_read(table, meters)
    for name, meter in meters.items():
        rows = [k for k, meter_name in enumerate(names) if meter_name == name]
        _check_flow(table, rows, name, meter, log)
    _check_sizes(table, names, meters, log)


def _check_expansion(values, raw, log):
    found, (low, high) = values["liquid"]["expansion_per_k"], LIQUID_EXPANSION_PER_K
    if found and not low <= found <= high:
        text = message(
            "liquid_expands_strangely",
            "{found:g} 1/K, expected {low:g} to {high:g}: it is that of the liquid's volume, not of"
            " the shell",
            found=found,
            low=low,
            high=high,
        )
        tell(log.warning, raw, "liquid", "expansion_per_k", text)


def _check_ranges(table, values, log):
    """Warn once for each column with an implausible temperature; returns True after a warning.

    A hint at degrees Fahrenheit shows the converted value.
    """
    low, high = LIQUID_C[values["checks"]["service"] or AMBIENT]
    is_reported = False
    for column in TEMPERATURES:
        temperature_c = table.numbers(column)
        is_beyond = (temperature_c < low) | (temperature_c > high)
        if not is_beyond.any():
            continue
        first, is_reported = int(np.argmax(is_beyond)), True
        text = message(
            "metered_temperature_strange",
            "{found_c:g} degC, expected {low_c:g} to {high_c:g}, in {count} of {all} rows: in"
            " degrees Fahrenheit, which would be {celsius_c:.1f} degC? For a tank that is hot or"
            " cold by its service, say so in checks.service",
            found_c=float(temperature_c[first]),
            low_c=low,
            high_c=high,
            count=int(is_beyond.sum()),
            all=int(np.isfinite(temperature_c).sum()),
            celsius_c=(float(temperature_c[first]) - FAHRENHEIT_ZERO) * FAHRENHEIT_STEP,
        )
        log.warning(table.file, text, table.rows[first], column)
    return is_reported


def _check_beside_one_another(table, log):
    """Compare meter and tank, shell and tank, consecutive dips; report the worst row each."""
    meter, tank, shell = (table.numbers(column) for column in TEMPERATURES)
    for column, difference, most in (
        ("meter_temperature_c", meter - tank, METER_OVER_TANK_K),
        ("shell_temperature_c", shell - tank, SHELL_OVER_LIQUID_K),
    ):
        distance = np.nan_to_num(np.abs(difference))
        if distance.max() > most:
            worst = int(np.argmax(distance))
            text = message(
                "temperatures_far_apart",
                "{found_c:g} degC, and the liquid in the tank had {tank_c:g}: expected at most"
                " {most_k:g} K between them ({count} rows have more); is one of them in degrees"
                " Fahrenheit, or of another place?",
                found_c=float(table.numbers(column)[worst]),
                tank_c=float(tank[worst]),
                most_k=most,
                count=int((distance > most).sum()),
            )
            log.warning(table.file, text, table.rows[worst], column)
    for places in place_runs(table).values():
        steps = np.nan_to_num(np.abs(np.diff(tank[places])))
        if len(steps) and steps.max() > TANK_C_STEP_K:
            worst = int(np.argmax(steps)) + 1
            text = message(
                "tank_temperature_jumps",
                "{after_c:g} degC after {before_c:g} at the dip before: expected at most {most_k:g}"
                " K; where the tank is in layers give the mean of its strata",
                after_c=float(tank[places[worst]]),
                before_c=float(tank[places[worst - 1]]),
                most_k=TANK_C_STEP_K,
            )
            log.warning(table.file, text, table.rows[places[worst]], "tank_temperature_c")


def _check_drift(meters, raw, log):
    register = raw.registers.get("meters")
    for name, keys in meters.items():
        if None in (keys["factor"], keys["factor_after"]):
            continue
        drift = keys["factor_after"] / keys["factor"] - 1
        row = register.entries[name]["factor_after"].row or register.rows.get(name)
        if abs(drift) > MUCH_METER_DRIFT * (1 + 1e-9):
            text = message(
                "meter_changed",
                "{drift_percent:+.3f} % from the factor before; expected within {most_percent:g} %:"
                " the meter changed, and which volumes are right is not known",
                drift_percent=100 * drift,
                most_percent=100 * MUCH_METER_DRIFT,
            )
        elif abs(drift) > METER_DRIFT * (1 + 1e-9):
            text = message(
                "meter_drifted",
                "{drift_percent:+.3f} % from the factor before; expected within {most_percent:g} %:"
                " does u_factor_ppm hold that?",
                drift_percent=100 * drift,
                most_percent=100 * METER_DRIFT,
            )
        else:
            continue
        log.warning(register.file, text, row, f"{name}.factor_after")


def _check_flow(table, rows, name, meter, log):
    """Warn about flow rates outside the range of the proving of a meter."""
    flows = table.numbers("flow_m3_h")[rows]
    low = 0.0 if meter["flow_min_m3_h"] is None else meter["flow_min_m3_h"]
    high = np.inf if meter["flow_max_m3_h"] is None else meter["flow_max_m3_h"]
    is_beyond = (flows < low) | (flows > high)
    if not is_beyond.any():
        return
    first = int(np.argmax(is_beyond))
    flow = float(flows[first])
    in_litres = low * L_MIN_PER_M3_H <= flow <= high * L_MIN_PER_M3_H and flow > high
    text = message(
        "flow_out_of_range",
        "{flow_m3_h:g} m3/h, and meter {name!r} was proved from {low_m3_h:g} to {high_m3_h:g} m3/h"
        " ({count} of {all} flows are beyond){hint}",
        flow_m3_h=flow,
        name=name,
        low_m3_h=low,
        high_m3_h=high,
        count=int(is_beyond.sum()),
        all=int(np.isfinite(flows).sum()),
        hint=message("flow_in_litres", ": is it in litres per minute?") if in_litres else "",
    )
    log.warning(table.file, text, table.rows[rows[first]], "flow_m3_h")


def _check_sizes(table, names, meters, log):
    """Warn about batches that are too small for the repeatability of the meter."""
    row_sds = table.of("s_volume_l")
    small = []
    for step in steps_of(table):
        meter = meters.get(names[step.place])
        if meter is None or meter["repeatability_ppm"] is None or not step.volume_m3:
            continue
        size = abs(step.volume_m3)
        sd = np.hypot(meter["repeatability_ppm"] / 1e6 * size, (meter["fixed_l"] or 0.0) / 1000)
        if row_sds[step.place] is not None:
            sd = row_sds[step.place] / 1000
        if sd > BATCH_SD * size * (1 + 1e-9):
            small.append((size, sd, step.place))
    if small:
        size, sd, place = min(small)
        text = message(
            "batch_too_small",
            "a batch of {size_m3:g} m3, whose standard deviation is {sd_l:.3g} L: expected at most"
            " {most_percent:g} % of it ({count} batches have more); fewer, larger batches are worth"
            " more",
            size_m3=size,
            sd_l=1000 * sd,
            most_percent=100 * BATCH_SD,
            count=len(small),
        )
        log.warning(table.file, text, table.rows[place], "volume_m3")
