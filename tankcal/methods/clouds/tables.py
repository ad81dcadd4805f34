"""Point clouds in the documents: the fact of the certificate, and the tables."""

from dataclasses import replace

from tankcal.report.tables import table
from tankcal.report.tables.table import Column, Table
from tankcal.text.digits import LITRE_DECIMALS


def _scan_sentence(paper, row):
    """Return a sentence on the point clouds with their numbers of points, or None."""
    clouds = paper.record.get("clouds")
    if not clouds:
        return None
    scans = clouds["scans"]
    return paper.word(
        "texts.cloud_method",
        scans=len(scans),
        files=len(clouds["files"]),
        wall=sum(scan["of_wall"] for scan in scans),
        read=sum(scan["delivered"] for scan in scans),
        means=sum(scan["readings"] for scan in scans),
    )


FACTS = (Column("scanned", text=_scan_sentence, sheet=True),)


def _column(key, heading, unit="", decimals=None, **more):
    """Return a column with equal headings in paper and workbook; the workbook adds the unit."""
    return Column(key, unit, decimals=decimals, heading=f"cloud_{heading}", sheet=True, **more)


def _count(key, **more):
    return _column(key, key, decimals=0, **more)


_SCAN = _column("scan", "scan", width=10)
_W = Column("w", decimals=2, heading="tangent_w", sheet="tangent_w")
_COURSE = Column("course", sheet="course", width=9)

FILES = Table(
    "cloud_files",
    (
        _column("cloud", "name", width=10),
        Column("file", sheet="file", width=24),
        _column("format", "format", width=9),
        Column("bytes", decimals=0, sheet="bytes"),
        *map(_count, ("scans", "declared", "delivered", "left_out", "of_wall")),
    ),
    rows=lambda record: record["clouds"]["files"],
)  # fmt: skip

SCANS = Table(
    "cloud_scans",
    (
        _SCAN,
        _column("scanner", "scanner", width=14),
        _column("side", "side", words="sides", width=14),
        _column("tie", "tie", words="ties_of_scans", width=12),
        *(Column(f"{axis}_m", "m", decimals=3, heading=f"hit_{axis}", sheet=f"hit_{axis}_m")
          for axis in "xyz"),
        _column("s_translation_mm", "s_translation", "image mm", 2),
        _column("s_rotation_arcsec", "s_rotation", "arcsec", 1),
        _count("targets"),
    ),
    rows=lambda record: [
        scan | {"tie": "assumed" if scan["is_assumed"] else scan["tie"]}
        for scan in record["clouds"]["scans"]
    ],
)  # fmt: skip

POINTS = Table(
    "cloud_points",
    (
        _SCAN,
        *map(_count, ("left_out", "delivered", "outside", "beyond", "of_wall", "readings")),
    ),
    rows=lambda record: record["clouds"]["scans"],
)


def _scanners(record):
    return [
        {
            **scanner,
            "certificate": scanner["certificate"] or None,
            "offset_from": _origin(
                scanner, scanner["u_offset_mm"] is None, scanner["offset_is_assumed"]
            ),
            "scale_from": _origin(scanner, False, scanner["scale_is_assumed"]),
        }
        for scanner in record["clouds"]["scanners"]
    ]


def _origin(scanner, is_free, is_assumed):
    """Return the code of the source of an offset or a scale."""
    if is_free:
        return "free"
    return "assumed" if is_assumed else "certificate" if scanner["certificate"] else "declared"


SCANNERS = Table(
    "cloud_scanners",
    (
        _column("scanner", "scanner", width=14),
        Column("certificate", heading="tape_certificate", sheet="tape_certificate", width=14),
        _column("offset_mm", "offset", "image mm", 2),
        _column("u_offset_mm", "u_offset", "image mm", 2),
        _column("offset_from", "offset_from", words="origins", width=14),
        _column("scale_ppm", "scale", "ppm", 1),
        _column("u_scale_ppm", "u_scale", "ppm", 1),
        _column("scale_from", "scale_from", words="origins", width=14),
        _column("u_incidence_mm", "u_incidence", "image mm", 2),
    ),
    rows=_scanners,
)

SHARED = replace(
    table.SHARED.but(
        instrument={"heading": "cloud_scanner", "sheet": True},
        what={"heading": "cloud_what_shared", "sheet": True},
    ),
    name="cloud_shared",
    rows=lambda record: [
        {**error, "certificate": error["certificate"] or None}
        for error in record["clouds"]["shared"]
    ],
)

TARGETS = Table(
    "cloud_targets",
    (
        _SCAN,
        _column("target", "target", width=10),
        *(_column(f"d{axis}", f"d{axis}", "mm", 2) for axis in "xyz"),
        _W,
        Column("mdb_m", "mm", decimals=1, heading="tangent_mdb", sheet="tangent_mdb_mm"),
        _column("removed", "removed", width=10),
        Column("row", decimals=0, heading="hit_row", sheet="hit_row", width=8),
    ),
    rows=lambda record: [
        target | dict(zip(("dx", "dy", "dz"), target["residual_m"], strict=True))
        for target in record["clouds"]["targets"]
    ],
)

OVERLAPS = Table(
    "cloud_overlaps",
    (
        _column("one", "one", width=10),
        _column("other", "other", width=10),
        _count("cells"),
        _column("mean_mm", "mean", "image mm", 2),
        _column("apart_mm", "apart", "image mm", 2),
        _W,
    ),
    rows=lambda record: record["clouds"]["overlaps"],
)

COURSES = Table(
    "cloud_courses",
    (_COURSE, _column("masked", "masked", "share", 1)),
    rows=lambda record: record["clouds"]["courses"],
)

OBSTRUCTIONS = Table(
    "cloud_obstructions",
    (
        _column("guess", "guess", words="obstructions", width=14),
        _column("azimuth_from_deg", "from", "deg", 1),
        _column("azimuth_to_deg", "to", "deg", 1),
        Column("bottom_m", "m", decimals=2, sheet="bottom_m"),
        Column("top_m", "m", decimals=2, sheet="top_m"),
        _column("near_m", "near", "m", 2),
        _column("far_m", "far", "m", 2),
    ),
    rows=lambda record: [
        thing | {"near_m": thing["far_m"], "far_m": thing["near_m"]}
        if thing["near_m"] is not None and abs(thing["near_m"]) > abs(thing["far_m"])
        else thing
        for thing in record["clouds"]["obstructions"]
    ],
)

JOINTS = Table(
    "cloud_joints",
    (
        _column("height_m", "height", "m", 3),
        _column("step_mm", "step", "image mm", 1),
        _column("nearest_m", "nearest", "m", 3, width=18),
    ),
    rows=lambda record: record["clouds"]["joints"],
)

WELDS = Table(
    "cloud_welds",
    (
        _COURSE,
        _column("azimuth_deg", "azimuth", "deg", 1),
        _column("depth_mm", "depth", "image mm", 1),
    ),
    rows=lambda record: record["clouds"]["welds"],
)


THINGS = Table(
    "cloud_things",
    (
        Column("name", heading="item", sheet="item", width=26),
        _column("kind", "kind", words="things", width=14),
        Column("bottom_m", "m", decimals=3, sheet="bottom_m"),
        Column("top_m", "m", decimals=3, sheet="top_m"),
        Column("volume_m3", "m3", u="u_m3", decimals=LITRE_DECIMALS + 1, sheet="volume_m3"),
        Column("u_m3", "m3", u="u_m3", decimals=LITRE_DECIMALS + 1, sheet="u_m3"),
        _column("box_m3", "box", "m3", LITRE_DECIMALS),
        _column("confirmed", "confirmed", width=12),
    ),
    rows=lambda record: (record["clouds"].get("inside") or {}).get("things", []),
)  # fmt: skip


def _share_of_U(record):
    part = record["clouds"]["shared_part"]
    return [
        {"what": "all", "u_m3": part["u_m3"], "U_m3": part["U_m3"]},
        {"what": "without", "u_m3": part["without_u_m3"], "U_m3": part["without_U_m3"]},
        {"what": "shared", "u_m3": part["shared_u_m3"], "U_m3": None},
    ]


SHARE_OF_U = Table(
    "cloud_share_of_U",
    (
        Column("what", words="parts_of_U", sheet="cloud_what", width=30, on=""),
        Column("u_m3", "m3", u="u_m3", sheet="standard_m3", on=""),
        Column("U_m3", "m3", u="U_m3", sheet="expanded_m3", on=""),
    ),
    rows=_share_of_U,
)

TABLES = (
    *(FILES, SCANS, POINTS, SCANNERS, SHARED, TARGETS, OVERLAPS, COURSES, OBSTRUCTIONS),
    *(JOINTS, WELDS, THINGS, SHARE_OF_U),
)
