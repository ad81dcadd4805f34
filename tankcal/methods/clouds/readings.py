"""From the checked clouds.toml and scan_targets.csv to `Clouds`, in SI."""

from dataclasses import dataclass, field

import numpy as np

import tankcal.clouds
from tankcal.clouds.contents import CloudHeader
from tankcal.job.checking import has_rows
from tankcal.job.contract.registers import USUAL_INCIDENCE_MM
from tankcal.job.contract.shorthand import FREE
from tankcal.methods.clouds.checks import has_network, poses_of, scans_of, unit_of
from tankcal.methods.clouds.columns import ASSUMED
from tankcal.survey.scans import KnownTargets, ScanSetup, ScanTarget
from tankcal.survey.wall_hits import RangingInstrument
from tankcal.units import ARCSEC

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
    header: CloudHeader
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
    given = registers["clouds"]
    files, scans, sides, tools = [], [], [], {}
    for name, keys in given.items():
        header = tankcal.clouds.describe_cloud(raw.folder / keys["file"])
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
