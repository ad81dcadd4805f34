"""The documents of saved files other than records."""

from tankcal.products.base import products


def find_document(path):
    """Return the document of a saved file.

    Parameters
    ----------
    path : str or Path
        A saved file, such as comparison.json, or its folder.

    Returns
    -------
    SavedDocument or None
    Path or None
        The saved file.

    Examples
    --------
    >>> find_document("examples/silva-1995")
    (None, None)
    >>> document, file = find_document("old/comparison.json")
    >>> document.saved_format.name, file.name
    ('tankcal-comparison', 'comparison.json')
    """
    for product in products():
        for document in product.documents():
            file = document.find_file(path)
            if file is not None:
                return document, file
    return None, None
