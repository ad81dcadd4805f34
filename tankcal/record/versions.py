"""Which versions of the record are read, and what is added to an older one so that it is.

A key that comes, goes or changes its meaning makes a new version, once the last one has been
released: VERSION counts up, `layouts/N.txt` lists its keys, and a step below says what a record of
the version before gets for each of them. Every released version has kept records in tests/records.
"""

import re

from tankcal.errors import InputError, Problem
from tankcal.messages import listed, message
from tankcal.plain_data import columns_of
from tankcal.record.layout import layout_of, missing_keys

NAME = "tankcal-record"
VERSION = 2
FORMAT = f"{NAME}/{VERSION}"
MOST_NAMED = 3  # keys that are missing


def version_of(record):
    """The version of a record that can be read; None of anything else."""
    found = record.get("format") if isinstance(record, dict) else None
    match = re.fullmatch(rf"{NAME}/([0-9]{{1,4}})", found) if isinstance(found, str) else None
    version = int(match[1]) if match else None
    return version if version in (*_STEPS, VERSION) else None


def migrated(record, name):
    """A record of any version that can be read, as one of VERSION; the same when it is one.

    record  as parsed; it is not changed        name  of its file, for problems

    Raises InputError in one line, with the version, for what cannot be read.
    """
    version = version_of(record)
    if version is None:
        found = record.get("format") if isinstance(record, dict) else None
        expected = message(
            "record_of_other_format",
            "found format {found}, expected {expected} or an older version of it",
            found=repr(found), expected=repr(FORMAT),
        )  # fmt: skip
        raise InputError(Problem(name, expected))
    try:
        if version == 1:
            record = _completed_draft(record)
        missing = list(missing_keys(record, version))
        for step in range(version, VERSION) if not missing else ():
            record = _STEPS[step](record)
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        expected = message(
            "record_is_damaged",
            "found format {found}, but not what a record of that version holds ({what}); "
            "expected record.json as tankcal wrote it: run the job again",
            found=f"{NAME}/{version}", what=str(error),
        )  # fmt: skip
        raise InputError(Problem(name, expected)) from error
    if missing:
        expected = message(
            "record_lacks_keys",
            "found format {found} without {keys}, which every record of that version has; "
            "expected record.json as tankcal wrote it: run the job again",
            found=f"{NAME}/{version}", keys=listed(missing, MOST_NAMED),
        )  # fmt: skip
        raise InputError(Problem(name, expected))
    return record


def _completed_draft(record):
    """Version 1 from one of its drafts, which knew neither Monte Carlo nor deliveries."""
    record = {"budgets": [], "rule": None, "monte_carlo": None, "proportional_parts": None} | record
    new = {"deliveries": record.get("deliveries") or []}
    if isinstance(record.get("budget"), list):
        new["budget"] = [_NOT_IN_DRAFTS | line for line in record["budget"]]
    if isinstance(record.get("capacity"), dict) and "interval" not in record["capacity"]:
        new["capacity"] = record["capacity"] | _intervals_of_draft(**record["capacity"])
    job = record.get("job")
    if isinstance(job, dict) and isinstance(job.get("table"), dict):
        new["job"] = job | {"table": {"monte_carlo": False} | job["table"]}
    return record | new


_NOT_IN_DRAFTS = {"estimate": None, "halved": None, "is_default": None}


def _intervals_of_draft(volume_m3=(), U_m3=(), **_):
    """Without intervals in the record, those of the law of propagation counted."""
    pairs = list(zip(volume_m3, U_m3, strict=False))
    return {
        "low_m3": [volume - U for volume, U in pairs],
        "high_m3": [volume + U for volume, U in pairs],
        "interval": ["gum"] * len(pairs),
        "stated_U_m3": U_m3,
    }


def _from_1(record):
    """Version 2 from version 1: readings in columns, what held coordinates react with unknown."""
    adjustment = record["adjustment"]
    if adjustment is not None:
        names = layout_of(2)["adjustment"]["residuals"]
        columns = columns_of(adjustment["residuals"], names)
        adjustment = {"held": []} | adjustment | {"residuals": columns}
    return record | {"format": f"{NAME}/2", "adjustment": adjustment}


_STEPS = {1: _from_1}
