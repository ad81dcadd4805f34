"""Files of scanners to the cells of a wall, end to end: time and memory of each format.

    python benchmarks/clouds.py [POINTS] [FORMAT ...] [--cluster N]    (default: 1 000 000 of all)

Described, read twice, placed by a pose, sampled and summed up in cells, as a job does it, in this
process (N = 0, the default) or by N workers. The goals for 1e8 points on two cores: LAS 60 s, LAZ
180 s, E57 90 s, peak 500 MB. Files are made in a temporary folder ($TMPDIR), of one noisy wall
written again and again. Seconds of processor are of all processes, the peak of memory is the
largest sum of what all of them hold (proportional set sizes, looked at five times a second).
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from measured import Row, tell

from tankcal.clouds import describe_cloud
from tankcal.clouds.wall import find_cloud_wall
from tankcal.methods.clouds.passes import Placing, Reading, Telling, open_passes
from tankcal.methods.clouds.readings import CloudFile
from tankcal.survey.registration import ScanSetup
from tankcal.survey.wall_hits import RangingInstrument

BLOCK = 1_000_000
RADIUS_M, HEIGHT_M, NOISE_M = 6.5, 9.5, 0.002


def main(points, kinds, workers):
    """A row for each format."""
    with tempfile.TemporaryDirectory() as folder:
        for kind in kinds:
            path = Path(folder) / f"wall.{kind}"
            # each in a process of its own: a child counts the memory of a parent as its own
            subprocess.run([sys.executable, __file__, "--write", path, str(points)], check=True)
            measure([sys.executable, __file__, "--run", path, str(workers)])
            path.unlink()


def measure(command):
    """Run a command; a row with seconds and memory of it and all of its children."""
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    held, done = [0.0], threading.Event()

    def look():
        while not done.wait(0.2):
            held.append(sum(map(megabytes, family(child.pid))))

    watch = threading.Thread(target=look)
    watch.start()
    line = child.stdout.read().strip()
    _, status, usage = os.wait4(child.pid, 0)
    done.set()
    watch.join()
    if status:
        sys.exit(1)
    kind, size, note = json.loads(line.splitlines()[-1])
    spent = (usage.ru_utime + usage.ru_stime,)
    tell(Row(f"file of a scanner, {kind}", size, spent, memory_mb=max(held), note=note))


def family(pid):
    """Numbers of a process and all of its children."""
    try:
        own = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        threads = Path(f"/proc/{pid}/task").iterdir()
        own += [one for task in threads for one in (task / "children").read_text().split()]
    except OSError:
        return {pid}
    return {pid, *(one for child in set(own) for one in family(int(child)))}


def megabytes(pid):
    """What a process holds, what it shares with others divided among them."""
    try:
        rows = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0.0
    return sum(int(row.split()[1]) for row in rows if row.startswith("Pss:")) / 1024


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


class Posed:
    """A registration that turns and shifts one scan, as a job's would."""

    rotation, place_m = np.eye(3)[None], np.array([[10.0, 20.0, 0.0]])


class OneCloud:
    """The clouds of a job of one file."""

    def __init__(self, path):
        header = describe_cloud(path)
        self.files = (CloudFile("A", path.name, header, 1.0, 0, np.zeros((0, 6))),)
        self.scans, self.ranging = (ScanSetup("A", "S"),), {"S": RangingInstrument("S")}


def run(path, workers):
    """Find the wall of a file; its format, its size and a note are printed as JSON."""
    clouds = OneCloud(path)
    start, steps = time.perf_counter(), []
    telling = Telling(lambda text: steps.append(time.perf_counter()))
    with open_passes(Placing.of(clouds, Posed), Reading(workers), telling) as passes:
        opened = time.perf_counter()
        wall = find_cloud_wall(
            passes,
            radius_m=RADIUS_M,
            joints_m=np.linspace(0, HEIGHT_M, 6),
            progress=telling.step,
        )
        end = time.perf_counter()
    header = clouds.files[0].header
    size = f"{wall.delivered[0]} points, {header.bytes / 1e6:.0f} MB"
    note = (
        f"with imports; {workers} workers, {wall.grid.rows} x {wall.grid.columns} cells; by the "
        f"clock: start {opened - start:.1f} s, sample {steps[1] - opened:.1f} s, "
        f"cells {end - steps[1]:.1f} s"
    )
    print(json.dumps([header.format, size, note]))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--run"]:
        run(Path(sys.argv[2]), int(sys.argv[3]))
    elif sys.argv[1:2] == ["--write"]:
        path = Path(sys.argv[2])
        WRITERS[path.suffix[1:]](path, int(sys.argv[3]))
    else:
        parser = argparse.ArgumentParser()
        parser.add_argument("points", nargs="?", type=float, default=1e6)
        parser.add_argument("formats", nargs="*", default=[*WRITERS])
        parser.add_argument("--cluster", type=int, default=0)
        asked = parser.parse_args()
        main(int(asked.points), asked.formats, asked.cluster)
