"""Data of a record for the calculators of the web page: dips, deliveries and quantities.

The scripts calculator.js and quantity.js compute in the same way as the calculators of the workbook
and as `Capacity.delivery`. The covariance factor of a long table is nearly linear between a few
rows. The page contains only these rows.
"""

from functools import partial

import numpy as np

from tankcal.record.covariance_factor import factor_of, norms_of_rows
from tankcal.report.blocks import Block
from tankcal.report.numbers import unit
from tankcal.report.uncertainty.capacity import ends_of_high_legs
from tankcal.report.uncertainty.stated import (
    critical_zone,
    flag_simulated,
    groups_of,
    is_roof_in_table,
    read_room_levels,
    roof_of,
    stated_rows,
    stated_U_m3,
)
from tankcal.report.web import pack_numbers
from tankcal.tank.fittings import AIR_KG_M3, WEIGHTS_KG_M3
from tankcal.tank.gauging import (
    FIELDS_OF_U,
    LIMITS,
    ROOMS,
    UNCERTAINTIES,
    UNITS_OF_U,
    VCF_AT_K,
    VCF_K,
    VCF_PERCENT,
)
from tankcal.tank.volume_correction import petroleum
from tankcal.tank.volume_correction.corrections import LEAST_C, MOST_C
from tankcal.text.digits import decimals_of_rows
from tankcal.uncertainty import coverage_factor

BEND = 1e-6  # largest deviation of the factor from the line between kept rows, in largest u
_NODES = 32  # intervals of nodes for k; the script interpolates log k over 1/dof


def calculator(paper):
    """Block of the calculator, which only the web page shows."""
    record = paper.record
    capacity, spec = record["capacity"], record["job"]["table"]
    shown = unit(spec["volume_unit"])
    U = np.array(stated_U_m3(capacity)) * shown.factor
    height_m, note = capacity["height_m"], {}
    if record.get("on_high_legs"):
        note["note"] = paper.word("texts.high_legs", **ends_of_high_legs(paper))
    return Block(
        {
            "kind": "calculator",
            "text": paper.word("web.calculator_here"),
            "unit": shown.symbol,
            "least": shown.least,
            "reference_height_m": record["job"]["datum"]["reference_height_m"],
            "coverage": paper.coverage(),
            "critical_m": critical_zone(record),
            "height_m": pack_numbers(height_m),
            "volume": pack_numbers(np.array(capacity["volume_m3"]) * shown.factor),
            "U": pack_numbers(U),
            "u": pack_numbers(np.array(capacity["u_m3"]) * shown.factor, "<f4"),
            "k": pack_numbers(capacity["k"], "<f4"),
            "decimals": pack_numbers(decimals_of_rows(U), "u1"),
            "simulated": pack_numbers(flag_simulated(capacity), "u1"),
            "deliveries": _deliveries(record, shown.factor),
            "quantity": quantity_data(record),
        }
        | note
    )


def _deliveries(record, unit_factor):
    """Return the data of deliveries: kept rows of the factor, sources, k, stated deliveries."""
    capacity = record["capacity"]
    factor = factor_of(capacity) * unit_factor
    height_m = np.array(capacity["height_m"])
    largest = norms_of_rows(lambda rows: factor[rows], len(factor)).max(initial=0.0)
    rows = straight_rows(height_m, factor, BEND * largest)
    owner, dof = sources_of(record)
    least_dof = min((nu for nu in dof if nu is not None), default=None)
    return {
        "rows": pack_numbers(rows, "<u4"),
        "columns": factor.shape[1],
        "factor": pack_numbers(factor[rows], "<f4"),
        "source": owner,
        "dof": dof,
        "k": _k_of_dof(record["job"]["table"]["coverage_probability"], least_dof),
        "stated": [
            {key: row[key] for key in ("low_m", "high_m", "k")} | {"U": row["U_m3"] * unit_factor}
            for row in stated_rows(record)
            if row["low_m"] is not None
        ],
    }


def straight_rows(height_m, factor, bend):
    """Select rows between which the covariance factor is linear.

    Parameters
    ----------
    height_m : ndarray, shape (n,)
        Heights of the rows.
    factor : ndarray, shape (n, c)
        Covariance factor.
    bend : float
        Largest norm of the difference between a row and the line between selected rows.

    Returns
    -------
    ndarray, shape (m,)
        Indices of the selected rows, including the first and the last.
    """
    kept, open_pieces = {0, len(height_m) - 1}, [(0, len(height_m) - 1)]
    while open_pieces:
        first, last = open_pieces.pop()
        if last - first < 2:
            continue
        part = (height_m[first : last + 1] - height_m[first]) / (height_m[last] - height_m[first])
        ends, rows = (factor[first], factor[last] - factor[first]), factor[first : last + 1]
        deviation = norms_of_rows(partial(_deviations, rows, part, *ends), len(rows))
        if deviation.max() > bend:
            # Split at the largest deviation, but not at an end of the piece.
            middle = first + int(np.clip(np.argmax(deviation), 1, last - first - 1))
            kept.add(middle)
            open_pieces += [(first, middle), (middle, last)]
    return np.array(sorted(kept))


def _deviations(factor, part, start, slope, rows):
    """Deviations of some rows of a piece of the factor from the line between its ends."""
    return factor[rows] - (start + part[rows, None] * slope)


def sources_of(record):
    """Return the source of each column of the factor, and the dof of each source.

    None denotes infinite degrees of freedom.
    """
    groups = groups_of(record["capacity"]["input_kind"], record["budget"])
    owner = [i for i, group in enumerate(groups) for _ in range(group.first, group.last + 1)]
    return owner, [group.dof if np.isfinite(group.dof) else None for group in groups]


def _k_of_dof(probability, least_dof):
    """Return log k at Chebyshev points of 1/dof from 0 (normal) to 1/least_dof."""
    widest = 0.0 if least_dof is None else 1 / least_dof
    nodes = widest * (1 - np.cos(np.pi * np.arange(_NODES + 1) / _NODES)) / 2
    with np.errstate(divide="ignore"):
        k = coverage_factor(probability, 1 / nodes)
    return {
        "inverse_dof": pack_numbers(nodes),
        "log_k": pack_numbers(np.log(k)),
        "least_dof": least_dof,
    }


def quantity_data(record):
    """Facts of the tank, constants of the volume corrections and assumed uncertainties (dict)."""
    job, capacity = record["job"], record["capacity"]
    interpolation = record.get("interpolation")
    return {
        "kind": job["tank"]["kind"],
        "unit_factor": unit(job["table"]["volume_unit"]).factor,
        "temperature_c": job["table"]["reference_temperature_c"],
        "expansion_per_k": job["material"]["expansion_per_k"],
        "zero_m": capacity["zero_m"],
        "interpolation_m3": interpolation["largest_m3"] if interpolation else 0.0,
        "roof": _roof_data(record),
        "rooms": [
            {"name": name, "level_m": dip, "sign": ROOMS[name][1]}
            for name, dip in read_room_levels(record).items()
        ],
        "air": AIR_KG_M3,
        "weights": WEIGHTS_KG_M3,
        "u": [(field, UNCERTAINTIES[name]) for name, field in FIELDS_OF_U.items()],
        "units_of_u": {field: UNITS_OF_U[name] for name, field in FIELDS_OF_U.items()},
        "input_limits": LIMITS,
        "vcf_rule": {"at_k": VCF_AT_K.tolist(), "percent": VCF_PERCENT.tolist(), "k": VCF_K},
        "constants": _correction_constants(),
    }


def _roof_data(record):
    """Facts of the floating roof, or None."""
    if not record["roof"]:
        return None
    roof = roof_of(record)
    return {
        "mass_kg": roof["roof_mass"],
        "critical_bottom_m": roof["roof_critical_bottom"],
        "critical_top_m": roof["roof_critical_top"],
        "reference_density": roof["roof_reference_density"],
        "air": AIR_KG_M3 if roof["roof_weighing"] == "air" else 0.0,
        "weights": WEIGHTS_KG_M3,
        "is_in_table": is_roof_in_table(record),
    }


def _correction_constants():
    """Constants of D1250, of the constant coefficient and of CNP 6/70."""
    forms = {
        "15C": petroleum.GROUPS_15C,
        "60F": petroleum.GROUPS_60F,
        "2004": petroleum.GROUPS_2004,
    }
    bounds = [float(bound) for bound in petroleum.CLASSES[:-1, 0]] + [petroleum.MOST]
    return {
        "bases_c": petroleum.BASES_C,
        "glass": petroleum.GLASS_EXPANSION,
        "groups": {
            form: {name: parts for name, (_, *parts) in groups.items()}
            for form, groups in forms.items()
        },
        "least": {
            form: {name: least for name, (least, *_) in groups.items()}
            for form, groups in forms.items()
        },
        "alpha": {
            "D1250-04": [1.8 * limit for limit in petroleum.ALPHA_2004_PER_F],
            "D1250-80": [1.8 * limit for limit in petroleum.ALPHA_1980_PER_F],
        },
        "scales": petroleum.SCALES,
        "delta_60": petroleum.DELTA_60,
        "zero_68_f": petroleum.ZERO_68_F,
        "limits_2004_c": petroleum.LIMITS_2004_C,
        "lowest_f": petroleum.LOWEST_F,
        "highest_f": petroleum.HIGHEST_F,
        "light": petroleum.LIGHT_KG_M3,
        "middle": petroleum.MIDDLE_KG_M3,
        "constant_c": [LEAST_C, MOST_C],
        "brazil": {
            "classes": [[bound, *map(float, petroleum.coefficients_of_class(bound))]
                        for bound in bounds],
            "least": petroleum.LEAST,
            "most": petroleum.MOST,
            "limits_c": [petroleum.LOWEST_C, petroleum.HIGHEST_C],
            "three_to": petroleum.THREE_DECIMALS_TO,
            "four_from": petroleum.FOUR_DECIMALS_FROM,
        },
    }  # fmt: skip
