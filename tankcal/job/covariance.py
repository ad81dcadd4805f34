"""points_cov.npz and radii_cov.npz: full covariance matrices, read with care.

An archive holds `covariance_m2`, m2, and the names that it is of, in their order: of points (3n,
3n), x, y, z of each point of points.csv, and `points` (n,); of radii (n, n), and `courses` (n,).
Nothing in it is ever unpickled.
"""

import io
import zipfile
import zlib
from dataclasses import dataclass

import numpy as np

from tankcal.job.tables import COVARIANCE_FILE, RADII_COVARIANCE_FILE, shown
from tankcal.messages import message

MAX_POINTS = 2500  # the matrix is 450 MB then
TOLERANCE = 1e-8  # of a correlation
_MATRIX = "covariance_m2"


@dataclass(frozen=True)
class Archive:
    """A file with a covariance: its name, the array of names, their table, rows of each."""

    file: str
    names: str
    table: str
    each: int


OF_POINTS = Archive(COVARIANCE_FILE, "points", "points.csv", 3)
OF_RADII = Archive(RADII_COVARIANCE_FILE, "courses", "radii.csv", 1)


def read_covariance(data, names, log, archive=OF_POINTS):
    """The covariance in m2 of the points or courses called `names`, or None after telling `log`."""
    if len(names) > MAX_POINTS:
        expected = message(
            "covariance_too_many",
            "{count} points; expected at most {most} with a full covariance, which is {megabytes}"
            " MB for these and four times that for twice the points",
            count=len(names),
            most=MAX_POINTS,
            megabytes=round(8e-6 * (archive.each * len(names)) ** 2),
        )
        log.problem(archive.file, expected)
        return None
    arrays = _load(data, len(names), log, archive)
    if arrays is None:
        return None
    matrix, its_names = arrays[_MATRIX], arrays[archive.names]
    size = archive.each * len(names)
    complaint = _complaint_about_names(its_names, names, archive)
    if complaint:
        log.problem(archive.file, complaint, None, archive.names)
    if matrix.shape != (size, size) or matrix.dtype.kind != "f":
        log.problem(archive.file, _other_shape(matrix, size, archive), None, _MATRIX)
        return None
    matrix = matrix.astype(float)
    complaint = _complaint_about_matrix(matrix)
    if complaint:
        log.problem(archive.file, complaint, None, _MATRIX)
        return None
    return (matrix + matrix.T) / 2


def _other_shape(matrix, size, archive):
    given = {
        "name": matrix.dtype.name,
        "shape": str(matrix.shape),
        "value": str((size, size)),
        "count": size // archive.each,
    }
    if archive is OF_RADII:
        return message(
            "covariance_shape_of_radii",
            "found {name} of shape {shape}; expected floating-point numbers of shape {value}: the"
            " radii of {count} courses",
            **given,
        )
    return message(
        "covariance_shape",
        "found {name} of shape {shape}; expected floating-point numbers of shape {value}: x, "
        "y, z of {count} points",
        **given,
    )


def _load(data, n, log, archive):
    """The two arrays, after a look at what they would unpack to."""
    largest = 8 * (3 * n) ** 2 + 64 * 4 * n + 100_000  # matrix, names of 64 characters, headers
    wanted = (_MATRIX, archive.names)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as zipped:
            unpacked = sum(member.file_size for member in zipped.infolist())
        if unpacked > largest:
            expected = message(
                "covariance_unpacks",
                "unpacks to {unpacked} bytes, more than the covariance of {n} points needs",
                unpacked=unpacked,
                n=n,
            )
            log.problem(archive.file, expected, None, _MATRIX)
            return None
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            missing = [name for name in wanted if name not in arrays.files]
            for name in missing:
                log.problem(
                    archive.file,
                    message("covariance_array_missing", "missing array"),
                    None,
                    name,
                )
            if not missing:
                return {name: arrays[name] for name in wanted}
    except (ValueError, OSError, EOFError, KeyError, TypeError, SyntaxError, MemoryError):
        _tell_damaged(log, archive)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, OverflowError):
        _tell_damaged(log, archive)
    return None


def _tell_damaged(log, archive):
    expected = message(
        "covariance_damaged",
        "cannot be read; expected a numpy .npz with plain arrays {matrix} and {names}",
        matrix=_MATRIX,
        names=archive.names,
    )
    log.problem(archive.file, expected)


def _complaint_about_names(found, names, archive):
    if found.dtype.kind != "U" or found.shape != (len(names),):
        return message(
            "covariance_names",
            "expected the {count} names of {table} as text, in its order",
            count=len(names),
            table=archive.table,
        )
    for position, (one, other) in enumerate(zip(found.tolist(), names, strict=True), 1):
        if other is not None and one != other:
            return message(
                "covariance_other_name",
                "name {position} is {found}; expected {wanted} as in {table}",
                position=position,
                found=shown(one),
                wanted=shown(other),
                table=archive.table,
            )
    return None


def _complaint_about_matrix(matrix):
    if not np.all(np.isfinite(matrix)):
        return message(
            "covariance_infinite", "holds NaN or infinite values; expected finite numbers"
        )
    variance = np.diagonal(matrix)
    if np.any(variance < 0) or np.any(variance > 1.0):
        return message(
            "covariance_variances",
            "variances from {low:g} to {high:g} m2; expected 0 to 1 m2 (the square of metres: is "
            "it in mm2?)",
            low=variance.min(),
            high=variance.max(),
        )
    sd = np.sqrt(variance)
    scale = np.where(sd > 0, sd, 1.0)
    correlation = matrix / scale[:, None] / scale[None, :]
    if np.any(np.abs(correlation - correlation.T) > TOLERANCE):
        return message("covariance_not_symmetric", "is not symmetric; expected a covariance matrix")
    try:
        np.linalg.cholesky(correlation + TOLERANCE * len(matrix) * np.eye(len(matrix)))
    except np.linalg.LinAlgError:
        return message(
            "covariance_not_definite", "is not a covariance matrix; expected no negative eigenvalue"
        )
    return None
