"""Limits and defaults in running text: each is a constant of the code, with its unit."""

import math
import re
import tomllib
from statistics import NormalDist

import pytest
from page_figures import agree, figures_of
from page_sessions import ROOT
from scipy import stats

from tankcal import adjust, units
from tankcal import clouds as cloud_reading
from tankcal.calibration.parameters import judgement, recommendation
from tankcal.calibration.targets import coded
from tankcal.clouds.formats import e57, isolation, lines
from tankcal.clouds.formats import lines as counted_text
from tankcal.clouds.inside import bottom
from tankcal.clouds.inside import bottom as cloud_bottom
from tankcal.clouds.wall import cells, deciding, growing, start
from tankcal.clouds.wall import cells as cloud_readings
from tankcal.clouds.wall import deciding as features
from tankcal.geometry import clutter, shell
from tankcal.geometry.field import blunders, components, estimate, sites
from tankcal.geometry.field.components import COMPONENTS
from tankcal.geometry.field.places import OF_CYLINDERS, OF_GREAT_CIRCLES, OF_SPHERES
from tankcal.job import plausibility
from tankcal.job.checks import settings, tapes
from tankcal.job.checks.settings import MAX_TABLE_ROWS
from tankcal.job.checks.survey import readings as survey_checks
from tankcal.job.contract import registers
from tankcal.methods.clouds import bottom as clouds_bottom
from tankcal.methods.clouds import cluster, overlaps
from tankcal.methods.clouds import wall as clouds_warnings
from tankcal.methods.clouds.columns import ASSUMED
from tankcal.methods.great_circles import sphere as circles
from tankcal.methods.hits import wall as hits_wall
from tankcal.methods.hits import warnings as hits_warnings
from tankcal.methods.inside_hits import solid as inside_solid
from tankcal.methods.lines import warnings
from tankcal.methods.lines import warnings as lines_warnings
from tankcal.methods.liquid import columns as liquid_columns
from tankcal.methods.liquid import tables as liquid_facts
from tankcal.methods.strapping import warnings as tape_warnings
from tankcal.pipeline import overruling_effects as overruling
from tankcal.pipeline import scanned_solids
from tankcal.pipeline import simulation as simulation_model
from tankcal.pipeline.checks import wall as wall_checks
from tankcal.pipeline.liquid import adjustment as liquid_steps
from tankcal.pipeline.wall_straps import typical_shape_m
from tankcal.products.fieldbooks import lists
from tankcal.products.gauge import deviation
from tankcal.products.gauge import reading as gauge
from tankcal.products.inspection import edges, weld_gaps, welds
from tankcal.products.linter import grids, volumes
from tankcal.products.quantity import reading as quantity
from tankcal.products.recalibration import (
    basis,
    comparison,
    read_table,
    solid_geometry,
)
from tankcal.products.recalibration import (
    comparison as verdict,
)
from tankcal.products.upkeep import estimation, flows, watching
from tankcal.products.upkeep import reading as upkeep
from tankcal.products.upkeep import upkeep as results_of_upkeep
from tankcal.record.columns import MOST_ROWS
from tankcal.report import attachments, laboratory
from tankcal.report.inspection import tables as inspection_paper
from tankcal.report.survey import quality
from tankcal.report.web import calculator_data
from tankcal.survey import poses, readings, strapping
from tankcal.survey.diagnosis import blunders as wrong_readings
from tankcal.tank import gauging
from tankcal.tank.liquid import adjustment as liquid_adjustment
from tankcal.tank.volume_correction.petroleum import Brazil, Petroleum

MM, PERCENT, PPM = 1e3, 100, 1e6


def page_constant(name):
    """A number of rows in the template of the pages."""
    text = (ROOT / "report_templates/page.typ").read_text(encoding="utf-8")
    return int(re.search(rf"^#let {name} = (\d+)", text, re.MULTILINE)[1])


def read_limits(survey):
    """The limits of a survey."""
    path = ROOT / "tankcal/pipeline/limits" / f"{survey}.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))


COMPONENT = {component.name: component for component in COMPONENTS}
NOMINAL = read_limits("nominal_size")
STRAPS, LINES = read_limits("strapping"), read_limits("reference_line")
BARREL_M = COMPONENT["common bulge"].median_m / math.sqrt((16 / 21) ** 2 / 5 + (8 / 35) ** 2 / 9)
RECALIBRATION = tomllib.loads(
    (ROOT / "tankcal/job/rule_tables/france_2020_recalibration.toml").read_text("utf-8")
)
SETTLEMENT = tomllib.loads(
    (ROOT / "tankcal/products/inspection/rules/api_653.toml").read_text("utf-8")
)["settlement"]
HITS, TANGENTS = read_limits("wall_hits"), read_limits("tangents")
LIQUID = tomllib.loads((ROOT / "tankcal/pipeline/liquid/limits.toml").read_text("utf-8"))["wide"]
normal = NormalDist()
LYING = tomllib.loads((ROOT / "tankcal/methods/inside_hits/limits.toml").read_text("utf-8"))
ONE_IN_500 = (1, 1 / NOMINAL["share"])

# (page, sentence with () for each figure, figures in the unit of the sentence)
LIMITS = [
    (
        "docs/measurements.md",
        "blank: () mm for a vertical tank",
        [MM * typical_shape_m()],
    ),
    (
        "docs/report.md",
        "at most () kB and () pixels along a side",
        [laboratory.MAX_LOGO_BYTES / 1000, laboratory.MAX_LOGO_PIXELS],
    ),
    ("docs/report-code.md", "A table of up to () rows is not divided", [page_constant("short")]),
    ("docs/report-code.md", "Tables end after () rows", [quality.MOST_ROWS]),
    (
        "docs/report-code.md",
        "at most about twice this value (() mL if the largest u is () m³)",
        [2e6 * calculator_data.BEND, 1],
    ),
    (
        "docs/report.md",
        "unless a file is larger than () MB (`record_tables.npz`: () MB)",
        [attachments.LARGEST / 1e6, attachments.LARGEST_PACKED / 1e6],
    ),
    ("docs/saved-keys.md", "with more than () rows", [MOST_ROWS]),
    ("docs/table.md", "A table has at most () rows", [MAX_TABLE_ROWS]),
    ("docs/table.md", "| 1/8 in = () m exactly |", [units.INCH_M / 8]),
    ("docs/table.md", "| 1/16 in = () m exactly |", [units.INCH_M / 16]),
    ("docs/table.md", "(42 US gallons = () m³ exactly)", [42 * 231 * units.INCH_M**3]),
    (
        "docs/table.md",
        "ends () mm or more below it, if this is a step or more than () mm",
        [MM * volumes._LEAST_GAP_M, MM * volumes._USUAL_GAP_M],
    ),
    (
        "docs/table.md",
        "more than () % from nominal; a power of ten is named | more than () % from "
        "`--nominal-diameter` and `--nominal-height`, or () % from `--nominal-volume`; without "
        "either, a cylinder more than () times as wide as high, or () times as high as wide",
        [
            PERCENT * volumes._FAR,
            PERCENT * volumes._CLOSE_DIAMETER,
            PERCENT * volumes._CLOSE_VOLUME,
            volumes._FLATTEST,
            1 / volumes._SLIMMEST,
        ],
    ),
    (
        "docs/strapping.md",
        "If it is blank for a vertical tank, () mm is assumed",
        [MM * typical_shape_m()],
    ),
    ("docs/studies/strapping.md", "The default of () mm is not taken", [MM * typical_shape_m()]),
    (
        "docs/strapping.md",
        "pull, assumed ± () %; friction, assumed ± () % of its value",
        [PERCENT * strapping.TENSION_SHARE, PERCENT * strapping.FRICTION_SHARE],
    ),
    (
        "docs/strapping.md",
        "weight per metre, assumed ± () %",
        [PERCENT * strapping.WEIGHT_SHARE],
    ),
    (
        "docs/strapping.md",
        "with a measured temperature, assumed ± () K",
        [strapping.TAPE_TEMPERATURE_K],
    ),
    (
        "docs/strapping.md",
        "an `s_mm` below () mm, which is probably in metres (below () mm it asks",
        [settings.SURE["s_mm"], settings.LEAST["s_mm"]],
    ),
    (
        "docs/strapping.md",
        "readings () % off the circumference of the drawing or off the median",
        [PERCENT * plausibility.IMPOSSIBLE_MISS],
    ),
    (
        "docs/strapping.md",
        "a certified temperature outside () to () °C",
        tape_warnings.CERTIFIED_C,
    ),
    (
        "docs/strapping.md",
        "a correction of more than () ppm (a tape of class II of OIML R 35 is off by () mm and "
        "() mm per metre at most)",
        [STRAPS["most_correction_ppm"], *STRAPS["class_ii"].values()],
    ),
    (
        "docs/strapping.md",
        "`correction_mm` and `correction` that together exceed () ppm",
        [STRAPS["most_correction_ppm"]],
    ),
    (
        "docs/strapping.md",
        "(over () ppm the program asks)",
        [STRAPS["most_correction_ppm"]],
    ),
    (
        "docs/strapping.md",
        "tapes over () K from the temperature of the table",
        [STRAPS["shell_unlike_tape_k"]],
    ),
    (
        "docs/strapping.md",
        "more butt straps, laps or welds than one per () m",
        [tapes.LEAST_PLATE_M],
    ),
    ("docs/strapping.md", "and caps over () mm", [tapes.THICK_WELD_MM]),
    (
        "docs/studies/strapping.md",
        "than chance explains (under () %)",
        [PERCENT * tape_warnings.BY_CHANCE],
    ),
    ("docs/studies/strapping.md", "the nominal radius is missed by () in ()", ONE_IN_500),
    (
        "docs/studies/strapping.md",
        "a course differs from the others by () in ()",
        [1, 2 / NOMINAL["share"]],
    ),
    (
        "docs/wall-hits.md",
        "Hits within () mm of a weld of `welds.csv` are left out",
        [MM * HITS["weld_distance_m"]],
    ),
    (
        "docs/studies/wall-hits.md",
        "until no hit moves by () mm (one or two passes)",
        [MM * hits_wall.SETTLED_M],
    ),
    (
        "docs/wall-hits.md",
        "an `s_mm` or `s_arcsec` below (), which is probably in metres or degrees (below () it",
        [settings.SURE["s_arcsec"], settings.LEAST["s_arcsec"]],
    ),
    (
        "docs/wall-hits.md",
        "a control target that moved (() mm and () gon, or more",
        [HITS["control_distance_mm"], HITS["control_angle_gon"]],
    ),
    (
        "docs/wall-hits.md",
        "an offset of over () mm that only straps determine",
        [HITS["most_offset_mm"]],
    ),
    ("docs/wall-hits.md", "departs from the nominal radius by more than () in ()", ONE_IN_500),
    (
        "docs/wall-hits.md",
        "had moved by () mm or more. Waves 2 to 8 of the wall (() mm each)",
        [MM * hits_warnings.MOVED_M, MM * hits_warnings.WAVE_M],
    ),
    (
        "docs/wall-hits.md",
        "whose distances are all () mm or more too long or too short",
        [MM * hits_warnings.MOVED_M],
    ),
    (
        "docs/wall-hits.md",
        "a `correction` of over () ppm",
        [PPM * survey_checks.DOUBTFUL_CORRECTION],
    ),
    (
        "docs/studies/wall-hits.md",
        "until no distance from the solid changes by () mm",
        [MM * inside_solid.SETTLED_M],
    ),
    (
        "docs/studies/wall-hits.md",
        "over () % of the radius plus () mm off the wall",
        [PERCENT * scanned_solids.NEVER_PART, MM * scanned_solids.NEVER_M],
    ),
    (
        "docs/wall-hits.md",
        "a set-up with over () % of its hits rejected; - hits on less than () % of the length",
        [PERCENT * LYING["most_rejected_share"], PERCENT * LYING["least_length_share"]],
    ),
    (
        "docs/studies/wall-hits.md",
        "counts with at least its prior median of () mm",
        [MM * COMPONENT["common ovality"].median_m],
    ),
    (
        "docs/studies/wall-hits.md",
        "do not settle within () mm in four passes",
        [MM * hits_wall.UNSETTLED_M],
    ),
    (
        "docs/studies/wall-hits.md",
        "if the other order fits () or () times better",
        [poses.MIRRORED, poses.EXCHANGED],
    ),
    (
        "docs/tangents.md",
        "Tangents within () mm of a weld of `welds.csv` are left out",
        [MM * HITS["weld_distance_m"]],
    ),
    (
        "docs/studies/tangents.md",
        "with more than () of its amplitude, if a level",
        [TANGENTS["wave_in_radius"]],
    ),
    (
        "docs/tangents.md",
        "an `s_arcsec` below (), which is probably in degrees (below () it asks",
        [settings.SURE["s_arcsec"], settings.LEAST["s_arcsec"]],
    ),
    (
        "docs/tangents.md",
        "a tangent more than () m from its level",
        [TANGENTS["level_m"]],
    ),
    ("docs/tangents.md", "departs from the nominal radius by more than () in ()", ONE_IN_500),
    (
        "docs/tangents.md",
        "The limit is () mm, or three standard deviations",
        [TANGENTS["base_mm"]],
    ),
    (
        "docs/rings.md",
        "repeats that differ by more than () mm",
        [STRAPS["repeats_lying"][0]["limit_mm"]],
    ),
    ("docs/rings.md", "of repeats over () mm", [STRAPS["repeats_lying"][0]["limit_mm"]]),
    (
        "docs/rings.md",
        "the () mm are from a secondary source",
        [STRAPS["repeats_lying"][0]["limit_mm"]],
    ),
    (
        "docs/studies/spheres.md",
        "by default () % of the radius. Evenly",
        [PERCENT * circles.OVALITY_SHARE],
    ),
    (
        "docs/studies/spheres.md",
        "- slow waves l⁻³ of () mm; - plates and seams of () and () m of () mm each; - a band of "
        "() mm at the equator",
        [
            MM * OF_GREAT_CIRCLES[0].median_m,
            OF_GREAT_CIRCLES[1].width_m,
            OF_GREAT_CIRCLES[2].width_m,
            MM * OF_GREAT_CIRCLES[2].median_m,
            MM * OF_GREAT_CIRCLES[3].median_m,
        ],
    ),
    (
        "docs/spheres.md",
        "(inside for outside) or by more than () %",
        [PERCENT * NOMINAL["share"]],
    ),
    (
        "docs/spheres.md",
        "with a prior of () mm, uncertain by a factor of ()",
        [MM * OF_SPHERES[3].median_m, math.exp(OF_SPHERES[3].log_sd / 2)],
    ),
    (
        "docs/studies/reference-lines.md",
        "Beyond (), which chance exceeds in () %",
        [lines_warnings.CRITICAL_LEAN, PERCENT * math.exp(-(lines_warnings.CRITICAL_LEAN**2) / 2)],
    ),
    (
        "docs/studies/reference-lines.md",
        'of () mm/m (()"), by which two verticals may differ',
        [MM * lines_warnings.VERTICALS, 3600 * math.degrees(lines_warnings.VERTICALS)],
    ),
    (
        "docs/reference-lines.md",
        "If more than () % of the offsets, on more than half",
        [PERCENT * lines_warnings.MANY],
    ),
    (
        "docs/reference-lines.md",
        "asks about an `s_mm` below () mm and refuses an `s_mm` below () mm",
        [settings.LEAST["s_mm"], settings.SURE["s_mm"]],
    ),
    (
        "docs/reference-lines.md",
        "contradicts the lines by more than () mm of radius",
        [MM * lines_warnings.OFF_LEVEL_M],
    ),
    ("docs/reference-lines.md", "a lean of more than () %", [PERCENT * LINES["most_lean"]]),
    ("docs/reference-lines.md", "a tank of less than () m", [LINES["least_diameter_m"]]),
    (
        "docs/reference-lines.md",
        "of all others by over () mm and by five times",
        [MM * warnings.APART_M],
    ),
    (
        "docs/reference-lines.md",
        "by () standard deviations less than all of them",
        [warnings.SURE_SDS],
    ),
    (
        "docs/reference-lines.md",
        "offsets that are all under () mm",
        [LINES["least_offset_mm"]],
    ),
    ("docs/reference-lines.md", "which shows errors of () in () of the drawing", ONE_IN_500),
]


U_OF_TICKET, U_OF_GAUGE = gauging.UNCERTAINTIES, gauge.UNCERTAINTIES
LIMITS += [
    ("docs/ticket.md", "| `u_dip_mm` | (), of each dip |", [U_OF_TICKET["u_dip_mm"]]),
    ("docs/ticket.md", "| `u_tape_ppm` | (), of the length read |", [U_OF_TICKET["u_tape_ppm"]]),
    (
        "docs/ticket.md",
        "| `u_water_dip_mm` | (), of each water dip |",
        [U_OF_TICKET["u_water_dip_mm"]],
    ),
    (
        "docs/ticket.md",
        "| `u_temperature_k` | (), of the mean temperature",
        [U_OF_TICKET["u_temperature_k"]],
    ),
    ("docs/ticket.md", "| `u_thermometer_k` | (), common", [U_OF_TICKET["u_thermometer_k"]]),
    ("docs/ticket.md", "| `u_ambient_k` | (), common", [U_OF_TICKET["u_ambient_k"]]),
    ("docs/ticket.md", "| `u_density_kg_m3` | () |", [U_OF_TICKET["u_density_kg_m3"]]),
    ("docs/ticket.md", "| `u_sw_percent` | (), if S&W", [U_OF_TICKET["u_sw_percent"]]),
    (
        "docs/ticket.md",
        "| by distance from the base: () % at () K, () % at () K |",
        [
            PERCENT * float(gauging.assumed_u_vcf(42.0, 20.0)),
            22,
            PERCENT * float(gauging.assumed_u_vcf(70.0, 20.0)),
            50,
        ],
    ),
    (
        "docs/studies/ticket.md",
        "temperature in degrees Fahrenheit | warning above () °C for a light product",
        [quantity.HOTTEST_C],
    ),
    (
        "docs/studies/ticket.md",
        "S&W as a fraction | warning below () %",
        [quantity.LEAST_SW_PERCENT],
    ),
    (
        "docs/studies/ticket.md",
        "differs from the table by more than () mm",
        [MM * quantity.MOST_REFERENCE_SHIFT_M],
    ),
    (
        "docs/studies/ticket.md",
        "`CNP-6-70` differs from D1250 at 20 °C: by () % for gasoline of () kg/m³ at () °C",
        [
            PERCENT
            * abs(
                Brazil(is_rounded=False).factor(740.0, 30.0)
                / Petroleum(2004, "products", "20C").factor(740.0, 30.0)
                - 1
            ),
            740,
            30,
        ],
    ),
    ("docs/gauge.md", "| `u_dip_mm` | (), of a single dip", [U_OF_GAUGE["u_dip_mm"]]),
    ("docs/gauge.md", "| `u_gauge_mm` | (), of the indication", [U_OF_GAUGE["u_gauge_mm"]]),
    ("docs/gauge.md", "| `u_tape_zero_mm` | (), common", [U_OF_GAUGE["u_tape_zero_mm"]]),
    ("docs/gauge.md", "| `u_tape_ppm` | (), common", [U_OF_GAUGE["u_tape_ppm"]]),
    (
        "docs/gauge.md",
        "| `u_tape_temperature_k` | (), common",
        [U_OF_GAUGE["u_tape_temperature_k"]],
    ),
    (
        "docs/gauge.md",
        "| `u_reference_mm`, `u_table_reference_mm` | () |",
        [U_OF_GAUGE["u_reference_mm"]],
    ),
    (
        "docs/gauge.md",
        "| `u_dip_plate_mm`, `u_table_zero_mm` | (), of `[zeros]`",
        [U_OF_GAUGE["u_dip_plate_mm"]],
    ),
    ("docs/gauge.md", "| `u_movement_percent` | (), of h", [U_OF_GAUGE["u_movement_percent"]]),
    (
        "docs/gauge.md",
        "1/cos t - 1, which is () mm/m at ()°",
        [MM * (1 / math.cos(math.radians(1)) - 1), 1],
    ),
    (
        "docs/studies/gauge.md",
        "If its probability is at least () %, both are pooled. The declared variance has () "
        "degrees of freedom (known to about () %",
        [
            PERCENT * deviation.LEAST_PROBABILITY,
            deviation.SCATTER_DOF,
            PERCENT / math.sqrt(2 * deviation.SCATTER_DOF),
        ],
    ),
    (
        "docs/studies/gauge.md",
        "Below () %, the residuals alone",
        [PERCENT * deviation.LEAST_PROBABILITY],
    ),
    (
        "docs/upkeep.md",
        "a counter that falls from above () % to below () % of a power of ten",
        [PERCENT * (1 - flows.ROLLOVER), PERCENT * flows.ROLLOVER],
    ),
    (
        "docs/upkeep.md",
        "Over () % of unused levels cause a warning, over () % a refusal",
        [PERCENT * upkeep.UNUSED_WARNED, PERCENT * upkeep.UNUSED_REFUSED],
    ),
    (
        "docs/upkeep.md",
        "Steps with |w| over () are rejected, at most () %",
        [estimation.OUTLIER, PERCENT * estimation.MOST_REJECTED],
    ),
    ("docs/upkeep.md", "fewer than () steps", [estimation.LEAST_STEPS]),
    ("docs/upkeep.md", "(u over () % of the content)", [PERCENT * results_of_upkeep.WIDE]),
    (
        "docs/upkeep.md",
        "of blocks of () days of the tank. Below () days the limit is provisional, () times that "
        "of the model. A cause is named only if no other cause is within () of",
        [watching.BLOCK_DAYS, watching.LEAST_TANK_DAYS, watching.PROVISIONAL, watching.ALIKE],
    ),
    (
        "docs/studies/read-table.md",
        "deviate by more than () % of the highest volume",
        [PERCENT * read_table.WORST_FIT],
    ),
    (
        "docs/studies/read-table.md",
        "if diameters that differ by more than () % explain them",
        [PERCENT * (solid_geometry.LARGEST_RATIO - 1)],
    ),
    (
        "docs/compare.md",
        "Tables whose volumes differ by more than () % at the highest",
        [PERCENT * comparison.MOST_APART],
    ),
    ("docs/compare.md", "a difference of over () mm and three u", [MM * comparison.LEAST_ZERO_M]),
    ("docs/studies/compare.md", "(() mm without a limit)", [MM * verdict.USUAL_LIMIT_M]),
    ("docs/studies/compare.md", "Less than () mm, or two u, counts", [MM * basis.LEAST_ZERO_M]),
    (
        "docs/studies/compare.md",
        "For example, 0.70, 0.46 and 0.60 m³ give () with c = 0 and () with 0.5",
        [0.70 / math.sqrt(0.46**2 + 0.60**2 - 2 * c * 0.46 * 0.60) for c in (0.0, 0.5)],
    ),
    (
        "docs/studies/liquid.md",
        "until no dip moves by more than () of its standard deviation",
        [liquid_steps.DIPS_SETTLED],
    ),
    (
        "docs/studies/liquid.md",
        "This is () u for () steps and u = () %, () u for () steps and u = () %",
        [100 * 0.03e-2, 100, 0.03, 300 * 0.5e-2, 300, 0.5],
    ),
    (
        "docs/liquid.md",
        "A horizontal tank has () % of diameter and length, () mm/m and () mm of zero; a sphere "
        "() %, a mesh () %",
        [
            PERCENT * LIQUID["size"],
            LIQUID["tilt_mm_per_m"],
            LIQUID["zero_mm"],
            PERCENT * LIQUID["size"],
            PERCENT * LIQUID["scale"],
        ],
    ),
    (
        "docs/liquid.md",
        "The smallest detectable size (power () at () %) is () sd",
        [
            adjust.POWER,
            PERCENT * adjust.ALPHA,
            normal.inv_cdf(1 - adjust.ALPHA / 2) + normal.inv_cdf(adjust.POWER),
        ],
    ),
    (
        "docs/liquid.md",
        "has |w| over (), the likeliest cause is named, with all causes that chi-square does not "
        "distinguish from it (())",
        [liquid_adjustment.LEAST, liquid_adjustment.ALIKE],
    ),
    ("docs/studies/liquid.md", "Above () U the certificate states", [liquid_facts.HIDDEN_U]),
    (
        "docs/studies/liquid.md",
        "() mm in () m changes the head by () % of its value",
        [1, 6.5, PERCENT * (1 / 6500) * 3],
    ),
    (
        "docs/studies/liquid.md",
        "() K is () ppm of a vertical tank",
        [1, 2 * PPM * 1.1e-5],
    ),
    (
        "docs/clouds.md",
        "XML above () MB, of more than () elements, nested more than () deep",
        [e57.LONGEST_XML >> 20, e57.MOST_ELEMENTS, e57.DEEPEST],
    ),
    (
        "docs/studies/clouds-files.md",
        "numbers that do not resolve () mm",
        [MM * cloud_reading.COARSEST_M],
    ),
    (
        "docs/studies/clouds-files.md",
        "in a child process with () GB of memory",
        [isolation.MEMORY_LIMIT >> 30],
    ),
    (
        "docs/clouds.md",
        "may have at most () scans and lines of () MB",
        [counted_text.MOST_SCANS, lines.LONGEST_LINE >> 20],
    ),
    (
        "docs/clouds.md",
        "a LAS scale of () rounds to () mm, a standard deviation of () mm",
        [0.001, 1, 1 / math.sqrt(12)],
    ),
    (
        "docs/studies/clouds-files.md",
        "processes of this machine with at most () GB of memory each",
        [cluster.WORKER_BYTES >> 30],
    ),
    (
        "docs/studies/clouds-files.md",
        "Allow () GB of memory for each worker",
        [cluster.WORKER_BYTES >> 30],
    ),
    (
        "docs/clouds-job.md",
        '(()" are () mm at () m of height)',
        [10, MM * 10 * units.ARCSEC * 10, 10],
    ),
    ("docs/clouds-job.md", "| `u_offset_mm` | () mm |", [ASSUMED["u_offset_mm"]]),
    ("docs/clouds-job.md", "| `u_scale_ppm` | () ppm |", [ASSUMED["u_scale_ppm"]]),
    (
        "docs/clouds-job.md",
        "| `s_translation_mm` | () mm along each axis |",
        [ASSUMED["s_translation_mm"]],
    ),
    (
        "docs/clouds-job.md",
        '| `s_rotation_arcsec` | ()" about each axis |',
        [ASSUMED["s_rotation_arcsec"]],
    ),
    (
        "docs/clouds-job.md",
        "w = 180°/n. It is (), (), (), () σ for 3, 4, 6, 8 scans",
        [math.sin(math.pi / n) / (math.pi / n * math.sqrt(n)) for n in (3, 4, 6, 8)],
    ),
    (
        "docs/clouds-job.md",
        "a scan with less than () % of its points on the wall",
        [PERCENT * clouds_warnings.LEAST_OF_WALL],
    ),
    (
        "docs/studies/clouds-wall.md",
        "incidences up to ()° and has a level of () %",
        [overlaps.STEEPEST_DEG, PERCENT * overlaps.LEVEL],
    ),
    (
        "docs/clouds-job.md",
        "if less than () % of the plan is seen",
        [PERCENT * (1 - clouds_bottom.UNSEEN)],
    ),
    (
        "docs/studies/clouds-wall.md",
        "occupied if it holds () % of the fullest class",
        [PERCENT * growing.OCCUPIED],
    ),
    (
        "docs/studies/clouds-wall.md",
        "belong to the wall if they lie within () mm of it (() mm more for each metre",
        [MM * growing.PATCH_STEP_M, MM * growing.PATCH_SLOPE],
    ),
    (
        "docs/studies/clouds-wall.md",
        "deviates by three standard deviations and () mm",
        [MM * growing.LEAST_TREND_M],
    ),
    (
        "docs/studies/clouds-wall.md",
        "Two surfaces are refused where () % of the cells of most sectors show both, or where "
        "another connected surface has () % of the cells",
        [PERCENT * deciding.TWO_SURFACES, PERCENT * deciding.RIVAL],
    ),
    (
        "docs/studies/clouds-wall.md",
        "(inwards for scans from outside) in () % of its coarse cells",
        [PERCENT * cells.REAR_SHARE],
    ),
    (
        "docs/studies/clouds-wall.md",
        "without a step in () % of the rows",
        [PERCENT * cells.LEAVING_SHARE],
    ),
    (
        "docs/studies/clouds-wall.md",
        "accepted with a radius within () % of the nominal radius",
        [PERCENT * start.WIDE],
    ),
    (
        "docs/studies/clouds-wall.md",
        "any surface whose radius differs by more than () %",
        [PERCENT * start.WIDE],
    ),
    (
        "docs/studies/clouds-wall.md",
        "A radius that differs by more than () % is",
        [PERCENT * start.WIDE],
    ),
    (
        "docs/studies/clouds-wall.md",
        "thinner than () mm counts as wall",
        [MM * growing.PATCH_STEP_M],
    ),
    (
        "docs/studies/clouds-wall.md",
        "nor is a weld under () mm",
        [MM * features.LEAST_WELD_M],
    ),
    (
        "docs/studies/clouds-wall.md",
        "A second surface over less than () % of the cells",
        [PERCENT * deciding.RIVAL],
    ),
    (
        "docs/studies/clouds-wall.md",
        "A layer of () mm over the plan of a tank of () m is () % of its volume",
        [1, 8, PERCENT * 1e-3 / 8],
    ),
    (
        "docs/liquid-job.md",
        "| `u_expansion_per_k` | () % of the expansion |",
        [PERCENT * liquid_columns.EXPANSION_SHARE],
    ),
    (
        "docs/liquid-job.md",
        "| `u_radius_mm` | () % of the radius of the drawing",
        [PERCENT * liquid_columns.RADIUS_SHARE],
    ),
    (
        "docs/liquid-job.md",
        "a meter that drifted by more than () %",
        [PERCENT * plausibility.METER_DRIFT],
    ),
    ("docs/clouds-job.md", "| `u_incidence_mm` | () mm at 60°", [registers.USUAL_INCIDENCE_MM]),
    (
        "docs/studies/clouds-wall.md",
        "are counted in classes of () mm. The range is () m, or () of the radius",
        [MM * bottom.BIN_M, bottom.LEAST_REACH_M, bottom.REACH],
    ),
    (
        "docs/studies/clouds-wall.md",
        "meet the foot of the shell within () m (or () % of the radius) and appear in () % of the",
        [
            cloud_bottom.FOOT_OFF_M,
            PERCENT * cloud_bottom.FOOT_SHARE,
            PERCENT * cloud_bottom.LEAST_SHARE,
        ],
    ),
    (
        "docs/studies/clouds-wall.md",
        "connected cells () mm or more below the",
        [MM * cloud_bottom.LEAST_PIT_M],
    ),
    ("docs/studies/clouds-wall.md", "and not steeper than ().", [growing.STEEPEST]),
    (
        "docs/studies/clouds-wall.md",
        "a roof over () % of the plan or more",
        [PERCENT * cloud_bottom.ROOF_SHARE],
    ),
    (
        "docs/studies/wall-model.md",
        "is a bulge of () b rms, or of () b if it is a parabola",
        [math.sqrt((16 / 21) ** 2 / 5 + (8 / 35) ** 2 / 9), math.sqrt((2 / 3) ** 2 / 5)],
    ),
    (
        "docs/studies/wall-model.md",
        "corresponds to a barrel of () mm, and the mean of its variance to () mm",
        [MM * BARREL_M, MM * BARREL_M * math.exp(COMPONENT["common bulge"].log_sd ** 2 / 4)],
    ),
    (
        "docs/studies/wall-model.md",
        "have a prior correlation of (). The correlation is () for joints and seams",
        [components.WORKMANSHIP, components.WORKMANSHIP + components.SHRINKAGE],
    ),
    ("docs/uncertainty.md", "at a level of () %", [PERCENT * adjust.ALPHA]),
    (
        "docs/studies/wall-model.md",
        "exceeds (), its critical value at () %",
        [adjust.CRITICAL, PERCENT * adjust.ALPHA],
    ),
    (
        "docs/studies/wall-model.md",
        "corresponds to two seams of () mm, () m wide",
        [MM * estimate.DEPTH_M, estimate.WIDTH_M],
    ),
    ("docs/studies/wall-model.md", "(1 - (w/s)²), w = () m", [estimate.WIDTH_M]),
    (
        "docs/studies/wall-model.md",
        "are sought within () mm of it, or within () % of the radius if that is more. A buckle or "
        "a settled shell of a small tank departs from the cylinder by more than () %",
        [MM * shell.LEAST_BAND_M, PERCENT * shell.WALL_BAND, PERCENT * shell.WALL_BAND],
    ),
    (
        "docs/studies/coverage.md",
        "pipes that stand off by less than () mm. It also applies to pipes among more than () "
        "points near the wall or fewer than () columns",
        [MM * blunders.LEAST_M, sites.MOST_SITES, blunders.FEWEST],
    ),
    (
        "docs/studies/coverage.md",
        "exceed its prior median of () mm rms",
        [MM * COMPONENT["common taper"].median_m],
    ),
    (
        "docs/studies/coverage.md",
        "measured at one height, () % of the course or more off its middle",
        [PERCENT * wall_checks.OFF_MIDDLE],
    ),
    (
        "docs/studies/section-noise.md",
        "if one of them fails at () %",
        [PERCENT * wall_checks.LEVEL],
    ),
    (
        "docs/studies/section-noise.md",
        "all sections together at () %",
        [PERCENT * wall_checks.LEVEL],
    ),
    (
        "docs/studies/wall-or-fitting.md",
        "with a median of () mm off the wall at most",
        [MM * clutter.FARTHEST_M],
    ),
    (
        "docs/studies/wall-or-fitting.md",
        "is rejected if the jump is () mm, 5 times the scatter about the smooth form, and () "
        "standard deviations",
        [MM * blunders.LEAST_M, blunders.LEAST_W],
    ),
    (
        "docs/studies/wall-model.md",
        "A point is rejected if it is () mm and () standard deviations off the wall shown by the "
        "other points (with more than 600 points, off the median of () neighbours). It is also "
        "rejected if it is farther than () % of the radius and () mm",
        [
            MM * scanned_solids.DENT_M,
            scanned_solids.FAR,
            scanned_solids.NEIGHBOURS,
            PERCENT * scanned_solids.NEVER_PART,
            MM * scanned_solids.NEVER_M,
        ],
    ),
    (
        "docs/decision-rules.md",
        "reference height () mm; at most () years",
        [
            RECALIBRATION["reference_height"]["total"]["limit_mm"],
            RECALIBRATION["period"]["all"]["years"],
        ],
    ),
    (
        "docs/studies/propagation.md",
        "In tables of more than () rows",
        [simulation_model.MOST_ROWS],
    ),
    (
        "docs/decision-rules.md",
        "conforms with a probability of () % (k = ()",
        [PERCENT * normal.cdf(1.959964), 1.959964],
    ),
    (
        "docs/studies/propagation.md",
        "too large by () π s² (() even points)",
        [(24 - 3) / 24, 24],
    ),
    (
        "docs/adjustment.md",
        "beyond () the observation contradicts the others (() %)",
        [adjust.CRITICAL, PERCENT * adjust.ALPHA],
    ),
    (
        "docs/adjustment.md",
        "that the w-test detects with a probability of () %",
        [PERCENT * adjust.POWER],
    ),
    (
        "docs/studies/adjustment.md",
        "if more than () % of all values, or a known coordinate, were rejected, and if one known "
        "point or photo lost far more than the others (binomial test, () %)",
        [PERCENT * wrong_readings.MANY, PERCENT * wrong_readings.LEVEL],
    ),
    ("docs/studies/adjustment.md", "agrees without them (both at () %", [PERCENT * adjust.ALPHA]),
    ("docs/studies/adjustment.md", "contradict each other beyond () %", [PERCENT * readings.LEVEL]),
    (
        "docs/adjustment.md",
        "(factor √χ²(3): (), (), () for 90, 95, 99 %; the standard ellipsoid holds () %)",
        [*(math.sqrt(stats.chi2.ppf(p, 3)) for p in (0.9, 0.95, 0.99)), 100 * stats.chi2.cdf(1, 3)],
    ),
    ("docs/archive.md", "long tables of more than () MB", [attachments.LARGEST_PACKED / 1e6]),
    ("docs/studies/camera.md", "with () px added", [coded.SD_FLOOR_PX]),
    ("docs/studies/camera.md", "`--alpha` ()", [judgement.ALPHA]),
    (
        "docs/studies/camera.md",
        "with a share below () % (0.7 % in print). Of the parameters that load above () on one "
        "component, the parameter with the smallest loading is dropped. Loadings closer than ()",
        [recommendation.NEGLIGIBLE_PERCENT, recommendation.LOADING, recommendation.ALIKE],
    ),
    (
        "docs/studies/methods.md",
        "leaning cylinder, band from () % to () % of the radius (() mm at least). Points more "
        "than () mm from",
        [
            PERCENT * shell.WIDE_BAND,
            PERCENT * shell.WALL_BAND,
            MM * shell.LEAST_BAND_M,
            MM * shell.BELIEVED_M,
        ],
    ),
    (
        "docs/studies/methods.md",
        "accepted points that deviates by () mm and () standard",
        [MM * blunders.LEAST_M, blunders.LEAST_W],
    ),
    ("docs/studies/methods.md", "rejected points within () mm that", [MM * clutter.FARTHEST_M]),
    (
        "docs/conventions.md",
        "with conventional weights, () % more for rho = () kg/m3",
        [PERCENT * ((1 - 1.2 / 8000) / (850 - 1.2) * 850 - 1), 850],
    ),
    ("docs/import.md", "Files may have up to () MB", [lists.MAX_BYTES / 1e6]),
    (
        "docs/inspection-welds.md",
        "A board of () mm (36 in) is centred",
        [MM * weld_gaps.BOARD_M],
    ),
    ("docs/inspection-welds.md", "largest |g| within () mm of it", [MM * weld_gaps.REACH_M]),
    (
        "docs/inspection-welds.md",
        "A peak of () mm exp(-|s|/w) has gaps of (), () and () mm for w = (), () and () m",
        [
            8,
            *(8 * (1 - math.exp(-weld_gaps.BOARD_M / 2 / w)) for w in (0.1, 0.15, 0.3)),
            0.1,
            0.15,
            0.3,
        ],
    ),
    (
        "docs/studies/inspection-welds.md",
        "are divided: () mm across the weld (up to () mm where",
        [MM * welds.ACROSS_M, MM * welds.WIDEST_M],
    ),
    ("docs/studies/inspection-welds.md", "through the cells within () mm", [MM * weld_gaps.END_M]),
    ("docs/studies/inspection-welds.md", "The middle () mm of a weld", [2 * MM * weld_gaps.BEAD_M]),
    (
        "docs/studies/inspection-welds.md",
        "over all boards deviates by () mm or more",
        [MM * weld_gaps.LEAST_BEAD_M],
    ),
    (
        "docs/studies/inspection-welds.md",
        "a hole of more than () mm near the weld, an end without wall on both sides, or a step "
        "that no plate has (() mm from",
        [MM * weld_gaps.HOLE_M, MM * weld_gaps.STEP_M],
    ),
    ("docs/inspection-welds.md", "A step of () mm or more is not", [MM * weld_gaps.STEP_M]),
    (
        "docs/limits.md",
        "a bulge of () mm rms is assumed, uncertain by a factor of ()",
        [
            MM * COMPONENT["common bulge"].median_m,
            math.exp(COMPONENT["common bulge"].log_sd / 2),
        ],
    ),
    (
        "docs/limits.md",
        "farther from the wall than () % of the radius, and farther than () mm",
        [PERCENT * shell.WALL_BAND, MM * shell.LEAST_BAND_M],
    ),
    ("docs/limits.md", "or a pipe within () mm of the wall", [MM * clutter.FARTHEST_M]),
    ("docs/limits.md", "or pipes less than () mm from the wall", [MM * blunders.LEAST_M]),
    (
        "docs/limits.md",
        "clutter within () % of the radius and () mm of the wall",
        [PERCENT * scanned_solids.NEVER_PART, MM * scanned_solids.NEVER_M],
    ),
    (
        "docs/limits.md",
        "At most () pages and () MB of drawing",
        [grids.MOST_PAGES, grids.MOST_CONTENT / 1e6],
    ),
    (
        "docs/planning.md",
        "the largest undetected blunder (() %, power () %)",
        [PERCENT * adjust.ALPHA, PERCENT * adjust.POWER],
    ),
    (
        "docs/overruling.md",
        "A kept point more than () mm from the wall that the others show, or a kept point or "
        "reading with |w| above ()",
        [MM * overruling.OUTRAGEOUS_M, overruling.OUTRAGEOUS],
    ),
    (
        "docs/settlement.md",
        "only if the bend is significant at () %",
        [PERCENT * edges.ALPHA],
    ),
    (
        "docs/plausibility.md",
        "`checks.diameter_is` (() % + () mm)",
        [PERCENT * plausibility.DRAWN_MISS, MM * plausibility.DRAWN_MISS_M],
    ),
    ("docs/record-format.md", "until at most () remain", [cloud_readings.MOST_CELLS]),
    ("docs/settlement.md", "to be at least (); not determined", [SETTLEMENT["least_r2"]]),
    (
        "docs/where.md",
        "significance level of the tests of readings** (() %, ())",
        [PERCENT * adjust.ALPHA, adjust.CRITICAL],
    ),
    (
        "docs/plausibility.md",
        "each course, may depart by () in () and () standard uncertainties of points",
        [*ONE_IN_500, NOMINAL["sds"]],
    ),
    (
        "docs/plausibility.md",
        "More than () % is refused",
        [PERCENT * plausibility.IMPOSSIBLE_MISS],
    ),
    (
        "docs/plausibility.md",
        "their centres are at most () mm from the wall",
        [plausibility.TARGET_MM["flat"][1]],
    ),
    ("docs/plausibility.md", "A departure within () in () is not detected", ONE_IN_500),
    ("docs/liquid-papers.md", "changes a volume by more than () U", [liquid_facts.HIDDEN_U]),
    (
        "docs/inspection.md",
        "gap under a board of () mm centred on a vertical or a horizontal weld: the largest gap "
        "within () mm",
        [MM * weld_gaps.BOARD_M, MM * weld_gaps.REACH_M],
    ),
    (
        "docs/studies/inspection.md",
        "Above () % it is printed as > () %",
        [PERCENT * inspection_paper._SURE, PERCENT * inspection_paper._SURE - 0.05],
    ),
]


@pytest.mark.parametrize(
    ("page", "sentence", "values"), LIMITS, ids=lambda item: item if isinstance(item, str) else ""
)
def test_a_limit_in_the_text_is_that_of_the_code(page, sentence, values):
    printed = figures_of(page, sentence)
    assert agree(values, printed), (printed, values)


PRIORS = [
    (
        "docs/studies/wall-model.md",
        "equal in all courses | () mm, () | | drawn-in",
        ["common bulge"],
    ),
    (
        "docs/studies/wall-model.md",
        "equal in all courses | () mm, () | | own bulge",
        ["drawn-in joints"],
    ),
    (
        "docs/studies/wall-model.md",
        "of each course independently | () mm, (); () mm, () |",
        ["own bulge", "own taper"],
    ),
    (
        "docs/studies/wall-model.md",
        "lapped and telescopic shells do | () mm, () |",
        ["common taper"],
    ),
    (
        "docs/studies/wall-model.md",
        "variance k^-3; over the whole shell, and of each course | () mm, (); () mm, () |",
        ["common ovality", "own ovality"],
    ),
    (
        "docs/studies/wall-model.md",
        "to its ends with either sign | () mm, () |",
        ["turning ovality"],
    ),
    ("docs/studies/wall-model.md", "(mean square over the shell) | () mm, () |", ["settlement"]),
    (
        "docs/studies/wall-model.md",
        "^2)^-2; over the whole shell, and of each course | () mm, (); () mm, () |",
        ["common seams", "own seams"],
    ),
    ("docs/studies/wall-model.md", "over half a course in height | () mm, () |", ["dents"]),
    (
        "docs/studies/wall-model.md",
        "of all welds together, and of each | peak of () mm, (); () mm, () |",
        ["peaking", "own peaks"],
    ),
]


@pytest.mark.parametrize(("page", "sentence", "names"), PRIORS, ids=lambda item: "")
def test_priors_of_the_wall_in_the_text(page, sentence, names):
    values = [
        value
        for name in names
        for value in (MM * COMPONENT[name].median_m, math.exp(COMPONENT[name].log_sd / 2))
    ]
    assert agree(values, figures_of(page, sentence))


SOLIDS = [
    (
        "docs/studies/wall-model.md",
        "(rings of plate, girth welds) | bulge | () mm, () each",
        OF_CYLINDERS[0],
    ),
    ("docs/studies/wall-model.md", "(a sag) | bulge | () mm, () |", OF_CYLINDERS[2]),
    ("docs/studies/wall-model.md", "and over 2 m | ovality | () mm, ();", OF_CYLINDERS[3]),
    ("docs/studies/wall-model.md", "ovality | 3 mm, 2.7; () mm, () | | |", OF_CYLINDERS[4]),
    ("docs/studies/wall-model.md", "and over 1.5 m | seams | () mm, () each", OF_CYLINDERS[5]),
    ("docs/studies/wall-model.md", "dents of 0.3 m | seams | () mm, () |", OF_CYLINDERS[7]),
    (
        "docs/studies/wall-model.md",
        "along the bottom, over 3 m | seams | () mm, () |",
        OF_CYLINDERS[8],
    ),
    (
        "docs/studies/wall-model.md",
        "of the great-circle angle | ovality | () mm, () |",
        OF_SPHERES[0],
    ),
    ("docs/studies/wall-model.md", "dents of 1.2 m | seams | () mm, ();", OF_SPHERES[1]),
    ("docs/studies/wall-model.md", "| seams | 4 mm, 2.1; () mm, () | | |", OF_SPHERES[2]),
    ("docs/studies/wall-model.md", "by its own weight | oblateness | () mm, () |", OF_SPHERES[3]),
]


@pytest.mark.parametrize(("page", "sentence", "departure"), SOLIDS, ids=lambda item: "")
def test_priors_of_horizontal_tanks_and_spheres_in_the_text(page, sentence, departure):
    values = [MM * departure.median_m, math.exp(departure.log_sd / 2)]
    assert agree(values, figures_of(page, sentence))


RULES = [
    (
        "docs/decision-rules.md",
        "| `oiml_r71` | U of the volumes: () % vertical, () % horizontal and inclined, () % others",
        "oiml_r71",
    ),
    (
        "docs/decision-rules.md",
        "| `inmetro_103_2022` | U of the volumes: () % vertical |",
        "inmetro_103_2022",
    ),
    (
        "docs/decision-rules.md",
        "| `france_2003` | relative U of the volumes: () % vertical, () % others",
        "france_2003",
    ),
    ("docs/decision-rules.md", "level marks outside: () %;", "france_2003_outside"),
    ("docs/decision-rules.md", "; alcohol () % |", "france_2003_alcohol"),
    (
        "docs/decision-rules.md",
        "new table against the former: () % at the top and of the range",
        "france_2020_recalibration",
    ),
    ("docs/decision-rules.md", "of at least 500 mm: () % of the capacity", "norway_2007"),
    ("docs/decision-rules.md", "calibrated zone of tankers: () %;", "france_2003_rail_tankers"),
    ("docs/decision-rules.md", "calibrated zone of tankers: () %;", "france_2003_road_tankers"),
    (
        "docs/decision-rules.md",
        "deviation of the volumes: () % vertical, () % horizontal; twice",
        "germany_2014",
    ),
    ("docs/decision-rules.md", "of the volumes of ships' tanks: () %;", "eu_71_349"),
]


def test_periods_of_tankers_in_the_text():
    printed = figures_of("docs/decision-rules.md", "; at most () and () years | yes: articles 32")
    names = ("france_2003_rail_tankers", "france_2003_road_tankers")
    files = (ROOT / f"tankcal/job/rule_tables/{name}.toml" for name in names)
    years = [tomllib.loads(file.read_text("utf-8"))["period"]["all"]["years"] for file in files]
    assert [float(text) for text in printed] == years


@pytest.mark.parametrize(("page", "sentence", "name"), RULES, ids=lambda item: "")
def test_limits_of_rules_in_the_text(page, sentence, name):
    rule = tomllib.loads((ROOT / f"tankcal/job/rule_tables/{name}.toml").read_text("utf-8"))
    limits = [
        entry["limit_percent"]
        for kind in ("uncertainty", "deviation")
        for entry in rule.get(kind, {}).values()
        if "limit_percent" in entry
    ]
    printed = [float(text) for text in figures_of(page, sentence)]
    assert printed == list(dict.fromkeys(limits))
