"""From the checked table of tangents to `Tangents`, in SI."""

import numpy as np

from tankcal.job.measuring import angle_in_rad, setups_of
from tankcal.survey.tangents import Tangents
from tankcal.units import ARCSEC


def make_tangents(tables, registers):
    """Build `Tangents` from tables and registers without problems."""
    table = tables["tangents"]
    return Tangents(
        setup=tuple(table.of("setup")),
        set=tuple(table.of("set")),
        course=tuple(table.of("course")),
        level_m=table.numbers("level_m"),
        is_right=np.array([side == "right" for side in table.of("side")], dtype=bool),
        direction_rad=angle_in_rad(table, "direction"),
        zenith_rad=angle_in_rad(table, "zenith"),
        sd_rad=table.numbers("s_arcsec") * ARCSEC,
        check=np.array([use == "check" for use in table.of("use")], dtype=bool),
        setups={setup.name: setup for setup in setups_of(tables["setups"])},
        certificates={
            name: given["certificate"] or "" for name, given in registers["instruments"].items()
        },
        rows=table.rows,
        file=table.file,
    )
