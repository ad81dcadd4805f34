"""Readings of all observations after the adjustment, by the user's names."""

import numpy as np

from tankcal.camera.model import PARAMETERS, UNITS
from tankcal.survey.network.reliability import HELD, UNCONTROLLED
from tankcal.survey.observations import NUISANCES
from tankcal.survey.results import GroupOfReadings, Reading, Readings


def readings_of(adjusted, held, held_trace):
    """Return the readings in the order of the tables, and a GroupOfReadings for each kind and name.

    Parameters
    ----------
    adjusted : network.Adjusted
    held : network.Residuals
        Residuals of held coordinates; they are not observed, so they belong to no group.
    held_trace : Trace

    Returns
    -------
    readings : Readings
    groups : tuple of GroupOfReadings
    """
    parts_of_readings, groups = [], {}
    for number, table in enumerate((*adjusted.residuals, held)):
        if table.source == "known beforehand":
            known_unknowns = adjusted.problem.observations[number]
            trace = _KnownTrace(*_known_names(adjusted, known_unknowns))
            value = known_unknowns.value
        else:
            trace, value = _trace_and_values(adjusted.survey, table, held_trace)
        if not len(table.rows):
            continue
        rows = table.rows.tolist()
        units = _units(table, trace)
        value = np.reshape(value, table.residual.shape)
        parts_of_readings.append(_rows(table, value, trace, units, adjusted.sigma0))
        if table.source == HELD:
            continue
        # Images and control are grouped by name and unit, as a camera mixes mm and rad.
        names, units = _objects(trace.group[i] for i in rows), _objects(units)
        for name, unit in dict.fromkeys(zip(names, units, strict=True)):
            is_in_group = (names == name) & (units == unit)
            groups.setdefault((table.kind, name, unit), []).append((table, is_in_group))
    return Readings.joined(parts_of_readings), tuple(
        _group(*key, parts, adjusted.survey) for key, parts in groups.items()
    )


def gone_with_their_points(adjusted, removed):
    """Reading rows of rejected observations whose points are no longer adjusted.

    Parameters
    ----------
    adjusted : network.Adjusted
    removed : sequence of network.snooping.Removed

    Returns
    -------
    list of Reading
        Residuals are nan and mdb is infinite: without the point they are undefined.
    """
    survey = adjusted.survey
    listed = {(table.source, row) for table in adjusted.residuals for row in table.rows.tolist()}
    nan, inf, rejected = float("nan"), float("inf"), []
    for item in removed:
        observed = survey.table(item.source)
        if (item.source, item.row) in listed or observed is None:
            continue
        trace = observed.trace
        value, sd = (
            np.atleast_1d(observed.value[item.row]),
            np.atleast_1d(observed.sd[item.row]),
        )
        for k, name in enumerate(trace.element[item.row]):
            rejected.append(
                Reading(
                    item.kind, trace.ids[item.row], name, trace.file, trace.rows[item.row],
                    int(trace.repeats[item.row]), observed.unit, float(value[k]), nan, float(sd[k]),
                    0.0, float(item.w), nan, inf, inf, True,
                )
            )  # fmt: skip
    return rejected


def _trace_and_values(survey, table, held_trace):
    """Trace and observed values of a table of residuals."""
    if table.source == HELD:
        return held_trace, survey.xyz_m.ravel()[table.rows]
    observations = survey.table(table.source)
    return observations.trace, observations.value[table.rows]


def _rows(table, value, trace, units, sigma0):
    """Readings of a table of residuals, one for each value."""
    rows, width = table.rows.tolist(), value.shape[1]
    tau = table.w / sigma0 if sigma0 > 0 else np.full_like(table.w, np.nan)
    numbers = {
        "value": value, "residual": table.residual, "sd": table.sd,
        "redundancy": table.redundancy, "w": table.w, "tau": tau, "mdb": table.mdb,
        "effect_m": table.effect_m,
    }  # fmt: skip

    def repeated(values):
        return np.repeat(_objects(values), width)

    return Readings(
        {
            "kind": repeated([table.kind] * len(rows)),
            "ids": repeated(trace.ids[i] for i in rows),
            "element": _objects(name for i in rows for name in trace.element[i]),
            "file": repeated([trace.file] * len(rows)),
            "row": repeated(trace.rows[i] for i in rows),
            "repeats": repeated(trace.repeats[i] for i in rows).astype(int),
            "unit": repeated(units),
            **{name: np.ravel(column).astype(float) for name, column in numbers.items()},
            "removed": np.repeat(~table.used, width),
            "check": np.zeros(width * len(rows), dtype=bool),
        }
    )


def _objects(values):
    """Array (n,) of objects, including tuples."""
    return np.fromiter(values, dtype=object)


def _units(table, trace):
    """Unit of each observation, length n; elements of a photo and weighted unknowns have mixed
    units."""
    if isinstance(trace, _KnownTrace):
        return trace.units
    if table.unit != "m or rad":
        return [table.unit] * len(table.rows)
    return ["m" if trace.element[i][0] in "xyz" else "rad" for i in table.rows.tolist()]


class _KnownTrace:
    """A Trace of weighted unknowns, which have no row in a file and a unit each."""

    def __init__(self, ids, elements, units, file):
        self.file, self.ids, self.element = file, ids, [(element,) for element in elements]
        self.rows, self.repeats, self.units = [None] * len(ids), [1] * len(ids), units
        self.group = [names[0] for names in ids]


def _known_names(adjusted, known_unknowns):
    """Names, elements, units and file of weighted unknowns."""
    survey, index = adjusted.survey, np.asarray(known_unknowns.index).tolist()
    if known_unknowns.of in NUISANCES:
        of, owners = NUISANCES[known_unknowns.of], survey.nuisances[known_unknowns.of].owners
        names = [(owners[i],) for i in index]
        return names, [of.element] * len(index), [of.unit] * len(index), of.file
    table, names, elements, units = adjusted.problem.interior_of, [], [], []
    for place in index:
        # Several photos may share a parameter; the first one identifies its camera.
        photos, parameters = np.nonzero(table == place)
        camera = survey.cameras[survey.photos.camera[photos[0]]]
        of_photo = camera.scope[parameters[0]] == "photo"
        names.append((camera.name, survey.photos.names[photos[0]]) if of_photo else (camera.name,))
        elements.append(PARAMETERS[parameters[0]])
        units.append(UNITS[elements[-1]])
    return names, elements, units, "cameras.toml"


def _group(kind, name, unit, parts, survey):
    """The GroupOfReadings of parts (table, mask of its rows)."""
    used = [mask_of_part & table.used for table, mask_of_part in parts]
    scatter = np.zeros(2)
    for (table, _), mask_of_part in zip(parts, used, strict=True):
        observations = survey.table(table.source)
        if observations is not None:
            # The scatter of averaged readings adds their chi-square and their degrees of freedom.
            scatter += [
                part[table.rows[mask_of_part]].sum() for part in observations.trace.repeated
            ]
    residual, sd, share, parts_of_chi2 = (
        np.concatenate(
            [
                getattr(table, field)[mask].ravel()
                for (table, _), mask in zip(parts, used, strict=True)
            ]
        )
        for field in ("residual", "sd", "redundancy", "part_of_chi2")
    )
    count = sum(int(mask_of_part.sum()) * table.residual.shape[1] for table, mask_of_part in parts)
    redundancy = float(share.sum() + scatter[1])
    factor = factor_sd = np.nan
    weighs = sd > 0  # exactly held values have neither residual nor redundancy
    if redundancy > UNCONTROLLED and weighs.any():
        # Variance component: v'Pv of the group over its redundancy (Foerstner's estimate).
        square = np.sum(parts_of_chi2[weighs]) + scatter[0]
        factor = float(np.sqrt(max(square, 0.0) / redundancy))
        factor_sd = float(1.0 / np.sqrt(2.0 * redundancy))
    rms = float(np.sqrt(np.mean(residual**2))) if len(residual) else np.nan
    low, high = (float(sd.min()), float(sd.max())) if len(sd) else (None, None)
    return GroupOfReadings(
        kind, name, unit, len(residual), count - len(residual), redundancy, factor, factor_sd,
        rms, low, high,
    )  # fmt: skip
