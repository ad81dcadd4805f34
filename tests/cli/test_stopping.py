"""A command that ends early: what it says, its exit status, and what it leaves."""

import io
import json
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
from job_builder import write_job

from tankcal.cli import main
from tankcal.record import manifest
from tankcal.report.folders import PREFIX
from tankcal.terminal import EndingSignal, raise_at_signals, signal_status

needs_signals = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")


@needs_signals
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_signal_is_told_as_ctrl_c_is(monkeypatch, capsys, name):
    from tankcal.products.linter import command as linting

    number = getattr(signal, name)
    usual = signal.signal(number, signal.SIG_DFL)  # the tests may run under nohup
    try:
        monkeypatch.setattr(linting, "_lint", lambda options: os.kill(os.getpid(), number))
        assert main(["lint", "table.csv"]) == 128 + number
        assert capsys.readouterr().err.startswith("tankcal: stopped; earlier results are unchanged")
        assert signal.getsignal(number) == signal.SIG_DFL
    finally:
        signal.signal(number, usual)


@needs_signals
def test_a_signal_that_is_ignored_remains_so():
    """As `nohup` asks for."""
    usual = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with raise_at_signals():
            os.kill(os.getpid(), signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, usual)


def test_status_of_an_ending():
    assert signal_status(ValueError()) is None
    assert signal_status(KeyboardInterrupt()) == 130
    assert signal_status(EndingSignal(15)) == 143
    with pytest.raises(AssertionError) as dressed:
        dress()
    assert signal_status(dressed.value) == 143


def dress():
    """As a library may do."""
    try:
        raise EndingSignal(15)
    except EndingSignal:
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
    for work in folder.glob(f"{PREFIX}*"):  # one without a lock may be new: it goes when it is old
        os.utime(work, (0, 0))
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
    assert {143, -signal.SIGKILL} <= end_runs(job, draws(16, 1000), np.random.default_rng(2))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are Linux's here")
def test_too_little_memory_is_told_in_a_line(tmp_path):
    """At every limit either complete results or one line.

    With 200 and 350 MB OpenBLAS would repeat its request for memory for ever while it is loaded.
    """
    folder = write_job(tmp_path / "job")
    import resource

    ends = set()
    for limit_mb in (60, 200, 350, 500, 520, 650, 1200):
        shutil.rmtree(folder / "results", ignore_errors=True)
        done = subprocess.run(
            [sys.executable, "-m", "tankcal", "run", str(folder), "--quiet"],
            capture_output=True, text=True, timeout=200, check=False,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit_mb << 20,) * 2),  # noqa: B023
        )  # fmt: skip
        ends.add(done.returncode)
        assert "Traceback" not in done.stderr
        if done.returncode:
            assert len(done.stderr.splitlines()) == 1
            assert not (folder / "results").exists()
        else:
            assert (folder / "results" / "report.pdf").is_file()
    assert ends == {0, 2}


@pytest.mark.parametrize(
    "error", [MemoryError(), ImportError("x.so: failed to map segment from shared object"),
              RuntimeError("can't start new thread"), OSError(12, "Cannot allocate memory")]
)  # fmt: skip
def test_want_of_memory_has_its_line(monkeypatch, capsys, error):
    def fail(*_):
        raise error

    monkeypatch.setattr("tankcal.cli.running._run", fail)
    monkeypatch.setattr("tankcal.cli.prepare_for_small_work", fail)
    assert main(["demo", "--quiet"]) == 2
    assert "not enough memory" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["stdin", "stdout", "stderr"])
def test_closed_streams_are_no_error(name, tmp_path, monkeypatch):
    """`>&-` of a shell, or a program without a terminal: Python has None for the stream."""
    monkeypatch.setattr(sys, name, None)
    assert main(["lint", str(tmp_path / "nowhere.csv"), "--json"]) == 2


def test_letters_in_the_locale_c(monkeypatch, tmp_path):
    """There Python escapes only undecodable bytes, not the letters that ASCII lacks."""
    output = io.BytesIO()
    stream = io.TextIOWrapper(output, encoding="ascii", errors="surrogateescape")
    monkeypatch.setattr(sys, "stderr", stream)
    assert main(["lint", str(tmp_path / "não.csv"), "--language", "pt-BR"]) == 2
    stream.flush()
    assert b"n\\xe3o.csv" in output.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8"])
def test_output_of_any_encoding(tmp_path, encoding):
    """In the language of a person whose terminal or file lacks a letter; JSON stays JSON."""
    environment = os.environ | {"PYTHONIOENCODING": encoding, "LANG": "es_ES.UTF-8"}
    for arguments in (["--help"], ["run", str(tmp_path / "não Ω"), "--json"]):
        done = subprocess.run(
            [sys.executable, "-m", "tankcal", *arguments], env=environment, capture_output=True
        )
        assert b"Traceback" not in done.stderr
    assert "não Ω" in json.loads(done.stdout.decode(encoding))["problems"][0]["file"]
