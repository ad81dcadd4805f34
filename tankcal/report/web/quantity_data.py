"""Data of a record for the quantity calculator of the web page (quantity.js)."""

from tankcal.report.numbers import unit
from tankcal.report.uncertainty.sources import is_roof_in_table, roof_of
from tankcal.tank.fittings import AIR_KG_M3, WEIGHTS_KG_M3
from tankcal.tank.gauging import UNCERTAINTIES, VCF_AT_K, VCF_PERCENT
from tankcal.tank.volume_correction import brazil, petroleum
from tankcal.tank.volume_correction.corrections import LEAST_C, MOST_C

# Keys of the fields, and the assumed uncertainties that they show.
FIELDS_OF_U = {
    "u_dip": "u_dip_mm", "u_tape": "u_tape_ppm", "u_water": "u_water_dip_mm",
    "u_temperature": "u_temperature_k", "u_thermometer": "u_thermometer_k",
    "u_ambient": "u_ambient_k", "u_density": "u_density_kg_m3", "u_sw": "u_sw_percent",
    "u_expansion": "u_expansion_per_k", "u_vcf": "u_vcf_percent",
}  # fmt: skip


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
        "roof": _roof(record),
        "air": AIR_KG_M3,
        "weights": WEIGHTS_KG_M3,
        "u": {field: UNCERTAINTIES[name] for field, name in FIELDS_OF_U.items()},
        "vcf_rule": {"at_k": VCF_AT_K.tolist(), "percent": VCF_PERCENT.tolist()},
        "constants": _constants(),
    }


def _roof(record):
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


def _constants():
    """Constants of D1250, of the constant coefficient and of CNP 6/70."""
    forms = {
        "15C": petroleum.GROUPS_15C,
        "60F": petroleum.GROUPS_60F,
        "2004": petroleum.GROUPS_2004,
    }
    bounds = [float(bound) for bound in brazil.CLASSES[:-1, 0]] + [brazil.MOST]
    return {
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
            "classes": [[bound, *map(float, brazil.coefficients_of_class(bound))]
                        for bound in bounds],
            "least": brazil.LEAST,
            "most": brazil.MOST,
            "limits_c": [brazil.LOWEST_C, brazil.HIGHEST_C],
            "three_to": brazil.THREE_DECIMALS_TO,
            "four_from": brazil.FOUR_DECIMALS_FROM,
        },
    }  # fmt: skip
