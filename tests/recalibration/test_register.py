"""Register of certificates: numbers given once, replaced and withdrawn certificates, history."""

import csv
import json
import shutil

import pytest
from conftest import EXAMPLE

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.job.certificate_entries import MARKED
from tankcal.products.register.certificates import issue, read_certificates, withdraw

HEAD = "event,date,number,tank,survey_date,record_sha256,replaced_by,reason\n"


@pytest.fixture(scope="module")
def record(example_result):
    return tankcal.record.record_of(example_result)


def write_results(folder, record, number, **certificate):
    """Write a record whose certificate has all required entries; return its folder."""
    given = dict.fromkeys(MARKED, "given") | {"date_of_issue": "1995-07-20", "number": number}
    job = record["job"] | {"certificate": given | certificate}
    folder = folder / number.replace("/", "-")
    folder.mkdir()
    text = json.dumps(record | {"job": job}, default=float)
    (folder / "record.json").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture
def register(tmp_path):
    return tmp_path / "certificates.csv"


@pytest.mark.slow
def test_a_number_is_given_once(tmp_path, record, register):
    first = write_results(tmp_path, record, "7/2024")
    [entry] = issue(register, [first])
    assert (entry.state, entry.issued, entry.tank) == ("issued", "1995-07-20", "SILVA-1995")
    before = register.read_bytes()
    with pytest.raises(InputError, match="number 7/2024 was issued on 1995-07-20"):
        issue(register, [first])
    assert register.read_bytes() == before


@pytest.mark.slow
def test_a_new_certificate_replaces_the_one_that_it_names(tmp_path, record, register):
    issue(register, [write_results(tmp_path, record, "7/2024")])
    later = write_results(
        tmp_path, record, "9/2024", replaces="7/2024: wrong owner", date_of_issue="1995-08-01"
    )
    issue(register, [later])
    states = read_certificates(register)
    old = states["7/2024"]
    assert (old.state, old.since, old.replaced_by) == ("replaced", "1995-08-01", "9/2024")
    assert old.reason == "wrong owner"
    assert states["9/2024"].state == "issued"


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("certificate", "expected"),
    [
        ({"replaces": "8/2024"}, "8/2024 is not in the register.*did you mean 7/2024"),
        ({"customer": " "}, "is a draft: customer"),
        ({"replaces": "7/2024", "date_of_issue": "1995-01-01"}, "before the day of issue"),
    ],
)
def test_nothing_is_written_for_a_bad_certificate(
    certificate, expected, tmp_path, record, register
):
    issue(register, [write_results(tmp_path, record, "7/2024")])
    before = register.read_bytes()
    with pytest.raises(InputError, match=expected):
        issue(register, [write_results(tmp_path, record, "9/2024", **certificate)])
    assert register.read_bytes() == before


def test_a_withdrawn_certificate_stays_withdrawn(tmp_path, record, register):
    issue(register, [write_results(tmp_path, record, "7/2024")])
    assert withdraw(register, "7/2024", "=tank deformed", "1999-01-01").state == "withdrawn"
    assert read_certificates(register)["7/2024"].reason == "=tank deformed"
    with pytest.raises(InputError, match="already withdrawn on 1999-01-01"):
        withdraw(register, "7/2024", "again", "1999-01-02")
    with pytest.raises(InputError, match="no such register"):
        withdraw(tmp_path / "no.csv", "7/2024", "again", "1999-01-02")


def test_registers_of_spreadsheets_keep_their_separator(tmp_path, record, register):
    register.write_text(HEAD.replace(",", ";") + "issued;1990-01-01;1;T-1;;;;", encoding="utf-8")
    issue(register, [write_results(tmp_path, record, "7/2024")])
    rows = list(csv.reader(register.read_text(encoding="utf-8").splitlines(), delimiter=";"))
    assert [row[2] for row in rows] == ["number", "1", "7/2024"]
    assert set(map(len, rows)) == {8}


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ("isued,1990-01-01,1,T,,,,\n", ["row 2, event"]),
        ("issued,1990-13-01,1,T,,,,\n", ["row 2, date"]),
        ("issued,1990-01-01,,T,,,,\n", ["row 2, number"]),
        ("withdrawn,1990-01-01,1,T,,,,x\n", ["row 2: number 1 is not in the register"]),
        (
            "issued,1990-01-01,1,T,,,,\nissued,1990-01-02,1,T,,,,\nissued,1990-01-02,1,T,,,,\n",
            ["row 3: number 1 was issued", "row 4: number 1 was issued"],
        ),
    ],
)
def test_a_damaged_register_is_refused_row_by_row(rows, expected, register):
    register.write_text(HEAD + rows, encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read_certificates(register)
    lines = str(refused.value).splitlines()
    assert len(lines) == len(expected)
    assert all(part in line for part, line in zip(expected, lines, strict=True))


def test_options_that_do_not_fit(register, capsys):
    assert main(["register", str(register), "--withdraw", "1", "--issue", "x"]) == 2
    assert main(["register", str(register), "--reason", "x", "--date", "1990-1-1"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 5
    assert not register.exists()


@pytest.mark.slow
def test_history_shows_states_and_numbers_of_other_records(tmp_path, register, capsys):
    job = shutil.copytree(EXAMPLE, tmp_path / "job", ignore=shutil.ignore_patterns("results"))
    assert main(["run", str(job), "--out", str(tmp_path / "out"), "--no-papers", "--quiet"]) == 0
    number = "RECONSTRUCTION-1"
    register.write_text(
        f"{HEAD}issued,1995-07-20,{number},SILVA-1995,1995-06-30,{'0' * 64},,\n", encoding="utf-8"
    )
    withdraw(register, number, "moved", "1999-01-01")
    capsys.readouterr()
    arguments = ["history", str(tmp_path / "out"), "--register", str(register)]
    assert main([*arguments, "--out", str(tmp_path / "history"), "--quiet"]) == 0
    said = capsys.readouterr()
    assert f"{number}, withdrawn 1999-01-01" in said.out
    assert "registered for another record" in said.err
    history = json.loads((tmp_path / "history" / "history.json").read_text(encoding="utf-8"))
    assert history["certificates"][0]["state"] == "withdrawn"
    rows = list(csv.DictReader((tmp_path / "history" / "certificates.csv").open(encoding="utf-8")))
    assert rows[0]["state"] == "withdrawn"
    assert main(["history", str(tmp_path / "out"), "--json"]) == 0
    assert "state" not in json.loads(capsys.readouterr().out)["certificates"][0]
