"""The structure of a digital calibration certificate: schema 3.3.0 of PTB with D-SI 2.2.

The schemas themselves are under the LGPL and not shipped (nor does PyDCC ship them). What
stands here is what their public text says of the elements that tankcal writes: which children an
element has, in which order, how often, and what a value looks like, in a notation of our own, of
which `schema` makes an XML schema. Elements of theirs that tankcal never writes are left out, so
that a document which is valid here is valid there; what they let be more is refused here.

    type: child=type child=type? (one=type | other=type)+ [attribute!=type attribute=type]

The true schemas take its place where TANKCAL_DCC_XSD names their dcc.xsd.
"""

import os
import re

import xmlschema

DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
NUMBER = r"[-+]?((\d*\.\d+)|(\d+\.\d*)|(\d+\.?))([Ee][-+]?\d+)?|NaN"
NOT_NEGATIVE = r"\+?((\d*\.\d+)|(\d+\.\d*)|(\d+\.?))([Ee][-+]?\d+)?|NaN"
SIMPLE = {  # name: (XML type that it restricts, pattern)
    "dcc:text1": ("string", r"[^\s]+(\s+[^\s]+)*"),
    "dcc:version": ("string", r"3\.3\.0"),
    "dcc:country": ("string", "[A-Z]{2}"),
    "dcc:language": ("string", "[a-z]{2}"),
    "dcc:place": ("string", "laboratory|customer|laboratoryBranch|customerBranch|other"),
    "dcc:change": ("string", "amended|substituted"),
    "dcc:issuer": ("string", "manufacturer|calibrationLaboratory|customer|owner|other"),
    "dcc:kind": ("string", "application|bios|driver|editor|firmware|library|os|other"),
    "dcc:verdict": ("string", "pass|fail|conditionalPass|conditionalFail|noPass|noFail"),
    "dcc:types": ("string", r"[^\s]+( [^\s]+)*"),
    "si:number": ("double", NUMBER),
    "si:uncertainty": ("double", NOT_NEGATIVE),
    "si:k": ("double", r"\+?(([1-9]\d*\.\d*)|([1-9]\d*))|NaN"),
    "si:probability": ("double", r"\+?((0(\.\d*)?)|(1(\.0*)?))|NaN"),
}
LISTS = {"dcc:strings": "xs:string", "si:units": "xs:string"}
LISTS |= {f"si:{name}s": f"si:{name}" for name in ("number", "uncertainty", "k", "probability")}
DCC_TYPES = """
certificate: administrativeData=administrative measurementResults=measured
  [schemaVersion!=version]
administrative: dccSoftware=softwares refTypeDefinitions=definitions? coreData=core items=items
  calibrationLaboratory=laboratory respPersons=persons customer=contact statements=statements?
softwares: software=software+
software: name=text release=text1 type=kind? description=rich?
definitions: refTypeDefinition=definition+
definition: name=text description=rich? namespace=text1 link=xs:anyURI release=text1?
core: countryCodeISO3166_1=country usedLangCodeISO639_1=language+
  mandatoryLangCodeISO639_1=language+ uniqueIdentifier=text1 identifications=identifications?
  receiptDate=xs:date? beginPerformanceDate=xs:date endPerformanceDate=xs:date
  performanceLocation=place issueDate=xs:date? reportAmendedSubstituted=substituted?
substituted: typeOfChange=change replacedUniqueIdentifier=text1
identifications: identification=identification+
identification: issuer=issuer value=text1 name=text? [refType=types]
items: item=item+
item: name=text description=rich? owner=contact? manufacturer=person? model=text1?
  identifications=identifications itemQuantities=itemQuantities?
itemQuantities: itemQuantity=primitive+
primitive: name=text? description=rich? si:real=si:real [refType=types]
laboratory: calibrationLaboratoryCode=text1? contact=contact
persons: respPerson=responsible+
responsible: person=person description=rich? role=text1? mainSigner=xs:boolean?
contact: name=text eMail=text1? phone=text1? location=location
person: name=text eMail=text1? phone=text1? location=location?
location: (city=text1 | countryCode=country | street=text1 | further=rich)+
statements: statement=statement+
statement: name=text? description=rich? convention=text1? traceable=xs:boolean? norm=text1*
  reference=text1* link=xs:anyURI* declaration=rich? valid=xs:boolean? date=xs:date?
  conformity=verdict? data=data? [refType=types]
measured: measurementResult=result+
result: name=text description=rich? usedMethods=methods? usedSoftware=softwares?
  measuringEquipments=equipments? influenceConditions=conditions? results=found
  measurementMetaData=metaDatas? [refType=types]
methods: usedMethod=method+
method: name=text description=rich? norm=text1* reference=text1* link=xs:anyURI* [refType=types]
equipments: name=text? description=rich? measuringEquipment=equipment+
equipment: name=text description=rich? model=text1? identifications=identifications?
  [refType=types]
conditions: influenceCondition=condition+
condition: name=text description=rich? data=data [refType=types]
found: result=one+
one: name=text description=rich? data=data [refType=types]
data: (text=rich | quantity=quantity | list=list)+
quantity: name=text? description=rich? (charsXMLList=strings | si:real=si:real |
  si:realListXMLList=si:realList) [refType=types]
list: name=text? description=rich? (list=list | quantity=quantity)+ [refType=types]
metaDatas: metaData=statement+
text: content=content+
rich: name=text? content=content+
"""
SI_TYPES = """
real: label=xs:string? value=number unit=xs:string measurementUncertaintyUnivariate=mu?
mu: (standardMU=standard | expandedMU=expanded | coverageIntervalMU=interval)
standard: valueStandardMU=uncertainty distribution=xs:string?
expanded: valueExpandedMU=uncertainty coverageFactor=k coverageProbability=probability
  distribution=xs:string?
interval: valueStandardMU=uncertainty intervalMin=number intervalMax=number
  coverageProbability=probability distribution=xs:string?
realList: valueXMLList=numbers unitXMLList=units measurementUncertaintyUnivariateXMLList=mus?
mus: (standardMUXMLList=standards | expandedMUXMLList=expandeds |
  coverageIntervalMUXMLList=intervals)
standards: valueStandardMUXMLList=uncertaintys
expandeds: valueExpandedMUXMLList=uncertaintys coverageFactorXMLList=ks
  coverageProbabilityXMLList=probabilitys
intervals: valueStandardMUXMLList=uncertaintys intervalMinXMLList=numbers
  intervalMaxXMLList=numbers coverageProbabilityXMLList=probabilitys
"""
_TIMES = {"": "", "?": ' minOccurs="0"', "*": ' minOccurs="0" maxOccurs="unbounded"',
          "+": ' maxOccurs="unbounded"'}  # fmt: skip
_CONTENT = """<xs:complexType name="content"><xs:simpleContent><xs:extension base="xs:string">
<xs:attribute name="lang" type="dcc:language"/></xs:extension></xs:simpleContent></xs:complexType>
<xs:element name="digitalCalibrationCertificate" type="dcc:certificate"/>"""
_ROOTS = """<xs:element name="real" type="si:real"/>
<xs:element name="realListXMLList" type="si:realList"/>"""


def schema():
    """The schema: the true one where TANKCAL_DCC_XSD names it, else that of this module."""
    true = os.environ.get("TANKCAL_DCC_XSD")
    if true:
        return xmlschema.XMLSchema(true)
    si = _schema("si", SI, SI_TYPES, _ROOTS)
    return xmlschema.XMLSchema([_schema("dcc", DCC, DCC_TYPES, _CONTENT), si])


def _schema(prefix, space, types, more):
    """The text of a schema of one namespace."""
    made = [more]
    for line in re.sub(r"\n +", " ", types).strip().splitlines():
        name, content = line.split(": ", 1)
        made.append(_complex(prefix, name, content))
    for name, (base, pattern) in SIMPLE.items():
        if name.startswith(f"{prefix}:"):
            made.append(
                f'<xs:simpleType name="{name.split(":")[1]}"><xs:restriction base="xs:{base}">'
                f'<xs:pattern value="{pattern}"/></xs:restriction></xs:simpleType>'
            )
    made += [
        f'<xs:simpleType name="{name.split(":")[1]}"><xs:list itemType="{of}"/></xs:simpleType>'
        for name, of in LISTS.items()
        if name.startswith(f"{prefix}:")
    ]
    imports = f'<xs:import namespace="{SI}"/>' if prefix == "dcc" else ""
    return (
        f'<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" xmlns:dcc="{DCC}" '
        f'xmlns:si="{SI}" targetNamespace="{space}" elementFormDefault="qualified">'
        f"{imports}{''.join(made)}</xs:schema>"
    )


def _complex(prefix, name, content):
    body, _, attributes = content.partition(" [")
    made = re.sub(r"([\w:]+)=([\w:]+)([?*+]?)", lambda m: _element(prefix, *m.groups()), body)
    made = re.sub(
        r"\(([^()]*)\)([?*+]?)",
        lambda m: f"<xs:choice{_TIMES[m[2]]}>{m[1].replace('|', '')}</xs:choice>",
        made,
    )
    for one in attributes.removesuffix("]").split():
        key, of = one.split("=")
        use = ' use="required"' if key.endswith("!") else ""
        made_attribute = f'<xs:attribute name="{key.strip("!")}" type="{prefix}:{of}"{use}/>'
        attributes = attributes.replace(one, made_attribute)
    sequence = f"<xs:sequence>{made}</xs:sequence>{attributes.removesuffix(']')}"
    return f'<xs:complexType name="{name}">{sequence}</xs:complexType>'


def _element(prefix, name, of, times):
    """An element declared; one of the other namespace is referred to."""
    if name.startswith("si:"):
        return f'<xs:element ref="{name}"{_TIMES[times]}/>'
    of = of if ":" in of else f"{prefix}:{of}"
    return f'<xs:element name="{name}" type="{of}"{_TIMES[times]}/>'
