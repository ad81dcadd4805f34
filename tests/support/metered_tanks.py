"""Jobs of tanks that were filled through a meter: plain data, to be spoilt before it is written."""

import numpy as np
from job_builder import SETTINGS, Parts, _courses, strapped_parts

HEADINGS = [
    *("run", "meter", "volume_m3", "dip_m"),
    *("meter_temperature_c", "tank_temperature_c", "shell_temperature_c"),
    *("flow_m3_h", "time", "use"),
]
METER = {
    "factor": 1.0005,
    "u_factor_ppm": 400.0,
    "k": 2.0,
    "repeatability_ppm": 100.0,
    "fixed_l": 2.0,
    "factor_after": 1.0006,
    "flow_min_m3_h": 20.0,
    "flow_max_m3_h": 120.0,
    "certificate": "V 31/2026",
    "prover": "P 4/2025",
}
LIQUID = {
    "liquid.density_kg_m3": 998.2,
    "liquid.density_temperature_c": 20.0,
    "liquid.expansion_per_k": 2.1e-4,
    "liquid.u_density_kg_m3": 0.2,
    "liquid.s_dip_mm": 0.5,
    "liquid.u_dip_zero_mm": 0.3,
    "liquid.run_ppm": 100.0,
}
LYING = {
    "tank.kind": "horizontal",
    "tank.nominal_diameter_m": None,
    "tank.nominal_height_m": None,
    "datum.bottom_z_m": None,
    "survey.side": "inside",
    "horizontal.diameter_m": 2.4,
    "horizontal.length_m": 9.0,
    "horizontal.end_a": "flat",
    "horizontal.end_b": "flat",
}


def metered_rows(dips, volumes, run="1"):
    """Rows of a run that starts from the first dip (None: empty and dry) and has each batch."""
    rows = []
    for k, (dip, volume) in enumerate(zip(dips, [0.0, *volumes], strict=True)):
        flow = None if k == 0 else 60.0
        minutes = f"2026-05-04T{8 + k // 2:02d}:{30 * (k % 2):02d}"
        rows.append([run, "M", float(volume), dip, 18.5, 18.0, 19.0, flow, minutes, None])
    rows[0][4] = None
    if dips[0] is None:
        rows[0][5] = rows[0][6] = None
    return rows


def metered_parts(kind="vertical", strapped=False, **settings):
    """Parts of a tank filled in one run; settings with dots for "__", None: not there."""
    parts = strapped_parts() if strapped else Parts(dict(SETTINGS), {})
    given = parts.settings | LIQUID
    if kind == "vertical":
        diameter = given["tank.nominal_diameter_m"]
        dips = [None, *np.round(np.arange(0.3, 1.55, 0.2), 3).tolist()]
        level = np.array([0.0, *dips[1:]])
        volumes = np.round(np.diff(np.pi / 4 * diameter**2 * level), 3)
        if not strapped:
            parts.tables["courses"] = _courses([1.9] * 5, 8.0, None)
            given["survey.side"] = "inside"
    elif kind == "horizontal":
        given |= LYING
        dips = [0.1, 0.5, 0.9, 1.3, 1.7, 2.1]
        volumes = [5.5, 7.68, 8.53, 8.17, 6.4]  # about those of section 3 of the reference
    elif kind == "sphere":
        given |= dict.fromkeys(("tank.nominal_diameter_m", "tank.nominal_height_m",
                                "datum.bottom_z_m")) | {
            "tank.kind": "sphere", "survey.side": "inside", "sphere.diameter_m": 10.0,
        }  # fmt: skip
        dips = [1.0, 3.0, 5.0, 7.0, 9.0]
        level = np.array(dips)
        volumes = np.round(np.diff(np.pi * level**2 * (5.0 - level / 3)), 3)
    given |= {key.replace("__", "."): value for key, value in settings.items()}
    parts.settings = {key: value for key, value in given.items() if value is not None}
    parts.tables["liquid"] = [list(HEADINGS), *metered_rows(dips, volumes)]
    parts.registers["meters"] = {"M": dict(METER)}
    return parts


def column(parts, name):
    """Place of a column in the rows of liquid.csv."""
    return parts.tables["liquid"][0].index(name)
