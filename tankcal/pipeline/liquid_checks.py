"""What a sound calibration by liquid hardly has: steps that disagree, causes that can be named."""

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import Problem
from tankcal.job.tables import SETTINGS_FILE
from tankcal.messages import join_with_or, message
from tankcal.pipeline.survey_limits import limits_of

TOLD = 3  # steps that are told one by one


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
        *_bottom(job, found),
        *_alone(job.liquid, found),
    )


def _disagreement(metering, found):
    """Liquid and geometry together: the test of all steps, and the cause, where one stands out."""
    named = [one for one in found.causes if one.is_named]
    if found.probability >= limits_of("liquid")["global_probability"] and not named:
        return
    if named:
        text = message(
            "liquid_disagrees_because",
            "liquid and geometry disagree, at {w:.1f} times the standard deviation; the likeliest "
            "cause is {cause}",
            w=abs(named[0].w),
            cause=join_with_or([_cause(one) for one in named]),
        )
    else:
        text = message(
            "liquid_disagrees",
            "liquid and geometry disagree: chi-square of the steps is {chi2:.1f} with {dof} "
            "degrees of freedom; no single cause stands out: check the uncertainties declared",
            chi2=found.chi2,
            dof=found.dof,
        )
    yield Problem(metering.file, text)


def _cause(one):
    """A cause in words, with its size."""
    size, of = one.size, one.cause.of
    if one.cause.kind == "meter":
        return message("cause_meter", "the factor of meter {name}, off by {size:+.3f} %",
                       name=of, size=100 * size)  # fmt: skip
    if one.cause.kind == "radii":
        return message("cause_radii", "the radii of the geometry, off by {size:+.1f} mm",
                       size=-1000 * size)  # fmt: skip
    if one.cause.kind == "dip_zero":
        return message("cause_dip_zero", "the zero of all dips, off by {size:+.1f} mm",
                       size=-1000 * size)  # fmt: skip
    if one.cause.kind == "dip":
        return message("cause_dip", "the dip of row {row}, off by {size:+.1f} mm",
                       row=of, size=-1000 * size)  # fmt: skip
    if one.cause.kind == "batch":
        return message("cause_batch", "the batch of row {row}, which lacks {size:+.3f} m3: is a "
                       "batch missing, or counted twice?", row=of, size=size)  # fmt: skip
    if one.cause.kind == "bottom":
        return message("cause_bottom", "the volume of the bottom, off by {size:+.3f} m3",
                       size=-size)  # fmt: skip
    return _so_or_not(one, size, of)


def _so_or_not(one, size, of):
    if one.cause.kind == "leak":
        unit = one.cause.unit if one.cause.unit != "m3" else message("m3_a_step", "m3 a step")
        return message("cause_leak", "a valve that passes, {size:+.3f} {unit}", size=size,
                       unit=unit)  # fmt: skip
    if one.cause.kind == "fahrenheit":
        return message("cause_fahrenheit", "temperatures in degrees Fahrenheit")
    return message("cause_swapped", "temperatures at the meter and in the tank that changed places")


def _single_readings(metering, found):
    """Batches and dips that the joint adjustment finds wrong, the worst first."""
    rows = [
        (abs(w), row, w * sd / np.sqrt(max(redundancy, 1e-12)), column)
        for one, column in ((found.steps, "volume_m3"), (found.dips, "dip_m"))
        for row, w, sd, redundancy in zip(one.row, one.w, one.sd, one.redundancy, strict=True)
        if abs(w) > CRITICAL
    ]
    for w, row, size, column in sorted(rows, reverse=True)[:TOLD]:
        if column == "dip_m":
            text = message("dip_disagrees", "the dip differs from what all other steps say by "
                           "{size:+.1f} mm, {w:.1f} standard deviations",
                           size=1000 * size, w=w)  # fmt: skip
        else:
            text = message("batch_disagrees", "the batch differs from what all other steps say by "
                           "{size:+.4f} m3, {w:.1f} standard deviations",
                           size=size, w=w)  # fmt: skip
        yield Problem(metering.file, text, int(row), column)


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
