"""From the checked tables of wall hits to `WallHits`, in SI."""

from dataclasses import replace

import numpy as np

from tankcal.job.contract.registers import FREE, USUAL_INCIDENCE_MM
from tankcal.job.measuring import angle_in_rad, setups_of
from tankcal.methods.hits.checks import instruments_used, ranging_of
from tankcal.survey.wall_hits import ControlReading, RangingInstrument, WallHits
from tankcal.units import ARCSEC

AXES = "xyz"


def make_hits(tables, registers):
    """Build `WallHits` from tables and registers without problems."""
    table, setups = tables["wall_hits"], _setups(tables["setups"], registers)
    names = tuple(table.of("setup"))
    used = dict.fromkeys(setups[name].instrument for name in names)
    ranging = ranging_of(registers)
    instruments = [ranging[setups[name].instrument] for name in names]
    # The sd of the row takes precedence over the sd of the instrument.
    sd_mm, sd_arcsec = (
        np.where(
            np.isnan(table.numbers(key)),
            [entry[key] or 0.0 for entry in instruments],
            table.numbers(key),
        )
        for key in ("s_mm", "s_arcsec")
    )
    return WallHits(
        setup=names,
        set=tuple(table.of("set")),
        course=tuple(table.of("course")),
        direction_rad=angle_in_rad(table, "direction"),
        zenith_rad=angle_in_rad(table, "zenith"),
        distance_m=table.numbers("distance_m"),
        sd_m=sd_mm / 1000,
        sd_rad=sd_arcsec * ARCSEC,
        surface=tuple(entry or "" for entry in table.of("surface")),
        check=np.array([use == "check" for use in table.of("use")], dtype=bool),
        setups=setups,
        instruments={name: _instrument(name, ranging[name]) for name in used},
        stations=_stations(tables["control"]),
        control=_control(tables["control_readings"]),
        rows=table.rows,
        file=table.file,
    )


def _setups(table, registers):
    used = instruments_used(table, ranging_of(registers))
    return {setup.name: replace(setup, instrument=used[setup.name]) for setup in setups_of(table)}


def _instrument(name, given):
    offset, scale, bias = (given[key] for key in ("u_offset_mm", "u_scale_ppm", "u_incidence_mm"))
    return RangingInstrument(
        name,
        correction=given["correction"] or 0.0,
        correction_m=(given["correction_mm"] or 0.0) / 1000,
        u_scale=np.nan if scale == FREE else (scale or 0.0) / 1e6,
        u_offset_m=np.nan if offset in (None, FREE) else offset / 1000,
        u_incidence_m=(USUAL_INCIDENCE_MM if bias is None else bias) / 1000,
        certificate=given["certificate"] or "",
    )


def _stations(table):
    if table is None:
        return {}
    xyz = np.column_stack([table.numbers(f"{axis}_m") for axis in AXES])
    return dict(zip(table.of("point"), xyz, strict=True))


def _control(table):
    if table is None:
        return ()
    angles = (angle_in_rad(table, name) for name in ("direction", "zenith"))
    columns = zip(table.of("setup"), table.of("target"), *angles, table.numbers("distance_m"),
                  table.numbers("time"), table.rows, strict=True)  # fmt: skip
    return tuple(ControlReading(*row) for row in columns)
