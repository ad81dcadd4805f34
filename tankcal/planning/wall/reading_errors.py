"""Simulated errors.

Independent errors of readings, and common errors of readings with one cause.
"""

from dataclasses import replace

import numpy as np

from tankcal.planning.measurements import draw_blunders
from tankcal.survey.observations import KINDS

UNKNOWN_OFFSET_M = 2e-3  # sd of the offset of an instrument without a prior
UNKNOWN_COLLIMATION_RAD = np.radians(10 / 3600)  # sd for a plummet read in both faces


class Errors:
    """Errors of one simulated survey.

    rng is a numpy generator; blunders is the share of readings with an error of
    `measurements.BLUNDER_SDS` standard deviations.
    """

    def __init__(self, rng, blunders=0.0):
        self._rng, self._blunders, self._causes = rng, blunders, {}

    def draw(self, sd):
        """Independent errors (n,) of readings with standard deviations (n,)."""
        sd = np.asarray(sd, dtype=float)
        errors = self._rng.standard_normal(sd.shape)
        if self._blunders:
            errors += draw_blunders(self._rng, self._blunders, len(sd))
        return errors * sd

    def draw_cause(self, kind, name):
        """Error of a cause in this survey, in its standard uncertainties."""
        if (kind, name) not in self._causes:
            self._causes[kind, name] = float(self._rng.standard_normal())
        return self._causes[kind, name]

    def scale(self, tool):
        """Relative error of the scale of an instrument."""
        return self.draw_cause("instrument_scale", tool.name) * _known(tool.u_scale, 0.0)

    def offset_m(self, tool):
        """Error of the offset of an instrument, m."""
        u = _known(tool.u_offset_m, UNKNOWN_OFFSET_M)
        return self.draw_cause("instrument_offset", tool.name) * u

    def collimation_rad(self, plummet):
        """Collimation error of a plummet, rad."""
        u = _known(plummet.u_collimation_rad, UNKNOWN_COLLIMATION_RAD)
        return self.draw_cause("collimation", plummet.name) * u


class _Exact(Errors):
    """Errors that are all zero."""

    def __init__(self):
        super().__init__(None)

    def draw(self, sd):
        return np.zeros(np.shape(sd))

    def draw_cause(self, kind, name):
        return 0.0


EXACT = _Exact()


def add_network_errors(measurements, errors):
    """Return Measurements with errors of the readings and of the distance instruments."""
    tools = {tool.name: tool for tool in measurements.instruments}
    used = {setup.name: setup.instrument for setup in measurements.setups}

    def read(readings):
        value = readings.value
        if KINDS[readings.table].has("instrument"):
            names = [used[name] for name in readings.setup] or readings.instrument
            known = [tools.get(name) for name in names]
            value = value * [1.0 if tool is None else 1 + errors.scale(tool) for tool in known]
            value = value + [0.0 if tool is None else errors.offset_m(tool) for tool in known]
        return replace(readings, value=value + errors.draw(readings.sd))

    return replace(measurements, readings=tuple(map(read, measurements.readings)))


def _known(u, otherwise):
    return otherwise if u is None or np.isnan(u) else u
