"""Packages: sealed, the same again, and broken ones refused."""

import hashlib
import json
import re

import pytest
from packages import (
    METHODS,
    NONCE,
    SECRET,
    answers_of,
    made_package,
    write_answers,
    written_package,
)

from tankcal.errors import InputError
from tankcal.job import load
from tankcal.job.tables import Log
from tankcal.products.intercomparison.answers import score_folders
from tankcal.products.intercomparison.command import METHODS as NAMED
from tankcal.products.intercomparison.observers import METHODS as ALL
from tankcal.products.intercomparison.package import load_package, make_package
from tankcal.products.intercomparison.tank import tank_of


@pytest.mark.slow
def test_commitment_is_the_hash_of_the_file(tmp_path):
    _, truth, manifest, _ = written_package(tmp_path)
    assert manifest["truth_sha256"] == hashlib.sha256(truth.read_bytes()).hexdigest()


def test_the_public_part_says_nothing_of_the_truth():
    made = made_package()
    truth = json.loads(made.truth)
    text = b"\n".join(data for name, data in made.files.items() if not name.endswith(".las"))
    for secret in (SECRET, NONCE, '"seed"', f"{truth['tanks'][0]['volume_m3'][-1]:.3f}"):
        assert secret.encode() not in text


@pytest.mark.slow
def test_seed_and_secret_make_the_same_again():
    again = make_package(2, 1, METHODS, secret=SECRET, nonce=NONCE)
    assert again == made_package()
    other = make_package(1, 1, METHODS[:1], secret="00" * 32, nonce=NONCE)
    assert other.files["T01/points/points.csv"] != again.files["T01/points/points.csv"]


@pytest.mark.slow
def test_methods_do_not_hang_on_each_other():
    """A package of fewer tanks and methods has the same files of them."""
    fewer = make_package(1, 1, METHODS[1:], secret=SECRET, nonce=NONCE)
    for name, data in fewer.files.items():
        if "/" in name:
            assert made_package().files[name] == data


def test_truth_can_be_computed_again():
    one = json.loads(made_package().truth)["tanks"][1]
    found = tank_of(one["shape"]).volumes_m3(one["heights_m"], 850.0)
    assert found.tolist() == one["volume_m3"]


def test_every_column_is_explained():
    columns = made_package().files["COLUMNS.md"].decode()
    rows = re.findall(r"^\| `(.+)` \| (.*) \|$", columns, re.MULTILINE)
    assert len(rows) > 60
    assert [name for name, note in rows if len(note.strip()) < 5] == []


@pytest.mark.slow
def test_all_methods_load_as_jobs(tmp_path):
    from tankcal.products.intercomparison.package import write_files

    made = make_package(1, 4, tuple(ALL), secret=SECRET, nonce=NONCE)
    write_files(tmp_path, made.files)
    for method in ALL:
        load(tmp_path / "T01" / method)
    assert sum(map(len, made.files.values())) < 1e7  # 10 tanks below 100 MB


def told(call, *arguments, **more):
    with pytest.raises(InputError) as caught:
        call(*arguments, **more)
    return [str(one) for one in caught.value.problems]


def test_a_changed_truth_is_refused(tmp_path):
    package, truth, manifest, content = written_package(tmp_path)
    answers = write_answers(tmp_path / "a", answers_of(manifest, content))
    score_folders([answers], truth, package)
    truth.write_bytes(truth.read_bytes().replace(b'"seed": 1', b'"seed": 2'))
    problems = told(score_folders, [answers], truth)
    assert len(problems) == 1
    assert "participant.toml" in problems[0]
    problems = told(score_folders, [answers], truth, package)
    assert len(problems) == 1
    assert problems[0].startswith("manifest.json: names the truth")


def test_a_changed_package_is_refused(tmp_path):
    package, *_ = written_package(tmp_path)
    (package / "T01" / "points" / "points.csv").write_text("point\n", encoding="utf-8")
    (package / "T02" / "total-station" / "wall_hits.csv").unlink()
    log = Log()
    assert load_package(package, log) is None
    assert [one.file for one in log.problems] == [
        "T01/points/points.csv",
        "T02/total-station/wall_hits.csv",
    ]


def test_a_manifest_that_leads_out_of_the_package_is_refused(tmp_path):
    package, *_ = written_package(tmp_path)
    path = package / "manifest.json"
    path.write_text(path.read_text("utf-8").replace("COLUMNS.md", "../sealed/truth.json"), "utf-8")
    log = Log()
    assert load_package(package, log) is None
    assert len(log.problems) == 1


@pytest.mark.parametrize("text", ["", "{", "[1]", "null", '{"format": 1}', "[" * 5000, "\x00"])
def test_no_truth_is_told(tmp_path, text):
    _, truth, manifest, content = written_package(tmp_path)
    answers = write_answers(tmp_path / "a", answers_of(manifest, content))
    truth.write_text(text, encoding="utf-8")
    assert len(told(score_folders, [answers], truth)) == 1


def test_the_command_names_every_method():
    """The parser has their names by itself: to load the crews takes long."""
    assert tuple(ALL) == NAMED
