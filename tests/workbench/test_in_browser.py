"""The notebook as a person uses it: JupyterLab in a headless Chromium."""

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
