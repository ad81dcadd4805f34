"""The part of the record on a ship: its sounding pipe, and corrections for trim and list."""

from math import degrees

import numpy as np

from tankcal.record.schema import Finite, Saved, key


class CorrectionsOfCell(Saved):
    """Corrections of all soundings at one trim and list."""

    trim_m: Finite = key("draught aft less draught forward")
    list_deg: Finite = key("to starboard positive")
    dry_m3: Finite = key("volume at which the pipe becomes dry")
    full_m: Finite = key("sounding at which the tank becomes full")
    state: list[str] = key('"", "full": tank full; "below": less than the lowest row of the table')
    correction_m: list[float] = key("to be added to the sounding; null: none")
    u_correction_m: list[float] = key("standard uncertainty")
    U_correction_m: list[float] = key("expanded uncertainty")
    volume_m3: list[Finite] = key("of the tank at this trim and list")
    u_m3: list[float] = key("its standard uncertainty; null: tank full")
    U_m3: list[float] = key("expanded uncertainty")


class ShipRecord(Saved):
    """Sounding pipe of a tank of a ship, and corrections of soundings."""

    length_between_marks_m: Finite = key("length to which trims refer")
    bow_azimuth_deg: Finite = key("in the frame of the mesh, clockwise from +y")
    pipe_bottom_m: list[Finite] = key("x, y, z of the lower end in the frame of the mesh")
    pipe_top_m: list[Finite] = key("x, y, z of the upper end")
    contraction_percent: float | None = key("of all lengths in service; null: not given")
    interpolated_m: Finite = key("largest error of a correction half way between two soundings")
    trim_m: list[Finite] = key("ascending")
    list_deg: list[Finite] = key("ascending")
    sounding_m: list[Finite] = key("along the pipe from its lower end")
    cells: list[CorrectionsOfCell] = key("of each trim with each list, the list changing first")


def ship_of(result):
    """Return the `ShipRecord` of a result; None for a tank that is not on a ship."""
    ship, tables = result.job.ship, result.ship
    if tables is None:
        return None
    return ShipRecord(
        ship.length_between_marks_m,
        degrees(ship.bow_azimuth_rad),
        list(ship.pipe_bottom_m),
        list(ship.pipe_top_m),
        None if ship.contraction is None else 100 * ship.contraction,
        tables.interpolated_m,
        tables.trim_m,
        np.degrees(tables.list_rad).round(9),
        tables.sounding_m,
        [_cell(tables, *place) for place in np.ndindex(tables.dry_m3.shape)],
    )


def _cell(tables, trim, list_):
    cell = trim, list_
    return CorrectionsOfCell(
        tables.trim_m[trim],
        float(np.degrees(tables.list_rad[list_]).round(9)),
        tables.dry_m3[cell],
        tables.full_m[cell],
        tables.state[cell].tolist(),
        tables.correction_m[cell],
        tables.u_correction_m[cell],
        tables.U_correction_m[cell],
        tables.volume_m3[cell],
        tables.u_m3[cell],
        tables.U_m3[cell],
    )
