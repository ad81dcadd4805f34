"""Summary values of the files written by a step, and the input of inspections."""

import json
from collections import Counter
from pathlib import Path

from tankcal.batch.finding import RECORD, SAVED
from tankcal.job.folder import OF_INSPECTIONS
from tankcal.job.tables import SETTINGS_FILE
from tankcal.record.inspection import VERDICTS


def values_of(step, folder):
    """Return ({name: value} for the summary, warnings as plain data) from the folder of a step."""
    saved = next((folder / name for name in SAVED if (folder / name).is_file()), None)
    if saved is None:
        return {}, []
    results = json.loads(saved.read_bytes())
    return _READERS[saved.name](results), results["warnings"]


def _of_record(record):
    job, table, adjustment = record["job"], record["capacity"], record["adjustment"]
    tank = job["tank"] or {}
    values = {
        "tank": tank.get("id"),
        "kind": tank.get("kind"),
        "date": (job["survey"] or {}).get("date"),
        "global_test": adjustment["passed"] if adjustment else None,
        "rule": record["rule"]["rule"]["name"] if record.get("rule") else None,
        "rule_verdict": record["rule"]["code"] if record.get("rule") else None,
    }
    if table:
        values |= {
            "height_m": table["height_m"][-1],
            "volume_m3": table["volume_m3"][-1],
            "U_m3": table["stated_U_m3"][-1],
        }
    return values


def _read_comparison(comparison):
    last = comparison["waterfall"][-1] if comparison["waterfall"] else None
    return {
        "comparison_verdict": comparison["verdict"] or "none",
        "former_m3": last and last["former_m3"],
        "of_tank_m3": last and last["tank_m3"],
    }


def _read_inspection(inspection):
    counts = Counter(check["verdict"] for check in inspection["checks"])
    worst = next((verdict for verdict in VERDICTS if counts[verdict]), None)
    return {"tank": inspection["tank"]["id"], "inspection_verdict": worst}


_READERS = dict(zip(SAVED, (_of_record, _read_comparison, _read_inspection), strict=True))


def source_of_inspection(job, results):
    """Return the input of the inspection of a job: (source, rule or None, {settlement, edges}).

    An inspection uses the record computed by this batch in the folder `results`, with the levelling
    tables and the rule beside the job. For clouds it uses the job, because a record contains no
    welds.
    """
    record = results / RECORD
    if "run" not in job.asked.do:
        return job.source, None, {}
    saved = json.loads(record.read_bytes())
    if saved.get("clouds"):
        return job.source, None, {}
    path = Path(job.source)
    folder = path if path.is_dir() else path.parent
    levelled = {
        name: folder / file if (folder / file).is_file() else None
        for name, file in zip(("settlement", "edges"), OF_INSPECTIONS, strict=True)
    }
    rule = (saved["job"].get("inspection") or {}).get("rule")
    is_file = rule is not None and rule.lower().endswith(".toml")
    return record, str(folder / rule) if is_file else None, levelled


def language_of(source):
    """Return the language of a job, or of the job of a record; None if it cannot be read."""
    path = Path(source)
    if path.name in SAVED:
        try:
            return json.loads(path.read_bytes())["job"]["table"]["language"]
        except (OSError, ValueError, LookupError, TypeError):
            return None
    import tankcal

    job = tankcal.load(path.parent if path.name == SETTINGS_FILE else path)
    return job.table.language
