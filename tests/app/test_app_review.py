"""Review, approval, register, users and locks of the app, without a browser and without a port."""

import hashlib
import json
import os
import re
from pathlib import Path

import pytest
from job_builder import write_job, write_workbook
from starlette.testclient import TestClient

from tankcal.errors import InputError
from tankcal.products.app import access, serving
from tankcal.products.app.access import ROLES, People, add_user
from tankcal.products.app.office_pages import find_signature
from tankcal.products.app.site import Site
from tankcal.products.desk import jobs
from tankcal.products.desk.draft import Draft
from tankcal.products.desk.jobs import Act, JobLock, RecentJobs, State, new_owner, state_of
from tankcal.products.register.certificates import read_certificates
from tankcal.text.words import load_words

PORT = 4711
HOST = f"http://127.0.0.1:{PORT}"
SECRET = "correct horse 9"
WORDS = load_words("pt-BR")["app"]


@pytest.fixture
def folder(tmp_path):
    return write_job(tmp_path / "job", rings=2)


def write_record(folder, text="1"):
    """A record that belongs to the present files of a job, without numbers."""
    out = folder / "results"
    out.mkdir(exist_ok=True)
    files = [
        {"file": path.name, "bytes": path.stat().st_size,
         "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
        for path in sorted(folder.iterdir()) if path.suffix in (".toml", ".csv", ".xlsx")
    ]  # fmt: skip
    (out / "record.json").write_text(json.dumps({"files": files, "made": text}))
    return hashlib.sha256((out / "record.json").read_bytes()).hexdigest()


@pytest.fixture
def site(tmp_path):
    return Site(tmp_path / "workspace", tmp_path / "state")


@pytest.fixture
def client(site, monkeypatch):
    monkeypatch.setattr("tankcal.products.app.site.QUICK_CHECK_S", 60.0)
    application = serving.guard_application(site, PORT, "t" * 24, serving.LOCAL_NAMES)
    with TestClient(application, base_url=HOST, follow_redirects=False) as client:
        client.cookies.set(f"tankcal-{PORT}", "t" * 24)
        client.cookies.set("tankcal-language", "pt-BR")
        yield client


def post(client, path, **form):
    return client.post(path, data=form, headers={"origin": str(client.base_url)})


def act(client, key, name, action):
    return client.post(f"/job/{key}/act", json={"name": name, "action": action, "since": 0},
                       headers={"origin": HOST})  # fmt: skip


# ---- model of a review


def test_decisions_follow_each_other_and_belong_to_a_record(folder):
    draft, sha = Draft.open(folder), write_record(folder)

    def add(decision, **rest):
        jobs.add_event(draft, decision, "Ana", sha, **rest)

    for early in (Act.APPROVED, Act.RETURNED, Act.REVIEWED, Act.REVISED):
        with pytest.raises(InputError):
            add(early, text="x")
    add(Act.SUBMITTED)
    with pytest.raises(InputError):
        add(Act.RETURNED)  # without a reason
    add(Act.RETURNED, text='point 17 is a "manhole"\\\n\x00é\x7f')
    assert state_of(folder).state is State.RETURNED
    add(Act.SUBMITTED)
    add(Act.REVIEWED)
    add(Act.APPROVED)
    with pytest.raises(InputError):
        add(Act.SUBMITTED)
    events = jobs.read_events(folder)
    assert [event.act for event in events][-1] is Act.APPROVED
    assert events[1].text == 'point 17 is a "manhole"\\ é'
    assert (state_of(folder).state, state_of(folder).person) == (State.APPROVED, "Ana")
    # Other results, or changed data: the approval does not hold.
    assert jobs.find_decision(events, "0" * 64) is None
    write_record(folder, "2")
    assert state_of(folder).state is State.COMPUTED
    write_record(folder)
    (folder / "points.csv").write_text((folder / "points.csv").read_text() + "# later\n")
    assert state_of(folder).state is State.STALE


@pytest.mark.parametrize("content", [
    "", "format = 1", 'format = "tankcal-review 1"\n[[event]]\n',
    'format = "tankcal-review 1"\nevent = 3', "\udc80",
])  # fmt: skip
def test_a_damaged_review_is_reported_and_approves_nothing(folder, content):
    write_record(folder)
    path = jobs.folder_of(folder) / jobs.FILE
    path.parent.mkdir()
    path.write_bytes(content.encode("utf-8", "surrogateescape"))
    with pytest.raises(InputError):
        jobs.read_events(folder)
    assert state_of(folder).state is State.COMPUTED


@pytest.mark.parametrize("is_book", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_changes_since_a_copy_are_listed_by_cell(tmp_path, is_book):
    if is_book:
        source = write_workbook(tmp_path / "T.xlsx")
    else:
        source = write_job(tmp_path / "job", rings=2)
    draft = Draft.open(source)
    jobs.add_event(draft, Act.SUBMITTED, "Ana", "a" * 64)
    copy, path = jobs.find_copy(source, jobs.read_events(source), "b" * 64)
    assert jobs.list_changes(path, draft) == []
    before = draft.tables["points"].rows
    draft.set_cells("points", [(3, "z_m", "0.97")])
    draft.remove_rows("points", [5])
    draft.set_value("job", "tank", "owner", "Porto")
    changes = jobs.list_changes(path, draft)
    cell = before[3].cells[draft.tables["points"].headings.index("z_m")]
    assert (copy.name, len(changes)) == ("Ana", 3)
    assert jobs.Change("job", "tank", "owner", None, "Porto") in changes
    assert jobs.Change("points", 4, "z_m", cell, "0.97") in changes
    assert [item.row for item in changes if item.after is None] == [6]
    # The copy of the own record is no earlier copy; an approved copy has precedence.
    assert jobs.find_copy(source, jobs.read_events(source), "a" * 64) == (None, None)


def test_remarks_are_resolved_once(folder):
    draft, sha = Draft.open(folder), write_record(folder)
    jobs.add_event(draft, Act.REMARK, "Rui", sha, "manhole?", "points.csv, 17")
    jobs.add_event(draft, Act.RESOLVED, "Ana", sha, "yes", number=1)
    with pytest.raises(InputError):
        jobs.add_event(draft, Act.RESOLVED, "Ana", sha, "again", number=1)
    [(remark, resolved)] = jobs.list_remarks(jobs.read_events(folder))
    assert (remark.place, resolved.text) == ("points.csv, 17", "yes")


# ---- pages of the review


@pytest.mark.slow
def test_who_submitted_approves_only_with_a_reason(client, site, folder, monkeypatch):
    # A record without numbers cannot be assessed.
    monkeypatch.setattr("tankcal.products.app.office_pages._refuse_unexplained", lambda job: None)
    key, sha = site.add(folder), write_record(folder)

    def decide(decision, name, text=""):
        return post(client, f"/job/{key}/review", act=decision, name=name, record=sha, text=text)

    assert decide("submitted", "Ana  Lima").status_code == 303
    answer = decide("approved", " Ana Lima ", " ")
    assert answer.status_code == 409
    assert "Ana Lima enviou estes resultados" in answer.text
    assert jobs.find_decision(jobs.read_events(folder), sha).act is Act.SUBMITTED
    assert decide("approved", "Ana Lima", "works alone").status_code == 303
    assert decide("revised", "Rui", "again").status_code == 303
    assert decide("submitted", "Ana Lima").status_code == 303
    assert decide("approved", "Rui").status_code == 303


@pytest.mark.slow
def test_an_approved_job_is_read_only_until_it_is_revised(client, site, folder):
    key, sha = site.add(folder), write_record(folder)
    page = client.get(f"/job/{key}/review").text
    assert WORDS["review"]["acts"]["submitted"] in page
    assert post(client, f"/job/{key}/review", act="submitted", name="Ana",
                record="0" * 64).status_code == 409  # fmt: skip
    assert post(client, f"/job/{key}/review", act="x", record=sha).status_code == 400
    for decision, name in (("submitted", "Ana"), ("approved", "Rui")):
        answer = post(client, f"/job/{key}/review", act=decision, name=name, record=sha, text="ok")
        assert answer.status_code == 303
    assert "aprovado por Rui" in client.get("/recent").text
    enter = {"kind": "enter", "changes": [[0, "z_m", "0,97"]]}
    answer = act(client, key, "points", enter)
    assert answer.status_code == 409
    assert "aprovado por Rui" in answer.json()["error"]
    assert client.get(f"/job/{key}/grid/points").json()["locked"]
    assert "disabled" in client.get(f"/job/{key}/").text
    answer = post(client, f"/job/{key}/run")
    assert answer.status_code == 409
    post(client, f"/job/{key}/review", act="revised", name="Rui", record=sha, text="new door")
    assert act(client, key, "points", enter).status_code == 200
    assert act(client, key, None, {"kind": "save"}).json()["is_changed"] is False
    page = client.get(f"/job/{key}/review").text
    assert WORDS["review"]["not_present"] in page
    assert "0.97" in page  # the change since the approved copy


@pytest.mark.slow
@pytest.mark.parametrize("language", ["en", "pt-BR", "es"])
def test_new_pages_are_in_the_language(client, site, folder, language):
    key, words = site.add(folder), load_words(language)["app"]
    client.cookies.set("tankcal-language", language)
    for path, expected in {
        f"/job/{key}/review": words["review"]["not_present"],
        "/register": words["no_certificates"],
        "/chart": words["drawing"]["no_calibration"],
    }.items():
        page = client.get(path).text
        assert expected.replace("'", "&#39;") in page
        assert f'<html lang="{language}"' in page


def test_a_signature_covers_the_file_or_not(tmp_path):
    path = tmp_path / "certificate.pdf"
    assert find_signature(path) == ""
    path.write_bytes(b"%PDF-1.7 " + b"x" * 91)
    assert find_signature(path) == "none"
    signed = b"%PDF-1.7 /ByteRange [0 20 40 60]"
    path.write_bytes(signed + b"x" * (100 - len(signed)))
    assert find_signature(path) == "present"
    path.write_bytes(path.read_bytes() + b"more")
    assert find_signature(path) == "incomplete"


# ---- users and roles


@pytest.fixture
def staff(tmp_path, monkeypatch):
    """An app behind TLS with a user of each role."""
    monkeypatch.setattr(access, "COST", {"n": 4, "r": 1, "p": 1})
    path = tmp_path / "users.toml"
    for role in ROLES:
        add_user(path, f"{role} Ã", [role], SECRET)
    site = Site(tmp_path / "workspace", tmp_path / "state", People(path))
    application = serving.guard_application(
        site, PORT, "t" * 24, ["lab.example"], is_secure=True
    )  # fmt: skip
    with TestClient(application, base_url="https://lab.example", follow_redirects=False) as client:
        client.headers["accept"] = "text/html"
        yield client, site, path


def log_in(client, name, secret=SECRET, **more):
    return post(client, "/login", name=name, password=secret, **more)


def test_no_page_without_a_session(staff, folder):
    client, site, _ = staff
    key = site.add(folder)
    answer = client.get(f"/job/{key}/")
    assert answer.status_code == 303
    assert answer.headers["location"] == f"/login?back=%2Fjob%2F{key}%2F"
    assert client.get(f"/?token={'t' * 24}").status_code == 303  # the token is worth nothing
    client.cookies.set(f"tankcal-{PORT}", "t" * 24)
    for path in ("/new", f"/job/{key}/act", "/upload?name=a.csv", f"/job/{key}/run", "/logout"):
        assert post(client, path).status_code == 403
    assert client.get(f"/job/{key}/events", headers={"accept": "*/*"}).status_code == 403
    assert client.get("/login", headers={"host": "evil.example"}).status_code == 421
    answer = client.post("/login", data={}, headers={"origin": "http://lab.example"})
    assert answer.status_code == 421


def test_a_session_begins_and_ends(staff, monkeypatch):
    client, _, path = staff
    assert log_in(client, "viewer Ã", "wrong").status_code == 403
    assert log_in(client, "nobody").status_code == 403
    for back in ("//evil.example", "https://evil.example", "/\\evil", "javascript:1"):
        answer = log_in(client, "viewer Ã", back=back)
        assert answer.headers["location"] == "/"
    cookie = answer.headers["set-cookie"].lower()
    assert all(item in cookie for item in ("httponly", "samesite=strict", "secure"))
    page = client.get("/")
    assert page.status_code == 200
    assert "viewer Ã" in page.text
    post(client, "/logout")
    assert client.get("/").status_code == 303
    # A changed password, a removed user and time end a session.
    log_in(client, "viewer Ã")
    add_user(path, "viewer Ã", ["viewer"], SECRET + "0")
    os.utime(path, ns=(1, 1))
    assert client.get("/").status_code == 303
    log_in(client, "reviewer Ã")
    monkeypatch.setattr(access, "IDLE_S", -1)
    assert client.get("/").status_code == 303


def test_passwords_are_hashed_and_attempts_limited(staff):
    client, site, path = staff
    text = path.read_text()
    assert SECRET not in text
    assert path.stat().st_mode & 0o777 == 0o600
    assert len(set(re.findall(r"scrypt\$\w+", text))) == len(ROLES)  # a salt each
    for _ in range(access.MOST_OF_BOTH):
        assert log_in(client, "viewer Ã", "wrong").status_code == 403
    assert log_in(client, "viewer Ã").status_code == 429
    assert log_in(client, "approver Ã").status_code == 303
    assert SECRET not in site.log.path.read_text() if site.log.path.exists() else True


@pytest.mark.slow
@pytest.mark.parametrize("role", ROLES)
def test_roles_decide_about_every_change(staff, folder, role):
    client, site, _ = staff
    key, sha = site.add(folder), write_record(folder)
    jobs.add_event(Draft.open(folder), Act.SUBMITTED, "Ana", sha)
    log_in(client, f"{role} Ã")
    edit, run, approve = ("edit" in ROLES[role], "run" in ROLES[role], "approve" in ROLES[role])
    table = {
        "/new": edit, "/example/none": edit, "/open": edit, "/upload?name=a": edit,
        "/import/0/job": edit, "/chart/job": edit, "/run-all": run,
        "/register/withdraw": approve, f"/job/{key}/act": edit, f"/job/{key}/add-table": edit,
        f"/job/{key}/recover": edit, f"/job/{key}/import/0": edit, f"/job/{key}/run": run,
        f"/job/{key}/stop": run, f"/job/{key}/overrule": edit, f"/job/{key}/take-over": edit,
        f"/job/{key}/issue": approve, "/service": edit, f"/service/{key}": edit,
    }  # fmt: skip
    for path, is_permitted in table.items():
        if path.endswith("/run"):
            continue  # would start a process for those who may
        assert (post(client, path).status_code == 403) != is_permitted, path
    if not run:
        assert post(client, f"/job/{key}/run").status_code == 403
    changes = {route.path for route in _routes(client) if "POST" in (route.methods or ())}
    known = {path.split("?")[0].replace(key, "{key:str}").replace("/0", "/{upload:str}")
             .replace("/none", "/{name:str}") for path in table}  # fmt: skip
    assert changes - known == {"/look", "/login", "/logout", "/job/{key:str}/forget",
                               "/job/{key:str}/review"}  # fmt: skip
    # The name of the session is recorded, not a typed name.
    answer = post(client, f"/job/{key}/review", act="approved", name="X", text="ok", record=sha)
    assert (answer.status_code == 303) == approve
    if approve:
        assert jobs.read_events(folder)[-1].name == f"{role} Ã"
        lines = [json.loads(line) for line in site.log.path.read_text().splitlines()]
        assert lines[-1]["name"] == f"{role} Ã"
        assert lines[-1]["content"]["act"] == "approved"


def _routes(client):
    return client.app.app.routes


@pytest.mark.parametrize("content", ["x", "[a]\nroles = ['king']\npassword = 'scrypt$1$2'",
                                     "[a]\nroles = ['viewer']\npassword = 'plain'"])  # fmt: skip
def test_a_damaged_file_of_users_is_refused(tmp_path, content):
    path = tmp_path / "users.toml"
    path.write_text(content)
    with pytest.raises(InputError):
        People(path)


def test_a_server_for_other_machines_needs_tls_and_users(monkeypatch, capsys, tmp_path):
    from tankcal.cli import main

    monkeypatch.setenv("TANKCAL_STATE", str(tmp_path))
    monkeypatch.setattr(serving, "serve", lambda *given: pytest.fail("served"))
    monkeypatch.setattr(access, "COST", {"n": 4, "r": 1, "p": 1})
    assert main(["app", "--address", "0.0.0.0"]) == 2
    assert "--certificate" in capsys.readouterr().err
    for arguments in (["--behind-tls", "lab.example"],
                      ["--address", "0.0.0.0", "--behind-tls", "lab.example"]):  # fmt: skip
        assert main(["app", "--no-browser", *arguments]) == 2
        assert "--add-user" in capsys.readouterr().err
    monkeypatch.setattr("sys.stdin", open(os.devnull))  # noqa: SIM115
    assert main(["app", "--add-user", "Ana", "--role", "approver"]) == 2
    secret = tmp_path / "secret"
    secret.write_text(SECRET + "\n")
    with secret.open() as file:
        monkeypatch.setattr("sys.stdin", file)
        assert main(["app", "--add-user", "Ana", "--role", "approver"]) in (0, None)
    assert People(tmp_path / "users.toml").begin("Ana", SECRET, "") is not None


# ---- two servers on a folder


@pytest.mark.slow
def test_a_second_server_shows_and_takes_over(client, site, folder, tmp_path, monkeypatch):
    other = Site(tmp_path / "workspace", tmp_path / "state-2")
    application = serving.guard_application(other, PORT, "t" * 24, serving.LOCAL_NAMES)
    key = site.add(folder)
    other.add(folder)
    enter = {"kind": "enter", "changes": [[0, "z_m", "0,97"]]}
    assert act(client, key, "points", enter).status_code == 200
    with TestClient(application, base_url=HOST, follow_redirects=False) as second:
        second.cookies.set(f"tankcal-{PORT}", "t" * 24)
        second.cookies.set("tankcal-language", "es")
        page = second.get(f"/job/{key}/table/points").text
        assert "abierto en otro programa" in page
        assert load_words("es")["app"]["take_over"] not in page
        assert act(second, key, "points", enter).status_code == 409
        assert post(second, f"/job/{key}/run").status_code == 409
        post(second, f"/job/{key}/take-over")  # not yet: the first is alive
        assert act(second, key, "points", enter).status_code == 409
        monkeypatch.setattr(jobs, "SILENT_S", -1)
        assert load_words("es")["app"]["take_over"] in second.get(f"/job/{key}/").text
        post(second, f"/job/{key}/take-over")
        monkeypatch.setattr(jobs, "SILENT_S", 300)
        assert act(second, key, "points", enter).status_code == 200
        # The first notices it before its next entry.
        answer = act(client, key, "points", enter)
        assert answer.status_code == 409
        assert "aberto em outro programa" in answer.json()["error"]
    other.close()
    assert not list(folder.glob(".*"))
    assert act(client, key, "points", {"kind": "undo"}).status_code == 200


def test_a_lock_of_an_ended_process_is_replaced(folder):
    lock = JobLock(folder, new_owner())
    assert lock.acquire() is None
    content = json.loads(lock.path.read_text())
    assert content["process"] == os.getpid()
    second = JobLock(folder, new_owner())
    assert second.acquire().machine == content["machine"]
    lock.path.write_text(json.dumps(content | {"process": 2**22 + 1}))  # above the largest
    assert second.acquire() is None
    lock.release()  # of another owner now
    assert second.path.exists()
    second.path.write_text("{")  # being written
    assert JobLock(folder, "x").acquire() is not None
    second.path.unlink()
    assert sorted(path.name for path in folder.glob(".*")) == []


def test_a_heartbeat_does_not_change_the_state(folder, tmp_path):
    recent = RecentJobs(tmp_path / "state")
    recent.add(folder)
    recent.list()
    lock = JobLock(folder, "a")
    lock.acquire()
    known = dict(recent._states)
    lock.renew()
    recent.list()
    assert recent._states == known


# ---- register, with real results


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """A computed job with a complete certificate."""
    import shutil

    import tankcal
    from tankcal.report import outputs

    root = Path(__file__).parents[2] / "examples" / "silva-1995"
    folder = tmp_path_factory.mktemp("example") / "job"
    shutil.copytree(root, folder, ignore=shutil.ignore_patterns("results", "*.md", "published"))
    draft = Draft.open(folder)
    for name, text in (("number", "2026/118"), ("laboratory_address", "Rua A"),
                       ("customer_address", "Rua B"), ("date_of_issue", "2026-11-30"),
                       ("authorised_by", "Rui")):  # fmt: skip
        draft.set_value("job", "certificate", name, text)
    draft.save()
    outputs.write(tankcal.run(tankcal.load(folder)), folder / "results")
    return folder


@pytest.mark.slow
def test_a_certificate_is_issued_withdrawn_and_replaced(client, site, example):
    key, sha = site.add(example), jobs.record_digest(example / "results")
    page = client.get(f"/job/{key}/review").text
    assert WORDS["review"]["assessment"] in page
    assert post(client, f"/job/{key}/issue", record=sha).status_code == 403  # not approved
    for decision in ("submitted", "approved"):
        answer = post(client, f"/job/{key}/review", act=decision, name="Rui", text="ok", record=sha)
        assert answer.status_code == 303, answer.text
    answer = post(client, f"/job/{key}/issue", record=sha)
    draft = Draft.open(example)
    number = draft.value("certificate", "number")
    assert answer.status_code == 303, answer.text
    [certificate] = read_certificates(site.register).values()
    assert (certificate.number, certificate.approved_by) == (number, "Rui")
    assert certificate.record_sha256 == sha
    assert f"emitido {number}" in client.get("/recent").text
    page = client.get("/register").text
    assert number in page
    assert post(client, "/register/withdraw", number=number).status_code == 400
    post(client, "/register/withdraw", number=number, reason="amassado")
    assert f"cancelado {number}" in client.get("/recent").text
    assert client.get("/register.csv").text.count("\n") == 3
    post(client, f"/job/{key}/review", act="revised", name="Rui", record=sha, text="novo")
    act(client, key, None, {"kind": "save"})
    assert f'replaces = "{number}: novo"' in (example / "job.toml").read_text()


@pytest.mark.slow
def test_a_dropped_certificate_shows_its_record(client, site, example):
    data = (example / "results" / "certificate.pdf").read_bytes()
    answer = client.post("/upload?name=cert.pdf", content=data, headers={"origin": HOST})
    page = client.get(answer.json()["address"]).text
    view = re.search(r'src="(/import/\w+/view)"', page)[1]
    assert client.get(view).status_code == 200
    assert WORDS["as_certificate"] in page
    key = site.add(example)
    compare = f"{answer.json()['address']}/compare/{key}"
    answer = client.get(compare)
    assert answer.status_code in (200, 409)
    broken = client.post("/upload?name=x.pdf", content=b"%PDF-1.4 no", headers={"origin": HOST})
    assert WORDS["file_kinds"]["pdf"] in client.get(broken.json()["address"]).text
