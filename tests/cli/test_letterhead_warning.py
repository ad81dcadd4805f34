"""The letterhead states entries of the certificate that the terminal no longer calls missing."""

from tankcal.cli.running import _complete_by_letterhead
from tankcal.pipeline.checks import incomplete_certificate


def test_entries_of_the_letterhead_are_not_missing(example_result):
    job, warnings = example_result.job, example_result.warnings
    told = _complete_by_letterhead(warnings, job, {"name": "Lab"})
    assert len(told) == len(warnings)
    assert "laboratory_address" in str(incomplete_certificate(job)[0])
    assert "laboratory_address" not in str(told[-1])
    assert "customer_address" in str(told[-1])
    assert _complete_by_letterhead(warnings, job, None) is warnings
