"""A tank as the sum of its parts: shell, head, bottom, deadwood, roof, or one solid.

Every part gives volume, free surface and derivatives below any level; the table is their sum. An
input that several parts share (a scale, the table's zero) moves all of them at once: it is one
column of the covariance, the sum of their derivatives times its standard uncertainty.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.tank.factors import Factor, join_shared
from tankcal.tank.parts import Part, sum_derivatives
from tankcal.tank.surveyed_form import SurveyedForm
from tankcal.tank.volumes import ShellVolume
from tankcal.uncertainty import declared_source, group_correlated

OWN_SCALE = "instrument_scale"  # kind of a cause that stands for the input "scale"
MEASURED = (  # lengths at the warmth of the survey
    *("diameter", "length", "end_depth", "dish", "knuckle", "dip_position", "tube_offset"),
    *("plate_thickness", "paint", "ring_lengths", "ring_axes"),
)
ROUNDED_M = 0.001  # that the last dip of a table, a whole millimetre, stands above the top at most
LEVELS = 9  # from empty to full, at which inputs are asked whether they move the volume


@dataclass(frozen=True)
class ShellPart(Part):
    """The shell of courses as a part; it has nothing below the bottom of its first course.

    Attributes
    ----------
    volume : ShellVolume
        Inside, at the table's temperature.
    factors : tuple of Factor
        What the survey leaves uncertain about the shell's features: of the points, of causes that
        they share, and of the wall between them ("bulge", "ovality", "seams").
    scale : float
        Of horizontal lengths, by temperature; expansion_per_k its coefficient.
    stretch : float
        Of heights, by temperature; 1 where heights are not corrected.
    bearing : tuple of str
        Which of the inputs "plate_thickness", "paint", "shell_temperature" and "expansion" were
        used.
    tilt : float
        Of the axis, m/m.
    read_with : dict
        {input: (f,) derivative of the shell's features by it}, of inputs that the readings of the
        survey depend on: the temperature of a tape that has that of the shell.
    unused : tuple of str
        Names of inputs that have no meaning for the survey.
    subtracts : bool
        Whether plate and paint were taken off the surveyed radii.
    """

    volume: ShellVolume
    factors: tuple[Factor, ...]
    scale: float
    expansion_per_k: float
    stretch: float = 1.0
    bearing: tuple[str, ...] = ()
    tilt: float = 0.0
    read_with: dict = field(default_factory=dict)
    unused: tuple[str, ...] = ()
    subtracts: bool = True

    @property
    def breakpoints_m(self):
        """Bottoms of the courses."""
        return tuple(course.bottom_m for course in self.volume.courses)

    def volume_m3(self, levels_m):
        """(rows,) volume of the shell below each level."""
        return self.volume.volume_m3(np.maximum(levels_m, 0.0))

    def area_m2(self, levels_m):
        """(rows,) inside area at each level; 0 below the bottom."""
        return self.volume.area_m2(np.maximum(levels_m, 0.0)) * (np.asarray(levels_m) >= 0)

    def derivatives(self, levels_m):
        """{input: (rows,)} m3 per SI unit; of "course_heights" (rows, courses), each its own.

        "barrel" and "taper", where they were declared, are the same in all courses, for in a real
        tank they had one sign. "scale" multiplies the surveyed lengths square to the axis, "offset"
        adds to every surveyed radius, "datum" lifts the table's zero. "tilt" leans the shell as
        surveyed: the horizontal cut is sqrt(1 + m^2) times the one square to the axis.
        """
        wet = np.maximum(levels_m, 0.0)
        features = self.volume.features, self.volume.girth_features, self.volume.scale_features
        departures = {name: self.volume.missed_features(name) for name in self.volume.departures}
        columns = np.column_stack([*features, *departures.values(), *self.read_with.values()])
        volume, loss, by_scale, *others = self.volume.integrated(wet, columns).T
        area = self.area_m2(levels_m)
        by_length = 2 * volume / self.scale
        if self.stretch != 1.0:
            by_length = by_length + (volume - area * wet) / self.stretch
        of_corrections = {
            "plate_thickness": -loss * self.subtracts,
            "paint": -loss * self.subtracts,
            "shell_temperature": -self.expansion_per_k * by_length,
            "expansion": (self.scale - 1) / self.expansion_per_k * by_length,
        }
        found = {
            "scale": by_scale,
            "datum": area,
            "offset": loss,
            **dict(zip(departures, others, strict=False)),
            "course_heights": self.volume.by_course_heights_m2(wet),
            "tilt": volume * self.tilt / (1 + self.tilt**2),
            **{name: of_corrections[name] for name in self.bearing},
        }
        found = {name: one for name, one in found.items() if name not in self.unused}
        for name, by_readings in zip(self.read_with, others[len(departures) :], strict=True):
            found[name] = found.get(name, 0.0) + by_readings
        return found

    def sources(self, levels_m):
        """What the survey itself leaves uncertain: the points, and the form between them."""
        if not self.factors:
            return ()
        wet = np.maximum(levels_m, 0.0)
        columns = self.volume.integrated(wet, np.hstack([one.columns for one in self.factors]))
        ends = np.cumsum([one.columns.shape[1] for one in self.factors])[:-1]
        parts = np.split(columns, ends, axis=1)
        return tuple(one.source(part) for one, part in zip(self.factors, parts, strict=True))


@dataclass(frozen=True)
class SolidPart(Part):
    """A tank of one solid (lying cylinder, sphere, mesh) at the table's temperature.

    Attributes
    ----------
    solid : Part
        A part whose lengths are at that temperature already.
    scale : float
        Of its lengths by temperature; expansion_per_k its coefficient; warmed whether a temperature
        was given.
    surveyed : tuple of str
        Names of the inputs of the solid that a survey of its wall gave; () without one.
    factors : tuple of Factor
        What that survey leaves uncertain about them, where no form says it of the volumes.
    form : SurveyedForm or None
        How that wall departs from the solid, with what the survey leaves uncertain of its volumes.
    unused : tuple of str
        Names of the solid's inputs that have no meaning in this job.
    read_with : dict
        {input: (f,) derivative by it of what the survey gave: the surveyed inputs, or the volumes
        at the form's nodes}, of inputs that the readings of the survey depend on: the temperature
        of a tape that has that of the shell.
    """

    solid: Part
    scale: float = 1.0
    expansion_per_k: float = 0.0
    warmed: bool = False
    surveyed: tuple[str, ...] = ()
    factors: tuple[Factor, ...] = ()
    form: SurveyedForm | None = None
    unused: tuple[str, ...] = ()
    read_with: dict = field(default_factory=dict)

    @property
    def top_m(self):
        """The highest dip."""
        return self.solid.top_m * self._stretch

    @property
    def capacity_m3(self):
        """Volume of the full tank."""
        full = self.solid.capacity_m3
        return full if self.form is None else full * (1 + self.form.share)

    def volume_m3(self, levels_m):
        """(rows,) volume below each level."""
        volume = self.solid.volume_m3(self._of_solid(levels_m))
        if self.form is None:
            return volume
        return volume * self.form.factor(self._shares(levels_m))

    def area_m2(self, levels_m):
        """(rows,) derivative of the volume by the level."""
        area = self.solid.area_m2(self._of_solid(levels_m))
        if self.form is None:
            return area
        volume = self.solid.volume_m3(self._of_solid(levels_m))
        return self._formed_area(levels_m, volume, area)

    def derivatives(self, levels_m):
        """{input: (rows,)} m3 per SI unit: those of the solid as measured, and its temperature."""
        found = self._formed(levels_m, self.solid.derivatives(self._of_solid(levels_m)))
        found |= {name: self.scale * found[name] for name in MEASURED if name in found}
        if self.warmed:
            by_length = found["scale"] / self.scale
            found["shell_temperature"] = -self.expansion_per_k * by_length
            found["expansion"] = (self.scale - 1) / self.expansion_per_k * by_length
        if "diameter" in self.surveyed:
            found["offset"] = 2 * found["diameter"]
        if self.read_with:
            by_survey = self._by_survey(levels_m, found)
            for name, column in self.read_with.items():
                found[name] = found.get(name, 0.0) + by_survey @ column
        without = {*self.unused, *self.surveyed}
        return {name: one for name, one in found.items() if name not in without}

    def sources(self, levels_m):
        """What the survey of the wall leaves uncertain, beside the solid's own sources."""
        own = tuple(self.solid.sources(self._of_solid(levels_m)))
        if not self.surveyed:
            return own
        of_solid = self.solid.derivatives(levels_m) if self.form is None else {}
        by_survey = self._by_survey(levels_m, of_solid)
        factors = self.factors if self.form is None else self.form.factors
        return (*(one.source(by_survey @ one.columns) for one in factors), *own)

    def _by_survey(self, levels_m, found):
        """(rows, f) derivatives by what the survey gave: the nodes of its form, or the surveyed of
        those by all inputs.
        """
        if self.form is not None:
            return self.form.at(self._shares(levels_m))
        return np.column_stack([found[name] for name in self.surveyed])

    @property
    def _stretch(self):
        return 1.0 if self.form is None else self.form.stretch

    def _of_solid(self, levels_m):
        return np.asarray(levels_m, dtype=float) / self._stretch

    def _shares(self, levels_m):
        share, _ = self.solid.height_share(self._of_solid(levels_m))
        return share

    def _formed_area(self, levels_m, volume, area):
        """Of the wall, from volume and area of the solid at its own levels."""
        shares, by_level = self.solid.height_share(self._of_solid(levels_m))
        slope = self.form.factor_slope(shares) * by_level / self._stretch
        return area * self.form.factor(shares) / self._stretch + volume * slope

    def _formed(self, levels_m, found):
        """Derivatives of the wall from those of the solid at its own levels.

        All lengths times t make the volume t^3 W(d / t): by the scale it is 3 W - d dW/dd.
        """
        if self.form is None:
            return found
        levels, factor = self._of_solid(levels_m), self.form.factor(self._shares(levels_m))
        volume = self.solid.volume_m3(levels)
        area = self._formed_area(levels_m, volume, found["datum"])
        formed = {name: factor * one for name, one in found.items()}
        by_scale = 3 * factor * volume - np.asarray(levels_m) * area
        return formed | {"datum": area, "scale": by_scale}


@dataclass(frozen=True)
class Body:
    """The parts of a tank together.

    lowest_m, highest_m levels between which there is a tank, in the frame of the parts

    Attributes
    ----------
    declared : tuple
        Inputs with name, u (SI), u_as_read, unit, type, distribution, dof, note, is_default.
    correlations : tuple
        (name, name, r) of declared inputs.
    estimates : dict
        {name of an input: its value, in the unit it is declared in}.
    shell : ShellPart or None
        The shell of courses that is among the parts; None for a tank without.
    """

    parts: tuple[Part, ...]
    declared: tuple
    lowest_m: float
    highest_m: float
    correlations: tuple = ()
    estimates: dict = field(default_factory=dict)
    shell: ShellPart | None = None

    is_bent = True  # whether second derivatives by the declared inputs are worth a simulation

    @property
    def breakpoints_m(self):
        """Levels at which the free surface jumps: joints, edges of what stands or floats inside."""
        every = {edge for part in self.parts for edge in part.breakpoints_m}
        return tuple(sorted(edge for edge in every if np.isfinite(edge)))

    def volume_m3(self, levels_m):
        """(rows,) volume below each level.

        Above its top, where the last whole millimetre of a dip may stand, the tank goes on as wide
        as it is there: a closed one not at all. Raises HeightError for levels farther off.
        """
        inside = self._inside(levels_m)
        volume = sum(part.volume_m3(inside) for part in self.parts)
        over = np.asarray(levels_m, dtype=float) - inside
        if not np.any(over):
            return volume
        top = np.array([self.highest_m])
        return volume + over * sum(part.area_m2(top) for part in self.parts)

    def area_m2(self, levels_m):
        """(rows,) derivative of the volume by the level: the free surface."""
        levels_m = self._inside(levels_m)
        return sum(part.area_m2(levels_m) for part in self.parts)

    def derivatives(self, levels_m):
        """{input: (rows,) or (rows, c)} of all parts together, m3 per SI unit."""
        levels_m = self._inside(levels_m)
        return sum_derivatives(part.derivatives(levels_m) for part in self.parts)

    def _inside(self, levels_m):
        """The levels; the top for those less than a millimetre above it."""
        levels = np.asarray(levels_m, dtype=float)
        over = (levels > self.highest_m) & (levels < self.highest_m + ROUNDED_M)
        return np.where(over, self.highest_m, levels)

    def moved_m3(self, levels_m, step_m):
        """(rows,) volumes when the table's zero stands step_m higher, a number or (rows,).

        What is declared by dips (deadwood, a roof, volumes measured by liquid) goes with the zero.
        Never below empty; above the top the tank goes on as wide as it is there.
        """
        levels = np.asarray(levels_m, dtype=float)
        ends = self.lowest_m, self.highest_m
        return sum(part.moved_m3(levels, step_m, *ends) for part in self.parts)

    def only_shell(self):
        """The body of the shell of courses alone."""
        return replace(self, parts=(self.shell,), highest_m=self.shell.volume.height_m)

    def undeclared(self):
        """Names of the inputs that move some volume of the tank and have no declared u.

        The scale of an instrument that was adjusted along stands for the scale of the survey, what
        the heights of a bottom share for its height.
        """
        levels = np.linspace(self.lowest_m, self.highest_m, LEVELS)
        moved = self.derivatives(levels)
        known = {one.name for one in self.declared}
        if self.shell is not None:
            known.update(self.shell.unused)
        if any(one.kind == OWN_SCALE for part in self.parts for one in part.sources(levels)):
            known.add("scale")
        if any(part.has_own_height for part in self.parts):
            known.add("bottom")
        return tuple(name for name, by in moved.items() if name not in known and _bears(by))

    def sources(self, levels_m):
        """One `Source` for each cause of uncertainty: the parts' own, then what was declared."""
        return self._sources(self._inside(levels_m), self.derivatives(levels_m))

    def sources_by(self, levels_m, inputs, without=()):
        """`sources` in which every declared input of `inputs` has its line, zeros where it does not
        move this body, or is one of `without`.

        Two bodies of one tank (loaded by two liquids) then give the same sources in the same order.
        """
        derivatives = self.derivatives(levels_m)
        for name in inputs:
            by = derivatives.get(name, np.zeros(len(levels_m)))
            derivatives[name] = np.zeros_like(by) if name in without else by
        return self._sources(self._inside(levels_m), derivatives)

    def rows(self, levels_m):
        """(volumes, areas, sources) of a table, each as its own method gives it, at one go.

        The derivative by "datum" is that by the level, so it serves as the area, too.
        """
        inside = self._inside(levels_m)
        derivatives = [part.derivatives(inside) for part in self.parts]
        area = sum(
            part.area_by(found, inside) for part, found in zip(self.parts, derivatives, strict=True)
        )
        return self.volume_m3(levels_m), area, self._sources(inside, sum_derivatives(derivatives))

    def _sources(self, levels_m, derivatives):
        own = join_shared([part.sources(levels_m) for part in self.parts])
        alone = {
            one.name: declared_source(one, derivatives[one.name], self.estimates.get(one.name))
            for one in self.declared
            if one.name in derivatives
        }
        return (*own, *group_correlated(alone, self.correlations))


def _bears(by):
    """Whether an input moves volumes, by its derivatives (rows,) or (rows, courses).

    The heights of several courses do, even where a nominal tank has equal ones: no real tank has.
    """
    return (by.ndim == 2 and by.shape[1] > 1) or bool(np.any(by != 0))
