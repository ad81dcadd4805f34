"""Assemble a Plan from checked input.

Rings become stations, patterns become targets at Gauss levels, and tapes become ties between ends.
"""

from dataclasses import replace

import numpy as np

from tankcal.geometry.field.amplitudes import assumed_amplitudes
from tankcal.geometry.rotations import rotation_of_view
from tankcal.job.measuring import ARCSEC
from tankcal.planning.contract import PLAN_FILE, forms_m
from tankcal.planning.model import (
    ControlPoint,
    Limits,
    Photograph,
    Plan,
    PlannedSetup,
    Shell,
    Targets,
    Tie,
)
from tankcal.planning.places import (
    bases_of,
    full_turn,
    joints_of,
    obstacles_of,
    places_around,
    plate_m,
    row_heights_m,
)

# Defaults of [limits]: largest angle of incidence, degrees, and fewest rays per point.
INCIDENCE_DEG, RAYS = 70.0, 3
# Defaults of [pattern]: rows of targets per course, and distance of targets from welds.
LEVELS, CLEARANCE_M = 2, 0.3
STEEP = np.radians(89.9)  # largest tilt of a camera


def assemble_plan(job, plan_input, bars, folder):
    """Return the Plan of a Job and of the valid input of a plan.

    Parameters
    ----------
    job : Job
    plan_input : PlanInput
        Valid sections and tables of the plan.
    bars : dict
        {name: {key: value}} of the stadias in the instruments of the job.
    folder : str
        Name of the folder of the plan.
    """
    pattern = plan_input.sections["pattern"]
    shell = shell_of(job, pattern)
    targets = targets_of(pattern, shell, job.courses)
    settings = job.measurements.settings
    photos, setups, ties, extra, facing = [], [], [], {}, {}
    for number, ring in enumerate(plan_input.sections["photo_rings"], 1):
        photos += photographs_of(ring, number, shell, settings.image_sd_mm, ring.place)
    for number, ring in enumerate(plan_input.sections["setup_rings"], 1):
        setups += setups_of(ring, number, shell, ring.place)
    for tape in plan_input.sections["tapes"]:
        tie, ends, out = tape_of(tape, shell)
        ties.append(tie)
        extra |= ends
        facing |= dict.fromkeys(ends, out)
    ties += _list_ties(plan_input.ties)
    places = dict(zip(targets.names, targets.xyz_m, strict=True)) | extra
    places |= {setup.name: setup.xyz_m for setup in setups}
    known = _complete_known_points(job.measurements.control, places)
    extra |= {
        point.name: point.xyz_m
        for point in known
        if point.name not in places and np.isfinite(point.xyz_m).all()
    }
    return Plan(
        job=replace(job, measurements=replace(job.measurements, control=None)),
        shell=shell,
        targets=targets,
        photos=tuple(photos),
        setups=tuple(setups),
        ties=tuple(ties),
        known=tuple(point for point in known if np.isfinite(point.sd_m).any()),
        extra=extra,
        facing=facing,
        obstacles=obstacles_of(plan_input),
        limits=limits_of(plan_input.sections["limits"]),
        bases=bases_of(plan_input.stadia, bars),
        bars={
            name: bar["length_m"]
            for name, bar in bars.items()
            if bar["length_m"] and bar["u_mm"] is not None
        },
        amplitudes=assumed_amplitudes(*forms_m(pattern)),
        costs={key: value or 0.0 for key, value in plan_input.sections["costs"].values.items()},
        folder=folder,
    )


def shell_of(job, pattern):
    """Return the Shell of a job and a [pattern]: the lowest course, with its plate if outside.

    `targets_of` moves the targets of courses with other plate thicknesses.
    """
    outside = job.survey.side == "outside"
    plate = plate_m(job.courses[0], outside)
    low = job.datum.bottom_z_m
    return Shell(
        axis_m=np.array([_value_or(pattern["axis_x_m"], 0.0), _value_or(pattern["axis_y_m"], 0.0)]),
        radius_m=job.tank.nominal_diameter_m / 2 + plate,
        low_m=low,
        high_m=low + sum(course.height_m for course in job.courses),
        is_outside=outside,
    )


def targets_of(pattern, shell, courses):
    """Return the Targets of a [pattern].

    Parameters
    ----------
    pattern : Entry
    shell : Shell
    courses : sequence of Course
        Courses of the job.
    """
    clearance = _value_or(pattern["weld_clearance_mm"], 1000 * CLEARANCE_M) / 1000
    joints = joints_of(courses)
    if pattern["heights_m"]:
        rows = np.sort(pattern["heights_m"])
        course = np.searchsorted(joints[1:-1], rows, side="right")
    else:
        levels = int(_value_or(pattern["levels"], LEVELS))
        rows, course = row_heights_m(courses, levels, clearance)
    n = int(pattern["generatrices"])
    azimuth = (
        np.radians(_value_or(pattern["first_azimuth_deg"], 0.0)) + 2 * np.pi * np.arange(n) / n
    )
    welds = np.radians(pattern["weld_azimuths_deg"] or [])
    azimuth = _clear_of_welds(azimuth, welds, clearance / shell.radius_m)
    offset = _value_or(pattern["offset_mm"], 0.0) / 1000
    row, line = (index.ravel() for index in np.indices((len(rows), n)))
    side = 1.0 if shell.is_outside else -1.0
    plates = np.array([plate_m(course, shell.is_outside) for course in courses])
    radius = shell.radius_m + (plates - plates[0])[course]
    out = np.zeros((len(row), 3))
    out[:, :2] = side * places_around((0.0, 0.0), azimuth[line], 1.0)
    xyz = np.column_stack(
        [
            places_around(shell.axis_m, azimuth[line], radius[row] + side * offset),
            shell.low_m + rows[row],
        ]
    )
    weld = np.radians(_value_or(pattern["reference_weld_deg"], 0.0))
    return Targets(
        names=tuple(f"{g + 1}-{s + 1}" for s, g in zip(row, line, strict=True)),
        section=tuple(str(s + 1) for s in row),
        generatrix=tuple(str(g + 1) for g in line),
        course=course[row],
        height_m=rows[row],
        arc_m=full_turn(azimuth[line] - weld) * shell.radius_m,
        xyz_m=xyz,
        outwards=out,
        offset_m=offset,
        clearance_m=clearance,
        welds_rad=tuple(welds.tolist()),
    )


def _clear_of_welds(azimuth, welds, clearance):
    """Azimuths moved away from welds to the clearance (rad), on the nearer side."""
    for weld in welds:
        off = np.angle(np.exp(1j * (azimuth - weld)))
        side = np.where(off < 0, -1.0, 1.0)
        azimuth = np.where(np.abs(off) < clearance, weld + side * clearance, azimuth)
    return azimuth


def _positions(ring, shell):
    """Yield (azimuth, position (3,), number of station, number of height) of a ring, by height."""
    n = int(ring["stations"])
    azimuth = np.radians(_value_or(ring["start_azimuth_deg"], 0.0)) + 2 * np.pi * np.arange(n) / n
    for level, height in enumerate(ring["heights_m"]):
        plan = places_around(shell.axis_m, azimuth, ring_radius_m(ring, shell))
        for i in range(n):
            yield azimuth[i], np.array([*plan[i], shell.low_m + height]), i, level


def ring_radius_m(ring, shell):
    """Distance of a ring's stations from the axis, m; `distance_m` is measured from the wall."""
    if ring["radius_m"] is not None:
        return ring["radius_m"]
    return shell.radius_m + (ring["distance_m"] if shell.is_outside else -ring["distance_m"])


def photographs_of(ring, number, shell, image_sd_mm, place):
    """Return the Photographs of the `number`th [[photo_rings]].

    Parameters
    ----------
    ring : Entry
    number : int
    shell : Shell
    image_sd_mm : float
        Default standard deviation of an image coordinate.
    place : tuple
        (file, row, column) of the ring, for messages.

    Returns
    -------
    list of Photograph
    """
    photographs = []
    sd = image_sd_mm if ring["s_um"] is None else ring["s_um"] / 1000
    height = _value_or(ring["aim_height_m"], (shell.high_m - shell.low_m) / 2)
    radius = ring_radius_m(ring, shell)
    far = radius - shell.radius_m if shell.is_outside else radius + shell.radius_m
    for azimuth, xyz, i, level in _positions(ring, shell):
        station = f"R{number}-{i + 1}" + (f"-{level + 1}" if len(ring["heights_m"]) > 1 else "")
        tilt = np.arctan2(shell.low_m + height - xyz[2], max(far, 1e-9))
        exposures = [
            (turn, roll)
            for turn in ring["directions_deg"] or [0.0]
            for roll in ring["rolls_deg"] or [0.0]
            for _ in range(int(_value_or(ring["photographs"], 1)))
        ]
        for k, (turn, roll) in enumerate(exposures):
            ahead = azimuth + np.pi + np.radians(turn)
            photographs.append(
                Photograph(
                    name=f"{station}.{k + 1}" if len(exposures) > 1 else station,
                    station=station,
                    camera=ring["camera"],
                    xyz_m=xyz,
                    rotation=rotation_of_view(
                        ahead, np.clip(tilt, -STEEP, STEEP), np.radians(roll)
                    ),
                    sd_mm=sd,
                    readings=int(_value_or(ring["readings"], 1)),
                    place=place,
                )
            )
    return photographs


def setups_of(entry, number, shell, place):
    """Return the set-ups of the `number`th [[setup_rings]].

    Parameters
    ----------
    entry : Entry
    number : int
    shell : Shell
    place : tuple
        (file, row, column) of the ring, for messages.

    Returns
    -------
    list of PlannedSetup
    """
    setups = []
    positions = list(_positions(entry, shell))
    names = [f"T{number}-{i + 1}" + (f"-{k + 1}" if k else "") for _, _, i, k in positions]
    for at, (_, xyz, _, level) in enumerate(positions):
        ring = [name for name, place in zip(names, positions, strict=True) if place[3] == level]
        setups.append(
            PlannedSetup(
                name=names[at],
                instrument=entry["instrument"],
                xyz_m=xyz,
                direction_sd_rad=_scale(entry["s_direction_arcsec"], ARCSEC),
                zenith_sd_rad=_scale(entry["s_zenith_arcsec"], ARCSEC),
                distance_sd_m=_scale(entry["s_mm"], 1e-3),
                sets=int(_value_or(entry["sets"], 1)),
                sights=() if entry["sights"] is False else _neighbours(ring, names[at]),
                place=place,
            )
        )
    return setups


def _neighbours(ring, name):
    at = ring.index(name)
    beside = (ring[at - 1], ring[(at + 1) % len(ring)])
    return tuple(neighbour for neighbour in dict.fromkeys(beside) if neighbour != name)


def tape_of(tape, shell):
    """Return the Tie of one [[tapes]], the positions of its ends, and their normal.

    A vertical tape hangs beside the wall. Outside, a horizontal tape lies along a tangent; inside,
    it lies along a chord whose ends have the stated distance from the wall.

    Parameters
    ----------
    tape : Entry
    shell : Shell

    Returns
    -------
    tie : Tie
    ends : dict
        {name: (3,) position} of the two ends.
    normal : ndarray, shape (3,)
        Horizontal unit vector from the wall to the observer.
    """
    azimuth, length = np.radians(tape["azimuth_deg"]), tape["length_m"]
    side = 1.0 if shell.is_outside else -1.0
    radius = shell.radius_m + side * _value_or(tape["off_m"], 0.1)
    if tape["kind"] == "horizontal" and not shell.is_outside:
        radius = np.sqrt(max(radius**2 - (length / 2) ** 2, 0.0))
    middle, low = places_around(shell.axis_m, azimuth, radius), shell.low_m + tape["low_m"]
    if tape["kind"] == "vertical":
        ends = np.array([[*middle, low], [*middle, low + length]])
    else:
        half = np.array([np.cos(azimuth), -np.sin(azimuth), 0.0]) * length / 2
        ends = np.array([*middle, low]) + np.array([-half, half])
    names = f"{tape['name']}a", f"{tape['name']}b"
    tie = Tie(
        tape["name"], "distances", *names, tape["s_mm"] / 1000,
        instrument=tape["instrument"], readings=int(_value_or(tape["readings"], 1)),
    )  # fmt: skip
    out = side * np.array([np.sin(azimuth), np.cos(azimuth), 0.0])
    return tie, dict(zip(names, ends, strict=True)), out


def _list_ties(tables):
    """Return the ties listed in the tables of a plan."""
    ties = []
    for name, table in tables.items():
        if table is None:
            continue
        kinds = table.of("kind") if "kind" in table.columns else [None] * len(table.rows)
        tools = table.of("instrument") if "instrument" in table.columns else kinds
        rows = zip(
            table.of("from"), table.of("to"), table.of("s_mm"), table.of("readings"),
            kinds, tools if name == "distances" else [None] * len(kinds), strict=True,
        )  # fmt: skip
        for start, end, sd, readings, kind, tool in rows:
            named = (f"{start}-{end}", name, start, end)
            ties.append(Tie(*named, sd / 1000, kind or "spatial", tool, int(readings or 1)))
    return ties


def _complete_known_points(control, places):
    """Return the known points; a blank coordinate takes its nominal value where the plan has it.

    A check point (use = "check") has a position, but no standard deviations: it does not constrain
    the network.
    """
    if control is None:
        return []
    known = []
    sds = np.where(control.check[:, None], np.nan, control.sd_m)
    for name, xyz, sd in zip(control.point, control.xyz_m, sds, strict=True):
        nominal = places.get(name, np.full(3, np.nan))
        known.append(ControlPoint(name, np.where(np.isnan(xyz), nominal, xyz), sd))
    return known


def limits_of(section):
    """Return the `Limits` of a [limits] section."""
    incidence = INCIDENCE_DEG if section["incidence_deg"] is None else section["incidence_deg"]
    return Limits(
        incidence_rad=float(np.radians(incidence)),
        relative_u=section["relative_u"],
        quantity=section["of"] or "top",
        rays=int(section["rays"] or RAYS),
        place=(PLAN_FILE, section.rows.get("of", section.row), "limits.of"),
    )


def _value_or(value, default):
    return default if value is None else value


def _scale(value, factor):
    return None if value is None else value * factor
