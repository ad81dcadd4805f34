"""uncertainty.csv: each input once, in its own unit, of a credible size, and of use here."""

from tankcal.distributions import FAMILIES, expanded, within
from tankcal.job.checks.bearing import useless_inputs
from tankcal.job.checks.common import refuse_repeated
from tankcal.job.contract import INPUTS

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
            log.problem(inputs.file, f"found {name}; {useless[name]}", row, "input")
        if None in (name, unit):
            continue
        if unit != INPUTS[name].unit:
            expected = f"found {unit!r}; expected {INPUTS[name].unit!r} for {name}"
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
        found = f"found {spread[0]:g}, a standard uncertainty of" if u != spread[0] else "found"
        expected = f"{found} {u:g} {unit} for {name}; expected at most {known.largest:g} {unit}"
        log.problem(file, expected, row, "u")


def _contradictions(u_is, k, distribution, dof):
    """[(column, what is wrong)] of what u is, its coverage factor and its distribution."""
    name = distribution or NORMAL
    found = [*_of_t(u_is, dof)] if name == "t" else [*_of_others(u_is, name)]
    if u_is == "expanded" and k is None:
        found.append(("k", "blank; expected the coverage factor, beside u_is = expanded"))
    if u_is != "expanded" and k is not None:
        found.append(("k", f"found {k:g}; expected a blank, or u_is = expanded beside it"))
    return found


def _of_t(u_is, dof):
    if u_is not in OF_T:
        found = "blank" if u_is is None else f"found {u_is}"
        yield "u_is", f"{found}; expected scale or sd: of a t distribution u may be either"
    if dof is None:
        yield "dof", "blank; expected the degrees of freedom of the t distribution"
    elif u_is == "sd" and dof <= 2:
        yield "dof", f"found {dof:g}; expected above 2: with fewer a t distribution has no sd"


def _of_others(u_is, name):
    if u_is in OF_T:
        yield "u_is", f"found {u_is}; expected it only beside distribution = t, this one is {name}"
    if u_is == "half_width" and name not in FAMILIES:
        bounded = ", ".join(FAMILIES)
        yield "distribution", f"{name} has no half-width; expected {bounded} beside it"
    if u_is == "expanded" and name != NORMAL:
        yield "distribution", f"found {name}; expected {NORMAL} or a blank beside u_is = expanded"
