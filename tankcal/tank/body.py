"""Tank as the sum of its parts: shell, head, bottom, deadwood, roof, or a single solid.

Each part has a volume, a free surface and derivatives below any level; the table is their sum. An
input shared by several parts (a scale, the zero of the table) changes all of them at once. It is a
single column of the factor of the covariance: the sum of the derivatives times the standard
uncertainty.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.tank.budgets import Factor, join_shared
from tankcal.tank.parts import Part, sum_derivatives
from tankcal.tank.solids import SurveyedForm
from tankcal.tank.volumes import ShellVolume
from tankcal.uncertainty import declared_source, group_correlated

OWN_SCALE = "instrument_scale"  # kind of a cause that replaces the input "scale"
MEASURED = (  # lengths at the temperature of the survey
    *("diameter", "length", "end_depth", "dish", "knuckle", "dip_position", "tube_offset"),
    *("plate_thickness", "paint", "ring_lengths", "ring_axes"),
)
ROUNDED_M = 0.001  # the last dip of a table, rounded to a millimetre, may exceed the top by this
LEVELS = 9  # levels from empty to full in the test whether an input changes the volume


@dataclass(frozen=True)
class ShellPart(Part):
    """Shell of courses as a part; it contains no volume below the bottom of its first course.

    Attributes
    ----------
    volume : ShellVolume
        Inside volume, at the temperature of the table.
    factors : tuple of Factor
        Uncertainty of the features of the shell after the survey: due to the points, to their
        common causes, and to the wall between them ("bulge", "ovality", "seams").
    scale : float
        Temperature factor on horizontal lengths.
    expansion_per_k : float
        Coefficient of linear expansion, 1/K.
    stretch : float
        Temperature factor on heights; 1 if heights are not corrected.
    bearing : tuple of str
        Inputs in use, of "plate_thickness", "paint", "shell_temperature" and "expansion".
    tilt : float
        Tilt of the axis, m/m.
    read_with : dict
        {input: (f,) derivative of the features of the shell}, for inputs that affect the readings
        of the survey, such as the temperature of a tape equal to that of the shell.
    unused : tuple of str
        Names of inputs that do not apply to the survey.
    subtracts : bool
        Whether plate and paint were subtracted from the surveyed radii.
    tilt_known : bool
        Whether the survey determines the tilt; otherwise `tilt` is 0.
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
    tilt_known: bool = True

    @property
    def breakpoints_m(self):
        """Levels of the bottoms of the courses."""
        return tuple(course.bottom_m for course in self.volume.courses)

    def volume_m3(self, levels_m):
        """Return the volume (rows,) of the shell below each level."""
        return self.volume.volume_m3(np.maximum(levels_m, 0.0))

    def area_m2(self, levels_m):
        """Return the inside area (rows,) at each level; 0 below the bottom."""
        return self.volume.area_m2(np.maximum(levels_m, 0.0)) * (np.asarray(levels_m) >= 0)

    def derivatives(self, levels_m):
        """Return {input: (rows,)}, m3 per SI unit; (rows, courses) for "course_heights".

        Declared "barrel" and "taper" are equal in all courses, since they had one sign in real
        tanks. "scale" multiplies the surveyed lengths perpendicular to the axis, "offset" is added
        to every surveyed radius, "datum" raises the zero of the table. "tilt" is the lean of the
        surveyed shell: the horizontal cut is sqrt(1 + m^2) times the perpendicular section.
        """
        wet = np.maximum(levels_m, 0.0)
        features = self.volume.features, self.volume.girth_features, self.volume.scale_features
        departures = {name: self.volume.missed_features(name) for name in self.volume.departures}
        columns = np.column_stack([*features, *departures.values(), *self.read_with.values()])
        # One integration for all feature columns: volume loss by thickness, scale, departures,
        # readings.
        volume, loss, by_scale, *others = self.volume.integrated(wet, columns).T
        area = self.area_m2(levels_m)
        by_length = 2 * volume / self.scale
        # Stretched heights: V(h) = s V0(h / s), so dV/ds = (V - A h) / s.
        if self.stretch != 1.0:
            by_length = by_length + (volume - area * wet) / self.stretch
        by_corrections = {
            "plate_thickness": -loss * self.subtracts,
            "paint": -loss * self.subtracts,
            "shell_temperature": -self.expansion_per_k * by_length,
            "expansion": (self.scale - 1) / self.expansion_per_k * by_length,
        }
        derivatives = {
            "scale": by_scale,
            "datum": area,
            "offset": loss,
            **dict(zip(departures, others, strict=False)),
            "course_heights": self.volume.by_course_heights_m2(wet),
            "tilt": volume * self.tilt / (1 + self.tilt**2),
            **{name: by_corrections[name] for name in self.bearing},
        }
        derivatives = {
            name: derivative for name, derivative in derivatives.items() if name not in self.unused
        }
        for name, by_readings in zip(self.read_with, others[len(departures) :], strict=True):
            derivatives[name] = derivatives.get(name, 0.0) + by_readings
        return derivatives

    def sources(self, levels_m):
        """Return the sources of the survey: the points, and the form between them."""
        if not self.factors:
            return ()
        wet = np.maximum(levels_m, 0.0)
        columns = self.volume.integrated(
            wet, np.hstack([factor.columns for factor in self.factors])
        )
        ends = np.cumsum([factor.columns.shape[1] for factor in self.factors])[:-1]
        parts = np.split(columns, ends, axis=1)
        return tuple(factor.source(part) for factor, part in zip(self.factors, parts, strict=True))


@dataclass(frozen=True)
class SolidPart(Part):
    """Tank that is a single solid (lying cylinder, sphere, mesh) at the temperature of the table.

    Attributes
    ----------
    solid : Part
        Solid whose lengths refer to that temperature.
    scale : float
        Temperature factor on lengths.
    expansion_per_k : float
        Coefficient of linear expansion, 1/K.
    warmed : bool
        Whether a temperature was given.
    surveyed : tuple of str
        Inputs of the solid determined by a survey of its wall; () without a survey.
    factors : tuple of Factor
        Uncertainty of these inputs after the survey, if no form contains the uncertainty of
        volumes.
    form : SurveyedForm or None
        Departure of the wall from the solid, with the uncertainty of its volumes.
    unused : tuple of str
        Inputs of the solid that do not apply to the job.
    read_with : dict
        {input: (f,) derivative of the surveyed inputs, or of the volumes at the nodes of the form},
        for inputs that affect the readings of the survey, such as the temperature of a tape equal
        to that of the shell.
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
        """Highest dip, m."""
        return self.solid.top_m * self._stretch

    @property
    def capacity_m3(self):
        """Volume of the full tank, m3."""
        full = self.solid.capacity_m3
        return full if self.form is None else full * (1 + self.form.share)

    def volume_m3(self, levels_m):
        """Return the volume (rows,) below each level."""
        volume = self.solid.volume_m3(self._solid_levels(levels_m))
        if self.form is None:
            return volume
        return volume * self.form.factor(self._shares(levels_m))

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of the volume by the level."""
        area = self.solid.area_m2(self._solid_levels(levels_m))
        if self.form is None:
            return area
        volume = self.solid.volume_m3(self._solid_levels(levels_m))
        return self._area_of_form(levels_m, volume, area)

    def derivatives(self, levels_m):
        """Return {input: (rows,)}, m3 per SI unit, by measured inputs and temperature."""
        of_solid = self.solid.derivatives(self._solid_levels(levels_m))
        derivatives = self._form_derivatives(levels_m, of_solid)
        # Measured lengths are multiplied by the temperature factor.
        derivatives |= {
            name: self.scale * derivatives[name] for name in MEASURED if name in derivatives
        }
        if self.warmed:
            by_length = derivatives["scale"] / self.scale
            derivatives["shell_temperature"] = -self.expansion_per_k * by_length
            derivatives["expansion"] = (self.scale - 1) / self.expansion_per_k * by_length
        if "diameter" in self.surveyed:
            derivatives["offset"] = 2 * derivatives["diameter"]
        if self.read_with:
            by_survey = self._survey_derivatives(levels_m, derivatives)
            for name, column in self.read_with.items():
                derivatives[name] = derivatives.get(name, 0.0) + by_survey @ column
        excluded = {*self.unused, *self.surveyed}
        return {
            name: derivative for name, derivative in derivatives.items() if name not in excluded
        }

    def sources(self, levels_m):
        """Return the sources of uncertainty of the survey of the wall, then those of the solid."""
        solid_sources = tuple(self.solid.sources(self._solid_levels(levels_m)))
        if not self.surveyed:
            return solid_sources
        by_solid = self.solid.derivatives(levels_m) if self.form is None else {}
        by_survey = self._survey_derivatives(levels_m, by_solid)
        factors = self.factors if self.form is None else self.form.factors
        return (*(factor.source(by_survey @ factor.columns) for factor in factors), *solid_sources)

    def _survey_derivatives(self, levels_m, derivatives):
        """Return derivatives (rows, f) by the results of the survey.

        The results are the volumes at the nodes of the form, or the surveyed inputs of the solid.
        """
        if self.form is not None:
            return self.form.at(self._shares(levels_m))
        return np.column_stack([derivatives[name] for name in self.surveyed])

    @property
    def _stretch(self):
        return 1.0 if self.form is None else self.form.stretch

    def _solid_levels(self, levels_m):
        return np.asarray(levels_m, dtype=float) / self._stretch

    def _shares(self, levels_m):
        share, _ = self.solid.height_share(self._solid_levels(levels_m))
        return share

    def _area_of_form(self, levels_m, volume, area):
        """Return the area of the wall, from volume and area of the solid."""
        shares, by_level = self.solid.height_share(self._solid_levels(levels_m))
        # Product rule: V = W(L / s) f(share), with s the stretch of the dips.
        slope = self.form.factor_slope(shares) * by_level / self._stretch
        return area * self.form.factor(shares) / self._stretch + volume * slope

    def _form_derivatives(self, levels_m, derivatives):
        """Return derivatives of the wall from those of the solid at the corresponding levels.

        All lengths times t give the volume t^3 W(d / t): its derivative by the scale is 3 W - d
        dW/dd.
        """
        if self.form is None:
            return derivatives
        levels, factor = self._solid_levels(levels_m), self.form.factor(self._shares(levels_m))
        volume = self.solid.volume_m3(levels)
        area = self._area_of_form(levels_m, volume, derivatives["datum"])
        formed = {name: factor * derivative for name, derivative in derivatives.items()}
        by_scale = 3 * factor * volume - np.asarray(levels_m) * area
        return formed | {"datum": area, "scale": by_scale}


@dataclass(frozen=True)
class Body:
    """Parts of a tank together.

    Attributes
    ----------
    parts : tuple of Part
    declared : tuple
        Inputs with name, u (SI), u_as_read, unit, type, distribution, dof, note, is_default.
    lowest_m, highest_m : float
        Levels of the empty and the full tank in the frame of the parts, m.
    correlations : tuple
        (name, name, r) of declared inputs.
    estimates : dict
        {name of an input: its value, in the declared unit}.
    shell : ShellPart or None
        Shell of courses among the parts; None for a tank without courses.
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
        """Levels at which the free surface jumps: joints, and limits of fittings or a roof."""
        edges = {edge for part in self.parts for edge in part.breakpoints_m}
        return tuple(sorted(edge for edge in edges if np.isfinite(edge)))

    def volume_m3(self, levels_m):
        """Return the volume (rows,) below each level.

        The last dip, a whole millimetre, may exceed the top. There the tank continues with the area
        at the top, which is zero for a closed tank. Raises HeightError for levels farther outside.
        """
        inside = self._inside(levels_m)
        volume = sum(part.volume_m3(inside) for part in self.parts)
        excess = np.asarray(levels_m, dtype=float) - inside
        if not np.any(excess):
            return volume
        top = np.array([self.highest_m])
        # Above the top: a prism over the area at the top.
        return volume + excess * sum(part.area_m2(top) for part in self.parts)

    def area_m2(self, levels_m):
        """Return the free surface (rows,), the derivative of the volume by the level."""
        levels_m = self._inside(levels_m)
        return sum(part.area_m2(levels_m) for part in self.parts)

    def derivatives(self, levels_m):
        """Return {input: (rows,) or (rows, c)} of all parts together, m3 per SI unit."""
        levels_m = self._inside(levels_m)
        return sum_derivatives(part.derivatives(levels_m) for part in self.parts)

    def _inside(self, levels_m):
        """Return the levels; levels less than a millimetre above the top become the top."""
        levels = np.asarray(levels_m, dtype=float)
        slightly_above = (levels > self.highest_m) & (levels < self.highest_m + ROUNDED_M)
        return np.where(slightly_above, self.highest_m, levels)

    def moved_m3(self, levels_m, step_m):
        """Return volumes (rows,) for a zero of the table raised by step_m, a number or (rows,).

        Parts declared by dips (deadwood, a roof, volumes measured with liquid) move with the zero.
        Volumes are never below empty; above the top, the tank continues with the area at the top.
        """
        levels = np.asarray(levels_m, dtype=float)
        ends = self.lowest_m, self.highest_m
        return sum(part.moved_m3(levels, step_m, *ends) for part in self.parts)

    def only_shell(self):
        """Return the body of the shell of courses alone."""
        return replace(self, parts=(self.shell,), highest_m=self.shell.volume.height_m)

    def undeclared(self):
        """Return the names of the inputs that change a volume but have no declared u.

        The estimated scale of an instrument replaces the scale of the survey. The common error of
        the heights of a bottom replaces its height. The declared dimensions of a solid without a
        survey replace the scale. An unknown tilt is named, although its derivative at 0 is 0.
        """
        levels = np.linspace(self.lowest_m, self.highest_m, LEVELS)
        derivatives = self.derivatives(levels)
        known_names = {item.name for item in self.declared}
        is_tilt_known = self.shell is None or self.shell.tilt_known
        if self.shell is not None:
            known_names.update(self.shell.unused)
        sources = [item for part in self.parts for item in part.sources(levels)]
        if any(item.kind == OWN_SCALE for item in sources):
            known_names.add("scale")
        if self.shell is None and "diameter" in derivatives and not sources:
            known_names.add("scale")
        if any(part.has_own_height for part in self.parts):
            known_names.add("bottom")
        return tuple(
            name
            for name, derivative in derivatives.items()
            if name not in known_names
            and (_changes_volume(derivative) or (name == "tilt" and not is_tilt_known))
        )

    def sources(self, levels_m):
        """Return one `Source` for each cause of uncertainty, of the parts and then declared."""
        return self._sources(self._inside(levels_m), self.derivatives(levels_m))

    def sources_by(self, levels_m, inputs, without=()):
        """Return `sources` with a line for each declared input of `inputs`.

        Two bodies of one tank (loaded by two liquids) then have equal sources in equal order.

        Parameters
        ----------
        levels_m : array_like, shape (rows,)
            Levels, m.
        inputs : iterable of str
            Names of inputs. The line of an input that does not affect the body is zero.
        without : sequence of str, optional
            Names of inputs whose line is zero in any case.

        Returns
        -------
        tuple of Source
        """
        derivatives = self.derivatives(levels_m)
        for name in inputs:
            derivative = derivatives.get(name, np.zeros(len(levels_m)))
            derivatives[name] = np.zeros_like(derivative) if name in without else derivative
        return self._sources(self._inside(levels_m), derivatives)

    def rows(self, levels_m):
        """Return (volumes, areas, sources) of a table in a single pass.

        The derivative by "datum" is the derivative by the level, so it also gives the area.
        """
        inside = self._inside(levels_m)
        derivatives = [part.derivatives(inside) for part in self.parts]
        area = sum(
            part.area_by(part_derivatives, inside)
            for part, part_derivatives in zip(self.parts, derivatives, strict=True)
        )
        return self.volume_m3(levels_m), area, self._sources(inside, sum_derivatives(derivatives))

    def _sources(self, levels_m, derivatives):
        part_sources = join_shared([part.sources(levels_m) for part in self.parts])
        declared_sources = {
            item.name: declared_source(item, derivatives[item.name], self.estimates.get(item.name))
            for item in self.declared
            if item.name in derivatives
        }
        return (*part_sources, *group_correlated(declared_sources, self.correlations))


def _changes_volume(derivatives):
    """Whether an input changes volumes, by its derivatives (rows,) or (rows, courses).

    Heights of several courses do, even if the derivatives vanish in a nominal tank of equal
    courses, since the courses of a real tank differ.
    """
    # Derivatives by several course heights may vanish for equal courses, see above.
    return (derivatives.ndim == 2 and derivatives.shape[1] > 1) or bool(np.any(derivatives != 0))
