"""Months of many tanks by workers of dask, killed in the middle and resumed.

Truth: the same months computed by one process without interruption.
"""

import os
import shutil
import subprocess
import sys

import pytest
from background import heed_ctrl_c
from batch_jobs import jobs_in, journal_of, wait_until
from conftest import EXAMPLE
from example_logs import make_station

from tankcal import cli
from tankcal.products.batch.outcomes import Options
from tankcal.products.batch.running import run_batch

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow

TANKS = 5
OPTIONS = Options(steps=("upkeep",), papers=False)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Folders of tanks with three months of logs, and the logs of the fourth month."""
    place = tmp_path_factory.mktemp("site")
    shutil.copytree(EXAMPLE.parent / "rings", place / "rings")
    assert cli.main(["run", str(place / "rings"), "--no-papers", "--quiet"]) == 0
    make_station(place / "rings" / "results" / "record.json", place / "made", 240)
    logs = sorted((place / "made" / "first").glob("*-2025-0*.csv"))
    month = [path for path in logs if "2025-04" in path.name]
    for path in logs:
        if path.name[-6:-4] > "04":
            path.unlink()
    (place / "month").mkdir()
    for path in month:
        path.rename(place / "month" / path.name)
    for number in range(TANKS):
        shutil.copytree(place / "made" / "first", place / "tanks" / f"S-{number}")
    return place


def ended(out):
    return jobs_in(out, "ended") if (out / "journal.jsonl").exists() else []


def test_a_killed_month_is_resumed_without_loss(site, tmp_path):
    tanks, out = [str(site / "tanks")], tmp_path / "out"
    assert run_batch(tanks, OPTIONS, out, workers=0).counts == {"done": TANKS}
    first = journal_of(out, "ended")
    assert len(list((out / "jobs" / "S-0" / "state").iterdir())) > 3
    for number in range(TANKS):
        shutil.copytree(site / "month", site / "tanks" / f"S-{number}", dirs_exist_ok=True)
    command = [sys.executable, "-m", "tankcal", "batch", *tanks, "--do", "upkeep", "--no-papers",
               "--out", str(out), "--workers", "2", "--quiet"]  # fmt: skip
    child = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=dict(os.environ),
        start_new_session=True, preexec_fn=heed_ctrl_c,
    )  # fmt: skip
    wait_until(lambda: len(ended(out)) > len(first))
    child.kill()
    child.wait()
    done = set(ended(out)[TANKS:])
    assert 1 <= len(done) < TANKS
    batch = run_batch(tanks, OPTIONS, out, workers=0)
    assert batch.skipped >= len(done)
    # Equal to the months in one process, and to all months without state.
    assert run_batch(tanks, OPTIONS, tmp_path / "whole", workers=0).counts == {"done": TANKS}
    for number in range(TANKS):
        name = f"jobs/S-{number}/upkeep/upkeep.json"
        assert (out / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert not list(out.rglob("*.part"))
