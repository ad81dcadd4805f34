"""Keys of meters.toml and [liquid], and columns of liquid.csv, for calibration with liquid."""

from tankcal.job.fields import NOTE, VERTICAL, Field, choice, number, positive

JOINT, ALONE, GEOMETRY = TABLES = ("joint", "liquid", "geometry")  # which table is printed
EXPANSION_SHARE = 0.05  # default relative standard uncertainty of the liquid's expansion
TEMPERATURE_SD_K = 0.2  # default standard deviation of one temperature
# Default standard deviation, over the nominal radius, of the radii of a vertical tank calibrated
# with liquid only.
RADIUS_SHARE = 0.005

METER = (
    number("factor", "meter factor: true volume = factor x indicated", 0.9, 1.1, required=True),
    number(
        "u_factor_ppm",
        "uncertainty of the factor, ppm: standard, or expanded if k is given",
        0,
        1e5,
        required=True,
    ),
    number("k", "coverage factor of u_factor_ppm; blank: 1 (standard uncertainty)", 1, 20),
    number(
        "repeatability_ppm",
        "standard deviation of one batch, ppm of its volume",
        0,
        1e5,
        required=True,
    ),
    number(
        "fixed_l",
        "standard deviation of one batch that does not depend on its volume (starting,"
        " stopping, reading), litres; blank: 0",
        0,
        1e4,
    ),
    number(
        "factor_after",
        "meter factor proved again after the calibration; only compared with factor",
        0.9,
        1.1,
    ),
    positive("flow_min_m3_h", "smallest flow at which the factor was proved, m3/h", 1e5),
    positive("flow_max_m3_h", "largest flow at which the factor was proved, m3/h", 1e5),
    Field("certificate", "text", "number of the meter's certificate; printed if given"),
    Field(
        "prover",
        "text",
        "prover or standard used for the proving, with its certificate; printed if given",
    ),
)


def _temperature(name, note):
    """Return the column of a temperature of a run."""
    return number(name, f"{note}, degrees Celsius; blank in all rows: no correction", -200, 300)


LIQUID = (
    Field(
        "run",
        "name",
        "name of the run; its rows are consecutive, in the order of the work",
        required=True,
    ),
    Field("meter", "name", "meter of meters.toml; blank: the only meter there"),
    number(
        "volume_m3",
        "volume indicated by the meter since the row above, cubic metres; 0 in the first row of"
        " a run; negative: drawn off",
        -1e5,
        1e5,
        required=True,
    ),
    number(
        "dip_m",
        "dip read after this volume, from the table's zero, metres; blank only in the first row"
        " of a run: the tank was empty and dry",
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
        "standard deviation of this batch, litres; blank: from the data of the meter in"
        " meters.toml",
        0,
        1e5,
    ),
    _temperature("meter_temperature_c", "temperature of the liquid in the meter, batch mean"),
    _temperature("tank_temperature_c", "mean temperature of the liquid in the tank at the dip"),
    _temperature("shell_temperature_c", "temperature of the shell at the dip"),
    positive("flow_m3_h", "flow through the meter, m3/h; compared with its range", 1e5),
    Field("time", "time", "time of the dip, such as 2026-01-05T14:30"),
    choice(
        "use",
        "check: the dip is only compared, but its batch counts; rest: dip read again with all"
        " valves shut, volume_m3 is 0; blank: adjust",
        ("adjust", "check", "rest"),
    ),
    NOTE,
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
        "temperature for which density_kg_m3 holds, degrees Celsius; needed with liquid.csv",
        -200,
        300,
    ),
    number(
        "expansion_per_k",
        "coefficient of thermal expansion of the liquid's volume, 1/K (water at 20 degrees:"
        " 2.1e-4); needed with liquid.csv",
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
        "s_dip_mm", "standard deviation of one dip, millimetres; needed if a row states none", 1000
    ),
    number(
        "u_dip_zero_mm",
        "standard uncertainty of the error common to all dips, millimetres (0: exact); needed"
        " with liquid.csv",
        0,
        1000,
    ),
    number(
        "run_ppm",
        "standard deviation of the error common to a whole run, ppm of its volumes; blank:"
        " estimated from the runs, two or more",
        0,
        1e5,
    ),
    number(
        "bottom_flex_m3_per_m",
        "vertical tank: standard deviation of the volume added by the deflection of the bottom"
        " for each metre of head, cubic metres; blank: 0",
        0,
        1000,
        kinds=VERTICAL,
    ),
    number(
        "u_radius_mm",
        "vertical tank calibrated with liquid only: standard deviation of each course's radius"
        f" about the radius of the drawing, millimetres; blank: {100 * RADIUS_SHARE:g} % of that"
        " radius",
        0.1,
        1e4,
        kinds=VERTICAL,
    ),
    choice(
        "table",
        "printed table: joint (of geometry and liquid), liquid alone, or geometry alone; blank:"
        " joint",
        TABLES,
    ),
)
KEYS = {"liquid": SETTINGS}
NEEDED = (  # keys of [liquid] required with liquid.csv
    *("density_kg_m3", "density_temperature_c", "expansion_per_k", "u_density_kg_m3"),
    "u_dip_zero_mm",
)

STARTS = {"survey.side": "inside", "datum.bottom_z_m": "0.0"}  # of upright tanks only
SETTING_EXAMPLES = {
    "liquid.density_kg_m3": 998.2,
    "liquid.density_temperature_c": 20.0,
    "liquid.expansion_per_k": 2.1e-4,
    "liquid.u_density_kg_m3": 0.2,
    "liquid.s_dip_mm": 0.5,
    "liquid.u_dip_zero_mm": 0.5,
    "liquid.run_ppm": 100.0,
    "meters.factor": 1.00052,
    "meters.u_factor_ppm": 400.0,
    "meters.k": 2.0,
    "meters.repeatability_ppm": 100.0,
    "meters.fixed_l": 2.0,
    "meters.certificate": "V 31/2026",
}
EXAMPLES = {
    "liquid": [
        {"run": "1", "meter": "M-3", "volume_m3": 0.0, "time": "2026-05-04T08:00"},
        {
            "run": "1",
            "meter": "M-3",
            "volume_m3": 20.034,
            "dip_m": 0.3012,
            "meter_temperature_c": 18.4,
            "tank_temperature_c": 18.1,
            "shell_temperature_c": 19.0,
            "flow_m3_h": 60.0,
            "time": "2026-05-04T08:35",
        },
    ],
}
