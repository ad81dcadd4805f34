"""Every value of every observation after the adjustment, by the names that the user gave."""

import numpy as np

from tankcal.camera.model import PARAMETERS, UNITS
from tankcal.survey.network.reactions import HELD
from tankcal.survey.network.reliability import UNCONTROLLED
from tankcal.survey.observations import NUISANCES
from tankcal.survey.results import GroupOfReadings, Reading, Readings


def readings_of(adjusted, held, held_trace):
    """Readings in the order of the tables, and a GroupOfReadings for each kind and name.

    adjusted    network.Adjusted
    held        network.Residuals of held coordinates: rows of no group, for they are not observed
    held_trace  their Trace
    """
    found, groups = [], {}
    for number, table in enumerate((*adjusted.residuals, held)):
        if table.source == "known beforehand":
            trace = _known_trace(adjusted, adjusted.problem.observations[number])
            value = adjusted.problem.observations[number].value
        else:
            trace, value = _observed(adjusted.survey, table, held_trace)
        if not len(table.rows):
            continue
        rows = table.rows.tolist()
        units = _units(table, trace)
        value = np.reshape(value, table.residual.shape)
        found.append(_rows(table, value, trace, units, adjusted.sigma0))
        if table.source == HELD:
            continue
        names, units = _objects(trace.group[i] for i in rows), _objects(units)
        for name, unit in dict.fromkeys(zip(names, units, strict=True)):
            mine = (names == name) & (units == unit)
            groups.setdefault((table.kind, name, unit), []).append((table, mine))
    return Readings.joined(found), tuple(
        _group(*key, parts, adjusted.survey) for key, parts in groups.items()
    )


def gone_with_their_points(adjusted, removed):
    """Reading rows of what was set aside, and whose points are no longer adjusted.

    removed  network.snooping.Removed
    """
    survey = adjusted.survey
    listed = {(table.source, row) for table in adjusted.residuals for row in table.rows.tolist()}
    nan, inf, found = float("nan"), float("inf"), []
    for one in removed:
        of = survey.table(one.source)
        if (one.source, one.row) in listed or of is None:
            continue
        trace = of.trace
        value, sd = np.atleast_1d(of.value[one.row]), np.atleast_1d(of.sd[one.row])
        for k, name in enumerate(trace.element[one.row]):
            found.append(
                Reading(
                    one.kind, trace.ids[one.row], name, trace.file, trace.rows[one.row],
                    int(trace.repeats[one.row]), of.unit, float(value[k]), nan, float(sd[k]), 0.0,
                    float(one.w), nan, inf, inf, True,
                )
            )  # fmt: skip
    return found


def _observed(survey, table, held_trace):
    """Trace and observed values of a table of residuals."""
    if table.source == HELD:
        return held_trace, survey.xyz_m.ravel()[table.rows]
    one = survey.table(table.source)
    return one.trace, one.value[table.rows]


def _rows(table, value, trace, units, sigma0):
    """Readings of a table of residuals, value by value."""
    rows, width = table.rows.tolist(), value.shape[1]
    tau = table.w / sigma0 if sigma0 > 0 else np.full_like(table.w, np.nan)
    numbers = {
        "value": value, "residual": table.residual, "sd": table.sd,
        "redundancy": table.redundancy, "w": table.w, "tau": tau, "mdb": table.mdb,
        "effect_m": table.effect_m,
    }  # fmt: skip

    def each(values):
        return np.repeat(_objects(values), width)

    return Readings(
        {
            "kind": each([table.kind] * len(rows)),
            "ids": each(trace.ids[i] for i in rows),
            "element": _objects(name for i in rows for name in trace.element[i]),
            "file": each([trace.file] * len(rows)),
            "row": each(trace.rows[i] for i in rows),
            "repeats": each(trace.repeats[i] for i in rows).astype(int),
            "unit": each(units),
            **{name: np.ravel(one).astype(float) for name, one in numbers.items()},
            "removed": np.repeat(~table.used, width),
            "check": np.zeros(width * len(rows), dtype=bool),
        }
    )


def _objects(values):
    """(n,) array of objects, tuples among them."""
    return np.fromiter(values, dtype=object)


def _units(table, trace):
    """[n] unit of each observation; elements of a photo and weighted unknowns differ in theirs."""
    if isinstance(trace, _KnownTrace):
        return trace.units
    if table.unit != "m or rad":
        return [table.unit] * len(table.rows)
    return ["m" if trace.element[i][0] in "xyz" else "rad" for i in table.rows.tolist()]


class _KnownTrace:
    """A Trace of weighted unknowns: they stand in no row, and each has its unit."""

    def __init__(self, file, ids, elements, units):
        self.file, self.ids, self.element = file, ids, [(element,) for element in elements]
        self.rows, self.repeats, self.units = [None] * len(ids), [1] * len(ids), units
        self.group = [one[0] for one in ids]


def _known_trace(adjusted, one):
    """The _KnownTrace of weighted unknowns."""
    names, elements, units, file = _known_names(adjusted, one)
    return _KnownTrace(file, names, elements, units)


def _known_names(adjusted, one):
    """Names, elements, units and file of weighted unknowns."""
    survey, index = adjusted.survey, np.asarray(one.index).tolist()
    if one.of in NUISANCES:
        of, owners = NUISANCES[one.of], survey.nuisances[one.of].owners
        names = [(owners[i],) for i in index]
        return names, [of.element] * len(index), [of.unit] * len(index), of.file
    table, names, elements, units = adjusted.problem.interior_of, [], [], []
    for place in index:
        photos, parameters = np.nonzero(table == place)
        camera = survey.cameras[survey.photos.camera[photos[0]]]
        of_photo = camera.scope[parameters[0]] == "photo"
        names.append((camera.name, survey.photos.names[photos[0]]) if of_photo else (camera.name,))
        elements.append(PARAMETERS[parameters[0]])
        units.append(UNITS[elements[-1]])
    return names, elements, units, "cameras.toml"


def _group(kind, name, unit, parts, survey):
    """The GroupOfReadings of parts (table, mask of its rows)."""
    used = [mine & table.used for table, mine in parts]
    scatter = np.zeros(2)
    for (table, _), mine in zip(parts, used, strict=True):
        one = survey.table(table.source)
        if one is not None:
            scatter += [part[table.rows[mine]].sum() for part in one.trace.repeated]
    residual, sd, share, parts_of_chi2 = (
        np.concatenate(
            [
                getattr(table, field)[mask].ravel()
                for (table, _), mask in zip(parts, used, strict=True)
            ]
        )
        for field in ("residual", "sd", "redundancy", "part_of_chi2")
    )
    count = sum(int(mine.sum()) * table.residual.shape[1] for table, mine in parts)
    redundancy = float(share.sum() + scatter[1])
    factor = factor_sd = np.nan
    weighs = sd > 0  # what holds exactly has neither residual nor redundancy
    if redundancy > UNCONTROLLED and weighs.any():
        square = np.sum(parts_of_chi2[weighs]) + scatter[0]
        factor = float(np.sqrt(max(square, 0.0) / redundancy))
        factor_sd = float(1.0 / np.sqrt(2.0 * redundancy))
    rms = float(np.sqrt(np.mean(residual**2))) if len(residual) else np.nan
    low, high = (float(sd.min()), float(sd.max())) if len(sd) else (None, None)
    return GroupOfReadings(
        kind, name, unit, len(residual), count - len(residual), redundancy, factor, factor_sd,
        rms, low, high,
    )  # fmt: skip
