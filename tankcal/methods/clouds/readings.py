"""Checks and readings of point clouds."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from tankcal.clouds.formats.files import CloudHeader
from tankcal.errors import InputError
from tankcal.job.checking import has_rows, is_not_given, missing_beside, name_twice, tell
from tankcal.job.checks.extent import has_survey, sights_given, tells_by_tape
from tankcal.job.contract.bottom import OF_CLOUD
from tankcal.job.contract.registers import USUAL_INCIDENCE_MM
from tankcal.job.entries import kind_of
from tankcal.job.fields import FREE
from tankcal.job.tables import unreadable_file
from tankcal.messages import message
from tankcal.methods.clouds.columns import (
    ASSUMED,
    DOCUMENTED,
    OF_FILE,
    OF_SCANNER,
    RANGING,
    REGISTRATION,
    UNITS_M,
)
from tankcal.survey.registration import KnownTargets, ScanSetup, ScanTarget
from tankcal.survey.wall_hits import RangingInstrument
from tankcal.units import ARCSEC

if TYPE_CHECKING:
    from tankcal.clouds.formats.files import CloudHeader

FEWEST_TARGETS = 3  # smallest number of targets that determine the pose of a scan
RIGID = 1e-4  # largest deviation of a pose from a rotation, due to rounding
PLACE = 3  # number of coordinates


def check_clouds(values, tables, registers, raw, log):
    """Check files, rigid poses, targets and declared errors; parameters as for `check_all`."""
    given, targets = registers.get("clouds", {}), tables["scan_targets"]
    if values is not None and kind_of(raw) == "vertical":
        _check_bottom(values, given, tables, raw, log)
    if not has_rows(tables["clouds"]):
        if has_rows(targets):
            log.warning(targets.file, message("no_clouds", "without effect: the job has no cloud"))
        return
    file = raw.registers["clouds"].file
    _refuse_beside(tables, log)
    size = ("tank", "nominal_diameter_m")
    if values is not None and kind_of(raw) != "vertical" and is_not_given(raw, *size):
        tell(log.problem, raw, *size, missing_beside(file))  # always required for a vertical tank
    headers = {name: _header(raw, name, keys, log) for name, keys in given.items()}
    names = {name: scans_of(name, headers[name]) for name in given if headers[name] is not None}
    counts = _count_targets(targets, names, len(names) == len(given), log)
    for name, keys in given.items():
        tell_of = _teller(raw, file, name, log)
        if headers[name] is not None:
            _check_poses(keys, headers[name], tell_of)
            for scan in headers[name].scans:
                if scan.warning is not None and keys["pose"] is None:
                    tell_of("pose", scan.warning, log.warning)
        _check_places(keys, tell_of)
        _check_errors(keys, [counts.get(scan, 0) for scan in names.get(name, ())], tables, tell_of)
    _refuse_unlike(raw, file, given, log)
    if has_rows(targets):
        _warn_lonely(tables, targets, log)


def _check_bottom(values, given, tables, raw, log):
    """Refuse a bottom measured by scans without a scan from inside."""
    if values["bottom"]["form"] != OF_CLOUD:
        return
    sides = {keys["side"] or values["survey"]["side"] or "inside" for keys in given.values()}
    if not has_rows(tables["clouds"]) or "inside" not in sides:
        text = message(
            "bottom_without_cloud",
            "found cloud; expected a scan from inside in clouds.toml, or another form: scans from"
            " outside do not see the bottom",
        )
        tell(log.problem, raw, "bottom", "form", text)


def scans_of(name, header):
    """Names of the scans of a file: the name of its section, numbered if there are several."""
    count = len(header.scans)
    return (name,) if count == 1 else tuple(f"{name} {i + 1}" for i in range(count))


def _teller(raw, file, name, log):
    """Function that reports on one key of a cloud, with its row."""
    register = raw.registers["clouds"]

    def tell(key, expected, report=log.problem):
        value = register.entries[name].get(key)
        row = register.rows[name] if value is None or value.row is None else value.row
        report(file, expected, row, f"{name}.{key}")

    return tell


def _refuse_beside(tables, log):
    beside = {"points": has_rows(tables["points"]), "targets": has_rows(tables["targets"])}
    beside |= {name: name != "clouds" for name in sights_given(tables)}
    for name, is_there in beside.items():
        if is_there:
            expected = message(
                "beside_clouds",
                "given together with a cloud; expected only one of them: tankcal does not join"
                " them yet",
            )
            log.problem(tables[name].file, expected)


def _header(raw, name, given, log):
    """`CloudHeader` of a file; None, with the problems in `log`, if unreadable."""
    if given["file"] is None:
        return None
    path = raw.folder / given["file"]
    from tankcal.clouds import describe_cloud

    tell = _teller(raw, raw.registers["clouds"].file, name, log)
    try:
        if not path.is_file():
            text = message(
                "cloud_not_found",
                "{file} not found; expected a file of a scanner",
                file=given["file"],
            )
            tell("file", text)
            return None
        header = describe_cloud(path)
    except InputError as error:
        log.problems.extend(error.problems)
        return None
    except (OSError, ValueError) as error:
        tell("file", unreadable_file(error))
        return None
    if not header.scans:
        tell("file", message("cloud_without_scans", "no scan in it; expected one or more"))
        return None
    return header


def poses_of(given, header, unit_m):
    """Pose (4, 4) of each scan, lengths in m; None if not given or not in the file."""
    if given["pose"] is None:
        return [None] * len(header.scans)
    if given["pose"] == OF_FILE:
        poses = [pose.pose for pose in header.scans]
    else:
        poses = [*np.reshape(given["pose"], (-1, 4, 4))]
    scale = np.ones((4, 4))
    scale[:3, 3] = unit_m
    return [None if pose is None else np.asarray(pose, dtype=float) * scale for pose in poses]


def _check_poses(given, header, tell):
    pose, count = given["pose"], len(header.scans)
    if pose is None:
        if count > 1 and any(scan.pose is not None for scan in header.scans):
            text = message(
                "pose_of_scans_missing",
                'blank, but the file has {count} scans with a pose each; expected "file", or four'
                " rows for each",
                count=count,
            )
            tell("pose", text)
        elif count > 1 and any(scan.is_placed for scan in header.scans):
            text = message(
                "pose_without_rotation",
                "blank, but the {count} scans of the file have positions without a rotation (a"
                " quaternion of zeros); expected four rows of four numbers for each scan",
                count=count,
            )
            tell("pose", text)
        return
    if pose == OF_FILE:
        unplaced = [i + 1 for i, scan in enumerate(header.scans) if scan.pose is None]
        if unplaced:
            text = message(
                "file_without_pose",
                "found file, but scans {scans} of the file have no pose; expected four rows of four"
                " numbers for each scan, or blank",
                scans=unplaced[:5],
            )
            tell("pose", text)
            return
    elif len(pose) != 4 * count:
        text = message(
            "rows_of_pose",
            "{rows} rows; expected {wanted}, four for each of the {count} scans of the file",
            rows=len(pose),
            wanted=4 * count,
            count=count,
        )
        tell("pose", text)
        return
    for i, scan in enumerate(poses_of(given, header, 1.0)):
        if not _is_rigid(scan):
            text = message(
                "pose_not_rigid",
                "the pose of scan {scan} is no rotation and shift; expected rows that turn a"
                " right-handed frame without a scale, and 0 0 0 1 as the last",
                scan=i + 1,
            )
            tell("pose", text)


def _is_rigid(pose):
    turn = pose[:3, :3]
    return bool(
        np.all(np.isfinite(pose))
        and np.allclose(pose[3], [0, 0, 0, 1], atol=1e-9)
        and np.allclose(turn @ turn.T, np.eye(3), atol=RIGID)
        and np.linalg.det(turn) > 0
    )


def _check_places(given, tell):
    scanner_xyz = given["scanner_xyz"]
    if scanner_xyz is not None and len(scanner_xyz) != PLACE:
        text = message(
            "three_numbers", "{count} numbers; expected x, y and z", count=len(scanner_xyz)
        )
        tell("scanner_xyz", text)
    for i, box in enumerate(given["leave_out"] or ()):
        if not all(low < high for low, high in zip(box[:3], box[3:], strict=True)):
            text = message(
                "empty_box",
                "box {number} holds nothing; expected x0 y0 z0 x1 y1 z1 with each first number"
                " below its second",
                number=i + 1,
            )
            tell("leave_out", text)


def _check_errors(given, targets, tables, tell):
    """Require the common errors of the points of a scan, declared or assumed.

    Parameters
    ----------
    given : dict
        {key: value} of the cloud.
    targets : sequence of int
        Number of targets in each scan of the file; empty: unreadable.
    tables : dict
        Tables by name.
    tell : callable
        Reports on a key.
    """
    if given["assume"] == DOCUMENTED:
        return
    missing = [key for key in RANGING if given[key] is None]
    is_certain = bool(targets) or not has_rows(
        tables["scan_targets"]
    )  # else the targets may belong to these scans
    if is_certain and min(targets, default=0) < FEWEST_TARGETS:
        missing += [key for key in REGISTRATION if given[key] is None]
    for key in missing:
        text = message(
            "shared_error_missing",
            'missing; expected its value, 0 where it is exact, or assume = "documented": all points'
            " of the scan share it, so that no table is made without it",
        )
        tell(key, text)
    if given["u_offset_mm"] == FREE and not tells_by_tape(tables):
        tell("u_offset_mm", offset_untold())


def offset_untold():
    """Message about a free offset that no tape determines."""
    return message(
        "offset_of_cloud_untold",
        "found free; expected its standard uncertainty, or a circumference by tape: nothing in the"
        " job tells it",
    )


def _refuse_unlike(raw, file, given, log):
    """Report files of one scanner with different declared errors."""
    first = {}
    for name, keys in given.items():
        other = first.setdefault(keys["scanner"], name)
        for key in OF_SCANNER:
            if keys[key] != given[other][key] and not log.has(file, None, f"{name}.{key}"):
                text = message(
                    "unlike_scanner",
                    "not what {other!r} has, but both are of one scanner; expected the same, or"
                    " another name of the scanner",
                    other=other,
                )
                _teller(raw, file, name, log)(key, text)


def _count_targets(targets, names, are_all_read, log):
    """{scan: number of its targets}; invalid rows are reported."""
    if not has_rows(targets):
        return {}
    known = [scan for scans in names.values() for scan in scans]
    counts, first_rows = {}, {}
    columns = zip(targets.rows, targets.of("scan"), targets.of("target"), strict=True)
    for row, scan, target in columns:
        if scan is None or target is None:
            continue
        if scan not in known:
            if are_all_read:
                text = message(
                    "scan_of_no_cloud",
                    "found {scan!r}; expected a scan of clouds.toml: {known}",
                    scan=scan,
                    known=known[:12],
                )
                log.problem(targets.file, text, row, "scan")
            continue
        if (scan, target) in first_rows:
            log.problem(targets.file, name_twice(target, first_rows[scan, target]), row, "target")
            continue
        first_rows[scan, target] = row
        counts[scan] = counts.get(scan, 0) + 1
    return counts


def _warn_lonely(tables, targets, log):
    """Warn about each target that occurs in a single scan and nowhere else."""
    known = set()
    for name, columns in (
        ("control", ("point",)),
        ("directions", ("to",)),
        ("slope_distances", ("to",)),
        ("distances", ("from", "to")),
        ("zenith_angles", ("to",)),
        ("height_differences", ("from", "to")),
        ("vectors", ("from", "to")),
        ("image_points", ("point",)),
    ):
        table = tables[name]
        if has_rows(table):
            known.update(name_of_point for column in columns for name_of_point in table.of(column))
    listed = targets.of("target")
    for row, target in zip(targets.rows, listed, strict=True):
        if target is not None and target not in known and listed.count(target) == 1:
            text = message(
                "lonely_target",
                "{target!r} is on this scan alone; expected it on another scan, or in the survey:"
                " it ties nothing",
                target=target,
            )
            log.warning(targets.file, text, row, "target")


def has_network(tables):
    """Return True if a survey to be adjusted may contain the targets of scans."""
    return has_survey(tables)


def unit_of(given):
    """Length of one unit of a file, m."""
    return UNITS_M[given["unit"]]


AXES = "xyz"
SCANNER = "scanner"  # name of a scanner without a name


@dataclass(frozen=True)
class CloudFile:
    """One file of a scanner.

    Attributes
    ----------
    name : str
        Name of its section in clouds.toml.
    file : str
        File name as given in clouds.toml.
    header : CloudHeader
    unit_m : float
        Length of one unit of its coordinates, m.
    first : int
        Index of its first scan among the scans of the job.
    leave_out_m : ndarray, shape (k, 6)
        Boxes x0, y0, z0, x1, y1, z1 without points of the tank, in the frame of the tank.
    time_s : float or None
        Time of the scans, s since 2000.
    """

    name: str
    file: str
    header: "CloudHeader"
    unit_m: float
    first: int
    leave_out_m: np.ndarray
    time_s: float | None = None


@dataclass(frozen=True)
class Clouds:
    """All clouds of a job.

    Attributes
    ----------
    files : tuple of CloudFile
    scans : tuple of ScanSetup
        Scans of all files, in the order of the files.
    tools : dict
        {scanner: (RangingInstrument, is its offset assumed, is its scale assumed)}.
    sides : tuple of str
        "inside" or "outside": position of the scanner in each scan.
    targets : tuple of ScanTarget
    control : KnownTargets
        Control points of control.csv, if no survey is adjusted.
    """

    files: tuple
    scans: tuple
    tools: dict
    sides: tuple
    targets: tuple = ()
    control: KnownTargets = field(default_factory=KnownTargets)

    @property
    def ranging(self):
        """{scanner: RangingInstrument}."""
        return {name: tool[0] for name, tool in self.tools.items()}

    @property
    def declared(self):
        """Number of points declared by the files; files without a declaration count 0."""
        return sum(scan.declared or 0 for file in self.files for scan in file.header.scans)


def make_clouds(values, tables, registers, raw):
    """Build `Clouds` from the values, tables and registers of a job without problems."""
    from tankcal.clouds import describe_cloud  # jobs without clouds do not load it

    given = registers["clouds"]
    files, scans, sides, tools = [], [], [], {}
    for name, keys in given.items():
        header = describe_cloud(raw.folder / keys["file"])
        unit = unit_of(keys)
        files.append(
            CloudFile(
                name,
                keys["file"],
                header,
                unit,
                len(scans),
                np.array(keys["leave_out"] or [], dtype=float).reshape(-1, 6),
                keys["time"],
            )
        )
        scanner = keys["scanner"] or SCANNER
        tools.setdefault(scanner, _tool(scanner, keys))
        scans += _scans(name, keys, header, unit, scanner)
        side = keys["side"] or values["survey"]["side"] or "inside"
        sides += [side] * len(header.scans)
    targets = tables["scan_targets"]
    return Clouds(
        tuple(files),
        tuple(scans),
        tools,
        tuple(sides),
        _targets(targets) if has_rows(targets) else (),
        KnownTargets() if has_network(tables) else _control(tables["control"]),
    )


def _tool(name, given):
    """(RangingInstrument, is its offset assumed, is its scale assumed)."""
    offset, scale, bias = (given[key] for key in ("u_offset_mm", "u_scale_ppm", "u_incidence_mm"))
    instrument = RangingInstrument(
        name,
        correction=(given["scale_ppm"] or 0.0) / 1e6,
        correction_m=(given["offset_mm"] or 0.0) / 1000,
        u_scale=(ASSUMED["u_scale_ppm"] if scale is None else scale) / 1e6,
        u_offset_m=np.nan
        if offset == FREE
        else (ASSUMED["u_offset_mm"] if offset is None else offset) / 1000,
        u_incidence_m=(USUAL_INCIDENCE_MM if bias is None else bias) / 1000,
        certificate=given["certificate"] or "",
    )
    return instrument, offset is None, scale is None


def _scans(name, given, header, unit_m, scanner):
    """`ScanSetup` of each scan of a file; pose and standard deviations in SI."""
    scanner_xyz_m = unit_m * np.array(given["scanner_xyz"] or (0.0, 0.0, 0.0))
    shift_mm, turn_arcsec = (given[key] for key in ("s_translation_mm", "s_rotation_arcsec"))
    assumes = given["assume"] is not None
    if assumes:
        shift_mm = ASSUMED["s_translation_mm"] if shift_mm is None else shift_mm
        turn_arcsec = ASSUMED["s_rotation_arcsec"] if turn_arcsec is None else turn_arcsec
    missing = given["s_translation_mm"] is None or given["s_rotation_arcsec"] is None
    return [
        ScanSetup(
            scan,
            scanner,
            given["surface"] or "",
            pose,
            scanner_xyz_m,
            np.nan if shift_mm is None else shift_mm / 1000,
            np.nan if turn_arcsec is None else turn_arcsec * ARCSEC,
            is_assumed=assumes and missing,
        )
        for scan, pose in zip(scans_of(name, header), poses_of(given, header, unit_m), strict=True)
    ]


def _targets(table):
    xyz = np.column_stack([table.numbers(f"{axis}_m") for axis in AXES])
    columns = zip(table.of("scan"), table.of("target"), xyz, table.numbers("s_mm"), table.rows,
                  strict=True)  # fmt: skip
    return tuple(
        ScanTarget(scan, target, place, sd / 1000, row) for scan, target, place, sd, row in columns
    )


def _control(table):
    """`KnownTargets` of uncorrelated control points with all sds and without a local system."""
    if not has_rows(table):
        return KnownTargets()
    xyz = np.column_stack([table.numbers(f"{axis}_m") for axis in AXES])
    sd = np.column_stack([table.numbers(f"s{axis}_mm") for axis in AXES]) / 1000
    is_used = np.array([system is None for system in table.of("system")])
    is_used &= ~np.isnan(np.hstack([xyz, sd])).any(axis=1)
    names = tuple(name for name, keep in zip(table.of("point"), is_used, strict=True) if keep)
    return KnownTargets(names, xyz[is_used], np.diag(sd[is_used].ravel() ** 2))
