"""Rows of a table: their heights and their rounding.

Dips are metres above the zero of the table. Each row is computed from its own number, n * step, and
rounded from its own exact volume, so no rounding errors accumulate.
"""

import numpy as np

from tankcal.errors import HeightError, InputError, Problem
from tankcal.messages import message
from tankcal.tank.dips.units import HEIGHT_STEPS_M

MOST_ROWS = 25_000  # largest number of rows of a table
_PER_METRE = 1_000_000_000  # steps and rows are whole nanometres, so that rows are exact decimals
_LAST_STEP_M = 1e-6  # a shorter last step is omitted
NEAR_MARK_M = 0.0005  # a top within this distance of a mark is at the mark


def table_heights(step_m, top_m, fine_step_m=None, fine_zones=()):
    """Return dips (rows,) at 0, step, 2 step, ... and the top, m, in ascending order.

    Parameters
    ----------
    step_m : float
        Row n is the number nearest to n * step.
    top_m : float
        Last row; a last step below a micrometre is omitted.
    fine_step_m : float, optional
        Step of the rows in `fine_zones`; a whole part of step_m.
    fine_zones : sequence of (float, float), optional
        (low_m, high_m) of each zone: it extends from the row at or below low_m to the row at or
        above high_m.

    Returns
    -------
    ndarray, shape (rows,)

    Raises
    ------
    InputError
        For inconsistent steps, and for more than MOST_ROWS rows.
    HeightError
        For a zone outside the table.

    Examples
    --------
    >>> table_heights(0.5, 1.2, 0.1, [(0.0, 0.2)])
    array([0. , 0.1, 0.2, 0.5, 1. , 1.2])
    """
    _check_steps(step_m, top_m, fine_step_m, fine_zones)
    pieces = [multiples_of(step_m, 0, int(np.floor(top_m / step_m + 1e-9)))]
    for low_m, high_m in fine_zones:
        first = int(np.floor(low_m / fine_step_m + 1e-9))
        last = int(np.ceil(min(high_m, top_m) / fine_step_m - 1e-9))
        pieces.append(multiples_of(fine_step_m, first, last))
    heights = np.unique(np.concatenate(pieces))
    # Rows beyond the top by more than rounding do not belong to the table.
    heights = heights[heights <= top_m + 2e-9 * step_m]
    if top_m - heights[-1] > _LAST_STEP_M:
        heights = np.append(heights, top_m)
    else:
        heights[-1] = min(heights[-1], top_m)
    return heights


def top_mark(top_m, height_unit="m", *, closed=False):
    """Return the dip of the last row of a table, m: the mark of the tape at the top of the tank.

    An open shell ends at the nearest whole millimetre, since 9.49996 m (a leaning shell of 9.5 m)
    is measured as 9.5 m. A tank that closes at its top is full from the next millimetre on. In feet
    and inches, the top is a mark if the mark is within half a millimetre; otherwise it is
    unchanged.

    Parameters
    ----------
    top_m : float
        Dip of the full tank, m.
    height_unit : {"m", "ft-in-8", "ft-in-16"}
    closed : bool
        Whether the tank has no free surface at the top.

    Returns
    -------
    float

    Examples
    --------
    >>> top_mark(9.49996), top_mark(9.49946, closed=True)
    (9.5, 9.5)
    """
    step = float(HEIGHT_STEPS_M[height_unit])
    if height_unit == "m" and closed:
        # Round up, except for an excess below a micrometre.
        number = np.ceil(top_m / step - _LAST_STEP_M / step)
    else:
        number = np.round(top_m / step)
    mark = float(multiples_of(step, number, number)[0])
    on_a_mark = height_unit == "m" or abs(mark - top_m) <= NEAR_MARK_M
    return mark if number > 0 and on_a_mark else float(top_m)


def multiples_of(step_m, first, last):
    """Return first * step, ..., last * step, each rounded once from the exact product.

    Parameters
    ----------
    step_m : float
    first, last : int

    Returns
    -------
    ndarray, shape (last - first + 1,)
        m.
    """
    numbers = np.arange(first, last + 1, dtype=float)
    step = step_m * _PER_METRE
    # Steps of whole nanometres give exact products; rows of other steps are rounded.
    if abs(step - round(step)) < 1e-3:
        return numbers * round(step) / _PER_METRE  # exact integer product, a single rounding
    return np.round(numbers * step_m, 9)


def _check_steps(step_m, top_m, fine_step_m, fine_zones):
    """Raise an error for steps and zones that do not fit the table."""
    if not step_m > 0 or not top_m > 0:
        raise InputError(
            Problem(
                "table",
                message(
                    "steps_above_zero",
                    "step {step_m:g} m, top {top_m:g} m; expected above 0",
                    step_m=step_m,
                    top_m=top_m,
                ),
                None,
                "step",
            )
        )
    count = top_m / step_m
    if fine_zones:
        ratio = step_m / (fine_step_m or np.inf)
        if not ratio > 1.5 or abs(ratio - round(ratio)) > 1e-6:
            given_step = "no fine step" if fine_step_m is None else f"{fine_step_m:g} m"
            raise InputError(
                Problem(
                    "table",
                    f"{given_step}; expected a whole part of the step of {step_m:g} m",
                    None,
                    "fine_step_m",
                )
            )
        for low_m, high_m in fine_zones:
            if not 0 <= low_m < high_m or low_m >= top_m:
                raise HeightError(
                    message(
                        "fine_zone_outside",
                        "fine zone {low_m:g} to {high_m:g} m is outside the table (0 to "
                        "{top_m:g} m)",
                        low_m=low_m,
                        high_m=high_m,
                        top_m=top_m,
                    )
                )
            count += (min(high_m, top_m) - low_m) / fine_step_m
    if count > MOST_ROWS:
        raise InputError(
            Problem(
                "table",
                message(
                    "table_rows_too_many",
                    "{rows:.0f} rows, expected at most {most}",
                    rows=count,
                    most=MOST_ROWS,
                ),
                None,
                "step_m",
            )
        )


def round_each(values, decimals):
    """Return values (rows,), each rounded once to the nearest decimal (half to even).

    The rounding is correct for the stored number: 2.675, which is stored as slightly less, gives
    2.67.

    Examples
    --------
    >>> round_each([2.675, 0.125], 2)
    array([2.67, 0.12])
    """
    return np.array([round(float(value), decimals) for value in values])
