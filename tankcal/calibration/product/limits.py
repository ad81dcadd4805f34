"""Tables of limits for products: the included table of the Brazilian standard, or a TOML file.

A table is a TOML file:

    [table]
    name = "PEC-PCD"
    source = "where the numbers were read"
    verified = false            # true: read in the legal or technical text itself
    remark = "..."              # optional
    share = 0.90                # of the points that must lie within the tolerance

    [plan.1000]                 # plan or height, then the scale (or any other name)
    A = {tolerance_m = 0.28, sd_m = 0.17}
    B = {tolerance_m = 0.50, sd_m = 0.30}

    [height.1000]
    A = {tolerance_m = 0.50, sd_m = 0.33}

The classes are listed from the best to the worst.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.job.entries import read_setting
from tankcal.job.fields import Field
from tankcal.job.folder import read_toml
from tankcal.job.tables import Log, nearest, read_bytes
from tankcal.messages import message
from tankcal.text.shipped import shipped_folder

PARTS = ("plan", "height")
SHIPPED = "pec_pcd"
MAX_BYTES = 1_000_000
_TABLE = {
    field.name: field
    for field in (
        Field("name", "text", message("limits_note_name", "name of the table"), required=True),
        Field(
            "source",
            "text",
            message("limits_note_source", "where its numbers were published"),
            required=True,
        ),
        Field("verified", "flag", "whether they were read in the legal or technical text itself"),
        Field("remark", "text", "anything that is to stand beside it"),
        Field("share", "number", "share of the points within the tolerance", low=0, high=1),
    )
}
_LIMIT = {
    name: Field(name, "number", note, required=True, low=0, high=1e5, above_low=True)
    for name, note in (("tolerance_m", "tolerance"), ("sd_m", "standard error"))
}
_DEFAULT_SHARE = 0.9


@dataclass(frozen=True)
class Limit:
    """Limits of one class of one scale.

    Attributes
    ----------
    part : str
        "plan" or "height".
    scale : str
        Name of the scale in the file, such as "1000".
    grade : str
        Name of the class.
    tolerance_m : float
        Tolerance for a share of the points (PEC), m.
    sd_m : float
        Largest RMSE (EP), m; in plan of both coordinates together.
    """

    part: str
    scale: str
    grade: str
    tolerance_m: float
    sd_m: float


@dataclass(frozen=True)
class LimitTable:
    """Table of limits by part and scale, the best class first.

    Attributes
    ----------
    name, source, remark : str
        Name, source and remark of the table.
    limits : tuple of Limit
        Limits in the order of the file.
    share : float
        Share of the points that must lie within the tolerance, 0 to 1.
    verified : bool or None
        Whether the numbers were read in the legal or technical text itself; None if not stated.
    code : str or None
        Code of a table that is part of tankcal, or None for a file of the user.
    """

    name: str
    source: str
    limits: tuple[Limit, ...]
    share: float = _DEFAULT_SHARE
    verified: bool | None = None
    remark: str = ""
    code: str | None = None


def limits_of_scale(table, scale):
    """Restrict a table to the limits of one scale.

    Parameters
    ----------
    table : LimitTable
        Table of limits.
    scale : float
        Denominator of the scale.

    Returns
    -------
    LimitTable

    Raises
    ------
    InputError
        If the table has no such scale.

    Examples
    --------
    >>> limits_of_scale(shipped_limits(), 2000).limits[0]
    Limit(part='plan', scale='2000', grade='A', tolerance_m=0.56, sd_m=0.34)
    """
    name = f"{scale:g}"
    chosen = tuple(limit for limit in table.limits if limit.scale == name)
    if not chosen:
        known = ", ".join(dict.fromkeys(limit.scale for limit in table.limits))
        raise InputError(
            Problem(
                table.name,
                message(
                    "limits_no_scale",
                    "found no scale {scale}; expected one of {known}",
                    scale=name,
                    known=known,
                ),
            )
        )
    return replace(table, limits=chosen)


def shipped_limits(name=SHIPPED):
    """Read a table of limits of tankcal: "pec_pcd", the Brazilian standard of digital maps.

    Parameters
    ----------
    name : str, optional
        Name of the table.

    Returns
    -------
    LimitTable

    Examples
    --------
    >>> shipped_limits().name
    'PEC-PCD'
    """
    folder = shipped_folder("calibration/product/limit_tables")
    return replace(read_limits(folder / f"{name}.toml"), code=name)


def read_limits(path):
    """Read a table of limits from a TOML file.

    Returns
    -------
    LimitTable

    Raises
    ------
    InputError
        If the file is invalid; the error lists all problems.
    """
    path, log = Path(path), Log()
    data = read_bytes(path, log, MAX_BYTES)
    settings = None
    if data is not None:
        settings, sections = read_toml(path.name, data, log)
    log.stop_if_problems()
    given = settings.pop("table", {})
    values = _read_values(path.name, "table", _TABLE, given, sections.get("table"), log)
    limits = _read_limit_sections(path.name, settings, sections, log)
    log.stop_if_problems()
    return LimitTable(
        name=values["name"],
        source=values["source"],
        limits=limits,
        share=_DEFAULT_SHARE if values["share"] is None else values["share"],
        verified=values["verified"],
        remark=values["remark"] or "",
    )


def _read_values(file, section, fields, given, row, log):
    """Return {key: value or None} of a section; problems are added to the log."""
    for key in given.keys() - fields.keys():
        known = ", ".join(fields)
        expected = message(
            "limits_unknown_key",
            "unknown key; expected {known}{hint}",
            known=known,
            hint=nearest(key, fields),
        )
        log.problem(file, expected, given[key].row or row, f"{section}.{key}")
    values = {
        name: read_setting(
            file, f"{section}.{name}", field, given.get(name), None, log, field.required, row
        )
        for name, field in fields.items()
    }
    if values.get("share") == 0:
        log.problem(
            file,
            message("limits_no_share", "found 0; expected a share above 0, at most 1"),
            row,
            "table.share",
        )
    return values


def _read_limit_sections(file, settings, sections, log):
    """Read the limits of all sections such as plan.1000.A, in the order of the file."""
    limits = []
    for section, entries in settings.items():
        part, _, rest = section.partition(".")
        scale, _, grade = rest.partition(".")
        row = sections.get(section)
        if part not in PARTS:
            hint = nearest(part, PARTS)
            expected = message(
                "limits_unknown_section",
                "unknown section; expected [table], [plan.SCALE] or [height.SCALE]{hint}",
                hint=hint,
            )
            log.problem(file, expected, row, f"[{section}]")
        elif grade and "." not in grade:
            values = _read_values(file, section, _LIMIT, entries, row, log)
            if None not in values.values():
                limits.append(Limit(part, scale, grade, **values))
        elif entries:
            expected = message(
                "limits_no_classes",
                "expected classes such as A = {{tolerance_m = 0.28, sd_m = 0.17}}",
            )
            log.problem(file, expected, row, f"[{section}]")
    if not (limits or log.problems):
        log.problem(
            file, message("limits_none", "no limits; expected sections such as [plan.1000]")
        )
    _log_disorder(file, limits, sections, log)
    return tuple(limits)


def _log_disorder(file, limits, sections, log):
    """Add a problem to the log for each class with smaller limits than the class before it."""
    before = {}
    for limit in limits:
        place = limit.part, limit.scale
        last = before.get(place, (-math.inf, -math.inf))
        now = limit.tolerance_m, limit.sd_m
        if now[0] < last[0] or now[1] < last[1]:
            section = f"{limit.part}.{limit.scale}.{limit.grade}"
            expected = message(
                "limits_disorder", "smaller than the class before it; expected the best class first"
            )
            log.problem(file, expected, sections.get(section), section)
        before[place] = now
