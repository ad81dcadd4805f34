"""Batches by workers of dask: the same bytes, and what is left when something is killed.

Truth: the batch in one process; how many times a job was begun is counted in the journal.
"""

import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from background import heed_ctrl_c
from batch_jobs import (
    DEADLY,
    bytes_of,
    do_or_die,
    do_slowly,
    jobs_in,
    journal_of,
    spoil,
    wait_until,
    write_jobs,
)

from tankcal.errors import InputError
from tankcal.products.batch import running
from tankcal.products.batch.outcomes import Options
from tankcal.products.batch.running import Callbacks, run_batch

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow

LIGHT = Options(papers=False)
JOBS = 6
BATCH = """
import sys
from tankcal.products.batch import running
from tankcal.cli import main
from batch_jobs import do_slowly
running.do_job = do_slowly
if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Jobs, one of which is refused, and what one process makes of them."""
    folder = tmp_path_factory.mktemp("site")
    write_jobs(folder / "jobs", JOBS)
    spoil(folder / "jobs" / "T-3")
    assert run_batch([str(folder / "jobs")], LIGHT, folder / "one", workers=0).exit_status == 2
    return folder


@pytest.fixture(scope="module")
def helpers():
    """The environment in which workers find what they do in these tests."""
    before = os.environ.get("PYTHONPATH")
    tests = Path(__file__).parents[1]
    paths = [str(tests), str(tests / "support"), *([before] if before else [])]
    os.environ["PYTHONPATH"] = os.pathsep.join(paths)
    yield
    os.environ.pop("PYTHONPATH")
    if before:
        os.environ["PYTHONPATH"] = before


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def workers_of(out):
    return {int(one["worker"].split(":")[1]) for one in journal_of(out, "begun")}


def test_the_death_of_a_worker_loses_nothing(site, tmp_path, helpers, monkeypatch):
    monkeypatch.setattr(running, "do_job", do_slowly)
    out, told = tmp_path / "out", []

    def kill_one():
        wait_until(lambda: (out / "journal.jsonl").exists() and jobs_in(out, "begun"))
        os.kill(min(workers_of(out)), signal.SIGKILL)

    killer = threading.Thread(target=kill_one)
    killer.start()
    batch = run_batch([str(site / "jobs")], LIGHT, out, workers=2,
                      callbacks=Callbacks(ended=lambda *row: told.append(row)))  # fmt: skip
    killer.join()
    assert bytes_of(out) == bytes_of(site / "one")  # with 0 and 2 workers, one of which died
    assert [(name, status) for name, status, *_ in told] == [("T-3", "refused")]
    assert batch.counts == {"done": JOBS - 1, "refused": 1}
    assert len(jobs_in(out, "begun")) == JOBS + 1
    assert sorted(jobs_in(out, "ended")) == [f"T-{one}" for one in range(JOBS)]


def test_a_job_that_kills_its_workers_stops_no_other(site, tmp_path, helpers, monkeypatch):
    monkeypatch.setattr(running, "do_job", do_or_die)
    shutil.copytree(site / "jobs" / "T-5", tmp_path / DEADLY)
    out, told = tmp_path / "out", []
    sources = [str(tmp_path / DEADLY), *(str(site / "jobs" / f"T-{one}") for one in range(3))]
    batch = run_batch(sources, LIGHT, out, workers=1,
                      callbacks=Callbacks(ended=lambda *row: told.append(row)))  # fmt: skip
    assert batch.counts == {"done": 3, "failed": 1}
    ((name, status, problems, _),) = told
    assert (name, status, problems[0]["code"]) == (DEADLY, "failed", "batch_killer")
    assert jobs_in(out, "begun").count(DEADLY) == running.TRIES
    assert sorted(jobs_in(out, "ended")) == ["T-0", "T-1", "T-2"]
    for name in ("T-0", "T-1", "T-2"):
        assert bytes_of(out / "jobs" / name) == bytes_of(site / "one" / "jobs" / name)
    monkeypatch.undo()  # by the next batch it is tried again
    assert run_batch(sources, LIGHT, out, workers=0).counts == {"done": 4}


def start(site, out, *more):
    command = [sys.executable, "-c", BATCH, "batch", str(site / "jobs"), "--out", str(out),
               "--no-papers", "--quiet", *more]  # fmt: skip
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL,
                            text=True, start_new_session=True, preexec_fn=heed_ctrl_c)  # fmt: skip


def ended(out):
    return jobs_in(out, "ended") if (out / "journal.jsonl").exists() else []


def test_kill_9_in_the_middle_and_on(site, tmp_path, helpers):
    out = tmp_path / "out"
    child = start(site, out, "--workers", "2")
    wait_until(lambda: len(ended(out)) >= 2)
    workers = workers_of(out)
    child.kill()
    child.communicate()
    wait_until(lambda: not any(map(alive, workers)))  # they do not outlive it
    done = set(ended(out))
    assert 2 <= len(done) < JOBS
    begun = jobs_in(out, "begun")
    batch = run_batch([str(site / "jobs")], LIGHT, out, workers=0)
    again = jobs_in(out, "begun")[len(begun) :]
    assert batch.skipped == len(done)
    assert done.isdisjoint(again)  # nothing that was done is begun again
    assert len(again) == len(set(again)) == JOBS - len(done)
    assert bytes_of(out) == bytes_of(site / "one")


def test_ctrl_c_in_the_middle_and_on(site, tmp_path, helpers):
    out = tmp_path / "out"
    child = start(site, out, "--workers", "1")
    wait_until(lambda: len(ended(out)) >= 1)
    os.killpg(child.pid, signal.SIGINT)  # as a terminal does: to the workers, too
    told = child.communicate(timeout=60)[1].splitlines()
    assert child.returncode == 130
    assert len([one for one in told if "tankcal batch" in one or "go" in one]) == 1, told
    assert len(told) <= 2, told  # that line, and T-3 where it was come to
    done = set(ended(out))
    batch = run_batch([str(site / "jobs")], LIGHT, out, workers=0)
    assert batch.skipped == len(done)
    assert bytes_of(out) == bytes_of(site / "one")


CLUSTER = """
import sys
from distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


@pytest.fixture
def scheduler(tmp_path):
    """A cluster in a process of its own: (address, process)."""
    path = tmp_path / "cluster.py"
    path.write_text(CLUSTER)
    with subprocess.Popen([sys.executable, str(path)], stdin=subprocess.PIPE, cwd=tmp_path,
                          stdout=subprocess.PIPE, text=True) as child:  # fmt: skip
        yield child.stdout.readline().strip(), child
        child.stdin.close()
        child.wait(timeout=30)


def test_a_scheduler_by_its_address_and_its_end(site, tmp_path, helpers, scheduler, monkeypatch):
    address, child = scheduler
    batch = run_batch([str(site / "jobs")], LIGHT, tmp_path / "out", workers=address)
    assert batch.exit_status == 2
    assert bytes_of(tmp_path / "out") == bytes_of(site / "one")
    monkeypatch.setattr(running, "do_job", do_slowly)
    out = tmp_path / "cut"

    def end():
        wait_until(lambda: len(ended(out)) >= 1)
        child.kill()

    killer = threading.Thread(target=end)
    killer.start()
    with pytest.raises(InputError, match="--cluster"):
        run_batch([str(site / "jobs")], LIGHT, out, workers=address)
    killer.join()
    monkeypatch.undo()
    done = len(set(ended(out)))
    assert run_batch([str(site / "jobs")], LIGHT, out, workers=0).skipped >= done
    assert bytes_of(out) == bytes_of(site / "one")


def test_addresses_where_nobody_is(site, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(InputError, match="no scheduler of dask answers"):
        run_batch([str(site / "jobs")], LIGHT, tmp_path / "out", workers=f"127.0.0.1:{port}")
