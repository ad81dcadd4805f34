"""Reading a cloud beside laspy, pye57, open3d and CloudCompare: points, and the box around them.

    python benchmarks/cloud_readers.py [POINTS]        (default: 2 000 000)

Each reads a file once, in pieces where it can, and determines the number of points and their box.
Seconds of processor include child processes (tankcal decodes LAZ and E57 in one). CloudCompare is a
program of its own; it is timed with its start, and tells the number of points only. Debian's build
reads neither LAS nor E57. PDAL is named where it cannot be installed.
"""

import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from clouds import WRITERS, wall
from measured import (
    ROUNDS,
    Row,
    Skipped,
    digits_of,
    installation_error,
    interleaved,
    peer_module,
    tell,
)

from tankcal.clouds import describe_cloud, read_cloud

LEAST, FROM_M = 6.0, 100.0  # digits of the box, seen from 100 m away: files have 0.1 mm
CHUNK = 1 << 18
PROGRAM = "CloudCompare"


def box_of(pieces):
    """Number of points of pieces (n, 3), and their box: (7,)."""
    count, low, high = 0, np.full(3, np.inf), np.full(3, -np.inf)
    for xyz in pieces:
        count += len(xyz)
        low, high = np.minimum(low, xyz.min(axis=0)), np.maximum(high, xyz.max(axis=0))
    return np.array([count, *(low + FROM_M), *(high + FROM_M)])


def by_tankcal(path):
    return box_of(chunk.xyz_m for chunk in read_cloud(describe_cloud(path)))


def by_laspy(laspy):
    def read(path):
        with laspy.open(path) as file:
            chunks = file.chunk_iterator(CHUNK)
            return box_of(np.column_stack([one.x, one.y, one.z]) for one in chunks)

    return read


def by_pye57(pye57):
    def read(path):
        scan = pye57.E57(str(path)).read_scan(0, ignore_missing_fields=True)
        return box_of([np.column_stack([scan[f"cartesian{axis}"] for axis in "XYZ"])])

    return read


def by_open3d(open3d):
    return lambda path: box_of([np.asarray(open3d.io.read_point_cloud(str(path)).points)])


def by_cloudcompare(path):
    """The count alone, from its console."""
    command = [PROGRAM, "-SILENT", "-AUTO_SAVE", "OFF", "-O", path]
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen", "OMP_NUM_THREADS": "1"}
    text = subprocess.run(command, capture_output=True, text=True, env=environment).stdout
    count = re.search(r"cloud with (\d+) points", text)
    return np.array([int(count[1]) if count else 0])


def version_of_cloudcompare():
    """As the package has it; empty where the program is not there."""
    if not shutil.which(PROGRAM):
        return ""
    ask = ["dpkg-query", "-W", "-f=${Version}", "cloudcompare"]
    return subprocess.run(ask, capture_output=True, text=True).stdout or "?"


def processor_s():
    """Seconds of processor of this process and its ended children."""
    both = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(used.ru_utime + used.ru_stime for used in both)


def spent(read, path):
    """Task that reads a file and gives the seconds of this process and its children."""

    def task():
        before = processor_s()
        read(path)
        return processor_s() - before

    return task


def main(points):
    """A row for each format and peer."""
    name, found = "reading a cloud", {}
    for module, make, kinds in (
        ("laspy", by_laspy, ("las", "laz")),
        ("pye57", by_pye57, ("e57",)),
        ("open3d", by_open3d, ("ply", "xyz")),
    ):
        if peer := peer_module(module, name):
            found[module] = make(peer[0]), peer[1], kinds, ""
    if version := version_of_cloudcompare():
        found[PROGRAM] = by_cloudcompare, version, ("ply", "xyz"), "with its start"
    else:
        tell(Skipped(name, PROGRAM, "not installed (apt-get install cloudcompare)"))
    tell(Skipped(name, "PDAL", installation_error("pdal") or "not measured"))
    right = box_of([wall(points)])
    right[0] = points  # the wall again and again
    with tempfile.TemporaryDirectory() as folder:
        for kind in ("las", "laz", "e57", "ply", "xyz"):
            path = Path(folder) / f"wall.{kind}"
            WRITERS[kind](path, points)
            readers = {"tankcal": by_tankcal} | {
                peer: read for peer, (read, _, kinds, _) in found.items() if kind in kinds
            }
            answers = {peer: read(path) for peer, read in readers.items()}
            digits = {peer: digits_of(one, right[: len(one)]) for peer, one in answers.items()}
            seconds = interleaved({key: spent(read, path) for key, read in readers.items()}, ROUNDS)
            for peer in readers:
                if peer != "tankcal":
                    tell(Row(f"{name}, {kind}", f"{points} points", seconds["tankcal"],
                             peer, found[peer][1], seconds[peer], "number and box of the points",
                             (digits["tankcal"], digits[peer]), LEAST,
                             note=found[peer][3]))  # fmt: skip
            path.unlink()


if __name__ == "__main__":
    main(int(float(sys.argv[1])) if len(sys.argv) > 1 else 2_000_000)
