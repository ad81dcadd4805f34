"""The same tank by every method: within U of the truth, and of each other.

Walls that are no model of the package, surveyed by points, tape, reference lines, bare hits (tied
or not), tangents, and by several of them together, each with the errors of its crew and its
instruments.
"""

from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np
import pytest
from generated_hits import hit_job
from generated_lines import plumbed_job
from generated_strapping import shape_of, strapped_job
from generated_tangents import tangent_job
from generated_walls import FAMILIES, job_of, make_wall, survey
from joined_jobs import lines_of, ring_job, sighted, untied_job, whole_job
from test_coverage_of_walls import judged

from tankcal.methods.hits.wall import sight_wall
from tankcal.methods.strapping.wall import find_strapped_wall
from tankcal.methods.tangents.wall import touch_wall
from tankcal.pipeline.tanks import body_of
from tankcal.pipeline.wall.finding import find_wall

TOP = 9  # of the rows that `judged` states: the full tank


def quiet(text):
    """Progress that nobody sees."""


def by_points(rng, wall, folder):
    job = job_of(wall, survey(rng, wall, rings=2, points=24, noise_m=1e-3), folder)
    return body_of(job, find_wall(job, quiet))


def by_tape(rng, wall, folder):
    job = strapped_job(rng, wall, straps=2, folder=folder, shape_sd_m=shape_of(wall))
    return body_of(job, find_strapped_wall(job, quiet))


def by_lines(rng, wall, folder):
    job, _ = plumbed_job(rng, wall, lines=16, folder=folder)
    return body_of(job, find_strapped_wall(job, quiet))


def by_hits(rng, wall, folder, straps):
    job = hit_job(rng, wall, folder=folder, hits=20, straps=straps)
    job, _ = sight_wall(job, None, quiet)
    return body_of(job, find_wall(job, quiet))


def by_tangents(rng, wall, folder, lines=False):
    job, poses, tools = tangent_job(rng, wall, folder=folder / "sights", stations=8)
    if lines:
        job = replace(job, lines=lines_of(rng, wall, folder))
    job, _, found = touch_wall(job, poses, tools, quiet)
    return body_of(job, found)


def by_ring(rng, wall, folder, beside):
    job = ring_job(rng, wall, folder=folder, beside=beside)
    return body_of(job, find_wall(job, quiet))


def by_all(rng, wall, folder):
    job = sighted(whole_job(rng, wall, folder=folder, hits=16, lines=16))
    return body_of(job, find_wall(job, quiet))


def by_untied_hits(rng, wall, folder):
    job = sighted(untied_job(rng, wall, folder=folder))
    return body_of(job, find_wall(job, quiet))


METHODS = {
    "points": by_points,
    "tape": by_tape,
    "lines": by_lines,
    "hits": partial(by_hits, straps=False),
    "hits and tape": partial(by_hits, straps=True),
    "untied hits": by_untied_hits,
    "hits, tape and lines": by_all,
    "a ring of points and lines": partial(by_ring, beside="lines"),
    "a ring of points and tape": partial(by_ring, beside="straps"),
    "tangents": by_tangents,
    "tangents and lines": partial(by_tangents, lines=True),
}


@pytest.mark.slow
def test_every_method_agrees_with_the_truth_and_the_others(tmp_path, figure):
    rng, held, agreed = np.random.default_rng(18), [], []
    for family in FAMILIES:
        wall = make_wall(rng, family, radius_m=7.5, courses=5)
        found = {
            name: judged(wall, method(rng, wall, tmp_path / name), family, name)
            for name, method in METHODS.items()
        }
        error = {name: one.error[TOP] for name, one in found.items()}
        expanded = {name: one.expanded[TOP] for name, one in found.items()}
        held += [abs(error[name]) <= expanded[name] for name in METHODS]
        agreed += [
            abs(error[a] - error[b]) <= np.hypot(expanded[a], expanded[b])
            for a, b in combinations(METHODS, 2)
        ]
        for name in METHODS:
            text = f"{1e6 * error[name]:+.0f} ppm, U {1e6 * expanded[name]:.0f}"
            figure(f"{family} wall by {name}", text)
    assert np.mean(held) >= 0.92
    assert np.mean(agreed) >= 0.92
