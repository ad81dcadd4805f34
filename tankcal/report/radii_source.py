"""Source of former radii, for certificate and working papers."""


def source_text(paper):
    """Return the source of the radii with the note of the job."""
    radii = paper.record["radii"]
    text = paper.word(f"radii_sources.{radii['source']}")
    return f"{text}: {radii['note']}" if radii["note"] else text
