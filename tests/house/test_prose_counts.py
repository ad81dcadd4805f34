"""The counter of words and names that our English should lose."""

from prose_counts import count_file, count_long_sentences, main, prose_of_page

PAGE = """# One page

The survey tells it, as it stands. `told` and [a link](told.md) do not count.

```
nothing here counts
```

| nothing | here |
"""
MODULE = '''"""What is told."""


def _of_radii(one):  # nothing said
    found = {"told": one}
    return found


def fit_circle(points):
    return points


def rejected_rows(rows):
    return rows
'''


def test_words_of_a_page(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    counts = count_file(page)
    expected = {"docs: one": 1, "docs: tells, told": 1, "docs: stands": 1, "docs: as it is": 1}
    assert {name: count for name, count in counts.items() if count} == expected
    assert "nothing" not in prose_of_page(PAGE)


def test_words_and_names_of_a_module(tmp_path):
    module = tmp_path / "module.py"
    module.write_text(MODULE)
    every = count_file(module)
    assert "package: by lot" in every  # a limit of 0, so that the word does not return
    counts = {name[9:]: count for name, count in every.items() if count}
    assert counts == {
        "what is, what the, what it": 1, "tells, told": 2, "nothing": 1, "says, said": 1,
        "name one": 2, "name found": 2, "function preposition": 1, "function participle": 1,
    }  # fmt: skip


def test_long_sentences():
    assert count_long_sentences("word " * 25 + ". Short.") == 0
    assert count_long_sentences("word " * 26 + ". Short.") == 1


def test_a_count_above_its_limit_fails(tmp_path, monkeypatch, capsys):
    import prose_counts

    page = tmp_path / "page.md"
    page.write_text("Nothing stands here.")
    monkeypatch.setattr(prose_counts, "list_files", lambda: [page])
    monkeypatch.setattr(prose_counts, "LIMITS", tmp_path / "limits.toml")
    assert main(["--lower"]) == 0
    assert main([]) == 0
    page.write_text("Nothing stands here, nothing.")
    assert main(["--lower"]) == 1
    assert capsys.readouterr().out.startswith("docs: nothing: 2, limit 1")
    page.write_text("No tank is here.")
    assert main(["--lower"]) == 0
    page.write_text("Nothing stands here.")
    assert main([]) == 1
