"""From the checked tables of wall hits to `WallHits`, in SI."""

from dataclasses import replace

import numpy as np

from tankcal.job.contract.registers import FREE, USUAL_INCIDENCE_MM
from tankcal.job.measuring import angle_in_rad, setups_of
from tankcal.methods.hits.checks import instruments_used, ranging_of
from tankcal.survey.sighting import bias_by_incidence, rays
from tankcal.survey.wall_hits import ControlReading, RangingInstrument, WallHits
from tankcal.units import ARCSEC

AXES = "xyz"
CLOSE_M, ROUNDS = 1e-12, 20  # convergence limit and largest number of iterations
MILLIMETRES = 3  # decimals to which heights of hits are rounded to form levels


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


# ---- hits of a known wall: sights along planned rays, with the inverse of their corrections


def _stations_of_hits(hits):
    """Instrument positions (n, 3) of the hits."""
    places = {
        name: hits.stations.get(setup.station, np.zeros(3)) + [0.0, 0.0, setup.height_m]
        for name, setup in hits.setups.items()
    }
    return np.array([places[name] for name in hits.setup])


def levels_of_hits(job):
    """Return (course, level above the table's zero, m) of each hit as aimed."""
    hits, datum = job.hits, job.datum
    rise = hits.distance_m * np.cos(hits.zenith_rad)
    z = _stations_of_hits(hits)[:, 2] + rise - datum.bottom_z_m - datum.plate_level_m
    return list(zip(hits.course, np.round(z, MILLIMETRES).tolist(), strict=True))


def observe_hits(job, wall, errors):
    """Return hits along their own sights, up to the inside or outside of the wall."""
    hits, levels = job.hits, levels_of_hits(job)
    station, ray = _stations_of_hits(hits)[:, :2], rays(hits.direction_rad, hits.zenith_rad)[0]
    inside, ray = np.hypot(*station.T) < wall.nominal_m, ray[:, :2]
    distance, cosine = np.empty(len(hits)), np.empty(len(hits))
    kinds = list(zip(levels, inside.tolist(), strict=True))
    for level, within in dict.fromkeys(kinds):
        of_kind = np.array([kind == (level, within) for kind in kinds])
        distance[of_kind], cosine[of_kind] = _intersect(
            wall, station[of_kind], ray[of_kind], level, inside=within
        )
    # Distances with their common errors, then the inverse of the corrections by the certificate.
    known = [hits.instruments[name] for name in hits.instrument]
    bias = [errors.draw_cause("incidence", tool.name) * tool.u_incidence_m for tool in known]
    distance *= 1 + np.array([errors.scale(tool) for tool in known])
    distance += np.array([errors.offset_m(tool) for tool in known])
    distance += np.array(bias) * bias_by_incidence(cosine)
    distance /= 1 + np.array([tool.correction for tool in known])
    distance -= np.array([tool.correction_m for tool in known])
    return replace(
        hits,
        distance_m=distance + errors.draw(hits.sd_m),
        direction_rad=hits.direction_rad + errors.draw(hits.sd_rad),
        zenith_rad=hits.zenith_rad + errors.draw(hits.sd_rad),
    )


def _intersect(wall, station_m, ray, level, *, inside):
    """Distance along horizontal rays (n, 2) to a level of the wall, and cosine of incidence."""
    # First the circle of nominal radius: |station + far ray|^2 = R^2, a quadratic in far.
    square, along = np.sum(ray**2, axis=1), np.sum(station_m * ray, axis=1)
    beyond = along**2 - square * (np.sum(station_m**2, axis=1) - wall.nominal_m**2)
    root = np.sqrt(np.maximum(beyond, 0.0))
    far = (-along + (root if inside else -root)) / square
    # Then Newton: the distance from the axis changes by the slope (cosine of incidence) per metre.
    for _ in range(ROUNDS):
        x, y = (station_m + far[:, None] * ray).T
        away = np.hypot(x, y)
        slope = (x * ray[:, 0] + y * ray[:, 1]) / away
        short = wall.radius_m(*level, np.arctan2(x, y), inside=inside) - away
        far = far + short / slope
        if np.abs(short).max() < CLOSE_M:
            break
    return far, np.abs(slope)
