"""One word for one thing: what a metrologist would not say never stands in the words."""

import re

import pytest
from page_sessions import ROOT

from tankcal.messages import fields_of
from tankcal.text.shipped import DEFAULT, LANGUAGES
from tankcal.text.words import load_words

OTHERS = [one for one in LANGUAGES if one != DEFAULT]

# {language: {what is said: patterns of what is not}}; \b stands for the edge of a word
GLOSSARY = {
    "pt-BR": {
        "serviço": (
            r"\btrabalhos?\b(?<!pasta de trabalho)(?<!área de trabalho)(?<!pastas de trabalho)",
            r"\bo job\b",
        ),
        "posição do ponto": (r"lugar do ponto", r"novo lugar"),
        "interpolação linear": (r"reta entre", r"linha reta entre"),
        "arredondamento": (r"último algarismo",),
        "balanço de incerteza": (r"orçamento",),
        "simulações": (r"sorteio",),
        "entrega": (r"volumes? fornecidos?",),
        "corpo interno": (r"elementos? internos?", r"madeira", r"volume morto"),
        "anel": (r"\bvirola", r"\bcurso"),
        "costado": (r"\bcasco\b", r"\binvólucro"),
        "mesa de medição": (r"(placa|prato) de medição",),
        "fio de prumo": (r"\bprumadas?\b",),
        "câmara": (r"\bcâmeras?\b",),
        "gon": (r"\bgrados\b", r"\bgons\b"),
        "advertência": (r"\bavisos?\b",),
        "módulo de elasticidade": (r"\bYoung\b",),
        "massa específica": (r"\bdensidade",),
        "desvio-padrão": (r"desvios? padr", r"desvio standard"),
        "incerteza-padrão": (r"incertezas? padr", r"incerteza típica"),
        "fator de abrangência": (r"fator de cobertura", r"probabilidade de cobertura"),
        "exatidão": (r"\bacurácia", r"\bprecisã(o)? absoluta"),
        "nivelado": (r"\beventualmente\b",),
        "n.º": (r"\bn[º°]\s(?!6/1970)", r"Certificado n[º°]"),
    },
    "es": {
        "servicio": (r"\btrabajos?\b", r"\bel job\b"),
        "posición del punto": (r"lugar del punto", r"nuevo lugar"),
        "interpolación lineal": (r"recta entre",),
        "redondeo": (r"última cifra impresa",),
        "balance de incertidumbre": (r"presupuesto",),
        "simulaciones": (r"\bsorteo", r"\bextracciones\b"),
        "elemento interno": (r"elementos? interior", r"cuerpos? internos?", r"madera"),
        "anillo": (r"\bvirola", r"\bcurso"),
        "envolvente": (r"\bcasco\b", r"\bcoraza"),
        "placa de medición": (r"(mesa|plato) de medición",),
        "línea de plomada": (
            r"(sin la|una|cintas, desniveles y) plomadas?\b(?! óptica)",
            r"^plomadas?$",
        ),
        "diana": (r"\bblancos\b",),
        "acimut": (r"\bazimut",),
        "gon": (r"\bgones\b",),
        "advertencia": (r"\bavisos?\b",),
        "desviación estándar": (r"desviaci(ón|ones) típica",),
        "incertidumbre estándar": (r"incertidumbre típica",),
        "factor de cobertura": (r"factor de abrangencia",),
        "matriz de covarianzas": (r"matriz de covarianza\b",),
        "toriesférico": (r"\btorisf",),
        "borde superior": (r"(?<!juntas a )\btope\b",),
        "excluida": (r"observaci(ón|ones) eliminada", r"\bdescartad"),
        "superada": (r"(?-i:RECHAZADA)", r"prueba global aceptada"),
        "previsión": (r"\bpredicción de un levantamiento",),
        "punto de control": (r"puntos? de apoyo",),
    },
}


def texts_of(words, path=""):
    """(path, text) of every text of the words."""
    for key, value in words.items():
        if isinstance(value, dict):
            yield from texts_of(value, f"{path}{key}/")
        elif isinstance(value, str):
            yield f"{path}{key}", value


@pytest.fixture(scope="module")
def texts():
    return {language: dict(texts_of(load_words(language))) for language in LANGUAGES}


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("language", OTHERS)
def test_one_word_for_one_thing(texts, language):
    found = [
        f"{path}: {text!r}: say {better!r}"
        for better, patterns in GLOSSARY[language].items()
        for path, text in texts[language].items()
        if any(re.search(one, re.sub(r"{.*?}", "", text), re.I) for one in patterns)
    ]
    assert found == []


@pytest.mark.parametrize("language", OTHERS)
def test_places_to_fill_in_are_those_of_the_english(texts, language):
    english = texts[DEFAULT]
    both = english.keys() & texts[language].keys()
    assert len(both) > 1000
    assert [
        one for one in sorted(both) if places(texts[language][one]) != places(english[one])
    ] == []


def places(text):
    return fields_of(text) if "{" in text else set()


@pytest.mark.parametrize("language", OTHERS)
def test_marks_are_set_as_the_language_sets_them(texts, language):
    """A blank before %, Spanish questions opened and closed."""
    assert [
        (one, text) for one, text in texts[language].items() if re.search(r"[\d}]%", text)
    ] == []
    opened = [(one, text) for one, text in texts["es"].items()
              if text.count("¿") != text.count("?") and "[]:*?" not in text]  # fmt: skip
    assert opened == []


def terms():
    """Rows of docs/glossary.md: English, Portuguese and Spanish term."""
    text = (ROOT / "docs/glossary.md").read_text(encoding="utf-8")
    rows = [line.strip("| \n").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return rows[2:]


def test_the_glossary_has_its_terms_in_three_languages():
    rows = terms()
    assert len(rows) >= 120
    assert [row for row in rows if len(row) != 3] == []
    names = [row[0].lower() for row in rows]
    assert names == sorted(set(names))


@pytest.mark.parametrize(("language", "column"), [("pt-BR", 1), ("es", 2)])
def test_words_use_the_terms_of_the_glossary(language, column):
    path = ROOT / f"report_templates/words/{language}.toml"
    words = path.read_text(encoding="utf-8").lower()
    unused = [
        row[column]
        for row in terms()
        if not re.search(rf"\b{re.escape(row[column].lower())}", words)
    ]
    assert unused == []


@pytest.mark.parametrize(("language", "column"), [("pt-BR", 1), ("es", 2)])
def test_the_glossary_has_no_term_that_the_words_avoid(language, column):
    for row in terms():
        for patterns in GLOSSARY[language].values():
            found = [one for one in patterns if re.search(one, row[column], re.IGNORECASE)]
            assert found == [], row
