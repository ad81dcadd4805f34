"""The dip calculator in service: warm shells, products, masses; recalculated by LibreOffice."""

import pytest
from calculated_tanks import example_with_rows
from recalculation import calculators

from tankcal.text.words import load_words

# openpyxl does not know our data bars, and says so each time
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:.*extension is not supported:UserWarning"),
]
NONE = "–"
RELATIVE = 1e-12  # LibreOffice stores 15 digits
WORDS = load_words("en")
PRODUCTS = WORDS["calculator"]["products"]
MEASUREMENT_CANADA = "volume correction factors to 15 °C, January 2016, Table 54B"
PRINTED = [  # published truth: product, density at 15 °C, °C, factor as printed, where
    ("products_54b", 710.0, -40.0, 1.0700, MEASUREMENT_CANADA + ", aviation gasoline"),
    ("products_54b", 710.0, -30.0, 1.0576, MEASUREMENT_CANADA + ", aviation gasoline"),
    ("products_54b", 710.0, -20.0, 1.0450, MEASUREMENT_CANADA + ", aviation gasoline"),
    ("products_54b", 800.0, -40.0, 1.0502, MEASUREMENT_CANADA + ", jet fuels"),
    ("products_54b", 800.0, -30.0, 1.0412, MEASUREMENT_CANADA + ", jet fuels"),
    ("products_54b", 800.0, -20.0, 1.0322, MEASUREMENT_CANADA + ", jet fuels"),
    ("products_54b", 990.3, 34.0, 0.9870, "bunker survey by Seven Surveyor, 2010, Table 54B"),
    ("products_54b", 992.0, 36.0, 0.9857, "bunker calculation, fuel oil tank 1, Table 54B"),
    ("crude_54a", 1050.0, 55.0, 0.97758, "ASTM Tables Calc, Baltic Crew, Table 54A"),
]
BETWEEN_GASOLINE_AND_JET = [770.5, 787.5]


def product_case(code, density, celsius, **more):
    typed = {
        "product_chosen": PRODUCTS[code],
        "density_at_base": density,
        "liquid_temperature": celsius,
    }
    return {"dip_m": 4.75, **typed, **more}


HOSTILE_PRODUCTS = [
    ({"product_chosen": "Beer"}, "product_state", "choose an item of the list."),
    ({"product_chosen": 3}, "product_state", "choose an item of the list."),
    ({"density_at_base": None}, "density_state", "type the density at 15 °C."),
    ({"density_at_base": "dense"}, "density_state", "not a number."),
    ({"density_at_base": 0.85}, "density_state", "outside the densities of that table."),
    ({"density_at_base": 640.0}, "density_state", "outside the densities of that table."),
    ({"liquid_temperature": None}, "liquid_state", "type the temperature of the liquid."),
    ({"liquid_temperature": 104.0}, "liquid_state", "expected -40 °C to 90 °C."),
    ({"liquid_temperature": "30 °C"}, "liquid_state", "not a number."),
    ({"product_chosen": PRODUCTS["own_factor"]}, "factor_state", "type the factor."),
    (
        {"product_chosen": PRODUCTS["own_factor"], "own_factor": 98.5},
        "factor_state",
        "too far from 1",
    ),
    ({"product_chosen": PRODUCTS["own_factor"], "own_factor": "-"}, "factor_state", "not a number"),
    ({"shell_temperature": "warm"}, "shell_state", "not a number."),
]

OWN = {"dip_m": 4.75, "product_chosen": PRODUCTS["own_factor"], "own_factor": 0.9951}


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    return example_with_rows(0.2, tmp_path_factory.mktemp("tank"))[1]


@pytest.fixture(scope="module")
def shells(record):
    """°C: the first three can be used."""
    return [record["job"]["table"]["reference_temperature_c"], 55.0, -10.0, None, "warm", 400.0]


@pytest.fixture(scope="module")
def calculated(record, shells, tmp_path_factory):
    joints = [joint + side for joint in BETWEEN_GASOLINE_AND_JET for side in (0, 0.001)]
    ordinary = product_case("products_54b", 746.8, 30.0)
    groups = {
        "shells": [{"dip_m": 4.75, "shell_temperature": shell} for shell in shells],
        "printed": [product_case(*one[:3]) for one in PRINTED],
        "joints": [product_case("products_54b", density, 40.0) for density in joints],
        "own": [OWN, OWN | {"density_at_base": 746.8}, product_case("products_54b", 746.8, 24.5)],
        "hostile": [ordinary | wrong for wrong, _, _ in HOSTILE_PRODUCTS],
    }
    groups = {name: (record, typed) for name, typed in groups.items()}
    return calculators(groups, WORDS, tmp_path_factory.mktemp("calculated"))


@pytest.fixture
def corrected(calculated):
    return calculated["printed"]


def test_a_warm_shell_holds_ctsh_times_the_volume(record, shells, calculated):
    base, at = shells[0], calculated["shells"]
    expansion = record["job"]["material"]["expansion_per_k"]
    ctsh = [(1 + expansion * (shell - base)) ** 2 for shell in shells[:3]]
    assert at.line("ctsh")[:3] == pytest.approx(ctsh, rel=1e-14)
    volume = at.line("volume")[0]
    expected = [factor * volume for factor in ctsh]
    assert at.line("in_service")[:3] == pytest.approx(expected, rel=1e-13)
    assert at.line("in_service")[3:] == [NONE] * 3
    assert all(text.startswith("Refused: ") for text in at.sentences("shell_state")[3:])


def test_the_factor_of_a_product_is_the_printed_one(corrected):
    found = corrected.line("factor_used")
    for factor, (*what, printed, _) in zip(found, PRINTED, strict=True):
        decimals = len(str(printed).partition(".")[2].ljust(4, "0"))
        assert factor == pytest.approx(printed, abs=0.5 * 10**-decimals), what


def test_the_zones_of_the_products_meet(calculated):
    """Property: between two zones there is no step that the print could show."""
    light, middle, jet_below, jet = calculated["joints"].line("factor_used")
    assert middle == pytest.approx(light, abs=5e-5)
    assert jet == pytest.approx(jet_below, abs=5e-5)


def test_volume_and_mass_at_the_base_temperature(corrected):
    lines = [
        corrected.line(key)
        for key in ("in_service", "factor_used", "at_base", "mass", "mass_in_air")
    ]
    densities = [one[1] for one in PRINTED]
    for density, volume, factor, base, mass, in_air in zip(densities, *lines, strict=True):
        assert base == pytest.approx(volume * factor, rel=RELATIVE)
        assert mass == pytest.approx(base * density, rel=RELATIVE)
        # weights of 8000 kg/m3 in air of 1.2 kg/m3 that balance it (OIML D 28)
        assert in_air * (1 - 1.2 / 8000) == pytest.approx(mass - 1.2 * base, rel=RELATIVE)


def test_a_factor_of_ones_own(calculated):
    """The example printed in Resolution CNP 6/70, Table II: 100 000 L at 24.5 °C are 99 510 L."""
    found = calculated["own"]
    volume = found.line("volume")[0]
    assert found.line("at_base")[:2] == pytest.approx([0.9951 * volume] * 2, rel=RELATIVE)
    assert found.line("mass")[0] == NONE
    assert found.line("in_tank")[1] == pytest.approx(0.9951 * 746.8, rel=RELATIVE)
    assert abs(found.line("factor_used")[2] - 0.9951) > 1e-3  # to 15 °C: another factor


def test_wrong_product_input_is_refused_in_words(calculated):
    typed = calculated["hostile"]
    for place, (wrong, state, words) in enumerate(HOSTILE_PRODUCTS):
        said = typed.sentences(state)[place].replace("−", "-")
        assert said.startswith("Refused: "), wrong
        assert words in said, wrong
    assert typed.line("at_base") == [NONE] * len(HOSTILE_PRODUCTS)
    assert typed.line("mass") == [NONE] * len(HOSTILE_PRODUCTS)
