"""The counter of the words of pages."""

from page_counts import LONGEST, SUM, TRANSLATIONS, count_pages, main


def test_words_by_kind(tmp_path):
    index = "## Start\n- [a](a.md)\n- [b](b-es.md)\n## Studies\n- [c](c.md)\n- [d](job-format.md)\n"
    (tmp_path / "index.md").write_text(index)
    (tmp_path / "a.md").write_text("word " * (LONGEST + 1))
    (tmp_path / "b-es.md").write_text("palabra " * 5)
    (tmp_path / "c.md").write_text("word " * 7)
    counts, words = count_pages(tmp_path)
    assert counts == {"docs/a.md": LONGEST + 1, SUM: LONGEST + 1, TRANSLATIONS: 5}
    assert words == {"a.md": LONGEST + 1, "b-es.md": 5, "c.md": 7}


def test_pages_are_within_their_limits():
    assert main([]) == 0
