"""Files of scanners read to their end: time and memory of each format.

    python benchmarks/clouds.py [POINTS] [FORMAT ...]        (default: 1 000 000 of all formats)

The goals for 1e8 points on two cores, reading and cells of the wall together: LAS 60 s, LAZ 180 s,
E57 90 s, peak 500 MB. Files are made in a temporary folder, of one noisy wall written again and
again; each format is read in a process of its own. Seconds of processor are of the reader and the
child that decodes for it; so are the peaks of memory, added.
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tankcal.clouds import describe_cloud, read_cloud

BLOCK = 1_000_000
RADIUS_M, HEIGHT_M, NOISE_M = 6.5, 9.5, 0.002


def main(points, kinds):
    """Print a line for each format."""
    with tempfile.TemporaryDirectory() as folder:
        for kind in kinds:
            path = Path(folder) / f"wall.{kind}"
            # each in a process of its own: a child counts the memory of a parent as its own
            for task in ("--write", "--read"):
                command = [sys.executable, __file__, task, str(path), str(points)]
                subprocess.run(command, check=True)
            path.unlink()


def wall(points):
    """(n, 3) of a noisy cylinder, at most `BLOCK` points."""
    n = min(points, BLOCK)
    rng = np.random.default_rng(1)
    azimuth, radius = rng.uniform(0, 2 * np.pi, n), RADIUS_M + rng.normal(0, NOISE_M, n)
    z = rng.uniform(0, HEIGHT_M, n)
    return np.column_stack([radius * np.sin(azimuth), radius * np.cos(azimuth), z])


def blocks(points):
    """The wall again and again, so many points in all."""
    xyz = wall(points)
    for done in range(0, points, len(xyz)):
        yield xyz[: points - done]


def write_las(path, points):
    """LAS, or LAZ by its ending, of the plainest records (20 bytes)."""
    import laspy

    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales, header.offsets = [0.0001] * 3, [0.0] * 3
    with laspy.open(path, "w", header=header) as file:
        for xyz in blocks(points):
            record = laspy.ScaleAwarePointRecord.zeros(len(xyz), header=header)
            record.x, record.y, record.z = xyz.T
            file.write_points(record)


def write_e57(path, points):
    """E57 of one scan in numbers of 64 bits."""
    from pye57 import E57, libe57

    file = E57(str(path), "w")
    image = file.image_file
    scan, prototype = libe57.StructureNode(image), libe57.StructureNode(image)
    scan.set("guid", libe57.StringNode(image, "{wall}"))
    names = ("cartesianX", "cartesianY", "cartesianZ")
    for name in names:
        prototype.set(name, libe57.FloatNode(image, 0.0, libe57.E57_DOUBLE, -1e4, 1e4))
    node = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
    scan.set("points", node)
    file.data3d.append(scan)
    columns = np.zeros((3, min(points, BLOCK)))
    buffers = libe57.VectorSourceDestBuffer()
    for name, column in zip(names, columns, strict=True):
        buffers.append(libe57.SourceDestBuffer(image, name, column, len(column), True, True))
    writer = node.writer(buffers)
    for xyz in blocks(points):
        columns[:, : len(xyz)] = xyz.T
        writer.write(len(xyz))
    writer.close()
    file.close()


def write_ply(path, points):
    """PLY of binary numbers of 64 bits."""
    with path.open("wb") as file:
        lines = "".join(f"property double {name}\n" for name in "xyz")
        file.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {points}\n".encode())
        file.write(f"{lines}end_header\n".encode())
        for xyz in blocks(points):
            xyz.tofile(file)


def write_ptx(path, points):
    """PTX of one scan."""
    frame = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
    write_rows(path, points, f"{points}\n1\n{frame}")


def write_pts(path, points):
    """PTS of one block."""
    write_rows(path, points, f"{points}\n")


def write_xyz(path, points):
    """Plain rows."""
    write_rows(path, points, "")


def write_rows(path, points, heading):
    """Rows of x, y, z, intensity under a heading."""
    rows = [b"%.4f %.4f %.4f 0.500\n" % (x, y, z) for x, y, z in wall(points).tolist()]
    text = b"".join(rows)
    with path.open("wb") as file:
        file.write(heading.encode())
        for done in range(0, points, len(rows)):
            left = points - done
            file.write(text if left >= len(rows) else b"".join(rows[:left]))


WRITERS = {
    "las": write_las,
    "laz": write_las,
    "e57": write_e57,
    "ply": write_ply,
    "ptx": write_ptx,
    "pts": write_pts,
    "xyz": write_xyz,
}


def read(path):
    """Read a file to its end and print what it took."""
    start, total = time.perf_counter(), np.zeros(3)
    header = describe_cloud(path)
    described = time.perf_counter() - start
    points = 0
    for part in read_cloud(header):
        points += len(part.xyz_m)
        total += part.xyz_m.sum(axis=0)
    seconds = time.perf_counter() - start
    own, child = (
        resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    cpu = sum(one.ru_utime + one.ru_stime for one in (own, child))
    peaks = [one.ru_maxrss / 1024 for one in (own, child)]
    print(
        f"{header.format}: {points} points, {header.bytes / 1e6:.0f} MB, {seconds:.1f} s by the "
        f"clock ({described:.1f} s of them for the header), {cpu:.1f} s of processor, peak "
        f"{sum(peaks):.0f} MB ({peaks[0]:.0f} + {peaks[1]:.0f} of the child), mean z "
        f"{total[2] / points:.4f} m",
        flush=True,
    )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--read"]:
        read(Path(sys.argv[2]))
    elif sys.argv[1:2] == ["--write"]:
        path = Path(sys.argv[2])
        WRITERS[path.suffix[1:]](path, int(sys.argv[3]))
    else:
        main(int(float((sys.argv[1:2] or ["1e6"])[0])), sys.argv[2:] or list(WRITERS))
