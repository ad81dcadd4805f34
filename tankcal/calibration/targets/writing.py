"""Writing of image_points.csv and of the list of refused candidates, both or neither."""

import io
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tankcal.calibration.targets.found import REASONS
from tankcal.errors import InputError, Problem, reason_of
from tankcal.messages import message
from tankcal.text.spreadsheets import write_guarded

HEADINGS = ("photo", "point", "column_px", "line_px", "s_px")
REFUSED_HEADINGS = ("photo", "code", "id", "column_px", "line_px", "detail", "reason")


@dataclass(frozen=True)
class ImagePoint:
    """Measured image point: name, column and line (2,), standard deviation of each, px."""

    point: str
    place_px: np.ndarray
    sd_px: float


@dataclass(frozen=True)
class PhotoReading:
    """Result of the measurement of one photo.

    Attributes
    ----------
    photo : str
        Name of the photo.
    size_px : tuple of int
        Columns and lines.
    orientation : int
        Orientation tag of the file (1: no rotation). It is not applied.
    targets : tuple of str
        Names of the targets, without suffixes of corners.
    points : tuple of ImagePoint
        Image points.
    refused : tuple of Refused
        Refused candidates.
    """

    photo: str
    size_px: tuple
    orientation: int
    targets: tuple
    points: tuple
    refused: tuple


def refused_path(path):
    """Path of the list of refused candidates: image_points_refused.csv for image_points.csv."""
    path = Path(path)
    return path.with_name(f"{path.stem}_refused.csv")


def _message_exists():
    return message(
        "targets_there_already",
        "already exists; expected another name, or the choice to replace it",
    )


def check_free(path, replace, log):
    """Log a problem if the folder is missing, or if a file exists and `replace` is false."""
    for file in (Path(path), refused_path(path)):
        if not file.parent.is_dir():
            log.problem(file.name, message("targets_no_folder", "its folder does not exist"))
            return
        if file.exists() and not replace:
            log.problem(file.name, _message_exists())


def write_image_points(photos, path, replace=False):
    """Write image_points.csv and the list of refused candidates.

    Parameters
    ----------
    photos : sequence of PhotoReading
        Results of the photos, in the order of the rows.
    path : path-like
        Path of image_points.csv.
    replace : bool, optional
        Whether existing files may be overwritten.

    Returns
    -------
    tuple of Path
        Paths of both files.

    Raises
    ------
    InputError
        If a file exists or cannot be written. No file is then written.
    """
    existing = [item.name for item in (Path(path), refused_path(path)) if item.exists()]
    if existing and not replace:
        expected = _message_exists()
        raise InputError([Problem(name, expected) for name in existing])
    rows = [
        (photo.photo, item.point, *(f"{x:.4f}" for x in item.place_px), f"{item.sd_px:.4f}")
        for photo in photos
        for item in photo.points
    ]
    refused = [_refused_row(photo.photo, item) for photo in photos for item in photo.refused]
    texts = {
        refused_path(path): _format_csv(REFUSED_HEADINGS, refused),
        Path(path): _format_csv(HEADINGS, rows),
    }
    drafts = {target: target.with_name(f".{target.name}.part") for target in texts}
    try:
        for target, text in texts.items():
            drafts[target].write_text(text, encoding="utf-8", newline="")
        for target, draft in drafts.items():
            os.replace(draft, target)
    except OSError as error:
        for draft in drafts.values():
            draft.unlink(missing_ok=True)
        raise InputError(
            Problem(
                Path(path).name,
                message(
                    "targets_not_written", "cannot be written ({reason})", reason=reason_of(error)
                ),
            )
        ) from None
    return Path(path), refused_path(path)


def _refused_row(photo, refused):
    column, line = refused.place_px
    detail = "; ".join(f"{key} {value:.3g}" for key, value in refused.detail.items())
    number = "" if refused.id is None else refused.id
    return (
        photo,
        refused.code,
        number,
        f"{column:.1f}",
        f"{line:.1f}",
        detail,
        REASONS[refused.code],
    )


def _format_csv(headings, rows):
    """Format rows as CSV; a cell with a comma is quoted, and no cell contains a line break."""
    stream = io.StringIO()
    write_guarded(stream, [headings, *rows])
    return stream.getvalue()
