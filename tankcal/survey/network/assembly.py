"""From a survey to a least-squares problem: what is unknown, and in which column it stands."""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.solver import Group, Model
from tankcal.solver.rows import PART
from tankcal.survey.network.blocks import CORRELATED, correlated_groups, is_in_block
from tankcal.survey.network.survey import FEWEST, IMAGES, SCOPES
from tankcal.survey.network.unknowns import (
    eliminated_points,
    in_words,
    layout_of,
    name_of,
    name_of_exact,
    told,
)
from tankcal.survey.observations import (
    KnownUnknowns,
    Layout,
    State,
)


@dataclass(frozen=True)
class Held:
    """Observations that hold exactly (sd 0).

    observations  as the survey has them (relative to the centre)
    conditions    the same as conditions      row_of  (conditions,) number of each one's observation
    source, rows  see Problem
    """

    observations: object
    conditions: object
    row_of: np.ndarray
    source: object
    rows: np.ndarray


@dataclass(frozen=True)
class Problem:
    """A survey ready to be adjusted; coordinates relative to `centre_m`.

    model, state, layout   for the solver
    observations           tuple, one for each group of the model
    sources                for each group where it comes from: "image points", a number in
                           Survey.observations, or "known beforehand"
    rows_of                for each group its rows' numbers there
    set_aside              (points,) why a point does not take part; empty string: it does
    eliminated             (points,) True when a point is eliminated
    interior_of            (photos, 13) place of each photo's parameters in State.interior
    exact                  tuple of Held: observations that hold exactly
    points                 names
    ordinary               number of groups before those of correlated observations; their tables of
                           residuals come first as well
    blocks                 pairs (number of a group of correlated observations, Members); these come
                           last; None for the number where all of a block is set aside
    """

    model: Model
    state: State
    layout: Layout
    observations: tuple
    sources: tuple
    rows_of: tuple
    centre_m: np.ndarray
    set_aside: tuple
    eliminated: np.ndarray
    interior_of: np.ndarray
    exact: tuple = ()
    points: tuple = ()
    photos: tuple = ()
    ordinary: int = 0
    blocks: tuple = ()

    @property
    def aside(self):
        """(points,) True for those that do not take part."""
        return _are_told(self.set_aside)

    def name_of_point(self, point):
        """Name of a point."""
        return self.points[point]

    def relative(self, observations):
        """Observations in the survey's frame, as the model has them."""
        return observations.relative(self.centre_m)


def assemble(survey):
    """The Problem of a Survey; raises SolutionError when something cannot be determined."""
    set_aside = _set_aside(survey)
    used = ~_are_told(set_aside)
    centre = _centre(survey)
    table, values, interior_free, known = _interior(survey)
    groups, sources, rows_of, exact = _others(survey, used, centre)
    eliminated = eliminated_points(survey, groups, used, exact)
    for block in survey.correlated:
        for source in np.unique(block.source):
            one = survey.observations[source]
            for name in one.ties:
                eliminated[getattr(one, name)[block.row[block.source == source]]] = False
    layout, reduced = layout_of(survey, eliminated, used, interior_free, table)
    for one, rows in _image_groups(survey, used, layout, reduced, table):
        groups.append(one)
        sources.append(IMAGES)
        rows_of.append(rows)
    for one in known + _known_nuisances(survey):
        groups.append(one)
        sources.append("known beforehand")
        rows_of.append(np.arange(len(one)))
    state = _state(survey, centre, values)
    ordinary, blocks = len(groups), []
    for one, members in correlated_groups(survey, used, centre, state):
        blocks.append((None if one is None else len(groups), members))
        if one is not None:
            groups.append(one)
            sources.append(CORRELATED)
            rows_of.append(np.zeros(1, dtype=int))
    _refuse_coincident(survey, groups, state)
    model = Model(
        reduced=reduced,
        blocks=int(np.count_nonzero(eliminated)),
        groups=_groups(groups, layout),
        moved=layout.moved,
        name_of=lambda column: name_of(survey, layout, table, column),
        in_words=lambda directions: in_words(survey, layout, table, directions),
        exact=_groups([held.conditions for held in exact], layout),
        name_of_exact=lambda row: name_of_exact(survey, exact, row),
    )
    return Problem(
        model, state, layout, tuple(groups), tuple(sources), tuple(rows_of),
        centre, set_aside, eliminated, table, exact, survey.points,
        () if survey.photos is None else survey.photos.names,
        ordinary, tuple(blocks),
    )  # fmt: skip


def _refuse_coincident(survey, groups, state):
    """Raise when a sight starts with both its ends at one place: it has no derivatives there."""
    for one in groups:
        bad = one.without_derivatives(state)
        if bad.any():
            raise SolutionError(
                message(
                    "ends_coincide",
                    "both ends of {observation} have the same approximate place: the "
                    "points have too few observations, or one point has two names",
                    observation=told(survey, one, int(np.argmax(bad))),
                )
            )


def _groups(observations, layout):
    return tuple(
        Group(one.columns(layout).astype(np.int32, copy=False), one.rows, one.fill, one.part)
        for one in observations
    )


def _set_aside(survey):
    """For each point, why it cannot be determined; an empty string when it can."""
    images = survey.image_points
    if images is not None:
        _refuse_poor_photos(survey)
    bad = survey.values_of_points() < FEWEST
    if not bad.any():
        return ("",) * len(bad)
    rays = np.zeros(len(bad), dtype=int)
    if images is not None:
        rays += np.bincount(images.of_used("point"), minlength=len(bad))
    names = zip(survey.points, rays.tolist(), bad, strict=True)
    return tuple(_poor(name, count) if is_bad else "" for name, count, is_bad in names)


def _are_told(texts):
    """(n,) True where a text is not empty."""
    if not any(texts):  # of many points, in no time
        return np.zeros(len(texts), dtype=bool)
    return np.array([bool(text) for text in texts])


def _poor(name, rays):
    if rays == 1:
        return one_ray_sentence(name)
    return message("hardly_observed", "point {point} has too few observations", point=name)


def one_ray_sentence(name):
    """What is said of a point that one image alone shows."""
    return message("one_ray", "point {point} has only one ray", point=name)


def _refuse_poor_photos(survey):
    """Raise when a photo has fewer observations than unknowns."""
    images, photos = survey.image_points, survey.photos
    rays = np.bincount(images.of_used("photo"), minlength=len(photos.names))
    count = 2 * rays
    for one in survey.observations:
        if hasattr(one, "photo"):
            count += one.rows * np.bincount(one.photo, minlength=len(count))
    if photos.fixed is not None:
        count += np.repeat(photos.fixed, (1, 1, 1, 3), axis=1).sum(axis=1)
    poor = (count < 6).nonzero()[0]
    if len(poor):
        told = ", ".join(f"{photos.names[i]} ({rays[i]})" for i in poor)
        raise SolutionError(
            message(
                "photo_short_of_points",
                "a photo needs at least 3 image points: {photos}",
                photos=told,
            )
        )


def _others(survey, used, centre):
    """Observations other than image points, relative to the centre, between points that are used.

    Returns the observations, their numbers in the survey, the numbers of their rows, and a tuple of
    Held for those that hold exactly.
    """
    groups, sources, rows_of, exact = [], [], [], []
    for number, one in enumerate(survey.observations):
        keep = np.ones(len(one), dtype=bool)
        for name in one.ties:
            keep &= used[getattr(one, name)]
        holds = one.exact
        if holds.any() and (sharp := (keep & holds & one.in_use).nonzero()[0]).size:
            taken = one.taken(sharp).relative(centre)
            exact.append(Held(taken, *taken.conditions(), number, sharp))
            if holds.all():
                continue
        rows = (keep & ~holds & ~is_in_block(survey, number)).nonzero()[0]
        groups.append((one if len(rows) == len(one) else one.taken(rows)).relative(centre))
        sources.append(number)
        rows_of.append(rows)
    return groups, sources, rows_of, tuple(exact)


def _centre(survey):
    """Middle of the start coordinates: where the adjustment puts its origin."""
    known = np.isfinite(survey.xyz_m)
    if not known.all():
        missing = [survey.points[i] for i in np.flatnonzero(~known.all(axis=1))[:5]]
        raise SolutionError(
            message(
                "no_approximate_coordinates",
                "no approximate coordinates for {points}",
                points=missing,
            )
        )
    return survey.xyz_m.mean(axis=0)


def _interior(survey):
    """Where each photo's interior parameters stand, their values, and which are unknowns.

    Returns table (photos, 13), values (q + 1,), free (q + 1,), and observations of weighted ones.
    """
    photos = survey.photos
    if photos is None:
        return np.zeros((0, 13), dtype=int), np.zeros(1), np.zeros(1, dtype=bool), []
    table = np.full((len(photos.names), 13), -1)
    values, free, known, shared = [], [], [], {}
    for camera, settings in enumerate(survey.cameras):
        mine = (photos.camera == camera).nonzero()[0]
        if not len(mine):
            continue
        if settings.scope[0] == "off" or not settings.values[0] > 0:
            raise SolutionError(
                message(
                    "no_principal_distance",
                    "{camera} has no principal distance c",
                    camera=settings.name,
                )
            )
        wanted = [[k for k in range(13) if settings.scope[k] == scope] for scope in SCOPES]
        each = [(shared, mine, wanted[1]), ({}, mine, wanted[2])]
        each += [({}, [photo], wanted[3]) for photo in mine] if wanted[3] else []
        for place, group, numbers in each:
            for k in numbers:
                if k not in place:
                    place[k] = len(values)
                    values.append(settings.values[k])
                    free.append(settings.state[k] != "fixed")
                    if settings.state[k] == "weighted":
                        known.append((place[k], values[-1], settings.sd[k]))
                table[group, k] = place[k]
    table[table < 0] = len(values)
    observed = []
    if known:
        index, value, sd = np.array(known).T
        observed = [KnownUnknowns(value, sd, "interior", index.astype(int))]
    return table, np.array([*values, 0.0]), np.array([*free, False]), observed


def _known_nuisances(survey):
    """Scales and offsets of instruments with an sd: weighted unknowns."""
    observed = []
    for of, one in survey.nuisances.items():
        index = (one.sd > 0).nonzero()[0]
        if len(index):
            observed.append(KnownUnknowns(one.value[index], one.sd[index], of, index))
    return observed


def _image_groups(survey, used, layout, reduced, table):
    """Image coordinates by form of camera, those of eliminated points first and point by point.

    Of so many as are evaluated together those of a photo stand next to one another: their rows
    have the same columns, and squares of all of them are one product.
    """
    images = survey.image_points
    if images is None or not len(images):
        return
    if not (images.sd > 0).all():
        raise SolutionError(
            message(
                "image_coordinate_exact",
                "an image coordinate cannot hold exactly: its sd must be above zero",
            )
        )
    first = layout.points[:, 0]
    last = np.count_nonzero(first >= reduced)
    of_point = np.where(first < reduced, last, (first - reduced) // 3)
    key = of_point.astype(np.min_scalar_type(last)).take(images.point)  # sorted faster
    for form, order in survey.by_form(images):
        left = table[[survey.cameras[camera].form == form for camera in survey.photos.camera]]
        if not used.all():
            order = order[used[images.point[order]]]
        of_order = key[order]
        if (of_order[1:] < of_order[:-1]).any():
            order = order[of_order.argsort(kind="stable")]
        eliminated = np.count_nonzero(key[order] < last)
        part = np.minimum(np.arange(len(order)), eliminated) // PART
        part[eliminated:] += 1
        of_photo = part * len(survey.photos.names) + images.photo[order]
        of_photo = of_photo.astype(np.min_scalar_type(of_photo.max(initial=0)))
        order = order[of_photo.argsort(kind="stable")]
        active = (left < layout.interior.size - 1).any(axis=0).nonzero()[0]
        active = active[(layout.interior[left[:, active]] >= 0).any(axis=0)]
        yield images.taken(order, form=form, active=active, interior_of=table), order


def _state(survey, centre, values):
    photos, systems = survey.photos, survey.systems
    found = {"nuisance": {of: one.value for of, one in survey.nuisances.items()}}
    if photos is not None:
        found |= {"photo_xyz_m": photos.xyz_m - centre, "rotation": photos.rotation}
    if systems:
        rotation = np.array([system.rotation for system in systems])
        scale = np.array([system.scale for system in systems])
        shift = np.array([system.shift_m for system in systems])
        shift = shift + (1 + scale)[:, None] * (rotation @ centre)
        found |= {"system": rotation, "system_shift_m": shift, "system_scale": scale}
    return State(xyz_m=survey.xyz_m - centre, interior=values, **found)
