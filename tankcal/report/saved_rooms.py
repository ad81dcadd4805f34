"""Package that writes the papers of a saved file other than a record."""


def room_of(path):
    """Return the package for a saved file, and the file.

    Parameters
    ----------
    path : str or Path
        A saved file, such as comparison.json, or its folder.

    Returns
    -------
    module or None
        `report.comparison`, `inspection` or `history`, with the functions `load` and `rebuild`.
    Path or None
        The saved file.

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
