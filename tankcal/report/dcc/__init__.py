"""The digital calibration certificate: XML of the German metrology institute (PTB), schema 3.3.0.

It is made from the record alone, and says nothing that the record does not: what the schema asks
for and the job does not give is there as "not stated" (docs/certificate-digital.md).
"""

from tankcal.report.dcc.administrative import administrative_data
from tankcal.report.dcc.elements import CERTIFICATE, DCC, Tongues, child, root_of, written
from tankcal.report.dcc.measured import measured_results
from tankcal.text.languages import LANGUAGES
from tankcal.text.words import language_of, load_words

__all__ = ["DCC", "FILE", "certificate_xml", "language_with"]
FILE = "certificate.xml"
_GROUPS = (  # of the words, that it takes where a record has no survey or warning to tell of
    *("language", "dcc", "certificate", "titles", "headings", "labels", "captions", "texts"),
    *("choices", "inputs", "kinds", "sides", "zeros", "parts", "units", "yes_no"),
    *("rule_codes", "rule_texts", "formulas", "datum"),
)


def certificate_xml(record, digest, language=None):
    """The digital calibration certificate of a record that has a capacity table.

    Names and sentences stand in every language; that of the papers comes first, and is the one
    that counts (`mandatoryLangCodeISO639_1`). Texts of the job have no language.

    Parameters
    ----------
    record : dict
        As `record.load` gives it.
    digest : str
        SHA-256 of the bytes of its record.json, in hexadecimal digits.
    language : str, optional
        One of LANGUAGES; None: that of the job.

    Returns
    -------
    bytes
        UTF-8; the same record gives the same bytes.
    """
    first = language or language_of(record)
    order = [first, *(one for one in LANGUAGES if one != first)]
    told = record["warnings"] or record["adjustment"] or record.get("overrulings")
    groups = None if told else _GROUPS
    tongues = Tongues(record, [load_words(one, groups) for one in order])
    root = root_of(CERTIFICATE)
    administrative_data(child(root, "administrativeData"), tongues, digest)
    measured_results(child(root, "measurementResults"), tongues, digest)
    return written(root)


def language_with(code):
    """The language of LANGUAGES with a two-letter code of the certificate; None for no such one."""
    return next((one for one in LANGUAGES if one.split("-")[0] == code), None)
