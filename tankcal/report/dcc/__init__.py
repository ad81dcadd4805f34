"""The digital calibration certificate: XML of the German metrology institute (PTB), schema 3.3.0.

The certificate contains data of the record only. Elements that the schema requires and the job
lacks are "not stated" (docs/certificate-digital.md).
"""

from tankcal.report.dcc.administrative import add_administrative_data
from tankcal.report.dcc.elements import (
    CERTIFICATE,
    DCC,
    Translations,
    add_child,
    make_root,
    serialize,
)
from tankcal.report.dcc.measured import add_results
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import language_of, load_words

__all__ = ["DCC", "FILE", "certificate_xml", "language_with"]
FILE = "certificate.xml"
_GROUPS = (  # groups of words for a record without survey, warning or decision
    *("language", "dcc", "certificate", "titles", "headings", "labels", "captions", "texts"),
    *("choices", "inputs", "kinds", "sides", "zeros", "parts", "units", "yes_no"),
    *("rule_codes", "rule_texts", "formulas", "datum"),
)


def certificate_xml(record, digest, language=None):
    """Return the digital calibration certificate of a record with a capacity table.

    Names and sentences are in all languages. The language of the reports comes first and is
    authoritative (`mandatoryLangCodeISO639_1`). Texts of the job have no language.

    Parameters
    ----------
    record : dict
        Record of `record.load`.
    digest : str
        SHA-256 of the bytes of record.json, in hexadecimal digits.
    language : str, optional
        One of LANGUAGES; None: language of the job.

    Returns
    -------
    bytes
        UTF-8; equal bytes for equal records.
    """
    first = language or language_of(record)
    codes = [first, *(code for code in LANGUAGES if code != first)]
    needs_all = record["warnings"] or record["adjustment"] or record.get("overrulings")
    groups = None if needs_all else _GROUPS
    languages = Translations(record, [load_words(code, groups) for code in codes])
    root = make_root(CERTIFICATE)
    add_administrative_data(add_child(root, "administrativeData"), languages, digest)
    add_results(add_child(root, "measurementResults"), languages, digest)
    return serialize(root)


def language_with(code):
    """Return the language of LANGUAGES with a two-letter code of the certificate, or None."""
    return next((language for language in LANGUAGES if language.split("-")[0] == code), None)
