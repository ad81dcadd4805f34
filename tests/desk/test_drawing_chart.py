"""Chart from the sizes of a drawing, and budgets of a record with factors of u."""

import math
from pathlib import Path

import numpy as np
import pytest

from tankcal.products.desk.drawing_chart import (
    Drawing,
    chart_rows,
    describe_chart,
    read_drawing,
    write_drawing_chart,
)

LYING = Drawing(diameter_m=2.5, length_m=6.0)


def segment_m3(radius, length, depth):
    """Volume in a level lying cylinder with flat ends."""
    depth = np.clip(depth, 0, 2 * radius)
    angle = np.arccos((radius - depth) / radius)
    return length * (radius**2 * angle - (radius - depth) * np.sqrt(depth * (2 * radius - depth)))


def test_volumes_agree_with_closed_forms():
    cm, volumes, _ = np.array(chart_rows(LYING)).T
    assert volumes == pytest.approx(segment_m3(1.25, 6.0, cm / 100), abs=1e-9)
    ends = Drawing(diameter_m=2.5, length_m=6.0, end="ellipsoidal", depth_m=0.5)
    capacity = math.pi / 4 * 2.5**2 * 6.0 + 4 / 3 * math.pi * 1.25**2 * 0.5
    assert chart_rows(ends)[-1][1] == pytest.approx(capacity, rel=1e-9)
    upright = Drawing(kind="vertical", diameter_m=3.0, length_m=4.0)
    assert [row[1] for row in chart_rows(upright)][::100] == pytest.approx(
        [math.pi / 4 * 9.0 * height for height in range(5)], rel=1e-12
    )


def test_a_tilted_tank_agrees_with_a_sum_of_slices():
    tilted = Drawing(diameter_m=2.5, length_m=6.0, tilt_mm_m=20.0, dip_m=0.5)
    s = (np.arange(20_000) + 0.5) * 6.0 / 20_000
    for dip in (0.0, 0.05, 1.0, 2.45):
        # End B is higher: the liquid is deeper towards A, by the tilt along the axis.
        depth = dip * math.hypot(1, 0.02) + (0.5 - s) * 0.02
        volume = segment_m3(1.25, 1.0, depth).mean() * 6.0
        assert tilted.volumes_m3([dip])[0] == pytest.approx(volume, rel=2e-4)


def test_U_covers_the_volumes_of_possible_tanks():
    """Level tanks with sizes drawn within their accuracy, by the closed form; U covers 95 %."""
    draws = np.random.default_rng(47).uniform(-0.01, 0.01, (20_000, 2)) + 1
    level = Drawing(diameter_m=2.5, length_m=6.0, tilt_accuracy_mm_m=0.0, step_cm=10)
    for cm, volume, U in chart_rows(level)[1:-1]:
        volumes = segment_m3(1.25 * draws[:, 0], 6.0 * draws[:, 1], cm / 100)
        share = np.mean(np.abs(volumes - volume) <= U)
        # The largest sizes are never reached together, so that k = 2 covers 95 % or more.
        assert 0.95 <= share <= 1.0, cm
        assert volumes.std() == pytest.approx(U / 2, rel=0.05), cm


def test_texts_of_the_form_are_read_or_refused():
    texts = {"kind": "horizontal", "diameter_m": "2,5", "length_m": "6", "step_cm": "5"}
    drawing, problems = read_drawing(texts)
    assert (drawing.diameter_m, drawing.step_cm, problems) == (2.5, 5, [])
    for name, text in {
        "diameter_m": "abc", "length_m": "", "tilt_mm_m": "99", "kind": "sphere", "step_cm": "3",
        "dip_m": "7", "end": "round", "accuracy_percent": "nan",
    }.items():  # fmt: skip
        assert read_drawing(texts | {name: text}) == (None, [name])
    tall = {"kind": "vertical", "diameter_m": "2", "length_m": "12", "step_cm": "1"}
    assert read_drawing(tall) == (None, ["step_cm"])


@pytest.mark.slow
@pytest.mark.parametrize("language", ["en", pytest.param("pt-BR", marks=pytest.mark.slow),
                                      pytest.param("es", marks=pytest.mark.slow)])  # fmt: skip
def test_the_chart_is_marked_as_no_calibration(language):
    import datetime
    import io

    import pypdf

    from tankcal.text.words import load_words

    words = load_words(language)["app"]["drawing"]
    content = write_drawing_chart(LYING, "P-1", language, datetime.date(2026, 11, 30))
    text = " ".join(page.extract_text() for page in pypdf.PdfReader(io.BytesIO(content)).pages)
    assert words["no_calibration"].split(":")[0] in " ".join(text.split())
    facts, rows = describe_chart(LYING, language)
    assert len(rows) == 251
    assert facts[0][1].replace(".", "").replace(",", "").replace("\N{NARROW NO-BREAK SPACE}", "") \
        == f"{round(1000 * math.pi / 4 * 2.5**2 * 6)} L"  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", ["silva-1995", "sphere-straps", "total-station", "liquid-lying"])
def test_a_recorded_budget_gives_the_U_of_the_result(tmp_path, name):
    """Factors on the lines of a record, compared with the sources of the result itself."""
    import tankcal
    from tankcal.products.desk.calculators import change_recorded_budget, list_recorded_budgets
    from tankcal.report import outputs
    from tankcal.report.paper import Paper

    result = tankcal.run(tankcal.load(Path(__file__).parents[2] / "examples" / name))
    outputs.write(result, tmp_path / "results", papers=False)
    paper = Paper(tmp_path / "results" / "record.json", language="en")
    random, numbers = np.random.default_rng(5), [item for item, _ in list_recorded_budgets(paper)]
    assert numbers
    for number in numbers:
        count = len(change_recorded_budget(paper, number).lines)
        factors = random.choice([0.0, 0.5, 1.0, 2.0], count)
        changed = change_recorded_budget(paper, number, dict(enumerate(factors)))
        high_m = low_m = None
        if number:
            stated = paper.record["budgets"][number - 1]
            high_m, low_m = stated["high_m"], stated["low_m"]
        expected = result.budget(high_m, low_m, reading=bool(number), factors=factors)
        assert changed.then.U_m3 == pytest.approx(expected.U_m3, rel=1e-4)
        assert [line["share"] for line in changed.lines] == pytest.approx(
            [line.share for line in expected.lines], abs=1e-6
        )
