"""Where former radii come from, for certificate and working papers."""


def source_text(paper):
    """Where the radii come from, with what the job notes of it."""
    radii = paper.record["radii"]
    text = paper.word(f"radii_sources.{radii['source']}")
    return f"{text}: {radii['note']}" if radii["note"] else text
