"""Clouds written in each format: LAS and LAZ by laspy, E57 by libe57, the others by hand.

write_cloud(path, xyz)      the format of the path's ending
"""

import struct

import numpy as np

AXES = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
UNMOVED = np.eye(4)


def some_wall(count=500, seed=1, centre=(0.0, 0.0, 0.0)):
    """(n, 3) of a noisy cylinder of 6.5 m, rounded to a tenth of a millimetre."""
    rng = np.random.default_rng(seed)
    azimuth, radius = rng.uniform(0, 2 * np.pi, count), 6.5 + rng.normal(0, 0.002, count)
    z = rng.uniform(0, 9.5, count)
    xyz = np.column_stack([radius * np.sin(azimuth), radius * np.cos(azimuth), z])
    return np.round(xyz + centre, 4)


def write_cloud(path, xyz):
    """A file of the format that the path's ending names."""
    ending = path.suffix[1:]
    {
        "las": write_las,
        "laz": write_las,
        "e57": lambda path, xyz: write_e57(path, [xyz]),
        "ply": write_ply,
        "ptx": lambda path, xyz: write_ptx(path, [(xyz, UNMOVED)]),
        "pts": lambda path, xyz: write_pts(path, [xyz]),
    }.get(ending, write_xyz)(path, xyz)
    return path


def write_las(path, xyz, *, version="1.2", form=3, scale=0.0001, evlrs=0):
    """LAS, or LAZ by the path's ending."""
    import laspy

    header = laspy.LasHeader(point_format=form, version=version)
    header.scales, header.offsets = [scale] * 3, np.floor(xyz.mean(axis=0))
    data = laspy.LasData(header)
    data.x, data.y, data.z = xyz.T
    for _ in range(evlrs):
        data.evlrs = data.evlrs or laspy.vlrs.vlrlist.VLRList()
        data.evlrs.append(laspy.VLR("tankcal", 1, "a test", b"abc"))
    data.write(path)


def write_e57(path, scans, *, poses=(), kind="double", invalid=None, spherical=False):
    """E57 of several scans.

    poses    ((w, x, y, z), translation) of each, or none
    kind     "double", "single", "scaled" or "integer" (of millimetres)
    invalid  array of the invalid state for each scan, or None
    """
    from pye57 import E57, libe57

    path.unlink(missing_ok=True)
    file = E57(str(path), "w")
    image = file.image_file
    for i, xyz in enumerate(scans):
        scan, prototype = libe57.StructureNode(image), libe57.StructureNode(image)
        scan.set("guid", libe57.StringNode(image, f"{{{i}}}"))
        scan.set("name", libe57.StringNode(image, f"scan {i}"))
        if poses:
            scan.set("pose", _pose_node(libe57, image, *poses[i]))
        names, columns = _fields(xyz, spherical)
        for name in names:
            prototype.set(name, _number_node(libe57, image, kind))
        columns = [np.ascontiguousarray(one) for one in columns]
        if invalid is not None:
            names = [*names, ("spherical" if spherical else "cartesian") + "InvalidState"]
            prototype.set(names[-1], libe57.IntegerNode(image, 0, 0, 2))
            columns.append(np.asarray(invalid, float))
        node = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
        scan.set("points", node)
        file.data3d.append(scan)
        buffers = libe57.VectorSourceDestBuffer()
        for name, column in zip(names, columns, strict=True):
            buffers.append(libe57.SourceDestBuffer(image, name, column, len(column), True, True))
        writer = node.writer(buffers)
        writer.write(len(xyz))
        writer.close()
    file.close()


def _fields(xyz, spherical):
    if not spherical:
        return ["cartesianX", "cartesianY", "cartesianZ"], xyz.T
    distance = np.linalg.norm(xyz, axis=1)
    columns = distance, np.arctan2(xyz[:, 1], xyz[:, 0]), np.arcsin(xyz[:, 2] / distance)
    return ["sphericalRange", "sphericalAzimuth", "sphericalElevation"], columns


def _number_node(libe57, image, kind):
    if kind == "scaled":
        return libe57.ScaledIntegerNode(image, 0, -(10**9), 10**9, 1e-5, 0.25)
    if kind == "integer":
        return libe57.IntegerNode(image, 0, -(10**6), 10**6)
    precision = libe57.E57_SINGLE if kind == "single" else libe57.E57_DOUBLE
    return libe57.FloatNode(image, 0.0, precision, -1e8, 1e8)


def _pose_node(libe57, image, quaternion, translation):
    pose = libe57.StructureNode(image)
    for part, names, values in (
        ("rotation", "wxyz", quaternion),
        ("translation", "xyz", translation),
    ):
        node = libe57.StructureNode(image)
        for name, value in zip(names, values, strict=True):
            node.set(name, libe57.FloatNode(image, float(value)))
        pose.set(part, node)
    return pose


def write_ply(path, xyz, *, order="binary_little_endian", kind="double", faces=True):
    """PLY with intensities between the coordinates, and triangles behind the vertices."""
    mark = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "<"}[order]
    word = {"double": "f8", "float": "f4"}[kind]
    fields = [("x", mark + word), ("y", mark + word), ("i", "u1"), ("z", mark + word)]
    rows = np.zeros(len(xyz), fields)
    rows["x"], rows["y"], rows["z"] = xyz.T
    names = {"u1": "uchar", "f8": "double", "f4": "float"}
    properties = "".join(f"property {names[code[-2:]]} {name}\n" for name, code in fields)
    head = f"ply\nformat {order} 1.0\ncomment of a test\nelement vertex {len(xyz)}\n{properties}"
    head += "element face 1\nproperty list uchar int vertex_indices\n" if faces else ""
    body, tail = rows.tobytes(), b"\3" + np.array([0, 1, 2], mark + "i4").tobytes()
    if order == "ascii":
        body = "".join(f"{x} {y} {i} {z}\n" for x, y, i, z in rows.tolist()).encode()
        tail = b"3 0 1 2\n"
    path.write_bytes(head.encode() + b"end_header\n" + body + (tail if faces else b""))


def write_ptx(path, scans):
    """PTX of pairs of points and the matrix of row vectors, one column of so many rows each."""
    parts = []
    for xyz, matrix in scans:
        rows = "".join(f"{x:.4f} {y:.4f} {z:.4f} 0.5\n" for x, y, z in xyz.tolist())
        frame = "".join(" ".join(f"{one:.12g}" for one in row) + "\n" for row in matrix)
        parts.append(f"1\n{len(xyz)}\n{AXES}{frame}{rows}")
    path.write_text("".join(parts))


def write_pts(path, scans):
    """PTS of several blocks."""
    rows = ["".join(f"{x:.4f} {y:.4f} {z:.4f} -5 1 2 3\n" for x, y, z in xyz) for xyz in scans]
    path.write_text("".join(f"{len(xyz)}\n{text}" for xyz, text in zip(scans, rows, strict=True)))


def write_xyz(path, xyz, *, separator=" ", decimal=".", heading="", end="\n"):
    """Rows of x, y, z."""
    rows = (separator.join(f"{one:.4f}" for one in row) for row in xyz.tolist())
    text = "".join(row.replace(".", decimal) + end for row in rows)
    path.write_bytes((heading + text).encode())


def with_checksums(data):
    """The bytes of an E57 file with the checksum of each page made right."""
    pages = (data[i : i + 1020] for i in range(0, len(data), 1024))
    return b"".join(page + crc32c(page).to_bytes(4, "big") for page in pages)


def _crc_table():
    table = []
    for value in range(256):
        for _ in range(8):
            value = value >> 1 ^ (0x82F63B78 if value & 1 else 0)
        table.append(value)
    return table


_TABLE = _crc_table()


def crc32c(data):
    """The checksum of Castagnoli, as E57 has it of its pages."""
    value = 0xFFFFFFFF
    for byte in data:
        value = _TABLE[(value ^ byte) & 0xFF] ^ value >> 8
    return value ^ 0xFFFFFFFF


def with_xml(data, change, are_summed=True):
    """An E57 file whose XML (bytes), at the end of the file, is change(xml); with checksums."""
    start, length = struct.unpack_from("<QQ", data, 24)
    logical = b"".join(data[i : i + 1020] for i in range(0, len(data), 1024))
    place = start // 1024 * 1020 + start % 1024
    xml = change(logical[place : place + length])
    logical = logical[:place] + xml
    logical += bytes(-len(logical) % 1020)
    pages = b"".join(logical[i : i + 1020] + bytes(4) for i in range(0, len(logical), 1020))
    head = struct.pack("<QQQ", len(pages), start, len(xml))
    pages = pages[:16] + head + pages[40:]
    return with_checksums(pages) if are_summed else pages
