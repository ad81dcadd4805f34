"""Which parameters belong in the model of a camera: what the terminal and the CSV files show."""

from tankcal.report.camera import parameter_advice as advice
from tankcal.report.camera import parameter_tests as tests
from tankcal.report.camera.parameter_tables import tables

__all__ = ["summary", "tables"]


def summary(paper):
    """What the terminal shows: tests, groups, correlations, components, dropping, advice."""
    return [
        *tests.facts(paper),
        paper.heading("tests"),
        *tests.tests(paper),
        *tests.correlated(paper),
        *_under(paper, "components", tests.components(paper)),
        *_under(paper, "dropping", advice.dropping(paper)),
        *_under(paper, "rules", advice.rules(paper)),
        paper.heading("recommendation"),
        *advice.recommendation(paper),
    ]


def _under(paper, name, found):
    """The blocks with a heading, where there are any."""
    return [paper.heading(name), *found] if found else []
