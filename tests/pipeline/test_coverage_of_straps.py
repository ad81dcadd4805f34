"""Do 95 % intervals of strapped tanks hold on walls that are no model of the package?

The tape of `generated_strapping` lies on the hull of the outside of `generated_walls`; the crew
declares the size of the shape, off by some 30 %.
"""

import numpy as np
import pytest
from generated_strapping import shape_of, strapped_job
from generated_walls import make_wall
from test_coverage_of_walls import judged, study

from tankcal.pipeline.strapped_wall import find_strapped_wall
from tankcal.pipeline.tanks import body_of


def found_of(rng, family, straps, folder, declared=1.0):
    """As `test_coverage_of_walls.found_of`; declared: part of the shape that is said to be there"""
    radius = np.exp(rng.uniform(*np.log([3, 40])))
    wall = make_wall(rng, family, radius_m=radius, courses=rng.integers(5, 11))
    job = strapped_job(
        rng,
        wall,
        straps=straps,
        folder=folder,
        laying_m=np.exp(rng.uniform(*np.log([3e-4, 2e-3]))),
        shape_sd_m=declared * shape_of(wall) * np.exp(0.3 * rng.normal()),
    )
    wall_found = find_strapped_wall(job, lambda text: None)
    return judged(wall, body_of(job, wall_found), family, straps)


@pytest.mark.slow
def test_intervals_hold_on_walls_that_are_not_the_model(tmp_path, figure):
    parts, _, _ = study(1, tmp_path, figure, found_of=found_of)
    assert min(parts) > 0.94 - 3 * np.sqrt(0.95 * 0.05 / 15)
