"""uncertainty.csv: each input once, in its own unit, of a credible size, and of use here."""

from tankcal.gum.distributions import FAMILIES, expanded, within
from tankcal.job.checks.bearing import useless_inputs
from tankcal.job.checks.common import refuse_repeated
from tankcal.job.contract import INPUTS
from tankcal.messages import message

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
