"""Files of scanners, a module for each format: their headers checked, their points in pieces."""

from tankcal.clouds.contents import WHOLE
from tankcal.clouds.formats import columns, counted_text, e57, las, ply
from tankcal.clouds.formats.files import find_format

_DESCRIBE = {
    "las": las.describe,
    "e57": e57.describe,
    "ply": ply.describe,
    "ptx": counted_text.describe_ptx,
    "pts": counted_text.describe_pts,
    "xyz": columns.describe,
}
_PIECES = {
    "las": las.pieces,
    "e57": e57.pieces,
    "ply": ply.pieces,
    "ptx": counted_text.ptx_pieces,
    "pts": counted_text.pts_pieces,
    "xyz": columns.pieces,
}
_SHARES = {"las": las.shares, "e57": e57.shares, "ply": ply.shares, "xyz": columns.shares}


def describe_file(file):
    """Format and `ScanHeader`s of a `CloudFile`; InputError with the problems of its header."""
    return _DESCRIBE[_kind(file)](file)


def read_pieces(file, chunk, share=WHOLE):
    """The records of a share of a `CloudFile` as `Piece`s of at most `chunk` of them."""
    read = _PIECES[_kind(file)]
    return read(file, chunk) if share == WHOLE else read(file, chunk, share)


def share_out(file, points_each):
    """`CloudPiece`s that make up a `CloudFile`, of about so many points where its format allows.

    Each record is in one of them.
    """
    kind = _kind(file)
    return _SHARES[kind](file, points_each) if kind in _SHARES else (WHOLE,)


def _kind(file):
    found = find_format(file)
    return columns.find_kind(file) if found == "text" else found
