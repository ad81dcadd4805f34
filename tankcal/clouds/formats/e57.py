"""E57 (ASTM E2807): header and XML checked here, points by libe57 in a child."""

import math
import struct
from dataclasses import dataclass, field

import numpy as np

from tankcal.clouds.contents import WHOLE, CloudPiece, ScanHeader
from tankcal.clouds.formats.e57_xml import parse_xml
from tankcal.clouds.formats.files import Piece, cut_short, no_points, require_library
from tankcal.clouds.formats.isolation import decoded_frames
from tankcal.messages import message

HEADER = struct.Struct("<8sIIQQQQ")  # signature, version, length, place and length of XML, page
PAGE, DATA = 1024, 1020  # bytes of a page, and of it what is no checksum
LONGEST_XML = 1 << 26
SECTION = struct.Struct("<B7xQQQ")  # of points: id, length, places of data and of index
CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
LARGEST = 1 << 63
UNIT_QUATERNION = 1e-3  # from 1, of the length of a quaternion


@dataclass
class _Scan:
    """One Data3D: what is needed to read it, and what is wrong with it."""

    header: ScanHeader
    fields: tuple[str, ...] = ()
    state: str = ""
    type: str = "d"
    problems: list = field(default_factory=list)


def describe(file):
    """The scans of a file; InputError with every problem of its XML."""
    scans = read_scans(file)
    return "e57", tuple(scan.header for scan in scans)


def shares(file, points_each):
    """A scan each: libe57 cannot begin within one."""
    return tuple(
        CloudPiece(number) for number, scan in enumerate(read_scans(file)) if scan.header.declared
    )


def pieces(file, chunk, share=WHOLE):
    """The points of a share of a file as `Piece`s."""
    scans = read_scans(file)
    request = {
        "kind": "e57",
        "path": str(file.path),
        "chunk": chunk,
        "scans": [
            {
                "count": scan.header.declared if share.scan in (None, number) else 0,
                "fields": scan.fields,
                "state": scan.state,
                "type": scan.type,
                "is_spherical": scan.fields == SPHERICAL,
            }
            for number, scan in enumerate(scans)
        ],
    }
    for frame in decoded_frames(file, request):
        columns = frame.data.view(scans[frame.scan].type).reshape(3, -1)
        yield Piece(frame.scan, columns.T, frame.read)


def read_scans(file):
    """A `_Scan` of each Data3D, all of them sound."""
    root = parse_xml(file, _xml_of(file))
    nodes = root.child("data3D").children
    scans = [_scan_of(file, number, node) for number, node in enumerate(nodes, start=1)]
    problems = [problem for scan in scans for problem in scan.problems]
    if problems:
        raise file.refusal(*problems)
    if not sum(scan.header.declared for scan in scans):
        raise no_points(file)
    require_library(file, "pye57")
    return scans


def _xml_of(file):
    """The bytes of the XML, its checksums left out; InputError for a header that is not sound."""
    if len(file.start) < HEADER.size:
        header = message("cloud_file_e57_header", "the header")
        raise file.refusal(cut_short(file, header, HEADER.size, file.bytes))
    _, major, _, length, place, size, page = HEADER.unpack_from(file.start)
    problems = []
    if major != 1 or page != PAGE:
        problems.append(
            message(
                "cloud_file_e57_version",
                "E57 of version {major} with pages of {page} bytes; expected version 1, 1024 bytes",
                major=major,
                page=page,
            )
        )
    if length != file.bytes or file.bytes % PAGE:
        problems.append(
            message(
                "cloud_file_e57_length",
                "should be {declared} bytes long and is {found}; expected whole pages of 1024: is "
                "it cut or damaged?",
                declared=length,
                found=file.bytes,
            )
        )
    first, end = _logical(place), _logical(place) + size
    room = file.bytes // PAGE * DATA
    if place % PAGE >= DATA or place < HEADER.size or end > room or not 0 < size <= LONGEST_XML:
        problems.append(
            message(
                "cloud_file_e57_xml",
                "its XML would be {size} bytes from byte {place} on, in a file of {there} bytes; "
                "expected it inside, at most {most} bytes",
                size=size,
                place=place,
                there=file.bytes,
                most=LONGEST_XML,
            )
        )
    if problems:
        raise file.refusal(*problems)
    return _read_logical(file, first, size)


def _logical(place):
    return place // PAGE * DATA + place % PAGE


def _read_logical(file, first, size):
    """Bytes from a logical place on, pages without their checksums."""
    page = first // DATA
    with file.path.open("rb") as stream:
        stream.seek(page * PAGE)
        pages = stream.read(((first + size - 1) // DATA - page + 1) * PAGE)
    data = b"".join(pages[i : i + DATA] for i in range(0, len(pages), PAGE))
    return data[first - page * DATA :][:size]


def _scan_of(file, number, node):
    """The `_Scan` of a node of data3D."""
    points = node.child("points")
    prototype, problems = points.child("prototype"), []
    count = points.whole("recordCount", -1)
    names = {one.name: one for one in prototype.children}
    is_cartesian = {*CARTESIAN} <= {*names}
    fields = CARTESIAN if is_cartesian else SPHERICAL
    state = "cartesianInvalidState" if is_cartesian else "sphericalInvalidState"
    if not {*fields} <= {*names}:
        problems.append(
            message(
                "cloud_file_e57_fields",
                "scan {number} has neither cartesian nor spherical coordinates",
                number=number,
            )
        )
        return _Scan(ScanHeader("", 0), problems=problems)
    bits = [_bits(names[name]) for name in names]
    problems += _count_problems(file, number, points, count, bits)
    problems += _field_problems(number, [names[name] for name in fields])
    pose, warning, is_placed = _pose(number, node, problems), None, False
    if pose is not None and not pose[:3, :3].any():
        pose, warning, is_placed = None, _no_rotation(number), bool(pose[:3, 3].any())
    singles = all(names[name].is_single for name in fields)
    return _Scan(
        ScanHeader(node.child("name").text.strip()[:200], max(count, 0), pose, warning, is_placed),
        fields,
        state if state in names else "",
        "f" if singles and is_cartesian else "d",
        problems,
    )


def _bits(node):
    """Bits of one record of a field, as the standard packs it."""
    if node.kind == "Float":
        return 32 if node.is_single else 64
    if node.kind in ("Integer", "ScaledInteger"):
        low, high = node.whole("minimum", -LARGEST), node.whole("maximum", LARGEST - 1)
        return max(high - low, 0).bit_length()
    return 8  # a text: its length at least


def _count_problems(file, number, points, count, bits):
    place = points.whole("fileOffset", -1)
    is_inside = HEADER.size <= place <= file.bytes - SECTION.size and place % PAGE < DATA
    if is_inside:
        section = _read_logical(file, _logical(place), SECTION.size)
        kind, length, data, _ = SECTION.unpack(section.ljust(SECTION.size, b"\0"))
        is_inside = kind == 1 and _logical(place) + length <= file.bytes // PAGE * DATA
        is_inside = is_inside and place < data <= file.bytes
    if not is_inside and count:
        yield message(
            "cloud_file_e57_place",
            "the points of scan {number} would begin at byte {place} of {size}, and do not: "
            "damaged",
            number=number,
            place=place,
            size=file.bytes,
        )
    if count < 0 or count * max(sum(bits), 1) > 8 * file.bytes:
        yield message(
            "cloud_file_e57_count",
            "scan {number} declares {declared} points of {bits} bits; a file of {size} bytes has "
            "no room for them: damaged",
            number=number,
            declared=count,
            bits=sum(bits),
            size=file.bytes,
        )


def _field_problems(number, nodes):
    for node in nodes:
        if node.kind not in ("Float", "Integer", "ScaledInteger"):
            is_sound = False
        elif node.kind == "ScaledInteger":
            scale, offset = node.real("scale", 1.0), node.real("offset", 0.0)
            is_sound = 0 < scale <= 1 and math.isfinite(offset)
        else:
            is_sound = True
        if not is_sound:
            yield message(
                "cloud_file_e57_scale",
                "scan {number}, {name}: expected numbers, with a finite offset and a scale above 0 "
                "and at most 1",
                number=number,
                name=node.name[:40],
            )


def _pose(number, node, problems):
    """(4, 4) of the rotation (a quaternion w, x, y, z) and translation; None: no pose.

    The rotation is zero for a quaternion of zeros.
    """
    pose = node.find("pose")
    if pose is None:
        return None
    turn, shift = pose.find("rotation"), pose.find("translation")
    w, x, y, z = (turn.number_of(name) for name in "wxyz") if turn else (1.0, 0.0, 0.0, 0.0)
    found = np.eye(4)
    found[:3, 3] = [shift.number_of(name) for name in "xyz"] if shift else 0.0
    if w == x == y == z == 0 and np.isfinite(found).all():
        found[:3, :3] = 0.0
        return found
    length = math.sqrt(w * w + x * x + y * y + z * z) if max(map(abs, (w, x, y, z))) < 2 else 0.0
    if not (abs(length - 1) <= UNIT_QUATERNION and np.isfinite(found).all()):
        problems.append(
            message(
                "cloud_file_e57_pose",
                "scan {number}: expected a pose of a quaternion of length 1 and a finite "
                "translation",
                number=number,
            )
        )
        return None
    w, x, y, z = (value / length for value in (w, x, y, z))
    found[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return found


def _no_rotation(number):
    """Warning about a quaternion of zeros, which some programs write where they have no rotation.

    Older versions of libE57Format and pye57 do so; CloudCompare reads such a file without its pose.
    """
    return message(
        "cloud_file_e57_zero_pose",
        "the rotation of scan {number} is a quaternion of zeros: read without a pose; if the scan"
        " has one, give it as four rows of four numbers",
        number=number,
    )
