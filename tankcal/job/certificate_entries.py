"""Entries of a certificate that ISO/IEC 17025:2017, 7.8.2 and 7.8.4, requires.

The terminal, the empty workbook, the certificate and its digital form ask this list. A certificate
without any of them is a draft, and `tankcal run --strict` refuses to write it.

Source: a guidance page on 7.8.2 and 7.8.4, not the standard itself (docs/report.md).
"""

# Keys of [certificate], in the order of the certificate. One key of each group is sufficient.
REQUIRED = (
    ("number",),
    ("laboratory",),
    ("laboratory_address",),
    ("customer",),
    ("customer_address", "customer_contact"),
    ("place",),
    ("date_of_issue",),
    ("method", "standard"),
    ("traceability",),
    ("conditions",),
    ("condition_of_tank",),
    ("authorised_by",),
)
# Keys that are marked in an empty job: the first of each group.
MARKED = tuple(group[0] for group in REQUIRED)
IN_LETTERHEAD = ("laboratory", "laboratory_address")


def missing_entries(certificate, location=None, has_letterhead=False):
    """Return the keys of required entries that a certificate lacks.

    Parameters
    ----------
    certificate : Mapping
        [certificate] of the job.
    location : str, optional
        Location of the tank, which replaces the place of the calibration.
    has_letterhead : bool, optional
        Whether a letterhead states the laboratory and its address.

    Returns
    -------
    list of str

    Examples
    --------
    >>> missing_entries(dict.fromkeys(MARKED, "given"))
    []
    >>> missing_entries({"number": "7", "place": " "}, "Santos", has_letterhead=True)[:2]
    ['customer', 'customer_address']
    """
    given = {key for key, value in certificate.items() if str(value or "").strip()}
    given |= {"place"} if location else set()
    given |= set(IN_LETTERHEAD) if has_letterhead else set()
    return [group[0] for group in REQUIRED if not given.intersection(group)]
