"""Tables of corrections for trim and list of a tank of a ship, with what is uncertain of them."""

from dataclasses import dataclass, replace
from math import ceil, floor, tan

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.pipeline.tanks import heeled_body
from tankcal.pipeline.tanks.solid import ship_pipe
from tankcal.tank.meshes import holds
from tankcal.tank.ships import corrections_of, in_ship_frame
from tankcal.tank.ships.corrections import FULL
from tankcal.uncertainty import combine

STEPS_M = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
ABOUT = 100  # soundings of a table whose step is not given
MOST = 400_000  # corrections in all
SLACK_M = (
    0.01  # that the lower end of a pipe may stand below the mesh, or its upper end below the top
)
OF_SHIP = ("trim", "list")  # inputs that even keel does not have
CLOSE = 1e-9  # of the capacity: a volume that falls by no more falls by rounding
CORRECTING = message("correcting_soundings", "correcting soundings for trim and list")


@dataclass(frozen=True)
class ShipTables:
    """Corrections of soundings, added to one to read the table at even keel.

    Of arrays (trims, lists, soundings) each is nan where a sounding cannot be corrected.

    Attributes
    ----------
    sounding_m : ndarray, shape (s,)
        Along the pipe from its lower end.
    trim_m, list_rad : ndarray, shape (t,), (g,)
        By the stern, to starboard positive.
    state : ndarray of str, shape (t, g, s)
        "", "full" (the tank is, to the millimetre that the table ends with) or "below" (the table
        begins with more).
    correction_m, u_correction_m, U_correction_m : ndarray, shape (t, g, s)
    volume_m3, u_m3, U_m3 : ndarray, shape (t, g, s)
        Of the tank as it lies; without u where it is full.
    dry_m3, full_m : ndarray, shape (t, g)
        Volume at which the pipe becomes dry, and sounding at which the tank becomes full.
    interpolated_m : float
        Largest error of a correction that is interpolated half way between two soundings.
    undeclared : tuple of str
        Inputs that move corrections and have no u.
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


def check_pipe(job, mesh):
    """InputError for a pipe that does not open into the mesh, or ends below its top."""
    if job.ship is None:
        return
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
    above = float(turned[:, 2].max() - pipe.top_m[2])
    if above > SLACK_M:
        expected = message(
            "ship_pipe_short",
            "the pipe ends {above:.3f} m below the top of the tank; expected it to reach the top, "
            "for the table goes there",
            above=above,
        )
        problems.append(Problem("job.toml", expected, column="ship.pipe_top_m"))
    if problems:
        raise InputError(problems)


def _place(xyz):
    return "({:.3f}, {:.3f}, {:.3f})".format(*xyz)


def ship_tables(job, survey, body, table, progress=None):
    """The `ShipTables` of a job with a ship.

    Parameters
    ----------
    job : Job
    survey : meshes.Mesh
    body : Body
        The tank at even keel.
    table : Capacity
        Of that body.
    progress : callable, optional
        Called as progress(text, done, total).

    Raises
    ------
    InputError
        For more corrections than can be tabled.
    """
    ship = job.ship
    trims, lists = np.array(ship.trim_m), np.array(ship.list_rad)
    tangents = [
        (trim / ship.length_between_marks_m, tan(list_)) for trim in trims for list_ in lists
    ]
    cells = [heeled_body(job, survey, *pair) for pair in tangents]
    soundings = _soundings(job, cells)
    solids, level = [cell.parts[0].solid for cell in cells], body.parts[0].solid
    found = corrections_of(solids, level, soundings, table.height_m[-1])
    _refuse_falling(job, found, level)
    made = _uncertainties(cells, found, soundings, body, table.probability, progress)
    shape = len(trims), len(lists)

    def on_grid(values):
        return np.array(values).reshape(*shape, *np.shape(values)[1:])

    return ShipTables(
        soundings,
        trims,
        lists,
        on_grid([one.state for one in found]),
        on_grid([one.even_m - soundings for one in found]),
        *(on_grid([one[name] for one in made]) for name in ("u_correction", "U_correction")),
        on_grid([one.volume_m3 for one in found]),
        *(on_grid([one[name] for one in made]) for name in ("u", "U")),
        on_grid([one.dry_m3 for one in found]),
        on_grid([one.full_m for one in found]),
        max(one.interpolated_m for one in found),
        undeclared_of_ship(job, survey),
    )


def undeclared_of_ship(job, survey):
    """Names of inputs that move corrections at the steepest trim and list and have no u."""
    if job.ship is None:
        return ()
    trim = max(job.ship.trim_m, key=abs) / job.ship.length_between_marks_m
    return heeled_body(job, survey, trim, tan(max(job.ship.list_rad, key=abs))).undeclared()


def _soundings(job, cells):
    """From 0 by the step to the highest sounding at which a tank becomes full, within the pipe.

    Where the last step is beyond the pipe's end, the last sounding is that of a whole millimetre.
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
    if soundings[-1] > length * (1 + 1e-12):  # no step ends within the pipe: its last millimetre
        last = min(ceil(1e3 * highest - 1e-6), floor(1e3 * length + 1e-6)) / 1e3
        soundings = np.append(soundings[:-1], last if last > soundings[-2] else [])
    return soundings


def _refuse_falling(job, found, level):
    """InputError where a volume falls as its sounding rises: the mesh crosses itself."""
    for one in found:
        if np.any(np.diff(one.volume_m3) < -CLOSE * level.capacity_m3):
            expected = message(
                "ship_volume_falls",
                "the volume falls with a rising sounding at a trim and list, the mesh crosses "
                "itself; expected a surface that does not",
            )
            raise InputError(Problem(job.mesh.file, expected))


def _uncertainties(cells, found, soundings, body, probability, progress):
    """What `_uncertainty` gives of each cell; the table at even keel is read for all at once."""
    readable = [one.even_m[np.isfinite(one.even_m)] for one in found]
    even_m, ends = np.concatenate(readable), np.cumsum([0, *map(len, readable)])
    inputs = tuple(body.derivatives(np.zeros(1)))
    even, made = None, []
    if len(even_m):
        even = body.sources_by(even_m, inputs, without=OF_SHIP), body.area_m2(even_m)
    for index, (cell, one) in enumerate(zip(cells, found, strict=True)):
        rows = slice(ends[index], ends[index + 1])
        made.append(_uncertainty(cell, one, soundings, even, rows, inputs, probability))
        if progress is not None:
            progress(CORRECTING, index + 1, len(cells))
    return made


def _uncertainty(cell, found, soundings, even, rows, inputs, probability):
    """{name: (rows,)} u and U of the volumes and of the corrections of one trim and list.

    even  sources and areas of the table at even keel, all cells' one after the other, None where
          nothing is corrected; rows: the cell's in them
    """
    names = ("u_correction", "U_correction", "u", "U")
    columns = {name: np.full(len(soundings), np.nan) for name in names}
    known, some = found.state != FULL, np.isfinite(found.even_m)
    if not known.any():
        return columns
    sources = cell.sources_by(soundings[known], inputs)
    volume = combine(sources, int(known.sum()))
    columns["u"][known], columns["U"][known] = volume.u, volume.expanded(probability)
    if not some.any():
        return columns
    moved = combine(_differences(sources, some[known], even, rows), int(some.sum()))
    columns["u_correction"][some] = moved.u
    columns["U_correction"][some] = moved.expanded(probability)
    return columns


def _differences(sources, some, even, rows):
    """Sources of corrections, m: what the volumes have in common cancels in their difference."""
    of_even, area = even[0], even[1][rows]
    per_area = np.divide(1.0, area, out=np.full(len(area), np.nan), where=area > 0)[:, None]
    return [
        replace(
            one, columns_m3=(one.columns_m3[some] - other.columns_m3[rows]) * per_area, parts=()
        )
        for one, other in zip(sources, of_even, strict=True)
    ]
