"""PTX and PTS: text files with a count before the points of each scan.

PTX: a scan begins with columns, rows, position and three axes of the scanner, and a 4 x 4 matrix.
The matrix is applied from the right to rows (x, y, z, 1). "0 0 0" is a direction without a return.
PTS: each block has a count and its points; all blocks are in one frame.
"""

import numpy as np

from tankcal.clouds.contents import ScanHeader
from tankcal.clouds.formats.files import Piece, count_mismatch, no_points
from tankcal.clouds.formats.lines import (
    LEAST_ROW,
    Layout,
    Lines,
    parse_rows,
    printable_start,
    skip_lines,
    whole_number,
)
from tankcal.messages import message

MOST_SCANS = 10_000
RIGID = 1e-3  # tolerance of an orthonormal matrix, for rotations written with few digits
LAYOUT = Layout()


def describe_ptx(file):
    """Return format and scan headers of a PTX file; the lines of each scan are counted."""
    return "ptx", tuple(_describe(file, _ptx_header))


def describe_pts(file):
    """Return format and scan headers of a PTS file, one per block; the lines are counted."""
    return "pts", tuple(_describe(file, _pts_header))


def ptx_pieces(file, chunk):
    """Yield the points of a PTX file, without directions that have no return."""
    for piece in _pieces(file, chunk, _ptx_header):
        x, y, z = piece.xyz.T
        has_return = (x != 0) | (y != 0) | (z != 0)
        xyz = piece.xyz if has_return.all() else piece.xyz.T[:, has_return].T
        yield Piece(piece.scan, xyz, piece.read)


def pts_pieces(file, chunk):
    """Yield the points of a PTS file."""
    return _pieces(file, chunk, _pts_header)


def is_ptx(lines):
    """Whether the first lines that are not blank are the header of a PTX scan."""
    counts = [whole_number(line) for line in lines[:2]]
    cells = [len(line.split()) for line in lines[2:10]]
    return None not in counts and cells == [3, 3, 3, 3, 4, 4, 4, 4]


def is_pts(lines):
    """Whether the first lines that are not blank are a count and a row of points."""
    return len(lines) > 1 and whole_number(lines[0]) is not None and len(lines[1].split()) >= 3


def _describe(file, read_header):
    scans = []
    with file.path.open("rb") as stream:
        lines = Lines(file, stream)
        while (scan := read_header(file, lines)) is not None:
            _check_size(file, scan, lines.row)
            lines_read = skip_lines(lines, scan.declared)
            if lines_read < scan.declared:
                raise _scan_count_error(file, len(scans), scan, lines_read)
            scans.append(scan)
            if len(scans) > MOST_SCANS:
                raise file.refusal(
                    message(
                        "cloud_file_scans",
                        "holds more than {most} scans; expected points in some of them",
                        most=MOST_SCANS,
                    )
                )
    if not sum(scan.declared for scan in scans):
        raise no_points(file)
    return scans


def _check_size(file, scan, row):
    if scan.declared * LEAST_ROW > file.bytes + LEAST_ROW:
        raise file.refusal(
            message(
                "cloud_file_text_room",
                "declares {declared} points; {size} bytes have no room for them: is it cut or "
                "damaged?",
                declared=scan.declared,
                size=file.bytes,
            ),
            row=row,
        )


def _scan_count_error(file, number, scan, points_read):
    return (
        count_mismatch(file, scan.declared, points_read)
        if number == 0
        else file.refusal(
            message(
                "cloud_file_scan_count",
                "scan {number} declares {declared} points and holds {found}; expected the same "
                "number: is the file cut or damaged?",
                number=number + 1,
                declared=scan.declared,
                found=points_read,
            )
        )
    )


def _pieces(file, chunk, read_header):
    with file.path.open("rb") as stream:
        lines, number = Lines(file, stream), 0
        while (scan := read_header(file, lines)) is not None:
            left = scan.declared
            while left:
                block, row = lines.take(min(left, chunk))
                if not block:
                    raise _scan_count_error(file, number, scan, scan.declared - left)
                xyz = parse_rows(file, block, row, LAYOUT)
                left -= len(xyz)
                yield Piece(number, xyz, len(xyz))
            number += 1


def _ptx_header(file, lines):
    """Read the next `ScanHeader`; None at the end of the file."""
    columns = lines.next_line()
    if columns is None:
        return None
    row, sizes = lines.row, (whole_number(columns), whole_number(lines.next_line()))
    if None in sizes:
        raise file.refusal(
            message(
                "cloud_file_ptx_size",
                "found {found!r}; expected the numbers of columns and of rows of a scan, each in a "
                "line of its own",
                found=printable_start(columns),
            ),
            row=row,
        )
    row, position = lines.row, [_numbers(lines.next_line(), 3) for _ in range(4)]
    matrix = [_numbers(lines.next_line(), 4) for _ in range(4)]
    if None in position or None in matrix or not _is_rigid(np.array(matrix).T):
        raise file.refusal(
            message(
                "cloud_file_ptx_frame",
                "after the size of a scan: expected its position and three axes, 3 numbers each, "
                "and four lines of 4 numbers that turn and shift without a change of size",
            ),
            row=row + 1,
        )
    return ScanHeader("", sizes[0] * sizes[1], np.array(matrix).T)


def _numbers(line, wanted):
    """Read `wanted` finite numbers from a line; None if the line has other contents."""
    cells = [] if line is None else LAYOUT.cells(line)
    numbers = [LAYOUT.number(cell) for cell in cells]
    return None if len(numbers) != wanted or None in numbers else numbers


def _is_rigid(pose):
    # A rotation is orthonormal with a positive determinant.
    turn = pose[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.abs(turn @ turn.T - np.eye(3)).max()
        is_turn = error < RIGID and np.linalg.det(turn) > 0
    return bool(is_turn) and np.allclose(pose[3], [0, 0, 0, 1], atol=1e-9)


def _pts_header(file, lines):
    line = lines.next_line()
    if line is None:
        return None
    count = whole_number(line)
    if count is None:
        raise file.refusal(
            message(
                "cloud_file_pts_count",
                "found {found!r}; expected the number of points that follow, alone in its line, or "
                "the end of the file",
                found=printable_start(line),
            ),
            row=lines.row,
        )
    return ScanHeader("", count)
