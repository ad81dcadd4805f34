"""E57 (ASTM E2807): check of header and XML; libe57 reads the points in a child process."""

import math
import re
import struct
from dataclasses import dataclass, field
from xml.parsers import expat

import numpy as np

from tankcal.clouds.formats.files import (
    WHOLE,
    CloudPiece,
    Piece,
    ScanHeader,
    describe_cut,
    no_points,
    require_library,
)
from tankcal.clouds.formats.isolation import decode_frames
from tankcal.messages import message

HEADER = struct.Struct("<8sIIQQQQ")  # signature, version, length, place and length of XML, page
PAGE, DATA = 1024, 1020  # bytes of a page, and bytes of a page without its checksum
LONGEST_XML = 1 << 26  # bytes
SECTION = struct.Struct("<B7xQQQ")  # section of points: id, length, places of data and of index
CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
LARGEST = 1 << 63  # bound of an integer field without a declared range
UNIT_QUATERNION = 1e-3  # tolerance of the length of a quaternion, from 1
# Limits of the XML against harmful input
DEEPEST = 40  # largest depth of nested elements; files of scanners have about ten
MOST_ELEMENTS = 200_000  # largest number of elements
LONGEST_TEXT = 1000  # letters kept from the text of an element
NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")


@dataclass
class _Scan:
    """One Data3D node: header, fields to read (`state` marks invalid points), and problems."""

    header: ScanHeader
    fields: tuple[str, ...] = ()
    state: str = ""
    type: str = "d"
    problems: list = field(default_factory=list)


def describe(file):
    """Return format and scans of a file; raise InputError with all problems of its XML."""
    scans = read_scans(file)
    return "e57", tuple(scan.header for scan in scans)


def shares(file, points_each):
    """Divide a file into one piece per scan; libe57 cannot begin within a scan."""
    return tuple(
        CloudPiece(number) for number, scan in enumerate(read_scans(file)) if scan.header.declared
    )


def pieces(file, chunk, share=WHOLE):
    """Yield the points of a share of a file as `Piece` objects."""
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
    for frame in decode_frames(file, request):
        columns = frame.data.view(scans[frame.scan].type).reshape(3, -1)
        yield Piece(frame.scan, columns.T, frame.read)


def read_scans(file):
    """Read a `_Scan` from each Data3D node; raise InputError if any node is invalid."""
    root = _parse_xml(file, _read_xml(file))
    nodes = root.child("data3D").children
    scans = [_parse_scan(file, number, node) for number, node in enumerate(nodes, start=1)]
    problems = [problem for scan in scans for problem in scan.problems]
    if problems:
        raise file.refusal(*problems)
    if not sum(scan.header.declared for scan in scans):
        raise no_points(file)
    require_library(file, "pye57")
    return scans


def _read_xml(file):
    """Read the XML without its checksums; raise InputError for an invalid header."""
    if len(file.start) < HEADER.size:
        header = message("cloud_file_e57_header", "the header")
        raise file.refusal(describe_cut(file, header, HEADER.size, file.bytes))
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
    first, end = _logical_place(place), _logical_place(place) + size
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


def _logical_place(place):
    # Logical places do not count the checksums at the end of each page.
    return place // PAGE * DATA + place % PAGE


def _read_logical(file, first, size):
    """Read `size` bytes from a logical place, without the checksums of the pages."""
    page = first // DATA
    with file.path.open("rb") as stream:
        stream.seek(page * PAGE)
        pages = stream.read(((first + size - 1) // DATA - page + 1) * PAGE)
    data = b"".join(pages[i : i + DATA] for i in range(0, len(pages), PAGE))
    return data[first - page * DATA :][:size]


def _parse_scan(file, number, node):
    """Create the `_Scan` of a Data3D node."""
    points = node.child("points")
    prototype, problems = points.child("prototype"), []
    count = points.whole("recordCount", -1)
    names = {child.name: child for child in prototype.children}
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
        pose, warning, is_placed = None, _zero_rotation_warning(number), bool(pose[:3, 3].any())
    singles = all(names[name].is_single for name in fields)
    return _Scan(
        ScanHeader(node.child("name").text.strip()[:200], max(count, 0), pose, warning, is_placed),
        fields,
        state if state in names else "",
        "f" if singles and is_cartesian else "d",
        problems,
    )


def _bits(node):
    """Number of bits of a field in one record, packed according to the standard."""
    if node.kind == "Float":
        return 32 if node.is_single else 64
    if node.kind in ("Integer", "ScaledInteger"):
        low, high = node.whole("minimum", -LARGEST), node.whole("maximum", LARGEST - 1)
        return max(high - low, 0).bit_length()
    return 8  # a text has at least its length


def _count_problems(file, number, points, count, bits):
    place = points.whole("fileOffset", -1)
    is_inside = HEADER.size <= place <= file.bytes - SECTION.size and place % PAGE < DATA
    if is_inside:
        section = _read_logical(file, _logical_place(place), SECTION.size)
        kind, length, data, _ = SECTION.unpack(section.ljust(SECTION.size, b"\0"))
        is_inside = kind == 1 and _logical_place(place) + length <= file.bytes // PAGE * DATA
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
            is_valid = False
        elif node.kind == "ScaledInteger":
            scale, offset = node.real("scale", 1.0), node.real("offset", 0.0)
            is_valid = 0 < scale <= 1 and math.isfinite(offset)
        else:
            is_valid = True
        if not is_valid:
            yield message(
                "cloud_file_e57_scale",
                "scan {number}, {name}: expected numbers, with a finite offset and a scale above 0 "
                "and at most 1",
                number=number,
                name=node.name[:40],
            )


def _pose(number, node, problems):
    """Pose (4, 4) from the quaternion (w, x, y, z) and the translation of a scan.

    None without a pose or for an invalid pose, whose problem is appended to `problems`. The
    rotation is a zero matrix for a quaternion of zeros.
    """
    pose = node.find("pose")
    if pose is None:
        return None
    rotation, translation = pose.find("rotation"), pose.find("translation")
    w, x, y, z = (
        (rotation.read_number(name) for name in "wxyz") if rotation else (1.0, 0.0, 0.0, 0.0)
    )
    pose_matrix = np.eye(4)
    pose_matrix[:3, 3] = [translation.read_number(name) for name in "xyz"] if translation else 0.0
    if w == x == y == z == 0 and np.isfinite(pose_matrix).all():
        pose_matrix[:3, :3] = 0.0
        return pose_matrix
    length = math.sqrt(w * w + x * x + y * y + z * z) if max(map(abs, (w, x, y, z))) < 2 else 0.0
    if not (abs(length - 1) <= UNIT_QUATERNION and np.isfinite(pose_matrix).all()):
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
    pose_matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return pose_matrix


def _zero_rotation_warning(number):
    """Create the warning about a quaternion of zeros, which some programs write for no rotation.

    Older versions of libE57Format and pye57 write it. CloudCompare reads such a file without its
    pose.
    """
    return message(
        "cloud_file_e57_zero_pose",
        "the rotation of scan {number} is a quaternion of zeros: read without a pose; if the scan"
        " has one, give it as four rows of four numbers",
        number=number,
    )


@dataclass
class _Node:
    """One element: name, attributes, text, children."""

    name: str
    attributes: dict
    text: str = ""
    children: list = field(default_factory=list)

    @property
    def kind(self):
        """Type of the element, such as "Float"."""
        return self.attributes.get("type", "")

    @property
    def is_single(self):
        """Whether the element is a 32-bit float."""
        return self.kind == "Float" and self.attributes.get("precision") == "single"

    def find(self, name):
        """First child of that name, or None."""
        return next((child for child in self.children if child.name == name), None)

    def child(self, name):
        """First child of that name, or an empty node."""
        return self.find(name) or _Node(name, {})

    def whole(self, attribute, default):
        """Attribute as int; the default if it is missing or not a whole number."""
        text = self.attributes.get(attribute, "").strip()
        return int(text) if re.fullmatch(r"[+-]?\d{1,20}", text) else default

    def real(self, attribute, default):
        """Attribute as float; the default if it is missing, nan if it is not a number."""
        text = self.attributes.get(attribute)
        return default if text is None else _parse_number(text)

    def read_number(self, name):
        """Number in a child; 0 if it is missing or empty, nan if it is not a number."""
        text = self.child(name).text.strip()
        return _parse_number(text) if text else 0.0


def _parse_number(text):
    text = text.strip()
    return float(text) if NUMBER.fullmatch(text) else math.nan


def _parse_xml(file, data):
    """Parse the XML to its root `_Node`; raise InputError for malformed or harmful XML."""
    builder = _Builder(file)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.characters
    parser.StartDoctypeDeclHandler = builder.doctype
    parser.EntityDeclHandler = builder.doctype
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError, LookupError) as error:
        line = getattr(error, "lineno", None)
        raise file.refusal(
            message(
                "cloud_file_xml",
                "its XML is not well formed (line {line}): damaged",
                line=str(line or "?"),
            )
        ) from error
    root = builder.root
    if root is None or root.name != "e57Root" or root.find("data3D") is None:
        raise file.refusal(message("cloud_file_e57_root", "its XML names no scans (data3D)"))
    return root


class _Builder:
    def __init__(self, file):
        self.file, self.root, self.stack, self.count = file, None, [], 0

    def start(self, name, attributes):
        self.count += 1
        node = _Node(name, attributes)
        if self.stack:
            self.stack[-1].children.append(node)
        else:
            self.root = node
        self.stack.append(node)
        if len(self.stack) > DEEPEST or self.count > MOST_ELEMENTS:
            raise self.file.refusal(
                message(
                    "cloud_file_xml_size",
                    "its XML has {count} elements or more, {depth} in each other; expected at most "
                    "{most}, and {deepest}",
                    count=self.count,
                    depth=len(self.stack),
                    most=MOST_ELEMENTS,
                    deepest=DEEPEST,
                )
            )

    def end(self, name):
        self.stack.pop()

    def characters(self, text):
        node = self.stack[-1]
        if len(node.text) < LONGEST_TEXT:
            node.text += text[:LONGEST_TEXT]

    def doctype(self, *_):
        raise self.file.refusal(
            message(
                "cloud_file_xml_entities",
                "its XML declares a document type or entities; expected none in a file of scans",
            )
        )
