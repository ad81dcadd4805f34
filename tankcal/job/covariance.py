"""Full covariance matrices in points_cov.npz and radii_cov.npz, read without unpickling.

An archive contains `covariance_m2`, m2, and names in the order of the matrix. For points:
`covariance_m2` (3n, 3n) with x, y, z of each point of points.csv, and `points` (n,). For radii:
`covariance_m2` (n, n) and `courses` (n,).
"""

import io
import zipfile
import zlib
from dataclasses import dataclass

import numpy as np

from tankcal.job.tables import COVARIANCE_FILE, shown
from tankcal.messages import message

MAX_POINTS = 2500  # largest number of points; the matrix has 450 MB
TOLERANCE = 1e-8  # rounding of a correlation coefficient
_MATRIX = "covariance_m2"


@dataclass(frozen=True)
class Archive:
    """Format of a file with a covariance matrix.

    Attributes
    ----------
    file : str
        Name of the file.
    names : str
        Name of the array of names.
    table : str
        Name of the table with these names.
    each : int
        Rows of the matrix for each name.
    """

    file: str
    names: str
    table: str
    each: int


OF_POINTS = Archive(COVARIANCE_FILE, "points", "points.csv", 3)


def read_covariance(data):
    """Read the covariance matrix of an archive that `check_covariance` accepts.

    Parameters
    ----------
    data : bytes
        Content of the archive.

    Returns
    -------
    ndarray
        Symmetric matrix, m2.
    """
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        matrix = arrays[_MATRIX].astype(float)
    return (matrix + matrix.T) / 2


def check_covariance(data, names, log, archive=OF_POINTS):
    """Report problems of an archive with a covariance matrix.

    Parameters
    ----------
    data : bytes
        Content of the archive.
    names : sequence of str or None
        Names of points or courses; None for an invalid name, which is not compared.
    log : Log
        Receives the problems.
    archive : Archive, optional
        Format of the file.
    """
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
        return
    arrays = _load(data, len(names), log, archive)
    if arrays is None:
        return
    matrix, its_names = arrays[_MATRIX], arrays[archive.names]
    size = archive.each * len(names)
    complaint = _complaint_about_names(its_names, names, archive)
    if complaint:
        log.problem(archive.file, complaint, None, archive.names)
    if matrix.shape != (size, size) or matrix.dtype.kind != "f":
        log.problem(archive.file, _other_shape(matrix, size, archive), None, _MATRIX)
        return
    complaint = _complaint_about_matrix(matrix.astype(float))
    if complaint:
        log.problem(archive.file, complaint, None, _MATRIX)


def _other_shape(matrix, size, archive):
    """Message about a matrix of another shape or type."""
    given = {
        "name": matrix.dtype.name,
        "shape": str(matrix.shape),
        "value": str((size, size)),
        "count": size // archive.each,
    }
    if archive.each == 1:
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
    """Read the two arrays; their unpacked size is checked first. None if unreadable."""
    largest = 8 * (3 * n) ** 2 + 64 * 4 * n + 100_000  # matrix, names of 64 characters, headers
    required = (_MATRIX, archive.names)
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
            missing = [name for name in required if name not in arrays.files]
            for name in missing:
                log.problem(
                    archive.file,
                    message("covariance_array_missing", "missing array"),
                    None,
                    name,
                )
            if not missing:
                return {name: arrays[name] for name in required}
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


def _complaint_about_names(given_names, names, archive):
    """Message about names that differ from the table; None if they agree."""
    if given_names.dtype.kind != "U" or given_names.shape != (len(names),):
        return message(
            "covariance_names",
            "expected the {count} names of {table} as text, in its order",
            count=len(names),
            table=archive.table,
        )
    for position, (given, name) in enumerate(zip(given_names.tolist(), names, strict=True), 1):
        if name is not None and given != name:
            return message(
                "covariance_other_name",
                "name {position} is {found}; expected {wanted} as in {table}",
                position=position,
                found=shown(given),
                wanted=shown(name),
                table=archive.table,
            )
    return None


def _complaint_about_matrix(matrix):
    """Message about a matrix that is not a covariance matrix; None if it is."""
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
    # Judge correlations in place of covariances, so that the tolerance has no unit.
    sd = np.sqrt(variance)
    scale = np.where(sd > 0, sd, 1.0)
    correlation = matrix / scale[:, None] / scale[None, :]
    if np.any(np.abs(correlation - correlation.T) > TOLERANCE):
        return message("covariance_not_symmetric", "is not symmetric; expected a covariance matrix")
    # n times the tolerance shifts the eigenvalues by more than the rounding of the file.
    try:
        np.linalg.cholesky(correlation + TOLERANCE * len(matrix) * np.eye(len(matrix)))
    except np.linalg.LinAlgError:
        return message(
            "covariance_not_definite", "is not a covariance matrix; expected no negative eigenvalue"
        )
    return None
