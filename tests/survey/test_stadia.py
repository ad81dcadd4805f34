"""A stadia bar: the angle between its ends as a horizontal distance, its length, the exchange rule.

Truth: closed form, differences, exact geometry.
"""

import numpy as np
import pytest
from generated_hits import Tool, network_tables, observe
from generated_tangents import ring_of_stations, traverse_tables
from job_builder import tangent_parts, write_book, write_folder

import tankcal
from tankcal.errors import InputError
from tankcal.methods.hits.readings import ranging_of
from tankcal.methods.lines.readings import plummets_of
from tankcal.pipeline.checks import check_bases

BAR = {"kind": "stadia", "length_m": 2.0, "u_mm": 0.02, "certificate": "B-1"}
ARCSEC = np.pi / 180 / 3600


def angle_deg(distance_m, length_m=2.0):
    """Between the ends of a bar square to the sight."""
    return float(np.degrees(2 * np.arctan(length_m / 2 / distance_m)))


def parts_of(bases, s_arcsec=1.0, ranged=True, bar=BAR, count=8):
    """Parts of a traverse with a bar; bases: (from, to, angle) with stations numbered from 0."""
    stations = ring_of_stations(count, 13.0)
    tables = traverse_tables(stations, np.zeros(count), Tool())
    if not ranged:  # all see all, as in a triangulation
        every = {}
        for i, at in enumerate(stations):
            others = [k for k in range(count) if k != i]
            every[f"I{i + 1}"] = [f"S{k + 1}" for k in others], observe(at, stations[others])
        tables |= network_tables(every)
        del tables["slope_distances"]
    tables["stadia"] = [
        ["setup", "to", "angle_deg", "s_arcsec"],
        *([f"I{a + 1}", f"S{b + 1}", angle, s_arcsec] for a, b, angle in bases),
    ]
    rows = [{"setup": f"I{i + 1}"} for i in range(count)]
    parts = tangent_parts(rows, tables)
    del parts.tables["tangents"]
    parts.registers["instruments"]["bar"] = bar
    return parts, stations


def loaded(folder, parts, write=write_folder):
    return tankcal.load(write(folder, parts), only="adjustment")


def test_the_angle_is_a_horizontal_distance(tmp_path):
    """Closed form d = (b/2) cot(beta/2), its sd by differences."""
    parts, _ = parts_of([(0, 1, 12.5)], s_arcsec=2.0)
    one = loaded(tmp_path / "job", parts).measurements.readings[-1]
    distance = 1 / np.tan(np.radians(12.5) / 2)
    assert (one.table, one.file, one.instrument) == ("distances", "stadia.csv", ("bar",))
    assert (one.start, one.end, one.horizontal.tolist()) == (("S1",), ("S2",), [True])
    assert one.value[0] == pytest.approx(distance, rel=1e-14)
    step = 1e-6
    slope = (1 / np.tan((np.radians(12.5) + step) / 2) - distance) / step
    assert one.sd[0] == pytest.approx(abs(slope) * 2 * ARCSEC, rel=1e-5)
    book = loaded(tmp_path / "job.xlsx", parts, write_book).measurements.readings[-1]
    assert book.value[0] == one.value[0]


def test_the_bar_alone_gives_the_scale(tmp_path):
    """Exact geometry: a traverse without another distance comes out in its size."""
    stations = ring_of_stations(8, 13.0)
    base = np.hypot(*(stations[1] - stations[0])[:2])
    parts, stations = parts_of([(0, 1, angle_deg(base)), (1, 0, angle_deg(base))], ranged=False)
    adjustment = tankcal.adjust_job(loaded(tmp_path, parts))
    order = [int(name[1:]) - 1 for name in adjustment.names]
    found, true = adjustment.xyz_m, stations[order]
    sides = [np.linalg.norm(xyz - np.roll(xyz, 3, axis=0), axis=1) for xyz in (found, true)]
    np.testing.assert_allclose(*sides, rtol=1e-8)
    scale = next(one for one in adjustment.causes if one.name == "bar")
    assert (scale.what, scale.u) == ("instrument_scale", pytest.approx(10.0))
    # readings are (1 + scale) times what is true, so places shrink
    move = scale.column_m.reshape(-1, 3)
    away = found - found.mean(axis=0)
    np.testing.assert_allclose(move[:, :2] - move[:, :2].mean(axis=0), -1e-5 * away[:, :2],
                               rtol=0, atol=2e-9)  # fmt: skip


@pytest.mark.parametrize(
    ("bases", "columns"),
    [
        ([(0, 1, 0.0), (1, 0, 0.0)], []),
        ([(0, 1, 0.0), (1, 0, 0.004)], ["to"]),
        ([(0, 1, 0.0), (0, 1, 0.0)], ["to"]),
    ],
)
def test_the_exchange_rule(tmp_path, bases, columns):
    """As it should be; 0.004 degrees are 3.5 mm of 10 m; not exchanged."""
    stations = ring_of_stations(8, 13.0)
    exact = angle_deg(np.hypot(*(stations[1] - stations[0])[:2]))
    parts, _ = parts_of([(a, b, exact + more) for a, b, more in bases])
    job = loaded(tmp_path, parts)
    assert [one.column for one in check_bases(job.measurements)] == columns


def _no_length(parts):
    parts.registers["instruments"]["bar"] = {"kind": "stadia", "u_mm": 0.02}
    return ("instruments.toml", "bar.length_m")


def _no_bar(parts):
    del parts.registers["instruments"]["bar"]
    return ("stadia.csv", "bar")


def _wide(parts):
    parts.tables["stadia"][1][2] = 120.0
    return ("stadia.csv", "angle_deg")


def _itself(parts):
    parts.tables["stadia"][1][1] = "S1"
    return ("stadia.csv", "to")


def _unknown(parts):
    parts.tables["stadia"][1][0] = "I99"
    return ("stadia.csv", "setup")


@pytest.mark.parametrize("spoil", [_no_length, _no_bar, _wide, _itself, _unknown])
def test_bad_input_is_one_line(tmp_path, spoil):
    parts, _ = parts_of([(0, 1, 12.5)])
    wanted = spoil(parts)
    with pytest.raises(InputError) as error:
        loaded(tmp_path, parts)
    assert [(one.file, one.column) for one in error.value.problems] == [wanted]


def test_a_bar_ranges_nothing_and_makes_no_line():
    """Property: beside it the only total station is still the one that a blank name means."""
    kinds = {"TS": "total_station", "bar": "stadia", "T-12": "tape"}
    registers = {"instruments": {name: {"kind": kind} for name, kind in kinds.items()}}
    assert [*ranging_of(registers)] == [*plummets_of(registers)] == ["TS"]
