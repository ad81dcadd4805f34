"""The part of the record that compares the noise of the sections."""

from tankcal.pipeline.section_homogeneity import homogeneity_of
from tankcal.record.schema import Saved, filled_from, key


class SectionTestRecord(Saved):
    """Tests of the noise of a section."""

    section: str = key("name")
    noise_factor: float = key(
        "variance of the noise apart from the form of the wall, over the stated one", of="factor"
    )
    noise_dof: float = key("its degrees of freedom", of="dof")
    noise_share: float = key("part of the redundancy of the circle that is noise", of="share")
    chi2: float = key("v'Pv about the circle")
    chi2_dof: int = key("n - 3")
    p: float | None = key("of the stated covariance, two-sided; null: it was estimated")
    compared: bool = key("whether it takes part in Bartlett's test", of="is_compared")
    differs: bool = key("whether it disagrees with the stated covariance")


class HomogeneityRecord(Saved):
    """Whether the sections have one variance of noise."""

    statistic: float | None = key("of Bartlett's test; null: fewer than two sections take part")
    dof: int | None = key("its degrees of freedom")
    p: float | None = key("probability of a larger statistic")
    sections: list[SectionTestRecord] = key("from the bottom up")


def homogeneity_record(job, wall):
    """`HomogeneityRecord` of a wall; None where its sections have no noise of their own."""
    found = None if wall is None else homogeneity_of(job, wall)
    if found is None:
        return None
    sections = [filled_from(SectionTestRecord, one) for one in found.sections]
    return filled_from(HomogeneityRecord, found, sections=sections)
