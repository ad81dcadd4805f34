"""uncertainty.csv: each input once, in its own unit, of a credible size, and of use here."""

from tankcal.gum.distributions import FAMILIES, Normal, expanded, within
from tankcal.job.checks.bearing import useless_inputs
from tankcal.job.checks.common import refuse_repeated
from tankcal.job.checks.geometry import UNIT_FACTOR
from tankcal.job.contract import INPUTS
from tankcal.messages import message
from tankcal.uncertainty import Input, Inputs

# stated.csv: dips within the tank, the upper one first, and volumes that it can hold.

_ROUNDING_M = 1e-9


def check_stated(table, extent, log):
    """Dips within the tank, high above low, each pair once; volumes in cubic metres."""
    first_row = {}
    columns = (table.of(name) for name in ("high_m", "low_m", "volume_m3"))
    for row, high, low, volume in zip(table.rows, *columns, strict=True):
        _check_within(table, row, high, low, extent, log)
        if high is None:
            continue
        if low is not None and low >= high:
            expected = message(
                "stated_upside_down",
                "found {low:g}; expected a dip below high_m = {high:g}",
                low=low,
                high=high,
            )
            log.problem(table.file, expected, row, "low_m")
        elif (high, low) in first_row:
            expected = message(
                "stated_twice",
                "this dip is there already, in row {first_row}; expected once",
                first_row=first_row[high, low],
            )
            log.problem(table.file, expected, row, "high_m")
        elif volume is not None:
            _check_volume(table, row, high, low, volume, extent, log)
        first_row.setdefault((high, low), row)


def _check_within(table, row, high, low, extent, log):
    top = extent.height_m if extent.top_m is None else extent.top_m
    for column, dip in (("high_m", high), ("low_m", low)):
        if None not in (dip, top) and dip > top + _ROUNDING_M:
            expected = message(
                "stated_above_top",
                "found {dip:g}; expected at most {top:.5g}, the top of the tank, in metres",
                dip=dip,
                top=top,
            )
            log.problem(table.file, expected, row, column)


def _check_volume(table, row, high, low, volume, extent, log):
    """Far more than the whole tank holds, or the slice of a delivery, is another unit."""
    height = extent.height_m if low is None else high - low
    if None in (height, extent.area_m2):
        return
    full = extent.area_m2 * height
    if volume > UNIT_FACTOR * full:
        expected = message(
            "stated_too_much",
            "found {volume:g}; the whole tank holds about {full:.4g} m3, expected m3: in litres?",
            volume=volume,
            full=full,
        )
        if low is not None:
            expected = message(
                "delivered_too_much",
                "found {volume:g}; the tank between low_m and high_m holds about {full:.4g} m3, "
                "expected m3: in litres?",
                volume=volume,
                full=full,
            )
        log.problem(table.file, expected, row, "volume_m3")


# correlations.csv: pairs of declared inputs, each once, and all of them possible together.


def check_correlations(table, inputs, raw, log):
    """Pairs of inputs of uncertainty.csv, each once, whose coefficients can hold together.

    inputs  uncertainty.csv, or None: not there or unreadable
    """
    before = len(log.problems)
    known = _declared(inputs, raw)
    pairs, first_row = {}, {}
    for row, one, other, r in zip(table.rows, *map(table.of, ("input", "with", "r")), strict=True):
        for column, name in (("input", one), ("with", other)):
            if None not in (known, name) and name not in known:
                expected = message(
                    "correlation_unknown",
                    "found {name}; expected an input of {of}",
                    name=name,
                    of=raw.file_of("uncertainty"),
                )
                log.problem(table.file, expected, row, column)
        if one is not None and one == other:
            expected = message(
                "correlation_with_itself", "found {one} again; expected another input", one=one
            )
            log.problem(table.file, expected, row, "with")
        pair = frozenset((one, other))
        if None not in pair and pair in first_row:
            expected = message(
                "correlation_twice",
                "{one} and {other} are there already, in row {first_row}; expected once",
                one=one,
                other=other,
                first_row=first_row[pair],
            )
            log.problem(table.file, expected, row, "with")
        first_row.setdefault(pair, row)
        pairs[one, other] = r
    if len(log.problems) == before and not (table.skipped or None in _flat(pairs)):
        _check_together(table, pairs, log)


def _declared(inputs, raw):
    """Names of the declared inputs; None where some of them could not be read."""
    if inputs is None:
        is_there = "uncertainty" in raw.tables
        return None if is_there else ()
    names = inputs.of("input")
    return None if inputs.skipped or None in names else names


def _flat(pairs):
    return [*(name for pair in pairs for name in pair), *pairs.values()]


def _check_together(table, pairs, log):
    """Is the matrix of all coefficients positive semidefinite?"""
    names = dict.fromkeys(name for pair in pairs for name in pair)
    try:
        Inputs([Input(name, Normal(1.0)) for name in names], pairs)
    except ValueError as error:
        expected = message(
            "correlations_impossible",
            "{error}; expected coefficients that can hold together",
            error=str(error),
        )
        log.problem(table.file, expected, None, "r")


OF_T = ("scale", "sd")
NORMAL = "normal"
SPREAD_COLUMNS = ("u", "u_is", "k", "distribution", "dof")


def check_inputs(inputs, values, tables, kind, log):
    """Each input once, in its own unit, of a credible size, and of use for this job."""
    told = {problem.row for problem in log.problems if problem.file == inputs.file}
    refuse_repeated(inputs, "input", log)
    useless = {} if values is None or kind is None else useless_inputs(values, tables, kind)
    units = inputs.of("unit")
    rows = zip(inputs.rows, inputs.of("input"), units, spreads(inputs), strict=True)
    for row, name, unit, spread in rows:
        if name in useless:
            why = useless[name]
            expected = message("useless_input", "found {name}; {why}", name=name, why=why)
            log.problem(inputs.file, expected, row, "input")
        if None in (name, unit):
            continue
        if unit != INPUTS[name].unit:
            expected = message(
                "other_unit",
                "found {unit!r}; expected {unit_of_input!r} for {name}",
                unit=unit,
                unit_of_input=INPUTS[name].unit,
                name=name,
            )
            log.problem(inputs.file, expected, row, "unit")
        if row not in told and spread[0] is not None:
            _check_spread(inputs.file, row, name, unit, spread, log)


def spreads(inputs):
    """(u, u_is, k, distribution, dof) of each row of uncertainty.csv, None where blank."""
    return [*zip(*(inputs.of(column) for column in SPREAD_COLUMNS), strict=True)]


def standard_u(u, u_is, k, distribution, dof):
    """Standard uncertainty of a sound row, in its unit; of a t distribution what u_is says."""
    if u_is == "half_width":
        return within(u, distribution).u
    if u_is == "expanded":
        return expanded(u, k=k).u
    return u


def _check_spread(file, row, name, unit, spread, log):
    """Cells of a row without other problems: do they agree, and is u of a credible size?"""
    contradictions = _contradictions(*spread[1:])
    for column, expected in contradictions:
        log.problem(file, expected, row, column)
    known = INPUTS[name]
    if contradictions or unit != known.unit:
        return
    u = standard_u(*spread)
    if u > known.largest:
        expected = message(
            "input_too_large",
            "found {u:g} {unit} for {name}; expected at most {largest:g} {unit}",
            u=u,
            unit=unit,
            name=name,
            largest=known.largest,
        )
        if u != spread[0]:
            expected = message(
                "spread_too_large",
                "found {spread:g}, a standard uncertainty of {u:g} {unit} for {name}; expected "
                "at most {largest:g} {unit}",
                spread=spread[0],
                u=u,
                unit=unit,
                name=name,
                largest=known.largest,
            )
        log.problem(file, expected, row, "u")


def _contradictions(u_is, k, distribution, dof):
    """[(column, what is wrong)] of what u is, its coverage factor and its distribution."""
    name = distribution or NORMAL
    found = [*_of_t(u_is, dof)] if name == "t" else [*_of_others(u_is, name)]
    if u_is == "expanded" and k is None:
        found.append(
            (
                "k",
                message(
                    "coverage_factor_missing",
                    "blank; expected the coverage factor, beside u_is = expanded",
                ),
            )
        )
    if u_is != "expanded" and k is not None:
        found.append(
            (
                "k",
                message(
                    "coverage_factor_unused",
                    "found {k:g}; expected a blank, or u_is = expanded beside it",
                    k=k,
                ),
            )
        )
    return found


def _of_t(u_is, dof):
    if u_is not in OF_T:
        if u_is is None:
            yield (
                "u_is",
                message(
                    "t_blank", "blank; expected scale or sd: of a t distribution u may be either"
                ),
            )
        else:
            yield (
                "u_is",
                message(
                    "t_other",
                    "found {u_is}; expected scale or sd: of a t distribution u may be either",
                    u_is=u_is,
                ),
            )
    if dof is None:
        yield (
            "dof",
            message("dof_missing", "blank; expected the degrees of freedom of the t distribution"),
        )
    elif u_is == "sd" and dof <= 2:
        yield (
            "dof",
            message(
                "dof_too_few",
                "found {dof:g}; expected above 2: with fewer a t distribution has no sd",
                dof=dof,
            ),
        )


def _of_others(u_is, name):
    if u_is in OF_T:
        yield (
            "u_is",
            message(
                "only_beside_t",
                "found {u_is}; expected it only beside distribution = t, this one is {name}",
                u_is=u_is,
                name=name,
            ),
        )
    if u_is == "half_width" and name not in FAMILIES:
        bounded = ", ".join(FAMILIES)
        yield (
            "distribution",
            message(
                "no_half_width",
                "{name} has no half-width; expected {bounded} beside it",
                name=name,
                bounded=bounded,
            ),
        )
    if u_is == "expanded" and name != NORMAL:
        yield (
            "distribution",
            message(
                "not_normal",
                "found {name}; expected {normal} or a blank beside u_is = expanded",
                name=name,
                normal=NORMAL,
            ),
        )
