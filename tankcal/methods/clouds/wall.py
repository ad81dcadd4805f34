"""The wall in point clouds, and warnings about it."""

import hashlib
import itertools
from dataclasses import dataclass, replace

import numpy as np

from tankcal.clouds import wall as cells_of_clouds
from tankcal.clouds.wall.growing import EMPTY, FEW, FEWEST
from tankcal.clouds.wall.passes import PointSample
from tankcal.clouds.wall.start import has_wall
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.job.model import InputFile
from tankcal.job.tables import unreadable_file
from tankcal.messages import message
from tankcal.methods.clouds.bottom import CloudInside, check_inside, find_inside, with_bottom
from tankcal.methods.clouds.columns import UNITS_M
from tankcal.methods.clouds.overlaps import normals_of, overlap_test, overlaps_of, scans_apart
from tankcal.methods.clouds.passes import Placing, Reading, Telling, open_passes
from tankcal.methods.clouds.readings import offset_untold
from tankcal.pipeline.checks import causes_unlike_certificates
from tankcal.pipeline.scanned_solids import fit_scan
from tankcal.pipeline.wall.finding import find_wall, joints_of, through_wall
from tankcal.pipeline.wall.shared_unknowns import estimate_causes
from tankcal.pipeline.wall.surveyed import s_transform
from tankcal.survey.beams import BeamPoints, points_of_beams
from tankcal.survey.registration import KnownTargets, Registration, register

FILE, TARGETS = "clouds.toml", "scan_targets.csv"
MOST_READINGS = 1200  # largest number of mean points, because of their full covariance
FEWEST_MEANS = 5  # smallest number of mean points of a course, as in a section
FAR_AWAY = 20.0  # largest distance of a scanner from the wall, in radii of the tank
IN_PROCESS = Reading()


@dataclass(frozen=True)
class Clouded:
    """Mean points of clouds, with the intermediate results.

    Attributes
    ----------
    files : tuple of InputFile
        SHA-256 of each file of a scanner, in the order of the job.
    registration : Registration
    cells : CloudWall
        Cells of the wall, obstructions, and numbers of points read.
    readings : CloudReadings
        Means of cells: the points of the job, in their order.
    beamed : BeamPoints
        Points with the causes that beams share.
    estimates : tuple of EstimatedCause
        Offsets and scales estimated by a vertical wall.
    left_out : ndarray of int, shape (scans,)
        Points of each scan in excluded boxes.
    inside : CloudInside or None
        Bottom and objects inside the tank; None: not requested.
    """

    files: tuple
    registration: Registration
    cells: object
    readings: object
    beamed: BeamPoints
    estimates: tuple = ()
    left_out: np.ndarray | None = None
    inside: CloudInside | None = None


def find_wall_in_clouds(
    job, adjustment, progress, dof=np.inf, *, amplitudes=None, reading=IN_PROCESS
):
    """Find the wall of a job in its point clouds.

    Offsets that only a tape determines are corrected, and the wall is computed again.

    Parameters
    ----------
    job : Job
    adjustment : Adjustment or None
        Adjustment of the network that contains the targets of the scans.
    progress : callable
    dof, amplitudes
        As in `find_wall`.
    reading : Reading, optional
        Processes that read the files; None: this process.

    Returns
    -------
    job : Job
        The job with mean points of its clouds as its points.
    clouded : Clouded
    survey : Wall or Scan
        Wall of a vertical tank, or shape of another tank.

    Raises
    ------
    InputError
        If the clouds show no wall, if targets have wrong names, or if a scanner is on the wrong
        side.
    """
    job, clouded = points_of_clouds(job, adjustment, progress, reading)
    if job.tank.kind != "vertical":
        return job, clouded, fit_scan(job, dof)
    wall = find_wall(job, progress, dof, amplitudes)
    estimates = estimate_causes(job, wall)
    offsets_m = {
        estimate.name: estimate.value for estimate in estimates if np.isinf(estimate.u_before)
    }
    if offsets_m:
        job, clouded = _as_points(job, clouded, offsets_m)
        wall = find_wall(job, progress, dof, amplitudes)
        estimates = estimate_causes(job, wall)
        job = with_bottom(job, clouded.inside, clouded.registration, estimates)
    return job, replace(clouded, estimates=estimates), wall


def points_of_clouds(job, adjustment, progress, reading=IN_PROCESS):
    """Return the job with mean points of its clouds as its points, and the `Clouded`.

    Parameters
    ----------
    job : Job
    adjustment : Adjustment or None
        Adjustment of the network that contains the targets of the scans.
    progress : callable
    reading : Reading, optional
        Processes that read the files.

    Returns
    -------
    job : Job
    clouded : Clouded
    """
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
        files = tuple(_fingerprint(file) for file in job.clouds.files)
        cloud_wall = _wall_of_cells(job, placing, passes, telling)
        _refuse_places(job, registration, cloud_wall.surface)
        inside = find_inside(job, passes, cloud_wall, telling)
    readings = cells_of_clouds.readings_of(cloud_wall, MOST_READINGS)
    _refuse_empty_courses(job, cloud_wall, readings)
    _refuse_scans_apart(job, cloud_wall, registration)
    job = replace(job, files=(*job.files, *files))
    job = with_bottom(job, inside, registration)
    clouded = Clouded(
        files, registration, cloud_wall, readings, None, left_out=passes.left_out, inside=inside
    )
    return _as_points(job, clouded)


def _wall_of_cells(job, placing, passes, telling):
    """`CloudWall` of a job; if none is found, InputError with the unit that would explain it."""
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
    """Return the `Registration` of the scans of a job; adjustment: of its network, or None."""
    clouds, known = job.clouds, job.clouds.control
    if adjustment is not None:
        targets = {reading.target for reading in clouds.targets}
        names = tuple(name for name in adjustment.names if name in targets)
        place = {name: i for i, name in enumerate(adjustment.names)}
        xyz = adjustment.xyz_m[[place[name] for name in names]].reshape(-1, 3)
        known = KnownTargets(names, xyz, adjustment.full_covariance_m2(names))
    try:
        return register(clouds.scans, clouds.ranging, clouds.targets, known)
    except SolutionError as error:
        file = TARGETS if clouds.targets else FILE
        raise InputError(Problem(file, error.args[0])) from error


def _as_points(job, clouded, estimated_m=None):
    """Return the job with the readings of its clouds as points, all on one side of the wall."""
    readings, surface = clouded.readings, clouded.cells.surface
    beamed = points_of_beams(
        readings.xyz_m,
        readings.sd_m,
        readings.scan,
        normals_of(surface, readings.xyz_m),
        clouded.registration,
        job.clouds.tools,
        file=FILE,
        estimated_m=estimated_m,
    )
    side = np.array(job.clouds.sides)[readings.scan]
    # Readings from the other side are moved through the plate to the side of the survey.
    is_moved = side != job.survey.side
    if is_moved.any() and job.courses:
        points = through_wall(job, beamed.points, normals_of(surface, readings.xyz_m), is_moved)
        beamed = replace(beamed, points=points)
    _refuse_unknown_offset(job, beamed)
    job = replace(job, points=s_transform(beamed.points))
    return job, replace(clouded, beamed=beamed)


def _fingerprint(file):
    """`InputFile` of a file of a scanner; the file is hashed as a stream because of its size."""
    try:
        with open(file.header.path, "rb") as stream:
            digest = hashlib.file_digest(stream, "sha256")
    except OSError as error:
        raise InputError(Problem(file.file, unreadable_file(error))) from error
    return InputFile(file.file, digest.hexdigest(), file.header.bytes)


def _nominal_radius_m(job):
    """Nominal radius of the tank, m."""
    return job.tank.nominal_diameter_m / 2


def _refuse_places(job, registration, surface):
    """Raise InputError for scanners on the wrong side of the wall, or far from it."""
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
    """Raise InputError if scans show two walls that their registration does not reconcile.

    Within the uncertainty of the registration, two walls are treated as the same wall. Beyond it,
    the registration is wrong or a scan shows another surface, and the table could belong to either
    wall.
    """
    if cells.are_separate:
        overlaps = [
            overlap for overlap in overlaps_of(job, cells, registration) if overlap.is_apart
        ]
        if overlaps:
            raise InputError([Problem(FILE, scans_apart(job, overlap)) for overlap in overlaps])


def _refuse_empty_courses(job, cloud_wall, readings):
    """Raise InputError for courses with too few mean points, with the reason."""
    means = np.bincount(readings.course, minlength=len(job.courses))
    middle = cloud_wall.grid.middles_m
    problems = []
    for number, course in enumerate(job.courses):
        if means[number] >= FEWEST_MEANS:
            continue
        low, high = cloud_wall.joints_m[number : number + 2]
        is_in_course = (middle > low) & (middle < high)
        few = np.all(
            [np.isin(reasons[is_in_course], (EMPTY, FEW)) for reasons in cloud_wall.why.values()],
            axis=0,
        )
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


def _refuse_unknown_offset(job, beamed):
    """Raise InputError for an offset without a declared uncertainty that no tape determines."""
    is_strapped = job.strapping is not None and any(
        not strap.check for strap in job.strapping.straps
    )
    names = [cause.name for cause in beamed.points.unbound if cause.what == "instrument_offset"]
    if names and not (is_strapped and job.tank.kind == "vertical"):
        raise InputError(Problem(FILE, offset_untold(), column="u_offset_mm"))


SAMPLE, MOST_CHUNKS = 60_000, 8  # largest numbers of points and of chunks examined per file
DEFINED = {"e57": "m"}  # units defined by a format (E57: ASTM E2807); no other unit is tried
SAME = 1e-3  # relative difference of units that points cannot separate: feet and survey feet


def refusal_of_units(placing, sizes, refused):
    """Return the error that no wall was found, or an error that names the files in another unit.

    Each file is examined alone, with its scans scaled to each unit. The scale applies about the
    scanner if the pose comes from targets, and about the origin if the pose comes from the file. A
    format that defines its unit allows no other unit. If a wall was found, the unit is right.

    Parameters
    ----------
    placing : Placing
    sizes : dict
        Nominal sizes of the wall: kind, ends_m, radius_m, azimuth_rad.
    refused : InputError
        Error that no wall was found.

    Returns
    -------
    InputError
    """
    problems = []
    if any(problem.expected.code == "cloud_two_surfaces" for problem in refused.problems):
        return refused
    for number, file in enumerate(placing.files):
        units = units_of(file)
        if len(units) == 1 and file.unit_m in units.values():
            continue
        scan, xyz = _some_points(placing, number)
        unit = _unit_that_fits(xyz, placing.place_m[scan], file.unit_m, units, sizes)
        if unit is not None:
            declared = next(name for name, size in UNITS_M.items() if size == file.unit_m)
            text = message(
                "cloud_file_unit",
                "no wall near the nominal radius {nominal_m:.3f} m, but one if the coordinates of "
                "{file} are {unit}: found {declared}",
                nominal_m=sizes["radius_m"],
                file=file.file,
                unit=unit,
                declared=declared,
            )
            problems.append(Problem(FILE, text, column=f"{file.name}.unit"))
    return InputError(problems) if problems else refused


def units_of(file):
    """Return the possible units of the coordinates of a `CloudFile`, {unit: size in m}."""
    defined = DEFINED.get(file.header.format)
    return UNITS_M if defined is None else {defined: UNITS_M[defined]}


def is_unit_defined(placing):
    """Whether the format of every file defines its unit, and the job declares this unit."""
    return all(list(units_of(file).values()) == [file.unit_m] for file in placing.files)


def _some_points(placing, number):
    """Number of the first scan of a file with points, and a sample of its points (k, 3), m."""
    shares = [share for share in placing.shares() if share.file == number]
    points = placing.points(shares, placing.tally())
    sample, first = PointSample(SAMPLE), None
    try:
        for scan, xyz in itertools.islice(points, MOST_CHUNKS):
            first = scan if first is None else first
            if scan == first:
                sample.add(xyz, scan)
    finally:
        points.close()
    return first or 0, sample.points()


def _unit_that_fits(xyz_m, place_m, declared_m, units, sizes):
    """Name of another unit with which the points show a wall, or None."""
    tried = [declared_m]
    for unit, size in units.items():
        factor = size / declared_m
        if any(abs(size / earlier - 1) < SAME for earlier in tried):
            continue
        tried.append(size)
        # The pose from targets is independent of the unit of the file; the pose from the file is
        # not.
        for origin in (place_m, np.zeros(3)):
            if has_wall((xyz_m - origin) * factor + origin, **sizes):
                return unit
    return None


HIDDEN = 0.25  # largest share of hidden cells of a course: their form is only interpolated
LEAST_OF_WALL = 0.01  # smallest share of wall points in a scan


def check_clouds(job, survey, clouded):
    """Return the warnings of the clouds of a wall.

    Parameters
    ----------
    job : Job
    survey : Wall or Scan
    clouded : Clouded

    Returns
    -------
    tuple of Problem
    """
    return (
        *_check_targets(clouded.registration),
        *_check_overlaps(job, clouded),
        *_check_idle_scans(job, clouded),
        *_check_hidden_courses(job, clouded),
        *_check_assumed_uncertainties(job, clouded),
        *check_inside(job, clouded.inside),
        *causes_unlike_certificates(
            survey, clouded.estimates, FILE, taken_off_m=clouded.beamed.estimated_m
        ),
    )


def _check_overlaps(job, clouded):
    """Warn of pairs of scans that disagree; if there are none, test all overlaps together."""
    apart = [
        overlap
        for overlap in overlaps_of(job, clouded.cells, clouded.registration)
        if overlap.is_apart
    ]
    for overlap in apart:
        yield Problem(FILE, scans_apart(job, overlap))
    if not apart:
        yield from _check_registration(job, clouded)


def _check_registration(job, clouded):
    """Warn of a registration worse than declared, according to all overlaps together."""
    test = overlap_test(job, clouded.cells, clouded.registration)
    if test is not None and test.chi2 > test.limit:
        text = message(
            "registration_beyond",
            "where scans overlap they differ {factor:.1f} times as much as the declared"
            " registration allows (chi2 = {chi2:.1f}, expected at most {limit:.1f} with {dof}"
            " degrees of freedom): U may be too small by this factor; check poses,"
            " s_translation_mm, s_rotation_arcsec and targets",
            factor=test.factor,
            chi2=test.chi2,
            limit=test.limit,
            dof=test.dof,
        )
        yield Problem(FILE, text)


def _check_targets(registration):
    """Warn of rejected targets."""
    for residual in registration.residuals:
        if residual.removed:
            text = message(
                "target_removed",
                "target {target!r} of scan {scan!r} is {off_mm:.1f} mm off where the others have it"
                " (|w| = {w:.1f}): rejected",
                target=residual.target,
                scan=residual.scan,
                off_mm=1000 * float(np.linalg.norm(residual.residual_m)),
                w=residual.w,
            )
            yield Problem(TARGETS, text, residual.row)


def _check_idle_scans(job, clouded):
    """Warn of scans with hardly any point of the wall."""
    cells = clouded.cells
    for number, scan in enumerate(job.clouds.scans):
        share = cells.of_wall[number] / max(cells.delivered[number], 1)
        if share < LEAST_OF_WALL:
            text = message(
                "scan_without_wall",
                "{percent:.1f} % of the points of scan {scan!r} are of the wall; expected"
                " {least:.1f} % or more: are its unit and its pose right, and is it a scan of this"
                " tank?",
                percent=100 * share,
                scan=scan.name,
                least=100 * LEAST_OF_WALL,
            )
            yield Problem(FILE, text)


def _check_hidden_courses(job, clouded):
    """Warn of courses that are largely hidden from all scans."""
    for number, share in enumerate(clouded.cells.masked_share):
        if share > HIDDEN:
            name = job.courses[number].name if number < len(job.courses) else str(number + 1)
            text = message(
                "course_hidden",
                "{percent:.0f} % of course {course!r} are hidden from all scans; expected at most"
                " {most:.0f} %: what lies there is told by the form of the rest alone",
                percent=100 * share,
                course=name,
                most=100 * HIDDEN,
            )
            yield Problem(FILE, text)


def _check_assumed_uncertainties(job, clouded):
    """Warn of assumed standard uncertainties of scanners and of the registration."""
    for name, (tool, offset, scale) in job.clouds.tools.items():
        if offset or scale:
            text = message(
                "scanner_assumed",
                "of scanner {name!r} an offset of {offset_mm:.1f} mm and a scale of {scale_ppm:.0f}"
                " ppm are taken as standard uncertainties: nobody declared both of them",
                name=name,
                offset_mm=1000 * tool.u_offset_m,
                scale_ppm=1e6 * tool.u_scale,
            )
            yield Problem(FILE, text)
    scans = clouded.registration.scans
    ties = clouded.registration.ties
    # The network determines the registration of tied scans, so nothing is assumed for them.
    assumed = [i for i, scan in enumerate(scans) if scan.is_assumed and ties[i] != "network"]
    if assumed:
        text = message(
            "registration_assumed",
            "the registration of scans {scans} is assumed: {mm:.1f} mm and {arcsec:.0f}''; expected"
            " targets, or the standard deviations that it has",
            scans=[scans[i].name for i in assumed],
            mm=1000 * scans[assumed[0]].s_translation_m,
            arcsec=np.degrees(scans[assumed[0]].s_rotation_rad) * 3600,
        )
        yield Problem(FILE, text)
