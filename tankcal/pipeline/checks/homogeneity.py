"""Tests whether the noise of the sections is homogeneous and agrees with its stated covariance.

The table uses the stated covariance of the points and amplitudes common to all courses. The scatter
of a section about its circle or about the wall enters U of no row. Two tests show where this is not
justified:

- Bartlett's test of all sections together, on the variance factors of their noise apart from the
  form of the wall. A section takes part if noise is at least half of the scatter of its points.
  Otherwise form that the model lacks would count as noise.
- A two-sided chi-square test of each section against its stated covariance. A small scatter is
  judged about the circle, because form can only add to it. A large scatter is judged apart from the
  form.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtr

from tankcal.geometry.field.section_noise import bartlett
from tankcal.messages import list_some, message
from tankcal.methods.base import given_methods
from tankcal.pipeline.checks.survey import SHOWN, noise_is_estimated, of_points

# Keys of the warnings that only measured points, not planned points, can cause.
OF_SCATTER = ("sections_inhomogeneous", "sections_off_stated")
LEVEL = 0.01  # significance of both tests; rejects 3 of 500 valid simulated surveys
LEAST_SHARE = 0.5  # least share of noise; without it 9 % of the surveys with 0.3 mm fail


@dataclass(frozen=True)
class SectionTest:
    """Tests of one section.

    Attributes
    ----------
    section : str
        Name of the section.
    factor : float
        Variance of the noise apart from the form, divided by the stated variance.
    dof : float
        Degrees of freedom of `factor`.
    share : float
        Share of noise in the redundancy of the circle; the rest is form.
    chi2, chi2_dof : float, int
        v'Pv about the circle, and n - 3.
    p : float or None
        Two-sided p value of the stated covariance; None if the covariance was estimated.
    is_compared : bool
        Whether the section takes part in Bartlett's test.
    differs : bool
        Whether the section disagrees with its stated covariance (Holm 1979, all sections at 1 %).
    """

    section: str
    factor: float
    dof: float
    share: float
    chi2: float
    chi2_dof: int
    p: float | None
    is_compared: bool
    differs: bool


@dataclass(frozen=True)
class Homogeneity:
    """Tests of the sections of a wall.

    Attributes
    ----------
    sections : tuple of SectionTest
        From the bottom up.
    statistic, dof, p : float or None, int or None, float or None
        Result of Bartlett's test; None if fewer than two sections take part.
    """

    sections: tuple[SectionTest, ...]
    statistic: float | None = None
    dof: int | None = None
    p: float | None = None

    @property
    def compared(self):
        """Sections that take part in Bartlett's test."""
        return [section for section in self.sections if section.is_compared]


def homogeneity_of(job, wall):
    """`Homogeneity` of the sections of a wall surveyed by points.

    Parameters
    ----------
    job : Job
    wall : Wall

    Returns
    -------
    Homogeneity or None
        None if points share unknowns of instruments (hits, clouds, tangents) or were averaged in
        cells, because sections then have no separate noise.
    """
    is_sighted = any(method.is_sighted for method in given_methods(job))
    shares_unknowns = is_sighted or job.points.unbound
    if shares_unknowns or wall.points_read != len(wall.accepted):
        return None
    noise = wall.section_noise
    is_stated = not noise_is_estimated(job)
    p = [
        _two_sided(section.circle, section_noise) if is_stated else None
        for section, section_noise in zip(wall.sections, noise, strict=True)
    ]
    differs = _rejected_by_holm(p) if is_stated else np.zeros(len(p), dtype=bool)
    tests = tuple(_test_of(*parts) for parts in zip(wall.sections, noise, p, differs, strict=True))
    compared = [(test.factor, test.dof) for test in tests if test.is_compared]
    if len(compared) < 2:
        return Homogeneity(tests)
    return Homogeneity(tests, *bartlett(*zip(*compared, strict=True)))


def _is_noisy(circle, noise):
    """Whether noise is at least half of the scatter of the points of a section."""
    return noise.redundancy >= LEAST_SHARE * circle.dof


def _two_sided(circle, noise):
    """Two-sided p value of the scatter of a section under its stated covariance."""
    lower = float(chdtr(circle.dof, circle.dof * circle.variance_factor))
    upper = noise.upper_p if _is_noisy(circle, noise) else 1.0
    # Doubling the smaller tail gives a two-sided p value; its bound of 1 keeps it a probability.
    return min(2 * min(lower, upper), 1.0)


def _rejected_by_holm(p):
    """Mask (k,) of the hypotheses rejected at a joint significance `LEVEL` (Holm 1979)."""
    p, order = np.array(p), np.argsort(p)
    passed = p[order] > LEVEL / np.arange(len(p), 0, -1)
    rejected = np.zeros(len(p), dtype=bool)
    rejected[order] = np.cumsum(passed) == 0  # from the first that passes on, all pass
    return rejected


def _test_of(section, noise, p, differs):
    """`SectionTest` of a section."""
    circle = section.circle
    return SectionTest(
        section=section.group.name,
        factor=noise.factor,
        dof=noise.dof,
        share=noise.redundancy / circle.dof,
        chi2=circle.dof * circle.variance_factor,
        chi2_dof=circle.dof,
        p=p,
        is_compared=_is_noisy(circle, noise),
        differs=bool(differs),
    )


def warn_of_sections(job, wall):
    """Warnings of sections whose noise differs, or disagrees with the stated covariance.

    Parameters
    ----------
    job : Job
    wall : Wall

    Returns
    -------
    list of Problem
    """
    homogeneity = homogeneity_of(job, wall)
    if homogeneity is None:
        return []
    texts = []
    if homogeneity.p is not None and homogeneity.p < LEVEL:
        quiet, *_, loud = sorted(homogeneity.compared, key=lambda test: test.factor)
        texts.append(
            message(
                "sections_inhomogeneous",
                "the noise of the sections is not homogeneous: Bartlett's statistic is"
                " {statistic:.1f} with {dof} degrees of freedom (p = {p:.1g}); the variance factor"
                " is {least:.2f} in section {low} and {most:.2f} in section {high}. U does not take"
                " the scatter of each section: for the whole tank it averages, of a row or delivery"
                " near section {low} the part by the points is too large (the true sd is"
                " {quiet:.1f} times the one taken), near section {high} too small ({loud:.1f}"
                " times): find the cause, or give the points of each section their own sd",
                statistic=homogeneity.statistic,
                dof=homogeneity.dof,
                p=homogeneity.p,
                least=quiet.factor,
                low=quiet.section,
                most=loud.factor,
                high=loud.section,
                quiet=np.sqrt(quiet.factor),
                loud=np.sqrt(loud.factor),
            )
        )
    differing = [section for section in homogeneity.sections if section.differs]
    if differing:
        texts_of_sections = [
            message(
                "section_off_stated",
                "{section} ({times:.2f} times, p = {p:.1g})",
                section=test.section,
                times=np.sqrt(_ratio(test)),
                p=test.p,
            )
            for test in sorted(differing, key=lambda test: test.p)
        ]
        texts.append(
            message(
                "sections_off_stated",
                "sections whose points scatter more or less than their stated standard deviations"
                " allow (chi-square, all sections together at 1 %): {sections}; U takes the"
                " stated standard deviations: correct them",
                sections=list_some(texts_of_sections, SHOWN),
            )
        )
    return of_points(job.points, texts)


def _ratio(test):
    """Variance over the stated one: about the circle if too small, else apart from the form."""
    # Form can only add to the scatter about the circle, so a ratio below 1 there is due to noise.
    about_circle = test.chi2 / test.chi2_dof
    return about_circle if about_circle < 1 else test.factor
