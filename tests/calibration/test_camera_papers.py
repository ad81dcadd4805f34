"""What a user sees of the camera's analyses: lines, tables, JSON, report; texts stay literal."""

import csv
import json
import shutil
import subprocess

import numpy as np
import pytest
from camera_sets import HOSTILE, SMALL, Q, sets

from tankcal.calibration.interiors import decentring_profile, radial_curve
from tankcal.calibration.product import check_product, shipped_limits
from tankcal.calibration.stability.comparison import compare
from tankcal.camera.model import Form, distort_image_points
from tankcal.errors import InputError
from tankcal.record import camera as product_json
from tankcal.record import camera as stability_json
from tankcal.report import camera as camera_papers
from tankcal.report.camera.paper import CameraPaper, load, number_names, shorten
from tankcal.report.numbers import concise
from tankcal.text.digits import decimals_of, fixed
from tankcal.text.words import load_words

pytest_plugins = ("camera_results",)


SLOW_FIXTURES = {"stability", "parameters", "run"}  # seconds each


@pytest.fixture(scope="module", params=["stability", "parameters", "influence", "product"])
def folder(request, results, tmp_path_factory):
    """The folder with everything of one kind, and its result."""
    out = tmp_path_factory.mktemp(request.param) / "papers"
    told = []
    paths = camera_papers.write(
        results[request.param], out, lambda *progress: told.append(progress)
    )
    assert told[-1][1] == told[-1][2]
    assert sorted(path.name for path in paths) == sorted(path.name for path in out.iterdir())
    return out, results[request.param]


def text_of(lines):
    return " ".join(" ".join(lines).split())


@pytest.mark.slow
def test_the_json_is_the_result(folder):
    out, result = folder
    assert load(out / "camera.json") == json.loads(json.dumps(result, allow_nan=False))


@pytest.mark.slow
def test_csv_tables_have_no_formula_and_one_width(folder):
    out, _ = folder
    found = sorted(out.glob("*.csv"))
    assert found
    for path in found:
        with open(path, encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
        assert len(rows) > 1
        assert {len(row) for row in rows} == {len(rows[0])}
        for cell in (cell for row in rows for cell in row):
            assert not cell.startswith(("=", "@", "\t")), (path.name, cell)
            assert not cell.startswith(("+", "-")) or float(cell) < 0


@pytest.mark.slow
def test_the_pages_show_every_text_literally(folder):
    out, result = folder
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "<b>bold" not in page
    assert "<i>" not in page
    assert page.count("<script") == 2  # the page's words, and its own script
    assert camera_papers.CameraPaper(result).title() in page
    if shutil.which("pdftotext") is None:
        pytest.skip("pdftotext is not installed")
    text = subprocess.run(
        ["pdftotext", "-layout", out / "report.pdf", "-"], capture_output=True, text=True
    ).stdout
    wanted = {
        "stability": ["=1+1", "<b>bold</b>", "#typst [x] *a*", "$x$ _y_", "@cmd|'"],
        "influence": ["=cmd, fixed"],
        "product": ["<i>7</i>", "PEC-PCD"],
        "parameters": ["K₁", "Recommendation"],
    }[result["kind"]]
    for name in wanted:
        assert name in text
    assert "Page 1 of" in text


@pytest.mark.slow
def test_foreign_folder_is_not_touched(tmp_path, product):
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match=r"mine\.txt"):
        camera_papers.write(product, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.slow
def test_a_failure_leaves_the_earlier_papers(folder):
    out, result = folder
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    with pytest.raises(ValueError, match="JSON compliant"):
        camera_papers.write(result | {"extra": float("nan")}, out)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert [path.name for path in out.parent.iterdir()] == [out.name]


@pytest.mark.slow
@pytest.mark.parametrize("result", [{}, [], {"format": "tankcal-camera/1", "kind": "weather"}])
def test_another_format_is_refused(result):
    with pytest.raises(InputError, match=r"camera\.json"):
        camera_papers.lines(result)


def test_lines_of_a_comparison(stability):
    lines = camera_papers.lines(stability)
    text = text_of(lines)
    known = load_words()["camera"]["conventions_of_comparison"]
    assert {convention["code"] for convention in stability["conventions"]} <= set(known)
    assert "resection of the second bundle" in text
    assert "seed" in text
    assert "1 of 15 pairs are similar" in text
    matrix = [line for line in lines if line.startswith(("2  <b>", "3  #typst"))]
    assert matrix[0].endswith(" 0.000 =")  # the first two sets are the same
    figures = {(p["a"], p["b"]): p["figure_px"] for p in stability["pairs"]}
    first, second = (figures[one, HOSTILE[2]] for one in HOSTILE[:2])
    scatter = {(p["a"], p["b"]): p["scatter_px"] for p in stability["pairs"]}
    shown = [min(decimals_of(scatter[one, HOSTILE[2]]), 3) for one in HOSTILE[:2]]
    expected = [fixed(one, places) for one, places in zip((first, second), shown, strict=True)]
    assert matrix[1].split()[-2:] == expected
    assert not any("\x1b" in line for line in lines)


def test_two_sets_need_no_matrix():
    found = compare(sets(("a", "b")), "zrot", grid=SMALL, as_published=True)
    lines = camera_papers.lines(stability_json.plain_stability(found))
    text = text_of(lines)
    assert "The two sets are similar" in text
    assert "rows: later set" not in text
    assert "mean length of the differences" in text
    assert "Pessoa (2017)" in text


def test_lines_of_parameters(parameters):
    lines = camera_papers.lines(parameters)
    text = text_of(lines)
    words = load_words()
    known = words["camera"]["reasons"]
    for advice in parameters["recommendation"]:
        beginning = f"- {words['parameters'][advice['name']]}: "
        line = next(line for line in lines if line.startswith(beginning))
        assert ("keep" if advice["keep"] else "may be dropped") in line
        assert {reason["code"] for reason in advice["reasons"]} <= set(known)
    assert "positive definite" in text
    assert "Silva (1995)" in text
    assert "Pessoa (2017)" in text
    for row in parameters["parameters"]:
        if row["sd"]:
            assert concise(row["value"], row["sd"]).replace("\N{NO-BREAK SPACE}", " ") in text


def test_disagreement_of_test_and_effect_is_said(parameters):
    reasons = [
        {"code": "not_significant", "F": 1.2, "critical": 2.7},
        {"code": "insignificant_but_large", "left_um": 8.0, "left_px": 6.0},
    ]
    told = [{"name": "K3", "keep": True, "reasons": reasons}]
    text = text_of(camera_papers.lines(parameters | {"recommendation": told}))
    assert "Test and effect disagree for K₃" in text
    assert "8.0 µm (6.0 px) remains at the corner" in text


def test_every_reason_is_a_sentence_without_a_volume(parameters):
    paper = CameraPaper(parameters)
    product = {"largest_sds": 0.1, "largest_mm": 0.2, "volume_change_m3": None, "volume_u_m3": None}
    text = paper.reason({"code": "product_moves", **product})
    assert "volume" not in text
    assert "0.20\N{NO-BREAK SPACE}mm" in text
    assert paper.reason({"code": "new_code", "of": ["K1"]}) == "new_code: of K₁"


def test_lines_of_influence(run):
    lines = camera_papers.lines(run)
    text = text_of(lines)
    assert any(line.startswith("reference") for line in lines)
    assert any(line.startswith("=cmd, fixed") and "adjusted" in line for line in lines)
    assert "no standard deviations for its weights" in text
    moved = run["runs"][1]["shifts"]["points"]["largest_xyz_mm"]
    assert f"{moved:.3f}" in text


@pytest.mark.slow
def test_lines_of_a_product(product):
    text = text_of(camera_papers.lines(product))
    best = next(one for one in product["best"] if (one["part"], one["scale"]) == ("plan", "1000"))
    assert f"plan 1:1000 {best['grade'] or 'none'} {best['grade_unbiased'] or 'none'}" in text
    assert "NOT compared with the original legal" in text
    assert product["axes"][0]["biased"] is True


def test_product_of_one_point_is_reported():
    found = check_product(np.array([[0.001, 0.002, 0.003]]), limits=shipped_limits())
    text = text_of(camera_papers.lines(product_json.plain_product(found)))
    assert "no test is possible" in text


def test_names_keep_their_beginning_and_end():
    assert shorten("n" * 24) == "n" * 24
    assert shorten("abc" + "n" * 60 + "xyz") == "abcnnnnnnnn…nnnnnnnnxyz"
    assert number_names(["1", "2"]) == (["1", "2"], ["1", "2"])
    assert number_names(["a", "longer name"]) == (["1  a", "2  longer name"], ["1", "2"])


@pytest.mark.parametrize(
    ("value", "sd", "expected"),
    [
        (4.3816, 0.001321, "4.3816(13)"),
        (-0.00174185, 6.792e-5, "−1.742(68) × 10⁻³"),
        (9.651101e-07, 1.018e-06, "1.0(1.0) × 10⁻⁶"),
        (12.3, 1.25, "12.3(1.3)"),
        (123.4, 12.0, "123(12)"),
        (5.0, None, "5.000000"),
        (0.0, 0.0, "0"),
    ],
)
def test_a_value_with_its_sd_in_brackets(value, sd, expected):
    assert concise(value, sd).replace("\N{NO-BREAK SPACE}", " ") == expected


@pytest.mark.parametrize(
    "convention", ["correction_added", "correction_subtracted", "distortion_of_ideal"]
)
def test_radial_curve_and_its_sd(convention):
    """Second method: images of ideal points; derivatives by differences of the curve itself."""
    form = Form(convention, "both_x", 1.0)
    ideal = np.linspace(0.1, 3.0, 30)
    radial = np.where(np.isin(np.arange(13), (0, 3, 4, 5, 6)), Q, 0.0)
    radius = distort_image_points(np.column_stack([ideal, 0 * ideal]), radial, form)[:, 0]
    covariance = np.diag(np.array([7e-5, 1e-5, 1e-6, 1e-8]) ** 2)
    covariance[0, 1] = covariance[1, 0] = -0.9 * 7e-5 * 1e-5
    curve, sd = radial_curve(radius, Q, form, covariance)
    assert curve == pytest.approx(radius - ideal, abs=1e-12)
    by_k = []
    for i in range(3, 7):
        step = np.zeros(13)
        step[i] = 1e-6 if i == 3 else 1e-8
        ends = [radial_curve(radius, Q + sign * step, form)[0] for sign in (1, -1)]
        by_k.append((ends[0] - ends[1]) / (2 * step[i]))
    expected = np.sqrt(np.einsum("in,ij,jn->n", by_k, covariance, by_k))
    assert sd == pytest.approx(expected, rel=1e-6)


def test_decentring_profile_is_the_largest_on_the_circle():
    """Second method: the distortion itself at many points of a circle."""
    only = np.where(np.isin(np.arange(13), (0, 7, 8)), Q, 0.0)
    turn = np.linspace(0, 2 * np.pi, 100_001)
    circle = 2.0 * np.column_stack([np.cos(turn), np.sin(turn)])
    shift = distort_image_points(circle, only, Form()) - circle
    radial = np.abs(np.sum(shift * circle, axis=1)).max() / 2.0
    assert decentring_profile([2.0], Q)[0] == pytest.approx(radial / 3, rel=1e-8)
