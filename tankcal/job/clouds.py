"""From the checked clouds.toml and scan_targets.csv to `Clouds`, all in SI."""

import numpy as np

import tankcal.clouds
from tankcal.job.checking import has_rows
from tankcal.job.checks.clouds import has_network, poses_of, scans_of, unit_of
from tankcal.job.contract.clouds import ASSUMED
from tankcal.job.contract.shorthand import FREE
from tankcal.job.hits import USUAL_INCIDENCE_MM
from tankcal.job.measuring import ARCSEC
from tankcal.job.model.clouds import CloudFile, Clouds
from tankcal.survey.scans import KnownTargets, ScanSetup, ScanTarget
from tankcal.survey.wall_hits import RangingInstrument

AXES = "xyz"
SCANNER = "scanner"  # the name of one that has none


def make_clouds(values, tables, registers, raw):
    """Clouds of a job without problems."""
    given = registers["clouds"]
    files, scans, sides, tools = [], [], [], {}
    for name, one in given.items():
        header = tankcal.clouds.describe_cloud(raw.folder / one["file"])
        unit = unit_of(one)
        files.append(
            CloudFile(
                name,
                one["file"],
                header,
                unit,
                len(scans),
                np.array(one["leave_out"] or [], dtype=float).reshape(-1, 6),
                one["time"],
            )
        )
        scanner = one["scanner"] or SCANNER
        tools.setdefault(scanner, _tool(scanner, one))
        scans += _scans(name, one, header, unit, scanner)
        side = one["side"] or values["survey"]["side"] or "inside"
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
    """(RangingInstrument, whether its offset is assumed, whether its scale is)."""
    offset, scale, bias = (given[key] for key in ("u_offset_mm", "u_scale_ppm", "u_incidence_mm"))
    tool = RangingInstrument(
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
    return tool, offset is None, scale is None


def _scans(name, given, header, unit_m, scanner):
    stood = unit_m * np.array(given["scanner_xyz"] or (0.0, 0.0, 0.0))
    mm, arcsec = (given[key] for key in ("s_translation_mm", "s_rotation_arcsec"))
    assumes = given["assume"] is not None
    if assumes:
        mm = ASSUMED["s_translation_mm"] if mm is None else mm
        arcsec = ASSUMED["s_rotation_arcsec"] if arcsec is None else arcsec
    missing = given["s_translation_mm"] is None or given["s_rotation_arcsec"] is None
    return [
        ScanSetup(
            scan,
            scanner,
            given["surface"] or "",
            pose,
            stood,
            np.nan if mm is None else mm / 1000,
            np.nan if arcsec is None else arcsec * ARCSEC,
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
    """Control points as they were handed in, each by itself; those without an sd are left out."""
    if not has_rows(table):
        return KnownTargets()
    xyz = np.column_stack([table.numbers(f"{axis}_m") for axis in AXES])
    sd = np.column_stack([table.numbers(f"s{axis}_mm") for axis in AXES]) / 1000
    own = np.array([system is None for system in table.of("system")])
    own &= ~np.isnan(np.hstack([xyz, sd])).any(axis=1)
    names = tuple(name for name, kept in zip(table.of("point"), own, strict=True) if kept)
    return KnownTargets(names, xyz[own], np.diag(sd[own].ravel() ** 2))
