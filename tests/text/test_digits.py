"""Writing a value to its uncertainty's digits: tables of cases."""

import numpy as np
import pytest

from tankcal.text.digits import (
    COMMA_SI,
    ENGLISH,
    ENGLISH_SI,
    NOTHING,
    PORTUGUESE,
    PROGRAM,
    bound_of_decimals,
    decimals_of,
    decimals_of_each,
    decimals_of_height,
    decimals_of_heights,
    decimals_of_mantissa,
    decimals_of_rows,
    fixed,
    fixed_rows,
    format_significant,
    format_with_u,
    shortest,
    superscript,
)

NAN, INF = float("nan"), float("inf")


def held(text):
    """With the power of ten held to its number by spaces that do not break."""
    return text.replace(" × ", "\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}")


CASES = [  # value, u, value ± U, concise
    # published: JCGM 100:2008 7.2.2, 7.2.6, H.2 (table H.4), H.3.6, H.1.7
    (100.02147, 0.00035, "100.02147 ± 0.00035", "100.02147(35)"),
    (10.05762, 0.027, "10.058 ± 0.027", "10.058(27)"),
    (127.732, 0.071, "127.732 ± 0.071", "127.732(71)"),
    (219.847, 0.295, "219.85 ± 0.30", "219.85(30)"),
    (254.260, 0.236, "254.26 ± 0.24", "254.26(24)"),
    (-0.1494, 0.0041, "−0.1494 ± 0.0041", "−0.1494(41)"),
    (50.000838, 0.000093, "50.000838 ± 0.000093", "50.000838(93)"),
    # U that rounds up to the next power of ten
    (1.23456, 0.0996, "1.23 ± 0.10", "1.23(10)"),
    (1.23456, 0.0994, "1.235 ± 0.099", "1.235(99)"),
    (1.23456, 0.0995, "1.23 ± 0.10", "1.23(10)"),
    (123.456, 9.96, "123 ± 10", "123(10)"),
    (123.456, 9.94, "123.5 ± 9.9", "123.5(9.9)"),
    (123.456, 0.996, "123.5 ± 1.0", "123.5(1.0)"),
    (123.456, 99.6, "120 ± 100", "120(100)"),
    (123456.7, 999.6, "123500 ± 1000", "123500(1000)"),
    # U of one and more
    (1252.8, 1.27, "1252.8 ± 1.3", "1252.8(1.3)"),
    (1252.8, 12.7, "1253 ± 13", "1253(13)"),
    (95.9065, 3.188, "95.9 ± 3.2", "95.9(3.2)"),
    (12345.6, 100.0, "12350 ± 100", "12350(100)"),
    (12345.6, 149.0, "12350 ± 150", "12350(150)"),
    (12345.6, 4100.0, "12300 ± 4100", "12300(4100)"),
    (12355.6, 123456.0, "10000 ± 120000", "10000(120000)"),
    (1.0, 1.0, "1.0 ± 1.0", "1.0(1.0)"),
    # halves go away from zero, on the decimal digits: another case than binary 2.67499...
    (2.675, 0.10, "2.68 ± 0.10", "2.68(10)"),
    (0.125, 0.25, "0.13 ± 0.25", "0.13(25)"),
    (-0.125, 0.25, "−0.13 ± 0.25", "−0.13(25)"),
    (0.135, 0.25, "0.14 ± 0.25", "0.14(25)"),
    (2.5, 10.5, "3 ± 11", "3(11)"),
    (1.005, 0.115, "1.01 ± 0.12", "1.01(12)"),
    (1.0, 0.00125, "1.0000 ± 0.0013", "1.0000(13)"),
    (0.1 + 0.2, 0.010, "0.300 ± 0.010", "0.300(10)"),
    # negative, and smaller than its U: no minus before zero
    (-12.3456, 0.0789, "−12.346 ± 0.079", "−12.346(79)"),
    (-0.001, 0.12, "0.00 ± 0.12", "0.00(12)"),
    (0.0, 0.12, "0.00 ± 0.12", "0.00(12)"),
    (-0.0, 0.12, "0.00 ± 0.12", "0.00(12)"),
    (-40.0, 1200.0, "0 ± 1200", "0(1200)"),
    # exact, and not known
    (1.5, 0.0, "1.500000 ± 0", "1.500000"),
    (0.0, 0.0, "0.000000 ± 0", "0.000000"),
    (1.5, NAN, "1.500000", "1.500000"),
    (1.5, INF, "1.500000", "1.500000"),
    (1.5, None, "1.500000", "1.500000"),
    (NAN, 0.1, NOTHING, NOTHING),
    (INF, 0.1, NOTHING, NOTHING),
    (None, 0.1, NOTHING, NOTHING),
    # powers of ten
    (1.23456e20, 5.6e18, "(1.235 ± 0.056) × 10²⁰", "1.235(56) × 10²⁰"),
    (1.5e300, 2e298, "(1.500 ± 0.020) × 10³⁰⁰", "1.500(20) × 10³⁰⁰"),
    (-1.5e-300, 2e-302, "(−1.500 ± 0.020) × 10⁻³⁰⁰", "−1.500(20) × 10⁻³⁰⁰"),
    (1.7e308, 1e305, "(1.7000 ± 0.0010) × 10³⁰⁸", "1.7000(10) × 10³⁰⁸"),
    (5e-324, 0.0, "(4.940656 ± 0) × 10⁻³²⁴", "4.940656 × 10⁻³²⁴"),
    (0.0, 3e-20, "(0.0 ± 3.0) × 10⁻²⁰", "0.0(3.0) × 10⁻²⁰"),
    (1.1e-5, 1.2e-6, "0.0000110 ± 0.0000012", "0.0000110(12)"),
    (7.5e6, 0.0012, "7500000.0000 ± 0.0012", "7500000.0000(12)"),
]


@pytest.mark.parametrize(("value", "u", "both", "concise"), CASES)
def test_a_value_and_its_uncertainty(value, u, both, concise):
    found = format_with_u(value, u)
    assert (found.both, found.concise) == (held(both), held(concise))
    if NOTHING not in (found.value, found.uncertainty):
        apart = f"{found.value} ± {found.uncertainty}"
        assert found.both == (f"({apart}){found.power}" if found.power else apart)


@pytest.mark.parametrize(
    ("value", "u", "marks", "both", "concise"),
    [
        (1234.5678, 0.0123, ENGLISH, "1234.568 ± 0.012", "1234.568(12)"),
        (1234.5678, 0.0123, PORTUGUESE, "1.234,568 ± 0,012", "1.234,568(12)"),
        (1234.5678, 0.0123, COMMA_SI, "1234,568 ± 0,012", "1234,568(12)"),
        (-1234567.8, 1234.0, PORTUGUESE, "−1.234.600 ± 1.200", "−1.234.600(1.200)"),
        (-1234567.8, 12345.0, ENGLISH_SI, "−1\u202f235\u202f000 ± 12\u202f000",
         "−1\u202f235\u202f000(12\u202f000)"),
        (100.02147, 0.00035, ENGLISH_SI, "100.021\u202f47 ± 0.000\u202f35", "100.021\u202f47(35)"),
        (100.02147, 0.00035, COMMA_SI, "100,021\u202f47 ± 0,000\u202f35", "100,021\u202f47(35)"),
        (12345.25, 1.25, PORTUGUESE, "12.345,3 ± 1,3", "12.345,3(1,3)"),
        (-1234.5678, 0.0123, PROGRAM, "-1234.568 ± 0.012", "-1234.568(12)"),
    ],
)  # fmt: skip
def test_separators_of_languages(value, u, marks, both, concise):
    found = format_with_u(value, u, marks)
    assert (found.both, found.concise) == (both, concise)


@pytest.mark.parametrize(
    ("value", "u", "options", "both"),
    [
        (12345.6, 1234.5, {"least": 0}, "12346 ± 1235"),
        (12.3456789, 1.27, {"least": 3}, "12.346 ± 1.270"),
        (12.3456789, 0.00127, {"least": 3}, "12.3457 ± 0.0013"),
        (0.0, 0.0, {"least": 8}, "0.00000000 ± 0"),
        (1.23456, 0.0123, {"significant": 1}, "1.23 ± 0.02"),  # down would take 19 % off
        (1.23456, 0.0104, {"significant": 1}, "1.23 ± 0.01"),
        (1.23456, 0.096, {"significant": 1}, "1.2 ± 0.1"),
        (1.23456, 0.0123, {"significant": 3}, "1.2346 ± 0.0123"),
        (1.0, 10.499, {}, "1 ± 10"),
    ],
)
def test_other_digits(value, u, options, both):
    assert format_with_u(value, u, **options).both == both


def test_rounding_never_takes_more_than_a_twentieth_of_u():
    """Property: EA-4/02 6.3, over four decades, with one, two and three digits."""
    for significant in (1, 2, 3):
        for u in np.geomspace(0.01, 100, 4001):
            shown = float(format_with_u(0.0, u, significant=significant).uncertainty)
            assert shown >= 0.95 * u * (1 - 1e-12)
            assert shown <= u * (1 + 1.0 / 10 ** (significant - 1))


def test_texts_give_the_value_back():
    """Property: within half a place of what was given, beside half its 15th digit."""
    rng = np.random.default_rng(5)
    for value, u in zip(rng.normal(0, 1e4, 2000), 10 ** rng.uniform(-9, 6, 2000), strict=True):
        found = format_with_u(value, u, PROGRAM)
        half = 0.5 * 10.0**-found.decimals
        fifteenth = 0.5 * 10.0 ** (np.floor(np.log10(abs(value))) - 14)
        assert abs(float(found.value) - value) <= half + 1.1 * fifteenth
        assert abs(float(found.uncertainty) - u) <= half * (1 + 1e-6)
        assert len(found.uncertainty.replace(".", "").lstrip("0").rstrip("0")) <= 2


def test_a_negative_uncertainty_is_refused():
    with pytest.raises(ValueError, match=r"uncertainty -0\.1"):
        format_with_u(1.0, -0.1)
    with pytest.raises(ValueError, match="expected 1 or more"):
        format_with_u(1.0, 0.1, significant=0)


@pytest.mark.parametrize(
    ("value", "u", "written_out", "both"),
    [
        (0.0012345, 0.000067, range(-2, 6), "(1.235 ± 0.067) × 10⁻³"),
        (0.0012345, 0.000067, range(-4, 6), "0.001235 ± 0.000067"),
        (1e-9, 1.2e-8, range(-2, 6), "(0.1 ± 1.2) × 10⁻⁸"),
        (100.0129441, 0.0221109, range(-2, 6), "100.013 ± 0.022"),
        (1249765.0, 1439.0, range(-2, 6), "(1.2498 ± 0.0014) × 10⁶"),
    ],
)
def test_powers_of_ten_in_a_narrow_column(value, u, written_out, both):
    assert format_with_u(value, u, written_out=written_out).both == held(both)


@pytest.mark.parametrize(
    ("u", "decimals"),
    [
        (1.27, 1),
        (0.74, 2),
        (0.0041, 4),
        (0.0996, 2),  # rounds up to 0.10
        (9.96, 0),  # rounds up to 10
        (0.0995, 2),  # a half goes up, though its binary form lies below
        (35.0, 0),
        (4100.0, 0),
        (1.0, 1),
        (0.0, 6),
        (NAN, 6),
        (None, 6),
    ],
)
def test_decimals_that_show_two_digits_of_u(u, decimals):
    assert decimals_of(u) == decimals


def test_decimals_that_show_other_digits_of_u():
    assert [decimals_of(0.0386, significant=n) for n in (1, 2, 3, 4)] == [2, 3, 4, 5]
    assert decimals_of(4100.0, least=None) == -2
    assert decimals_of(4100.0, least=3) == 3


@pytest.mark.parametrize("decimals", range(9))
def test_more_decimals_are_shown_below_their_bound(decimals):
    """Property: the bound is where the number of decimals changes."""
    bound = bound_of_decimals(decimals)
    assert decimals_of(bound * (1 - 1e-12), least=None) == decimals
    assert decimals_of(bound, least=None) == decimals - 1


@pytest.mark.parametrize(
    ("value", "u", "decimals"),
    [
        (-0.00174185, 6.792e-5, 3),  # 1.742E-03, 6.8E-05
        (6.792e-5, 6.792e-5, 1),
        (9.99e-5, 1.0e-6, 2),  # 9.99E-05
        (9.996e-5, 1.0e-6, 3),  # 1.000E-04
        (3.2e-9, 1.2e-8, 0),  # 3E-09
        (1.0e-12, 1.2e-8, 0),
        (1.5, 0.0, 6),
        (1.5, None, 6),
        (0.0, 0.1, 6),
    ],
)
def test_decimals_of_a_mantissa(value, u, decimals):
    assert decimals_of_mantissa(value, u) == decimals


@pytest.mark.parametrize(
    ("column", "options", "decimals"),
    [
        ([0.0, 0.0123, 0.5, 1.4, 14.0], {}, [3, 3, 2, 1, 0]),
        ([0.0, 0.0123, 0.5, 1.4, 14.0], {"least": 3}, [3, 3, 3, 3, 3]),
        ([0.0, 0.00123, 0.5], {"least": 3}, [4, 4, 3]),
        ([0.5, 0.0], {}, [2, 2]),  # as the one before
        ([None, 2.0], {}, [1, 1]),
        ([NAN, 2.0, None, 0.03], {}, [1, 1, 3, 3]),  # as the next one
        ([None, None], {}, [6, 6]),
        ([None, 0.0], {"unknown": 4}, [4, 4]),
        ([0.0012, 1.6e-19, 0.0], {"most": 6}, [4, 6, 6]),  # the rounding of a fixed coordinate
        ([], {}, []),
    ],
)
def test_decimals_of_rows(column, options, decimals):
    assert decimals_of_rows(column, **options) == decimals


# Powers of ten and halves, and their neighbours, which binary numbers may round differently.
_BOUNDS = np.outer([1, 1.05, 2.675, 9.45, 9.5, 9.95, 9.995, 99.5], 10.0 ** np.arange(-9, 10))
_COLUMN = np.concatenate(
    [np.nextafter(_BOUNDS, end).ravel() for end in (0, INF)] + [_BOUNDS.ravel()]
).tolist()


@pytest.mark.parametrize("significant", [1, 2, 3])
@pytest.mark.parametrize("least", [None, 0, 3])
def test_a_column_has_the_decimals_of_its_cells(significant, least):
    options = {"significant": significant, "least": least}
    column = [*_COLUMN, 0.0, NAN, None, 1e-310, 1e305]
    assert decimals_of_each(column, **options) == [decimals_of(u, **options) for u in column]


@pytest.mark.parametrize("marks", [ENGLISH, ENGLISH_SI, PORTUGUESE, PROGRAM])
@pytest.mark.parametrize("places", [-1, 0, 2, 6])
def test_a_column_has_the_texts_of_its_cells(marks, places):
    column = [*_COLUMN, *(-value for value in _COLUMN), 0.0, -0.0, None, NAN, float("inf"), 1e300]
    texts = fixed_rows(column, [places] * len(column), marks)
    assert texts == [fixed(value, places, marks) for value in column]


def test_a_column_of_heights_has_the_decimals_of_its_cells():
    heights = [0.0, 1.25, 1.2345, 9.49999998, 3.0480061, 9.5000049, *np.arange(0, 2, 0.0025)]
    assert decimals_of_heights(heights) == [decimals_of_height(height) for height in heights]


@pytest.mark.parametrize(
    ("height", "decimals"),
    [
        (0.0, 3),
        (1.25, 3),
        (1.2345, 4),
        (1.23456, 5),
        (9.49995045, 5),
        (3.0480061, 5),
        (12.0004999999999, 4),
        (9.49999998, 3),
        (9.50004999, 5),
        (9.5000499999, 5),
        (9.500049, 5),
        (9.5000049, 3),
    ],
)
def test_decimals_of_a_height(height, decimals):
    assert decimals_of_height(height) == decimals


@pytest.mark.parametrize(
    ("value", "digits", "marks", "text"),
    [
        (0.00020, 2, ENGLISH, "0.00020"),
        (386.31, 4, ENGLISH, "386.3"),
        (386.31, 2, ENGLISH, "386"),  # no whole digit is rounded off
        (9.996, 3, ENGLISH, "10.0"),
        (0.125, 2, ENGLISH, "0.13"),  # a half away from zero
        (1.1e-5, 2, ENGLISH, "1.1 × 10⁻⁵"),
        (9.96e-5, 2, ENGLISH, "0.00010"),
        (-2.06e11, 3, PORTUGUESE, "−2,06 × 10¹¹"),
        (-12345.678, 6, PORTUGUESE, "−12.345,7"),
        (0.0, 3, ENGLISH, "0"),
        (None, 3, ENGLISH, NOTHING),
        (INF, 3, ENGLISH, NOTHING),
    ],
)
def test_significant_digits(value, digits, marks, text):
    assert format_significant(value, digits, marks) == held(text)


@pytest.mark.parametrize(
    ("value", "digits", "marks", "text"),
    [
        (850.5, 6, PORTUGUESE, "850,5"),
        (1025.0, 3, ENGLISH, "1025"),
        (95, 6, ENGLISH, "95"),
        (100.0, 6, ENGLISH, "100"),
        (99.73, 6, PORTUGUESE, "99,73"),
        (-0.25, 6, ENGLISH, "−0.25"),
        (3.290526731, 3, ENGLISH, "3.29"),
        (0.1 + 0.2, 6, ENGLISH, "0.3"),
        (1e6, 6, ENGLISH, "1 × 10⁶"),
        (2.50e-7, 6, PORTUGUESE, "2,5 × 10⁻⁷"),
        (0.0, 6, ENGLISH, "0"),
        (NAN, 6, ENGLISH, NOTHING),
    ],
)
def test_a_number_as_it_was_chosen(value, digits, marks, text):
    assert shortest(value, marks, digits=digits) == held(text)


def test_superscript():
    assert superscript("mm-2") == "mm⁻²"


@pytest.mark.parametrize(
    ("value", "decimals", "marks", "text"),
    [
        (1234.5, 0, ENGLISH, "1235"),
        (1234.4999, 3, PORTUGUESE, "1.234,500"),
        (1249.84, 1, ENGLISH, "1249.8"),
        (-0.0449, 2, ENGLISH, "−0.04"),
        (-1.25, 2, PORTUGUESE, "−1,25"),
        (2.0, 0, ENGLISH, "2"),
        (INF, 2, ENGLISH, NOTHING),
        (-0.0004, 3, ENGLISH, "0.000"),
        (-0.0005, 3, ENGLISH, "−0.001"),
        (None, 3, ENGLISH, NOTHING),
        (NAN, 3, ENGLISH, NOTHING),
    ],
)
def test_a_number_of_given_decimals(value, decimals, marks, text):
    assert fixed(value, decimals, marks) == text
