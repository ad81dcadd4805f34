"""A small job with everything that papers say of uncertainty: rows of both intervals, a rule.

A lying tank, its diameter of four degrees of freedom and correlated with the length, so that Monte
Carlo does not validate the GUM interval of most rows; with stated volumes and a house rule.
"""

from job_builder import job_parts, write_folder

import tankcal
from tankcal.record import record_of, save

HOSTILE = '=HYPERLINK("x") <b>$C$-17 #2'
UNCERTAINTY = [
    ["input", "u", "unit", "u_is", "type", "distribution", "dof", "note"],
    ["diameter", 2.0, "mm", "scale", "A", "t", 4, HOSTILE],
    ["length", 5.0, "mm", None, "B", "normal", None, "tape 3"],
    ["datum", 1.0, "mm", None, "B", "rectangular", None, None],
    ["end_depth", 3.0, "mm", None, "B", "u-shaped", None, None],
]
STATED = """high_m,low_m,volume_m3,note
1.2,,24.0,at a row
2.4,,48.6,full
1.75,,,between two rows
2.0,1.0,24.3,contract
"""
RULE = f"""
[rule]
name = '{HOSTILE}'
source = "contract 12, annex B"
remark = "Read in a translation"

[uncertainty.volumes]
of = "volumes"
limit_percent = 1.0
clause = "B.2"
verified = true

[uncertainty.deliveries]
of = "deliveries"
minimum_height_m = 0.5
limit_percent = 0.25

[uncertainty.stated]
of = "deliveries"
minimum_height_m = 1
clause = "B.3"

[deviation.top]
of = "capacity"
limit_percent = 0.3
guard = "U"
clause = "B.4"

[deviation.steps]
of = "deliveries"
limit_m3 = 0.9
guard = "U"
"""


def write_uncertain_job(folder, **settings):
    """Write the job; returns its folder."""
    parts = job_parts(
        kind="horizontal",
        settings={
            "table.step_m": 0.1,
            "table.monte_carlo": True,
            "table.rule": "house.toml",
            "table.minimum_delivery_m": [0.5, 1.0],
            "horizontal.end_a": "ellipsoidal",
            "horizontal.end_a_depth_m": 0.6,
            **settings,
        },
    )
    parts.tables["uncertainty"] = UNCERTAINTY
    parts.extra_files = {
        "correlations.csv": "input,with,r\ndiameter,length,0.5\n",
        "stated.csv": STATED,
        "house.toml": RULE,
    }
    return write_folder(folder / "job", parts)


def write_uncertain_record(folder, **settings):
    """Run the job; returns the path of its record.json."""
    result = tankcal.run(tankcal.load(write_uncertain_job(folder, **settings)))
    save(record_of(result), folder / "record.json")
    return folder / "record.json"


def as_before(record):
    """A record without what an earlier version of the same format did not have."""
    old = {key: value for key, value in record.items() if key not in ("budgets", "rule")}
    since = ("low_m3", "high_m3", "interval", "stated_U_m3")
    old["capacity"] = {k: v for k, v in record["capacity"].items() if k not in since}
    since = ("estimate", "halved", "is_default")
    old["budget"] = [{k: v for k, v in line.items() if k not in since} for line in record["budget"]]
    spec = {k: v for k, v in record["job"]["table"].items() if k != "monte_carlo"}
    old["job"] = record["job"] | {"table": spec}
    return old | {"deliveries": None, "monte_carlo": None}
