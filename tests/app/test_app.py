"""The app without a browser and without a port: access, pages, edits, imports."""

import io
import json
import re
import shutil
import time
import zipfile
from pathlib import Path

import pytest
from job_builder import write_job
from starlette.testclient import TestClient

from tankcal.cli import main
from tankcal.products.app import serving
from tankcal.products.app.access import new_token
from tankcal.products.app.server import DOCUMENTS, EXAMPLES, SURVEYS
from tankcal.products.app.site import Site, identifier
from tankcal.text.words import load_words

ROOT = Path(__file__).parents[2]
PORT, TOKEN = 4711, "t" * 24
HOST = f"http://127.0.0.1:{PORT}"
ORIGIN = {"origin": HOST}
LANGUAGES = ("en", "pt-BR", "es")


@pytest.fixture
def site(tmp_path):
    return Site(tmp_path / "workspace", tmp_path / "state")


@pytest.fixture
def folder(tmp_path):
    return write_job(tmp_path / "job", rings=2)


@pytest.fixture
def client(site, monkeypatch):
    # On a loaded machine, too, the full check is made before the answer.
    monkeypatch.setattr("tankcal.products.app.site.QUICK_CHECK_S", 60.0)
    application = serving.guard_application(site, PORT, TOKEN, serving.LOCAL_NAMES)
    with TestClient(application, base_url=HOST, follow_redirects=False) as client:
        client.cookies.set(f"tankcal-{PORT}", TOKEN)
        client.cookies.set("tankcal-language", "pt-BR")
        yield client


def act(client, key, name, action, revision=None, since=0):
    content = {"name": name, "action": action, "revision": revision, "since": since}
    return client.post(f"/job/{key}/act", json=content, headers=ORIGIN)


# ---- access


def paths():
    job = f"/job/{'0' * 16}"
    return ["/", "/recent", "/new", "/open", "/keys", "/static/1/app.js", f"{job}/",
            f"{job}/table/points", f"{job}/grid/points", f"{job}/events", f"{job}/results",
            f"{job}/file/certificate.pdf", f"{job}/zip"]  # fmt: skip


@pytest.mark.parametrize("path", paths())
def test_no_page_without_token_or_with_another_host(client, path):
    assert client.get(path, headers={"host": "evil.example"}).status_code == 421
    assert client.get(path, headers={"host": f"evil.example:{PORT}"}).status_code == 421
    assert client.get(path, headers={"host": "127.0.0.1:80"}).status_code == 421
    client.cookies.clear()
    assert client.get(path).status_code == 403
    client.cookies.set(f"tankcal-{PORT}", "x" * 24)
    assert client.get(path).status_code == 403


@pytest.mark.parametrize(
    "origin",
    [
        *(None, "null", "http://evil.example", "http://127.0.0.1:80"),
        *(f"http://localhost:{PORT}", f"https://127.0.0.1:{PORT}"),
    ],
)
def test_no_change_from_another_origin(client, site, folder, origin):
    key = site.add(folder)
    headers = {} if origin is None else {"origin": origin}
    for path in ("/new", f"/job/{key}/act", "/upload?name=a.csv", "/look", f"/job/{key}/run"):
        assert client.post(path, headers=headers, content=b"{}").status_code == 421
    assert client.put("/new", headers=headers).status_code == 421


@pytest.mark.slow
def test_the_token_becomes_a_cookie_and_leaves_the_address(client):
    client.cookies.clear()
    answer = client.get(f"/new?token={TOKEN}&language=es&upload=1")
    assert answer.status_code == 303
    assert answer.headers["location"] == "/new?upload=1"
    cookies = answer.headers.get_list("set-cookie")
    assert any("httponly" in one.lower() and "samesite=strict" in one.lower() for one in cookies)
    assert "Nuevo tanque" in client.get("/new").text
    # The redirection stays on this host.
    assert client.get(f"//evil.example/?token={TOKEN}").headers.get("location", "/")[:2] != "//"
    assert len(new_token()) == 24
    assert new_token() != new_token()


def test_pages_run_no_foreign_script(client):
    headers = client.get("/").headers
    policy = headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "unsafe" not in policy
    assert headers["x-content-type-options"] == "nosniff"
    page = client.get("/").text
    assert not re.search(r"<script(?![^>]*src=)|\son\w+=|\sstyle=|https?://", page)


@pytest.mark.parametrize("name", ["..", "%2e%2e", "..%2f..%2fetc%2fpasswd", "%2fetc%2fpasswd",
                                  "..%5c..%5cwindows", "job.toml", "con"])  # fmt: skip
def test_no_path_of_a_request_is_used(client, site, folder, name):
    key = site.add(folder)
    for path in (f"/job/{key}/file/{name}", f"/static/1/{name}", f"/job/{name}/", f"/import/{name}",
                 f"/job/{key}/table/{name}", f"/example/{name}", f"/job/{key}/view/{name}",
                 f"/field-sheet/{name}"):  # fmt: skip
        # A path that the client shortens may be the list of jobs, but never a file.
        answer = client.get(path)
        assert answer.status_code in (404, 405, 307) or "<h1>Tanques" in answer.text
        assert "root:" not in answer.text
        assert "[tank]" not in answer.text
    answer = client.get(f"/open?at={name}")
    assert "root" not in answer.text


def test_a_link_out_of_the_workspace_is_not_listed(client, site, tmp_path, monkeypatch):
    monkeypatch.setattr(Path, "home", lambda: tmp_path / "home")
    (tmp_path / "home").mkdir()
    site.workspace.mkdir()
    (site.workspace / "inside").mkdir()
    (tmp_path / "secret").mkdir()
    (site.workspace / "out").symlink_to(tmp_path / "secret")
    client.get("/open")
    page = client.get(f"/open?at={identifier(site.workspace)}").text
    assert "inside" in page
    assert ">out<" not in page
    assert client.get(f"/open?at={identifier(tmp_path)}").text.count("<li>") == 1


def test_back_leads_to_no_other_site(client):
    for back in ("//evil.example", "https://evil.example", "/\\evil.example", "javascript:1"):
        content = {"back": back, "language": "es"}
        answer = client.post("/look", data=content, headers=ORIGIN)
        assert answer.headers["location"] == "/"
    answer = client.post("/look", data={"back": "/new", "theme": "dark"}, headers=ORIGIN)
    assert answer.headers["location"] == "/new"


@pytest.mark.parametrize("arguments", [
    ["--address", "0.0.0.0"], ["--address", "192.168.0.7"], ["--port", "0"], ["--port", "x"],
    ["--address", "300.1.1.1", "--behind-tls", "a.example"],
])  # fmt: skip
def test_bad_addresses_are_refused(capsys, monkeypatch, tmp_path, arguments):
    monkeypatch.setenv("TANKCAL_STATE", str(tmp_path))
    monkeypatch.setattr(serving, "serve", lambda *given: pytest.fail("served"))
    try:
        status = main(["app", *arguments, "--no-browser"])
    except SystemExit as stop:
        status = stop.code
    assert status == 2
    assert capsys.readouterr().err


def test_behind_a_proxy_only_its_name_and_prefix_are_answered(site):
    application = serving.guard_application(
        site, PORT, TOKEN, ["10.0.0.1", "lab.example"], "/tankcal", True
    )
    with TestClient(application, base_url="https://lab.example") as client:
        client.cookies.set(f"tankcal-{PORT}", TOKEN)
        page = client.get("/tankcal/").text
        addresses = re.findall(r'(?:href|src|action|data-drop|data-fragment)="(/[^"]*)"', page)
        assert len(addresses) > 8
        assert all(one.startswith("/tankcal/") for one in addresses)
        assert client.get("/").status_code == 404
        assert client.get("/tankcal/", headers={"host": "evil.example"}).status_code == 421
        answer = client.post("/tankcal/new", headers={"origin": "http://lab.example"})
        assert answer.status_code == 421


# ---- pages


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_pages_are_in_the_language_of_the_browser(client, site, folder, language):
    client.cookies.clear()
    client.cookies.set(f"tankcal-{PORT}", TOKEN)
    key, words = site.add(folder), load_words(language)["app"]
    headers = {"accept-language": f"xx, {language.lower()};q=0.9, fr;q=0.1"}
    for path, expected in {
        "/": words["jobs"], "/recent": words["states"]["ready"], "/new": words["which_tank"],
        "/open": words["choose_root"], "/keys": words["shortcuts"]["F8"],
        f"/job/{key}/": words["groups"]["needed"], f"/job/{key}/problems": words["none"],
        f"/job/{key}/table/courses": words["drop"], f"/job/{key}/results": words["no_results"],
        "/nothing": words["errors"]["404"],
    }.items():  # fmt: skip
        page = client.get(path, headers=headers).text
        assert expected.replace("'", "&#39;") in page
        assert f'<html lang="{language}"' in page


def test_the_words_of_the_pages_are_complete():
    for language in LANGUAGES:
        words = load_words(language)["app"]
        assert set(words["example_names"]) == set(EXAMPLES)
        assert set(words["documents"]) == set(DOCUMENTS.values())
        assert set(words["kinds"]) >= set(SURVEYS)
        ways = {way for kinds in SURVEYS.values() for way in kinds}
        assert set(words["surveys"]) >= ways == set(words["survey_notes"])
    templates = (ROOT / "tankcal/products/app/templates").glob("*.html")
    used = {word for path in templates for word in re.findall(r"\bw\.(\w+)", path.read_text())}
    assert used - set(words) == set()
    elsewhere = {"headline", "grid", "password_again", "login_wrong", "login_often"}
    assert set(words) - used == elsewhere


def test_the_script_is_small_and_loads_nothing():
    files = [ROOT / "tankcal/products/app/static/app.js", ROOT / "tankcal/products/desk/grid.js"]
    text = "".join(path.read_text() for path in files)
    assert text.count("\n") <= 900
    assert not re.search(r"https?://|eval\(|innerHTML|document\.write", text)


@pytest.mark.slow
def test_texts_of_a_job_are_escaped(client, site, folder):
    path = folder / "job.toml"
    path.write_text(
        path.read_text().replace("[tank]", "[tank]\nowner = '<script>alert(1)</script>'")
    )
    page = client.get(f"/job/{site.add(folder)}/").text
    assert "&lt;script&gt;alert(1)" in page
    assert "<script>alert" not in page


# ---- a job


@pytest.mark.slow
def test_a_new_job_is_created_and_listed(client, site):
    content = {"kind": "horizontal", "survey": "strapping", "tank": "TQ/9"}
    answer = client.post("/new", data=content, headers=ORIGIN)
    assert answer.status_code == 303
    page = client.get(answer.headers["location"]).text
    assert "TQ-9" in page
    assert 'data-section="horizontal"' in page
    assert "TQ-9" in client.get("/recent").text
    assert (site.workspace / "TQ-9" / "job.toml").is_file()
    bad = {"kind": "horizontal", "survey": "photos", "tank": "x"}
    assert client.post("/new", data=bad, headers=ORIGIN).status_code == 400


def test_an_entry_is_checked_saved_and_undone(client, site, folder):
    key = site.add(folder)
    grid = client.get(f"/job/{key}/grid/points").json()
    assert grid["marks"] == []
    enter = {"kind": "enter", "changes": [[2, "x_m", "1x9"]]}
    state = act(client, key, "points", enter, grid["revision"]).json()
    assert state["problems"] == 1
    assert state["cells"] == [[2, 1, "1x9"]]
    assert state["marks"][0][:3] == [2, 1, "bad"]
    assert "esperado um número" in state["marks"][0][3]
    assert state["undo"] == "Valor em Pontos da parede"
    problems = client.get(f"/job/{key}/problems").text
    assert 'table/points#2,x_m"' in problems
    seen = state["revision"]
    state = act(client, key, "points", {"kind": "undo"}, seen, seen).json()
    assert (state["problems"], state["redo"]) == (0, "Valor em Pontos da parede")
    before = (folder / "points.csv").read_text()
    enter = {"kind": "enter", "changes": [[0, "z_m", "0,97"]]}
    act(client, key, "points", enter, state["revision"])
    state = act(client, key, None, {"kind": "save"}).json()
    assert not state["is_changed"]
    assert (folder / "points.csv").read_text() != before
    assert "0.97" in (folder / "points.csv").read_text()


@pytest.mark.slow
def test_a_setting_is_entered_with_the_decimal_mark(client, site, folder):
    key = site.add(folder)
    action = {"kind": "setting", "section": "tank", "key": "nominal_diameter_m", "text": "12,75"}
    state = act(client, key, "job", action).json()
    assert state["fields"]["tank.nominal_diameter_m"][0] == "12,75"
    action["text"] = "1.234"
    state = act(client, key, "job", action).json()
    assert state["fields"]["tank.nominal_diameter_m"][1] == "bad"
    state = act(client, key, None, {"kind": "save"}).json()
    assert state["refusal"]
    assert "12.75" not in (folder / "job.toml").read_text()


def test_a_slow_check_follows_the_answer(client, site, folder, monkeypatch):
    monkeypatch.setattr("tankcal.products.app.site.QUICK_CHECK_S", 0.0)
    key = site.add(folder)
    client.get(f"/job/{key}/grid/points")
    enter = {"kind": "enter", "changes": [[2, "x_m", "1x9"], [3, "x_m", "1,5"]]}
    state = act(client, key, "points", enter).json()
    assert state["problems"] is None
    assert [mark[:3] for mark in state["entered"]] == [[2, 1, "bad"], [3, 1, ""]]
    for _ in range(200):
        state = client.get(f"/job/{key}/changes?name=points&since=0").json()
        if state["is_checked"]:
            break
        time.sleep(0.05)
    assert state["marks"][0][:3] == [2, 1, "bad"]


def test_two_windows_see_each_other(client, site, folder):
    key = site.add(folder)
    seen = client.get(f"/job/{key}/grid/points").json()["revision"]
    act(client, key, "points", {"kind": "enter", "changes": [[0, "z_m", "0,97"]]}, seen, seen)
    changes = client.get(f"/job/{key}/changes?name=points&since={seen}").json()
    assert changes["cells"] == [[0, 3, "0,97"]]
    second = {"kind": "enter", "changes": [[0, "z_m", "0,98"]]}
    answer = act(client, key, "points", second, seen, seen)
    assert answer.status_code == 409
    assert "0,97" in answer.json()["error"]
    whole = client.get(f"/job/{key}/changes?name=points&since=x").json()
    assert len(whole["rows"]) > 10


def test_own_edits_of_a_page_do_not_contradict_each_other(client, site, folder):
    key = site.add(folder)
    seen = client.get(f"/job/{key}/grid/points").json()["revision"]

    def send(page, action):
        content = {"name": "points", "action": action, "revision": seen, "client": page}
        return client.post(f"/job/{key}/act", json=content, headers=ORIGIN).status_code

    # Typed faster than the server answers: a row is added, and its cell entered.
    assert send("a", {"kind": "insert", "row": 0, "count": 1}) == 200
    assert send("a", {"kind": "enter", "changes": [[0, "z_m", "0,97"]]}) == 200
    assert send("b", {"kind": "enter", "changes": [[1, "z_m", "0,98"]]}) == 409
    assert send("a", {"kind": "enter", "changes": [[0, "x_m", "6,5"]]}) == 200


@pytest.mark.parametrize("content", [
    b"", b"[]", b"{", b'{"action": 3}', b'{"action": {"kind": "enter"}, "name": "points"}',
    b'{"action": {"kind": "insert", "row": "a", "count": 1}, "name": "points"}',
    b'{"action": {"kind": "setting"}}', b'{"since": "a", "action": {}}',
    b'{"action": {"kind": "remove", "rows": [[1]]}, "name": "points"}',
    b'{"action": {"kind": "paste", "row": 0, "column": 99, "cells": 5}, "name": "points"}',
])  # fmt: skip
def test_broken_requests_are_refused(client, site, folder, content):
    key = site.add(folder)
    headers = ORIGIN | {"content-type": "application/json"}
    answer = client.post(f"/job/{key}/act", content=content, headers=headers)
    assert answer.status_code in (400, 404)
    assert client.get(f"/job/{key}/grid/points").status_code == 200


@pytest.mark.slow
def test_an_entry_of_a_page_of_an_earlier_server_is_not_made(client, site, folder):
    key = site.add(folder)
    reading = client.get(f"/job/{key}/changes?since=0").json()["desk"]
    before = (folder / "courses.csv").read_bytes()
    content = {"name": "courses", "action": {"kind": "enter", "changes": [[0, "height_m", "1,7"]]},
               "revision": 0, "since": 0}  # fmt: skip
    for desk, status in (("another", 412), (None, 412), (reading, 200)):
        assert (folder / "courses.csv").read_bytes() == before
        answer = client.post(f"/job/{key}/act", json=content | {"desk": desk}, headers=ORIGIN)
        assert answer.status_code == status
    assert f'data-desk="{reading}"' in client.get(f"/job/{key}/").text
    site.close()  # saves what waits for its pause
    assert b"1.7" in (folder / "courses.csv").read_bytes()


def test_a_restarted_app_has_the_port_of_the_last_unless_it_is_taken(tmp_path):
    with serving.free_socket("127.0.0.1") as first:
        port = first.getsockname()[1]
        serving.write_state(tmp_path, f"http://127.0.0.1:{port}/?token=x")
        with serving.last_socket("127.0.0.1", tmp_path) as other:
            assert other.getsockname()[1] != port
    with serving.last_socket("127.0.0.1", tmp_path) as again:
        assert again.getsockname()[1] == port


def test_files_changed_by_another_program_are_read_again(client, site, folder):
    key = site.add(folder)
    client.get(f"/job/{key}/grid/points")
    path = folder / "points.csv"
    path.write_text(path.read_text() + "Z9,1,2,3\n")
    rows = client.get(f"/job/{key}/grid/points").json()["rows"]
    assert rows[-1][:2] == ["Z9", "1"]
    act(client, key, "points", {"kind": "enter", "changes": [[0, "z_m", "0,97"]]})
    path.write_text(path.read_text() + "# more\n")
    state = act(client, key, None, {"kind": "save"}).json()
    assert "outro programa" in state["refusal"]
    assert "# more" in path.read_text()


@pytest.mark.slow
def test_unsaved_edits_are_offered_after_a_crash(client, site, folder):
    key = site.add(folder)
    act(client, key, "points", {"kind": "enter", "changes": [[0, "z_m", "0,97"]]})
    site.forget(key)  # the process was killed before it saved
    page = client.get(f"/job/{key}/").text
    assert "1 alterações de uma sessão anterior" in page
    answer = client.post(f"/job/{key}/recover", data={"decision": "recover"}, headers=ORIGIN)
    assert answer.status_code == 303
    assert client.get(f"/job/{key}/grid/points").json()["rows"][0][3] == "0,97"


def test_a_job_that_is_gone_is_told(client, site, folder):
    key = site.add(folder)
    shutil.rmtree(folder)
    assert client.get(f"/job/{key}/").status_code == 404
    page = client.get("/recent").text
    assert load_words("pt-BR")["app"]["states"]["gone"] in page
    client.post(f"/job/{key}/forget", headers=ORIGIN)
    assert "job" not in client.get("/recent").text.split("<tbody>")[-1][:50]


@pytest.mark.slow
def test_results_are_shown_with_quantities(client, site, folder):
    """The pages of a computed job, without a browser, in its language."""
    import tankcal
    from tankcal.report import outputs

    result = tankcal.run(tankcal.load(folder))
    outputs.write(result, folder / "results", papers=False)
    key = site.add(folder)
    page = client.get(f"/job/{key}/results").text
    assert "Capacidade de" in page
    for view in ("table", "wall", "budget", "whole"):
        answer = client.get(f"/job/{key}/view/{view}")
        assert answer.headers["content-security-policy"].startswith("sandbox allow-scripts;")
    archive = zipfile.ZipFile(io.BytesIO(client.get(f"/job/{key}/zip").content))
    assert "record.json" in archive.namelist()
    answer = client.get(f"/job/{key}/file/capacity.csv?store")
    assert "attachment" in answer.headers["content-disposition"]
    page = client.get(f"/job/{key}/quantity?opening.dip_m=x").text
    assert "aria-describedby" in page
    assert "&lt;" not in page.split('<form method="get">')[1][:200]
    with (folder / "points.csv").open("a") as file:
        file.write("# later\n")
    page = client.get(f"/job/{key}/results").text
    assert load_words("pt-BR")["app"]["states"]["stale"] in page


# ---- files


def upload(client, data, name="caderneta.csv", job=""):
    answer = client.post(f"/upload?name={name}&job={job}", content=data, headers=ORIGIN)
    return answer.json()["address"]


def test_a_table_is_imported_with_its_mapping(client, site, folder):
    key = site.add(folder)
    text = "Levantamento\nPonto;Este (mm);Norte;Cota;Obs\nN1;6500,5;0,25;0,95;x\nN2;1;2,5;0,95;\n"
    address = upload(client, text.encode("cp1252"), job=key)
    assert address.startswith(f"/job/{key}/import/")
    page = client.get(address).text
    assert "caderneta.csv" in page
    assert "<option selected>mm</option>" in page
    answer = client.post(address, data={"rows": "replace"}, headers=ORIGIN)
    assert answer.headers["location"] == f"/job/{key}/table/points"
    rows = client.get(f"/job/{key}/grid/points").json()["rows"]
    assert [row[:4] for row in rows] == [
        ["N1", "6,5005", "0,25", "0,95"], ["N2", "0,001", "2,5", "0,95"],
    ]  # fmt: skip
    chosen = "?table=points&encoding=cp1252&separator=;&decimal=,&for=points|;|cp1252"
    chosen += "&target=point&target=y_m&target=x_m&target=z_m&target=&unit=&unit=m&unit=m&unit=m"
    client.post(f"{address}{chosen}", data={"rows": "add"}, headers=ORIGIN)
    rows = client.get(f"/job/{key}/grid/points").json()["rows"]
    assert rows[2][:4] == ["N1", "0,25", "6500,5", "0,95"]


@pytest.mark.slow
def test_an_upload_without_a_job_asks_for_the_tank(client, site, folder):
    site.add(folder)
    address = upload(client, b"point,x_m,y_m,z_m\nA,1.5,2.5,3.5\n")
    page = client.get(address).text
    assert load_words("pt-BR")["app"]["belongs_to"] in page
    key = address.rsplit("/", 1)[1]
    content = {"kind": "vertical", "survey": "points", "tank": "T", "upload": key}
    answer = client.post("/new", data=content, headers=ORIGIN)
    assert answer.headers["location"].endswith(f"/import/{key}")
    assert client.get(answer.headers["location"]).status_code == 200


@pytest.mark.slow
def test_a_field_book_is_imported(client, site):
    content = {"kind": "vertical", "survey": "wall_hits", "tank": "T-9"}
    answer = client.post("/new", data=content, headers=ORIGIN)
    key = answer.headers["location"].split("/")[2]
    data = (ROOT / "examples/wall-hits/field-book.gsi").read_bytes()
    address = upload(client, data, "field-book.gsi", key)
    assert load_words("pt-BR")["app"]["file_kinds"]["field_book"] in client.get(address).text
    answer = client.post(address, data={"rows": "add"}, headers=ORIGIN)
    assert answer.status_code == 200, answer.text
    assert len(client.get(f"/job/{key}/grid/wall_hits").json()["rows"]) == 200


def send_folder(client, name, files):
    """Send a folder {path: bytes} as the page does; return the address of its page."""
    body = json.dumps([[path, len(data)] for path, data in files.items()]).encode() + b"\n"
    body += b"".join(files.values())
    answer = client.post(f"/upload?name={name}&folder=yes&job=x", content=body, headers=ORIGIN)
    assert answer.status_code == 200, answer.text
    return answer.json()["address"]


@pytest.mark.slow
def test_a_job_folder_becomes_a_job(client, site, folder):
    files = {f"tank 9/{path.name}": path.read_bytes() for path in folder.iterdir()}
    strange = ("tank 9/../../out.csv", "tank 9/a\\b.csv", "tank 9/c:x.csv",
               "tank 9/.git/config", "tank 9/results/x.csv")  # fmt: skip
    address = send_folder(client, "tank 9", files | dict.fromkeys(strange, b"x"))
    words = load_words("pt-BR")["app"]
    assert words["file_kinds"]["job_folder"] in client.get(address).text
    answer = client.post(f"{address}/job", headers=ORIGIN)
    assert answer.status_code == 303, answer.text
    copy = site.workspace / "tank-9"
    assert {path.name for path in copy.iterdir()} == {path.name for path in folder.iterdir()}
    assert (copy / "points.csv").read_bytes() == (folder / "points.csv").read_bytes()
    assert client.get(answer.headers["location"]).status_code == 200
    page = client.get(send_folder(client, "tank 9", files)).text  # the same folder again
    assert f'href="{answer.headers["location"]}"' in page
    # Settings that cannot be read are shown; a folder without a job is not known.
    address = send_folder(client, "bad", {"bad/job.toml": b"\xff\xfe\x00"})
    answer = client.post(f"{address}/job", headers=ORIGIN)
    assert client.get(answer.headers["location"]).status_code == 200
    assert sorted(path.name for path in site.workspace.iterdir()) == ["bad", "tank-9"]
    page = client.get(send_folder(client, "photos", {"photos/a.txt": b"abc"})).text
    assert words["file_kinds"]["unknown"] in page


@pytest.mark.parametrize("body", [b"", b'[["a", 5]]\nab', b'[["a", -1]]\n', b'[["a"]]\n',
                                  b'[[1, 1]]\na', b"x", b"5"])  # fmt: skip
def test_broken_folders_are_refused(client, site, body):
    answer = client.post("/upload?name=a&folder=yes", content=body, headers=ORIGIN)
    assert answer.status_code == 400
    assert not any((site.state / "uploads").iterdir())


def test_too_large_and_strange_uploads_are_refused(client, site, monkeypatch):
    monkeypatch.setattr("tankcal.products.app.site.MOST_UPLOAD", 1000)
    answer = client.post("/upload?name=a.csv", content=b"x" * 1001, headers=ORIGIN)
    assert answer.status_code == 413
    assert list((site.state / "uploads").iterdir()) == []
    address = upload(client, b"\0\1\2", "../../x.bin")
    page = client.get(address).text
    assert load_words("pt-BR")["app"]["file_kinds"]["unknown"] in page
    assert "x.bin" in page
    assert ".." not in page.split("<h1>")[1][:40]


# ---- start


def test_a_second_start_finds_the_first(tmp_path):
    import socket

    assert serving.running_address(tmp_path) is None
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"http://127.0.0.1:{server.getsockname()[1]}/?token=abc"
        path = serving.write_state(tmp_path, address)
        assert path.stat().st_mode & 0o777 == 0o600
        assert json.loads(path.read_text())["address"] == address
        assert serving.running_address(tmp_path) == address
    assert serving.running_address(tmp_path) is None


@pytest.mark.parametrize(("display", "is_opened"), [("", False), (":0", True)])
def test_without_arguments_the_app_opens_on_a_display(monkeypatch, capsys, display, is_opened):
    from tankcal.products.app import command

    started = []
    monkeypatch.setattr(command, "run_app", lambda options: started.append(options))
    monkeypatch.setattr("sys.argv", ["tankcal"])
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", display)
    assert main() == 0
    assert bool(started) == is_opened
    assert ("usage" in capsys.readouterr().out) != is_opened
    assert main([]) == 0  # called by a program
    assert len(started) == is_opened
