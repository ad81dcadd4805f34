"""The wall from rings of a horizontal tank, and warnings about it.

Rings of a horizontal cylinder measured by strapping: inside radii and their uncertainty.

A ring is a cylinder with the mean radius of its straps. Its form between the straps (taper, bulge)
and the distance of its bottom at the dip from the mean are uncertain. Their prior sizes are those
of the wall components (`geometry.field`). A tape does not show the deviation of a ring from a
circle, so its size is declared. Each wave cos(k a) of this deviation changes the rows of the table
directly, and through the bottom from which dips count. A horizontal tank flattens under its own
weight. Half of the variance is assigned to this, as wave 2 common to all rings. The other half is
distributed like the components of walls.

Warnings about the rings of a horizontal tank that are unlikely for a valid survey.

Lap-jointed rings are inner and outer in turn. The inside radius of an outer ring is larger by the
plate thickness of its inner neighbours. Rings exchanged in a file break this order.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import Problem
from tankcal.geometry.field.components import COMPONENTS, OVALITY_MODES, mode_shares
from tankcal.geometry.field.estimate import LEVELS, gauss_heights
from tankcal.geometry.girth import perimeter_excess
from tankcal.messages import message
from tankcal.methods.strapping.warnings import (
    FAR_LIMITS,
    FILE,
    check_repeats,
    check_tapes,
    limit_of_repeats,
    read_once,
    straps_apart,
)
from tankcal.pipeline.checks import limits_of
from tankcal.pipeline.checks.size import (
    InsideRadii,
    allowed_departure_m,
    check_side,
    departure_of_size,
)
from tankcal.pipeline.read_wall import names_of, readings_of_straps
from tankcal.pipeline.tanks.solid import factor_of_unseen, inside_end, is_warmed, thermal_scale
from tankcal.pipeline.wall_straps import (
    AreaTerm,
    TapedWall,
    adjust_readings,
    exchanged_courses,
    gauged_plates,
)
from tankcal.quadrature import panels
from tankcal.survey.strapping import reduce_straps, tapes_used
from tankcal.tank.body import SolidPart
from tankcal.tank.budgets import Factor
from tankcal.tank.lying import WAVES, RingedTank

# Radius of the measured shell, m. Bulges and drawn-in joints of rings scale with the square root of
# the radius R. A girth weld that shrinks with the force F draws a plate of thickness t in by
# F beta R / (2 E t) with beta = (3 (1 - nu^2))^(1/4) / sqrt(R t), the ring load of a long cylinder;
# a residual strain moves the plate in proportion to R, and filling in proportion to R^2.
UPRIGHT_M = 7.5
FLATTENED = 0.5  # share of the variance round a ring due to its weight on saddles
KIND_OF_WAVES = {"oval": "ovality", "seam": "seams"}
SURVEYED = ("ring_radii", "dip_radius", "ring_waves")


@dataclass(frozen=True)
class RingedWall(TapedWall):
    """Strapped rings of a horizontal tank; levels are positions along the axis from end A."""

    surveyed_as = "rings"

    def radius_sd_m(self, factors):
        """Standard deviations (rings,) of the mean radii from the factors of `RingFeatures`, m."""
        rings = len(self.joints_m) - 1
        return np.sqrt(sum(np.sum(factor.columns[:rings] ** 2, axis=1) for factor in factors))

    def features_at(self, dip_from_a_m):
        """`RingFeatures` of a tank dipped at a distance from end A."""
        return RingFeatures(self, dip_from_a_m)


class RingFeatures:
    """Features of rings: mean radii, the bottom at the dip, and the waves of each ring.

    The rows of its columns match the derivatives of `RingedTank` by ring_radii, dip_radius and
    ring_waves.

    Parameters
    ----------
    wall : RingedWall
    dip_from_a_m : float
        Distance of the dip from end A, m.
    """

    def __init__(self, wall, dip_from_a_m):
        self._wall, self._rings = wall, len(wall.joints_m) - 1
        self._zero = min(
            max(int(np.searchsorted(wall.joints_m, dip_from_a_m, side="right")) - 1, 0),
            self._rings - 1,
        )
        low, high = wall.joints_m[self._zero], wall.joints_m[self._zero + 1]
        self._means = wall.field.means
        self._of_levels = self._weights_of_levels(2 * (dip_from_a_m - low) / (high - low) - 1)

    def factors(self, job):
        """`Factor`s of the uncertainty that the tape leaves in the features."""
        factors_of_tape = self._wall.factors(job, self._of_levels @ self._means.weights)
        return (
            *map(self._padded, factors_of_tape),
            *self._factors_of_bulges(),
            *self._factors_of_waves(),
        )

    def read_with(self):
        """Derivatives (features,) by inputs, such as the temperature of the shell and tape."""
        by_inputs = self._wall.read_with(self._of_levels @ self._means.weights)
        return {name: self._with_waves(column) for name, column in by_inputs.items()}

    def _weights_of_levels(self, zeta):
        """Weights (rings + 1, rings * LEVELS) of radii at the Gauss heights.

        The first rows give the mean radius of each ring. The last row gives the difference between
        the wall at height zeta of the dipped ring and its mean.
        """
        share, nodes = panels([0.0, 1.0], LEVELS)[1], gauss_heights()
        weights = np.kron(np.vstack([np.eye(self._rings), np.zeros(self._rings)]), share)
        nodes_without_j = [np.delete(nodes, j) for j in range(LEVELS)]
        # Lagrange polynomials through the Gauss heights, evaluated at zeta.
        interpolation = [
            np.prod((zeta - other_nodes) / (node - other_nodes))
            for node, other_nodes in zip(nodes, nodes_without_j, strict=True)
        ]
        columns = slice(self._zero * LEVELS, (self._zero + 1) * LEVELS)
        weights[-1, columns] = interpolation - share
        return weights

    def _with_waves(self, rows):
        """Append zero rows for the waves, which a tape does not show."""
        padding = ((0, self._rings * len(WAVES)), *((0, 0),) * (np.ndim(rows) - 1))
        return np.pad(rows, padding)

    def _padded(self, factor):
        """A `Factor` of radii and the bottom, with zero rows for the waves."""
        return factor.mapped(self._with_waves)

    def _factors_of_bulges(self):
        """`Factor` of the variation of the mean radius along rings between the straps."""
        assumed = self._wall.field.amplitudes.assumed_share()
        indices = [i for i, component in enumerate(COMPONENTS) if component.shape == "mean"]
        weights = self._of_levels
        parts = [weights @ self._means.unseen(i) @ weights.T for i in indices]
        factor = factor_of_unseen(
            "bulge", parts, [np.trace(part) for part in parts], assumed[indices]
        )
        return (self._padded(factor),) if factor.columns.shape[1] else ()

    def _factors_of_waves(self):
        """`Factor`s of the deviations from a circle, of declared size."""
        shape = self._wall.shape_sd_m
        if not shape:
            return
        shares = {
            key: (1 - FLATTENED) * size * shape**2 for key, size in _shares_of_waves().items()
        }
        radius = float(np.mean(self._wall.radius_m))
        orders = np.arange(2.0, OVALITY_MODES[-1] + 1)
        for name, kind in KIND_OF_WAVES.items():
            # `FLATTENED` of the variance is wave 2 of all rings; the rest has the spectrum of the
            # components.
            spectrum = mode_shares(orders, radius)[name]
            columns = [
                *self._waves(np.sqrt(shares[name, True] * spectrum), common=True),
                *self._waves(np.sqrt(shares[name, False] * spectrum), common=False),
            ]
            if name == "oval":  # the amplitude of cos 2a is sqrt(2) times the sd of the radius
                columns += self._waves(np.sqrt([2 * FLATTENED * shape**2]), common=True)
            yield Factor(kind, np.column_stack(columns), note="assumed")

    def _waves(self, sds_m, *, common):
        """Columns of waves with the given standard deviations, common to all rings or one per ring.

        Waves shorter than those in `WAVES` change only the bottom at the dip.
        """
        count = self._rings + 1 + self._rings * len(WAVES)
        for k, sd in enumerate(sds_m[: len(WAVES)]):
            places = self._rings + 1 + np.arange(self._rings) * len(WAVES) + k
            for rows in [places] if common else places[:, None]:
                column = np.zeros(count)
                column[rows] = sd
                yield column
        if len(sds_m) > len(WAVES):
            column = np.zeros(count)
            # Shorter waves are independent, so their variances add at the bottom of the dip.
            column[self._rings] = np.sqrt(np.sum(sds_m[len(WAVES) :] ** 2))
            yield column


def _shares_of_waves():
    """{(shape, common): share of the variance round a wall}, from the medians of the components."""
    sizes = {(shape, common): 0.0 for shape in KIND_OF_WAVES for common in (True, False)}
    for component in COMPONENTS:
        if component.shape in KIND_OF_WAVES:
            sizes[component.shape, component.common] += component.median_m**2
    total = sum(sizes.values())
    return {key: size / total for key, size in sizes.items()}


def find_ringed_wall(job, progress, amplitudes=None):
    """`RingedWall` of a job with strapped rings.

    Parameters
    ----------
    job : Job
    progress : callable
        Called with a line of text when the step begins.
    amplitudes : Amplitudes, optional
        Known amplitudes of the wall components; None: estimated from the readings.
    """
    straps = job.strapping
    progress(
        message(
            "strapping_rings",
            "reducing {count} readings of the tape to {rings} rings",
            count=len(straps.straps),
            rings=len(job.rings),
        )
    )
    readings_m = [strap.reading_m for strap in straps.straps]
    nominal = float(np.median(readings_m)) / (2 * np.pi)
    reduced = reduce_straps(straps, job.survey.shell_temperature_c, 2 * nominal)
    places = [i for i, reduced_strap in enumerate(reduced) if not reduced_strap.strap.check]
    term = AreaTerm(*perimeter_excess(straps.shape_sd_m, nominal))
    readings = readings_of_straps([reduced[i] for i in places], names_of(job.rings), term)
    joints = np.concatenate([[0.0], np.cumsum([ring.length_m for ring in job.rings])])
    readings, tested, field = adjust_readings(
        readings,
        (joints, 0.0, nominal),
        amplitudes,
        snooping=job.snooping,
        bulge_scale=min(np.sqrt(nominal / UPRIGHT_M), 1.0),
    )
    return RingedWall(
        joints_m=joints,
        zero_m=0.0,
        readings=tuple(readings),
        places=np.array(places),
        tested=tested,
        field=field,
        reduced=reduced,
        area_term=term,
        plate_sd_m=gauged_plates(job),
        tapes=tapes_used(straps),
        shape_sd_m=straps.shape_sd_m,
    )


def inside_radii(job, wall):
    """`InsideRadii` of a `RingedWall`."""
    plates = np.array([ring.thickness_m + ring.paint_m for ring in job.rings])
    return InsideRadii(
        tuple(names_of(job.rings)), wall.straps.radius_m - plates, plates, np.zeros(len(plates))
    )


def ringed_part(job, wall, switches):
    """`SolidPart` of a `wall.RingedWall`."""
    scale, lying = thermal_scale(job, switches), job.horizontal
    ends_m = lying.thickness_m * switches.plate
    insets = [
        switches.plate * ring.thickness_m + switches.paint * ring.paint_m for ring in job.rings
    ]
    radii = wall.radius_m - insets
    tank = RingedTank(
        tuple(float(scale * radius) for radius in radii),
        tuple(scale * ring.length_m for ring in job.rings),
        end_a=inside_end(lying.end_a, 2 * float(wall.radius_m[0]), ends_m, scale),
        end_b=inside_end(lying.end_b, 2 * float(wall.radius_m[-1]), ends_m, scale),
        tilt=lying.tilt,
        dip_from_a_m=scale * lying.dip_from_a_m,
        dip_direction=lying.dip_direction,
    )
    features = wall.features_at(lying.dip_from_a_m)
    warmed = is_warmed(job, switches)
    is_used = {
        "plate_thickness": switches.plate and any(ring.thickness_m for ring in job.rings),
        "paint": switches.paint and any(ring.paint_m for ring in job.rings),
    }
    return SolidPart(
        tank,
        scale,
        job.material.expansion_per_k,
        warmed=warmed,
        surveyed=SURVEYED,
        factors=tuple(
            factor.mapped(lambda columns: scale * columns) for factor in features.factors(job)
        ),
        unused=tuple(name for name, is_relevant in is_used.items() if not is_relevant),
        read_with=features.read_with() if warmed else {},
    )


LIMITS = "repeats_lying"  # table of the rule file
# Mean remaining step, as a share of a plate, below which an order of laps fits; also the least
# step in the wrong direction that counts as a contradiction of rings.csv.
FITS = 0.5


def check_rings(job, wall):
    """`Problem`s of a `RingedWall`."""
    straps = wall.straps
    return (
        *check_tapes(job, straps, job.strapping),
        *check_repeats(straps, LIMITS),
        *_check_pairs(job, straps),
        *_check_other_rings(job, straps),
        *_check_laps(job, straps),
        *_check_nominal(job, straps),
        *_uncontrolled(job, wall),
    )


def _problem(text, row=None, column="reading_m"):
    return Problem(FILE, text, row=row, column=column)


def _check_pairs(job, straps):
    """Problems of straps that differ from the other straps of their ring by more than taper."""
    for size, strap, count, typical in straps_apart(names_of(job.rings), straps):
        template = (
            "the {count} straps of ring {ring!r} differ by {apart_mm:.1f} mm, those of other rings"
            " by {usual_mm:.1f} mm: is one of them misread, over an obstruction or not square to"
            " the axis?"
        )
        ring, apart_mm, least = strap.strap.course, 1000 * size, 1000 * typical
        if size > FAR_LIMITS * limit_of_repeats(strap.circumference_m, LIMITS):
            text = message(
                "strap_of_ring_far",
                template,
                count=count,
                ring=ring,
                apart_mm=apart_mm,
                usual_mm=least,
            )
        else:
            text = message(
                "strap_of_ring_apart",
                template,
                count=count,
                ring=ring,
                apart_mm=apart_mm,
                usual_mm=least,
            )
        yield _problem(text, strap.strap.row)


def _check_other_rings(job, straps):
    """Problems of rings whose radius differs from the median of the other rings of the same lap.

    The tolerance is a nominal share plus part of a plate, or a whole plate if the laps are not
    given.
    """
    plates = np.array([ring.thickness_m + ring.paint_m for ring in job.rings])
    inside, names = straps.radius_m - plates, names_of(job.rings)
    laps = np.array([ring.lap or "" for ring in job.rings])
    step = float(np.max(plates)) * (FITS if np.all(laps != "") else 1.0)
    if np.any(laps == ""):
        laps[:] = ""
    for lap in dict.fromkeys(laps.tolist()):
        same_lap = np.flatnonzero(laps == lap)
        median = float(np.median(inside[same_lap]))
        allowed = limits_of("nominal_size")["share"] * median + step
        for place in same_lap[np.abs(inside[same_lap] - median) > allowed]:
            text = message(
                "ring_far",
                "ring {ring!r} comes out {miss_mm:+.1f} mm of radius from the others, more than a"
                " lap: is a strap of it misread or over an obstruction, or is its plate another"
                " one?",
                ring=names[place],
                miss_mm=1000 * float(inside[place] - median),
            )
            yield _problem(text, column="ring")


def _check_laps(job, straps):
    """Problems of rings that appear exchanged, and of an order that contradicts rings.csv."""
    plates = np.array([ring.thickness_m + ring.paint_m for ring in job.rings])
    laps = [ring.lap for ring in job.rings]
    thickness = np.array([ring.thickness_m for ring in job.rings])
    names = names_of(job.rings)
    if None not in laps and len(names) > 1:
        outer = np.array([lap == "outer" for lap in laps])
        if _steps_of_laps(straps.radius_m - plates, thickness, outer) < -FITS:
            yield _problem(
                message(
                    "laps_reversed",
                    "the rings that rings.csv calls inner are the wider ones, by about their"
                    " plates: are inner and outer rings mixed up, or the rows of the tape?",
                ),
                column="ring",
            )
            return
    pairs_found = exchanged_rings(straps.radius_m, plates, thickness, laps)
    if pairs_found:
        pairs = "; ".join(f"{names[first]} - {names[second]}" for first, second, *_ in pairs_found)
        text = message(
            "rings_exchanged",
            "with the readings of two rings exchanged ({pairs}) the rings would be inner and outer"
            " in turn, and steps that laps do not explain would add up to {left_mm:.1f} mm in place"
            " of {steps_mm:.1f} mm: are they mixed up?",
            pairs=pairs,
            left_mm=1000 * pairs_found[0][2],
            steps_mm=1000 * pairs_found[0][3],
        )
        yield _problem(text, column="ring")


def _steps_of_laps(inside_m, thickness_m, outer):
    """Mean step from inner to outer neighbours over the inner plate; 0 without such neighbours."""
    steps = []
    for i in range(len(outer) - 1):
        if outer[i] != outer[i + 1]:
            outer_ring, inner_ring = (i, i + 1) if outer[i] else (i + 1, i)
            if thickness_m[inner_ring] > 0:
                steps.append(
                    (inside_m[outer_ring] - inside_m[inner_ring]) / thickness_m[inner_ring]
                )
    return float(np.mean(steps)) if steps else 0.0


def exchanged_rings(outside_m, plates_m, thickness_m, laps):
    """Pairs of rings that appear exchanged, from the steps that laps leave between neighbours.

    The rings are valid if they fit an order: butt-jointed, or inner and outer in turn. The order is
    that in `laps`, or either order if `laps` states none. Otherwise each pair is tried in each
    order.

    Parameters
    ----------
    outside_m, plates_m : ndarray, shape (rings,)
        Outside radii, and plate thicknesses including paint, m.
    thickness_m : ndarray, shape (rings,)
        Plate thicknesses, m.
    laps : sequence of str or None
        "inner" or "outer" for each ring.

    Returns
    -------
    list of (int, int, float, float)
        The pair, and the sums of the steps with the pair exchanged and as read, m. Two entries if
        orders that begin with an inner or an outer ring explain the readings equally well.

    Examples
    --------
    >>> plates = np.full(5, 0.008)
    >>> inside = np.array([1.200, 1.200, 1.192, 1.192, 1.200])
    >>> [pair[:2] for pair in exchanged_rings(inside + plates, plates, plates, [None] * 5)]
    [(1, 2)]
    """
    count = len(outside_m)
    if count < 3:
        return []
    if None in laps:
        first = np.arange(count) % 2 == 0
        orders = [np.zeros(count, dtype=bool), first, ~first]
    else:
        orders = [np.array([lap == "outer" for lap in laps])]
    # In the true order, outer rings are wider by the inner plates; after subtraction no step
    # remains.
    shifts = [outer * _inner_plates(thickness_m, outer) for outer in orders]
    inside = outside_m - plates_m
    steps = [np.abs(np.diff(inside - shift)).sum() for shift in shifts]
    if min(steps) < FITS * float(np.median(thickness_m)) * (count - 1):
        return []
    exchanged = [exchanged_courses(outside_m, plates_m + shift, range(count)) for shift in shifts]
    exchanged = [result for result in exchanged if result is not None]
    least = min((sum_m for _, _, sum_m, _ in exchanged), default=0.0)
    limit = least + FITS * float(np.median(thickness_m))
    return list({result[:2]: result for result in exchanged if result[2] <= limit}.values())


def _inner_plates(thickness_m, outer):
    """Mean plate of the inner neighbours of each ring, or its own plate without any, m."""
    plates_m = thickness_m.astype(float)
    for i in range(len(outer)):
        inner_neighbours = [k for k in (i - 1, i + 1) if 0 <= k < len(outer) and not outer[k]]
        if inner_neighbours:
            plates_m[i] = np.mean(thickness_m[inner_neighbours])
    return plates_m


def _check_nominal(job, straps):
    """Problems of a mean inside diameter that differs from the drawing."""
    nominal = job.tank.nominal_diameter_m
    if nominal is None:
        return
    plates = np.array([ring.thickness_m + ring.paint_m for ring in job.rings])
    inside = 2 * float(np.mean(straps.radius_m - plates))
    yield from check_side(job, inside, float(np.mean(plates)), 0.0)
    if job.diameter_is is None and abs(inside - nominal) > 2 * allowed_departure_m(job):
        template = "the rings come out {miss_mm:+.0f} mm of inside diameter from the nominal one"
        miss = 1000 * (inside - nominal)
        if departure_of_size(job, inside / 2, float(np.mean(plates))):
            text = message("rings_unlike_nominal", template, miss_mm=miss)
        else:
            text = message("rings_short_by_plates", template, miss_mm=miss)
        yield _problem(text)


def _uncontrolled(job, wall):
    """Problems of rings with a single reading, in which no other reading reveals a blunder."""
    single = read_once(names_of(job.rings), wall)
    if single:
        text = message(
            "rings_controlled_by_nothing",
            "rings {rings}: a single reading, which nothing controls; a second strap would",
            rings=", ".join(single),
        )
        yield _problem(text, column="ring")
