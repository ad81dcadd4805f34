"""The sentence that a certificate has for a decision against the search for blunders."""

import pytest

from tankcal.report.paper import Paper
from tankcal.report.tables.survey import sentence_of


@pytest.mark.parametrize(
    ("language", "by", "date", "told"),
    [
        ("en", "J. Silva", "2026-02-03", "Decided by: J. Silva, 3 February 2026."),
        ("en", "", "2026-02-03", "Decided on 3 February 2026."),
        ("pt-BR", "", "2026-02-03", "Decidido em 3 de fevereiro de 2026."),
        ("es", "", "2026-02-03", "Decidido el 3 de febrero de 2026."),
        ("es", "J. Silva", "", "Decidido por: J. Silva."),
        ("en", "", "", "Reason: a dent."),
    ],
)
def test_who_decided_and_when(language, by, date, told):
    row = {"what": "I 7", "kind": "point", "decision": "keep", "reason": "a dent."}
    row |= {"by": by, "date": date, "searched": None, "moved_m3": None}
    record = {"job": {"table": {}}, "adjustment": None, "corrections": [], "warnings": []}
    said = sentence_of(Paper(record, language=language), row)
    assert said.endswith(told)
