"""From checked rows to what a job declares about uncertainty, and what is assumed beside it."""

import numpy as np

from tankcal.gum.distributions import within
from tankcal.job.checks import spreads, standard_u, useless_inputs
from tankcal.job.contract import INPUTS
from tankcal.job.model import DeclaredInput, StatedVolume


def inputs_of(values, tables):
    """`DeclaredInput`s: the rows of uncertainty.csv, then the defaults in the order of INPUTS."""
    declared = _declared(tables["uncertainty"])
    return (*declared, *_assumed(values, tables, {one.name for one in declared}))


def correlations_of(table):
    """(name, name, r) of the rows of correlations.csv."""
    if table is None:
        return ()
    return tuple(zip(*map(table.of, ("input", "with", "r")), strict=True))


def stated_of(table):
    """`StatedVolume`s of the rows of stated.csv."""
    if table is None:
        return ()
    columns = map(table.of, ("high_m", "low_m", "volume_m3", "note"))
    return tuple(
        StatedVolume(high, low, volume, note or "", row, table.file)
        for high, low, volume, note, row in zip(*columns, table.rows, strict=True)
    )


def _declared(table):
    if table is None:
        return ()
    columns = map(table.of, ("input", "unit", "type", "distribution", "dof", "note"))
    rows = zip(*columns, spreads(table), strict=True)
    return tuple(
        _input(
            name,
            standard_u(*spread),
            unit,
            type=type or "B",
            distribution=distribution or "normal",
            dof=np.inf if dof is None else dof,
            note=note or "",
            u_is="sd" if spread[1] == "sd" else "scale",
        )
        for name, unit, type, distribution, dof, note, spread in rows
    )


def _assumed(values, tables, declared):
    """What is assumed of the inputs that bear on the job and are not declared."""
    useless = useless_inputs(values, tables, values["tank"]["kind"])
    own_values = {"roof_mass": values["roof"]["mass_kg"]}
    for name, known in INPUTS.items():
        if known.assumption and name not in declared and name not in useless:
            assumed = within(known.assumed_half_width(own_values.get(name)))
            yield _input(name, assumed.u, known.unit, distribution=assumed.name, is_default=True)


def _input(name, u, unit, **more):
    return DeclaredInput(name, float(u / INPUTS[name].per_si), unit, float(u), **more)
