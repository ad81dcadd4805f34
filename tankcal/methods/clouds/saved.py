"""The part of the record on point clouds: files, scans, registration, obstructions, bottom."""

from collections import Counter
from dataclasses import replace

import numpy as np

from tankcal.record.ranging import SharedByHits, shared_of
from tankcal.record.schema import Finite, Saved, key
from tankcal.units import ARCSEC

# Kinds of inputs that all points of a scanner or a scan share.
SHARED = {"instrument_offset", "instrument_scale", "incidence", "registration"}


class CloudFileRead(Saved):
    """A file of a scanner, which is read in place."""

    cloud: str = key("section of clouds.toml")
    file: str = key("as it is named there")
    format: str = key('"las", "laz", "e57", "ply", "ptx", "pts" or "xyz"')
    sha256: str = key("of the whole file")
    bytes: int = key("of the file")
    unit_m: float = key("metres of one unit of its coordinates")
    scans: int = key("in the file")
    declared: int | None = key("number of points by its header; null: not in the header")
    delivered: int = key("points with a return, outside of the boxes that are left out")
    left_out: int = key("points in the boxes that are left out")
    of_wall: int = key("delivered points in the means of the wall")


class ScanRegistered(Saved):
    """A scan, its pose and the precision of the pose."""

    scan: str = key("name")
    scanner: str = key("name")
    side: str = key('"inside" or "outside": where the scanner stood')
    surface: str = key('of the wall that it shows; "": only one surface')
    tie: str = key('"network" (targets), "frame" (it is the frame itself) or "declared"')
    is_assumed: bool = key("whether its standard deviations are assumed")
    x_m: Finite = key("position of the scanner in the frame of the tank")
    y_m: Finite = key("position of the scanner in the frame of the tank")
    z_m: Finite = key("position of the scanner in the frame of the tank")
    s_translation_mm: float = key("standard deviation along an axis, root of the mean variance")
    s_rotation_arcsec: float = key("standard deviation about an axis, root of the mean variance")
    targets: int = key("that determine its pose")
    delivered: int = key("points with a return, outside of the boxes that are left out")
    left_out: int = key("points in the boxes that are left out")
    outside: int = key("delivered points above, below or far from the wall")
    beyond: int = key("delivered points near the wall, but outside its band")
    of_wall: int = key("delivered points in the means of the wall")
    readings: int = key("means of cells that determine the wall")


class ScannerDeclared(Saved):
    """Errors common to all points of a scanner, as declared or assumed."""

    scanner: str = key("name")
    certificate: str = key('its number; "": not given')
    offset_mm: float = key("added to each distance")
    u_offset_mm: float | None = key("its standard uncertainty; null: free, estimated with the wall")
    offset_is_assumed: bool = key("whether it is assumed, not declared")
    scale_ppm: float = key("true = reading (1 + scale)")
    u_scale_ppm: float = key("its standard uncertainty")
    scale_is_assumed: bool = key("whether it is assumed, not declared")
    u_incidence_mm: float = key("standard uncertainty of the bias at 60 degrees of incidence")


class ScanTargetUsed(Saved):
    """A target in a scan, compared with the adjusted registration."""

    scan: str = key("name")
    target: str = key("name")
    residual_m: list[float] = key("x, y, z: by the pose less adjusted, in the frame of the tank")
    w: float | None = key("of the worst coordinate; null: not controlled")
    mdb_m: float | None = key("smallest blunder that the test detects; null: not controlled")
    removed: bool = key("whether it was rejected")
    row: int | None = key("of scan_targets.csv")


class ScansCompared(Saved):
    """Two scans compared where both show the wall."""

    one: str = key("name")
    other: str = key("name")
    cells: int = key("that both show")
    mean_mm: float = key("mean difference of the wall, other minus one, outwards positive")
    apart_mm: float = key("part of their differences that a shift between them explains")
    w: float = key("of that shift, by the uncertainty of registration and scanners")


class CourseSeen(Saved):
    """The hidden share of a course."""

    course: str = key("name; for a tank without courses the number of the part")
    masked: float = key("share of its cells that no scan shows")


class ObstructionSeen(Saved):
    """An object that hides the wall: a proposed row of deadwood, without its volume."""

    guess: str = key('"pipe", "stairs", "ring", "nozzle" or "unseen"')
    azimuth_from_deg: float = key("clockwise from +y")
    azimuth_to_deg: float = key("clockwise from +y; it may exceed 360")
    bottom_m: float = key("height above the table's zero")
    top_m: float = key("height above the table's zero")
    near_m: float | None = key("from the wall, outwards positive: 5 % of its points; null: none")
    far_m: float | None = key("from the wall, outwards positive: 95 % of its points; null: none")


class JointSeen(Saved):
    """A step of the radius in the cells, compared with the joints of the job."""

    height_m: float = key("above the table's zero")
    step_mm: float = key("of the radius: above less below")
    nearest_m: float | None = key("height of the nearest joint of the job; null: it has none")


class WeldSeen(Saved):
    """A narrow valley or ridge over a course, such as a vertical weld."""

    course: str = key("name")
    azimuth_deg: float = key("clockwise from +y")
    depth_mm: float = key("of the wall beside it, inwards positive")


class SharedPart(Saved):
    """The uncertainty of the top of the table with and without the common errors of points."""

    u_m3: float = key("standard uncertainty, as in the table")
    U_m3: float = key("expanded uncertainty, k by its degrees of freedom")
    shared_u_m3: float = key("of offset, scale, bias by incidence and registration together")
    without_u_m3: float = key("of all other inputs")
    without_U_m3: float = key("expanded, of all other inputs, k by their degrees of freedom")


class CloudMap(Saved):
    """The unrolled wall: mean deviations of coarse cells, for papers and the web page."""

    height_edges_m: list[Finite] = key(
        "edges of the rows, from below, above the table's zero; of a horizontal tank along its axis"
    )
    azimuth_edges_deg: list[Finite] = key("edges of the columns, from 0 to 360, clockwise")
    departure_tenths_mm: list[list[int | None]] = key(
        "rows x columns: outwards from the mean of its course, 0.1 mm; null: hidden from all scans"
    )
    cells: int = key("number of cells before merging: rows x columns")


class ThingSeen(Saved):
    """An object in the tank: a proposed row of deadwood.csv, deducted only if confirmed."""

    name: str = key("proposed, unique in the job")
    kind: str = key('"column", "box", "level surface" or "pit"')
    bottom_m: float = key("dip of its lowest point, above the table's zero")
    top_m: float = key("of its highest")
    volume_m3: float | None = key("negative: an object; positive: a pit; null: not determined")
    u_m3: float | None = key("standard uncertainty of the volume")
    box_m3: float | None = key("volume of the box round its points; null: a pit")
    points: int | None = key("of the object; null: a pit")
    confirmed: bool = key("whether deadwood.csv has a row of that name")


class InsideSeen(Saved):
    """The bottom in scans from inside, and objects on it."""

    seen_share: float = key("share of the plan that shows the bottom")
    cell_m: float = key("side of a cell of the plan")
    cells: int = key("that show the bottom")
    points: int = key("heights that determine its surface, means of cells")
    scatter_mm: float = key("standard deviation of the height of a cell, from its neighbours")
    mirrored: int = key("points below the bottom that are mirror images; many on a wet bottom")
    roof_share: float | None = key("share of the plan that shows a roof; null: no roof")
    roof_low_m: float | None = key(
        "above the table's zero: 5 % of the points of the roof lie lower"
    )
    roof_high_m: float | None = key(
        "above the table's zero: 5 % of the points of the roof lie higher"
    )
    things: list[ThingSeen] = key("objects in the tank, then pits")


class CloudsRecord(Saved):
    """Clouds of the wall, and their common errors."""

    files: list[CloudFileRead] = key("in the order of clouds.toml")
    scans: list[ScanRegistered] = key("in the order of the files")
    scanners: list[ScannerDeclared] = key("by name")
    targets: list[ScanTargetUsed] = key("in the order of scan_targets.csv")
    registration_dof: int = key("redundancy of the registration")
    registration_chi2: float = key("weighted sum of squares of its residuals")
    overlaps: list[ScansCompared] = key("of scans on one side of the wall")
    courses: list[CourseSeen] = key("from the bottom up")
    obstructions: list[ObstructionSeen] = key("in the cells")
    joints: list[JointSeen] = key("steps of the radius; upright tanks")
    welds: list[WeldSeen] = key("in the cells")
    shared: list[SharedByHits] = key("offsets and scales, before and after the wall; upright tanks")
    shared_part: SharedPart = key("of U at the top of the table")
    map: CloudMap = key("the wall unrolled")
    inside: InsideSeen | None = key(
        "bottom and objects; left out if the bottom is not taken from the scans",
        default=None,
        optional=True,
    )


def save_clouds(result):
    """`CloudsRecord` of a result."""
    from tankcal.methods.clouds.overlaps import overlaps_of

    clouded, clouds = result.clouded, result.job.clouds
    cells, registration = clouded.cells, clouded.registration
    zero_m = _zero_m(result)
    certificates = {name: tool.certificate for name, tool in clouds.ranging.items()}
    return CloudsRecord(
        files=_files(clouds, clouded),
        scans=_scans(result),
        scanners=[_scanner(name, *declaration) for name, declaration in clouds.tools.items()],
        targets=[
            ScanTargetUsed(
                scan=residual.scan,
                target=residual.target,
                residual_m=residual.residual_m.tolist(),
                w=residual.w if np.isfinite(residual.w) else None,
                mdb_m=residual.mdb_m if np.isfinite(residual.mdb_m) else None,
                removed=residual.removed,
                row=residual.row,
            )
            for residual in registration.residuals
        ],
        registration_dof=registration.dof,
        registration_chi2=registration.chi2,
        overlaps=[
            ScansCompared(
                one=clouds.scans[overlap.scans[0]].name,
                other=clouds.scans[overlap.scans[1]].name,
                cells=overlap.cells,
                mean_mm=1000 * overlap.mean_m,
                apart_mm=1000 * overlap.apart_m,
                w=overlap.w,
            )
            for overlap in overlaps_of(result.job, cells, registration)
        ],
        courses=[
            CourseSeen(course=_course_name(result.job, index), masked=float(share))
            for index, share in enumerate(cells.masked_share)
        ],
        obstructions=[_obstruction(obstruction, zero_m) for obstruction in cells.obstructions],
        joints=[
            JointSeen(
                height_m=joint.height_m - zero_m,
                step_mm=1000 * joint.step_m,
                nearest_m=joint.nearest_m - zero_m if np.isfinite(joint.nearest_m) else None,
            )
            for joint in cells.joints
        ],
        welds=[
            WeldSeen(
                course=_course_name(result.job, weld.course),
                azimuth_deg=float(np.degrees(weld.azimuth_rad)),
                depth_mm=1000 * weld.depth_m,
            )
            for weld in cells.welds
        ],
        shared=shared_of(clouded.estimates, certificates, clouded.beamed.estimated_m),
        shared_part=shared_part_of(result.table),
        map=_map(cells, zero_m),
        inside=_inside(result, zero_m),
    )


def _files(clouds, clouded):
    """`CloudFileRead` of each file, with the sums over its scans."""
    rows, cells = [], clouded.cells
    for file, hashed in zip(clouds.files, clouded.files, strict=True):
        scans = slice(file.first, file.first + len(file.header.scans))
        counts = [scan.declared for scan in file.header.scans]
        rows.append(
            CloudFileRead(
                cloud=file.name,
                file=file.file,
                format=file.header.format,
                sha256=hashed.sha256,
                bytes=hashed.bytes,
                unit_m=file.unit_m,
                scans=len(counts),
                declared=None if None in counts else sum(counts),
                delivered=int(cells.delivered[scans].sum()),
                left_out=int(clouded.left_out[scans].sum()),
                of_wall=int(cells.of_wall[scans].sum()),
            )
        )
    return rows


def _scans(result):
    """`ScanRegistered` of each scan."""
    clouded, clouds = result.clouded, result.job.clouds
    registration, cells = clouded.registration, clouded.cells
    targets = Counter(residual.scan for residual in registration.residuals if not residual.removed)
    readings = np.bincount(clouded.readings.scan, minlength=len(clouds.scans))
    rows = []
    for index, scan in enumerate(registration.scans):
        s_translation_m, s_rotation_rad = registration.sd_of(index)
        x_m, y_m, z_m = registration.place_m[index].tolist()
        rows.append(
            ScanRegistered(
                scan=scan.name,
                scanner=scan.scanner,
                side=clouds.sides[index],
                surface=scan.surface,
                tie=registration.ties[index],
                is_assumed=scan.is_assumed and registration.ties[index] != "network",
                x_m=x_m,
                y_m=y_m,
                z_m=z_m,
                s_translation_mm=1000 * s_translation_m,
                s_rotation_arcsec=s_rotation_rad / ARCSEC,
                targets=targets[scan.name],
                delivered=int(cells.delivered[index]),
                left_out=int(clouded.left_out[index]),
                outside=int(cells.outside[index]),
                beyond=int(cells.beyond[index]),
                of_wall=int(cells.of_wall[index]),
                readings=int(readings[index]),
            )
        )
    return rows


def _scanner(name, tool, offset_is_assumed, scale_is_assumed):
    return ScannerDeclared(
        scanner=name,
        certificate=tool.certificate,
        offset_mm=1000 * tool.correction_m,
        u_offset_mm=None if np.isnan(tool.u_offset_m) else 1000 * tool.u_offset_m,
        offset_is_assumed=offset_is_assumed,
        scale_ppm=1e6 * tool.correction,
        u_scale_ppm=1e6 * tool.u_scale,
        scale_is_assumed=scale_is_assumed,
        u_incidence_mm=1000 * tool.u_incidence_m,
    )


def _course_name(job, index):
    """Name of a course; a tank without courses has numbered parts."""
    return job.courses[index].name if index < len(job.courses) else str(index + 1)


def _obstruction(obstruction, zero_m):
    low_m, high_m = np.array(obstruction.height_m) - zero_m
    near_m, far_m = (float(d) if np.isfinite(d) else None for d in obstruction.distance_m)
    return ObstructionSeen(
        guess=obstruction.guess,
        azimuth_from_deg=float(np.degrees(obstruction.azimuth_rad[0])),
        azimuth_to_deg=float(np.degrees(obstruction.azimuth_rad[1])),
        bottom_m=float(low_m),
        top_m=float(high_m),
        near_m=near_m,
        far_m=far_m,
    )


def _zero_m(result):
    """Height of the table's zero in the frame of the cells; 0 for a horizontal tank (axis)."""
    kind, surface = result.job.tank.kind, result.clouded.cells.surface
    if kind == "sphere":  # the lowest point of the inside
        return surface.centre_m[2] - surface.radius_m
    if kind != "vertical":
        return 0.0
    return (result.job.datum.bottom_z_m or 0.0) + result.zero_m


def shared_part_of(table):
    """`SharedPart` of the top row of a capacity table.

    A source of correlated inputs ("a & b") is shared if one of these inputs is shared.
    """
    shared, others = [], []
    for source in table.sources:
        is_shared = not SHARED.isdisjoint(source.kind.split(" & "))
        (shared if is_shared else others).append(source)
    shared, others = (replace(table, sources=tuple(part)) for part in (shared, others))
    return SharedPart(
        u_m3=float(table.u_m3[-1]),
        U_m3=float(table.U_m3[-1]),
        shared_u_m3=float(shared.u_m3[-1]),
        without_u_m3=float(others.u_m3[-1]),
        without_U_m3=float(others.U_m3[-1]),
    )


def _map(cells, zero_m):
    """`CloudMap` of the cells of a wall, with heights above the table's zero."""
    from tankcal.clouds.wall.cells import unroll_wall

    wall = unroll_wall(cells)
    rows = zip(wall.departure_tenths_mm.tolist(), wall.is_shown.tolist(), strict=True)
    return CloudMap(
        height_edges_m=(wall.height_edges_m - zero_m).tolist(),
        azimuth_edges_deg=wall.azimuth_edges_deg.tolist(),
        departure_tenths_mm=[
            [tenths if is_shown else None for tenths, is_shown in zip(*row, strict=True)]
            for row in rows
        ],
        cells=cells.grid.rows * cells.grid.columns,
    )


def _inside(result, zero_m):
    """`InsideSeen` of a result whose bottom comes from its clouds, else None."""
    inside = result.clouded.inside
    if inside is None:
        return None
    bottom, roof = inside.bottom, inside.bottom.roof
    return InsideSeen(
        seen_share=bottom.seen_share,
        cell_m=bottom.grid.cell_m,
        cells=int(np.count_nonzero(bottom.is_bottom & bottom.in_plan)),
        points=len(inside.points.xyz_m),
        scatter_mm=1000 * bottom.scatter_m,
        mirrored=bottom.mirrored,
        roof_share=roof and roof.share,
        roof_low_m=roof and roof.low_m - zero_m,
        roof_high_m=roof and roof.high_m - zero_m,
        things=_deadwood_entries(inside, {item.name for item in result.job.deadwood}, zero_m),
    )


def _deadwood_entries(inside, declared_names, zero_m):
    """`ThingSeen` of each proposed row of deadwood.csv."""
    from tankcal.methods.clouds.bottom import deadwood_rows

    return [
        ThingSeen(
            name=name,
            kind=proposal.kind,
            bottom_m=bottom_m,
            top_m=top_m,
            volume_m3=volume_m3 if np.isfinite(volume_m3) else None,
            u_m3=u_m3 if np.isfinite(u_m3) else None,
            box_m3=proposal.box_m3,
            points=proposal.points,
            confirmed=name in declared_names,
        )
        for proposal, (name, bottom_m, top_m, volume_m3, u_m3) in zip(
            inside.proposals, deadwood_rows(inside, zero_m), strict=True
        )
    ]
