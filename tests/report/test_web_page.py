"""The page of the report in a headless Chromium whose network is refused: what a reader sees.

Each test has a page of its own in one browser; without Chromium they skip.
"""

import copy
import json
from pathlib import Path

import numpy as np
import pytest
from browser import Browser
from paper_cells import paper_blocks
from uncertain_job import write_uncertain_record

from tankcal.record.covariance_factor import factor_of, wrap_factor
from tankcal.report.web import page
from tankcal.text import digits
from tankcal.text.digits import (
    ENGLISH,
    ENGLISH_SI,
    PORTUGUESE,
    decimals_of,
    decimals_of_rows,
    fixed,
)
from tankcal.text.words import load_words

pytestmark = pytest.mark.slow

NUMBERS = Path(digits.__file__).parents[2] / "report_templates" / "web" / "numbers.js"
HOSTILE = "</script><script>hit=1</script>\"'><img src=x onerror=hit=1>\u2028<!--"
HUES = 100  # how far apart red and blue are of a pixel that is plainly of one of them


@pytest.fixture(scope="module")
def browser():
    with Browser() as found:
        yield found


@pytest.fixture(scope="module")
def record(example_record):
    return json.loads(example_record.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def report(example_record, tmp_path_factory):
    """The page of the example's record."""
    return written(paper_blocks(example_record), tmp_path_factory.mktemp("page"))


def written(found, folder):
    path = folder / "report.html"
    path.write_text(page(found), encoding="utf-8")
    return path


def words_with(marks):
    found = copy.deepcopy(load_words("en"))
    found["language"]["marks"] = {
        key: getattr(marks, key) for key in ("decimal", "group", "least", "of_decimals", "minus")
    }
    return found


def expected_volume(capacity, row, marks=ENGLISH):
    """The sentence of a row of the table, from the record."""
    decimals = decimals_of_rows(capacity["stated_U_m3"])[row]
    volume = fixed(capacity["volume_m3"][row], max(decimals, 3), marks)
    U = fixed(capacity["stated_U_m3"][row], decimals, marks)
    simulated = capacity["interval"][row] == "monte_carlo"
    k = "Monte Carlo" if simulated else f"k = {fixed(capacity['k'][row], 2, marks)}"
    return f"V = {volume} m³ with U = {U} m³ ({k}, 95 %)"


def test_page_makes_no_network_request(browser, report):
    browser.open(report)
    browser.type("#dip", "2.5")
    assert browser.requests == []
    assert browser.complaints == []


def test_a_dip_typed_gives_the_volume_of_the_record(browser, report, record):
    browser.open(report)
    capacity = record["capacity"]
    for row in [0, 1, 2, *range(3, 950, 61), 949, 950]:
        typed = fixed(capacity["height_m"][row], 5, digits.PROGRAM)
        for text in (typed, typed.replace(".", ","), f" {typed} "):
            browser.type("#dip", text)
            assert browser.text("#volume") == expected_volume(capacity, row)


def test_web_interpolation_is_linear_with_larger_U(browser, report, record):
    browser.open(report)
    capacity = record["capacity"]
    browser.type("#dip", "4.2375")
    volume = 0.25 * capacity["volume_m3"][423] + 0.75 * capacity["volume_m3"][424]
    U = max(capacity["stated_U_m3"][423:425])
    text = f"V = {fixed(volume, 3)} m³ with U = {fixed(U, decimals_of(U))} m³ (k = 1.96, 95 %)"
    assert browser.text("#volume") == text
    assert "4.230 m, 4.240 m" in browser.text("#volume-more")
    assert fixed(9.8 - 4.2375, 4) in browser.text("#volume-more")  # the ullage


def test_the_top_as_it_is_printed_is_the_top(browser, report, record):
    browser.open(report)
    for typed in ("9.5", "9,500", "9.50"):  # the shell leans: 9.49996 m
        browser.type("#dip", typed)
        assert browser.text("#volume") == expected_volume(record["capacity"], 950)
    browser.type("#dip", "9.5001")
    assert browser.text("#volume").startswith("Refused: above the table")


@pytest.mark.parametrize(
    ("typed", "answer"),
    [
        ("9.51", "Refused: above the table, which ends at 9.500 m."),
        ("-0.01", "Refused: below the table, which begins at 0.000 m."),
        ("4.2.1", "Refused: “4.2.1” is not a number of metres"),
        ("1e1", "Refused: “1e1” is not a number of metres"),
        ("<b>4", "Refused: “<b>4” is not a number of metres"),
        ("", "Type a dip in metres."),
    ],
)
def test_dip_outside_the_table_is_refused(browser, report, typed, answer):
    browser.open(report)
    browser.type("#dip", typed)
    assert browser.text("#volume").startswith(answer)
    assert browser.text("#volume-more") == ""


PAIRS = [(0.5, 8.0), (2.0, 2.01), (3.333, 7.777), (0.0, 9.49996), (4.0, 4.05), (1.895, 1.905)]


def test_a_delivery_has_its_own_uncertainty(browser, report, example_result):
    """Second method: `Capacity.delivery`, from the whole factor."""
    browser.open(report)
    for low, high in PAIRS:
        table, high_m = example_result.table, min(high, example_result.table.height_m[-1])
        # Emptying the tank is the volume at the upper dip.
        found = table.delivery(low, high_m) if low > 0 else table.at(high_m)
        decimals = decimals_of(found.U_m3)
        browser.type("#dip", f"{low}")
        browser.type("#other_dip", f"{high}".replace(".", ","))
        assert browser.text("#delivery") == (
            f"V = {fixed(found.value_m3, max(decimals, 3))} m³ with U = "
            f"{fixed(found.U_m3, decimals)} m³ (k = {fixed(found.k, 2)}, 95 %)"
        )
    browser.type("#other_dip", "1.895")
    assert browser.text("#delivery") == "Refused: both dips are equal."
    browser.type("#other_dip", "12")
    assert browser.text("#delivery").startswith("Refused: above the table")


def test_deliveries_of_few_degrees_of_freedom(browser, tmp_path):
    """k of Student's t between rows, and a stated delivery with the U that is stated."""
    path = write_uncertain_record(tmp_path)
    record = json.loads(path.read_text(encoding="utf-8"))
    browser.open(written(paper_blocks(path), tmp_path))
    seen = set()
    for one in [found["absolute"] for found in record["deliveries"]] + record["budgets"]:
        if one["low_m"] is None:
            continue
        browser.type("#dip", repr(one["low_m"]))
        browser.type("#other_dip", repr(one["high_m"]))
        answer = browser.text("#delivery")
        assert answer.startswith(f"V = {fixed(one['volume_m3'], 3)} m³")
        stated = "as stated in the certificate" in browser.text("#delivery-more")
        seen.add(stated)
        if one["low_m"] == 0 and not stated:  # emptied: the larger U, of the volume or between dips
            capacity = record["capacity"]
            U = dict(zip(capacity["height_m"], capacity["stated_U_m3"], strict=True))
            larger = max(U[one["high_m"]], one["U_m3"])
            assert f"U = {fixed(larger, decimals_of(larger))} m³" in answer
        elif not stated:
            assert f"(k = {fixed(one['k'], 2)}," in answer
            assert fixed(one["U_m3"], decimals_of(one["U_m3"])) in answer
    assert True in seen


def test_the_critical_zone_of_a_roof_is_refused(browser, example_record, record, tmp_path):
    roof = [
        {"code": "roof_critical_bottom", "value": 1.0, "unit": "m"},
        {"code": "roof_critical_top", "value": 1.6, "unit": "m"},
        {"code": "roof_mass", "value": 42_000.0, "unit": "kg"},
        {"code": "roof_reference_density", "value": 850.0, "unit": "kg/m3"},
        {"code": "roof_weighing", "value": "air", "unit": None},
    ]
    path = tmp_path / "record.json"
    path.write_text(json.dumps({**record, "roof": roof}), encoding="utf-8")
    browser.open(written(paper_blocks(path), tmp_path))
    browser.type("#dip", "1.3")
    assert browser.text("#volume").startswith("Refused: in the critical zone")
    browser.type("#dip", "1.0")
    assert browser.text("#volume") == expected_volume(record["capacity"], 100)


def test_numbers_are_in_the_marks_of_the_language(browser, example_record, record, tmp_path):
    words = words_with(PORTUGUESE)
    with pytest.MonkeyPatch.context() as patch:
        for module in ("tankcal.report.paper", "tankcal.report.web"):
            patch.setattr(f"{module}.load_words", lambda language: words)
        browser.open(written(paper_blocks(example_record), tmp_path))
    browser.type("#dip", "9.41")
    assert browser.text("#volume") == expected_volume(record["capacity"], 941, PORTUGUESE)
    assert "1.237," in browser.text("#volume")
    browser.type(".finder input", "9.41")
    assert browser.text(".finder output").startswith("1 of 951 rows")


CASES = [
    (value, decimals)
    for value in (0.0, 2.675, 1.005, 0.5, 1.5, 999.9995, 1234567.0625, -0.0004, -1250.5, 1e-7, 0.05)
    for decimals in range(7)
]


@pytest.mark.parametrize("marks", [ENGLISH, ENGLISH_SI, PORTUGUESE])
def test_the_digits_are_those_of_every_paper(browser, tmp_path, marks):
    """Second method: the script's numbers against `tankcal.text.digits`."""
    rng = np.random.default_rng(7)
    cases = CASES + [
        (float(f"{value:.4f}5"), int(decimals))
        for value, decimals in zip(rng.normal(0, 1e4, 300), rng.integers(0, 7, 300), strict=True)
    ]
    spread = [10.0**power * digit for power in range(-5, 4) for digit in (1, 1.05, 9.94, 9.96)]
    spoken = {"words": {}, "marks": words_with(marks)["language"]["marks"]}
    path = tmp_path / "numbers.html"
    script = NUMBERS.read_text(encoding="utf-8")
    path.write_text(
        f'<meta charset="utf-8"><script type="application/json" id="words">{json.dumps(spoken)}'
        f"</script><script>{script}</script>",
        encoding="utf-8",
    )
    browser.open(path)
    found = browser.run(f"{json.dumps(cases)}.map(([value, places]) => fixed(value, places))")
    assert found == [fixed(value, places, marks) for value, places in cases]
    assert browser.run(f"{json.dumps(spread)}.map(decimalsOf)") == [decimals_of(u) for u in spread]


def test_rows_are_found_by_dip_or_number(browser, report, record):
    capacity = record["capacity"]
    browser.open(report)
    visible = "[...document.querySelectorAll('.pieces tbody tr')].filter(row => !row.hidden)"
    texts = f"{visible}.map(row => row.cells[0].textContent.trim())"
    browser.type(".finder input", "4,2")
    assert browser.run(texts) == [f"4.2{n}0" for n in range(10)]
    browser.type(".finder input", "4.235")  # between two rows
    assert browser.run(texts) == ["4.230", "4.240"]
    row = capacity["height_m"].index(4.75)
    browser.type(".finder input", f"{capacity['volume_m3'][row]:.3f}")
    assert browser.run(texts) == ["4.750"]
    browser.type(".finder input", "north")
    assert browser.text(".finder output") == "No row contains north."
    browser.type(".finder input", "8.88")
    browser.press("Enter", 13)
    assert browser.run(f"{visible}.length") == 951
    box = "document.querySelector('.found').getBoundingClientRect()"
    assert 0 < browser.run(f"{box}.top") < 900
    assert browser.text(".found").startswith("8.880")


def coloured(pixels):
    """Numbers of plainly red and of plainly blue pixels."""
    warmth = pixels[..., 0] - pixels[..., 2]
    return int(np.sum(warmth > HUES)), int(np.sum(warmth < -HUES))


def width_of_the_rim(pixels):
    """Columns that the upper part of the tank covers, on white."""
    upper = pixels[: len(pixels) // 3]
    return int(np.ptp(np.flatnonzero((upper < 250).any(axis=(0, 2)))))


def test_the_tank_is_drawn_turned_and_its_deviations_enlarged(browser, report):
    browser.open(report)
    first = browser.picture("canvas")
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 1000
    assert min(coloured(first)) > 500
    browser.run("document.querySelector('canvas').focus()")
    browser.press("ArrowRight", 39)
    turned = browser.picture("canvas")
    assert np.mean(np.abs(turned - first)) > 1
    browser.press("Home", 36)
    assert np.mean(np.abs(browser.picture("canvas") - first)) < 0.1
    slider = "document.querySelector('#exaggeration')"
    browser.run(f"{slider}.value = 0; {slider}.dispatchEvent(new Event('input'))")
    browser.drawn()
    assert browser.text("#factor") == "× 1"
    plain = browser.picture("canvas")
    assert np.mean(np.abs(plain - first)) > 1
    assert abs(width_of_the_rim(first) - width_of_the_rim(plain)) > 5


def test_legend_shows_largest_deviation(browser, report, record):
    browser.open(report)
    largest = max(
        abs(radius - section["radius_m"])
        for section in record["sections"]
        for radius in section["outline"]["radius_m"]
    )
    assert browser.text("#most") == f"+{fixed(1000 * largest, 0)} mm"
    choice = "document.querySelector('#deviations')"
    browser.run(f"{choice}.value = 'cylinder'; {choice}.dispatchEvent(new Event('input'))")
    assert float(browser.text("#most")[1:-3]) > 1000 * largest  # the tilt is among them


def test_points_are_labelled(browser, report):
    browser.open(report)
    browser.run("document.querySelector('#show-names').click()")
    browser.drawn()
    shown = "[...document.querySelectorAll('.marks span')].filter(one => !one.hidden)"
    assert browser.run(f"{shown}.length") == 119 + 4


def test_page_without_webgl_has_a_note(report):
    with Browser("--disable-3d-apis") as browser:
        browser.open(report)
        assert "does not support three-dimensional pictures" in browser.text("#view")
        assert browser.run("document.querySelector('canvas').offsetHeight") == 0
        assert browser.text("#volume").startswith("V = ")


def brightness(browser):
    return float(np.mean(browser.picture()))


@pytest.mark.study
def test_light_and_dark(browser, report):
    browser.open(report)
    light = brightness(browser)
    browser.run("document.querySelector('#look').click()")
    browser.drawn()
    dark = brightness(browser)
    assert light > 200
    assert dark < 60
    figure = browser.picture("figure img")
    assert np.mean(figure) < 80
    assert np.mean(figure > 140) > 0.01  # its lines and words are light
    browser.ask("Emulation.setEmulatedMedia", features=[
        {"name": "prefers-color-scheme", "value": "dark"}])  # fmt: skip
    browser.open(report)
    assert brightness(browser) == pytest.approx(dark, abs=5)
    browser.run("document.querySelector('#look').click()")
    browser.drawn()
    assert brightness(browser) == pytest.approx(light, abs=5)
    browser.ask("Emulation.setEmulatedMedia", features=[])


def test_on_paper_there_are_all_rows_and_no_widgets(browser, report):
    browser.open(report)
    browser.run("document.querySelector('#look').click()")
    browser.type(".finder input", "4.2")
    browser.ask("Emulation.setEmulatedMedia", media="print")
    browser.drawn()
    rows = "[...document.querySelectorAll('.pieces tbody tr')].filter(row => row.offsetHeight)"
    assert browser.run(f"{rows}.length") == 951
    for selector in (".bar", ".contents", "#calculator", "#view", ".finder"):
        assert browser.run(f"document.querySelector('{selector}').offsetHeight") == 0
    assert brightness(browser) > 200
    browser.ask("Emulation.setEmulatedMedia", media="")


def test_a_phone_shows_the_page_without_sliding_sideways(browser, report):
    size = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
    browser.ask("Emulation.setDeviceMetricsOverride", **size)
    browser.open(report)
    assert browser.run("document.documentElement.scrollWidth") == 390
    assert not browser.run("document.querySelector('.contents details').open")
    browser.ask("Emulation.clearDeviceMetricsOverride")


def test_text_of_a_user_never_runs(browser, record, tmp_path):
    hostile = copy.deepcopy(record)
    hostile["job"]["tank"]["id"] = HOSTILE
    hostile["job"]["tank"]["details"]["owner"] = HOSTILE
    hostile["job"]["certificate"] |= {"customer": HOSTILE, "notice": HOSTILE}
    names = {name: f"{HOSTILE}{name}" for s in record["sections"] for name in s["points"]}
    for section in hostile["sections"]:
        section["points"] = [names[name] for name in section["points"]]
    for point in hostile["points"]:
        point["point"] = names.get(point["point"], point["point"])
    path = tmp_path / "record.json"
    path.write_text(json.dumps(hostile), encoding="utf-8")
    browser.open(written(paper_blocks(path), tmp_path))
    browser.run("document.querySelector('#show-names').click()")
    browser.drawn()
    assert browser.run("typeof hit") == "undefined"
    assert browser.complaints == []
    assert browser.requests == []
    assert browser.text("#volume").startswith("V = ")
    assert "<script>hit=1</script>" in browser.text("h1 ~ *, main")


def test_an_injected_script_is_refused_by_the_policy(browser, report, tmp_path):
    """What would happen if a text were not escaped after all."""
    text = report.read_text(encoding="utf-8")
    path = tmp_path / "injected.html"
    path.write_text(text.replace("<main ", "<script>hit=1</script><main ", 1), encoding="utf-8")
    browser.open(path)
    assert browser.run("typeof hit") == "undefined"
    assert "Content Security Policy" in str(browser.complaints)


@pytest.mark.study
def test_a_long_table_is_quick(browser, record, tmp_path, figure):
    """20 001 rows: what the main thread does until the page stands, and to find a row."""
    long = lengthened(record, 20)
    path = tmp_path / "record.json"
    path.write_text(json.dumps(long), encoding="utf-8")
    blocks = [block for block in paper_blocks(path) if block["kind"] != "figure"]
    report = written(blocks, tmp_path)
    browser.ask("Performance.enable", timeDomain="threadTicks")
    browser.open(report)
    metrics = browser.ask("Performance.getMetrics")["metrics"]
    (busy_s,) = (one["value"] for one in metrics if one["name"] == "TaskDuration")
    assert len(long["capacity"]["height_m"]) > 19000
    assert busy_s < 20  # measured: 0.7; row by row it would be minutes
    script = (
        "(() => { const field = [...document.querySelectorAll('.finder input')].pop();"
        "const start = performance.now(); field.value = '4.2345';"
        "field.dispatchEvent(new Event('input')); return performance.now() - start; })()"
    )
    assert browser.run(script) < 10_000
    figure("page of a long table, MB", f"{report.stat().st_size / 1e6:.2f}")
    figure("its main thread until it stands, s", f"{busy_s:.2f}")


def lengthened(record, times):
    """A record whose table has that many rows in place of each: straight between the old ones."""
    found = copy.deepcopy(record)
    capacity = found["capacity"]
    count = len(capacity["height_m"])
    places = np.arange((count - 1) * times + 1) / times
    nearest = places.astype(int).tolist()
    for key, values in capacity.items():
        if not isinstance(values, list) or len(values) != count:
            continue
        if key in ("height_m", "volume_m3"):
            capacity[key] = np.interp(places, np.arange(count), values).round(6).tolist()
        else:
            capacity[key] = [values[row] for row in nearest]
    capacity["dip"] = [fixed(height, 4, digits.PROGRAM) for height in capacity["height_m"]]
    whole = {"factor_m3": factor_of(record["capacity"])[nearest].tolist()}
    capacity["factor"] = wrap_factor(whole)["factor"]
    return found | {"monte_carlo": None, "densities": []}
