"""A saved comparison, and what may be different about one: no U, a roof, texts of a user."""

import copy
import json
from pathlib import Path

SAVED = json.loads(
    (Path(__file__).parents[1] / "recalibration" / "comparison.json").read_text("utf-8")
)
HOSTILE = '=HYPERLINK("http://x.example","y") <script>alert(1)</script>'
NAME = f"{HOSTILE} {'very_long_name_of_a_file_' * 4}.csv"
OF_E_N = ("c", "worst_E_n", "worst_E_n_at_half", "c_limit", "coverage_k")
OF_FORMER = ("k", "U_top_m3", "U_of_deliveries", "laboratory", "number", "date")


def plain():
    """The comparison that a run made."""
    return copy.deepcopy(SAVED)


def without_uncertainty():
    """U of the former table is not known, its temperature not either; nothing to judge by."""
    found = plain()
    count = len(found["rows"]["height_m"])
    found["rows"] |= {key: [None] * count for key in ("U_former_m3", "E_n", "c_limit")}
    nothing = dict.fromkeys(("U_former_m3", "E_n", "c_limit"))
    found["deliveries"] = [o | nothing for o in found["deliveries"] if o["by"] == "relative"]
    found["correlation"] |= dict.fromkeys(OF_E_N) | {"source": "not_declared"}
    found["former"] |= dict.fromkeys(OF_FORMER)
    found["courses"] = [one | {"u_m": None, "w": None} for one in found["courses"]]
    found["steps"][1] |= {
        "state": "not_declared", "source": None, "former": None, "top_m3": 0.0, "largest_m3": 0.0,
        "lacking": ["former.reference_temperature_c"],
    }  # fmt: skip
    read = {"table": "former", "u": 5.2, "unit": "kg/m3", "sure": "sure", "used": True}
    found["read"] = [
        read | {"code": "head_with", "value": 853.1},
        read | {"code": "head_without", "value": 3.1},
        read | {"code": "head_undecided", "value": None, "u": None, "sure": "doubtful"},
    ]
    reasons = [{"code": "nothing_to_judge", "values": {}}]
    return found | {"tank": None, "legal": [], "ages": [], "verdict": None, "reasons": reasons}


def hostile():
    """Texts that a spreadsheet, a browser or a typesetter could take for commands; a roof."""
    found = plain()
    found["former"] |= {"name": NAME, "laboratory": "=1+1 #strong[x] $E$ \\n"}
    found["new"] |= {"number": "@SUM(A1)", "method": "-2+3"}
    roof = {"mass_kg": 42000.0, "density_kg_m3": 850.0, "weighing": "air", "critical_m": [1.5, 1.8]}
    found["former"]["roof"], found["new"]["roof"] = roof, roof | {"weighing": "vacuum"}
    found["steps"][3] |= {
        "state": "done", "source": "declared", "former": 49.3, "new": 56.7, "top_m3": -7.345,
        "largest_m3": -7.345,
    }  # fmt: skip
    found["waterfall"] = [
        one | {"roof_m3": -7.345, "new_m3": one["new_m3"] - 7.345} for one in found["waterfall"]
    ]
    rows = found["rows"]
    rows["for_use"] = [not 1.5 < dip < 1.8 for dip in rows["height_m"]]
    rows["E_n"] = [14 * one for one in rows["E_n"]]
    found["correlation"] |= {"c": None, "source": "not_declared", "c_limit": -0.4}
    rule = {"name": "House rule", "file": "mine.toml", "verified": False, "is_default": False}
    found["rule"] |= rule
    warning = {"file": "a.csv", "row": None, "column": None, "text": "x", "code": None}
    found["warnings"] = [warning | {"values": {}}]
    return found | {"tank": "=T-1", "verdict": "recalibrate", "verified": False, "courses": []}


KINDS = {"plain": plain, "without_uncertainty": without_uncertainty, "hostile": hostile}
