"""`tankcal dcc`: a page that shows a digital calibration certificate."""

import hashlib
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message, printable
from tankcal.terminal import add_language, language_of_run, speak


def add(commands):
    """Add the parser of `tankcal dcc`."""
    parser = commands.add_parser(
        "dcc",
        help="show a digital calibration certificate (DCC) as a page",
        description="Write the content of a digital calibration certificate (XML) of any "
        "laboratory as a page: administrative data, results, tables. The page uses no network. "
        "Neither the schema nor a signature is checked. See docs/certificate-digital.md.",
        epilog="exit status: 0 done; 2 the file cannot be read as a certificate (no file is "
        "written).",
    )
    parser.add_argument("certificate", metavar="CERTIFICATE.xml", help="digital certificate")
    parser.add_argument("--out", metavar="FILE", help="output file (default: CERTIFICATE.html)")
    add_language(parser)
    parser.set_defaults(command=_show)


def _show(options):
    speak(options.language)
    from tankcal.report.dcc.viewer import certificate_blocks, read_certificate
    from tankcal.report.folders import replace_file
    from tankcal.report.plain import PlainPaper
    from tankcal.report.web import page
    from tankcal.text.words import load_words

    source = Path(options.certificate)
    out = Path(options.out or f"{source.stem}.html")
    if out.suffix.lower() != ".html":
        expected = message("dcc_out", "expected the name of an .html file")
        raise InputError(Problem("--out", expected))
    root = read_certificate(source)
    digest = hashlib.sha256(source.read_bytes()).hexdigest()
    language = language_of_run()
    paper = PlainPaper(load_words(language))
    shown = [block.data for block in certificate_blocks(root, paper, language, digest)]
    with replace_file(out) as temporary:
        temporary.write_text(page(shown), encoding="utf-8")
    print(f"  {printable(out)}")
    return 0
