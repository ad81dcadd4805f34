"""Keys of [levels], the operating levels of a tank, and checks of their order."""

from itertools import pairwise

from tankcal.job.checking import tell
from tankcal.job.contract.shorthand import positive
from tankcal.job.contract.stated import dip_above_top
from tankcal.messages import message

_MOST_M = 100

KEYS = (
    positive("full_m", "dip of the full tank, such as the overflow, metres", _MOST_M),
    positive("maximum_m", "dip of the safe fill, metres", _MOST_M),
    positive("minimum_m", "lowest dip in operation, metres", _MOST_M),
    positive("pump_suction_m", "lowest dip that can be pumped, metres", _MOST_M),
)
_FROM_THE_TOP = tuple(key.name for key in KEYS)


def check_levels(levels, extent, raw, log):
    """Check that the levels lie within the tank, in their order.

    The lowest dip in operation may be the lowest that can be pumped, and the safe fill may be the
    full tank. The maximum must be above both lower levels, because volumes between them are stated.
    """
    given = [(name, levels[name]) for name in _FROM_THE_TOP if levels[name] is not None]
    for name, dip in given:
        expected = dip_above_top(dip, extent)
        if expected:
            tell(log.problem, raw, "levels", name, expected)
    for (name, dip), (lower, low) in pairwise(given):
        if dip < low or (dip == low and name == "maximum_m"):
            expected = message(
                "level_below_lower_level",
                "found {level:g}; expected a dip above {lower} = {low:g}",
                level=dip,
                lower=lower,
                low=low,
            )
            tell(log.problem, raw, "levels", name, expected)
