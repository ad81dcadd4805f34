"""Tickets for the calculators of quantity: the sheet of the workbook, and the web page."""

import json

from tankcal.products.quantity.reading import read_tickets
from tankcal.tank.gauging import UNCERTAINTIES

# {label of a step: its name in the library}
STEPS = {
    "tov": "tov_m3", "fw": "fw_m3", "ctsh": "ctsh", "vcf": "vcf", "fra": "fra_m3", "gov": "gov_m3",
    "gsv": "gsv_m3", "csw": "csw", "nsv": "nsv_m3", "mass": "mass_kg", "weight": "weight_kg",
    "rho_t": "observed_density", "shell": "shell_c", "air": "air_factor",
}  # fmt: skip

OPENING = {"dip_m": 2.317, "water_dip_m": 0.412, "temperature_c": 18.4, "ambient_c": 25.0}
CLOSING = {"dip_m": 8.642, "water_dip_m": 0.512, "temperature_c": 31.2, "ambient_c": 29.0}

# Operating levels, m: of the upright tank, and of the tank with a roof that floats from 1.3 m.
LEVELS = {"full_m": None, "maximum_m": 9.333, "minimum_m": 1.207, "pump_suction_m": 0.313}
LEVELS_OF_ROOF = LEVELS | {"minimum_m": 0.907}


def case(correction, density, *, opening=OPENING, closing=CLOSING, shell=None, u=None, **product):
    sections = {
        "product": {
            "correction": correction, "density_kg_m3": density, "density_is": "base",
            "sw_percent": 0.05, **product,
        },
        "closing": closing,
    }  # fmt: skip
    if opening:
        sections["opening"] = opening
    return sections | ({"shell": shell} if shell else {}) | ({"uncertainty": u} if u else {})


def observed(celsius, hydrometer=None):
    keys = {"density_is": "observed", "density_temperature_c": celsius}
    return keys | ({"hydrometer": hydrometer} if hydrometer else {})


COLD = {"dip_m": 5.0, "temperature_c": -12.5, "ambient_c": -20.0}
HOT = {"dip_m": 9.2001, "temperature_c": 58.3, "ambient_c": 33.0}
GRID = {
    f"{edition} {group} {base} {density} {kind}": case(
        edition, density, group=group, base=base, **more
    )
    for edition in ("D1250-04", "D1250-80")
    for group, densities in (
        ("crude", (680.0, 874.3)),
        ("products", (735.2, 779.0, 801.7, 842.0, 985.0)),
        ("lubricants", (880.0,)),
    )
    for density in densities
    for base, kind, more in (
        ("15C", "base", {}),
        ("20C", "observed", observed(27.5, "glass 20C")),
        ("60F", "observed", observed(8.0)),
    )
}
CASES = {
    "D1250-04 products": case("D1250-04", 842.0, group="products", base="20C",
                              **observed(27.5, "glass 20C")),
    "D1250-80 products": case("D1250-80", 735.2, group="products", base="60F", **observed(8.0)),
    "D1250-80 crude": case("D1250-80", 874.3, group="crude", base="20C", **observed(27.5)),
    "coefficient group": case("D1250-04", 850.0, group="coefficient", alpha_per_k=8e-4, base="15C"),
    "coefficient group 80": case(
        "D1250-80", 850.0, group="coefficient", alpha_per_k=8e-4, base="20C", **observed(31.0)
    ),
    "coefficient group 60F": case(
        "D1250-80", 850.0, group="coefficient", alpha_per_k=8e-4, base="60F", **observed(31.0)
    ),
    "coefficient": case("coefficient", 1010.0, alpha_per_k=4e-4, base="15C"),
    "coefficient seen": case("coefficient", 1010.0, alpha_per_k=4e-4, base="20C",
                             **observed(33.0, "glass 15C")),
    "cnp": case("CNP-6-70", 837.0),
    "cnp half": case("CNP-6-70", 841.0, **observed(24.5)),
    "cnp light": case("CNP-6-70", 601.0, **observed(12.5, "glass 15C")),
    "cnp exact": case("CNP-6-70-unrounded", 742.0),
    "cnp exact seen": case("CNP-6-70-unrounded", 995.9, **observed(35.0, "glass 60F")),
    "stock": case("D1250-04", 842.0, opening=None, group="products", base="20C"),
    "no water, no S&W": case("D1250-04", 842.0, opening=COLD, closing=HOT, group="products",
                             base="20C", sw_percent=None),
    "emptied": case("D1250-04", 842.0, opening=CLOSING, closing=OPENING, group="crude",
                    base="15C"),
    "insulated": case("D1250-80", 842.0, group="products", base="15C", shell={"insulated": True},
                      opening={"dip_m": 3.0, "temperature_c": 22.0},
                      closing={"dip_m": 4.0, "temperature_c": 24.0}),
    "own u": case("D1250-04", 842.0, group="products", base="20C",
                  u={name: 0.3 if value is None else 1.7 * value
                     for name, value in UNCERTAINTIES.items()}),
    "low water": case("D1250-04", 842.0, group="products", base="20C",
                      closing=CLOSING | {"water_dip_m": 0.0}),
    "a row, and no expansion": case("D1250-04", 842.0, group="products", base="20C",
                                    closing=CLOSING | {"dip_m": 8.0}),
}  # fmt: skip
ULLAGES = {
    "ullage": case("D1250-04", 842.0, group="products", base="20C",
                   opening={"ullage_m": 7.1, "temperature_c": 25.0, "ambient_c": 20.0},
                   closing=CLOSING | {"water_dip_m": 0.1}),
    "afloat": case("D1250-80", 745.0, group="products", base="15C", **observed(30.0),
                   opening={"dip_m": 4.111, "temperature_c": 25.0, "ambient_c": 20.0},
                   closing={"dip_m": 9.0, "temperature_c": 28.0, "ambient_c": 20.0}),
    "afloat cnp": case("CNP-6-70", 745.0,
                       opening={"dip_m": 4.111, "temperature_c": 25.0, "ambient_c": 20.0},
                       closing={"dip_m": 9.0, "temperature_c": 28.0, "ambient_c": 20.0}),
}  # fmt: skip


def save_with_levels(record, levels, folder):
    """Record with the operating levels of its tank, also saved as record.json."""
    record = {**record, "job": {**record["job"], "levels": levels}}
    (folder / "record.json").write_text(json.dumps(record), encoding="utf-8")
    return record


def ticket_of(sections, folder, table):
    lines = []
    for section, keys in sections.items():
        lines.append(f"[{section}]")
        for key, value in keys.items():
            if value is not None:
                lines.append(f"{key} = {json.dumps(value)}")
    path = folder / "ticket.toml"
    path.write_text("\n".join(lines), encoding="utf-8")
    return read_tickets(table, path)
