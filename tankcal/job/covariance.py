"""points_cov.npz: the full covariance matrix of the points, read with care.

The archive holds `covariance_m2` (3n, 3n), m2, in the order x, y, z of each point of points.csv,
and `points` (n,), their names in that order. Nothing in it is ever unpickled.
"""

import io
import zipfile
import zlib

import numpy as np

from tankcal.job.tables import COVARIANCE_FILE, shown
from tankcal.messages import message

MAX_POINTS = 2500  # the matrix is 450 MB then
TOLERANCE = 1e-8  # of a correlation
_MATRIX, _NAMES = "covariance_m2", "points"


def read_covariance(data, names, log):
    """The (3n, 3n) covariance in m2 of the points called `names`, or None after telling `log`."""
    if len(names) > MAX_POINTS:
        expected = message(
            "covariance_too_many",
            "{count} points; expected at most {most} with a full covariance",
            count=len(names),
            most=MAX_POINTS,
        )
        log.problem(COVARIANCE_FILE, expected)
        return None
    arrays = _load(data, len(names), log)
    if arrays is None:
        return None
    matrix, its_names = arrays[_MATRIX], arrays[_NAMES]
    size = 3 * len(names)
    complaint = _complaint_about_names(its_names, names)
    if complaint:
        log.problem(COVARIANCE_FILE, complaint, None, _NAMES)
    if matrix.shape != (size, size) or matrix.dtype.kind != "f":
        expected = message(
            "covariance_shape",
            "found {name} of shape {shape}; expected floating-point numbers of shape {value}: x, "
            "y, z of {count} points",
            name=matrix.dtype.name,
            shape=str(matrix.shape),
            value=str((size, size)),
            count=len(names),
        )
        log.problem(COVARIANCE_FILE, expected, None, _MATRIX)
        return None
    matrix = matrix.astype(float)
    complaint = _complaint_about_matrix(matrix)
    if complaint:
        log.problem(COVARIANCE_FILE, complaint, None, _MATRIX)
        return None
    return (matrix + matrix.T) / 2


def _load(data, n, log):
    """The two arrays, after a look at what they would unpack to."""
    largest = 8 * (3 * n) ** 2 + 64 * 4 * n + 100_000  # matrix, names of 64 characters, headers
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            unpacked = sum(member.file_size for member in archive.infolist())
        if unpacked > largest:
            expected = message(
                "covariance_unpacks",
                "unpacks to {unpacked} bytes, more than the covariance of {n} points needs",
                unpacked=unpacked,
                n=n,
            )
            log.problem(COVARIANCE_FILE, expected, None, _MATRIX)
            return None
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            missing = [name for name in (_MATRIX, _NAMES) if name not in archive.files]
            for name in missing:
                log.problem(
                    COVARIANCE_FILE,
                    message("covariance_array_missing", "missing array"),
                    None,
                    name,
                )
            if not missing:
                return {name: archive[name] for name in (_MATRIX, _NAMES)}
    except (ValueError, OSError, EOFError, KeyError, TypeError, SyntaxError, MemoryError):
        _tell_damaged(log)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, OverflowError):
        _tell_damaged(log)
    return None


def _tell_damaged(log):
    expected = message(
        "covariance_damaged",
        "cannot be read; expected a numpy .npz with plain arrays {matrix} and {names}",
        matrix=_MATRIX,
        names=_NAMES,
    )
    log.problem(COVARIANCE_FILE, expected)


def _complaint_about_names(found, names):
    if found.dtype.kind != "U" or found.shape != (len(names),):
        return message(
            "covariance_names",
            "expected the {count} names of points.csv as text, in its order",
            count=len(names),
        )
    for position, (one, other) in enumerate(zip(found.tolist(), names, strict=True), 1):
        if other is not None and one != other:
            return message(
                "covariance_other_name",
                "name {position} is {found}; expected {wanted} as in points.csv",
                position=position,
                found=shown(one),
                wanted=shown(other),
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
