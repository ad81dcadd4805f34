"""What a notebook shows of a result, without a browser: calculators, points, budget, pages."""

import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from job_builder import job_parts, write_folder

import tankcal
from tankcal.errors import InputError, Problem
from tankcal.job.model import Overruling
from tankcal.messages import message
from tankcal.products.desk.result_pages import wall_page
from tankcal.products.workbench import views as pages
from tankcal.products.workbench.views import (
    Calculator,
    SavedView,
    budget_sentences,
    change_budget,
    parse_number,
    results_view,
    table_html,
)
from tankcal.record import record_of
from tankcal.report.paper import Paper
from tankcal.report.tables.capacity import capacity_rows, capacity_table
from tankcal.text.shipped import LANGUAGES

TURN = np.radians(7.5)
DENT = ("dent", 6.46 * np.sin(TURN), 6.46 * np.cos(TURN), 5.225)
SOUND = ("a", 6.5, 0.0, 5.2)
OTHER = ("b", -6.44, 0.0, 1.0)
SPACE = "\N{NO-BREAK SPACE}"
EACH_LANGUAGE = ["en", *(pytest.param(other, marks=pytest.mark.slow) for other in LANGUAGES[1:])]


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    parts = job_parts(
        rings=2,
        noise_mm=1.0,
        extra_points=[DENT, SOUND, OTHER],
        uncertainty=[("scale", 40.0, "ppm"), ("datum", 1.0, "mm")],
        settings={"table.step_m": 0.5, "datum.reference_height_m": 11.0},
    )
    return tankcal.load(write_folder(tmp_path_factory.mktemp("views") / "job", parts))


@pytest.fixture(scope="module")
def result(job):
    return tankcal.run(job)


@pytest.fixture(scope="module")
def record(result):
    return record_of(result)


@pytest.fixture(params=EACH_LANGUAGE)
def paper(request, record):
    return Paper(record, language=request.param)


@pytest.fixture
def english(record):
    return Paper(record, language="en")


# ---- calculators


@pytest.mark.slow(after=2)
def test_every_row_is_that_of_the_certificate(result, paper):
    # to the digit: the cells that the certificate prints
    table, rows = capacity_table(paper.record), capacity_rows(paper.record)
    printed = {
        key: paper.column_texts(rows, next(one for one in table.columns if one.key == key))
        for key in ("volume_m3", "stated_U_m3", "k")
        if any(one.key == key for one in table.columns)
    }
    calculator = Calculator(result, paper)
    for number, height in enumerate(result.table.height_m):
        answer = calculator.volume_at(str(float(height)))
        assert not answer.is_refused
        for cells in printed.values():
            assert cells[number] in answer.text


def test_between_two_rows_U_is_that_of_the_worse_one(result, english):
    calculator = Calculator(result, english)
    between, worse = calculator.volume_at("9.25"), calculator.volume_at("9.5")
    assert between.text.split(" with ")[1] == worse.text.split(" with ")[1]
    assert f"V = {result.at(9.25).value_m3:.3f}" in between.text


def test_the_dip_of_a_volume_is_its_inverse(result, english):
    calculator = Calculator(result, english)
    for dip in (0.5, 3.25, 9.0):
        volume = result.at(dip).value_m3
        answer = calculator.dip_of(repr(volume))
        found = result.dip_of(volume)
        k = result.table.at(dip).k
        assert f"h = {dip:.4f}{SPACE}m with U = " in answer.text
        U_mm = 1e3 * k * float(found.u_m[0])
        assert float(re.search(r"U = ([\d.]+)", answer.text)[1]) == pytest.approx(U_mm, rel=0.05)
        assert answer.facts[-1][1] == f"{11.0 - dip:.3f}{SPACE}m"


def test_a_delivery_in_any_order(result, english):
    calculator = Calculator(result, english)
    one, other = calculator.delivery("2", "7.3"), calculator.delivery("7.3", "2")
    found = result.delivery(2.0, 7.3)
    assert one == other
    assert f"V = {found.value_m3:.3f}" in one.text
    assert f"k = {found.k:.2f}" in one.text


@pytest.mark.parametrize(
    "text", ["", "  ", "x", "1e3", "4.5.6", "nan", "inf", "-1", "12", "9" * 80]
)
def test_no_dip_is_answered_with_a_sentence(result, paper, text):
    calculator = Calculator(result, paper)
    answers = [calculator.volume_at(text), calculator.delivery(text, "2"), calculator.dip_of(text)]
    assert answers[0].is_refused
    assert answers[1].is_refused
    assert answers[0].text
    if text != "12":
        assert answers[2].is_refused


def test_the_same_dip_twice_is_no_delivery(result, english):
    assert Calculator(result, english).delivery("2", "2.0").is_refused


def test_a_decimal_comma_is_understood(result, record):
    assert parse_number("4,25") == parse_number(" 4.25 ") == 4.25
    answer = Calculator(result, Paper(record, language="pt-BR")).volume_at("4,5")
    assert re.match(r"V = \d+,\d{3}", answer.text)


def test_the_critical_zone_is_refused(result, english):
    floating = replace(result, table=replace(result.table, critical_m=(1.0, 1.3)))
    calculator = Calculator(floating, english)
    assert calculator.volume_at("1.1").is_refused
    assert not calculator.volume_at("1.3").is_refused


# ---- what if


def test_the_budget_as_it_is(result, paper):
    supposed = change_budget(result, paper, 9.5)
    assert supposed.then.U_m3 == pytest.approx(result.budget().U_m3, rel=1e-12)
    assert len(budget_sentences(paper, supposed)) == 1
    assert len(supposed.names) == len(result.budget().lines)


def test_half_of_a_line(result, paper):
    supposed = change_budget(result, paper, 9.5, factors={0: 0.5})
    assert supposed.then.U_m3 == pytest.approx(
        result.budget().U_m3 * result.budget().lines[0].halved, rel=1e-12
    )
    said = budget_sentences(paper, supposed)
    change = 100 * (supposed.then.U_m3 / supposed.now.U_m3 - 1)
    assert paper.number(abs(change), decimals=1) in said[1]
    html = table_html(paper, supposed)
    assert paper.number(0.5, decimals=2) in html
    assert all(name in unescape(html) for name in supposed.names)


def test_a_delivery_has_its_own_budget(result, english):
    supposed = change_budget(result, english, 9.0, 2.0)
    assert supposed.now.volume_m3 == pytest.approx(result.delivery(2.0, 9.0).value_m3)


# ---- pages


def test_a_saved_view_is_one_page_that_asks_for_nothing(paper):
    view = SavedView(paper)
    html = view.html
    assert 'id="calculator"' in html
    assert 'id="wall"' in html
    assert 'id="view"' in html
    assert "dent" in html
    assert not re.search(r"(src|href)=[\"']https?:", html)
    shown = view._repr_html_()
    assert 'sandbox="allow-scripts"' in shown
    assert unescape(re.search(r'srcdoc="([^"]*)"', shown)[1]) == html


def test_without_widgets_there_is_the_page(monkeypatch, result, record):
    from tankcal.products.workbench import views

    monkeypatch.setattr(views, "find_spec", lambda name: None)
    assert isinstance(results_view(result, record), SavedView)


@pytest.mark.slow
def test_what_is_written_by_a_user_stays_text(job):
    bad = "<script>alert(1)</script>\"'&"
    decided = replace(job, overrulings=(Overruling("dent", None, None, "keep", bad, by=bad),))
    html = SavedView(Paper(record_of(tankcal.run(decided, simulated=False)))).html
    assert bad not in html
    assert "<script>alert" not in html


def test_the_rejected_of_the_wall_and_of_space(record, english):
    from tankcal.report.web.tank_shape import tank_view
    from tankcal.report.web.wall_map import wall_map_view

    on_wall, in_space = wall_map_view(english).data, tank_view(english).data["shell"]
    assert [one["name"] for one in on_wall["rejected"]] == ["b", "dent"]
    assert [one["name"] for one in in_space["rejected"]] == ["b", "dent"]
    dent = on_wall["rejected"][1]
    assert dent["azimuth"] == pytest.approx(7.5, abs=0.05)  # closed form: where it was put
    assert dent["height"] == pytest.approx(5.225, abs=1e-3)
    assert dent["off_mm"] == pytest.approx(-40, abs=3)
    assert len(on_wall["names"]) == sum(one["used"] for one in record["points"])


def test_a_lying_tank_has_its_form(tmp_path):
    path = write_folder(tmp_path / "job", job_parts(kind="horizontal"))
    result = tankcal.run(tankcal.load(path), simulated=False)
    paper = Paper(record_of(result))
    assert 'id="view"' in wall_page(paper)
    assert 'id="wall"' not in SavedView(paper).html


# ---- widgets


@pytest.fixture
def widgets():
    return pytest.importorskip("ipywidgets")


@pytest.fixture
def heard():
    return []


@pytest.fixture
def points(widgets, english, heard):
    from tankcal.products.workbench.views import PointsPanel

    return PointsPanel(english, lambda *given: heard.append(given))


def test_one_point_after_another(points):
    seen = []
    for _ in range(3):
        points.step(1)
        seen.append(points.chosen)
    assert seen == ["b", "dent", "b"]
    points.step(-1)
    assert points.chosen == "dent"
    assert points.list.value == "dent"
    assert "mm" in points.details.value


def test_a_decision_needs_a_reason(points, heard):
    points.chosen = "dent"
    for reason in ("", "   "):
        points.reason.value = reason
        points.decide["keep"].click()
    assert heard == []
    assert "reason" in points.state.value
    points.reason.value = " dent,  seen "
    points.decide["keep"].click()
    assert heard == [("dent", "keep", "dent, seen")]
    assert "dent" in points.state.value


def test_a_point_of_the_wall_can_be_left_out(points, heard):
    points.chosen = "a"  # as the picture tells it
    points.reason.value = "target fell off"
    points.decide["leave_out"].click()
    assert heard == [("a", "leave_out", "target fell off")]


def test_nothing_is_decided_about_nothing(points):
    assert all(button.disabled for button in points.decide.values())
    points.chosen = "nobody"
    assert all(button.disabled for button in points.decide.values())


def test_a_refusal_is_said(widgets, english):
    from tankcal.products.workbench.views import PointsPanel

    def refuse(*_given):
        raise InputError(Problem("overrulings.csv", message("overruled_nothing", "blank <b>")))

    panel = PointsPanel(english, refuse)
    panel.chosen, panel.reason.value = "dent", "why"
    panel.decide["keep"].click()
    assert "&lt;b&gt;" in panel.state.value
    assert panel.reason.value == "why"


def test_nobody_decides_where_nobody_listens(widgets, english):
    from tankcal.products.workbench.views import PointsPanel

    panel = PointsPanel(english, None)
    assert panel.reason not in panel.box.children


def test_the_whole_view(widgets, result, record, heard):
    view = results_view(result, record, "pt-BR", lambda *given: heard.append(given))
    _, tabs = view.children
    assert list(tabs.titles) == ["Tabela", "Quantidade", "Parede e pontos", "Balanço de incerteza"]


def test_picture_and_list_look_at_the_same_point(widgets, result, english):
    pytest.importorskip("anywidget")
    from tankcal.products.workbench.views import wall_part

    box = wall_part(result, english, wall_page(english), None)
    frame = box.children[1]
    frame.chosen = "dent"  # as the picture does
    assert "dent" in box.children[0].children[1].value


def test_sliders_of_the_budget(widgets, result, paper):
    from tankcal.products.workbench.views import BudgetPanel

    panel = BudgetPanel(result, paper)
    before = panel.totals.value
    panel.factors[0].value = 0.5
    assert panel.totals.value != before
    panel.reset_factors()
    assert panel.totals.value == before
    panel.dip.value = 4.5
    assert panel.totals.value != before
    panel.low.value = "2"
    of_delivery = panel.totals.value
    for wrong in ("x", "4.5", "-3"):
        panel.low.value = wrong
        assert panel.totals.value != of_delivery
        assert panel.table.value == ""


# ---- quantity calculator

TICKET = {
    "product": {
        "correction": "D1250-04", "group": "products", "base": "20C", "density_kg_m3": 835.2,
        "density_is": "observed", "density_temperature_c": 27.5, "hydrometer": "glass 20C",
        "sw_percent": 0.05,
    },
    "opening": {"dip_m": 2.317, "water_dip_m": 0.612, "temperature_c": 28.4, "ambient_c": 25.0},
    "closing": {"dip_m": 8.642, "water_dip_m": 0.612, "temperature_c": 31.2, "ambient_c": 29.0},
    "uncertainty": {"u_expansion_per_k": 2e-6},
}  # fmt: skip


@pytest.fixture
def quantity(widgets, paper):
    """Quantity panel in which the ticket was typed with the decimal mark of the language."""
    from tankcal.products.workbench.views import QuantityPanel

    panel = QuantityPanel(paper)
    for section, values in TICKET.items():
        for key, value in values.items():
            typed = (
                value if isinstance(value, str) else str(value).replace(".", paper.marks.decimal)
            )
            panel.entries[f"{section}.{key}"].value = typed
    return panel


def printed(answer):
    """Text of the cells of the HTML of an answer."""
    return [unescape(re.sub("<[^>]+>", "", cell)) for cell in re.findall(r"<td.*?</td>", answer)]


@pytest.mark.slow
def test_a_typed_ticket_is_that_of_the_result(result, paper, quantity):
    from tankcal.text.digits import format_with_u

    transfer = result.ticket(TICKET)
    cells = printed(quantity.answer.value)
    for state in ("opening", "closing", "moved"):
        for name in ("gov_m3", "gsv_m3", "nsv_m3", "mass_kg"):
            row = transfer.frame().loc[("1", state, name)]
            written = format_with_u(row.value, row.U, paper.marks)
            assert {written.value, written.uncertainty} <= set(cells)
    assert quantity.settings() == (TICKET, {})
    assert not any(remark.value for remark in quantity.remarks.values())


@pytest.mark.slow
def test_a_stock_needs_no_opening(result, paper, quantity):
    from tankcal.text.digits import format_with_u

    for key in TICKET["opening"]:
        quantity.entries[f"opening.{key}"].value = " "
    stock = result.ticket({name: part for name, part in TICKET.items() if name != "opening"})
    row = stock.frame().loc[("1", "closing", "mass_kg")]
    written = format_with_u(row.value, row.U, paper.marks)
    assert {written.value, written.uncertainty} <= set(printed(quantity.answer.value))
    assert paper.words["ticket"]["states"]["moved"] not in quantity.answer.value


@pytest.mark.slow
def test_a_typed_zero_is_an_entry(result, paper, quantity):
    """A blank takes the assumption or the default; 0 does not."""
    from tankcal.text.digits import format_with_u

    changed = {**TICKET, "uncertainty": TICKET["uncertainty"] | {"u_density_kg_m3": 0.0}}
    changed["opening"] = TICKET["opening"] | {"water_dip_m": 0.0}
    quantity.entries["uncertainty.u_density_kg_m3"].value = "0"
    quantity.entries["opening.water_dip_m"].value = f"0{paper.marks.decimal}0"
    assert quantity.settings() == (changed, {})
    row = result.ticket(changed).frame().loc[("1", "moved", "mass_kg")]
    written = format_with_u(row.value, row.U, paper.marks)
    assert {written.value, written.uncertainty} <= set(printed(quantity.answer.value))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "typed"),
    [
        ("closing.dip_m", "99"), ("closing.ullage_m", "2.5"), ("closing.water_dip_m", "9"),
        ("opening.temperature_c", "190"), ("product.density_kg_m3", "0.84"),
        ("product.sw_percent", "50"), ("product.density_temperature_c", ""),
        ("product.density_is", "base"), ("product.alpha_per_k", "8e-4"), ("opening.dip_m", ""),
        ("uncertainty.u_dip_mm", "-1"),
    ],
)  # fmt: skip
def test_a_problem_is_told_beside_its_field(result, paper, quantity, place, typed):
    from tankcal.text.words import say

    quantity.entries[place].value = typed
    assert quantity.answer.value == ""
    with pytest.raises(InputError) as refused:
        result.ticket(quantity.settings()[0])
    for problem in refused.value.problems:
        text = say(paper.words, problem.expected)
        assert text in unescape(quantity.remarks[problem.column].value)


def test_a_missing_choice_is_asked_for_in_words(paper, quantity):
    quantity.entries["product.group"].value = None
    asked = paper.words["quantity"]["sentences"]["group_blank"]
    assert asked in unescape(quantity.remarks["product.group"].value)
    assert quantity.answer.value == ""


@pytest.mark.slow
@pytest.mark.parametrize("typed", ["<b>8</b>", "1.2.3", "8 m", "1.234,5", "nan", "9" * 400])
def test_an_entry_that_is_no_number_is_refused(quantity, typed):
    quantity.entries["closing.dip_m"].value = typed
    assert quantity.answer.value == ""
    assert quantity.remarks["closing.dip_m"].value
    assert "<b>" not in quantity.remarks["closing.dip_m"].value


@pytest.mark.slow
def test_a_slip_is_told_beside_its_field(paper, quantity):
    quantity.entries["product.sw_percent"].value = "0.0005"
    assert "0" + paper.marks.decimal + "005" in quantity.remarks["product.sw_percent"].value
    assert quantity.answer.value


def test_a_form_without_entries_is_silent(widgets, paper):
    from tankcal.products.workbench.views import QuantityPanel

    panel = QuantityPanel(paper)
    panel.entries["closing.dip_m"].value = "4"
    assert panel.remarks["product.correction"].value
    panel.entries["closing.dip_m"].value = ""
    assert not any(remark.value for remark in panel.remarks.values())
    assert panel.answer.value == panel.state.value == ""


def test_without_anywidget_a_page_is_still_framed(monkeypatch, widgets, english):
    from tankcal.products.workbench import views as panels

    monkeypatch.setattr(panels, "find_spec", lambda name: None)
    assert "srcdoc" in panels.frame_of(wall_page(english), "wall").value


def test_the_scripts_of_the_frame_are_shipped():
    assert (Path(pages.__file__).parent / "frame.js").is_file()
