"""The dip calculator of records of other kinds: few degrees of freedom, a roof, rows alike."""

import copy
import random
from dataclasses import replace

import numpy as np
import pytest
from calculated_tanks import afloat, example_with_rows
from calculator_deliveries import held_against_deliveries
from recalculation import calculators

from tankcal.report.uncertainty.stated import groups_of
from tankcal.text.words import load_words

# openpyxl does not know our data bars, and says so each time
pytestmark = pytest.mark.filterwarnings("ignore:.*extension is not supported:UserWarning")
NONE = "–"
RELATIVE = 1e-12  # LibreOffice stores 15 digits
WORDS = load_words("en")
OWN = {"product_chosen": WORDS["calculator"]["products"]["own_factor"], "own_factor": 1.0}
DENSITIES = [700.0, 775.0, 850.0, 1000.0, 1001.0, 690.0]
AT_DIP = 5.0
FEW = {"points": 1.3, "seams": 2.5, "ovality": 4.0, "datum": 3.7, "paint": 1.0, "expansion": 30.0}
NEAR_1000 = {"points": 990.0, "seams": 3.0}  # where one formula of k gives way to the other
OF_INPUTS = {"few": (FEW, 0.95), "near_1000": (NEAR_1000, 0.9973)}


def of_few_degrees(result, record, dof, probability):
    """(table, record) of the same tank with other degrees of freedom."""
    sources = tuple(replace(one, dof=dof.get(one.kind, np.inf)) for one in result.table.sources)
    other = copy.deepcopy(record)
    other["job"]["table"]["coverage_probability"] = probability
    for line in other["budget"]:
        line["dof"] = dof.get(line["kind"])
    return replace(result.table, sources=sources, probability=probability), other


def pairs_of_dips():
    """Deliveries, far apart and close together."""
    draw = random.Random(11)
    pairs = [sorted((draw.uniform(0, 9.49), draw.uniform(0, 9.49))) for _ in range(100)]
    pairs += [(low, low + 0.002) for low in np.linspace(0, 9.4, 30).tolist()]
    return [{"delivery_low_dip": low, "delivery_high_dip": high} for low, high in pairs]


def flat(record):
    """A copy in which volumes stand still at the bottom and further up."""
    other = copy.deepcopy(record)
    volumes = other["capacity"]["volume_m3"]
    volumes[:6] = [0.0] * 6
    volumes[20:24] = [volumes[20]] * 4
    return other


def falling(record):
    other = copy.deepcopy(record)
    other["capacity"]["volume_m3"][30] -= 500.0
    return other


def dips_about(zone, record):
    """Cases at the ends of a zone and in it."""
    low, high = zone
    capacity = record["capacity"]
    for dip in (low, low + 0.001, (low + high) / 2, high - 0.001, high):
        volume = float(np.interp(dip, capacity["height_m"], capacity["volume_m3"]))
        yield {
            "dip_m": dip,
            "delivery_low_dip": dip,
            "delivery_high_dip": 8.0,
            "wanted_volume": volume,
        }


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    return example_with_rows(0.2, tmp_path_factory.mktemp("example"))


@pytest.fixture(scope="module")
def roofed(tmp_path_factory):
    return afloat(tmp_path_factory.mktemp("afloat"))


@pytest.fixture(scope="module")
def tables(example):
    """{name of OF_INPUTS: (table, record)}."""
    return {name: of_few_degrees(*example, *inputs) for name, inputs in OF_INPUTS.items()}


@pytest.fixture(scope="module")
def calculated(example, roofed, tables, tmp_path_factory):
    still = flat(example[1])
    volumes = still["capacity"]["volume_m3"]
    wanted = [0.0, volumes[20], volumes[25], (volumes[23] + volumes[24]) / 2]
    result, record = roofed
    roof = result.job.roof
    at = {"dip_m": AT_DIP}
    floats = [at | OWN | {"density_at_base": density} for density in DENSITIES]
    floats += [{**floats[1], "dip_m": 0.5}, at]
    above = [one for one in pairs_of_dips() if one["delivery_low_dip"] > 1.4]
    groups = {name: (of, pairs_of_dips()) for name, (_, of) in tables.items()}
    groups |= {
        "flat": (still, [{"wanted_volume": one} for one in wanted]),
        "falling": (falling(example[1]), [{"wanted_volume": 100.0}]),
        "floats": (record, floats),
        "critical": (record, [*dips_about((roof.critical_bottom_m, roof.critical_top_m), record)]),
        "above the roof": (record, above),
    }
    return calculators(groups, WORDS, tmp_path_factory.mktemp("calculated"))


@pytest.mark.slow
@pytest.mark.parametrize("name", OF_INPUTS)
def test_k_of_few_degrees_of_freedom(calculated, tables, name, figure):
    """By the beta distribution, and just above."""
    found = held_against_deliveries(calculated[name], tables[name][0], pairs_of_dips(), figure)
    few, many = found.dof.min(), found.dof[np.isfinite(found.dof)].max()
    assert few < 2 if name == "few" else few < 1000 < many
    figure(
        f"calculator: degrees of freedom of these deliveries, {name}", f"{few:.4g} to {many:.4g}"
    )


def test_columns_belong_to_the_sources_of_the_budget():
    """Points and form have several columns each; items of deadwood one each; correlated are one."""
    kinds = ["points"] * 3 + ["deadwood"] * 2 + ["form", "paint", "expansion & plate_thickness"]
    kinds += ["expansion & plate_thickness", "deadwood"]
    lines = [
        ("points", 9.0), ("deadwood", None), ("deadwood", 4.0), ("own_form", 2.0), ("form", 3.0),
        ("paint", None), ("expansion", 12.0), ("plate_thickness", 7.0), ("deadwood", 5.0),
    ]  # fmt: skip
    found = groups_of(kinds, [{"kind": kind, "dof": dof} for kind, dof in lines])
    assert [(one.name, one.first, one.last, one.dof) for one in found] == [
        ("points", 0, 2, 9.0), ("deadwood", 3, 3, np.inf), ("deadwood", 4, 4, 4.0),
        ("form", 5, 5, 3.0), ("paint", 6, 6, np.inf),
        ("expansion & plate_thickness", 7, 8, 7.0), ("deadwood", 9, 9, 5.0),
    ]  # fmt: skip


# a floating roof, other densities, rows that cannot be told apart


@pytest.mark.slow
def test_head_and_roof_follow_the_density_of_the_liquid(roofed, calculated):
    """Head: the record's own tables at its densities, less their roof; half-way the mean of two."""
    result, record = roofed
    at = record["capacity"]["height_m"].index(AT_DIP)
    roof = next(part for part in result.body.parts if part.kind == "roof")
    floats = calculated["floats"]
    table = record["capacity"]["volume_m3"][at]
    light, heavy = (
        other["volume_m3"][at] - table - roof.density_correction_m3(other["density_kg_m3"])
        for other in record["densities"]
    )
    expected = [light, light / 2, 0.0, heavy]
    assert light < 0 < heavy
    assert floats.line("head")[:4] == pytest.approx(expected, abs=1e-10)
    roofs = [roof.density_correction_m3(density) for density in DENSITIES[:4]]
    assert floats.line("roof")[:4] == pytest.approx(roofs, rel=1e-9, abs=1e-12)
    sums = [table + head + one for head, one in zip(expected, roofs, strict=True)]
    assert floats.line("in_service")[:4] == pytest.approx(sums, rel=RELATIVE)
    outside = "Refused: outside the densities of the record, 700 to 1000 kg/m³."
    assert floats.sentences("head_state")[4:6] == [outside] * 2
    assert floats.line("in_service")[4:6] == [NONE] * 2
    assert floats.line("roof")[6] == 0  # below the critical zone it stands on its legs
    assert floats.line("in_service")[7] == pytest.approx(table, rel=RELATIVE)


@pytest.mark.slow
def test_the_critical_zone_of_a_roof_is_refused(calculated):
    critical = calculated["critical"]
    said = "Refused: critical zone of the roof, 1.000 m to 1.300 m."
    for state in ("dip_state", "low_dip_state"):
        assert critical.sentences(state)[1:4] == [said] * 3
        assert not any(text.startswith("Refused") for text in critical.sentences(state)[::4])
    for line in ("volume", "expanded", "in_service", "dip_of_volume", "delivered", "delivered_U"):
        found = critical.line(line)
        assert found[1:4] == [NONE] * 3, line
        assert all(isinstance(found[end], float | int) for end in (0, 4)), line


@pytest.mark.slow
def test_deliveries_of_a_tank_whose_inputs_are_all_sure(roofed, calculated):
    """Degrees of freedom are those of points and form here; every pair as tankcal has it."""
    pairs = [one for one in pairs_of_dips() if one["delivery_low_dip"] > 1.4]
    held_against_deliveries(calculated["above the roof"], roofed[0].table, pairs, None)


@pytest.mark.slow
def test_a_volume_of_more_than_one_dip_is_refused(example, calculated):
    """As tankcal.tank.dips.dips_of refuses it: below a raised bottom the table stands still."""
    found, heights = calculated["flat"], example[1]["capacity"]["height_m"]
    refused = "Refused: the table has this volume at more than one dip."
    assert found.sentences("wanted_state")[:2] == [refused] * 2
    expected = [heights[25], (heights[23] + heights[24]) / 2]
    assert found.line("dip_of_volume")[2:] == pytest.approx(expected, abs=1e-9)


@pytest.mark.slow
def test_a_table_that_falls_gives_no_dip(calculated):
    (said,) = calculated["falling"].sentences("wanted_state")
    assert said == "Refused: volumes of this table decrease in places: no single dip."
    assert calculated["falling"].line("dip_of_volume") == [NONE]
