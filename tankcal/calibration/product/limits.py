"""Limit tables of products as data: the shipped one of the Brazilian standard, or one's own file.

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

Classes stand from the best to the worst.
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
    """What one class of one scale asks for.

    part         "plan" or "height"      scale  as the file names it, such as "1000"
    grade        name of the class       tolerance_m  that a share of the points must keep (PEC)
    sd_m         bound of the RMSE (EP); in plan it is that of both coordinates together
    """

    part: str
    scale: str
    grade: str
    tolerance_m: float
    sd_m: float


@dataclass(frozen=True)
class LimitTable:
    """A limit table: its limits by part and scale, the best class first.

    verified  whether the numbers were read in the legal or technical text itself; None: not said
    share     of the points that must lie within the tolerance, 0 to 1
    code      of a table that ships with tankcal: its source and remark have words; None: one's own
    """

    name: str
    source: str
    limits: tuple[Limit, ...]
    share: float = _DEFAULT_SHARE
    verified: bool | None = None
    remark: str = ""
    code: str | None = None


def limits_of_scale(table, scale):
    """The limits of one scale only.

    Parameters
    ----------
    table : LimitTable
        All limits.
    scale : number
        Denominator of the scale.

    Returns
    -------
    LimitTable

    Raises
    ------
    InputError
        When the table has no such scale.

    Examples
    --------
    >>> limits_of_scale(shipped_limits(), 2000).limits[0]
    Limit(part='plan', scale='2000', grade='A', tolerance_m=0.56, sd_m=0.34)
    """
    name = f"{scale:g}"
    chosen = tuple(one for one in table.limits if one.scale == name)
    if not chosen:
        known = ", ".join(dict.fromkeys(one.scale for one in table.limits))
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
    """A table of limits that ships: "pec_pcd", the Brazilian standard of digital maps.

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
    """Read the table of limits of a TOML file.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    LimitTable

    Raises
    ------
    InputError
        With every problem of the file.
    """
    path, log = Path(path), Log()
    data = read_bytes(path, log, MAX_BYTES)
    settings = None
    if data is not None:
        settings, sections = read_toml(path.name, data, log)
    log.stop_if_problems()
    given = settings.pop("table", {})
    values = _values(path.name, "table", _TABLE, given, sections.get("table"), log)
    limits = _limits(path.name, settings, sections, log)
    log.stop_if_problems()
    return LimitTable(
        name=values["name"],
        source=values["source"],
        limits=limits,
        share=_DEFAULT_SHARE if values["share"] is None else values["share"],
        verified=values["verified"],
        remark=values["remark"] or "",
    )


def _values(file, section, fields, given, row, log):
    """{key: value or None} of a section; what is wrong goes to the log."""
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


def _limits(file, settings, sections, log):
    """The limits of all sections such as plan.1000.A, in the order of the file."""
    found = []
    for section, given in settings.items():
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
            values = _values(file, section, _LIMIT, given, row, log)
            if None not in values.values():
                found.append(Limit(part, scale, grade, **values))
        elif given:
            expected = message(
                "limits_no_classes",
                "expected classes such as A = {{tolerance_m = 0.28, sd_m = 0.17}}",
            )
            log.problem(file, expected, row, f"[{section}]")
    if not (found or log.problems):
        log.problem(
            file, message("limits_none", "no limits; expected sections such as [plan.1000]")
        )
    _tell_disorder(file, found, sections, log)
    return tuple(found)


def _tell_disorder(file, limits, sections, log):
    """A problem for each class that asks for more than the one before it."""
    before = {}
    for one in limits:
        place = one.part, one.scale
        last = before.get(place, (-math.inf, -math.inf))
        now = one.tolerance_m, one.sd_m
        if now[0] < last[0] or now[1] < last[1]:
            section = f"{one.part}.{one.scale}.{one.grade}"
            expected = message(
                "limits_disorder", "smaller than the class before it; expected the best class first"
            )
            log.problem(file, expected, sections.get(section), section)
        before[place] = now
