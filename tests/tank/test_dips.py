"""Rows, units, straight lines between rows, proportional parts and the way back from a volume."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from tankcal.errors import HeightError, InputError
from tankcal.tank.dips import (
    HEIGHT_STEPS_M,
    INCH_STEPS_M,
    LADDERS_M,
    METRIC_STEPS_M,
    VOLUME_UNITS_M3,
    choose_rows,
    dip_label,
    dips_of,
    interpolation_errors,
    parse_dip,
    proportional_parts,
    round_each,
    table_heights,
    top_mark,
    ullage_m,
    volume_from_m3,
    volume_to_m3,
)

RADIUS_M, LENGTH_M = 1.2, 10.0


def lying(h):
    """Volume of a lying cylinder with flat ends, 2.4 x 10 m: closed form of the segment."""
    h = np.clip(h, 0, 2 * RADIUS_M)
    across = np.sqrt(2 * RADIUS_M * h - h**2)
    return LENGTH_M * (RADIUS_M**2 * np.arccos(1 - h / RADIUS_M) - (RADIUS_M - h) * across)


def lying_area(h):
    return 2 * LENGTH_M * np.sqrt(2 * RADIUS_M * h - h**2)


def stepped(h, joint=4.0, below=130.0, above=131.0):
    return below * np.minimum(h, joint) + above * np.maximum(h - joint, 0)


# rows


@pytest.mark.parametrize(
    ("step", "top", "rows", "last"),
    [
        (0.01, 9.5, 951, 9.5),
        (0.01, 9.4999, 951, 9.4999),
        (0.3, 1.0, 5, 1.0),
        (0.001, 12.0, 12001, 12),
        (0.1, 9.5, 96, 9.5),
        (0.003175, 9.5, 2994, 9.5),
    ],
)
def test_rows_go_to_the_very_top(step, top, rows, last):
    heights = table_heights(step, top)
    assert len(heights) == rows
    assert heights[-1] == pytest.approx(last, abs=1e-9)
    assert heights[-1] <= top
    assert np.all(np.diff(heights) > 0)
    assert np.allclose(heights[:-1], np.arange(rows - 1) * step)


@pytest.mark.parametrize("step", ["0.001", "0.01", "0.1", "0.003175", "0.0015875"])
def test_every_row_is_the_number_nearest_to_its_multiple(step):
    """Second method: rational arithmetic. A running sum of steps drifts."""
    heights = table_heights(float(step), 10.0)
    exact = [float(n * Fraction(step)) for n in range(len(heights) - 1)]
    assert heights[:-1].tolist() == exact
    assert np.cumsum(np.full(len(exact), float(step)))[-1] != exact[-1]


def test_the_last_step_under_a_micron_is_dropped():
    assert table_heights(0.01, 9.5000005)[-1] == 9.5
    assert table_heights(0.01, 9.5 - 1e-11)[-1] == 9.5 - 1e-11
    assert len(table_heights(0.01, 9.5 - 1e-11)) == 951


def test_a_finer_step_in_zones_adds_each_row_once():
    zones = ((0.0, 0.05), (0.04, 0.062), (9.4712, 9.6))
    heights = table_heights(0.01, 9.5, 0.001, zones)
    assert np.all(np.diff(heights) > 5e-4)
    assert np.isin(table_heights(0.01, 9.5), heights).all()
    # closed form: mm rows to 0.062, cm rows to 9.47, mm rows from 9.471 to the top
    assert len(heights) == 63 + (947 - 6) + 30
    assert heights[-1] == 9.5
    assert 9.471 in heights
    assert 9.469 not in heights


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((0.0, 9.5), "expected above 0"),
        ((float("nan"), 9.5), "expected above 0"),
        ((0.0001, 9.5), "95000 rows, expected at most 25000"),
        ((0.01, 9.5, None, ((0, 1),)), "no fine step; expected a whole part"),
        ((0.01, 9.5, 0.003, ((0, 1),)), "expected a whole part of the step of 0.01 m"),
        ((0.01, 9.5, 0.02, ((0, 1),)), "expected a whole part"),
        ((0.01, 9.5, 0.0001, ((0, 5),)), "50950 rows"),
        ((0.01, 9.5, 0.001, ((1, 1),)), "fine zone 1 to 1 m"),
        ((0.01, 9.5, 0.001, ((9.5, 10),)), "outside the table"),
        ((0.01, 9.5, 0.001, ((-0.1, 1),)), "outside the table"),
    ],
)
def test_rows_that_are_refused(arguments, words):
    with pytest.raises((InputError, HeightError), match=words):
        table_heights(*arguments)


# units and labels


def test_volume_units_are_exact():
    # published: 1 bbl = 42 US gal = 0.158987294928 m3 (NIST Handbook 44, appendix C)
    assert VOLUME_UNITS_M3["bbl"] == Fraction("0.158987294928")
    assert volume_from_m3(0.158987294928, "bbl") == pytest.approx(1.0, rel=1e-15)
    exact = float(Fraction(1.252812) * 1000)  # of the number as stored
    assert volume_from_m3([1.252812, 2.0], "L").tolist() == [exact, 2000.0]
    assert volume_to_m3(1252.812, "L") == float(Fraction(1252.812) / 1000)
    values = np.random.default_rng(1).uniform(0, 1e5, 1000)
    for unit in VOLUME_UNITS_M3:
        assert np.allclose(volume_to_m3(volume_from_m3(values, unit), unit), values, rtol=3e-16)


@pytest.mark.parametrize(
    ("sixteenths", "label"),
    [
        (0, "0' 0\""),
        (1, "0' 0 1/16\""),
        (8, "0' 0 1/2\""),
        (650, "3' 4 5/8\""),
        (12 * 16, "1' 0\""),
        (12 * 16 - 1, "0' 11 15/16\""),
    ],
)
def test_labels_in_feet_and_inches_have_reduced_fractions(sixteenths, label):
    height = float(sixteenths * Fraction(254, 10_000) / 16)
    assert dip_label(height, "ft-in-16") == label
    assert parse_dip(label, "ft-in-16") == height


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("unit", ["ft-in-8", "ft-in-16"])
def test_every_label_of_a_table_reads_back_as_its_row(unit):
    heights = table_heights(float(HEIGHT_STEPS_M[unit]), 12.0)[:-1]
    assert [parse_dip(dip_label(height, unit), unit) for height in heights] == heights.tolist()


def test_the_top_between_the_marks_is_labelled_in_decimals():
    assert dip_label(9.49996, "ft-in-8") == "31' 2.014\""  # 9.49996 / 0.0254 = 374.0142
    assert parse_dip("31' 2.014\"", "ft-in-8") == pytest.approx(9.49996, abs=2e-5)
    assert dip_label(12 * 0.0254 - 1e-6, "ft-in-8") == "1' 0.000\""
    assert (dip_label(1.03), dip_label(9.49996)) == ("1.030", "9.49996")


@pytest.mark.parametrize(
    "text",
    [
        *("3' 4 5/8\"", "3'4 5/8\"", "3-4 5/8", "3-04-5/8", "3 ft 4 5/8 in", "3′ 4 5/8″"),
        *('40 5/8"', "3' 4 10/16\"", "3' 4.625\"", " 3ft. 4-5/8in. "),
    ],
)
def test_ways_to_write_three_feet_four_and_five_eighths(text):
    assert parse_dip(text, "ft-in-8") == 1.031875  # 40.625 * 0.0254


@pytest.mark.parametrize(
    "text",
    ["", "'", '"', "abc", "3' 12\"", "3' 4 5/7\"", "3' 4 9/8\"", "-3' 4\"", "1.2' 3\"", "4.5 1/8"],
)
def test_dips_in_feet_that_are_refused(text):
    with pytest.raises(HeightError, match="expected feet and inches"):
        parse_dip(text, "ft-in-8")


def test_dips_in_metres_as_text():
    assert parse_dip(" 1.035 ") == 1.035
    with pytest.raises(HeightError, match="expected metres"):
        parse_dip("1,035")
    with pytest.raises(HeightError, match="upwards"):
        dip_label(-0.1, "ft-in-8")


# straight lines between rows


def test_interpolation_error_of_lying_tank_near_its_ends(figure):
    """Second method: the exact volume where the area equals the mean area of the interval."""
    heights = table_heights(0.01, 2.4)
    found = interpolation_errors(lying, heights)
    for i in (0, 1, 7, 120, 238, 239):
        low, high = heights[i], heights[i + 1]
        mean = (lying(high) - lying(low)) / (high - low)
        ends = (low, high) if i != 120 else (low + 1e-9, high - 1e-9)
        place = brentq(lambda h, mean=mean: lying_area(h) - mean, *ends, xtol=1e-15)
        exact = lying(low) + mean * (place - low) - lying(place)
        assert found.deviation_m3[i] == pytest.approx(exact, rel=1e-7, abs=1e-14)
        assert found.height_m[i] == pytest.approx(place, abs=1e-6)
    # closed form for V = c h^1.5 (the segment while h << R): 4/27 c step^1.5 at 4/9 of the step
    assert found.largest_m3 == pytest.approx(
        4 / 27 * LENGTH_M * 4 / 3 * np.sqrt(2 * RADIUS_M) * 0.01**1.5, rel=5e-3
    )
    assert 0.0030 < found.largest_m3 < 0.0031
    assert found.height_m[0] == pytest.approx(4 / 900, rel=1e-2)
    rule_of_thumb = 0.01**2 / 8 * np.abs(np.diff(lying_area(heights)) / 0.01).max()
    figure(
        "lying tank 2.4 x 10 m, cm rows: largest error of linear interpolation",
        f"{1000 * found.largest_m3:.3f} L at {1000 * found.height_m[0]:.2f} mm "
        f"(step^2/8 |A'| by differences: {1000 * rule_of_thumb:.3f} L)",
    )


def test_between_rows_of_a_cone_the_deviation_is_its_closed_form():
    """V = a h^3 between 0 and s: largest at s / sqrt 3, a s^3 * 2 / (3 sqrt 3)."""
    found = interpolation_errors(lambda h: 2 * h**3, np.array([0.0, 0.5, 0.6]))
    assert found.deviation_m3[0] == pytest.approx(2 * 0.125 * 2 / (3 * np.sqrt(3)), rel=1e-12)
    assert found.height_m[0] == pytest.approx(0.5 / np.sqrt(3), rel=1e-6)


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("joint", [4.005, 4.0001, 4.0])
def test_a_joint_between_rows(joint, known):
    """Closed form: jump of the area * t (1 - t) * step at the part t of the step."""
    found = interpolation_errors(
        lambda h: stepped(h, joint), table_heights(0.01, 9.5), [joint] if known else []
    )
    part = (joint - 4.0) / 0.01
    assert found.largest_m3 == pytest.approx(0.01 * part * (1 - part), rel=1e-6, abs=1e-12)
    if part:
        assert found.at_m == pytest.approx(joint, abs=1e-6)
        assert found.deviation_m3.max() == found.largest_m3  # a wider course: the line lies above
    assert len(found.deviation_m3) == 950


def test_two_breakpoints_in_one_interval_are_both_looked_at():
    """A ring of deadwood thinner than a step: the exact volume holds back, then goes on."""

    def volume(h):
        return 100 * h - 20 * (np.clip(h, 0.502, 0.504) - 0.502)

    found = interpolation_errors(volume, np.array([0.5, 0.51]), [0.502, 0.504])
    line = [
        20 * -0.002 * (h - 0.5) / 0.01 + 20 * max(min(h, 0.504) - 0.502, 0) for h in (0.502, 0.504)
    ]
    assert found.largest_m3 == pytest.approx(np.abs(line).max(), rel=1e-9)
    assert found.at_m == pytest.approx((0.502, 0.504)[int(np.argmax(np.abs(line)))], abs=1e-8)


@pytest.mark.slow
@given(st.floats(0.05, 5.0), st.floats(0.01, 0.3), st.integers(0, 7))
def test_no_height_between_rows_is_worse_than_what_is_stated(radius, part, seed):
    """Property, for spheres: a dense random sample stays within the stated deviation."""

    def volume(h):
        return np.pi * h**2 * (radius - h / 3)

    heights = table_heights(part * radius, 2 * radius)
    found = interpolation_errors(volume, heights)
    sample = np.random.default_rng(seed).uniform(0, 2 * radius, 400)
    deviation = np.abs(np.interp(sample, heights, volume(heights)) - volume(sample))
    interval = np.clip(np.searchsorted(heights, sample, side="right") - 1, 0, len(heights) - 2)
    assert np.all(deviation <= np.abs(found.deviation_m3)[interval] * (1 + 1e-6) + 1e-12 * radius)


# the step that a bound asks for


def test_millimetre_rows_only_where_they_are_needed(figure):
    chosen = choose_rows(lying, 2.4, 0.0005, step_m=0.01)
    assert (chosen.step_m, chosen.fine_step_m) == (0.01, 0.002)
    assert chosen.largest_m3 <= 0.0005
    assert interpolation_errors(lying, chosen.height_m).largest_m3 == chosen.largest_m3
    (low, bottom), (top, high) = chosen.fine_zones
    assert (low, high) == (0.0, 2.4)
    assert bottom < 0.15
    assert top > 2.25
    # just outside the zones the cm rows keep the bound, just inside they do not
    plain = np.abs(interpolation_errors(lying, table_heights(0.01, 2.4)).deviation_m3)
    assert plain[round(bottom / 0.01)] <= 0.0005 < plain[round(bottom / 0.01) - 1]
    figure(
        "lying tank 2.4 x 10 m, cm table within 0.5 L",
        f"{len(chosen.height_m)} rows, those of 2 mm in {chosen.fine_zones}",
    )


@pytest.mark.slow
def test_the_fewest_rows_are_chosen():
    """Second method: every step and pair of steps of the ladder, tried one by one."""
    bound = 0.0005
    chosen = choose_rows(lying, 2.4, bound)
    counts = []
    for step in METRIC_STEPS_M:
        plain = interpolation_errors(lying, table_heights(step, 2.4))
        if plain.largest_m3 <= bound:
            counts.append(len(table_heights(step, 2.4)))
        for fine in METRIC_STEPS_M:
            if fine < step and round(step / fine) == pytest.approx(step / fine):
                bad = np.abs(plain.deviation_m3) > bound
                edges = table_heights(step, 2.4)
                zones = [(edges[i], edges[i + 1]) for i in np.flatnonzero(bad)]
                rows = table_heights(step, 2.4, fine, zones)
                if interpolation_errors(lying, rows).largest_m3 <= bound:
                    counts.append(len(rows))
    assert len(chosen.height_m) == min(counts)
    assert chosen.largest_m3 <= bound


def test_a_cylinder_needs_no_fine_rows_and_a_joint_only_its_own():
    assert choose_rows(lambda h: 130 * h, 9.5, 0.0001).step_m == 0.1
    chosen = choose_rows(lambda h: stepped(h, 4.0045), 9.5, 0.0003, [4.0045], 0.01)
    assert chosen.fine_zones == ((4.0, 4.01),)
    assert chosen.fine_step_m == 0.001
    assert len(chosen.height_m) == 951 + 9


def test_inch_ladders_and_bounds_that_cannot_be_met():
    chosen = choose_rows(lying, 2.4, 0.002, ladder_m=LADDERS_M["ft-in-8"])
    steps = {round(float(step), 9) for step in np.diff(chosen.height_m[:-1])}
    assert steps <= {round(k * INCH_STEPS_M[3], 9) for k in (1, 2, 4, 8)}
    with pytest.raises(InputError, match=r"errs by 0\.09\d+ L at .* with rows of 1 mm"):
        choose_rows(lying, 2.4, 1e-5)


# proportional parts


def test_proportional_parts_of_two_courses():
    """Closed form: cylinders of 130 and 131 m2, so the parts are exact away from the joint."""
    low, high = proportional_parts(stepped, [0.0, 4.0, 9.5])
    assert low.part_m3 == pytest.approx(130e-3 * np.arange(1, 10), rel=1e-12)
    assert high.part_m3 == pytest.approx(131e-3 * np.arange(1, 10), rel=1e-12)
    assert max(abs(low.deviation_m3), abs(high.deviation_m3)) < 1e-9
    assert (high.bottom_m, high.top_m) == (4.0, 9.5)


def test_the_price_of_proportional_parts_is_stated():
    """A joint at 4.005 m: the parts of the upper course start from a row of the lower one."""
    upper = proportional_parts(lambda h: stepped(h, 4.005), [0.0, 4.005, 9.5])[1]
    assert upper.deviation_m3 == pytest.approx(0.005 * 1.0, rel=1e-6)  # closed form
    assert upper.at_m == pytest.approx(4.006, abs=0.0041)
    (whole,) = proportional_parts(lying, [0.0, 2.4])
    marks = np.round(np.arange(2401) * 0.001, 9)
    rows = marks - np.arange(2401) % 10 * 0.001
    mean = lying(2.4) / 2400
    deviation = lying(rows) + np.arange(2401) % 10 * mean - lying(marks)
    assert abs(whole.deviation_m3) == pytest.approx(np.abs(deviation).max(), rel=1e-9)


def test_parts_of_inches_and_edges_that_are_refused():
    (found,) = proportional_parts(lambda h: 100 * h, [0.0, 3.0], row_step_m=0.0254, parts=8)
    assert found.part_m3 == pytest.approx(0.3175 * np.arange(1, 8))
    assert len(found.part_m3) == 7
    with pytest.raises(HeightError, match="ascending"):
        proportional_parts(lying, [0.0, 2.0, 1.0])


def cone_and_shell(h, depth=0.25, radius=6.5):
    """Closed form: a cone of that depth under a cylinder, filled from its tip."""
    h = np.asarray(h, dtype=float)
    cone = np.pi * radius**2 / (3 * depth**2) * np.minimum(h, depth) ** 3
    return cone + np.pi * radius**2 * np.maximum(h - depth, 0.0)


def test_parts_of_a_cone_keep_their_bound_or_are_not_given():
    """The mean of the whole stretch would be off by 2.5 m3; no printed part is, by more than 2 L.

    Second method: every millimetre of every zone, row plus part, against the closed form.
    """
    (whole,) = proportional_parts(cone_and_shell, [0.0, 9.75])
    assert abs(whole.deviation_m3) > 0.5
    zones = proportional_parts(
        cone_and_shell, [0.0, 0.25, 9.75], bound_m3=lambda dips: np.full(len(dips), 0.002)
    )
    assert (zones[-1].bottom_m, zones[-1].top_m) == (0.25, 9.75)
    assert all(zone.top_m - zone.bottom_m >= 0.0999 for zone in zones)
    for zone in zones:
        marks = np.arange(round(1000 * zone.bottom_m), round(1000 * zone.top_m) + 1)
        rows, part = marks // 10 / 100, np.insert(zone.part_m3, 0, 0.0)[marks % 10]
        assert np.abs(cone_and_shell(rows) + part - cone_and_shell(marks / 1000)).max() < 0.002


def test_zones_are_the_longest_within_the_bound():
    """Property: zones of a widening tank meet, and each one row longer would break the bound."""

    def widening(h):
        return 100 * h + 0.5 * np.asarray(h) ** 2

    def bound(dips):
        return np.full(len(dips), 0.005)

    zones = proportional_parts(widening, [0.0, 10.0], bound_m3=bound)
    assert zones[0].bottom_m == 0.0
    assert len(zones) > 3
    for zone, above in pairwise(zones):
        assert zone.top_m == above.bottom_m
        assert abs(zone.deviation_m3) <= 0.005
        (longer,) = proportional_parts(widening, [zone.bottom_m, zone.top_m + 0.01])
        assert abs(longer.deviation_m3) > 0.005


def test_the_top_of_a_table_is_a_mark_of_the_tape():
    assert top_mark(9.49996) == 9.5
    assert top_mark(9.4994) == 9.499
    assert top_mark(2.9994, closed=True) == top_mark(3.0, closed=True) == 3.0
    assert top_mark(2.9991, "m", closed=True) == 3.0  # full from there on
    assert top_mark(9.14396, "ft-in-8") == pytest.approx(9.144, abs=1e-12)  # 30 ft
    assert top_mark(9.5004, "ft-in-16") == 9.5004  # no mark within half a millimetre


# ullage and the dip of a volume


def test_ullage_and_dip_are_the_same_subtraction():
    assert ullage_m(10.25, [0.0, 4.5]).tolist() == [10.25, 5.75]
    assert ullage_m(10.25, ullage_m(10.25, 4.5)) == 4.5
    for dip in (-0.001, 10.2501, float("nan")):
        with pytest.raises(HeightError, match="reference height"):
            ullage_m(10.25, dip)


HEIGHTS = table_heights(0.01, 2.4)
FACTOR = np.column_stack([0.002 * lying(HEIGHTS), 0.001 * lying_area(HEIGHTS)])


@pytest.mark.slow
@given(st.lists(st.floats(0.0, 2.4), min_size=1, max_size=20))
def test_the_dip_of_a_volume_is_the_inverse_of_the_table(dips):
    """Property: what the table gives at a dip leads back to the dip."""
    wanted = np.interp(dips, HEIGHTS, lying(HEIGHTS))
    found = dips_of(HEIGHTS, lying(HEIGHTS), FACTOR, wanted)
    assert np.interp(found.height_m, HEIGHTS, lying(HEIGHTS)) == pytest.approx(wanted, abs=1e-13)
    # an empty tank's first row rises by 20.7 L: 1e-14 m3 are 5e-15 m there
    assert found.height_m == pytest.approx(dips, abs=1e-13)


def test_rows_read_back_exactly():
    found = dips_of(HEIGHTS, lying(HEIGHTS), FACTOR, lying(HEIGHTS))
    assert found.height_m.tolist() == HEIGHTS.tolist()


def test_u_of_dip_is_u_of_volume_over_area():
    table = np.array([0.0, 1.0, 3.0])
    found = dips_of([0, 1, 2], table, [[0.0, 0.0], [3.0, 4.0], [3.0, 4.0]], [0.5, 1.0, 2.0])
    assert found.u_m.tolist() == [2.5, 5.0, 2.5]  # closed form: slopes 1, 1 and 2 m2


def test_the_table_and_its_inverse_agree_with_capacity():
    """Other program: `Capacity.at` gives the same volume and the same u at the dip."""
    from tankcal.tank.capacity import Capacity
    from tankcal.uncertainty import Source

    table = Capacity(HEIGHTS, lying(HEIGHTS), lying_area(HEIGHTS), (Source("x", FACTOR),), 0.95)
    found = dips_of(table.height_m, table.volume_m3, table.factor_m3, [0.013, 20.0, 44.44])
    for dip, u, volume in zip(found.height_m, found.u_m, [0.013, 20.0, 44.44], strict=True):
        read = table.at(dip)
        assert read.value_m3 == pytest.approx(volume, rel=1e-12)
        row = int(np.searchsorted(HEIGHTS, dip))
        slope = np.diff(lying(HEIGHTS))[row - 1] / 0.01
        assert u == pytest.approx(read.u_m3 / slope, rel=1e-9)


@pytest.mark.parametrize("volume", [-1e-9, 3.0001, float("nan"), float("inf")])
def test_volumes_outside_are_errors(volume):
    with pytest.raises(HeightError, match="outside the capacity table"):
        dips_of([0, 1, 2], [0.0, 1.0, 3.0], np.zeros((3, 0)), volume)


@pytest.mark.parametrize(
    ("volumes", "wanted", "words"),
    [
        ([0, 0, 0, 1], 0.0, "from 0 to 2 m"),
        ([0, 1, 1, 2], 1.0, "from 1 to 2 m"),
        ([0, 5, 3, 8], 4.0, "from 1 to 2 m"),
        ([0, 1, 2, 2], 2.0, "from 2 to 3 m"),
    ],
)
def test_a_volume_with_more_than_one_dip_is_an_error(volumes, wanted, words):
    with pytest.raises(HeightError, match=words):
        dips_of(np.arange(4.0), volumes, np.zeros((4, 0)), wanted)


def test_flat_places_elsewhere_do_no_harm():
    found = dips_of(np.arange(5.0), [0, 0, 1, 1, 4], np.zeros((5, 0)), [0.5, 2.5, 4.0])
    assert found.height_m.tolist() == [1.5, 3.5, 4.0]


# rounding


def test_rows_are_rounded_from_exact_volumes(figure):
    exact = volume_from_m3(lying(HEIGHTS), "L")
    once = round_each(exact, 0)
    assert np.abs(once - exact).max() <= 0.5  # property of rounding
    added = np.concatenate([[0], np.cumsum(round_each(np.diff(exact), 0))])
    assert np.abs(added - exact).max() > 2
    figure(
        "rounding of 241 rows to the litre, largest error",
        f"{np.abs(once - exact).max():.3f} L each by itself, "
        f"{np.abs(added - exact).max():.3f} L if added up",
    )


def test_rounding_is_that_of_the_stored_number():
    # closed form: 2.675 is stored as 2.67499999999999982236431605997495353221893310546875
    assert round_each([2.675, 0.125, 0.375, -1.5], 2).tolist() == [2.67, 0.12, 0.38, -1.5]
