"""Body of a tank determined by geometry and liquid together: its rows and sources.

    V(L) + C(L) z + b s(L),     z, b = G y

C are the columns of the geometry (and of the flexing of the bottom), b is the volume below the
first dip, s its share below level L, and y are the misclosures. The sources follow from the law of
propagation, with y = A z + F b + N e:

    C - (C G) A  of a cause of the geometry,    -(C G) A,  -(C G) N  of causes of the liquid.

Every cause keeps its name, its distribution and its degrees of freedom.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.pipeline.liquid.geometry import column_of, sources_at, stacked, volumes_at
from tankcal.tank.body import Body, Factor, ShellPart, SolidPart
from tankcal.tank.parts import Part
from tankcal.uncertainty import Source

AREA_STEP_M = 1e-4  # step of the difference quotient for the free surface of the correction


@dataclass(frozen=True)
class Known:
    """Results of the adjustment by liquid, sufficient to compute any row.

    Attributes
    ----------
    geometry : Geometry
        Geometry after its last step.
    z : ndarray, shape (c,)
        Estimated deviates of the sources of the geometry.
    gain : ndarray, shape (c, n)
        Derivative of z by the misclosures.
    sources : tuple of Source
        Sources of the geometry, with their effect on the n misclosures.
    liquid : tuple of Source
        Sources of the readings and of their common causes, with their effect on the misclosures.
    moved : tuple of (Place, float)
        Declared inputs that were moved, with their deviate.
    first_m : float or None
        Level of the first dip, if the volume below it is a separate unknown; otherwise None.
    bottom_m3 : float
        Estimate of this volume, beyond the volume by geometry.
    bottom_gain : ndarray, shape (n,)
        Derivative of this volume by the misclosures.
    flex, flex_sd : float
        Estimate of the flexing of the bottom and its prior standard deviation, m3 per metre of
        head.
    flex_gain, flex_column : ndarray, shape (n,)
        Derivative of the flexing by the misclosures, and its effect on the misclosures.
    density_kg_m3 : float
        Density of the calibrating liquid.
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
        """Share of the volume below the first dip that lies below each level, shape (rows,)."""
        if self.first_m is None:
            return np.zeros(len(levels_m))
        reach = max(self.first_m, AREA_STEP_M)
        return np.clip(np.asarray(levels_m) / reach, 0.0, 1.0)


@dataclass(frozen=True)
class JointBody(Body):
    """Tank determined by geometry and liquid; a `Body` with the parts of the geometry.

    Attributes
    ----------
    known : Known
    plain : Body
        Body by geometry, with its sizes as adjusted by liquid.
    slim : Body
        `plain` with a single column, the effect of the estimates, for all sources of a survey.
    weights : ndarray
        Deviates of the sources of `slim`.
    head : float
        Density of the liquid of the table over density of the calibrating liquid.
    """

    known: Known | None = None
    plain: Body | None = None
    slim: Body | None = None
    weights: np.ndarray | None = None
    head: float = 1.0

    is_bent = False  # for `simulation`: the volumes are linear in the causes

    def volume_m3(self, levels_m):
        """Volume below each level, shape (rows,), not below 0."""
        levels = np.asarray(levels_m, dtype=float)
        volume = volumes_at(self.plain, levels, self.known.geometry.shift_m)
        return np.maximum(volume + self._correction_m3(levels), 0.0)

    def area_m2(self, levels_m):
        """Derivative of the volume by the level, shape (rows,)."""
        levels = np.asarray(levels_m, dtype=float)
        inside = self._of_plain(levels)
        # The step must not pass the top of the tank.
        below_top = np.minimum(levels, self.highest_m - AREA_STEP_M)
        rise = self._correction_m3(below_top + AREA_STEP_M) - self._correction_m3(below_top)
        return self.plain.area_m2(inside) + rise / AREA_STEP_M

    def derivatives(self, levels_m):
        """Derivatives of the volumes by geometry, {input: (rows,)}."""
        return self.plain.derivatives(self._of_plain(levels_m))

    def moved_m3(self, levels_m, step_m):
        """Volumes (rows,) with the zero of the table step_m higher."""
        levels = np.asarray(levels_m, dtype=float)
        shifted = np.clip(levels + step_m, self.lowest_m, self.highest_m)
        plain = self.plain.moved_m3(levels, self.known.geometry.shift_m + step_m)
        return np.maximum(plain + self._correction_m3(shifted), 0.0)

    def undeclared(self):
        """Names of inputs without declared uncertainty, except those that liquid determines."""
        by_liquid = self.known.geometry.told_by_liquid
        return tuple(name for name in self.plain.undeclared() if name not in by_liquid)

    def sources(self, levels_m):
        """One `Source` per cause: causes of the geometry, then causes of the liquid."""
        levels, known = np.asarray(levels_m, dtype=float), self.known
        geometry_sources, head = self._of_geometry(self.plain, levels), self._head_m(levels)
        by_y = self.by_misclosures(levels, geometry_sources)
        sources = [
            _subtract_seen(source, seen, by_y)
            for source, seen in zip(geometry_sources, known.sources, strict=True)
        ]
        sources += [source.weighted(-by_y) for source in known.liquid]
        if known.flex_sd:
            columns = known.flex_sd * head - by_y @ known.flex_column
            sources.append(
                Source("bottom_flex", columns[:, None], u=known.flex_sd, unit="m3/m",
                       estimate=known.flex)
            )  # fmt: skip
        return (
            *(source for source in sources if np.any(source.columns_m3)),
            *self._below_first(levels),
        )

    def by_misclosures(self, levels_m, of_geometry=None):
        """Derivative of the volumes below levels by the misclosures, shape (rows, n).

        Parameters
        ----------
        levels_m : array_like, shape (rows,)
        of_geometry : tuple of Source, optional
            Sources of the geometry at the levels; None: computed here.

        Returns
        -------
        ndarray, shape (rows, n)
        """
        levels, known = np.asarray(levels_m, dtype=float), self.known
        if of_geometry is None:
            of_geometry = self._of_geometry(self.plain, levels)
        # Sum of the effects of the estimates: geometry, volume below the first dip, and flexing.
        by_y = stacked(of_geometry, len(levels)) @ known.gain
        by_y = by_y + np.outer(known.share(levels), _gain_or_zeros(known.bottom_gain, by_y))
        return by_y + np.outer(self._head_m(levels), _gain_or_zeros(known.flex_gain, by_y))

    def rows(self, levels_m):
        """Volumes, areas and sources of a table."""
        return self.volume_m3(levels_m), self.area_m2(levels_m), self.sources(levels_m)

    def only_shell(self):
        """Return the same body with the shell only.

        The other parts hold no volume, and the estimates of the bottom by liquid are omitted.
        """
        none = {"bottom_gain": None, "flex_gain": None, "flex": 0.0, "flex_sd": 0.0}
        return replace(
            self,
            known=replace(self.known, first_m=None, bottom_m3=0.0, **none),
            plain=_silence_parts(self.plain),
            slim=_silence_parts(self.slim),
        )

    def _of_plain(self, levels_m):
        """Levels in the frame of `plain`, limited to its range."""
        shifted = np.asarray(levels_m, dtype=float) + self.known.geometry.shift_m
        return np.clip(shifted, self.plain.lowest_m, self.plain.highest_m)

    def _head_m(self, levels):
        """Head of liquid at each level, times the ratio of densities."""
        return self.head * np.maximum(levels, 0.0)

    def _of_geometry(self, body, levels):
        """Sources of the geometry at each level."""
        return sources_at(self.known.geometry, body, self._of_plain(levels))

    def _correction_m3(self, levels):
        """Correction (rows,) of the volumes by liquid; `slim` limits the cost of a row."""
        known, sources = self.known, self._of_geometry(self.slim, levels)
        correction = stacked(sources, len(levels)) @ self.weights
        for place, deviate in known.moved:
            # Moved inputs have changed the geometry itself already: their linear part must not
            # count twice.
            correction = correction - deviate * column_of(sources, place)
        correction = correction + known.bottom_m3 * known.share(levels)
        return correction + known.flex * self._head_m(levels)

    def _below_first(self, levels):
        """Source of the unknown distribution of the volume below the first dip."""
        known = self.known
        if known.first_m is None or not np.any(levels < known.first_m):
            return ()
        # Any distribution below the first dip is possible: a rectangular distribution with this
        # half-width.
        half = abs(known.bottom_m3) * (1 - known.share(levels))
        columns = half[:, None] / np.sqrt(3)
        return (Source("below_first_dip", columns, distribution="rectangular"),)


@dataclass(frozen=True)
class Silent(Part):
    """A part without volume, with the same number of sources as another part."""

    part: Part

    def volume_m3(self, levels_m):
        """Zeros (rows,)."""
        return np.zeros(len(levels_m))

    def area_m2(self, levels_m):
        """Zeros (rows,)."""
        return np.zeros(len(levels_m))

    def derivatives(self, levels_m):
        """Empty dict."""
        return {}

    def sources(self, levels_m):
        """Sources of the part, with zero columns."""
        return tuple(source.mapped(np.zeros_like) for source in self.part.sources(levels_m))


def _silence_parts(body):
    """Body whose parts other than the shell hold no volume."""
    parts = tuple(part if part is body.shell else Silent(part) for part in body.parts)
    return replace(body, parts=parts)


def join_body(known, density_kg_m3=None):
    """Return the `JointBody` of the results by liquid; density None: liquid of the table."""
    geometry, zero = known.geometry, known.geometry.shift_m
    plain = geometry.body(density_kg_m3)
    slim, weights = _slim_body(plain, known)
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


def _slim_body(body, known):
    """Body with one column per survey factor, the effect of the estimates, and the deviates.

    Survey factors have many columns, which would make every row of a long table expensive.
    """
    widths = [source.columns_m3.shape[1] for source in known.sources]
    pieces = np.split(known.z, np.cumsum(widths)[:-1])
    first, parts, weights = 0, [], []
    levels = np.array([body.highest_m])
    for part in body.parts:
        count_of_part = len(part.sources(levels))
        estimates = pieces[first : first + count_of_part]
        if isinstance(part, ShellPart) and part.factors:
            part = replace(part, factors=_single_columns(part.factors, estimates))
            estimates = [np.ones(1)] * count_of_part
        elif isinstance(part, SolidPart) and part.form is not None:
            count = len(part.form.factors)
            factors = _single_columns(part.form.factors, estimates[:count])
            part = replace(part, form=replace(part.form, factors=factors))
            estimates = [*[np.ones(1)] * count, *estimates[count:]]
        parts.append(part)
        weights += estimates
        first += count_of_part
    shell = next((part for part in parts if isinstance(part, ShellPart)), None)
    slim = replace(body, parts=tuple(parts), shell=shell and body.shell and shell)
    return slim, np.concatenate([*weights, *pieces[first:], np.zeros(0)])


def _single_columns(factors, deviates):
    """Factors with their effect at given deviates as the single column."""
    pairs = zip(factors, deviates, strict=True)
    return tuple(Factor(factor.kind, (factor.columns @ z)[:, None]) for factor, z in pairs)


def _subtract_seen(source, seen, by_y):
    """Source of the table less the effect of its causes through the misclosures."""
    columns = source.columns_m3 - by_y @ seen.columns_m3
    parts = tuple(
        _subtract_seen(*pair, by_y) for pair in zip(source.parts, seen.parts, strict=True)
    )
    return replace(source, columns_m3=columns, parts=parts)


def _gain_or_zeros(gain, by_y):
    """Gain (n,), or zeros if there is none."""
    return np.zeros(by_y.shape[1]) if gain is None else gain
