"""Warnings of a calibration by liquid: steps that disagree, and their probable causes."""

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import Problem
from tankcal.job.tables import SETTINGS_FILE
from tankcal.messages import message
from tankcal.pipeline.checks import limits_of_method
from tankcal.pipeline.liquid.measuring import causes_in_words, is_steady_leak, leak_unit

TOLD = 3  # largest number of steps reported individually
FAR = 2 * CRITICAL  # test quantity from which a cause changes the table by more than U
CONTROLLED = 1e-6  # smallest redundancy of a reading that can be tested
HIDDEN_U = 2.0  # largest change of a volume by an undetectable error without warning, in U


def check_liquid(job, result):
    """Return the warnings of a `LiquidResult`, a tuple of Problem."""
    return (
        *_check_agreement(job.liquid, result),
        *_check_readings(job.liquid, result),
        *_check_compared_dips(job.liquid, result),
        *_check_leak(job.liquid, result),
        *_check_meters(job.liquid, result),
        *_check_bottom(job, result),
        *_check_liquid_table(job.liquid, result),
    )


def _check_agreement(metering, result):
    """Warn if liquid and geometry disagree, by the test of all steps or by a named cause."""
    named = [verdict for verdict in result.causes if verdict.is_named]
    if (
        result.probability >= limits_of_method("tankcal.pipeline.liquid")["global_probability"]
        and not named
    ):
        return
    if named:
        template = (
            "liquid and geometry disagree, at {w:.1f} times the standard deviation; the likeliest "
            "cause is {cause}"
        )
        w, cause = abs(named[0].w), causes_in_words(named)
        if w > FAR:
            text = message("liquid_far_because", template, w=w, cause=cause)
        else:
            text = message("liquid_disagrees_because", template, w=w, cause=cause)
    else:
        text = message(
            "liquid_disagrees",
            "liquid and geometry disagree: chi-square of the steps is {chi2:.1f} with {dof} "
            "degrees of freedom; no single cause stands out: check the uncertainties declared",
            chi2=result.chi2,
            dof=result.dof,
        )
    yield Problem(metering.file, text)


def _check_leak(metering, result):
    """Warn of a drift with time, by a test at the level of one in 1000, if no cause is named."""
    leak = next((verdict for verdict in result.causes if is_steady_leak(verdict)), None)
    is_named = any(verdict.is_named for verdict in result.causes)
    if leak is None or is_named or abs(leak.w) <= CRITICAL:
        return
    text = message(
        "liquid_drifts",
        "the steps differ from the geometry as if a valve passed {size:+.3f} {unit}, at {w:.1f} "
        "times the standard deviation: read the dip before and after hours at rest (use = rest)",
        size=leak.size,
        unit=leak_unit(leak.cause),
        w=abs(leak.w),
    )
    yield Problem(metering.file, text)


def _check_meters(metering, result):
    """Warn of meters that neither a second proving nor the steps control."""
    for verdict in result.causes:
        hidden_U = verdict.undetected_U
        if verdict.cause.kind != "meter" or hidden_U is None or hidden_U <= HIDDEN_U:
            continue
        if metering.meters[verdict.cause.of].factor_after is not None:
            continue
        text = message(
            "meter_unchecked",
            "nothing checks the factor of meter {name}: an error of {percent:.2g} % would not "
            "show, and would change a volume by {times:.1f} times its U; prove it again afterwards "
            "(factor_after), or fill a part through a second meter",
            name=verdict.cause.of,
            percent=100 * verdict.detectable,
            times=hidden_U,
        )
        yield Problem(metering.meters_file, text, column=f"{verdict.cause.of}.factor_after")


def _check_readings(metering, result):
    """Warn of outlying batches and dips of the joint adjustment, the largest first."""
    rows = [
        # The estimated error of a reading is w times its sd over the square root of its redundancy.
        (abs(w), row, w * sd / np.sqrt(redundancy), column)
        for readings, column in ((result.steps, "volume_m3"), (result.dips, "dip_m"))
        for row, w, sd, redundancy in zip(
            readings.row, readings.w, readings.sd, readings.redundancy, strict=True
        )
        if abs(w) > CRITICAL and redundancy > CONTROLLED
    ]
    for w, row, size, column in sorted(rows, reverse=True)[:TOLD]:
        if column == "dip_m":
            text = message("dip_disagrees", "the dip differs from what all other steps say by "
                           "{size:+.1f} mm, {w:.1f} standard deviations",
                           size=-1000 * size, w=w)  # fmt: skip
        else:
            text = message("batch_disagrees", "the batch lacks {size:+.4f} m3 by all other "
                           "steps, {w:.1f} standard deviations",
                           size=size, w=w)  # fmt: skip
        yield Problem(metering.file, text, int(row), column)


def _check_compared_dips(metering, result):
    """Warn of dips that are only compared and differ."""
    checks = result.checks
    if checks is None:
        return
    for number in np.flatnonzero(np.abs(checks.w) > CRITICAL):
        text = message(
            "check_dip_differs",
            "a dip to compare: {difference:+.1f} mm from what all that counts says, {w:.1f} "
            "standard deviations",
            difference=1000 * checks.difference_m[number],
            w=abs(checks.w[number]),
        )
        yield Problem(metering.file, text, int(checks.row[number]), "dip_m")


def _check_bottom(job, result):
    """Warn of a bottom that was neither surveyed nor filled from empty."""
    untold = job.bottom.form in ("flat", "leaning")
    if job.tank.kind == "vertical" and untold and result.bottom_m3 is None:
        text = message(
            "bottom_not_filled",
            "no run began in the empty tank, and nobody surveyed the bottom: what is below the "
            "first dip, {dip:g} m, is that of a flat bottom, and its error is not in U",
            dip=result.filled_m[0],
        )
        yield Problem(job.liquid.file, text)


def _check_liquid_table(metering, result):
    """Warn about the table of liquid alone: missing, or extrapolated."""
    if result.tables["liquid"] is None:
        text = message("liquid_alone_untold", "liquid alone does not tell the volumes of this "
                       "tank: there is no table of it beside the joint one")  # fmt: skip
        yield Problem(metering.file, text)
    if result.certified == "liquid":
        text = message(
            "liquid_certified",
            "the table is that of liquid alone: beyond its dips, {low:g} to {high:g} m, it goes "
            "by the drawing",
            low=result.filled_m[0],
            high=result.filled_m[1],
        )
        yield Problem(SETTINGS_FILE, text, column="liquid.table")
