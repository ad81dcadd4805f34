"""The quantity calculator of the web page, run by Node, against the tickets."""

import json
import shutil
import subprocess

import numpy as np
import pytest
from browser import Browser
from calculated_tanks import afloat, example_with_rows
from quantity_cases import (
    CASES,
    CLOSING,
    GRID,
    LEVELS,
    LEVELS_OF_ROOF,
    STEPS,
    ULLAGES,
    case,
    save_with_levels,
    ticket_of,
)

from tankcal.errors import InputError
from tankcal.products.quantity.chain import QUANTITIES
from tankcal.products.quantity.table import read_table
from tankcal.report import blocks
from tankcal.report.paper import Paper
from tankcal.report.web import page
from tankcal.report.web.calculator_data import calculator
from tankcal.tank.gauging import FIELDS_OF_U, UNCERTAINTIES
from tankcal.text.shipped import shipped_folder
from tankcal.text.words import load_words

SAME = 1e-9
LABELS = ("tov", "gov", "gsv", "nsv", "mass", "weight")  # of QUANTITIES
# The page contains the covariance factor in single precision, at the rows between which it is
# linear to 1e-6 of the largest u.
SAME_U = 1e-6
SCRIPTS = ("numbers.js", "deliveries.js", "quantity.js")
RUN = """
const document = { getElementById: () => ({ textContent: '{"words": {}, "marks": {}}' }) };
%s
const { data, cases } = JSON.parse(require("fs").readFileSync(0, "utf8"));
const heights = unpacked(data.height_m, Float64Array);
const tank = { ...data.quantity, reference_height_m: data.reference_height_m, heights,
  volumes: unpacked(data.volume, Float64Array).map((v) => v / data.quantity.unit_factor) };
const table = covarianceOfTable(data.deliveries, heights);
const results = cases.map((given) => {
  try { return quantityOf(tank, table, given); } catch (refusal) {
    if (!(refusal instanceof Refusal)) throw refusal;
    return { refusal: refusal.key };
  }
});
console.log(JSON.stringify(results));
"""


def given_of(sections):
    """What the form hands to `quantityOf` for the sections of a ticket."""
    product = sections["product"]
    own = sections.get("uncertainty", {})
    given = {
        "correction": product["correction"],
        "group": product.get("group") or "",
        "base": product.get("base") or "",
        "alpha": product.get("alpha_per_k"),
        "density": product["density_kg_m3"],
        "density_is": product["density_is"],
        "sample": product.get("density_temperature_c"),
        "hydrometer": (product.get("hydrometer") or "").removeprefix("glass "),
        "sw": product.get("sw_percent"),
        "insulated": bool(sections.get("shell", {}).get("insulated")),
        "u": {field: own.get(name, UNCERTAINTIES[name]) for name, field in FIELDS_OF_U.items()},
    }
    for state in ("opening", "closing"):
        given[state] = {
            name: sections.get(state, {}).get(key)
            for key, name in (("dip_m", "dip"), ("ullage_m", "ullage"), ("water_dip_m", "water"),
                              ("temperature_c", "liquid"), ("ambient_c", "ambient"))
        }  # fmt: skip
    return given


def run(record, cases, folder):
    """Results of cases by the script of the page; skips without Node."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("Node is not installed: the script of the page cannot run")
    scripts = shipped_folder("report_templates") / "web"
    source = RUN % "\n".join((scripts / name).read_text(encoding="utf-8") for name in SCRIPTS)
    (folder / "run.cjs").write_text(source, encoding="utf-8")
    data = calculator(Paper(record, load_words("en"))).data
    result = subprocess.run(
        [node, str(folder / "run.cjs")], input=json.dumps({"data": data, "cases": cases}),
        capture_output=True, encoding="utf-8", check=True, timeout=100,
    )  # fmt: skip
    return json.loads(result.stdout)


TANKS = {
    "upright": (lambda folder: example_with_rows(0.2, folder), LEVELS, CASES | GRID),
    "roofed": (afloat, LEVELS_OF_ROOF, ULLAGES),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", TANKS)
def test_the_page_shows_the_numbers_of_the_ticket(kind, tmp_path):
    make, levels, cases = TANKS[kind]
    record = save_with_levels(make(tmp_path)[1], levels, tmp_path)
    table = read_table(tmp_path / "record.json")
    results = run(record, [given_of(sections) for sections in cases.values()], tmp_path)
    for (key, sections), result in zip(cases.items(), results, strict=True):
        try:
            ticket = ticket_of(sections, tmp_path, table)
        except InputError:
            ticket = None
        assert ("refusal" in result) == (ticket is None), (key, result)
        if ticket is None:
            continue
        transfer = ticket.transfer
        for state, steps in transfer.steps.items():
            for label, name in STEPS.items():
                expected = float(np.real(getattr(steps, name))[0])
                found = result["steps"][state][label]["value"]
                assert found == pytest.approx(expected, rel=SAME, abs=1e-9), (key, name)
        quantities = transfer.quantities()
        total = quantities.get("moved", quantities["closing"])
        for label, name in zip(LABELS, QUANTITIES, strict=True):
            place, moved = QUANTITIES.index(name), result["moved"][label]
            assert moved["value"] == pytest.approx(total.value[0, place], rel=SAME), (key, name)
            assert moved["U"] == pytest.approx(total.U[0, place], rel=SAME_U), (key, name)
            assert moved["k"] == pytest.approx(total.k[0, place], rel=1e-6), (key, name)
        rooms = transfer.rooms()
        assert [room["name"] for room in result["rooms"]] == list(transfer.room_levels)
        for place, found in enumerate(result["rooms"]):
            name = found["name"]
            assert found["level_m"] == transfer.room_levels[name]
            assert found["value"] == pytest.approx(rooms.value[0, place], rel=SAME, abs=1e-9), key
            assert found["U"] == pytest.approx(rooms.U[0, place], rel=SAME_U), (key, name)
            assert found["k"] == pytest.approx(rooms.k[0, place], rel=1e-6), (key, name)


OUTSIDE = {  # values that the reader of tickets refuses
    "dip": CLOSING | {"dip_m": -0.1}, "ullage": {"ullage_m": 201.0, "temperature_c": 20.0},
    "water": CLOSING | {"water_dip_m": -0.1}, "liquid": CLOSING | {"temperature_c": 201.0},
    "air": CLOSING | {"ambient_c": 77.0},
}  # fmt: skip


@pytest.mark.slow
def test_the_page_refuses_a_reading_outside_the_limits_of_a_ticket(tmp_path):
    record = example_with_rows(0.2, tmp_path)[1]
    table = read_table(tmp_path / "record.json")
    product = {"group": "products", "base": "20C"}
    cases = {key: case("D1250-04", 842.0, closing=own, **product) for key, own in OUTSIDE.items()}
    for sections in cases.values():
        with pytest.raises(InputError):
            ticket_of(sections, tmp_path, table)
    results = run(record, [given_of(sections) for sections in cases.values()], tmp_path)
    assert results == [{"refusal": "no_number"}] * len(cases)


FILL = """
document.getElementById("quantity").open = true;
for (const [id, text] of %s) {
  const field = document.getElementById(`quantity-${id}`);
  field.value = text;
  field.dispatchEvent(new Event("input"));
}
"""
TYPED = [
    ("correction", "D1250-80"), ("group", "products"), ("base", "15C"), ("density", "745"),
    ("density_is", "observed"), ("sample", "30"), ("dip-closing", "9"), ("liquid-closing", "28"),
    ("ambient-closing", "20"),
]  # fmt: skip


@pytest.mark.slow
def test_the_form_shows_the_stock_or_the_reason_of_a_refusal(tmp_path):
    record = save_with_levels(afloat(tmp_path)[1], LEVELS_OF_ROOF, tmp_path)
    shown = [blocks.document(title="T").data, calculator(Paper(record, load_words("en"))).data]
    (tmp_path / "page.html").write_text(page(shown, has_contents=False), encoding="utf-8")
    with Browser() as browser:
        browser.open(tmp_path / "page.html")
        browser.run(FILL % "[]")
        assert "choose the volume correction" in browser.text("#quantity .answer")
        browser.run(FILL % json.dumps(TYPED))
        assert browser.text("#quantity .answer").startswith("Blank: the results are the stock")
        table = browser.text("#quantity table")
        assert f"{record['capacity']['volume_m3'][36]:.3f}" in table.replace(",", "")  # at 9 m
        browser.run(FILL % json.dumps([("liquid-closing", "160")]))
        # 0 degF and 200 degF
        allowed = "Allowed temperature, from and to: -17.77, 93.33 °C."
        assert browser.text("#quantity .answer").replace("−", "-").endswith(allowed)
        browser.run(FILL % json.dumps([("liquid-closing", "28")]))
        assert "Room and stock at the closing gauging" in table
        assert "Available room (m³)" in table
        browser.run(FILL % json.dumps([("dip-closing", "0.2")]))
        assert "floating roof does not float" in browser.text("#quantity .answer")
        assert browser.text("#quantity table").strip() == ""
        assert browser.complaints == []
