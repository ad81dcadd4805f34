"""Record of a table kept up by everyday data: the former record with the new table.

All parts of the former record that follow from its table are computed again, or left out: volumes,
covariance, budgets and worst deliveries are new; verdicts of rules, simulation, proportional parts
and rows on high legs are left out. The survey and its parts are those of the former table.
"""

import json
from pathlib import Path

import numpy as np
import scipy.linalg

from tankcal import record as records
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.pipeline.liquid.measuring import BALANCE, BY_LIQUID
from tankcal.pipeline.tanks import Correction
from tankcal.products.upkeep.estimation import estimate
from tankcal.products.upkeep.reading import SETTINGS, read_upkeep
from tankcal.products.upkeep.saved import NO_STATE
from tankcal.products.upkeep.upkeep import keep_up, update_table
from tankcal.record.covariance_factor import blocks_of
from tankcal.record.making import KeptUp, MeterByTank
from tankcal.record.recomputation import compare_records
from tankcal.record.schema import to_plain, warnings_of
from tankcal.record.table import budget_lines
from tankcal.tank.budgets import budget, reading_sources
from tankcal.tank.capacity import Capacity
from tankcal.tank.deliveries import worst_deliveries
from tankcal.uncertainty import Source

KIND = "upkeep"  # of the only source of uncertainty of the new table


def make_record(inputs, upkeep, state=NO_STATE, reasons=None):
    """Return the record of the new table of an upkeep.

    Parameters
    ----------
    inputs : reading.Inputs
    upkeep : saved.UpkeepFile
        Result of `keep_up` of these inputs.
    state : state.State, optional
        Results of earlier runs.
    reasons : str, optional
        Why the table is not improved, in the language of the user; None: codes.

    Returns
    -------
    dict
        Plain data in the form of `tankcal.record.record_of`.

    Raises
    ------
    InputError
        If the table was not improved.
    """
    if upkeep.mode != "improved":
        text = message("upkeep_not_improved", "the table is not improved ({reasons}); expected "
                       "an improved table for a new record",
                       reasons=reasons or ", ".join(upkeep.reasons))  # fmt: skip
        raise InputError(Problem(SETTINGS, text))
    former = records.load(inputs.record_path)
    table, period, scale = inputs.table, upkeep.period, upkeep.fit.scale
    estimation = estimate(inputs.operation_of_meters(), inputs.steps, state=state)
    volume, factor = update_table(
        estimation, inputs.operation.stock, period.lowest_m, period.highest_m
    )
    change = volume - table.volume_m3
    old = former["capacity"]
    area = [None if value is None else value + slope
            for value, slope in zip(old["area_m2"], np.gradient(change, table.height_m),
                                    strict=True)]  # fmt: skip
    roof = table.roof
    zone = None if roof is None else (roof.critical_bottom_m, roof.critical_top_m)
    probability = next(entry["value"] for entry in former["choices"] if entry["code"] == "coverage")
    capacity = Capacity(table.height_m, volume, np.array(area, dtype=float),
                        (Source(KIND, scale * factor),), float(probability), zone)  # fmt: skip
    new = {key: value for key, value in former.items() if key != "on_high_legs"}
    new |= to_plain({
        "files": inputs.files(),
        "capacity": old | _capacity_part(capacity),
        "proportional_parts": dict(former["proportional_parts"] or {}, zones=[], largest_m3=None),
        "densities": [
            entry | {"volume_m3": (np.array(entry["volume_m3"]) + change).tolist()}
            for entry in former["densities"]
        ],
        "corrections": [*former["corrections"], _correction(former, change)],
        "budget": budget_lines(budget(capacity, table.height_m[-1]).lines),
        "budgets": [_compute_stated(capacity, entry, former) for entry in former["budgets"]],
        "deliveries": [
            worst_deliveries(capacity, entry["minimum_m"]) for entry in former["deliveries"]
        ],
        "rule": None,
        "monte_carlo": None,
        "choices": [entry | ({"value": "normal"} if entry["code"] == "k" else {})
                    for entry in former["choices"]],
        "warnings": [*former["warnings"], *warnings_of([_notice(upkeep)]), *upkeep.warnings],
        KIND: _part(inputs, upkeep, estimation, factor.shape[1]),
    })  # fmt: skip
    return (
        json.loads(json.dumps(new, allow_nan=False)) if former.get("long_tables") is None else new
    )


def _capacity_part(capacity):
    """Keys of the capacity table that follow from volumes and covariance."""
    names = [f"{KIND} {number + 1}" for number in range(capacity.factor_m3.shape[1])]
    return {
        "volume_m3": capacity.volume_m3, "u_m3": capacity.u_m3, "U_m3": capacity.U_m3,
        "k": capacity.k, "dof": capacity.dof, "area_m2": capacity.area_m2,
        "low_m3": capacity.volume_m3 - capacity.U_m3,
        "high_m3": capacity.volume_m3 + capacity.U_m3,
        "interval": ["gum"] * len(names and capacity.height_m), "stated_U_m3": capacity.U_m3,
        "inputs": names, "input_kind": [KIND] * len(names),
        "factor": blocks_of(capacity.factor_m3),
    }  # fmt: skip


def _compute_stated(capacity, entry, former):
    """A stated volume or delivery of the former record, by the new table."""
    interpolation = former.get("interpolation") or {"largest_m3": 0.0}
    result = budget(capacity, entry["high_m"], entry["low_m"],
                    reading_sources((), interpolation["largest_m3"]))  # fmt: skip
    return entry | {
        "volume_m3": result.volume_m3, "table_u_m3": result.table_u_m3, "u_m3": result.u_m3,
        "dof": result.dof, "k": result.k, "U_m3": result.U_m3, "stated_U_m3": result.U_m3,
        "low_m3": result.volume_m3 - result.U_m3, "high_m3": result.volume_m3 + result.U_m3,
        "interval": "gum", "monte_carlo": None, "lines": budget_lines(result.lines),
    }  # fmt: skip


def _correction(former, change):
    """Effect of the everyday data at the top row, in the list of corrections."""
    size, gross = float(change[-1]), former["gross"]
    whole = gross["volume_m3"] if gross else former["capacity"]["volume_m3"][-1]
    return Correction(KIND, True, size, 100 * size / whole, BY_LIQUID, BALANCE)


def _notice(upkeep):
    """The origin of the table, in the remarks of all reports."""
    text = message(
        "upkeep_origin", "The table was kept up by everyday data of the tank from {first} to "
        "{last}, {steps} steps. The former table (record {digest}) is contained in it. Survey, "
        "sections and parts are those of the former table.", first=upkeep.period.first,
        last=upkeep.period.last, steps=upkeep.period.used, digest=upkeep.record_sha256[:12],
    )  # fmt: skip
    return Problem(SETTINGS, text)


def _part(inputs, upkeep, estimation, columns):
    """`KeptUp` of an upkeep, with the meters and their covariance with the table."""
    covariance, causes = estimation.covariance, estimation.balance.causes
    count = len(inputs.operation.stock.names)
    lower = scipy.linalg.cholesky(covariance[:count, :count], lower=True)
    meters = []
    for meter in upkeep.meters:
        weights = np.zeros(len(covariance))
        for name in (f"meter {meter.name}", "meters_common"):
            for place in np.flatnonzero(np.array(causes.names) == name):
                weights[place] = causes.sd[place] / 100
        # The first inputs of the table are L^-1 of its causes, cov = L L'; the others are
        # independent of the meters.
        with_table = scipy.linalg.solve_triangular(lower, covariance[:count] @ weights, lower=True)
        meters.append(MeterByTank(
            meter.name, meter.certificate, 1 + meter.deviation_percent / 100,
            meter.U_percent / 100 / upkeep.k,
            np.append(upkeep.fit.scale * with_table, np.zeros(columns - count)),
        ))  # fmt: skip
    logs = [entry.sha256 for entry in upkeep.files if entry.kind not in ("settings", "record")]
    known = (inputs.former_upkeep or {}).get("logs", [])
    return KeptUp(upkeep.record_sha256, upkeep.period.first, upkeep.period.last,
                  upkeep.period.used, [*known, *logs], meters)  # fmt: skip


def write_record(record, folder, language=None):
    """Write record.json, CSV files and SHA256SUMS of a new table, all or none.

    Parameters
    ----------
    record : dict
        Result of `make_record`.
    folder : path
    language : str, optional

    Returns
    -------
    list of Path
    """
    from tankcal.report import folders, outputs

    outputs.refuse_foreign(folder)
    with folders.replace_folder(folder, language) as temporary:
        records.save(record, temporary / outputs.RECORD)
        outputs.write_tables(record, temporary)
    return [Path(folder) / outputs.RECORD]


def compute_record_again(record, folder):
    """Compute the record of a kept-up table again from its logs, for `tankcal verify`.

    Parameters
    ----------
    record : dict
    folder : path
        Folder of the input files.

    Returns
    -------
    record.recomputation.Recomputation
    """
    source = record["files"][1]["file"]  # the first file is upkeep.toml
    inputs = read_upkeep(folder, source=source)
    return compare_records(record, make_record(inputs, keep_up(inputs)))
