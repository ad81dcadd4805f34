"""Point clouds of a wall: their scans registered, means of their cells, the wall they show."""

import hashlib
from dataclasses import dataclass, replace

import numpy as np

from tankcal.clouds import wall as cells_of_clouds
from tankcal.clouds.wall.growing import EMPTY, FEW, FEWEST
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.job.checks.clouds import offset_untold
from tankcal.job.model import InputFile
from tankcal.job.tables import unreadable_file
from tankcal.messages import message
from tankcal.pipeline.cause_correlations import told_causes
from tankcal.pipeline.cloud_bottom import CloudInside, find_inside, with_bottom
from tankcal.pipeline.cloud_cluster import open_passes
from tankcal.pipeline.cloud_overlaps import normals_of, overlaps_of, scans_apart
from tankcal.pipeline.cloud_passes import Placing, Reading, Telling
from tankcal.pipeline.cloud_units import is_unit_defined, refusal_of_units
from tankcal.pipeline.hit_wall import through_wall
from tankcal.pipeline.point_covariance import s_transform
from tankcal.pipeline.scan import fit_scan
from tankcal.pipeline.wall import find_wall, joints_of
from tankcal.survey.beams import Beamed, points_of_beams
from tankcal.survey.registration import Registration, register
from tankcal.survey.scans import KnownTargets

FILE, TARGETS = "clouds.toml", "scan_targets.csv"
MOST_READINGS = 1200  # whose full covariance is kept
FEWEST_MEANS = 5  # of a course: a section has as many points
FAR_AWAY = 20.0  # radii: no scanner that sees a wall stands further from it
IN_PROCESS = Reading()


@dataclass(frozen=True)
class Clouded:
    """Clouds as points of a wall, and how they came about.

    Attributes
    ----------
    files : tuple of InputFile
        SHA-256 of each file of a scanner, in the order of the job.
    registration : Registration
    cells : CloudWall
        Cells of the wall, what hides it, and how many points were read.
    readings : CloudReadings
        Means of cells: the points of the job, in their order.
    beamed : Beamed
    told : tuple of ToldCause
        What an upright wall says of offsets and scales.
    left_out : ndarray of int, shape (scans,)
        Points of each scan in boxes that are left out.
    inside : CloudInside or None
        Bottom and things inside; None: not asked for.
    """

    files: tuple
    registration: Registration
    cells: object
    readings: object
    beamed: Beamed
    told: tuple = ()
    left_out: np.ndarray | None = None
    inside: CloudInside | None = None


def find_wall_in_clouds(
    job, adjustment, progress, dof=np.inf, *, amplitudes=None, reading=IN_PROCESS
):
    """The job with means of its clouds as points, `Clouded`, and the `Wall` or `Scan` of them.

    Offsets that nothing but a tape tells are taken off, and the wall is found once more.

    Parameters
    ----------
    job : Job
    adjustment : Adjustment or None
        Of the network that targets of scans belong to.
    progress : callable
    dof, amplitudes
        As in `find_wall`.
    reading : Reading, optional
        By how many workers files are read; None: in this process.

    Raises
    ------
    InputError
        For clouds without a wall, targets under wrong names, a scanner on the other side.
    """
    job, clouded = points_of_clouds(job, adjustment, progress, reading)
    if job.tank.kind != "vertical":
        return job, clouded, fit_scan(job, dof)
    wall = find_wall(job, progress, dof, amplitudes)
    told = told_causes(job, wall)
    free = {one.name: one.value for one in told if np.isinf(one.u_before)}
    if free:
        job, clouded = _as_points(job, clouded, free)
        wall = find_wall(job, progress, dof, amplitudes)
        told = told_causes(job, wall)
        job = with_bottom(job, clouded.inside, clouded.registration, told)
    return job, replace(clouded, told=told), wall


def points_of_clouds(job, adjustment, progress, reading=IN_PROCESS):
    """The job with means of its clouds as points, and their `Clouded`."""
    registration = registered(job, adjustment)
    progress(
        message(
            "reading_clouds",
            "reading {count} files of {scans} scans",
            count=len(job.clouds.files),
            scans=len(job.clouds.scans),
        )
    )
    telling = Telling(progress, reading.part_progress)
    placing = Placing.of(job.clouds, registration)
    with open_passes(placing, reading, telling) as passes:
        files = tuple(_fingerprint(one) for one in job.clouds.files)
        found = _wall_of_cells(job, placing, passes, telling)
        _refuse_places(job, registration, found.surface)
        inside = find_inside(job, passes, found, telling)
    readings = cells_of_clouds.readings_of(found, MOST_READINGS)
    _refuse_empty_courses(job, found, readings)
    _refuse_scans_apart(job, found, registration)
    job = replace(job, files=(*job.files, *files))
    job = with_bottom(job, inside, registration)
    clouded = Clouded(
        files, registration, found, readings, None, left_out=passes.left_out, inside=inside
    )
    return _as_points(job, clouded)


def _wall_of_cells(job, placing, passes, telling):
    """`CloudWall`; InputError with the unit that would explain that there is none."""
    joints = tuple(job.datum.bottom_z_m + joints_of(job)) if job.courses else None
    sizes = {
        "kind": job.tank.kind,
        "radius_m": _nominal_radius_m(job),
        "azimuth_rad": (job.horizontal.azimuth_rad if job.horizontal else None) or 0.0,
    }
    try:
        return cells_of_clouds.find_cloud_wall(
            passes,
            joints_m=joints,
            sides=job.clouds.sides,
            progress=telling.step,
            is_unit_defined=is_unit_defined(placing),
            **sizes,
        )
    except InputError as refused:
        ends = (joints[0], joints[-1]) if joints else None
        raise refusal_of_units(placing, {**sizes, "ends_m": ends}, refused) from refused


def registered(job, adjustment):
    """`Registration` of the scans of a job; adjustment: of its network, or None."""
    clouds, known = job.clouds, job.clouds.control
    if adjustment is not None:
        wanted = {one.target for one in clouds.targets}
        names = tuple(name for name in adjustment.names if name in wanted)
        place = {name: i for i, name in enumerate(adjustment.names)}
        xyz = adjustment.xyz_m[[place[name] for name in names]].reshape(-1, 3)
        known = KnownTargets(names, xyz, adjustment.full_covariance_m2(names))
    try:
        return register(clouds.scans, clouds.ranging, clouds.targets, known)
    except SolutionError as error:
        file = TARGETS if clouds.targets else FILE
        raise InputError(Problem(file, error.args[0])) from error


def _as_points(job, clouded, told_m=None):
    """The job with the readings of a cloud as its points, all on one side of the wall."""
    readings, surface = clouded.readings, clouded.cells.surface
    beamed = points_of_beams(
        readings.xyz_m,
        readings.sd_m,
        readings.scan,
        normals_of(surface, readings.xyz_m),
        clouded.registration,
        job.clouds.tools,
        file=FILE,
        told_m=told_m,
    )
    side = np.array(job.clouds.sides)[readings.scan]
    moved = side != job.survey.side
    if moved.any() and job.courses:
        points = through_wall(job, beamed.points, normals_of(surface, readings.xyz_m), moved)
        beamed = replace(beamed, points=points)
    _refuse_untold(job, beamed)
    job = replace(job, points=s_transform(beamed.points))
    return job, replace(clouded, beamed=beamed)


def _fingerprint(file):
    """`InputFile` of a file of a scanner, whose content is never held whole."""
    try:
        with open(file.header.path, "rb") as stream:
            digest = hashlib.file_digest(stream, "sha256")
    except OSError as error:
        raise InputError(Problem(file.file, unreadable_file(error))) from error
    return InputFile(file.file, digest.hexdigest(), file.header.bytes)


def _nominal_radius_m(job):
    return job.tank.nominal_diameter_m / 2


def _refuse_places(job, registration, surface):
    """Raise InputError for scanners on the other side of the wall than said, or far from it."""
    distance = surface.places(registration.place_m.copy())[2]
    radius = _nominal_radius_m(job)
    problems = []
    for file in job.clouds.files:
        for scan in range(file.first, file.first + len(file.header.scans)):
            if abs(distance[scan]) > FAR_AWAY * radius:
                text = message(
                    "scanner_far_away",
                    "scan {scan!r} comes from {away:.0f} m away from the wall; expected where the"
                    " scanner stood as scanner_xyz: offset and scale act along its beams",
                    scan=job.clouds.scans[scan].name,
                    away=abs(distance[scan]),
                )
                problems.append(Problem(FILE, text, column=f"{file.name}.scanner_xyz"))
            elif (distance[scan] < 0) != (job.clouds.sides[scan] == "inside"):
                text = message(
                    "scan_on_other_side",
                    "scan {scan!r} is said to be taken {side}, but its scanner stood on the other"
                    " side of the wall; expected the side of its scanner",
                    scan=job.clouds.scans[scan].name,
                    side=job.clouds.sides[scan],
                )
                problems.append(Problem(FILE, text, column=f"{file.name}.side"))
    if problems:
        raise InputError(problems)


def _refuse_scans_apart(job, cells, registration):
    """Raise InputError where scans show two walls that their registration does not bring together.

    Two walls within the registration are one; beyond it either the registration is wrong or a
    scan shows another surface, and the table could be that of either.
    """
    if cells.are_apart:
        apart = [one for one in overlaps_of(job, cells, registration) if one.is_apart]
        if apart:
            raise InputError([Problem(FILE, scans_apart(job, one)) for one in apart])


def _refuse_empty_courses(job, found, readings):
    """Raise InputError for courses of which too few means of cells are, with the reason."""
    means = np.bincount(readings.course, minlength=len(job.courses))
    middle = (found.grid.edges_m[:-1] + found.grid.edges_m[1:]) / 2
    problems = []
    for place, course in enumerate(job.courses):
        if means[place] >= FEWEST_MEANS:
            continue
        low, high = found.joints_m[place : place + 2]
        mine = (middle > low) & (middle < high)
        few = np.all([np.isin(one[mine], (EMPTY, FEW)) for one in found.why.values()], axis=0)
        text = message(
            "course_without_cells",
            "nothing of the wall of course {course!r} can be used: {few:.0f} % of its cells have"
            " fewer than {least} points, before the others something stands; expected a denser"
            " cloud, or a scanner that stands nearer and sees it",
            course=course.name,
            few=100 * np.mean(few),
            least=FEWEST,
        )
        problems.append(Problem(FILE, text))
    if problems:
        raise InputError(problems)


def _refuse_untold(job, beamed):
    """Raise InputError for an offset that nobody gave, and that no tape tells."""
    taped = job.strapping is not None and any(not one.check for one in job.strapping.straps)
    names = [one.name for one in beamed.points.unbound if one.what == "instrument_offset"]
    if names and not (taped and job.tank.kind == "vertical"):
        raise InputError(Problem(FILE, offset_untold(), column="u_offset_mm"))
