"""Corrections of soundings for trim and list, and the pipe that is sounded."""

from math import degrees

import numpy as np

from tankcal.record.schema import Finite, Saved, key


class CorrectionsOfCell(Saved):
    """Corrections at one trim and list, one for each sounding."""

    trim_m: Finite = key("draught aft less draught forward")
    list_deg: Finite = key("to starboard positive")
    dry_m3: Finite = key("volume at which the pipe becomes dry")
    full_m: Finite = key("sounding at which the tank becomes full")
    state: list[str] = key('"", "full": the tank is; "below": less than the table begins with')
    correction_m: list[float] = key("to be added to the sounding; null where there is none")
    u_correction_m: list[float] = key("standard uncertainty")
    U_correction_m: list[float] = key("expanded uncertainty")
    volume_m3: list[Finite] = key("of the tank as it lies")
    u_m3: list[float] = key("standard uncertainty of that; null where the tank is full")
    U_m3: list[float] = key("expanded uncertainty")


class ShipRecord(Saved):
    """What a ship adds to a tank: its pipe and corrections of soundings."""

    length_between_marks_m: Finite = key("that trims are over")
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
    """`ShipRecord` of a result; None: its tank is no ship's."""
    ship, tables = result.job.ship, result.ship
    if tables is None:
        return None
    share = ship.contraction
    return ShipRecord(
        ship.length_between_marks_m,
        degrees(ship.bow_azimuth_rad),
        list(ship.pipe_bottom_m),
        list(ship.pipe_top_m),
        None if share is None else 100 * share,
        tables.interpolated_m,
        tables.trim_m,
        np.degrees(tables.list_rad).round(9),
        tables.sounding_m,
        [_cell(tables, *place) for place in np.ndindex(tables.dry_m3.shape)],
    )


def _cell(tables, trim, list_):
    at = trim, list_
    return CorrectionsOfCell(
        tables.trim_m[trim],
        float(np.degrees(tables.list_rad[list_]).round(9)),
        tables.dry_m3[at],
        tables.full_m[at],
        tables.state[at].tolist(),
        tables.correction_m[at],
        tables.u_correction_m[at],
        tables.U_correction_m[at],
        tables.volume_m3[at],
        tables.u_m3[at],
        tables.U_m3[at],
    )
