"""Which room makes papers of a saved file that is no record."""


def room_of(path):
    """The room whose saved file a path names, itself or its folder, and that file.

    Parameters
    ----------
    path : path
        Such as comparison.json, or the folder that it lies in.

    Returns
    -------
    module or None
        `report.comparison`, `inspection` or `history`: it has `load` and `rebuild`.
    Path or None

    Examples
    --------
    >>> room_of("examples/silva-1995")
    (None, None)
    >>> room, file = room_of("old/comparison.json")
    >>> room.__name__, file.name
    ('tankcal.report.comparison', 'comparison.json')
    """
    from tankcal.report import comparison, history, inspection

    for room, file_of in (
        (comparison, comparison.comparison_file),
        (inspection, inspection.inspection_file),
        (history, history.history_file),
    ):
        file = file_of(path)
        if file is not None:
            return room, file
    return None, None
