"""File formats of scanners, one module per format: check of the header, reading of the points."""

from tankcal.clouds.formats import columns, e57, las, lines, ply
from tankcal.clouds.formats.files import WHOLE, find_format

_DESCRIBE = {
    "las": las.describe,
    "e57": e57.describe,
    "ply": ply.describe,
    "ptx": lines.describe_ptx,
    "pts": lines.describe_pts,
    "xyz": columns.describe,
}
_PIECES = {
    "las": las.pieces,
    "e57": e57.pieces,
    "ply": ply.pieces,
    "ptx": lines.ptx_pieces,
    "pts": lines.pts_pieces,
    "xyz": columns.pieces,
}
_SHARES = {"las": las.shares, "e57": e57.shares, "ply": ply.shares, "xyz": columns.shares}


def describe_file(file):
    """Return format and scan headers of a `CloudFile`; raise InputError for an invalid header."""
    return _DESCRIBE[_kind(file)](file)


def read_pieces(file, chunk, share=WHOLE):
    """Yield the records of a share of a file as `Piece` objects of at most `chunk` records."""
    read = _PIECES[_kind(file)]
    return read(file, chunk) if share == WHOLE else read(file, chunk, share)


def divide_file(file, points_each):
    """Divide a `CloudFile` into `CloudPiece` objects of about `points_each` points.

    Each record belongs to exactly one piece. A format that cannot be divided gives one piece.
    """
    kind = _kind(file)
    return _SHARES[kind](file, points_each) if kind in _SHARES else (WHOLE,)


def _kind(file):
    kind = find_format(file)
    return columns.find_kind(file) if kind == "text" else kind
