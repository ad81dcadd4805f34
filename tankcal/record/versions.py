"""The versions of the record, and what is added to an older one so that it is of the last."""

from tankcal.record.columns import columns_of
from tankcal.record.covariance_factor import in_blocks
from tankcal.record.saved_formats import SavedFormat

VERSION = 2


def _completed_draft(record, version):
    """A version from one of its drafts: of 1, which knew neither Monte Carlo nor deliveries."""
    if version != 1:
        return _with_factor_in_blocks(record)
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
    adjustment = record.get("adjustment")
    if adjustment is not None and "residuals" in adjustment:
        columns = columns_of(adjustment["residuals"], _READING)
        adjustment = {"held": []} | adjustment | {"residuals": columns}
        record = record | {"adjustment": adjustment}
    return _with_factor_in_blocks(record) | {"format": "tankcal-record/2"}


def _with_factor_in_blocks(record):
    """A record of version 2 from 1 or a draft of 2, which had the whole factor of the table."""
    capacity = record.get("capacity")
    if not isinstance(capacity, dict) or "factor_m3" not in capacity:
        return record
    return record | {"capacity": in_blocks(capacity)}


_READING = (
    "kind", "ids", "element", "file", "row", "repeats", "unit", "value", "residual", "sd",
    "redundancy", "w", "tau", "mdb", "effect_m", "removed", "check", "controlled",
)  # fmt: skip


RECORD = SavedFormat(
    "tankcal-record", VERSION, "record.json", {1: _from_1}, completed=_completed_draft
)
FORMAT = RECORD.format
migrated, version_of = RECORD.migrated, RECORD.version_of
