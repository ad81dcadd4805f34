"""The body of a tank that geometry and liquid know together: rows, sources, as any other body.

    V(L) + C(L) z + b s(L),     z, b = G y

C are the columns of geometry (and of the bottom's flexing), b the volume below the first dip. The
sources follow by the law of propagation, with y = A z + F b + N e:

    C - (C G) A  of a cause of geometry,    -(C G) A,  -(C G) N  of the liquid's own.

Every cause keeps its name, its distribution and its degrees of freedom.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.pipeline.liquid_geometry import column_of, sources_at, stacked, volumes_at
from tankcal.tank.body import Body, Factor, ShellPart, SolidPart
from tankcal.tank.parts import Part
from tankcal.uncertainty import Source

AREA_STEP_M = 1e-4  # of the difference that the correction's part of the free surface is


@dataclass(frozen=True)
class Known:
    """What liquid makes of a geometry: all that a body needs to give any row.

    Attributes
    ----------
    geometry : Geometry
        At its last place.
    z : ndarray, shape (c,)
        Estimates of the deviates of the geometry's sources.
    gain : ndarray, shape (c, n)
        Of these by the misclosures.
    sources : tuple of Source
        Of geometry, columns by the n misclosures.
    liquid : tuple of Source
        Of the readings and what they share, likewise.
    moved : tuple of (Place, float)
        Declared inputs that were moved, with their deviate.
    first_m : float or None
        Level of the first dip, where what is below it is a volume of its own; None: it is not.
    bottom_m3 : float
        That volume, beyond geometry's.
    bottom_gain : ndarray, shape (n,)
    flex : float
        Estimate of the bottom's flexing, m3 per metre of head; with flex_sd and flex_gain (n,).
    """

    geometry: object
    z: np.ndarray
    gain: np.ndarray
    sources: tuple[Source, ...]
    liquid: tuple[Source, ...]
    moved: tuple = ()
    first_m: float | None = None
    bottom_m3: float = 0.0
    bottom_gain: np.ndarray | None = None
    flex: float = 0.0
    flex_sd: float = 0.0
    flex_gain: np.ndarray | None = None
    flex_column: np.ndarray | None = None
    density_kg_m3: float = 0.0

    def share(self, levels_m):
        """(rows,) part of the volume below the first dip that lies below a level."""
        if self.first_m is None:
            return np.zeros(len(levels_m))
        reach = max(self.first_m, AREA_STEP_M)
        return np.clip(np.asarray(levels_m) / reach, 0.0, 1.0)


@dataclass(frozen=True)
class JointBody(Body):
    """A tank by geometry and liquid; a `Body` whose parts are those of geometry.

    Attributes
    ----------
    known : Known
    plain : Body
        The same by geometry, its sizes where liquid has them.
    slim : Body
        `plain` with one column for all that a survey leaves uncertain: that of the estimates.
    weights : ndarray
        Deviates of the sources of `slim`.
    head : float
        Density of the table's liquid over that of the calibrating one.
    """

    known: Known | None = None
    plain: Body | None = None
    slim: Body | None = None
    weights: np.ndarray | None = None
    head: float = 1.0

    is_bent = False  # what `simulation` asks: volumes follow the causes as straight lines

    def volume_m3(self, levels_m):
        """(rows,) volume below each level, never below 0."""
        levels = np.asarray(levels_m, dtype=float)
        volume = volumes_at(self.plain, levels, self.known.geometry.shift_m)
        return np.maximum(volume + self._correction_m3(levels), 0.0)

    def area_m2(self, levels_m):
        """(rows,) derivative of the volume by the level."""
        levels = np.asarray(levels_m, dtype=float)
        inside = self._of_plain(levels)
        there = np.minimum(levels, self.highest_m - AREA_STEP_M)
        rise = self._correction_m3(there + AREA_STEP_M) - self._correction_m3(there)
        return self.plain.area_m2(inside) + rise / AREA_STEP_M

    def derivatives(self, levels_m):
        """{input: (rows,)} of geometry alone."""
        return self.plain.derivatives(self._of_plain(levels_m))

    def moved_m3(self, levels_m, step_m):
        """(rows,) volumes when the table's zero stands step_m higher."""
        levels = np.asarray(levels_m, dtype=float)
        moved = np.clip(levels + step_m, self.lowest_m, self.highest_m)
        plain = self.plain.moved_m3(levels, self.known.geometry.shift_m + step_m)
        return np.maximum(plain + self._correction_m3(moved), 0.0)

    def undeclared(self):
        """Those of geometry, but for what liquid tells where nobody surveyed the wall."""
        told = self.known.geometry.told_by_liquid
        return tuple(name for name in self.plain.undeclared() if name not in told)

    def sources(self, levels_m):
        """One `Source` for each cause: those of geometry, then those of liquid."""
        levels, known = np.asarray(levels_m, dtype=float), self.known
        of_geometry, head = self._of_geometry(self.plain, levels), self._head_m(levels)
        by_y = self.by_misclosures(levels, of_geometry)
        found = [
            _less(one, other, by_y) for one, other in zip(of_geometry, known.sources, strict=True)
        ]
        found += [one.weighted(-by_y) for one in known.liquid]
        if known.flex_sd:
            columns = known.flex_sd * head - by_y @ known.flex_column
            found.append(
                Source("bottom_flex", columns[:, None], u=known.flex_sd, unit="m3/m", type="B",
                       estimate=known.flex)
            )  # fmt: skip
        return (*(one for one in found if np.any(one.columns_m3)), *self._below_first(levels))

    def by_misclosures(self, levels_m, of_geometry=None):
        """Derivative of the volumes below levels by the misclosures, shape (rows, n).

        of_geometry  sources of the geometry at the levels; None: they are computed
        """
        levels, known = np.asarray(levels_m, dtype=float), self.known
        if of_geometry is None:
            of_geometry = self._of_geometry(self.plain, levels)
        by_y = stacked(of_geometry, len(levels)) @ known.gain
        by_y = by_y + np.outer(known.share(levels), _or_nothing(known.bottom_gain, by_y))
        return by_y + np.outer(self._head_m(levels), _or_nothing(known.flex_gain, by_y))

    def rows(self, levels_m):
        """(volumes, areas, sources) of a table."""
        return self.volume_m3(levels_m), self.area_m2(levels_m), self.sources(levels_m)

    def only_shell(self):
        """The same of the shell alone; the other parts hold nothing, and what liquid says of them
        is left out.
        """
        none = {"bottom_gain": None, "flex_gain": None, "flex": 0.0, "flex_sd": 0.0}
        return replace(
            self,
            known=replace(self.known, first_m=None, bottom_m3=0.0, **none),
            plain=_silenced(self.plain),
            slim=_silenced(self.slim),
        )

    def _of_plain(self, levels_m):
        moved = np.asarray(levels_m, dtype=float) + self.known.geometry.shift_m
        return np.clip(moved, self.plain.lowest_m, self.plain.highest_m)

    def _head_m(self, levels):
        return self.head * np.maximum(levels, 0.0)

    def _of_geometry(self, body, levels):
        return sources_at(self.known.geometry, body, self._of_plain(levels))

    def _correction_m3(self, levels):
        """(rows,) what liquid adds to geometry: no row costs more than a few columns."""
        known, sources = self.known, self._of_geometry(self.slim, levels)
        found = stacked(sources, len(levels)) @ self.weights
        for place, deviate in known.moved:
            found = found - deviate * column_of(sources, place)
        found = found + known.bottom_m3 * known.share(levels)
        return found + known.flex * self._head_m(levels)

    def _below_first(self, levels):
        """How the volume below the first dip is spread there: nobody knows."""
        known = self.known
        if known.first_m is None or not np.any(levels < known.first_m):
            return ()
        half = abs(known.bottom_m3) * (1 - known.share(levels))
        columns = half[:, None] / np.sqrt(3)
        return (Source("below_first_dip", columns, type="B", distribution="rectangular"),)


@dataclass(frozen=True)
class Silent(Part):
    """A part that holds nothing, with as many sources as another."""

    part: Part

    def volume_m3(self, levels_m):
        """(rows,) zeros."""
        return np.zeros(len(levels_m))

    def area_m2(self, levels_m):
        """(rows,) zeros."""
        return np.zeros(len(levels_m))

    def derivatives(self, levels_m):
        """None."""
        return {}

    def sources(self, levels_m):
        """Those of the part, of no size."""
        return tuple(one.mapped(np.zeros_like) for one in self.part.sources(levels_m))


def _silenced(body):
    parts = tuple(one if one is body.shell else Silent(one) for one in body.parts)
    return replace(body, parts=parts)


def join_body(known, density_kg_m3=None):
    """`JointBody` of what liquid makes of a geometry; density of the liquid, None: the table's."""
    geometry, zero = known.geometry, known.geometry.shift_m
    plain = geometry.body(density_kg_m3)
    slim, weights = _slimmed(plain, known)
    if density_kg_m3 is None:
        density_kg_m3 = geometry.job.table.liquid_density_kg_m3
    return JointBody(
        parts=plain.parts,
        declared=plain.declared,
        lowest_m=plain.lowest_m,
        highest_m=plain.highest_m - zero,
        correlations=plain.correlations,
        estimates=plain.estimates,
        shell=plain.shell,
        known=known,
        plain=plain,
        slim=slim,
        weights=weights,
        head=density_kg_m3 / known.density_kg_m3,
    )


def _slimmed(body, known):
    """(body, (c,) deviates): every survey's factors as the one column of their estimates."""
    widths = [one.columns_m3.shape[1] for one in known.sources]
    pieces = np.split(known.z, np.cumsum(widths)[:-1])
    first, parts, weights = 0, [], []
    levels = np.array([body.highest_m])
    for part in body.parts:
        own = len(part.sources(levels))
        mine = pieces[first : first + own]
        if isinstance(part, ShellPart) and part.factors:
            part = replace(part, factors=_one_each(part.factors, mine))
            mine = [np.ones(1)] * own
        elif isinstance(part, SolidPart) and part.form is not None:
            count = len(part.form.factors)
            one_each = _one_each(part.form.factors, mine[:count])
            part = replace(part, form=replace(part.form, factors=one_each))
            mine = [*[np.ones(1)] * count, *mine[count:]]
        parts.append(part)
        weights += mine
        first += own
    shell = next((one for one in parts if isinstance(one, ShellPart)), None)
    slim = replace(body, parts=tuple(parts), shell=shell and body.shell and shell)
    return slim, np.concatenate([*weights, *pieces[first:], np.zeros(0)])


def _one_each(factors, deviates):
    pairs = zip(factors, deviates, strict=True)
    return tuple(Factor(one.kind, (one.columns @ z)[:, None]) for one, z in pairs)


def _less(one, other, by_y):
    """A source of the table less what the misclosures say of its causes."""
    columns = one.columns_m3 - by_y @ other.columns_m3
    parts = tuple(_less(*pair, by_y) for pair in zip(one.parts, other.parts, strict=True))
    return replace(one, columns_m3=columns, parts=parts)


def _or_nothing(gain, by_y):
    return np.zeros(by_y.shape[1]) if gain is None else gain
