"""Keys of [ship] (draught marks, trims, lists and sounding pipe of a ship's tank), and checks."""

from itertools import product
from math import hypot, radians, tan

import numpy as np

from tankcal.job.checking import has_rows, is_not_given, missing_beside, tell
from tankcal.job.fields import Field, number, positive
from tankcal.messages import message

MESH_ONLY = ("mesh",)
BOW_DEG = 90.0  # default direction of the bow, +x


def _several(name, note, high):
    """Return a key for several numbers of magnitude up to `high`."""
    return Field(name, "numbers", note, low=-high, high=high, kinds=MESH_ONLY)


KEYS = (
    _several(
        "trim_m",
        "trims of the correction tables, draught aft minus draught forward, metres; negative:"
        " by the bow; blank, like all of [ship]: not a tank of a ship",
        30,
    ),
    positive(
        "length_between_marks_m",
        "distance fore and aft between the draught marks, metres",
        600,
        kinds=MESH_ONLY,
    ),
    _several(
        "list_deg",
        "lists of the correction tables, degrees; positive to starboard, negative to port",
        45,
    ),
    number(
        "bow_azimuth_deg",
        "direction of the bow in the frame of the mesh, degrees clockwise from +y; blank: 90, +x",
        0,
        360,
        kinds=MESH_ONLY,
    ),
    _several(
        "pipe_top_m",
        "upper end of the sounding pipe: x; y; z in the frame of the mesh, metres",
        1e8,
    ),
    _several(
        "pipe_bottom_m",
        "lower end of the sounding pipe, the zero of the soundings: x; y; z in the frame of the"
        " mesh, metres",
        1e8,
    ),
    positive(
        "correction_step_m",
        "step of the soundings in the correction tables, metres; blank: chosen for about a"
        " hundred soundings",
        10,
        kinds=MESH_ONLY,
    ),
    number(
        "contraction_percent",
        "uniform contraction of all lengths of the tank in service, relative to the survey,"
        " percent; blank: 0",
        -1,
        2,
        kinds=MESH_ONLY,
    ),
)

NEEDED = ("trim_m", "length_between_marks_m", "list_deg", "pipe_top_m", "pipe_bottom_m")
ENDS = ("pipe_top_m", "pipe_bottom_m")
STEEPEST_TRIM = 0.2  # tangent; larger: draughts and marks are in different units
LEAST_RISE = 0.2  # rise of the surface per metre of pipe that soundings require
MOST_CELLS = 400  # largest number of pairs of trim and list


def is_ship(values):
    """Determine whether the tank is a ship's tank, from the readable keys of [ship]."""
    return any(values["ship"][name] is not None for name in NEEDED)


def check_ship(values, tables, raw, log):
    """Check that [ship] is complete or blank, with plausible trims and a usable sounding pipe."""
    given = [field.name for field in KEYS if not is_not_given(raw, "ship", field.name)]
    if not given:
        return

    def refuse(key, expected, section="ship"):
        tell(log.problem, raw, section, key, expected)

    for name in NEEDED:
        if name not in given:
            refuse(name, missing_beside(f"ship.{given[0]}"))
    ship = values["ship"]
    _check_grid(ship, refuse)
    _check_pipe(ship, refuse)
    _refuse_other_parts(values, tables, log, refuse)


def _check_grid(ship, refuse):
    """Check trims and lists: each once, of plausible size and number."""
    length = ship["length_between_marks_m"]
    for name in ("trim_m", "list_deg"):
        values = ship[name] or ()
        if len(set(values)) < len(values):
            refuse(name, message("ship_grid_twice", "a value is given twice; expected each once"))
    if length is not None and ship["trim_m"]:
        steepest = max(ship["trim_m"], key=abs)
        if abs(steepest) > STEEPEST_TRIM * length:
            expected = message(
                "ship_trim_steep",
                "found {trim:g}; expected at most {most:g} m over {length:g} m between the marks: "
                "is one in another unit?",
                trim=steepest,
                most=STEEPEST_TRIM * length,
                length=length,
            )
            refuse("trim_m", expected)
    count = len(ship["trim_m"] or ()) * len(ship["list_deg"] or ())
    if count > MOST_CELLS:
        expected = message(
            "ship_grid_large",
            "{count} pairs of trim and list; expected at most {most}",
            count=count,
            most=MOST_CELLS,
        )
        refuse("trim_m", expected)


def _check_pipe(ship, refuse):
    """Check the ends of the sounding pipe."""
    for name in ENDS:
        if ship[name] is not None and len(ship[name]) != 3:
            expected = message(
                "ship_pipe_not_xyz",
                "{count} numbers; expected the three of a place: x; y; z",
                count=len(ship[name]),
            )
            refuse(name, expected)
    if any(ship[name] is None or len(ship[name]) != 3 for name in ENDS):
        return
    top, bottom = ship["pipe_top_m"], ship["pipe_bottom_m"]
    if not top[2] > bottom[2]:
        expected = message(
            "ship_pipe_upside_down",
            "found z = {top:g}; expected above the lower end, z = {bottom:g}: is the pipe upside "
            "down?",
            top=top[2],
            bottom=bottom[2],
        )
        refuse("pipe_top_m", expected)
    elif None not in (ship["length_between_marks_m"], ship["trim_m"], ship["list_deg"]):
        _check_rise(ship, refuse)


def _check_rise(ship, refuse):
    """Check that the pipe rises sufficiently at even keel and at all pairs of trim and list.

    Only the first failure is reported.
    """
    from tankcal.tank.ships import Pipe, in_ship_frame

    bow = BOW_DEG if ship["bow_azimuth_deg"] is None else ship["bow_azimuth_deg"]
    ends = in_ship_frame([ship["pipe_bottom_m"], ship["pipe_top_m"]], radians(bow))
    pipe = Pipe(*np.asarray(ends))
    trims = (0.0, *(trim / ship["length_between_marks_m"] for trim in ship["trim_m"]))
    lists = (0.0, *(tan(radians(list_deg)) for list_deg in ship["list_deg"]))
    for trim, list_ in product(trims, lists):
        rise = pipe.rise(trim, list_) / hypot(1.0, trim, list_)
        if rise < LEAST_RISE:
            expected = message(
                "ship_pipe_flat",
                "the pipe rises {rise:.3g} m for each metre at trim {trim:g} m and list {list:g} "
                "degrees; expected at least {least:g}",
                rise=rise,
                trim=trim * ship["length_between_marks_m"],
                list=np.degrees(np.arctan(list_)),
                least=LEAST_RISE,
            )
            refuse("pipe_top_m", expected)
            return


def _refuse_other_parts(values, tables, log, refuse):
    """Refuse parts that contradict a sounding pipe: another zero, deadwood, runs, a temperature."""
    if values["datum"]["dip_plate_z_m"] is not None:
        expected = message(
            "ship_dip_plate",
            "given beside [ship]; expected a blank: soundings count from ship.pipe_bottom_m",
        )
        refuse("dip_plate_z_m", expected, "datum")
    if has_rows(tables["deadwood"]):
        expected = message(
            "ship_deadwood",
            "given beside [ship]; expected objects in the tank as cavities of the mesh:"
            " deadwood given by dips has no horizontal position",
        )
        log.problem(tables["deadwood"].file, expected)
    if has_rows(tables["liquid"]):
        expected = message(
            "ship_liquid",
            "given beside [ship]; expected only one of them: metered runs do not"
            " use a sounding pipe",
        )
        log.problem(tables["liquid"].file, expected)
    contracted = values["ship"]["contraction_percent"] is not None
    if contracted and values["survey"]["shell_temperature_c"] is not None:
        expected = message(
            "ship_contraction_twice",
            "given beside survey.shell_temperature_c; expected only one of them: both shorten the "
            "tank",
        )
        refuse("contraction_percent", expected)


def useless_inputs_of_ship(values):
    """{input: reason}, as `Method.useless_inputs`, of inputs that only a sounding pipe has."""
    no_pipe = message("no_ship", "expected only with [ship]")
    no_contraction = message("no_contraction", "expected only with ship.contraction_percent")
    contracts = values["ship"]["contraction_percent"] is not None
    of_pipe = dict.fromkeys(
        ("trim", "list", "pipe_x", "pipe_y", "pipe_lean"), "" if is_ship(values) else no_pipe
    )
    return of_pipe | {"contraction": "" if contracts else no_contraction}
