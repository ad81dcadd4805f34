"""The notebook as a person uses it: Voilà and JupyterLab in a headless Chromium."""

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import pytest
from background import heed_ctrl_c
from browser import THIS_MACHINE, Browser
from job_builder import write_job

from tankcal.products.workbench import serving

pytestmark = pytest.mark.slow
SLOW_S = 120  # a loaded machine starts a kernel and its page within


@contextmanager
def served(*command, **beside):
    """The address that a command prints, while it serves; it must end by itself on Ctrl-C."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "LANG": "C", **beside}
    process = subprocess.Popen(
        [sys.executable, "-m", *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment,
        start_new_session=True,
        preexec_fn=heed_ctrl_c,
    )
    lines = []
    try:
        for line in process.stdout:
            lines.append(line)
            found = re.search(r"http://127\.0\.0\.1:\d+/\S*", line)
            if found and ("Ctrl-C" in line or "token=" in line):
                break
        else:
            pytest.fail("".join(lines))
        threading.Thread(target=process.stdout.read, daemon=True).start()
        yield found.group()
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait(20)


def reach(url):
    """Wait until a server listens."""
    host, port = re.search(r"//([\d.]+):(\d+)", url).groups()
    for _ in range(10 * SLOW_S):
        with socket.socket() as tried:
            if tried.connect_ex((host, int(port))) == 0:
                return
        time.sleep(0.1)


def cell(table, row, column):
    return f'[data-table={table}] td[data-row="{row}"][data-column={column}]'


def reason(place):
    return f"document.querySelector('{place}').title"


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


def test_app_answers_no_other_host(folder):
    """A page of another host, whose name was made to point to 127.0.0.1, starts no kernel."""
    if not serving.has_app():
        pytest.skip("no Voilà here (tankcal[app]): the app is not reached")
    with served("tankcal", "app", str(folder), "--no-browser") as url:
        reach(url)
        host, port = re.search(r"//([\d.]+):(\d+)", url).groups()
        statuses = {}
        for name in ("evil.example", f"evil.example:{port}", "192.168.0.7", f"localhost:{port}"):
            connection = http.client.HTTPConnection(host, int(port), timeout=SLOW_S)
            connection.request("GET", "/", headers={"Host": name})
            statuses[name] = connection.getresponse().status
            connection.close()
        assert statuses.pop(f"localhost:{port}") == 200
        assert set(statuses.values()) == {403}


def test_app_edits_checks_runs_and_saves(folder):
    if not serving.has_app():
        pytest.skip("no Voilà here (tankcal[app]): the app is not driven")
    before = {path.name: path.read_text() for path in folder.iterdir()}
    height = cell("courses", 1, "height_m")
    browser = Browser(THIS_MACHINE)
    with served("tankcal", "app", str(folder), "--no-browser") as url, browser:
        reach(url)
        browser.visit(url)
        browser.wait_for(f"document.querySelector('{height}')", SLOW_S)
        browser.wait_for("document.querySelector('.tankcal-view')", SLOW_S)
        assert "open_job" not in browser.text("body")  # no code
        assert "Anéis" in browser.text("body")

        # a bad value: the cell says why, the list says where, nothing runs
        browser.click(height)
        browser.write("1x9")
        browser.press("Enter", 13)
        assert "esperado um número" in browser.wait_for(reason(height))
        assert browser.run(f"document.querySelector('{height}').ariaInvalid") == "true"
        red, green, blue = browser.picture(height)[4, 4]
        assert red > green + 30
        assert red > blue + 30
        assert "courses.csv, linha 3, height_m" in browser.text(".tankcal-findings")
        browser.click(".tankcal-run")
        browser.wait_for("document.querySelector('.tankcal-state').innerText.includes('1x9')")
        assert not (folder / "results").exists()
        assert (folder / "courses.csv").read_text() == before["courses.csv"]

        # mended by keyboard alone: back up, type, Tab to the next cell
        browser.click(height)
        browser.write("1,8")
        browser.press("Tab", 9)
        browser.wait_for(f"{reason(height)} === ''")
        browser.press("ArrowLeft", 37)
        browser.press("ArrowDown", 40)
        browser.write("2,0")
        browser.press("Enter", 13)

        # a block out of a spreadsheet, below the last row
        count = len(before["points.csv"].split()) - 1
        browser.click('[data-table=points] [data-act="add_row"]')
        last = "document.querySelector('[data-table=points] [role=grid]').ariaRowCount"
        browser.wait_for(f"{last} === '{count + 2}'")
        browser.press("End", 35)
        browser.ask("Input.dispatchKeyEvent", type="keyDown", key="ArrowDown",
                    windowsVirtualKeyCode=40, modifiers=2)  # fmt: skip
        browser.press("Home", 36)
        browser.paste(
            "[data-table=points] [role=grid]", "N1\t6,5\t0,0\t0,95\r\nN2\t0,0\t6,5\t0,95\r\n"
        )
        browser.wait_for(f"document.querySelector('{cell('points', count + 1, 'point')}')"
                         ".innerText === 'N2'")  # fmt: skip

        # saved: what was edited, and nothing else
        browser.click(".tankcal-save")
        browser.wait_for("document.querySelector('.tankcal-head').innerText.includes('Salvo')")
        after = {name: (folder / name).read_text() for name in before}
        changed = {name for name in before if after[name] != before[name]}
        assert changed == {"courses.csv", "points.csv"}
        lines = before["courses.csv"].splitlines()
        lines[2] = lines[2].replace("1,9", "1,8", 1)
        lines[3] = lines[3].replace("1,9", "2,0", 1)
        assert after["courses.csv"].splitlines() == lines
        assert after["points.csv"].startswith(before["points.csv"])
        assert after["points.csv"].splitlines()[-1].startswith("N2;0,0;6,5;0,95")

        # run: the results are there before the papers are, and say so
        browser.click(".tankcal-run")
        browser.wait_for("document.querySelector('.tankcal-view').children.length", SLOW_S)
        browser.wait_for("document.querySelector('.tankcal-state').innerText.includes('record.json')",
                         SLOW_S)  # fmt: skip
        assert (folder / "results" / "certificate.pdf").exists()

        # nothing was asked of another machine, and what the page's template asks is refused
        thrown = [one for one in browser.complaints if "exceptionDetails" in one]
        assert thrown == []
        foreign = {one for one in browser.requests if "127.0.0.1" not in one and "blob:" not in one}
        assert all("fontawesome" in one for one in foreign)
        for one in browser.complaints:
            if "cdn" in str(one.get("entry", {}).get("text")):
                assert one["entry"]["source"] == "security"

    record = json.loads((folder / "results" / "record.json").read_text())
    assert [one["height_m"] for one in record["job"]["courses"]][:3] == [1.9, 1.8, 2.0]


def test_lab_opens_the_notebook_and_marks_a_cell(tmp_path):
    if not serving.has_lab():
        pytest.skip("no JupyterLab here (tankcal[lab]): the notebook is not driven in it")
    folder = write_job(tmp_path / "T-2", rings=2)
    height = cell("courses", 1, "height_m")
    (tmp_path / "jupyter_lab_config.json").write_text(
        json.dumps({"LabApp": {"expose_app_in_browser": True}, "ServerApp": {"allow_root": True}})
    )
    opener, opened = tmp_path / "opener", tmp_path / "opened.html"  # in place of a browser
    opener.write_text(
        f'#!/bin/sh\ncp "${{1#file://}}" "{opened}.part"; mv "{opened}.part" "{opened}"\n'
    )
    opener.chmod(0o755)
    beside = {"JUPYTER_CONFIG_DIR": str(tmp_path), "BROWSER": str(opener)}
    browser = Browser(THIS_MACHINE)
    with served("tankcal", "notebook", str(folder), **beside) as url, browser:
        reach(url)
        while not opened.exists():
            time.sleep(0.1)
        page = re.search(r"https?://[^\"']+", opened.read_text()).group()
        browser.visit(page.replace("localhost", "127.0.0.1").replace("&amp;", "&"))
        shown = "[...jupyterapp.shell.widgets('main')].find(one => one.id && one.context)"
        ready = f"{shown}.context.sessionContext.session.kernel.status"
        browser.wait_for(f"{ready} === 'idle'", SLOW_S)
        browser.run(f"jupyterapp.shell.activateById({shown}.id); 1")
        browser.drawn()
        browser.run("jupyterapp.commands.execute('notebook:run-all-cells'); 1")
        browser.wait_for(f"document.querySelector('{height}')", SLOW_S)
        browser.wait_for(f"{ready} === 'idle'", SLOW_S)  # what cells still write moves the table
        browser.drawn()
        browser.click(height)
        browser.write("1x9")  # letters are no shortcuts of JupyterLab there
        browser.press("Enter", 13)
        assert "expected a number" in browser.wait_for(reason(height))
        browser.press("ArrowUp", 38)
        browser.write("1.8")
        browser.press("Enter", 13)
        browser.wait_for(f"{reason(height)} === ''")
        browser.wait_for("document.querySelector('.tankcal-save')", SLOW_S)
        browser.click(".tankcal-save")
        browser.wait_for("document.querySelector('.tankcal-head').innerText.includes('Saved')")
    assert "2,1.8," in (folder / "courses.csv").read_text()
