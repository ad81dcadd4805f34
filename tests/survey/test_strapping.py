"""From the reading of a tape to a circumference: worked numbers, sizes of corrections, masters."""

import numpy as np
import pytest
from job_builder import S_1

from tankcal.survey.strapping import (
    Comparison,
    Obstruction,
    Strap,
    Strapping,
    Tape,
    certified,
    mean_tension_n,
    reduce_strap,
)

ROUND = Strapping((), ())
PLAIN = Tape("T")


def reduced(tape, reading_m=41.0, obstructions=(), diameter_m=13.0, shell_c=None, **strap):
    one = Strap("1a", "1", 0.4, reading_m, 0.0005, "T", **strap)
    return reduce_strap(one, tape, obstructions, shell_c, ROUND, diameter_m)


def test_tank_s_1():
    """Worked numbers: every circumference of the tank, to 0.01 mm, and radii to a micrometre."""
    tape = Tape("T", 35e-6, 0.0, 20.0, 50.0, 1.15e-5, 0.2e-3, stiffness_n=2.5 * 206e3)
    straps = {1: (45.32297, 45.32217), 2: (45.31697, 45.31537), 3: (45.31177, 45.31117),
              4: (45.30567, 45.30647), 5: (45.30387, 45.30327)}  # fmt: skip
    inside = (7.203189, 7.203171, 7.203422, 7.203563, 7.203165)
    butt, measured = (
        Obstruction("butt_strap", 4, 0.009, 0.12),
        Obstruction("measured", excess_m=2.3e-3),
    )
    for course, (_, plate_mm, *readings) in enumerate(S_1, 1):
        found = []
        for letter, reading in zip("ab", readings, strict=True):
            ways = [butt] if course == 1 else [measured] if (course, letter) == (2, "b") else []
            one = reduced(tape, reading, ways, 14.4, 31.0, tension_n=60.0)
            found.append(one.circumference_m)
        assert found == pytest.approx(straps[course], abs=6e-6)
        radius = np.mean(found) / (2 * np.pi) - (plate_mm + 0.25) / 1000
        assert radius * (1 - 11 * 1.1e-5) == pytest.approx(inside[course - 1], abs=1e-6)


def test_steps_of_tank_s_1():
    """Worked numbers: strain 19.4175e-6, half the tape's thickness 0.62832 mm, rise 3.0000 mm."""
    tape = Tape("T", 35e-6, 0.0, 20.0, 50.0, 1.15e-5, 0.2e-3, stiffness_n=2.5 * 206e3)
    butt = Obstruction("butt_strap", 4, 0.009, 0.12)
    steps = reduced(tape, 45.3184, [butt], 14.4, 31.0, tension_n=60.0).steps_m
    assert steps["tension"] / 45.3257 == pytest.approx(19.4175e-6, rel=1e-5)
    assert 1000 * steps["tape_thickness"] == pytest.approx(-0.62832, abs=1e-5)
    assert 1000 * steps["rise"] == pytest.approx(-3.0000, abs=1e-4)


def test_sizes_of_obstructions():
    """Worked numbers; two of them against plane geometry written out."""
    mm = 1e-3
    assert Obstruction("butt_strap", 6, 12 * mm, 100 * mm).excess(15.24) == pytest.approx(
        6.333 * mm, abs=1e-6
    )
    assert Obstruction("weld", 24, 10 * mm, 150 * mm).excess(40.0) == pytest.approx(
        11.919 * mm, abs=1e-6
    )
    assert Obstruction("step", 1, 8 * mm).excess(13.0) == pytest.approx(0.2646 * mm, abs=1e-7)
    assert Obstruction("lap", 1, 8 * mm).excess(13.0) == pytest.approx(0.1871 * mm, abs=1e-7)
    assert Obstruction("step_over", 2, over_m=1.022, arc_m=1.0).excess(13.0) == pytest.approx(0.044)


def exact_butt_strap(t, width, diameter):
    """Second method: the tape along two tangents and over a plate bent to the shell."""
    radius = diameter / 2
    half = width / 2 / radius  # angle of the plate's half width, on the shell
    tangent = np.sqrt((radius + t) ** 2 - radius**2)
    turn = np.arccos(radius / (radius + t))
    return 2 * (tangent + (radius + t) * half) - 2 * radius * (half + turn)


def test_a_butt_strap_is_what_plane_geometry_says(figure):
    for t, width, diameter in ((0.012, 0.1, 15.24), (0.010, 0.15, 40.0)):
        found = Obstruction("butt_strap", 1, t, width).excess(diameter)
        exact = exact_butt_strap(t, width, diameter)
        figure(f"butt strap {1000 * t:.0f} mm on {diameter} m: formula over geometry",
               f"{found / exact:.5f}")  # fmt: skip
        assert found == pytest.approx(exact, rel=1e-3)


def test_sizes_of_corrections():
    """Worked numbers: thickness, temperature, friction, wave and helix."""
    thick = reduced(Tape("T", thickness_m=0.25e-3))
    assert thick.steps_m["tape_thickness"] == pytest.approx(-0.785e-3, abs=1e-6)
    warm = reduced(Tape("T", temperature_c=20.0, expansion_per_k=1.1e-5), temperature_c=30.0)
    assert warm.steps_m["temperature"] == pytest.approx(4.51e-3, abs=1e-5)
    means = [mean_tension_n(1.0, mu, 1) for mu in (0.1, 0.2, 0.3)]
    assert means == pytest.approx([0.858, 0.743, 0.648], abs=6e-4)  # the second is 0.74248
    for mu, pulls, long_mm in ((0.1, 1, 0.69), (0.2, 1, 1.25), (0.3, 1, 1.71), (0.3, 4, 0.53)):
        tape = Tape("T", tension_n=98.0, friction=mu, stiffness_n=0.83e6)
        one = reduced(tape, tension_n=98.0, pulls=pulls)
        assert -1000 * one.steps_m["tension"] == pytest.approx(long_mm, abs=0.011)
    strap = Strap("1a", "1", 0.4, 41.0, 0.0005, "T")
    for given, excess_mm in (({"wave_m": 0.05}, 0.604), ({"helix_m": 0.1}, 0.122)):
        one = reduce_strap(strap, PLAIN, (), None, Strapping((), (), **given), 13.0)
        assert -2000 * one.steps_m["out_of_level"] == pytest.approx(excess_mm, abs=0.002)


def test_effects_are_what_another_input_does():
    """Second method: differences of the reduction itself."""
    given = {"temperature_c": 20.0, "tension_n": 50.0, "expansion_per_k": 1.15e-5,
             "thickness_m": 2e-4, "friction": 0.2, "stiffness_n": 5e5}  # fmt: skip
    tape = Tape("T", **given, u_scale=20e-6, u_offset_m=1e-4)
    strap = {"temperature_c": 31.0, "tension_n": 60.0}
    base = reduced(tape, **strap)
    effects = {one.kind: one for one in base.effects}

    def moved(kind, tape=tape, **changed):
        other = reduced(tape, **(strap | changed)).circumference_m - base.circumference_m
        assert effects[kind].by_m == pytest.approx(other, rel=0.02)

    moved("instrument_scale", Tape("T", correction=20e-6, **given))
    moved("instrument_offset", Tape("T", correction_m=1e-4, **given))
    moved("tape_temperature", temperature_c=31.0 + 2 / np.sqrt(3))
    moved("tape_tension", tension_n=60.0 * (1 + 0.1 / np.sqrt(3)))
    slightly = Tape("T", **(given | {"friction": 0.2 * (1 + 1e-4)}))
    change = (reduced(slightly, **strap).circumference_m - base.circumference_m) / 1e-4
    assert effects["tape_friction"].by_m == pytest.approx(change * 0.5 / np.sqrt(3), rel=1e-3)
    on_shell = reduced(tape, shell_c=31.0, tension_n=60.0)
    warmer = reduced(tape, shell_c=32.0, tension_n=60.0)
    assert on_shell.by_shell_temperature_m == pytest.approx(
        warmer.circumference_m - on_shell.circumference_m, rel=1e-3
    )


def test_the_working_tape_comes_out_through_the_master():
    """Simulation: the working tape is 80 ppm too long, the master is certified."""
    master = Tape("M", correction=12e-6, temperature_c=20.0, tension_n=50.0, u_scale=5e-6)
    working = Tape("W", correction=500e-6, master="M", u_scale=100e-6)
    true = np.array([40.1, 40.2, 39.9])
    compared = [
        Comparison(str(i), length / (1 + 12e-6), length / (1 + 80e-6), 2e-4)
        for i, length in enumerate(true)
    ]
    found, sd = certified(working, {"M": master, "W": working}, compared)
    assert found.correction == pytest.approx(80e-6, abs=1e-9)
    assert (found.u_scale, found.temperature_c, found.tension_n) == (5e-6, 20.0, 50.0)
    assert sd == pytest.approx(2e-4 / 40.07 / np.sqrt(3), rel=1e-2)
    without = [Comparison(one.level, one.master_m, one.working_m) for one in compared]
    assert certified(working, {"M": master, "W": working}, without)[0].correction == pytest.approx(
        80e-6, abs=1e-9
    )
