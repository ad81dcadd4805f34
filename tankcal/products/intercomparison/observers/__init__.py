"""Simulated surveys of a tank by each method, as the files of a job.

    parts = METHODS["tape"](tank, Chance(rng), asked)

Each method takes the true `Tank`, the source of random errors (`Chance`) and the requested
conditions of the capacity table (`Asked`). It returns the `Parts` of a job.

A simulation adds errors of the instruments to the true tank, and declares their standard
uncertainties. The formulas are deliberately independent of `tankcal.survey` and `tankcal.geometry`,
so that an error there does not affect the true values.
"""

from tankcal.products.intercomparison.observers.cloud import observe_cloud
from tankcal.products.intercomparison.observers.liquid import observe_liquid
from tankcal.products.intercomparison.observers.photographs import observe_photographs
from tankcal.products.intercomparison.observers.tape import observe_lines, observe_tape
from tankcal.products.intercomparison.observers.total_station import observe_hits, observe_points

METHODS = {
    "points": observe_points,
    "photographs": observe_photographs,
    "total-station": observe_hits,
    "tape": observe_tape,
    "reference-line": observe_lines,
    "cloud": observe_cloud,
    "liquid": observe_liquid,
}
