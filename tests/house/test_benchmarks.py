"""The benchmarks' results as data, the guard over their ratios, the page that is made of them."""

import json
import math
import sys
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from jacobians import assert_derivative

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "benchmarks"), str(ROOT / "benchmarks" / "adjustment")]
guard, measured, page, peers, projection, run, volumes = map(
    import_module, ("guard", "measured", "page", "peers", "projection", "run", "volumes")
)
Growth, Row, Skipped = measured.Growth, measured.Row, measured.Skipped

MACHINE = {"processor": "P", "cores": 2, "kernel": "K", "versions": {"numpy": "2"}}


def row(peer_s=(4.0, 6.0), **more):
    return Row("task", "9 rows", (1.0, 2.0), "peer", "1.2", peer_s, **more)


def results_of(*rows):
    """What a run writes of these rows, through the file in which they are kept."""
    lines = [
        json.dumps({"kind": kind, **vars(one)})
        for one in rows
        for kind, made in measured.KINDS.items()
        if isinstance(one, made)
    ]
    return {"date": "2026-01-02", "version": "0.1", "rounds": 2, "machine": MACHINE,
            "others_cores": 1.5, **measured.gathered(lines)}  # fmt: skip


def released_with(ratio):
    return {"release": "0.1.0", "date": "2026-01-01", "machine": MACHINE,
            "ratios": {"task, against peer": ratio}}  # fmt: skip


def test_ratio_is_the_median_of_rounds():
    """Closed form: 4 / 1 and 6 / 2."""
    assert row().ratio == (3.5, 3.0, 4.0)
    assert row(peer_s=(8.0,)).ratio == (8.0, 8.0, 8.0)
    assert Row("alone", "", (1.0,)).ratio is None


@pytest.mark.parametrize("digits", [(4.9, 9.0), (9.0, 4.9)])
def test_wrong_answer_has_no_ratio(digits):
    wrong = row(answer="cost", digits=digits, least=5.0)
    assert wrong.ratio is None
    assert guard.ratios_of(results_of(wrong)) == {}
    assert row(answer="cost", digits=(5.0, None), least=5.0).ratio is not None


def test_digits():
    """Closed form; the worst of an array; what is no number has none."""
    assert measured.digits_of([2.0, 1.0001], [2.0, 1.0]) == 4.0
    assert measured.digits_of(np.nan, 1.0) == 0.0


def test_results_come_back_as_they_were_told(tmp_path, monkeypatch, capsys):
    told = [row(answer="cost", digits=(9.0, None)), Skipped("task", "other", "no wheel"),
            Growth("rows", "rows", (10, 100), (1.0, 100.0))]  # fmt: skip
    monkeypatch.setenv("BENCHMARKS", str(tmp_path / "told"))
    for one in told:
        measured.tell(one)
    found = measured.read(measured.gathered((tmp_path / "told").read_text().splitlines()))
    assert [one for rows in found.values() for one in rows] == told
    assert capsys.readouterr().out.splitlines() == [measured.line_of(one) for one in told]
    assert told[2].slopes == pytest.approx([2.0])  # closed form


def test_guard_tells_a_fall_of_more_than_a_fifth():
    """3.5 against 4.4 is a fall of 20.5 %."""
    (line,) = guard.fallen(results_of(row()), released_with(4.4))
    assert "task, against peer" in line
    assert "20 %" in line
    assert "P" not in line  # the same machine


@pytest.mark.parametrize("then", [4.3, 3.5, 1.0])
def test_guard_is_quiet_otherwise(then):
    assert guard.fallen(results_of(row()), released_with(then)) == []


def test_guard_names_another_machine_and_leaves_out_what_was_not_measured():
    other = released_with(10.0) | {"machine": MACHINE | {"processor": "Q"}}
    (line,) = guard.fallen(results_of(row()), other)
    assert "another machine (Q)" in line
    other["machine"] = MACHINE | {"versions": {"numpy": "1"}}
    (line,) = guard.fallen(results_of(row()), other)
    assert line.endswith("at 0.1.0 with numpy 1")
    assert guard.fallen(results_of(), other) == []


@pytest.mark.parametrize("released", [10.0, 1.0])
def test_a_fall_changes_no_status_and_a_wrong_answer_does(released, tmp_path, monkeypatch, capsys):
    kept = tmp_path / "released.json"
    kept.write_text(json.dumps(released_with(released)))
    monkeypatch.setattr(run, "RELEASED", kept)
    assert run.tell_all(results_of(row()), []) == 0
    assert ("fell by" in capsys.readouterr().out) == (released > 5)
    wrong = row(answer="cost", digits=(1.0, 9.0), least=5.0)
    assert run.tell_all(results_of(wrong), []) == 1
    assert "wrong answer of tankcal: task" in capsys.readouterr().out
    peer_wrong = row(answer="cost", digits=(9.0, 1.0), least=5.0)
    assert run.tell_all(results_of(peer_wrong), []) == 0
    assert run.tell_all(results_of(row()), ["wall"]) == 1


def test_release_keeps_ratios_with_day_and_machine():
    kept = guard.kept(results_of(row()), "0.2.0")
    assert kept["release"] == "0.2.0"
    assert kept["ratios"] == {"task, against peer": 3.5}
    assert guard.fallen(results_of(row()), kept) == []


def test_page_has_every_result_and_keeps_its_prose():
    text = f"# Title\n\n{page.BEGIN}\nold\n{page.END}\n\nafter\n"
    given = results_of(
        row(note="in C"),
        Row("alone", "", (1.0,), memory_mb=7.0),
        Skipped("task", "other", "no wheel"),
        Growth("g", "n", (1, 2), (1, 2)),
    )
    made = page.filled(text, given, released_with(10.0))
    assert made.startswith("# Title")
    assert made.endswith("after\n")
    assert "old" not in made
    cells = [[one.strip() for one in line.strip("|").split("|")]
             for line in made.splitlines() if line.startswith("|")]  # fmt: skip
    assert ["task", "other", "no wheel"] in cells
    assert ["g", "1, 2 n", "1.00 s, 2.00 s", "", "1.00", ""] in cells
    assert ["alone", "", "1.00 s", "7 MB", ""] in cells
    assert "peer 1.2; in C" in [one[3] for one in cells if len(one) == 7]
    assert "fell by 65 %" in made
    assert page.filled(made, given, released_with(10.0)) == made
    assert "None fell" in page.filled(made, given, released_with(3.5))
    with pytest.raises(ValueError, match="lacks"):
        page.filled("# Title", given, released_with(1.0))


def test_kept_page_says_on_what_it_was_made():
    text = (ROOT / "docs/studies/benchmarks.md").read_text(encoding="utf-8")
    inside = text.partition(page.BEGIN)[2].partition(page.END)[0]
    for what in ("day", "tankcal", "processor", "kernel", "Python", "numpy", "BLAS"):
        assert f"| {what} | " in inside
    released = json.loads(guard.RELEASED.read_text(encoding="utf-8"))
    assert released["release"] in inside
    assert released["ratios"]


def test_site_shows_the_run_that_was_made_with_it(tmp_path, monkeypatch):
    spec = spec_from_file_location("stage_of_site", ROOT / "docs" / "stage.py")
    stage = module_from_spec(spec)
    spec.loader.exec_module(stage)
    results = tmp_path / "benchmarks.json"
    results.write_text(json.dumps(results_of(Row("a task of this run", "", (1.0,)))))
    monkeypatch.setattr(stage, "RESULTS", results)
    kept = (ROOT / "docs/studies/benchmarks.md").read_text(encoding="utf-8")
    assert "a task of this run" not in kept
    assert "| a task of this run |" in stage.with_results(kept)


def test_every_benchmark_is_there():
    assert [name for name in run.BENCHMARKS if not (ROOT / f"benchmarks/{name}.py").exists()] == []


def test_processor_of_others_is_no_less_than_none():
    assert run.machine()["cores"] >= 1
    assert run.others(run.now()) is None or run.others(run.now()) >= 0


def test_absent_peer_is_named_with_what_the_installer_said(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    assert measured.peer_module("no_such_peer", "task") is None
    (tmp_path / "errors.json").write_text('{"no_such_peer": "no wheel"}')
    assert measured.peer_module("no_such_peer", "task") is None
    told = capsys.readouterr().out.splitlines()
    assert told[0].startswith("task: no_such_peer left out: No module")
    assert told[1] == "task: no_such_peer left out: no wheel"


def test_error_of_the_installer_in_one_line_without_addresses():
    text = "WARNING: x\nERROR: no wheel at https://a.example/simple for it\n"
    assert peers.told(text) == "no wheel at ... for it"


def test_image_of_the_peers_has_its_derivatives():
    io = np.array([100.02, 0.03, -0.04, 2.0, -1.1, 0.4, 3.0, -2.0, 1.2, -0.8])
    x = np.concatenate([io, [1.0, -12.0, 1.6, 0.1, 0.2, -0.3], [-0.8, 2.0, 4.0]])

    def at(x):
        return projection.image(x[:10], x[10:16], x[16:], math.sin, math.cos)

    assert_derivative(lambda x: np.array(at(x)[0]), x, np.array(at(x)[1:]))


def test_torispherical_answer_is_that_of_turned_sections():
    """Second method: a full tank is its cylinder and two bodies turned about the axis."""
    inner, high = 0.96, math.sqrt(2.16**2 - 0.96**2)
    joint, tip = 0.24 * high / 2.16, 2.4 - high
    x = np.linspace(0, joint, 200_001)
    knuckle = np.trapezoid((inner + np.sqrt(0.24**2 - x**2)) ** 2, x)
    dish = 2.4**2 * (tip - joint) - ((tip + high) ** 3 - (joint + high) ** 3) / 3
    full = np.pi * (1.2**2 * 10 + 2 * (knuckle + dish))
    found = volumes.torispherical_m3(np.array([1.2, 2.4]))
    assert found[1] == pytest.approx(full, rel=1e-11)
    assert found[0] == pytest.approx(full / 2, rel=1e-11)
