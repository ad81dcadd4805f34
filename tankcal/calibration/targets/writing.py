"""image_points.csv and the list of what was refused, both or none."""

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
    """A measured image point: name, (2,) column and line, standard deviation of both, px."""

    point: str
    place_px: np.ndarray
    sd_px: float


@dataclass(frozen=True)
class PhotoReading:
    """What was read in one photo.

    Attributes
    ----------
    photo : str
        Its name.
    size_px : tuple
        (columns, lines).
    orientation : int
        What its file says about turning it, 1: nothing; never applied.
    targets : tuple
        Names of the targets, before corners.
    points : tuple
        ImagePoints.
    refused : tuple
        Refused.
    """

    photo: str
    size_px: tuple
    orientation: int
    targets: tuple
    points: tuple
    refused: tuple


def refused_path(path):
    """Where the list of the refused goes: image_points_refused.csv for image_points.csv."""
    path = Path(path)
    return path.with_name(f"{path.stem}_refused.csv")


def _there_already():
    return message(
        "targets_there_already",
        "already exists; expected another name, or the choice to replace it",
    )


def check_free(path, replace, log):
    """Tell `log` of what stands in the way of writing."""
    for one in (Path(path), refused_path(path)):
        if not one.parent.is_dir():
            log.problem(one.name, message("targets_no_folder", "its folder does not exist"))
            return
        if one.exists() and not replace:
            log.problem(one.name, _there_already())


def write_image_points(photos, path, replace=False):
    """Write image_points.csv and the list of the refused beside it: (2,) their paths.

    Parameters
    ----------
    photos
        PhotoReadings; rows in their order.
    replace : optional
        Whether files that are there may be overwritten.

    Raises
    ------
    InputError
        For files that are there already, or cannot be written; then none is.
    """
    taken = [one.name for one in (Path(path), refused_path(path)) if one.exists()]
    if taken and not replace:
        expected = _there_already()
        raise InputError([Problem(name, expected) for name in taken])
    rows = [
        (photo.photo, one.point, *(f"{x:.4f}" for x in one.place_px), f"{one.sd_px:.4f}")
        for photo in photos
        for one in photo.points
    ]
    refused = [_refused_row(photo.photo, one) for photo in photos for one in photo.refused]
    texts = {
        refused_path(path): _text(REFUSED_HEADINGS, refused),
        Path(path): _text(HEADINGS, rows),
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


def _refused_row(photo, one):
    column, line = one.place_px
    detail = "; ".join(f"{key} {value:.3g}" for key, value in one.detail.items())
    number = "" if one.id is None else one.id
    return photo, one.code, number, f"{column:.1f}", f"{line:.1f}", detail, REASONS[one.code]


def _text(headings, rows):
    """CSV; a comma within a cell is quoted, a line break cannot be there."""
    stream = io.StringIO()
    write_guarded(stream, [headings, *rows])
    return stream.getvalue()
