"""Keys of [top], the head of a vertical tank, and checks of its form and sizes."""

from tankcal.job.checking import is_not_given, missing_beside, tell
from tankcal.job.contract.bottom import DEEPEST, SHAPED
from tankcal.job.contract.ends import (
    check_radii,
    depth_missing,
    depth_of_head,
    too_deep,
    torispherical_keys,
)
from tankcal.job.fields import VERTICAL, choice, positive
from tankcal.messages import message

KEYS = (
    choice(
        "form",
        "head on top of the shell, which the liquid may enter: cone, dish, ellipsoidal or"
        " torispherical; blank: the table ends at the top of the shell",
        SHAPED,
        kinds=VERTICAL,
    ),
    positive(
        "depth_m",
        "inside height of the head above the top of the last course, metres",
        100,
        kinds=VERTICAL,
    ),
    *torispherical_keys("", "", VERTICAL),
)


def depth_of_top(values):
    """Return the height of the head above the shell, m; 0 without a head, None if unknown."""
    given, diameter = values["top"], values["tank"]["nominal_diameter_m"]
    if given["form"] is None or values["corrections"]["top"] is False:
        return 0.0
    return None if diameter is None else depth_of_head(given, given["depth_m"], diameter)


def check_top(values, is_supplemented, raw, log):
    """Check that a head has a form and sizes, and sizes that fit the diameter."""
    given, form, depth = values["top"], values["top"]["form"], values["top"]["depth_m"]
    diameter = values["tank"]["nominal_diameter_m"]
    names = [field.name for field in KEYS]
    if is_not_given(raw, "top", "form"):
        present = [name for name in names if not is_not_given(raw, "top", name)]
        if present:
            tell(log.problem, raw, "top", "form", missing_beside(present[0]))
        return
    if form is None:
        return
    if is_supplemented:
        expected = message(
            "top_beside_liquid",
            "given together with liquid.csv; expected a blank: metered runs calibrate only the"
            " shell, and the table ends at its top",
        )
        tell(log.problem, raw, "top", "form", expected)
    if form != "torispherical" and is_not_given(raw, "top", "depth_m"):
        tell(log.problem, raw, "top", "depth_m", depth_missing(form))
    check_radii("top", given, form, "depth_m", depth, diameter, raw, log)
    if None in (depth, diameter):
        return
    deepest = DEEPEST[form] * diameter
    if depth > deepest * (1 + 1e-9) and form != "torispherical":
        tell(log.problem, raw, "top", "depth_m", too_deep(depth, deepest, form))
