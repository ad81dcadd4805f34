"""Inputs of tickets: a table of factors of one's own, the empty form, slips, Python."""

import numpy as np
import pytest

import tankcal
from tankcal import record as records
from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.products.quantity.chain import QUANTITIES
from tankcal.products.quantity.reading import SECTIONS, read_tickets
from tankcal.products.quantity.starter import FORM, starter_text, write_starter
from tankcal.products.quantity.table import TankTable
from tankcal.tank.volume_correction.corrections import FactorTable
from tankcal.tank.volume_correction.petroleum import Petroleum
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

M3_PER_M = 131.0
CRUDE = Petroleum(1980, "crude", "15C")


def _cylinder(reference_height_m=12.6):
    height = np.linspace(0.0, 12.0, 1201)
    factor = np.column_stack([M3_PER_M * height * 3e-4, np.full(len(height), 0.05)])
    return TankTable(
        "TK-1", "vertical", height, M3_PER_M * height, factor, np.full(len(height), np.inf), 1e-4,
        20.0, 1.116e-5, 0.0, None, reference_height_m,
    )  # fmt: skip


def _inputs(**changes):
    """Content of a ticket.toml; changes of a section by its name."""
    inputs = {
        "product": {"correction": "D1250-04", "group": "products", "base": "20C",
                    "density_kg_m3": 842.0, "density_is": "base", "sw_percent": 0.05},
        "opening": {"dip_m": 2.0, "temperature_c": 28.0, "ambient_c": 24.0},
        "closing": {"dip_m": 9.0, "temperature_c": 31.0, "ambient_c": 27.0},
    }  # fmt: skip
    for section, values in changes.items():
        inputs[section] = inputs.get(section, {}) | values
    return inputs


# ---- a table of factors


def _write_factors(path, factor, densities, celsius, separator=",", decimal="."):
    rows = [["temperature_c", *(f"{value:g}" for value in densities)]]
    for t in celsius:
        cells = (f"{t:g}", *(f"{float(factor(d, t)):.6f}" for d in densities))
        rows.append([cell.replace(".", decimal) for cell in cells])
    path.write_text("".join(separator.join(row) + "\n" for row in rows), encoding="utf-8")


OWN = {"correction": "table", "factor_table": "own.csv", "base": "15C", "group": None}


def _own(tmp_path, monkeypatch, **changes):
    monkeypatch.chdir(tmp_path)
    product = {"density_kg_m3": 853.0} | OWN | changes
    inputs = _inputs(product=product, uncertainty={"u_vcf_percent": 0.02})
    inputs["product"] = {k: v for k, v in inputs["product"].items() if v is not None}
    return inputs


@pytest.mark.parametrize("marks", [(",", "."), (";", ",")])
def test_own_table_reproduces_the_correction_it_was_made_of(tmp_path, monkeypatch, marks):
    """Factors of D1250-80 A each 5 kg/m3 and 2 K: linear interpolation errs by less than 2e-6."""
    _write_factors(tmp_path / "own.csv", CRUDE.factor, np.arange(800, 905, 5.0),
                   np.arange(5, 51, 2.0), *marks)  # fmt: skip
    own = read_tickets(_cylinder(), _own(tmp_path, monkeypatch))
    made_of = read_tickets(
        _cylinder(),
        _inputs(
            product={
                "correction": "D1250-80",
                "group": "crude",
                "base": "15C",
                "density_kg_m3": 853.0,
            }
        ),
    )
    for state in ("opening", "closing"):
        steps, expected = own.transfer.steps[state], made_of.transfer.steps[state]
        np.testing.assert_allclose(steps.vcf, expected.vcf, rtol=2e-6)
    # The derivatives by temperature pass through the interpolation.
    place = QUANTITIES.index("nsv_m3")
    for name in ("temperature closing", "thermometer"):
        slopes = (tickets.quantities["closing"].contributions[name][0, place]
                  for tickets in (own, made_of))  # fmt: skip
        assert next(slopes) == pytest.approx(next(slopes), rel=0.01)
    # 0.02 % of the volume, which is common to both gaugings.
    part = own.quantities["moved"].contributions["vcf"][0, place]
    assert part == pytest.approx(2e-4 * own.quantities["moved"].value[0, place], rel=1e-9)


def test_own_table_finds_the_base_density_of_a_sample():
    """rho_b VCF(rho_b, t) gives the density of the sample again, also in the derivative."""
    densities, celsius = np.arange(800.0, 905.0, 5.0), np.arange(5.0, 51.0, 2.5)
    factors = CRUDE.factor(densities[None, :], celsius[:, None])
    table = FactorTable("own.csv", densities, celsius, factors, "15C")
    base = table.base_density(np.array([841.0]), np.array([33.3]))
    assert float((base * table.factor(base, np.array([33.3])))[0]) == pytest.approx(
        841.0, rel=1e-12
    )
    step = 1e-30j
    slope = np.imag(table.base_density(np.array([841.0]) + step, np.array([33.3])) / 1e-30)[0]
    apart = [table.base_density(np.array([841.0 + d]), np.array([33.3]))[0] for d in (-1e-3, 1e-3)]
    assert slope == pytest.approx((apart[1] - apart[0]) / 2e-3, rel=1e-6)


@pytest.mark.parametrize(
    ("text", "place", "said"),
    [
        ("t,800,820\n15,1,1\n20,.99,.99\n", "row 1", "first heading"),
        ("temperature_c,800\n15,1\n20,.99\n", "row 1", "two or more densities"),
        ("temperature_c,0.80,0.82\n15,1,1\n20,.99,.99\n", "row 1", "kg/m3"),
        ("temperature_c,820,800\n15,1,1\n20,.99,.99\n", "row 1", "column before"),
        ("temperature_c,800,820\n15,1,1\n", "own.csv", "two or more temperatures"),
        ("temperature_c,800,820\n15,1,1\n15,.99,.99\n", "row 3", "row before"),
        ("temperature_c,800,820\n15,1,1\n20,.99,1.01\n", "row 3", "falls as the temperature"),
        ("temperature_c,800,820\n15,1,\n20,.99,.99\n", "row 2", "820"),
        ("temperature_c,800,820\n15,1,x\n20,.99,.99\n", "row 2", "820"),
        ("temperature_c,800,820\n10,1.01,1.01\n15,.99,.99\n20,.98,.98\n", "800", "base = 15C"),
        ("temperature_c,800,860\n10,1.01,1.01\n15,1,1\n20,.99,.99\n", "temperature_c", "10 to 20"),
        ("temperature_c,800,820\n5,1.01,1.01\n15,1,1\n45,.97,.97\n", "density_kg_m3", "800 to 820"),
    ],
)
def test_bad_factors_are_refused(tmp_path, monkeypatch, text, place, said):
    inputs = _own(tmp_path, monkeypatch)
    (tmp_path / "own.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read_tickets(_cylinder(), inputs)
    lines = [str(line) for line in refused.value.texts]
    assert any(place in line and said in line for line in lines), lines


def test_factors_against_the_density_are_a_warning(tmp_path, monkeypatch):
    inputs = _own(tmp_path, monkeypatch)
    (tmp_path / "own.csv").write_text(
        "temperature_c,800,900\n5,1.01,1.01\n15,1,1\n45,.97,.969\n", encoding="utf-8"
    )
    (warning,) = read_tickets(_cylinder(), inputs).warnings
    assert warning.expected.code == "factor_table_density_order"


def test_own_table_needs_its_uncertainty_and_its_file(tmp_path, monkeypatch):
    inputs = _own(tmp_path, monkeypatch)
    with pytest.raises(InputError, match=r"own\.csv"):
        read_tickets(_cylinder(), inputs)
    _write_factors(tmp_path / "own.csv", CRUDE.factor, [800.0, 900.0], [5.0, 15.0, 45.0])
    with pytest.raises(InputError, match="u_vcf_percent"):
        read_tickets(_cylinder(), inputs | {"uncertainty": {}})
    assert read_tickets(_cylinder(), inputs).files.keys() == {"own.csv"}


# ---- the empty form


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_empty_form_explains_every_key(language):
    text = starter_text(_cylinder(), language, "t.toml")
    notes = load_words(language)["ticket"]["notes"]
    for section in FORM:
        assert f"\n[{section}]\n" in text
        of_section = notes["gauging" if section in ("opening", "closing") else section]
        assert of_section.keys() == {field.name for field in SECTIONS[section]}
    assert "{" not in text
    assert "ullage" not in starter_text(_cylinder(None), language, "t.toml")


def test_the_empty_form_asks_for_what_is_missing(tmp_path):
    """Every key that must be filled in is named, and a form with these keys is a ticket."""
    path = tmp_path / "t.toml"
    write_starter(path, _cylinder(), "en")
    with pytest.raises(InputError) as refused:
        read_tickets(_cylinder(), path)
    assert {problem.column for problem in refused.value.problems} == {
        "product.correction", "product.density_is", "product.density_kg_m3",
        "closing.dip_m"}  # fmt: skip
    text = path.read_text(encoding="utf-8")
    values = {"number": '"7"', "date": "2026-05-03", "density_kg_m3": "842.0"} | {
        key: f'"{value}"' for key, value in
        {"correction": "D1250-04", "group": "products", "base": "20C", "density_is": "base"}.items()
    }  # fmt: skip
    for key, value in values.items():
        text = text.replace(f'\n{key} = ""', f"\n{key} = {value}", 1)
    head, closing = text.split("[closing]")
    for key, value in {"dip_m": 9.0, "temperature_c": 31.0, "ambient_c": 27.0}.items():
        closing = closing.replace(f'\n{key} = ""', f"\n{key} = {value}", 1)
    path.write_text(f"{head}[closing]{closing}", encoding="utf-8")
    tickets = read_tickets(_cylinder(), path)
    assert tickets.result_state == "closing"  # a stock: the opening is blank
    same = _inputs(product={"sw_percent": 0.0})
    del same["opening"]
    expected = read_tickets(_cylinder(), same)
    np.testing.assert_allclose(
        tickets.quantities["closing"].value, expected.quantities["closing"].value, rtol=1e-14
    )


@pytest.mark.slow
def test_an_existing_form_is_left_alone(example_record, tmp_path, capsys):
    path = tmp_path / "t.toml"
    command = ["ticket", str(example_record), str(path), "--new", "--language", "es"]
    assert main(command) == 0
    before = path.read_bytes()
    assert "COMPLETE" in before.decode("utf-8")
    assert main(command) == 2
    assert path.read_bytes() == before
    assert main(["ticket", str(example_record), str(tmp_path / "t.csv"), "--new"]) == 2
    assert not (tmp_path / "t.csv").exists()
    capsys.readouterr()


# ---- slips


def _compared(inputs, U=2.0):
    """Inputs compared with their own true quantity, as a meter reads it."""
    truth = read_tickets(_cylinder(), inputs).quantities["moved"]
    value = abs(float(truth.value[0, QUANTITIES.index("nsv_m3")]))
    return inputs | {"compared": {"quantity": "nsv_m3", "value": value, "U": U}}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("slip", "key"),
    [
        ({"closing": {"dip_m": 12.6 - 9.0}}, "closing.dip_m"),
        ({"opening": {"dip_m": 12.6 - 2.0}}, "opening.dip_m"),
        ({"closing": {"temperature_c": 87.8}, "opening": {"temperature_c": 82.4}},
         "closing.temperature_c"),
        ({"product": {"sw_percent": 0.006}}, "product.sw_percent"),
    ],
)  # fmt: skip
def test_a_slip_that_explains_a_contradiction_is_named(slip, key):
    inputs = _compared(_inputs(product={"sw_percent": 0.6}))
    assert read_tickets(_cylinder(), inputs).warnings == ()
    wrong = {section: inputs[section] | slip.get(section, {}) for section in inputs}
    slips = [
        warning.column
        for warning in read_tickets(_cylinder(), wrong).warnings
        if "would explain" in str(warning.text)
    ]
    assert key in slips


@pytest.mark.slow
def test_another_base_of_the_volume_is_named_alone():
    """Exchanged dips would give the same volume in the other direction, which explains nothing."""
    inputs = _compared(_inputs())
    wrong = inputs | {"product": inputs["product"] | {"base": "15C"}}
    slips = [warning.column for warning in read_tickets(_cylinder(), wrong).warnings]
    assert slips == ["product.base"]


@pytest.mark.slow
def test_a_difference_that_no_slip_explains_is_left(tmp_path):
    inputs = _compared(_inputs())
    inputs["compared"]["value"] += 50.0
    assert read_tickets(_cylinder(), inputs).warnings == ()


def test_a_copied_dip_is_warned_of():
    dip = _inputs()["opening"]["dip_m"]
    (warning,) = read_tickets(_cylinder(), _inputs(closing={"dip_m": dip})).warnings
    assert warning.column == "closing.dip_m"
    assert "was it copied" in str(warning.text)


def test_a_moved_reference_height_is_told():
    within = _inputs(closing={"reference_height_m": 12.603})
    assert read_tickets(_cylinder(), within).warnings == ()
    moved = _inputs(closing={"reference_height_m": 12.594})
    (warning,) = read_tickets(_cylinder(), moved).warnings
    assert (warning.expected.code, warning.column) == (
        "ticket_reference_moved", "closing.reference_height_m")  # fmt: skip
    assert "-6.0 mm" in str(warning.expected)
    (unknown,) = read_tickets(_cylinder(None), moved).warnings
    assert unknown.expected.code == "ticket_no_reference_in_table"


def test_hot_air_is_told():
    (warning,) = read_tickets(_cylinder(), _inputs(closing={"ambient_c": 68.0})).warnings
    assert warning.expected.code == "ticket_hot_air"


# ---- Python


@pytest.mark.slow
def test_result_and_record_give_the_same_ticket(example_result, example_record):
    inputs = _inputs(closing={"dip_m": 8.5})
    by_result = example_result.ticket(inputs)
    sources = (example_record, records.load(example_record), records.read(example_record))
    for source in sources:
        ticket = tankcal.ticket(source, inputs)
        np.testing.assert_allclose(
            ticket.quantities["moved"].U, by_result.quantities["moved"].U, rtol=1e-12
        )
        assert str(ticket) == str(by_result)
    assert tankcal.ticket(sources[1], inputs).transfer.table.digest == (
        tankcal.ticket(example_record, inputs).transfer.table.digest)  # fmt: skip


@pytest.mark.slow
def test_frame_and_budgets_of_python(example_result):
    ticket = example_result.ticket(_inputs(closing={"dip_m": 8.5}))
    frame = ticket.frame()
    assert set(frame.columns) == {"value", "u", "dof", "k", "U"}
    for quantity in QUANTITIES:
        for state in ("opening", "closing", "moved"):
            budget = ticket.budget(quantity, state)
            row = frame.loc[(ticket.names[0], state, quantity)]
            assert np.sqrt((budget.contribution**2).sum()) == pytest.approx(row.u, rel=1e-12)
            assert budget.share.sum() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(
    "inputs",
    [
        {}, {"product": 3}, {"closing": {"dip_m": "x"}}, {"product": {"density_kg_m3": np.nan}},
        {"closing": {"dip_m": float("inf")}}, {3: {}}, {"ticket": {"date": "yesterday"}},
    ],
)  # fmt: skip
def test_bad_python_inputs_are_problems(inputs):
    with pytest.raises(InputError):
        read_tickets(_cylinder(), inputs)
