"""Tanks in service in the app: create, drop the logs of a month, read the estimate, download.

Kind of truth: the command `tankcal upkeep` on the same folder.
"""

import json
import shutil

import numpy as np
import pytest
from browser import THIS_MACHINE, Browser
from conftest import EXAMPLE
from example_logs import Station, TrueTank, write_station
from test_app import ORIGIN, client, site  # noqa: F401
from test_app_in_browser import AXE, SLOW_S, ended, follow, start

from tankcal import cli
from tankcal.products.app.office_pages import list_services
from tankcal.products.quantity.table import read_table
from tankcal.text.words import load_words

FORM = {
    "tank": "Posto 7", "timezone": "America/Sao_Paulo", "service": "station", "base_c": "20",
    "expansion_per_k": "0,00124", "resolution_mm": "0,01",
}  # fmt: skip
NAMES = {"levels.csv": "levels-01.csv", "meters.csv.log": "sales-01.csv",
         "deliveries.csv": "tickets-01.csv"}  # fmt: skip


def make_workspace(state, folder):
    """Computed tank in the workspace of a state folder, and logs of a month of it."""
    job = state / "workspace" / "rings"
    shutil.copytree(EXAMPLE.parent / "rings", job)
    assert cli.main(["run", str(job), "--no-papers", "--quiet"]) == 0
    tank, table = TrueTank(), read_table(job / "results" / "record.json")
    tank.grid, tank.volume = table.height_m, table.volume_m3
    write_station(folder, Station(days=40, tank=tank, period_s=300.0).run(np.random.default_rng(7)))
    return job, {new: (folder / old).read_text() for old, new in NAMES.items()}


def send(client, service, files):  # noqa: F811
    """Send files as the drop area does; address of the page."""
    items = [(name, text.encode()) for name, text in files.items()]
    sizes = json.dumps([[name, len(content)] for name, content in items]).encode()
    answer = client.post(
        "/upload", params={"service": service, "name": "month", "folder": "yes"}, headers=ORIGIN,
        content=b"\n".join([sizes, b"".join(content for _, content in items)]),
    )  # fmt: skip
    return answer.json()["address"]


@pytest.mark.slow
def test_months_are_added_and_computed(client, site, tmp_path, capsys):  # noqa: F811
    job, logs = make_workspace(tmp_path, tmp_path / "logs")
    key = site.add(job)
    assert "rings" in client.get("/service").text
    bad = client.post("/service", headers=ORIGIN, data=FORM | {"job": key, "base_c": "x"})
    assert bad.status_code == 409
    assert "base_c" in bad.text
    assert list_services(site) == {}
    page = client.post("/service", headers=ORIGIN, data=FORM | {"job": key}).headers["location"]
    service = page.rpartition("/")[2]
    folder = list_services(site)[service]
    # A file without the name of a log, and an unreadable log, change the folder in no way.
    address = send(client, service, logs | {"notes.txt": "x", "sales-01.csv": "a,b\n1,2\n"})
    words = load_words("pt-BR")["app"]["service"]
    assert words["states"]["no_log"] in client.get(address).text
    upload = address.partition("upload=")[2]
    refused = client.post(page, headers=ORIGIN, data={"upload": upload})
    assert refused.status_code == 409
    assert "sales-01.csv" in refused.text
    assert [path.name for path in folder.iterdir() if path.is_file()] == ["upkeep.toml"]
    upload = send(client, service, logs).partition("upload=")[2]
    assert client.post(page, headers=ORIGIN, data={"upload": upload}).status_code == 303
    shown = client.get(page).text
    assert "2025-01" in shown
    capsys.readouterr()
    assert cli.main(["upkeep", str(folder), "--json"]) == 0
    by_command = json.loads(capsys.readouterr().out)
    del by_command["exit_status"]
    saved = client.get(f"{page}/upkeep.json").json()
    assert saved == by_command
    assert client.get(f"{page}/upkeep.pdf").content.startswith(b"%PDF")
    assert client.get(f"{page}/upkeep.toml").status_code == 404
    # The same log again is known; another content of its name is refused.
    address = send(client, service, logs)
    assert words["states"]["known"] in client.get(address).text
    address = send(client, service, logs | {"sales-01.csv": "time,meter,total_l\n"})
    assert words["states"]["other"] in client.get(address).text
    upload = address.partition("upload=")[2]
    assert client.post(page, headers=ORIGIN, data={"upload": upload}).status_code == 409
    assert client.get("/service/0000").status_code == 404


@pytest.mark.slow
def test_a_month_is_dropped_in_a_browser(tmp_path):
    """Form, drop of three files, estimate and downloads; no finding of axe in any language."""
    state = tmp_path / "state"
    job, logs = make_workspace(state, tmp_path / "logs")
    process, address = start(job, state)
    root = address.split("/job/")[0]
    script, findings = AXE.read_text(encoding="utf-8"), []
    with ended(process), Browser(THIS_MACHINE) as browser:
        browser.visit(address)
        browser.wait_for("document.querySelector('[data-section]')", SLOW_S)
        browser.visit(f"{root}/service")
        browser.wait_for("document.querySelector('#s-tank')", SLOW_S)
        for name, value in FORM.items():
            browser.run(f"document.querySelector('#s-{name}').value = {json.dumps(value)}; 1")
        follow(browser, "main form button")
        browser.wait_for("document.querySelector('[data-drop]')", SLOW_S)
        page = browser.run("location.href")
        files = "".join(
            f"data.items.add(new File([{json.dumps(text)}], '{name}'));"
            for name, text in logs.items()
        )
        browser.run(
            "const input = document.querySelector('[data-drop] input');"
            f"const data = new DataTransfer(); {files} input.files = data.files;"
            "input.dispatchEvent(new Event('change')); 1"
        )
        browser.wait_for("location.search.includes('upload=')", SLOW_S)
        browser.wait_for("document.querySelectorAll('main table tr').length === 3", SLOW_S)
        received = browser.run("location.href")
        pages = [f"{root}/service", received]
        check_pages(browser, script, pages, findings)
        browser.visit(received)
        browser.wait_for("document.querySelector('main form button')", SLOW_S)
        follow(browser, "main form button")
        browser.wait_for("document.querySelector('main').textContent.includes('2025-01')", SLOW_S)
        assert browser.run(
            "Promise.all([...document.querySelectorAll('a[download]')].map(a => fetch(a.href)"
            ".then(r => r.status)))"
        ) == [200] * browser.run("document.querySelectorAll('a[download]').length")
        assert browser.run("document.querySelectorAll('a[download]').length") >= 8
        check_pages(browser, script, [page], findings)
    assert findings == []


def check_pages(browser, script, pages, findings):
    """Findings of axe, and pages that are wider than a phone, in each language and theme."""
    for language in ("en", "es", "pt-BR"):
        browser.run(f"document.cookie = 'tankcal-language={language}; path=/'")
        title = load_words(language)["app"]["service"]["title"]
        for theme in ("light", "dark"):
            browser.run(f"document.cookie = 'tankcal-theme={theme}; path=/'")
            for page in pages:
                browser.visit(page)
                browser.wait_for("document.readyState === 'complete'", SLOW_S)
                assert title in browser.run("document.querySelector('main').textContent")
                browser.run(f"{script}; 1")
                findings += browser.run(
                    "axe.run({runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa']})"
                    ".then(done => done.violations.map(item => [item.id, ...item.nodes"
                    ".slice(0, 3).map(node => node.html.slice(0, 160))]))"
                )
                browser.ask("Emulation.setDeviceMetricsOverride", width=390, height=900,
                            deviceScaleFactor=1, mobile=False)  # fmt: skip
                browser.drawn()
                wide = browser.run(
                    "document.documentElement.scrollWidth - document.documentElement.clientWidth"
                )
                if wide > 0:
                    findings.append((page, language, wide))
                browser.ask("Emulation.clearDeviceMetricsOverride")
