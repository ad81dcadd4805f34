"""Portuguese and Spanish words for choices and for yes and no in forms.

A form may contain these words in place of the English words. A form offers the first word.
"""

import unicodedata

NOTES = {}  # {English note of a key or column: (group, name)}; the contract of the job fills it
YES, NO = "true", "false"
FORM_WORDS = {
    "pt-BR": {
        YES: ("sim", "verdadeiro"),
        NO: ("não", "falso"),
        "outside": ("fora", "por fora", "externo", "exterior"),
        "inside": ("dentro", "por dentro", "interno", "interior"),
        "sphere": ("esfera", "esférico"),
        "equator": ("equador",),
        "meridian": ("meridiano",),
        "mesh": ("malha",),
        "flat": ("plano",),
        "leaning": ("inclinado",),
        "cone": ("cone", "cônico"),
        "dish": ("calota",),
        "points": ("pontos",),
        "liquid": ("líquido",),
        "conical": ("cônico",),
        "ellipsoidal": ("elipsoidal", "elíptico", "semielíptico"),
        "torispherical": ("torisférico",),
        "spherical": ("esférico",),
        "plumb": ("prumo", "a prumo", "vertical"),
        "square": ("esquadro", "perpendicular"),
        "air": ("ar", "no ar"),
        "vacuum": ("vácuo", "no vácuo"),
        "standard": ("padrão", "incerteza-padrão"),
        "expanded": ("expandida",),
        "half_width": ("semiamplitude", "semilargura"),
        "rectangular": ("retangular",),
        "adjust": ("ajustar",),
        "check": ("verificar",),
        "rest": ("repouso",),
        "spatial": ("espacial", "inclinada"),
        "control": ("apoio",),
        "fixed_photo": ("foto fixa",),
        "minimal": ("mínimo", "mínimas"),
        "inner": ("interno", "internas", "livre", "interna"),
        "outer": ("externo", "externa"),
        "carbon_steel": ("aço-carbono", "aço carbono"),
        "stainless_steel": ("inoxidável", "aço inoxidável"),
        "aluminium": ("alumínio",),
        "other": ("outro",),
        "ambient": ("ambiente",),
        "heated": ("aquecido",),
        "refrigerated": ("refrigerado",),
        "up": ("sobe",),
        "middle": ("meio", "linha média"),
        "raised": ("saliente", "em suporte"),
        "down": ("desce",),
        "keep": ("manter",),
        "leave_out": ("retirar",),
        "left": ("esquerda", "esquerdo"),
        "right": ("direita", "direito"),
        "tape": ("trena",),
        "edm": ("distanciômetro",),
        "total_station": ("estação total",),
        "theodolite": ("teodolito",),
        "level": ("nível",),
        "plummet": ("prumo",),
        "stadia": ("estádia",),
        "before": ("antes",),
        "after": ("depois",),
        "rust": ("ferrugem",),
        "paint": ("pintura",),
    },
    "es": {
        YES: ("sí", "verdadero"),
        NO: ("no", "falso"),
        "outside": ("fuera", "por fuera", "externo", "exterior"),
        "inside": ("dentro", "por dentro", "interno", "interior"),
        "sphere": ("esfera", "esférico"),
        "equator": ("ecuador",),
        "meridian": ("meridiano",),
        "mesh": ("malla",),
        "flat": ("plano",),
        "leaning": ("inclinado",),
        "cone": ("cono", "cónico"),
        "dish": ("casquete",),
        "points": ("puntos",),
        "liquid": ("líquido",),
        "conical": ("cónico",),
        "ellipsoidal": ("elipsoidal", "elíptico", "semielíptico"),
        "torispherical": ("toriesférico", "torisférico"),
        "spherical": ("esférico",),
        "plumb": ("plomada", "a plomo", "vertical"),
        "square": ("escuadra", "perpendicular"),
        "air": ("aire", "en aire"),
        "vacuum": ("vacío", "en vacío"),
        "standard": ("estándar", "típica"),
        "expanded": ("expandida",),
        "half_width": ("semiamplitud",),
        "rectangular": ("rectangular",),
        "adjust": ("ajustar",),
        "check": ("comprobar",),
        "rest": ("reposo",),
        "spatial": ("espacial", "inclinada"),
        "control": ("control", "apoyo"),
        "fixed_photo": ("foto fija",),
        "minimal": ("mínimo", "mínimas"),
        "inner": ("interno", "internas", "libre"),
        "outer": ("externo", "exterior"),
        "carbon_steel": ("acero al carbono",),
        "stainless_steel": ("inoxidable", "acero inoxidable"),
        "aluminium": ("aluminio",),
        "other": ("otro",),
        "ambient": ("ambiente",),
        "heated": ("calentado",),
        "refrigerated": ("refrigerado",),
        "up": ("sube",),
        "middle": ("mitad", "línea media"),
        "raised": ("saliente", "en soporte"),
        "down": ("baja",),
        "keep": ("mantener",),
        "leave_out": ("retirar",),
        "left": ("izquierda", "izquierdo"),
        "right": ("derecha", "derecho"),
        "tape": ("cinta",),
        "edm": ("distanciómetro",),
        "total_station": ("estación total",),
        "theodolite": ("teodolito",),
        "level": ("nivel",),
        "plummet": ("plomada",),
        "stadia": ("estadia",),
        "before": ("antes",),
        "after": ("después",),
        "rust": ("óxido",),
        "paint": ("pintura",),
    },
}


def word_of(language, choice):
    """Return the word for a choice in a language; the choice itself if there is no word."""
    return FORM_WORDS.get(language, {}).get(choice, (choice,))[0]


def meant(word, choices):
    """Return the choice that a word of any form means; None if it matches no choice or several.

    A choice also matches regardless of case, blanks and punctuation: "DIN 28011" matches din_28011.
    This does not apply to units and codes of one or two letters.
    """
    plain = _plain(word)
    matches = {
        choice
        for words in FORM_WORDS.values()
        for choice in choices
        if plain in map(_plain, words.get(choice, ()))
    }
    if not matches:
        bare = _bare(word)
        matches = {choice for choice in choices if len(bare) > 2 and _bare(choice) == bare}
    return matches.pop() if len(matches) == 1 else None


def _bare(word):
    """Return the letters and digits of a word in lower case, without accents."""
    return "".join(char for char in _plain(word) if char.isalnum())


def _plain(word):
    """Return a word in lower case without accents and underscores."""
    letters = unicodedata.normalize("NFKD", word.strip().lower().replace("_", " "))
    return "".join(letter for letter in letters if not unicodedata.combining(letter))
