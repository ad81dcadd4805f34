"""Languages of the reports; each has a file in report_templates/words/."""

DEFAULT = "en"
LANGUAGES = (DEFAULT, "pt-BR", "es")


def nearest_language(given):
    """Return the language for a code such as "pt", "pt_PT.UTF-8" or "ES"; None if unsupported."""
    first = given.strip().lower()[:2] if isinstance(given, str) else ""
    return next(
        (language for language in LANGUAGES if first and language.lower()[:2] == first), None
    )
