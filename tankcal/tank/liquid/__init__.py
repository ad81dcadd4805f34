"""Calibration with liquid: metered steps as observations of the volumes of a tank.

    fill = fill_of(metering)                                  steps between valid dips
    reduced = reduce_steps(fill, volume_m3, growth)           misclosures against a geometry
    found = adjust_steps(reduced.misclosure_m3, noise, effects)
    found.gain, found.test(column)
    estimate_run_effect(found, columns), name_causes(found, alternatives)

The functions use plain arrays and are independent of a job. Source: ISO 4269:2001 and API Std 2555
(methods, by their catalogue pages); the mathematics is in docs/liquid.md.
"""

from tankcal.tank.liquid.adjustment import (
    Alternative,
    Effect,
    LiquidAdjustment,
    RunEffect,
    Verdict,
    adjust_steps,
    estimate_run_effect,
    name_causes,
)
from tankcal.tank.liquid.reduction import (
    Fill,
    ReadingEffects,
    ReducedSteps,
    fill_of,
    reading_effects,
    reduce_steps,
)

__all__ = [
    "Alternative",
    "Effect",
    "Fill",
    "LiquidAdjustment",
    "ReadingEffects",
    "ReducedSteps",
    "RunEffect",
    "Verdict",
    "adjust_steps",
    "estimate_run_effect",
    "fill_of",
    "name_causes",
    "reading_effects",
    "reduce_steps",
]
