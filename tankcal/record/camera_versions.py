"""Versions of camera.json, and the migration of older versions."""

from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Saved, key

VERSION = 2
KINDS = ("stability", "parameters", "influence", "product")


def _migrate_1(result):
    """Convert version 1 to 2; comparisons of version 1 have a single terrain and no scatter."""
    result = result | {"format": "tankcal-camera/2"}
    if result["kind"] != "stability":
        return result
    terrain = result["terrain"] and {"terrains": 1} | result["terrain"]
    pairs = [{"scatter_px": None} | pair for pair in result["pairs"]]
    random = {"terrain_random": {"terrains": 1}}
    conventions = [random.get(choice["code"], {}) | choice for choice in result["conventions"]]
    return result | {"terrain": terrain, "pairs": pairs, "conventions": conventions}


CAMERA = SavedFormat("tankcal-camera", VERSION, "camera.json", {1: _migrate_1}, KINDS)
FORMAT = CAMERA.format


class CameraFile(Saved, kw_only=True):
    """Keys common to all kinds of camera.json."""

    format: str = key("see Versions", default=FORMAT)
    kind: str = key("one of: " + ", ".join(KINDS))
    made_from: dict | None = key("files, version and job", optional=True, default=None)
