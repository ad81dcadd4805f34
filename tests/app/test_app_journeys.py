"""The seven journeys of the app in a headless Chromium, by keyboard alone, in three languages.

No element is clicked by a script: Tab moves to each element, and keys act on it.
"""

import json
import math
import os
import random
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from background import heed_ctrl_c
from browser import THIS_MACHINE, Browser

from tankcal.products.desk import jobs
from tankcal.products.register.certificates import read_certificates
from tankcal.text.words import load_words

pytestmark = pytest.mark.slow
SLOW_S = 240
ROOT = Path(__file__).parents[2]
LANGUAGES = ("en", "pt-BR", "es")
MOST_TABS = 400  # elements of the longest page
KEYS = {
    "Tab": 9,
    "Home": 36,
    "ArrowRight": 39,
    "Enter": 13,
    " ": 32,
    "ArrowDown": 40,
    "ArrowUp": 38,
    "F8": 119,
}
TEXTS = {"Enter": "\r", " ": " "}
SHIFT = 8  # modifier of a key
AXE = Path(__file__).with_name("axe.min.js")


class Keyboard:
    """A person at a keyboard in front of a page."""

    def __init__(self, browser):
        self.browser, self.foreign, self.errors = browser, [], []

    def press(self, key, modifiers=0):
        more = {"text": TEXTS[key]} if key in TEXTS and not modifiers else {}
        for kind in ("keyDown", "keyUp"):
            self.browser.ask(
                "Input.dispatchKeyEvent", type=kind, key=key, modifiers=modifiers,
                windowsVirtualKeyCode=KEYS[key], **(more if kind == "keyDown" else {}),
            )  # fmt: skip

    def reach(self, selector):
        """Move to an element by Tab; fail if Tab does not reach it."""
        self.browser.wait_for(f"document.querySelector({json.dumps(selector)})", SLOW_S)
        test = f"document.activeElement?.matches({json.dumps(selector)})"
        # The way back is shorter for an element above.
        above = self.browser.run(
            f"!!(document.activeElement && document.activeElement !== document.body && "
            f"(document.querySelector({json.dumps(selector)})"
            ".compareDocumentPosition(document.activeElement) & 4))"
        )
        for _ in range(MOST_TABS):
            if self.browser.run(test):
                return
            self.press("Tab", SHIFT if above else 0)
        raise AssertionError(f"not reached by Tab: {selector}")

    def write(self, selector, text):
        """Type a text into a field, in place of its text."""
        self.reach(selector)
        self.browser.run("document.activeElement.select?.()")
        self.browser.write(text)

    def choose(self, selector, value):
        """Choose an option of a list by its arrows."""
        self.reach(selector)
        for _ in range(60):
            if self.browser.run("document.activeElement.value") == value:
                return
            self.press("ArrowDown")
        raise AssertionError(f"no option {value} in {selector}")

    def follow(self, selector, key="Enter"):
        """Activate a link or button, and wait for the page to which it leads."""
        self.reach(selector)
        self.browser.run("window.tankcalLeft = true")
        self.press(key)
        self.arrive()

    def arrive(self):
        self.browser.wait_for("!window.tankcalLeft && document.readyState === 'complete'", SLOW_S)
        self.collect()

    def collect(self):
        """Keep foreign requests and errors of the page."""
        self.foreign += [
            item for item in self.browser.requests
            if "127.0.0.1" not in item and not item.startswith(("data:", "blob:"))
        ]  # fmt: skip
        self.errors += [item for item in self.browser.complaints if "409" not in str(item)]
        self.browser.events.clear()

    def give_file(self, path, selector="input[type=file]"):
        """Open the chooser of files by a key, and choose a file or folder."""
        self.browser.ask("Page.setInterceptFileChooserDialog", enabled=True)
        self.browser.events.clear()
        self.reach(selector)
        self.browser.run("window.tankcalLeft = true")
        self.press("Enter")
        for _ in range(200):
            self.browser.run("1")
            opened = [item for item in self.browser.events
                      if item["method"] == "Page.fileChooserOpened"]  # fmt: skip
            if opened:
                break
        node = opened[0]["params"]["backendNodeId"]
        self.browser.ask("DOM.setFileInputFiles", files=[str(path)], backendNodeId=node)
        self.arrive()


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    return tmp_path_factory.mktemp("state")


@pytest.fixture(scope="module")
def address(state):
    """Address of an app with an empty list of jobs; it must end on Ctrl-C."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "LANG": "C", "TANKCAL_STATE": str(state)}
    command = [sys.executable, "-m", "tankcal", "app", "--no-browser"]
    process = subprocess.Popen(
        [*command, "--workspace", str(state / "workspace")], stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, env=environment, start_new_session=True,
        preexec_fn=heed_ctrl_c,
    )  # fmt: skip
    try:
        line = process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+/\S*", line)
        assert found, line + process.stdout.read()
        yield found.group().rstrip(";")
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
        assert not list((state / "workspace").glob("*/.open.json"))  # no lock remains
    finally:
        if process.poll() is None:
            process.kill()
            process.wait(20)


@pytest.fixture(params=LANGUAGES)
def language(request):
    return request.param


@pytest.fixture
def keys(address, language):
    """A keyboard at the home page in a language; at the end no error, no foreign request."""
    with Browser(THIS_MACHINE) as browser:
        keyboard = Keyboard(browser)
        browser.visit(f"{address}&language={language}")
        browser.wait_for("document.querySelector('h1') && document.readyState === 'complete'")
        browser.wait_for("document.querySelector('[data-fragment] h2')", SLOW_S)
        assert browser.run("document.documentElement.lang") == language
        yield keyboard
        keyboard.collect()
    assert keyboard.foreign == []
    assert keyboard.errors == []


def words_of(language):
    return load_words(language)["app"]


def new_tank(keys, kind, survey, name):
    """Create a tank by its three questions."""
    keys.follow('a[href$="/new"]')
    keys.reach("[name=kind]")
    pick(keys, "kind", kind)
    pick(keys, "survey", survey)
    keys.write("[name=tank]", name)
    keys.follow("main button.primary")


def pick(keys, name, value):
    """Choose a radio button by its arrows."""
    keys.reach(f"[name={name}]")
    for _ in range(20):
        if keys.browser.run("document.activeElement.value") == value:
            return keys.press(" ")
        keys.press("ArrowDown")
    raise AssertionError(f"no {name} {value}")


def compute(keys):
    """Compute on the results page, and wait for the capacity."""
    keys.follow('nav a[href$="/results"]')
    keys.follow("#start button")
    keys.browser.wait_for("document.querySelector('.headline')", SLOW_S)
    keys.browser.wait_for("document.readyState === 'complete'")
    return keys.browser.text(".headline")


def fill_setting(keys, section, key, text):
    """Enter a setting; its group is opened by a key if it is closed."""
    selector = f'[id="f-{section}.{key}"]'
    closed = f"document.querySelector({json.dumps(selector)}).closest('details:not([open])')"
    if keys.browser.run(f"!!{closed}"):
        keys.browser.run(f"{closed}.querySelector('summary').dataset.test = '1'")
        keys.reach("summary[data-test]")
        keys.press("Enter")
        keys.browser.run("document.querySelector('[data-test]').removeAttribute('data-test')")
    if keys.browser.run(f"document.querySelector({json.dumps(selector)}).matches('select')"):
        keys.choose(selector, text)
    else:
        keys.write(selector, text)
    keys.press("Tab")


def field_book(path, mark):
    """A list of points as an office program writes it: 3 rings a course, radius 5 m, 2 courses."""
    draw = random.Random(47)
    lines = ["Obra;Terminal", "", "Pto;Leste (m);Norte (m);Cota (m);Nota"]
    for ring, z in enumerate((0.4, 1.2, 2.0, 2.8, 3.6, 4.4)):
        for place in range(18):
            angle = 2 * math.pi * (place + 0.1 * ring) / 18
            radius = 5.0 + draw.gauss(0, 0.001)
            values = (100 + radius * math.cos(angle), 200 + radius * math.sin(angle), 10 + z)
            cells = [f"{value:.4f}".replace(".", mark) for value in values]
            lines.append(";".join([f"R{ring + 1}-{place + 1:02d}", *cells, ""]))
    path.write_bytes("\r\n".join(lines).encode("cp1252"))


def type_row(keys, texts):
    """Type a row of the grid from its first cell."""
    for text in texts:
        keys.browser.write(text)
        keys.press("Tab")
    keys.press("ArrowDown")
    keys.press("Home")


def test_a_technician_computes_a_first_tank_by_points(keys, language, state, tmp_path):
    words, browser, mark = words_of(language), keys.browser, "." if language == "en" else ","
    book, name = tmp_path / "caderneta.csv", f"TQ-1-{language}"
    field_book(book, mark)
    new_tank(keys, "vertical", "points", name)
    keys.give_file(book)
    assert words["import_title"].format(file="caderneta.csv") in browser.text("h1")
    targets = browser.run("[...document.querySelectorAll('[name=target]')].map(one => one.value)")
    assert targets == ["point", "x_m", "y_m", "z_m", ""]
    keys.follow("main form[method=post] button.primary")
    browser.wait_for("document.querySelector('[role=grid] td')", SLOW_S)
    assert browser.run("document.querySelector('[role=grid]').ariaRowCount") == "109"
    # an empty table: typing adds a row, faster than the server answers
    keys.follow('nav a[href$="table/courses"]')
    keys.reach("[role=grid]")
    type_row(keys, ("1", f"2{mark}4", f"8{mark}0"))
    type_row(keys, ("2", f"2{mark}4", f"6{mark}3"))
    keys.follow("nav .tank")
    # Chromium shows a date in the language of the machine, here month, day, year.
    for section, key, text in (
        ("tank", "nominal_diameter_m", "10"), ("tank", "nominal_height_m", f"4{mark}8"),
        ("survey", "side", "inside"), ("survey", "date", "11302026"), ("datum", "bottom_z_m", "10"),
        ("table", "step_m", f"0{mark}1"), ("table", "reference_temperature_c", "20"),
    ):  # fmt: skip
        fill_setting(keys, section, key, text)
    keys.follow('nav a[href$="/problems"]')
    assert words["none"] in browser.text("main")
    keys.follow('nav a[href$="/results"]')
    assert words["asked_before"].split(":")[0] in browser.text("main")  # before Run
    headline = compute(keys)
    volume = float(re.search(r"\d+[.,]\d+", headline)[0].replace(",", "."))
    assert abs(volume - math.pi * 25 * 4.8) < 0.15  # that of the tank behind the field book
    assert (state / "workspace" / name / "results" / "certificate.pdf").is_file()


def test_a_strapping_crew_enters_its_readings(keys, language, state):
    words, browser = words_of(language), keys.browser
    sheet = browser.run(
        "fetch(document.querySelector('a[href$=\"field-sheet/strapping\"]').href)"
        ".then(answer => answer.headers.get('content-type'))"
    )
    assert sheet == "application/pdf"
    keys.follow('form[action$="/example/strapping"] button')
    keys.follow('nav a[href$="table/circumferences"]')
    keys.reach("[role=grid]")
    before = browser.wait_for("document.querySelector('[role=grid] td.tankcal-active').innerText")
    column = browser.run(
        "[...document.querySelectorAll('[role=grid] [data-row=\"0\"]')]"
        ".findIndex(one => /\\d[.,]\\d/.test(one.innerText))"
    )
    for _ in range(column):
        keys.press("ArrowRight")
    browser.write("x")
    keys.press("Enter")
    browser.wait_for("document.querySelector('.tankcal-bad')")
    keys.press("F8")
    # Undo by its key, in the grid
    browser.ask("Input.dispatchKeyEvent", type="keyDown", key="z", windowsVirtualKeyCode=90,
                modifiers=2)  # fmt: skip
    browser.wait_for("!document.querySelector('.tankcal-bad')")
    assert browser.text("#count") == words["no_problem"] or words["count"].split(":")[0] in (
        browser.text("#count")
    )
    assert before
    keys.follow('nav a[href$="/results"]')
    keys.reach("[name=documents]")
    keys.press(" ")
    keys.follow("#start button")
    browser.wait_for("document.querySelector('.headline')", SLOW_S)
    keys.follow('main a[href$="/what-if"]')
    now = browser.wait_for("document.querySelector('#answer').innerText")
    keys.reach("input[type=range]")
    for _ in range(10):
        keys.press("ArrowDown")
    browser.wait_for(f"document.querySelector('#answer').innerText !== {json.dumps(now)}", SLOW_S)
    assert browser.text("output") == ("0.50" if language == "en" else "0,50")


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    """A computed job with a complete certificate, without its number."""
    import tankcal
    from tankcal.products.desk.draft import Draft
    from tankcal.report import outputs

    root = tmp_path_factory.mktemp("computed")

    def compute_copy(language):
        folder = root / language
        if folder.is_dir():
            return folder
        ignored = shutil.ignore_patterns("results", "*.md", "published")
        shutil.copytree(ROOT / "examples" / "silva-1995", folder, ignore=ignored)
        draft = Draft.open(folder)
        for name, text in (("number", f"2026/{language}"), ("laboratory_address", "Rua A"),
                           ("customer_address", "Rua B"), ("date_of_issue", "2026-11-30"),
                           ("authorised_by", "Rui Braga")):  # fmt: skip
            draft.set_value("job", "certificate", name, text)
        draft.set_value("job", "tank", "id", f"TQ-7-{language}")
        draft.save()
        outputs.write(tankcal.run(tankcal.load(folder)), folder / "results")
        return folder

    return compute_copy


@pytest.fixture
def folder(computed, state, language):
    """A copy of the computed job in the workspace, in the list of recent jobs."""
    from tankcal.products.desk.jobs import RecentJobs

    folder = state / "workspace" / f"TQ-7-{language}"
    if not folder.is_dir():
        shutil.copytree(computed(language), folder)
        RecentJobs(state).add(folder)
    return folder


def test_a_reviewer_returns_approves_and_issues(folder, keys, language, state):
    words, browser = words_of(language), keys.browser
    browser.wait_for(f"document.querySelector('#recent-jobs').innerText.includes({folder.name!r})",
                     SLOW_S)  # fmt: skip
    browser.run(f"[...document.querySelectorAll('#recent-jobs a')].find(one => one.innerText === "
                f"{folder.name!r}).dataset.test = '1'")  # fmt: skip
    keys.follow("a[data-test]")
    keys.follow('nav a[href$="/review"]')

    def decide(act, name, text=""):
        keys.write("#d-name", name)
        if text:
            keys.write("#d-text", text)
        keys.follow(f'#decision button[value="{act}"]')

    decide("submitted", "José Lima")
    keys.write("#r-row", "17, x_m")
    keys.write("#r-text", "porta de visita?")
    keys.write("#r-name", "Rui Braga")
    keys.follow('button[value="remark"]')
    decide("returned", "Rui Braga", "ver a observação")
    assert words["states"]["returned"].format(name="Rui Braga") in browser.text("main")
    keys.follow('main button[value="resolved"]')
    decide("submitted", "José Lima")
    decide("approved", "Rui Braga", "ok")
    assert words["states"]["approved"].format(name="Rui Braga") in browser.text("main")
    keys.follow('form[action$="/issue"] button')
    number = f"2026/{language}"
    assert number in browser.text("#certificates")
    certificate = read_certificates(state / "workspace" / "register.csv")[number]
    assert (certificate.state, certificate.approved_by) == ("issued", "Rui Braga")
    assert [event.act for event in jobs.read_events(folder)].count("returned") == 1
    # the list of the laboratory, with its states
    keys.follow(".brand")
    expected = words["states"]["issued"].format(number=number)
    browser.wait_for(
        f"document.querySelector('#recent-jobs').innerText.includes({expected!r})", SLOW_S
    )
    keys.write("[data-filter]", "nothing like this")
    shown = "[...document.querySelectorAll('#recent-jobs tbody tr')].filter(one => !one.hidden)"
    browser.wait_for(f"{shown}.length === 0")


def test_an_old_certificate_is_read_and_compared(folder, keys, language):
    words, browser = words_of(language), keys.browser
    keys.give_file(folder / "results" / "certificate.pdf")
    assert words["as_certificate"] in browser.text("main")
    view = browser.run("fetch(document.querySelector('iframe.paper').src).then(one => one.status)")
    assert view == 200
    # its table against the results of the same tank
    browser.run(f"[...document.querySelectorAll('main a[target=paper]')].find(one => one.innerText "
                f"=== {folder.name!r}).dataset.test = '1'")  # fmt: skip
    status = browser.run("fetch(document.querySelector('a[data-test]').href).then(a => a.status)")
    assert status in (200, 409)
    keys.reach("a[data-test]")
    keys.press("Enter")


def test_a_folder_is_dropped_or_chosen(folder, keys, language, state):
    words, browser = words_of(language), keys.browser
    # Results: shown, and offered beside the tank to which they belong.
    browser.run("window.tankcalLeft = true")
    x, y = browser.run("(({x, y}) => [x + 9, y + 9])(document.querySelector('.drop')"
                       ".getBoundingClientRect())")  # fmt: skip
    data = {"items": [], "files": [str(folder / "results")], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        browser.ask("Input.dispatchDragEvent", type=kind, x=x, y=y, data=data)
    keys.arrive()
    assert browser.text("h1") == "results"
    assert words["file_kinds"]["folder"] in browser.text("main")
    assert words["as_certificate"] in browser.text("details summary")
    assert browser.text(".actions") == words["open_known"].format(tank=folder.name)
    view = browser.run("fetch(document.querySelector('iframe.paper').src).then(one => one.status)")
    assert view == 200
    compare = browser.run("fetch(document.querySelector('main a[target=paper]').href)"
                          ".then(one => one.status)")  # fmt: skip
    assert compare == 200
    # A job: becomes a job of the workspace.
    keys.follow(".brand")
    keys.give_file(folder, "input[webkitdirectory]")
    assert words["file_kinds"]["job_folder"] in browser.text("main")
    keys.follow('form[action$="/job"] button')
    browser.wait_for("document.querySelector('[data-section]')", SLOW_S)
    copy = state / "workspace" / f"{folder.name}-2"
    assert (copy / "job.toml").read_bytes() == (folder / "job.toml").read_bytes()
    assert not (copy / "results").exists()


def test_the_owner_of_a_station_gets_a_chart(keys, language, state):
    words, browser, mark = words_of(language), keys.browser, "." if language == "en" else ","
    keys.follow('main a[href$="/chart"]')
    keys.write("#c-tank", f"Posto {language}")
    keys.write("#c-diameter_m", "abc")
    keys.follow("#sizes button")
    assert words["drawing"]["problem"] in browser.text("main")
    keys.write("#c-diameter_m", f"2{mark}5")
    keys.write("#c-length_m", "6")
    keys.follow("#sizes button")
    assert words["drawing"]["no_calibration"] in browser.text("main")
    litres = re.sub(r"\D", "", browser.text(".facts dd"))
    assert litres == str(round(1000 * math.pi / 4 * 2.5**2 * 6))
    kind = browser.run("fetch(document.querySelector('a[href*=\"chart.pdf\"]').href)"
                       ".then(one => one.headers.get('content-type'))")  # fmt: skip
    assert kind == "application/pdf"
    keys.follow('form[action$="/chart/job"] button')
    browser.wait_for("document.querySelector('[data-section]')", SLOW_S)
    assert browser.run("document.getElementById('f-horizontal.diameter_m').value") == f"2{mark}5"


def test_new_screens_are_accessible_and_fit_a_phone(folder, keys, address, language):
    browser, script = keys.browser, AXE.read_text(encoding="utf-8")
    browser.wait_for("document.querySelector('#recent-jobs')", SLOW_S)
    job = browser.run("document.querySelector('#recent-jobs th a').getAttribute('href')")
    root, findings = address.split("/?")[0], []
    chart = "/chart?diameter_m=2.5&length_m=6&end=ellipsoidal&depth_m=0.5&step_cm=5"
    for theme in ("light", "dark"):
        browser.run(f"document.cookie = 'tankcal-theme={theme}; path=/'")
        for page in ("/", chart, "/chart?diameter_m=x", "/register",
                     *(f"{job}{part}" for part in ("review", "what-if", "results"))):  # fmt: skip
            browser.visit(root + page)
            browser.wait_for("document.readyState === 'complete' && document.querySelector('h1')")
            browser.run("for (const fold of document.querySelectorAll('details')) fold.open = true")
            browser.run(f"{script}; 1")
            found = browser.run(
                "axe.run({iframes: false, runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa']})"
                ".then(done => done.violations.map(one => "
                "[one.id, one.nodes.slice(0, 3).map(node => node.html.slice(0, 160))]))"
            )
            findings += [(theme, page, item) for item in found]
            browser.ask("Emulation.setDeviceMetricsOverride", width=390, height=900,
                        deviceScaleFactor=1, mobile=False)  # fmt: skip
            browser.drawn()
            sideways = browser.run(
                "document.documentElement.scrollWidth - document.documentElement.clientWidth"
            )
            findings += [(theme, page, sideways)] if sideways > 0 else []
            browser.ask("Emulation.clearDeviceMetricsOverride")
    assert findings == []
