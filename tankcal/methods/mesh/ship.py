"""Tank inside a mesh, and the corrections of its soundings on a ship for trim and list."""

from dataclasses import dataclass, replace
from math import ceil, floor, tan

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.pipeline.tanks.solid import is_warmed, solid_body, thermal_scale
from tankcal.tank.body import SolidPart
from tankcal.tank.meshes import holds, mesh_part
from tankcal.tank.ships import FULL, Pipe, corrections_of, in_ship_frame, piped_mesh
from tankcal.uncertainty import combine

STEPS_M = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
ABOUT = 100  # largest number of steps of a table without a given step
MOST = 400_000  # largest number of corrections
# Tolerance of a pipe that ends below the mesh or below the top of the tank.
SLACK_M = 0.01
OF_SHIP = ("trim", "list")  # inputs without effect at even keel
CLOSE = 1e-9  # fall of a volume, relative to the capacity, that counts as rounding
CORRECTING = message("correcting_soundings", "correcting soundings for trim and list")


@dataclass(frozen=True)
class ShipTables:
    """Corrections of soundings; a sounding plus its correction is read in the table at even keel.

    Arrays (trims, lists, soundings) are nan where a sounding cannot be corrected.

    Attributes
    ----------
    sounding_m : ndarray, shape (s,)
        Soundings along the pipe from its lower end, m.
    trim_m, list_rad : ndarray, shape (t,), (g,)
        Trim by the stern, m, and list to starboard, rad, both positive.
    state : ndarray of str, shape (t, g, s)
        "", "full" (the tank is full, within the last millimetre of the table) or "below" (the table
        begins with a larger volume).
    correction_m, u_correction_m, U_correction_m : ndarray, shape (t, g, s)
        Corrections, their standard and expanded uncertainties, m.
    volume_m3, u_m3, U_m3 : ndarray, shape (t, g, s)
        Volumes in the inclined tank and their uncertainties, m3; no uncertainty if the tank is
        full.
    dry_m3, full_m : ndarray, shape (t, g)
        Volume at which the pipe runs dry, m3, and sounding at which the tank is full, m.
    interpolated_m : float
        Largest error of a correction interpolated midway between two soundings, m.
    undeclared : tuple of str
        Inputs that affect corrections and have no standard uncertainty.
    """

    sounding_m: np.ndarray
    trim_m: np.ndarray
    list_rad: np.ndarray
    state: np.ndarray
    correction_m: np.ndarray
    u_correction_m: np.ndarray
    U_correction_m: np.ndarray
    volume_m3: np.ndarray
    u_m3: np.ndarray
    U_m3: np.ndarray
    dry_m3: np.ndarray
    full_m: np.ndarray
    interpolated_m: float
    undeclared: tuple[str, ...]


def part_of_mesh(job, mesh, switches, heel=(0.0, 0.0)):
    """`SolidPart` that a mesh encloses; `heel` contains the tangents of trim and list of a ship.

    Levels count from the dip plate or the lowest point; on a ship, along the pipe from its lower
    end.
    """
    scale = thermal_scale(job, switches)
    if job.ship is None:
        zero = job.datum.dip_plate_z_m
        if zero is None:
            zero = job.datum.bottom_z_m
        warmed = replace(mesh, vertices_m=scale * mesh.vertices_m)
        solid = mesh_part(warmed, zero if zero is None else scale * zero)
    else:
        solid = _ship_part(job.ship, mesh, scale, heel)
    return SolidPart(
        solid,
        scale,
        job.material.expansion_per_k,
        warmed=is_warmed(job, switches),
        unused=("plate_thickness",),
    )


def ship_pipe(ship):
    """`Pipe` of a `Ship` in the ship's frame."""
    return Pipe(*in_ship_frame([ship.pipe_bottom_m, ship.pipe_top_m], ship.bow_azimuth_rad))


def _ship_part(ship, mesh, scale, heel):
    """Solid inside the mesh of a ship's tank, with levels along its pipe."""
    contracted = None if ship.contraction is None else 1 - ship.contraction
    return piped_mesh(
        replace(mesh, vertices_m=in_ship_frame(mesh.vertices_m, ship.bow_azimuth_rad)),
        ship_pipe(ship),
        *heel,
        scale=scale * (contracted or 1.0),
        contracted=contracted,
        marks_m=ship.length_between_marks_m,
    )


def heeled_body(job, survey, trim, list_):
    """`Body` of a ship's tank at tangents of trim and list; levels are soundings along its pipe."""
    part = part_of_mesh(job, survey, job.switches, (trim, list_))
    return solid_body(job, survey, job.switches, part)


def values_of_ship(ship):
    """Even keel, position of the pipe in the ship's frame, and contraction."""
    values = dict.fromkeys(("trim", "list", "pipe_x", "pipe_y", "pipe_lean"), 0.0)
    return values if ship.contraction is None else {**values, "contraction": 100 * ship.contraction}


def check_pipe(job, mesh):
    """Raise InputError for a pipe that does not open into the mesh or ends below its top."""
    turned = in_ship_frame(mesh.vertices_m, job.ship.bow_azimuth_rad)
    pipe, problems = ship_pipe(job.ship), []
    ends = np.array([job.ship.pipe_bottom_m, job.ship.pipe_top_m], dtype=float)
    raised = ends[0] + SLACK_M * (ends[1] - ends[0]) / pipe.length_m
    if not (holds(mesh, ends[0]) or holds(mesh, raised)):
        low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
        expected = message(
            "ship_pipe_outside",
            "the lower end at {place} m lies outside the mesh, which goes from {low} to {high} m; "
            "expected it in the tank, in the frame of the mesh and in metres",
            place=_place(ends[0]),
            low=_place(low),
            high=_place(high),
        )
        problems.append(Problem("job.toml", expected, column="ship.pipe_bottom_m"))
    shortfall_m = float(turned[:, 2].max() - pipe.top_m[2])
    if shortfall_m > SLACK_M:
        expected = message(
            "ship_pipe_short",
            "the pipe ends {above:.3f} m below the top of the tank; expected it to reach the top, "
            "for the table goes there",
            above=shortfall_m,
        )
        problems.append(Problem("job.toml", expected, column="ship.pipe_top_m"))
    if problems:
        raise InputError(problems)


def _place(xyz):
    return "({:.3f}, {:.3f}, {:.3f})".format(*xyz)


def ship_tables(job, survey, body, table, progress=None):
    """`ShipTables` of a job with a ship.

    Parameters
    ----------
    job : Job
    survey : meshes.Mesh
    body : Body
        Tank at even keel.
    table : Capacity
        Capacity table of that body.
    progress : callable, optional
        Called as progress(text, done, total).

    Raises
    ------
    InputError
        If there are too many corrections, or if the volume falls as the sounding rises.
    """
    ship = job.ship
    trims, lists = np.array(ship.trim_m), np.array(ship.list_rad)
    tangents = [
        (trim / ship.length_between_marks_m, tan(list_)) for trim in trims for list_ in lists
    ]
    cells = [heeled_body(job, survey, *tangents_of_cell) for tangents_of_cell in tangents]
    soundings = _soundings(job, cells)
    solids, level = [cell.parts[0].solid for cell in cells], body.parts[0].solid
    corrections = corrections_of(solids, level, soundings, table.height_m[-1])
    _refuse_falling(job, corrections, level)
    uncertainties = _uncertainties(cells, corrections, soundings, body, table.probability, progress)
    shape = len(trims), len(lists)

    def on_grid(values):
        return np.array(values).reshape(*shape, *np.shape(values)[1:])

    return ShipTables(
        soundings,
        trims,
        lists,
        on_grid([cell_result.state for cell_result in corrections]),
        on_grid([cell_result.even_m - soundings for cell_result in corrections]),
        *(
            on_grid([cell_result[name] for cell_result in uncertainties])
            for name in ("u_correction", "U_correction")
        ),
        on_grid([cell_result.volume_m3 for cell_result in corrections]),
        *(on_grid([cell_result[name] for cell_result in uncertainties]) for name in ("u", "U")),
        on_grid([cell_result.dry_m3 for cell_result in corrections]),
        on_grid([cell_result.full_m for cell_result in corrections]),
        max(cell_result.interpolated_m for cell_result in corrections),
        undeclared_of_ship(job, survey),
    )


def undeclared_of_ship(job, survey):
    """Inputs without a standard uncertainty that affect corrections at largest trim and list."""
    trim = max(job.ship.trim_m, key=abs) / job.ship.length_between_marks_m
    return heeled_body(job, survey, trim, tan(max(job.ship.list_rad, key=abs))).undeclared()


def _soundings(job, cells):
    """Soundings from 0, in equal steps, to the highest sounding at which a tank becomes full.

    The soundings stay within the pipe. If the last step exceeds the end of the pipe, the last
    sounding is a whole millimetre.
    """
    ship = job.ship
    length = ship_pipe(ship).length_m
    highest = min(max(cell.highest_m for cell in cells), length)
    step = ship.correction_step_m
    if step is None:
        step = next((step_m for step_m in STEPS_M if highest / step_m <= ABOUT), STEPS_M[-1])
    count = ceil(highest / step - 1e-9) + 1
    if count * len(cells) > MOST:
        expected = message(
            "ship_corrections_many",
            "{count} corrections ({soundings} soundings of {cells} trims and lists); expected at "
            "most {most}: a longer step",
            count=count * len(cells),
            soundings=count,
            cells=len(cells),
            most=MOST,
        )
        raise InputError(Problem("job.toml", expected, column="ship.correction_step_m"))
    soundings = np.round(step * np.arange(count), 9)
    if soundings[-1] > length * (1 + 1e-12):  # the last step ends beyond the pipe
        last = min(ceil(1e3 * highest - 1e-6), floor(1e3 * length + 1e-6)) / 1e3
        soundings = np.append(soundings[:-1], last if last > soundings[-2] else [])
    return soundings


def _refuse_falling(job, corrections, level):
    """Raise InputError if a volume falls as its sounding rises: the mesh intersects itself."""
    for cell_result in corrections:
        if np.any(np.diff(cell_result.volume_m3) < -CLOSE * level.capacity_m3):
            expected = message(
                "ship_volume_falls",
                "the volume falls with a rising sounding at a trim and list, the mesh crosses "
                "itself; expected a surface that does not",
            )
            raise InputError(Problem(job.mesh.file, expected))


def _uncertainties(cells, corrections, soundings, body, probability, progress):
    """Results of `_uncertainty` for each cell; the table at even keel is evaluated once for all."""
    readable = [cell_result.even_m[np.isfinite(cell_result.even_m)] for cell_result in corrections]
    even_m, ends = np.concatenate(readable), np.cumsum([0, *map(len, readable)])
    inputs = tuple(body.derivatives(np.zeros(1)))
    even, uncertainties = None, []
    if len(even_m):
        even = body.sources_by(even_m, inputs, without=OF_SHIP), body.area_m2(even_m)
    for index, (cell, cell_result) in enumerate(zip(cells, corrections, strict=True)):
        rows = slice(ends[index], ends[index + 1])
        uncertainties.append(
            _uncertainty(cell, cell_result, soundings, even, rows, inputs, probability)
        )
        if progress is not None:
            progress(CORRECTING, index + 1, len(cells))
    return uncertainties


def _uncertainty(cell, corrected, soundings, even, rows, inputs, probability):
    """{name: (rows,)} u and U of the volumes and corrections at one trim and list.

    Parameters
    ----------
    cell : Body
        Inclined tank.
    corrected : object
        Corrections of the cell.
    soundings : ndarray, shape (s,)
        Soundings, m.
    even : tuple or None
        Sources and areas of the table at even keel for all cells in sequence; None without any
        corrections.
    rows : slice
        Rows of the cell in `even`.
    inputs : tuple of str
    probability : float
        Coverage probability.

    Returns
    -------
    dict
    """
    names = ("u_correction", "U_correction", "u", "U")
    columns = {name: np.full(len(soundings), np.nan) for name in names}
    is_not_full, is_corrected = corrected.state != FULL, np.isfinite(corrected.even_m)
    if not is_not_full.any():
        return columns
    sources = cell.sources_by(soundings[is_not_full], inputs)
    volume = combine(sources, int(is_not_full.sum()))
    columns["u"][is_not_full], columns["U"][is_not_full] = volume.u, volume.expanded(probability)
    if not is_corrected.any():
        return columns
    moved = combine(
        _differences(sources, is_corrected[is_not_full], even, rows), int(is_corrected.sum())
    )
    columns["u_correction"][is_corrected] = moved.u
    columns["U_correction"][is_corrected] = moved.expanded(probability)
    return columns


def _differences(sources, is_corrected, even, rows):
    """Sources of corrections, m; causes common to both volumes cancel in their difference."""
    of_even, area = even[0], even[1][rows]
    per_area = np.divide(1.0, area, out=np.full(len(area), np.nan), where=area > 0)[:, None]
    return [
        replace(
            inclined,
            columns_m3=(inclined.columns_m3[is_corrected] - level.columns_m3[rows]) * per_area,
            parts=(),
        )
        for inclined, level in zip(sources, of_even, strict=True)
    ]
