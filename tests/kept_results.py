"""Results of the camera's analyses and plans of released versions that are kept.

python tests/kept_results.py FOLDER   keeps the *.json of a folder, and lists their keys
"""

import gzip
import json
import sys
from pathlib import Path

from schemas import keys_in

from tankcal.record.plan import PLAN
from tankcal.record.versions import CAMERA

KEPT = Path(__file__).with_name("kept")
FREE = (
    "conventions[]", "recommendation[].reasons[]", "warnings[].values", "survey.datum.words_values",
)  # fmt: skip
# FREE: any keys
FORMATS = (CAMERA, PLAN)


def kept_files():
    """[(SavedFormat, version, path)] of all that is kept."""
    return [
        (one, int(path.parent.name), path)
        for one in FORMATS
        for path in sorted((KEPT / one.name).glob("*/*.json.gz"))
    ]


def read(path):
    """What a kept file holds."""
    return json.loads(gzip.decompress(path.read_bytes()))


def keys_file(path):
    """Path of the list of the keys of a kept file."""
    return path.with_name(path.name.replace(".json.gz", ".txt"))


def keep(path):
    """Keep a result, as written, under its format and version, with the list of its keys."""
    saved = json.loads(path.read_text(encoding="utf-8"))
    name, version = saved["format"].split("/")
    (one,) = (one for one in FORMATS if one.name == name)
    kind = saved["kind"] if one.kinds else path.stem
    place = KEPT / name / version / f"{kind}.json.gz"
    place.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(saved, ensure_ascii=False, separators=(",", ":"))
    place.write_bytes(gzip.compress(text.encode("utf-8"), mtime=0))
    keys = "\n".join(sorted(keys_in(saved, FREE))) + "\n"
    keys_file(place).write_text(keys, encoding="utf-8")


if __name__ == "__main__":
    for one in sorted(Path(sys.argv[1]).glob("*.json")):
        keep(one)
