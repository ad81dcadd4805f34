"""The versions of camera.json, and what is added to an older one so that it is of the last."""

from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Saved, key

VERSION = 2
KINDS = ("stability", "parameters", "influence", "product")


def _from_1(result):
    """Version 2 from version 1, whose comparisons drew one terrain and knew no scatter."""
    result = result | {"format": "tankcal-camera/2"}
    if result["kind"] != "stability":
        return result
    terrain = result["terrain"] and {"terrains": 1} | result["terrain"]
    pairs = [{"scatter_px": None} | pair for pair in result["pairs"]]
    random = {"terrain_random": {"terrains": 1}}
    conventions = [random.get(one["code"], {}) | one for one in result["conventions"]]
    return result | {"terrain": terrain, "pairs": pairs, "conventions": conventions}


CAMERA = SavedFormat("tankcal-camera", VERSION, "camera.json", {1: _from_1}, KINDS)
FORMAT = CAMERA.format  # of the plain data that every analysis gives


class CameraFile(Saved, kw_only=True):
    """What all kinds of camera.json have."""

    format: str = key("see Versions", default=FORMAT)
    kind: str = key("one of: " + ", ".join(KINDS))
    made_from: dict | None = key("files, version and job", optional=True, default=None)
