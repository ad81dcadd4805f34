"""The shell of a tank that liquid measured, without its bottom and what stands inside."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.pipeline.liquid_body import JointBody
from tankcal.tank.body import Body


@dataclass(frozen=True)
class JointShell:
    """A `JointBody` without bottom, deadwood and roof, where differences of levels are asked.

    What liquid found below its first dip and of the bottom's flexing is not of the shell either.
    """

    whole: JointBody
    of_shell: Body
    shift_m: float

    def volume_m3(self, levels_m):
        """(rows,) volume of the shell below each level."""
        levels = np.asarray(levels_m, dtype=float)
        rest = self.whole.plain.moved_m3(levels, self.shift_m)
        rest = rest - self.of_shell.moved_m3(levels, self.shift_m)
        return self.whole.volume_m3(levels) - rest

    def sources(self, levels_m):
        """One `Source` for each cause that the shell has, as geometry and liquid know it."""
        return self.whole.sources(levels_m)


def joint_shell(body):
    """What differences of the levels of a shell are taken of: `volume_m3` and `sources`.

    Parameters
    ----------
    body : Body
        Of an upright tank, by geometry, liquid or both.
    """
    if not isinstance(body, JointBody):
        return replace(body, parts=(body.shell,))
    known = replace(
        body.known, first_m=None, bottom_m3=0.0, bottom_gain=None, flex=0.0, flex_sd=0.0,
        flex_gain=None, flex_column=None,
    )  # fmt: skip
    of_shell = replace(body.plain, parts=(body.plain.shell,))
    return JointShell(replace(body, known=known), of_shell, known.geometry.shift_m)
