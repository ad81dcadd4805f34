"""The app as a person uses it, in a headless Chromium: edit, import, compute, read; accessibility.

axe.min.js beside this file is axe-core 4.14.1 (Deque Systems, MPL-2.0), test data only.
"""

import json
import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from background import heed_ctrl_c
from browser import THIS_MACHINE, Browser
from job_builder import write_job

from tankcal.cli import main
from tankcal.text.words import load_words

pytestmark = pytest.mark.slow
SLOW_S = 180  # a loaded machine computes a job and its papers within
AXE = Path(__file__).with_name("axe.min.js")
CONTROL = 2  # modifier of a key


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A small job of a Brazilian: comma and semicolon in the files, Portuguese in the papers."""
    folder = write_job(tmp_path_factory.mktemp("job") / "T-1", rings=2)
    settings = (folder / "job.toml").read_text()
    settings = settings.replace("step_m = 0.01", 'step_m = 0.1 # coarse\nlanguage = "pt-BR"')
    (folder / "job.toml").write_text(settings + '\n[csv]\nseparator = ";"\ndecimal = ","\n')
    for path in folder.glob("*.csv"):
        path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    return folder


def start(folder, state):
    """Start an app with this job; return its process and its address."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "LANG": "C", "TANKCAL_STATE": str(state)}
    command = [sys.executable, "-m", "tankcal", "app", str(folder), "--no-browser"]
    command += ["--workspace", str(state / "workspace"), "--language", "pt-BR"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment,
        start_new_session=True, preexec_fn=heed_ctrl_c,
    )  # fmt: skip
    line = process.stdout.readline()
    found = re.search(r"http://127\.0\.0\.1:\d+/\S*", line)
    assert found, line + process.stdout.read()
    return process, found.group()


@contextmanager
def ended(process):
    """End an app by Ctrl-C."""
    try:
        yield
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
    finally:
        if process.poll() is None:
            process.kill()
            process.wait(20)


@pytest.fixture(scope="module")
def address(folder, tmp_path_factory):
    """Address of an app with this job; it must end on Ctrl-C."""
    process, address = start(folder, tmp_path_factory.mktemp("state"))
    with ended(process):
        yield address


@pytest.fixture
def browser(address):
    """A browser with the first page of the job; at its end no error and no foreign request."""
    requests, thrown = [], []
    with Browser(THIS_MACHINE) as browser:
        visit = browser.visit

        def collect():
            requests.extend(browser.requests)
            thrown.extend(one for one in browser.complaints if "/nothing" not in str(one))

        def visit_and_collect(url):
            collect()
            visit(url)

        browser.visit = visit_and_collect
        browser.visit(address)
        browser.wait_for("document.querySelector('[data-section]')", SLOW_S)
        browser.wait_for("document.querySelector('#saved').textContent")
        yield browser
        collect()
    foreign = [one for one in requests if "127.0.0.1" not in one and not one.startswith("data:")]
    assert foreign == []
    assert thrown == []


def follow(browser, selector):
    """Click a link or button that leads to another page."""
    element = f"document.querySelector({json.dumps(selector)})"
    browser.run(f"window.tankcalLeft = true; setTimeout(() => {element}.click(), 20); 1")
    browser.wait_for("!window.tankcalLeft && document.readyState === 'complete'", SLOW_S)


def press_with_control(browser, key, code):
    browser.ask("Input.dispatchKeyEvent", type="keyDown", key=key, windowsVirtualKeyCode=code,
                modifiers=CONTROL)  # fmt: skip


def cell(row, column):
    return f'[data-table] td[data-row="{row}"][data-column={column}]'


def reason(place):
    return f"document.querySelector('{place}').title"


def saved(browser):
    browser.wait_for("document.querySelector('#saved').textContent === 'Salvo'")


def test_edits_are_checked_saved_and_computed(browser, folder):
    before = {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}
    follow(browser, 'nav a[href$="table/courses"]')
    height = cell(1, "height_m")
    browser.wait_for(f"document.querySelector('{height}')", SLOW_S)
    assert "Anéis" in browser.text("h1")

    # a bad value: the cell, the line below the grid and the list state the reason
    browser.click(height)
    browser.write("1x9")
    browser.press("Enter", 13)
    assert "esperado um número" in browser.wait_for(reason(height))
    assert browser.run(f"document.querySelector('{height}').ariaInvalid") == "true"
    browser.wait_for("document.querySelector('#count').textContent.includes('Problemas: 1')")
    follow(browser, "#count")
    assert "Anéis, linha 2, Altura: " in browser.text(".findings")
    follow(browser, ".findings a")
    browser.wait_for(f"document.querySelector('{height}.tankcal-active')")

    # mended by keyboard alone: F8 finds the cell, then Tab and the arrows
    browser.press("Home", 36)
    browser.press("F8", 119)
    browser.wait_for(f"document.querySelector('{height}.tankcal-active')")
    # An answer of the server, or scrolling, draws the rows anew while a cell is typed.
    browser.write("1,")
    browser.run("document.querySelector('[role=grid]').dispatchEvent(new Event('scroll')); 1")
    browser.write("8")
    browser.press("Tab", 9)
    browser.wait_for(f"{reason(height)} === ''")
    browser.press("ArrowLeft", 37)
    browser.press("ArrowDown", 40)
    browser.write("2,0")
    browser.press("Enter", 13)
    saved(browser)
    lines = before["courses.csv"].splitlines()
    lines[2] = lines[2].replace("1,9", "1,8", 1)
    lines[3] = lines[3].replace("1,9", "2,0", 1)
    assert (folder / "courses.csv").read_text().splitlines() == lines

    # Undo and Redo by keyboard
    press_with_control(browser, "z", 90)
    browser.wait_for(f"document.querySelector('{cell(2, 'height_m')}').innerText === '1,9'")
    press_with_control(browser, "y", 89)
    browser.wait_for(f"document.querySelector('{cell(2, 'height_m')}').innerText === '2,0'")
    saved(browser)

    # a block of a spreadsheet below the last row
    follow(browser, 'nav a[href$="table/points"]')
    browser.wait_for(f"document.querySelector('{cell(0, 'x_m')}')", SLOW_S)
    count = len(before["points.csv"].split()) - 1
    browser.click('[data-act="add_row"]')
    browser.wait_for(f"document.querySelector('[role=grid]').ariaRowCount === '{count + 2}'")
    browser.press("End", 35)
    press_with_control(browser, "ArrowDown", 40)
    browser.press("Home", 36)
    browser.paste("[role=grid]", "N1\t6,5\t0,0\t0,95\r\nN2\t0,0\t6,5\t0,95\r\n")
    browser.wait_for(f"document.querySelector('{cell(count + 1, 'point')}').innerText === 'N2'")
    saved(browser)
    text = (folder / "points.csv").read_text()
    assert text.startswith(before["points.csv"])
    assert text.splitlines()[-1].startswith("N2;0,0;6,5;0,95")

    # computed by a key from there, with progress, and the results are those of the files
    press_with_control(browser, "Enter", 13)
    browser.wait_for("document.querySelector('#start')", SLOW_S)
    follow(browser, "#start button")
    browser.wait_for("document.querySelector('.headline')", SLOW_S)
    assert re.search(r"Capacidade de [\d.,]+ m³ até [\d,]+ m; U = ", browser.text(".headline"))
    assert (folder / "results" / "certificate.pdf").exists()
    record = json.loads((folder / "results" / "record.json").read_text())
    assert [one["height_m"] for one in record["job"]["courses"]][:3] == [1.9, 1.8, 2.0]
    kind = browser.run(
        "fetch(document.querySelector('a[href*=\"certificate.pdf?store\"]').href)"
        ".then(answer => answer.headers.get('content-disposition'))"
    )
    assert "attachment" in kind
    table = browser.run(
        "fetch(document.querySelector('iframe.paper').src).then(answer => answer.headers"
        ".get('content-security-policy'))"
    )
    assert table.startswith("sandbox allow-scripts;")


def test_a_run_is_stopped_and_leaves_earlier_results(browser, folder, address):
    record = folder / "results" / "record.json"
    if not record.is_file():  # the test that computes it was left out
        assert main(["run", str(folder), "--no-papers", "--quiet"]) == 0
    follow(browser, 'nav a[href$="results"]')
    earlier = record.read_bytes()
    follow(browser, "#start button")
    browser.wait_for("document.querySelector('#step').textContent", SLOW_S)
    follow(browser, "#progress button")
    stopped = load_words("pt-BR")["app"]["stopped"]
    browser.wait_for(f"document.querySelector('#run').innerText.includes({stopped!r})")
    assert record.read_bytes() == earlier


def test_two_windows_show_the_same_job(browser, folder, address):
    with Browser(THIS_MACHINE) as other:
        other.visit(address)
        other.wait_for("document.querySelector('#saved').textContent", SLOW_S)
        field = "document.getElementById('f-certificate.number')"
        for window in (browser, other):
            window.run(f"{field}.closest('details').open = true")
        browser.type('[id="f-certificate.number"]', "2026/118")
        browser.press("Tab", 9)
        other.wait_for(f"{field}.value === '2026/118'")
    saved(browser)
    assert 'number = "2026/118"' in (folder / "job.toml").read_text()


def test_entries_wait_for_a_server_that_was_stopped(tmp_path):
    words, folder = load_words("pt-BR")["app"], write_job(tmp_path / "T-2", rings=2)
    bar = "document.querySelector('#bar').innerText"
    path, [first, second] = folder / "courses.csv", [cell(row, "height_m") for row in (0, 1)]
    with Browser(THIS_MACHINE) as browser:
        process, address = start(folder, tmp_path / "state")
        with ended(process):
            browser.visit(address)
            browser.wait_for("document.querySelector('#saved').textContent", SLOW_S)
            follow(browser, 'nav a[href$="table/courses"]')
            browser.wait_for(f"document.querySelector('{first}')", SLOW_S)
            browser.click(first)
            browser.write("1,7")
            browser.press("Enter", 13)
            browser.wait_for("document.querySelector('#count').textContent")
        # Stopped within the pause before saving: the entry is saved at the end.
        assert "1.7" in path.read_text().splitlines()[1]
        assert browser.wait_for(bar) == words["offline"]
        browser.click(second)
        browser.write("1,8")
        browser.press("Enter", 13)
        assert browser.text(second) == "1,8"
        before = path.read_text()
        process, again = start(folder, tmp_path / "state")
        with ended(process):
            assert again.split("?")[0] == address.split("?")[0]
            assert again != address
            # The page of the stopped server has no access until the new address was opened.
            browser.wait_for(f"{bar} === {words['restarted']!r}", SLOW_S)
            assert path.read_text() == before
            browser.ask("Target.createTarget", url=again)
            browser.wait_for(f"{bar} === ''", SLOW_S)
            browser.wait_for("document.querySelector('#saved').textContent === 'Salvo'", SLOW_S)
            lines = path.read_text().splitlines()
            assert [line.split(",")[1] for line in lines[1:3]] == ["1.7", "1.8"]
            assert [browser.text(place) for place in (first, second)] == ["1,7", "1,8"]


def test_a_file_becomes_the_points_of_a_new_tank(browser, address):
    root = address.split("/job/")[0]
    browser.visit(f"{root}/")
    browser.wait_for("document.querySelector('#recent-jobs')", SLOW_S)
    text = "Ponto;Este (mm);Norte;Cota\n" + "".join(
        f"P{i};{6500 + i},5;{i},25;1{i % 9},95\n" for i in range(30)
    )
    browser.run(
        "window.tankcalLeft = true; (() => { const input = document.querySelector('[type=file]');"
        "const data = new DataTransfer(); data.items.add(new File("
        f"[{json.dumps(text)}], 'caderneta.csv')); input.files = data.files;"
        "input.dispatchEvent(new Event('change')); })(); 1"
    )
    browser.wait_for("!window.tankcalLeft && document.querySelector('a[href*=\"/new?\"]')", SLOW_S)
    follow(browser, 'a[href*="/new?"]')
    browser.type("[name=tank]", "TQ 23")
    follow(browser, "main button.primary")
    assert "caderneta.csv" in browser.text("h1")
    # another choice of a column proposes again
    browser.run(
        "window.tankcalLeft = true; (() => { const list = document.querySelectorAll("
        "'[name=target]')[1]; list.value = 'y_m'; list.dispatchEvent(new Event('change')); })(); 1"
    )
    browser.wait_for("!window.tankcalLeft && document.readyState === 'complete'", SLOW_S)
    assert browser.run("document.querySelectorAll('[name=target]')[1].value") == "y_m"
    browser.run(
        "window.tankcalLeft = true; (() => { const list = document.querySelectorAll("
        "'[name=target]')[2]; list.value = 'x_m'; list.dispatchEvent(new Event('change')); })(); 1"
    )
    browser.wait_for("!window.tankcalLeft && document.readyState === 'complete'", SLOW_S)
    follow(browser, "main form[method=post] button.primary")
    browser.wait_for(f"document.querySelector('{cell(0, 'x_m')}')", SLOW_S)
    assert browser.text(cell(0, "x_m")) == "0,25"
    assert browser.text(cell(0, "y_m")) == "6,5005"


@pytest.mark.parametrize("language", ["en", "pt-BR", "es"])
def test_pages_are_accessible_and_fit_a_phone(browser, address, language):
    root, key = address.split("/job/")[0], address.split("/job/")[1].split("/")[0]
    script = AXE.read_text(encoding="utf-8")
    pages = ["/", "/new", "/open", "/keys", "/nothing", *(
        f"/job/{key}/{part}" for part in ("", "table/courses", "problems", "results")
    )]  # fmt: skip
    findings = []
    for theme in ("light", "dark"):
        browser.run(f"document.cookie = 'tankcal-language={language}; path=/'")
        browser.run(f"document.cookie = 'tankcal-theme={theme}; path=/'")
        for page in pages:
            browser.visit(root + page)
            browser.wait_for("document.readyState === 'complete' && document.querySelector('h1')")
            if page == "/":
                browser.wait_for("document.querySelector('#recent-jobs')", SLOW_S)
            if "table" in page:
                browser.wait_for("document.querySelector('[role=grid] td')", SLOW_S)
            browser.run("for (const fold of document.querySelectorAll('details')) fold.open = true")
            browser.run(f"{script}; 1")
            found = browser.run(
                "axe.run({iframes: false, runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa']})"
                ".then(done => done.violations.map(one => "
                "[one.id, one.nodes.slice(0, 3).map(node => node.html.slice(0, 160))]))"
            )
            findings += [(theme, page, one) for one in found]
            for width in (390, 1280):
                browser.ask("Emulation.setDeviceMetricsOverride", width=width, height=900,
                            deviceScaleFactor=1, mobile=False)  # fmt: skip
                browser.drawn()
                sideways = browser.run(
                    "document.documentElement.scrollWidth - document.documentElement.clientWidth"
                )
                if sideways > 0:
                    findings.append((theme, page, width, sideways))
    assert findings == []
