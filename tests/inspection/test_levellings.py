"""settlement.csv and edge_profiles.csv: what is read, and every way in which they can be wrong."""

import numpy as np
import pytest
from fuzzing import HOSTILE_CELLS, WHOLE, spoilt_csv
from levelled_tanks import A_MM, LIMITS, TANK_A, settlement_rows
from messages_told import lines
from numpy.testing import assert_allclose

from tankcal.job.tables import Log
from tankcal.products.inspection.edges import assess_edges
from tankcal.products.inspection.levelling import read_edge_profiles, read_settlement
from tankcal.products.inspection.rules import BulgeLimits, EdgeLimits
from tankcal.products.inspection.settlement import assess_settlement

POINTS = {f"P{i + 1}": (22.5 * i, 12 + z / 1000) for i, z in enumerate(A_MM)}
GOOD = settlement_rows({"2019": POINTS, "2024": POINTS})


def read(tmp_path, text, reader=read_settlement, name="settlement.csv"):
    """(what was read, problems, warnings) of a file, told in words that have codes."""
    path, log = tmp_path / name, Log()
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    found = reader(path, log)
    assert (found is None) == bool(log.problems)
    lines(log.problems), lines(log.warnings)
    return found, log.problems, log.warnings


def codes(problems):
    return [(one.expected.code, one.row, one.column) for one in problems]


# ---- what is read


def test_two_epochs_are_read(tmp_path):
    found, _, warnings = read(tmp_path, GOOD)
    assert [one.name for one in found.epochs] == ["2019", "2024"]
    assert found.epochs[0].points == tuple(POINTS)
    assert_allclose(found.epochs[1].z_m - 12, np.array(A_MM) / 1000, atol=1e-12)
    assert_allclose(found.epochs[1].u_m, 0.001)
    assert (found.sd_known, found.dof, warnings) == (True, np.inf, [])


def test_decimal_commas_are_read(tmp_path):
    plain = "# levelled by A; level B; 2024\n\n" + GOOD
    assert len(read(tmp_path, plain)[0].epochs) == 2
    text = "# a comment, with a comma\n" + GOOD.replace(",", ";").replace(".", ",")
    assert_allclose(read(tmp_path, text)[0].epochs[0].z_m, [z for _, z in POINTS.values()])


def test_dates_are_put_in_order_and_names_are_not(tmp_path):
    late_first = settlement_rows({"2024-05": POINTS, "2019-11": POINTS})
    assert [one.name for one in read(tmp_path, late_first)[0].epochs] == ["2019-11", "2024-05"]
    named = settlement_rows({"repair": POINTS, "as built": POINTS})
    assert [one.name for one in read(tmp_path, named)[0].epochs] == ["repair", "as built"]


def test_points_come_by_azimuth(tmp_path):
    turned = {name: (360 - t if t else 0, z) for name, (t, z) in POINTS.items()}
    found = read(tmp_path, settlement_rows({"1": turned}))[0].epochs[0]
    assert found.points[:3] == ("P1", "P16", "P15")
    assert np.all(np.diff(found.azimuth_rad) > 0)


def test_coordinates_give_azimuths_clockwise_from_y(tmp_path):
    """Closed form: points on a circle about (500100, 7400020)."""
    angle = np.radians([t for t, _ in POINTS.values()])
    x, y = 500100 + 10.65 * np.sin(angle), 7400020 + 10.65 * np.cos(angle)
    rows = [f"P{i},{a:.4f},{b:.4f},12.0" for i, (a, b) in enumerate(zip(x, y, strict=True))]
    found = read(tmp_path, "point,x_m,y_m,elevation_m\n" + "\n".join(rows))[0]
    assert_allclose(found.epochs[0].azimuth_rad, angle, atol=1e-5)
    assert_allclose(found.radius_m, 10.65, atol=1e-4)


def test_an_azimuth_is_needed_once(tmp_path):
    later = {name: ("", z) for name, (_, z) in POINTS.items()}
    found = read(tmp_path, settlement_rows({"a": POINTS, "b": later}))[0]
    assert_allclose(found.epochs[1].azimuth_rad, found.epochs[0].azimuth_rad)


def test_repeats_are_averaged_by_their_sds(tmp_path):
    """Closed form: 12.1 +- 1 mm and 12.2 +- 2 mm have the mean 12.12 +- 2/sqrt(5) mm."""
    text = GOOD.replace("P1,0.0,12.1138,1,2019", "P1,0,12.1,1,2019\nP1,0,12.2,2,2019")
    found, _, warnings = read(tmp_path, text)
    assert_allclose(found.epochs[0].z_m[0], 12.12)
    assert_allclose(found.epochs[0].u_m[0], 0.002 / np.sqrt(5))
    assert [one.expected.code for one in warnings] == ["levels_repeats_off"]


def test_sd_by_repeats(tmp_path):
    """Closed form: two pairs 2 and 4 mm apart pool to sqrt((2 + 8) / 2) mm, 2 degrees."""
    rows = [f"{name},{t},{z}" for name, (t, z) in POINTS.items()]
    rows += [f"P1,0,{POINTS['P1'][1] + 0.002}", f"P2,22.5,{POINTS['P2'][1] + 0.004}"]
    found, _, warnings = read(tmp_path, "point,azimuth_deg,elevation_m\n" + "\n".join(rows))
    sd = np.sqrt(5) / 1000
    assert (found.sd_known, found.dof, warnings) == (False, 2, [])
    assert_allclose(found.epochs[0].u_m[:3], [sd / np.sqrt(2), sd / np.sqrt(2), sd])


@pytest.mark.parametrize("copied", [False, True])
def test_no_uncertainty_is_told(tmp_path, copied):
    rows = [f"{name},{t},{z}" for name, (t, z) in POINTS.items()]
    text = "point,azimuth_deg,elevation_m\n" + "\n".join(rows + rows[:3] * copied)
    found, _, warnings = read(tmp_path, text)
    assert found.dof == 0
    assert [one.expected.code for one in warnings] == ["levels_no_sd"]


# ---- what is wrong, one line each

HEAD = "point,azimuth_deg,elevation_m,s_mm,epoch\n"
FEW = {name: POINTS[name] for name in (*("P1", "P3", "P5", "P7", "P9", "P11", "P13"),)}
WRONG = {
    "fewer than 8": (settlement_rows({"2019": FEW}), [("levels_few_points", None, None)]),
    "one azimuth twice": (
        GOOD.replace("P2,22.5", "P2,0.01"),
        [("levels_same_azimuth", None, None)] * 2,
    ),
    "north twice": (
        GOOD.replace("P16,337.5", "P16,360"),
        [("levels_same_azimuth", None, None)] * 2,
    ),
    "a point elsewhere": (
        GOOD.replace("P3,45.0,12.1009,1,2024", "P3,48.0,12.1009,1,2024"),
        [("levels_moved", 20, "point")],
    ),
    "millimetres": (
        settlement_rows({"1": {n: (t, 1000 * z) for n, (t, z) in POINTS.items()}}),
        [(None, row, "elevation_m") for row in range(2, 18)],
    ),
    "millimetres of a local zero": (
        settlement_rows({"1": {n: (t, 1000 * z - 12000) for n, (t, z) in POINTS.items()}}),
        [("levels_other_unit", None, "elevation_m")],
    ),
    "half of the round": (
        settlement_rows({"1": {n: (t / 2, z) for n, (t, z) in POINTS.items()}}),
        [("levels_half_round", None, None)],
    ),
    "a blank epoch": (GOOD.replace("P4,67.5,12.0971,1,2019", "P4,67.5,12.0971,1,"),
                      [("levels_no_epoch", 5, "epoch")]),
    "days before months": (
        settlement_rows({"31-12-2019": POINTS, "01-06-2025": POINTS}),
        [("levels_no_date", 2, "epoch"), ("levels_no_date", 18, "epoch")],
    ),
    "a month of one digit": (
        settlement_rows({"2024-5-31": POINTS, "2024-11-01": POINTS}),
        [("levels_no_date", 2, "epoch")],
    ),
    "no day of the calendar": (GOOD.replace(",2024", ",2024-02-30"),
                               [("levels_no_date", 18, "epoch")]),
    "two spellings": (
        settlement_rows({"As built": POINTS, "as built": POINTS}),
        [("levels_epoch_spelt", row, "epoch") for row in range(18, 34)],
    ),
    "an epoch with a line break's mark": (GOOD.replace(",2024", ',"=cmd()"'),
                                         [(None, row, "epoch") for row in range(18, 34)]),
    "metres of sd": (GOOD.replace(",1,20", ",0.001,20"), [("tiny_sd_mm", 2, "s_mm")]),
    "no place": (
        "point,elevation_m\n" + "\n".join(f"{n},{z}" for n, (_, z) in POINTS.items()),
        [("levels_nowhere", None, "azimuth_deg")],
    ),
    "one coordinate": (
        "point,x_m,elevation_m\n" + "\n".join(f"{n},{t},{z}" for n, (t, z) in POINTS.items()),
        [("missing_beside", None, "y_m")],
    ),
    "both places": (
        GOOD.replace("azimuth_deg", "azimuth_deg,x_m", 1).replace("P1,0.0", "P1,0.0,1")
        .replace(".5,12", ".5,,12").replace(".0,12", ".0,,12"),
        [("levels_two_places", None, "x_m")],
    ),
    "nowhere in any row": (
        settlement_rows({"1": POINTS | {"Q": ("", 12.1)}}), [("levels_point_nowhere", 18, "point")]
    ),
    "no rows": (HEAD, [("levels_no_rows", None, None)]),
    "no column": (GOOD.replace("elevation_m", "z_m"),
                  [("unknown_column", 1, "z_m"), ("missing_column", 1, "elevation_m")]),
    "coordinates in a line": (
        "point,x_m,y_m,elevation_m\n" + "\n".join(f"A{i},{i},{2 * i},1" for i in range(9)),
        [("levels_no_circle", None, "x_m")],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_settlement_is_told(tmp_path, name):
    text, expected = WRONG[name]
    told = codes(read(tmp_path, text)[1])
    assert [(code if want[0] else None, *place) for (code, *place), want in
            zip(told, expected, strict=True)] == expected  # fmt: skip


def test_a_point_off_the_circle_is_told(tmp_path):
    angle = np.radians([t for t, _ in POINTS.values()])
    x, y = 10 * np.sin(angle), 10 * np.cos(angle)
    x[3] += 1.5
    rows = [f"P{i},{a:.4f},{b:.4f},12.0" for i, (a, b) in enumerate(zip(x, y, strict=True))]
    told = codes(read(tmp_path, "point,x_m,y_m,elevation_m\n" + "\n".join(rows))[1])
    assert told == [("levels_off_circle", 5, "x_m")]


def test_all_problems_come_in_one_run(tmp_path):
    text = GOOD.replace("12.1138", "abc", 1).replace("P3,45.0", "P3,x", 1)
    text = text.replace(",1,2024", ",0,2024", 1)
    assert [(row, column) for _, row, column in codes(read(tmp_path, text)[1])] == [
        (4, "azimuth_deg"), (2, "elevation_m"), (18, "s_mm")
    ]  # fmt: skip


def test_more_than_anyone_levels_is_told(tmp_path):
    many = settlement_rows({"1": {f"A{i}": (i * 0.35, 12) for i in range(1001)}})
    assert codes(read(tmp_path, many)[1]) == [("levels_many_points", None, None)]
    epochs = settlement_rows({f"E{i}": POINTS for i in range(51)})
    assert codes(read(tmp_path, epochs)[1]) == [("levels_many_epochs", None, "epoch")]
    lines = "azimuth_deg,radius_m,z_m\n" + "".join(f"{i},5,0\n" for i in range(201))
    assert codes(read(tmp_path, lines, read_edge_profiles)[1]) == [
        ("edge_many_lines", None, "azimuth_deg")
    ]
    line = "azimuth_deg,radius_m,z_m\n" + "".join(f"0,{i / 60},0\n" for i in range(501))
    assert codes(read(tmp_path, line, read_edge_profiles)[1]) == [
        ("edge_many_readings", 2, "azimuth_deg")
    ]


@pytest.mark.slow(after=4)
@pytest.mark.parametrize("whole", WHOLE)
def test_what_is_no_table_is_told(tmp_path, whole):
    for reader in (read_settlement, read_edge_profiles):
        assert read(tmp_path, whole, reader)[1]


@pytest.mark.slow
def test_spoilt_files_are_told_or_computed(tmp_path):
    rng = np.random.default_rng(99)
    for _ in range(150):
        spoilt = spoilt_csv(GOOD, rng).encode(errors="surrogatepass")
        found = read(tmp_path, spoilt)[0]
        if found is not None:
            assess_settlement(found, TANK_A, LIMITS, Log())


@pytest.mark.slow
def test_spoilt_profiles_are_told_or_computed(tmp_path):
    rng, base = np.random.default_rng(98), EDGE_HEAD + edge_rows() + edge_rows(90, end="1,45")
    for _ in range(150):
        spoilt = spoilt_csv(base, rng).encode(errors="surrogatepass")
        found = read(tmp_path, spoilt, read_edge_profiles)[0]
        if found is not None:
            assess_edges(found, 10.65, EdgeLimits(30.83), BulgeLimits(30.83), file="e", log=Log())


@pytest.mark.parametrize("cell", HOSTILE_CELLS)
def test_hostile_cells(tmp_path, cell):
    text = GOOD.replace("12.1138", cell, 1).encode(errors="surrogatepass")
    found, problems, _ = read(tmp_path, text)
    assert problems or abs(found.epochs[0].z_m[0]) < 1e4


# ---- what only deserves a look


def warned(epochs, strength=TANK_A):
    """Codes of the warnings of {epoch: points}, and the labels that are judged."""

    def of(tmp_path):
        found, log = read(tmp_path, settlement_rows(epochs))[0], Log()
        _, figures = assess_settlement(found, strength, LIMITS, log)
        lines(log.warnings)
        assert log.problems == []
        return [one.expected.code for one in log.warnings], {one.epoch for one in figures}

    return of


@pytest.mark.slow
def test_an_odd_number_and_wide_gaps_are_told(tmp_path):
    without = {n: p for n, p in POINTS.items() if n not in ("P4", "P5")}
    assert warned({"1": without})(tmp_path)[0] == ["levels_wide_gaps"]
    without.pop("P9")
    assert warned({"1": without})(tmp_path)[0] == ["levels_odd", "levels_wide_gaps"]


def test_too_few_points_for_the_tank_are_told(tmp_path):
    wide = type(TANK_A)(82.9, 20.2, 248e6, 206e9)  # example B asks for 28
    codes, _ = warned({"1": POINTS}, wide)(tmp_path)
    assert codes == ["levels_fewer_than_asked", "levels_wide_gaps"]


@pytest.mark.slow
def test_two_epochs_of_different_points(tmp_path):
    other = {f"Q{n[1:]}": (t + 5, z) for n, (t, z) in POINTS.items()}
    assert warned({"a": POINTS, "b": other})(tmp_path) == (["levels_no_difference"], {"a", "b"})
    some = POINTS | {"P2": POINTS["P2"], "Q": (50.0, 12.1)}
    del some["P3"]
    told, labels = warned({"a": POINTS, "b": some})(tmp_path)
    assert (told, labels) == (["levels_alone"], {"a", "b", "b - a"})


@pytest.mark.slow
def test_another_datum_is_told(tmp_path):
    raised = {n: (t, z + 40) for n, (t, z) in POINTS.items()}
    assert warned({"a": POINTS, "b": raised})(tmp_path)[0] == ["levels_other_datum"]


def test_points_of_another_tank_are_told(tmp_path):
    angle = np.radians([t for t, _ in POINTS.values()])
    xy = zip(3 * np.sin(angle), 3 * np.cos(angle), strict=True)
    rows = [f"P{i},{a:.4f},{b:.4f},12.0,1" for i, (a, b) in enumerate(xy)]
    found = read(tmp_path, "point,x_m,y_m,elevation_m,s_mm\n" + "\n".join(rows))[0]
    log = Log()
    assert assess_settlement(found, TANK_A, LIMITS, log) == ([], [])
    assert codes(log.problems) == [("levels_other_tank", None, "x_m")]


# ---- edge_profiles.csv

EDGE_HEAD = "azimuth_deg,radius_m,z_m,s_mm,weld_deg\n"


def edge_rows(azimuth=0.0, radii=(9.0, 9.4, 9.8, 10.2, 10.6), z=12.0, end="1,"):
    return "".join(f"{azimuth},{r},{z},{end}\n" for r in radii)


def test_radial_lines_are_read(tmp_path):
    text = EDGE_HEAD + edge_rows(90, (10.6, 9.0, 9.4, 9.8, 10.2)) + edge_rows(-90, end="2,30")
    first, second = read(tmp_path, text, read_edge_profiles)[0]
    assert (first.azimuth_deg, second.azimuth_deg) == (90.0, 270.0)
    assert first.radius_m.tolist() == [9.0, 9.4, 9.8, 10.2, 10.6]
    assert (first.weld_deg, second.weld_deg) == (None, 30.0)
    assert_allclose(second.sd_m, 0.002)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (edge_rows(radii=(9, 10)), [("edge_few_readings", 2, "azimuth_deg")]),
        (edge_rows(radii=(9, 9.5, 10, 10, 10.5)), [("edge_same_radius", 5, "radius_m")]),
        (edge_rows() + "0,8,120,1,\n", [("edge_other_unit", 2, "z_m")]),
        (edge_rows(end="1,0") + "0,8,12,1,90\n", [("edge_two_welds", 2, "weld_deg")]),
        ("", [("levels_no_rows", None, None)]),
    ],
)
def test_wrong_radial_lines_are_told(tmp_path, text, expected):
    assert codes(read(tmp_path, EDGE_HEAD + text, read_edge_profiles)[1]) == expected
