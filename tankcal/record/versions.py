"""Versions of the record and of camera.json, and the migration of older versions."""

from tankcal.record.columns import columns_of
from tankcal.record.covariance_factor import wrap_factor
from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Saved, key

VERSION = 2
_READING = (  # columns of readings
    "kind", "ids", "element", "file", "row", "repeats", "unit", "value", "residual", "sd",
    "redundancy", "w", "tau", "mdb", "effect_m", "removed", "check", "controlled",
)  # fmt: skip
# Keys of a budget line that drafts of version 1 lack.
_LATER_KEYS = {"estimate": None, "halved": None, "is_default": None}


def _complete_draft(record, version):
    """Add the keys that drafts of a version lack; drafts of 1 had no Monte Carlo or deliveries."""
    if version != 1:
        return _replace_factor(record)
    record = {"budgets": [], "rule": None, "monte_carlo": None, "proportional_parts": None} | record
    added = {"deliveries": record.get("deliveries") or []}
    if isinstance(record.get("budget"), list):
        added["budget"] = [_LATER_KEYS | line for line in record["budget"]]
    if isinstance(record.get("capacity"), dict) and "interval" not in record["capacity"]:
        added["capacity"] = record["capacity"] | _gum_intervals(**record["capacity"])
    job = record.get("job")
    if isinstance(job, dict) and isinstance(job.get("table"), dict):
        added["job"] = job | {"table": {"monte_carlo": False} | job["table"]}
    return record | added


def _gum_intervals(volume_m3=(), U_m3=(), **_):
    """Return the columns of the intervals of a draft, which were all results of the GUM."""
    pairs = list(zip(volume_m3, U_m3, strict=False))
    return {
        "low_m3": [volume - U for volume, U in pairs],
        "high_m3": [volume + U for volume, U in pairs],
        "interval": ["gum"] * len(pairs),
        "stated_U_m3": U_m3,
    }


def _migrate_1(record):
    """Convert version 1 to 2: readings in columns; released values of held ones are unknown."""
    adjustment = record.get("adjustment")
    if adjustment is not None and "residuals" in adjustment:
        columns = columns_of(adjustment["residuals"], _READING)
        adjustment = {"held": []} | adjustment | {"residuals": columns}
        record = record | {"adjustment": adjustment}
    return _replace_factor(record) | {"format": "tankcal-record/2"}


def _replace_factor(record):
    """Replace the whole factor of the table, as in version 1 and drafts of 2, by a block."""
    capacity = record.get("capacity")
    if not isinstance(capacity, dict) or "factor_m3" not in capacity:
        return record
    return record | {"capacity": wrap_factor(capacity)}


RECORD = SavedFormat(
    "tankcal-record", VERSION, "record.json", {1: _migrate_1}, complete=_complete_draft
)
FORMAT = RECORD.format
migrated, version_of = RECORD.migrated, RECORD.version_of

CAMERA_KINDS = ("stability", "parameters", "influence", "product")


def _migrate_camera_1(result):
    """Convert version 1 to 2; comparisons of version 1 have a single terrain and no scatter."""
    result = result | {"format": "tankcal-camera/2"}
    if result["kind"] != "stability":
        return result
    terrain = result["terrain"] and {"terrains": 1} | result["terrain"]
    pairs = [{"scatter_px": None} | pair for pair in result["pairs"]]
    random = {"terrain_random": {"terrains": 1}}
    conventions = [random.get(choice["code"], {}) | choice for choice in result["conventions"]]
    return result | {"terrain": terrain, "pairs": pairs, "conventions": conventions}


CAMERA = SavedFormat("tankcal-camera", 2, "camera.json", {1: _migrate_camera_1}, CAMERA_KINDS)


class CameraFile(Saved, kw_only=True):
    """Keys common to all kinds of camera.json."""

    format: str = key("see Versions", default=CAMERA.format)
    kind: str = key("one of: " + ", ".join(CAMERA_KINDS))
    made_from: dict | None = key("files, version and job", optional=True, default=None)
