"""Horizontal sections of a shell: points grouped, the circle through them, and their outline."""

from tankcal.sections.fitting import Section, fit_section, sample_of, slide
from tankcal.sections.grouping import Group, group_by_height, group_by_name
from tankcal.sections.points import coordinates_of, covariance_of, own_covariances

__all__ = [
    "Group",
    "Section",
    "coordinates_of",
    "covariance_of",
    "fit_section",
    "group_by_height",
    "group_by_name",
    "own_covariances",
    "sample_of",
    "slide",
]
