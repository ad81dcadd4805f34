"""`tankcal ticket`: the chain, the uncertainty of transfers, reading, and the command."""

import csv
import json
from dataclasses import replace

import numpy as np
import plain_quantity
import pytest
from page_figures import agree, figures_of, value_of

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.products.quantity.chain import QUANTITIES, Gauging, Product, Transfer, follow_chain
from tankcal.products.quantity.reading import read_tickets
from tankcal.products.quantity.results import check_output, rows_of
from tankcal.products.quantity.table import TankTable, read_table
from tankcal.tank.fittings import floating_roof
from tankcal.tank.gauging import UNCERTAINTIES
from tankcal.tank.volume_correction.petroleum import Petroleum, glass_correction

NSV = QUANTITIES.index("nsv_m3")
M3_PER_M = 131.0  # of the cylinder


def _cylinder(*, with_roof=False, relative_u=3e-4):
    """Table of a cylinder with a scale error and an error of the bottom."""
    height = np.linspace(0.0, 12.0, 1201)
    volume = M3_PER_M * height
    factor = np.column_stack([volume * relative_u, np.full(len(height), 0.05)])
    roof = floating_roof(42_000.0, 1.0, 1.5, 850.0, "vacuum") if with_roof else None
    return TankTable(
        "TK-1", "vertical", height, volume, factor, np.full(len(height), np.inf), 1e-4, 20.0,
        1.116e-5, 0.0, roof, 12.6,
    )  # fmt: skip


def _gauging(level, water=np.nan, celsius=20.0, ambient=20.0):
    return Gauging(
        *(np.atleast_1d(np.asarray(part, float)) for part in (level, water, celsius, ambient, 0.0))
    )


def _product(density=842.0, share=0.0, count=1):
    correction = Petroleum(2004, "products", "20C")
    one = np.ones(count)
    return Product(correction, one * density, None, one, one * share, one * 1.116e-5)


def test_chain_to_its_last_printed_digit():
    """A transfer worked by another author from the equations alone."""
    table = _cylinder(with_roof=True)
    gauging = _gauging(1369.710 / M3_PER_M, 2.315 / M3_PER_M, 34.2, 27.0)
    steps = follow_chain(table, gauging, _product(share=0.0005))
    expected = {
        "tov_m3": (1369.710, 3), "fw_m3": (2.315, 3), "shell_c": (33.3, 1), "ctsh": (1.000297, 6),
        "vcf": (0.988000, 6), "observed_density": (831.8959, 4), "fra_m3": (-1.0753, 4),
        "gov_m3": (1366.7256, 4), "gsv_m3": (1350.3248, 4), "nsv_m3": (1349.6496, 4),
        "mass_kg": (1_136_405.0, 1), "weight_kg": (1_134_955.6, 1),
    }  # fmt: skip
    for name, (value, decimals) in expected.items():
        assert round(float(getattr(steps, name)[0]), decimals) == value, name


@pytest.fixture(scope="module")
def worked_transfer():
    """A delivery worked by another author, with three courses, a bottom and a scale."""
    height = np.array([0.0, 0.9, 1.8, 3.6, 6.0, 8.4])
    volume = np.array([0.0, 146.708, 293.425, 586.885, 978.261, 1369.710])
    courses = [2 * np.pi * 7.2 * 3e-4 * np.clip(height - low, 0, 2.8) for low in (0, 2.8, 5.6)]
    factor = np.column_stack([108e-6 * volume, np.full(6, 0.3), *courses])
    table = TankTable("t", "vertical", height, volume, factor, np.full(6, np.inf), 0.0, 20.0,
                      1.116e-5)  # fmt: skip
    product = Product(Petroleum(1980, "products", "15C"), np.array([845.0]), None, np.ones(1),
                      np.array([0.0005]), np.array([1.116e-5]))  # fmt: skip
    return _transfer(
        table, _gauging(8.4, 0.02, 27.4, 22.0), _gauging(1.8, 0.02, 24.1, 20.0), product,
        u_tape_ppm=50.0, u_water_dip_mm=2.0, u_temperature_k=0.2, u_thermometer_k=0.0,
        u_ambient_k=1.0, u_sw_percent=0.02, u_expansion_per_k=0.0, u_vcf_percent=0.0,
    )  # fmt: skip


def test_quantities_to_the_printed_digit(worked_transfer):
    expected = {
        "opening": (1.000150, 1366.6549, 0.989587, 1352.4234, 1351.7472, 1_142_226.4),
        "closing": (1.000080, 290.1881, 0.992364, 287.9722, 287.8282, 243_214.8),
    }
    for state, values in expected.items():
        steps, names = worked_transfer.steps[state], ("ctsh", "gov_m3", "vcf", "gsv_m3", "nsv_m3")
        found = [float(getattr(steps, name)[0]) for name in (*names, "mass_kg")]
        decimals = (6, 4, 6, 4, 4, 1)
        assert tuple(round(value, n) for value, n in zip(found, decimals, strict=True)) == values
    moved = -worked_transfer.quantities()["moved"].value[0]
    assert moved[1:4].round(4).tolist() == [1076.4669, 1064.4513, 1063.9190]
    assert round(float(moved[4]), 1) == 899_011.6


def test_budget_to_the_printed_digit(worked_transfer):
    """Contributions to the delivered NSV in m3, and U; the zero of the tape is common to both dips.

    The author differentiates the table at its last row, where half of the difference is missing
    (0.0807 for 0.1613), and has no zero of the tape at the closing dip. With these two slips our
    budget is that of the author to a unit of the last digit: U 1.0935, 0.7455 and 1.2386. Without
    them it is 1.1433, 0.7629 and 1.2710.
    """
    found = worked_transfer.quantities()
    moved = {name: float(values[0, NSV]) for name, values in found["moved"].contributions.items()}
    expected = {
        "water dip closing": 0.3234, "water dip opening": 0.3225, "temperature opening": 0.2248,
        "temperature closing": 0.0477, "sw": 0.2129, "dip closing": 0.1617, "table": 0.1273,
        "dip opening": 0.1613,
    }  # fmt: skip
    assert {name: round(abs(moved[name]), 4) for name in expected} == expected
    assert round(-found["moved"].contributions["density"][0, 4]) == 540  # kg, of the mass
    level = {"opening": 8.4, "closing": 1.8}
    # The correction has a relative u of 0.025 % at 22 K from its base, in proportion.
    by_correction = {"opening": 0.00025 * 12.4 / 22 * 1351.7472,
                     "closing": 0.00025 * 9.1 / 22 * 287.8282}  # fmt: skip
    slips = {"opening": (0.5, 1.0), "closing": (1.0, 0.0)}  # slope of the dip, zero of the tape
    for state, signs, by_author, right in (
        ("opening", {"opening": 1}, 1.0935, 1.1433),
        ("closing", {"closing": 1}, 0.7455, 0.7629),
        ("moved", {"opening": -1, "closing": 1}, 1.2386, 1.2710),
    ):
        parts = found[state].contributions
        others = [values[0, NSV] for name, values in parts.items()
                  if name != "tape" and not name.startswith("dip")]  # fmt: skip
        correction = sum(sign * by_correction[name] for name, sign in signs.items())
        for author, expected_U in ((True, by_author), (False, right)):
            dips, tape, zero = [], 0.0, 0.0
            for name, sign in signs.items():
                share, has_zero = slips[name] if author else (1.0, 1.0)
                slope = sign * share * found[name].contributions[f"dip {name}"][0, NSV]
                dips.append(slope)
                tape += 0.05 * level[name] * slope
                zero += 0.5 * has_zero * slope
            U = 2 * np.linalg.norm([*others, correction, *dips, tape, zero])
            assert pytest.approx(expected_U, abs=1e-4 if author else 5e-5) == U


def test_chain_against_a_plain_implementation():
    rng = np.random.default_rng(7)
    table = _cylinder(with_roof=True)
    for _ in range(20):
        level, water = rng.uniform(2, 11), rng.uniform(0.01, 0.5)
        celsius, ambient, density = rng.uniform(-5, 50), rng.uniform(-10, 40), rng.uniform(700, 950)
        steps = follow_chain(
            table, _gauging(level, water, celsius, ambient), _product(density, 0.002)
        )
        expected = plain_quantity.net_standard_volume(
            lambda at: M3_PER_M * at, level, water, celsius, ambient, density, 0.002,
            group="products", base_c=20.0, expansion=1.116e-5, table_c=20.0, roof=(42_000.0, 850.0),
        )  # fmt: skip
        assert steps.nsv_m3[0] == pytest.approx(expected, rel=1e-10)


def _transfer(table, opening, closing, product, **u):
    declared = UNCERTAINTIES | u
    gaugings = {"opening": opening, "closing": closing}
    taped = {state: gauging.level_m for state, gauging in gaugings.items()}
    return Transfer(table, gaugings, taped, product, declared)


def test_budget_adds_up():
    transfer = _transfer(
        _cylinder(), _gauging(2.0, 0.02, 28.0, 25.0), _gauging(9.0, 0.02, 31.0, 27.0),
        _product(share=0.001),
    )  # fmt: skip
    for result in transfer.quantities().values():
        total = sum(part**2 for part in result.contributions.values())
        np.testing.assert_allclose(np.sqrt(total), result.u, rtol=1e-12)
        np.testing.assert_allclose(result.U, result.k * result.u, rtol=1e-12)


def test_free_water_does_not_change_u_of_the_total_volume():
    dry, wet = (
        _transfer(
            _cylinder(), _gauging(2.0, water, 28.0, 25.0), _gauging(9.0, 2 * water, 31.0, 27.0),
            _product(),
        ).quantities()
        for water in (np.nan, 0.5)
    )  # fmt: skip
    tov, gov = (QUANTITIES.index(name) for name in ("tov_m3", "gov_m3"))
    for state, result in wet.items():
        assert result.u[0, tov] == pytest.approx(dry[state].u[0, tov], rel=1e-12)
    # The error of the bottom cancels in the volume without water; that of the scale remains.
    by_table = wet["opening"].contributions["table"][0, gov]
    assert by_table == pytest.approx(3e-4 * wet["opening"].value[0, gov], rel=1e-9)


def test_equal_dips_share_their_errors():
    """Nothing was moved: shared errors cancel, the errors of both dips do not."""
    same = _gauging(6.0, np.nan, 30.0, 25.0)
    result = _transfer(_cylinder(), same, same, _product()).quantities()["moved"]
    assert result.value[0, NSV] == 0
    for name in ("table", "tape", "thermometer", "density", "vcf", "expansion"):
        assert abs(result.contributions[name][0, NSV]) < 1e-12
    each = result.contributions["dip opening"][0, NSV]
    assert abs(each) == pytest.approx(M3_PER_M * 1e-3, rel=0.02)


def simulate_transfers(count, seed, *, is_density_shared=True):
    """Share of `count` simulated transfers whose true NSV moved lies within U.

    Truth is computed by the plain implementation, from true dips, temperatures, density and table.
    The error of the declared density is that of both gaugings, or an independent one in each.
    """
    rng = np.random.default_rng(seed)
    true_moved, densities, shares, readings = [], [], [], {"opening": [], "closing": []}
    for _ in range(count):
        truth = {
            "opening": (rng.uniform(1, 4), rng.uniform(15, 35), rng.uniform(10, 30)),
            "closing": (rng.uniform(7, 11), rng.uniform(15, 35), rng.uniform(10, 30)),
        }
        density, share = rng.uniform(790, 870), 0.005
        scale, bottom = 1 + 3e-4 * rng.standard_normal(), 0.05 * rng.standard_normal()
        tape, thermometer = 115e-6 * rng.standard_normal(), 0.15 * rng.standard_normal()
        density_error = 0.5 * rng.standard_normal()
        vcf_error, air_error = rng.standard_normal(), 3.0 * rng.standard_normal()
        expansion = 1.116e-5 + 1e-6 * rng.standard_normal()
        share_error = 1e-3 * rng.standard_normal()
        true_nsv = {}
        for state, (level, celsius, ambient) in truth.items():
            if not is_density_shared:
                density_error = 0.5 * rng.standard_normal()
            distance = celsius - 20.0
            u_vcf = np.sign(distance) * np.interp(abs(distance), [0, 22.2, 50], [0, 5e-4, 15e-4])
            true_nsv[state] = plain_quantity.net_standard_volume(
                lambda at, scale=scale, bottom=bottom: M3_PER_M * at * scale + bottom,
                level, None, celsius, ambient, density - density_error, share, group="products",
                base_c=20.0, expansion=expansion, table_c=20.0, vcf_error=vcf_error * u_vcf / 1.96,
            )  # fmt: skip
            level_read = level * (1 - tape) + 1e-3 * rng.standard_normal()
            celsius_read = celsius + 0.25 * rng.standard_normal() + thermometer
            readings[state].append((level_read, np.nan, celsius_read, ambient + air_error, 0.0))
        true_moved.append(true_nsv["closing"] - true_nsv["opening"])
        densities.append(density)
        shares.append(share + share_error)
    opening, closing = (Gauging(*np.array(readings[state]).T) for state in readings)
    product = _product(np.array(densities), np.array(shares), count)
    result = _transfer(_cylinder(), opening, closing, product).quantities()["moved"]
    return np.mean(np.abs(result.value[:, NSV] - true_moved) <= result.U[:, NSV])


@pytest.mark.slow
def test_intervals_of_transfers_hold():
    """A small part of the study: 300 transfers, of which fewer than 0.90 or more than 0.99 are
    held by chance in less than one of 1000 runs.
    """
    assert 0.90 <= simulate_transfers(300, 1) <= 0.99


@pytest.mark.study
@pytest.mark.parametrize("is_density_shared", [True, False], ids=["shared", "own density"])
def test_intervals_of_transfers_hold_study(figure, is_density_shared):
    count = 10_000
    share = simulate_transfers(count, 2, is_density_shared=is_density_shared)
    density = "shared density" if is_density_shared else "a density of its own in each gauging"
    figure(f"NSV of {count} transfers held, {density}", f"{share:.4f}")
    full, stated = figures_of(
        "docs/studies/ticket.md",
        "Of () simulated transfers, () of the true net standard volumes lie within U (0.95 "
        "expected, standard error 0.002)",
    )
    (own_stated,) = figures_of(
        "docs/studies/ticket.md", "has an independent error in each gauging, U also holds ():"
    )
    assert value_of(full) == count
    assert agree([share], [stated if is_density_shared else own_stated])
    assert 0.94 <= share <= 0.96


SETTINGS = """
[ticket]
number = "T-1"
[product]
correction = "D1250-04"
group = "products"
base = "20C"
density_kg_m3 = 842.0
density_is = "base"
sw_percent = 0.05
[opening]
dip_m = 2.0
water_dip_m = 0.015
temperature_c = 28.0
ambient_c = 24.0
[closing]
dip_m = 9.0
water_dip_m = 0.015
temperature_c = 31.0
ambient_c = 27.0
[compared]
quantity = "nsv_m3"
value = 905.0
U = 2.0
source = "FT-12"
"""


@pytest.fixture
def settings(tmp_path):
    """ticket.toml of a transfer, and a function that changes its text."""
    path = tmp_path / "ticket.toml"

    def write(*changes, text=SETTINGS):
        for before, after in changes:
            assert before in text
            text = text.replace(before, after, 1)
        path.write_text(text, encoding="utf-8")
        return path

    write()
    return write


def test_ullage_gives_the_quantities_of_the_dip(settings):
    by_dip = read_tickets(_cylinder(), settings()).transfer.quantities()["moved"]
    by_ullage = read_tickets(
        _cylinder(), settings(("dip_m = 9.0", "ullage_m = 3.6"))
    ).transfer.quantities()["moved"]
    np.testing.assert_allclose(by_ullage.value, by_dip.value, rtol=1e-12)
    # A longer tape raises a level by dip and lowers a level by ullage.
    tape = by_ullage.contributions["tape"][0, NSV], by_dip.contributions["tape"][0, NSV]
    assert tape[0] < 0 < tape[1]


@pytest.mark.parametrize(
    ("change", "place", "text"),
    [
        (("dip_m = 9.0", ""), "closing.dip_m", "missing"),
        (("dip_m = 9.0", "dip_m = 9.0\nullage_m = 3.6"), "closing.ullage_m", "only one"),
        (("dip_m = 9.0", "dip_m = 13.0"), "closing.dip_m", "0.0000 to 12.0000"),
        (
            ("water_dip_m = 0.015", "water_dip_m = 2.5"),
            "opening.water_dip_m",
            "below the liquid at 2.0000 m",
        ),
        (("temperature_c = 31.0", "temperature_c = 190.0"), "closing.temperature_c", "-50 to 150"),
        (("ambient_c = 27.0", ""), "closing.ambient_c", "not insulated"),
        (("842.0", "0.842"), "product.density_kg_m3", "kg/m³"),
        (("842.0", "560.0"), "product.density_kg_m3", "range of ASTM D1250-04"),
        (('base = "20C"', ""), "product.base", "missing"),
        (('density_is = "base"', 'density_is = "observed"'), "density_temperature_c", "missing"),
        (("sw_percent", 'hydrometer = "glass 20C"\nsw_percent'), "product.hydrometer", "base"),
        (("[closing]", "[closng]"), "[closng]", "closing"),
        (("D1250-04", "D1250"), "product.correction", "D1250-80"),
        # A gauging without its temperature was left out: the whole stock became the transfer.
        (("temperature_c = 28.0", ""), "opening.temperature_c", "missing"),
        (
            ("dip_m = 2.0\nwater_dip_m = 0.015\ntemperature_c = 28.0", ""),
            "opening.dip_m",
            "missing",
        ),
        # Keys without effect.
        (("sw_percent", "alpha_per_k = 0.001\nsw_percent"), "product.alpha_per_k", "not used"),
        (
            ('"D1250-04"\ngroup = "products"\nbase = "20C"', '"OIML-R22"\nbase = "15C"'),
            "product.base",
            "20 degC",
        ),
        (("sw_percent", "weights_kg_m3 = 1.2\nsw_percent"), "product.weights_kg_m3", "1000"),
        (('quantity = "nsv_m3"', ""), "compared.quantity", "missing"),
        (("value = 905.0", ""), "compared.value", "missing"),
    ],
)
def test_bad_tickets_are_refused_in_one_line(settings, change, place, text):
    with pytest.raises(InputError) as refused:
        read_tickets(_cylinder(), settings(change))
    lines = [str(line) for line in refused.value.texts]
    assert any(place in line and text in line for line in lines), lines
    assert all("ticket.toml" in line for line in lines)


def test_dip_in_the_critical_zone_is_refused(settings):
    with pytest.raises(InputError, match=r"does not float below 1\.5000 m"):
        read_tickets(_cylinder(with_roof=True), settings(("dip_m = 2.0", "dip_m = 1.4")))


def _write_correction(write, correction, density, celsius, more=""):
    observed = f'"observed"\ndensity_temperature_c = {celsius}\n{more}'
    return write(
        ('"D1250-04"\ngroup = "products"\nbase = "20C"', f'"{correction}"'),
        ("842.0", f"{density}"),
        ('"base"', observed),
    )


@pytest.mark.parametrize(
    ("correction", "density", "celsius", "text"),
    [
        ("GPA-TP27", 301.0, 200.0, "gives no density"),
        ("GPA-TP27", 301.0, 20.0, "at the base temperature: found 317.29"),
        ("CNP-6-70", 700.0, 25.0, "number of decimals"),
        ("OIML-R22", 700.0, 25.0, "density_kg_m3: found 700; expected 78"),
    ],
)
def test_density_outside_the_correction_is_one_line(settings, correction, density, celsius, text):
    path = _write_correction(settings, correction, density, celsius)
    with pytest.raises(InputError) as refused:
        read_tickets(_cylinder(), path)
    (line,) = refused.value.texts
    assert "ticket.toml, row" in line
    assert text in line


def test_each_density_outside_the_range_is_named_with_its_value(settings, tmp_path):
    rows = tmp_path / "tickets.csv"
    rows.write_text("ticket,density_kg_m3\nA,550\nB,842\nC,560\n", encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read_tickets(_cylinder(), settings(), rows)
    first, second = refused.value.texts
    assert "row 2" in first
    assert "found 550" in first
    assert "row 4" in second
    assert "found 560" in second


@pytest.mark.slow
def test_glass_of_the_brazilian_table_is_corrected_once(settings):
    """The table is entered with the reading; a vibrating tube gives the corrected reading."""
    reading, celsius = 835.2, 27.5
    true = reading * glass_correction(celsius, "20C")
    by_glass, by_tube = (
        read_tickets(
            _cylinder(), _write_correction(settings, "CNP-6-70-unrounded", density, celsius, more)
        ).transfer.steps["closing"].base_density[0]
        for density, more in ((reading, 'hydrometer = "glass 20C"'), (true, ""))
    )  # fmt: skip
    assert by_glass == pytest.approx(by_tube, rel=1e-12)
    # From the equations of the table alone.
    assert by_glass == pytest.approx(840.1905, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "text"),
    [
        (("temperature_c = 31.0", "temperature_c = 88.0"), "Fahrenheit"),
        (("sw_percent = 0.05", "sw_percent = 0.0005"), "fraction"),
    ],
)
def test_slips_are_warned_of(settings, change, text):
    warnings = read_tickets(_cylinder(), settings(change)).warnings
    assert any(text in str(warning.text) for warning in warnings)


def test_water_below_a_table_that_begins_with_a_volume_is_warned_of(settings):
    full = _cylinder()
    table = replace(full, **{name: getattr(full, name)[50:] for name in (
        "height_m", "volume_m3", "factor_m3", "dof")})  # fmt: skip
    tickets = read_tickets(table, settings())
    assert [str(w.text).count("first row of the table") for w in tickets.warnings] == [1, 1]
    assert tickets.transfer.steps["closing"].fw_m3[0] == 0


def test_water_at_the_roof_is_refused(settings):
    path = settings(("water_dip_m = 0.015", "water_dip_m = 1.2"))
    with pytest.raises(InputError, match=r"subtracts the roof from 1\.0000 m"):
        read_tickets(_cylinder(with_roof=True), path)


@pytest.mark.slow
def test_roof_of_a_record_corrects_the_volume(tmp_path, example_record):
    """The displacement by Archimedes, in a table with the roof and in a table without it."""
    record = json.loads(example_record.read_text(encoding="utf-8"))
    values = {
        "roof_mass": 42_000.0, "roof_weighing": "vacuum", "roof_reference_density": 850.0,
        "roof_displacement": 42_000 / 850, "roof_critical_bottom": 1.0, "roof_critical_top": 1.5,
    }  # fmt: skip
    record["roof"] = [{"code": code, "value": v, "unit": None} for code, v in values.items()]
    path = tmp_path / "record.json"
    for choice, expected in (("vacuum", 42_000 / 850), ("off", 0.0)):
        others = [other for other in record["choices"] if other["code"] != "roof"]
        record["choices"] = [*others, {"code": "roof", "value": choice}]
        path.write_text(json.dumps(record), encoding="utf-8")
        table = read_table(path)
        assert table.is_critical(np.array([1.4, 1.6])).tolist() == [True, False]
        correction = table.roof_correction_m3(np.array([740.0]))[0]
        assert correction == pytest.approx(expected - 42_000 / 740, rel=1e-12)


def test_comparison_of_a_row_may_be_missing(settings, tmp_path):
    """A blank cell has the value of the file; without it the difference does not exist."""
    rows = tmp_path / "tickets.csv"
    rows.write_text("ticket,compared_value\nA,\nB,800\n", encoding="utf-8")
    for change, is_missing in (
        (("value = 905.0", "value = 905.0"), False),
        (("value = 905.0", ""), True),
    ):
        tickets = read_tickets(_cylinder(), settings(change), rows)
        first, second = rows_of(tickets)
        assert (first["difference_nsv_m3"] is None) == is_missing
        assert second["difference_nsv_m3"] is not None
        assert json.dumps([first, second], allow_nan=False)


@pytest.mark.slow
def test_columns_of_an_opening_make_a_transfer(settings, tmp_path):
    """An opening without its temperature was left out."""
    begin, end = SETTINGS.index("[opening]"), SETTINGS.index("[closing]")
    stock = settings(text=SETTINGS[:begin] + SETTINGS[end:])
    rows = tmp_path / "tickets.csv"
    rows.write_text("ticket;opening_dip_m\nA;2,0\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"opening\.temperature_c: missing"):
        read_tickets(_cylinder(), stock, rows)
    rows.write_text("ticket;opening_dip_m\nA;\n", encoding="utf-8")
    assert list(read_tickets(_cylinder(), stock, rows).transfer.gaugings) == ["closing"]


def test_tickets_have_different_names(settings, tmp_path):
    rows = tmp_path / "tickets.csv"
    rows.write_text("ticket;closing_dip_m\nA;8,5\nA;9,0\n", encoding="utf-8")
    with pytest.raises(InputError, match="row 3, ticket"):
        read_tickets(_cylinder(), settings(), rows)


@pytest.mark.slow
def test_decimal_mark_can_be_declared(settings, tmp_path):
    rows = tmp_path / "tickets.csv"
    rows.write_text("ticket;density_kg_m3\nA;1,025\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"\[csv\] decimal"):  # 1.025 or 1025
        read_tickets(_cylinder(), settings(), rows)
    rows.write_text("ticket;closing_dip_m\nA;8,123\n", encoding="utf-8")
    assert read_tickets(_cylinder(), settings(), rows).names == ("A",)  # no dip is 8123 m
    path = settings(("[closing]", "[csv]\nseparator = ';'\ndecimal = ','\n[closing]"))
    tickets = read_tickets(_cylinder(), path, rows)
    assert tickets.transfer.gaugings["closing"].level_m.tolist() == [8.123]


def test_uncertainty_of_the_correction_grows_without_end():
    """At 150 degC the rule is extended by its last slope, 0.1 % in 27.8 K."""
    hot = _transfer(_cylinder(), _gauging(2.0, np.nan, 150.0), _gauging(9.0, np.nan, 150.0),
                    _product(960.0))  # fmt: skip
    share = hot._vcf_scale(np.array([150.0]))[0]
    assert share == pytest.approx((0.35 + 0.1 * (130 - 105.6) / 27.8) / 100 / 1.96, rel=1e-12)


def test_rows_replace_keys(settings, tmp_path):
    rows = tmp_path / "tickets.csv"
    rows.write_text("ticket;closing_dip_m;density_kg_m3\nA;9,0;842\nB;8,5;830\n", encoding="utf-8")
    tickets = read_tickets(_cylinder(), settings(), rows)
    result = tickets.transfer.quantities()["moved"]
    single = read_tickets(_cylinder(), settings()).transfer.quantities()["moved"]
    assert tickets.names == ("A", "B")
    np.testing.assert_allclose(result.value[0], single.value[0], rtol=1e-13)
    assert result.value[1, NSV] < result.value[0, NSV]


def test_bad_rows_are_named_by_row_and_column(settings, tmp_path):
    rows = tmp_path / "tickets.csv"
    rows.write_text(
        "ticket,closing_dip_m,closing_temperature_c\nA,9.0,30\nB,19.0,30\nC,9.0,900\n",
        encoding="utf-8",
    )
    with pytest.raises(InputError) as refused:
        read_tickets(_cylinder(), settings(), rows)
    dip, temperature = map(str, refused.value.texts)
    assert dip.startswith("tickets.csv, row 3, closing_dip_m: the dip is 19.0000 m")
    assert temperature.startswith("tickets.csv, row 4, closing_temperature_c")


def test_all_problems_are_reported_in_a_single_run(settings, tmp_path):
    """Invalid cells, dips outside the table, and values outside the correction, a line each."""
    rows = tmp_path / "tickets.csv"
    rows.write_text(
        "ticket,closing_dip_m,closing_temperature_c,density_kg_m3,closing_water_dip_m\n"
        "A,9.0,30,842,\n"  # correct
        "B,nine,30,842,\n"
        "C,19.0,30,842,\n"
        "D,9.0,155,842,\n"  # above 150 degC
        "E,9.0,30,400,\n"  # below 610.6 kg/m3
        "F,9.0,155,1500,\n"  # both
        "G,9.0,30,0.842,\n"
        "H,9.0,hot,842,9.5\n"
        "I,9.0,30,842,9.0\n",
        encoding="utf-8",
    )
    with pytest.raises(InputError) as refused:
        read_tickets(_cylinder(), settings(("dip_m = 2.0", "dip_m = 22.0")), rows)
    found = [(problem.file, problem.row, problem.column) for problem in refused.value.problems]
    assert sorted(place for place in found if place[0] == "tickets.csv") == [
        ("tickets.csv", 3, "closing_dip_m"),
        ("tickets.csv", 4, "closing_dip_m"),
        ("tickets.csv", 5, "closing_temperature_c"),
        ("tickets.csv", 6, "density_kg_m3"),
        ("tickets.csv", 7, "closing_temperature_c"),
        ("tickets.csv", 7, "density_kg_m3"),
        ("tickets.csv", 8, "density_kg_m3"),
        ("tickets.csv", 9, "closing_temperature_c"),
        ("tickets.csv", 9, "closing_water_dip_m"),
        ("tickets.csv", 10, "closing_water_dip_m"),
    ]
    assert [column for file, _, column in found if file == "ticket.toml"] == ["opening.dip_m"]


def test_an_unknown_column_is_reported_alone(settings, tmp_path):
    """Its values would seem to be missing in every row."""
    rows = tmp_path / "tickets.csv"
    rows.write_text("ticket,closing_gauge\nA,9.0\nB,8.0\n", encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read_tickets(_cylinder(), settings(("dip_m = 9.0\n", "")), rows)
    assert [problem.column for problem in refused.value.problems] == ["closing_gauge"]


@pytest.mark.slow
def test_command_prints_the_quantities(settings, example_record, tmp_path, capsys):
    path = settings(("dip_m = 9.0", "dip_m = 8.5"))
    out = tmp_path / "out.csv"
    assert main(["ticket", str(example_record), str(path), "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "net standard volume" in text
    assert "Eₙ" in text
    with out.open(encoding="utf-8") as stream:
        (row,) = csv.DictReader(stream)
    assert main(["ticket", str(example_record), str(path), "--json"]) == 0
    (ticket,) = json.loads(capsys.readouterr().out)["tickets"]
    assert float(row["moved_nsv_m3"]) == pytest.approx(ticket["moved_nsv_m3"], rel=1e-12)
    table = read_table(example_record)
    direct = read_tickets(table, path).transfer.quantities()["moved"]
    assert ticket["moved_U_nsv_m3"] == pytest.approx(direct.U[0, NSV], rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("language", ["pt-BR", "es"])
def test_command_speaks_the_language(settings, example_record, language, capsys):
    path = settings(("dip_m = 9.0", "dip_m = 8.5"))
    assert main(["ticket", str(example_record), str(path), "--language", language]) == 0
    text = capsys.readouterr().out
    assert "net standard volume" not in text
    assert "{" not in text


@pytest.mark.slow
def test_output_replaces_only_a_file_of_the_command(settings, example_record, tmp_path, capsys):
    path = settings(("dip_m = 9.0", "dip_m = 8.5"), ('"T-1"', '"=T-1"'))
    out = tmp_path / "out.csv"
    arguments = ["ticket", str(example_record), str(path), "--out", str(out)]
    for _ in range(2):  # a file of the command is replaced
        assert main(arguments) == 0
    assert out.read_text(encoding="utf-8").splitlines()[1].startswith("'=T-1,")
    rows = "ticket;closing_dip_m\nA;8,5\n"
    out.write_text(rows, encoding="utf-8")
    assert main([*arguments, "--tickets", str(out)]) == 2
    assert out.read_text(encoding="utf-8") == rows
    assert "did not write" in capsys.readouterr().err
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(IsADirectoryError):
        check_output(tmp_path / "folder.csv")
    other = tmp_path / "record.json"
    other.write_text("{}", encoding="utf-8")
    assert main([*arguments[:-1], str(other)]) == 2
    assert other.read_text(encoding="utf-8") == "{}"


@pytest.mark.slow
def test_failed_output_leaves_the_former_file(settings, example_record, tmp_path, monkeypatch):
    path = settings(("dip_m = 9.0", "dip_m = 8.5"))
    out = tmp_path / "out.csv"
    arguments = ["ticket", str(example_record), str(path), "--out", str(out)]
    assert main(arguments) == 0
    before = out.read_bytes()

    def fail(stream, rows):
        stream.write("ticket")
        raise OSError(28, "No space left on device", "temporary")

    monkeypatch.setattr("tankcal.products.quantity.results.write_guarded", fail)
    assert main(arguments) == 2
    assert out.read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir() if p.suffix != ".toml") == ["out.csv"]


@pytest.mark.slow
@pytest.mark.parametrize("language", ["pt-BR", "es"])
@pytest.mark.parametrize("correction", ["CNP-6-70", "OIML-R22", "GPA-TP27"])
def test_correction_is_named_in_the_language(
    settings, example_record, language, correction, capsys
):
    density = {"GPA-TP27": 540.0}.get(correction, 842.0)
    path = settings(
        ("dip_m = 9.0", "dip_m = 8.5"),
        ('"D1250-04"\ngroup = "products"\nbase = "20C"', f'"{correction}"'),
        ("842.0", f"{density}"),
    )
    assert main(["ticket", str(example_record), str(path), "--language", language]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert "T-1" in first
    assert not any(word in first for word in ("rounded", "ethanol", "liquefied", "base 20 degC"))


@pytest.mark.parametrize("language", ["pt-BR", "es"])
def test_missing_keys_are_explained_in_the_language(settings, example_record, language, capsys):
    path = settings(('density_is = "base"', ""), ('correction = "D1250-04"', ""))
    assert main(["ticket", str(example_record), str(path), "--language", language]) == 2
    text = capsys.readouterr().err
    assert "volume correction" not in text
    assert "temperature;" not in text


def test_tickets_of_rows_are_listed(settings, example_record, tmp_path, capsys):
    rows = tmp_path / "tickets.csv"
    lines = "".join(f"T{number};{5 + number / 100}\n" for number in range(23))
    rows.write_text(f"ticket;closing_dip_m\n{lines}", encoding="utf-8")
    arguments = ["ticket", str(example_record), str(settings()), "--tickets", str(rows)]
    assert main([*arguments, "--language", "en"]) == 0
    count, first, *_, more, last = capsys.readouterr().out.splitlines()
    assert count == "23 tickets computed"
    assert first.startswith("  T0: closing less opening, net standard volume")
    assert "3 more" in more
    assert last.startswith("23 of 23 tickets do not agree")  # with the value of the TOML file


LEVELS = {"full_m": None, "maximum_m": 11.0, "minimum_m": 1.2, "pump_suction_m": 0.4}


def test_rooms_have_the_u_of_the_closed_form(settings):
    """A cylinder: the error of the bottom cancels, that of the scale acts on the difference."""
    table = replace(_cylinder(), levels=LEVELS)
    transfer = read_tickets(table, settings()).transfer
    rooms, closing = transfer.rooms(), transfer.gaugings["closing"]
    u, steps, a = transfer.u, transfer.steps["closing"], 1.116e-5
    warming = float(steps.shell_c[0]) - 20.0
    ctsh, by_shell = 1 + 2 * a * warming + (a * warming) ** 2, 2 * a * (1 + a * warming)
    level = float(closing.level_m[0])
    for place, (name, dip, sign) in enumerate(
        (("room", 11.0, 1), ("above_minimum", 1.2, -1), ("pumpable", 0.4, -1))
    ):
        volume = sign * M3_PER_M * (dip - level)
        parts = [
            M3_PER_M * ctsh * u["u_dip_mm"] / 1000,
            M3_PER_M * ctsh * level * u["u_tape_ppm"] / 1e6,
            volume * ctsh * 3e-4,
            ctsh * 1e-4 * np.sqrt(2 / 3),
            volume * by_shell * 7 / 8 * u["u_temperature_k"],
            volume * by_shell * 7 / 8 * u["u_thermometer_k"],
            volume * by_shell / 8 * u["u_ambient_k"],
            volume * 2 * warming * (1 + a * warming) * u["u_expansion_per_k"],
        ]
        assert list(transfer.room_levels)[place] == name
        assert rooms.value[0, place] == pytest.approx(volume * ctsh, rel=1e-12)
        assert rooms.u[0, place] == pytest.approx(np.sqrt(np.sum(np.square(parts))), rel=1e-9)


def test_rooms_of_a_tank_with_a_floating_roof(settings):
    """The roof cancels where it floats at both dips; no level in its critical zone has a room."""
    table = replace(_cylinder(with_roof=True), levels=LEVELS)
    transfer = read_tickets(table, settings()).transfer
    steps, rooms = transfer.steps["closing"], transfer.rooms()
    assert list(transfer.room_levels) == ["room", "pumpable"]  # 1.2 m is in the critical zone
    level = float(transfer.gaugings["closing"].level_m[0])
    room, pumpable = rooms.value[0]
    ctsh = float(steps.ctsh[0])
    assert room == pytest.approx(M3_PER_M * (11.0 - level) * ctsh, rel=1e-12)
    expected = M3_PER_M * (level - 0.4) * ctsh + float(steps.fra_m3[0])
    assert pumpable == pytest.approx(expected, rel=1e-12)
    density = np.abs(rooms.contributions["density"][0])
    assert density[0] < 1e-12 < density[1]


@pytest.mark.slow
def test_rooms_are_columns_only_with_levels(settings):
    without, with_levels = _cylinder(), replace(_cylinder(), levels=LEVELS | {"minimum_m": None})
    assert "closing_room_m3" not in rows_of(read_tickets(without, settings()))[0]
    (row,) = rows_of(read_tickets(with_levels, settings()))
    names = [name for name in row if "room" in name or "pumpable" in name]
    assert names == [f"closing_{part}_m3" for part in ("room", "U_room", "pumpable", "U_pumpable")]
    assert row["closing_U_room_m3"] > 0
