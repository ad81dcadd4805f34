"""What a sound calibration by liquid hardly has: steps that disagree, causes that can be named."""

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import Problem
from tankcal.job.tables import SETTINGS_FILE
from tankcal.messages import message
from tankcal.pipeline.liquid_naming import causes_in_words, is_steady_leak, leak_unit
from tankcal.pipeline.survey_limits import limits_of

TOLD = 3  # steps that are told one by one
FAR = 2 * CRITICAL  # test quantity of a cause, from which it moves the table beyond U
CONTROLLED = 1e-6  # redundancy of a reading below which nothing tests it
HIDDEN_U = 2.0  # change of a volume, in its U, by an error that no test shows: more is told


def check_liquid_result(job, found):
    """`Problem`s of a `LiquidResult`; () without one.

    Parameters
    ----------
    job : Job
    found : LiquidResult or None
    """
    if found is None:
        return ()
    return (
        *_disagreement(job.liquid, found),
        *_single_readings(job.liquid, found),
        *_compared(job.liquid, found),
        *_leak(job.liquid, found),
        *_meters(job.liquid, found),
        *_bottom(job, found),
        *_alone(job.liquid, found),
    )


def _disagreement(metering, found):
    """Liquid and geometry together: the test of all steps, and the cause, where one stands out."""
    named = [one for one in found.causes if one.is_named]
    if found.probability >= limits_of("liquid")["global_probability"] and not named:
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
            chi2=found.chi2,
            dof=found.dof,
        )
    yield Problem(metering.file, text)


def _leak(metering, found):
    """A drift with time that is not named among all causes: a test of its own, of one in 1000."""
    steady = next((one for one in found.causes if is_steady_leak(one)), None)
    is_named = any(one.is_named for one in found.causes)
    if steady is None or is_named or abs(steady.w) <= CRITICAL:
        return
    text = message(
        "liquid_drifts",
        "the steps differ from the geometry as if a valve passed {size:+.3f} {unit}, at {w:.1f} "
        "times the standard deviation: read the dip before and after hours at rest (use = rest)",
        size=steady.size,
        unit=leak_unit(steady.cause),
        w=abs(steady.w),
    )
    yield Problem(metering.file, text)


def _meters(metering, found):
    """Meters that neither a second proving nor the steps control."""
    for one in found.causes:
        hidden = one.undetected_U
        if one.cause.kind != "meter" or hidden is None or hidden <= HIDDEN_U:
            continue
        if metering.meters[one.cause.of].factor_after is not None:
            continue
        text = message(
            "meter_unchecked",
            "nothing checks the factor of meter {name}: an error of {percent:.2g} % would not "
            "show, and would change a volume by {times:.1f} times its U; prove it again afterwards "
            "(factor_after), or fill a part through a second meter",
            name=one.cause.of,
            percent=100 * one.detectable,
            times=hidden,
        )
        yield Problem(metering.meters_file, text, column=f"{one.cause.of}.factor_after")


def _single_readings(metering, found):
    """Batches and dips that the joint adjustment finds wrong, the worst first."""
    rows = [
        (abs(w), row, w * sd / np.sqrt(redundancy), column)
        for one, column in ((found.steps, "volume_m3"), (found.dips, "dip_m"))
        for row, w, sd, redundancy in zip(one.row, one.w, one.sd, one.redundancy, strict=True)
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


def _compared(metering, found):
    """Dips that are only compared, and differ."""
    checks = found.checks
    if checks is None:
        return
    for place in np.flatnonzero(np.abs(checks.w) > CRITICAL):
        text = message(
            "check_dip_differs",
            "a dip to compare: {difference:+.1f} mm from what all that counts says, {w:.1f} "
            "standard deviations",
            difference=1000 * checks.difference_m[place],
            w=abs(checks.w[place]),
        )
        yield Problem(metering.file, text, int(checks.row[place]), "dip_m")


def _bottom(job, found):
    untold = job.bottom.form in ("flat", "leaning")
    if job.tank.kind == "vertical" and untold and found.bottom_m3 is None:
        text = message(
            "bottom_not_filled",
            "no run began in the empty tank, and nobody surveyed the bottom: what is below the "
            "first dip, {dip:g} m, is that of a flat bottom, and its error is not in U",
            dip=found.filled_m[0],
        )
        yield Problem(job.liquid.file, text)


def _alone(metering, found):
    if found.tables["liquid"] is None:
        text = message("liquid_alone_untold", "liquid alone does not tell the volumes of this "
                       "tank: there is no table of it beside the joint one")  # fmt: skip
        yield Problem(metering.file, text)
    if found.certified == "liquid":
        text = message(
            "liquid_certified",
            "the table is that of liquid alone: beyond its dips, {low:g} to {high:g} m, it goes "
            "by the drawing",
            low=found.filled_m[0],
            high=found.filled_m[1],
        )
        yield Problem(SETTINGS_FILE, text, column="liquid.table")
