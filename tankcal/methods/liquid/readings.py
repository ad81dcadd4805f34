"""Calibration with liquid: problems of the job, and readings in SI."""

import datetime
from dataclasses import dataclass, field

import numpy as np

from tankcal.job.checking import has_rows, is_not_given, missing_beside, settings_place, tell
from tankcal.job.checks.extent import (
    extent_of,
    has_wall_points,
    is_strapped,
    is_unsurveyed,
)
from tankcal.job.contract.bottom import bottom_form
from tankcal.job.entries import kind_of
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
from tankcal.job.structure import structure
from tankcal.job.tables import nearest
from tankcal.messages import message
from tankcal.methods.liquid.columns import (
    EXPANSION_SHARE,
    GEOMETRY,
    JOINT,
    NEEDED,
    RADIUS_SHARE,
    TEMPERATURE_SD_K,
    TEMPERATURES,
)
from tankcal.methods.liquid.runs import CHECK, check_runs, place_runs, steps_of
from tankcal.tank.liquid import MOST_ROWS

FAHRENHEIT_ZERO, FAHRENHEIT_STEP = 32.0, 5 / 9
L_MIN_PER_M3_H = 1000 / 60


def check_liquid(values, tables, registers, raw, log):
    """Check meters, settings and the order of rows; parameters as for `check_all`."""
    table = tables["liquid"]
    if len(table.rows) > MOST_ROWS:
        expected = message(
            "too_many_batches",
            "{count} rows; expected at most {most}",
            count=len(table.rows),
            most=MOST_ROWS,
        )
        log.problem(table.file, expected)
        return
    _check_meters(table, registers["meters"], raw, log)
    extent = None
    if values is not None:
        kind = kind_of(raw)
        extent = extent_of(values, tables, kind)
        _check_settings(values, tables, raw, log)
        _check_beside(values, tables, kind, raw, log)
    check_runs(table, values, extent, raw, log)


def meters_read(table, meters):
    """Name of the meter of each row; None where it is not known.

    A blank means the only meter. At the start of a run, where nothing was metered, the meter of the
    next row applies.
    """
    only = next(iter(meters)) if len(meters) == 1 else None
    names = [name or only for name in table.of("meter")]
    for rows in place_runs(table).values():
        if len(rows) > 1 and names[rows[0]] is None:
            names[rows[0]] = names[rows[1]]
    return names


def tell_without_rows(tables, registers, raw, log):
    """Report meters, settings or an empty table without any readings."""
    if "liquid" in raw.tables:
        table = raw.tables["liquid"]
        has_wall = has_wall_points(tables) or is_strapped(tables)
        is_begun = registers["meters"] or _given_settings(raw)
        if table is not None and (has_wall or kind_of(raw) != "vertical") and is_begun:
            expected = message(
                "meters_without_rows",
                "no rows, but a meter or [liquid] is filled in; expected the batches and dips",
            )
            log.problem(table.file, expected)
        return
    for key in _given_settings(raw)[:1]:
        expected = message(
            "settings_without_liquid",
            "given without {file}; expected both or none",
            file=raw.file_of("liquid"),
        )
        tell(log.problem, raw, "liquid", key, expected)
    if registers["meters"]:
        expected = message("no_liquid", "without effect: nothing was metered into the tank")
        log.warning(raw.registers["meters"].file, expected)


def _given_settings(raw):
    entries = (raw.settings or {}).get("liquid", {})
    return [key for key in entries if not is_not_given(raw, "liquid", key)]


def _check_meters(table, meters, raw, log):
    file = raw.file_of("meters")
    if raw.registers.get("meters", ()) is None:
        return  # unreadable, reported already
    if not meters:
        expected = message(
            "no_meter",
            "nothing filled in; expected a section for each meter of {of}",
            of=table.file,
        )
        log.problem(file, expected)
        return
    used_meters = meters_read(table, meters)
    for row, given, name in zip(table.rows, table.of("meter"), used_meters, strict=True):
        if name is None and not log.has(table.file, row, "meter"):
            expected = message("meter_not_named", "blank; expected a meter of {file}", file=file)
            log.problem(table.file, expected, row, "meter")
        elif given is not None and given not in meters:
            expected = message(
                "no_such_meter",
                "found {name!r}; expected a meter of {file}{hint}",
                name=given,
                file=file,
                hint=nearest(given, meters),
            )
            log.problem(table.file, expected, row, "meter")
    register = raw.registers["meters"]
    for name, keys in meters.items():
        low, high = keys["flow_min_m3_h"], keys["flow_max_m3_h"]
        if None not in (low, high) and low >= high:
            expected = message(
                "flows_upside_down",
                "found {low:g}; expected less than flow_max_m3_h = {high:g}",
                low=low,
                high=high,
            )
            _tell_of_meter(log.problem, register, name, "flow_min_m3_h", expected)
        if name not in used_meters:
            expected = message("meter_not_read", "without effect: no row of {of} names it",
                               of=table.file)  # fmt: skip
            log.warning(file, expected, register.rows.get(name), name)


def _tell_of_meter(report, register, name, key, expected):
    value = register.entries[name].get(key)
    row = register.rows.get(name) if value is None or value.row is None else value.row
    report(register.file, expected, row, f"{name}.{key}")


def _check_settings(values, tables, raw, log):
    """Require the settings of a calibration with liquid; refuse settings without effect."""
    table, given = tables["liquid"], values["liquid"]
    for key in NEEDED:
        if is_not_given(raw, "liquid", key):
            tell(log.problem, raw, "liquid", key, missing_beside(table.file))
    dips = zip(table.of("dip_m"), table.of("s_dip_mm"), strict=True)
    if is_not_given(raw, "liquid", "s_dip_mm") and any(
        sd is None for dip, sd in dips if dip is not None
    ):
        expected = message(
            "dip_sd_missing",
            "missing; expected it, or s_dip_mm in each row of {file}",
            file=table.file,
        )
        tell(log.problem, raw, "liquid", "s_dip_mm", expected)
    runs = place_runs(table)
    if len(runs) == 1 and not table.skipped and is_not_given(raw, "liquid", "run_ppm"):
        expected = message(
            "run_effect_missing",
            "missing; expected by how much whole runs differ (0: not at all): there is one run,"
            " {run!r}, and only two or more show it",
            run=next(iter(runs)),
        )
        tell(log.problem, raw, "liquid", "run_ppm", expected)
    alone = is_unsurveyed(tables) and not any(
        table is None for name, table in raw.tables.items() if name != "liquid"
    )
    if alone and given["table"] == GEOMETRY:
        expected = message(
            "no_geometry_beside_liquid",
            "found {table}; expected joint or liquid: nothing but liquid measured the tank",
            table=GEOMETRY,
        )
        tell(log.problem, raw, "liquid", "table", expected)
    if given["u_radius_mm"] is not None and not is_unsurveyed(tables):
        expected = message(
            "radius_beside_survey",
            "given beside a survey of the wall; expected only where liquid alone tells the tank",
        )
        tell(log.problem, raw, "liquid", "u_radius_mm", expected)


def _check_beside(values, tables, kind, raw, log):
    """Refuse a second determination of the bottom, and a roof that touches the liquid."""
    lowest, table = values["roof"]["critical_bottom_m"], tables["liquid"]
    if kind == "vertical" and lowest is not None:
        _refuse_roof(table, lowest, log)
    if kind != "vertical" or bottom_form(values, tables["bottom"]) != "liquid":
        return
    expected = message(
        "bottom_beside_liquid",
        "a bottom measured by liquid beside {file}; expected only one of them: {file} tells what"
        " is below its first dip",
        file=tables["liquid"].file,
    )
    if has_rows(tables["bottom"]):
        log.problem(tables["bottom"].file, expected)
    else:
        file, row, name = settings_place(raw, "bottom", "form")
        log.problem(file, expected, row, name)


def _refuse_roof(table, lowest_m, log):
    for row, dip in zip(table.rows, table.of("dip_m"), strict=True):
        if dip is not None and dip > lowest_m:
            expected = message(
                "dip_reaches_roof",
                "found {dip:g}; expected dips below roof.critical_bottom_m = {lowest:g} m: above it"
                " the roof takes part in the volume",
                dip=dip,
                lowest=lowest_m,
            )
            log.problem(table.file, expected, row, "dip_m")
            return


# ---- plausibility of a calibration with liquid: temperatures, expansion, meters, flows, batches


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


_EPOCH = datetime.datetime(2000, 1, 1)


@dataclass(frozen=True)
class Meter:
    """One meter according to its certificate: true volume = factor x indicated volume.

    The standard deviation of a batch v is sqrt((repeatability v)^2 + fixed_m3^2).

    Attributes
    ----------
    name : str
        Name of its section in meters.toml.
    factor : float
    u_factor : float
        Relative standard uncertainty of the factor.
    repeatability : float
        Standard deviation of a batch, relative to its volume.
    fixed_m3 : float
        Constant part of the standard deviation of a batch.
    certificate, prover : str
        Printed if given, else "".
    flow_min_m3_h, flow_max_m3_h : float or None
        Range of flow rates of the proving.
    factor_after : float or None
        Factor proved after the calibration; None: not proved again.
    row : int or None
        Row of its section in the input, for messages.
    """

    name: str
    factor: float
    u_factor: float
    repeatability: float
    fixed_m3: float = 0.0
    certificate: str = ""
    prover: str = ""
    flow_min_m3_h: float | None = None
    flow_max_m3_h: float | None = None
    factor_after: float | None = None
    row: int | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Metering:
    """All runs of a job, n rows in the order of liquid.csv, in SI; nan: not given.

    The rows of one run are consecutive, except for rows that are not used. The first row of a run
    has volume 0 and is its start.

    Attributes
    ----------
    row : ndarray of int, shape (n,)
        Row of the input, for messages.
    run, meter : tuple of str, length n
    volume_m3 : ndarray, shape (n,)
        Indicated volume since the row above: positive when filled, negative when emptied, 0 at the
        start of a run.
    dip_m : ndarray, shape (n,)
        Dip as read; nan only at the start of a run: the tank was empty and dry.
    s_dip_m : ndarray, shape (n,)
        Standard deviation of the dip, always given; 0 if the tank was empty and dry.
    s_volume_m3 : ndarray, shape (n,)
        Standard deviation of the batch, which replaces that of the meter; nan: by the meter.
    meter_c, tank_c, shell_c : ndarray, shape (n,)
        Temperatures of the liquid at the meter and in the tank and of the shell, degrees Celsius;
        nan: no correction.
    flow_m3_h : ndarray, shape (n,)
    time : tuple, length n
        Times in ISO format, or None.
    used : ndarray of bool, shape (n,)
        False: the *dip* of the row is not used; its volume still entered the tank.
    note : tuple, length n
    meters : dict
        {name: Meter} of the meters in use.
    density_kg_m3 : float
        Density of the calibrating liquid at density_c.
    density_c : float
    expansion_per_k : float
        Cubic thermal expansion of the liquid, 1/K.
    u_density_kg_m3 : float
    u_dip_zero_m : float
        Standard uncertainty of the common error of all dips.
    flex_sd_m3_per_m : float
        Prior standard deviation of the flexing of the bottom, m3 per metre of head.
    run_sd : float or None
        Relative standard deviation of the run effect; None: estimated, from two runs or more.
    certified : {"joint", "liquid", "geometry"}
        Table to be printed.
    u_expansion_per_k : float
        Standard uncertainty of expansion_per_k.
    u_temperature_c : float
        Standard deviation of one temperature.
    u_radius_m : float or None
        Prior standard deviation of the radius of each course about half the nominal diameter, for a
        vertical tank calibrated with liquid alone; None: without a nominal diameter.
    file : str
        File of the rows, for messages.
    meters_file : str
    """

    row: np.ndarray
    run: tuple[str, ...]
    meter: tuple[str, ...]
    volume_m3: np.ndarray
    dip_m: np.ndarray
    s_dip_m: np.ndarray
    s_volume_m3: np.ndarray
    meter_c: np.ndarray
    tank_c: np.ndarray
    shell_c: np.ndarray
    flow_m3_h: np.ndarray
    time: tuple[str | None, ...]
    used: np.ndarray
    note: tuple[str | None, ...]
    meters: dict[str, Meter]
    density_kg_m3: float
    density_c: float
    expansion_per_k: float
    u_density_kg_m3: float
    u_dip_zero_m: float
    flex_sd_m3_per_m: float
    run_sd: float | None = None
    certified: str = "joint"
    u_expansion_per_k: float = 0.0
    u_temperature_c: float = 0.0
    u_radius_m: float | None = None
    file: str = field(default="liquid.csv", compare=False)
    meters_file: str = field(default="meters.toml", compare=False)

    def __len__(self):
        """Number of rows."""
        return len(self.row)

    @property
    def runs(self):
        """{name of the run: indices of its rows, in order}."""
        places = {}
        for place, run in enumerate(self.run):
            places.setdefault(run, []).append(place)
        return {run: np.array(rows) for run, rows in places.items()}


def make_metering(values, tables, registers, raw):
    """Build `Metering` from the values, tables and registers of a job without problems."""
    table, given = tables["liquid"], values["liquid"]
    rows, meters = raw.registers["meters"].rows, registers["meters"]
    names = tuple(meters_read(table, meters))
    dips = table.numbers("dip_m")
    default_sd = np.nan if given["s_dip_mm"] is None else given["s_dip_mm"]
    # A start without a dip was empty and dry, and has no uncertainty.
    sds = table.numbers("s_dip_mm")
    sds = np.where(np.isnan(dips), 0.0, np.where(np.isnan(sds), default_sd, sds))
    return Metering(
        row=np.array(table.rows),
        run=tuple(table.of("run")),
        meter=names,
        volume_m3=table.numbers("volume_m3"),
        dip_m=dips,
        s_dip_m=sds / 1000,
        s_volume_m3=table.numbers("s_volume_l") / 1000,
        meter_c=table.numbers("meter_temperature_c"),
        tank_c=table.numbers("tank_temperature_c"),
        shell_c=table.numbers("shell_temperature_c"),
        flow_m3_h=table.numbers("flow_m3_h"),
        time=tuple(map(_moment, table.of("time"))),
        used=np.array([use != CHECK for use in table.of("use")]),
        note=tuple(table.of("note")),
        meters={name: _meter(name, meters[name], rows.get(name)) for name in dict.fromkeys(names)},
        **_settings(given, values),
        file=table.file,
        meters_file=raw.file_of("meters"),
    )


def _settings(given, values):
    """Keys of [liquid] in SI, with defaults for blank keys."""
    expansion, diameter = given["expansion_per_k"], values["tank"]["nominal_diameter_m"]
    u_expansion = given["u_expansion_per_k"]
    u_radius = given["u_radius_mm"]
    if u_radius is None:
        u_radius = None if diameter is None else RADIUS_SHARE * diameter / 2 * 1000
    return {
        "density_kg_m3": given["density_kg_m3"],
        "density_c": given["density_temperature_c"],
        "expansion_per_k": expansion,
        "u_density_kg_m3": given["u_density_kg_m3"],
        "u_expansion_per_k": EXPANSION_SHARE * expansion if u_expansion is None else u_expansion,
        "u_temperature_c": _or_default(given["u_temperature_c"], TEMPERATURE_SD_K),
        "u_dip_zero_m": given["u_dip_zero_mm"] / 1000,
        "flex_sd_m3_per_m": _or_default(given["bottom_flex_m3_per_m"], 0.0),
        "run_sd": None if given["run_ppm"] is None else given["run_ppm"] / 1e6,
        "u_radius_m": None if u_radius is None else u_radius / 1000,
        "certified": given["table"] or JOINT,
    }


def _or_default(value, default):
    return default if value is None else value


def _meter(name, given, row):
    u_factor = given["u_factor_ppm"] / (given["k"] or 1.0) / 1e6
    return structure(Meter, given, name=name, u_factor=u_factor, row=row)


def _moment(seconds):
    """Time in ISO format from seconds since 2000."""
    return None if seconds is None else (_EPOCH + datetime.timedelta(seconds=seconds)).isoformat()
