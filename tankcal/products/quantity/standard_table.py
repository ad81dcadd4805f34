"""Table of gross standard volumes: dips by densities and temperatures, each with its U.

A table replaces the steps of a ticket where only dip, temperature and density are read. Readings
are exact: U contains the capacity table, its interpolation, the volume correction and the expansion
of the shell.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.products.quantity.chain import QUANTITIES, Gauging, Transfer, values_of
from tankcal.products.quantity.reading import SECTIONS, SETTINGS_NAME, read_tickets
from tankcal.products.quantity.table import TankTable
from tankcal.products.settings import drop_blanks, read_sections
from tankcal.tank.volume_correction.petroleum import OutsideRangeError

MOST_CELLS = 200_000
_READINGS = ("u_dip_mm", "u_tape_ppm", "u_water_dip_mm", "u_temperature_k", "u_thermometer_k",
             "u_ambient_k", "u_density_kg_m3", "u_sw_percent")  # fmt: skip
_OPTIONS = {"temperature_c": "--temperatures", "density_kg_m3": "--densities"}


@dataclass(frozen=True)
class StandardTable:
    """Gross standard volumes of a tank.

    Attributes
    ----------
    table : TankTable
    correction : object
        Volume correction.
    dip_m : ndarray, shape (dips,)
    density_kg_m3 : ndarray, shape (densities,)
        Densities at the base temperature.
    temperature_c : ndarray, shape (temperatures,)
        Temperatures of the liquid.
    air_c : float or None
        Temperature of the air; None: the shell has the temperature of the liquid.
    vcf : ndarray, shape (densities, temperatures)
    ctsh : ndarray, shape (densities, temperatures, dips)
        Correction of the shell.
    volume_m3, U_m3, k : ndarray, shape (densities, temperatures, dips)
        Gross standard volume and its expanded uncertainty; nan where a floating roof does not
        float.
    probability : float
        Coverage probability.
    """

    table: TankTable
    correction: object
    dip_m: np.ndarray
    density_kg_m3: np.ndarray
    temperature_c: np.ndarray
    air_c: float | None
    vcf: np.ndarray
    ctsh: np.ndarray
    volume_m3: np.ndarray
    U_m3: np.ndarray
    k: np.ndarray
    probability: float


def compute_standard_table(table, settings, temperatures_c, densities, step_cm=10, air_c=None):
    """Compute gross standard volumes at each dip, density and temperature.

    Parameters
    ----------
    table : TankTable
    settings : Path
        A ticket.toml; its sections [product], [shell] and [uncertainty] are used.
    temperatures_c, densities : sequence of float
        Temperatures of the liquid, degC, and densities at the base, kg/m3.
    step_cm : int, optional
        Centimetres between two dips.
    air_c : float, optional
        Temperature of the air; None: the shell has the temperature of the liquid.

    Returns
    -------
    StandardTable

    Raises
    ------
    InputError
        For invalid settings, values outside the range of the volume correction, and a table with
        too many cells.
    """
    dips = list_dips(table, step_cm)
    shape = len(densities), len(temperatures_c), len(dips)
    _check_size(shape)
    plain = _transfer(table, settings, densities[0])
    density, temperature, dip = (
        part.ravel() for part in np.meshgrid(densities, temperatures_c, dips, indexing="ij")
    )
    correction = plain.product.correction
    _check_range(correction, densities, temperatures_c)
    # A roof that does not float has no valid volume; its cells are computed at a valid dip.
    is_critical = table.is_critical(dip)
    level = np.where(is_critical, table.height_m[-1], dip)
    count = len(level)
    product = replace(
        plain.product, density=density, sample_c=None, glass=np.ones(count),
        water_share=np.zeros(count), is_insulated=air_c is None,
        expansion_per_k=np.full(count, plain.product.expansion_per_k[0]),
    )  # fmt: skip
    air = np.full(count, np.nan if air_c is None else air_c)
    gauging = Gauging(level, np.full(count, np.nan), temperature, air, np.zeros(count))
    u = plain.u | dict.fromkeys(_READINGS, 0.0)
    transfer = Transfer(
        table, {"closing": gauging}, {"closing": level}, product, u, plain.probability
    )
    result, place = transfer.quantities()["closing"], QUANTITIES.index("gsv_m3")
    steps = values_of(transfer.steps["closing"])

    def cells(values):
        return np.where(is_critical, np.nan, values).reshape(shape)

    return StandardTable(
        table, correction, dips, np.array(densities), np.array(temperatures_c), air_c,
        steps["vcf"].reshape(shape)[:, :, 0], steps["ctsh"].reshape(shape),
        cells(result.value[:, place]), cells(result.U[:, place]), cells(result.k[:, place]),
        plain.probability,
    )  # fmt: skip


def list_dips(table, step_cm):
    """Dips of the table at whole multiples of a step in centimetres, m."""
    first, last = (100 * table.height_m[end] / step_cm for end in (0, -1))
    # The tolerance keeps a dip at a whole centimetre in spite of binary fractions.
    return np.arange(math.ceil(first - 1e-7), math.floor(last + 1e-7) + 1) * step_cm / 100


def _check_size(shape):
    """Refuse a table without dips, and too many cells."""
    count = math.prod(shape)
    if not 0 < count <= MOST_CELLS:
        text = message(
            "standard_cells", "the table would have {count} cells; expected 1 to {most}",
            count=count, most=MOST_CELLS,
        )  # fmt: skip
        raise InputError(Problem("--step-cm", text))


def _transfer(table, settings, density):
    """`Transfer` of a full tank with the product of a ticket.toml, which is checked so."""
    log = Log()
    product = [replace(field, required=field.required and field.name != "density_is")
               for field in SECTIONS["product"]]  # fmt: skip
    sections, _, _ = read_sections(settings, SECTIONS | {"product": product}, log)
    log.stop_if_problems()
    filled = drop_blanks(sections)
    product = filled.get("product", {}) | {"density_is": "base", "density_kg_m3": density}
    for key in ("density_temperature_c", "hydrometer", "sw_percent"):
        product.pop(key, None)
    if "factor_table" in product:  # beside the file of the settings
        product["factor_table"] = str(Path(settings).absolute().parent / product["factor_table"])
    kept = {name: filled[name] for name in ("ticket", "uncertainty") if name in filled}
    shell = filled.get("shell", {}) | {"insulated": True}
    correction_c = {"GPA-TP27": (60 - 32) / 1.8}.get(product.get("correction"), 15.0)
    closing = {"dip_m": float(table.height_m[-1]), "temperature_c": correction_c}
    probe = {**kept, "product": product, "shell": shell, "closing": closing}
    try:
        return read_tickets(table, probe).transfer
    except InputError as error:
        raise InputError(
            [_place_problem(problem, settings) for problem in error.problems]
        ) from error


def _place_problem(problem, settings):
    """Problem of the probe, with the file of the settings or the option of the density."""
    if problem.column == "product.density_kg_m3":
        return Problem(_OPTIONS["density_kg_m3"], problem.expected)
    is_setting = problem.file == str(SETTINGS_NAME)
    return replace(problem, file=Path(settings).name) if is_setting else problem


def _check_range(correction, densities, temperatures_c):
    """Report each density and temperature outside the range of the volume correction."""
    problems = {}
    for density in densities:
        for celsius in temperatures_c:
            try:
                correction.factor(np.array([density]), np.array([celsius]))
            except OutsideRangeError as error:
                option = _OPTIONS.get(error.quantity, "product")
                problem = Problem(option, error.expected_at((0,)))
                problems[str(problem)] = problem
    if problems:
        raise InputError([*problems.values()])
