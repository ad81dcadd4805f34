"""Results of the camera and plans of every released version are read; keys keep to the version."""

import json

import numpy as np
import pytest
from kept_results import FREE, KEPT, kept_files, keys_file, read
from schemas import SAVED, keys_in, keys_of_schema

from tankcal.calibration.product import check_product
from tankcal.errors import InputError
from tankcal.planning import load_plan, predict
from tankcal.record.camera import plain_product
from tankcal.record.plan import PLAN, plain_of
from tankcal.record.schema import check_data, from_plain, to_plain
from tankcal.record.versions import CAMERA
from tankcal.report import camera as camera_papers
from tankcal.report.camera.paper import load
from tankcal.report.planning import empty_job

pytest_plugins = ("camera_results",)

ALL = kept_files()
WHAT_TO_DO = """The keys are not those of the version any more: count VERSION up in versions.py, say
in a step what an older file gets for each new key, write the schema of the new one
(make schemas), and keep results of it with the list of their keys (tests/kept_results.py)."""


def listed_keys(saved_format, version, kind="plan"):
    path = KEPT / saved_format.name / str(version) / f"{kind}.json.gz"
    return set(keys_file(path).read_text(encoding="utf-8").split())


def assert_is_of_its_schema(saved, saved_format):
    """Every key is there, none is unknown, every value is of its type."""
    schema = saved_format.schema(saved.get("kind"))
    assert check_data(saved, schema, "kept") == ([], [])
    unknown = keys_in(saved, FREE) - keys_of_schema(schema, optional=True)
    assert unknown == set()


def short(value):
    """The id of a parameter, the same in every process: no address of a function in it."""
    return getattr(value, "name", str(value))


@pytest.mark.slow
@pytest.mark.parametrize("kind", CAMERA.kinds)
def test_no_key_of_a_result_comes_or_goes_without_the_version(kind, results):
    result = json.loads(json.dumps(results[kind]))
    assert result["format"] == CAMERA.format
    assert keys_in(result, FREE) == listed_keys(CAMERA, CAMERA.version, kind), WHAT_TO_DO
    assert_is_of_its_schema(result, CAMERA)


@pytest.mark.slow
def test_no_key_of_a_plan_comes_or_goes_without_the_version():
    from plan_folders import PLAN as EXAMPLE

    plan = plain_of(predict(load_plan(EXAMPLE)))
    assert plan["format"] == PLAN.format
    listed = {key for key in listed_keys(PLAN, PLAN.version) if not key.startswith("simulated.")}
    assert keys_in(plan, FREE) | {"job[].file", "job[].sha256"} == listed, WHAT_TO_DO
    assert_is_of_its_schema(json.loads(json.dumps(plan)), PLAN)


def test_every_released_version_of_every_kind_is_kept():
    kept = {(one.name, version, path.name) for one, version, path in ALL}
    for version in range(1, CAMERA.version + 1):
        assert {(CAMERA.name, version, f"{kind}.json.gz") for kind in CAMERA.kinds} <= kept
    assert (PLAN.name, PLAN.version, "plan.json.gz") in kept


@pytest.mark.parametrize(("saved_format", "version", "path"), ALL, ids=short)
def test_a_kept_file_is_read_as_one_of_this_version(saved_format, version, path):
    saved = read(path)
    before = json.dumps(saved)
    assert saved_format.version_of(saved) == version
    assert keys_in(saved, FREE) == listed_keys(saved_format, version, saved.get("kind", "plan"))
    found = saved_format.migrated(saved, "kept")
    assert json.dumps(saved) == before
    assert found["format"] == saved_format.format
    assert_is_of_its_schema(found, saved_format)
    (cls,) = (cls for one, kind, cls in SAVED if (one, kind) == (saved_format, found.get("kind")))
    assert to_plain(from_plain(cls, found)) == found


def test_a_check_of_the_plan_alone_is_read():
    """Its differences have no z."""
    found = check_product(np.array([[0.1, 0.2], [0.0, -0.1], [-0.1, 0.1]]), ("x", "y"))
    saved = json.loads(json.dumps(plain_product(found)))
    assert set(saved["differences"][0]) == {"point", "dx_m", "dy_m"}
    assert CAMERA.migrated(saved, "camera.json") == saved


@pytest.mark.parametrize(
    "path", [path for one, _, path in ALL if one is CAMERA], ids=lambda path: str(path)[-30:]
)
def test_the_lines_of_a_kept_result_are_made(path):
    assert len(camera_papers.lines(read(path))) > 5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": "tankcal-camera/9"}, "found format 'tankcal-camera/9', expected"),
        ({"format": 2}, "found format 2, expected"),
        ({"kind": "weather"}, "found kind 'weather'; expected one of"),
        ({"kind": []}, "found kind"),
        ({"pairs": [{}]}, "tankcal-camera/1 without pairs"),
        ({"conventions": [7]}, "what a file of that version holds"),
    ],
    ids=str,
)
def test_what_cannot_be_read_is_refused_in_one_line(change, words, tmp_path):
    (saved,) = (read(path) for one, version, path in ALL
                if (one, version, path.name) == (CAMERA, 1, "stability.json.gz"))  # fmt: skip
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(saved | change), encoding="utf-8")
    with pytest.raises(InputError, match=words) as told:
        load(path)
    assert len(told.value.problems) == 1


def test_plan_of_later_version_is_not_replaced(tmp_path):
    (tmp_path / "job").mkdir()
    (tmp_path / "plan.json").write_text('{"format": "tankcal-plan/9"}', encoding="utf-8")
    with pytest.raises(InputError, match="tankcal-plan/9"):
        empty_job.refuse_filled(tmp_path / "job", tmp_path / "plan.json")
