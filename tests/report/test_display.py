"""How results show themselves: text, HTML, drawings, JSON for programs."""

import json
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure

import tankcal
from tankcal.cli import main
from tankcal.tank.capacity import Quantity
from tankcal.text.display import table_html, volume_text

TOTAL_STATION = Path(__file__).parents[2] / "examples" / "total-station"


@pytest.fixture(scope="module")
def adjusted():
    return tankcal.adjust_job(tankcal.load(TOTAL_STATION, only="adjustment"))


def test_a_quantity_is_a_sentence():
    one = Quantity(554.5601, 0.2134, 40.0, 1.974, 0.4212)
    assert str(one) == "554.56 m3, U = 0.42 m3 (k = 1.97)"
    assert "554.56 m3" in one._repr_html_()


def test_U_of_monte_carlo_is_stated_without_k():
    assert volume_text(0.041, 0.012, None).endswith("(Monte Carlo)")
    assert volume_text(10.0, 0.0, 1.96) == "10.000 m3, no uncertainty declared"


def test_text_of_a_user_is_no_markup():
    assert "<b>" not in table_html("<b>", ["<b>"], [["<b>", None, 1.5]])


def test_shown_result_budget_and_delivery_agree_with_table(example_result):
    top = example_result.table.height_m[-1]
    assert example_result.budget().summary.endswith(str(example_result.at(top)))
    delivered = str(example_result.budget(7.5, 2.0)).splitlines()
    assert delivered[0].endswith(str(example_result.delivery(2.0, 7.5)))
    shares = [float(line.partition("%")[0]) for line in delivered[1:]]
    assert shares == sorted(shares, key=abs, reverse=True)
    assert sum(shares) == pytest.approx(100, abs=0.05 * len(shares))
    assert example_result.job.tank.id in example_result._repr_html_()
    frame = pd.DataFrame(example_result.budget().lines)
    assert frame.share.sum() == pytest.approx(1, abs=1e-12)


def test_reading_the_table_adds_to_a_budget(example_result):
    alone, read = example_result.budget(4.217), example_result.budget(4.217, reading=True)
    assert read.u_m3 > alone.u_m3
    assert alone.u_m3 == pytest.approx(example_result.at(4.217).u_m3, rel=1e-12)
    assert {one.name for one in read.lines} - {one.name for one in alone.lines} == {
        "interpolation",
        "rounding",
    }


@pytest.mark.slow(after=4)
@pytest.mark.parametrize(
    "what", [None, "capacity", "budget", "sections", "residuals", "wall", "field"]
)
def test_every_drawing_of_a_result_is_a_figure(example_result, what):
    assert isinstance(example_result.plot(what), Figure)


@pytest.mark.slow
def test_the_drawn_residuals_are_those_of_the_record(example_result, example_record):
    """Second source: the record computes azimuths from the points themselves."""
    sections = json.loads(Path(example_record).read_text(encoding="utf-8"))["sections"]
    axes = example_result.plot("residuals").axes
    for ax, section in zip(axes, sections, strict=True):
        x, y = ax.lines[0].get_data()
        assert x == pytest.approx(section["azimuth_deg"], abs=1e-9)
        assert y == pytest.approx([1e3 * r for r in section["residual_m"]], abs=1e-9)


@pytest.mark.slow
def test_a_drawing_that_does_not_exist_is_refused(example_result, adjusted):
    with pytest.raises(ValueError, match="expected one of capacity"):
        example_result.plot("spectrum")
    with pytest.raises(ValueError, match="name none"):
        tankcal.plot(adjusted, "wall")


def test_an_adjustment_shows_its_points(adjusted):
    assert str(adjusted).startswith("167 points, redundancy 588, sigma0 = 0.982")
    assert adjusted._repr_html_().count("<tr>") == 21
    assert isinstance(tankcal.plot(adjusted), Figure)
    frame = pd.DataFrame(adjusted.points)
    assert list(frame) == ["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"]
    assert len(frame) == 167


def test_package_is_marked_as_typed():
    assert Path(tankcal.__file__).with_name("py.typed").exists()
    assert set(tankcal.__all__) - {"__version__"} == set(tankcal._MODULE_OF)


def test_tankcal_alone_prints_its_help(capsys):
    for arguments in ([], ["camera"]):
        assert main(arguments) == 0
        assert capsys.readouterr().out.startswith("usage: tankcal")


def test_wrong_job_is_reported_in_json(tmp_path, capsys):
    assert main(["run", str(tmp_path), "--json"]) == 2
    told = json.loads(capsys.readouterr().out)
    assert told["exit_status"] == 2
    assert told["problems"][0]["file"] == "job.toml"


def test_lint_in_json(tmp_path, capsys):
    table = tmp_path / "table.csv"
    rows = [f"{0.01 * i:.2f},{1.3 * i + (0.9 if i == 50 else 0):.3f}" for i in range(101)]
    table.write_text("\n".join(["height_m,volume_m3", *rows]), encoding="utf-8")
    assert main(["lint", str(table), "--json"]) == 2
    told = json.loads(capsys.readouterr().out)
    assert (told["errors"], told["findings"][0]["row"]) == (1, 52)
    assert tankcal.lint(table)._repr_html_().count("<tr>") == 1 + len(told["findings"])


def test_importing_tankcal_loads_nothing_heavy():
    code = "import sys, tankcal; print(*{'numpy', 'pandas', 'matplotlib'} & set(sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not found.stdout.strip()
