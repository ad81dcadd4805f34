"""From the checked meters.toml, liquid.csv and [liquid] to `Metering`, in SI."""

import datetime

import numpy as np

from tankcal.job.checks.liquid import meters_read
from tankcal.job.checks.runs import CHECK
from tankcal.job.contract.liquid import EXPANSION_SHARE, JOINT, RADIUS_SHARE, TEMPERATURE_SD_K
from tankcal.job.model.liquid import Meter, Metering
from tankcal.job.structure import structure

_EPOCH = datetime.datetime(2000, 1, 1)


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
