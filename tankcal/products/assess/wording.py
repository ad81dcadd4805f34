"""Words of certificates in six languages: labels, claims, intervals, placeholders.

Patterns of regular expressions for texts in English, Portuguese, Spanish, French, German and
Italian. They find a label or a claim in the certificate of any laboratory; a certificate that uses
other words gets a finding that a reader must check.
"""

import re

from tankcal.messages import message

PLACEHOLDER = re.compile(
    r"tbd|tba|todo|x{2,}|\?+|[-–—._/ ]+|n[./]?a\.?|<.*>|\[.*\]|lorem ipsum.*|fixme"
    r"|to be (filled|completed|determined|confirmed|defined).*|a (preencher|definir|confirmar).*"
    r"|por (completar|definir|confirmar).*|pendente|pendiente|pending|à compléter.*",
    re.IGNORECASE,
)
CLAIMS = re.compile(
    r"\b(compl(y|ies) with|conforms? (to|with)|in conformity with|in compliance with"
    r"|meets? the (requirements?|limits?)|within (the )?toleran\w+"
    r"|(tank|table) (passed|is approved)"
    r"|atende (a|ao|aos|à|às) \w+|em conformidade com|está conforme|dentro da tolerância"
    r"|(tanque|tabela) aprovad[oa]"
    r"|cumple (con )?(el|la|los|las)|conforme (a|con) (el|la|los|las)|dentro de la tolerancia"
    r"|(tanque|tabla) aprobad[oa]|est conforme|satisfait aux?|entspricht den|ist konform"
    r"|è conforme)\b",
    re.IGNORECASE,
)
INTERVALS = re.compile(
    r"\b(valid (until|for|to)|period of validity|expir(es|y)|(next|re-?)[ -]?calibrat\w+"
    r"|next (verification|due)|due date|recommended interval"
    r"|válid[oa] (até|por|hasta)|validade|vencimento|vencimiento|vigencia"
    r"|próxim[oa] (calibração|verificação|arqueação|calibración|verificación)|recalibra\w+"
    r"|valable jusqu\w*|prochain(e)? (étalonnage|vérification)|gültig bis|nächste kalibrierung"
    r"|valid[oa] fino|prossima taratura)\b",
    re.IGNORECASE,
)
# A rule or the customer's request, which permits an interval.
_REASONS = re.compile(
    r"customer|request|regulation|\b(order|law|lei|ley|norma|loi)\b|decree|directive|cliente|pedido"
    r"|solicit|portaria|decreto|resolu[cç]|arrêté|demande|kunde|verordnung|gesetz|richiesta"
    r"|(article|artigo) \d",
    re.IGNORECASE,
)
# What may be valid until a day without being the tank: standards, instruments, an accreditation.
_OTHER_VALIDITY = re.compile(
    r"padr(ão|ões)|patr(ón|ones)|standards?\b|instrument|equip|trena|cinta|tape|scanner|estaç"
    r"|estación|station|accredit|acredit|akkredit|certificad[oa]s? (rbc|n[.º°o])|étalon",
    re.IGNORECASE,
)
_NEAR, _REASON_NEAR = 60, 120  # letters around an interval in which its subject or reason is
# Names of the requirements of a certificate whose words are searched, with their patterns.
LABELS = {
    "title": r"certificate|certificado|certificat|kalibrierschein|certificato|barème|zertifikat",
    "number": r"(certificate|report|certificado|certificat|kalibrierschein|certificato|serial)?"
    r"\s*(no\b|n[.º°o]|number|número|numéro|nummer|numero)\s*[.:º°]?",
    "laboratory": r"laborator|issued by|emitid|émetteur|expedid|aussteller|company|empresa|ltd|gmbh"
    r"|s\.?a\.?\b",
    "customer": r"customer|client|owner|propriet|propietari|kunde|auftraggeber|cliente|titular"
    r"|détenteur|solicitante|contratante|requerente|interessado|applicant|requested by",
    "place": r"place|location|site\b|local|lugar|ubicaci|lieu|\bort\b|standort|luogo|terminal",
    "method": r"method|método|méthode|verfahren|metodo|procedure|procedimento|procedimiento"
    r"|ISO 7507|API MPMS",
    "item": r"tank|tanque|réservoir|récipient|cuve|serbatoio|behälter|depósito",
    "date": r"\bdate|\bdata\b|fecha|datum|\d{1,2}[./-]\d{1,2}[./-]\d{2,4}|\d{4}-\d{2}-\d{2}",
    "conditions": r"condition|condiç|condicion|temperatur|bedingung|condizion|weather|environment",
    "traceability": r"traceab|rastreab|trazab|traçab|raccord|rückgeführt|rückführ|riferibil|tracea"
    r"|standards? used|padr(ão|ões)|patr(ón|ones)|étalons?",
    "uncertainty": r"uncertaint|incerteza|incertidumbre|incertitude|unsicherheit|incertezza"
    r"|\bU\s*=",
    "coverage": r"\bk\s*=|coverage|abrang|cobertura|élargissement|erweiterungsfaktor|copertura",
    "reference": r"reference temperature|temperatura de refer|température de référence"
    r"|bezugstemperatur|temperatura di riferimento|(at|to|a|à|bei|zu) (15|20|60)([.,]0+)?\s*°",
    "only_items": r"(only|solely|exclusively|apenas|somente|únicamente|solamente|sólo|solo"
    r"|exclusiva\w*|uniquement|ausschließlich|esclusivamente)",
    "copy": r"reprodu|copied|copia|cópia|copiad|vervielfältig|riprodu",
    "authorisation": r"authori[sz]|approv|sign|autoriz|aprov|aprob|assinat|firma|signat"
    r"|unterschrift|verantwortlich|responsible|responsável|responsable",
    "pages": r"(page|página|pág\.?|seite|pagina|sheet|folha|hoja)\s*:?\s*\d+\s*(of|de|/|von|di|sur)"
    r"\s*\d+|\b\d+\s*/\s*\d+\b",
}


def find_claim(text):
    """Words of a text that claim conformity; "" if there are none."""
    match = CLAIMS.search(text)
    return match[0] if match else ""


def find_interval(text):
    """Words of a text that state an interval of calibration without its reason; ""."""
    for match in INTERVALS.finditer(text):
        subject, reason = (
            text[max(0, match.start() - near) : match.end() + near]
            for near in (_NEAR, _REASON_NEAR)
        )
        if not (_OTHER_VALIDITY.search(subject) or _REASONS.search(reason)):
            return match[0]
    return ""


def claim_text(words):
    """Return the message about words that claim conformity."""
    return message(
        "assess_claim", "claims conformity ({words}) without a decision rule", words=words
    )


def interval_text(words):
    """Return the message about words that state an interval of calibration."""
    return message(
        "assess_interval",
        "states a validity or a next calibration ({words}), without the rule or the customer's "
        "request behind it",
        words=words,
    )


def statement_text(sentence):
    """Return the message about a sentence that a certificate lacks."""
    return message("assess_statement", "does not state: {sentence}", sentence=sentence)
