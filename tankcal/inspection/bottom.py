"""Settlement of the foot and of the bottom: read both tables and compute the figures."""

from dataclasses import dataclass
from pathlib import Path

from tankcal.inspection.edges import assess_edges
from tankcal.inspection.levelling import read_edge_profiles, read_settlement
from tankcal.inspection.settlement import assess_settlement
from tankcal.inspection.settlement_limits import bulge_limits, edge_limits, settlement_limits
from tankcal.messages import message


@dataclass(frozen=True)
class Bottom:
    """Results of the levellings of a tank.

    Attributes
    ----------
    settlements : tuple of record.inspection.Settlement
        Each epoch, then the differences between epochs.
    edges : tuple of record.inspection.EdgeProfile
    figures : tuple of figures.Figure
        Figures of each epoch in the order of the checks; edge and bulge last.
    """

    settlements: tuple = ()
    edges: tuple = ()
    figures: tuple = ()

    @property
    def as_built(self):
        """Whether differences to an earlier epoch remove the form of the tank as built."""
        return any(settlement.since is not None for settlement in self.settlements)


def inspect_bottom(settlement, edges, strength, sections, log) -> Bottom:
    """Read settlement.csv and edge_profiles.csv, and compute their figures.

    Parameters
    ----------
    settlement, edges : path or None
        The files; None if not levelled.
    strength : settlement_limits.Strength
        Diameter, height and steel of the tank. A levelled tank without a diameter is a problem.
    sections : dict
        {section: {key: value}} of the rule. Without the section "settlement", "edge" or "bulge",
        its figures have no limits.
    log : Log
        Receives the problems and warnings of both files.

    Returns
    -------
    Bottom
        Empty if the files have problems.

    Examples
    --------
    >>> from tankcal.inspection.settlement_limits import Strength
    >>> from tankcal.job.tables import Log
    >>> tank = Strength(13.0, 9.5, yield_pa=250e6, e_pa=206e9)
    >>> bottom = inspect_bottom("examples/inspection/settlement.csv", None, tank, {}, Log())
    >>> [settlement.epoch for settlement in bottom.settlements], bottom.as_built
    (['2019-03-11', '2026-05-04', '2026-05-04'], True)
    """
    problem_count = len(log.problems)
    levelling = None if settlement is None else read_settlement(settlement, log)
    lines = None if edges is None else read_edge_profiles(edges, log)
    is_levelled = not (settlement is None and edges is None)
    if is_levelled and strength.diameter_m is None:
        text = message("bottom_no_diameter", "missing; settlement and edges are held against the"
                       " size of the tank, expected its diameter")  # fmt: skip
        log.problem(Path(settlement or edges).name, text, None, "nominal_diameter_m")
    if len(log.problems) > problem_count:
        return Bottom()
    settlements, figures, profiles = [], [], []
    if levelling is not None:
        limits = settlement_limits(sections.get("settlement"))
        settlements, figures = assess_settlement(levelling, strength, limits, log)
    if lines is not None:
        limits = edge_limits(sections.get("edge")), bulge_limits(sections.get("bulge"))
        profiles, edge_figures = assess_edges(
            lines, strength.diameter_m / 2, *limits, file=Path(edges).name, log=log
        )
        figures = [*figures, *edge_figures]
    return Bottom(tuple(settlements), tuple(profiles), tuple(figures))
