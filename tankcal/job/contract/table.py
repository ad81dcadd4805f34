"""The keys of [table]."""

from tankcal.job.contract.kinds import VERTICAL
from tankcal.job.fields import Field
from tankcal.text.languages import LANGUAGES

TABLE = (
    Field(
        "step_m",
        "number",
        "step of the capacity table, metres: 0.01 for centimetres; blank with feet and inches",
        low=0,
        above_low=True,
        start="0.01",
    ),
    Field(
        "reference_temperature_c",
        "number",
        "shell temperature that the table is for, degrees Celsius",
        required=True,
        low=-200,
        high=300,
    ),
    Field(
        "height_unit",
        "choice",
        "of the printed table: m, or feet and inches in steps of 1/8 or 1/16 inch; blank: m",
        choices=("m", "ft-in-8", "ft-in-16"),
    ),
    Field(
        "volume_unit",
        "choice",
        "of the printed table: m3, L, or bbl (42 US gallons); blank: m3",
        choices=("m3", "L", "bbl"),
    ),
    Field(
        "fine_step_m",
        "number",
        "smaller step within fine_zones, metres",
        low=0,
        above_low=True,
    ),
    Field(
        "fine_zones",
        "ranges",
        "dips, metres, between which the table has that step: 0-0.3; 2.1-2.4",
    ),
    Field(
        "max_interpolation_error_l",
        "number",
        "largest error of linear interpolation between rows, litres; without step_m the step is"
        " chosen by it",
        low=0,
        above_low=True,
        high=1e5,
    ),
    Field(
        "height_expansion",
        "flag",
        "true: dips expand with the shell, too; blank: false",
    ),
    Field(
        "liquid_density_kg_m3",
        "number",
        "density of the liquid that loads the shell, kg/m3; 0 or blank: no head",
        kinds=VERTICAL,
        low=0,
        high=3000,
    ),
    Field(
        "other_densities_kg_m3",
        "numbers",
        "densities of further tables, kg/m3: 700; 850",
        kinds=VERTICAL,
        low=0,
        above_low=True,
        high=3000,
    ),
    Field(
        "coverage_probability",
        "number",
        "of the expanded uncertainty; blank: 0.95",
        low=0.5,
        high=0.9999,
    ),
    Field(
        "rule",
        "rule name",
        "decision rule that the table is judged by: one that ships with tankcal, such as oiml_r71,"
        " or a .toml file beside job.toml; blank: none",
    ),
    Field(
        "minimum_delivery_m",
        "numbers",
        "heights of the least deliveries whose worst uncertainty is reported, metres: 1.5; 2;"
        " blank: 1.5, 2 and 3 as far as they fit",
        low=0,
        above_low=True,
        high=100,
    ),
    Field(
        "monte_carlo",
        "flag",
        "false: no Monte Carlo beside the law of propagation; blank: true",
    ),
    Field(
        "language",
        "choice",
        "language of the papers; blank: English",
        choices=LANGUAGES,
    ),
)
