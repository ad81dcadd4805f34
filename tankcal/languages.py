"""The languages of the papers: each is one file of words (report_templates/words/)."""

DEFAULT = "en"
LANGUAGES = (DEFAULT, "pt-BR", "es")
