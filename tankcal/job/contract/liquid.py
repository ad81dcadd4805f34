"""Calibration by liquid: the keys of meters.toml and of [liquid], and the columns of liquid.csv."""

from tankcal.job.contract.kinds import VERTICAL
from tankcal.job.contract.shorthand import choice, number, positive
from tankcal.job.fields import Field

JOINT, ALONE, GEOMETRY = TABLES = ("joint", "liquid", "geometry")  # which table is printed
EXPANSION_SHARE = 0.05  # u of the liquid's expansion that is not given, of its value
TEMPERATURE_SD_K = 0.2  # of one temperature, where it is not given
RADIUS_SHARE = 0.005  # sd of the radii of an upright tank that liquid alone tells, of the nominal

METER = (
    number("factor", "meter factor: true volume = factor x indicated", 0.9, 1.1, required=True),
    number(
        "u_factor_ppm",
        "uncertainty of the factor, ppm: standard, or expanded with its k",
        0,
        1e5,
        required=True,
    ),
    number("k", "coverage factor of that uncertainty; blank: 1, it is standard", 1, 20),
    number(
        "repeatability_ppm",
        "standard deviation of one batch, ppm of its volume",
        0,
        1e5,
        required=True,
    ),
    number(
        "fixed_l",
        "standard deviation of one batch that does not grow with it, such as of starting,"
        " stopping and reading, litres; blank: 0",
        0,
        1e4,
    ),
    number(
        "factor_after",
        "the factor as proved again after the calibration; compared with the factor, not used",
        0.9,
        1.1,
    ),
    positive("flow_min_m3_h", "least flow that the factor was proved for, m3/h", 1e5),
    positive("flow_max_m3_h", "largest flow that the factor was proved for, m3/h", 1e5),
    Field("certificate", "text", "number of its certificate; printed when given"),
    Field("prover", "text", "what it was proved against, with its certificate; printed when given"),
)


def _temperature(name, note):
    return number(name, f"{note}, degrees Celsius; blank in all rows: no correction", -200, 300)


LIQUID = (
    Field(
        "run",
        "name",
        "name of the run; its rows stand one after the other, in the order of the work",
        required=True,
    ),
    Field("meter", "name", "meter of meters.toml; blank: the only one there"),
    number(
        "volume_m3",
        "what the meter showed since the row above, cubic metres; 0 in the first row of a run;"
        " negative: drawn off",
        -1e5,
        1e5,
        required=True,
    ),
    number(
        "dip_m",
        "dip that was read after it, from the table's zero, metres; blank only in the first row of"
        " a run: the tank was empty and dry",
        -100,
        100,
    ),
    positive(
        "s_dip_mm",
        "standard deviation of this dip, millimetres; blank: s_dip_mm of [liquid]",
        1000,
    ),
    number(
        "s_volume_l",
        "standard deviation of this batch, litres; blank: by what meters.toml says of the meter",
        0,
        1e5,
    ),
    _temperature("meter_temperature_c", "temperature of the liquid in the meter, batch mean"),
    _temperature("tank_temperature_c", "mean temperature of the liquid in the tank at the dip"),
    _temperature("shell_temperature_c", "temperature of the shell at the dip"),
    positive("flow_m3_h", "flow through the meter, m3/h; compared with its range", 1e5),
    Field("time", "time", "when the dip was read, such as 2026-01-05T14:30"),
    choice(
        "use",
        "check: this dip is only compared, its batch still went in; rest: the dip was read again,"
        " with all valves shut, and volume_m3 is 0; blank: adjust",
        ("adjust", "check", "rest"),
    ),
    Field("note", "text", "for the reader"),
)
COLUMNS = {"liquid": LIQUID}
TEMPERATURES = ("meter_temperature_c", "tank_temperature_c", "shell_temperature_c")

SETTINGS = (
    positive(
        "density_kg_m3",
        "density of the calibrating liquid at density_temperature_c, kg/m3; needed with liquid.csv",
        3000,
    ),
    number(
        "density_temperature_c",
        "temperature of that density, degrees Celsius; needed with liquid.csv",
        -200,
        300,
    ),
    number(
        "expansion_per_k",
        "thermal expansion of the liquid's volume, 1/K: of water at 20 degrees 2.1e-4; needed with"
        " liquid.csv",
        0,
        5e-3,
    ),
    number(
        "u_density_kg_m3",
        "standard uncertainty of the density, kg/m3 (0: exact); needed with liquid.csv",
        0,
        500,
    ),
    number(
        "u_expansion_per_k",
        f"standard uncertainty of the expansion, 1/K; blank: {100 * EXPANSION_SHARE:g} % of it",
        0,
        1e-3,
    ),
    number(
        "u_temperature_c",
        f"standard deviation of one temperature, kelvin; blank: {TEMPERATURE_SD_K:g}",
        0,
        20,
    ),
    positive(
        "s_dip_mm", "standard deviation of one dip, millimetres; needed where a row has none", 1000
    ),
    number(
        "u_dip_zero_mm",
        "standard uncertainty of what all dips have in common, millimetres (0: exact); needed with"
        " liquid.csv",
        0,
        1000,
    ),
    number(
        "run_ppm",
        "standard deviation of what a whole run is off by, ppm of its volumes; blank: found from"
        " the runs, two or more",
        0,
        1e5,
    ),
    number(
        "bottom_flex_m3_per_m",
        "upright tank: standard deviation of what the bottom gives for each metre of head, cubic"
        " metres; blank: 0",
        0,
        1000,
        kinds=VERTICAL,
    ),
    number(
        "u_radius_mm",
        "upright tank that liquid alone tells: standard deviation of each course's radius from"
        f" that of the drawing, millimetres; blank: {100 * RADIUS_SHARE:g} % of it",
        0.1,
        1e4,
        kinds=VERTICAL,
    ),
    choice(
        "table",
        "the table that is printed: joint (of geometry and liquid), liquid alone, or geometry"
        " alone; blank: joint",
        TABLES,
    ),
)
KEYS = {"liquid": SETTINGS}
NEEDED = (  # of [liquid], with liquid.csv
    *("density_kg_m3", "density_temperature_c", "expansion_per_k", "u_density_kg_m3"),
    "u_dip_zero_mm",
)
