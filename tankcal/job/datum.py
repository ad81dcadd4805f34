"""The points of a datum as they are written: P7, P7:xy."""

AXES = "xyz"


def datum_point(text):
    """(name, axes) of a datum point such as P7 or P7:xy; axes "" where they make no sense."""
    name, colon, axes = text.rpartition(":")
    if not colon:
        return text, AXES
    sound = axes and set(axes) <= set(AXES) and len(set(axes)) == len(axes)
    return name.strip(), "".join(axis for axis in AXES if axis in axes) if sound else ""
