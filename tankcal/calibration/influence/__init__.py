"""Influence of a wrong camera calibration on a survey."""


def __getattr__(name):
    if name != "influence":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from tankcal.calibration.influence.runs import influence

    return influence
