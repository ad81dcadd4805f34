"""By how much readings are off: each for itself, and all that share a cause by the same."""

from dataclasses import replace

import numpy as np

from tankcal.planning.simulations import blunders_in_sds
from tankcal.survey.observations import KINDS

UNKNOWN_OFFSET_M = 2e-3  # of an instrument of whose offset nothing is known beforehand
UNKNOWN_COLLIMATION_RAD = np.radians(10 / 3600)  # of a plummet that both faces tell


class Errors:
    """Errors of one survey.

    rng       of numpy
    blunders  share of the readings that are off by `simulations.BLUNDER_SDS`
    """

    def __init__(self, rng, blunders=0.0):
        self._rng, self._blunders, self._causes = rng, blunders, {}

    def own(self, sd):
        """(n,) errors of readings whose standard deviations are (n,)."""
        sd = np.asarray(sd, dtype=float)
        found = self._rng.standard_normal(sd.shape)
        if self._blunders:
            found += blunders_in_sds(self._rng, self._blunders, len(sd))
        return found * sd

    def of_cause(self, kind, name):
        """By how many of its standard uncertainties a cause is off in this survey."""
        if (kind, name) not in self._causes:
            self._causes[kind, name] = float(self._rng.standard_normal())
        return self._causes[kind, name]

    def scale(self, tool):
        """By how much an instrument's scale is off, relative."""
        return self.of_cause("instrument_scale", tool.name) * _known(tool.u_scale, 0.0)

    def offset_m(self, tool):
        """By how much its offset is."""
        u = _known(tool.u_offset_m, UNKNOWN_OFFSET_M)
        return self.of_cause("instrument_offset", tool.name) * u

    def collimation_rad(self, plummet):
        """By how much a plummet leans."""
        u = _known(plummet.u_collimation_rad, UNKNOWN_COLLIMATION_RAD)
        return self.of_cause("collimation", plummet.name) * u


class _Exact(Errors):
    """No errors."""

    def __init__(self):
        super().__init__(None)

    def own(self, sd):
        return np.zeros(np.shape(sd))

    def of_cause(self, kind, name):
        return 0.0


EXACT = _Exact()


def with_network_errors(measurements, errors):
    """The Measurements with errors of their readings, and of the instruments of distances."""
    tools = {one.name: one for one in measurements.instruments}
    used = {one.name: one.instrument for one in measurements.setups}

    def read(given):
        value = given.value
        if KINDS[given.table].has("instrument"):
            names = [used[name] for name in given.setup] or given.instrument
            known = [tools.get(name) for name in names]
            value = value * [1.0 if one is None else 1 + errors.scale(one) for one in known]
            value = value + [0.0 if one is None else errors.offset_m(one) for one in known]
        return replace(given, value=value + errors.own(given.sd))

    return replace(measurements, readings=tuple(map(read, measurements.readings)))


def _known(u, otherwise):
    return otherwise if u is None or np.isnan(u) else u
