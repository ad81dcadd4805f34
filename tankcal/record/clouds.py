"""The part of the record that says what clouds showed: files, scans, what hides the wall."""

from dataclasses import replace

import numpy as np

from tankcal.record.cloud_inside import InsideSeen, inside_of
from tankcal.record.cloud_map import CloudMap, map_of
from tankcal.record.ranging import SharedByHits, shared_of
from tankcal.record.schema import Finite, Saved, key

ARCSEC = np.pi / 180 / 3600
SHARED = {"instrument_offset", "instrument_scale", "incidence", "registration"}  # kinds of inputs


class CloudFileRead(Saved):
    """A file of a scanner: read in place, never copied."""

    cloud: str = key("section of clouds.toml")
    file: str = key("as it is named there")
    format: str = key('"las", "laz", "e57", "ply", "ptx", "pts" or "xyz"')
    sha256: str = key("of the whole file")
    bytes: int = key("of the file")
    unit_m: float = key("metres of one unit of its coordinates")
    scans: int = key("in the file")
    declared: int | None = key("points that its header says it holds; null: it does not say")
    delivered: int = key("points with a return, outside of the boxes that are left out")
    left_out: int = key("points in those boxes")
    of_wall: int = key("of those delivered, points that means of the wall were taken from")


class ScanRegistered(Saved):
    """A scan, and how well its pose is known."""

    scan: str = key("name")
    scanner: str = key("name")
    side: str = key('"inside" or "outside": where the scanner stood')
    surface: str = key('that it saw; "": all the same')
    tie: str = key('"network" (targets), "frame" (it is the frame itself) or "declared"')
    is_assumed: bool = key("whether its standard deviations are assumed")
    x_m: Finite = key("where the scanner stood, in the frame of the tank")
    y_m: Finite = key("the same")
    z_m: Finite = key("the same")
    s_translation_mm: float = key("standard deviation along an axis, root of the mean variance")
    s_rotation_arcsec: float = key("the same about an axis")
    targets: int = key("that its pose was taken from")
    delivered: int = key("points with a return, outside of the boxes that are left out")
    left_out: int = key("points in those boxes")
    outside: int = key("of those delivered, points above, below or far from the wall")
    beyond: int = key("of those delivered, points near it, but further than its band")
    of_wall: int = key("of those delivered, points that means of the wall were taken from")
    readings: int = key("means of cells that the wall was taken from")


class ScannerDeclared(Saved):
    """What all points of a scanner share, as declared or assumed."""

    scanner: str = key("name")
    certificate: str = key('its number; "": not given')
    offset_mm: float = key("added to each distance")
    u_offset_mm: float | None = key("its standard uncertainty; null: free, the wall told it")
    offset_is_assumed: bool = key("whether nobody declared it")
    scale_ppm: float = key("true = reading (1 + scale)")
    u_scale_ppm: float = key("its standard uncertainty")
    scale_is_assumed: bool = key("whether nobody declared it")
    u_incidence_mm: float = key("standard uncertainty of the bias at 60 degrees of incidence")


class ScanTargetUsed(Saved):
    """A target as a scan shows it, against the adjusted registration."""

    scan: str = key("name")
    target: str = key("name")
    residual_m: list[float] = key("x, y, z: by the pose less adjusted, in the frame of the tank")
    w: float | None = key("of the worst of them; null: nothing checks it")
    mdb_m: float | None = key("smallest blunder that the test shows; null: none")
    removed: bool = key("whether it was rejected")
    row: int | None = key("of scan_targets.csv")


class ScansCompared(Saved):
    """Two scans where both show the wall."""

    one: str = key("name")
    other: str = key("name")
    cells: int = key("that both show")
    mean_mm: float = key("by how much the other has the wall further out")
    apart_mm: float = key("what a shift between them explains of their differences")
    w: float = key("of that, against registration and scanners")


class CourseSeen(Saved):
    """How much of a course no scan shows."""

    course: str = key("name; of another tank its part")
    masked: float = key("share of its cells")


class ObstructionSeen(Saved):
    """Something that hides the wall: a proposed row of deadwood, without its volume."""

    guess: str = key('"pipe", "stairs", "ring", "nozzle" or "unseen"')
    azimuth_from_deg: float = key("clockwise from +y")
    azimuth_to_deg: float = key("the same; it may pass 360")
    bottom_m: float = key("height above the table's zero")
    top_m: float = key("the same")
    near_m: float | None = key("from the wall, outwards positive: 5 % of what is seen; null: none")
    far_m: float | None = key("the same: 95 %")


class JointSeen(Saved):
    """A step of the radius that the cells show, beside the joints of the job."""

    height_m: float = key("above the table's zero")
    step_mm: float = key("of the radius: above less below")
    nearest_m: float | None = key("height of the nearest joint of the job; null: it has none")


class WeldSeen(Saved):
    """A narrow valley or ridge over a course, such as a vertical weld."""

    course: str = key("name")
    azimuth_deg: float = key("clockwise from +y")
    depth_mm: float = key("of the wall beside it, inwards positive")


class SharedPart(Saved):
    """The uncertainty of the top of the table with and without what points have in common."""

    u_m3: float = key("standard uncertainty, as in the table")
    U_m3: float = key("expanded uncertainty, k by its degrees of freedom")
    shared_u_m3: float = key("of offset, scale, bias by incidence and registration together")
    without_u_m3: float = key("of all others")
    without_U_m3: float = key("the same expanded, by a k of their own")


class CloudsRecord(Saved):
    """Clouds of the wall, and what they share."""

    files: list[CloudFileRead] = key("in the order of clouds.toml")
    scans: list[ScanRegistered] = key("in the order of the files")
    scanners: list[ScannerDeclared] = key("by name")
    targets: list[ScanTargetUsed] = key("in the order of scan_targets.csv")
    registration_dof: int = key("redundancy of the registration")
    registration_chi2: float = key("weighted sum of squares of its residuals")
    overlaps: list[ScansCompared] = key("of scans on one side of the wall")
    courses: list[CourseSeen] = key("from the bottom up")
    obstructions: list[ObstructionSeen] = key("as the cells show them")
    joints: list[JointSeen] = key("steps of the radius that were found; upright tanks")
    welds: list[WeldSeen] = key("that were found")
    shared: list[SharedByHits] = key("offsets and scales, before and after the wall; upright tanks")
    shared_part: SharedPart = key("of U at the top of the table")
    map: CloudMap = key("the wall unrolled")
    inside: InsideSeen | None = key(
        "bottom and things; left out where the bottom is not taken from the scans",
        default=None,
        optional=True,
    )


def clouds_of(result):
    """`CloudsRecord` of a result; None where the wall was not scanned."""
    clouded, clouds = result.clouded, result.job.clouds
    if clouded is None:
        return None
    from tankcal.pipeline.cloud_overlaps import overlaps_of

    certificates = {name: tool.certificate for name, tool in clouds.ranging.items()}
    return CloudsRecord(
        files=_files(clouds, clouded),
        scans=_scans(result),
        scanners=[_scanner(name, given) for name, given in clouds.tools.items()],
        targets=[_target(one) for one in clouded.registration.residuals],
        registration_dof=clouded.registration.dof,
        registration_chi2=clouded.registration.chi2,
        overlaps=[
            ScansCompared(
                one=clouds.scans[one.scans[0]].name,
                other=clouds.scans[one.scans[1]].name,
                cells=one.cells,
                mean_mm=1000 * one.mean_m,
                apart_mm=1000 * one.apart_m,
                w=one.w,
            )
            for one in overlaps_of(result.job, clouded.cells, clouded.registration)
        ],
        courses=[
            CourseSeen(course=_course(result.job, place), masked=float(share))
            for place, share in enumerate(clouded.cells.masked_share)
        ],
        obstructions=[_obstruction(one, result) for one in clouded.cells.obstructions],
        joints=[_joint(one, result) for one in clouded.cells.joints],
        welds=[
            WeldSeen(
                course=_course(result.job, one.course),
                azimuth_deg=float(np.degrees(one.azimuth_rad)),
                depth_mm=1000 * one.depth_m,
            )
            for one in clouded.cells.welds
        ],
        shared=shared_of(clouded.told, certificates, clouded.beamed.told_m),
        shared_part=shared_part_of(result.table),
        map=map_of(clouded.cells, _zero_m(result)),
        inside=inside_of(result, _zero_m(result)),
    )


def _files(clouds, clouded):
    found, cells = [], clouded.cells
    for file, hashed in zip(clouds.files, clouded.files, strict=True):
        mine = slice(file.first, file.first + len(file.header.scans))
        counts = [one.declared for one in file.header.scans]
        found.append(
            CloudFileRead(
                cloud=file.name,
                file=file.file,
                format=file.header.format,
                sha256=hashed.sha256,
                bytes=hashed.bytes,
                unit_m=file.unit_m,
                scans=len(counts),
                declared=None if None in counts else sum(counts),
                delivered=int(cells.delivered[mine].sum()),
                left_out=int(clouded.left_out[mine].sum()),
                of_wall=int(cells.of_wall[mine].sum()),
            )
        )
    return found


def _scans(result):
    clouded, clouds = result.clouded, result.job.clouds
    registration, cells = clouded.registration, clouded.cells
    tied = {}
    for one in registration.residuals:
        tied[one.scan] = tied.get(one.scan, 0) + (not one.removed)
    readings = np.bincount(clouded.readings.scan, minlength=len(clouds.scans))
    found = []
    for place, one in enumerate(registration.scans):
        translation, rotation = registration.sd_of(place)
        found.append(
            ScanRegistered(
                scan=one.name,
                scanner=one.scanner,
                side=clouds.sides[place],
                surface=one.surface,
                tie=registration.ties[place],
                is_assumed=one.is_assumed and registration.ties[place] != "network",
                **dict(
                    zip(("x_m", "y_m", "z_m"), registration.place_m[place].tolist(), strict=True)
                ),
                s_translation_mm=1000 * translation,
                s_rotation_arcsec=rotation / ARCSEC,
                targets=tied.get(one.name, 0),
                delivered=int(cells.delivered[place]),
                left_out=int(clouded.left_out[place]),
                outside=int(cells.outside[place]),
                beyond=int(cells.beyond[place]),
                of_wall=int(cells.of_wall[place]),
                readings=int(readings[place]),
            )
        )
    return found


def _scanner(name, given):
    tool, offset, scale = given
    return ScannerDeclared(
        scanner=name,
        certificate=tool.certificate,
        offset_mm=1000 * tool.correction_m,
        u_offset_mm=None if np.isnan(tool.u_offset_m) else 1000 * tool.u_offset_m,
        offset_is_assumed=offset,
        scale_ppm=1e6 * tool.correction,
        u_scale_ppm=1e6 * tool.u_scale,
        scale_is_assumed=scale,
        u_incidence_mm=1000 * tool.u_incidence_m,
    )


def _target(one):
    return ScanTargetUsed(
        scan=one.scan,
        target=one.target,
        residual_m=one.residual_m.tolist(),
        w=one.w if np.isfinite(one.w) else None,
        mdb_m=one.mdb_m if np.isfinite(one.mdb_m) else None,
        removed=one.removed,
        row=one.row,
    )


def _course(job, place):
    return job.courses[place].name if place < len(job.courses) else str(place + 1)


def _obstruction(one, result):
    low, high = np.array(one.height_m) - _zero_m(result)
    near, far = (float(d) if np.isfinite(d) else None for d in one.distance_m)
    return ObstructionSeen(
        guess=one.guess,
        azimuth_from_deg=float(np.degrees(one.azimuth_rad[0])),
        azimuth_to_deg=float(np.degrees(one.azimuth_rad[1])),
        bottom_m=float(low),
        top_m=float(high),
        near_m=near,
        far_m=far,
    )


def _zero_m(result):
    """Height of the table's zero in the frame of the cells; of lying tanks 0, along the axis."""
    kind, surface = result.job.tank.kind, result.clouded.cells.surface
    if kind == "sphere":  # the lowest point of the inside
        return surface.centre_m[2] - surface.radius_m
    if kind != "vertical":
        return 0.0
    return (result.job.datum.bottom_z_m or 0.0) + result.zero_m


def _joint(one, result):
    low = _zero_m(result)
    return JointSeen(
        height_m=one.height_m - low,
        step_mm=1000 * one.step_m,
        nearest_m=one.nearest_m - low if np.isfinite(one.nearest_m) else None,
    )


def shared_part_of(table):
    """`SharedPart` of the top row of a capacity table.

    Inputs that were found together ("a & b") count as shared where one of them is.
    """
    shared, others = [], []
    for source in table.sources:
        is_shared = not SHARED.isdisjoint(source.kind.split(" & "))
        (shared if is_shared else others).append(source)
    shared, others = (replace(table, sources=tuple(one)) for one in (shared, others))
    return SharedPart(
        u_m3=float(table.u_m3[-1]),
        U_m3=float(table.U_m3[-1]),
        shared_u_m3=float(shared.u_m3[-1]),
        without_u_m3=float(others.u_m3[-1]),
        without_U_m3=float(others.U_m3[-1]),
    )
