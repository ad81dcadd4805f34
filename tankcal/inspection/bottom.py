"""Foot and bottom of a tank in an inspection: both tables read, computed, ready to be judged."""

from dataclasses import dataclass
from pathlib import Path

from tankcal.inspection.edges import assess_edges
from tankcal.inspection.levelling import read_edge_profiles, read_settlement
from tankcal.inspection.settlement import assess_settlement
from tankcal.inspection.settlement_limits import bulge_limits, edge_limits, settlement_limits
from tankcal.messages import message


@dataclass(frozen=True)
class Bottom:
    """What levellings say of a tank.

    Attributes
    ----------
    settlements : tuple of record.inspection.Settlement
        Each epoch, then differences.
    edges : tuple of record.inspection.EdgeProfile
    figures : tuple of figures.Figure
        In the order of the checks for each epoch; edge and bulge last.
    """

    settlements: tuple = ()
    edges: tuple = ()
    figures: tuple = ()

    @property
    def as_built(self):
        """Whether an earlier epoch takes out how the tank was built."""
        return any(one.since is not None for one in self.settlements)


def inspect_bottom(settlement, edges, strength, sections, log) -> Bottom:
    """Read settlement.csv and edge_profiles.csv, and compute what is judged of them.

    Parameters
    ----------
    settlement, edges : path or None
        The files; None: not levelled.
    strength : settlement_limits.Strength
        Diameter, height and steel of the tank; a diameter of None is told as a problem.
    sections : dict
        {section: {key: value}} of the rule; without "settlement", "edge" or "bulge" there are
        figures without limits.
    log : Log
        Takes every problem of both files, and the warnings.

    Examples
    --------
    >>> from tankcal.inspection.settlement_limits import Strength
    >>> from tankcal.job.tables import Log
    >>> tank = Strength(13.0, 9.5, yield_pa=250e6, e_pa=206e9)
    >>> found = inspect_bottom("examples/inspection/settlement.csv", None, tank, {}, Log())
    >>> [one.epoch for one in found.settlements], found.as_built
    (['2019-03-11', '2026-05-04', '2026-05-04'], True)
    """
    told = len(log.problems)
    levelling = None if settlement is None else read_settlement(settlement, log)
    lines = None if edges is None else read_edge_profiles(edges, log)
    is_levelled = not (settlement is None and edges is None)
    if is_levelled and strength.diameter_m is None:
        text = message("bottom_no_diameter", "missing; settlement and edges are held against the"
                       " size of the tank, expected its diameter")  # fmt: skip
        log.problem(Path(settlement or edges).name, text, None, "nominal_diameter_m")
    if len(log.problems) > told:
        return Bottom()
    saved, figures, profiles = [], [], []
    if levelling is not None:
        limits = settlement_limits(sections.get("settlement"))
        saved, figures = assess_settlement(levelling, strength, limits, log)
    if lines is not None:
        limits = edge_limits(sections.get("edge")), bulge_limits(sections.get("bulge"))
        profiles, more = assess_edges(
            lines, strength.diameter_m / 2, *limits, file=Path(edges).name, log=log
        )
        figures = [*figures, *more]
    return Bottom(tuple(saved), tuple(profiles), tuple(figures))
