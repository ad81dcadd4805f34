"""Assumed uncertainties of a gauging, and the limits of its readings."""

import numpy as np

# {name: (standard uncertainty if the ticket does not declare it, origin)}; None: by the rule below.
# "memory": from memory of practice of manual gauging, class II tapes, ISO 4268 thermometers,
# reproducibility of hydrometers and of the centrifuge; none of these texts was read. "assumed": our
# own choice.
ASSUMPTIONS = {
    "u_dip_mm": (1.0, "memory"),
    "u_tape_ppm": (115.0, "memory"),
    "u_water_dip_mm": (1.5, "assumed"),
    "u_temperature_k": (0.25, "assumed"),
    "u_thermometer_k": (0.15, "memory"),
    "u_ambient_k": (3.0, "assumed"),
    "u_density_kg_m3": (0.5, "memory"),
    "u_sw_percent": (0.1, "memory"),
    "u_vcf_percent": (None, "memory"),
    "u_expansion_per_k": (1e-6, "assumed"),
}
UNCERTAINTIES = {name: value for name, (value, _) in ASSUMPTIONS.items()}
UNITS_OF_U = {
    "u_dip_mm": "mm",
    "u_tape_ppm": "ppm",
    "u_water_dip_mm": "mm",
    "u_temperature_k": "K",
    "u_thermometer_k": "K",
    "u_ambient_k": "K",
    "u_density_kg_m3": "kg/m³",
    "u_sw_percent": "%",
    "u_expansion_per_k": "1/K",
    "u_vcf_percent": "%",
}
# Their fields in the calculators of workbook and web page; the optional u of VCF is the last one.
FIELDS_OF_U = {
    "u_dip_mm": "u_dip",
    "u_tape_ppm": "u_tape",
    "u_water_dip_mm": "u_water",
    "u_temperature_k": "u_temperature",
    "u_thermometer_k": "u_thermometer",
    "u_ambient_k": "u_ambient",
    "u_density_kg_m3": "u_density",
    "u_sw_percent": "u_sw",
    "u_expansion_per_k": "u_expansion",
    "u_vcf_percent": "u_vcf",
}
KEY_OF_INPUT = {  # input of the budget without its state: key of its standard uncertainty
    "dip": "u_dip_mm",
    "water dip": "u_water_dip_mm",
    "temperature": "u_temperature_k",
    "tape": "u_tape_ppm",
    "thermometer": "u_thermometer_k",
    "ambient": "u_ambient_k",
    "density": "u_density_kg_m3",
    "sw": "u_sw_percent",
    "expansion": "u_expansion_per_k",
    "vcf": "u_vcf_percent",
}
# Expanded uncertainty (95 %) of the volume correction at temperatures, percent of the volume; from
# memory of the 1980 edition, for 60 degF. Below the first point it grows in proportion to the
# distance from the base, which is our own rule.
VCF_AT_K = np.array([0.0, 22.2, 50.0, 77.8, 105.6])
VCF_PERCENT = np.array([0.0, 0.05, 0.15, 0.25, 0.35])
VCF_K = 1.96  # coverage factor of this expanded uncertainty

# Lowest and highest accepted value of the keys of a ticket.
LIMITS = {
    "dip_m": (0, 200),
    "ullage_m": (0, 200),
    "water_dip_m": (0, 200),
    "temperature_c": (-60, 200),
    "ambient_c": (-60, 70),
    "density_kg_m3": (300, 2000),  # a lower value is a relative density, or in g/cm3
    "density_temperature_c": (-60, 200),
    "sw_percent": (0, 20),
}

# Volumes between the closing gauging and an operating level: key of the level, sign.
ROOMS = {
    "room": ("maximum_m", 1),  # can still be received
    "above_minimum": ("minimum_m", -1),
    "pumpable": ("pump_suction_m", -1),  # can be delivered
}


def room_levels(levels, first_m, last_m, critical_m=None):
    """Operating levels of the rooms that a table can state.

    Parameters
    ----------
    levels : Mapping
        Section [levels] of a job: {"maximum_m": dip or None ...}.
    first_m, last_m : float
        Lowest and highest dip of the table.
    critical_m : tuple of float, optional
        Lowest and highest dip of the critical zone of a floating roof.

    Returns
    -------
    dict
        {name of ROOMS: dip}, without levels outside the table or inside the critical zone.
    """
    dips = {name: levels.get(key) for name, (key, _) in ROOMS.items()}
    low, high = critical_m or (last_m, last_m)
    return {
        name: dip
        for name, dip in dips.items()
        if dip is not None and first_m <= dip <= last_m and not low < dip < high
    }


def assumed_u_vcf(temperature_c, base_c):
    """Standard uncertainty of a volume correction factor by the assumed rule, relative.

    Parameters
    ----------
    temperature_c : float or ndarray
        Temperature of the liquid, degC.
    base_c : float
        Base temperature, degC.

    Returns
    -------
    float or ndarray
        With the sign of the distance from the base, as the error of the model.
    """
    distance = np.abs(temperature_c - base_c)
    # Beyond the last point the last slope goes on, so that U does not stop growing.
    beyond = np.maximum(distance - VCF_AT_K[-1], 0.0)
    slope = (VCF_PERCENT[-1] - VCF_PERCENT[-2]) / (VCF_AT_K[-1] - VCF_AT_K[-2])
    percent = np.interp(distance, VCF_AT_K, VCF_PERCENT) + slope * beyond
    return np.sign(temperature_c - base_c) * percent / 100 / VCF_K
