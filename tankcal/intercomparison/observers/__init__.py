"""One crew for each method: what it reads of a tank, as the files of a job.

    parts = METHODS["tape"](tank, Chance(rng), asked)

A crew knows the true tank, adds the errors of its instruments and declares what a crew declares of
them. Formulas stand here once more, on purpose: none of `tankcal.survey` or `tankcal.geometry` is
used, so that a mistake there is no part of the truth here.
"""

from tankcal.intercomparison.observers.cloud import observe_cloud
from tankcal.intercomparison.observers.lines import observe_lines
from tankcal.intercomparison.observers.liquid import observe_liquid
from tankcal.intercomparison.observers.photographs import observe_photographs
from tankcal.intercomparison.observers.points import observe_points
from tankcal.intercomparison.observers.tape import observe_tape
from tankcal.intercomparison.observers.total_station import observe_hits

METHODS = {
    "points": observe_points,
    "photographs": observe_photographs,
    "total-station": observe_hits,
    "tape": observe_tape,
    "reference-line": observe_lines,
    "cloud": observe_cloud,
    "liquid": observe_liquid,
}
