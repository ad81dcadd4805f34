"""What released versions kept: read, made into papers, and computed again of the jobs beside it.

A release without kept files fails here. To keep them: python tests/kept_releases.py, before the
day of the release is written into CHANGELOG.md (CONTRIBUTING.md, "A release").
"""

import json
import lzma

import numpy as np
import pytest
from kept_releases import JOBS, KEPT, SAVED, compute, kept_records, kept_saved, unpack, versions
from paper_cells import paper_blocks

import tankcal
from tankcal.record import load, migrated
from tankcal.record.recomputation import compare_records
from tankcal.report import comparison, history, inspection, outputs

PART_OF_U = 0.1  # by which a volume of a later version may differ from the kept one
PART_OF_u = 0.1
WHAT_TO_DO = """{version} has no kept files. Before its day stands in CHANGELOG.md:
python tests/kept_releases.py, and commit tests/releases/{version}."""


def of(path):
    return f"{path.parent.parent.name}-{path.parent.name}-{path.name.partition('.')[0]}"


def read(path):
    return json.loads(lzma.decompress(path.read_bytes()))


def test_a_version_that_is_released_is_in_the_changelog():
    """Between two releases the version has .dev, and the next number need not be known yet."""
    released, development, _ = tankcal.__version__.partition(".dev")
    assert development or released in versions()


@pytest.mark.parametrize("version", sorted(versions()))
def test_every_released_version_keeps_one_of_each_kind(version):
    """The version that is made, too: its day comes."""
    there = {path.parent.name for path in kept_records() if path.parent.parent.name == version}
    files = {path.name for path in kept_saved() if path.parent.parent.name == version}
    assert there >= set(JOBS), WHAT_TO_DO.format(version=version)
    assert files >= {f"{one.file}.xz" for one in SAVED}, WHAT_TO_DO.format(version=version)


def test_a_release_without_kept_files_is_missed(monkeypatch):
    """The test above can fail."""
    monkeypatch.setattr("kept_releases.KEPT", KEPT.with_name("nowhere"))
    with pytest.raises(AssertionError, match=r"tests/kept_releases\.py"):
        test_every_released_version_keeps_one_of_each_kind(tankcal.__version__)


@pytest.mark.slow(after=3)
@pytest.mark.parametrize("path", kept_records(), ids=of)
def test_a_kept_record_is_read(path, tmp_path):
    kept = read(path)
    assert kept["tankcal"] == path.parent.parent.name
    assert load(unpack(path, tmp_path)) == migrated(kept, "record.json")


@pytest.mark.slow
@pytest.mark.parametrize("path", kept_records(), ids=of)
def test_a_kept_record_gives_its_papers(path, tmp_path, monkeypatch):
    """Tables, workbook, XML, all cells of the papers; the pages are not set."""
    blocks = []
    monkeypatch.setattr(outputs, "build", lambda source, *_: blocks.extend(paper_blocks(source)))
    outputs.rebuild(unpack(path, tmp_path), tmp_path / "out")
    assert {one.suffix for one in (tmp_path / "out").iterdir()} >= {".csv", ".xlsx", ".json"}
    assert len(blocks) > 20


@pytest.mark.slow
@pytest.mark.parametrize("path", kept_records(), ids=of)
def test_a_kept_job_gives_its_numbers_again(path, tmp_path, figure):
    """Volumes within a tenth of U of those that were handed out, u within a tenth of itself.

    What changes by more is a correction of a mistake: CHANGELOG.md says it ("Numbers that
    changed"), and the kept record of that job is kept anew in the version that corrects it.
    """
    kept = load(unpack(path, tmp_path))
    found = compute(path.parent / "job", JOBS[path.parent.name][0])
    again = compare_records(kept, json.loads(json.dumps(found)))
    figure(f"kept {of(path)}, numbers that differ", again.different)
    if kept["capacity"] is None:
        was, now = ({one["point"]: one for one in each["points"]} for each in (kept, found))
        assert was.keys() == now.keys()
        for name, one in was.items():
            sd = np.sqrt(np.diag(np.array(one["cov_m2"])))
            off = [one[key] - now[name][key] for key in ("x_m", "y_m", "z_m")]
            assert np.all(np.abs(off) <= PART_OF_U * sd + 1e-9)
        return
    was, now = (
        {key: np.array(each["capacity"][key]) for key in ("height_m", "volume_m3", "u_m3")}
        for each in (kept, found)
    )
    np.testing.assert_allclose(now["height_m"], was["height_m"], rtol=0, atol=1e-9)
    U = 2 * was["u_m3"]
    assert np.all(np.abs(now["volume_m3"] - was["volume_m3"]) <= PART_OF_U * U + 1e-6)
    np.testing.assert_allclose(now["u_m3"], was["u_m3"], rtol=PART_OF_u, atol=1e-6)


@pytest.mark.parametrize("path", kept_saved(), ids=of)
def test_a_kept_saved_file_is_read(path):
    saved = read(path)
    (one,) = (one for one in SAVED if saved["format"].startswith(f"{one.name}/"))
    assert one.migrated(saved, one.file)["format"] == one.format


@pytest.mark.slow
@pytest.mark.parametrize("path", kept_saved(), ids=of)
def test_a_kept_saved_file_gives_its_papers(path, tmp_path):
    """Of a plan there is nothing that is made from its file alone."""
    rooms = {
        "comparison.json.xz": comparison, "history.json.xz": history,
        "inspection.json.xz": inspection,
    }  # fmt: skip
    if path.name not in rooms:
        pytest.skip("nothing is made of this file alone")
    written = rooms[path.name].rebuild(unpack(path, tmp_path), tmp_path / "out")
    assert any(one.suffix == ".pdf" for one in written)
