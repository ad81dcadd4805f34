"""The languages of the papers: each is one file of words (report_templates/words/)."""

DEFAULT = "en"
LANGUAGES = (DEFAULT, "pt-BR", "es")


def nearest_language(given):
    """The language that a code such as "pt", "pt_PT.UTF-8" or "ES" means; None for no such one."""
    first = given.strip().lower()[:2] if isinstance(given, str) else ""
    return next(
        (language for language in LANGUAGES if first and language.lower()[:2] == first), None
    )
