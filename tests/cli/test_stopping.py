"""A command that a signal ends: what it says, its exit status, and what it leaves."""

import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import EXAMPLE
from draws import draws

from tankcal.cli import main
from tankcal.cli.stopping import Ended, ended_by_signals, stopped_status
from tankcal.record import manifest
from tankcal.report.folders import PREFIX

needs_signals = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")


@needs_signals
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_signal_is_told_as_ctrl_c_is(monkeypatch, capsys, name):
    from tankcal.cli import linting

    number = getattr(signal, name)
    monkeypatch.setattr(linting, "_lint", lambda options: os.kill(os.getpid(), number))
    assert main(["lint", "table.csv"]) == 128 + number
    assert capsys.readouterr().err.startswith("tankcal: stopped; results are as they were")
    assert signal.getsignal(number) == signal.SIG_DFL


@needs_signals
def test_a_signal_that_is_ignored_remains_so():
    """As `nohup` asks for."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with ended_by_signals():
            os.kill(os.getpid(), signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


def test_status_of_an_ending():
    assert stopped_status(ValueError()) is None
    assert stopped_status(KeyboardInterrupt()) == 130
    assert stopped_status(Ended(15)) == 143
    with pytest.raises(AssertionError) as dressed:
        dress()
    assert stopped_status(dressed.value) == 143


def dress():
    """As a library may do."""
    try:
        raise Ended(15)
    except Ended:
        raise AssertionError from None


# ---- runs that are ended anywhere


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    """(a job with results, seconds that a run of it takes)."""
    folder = tmp_path_factory.mktemp("ended") / "tank"
    shutil.copytree(EXAMPLE, folder)
    run(folder)
    since = time.perf_counter()
    assert run(folder)[0] == 0
    return folder, time.perf_counter() - since


def run(folder, number=None, after_s=0.0):
    """(exit status, what it said) of a run that gets a signal after some time."""
    command = [sys.executable, "-m", "tankcal", "run", str(folder), "--no-papers", "--quiet"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as child:
        if number is not None:
            time.sleep(after_s)
            child.send_signal(number)
        said = child.communicate()[1]
    return child.returncode, said


def end_runs(job, count, rng):
    """Runs ended at random times, by kill -9 and SIGTERM in turn: nothing is lost or left."""
    folder, lasts_s = job
    results = folder / "results"
    ends = set()
    for i in range(count):
        number = (signal.SIGKILL, signal.SIGTERM)[i % 2]
        status, said = run(folder, number, rng.uniform(0.3, 1.05) * lasts_s)
        ends.add(status)
        assert "Traceback" not in said
        listed = manifest.read_manifest(results).digests
        assert sorted(listed) == manifest.files_below(results)
        assert all(manifest.digest_of(results / name) == listed[name] for name in listed)
        if number == signal.SIGTERM:
            assert status in (143, -signal.SIGTERM, 0)  # -SIGTERM: before the command began
    assert run(folder)[0] == 0
    assert not list(folder.glob(f"{PREFIX}*"))
    return ends


@needs_signals
@pytest.mark.slow
@pytest.mark.twentieth
def test_runs_that_are_ended_lose_nothing(job):
    assert {143, -signal.SIGKILL} <= end_runs(job, 12, np.random.default_rng(1))


@needs_signals
@pytest.mark.study
def test_runs_that_are_ended_lose_nothing_study(job):
    assert {143, -signal.SIGKILL} <= end_runs(job, draws(40, 1000), np.random.default_rng(2))
