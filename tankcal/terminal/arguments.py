"""Types of command-line arguments: numbers and languages."""

import argparse
import math

from tankcal.messages import message
from tankcal.terminal.showing import say_in_language
from tankcal.text.naming import NUMBER, WHOLE_NUMBER
from tankcal.text.shipped import LANGUAGES

MOST_WORKERS = 256  # on one machine
LEAST_WORKER_GB = 0.5


def add_language(parser):
    """Add the option --language of a command without a job."""
    parser.add_argument(
        "--language",
        metavar="CODE",
        choices=LANGUAGES,
        help=f"language of all output: {', '.join(LANGUAGES)} (default: language of the input, "
        "else of the environment)",
    )


def add_letterhead(parser):
    """Add the option --letterhead."""
    parser.add_argument(
        "--letterhead",
        metavar="FILE",
        help="TOML file with name, address, logo and colours of the laboratory (docs/report.md)",
    )


def read_letterhead(options):
    """Return the checked letterhead of the options, or None."""
    if options.letterhead is None:
        return None
    from tankcal.report.laboratory import load

    return load(options.letterhead)


def parse_number(text):
    """Return a finite number."""
    value = _number(text)
    if not math.isfinite(value):
        raise refuse_argument(
            message("option_number", "found {text!r}; expected a number", text=text)
        )
    return value


def parse_positive(text):
    """Return a positive number."""
    value = _number(text)
    if not 0 < value < float("inf"):
        raise refuse_argument(
            message("option_above_0", "found {text!r}; expected a number above 0", text=text)
        )
    return value


def parse_yield(text):
    """Return a yield strength in megapascals, at most MOST_YIELD_MPA."""
    from tankcal.job.plausibility import MOST_YIELD_MPA

    value = parse_positive(text)
    if value > MOST_YIELD_MPA:
        raise refuse_argument(
            message(
                "option_yield",
                "found {text!r}; expected at most {most} MPa (is it in another unit?)",
                text=text,
                most=MOST_YIELD_MPA,
            )
        )
    return value


def parse_share(text):
    """Return a number between 0 and 1."""
    value = _number(text)
    if not 0 < value < 1:
        raise refuse_argument(
            message("option_share", "found {text!r}; expected a number between 0 and 1", text=text)
        )
    return value


def parse_several(text):
    """Return a whole number from 2 to 1000000."""
    value = _number(text)
    if not (2 <= value <= 1e6 and value == int(value)):
        raise refuse_argument(
            message(
                "option_several",
                "found {text!r}; expected a whole number from 2 to 1000000",
                text=text,
            )
        )
    return int(value)


def parse_count(text):
    """Return a whole number."""
    if not WHOLE_NUMBER.fullmatch(text):
        raise refuse_argument(
            message("option_whole", "found {text!r}; expected a whole number", text=text)
        )
    return int(text)


def parse_workers(text):
    """Return a number of workers on this machine."""
    workers = parse_count(text)
    if workers > MOST_WORKERS:
        raise refuse_argument(
            message(
                "option_workers",
                "found {text!r}; expected at most {most} workers on one machine",
                text=text,
                most=MOST_WORKERS,
            )
        )
    return workers


def parse_worker_memory(text):
    """Return the memory of a worker in gigabytes."""
    value = parse_positive(text)
    if value < LEAST_WORKER_GB:
        raise refuse_argument(
            message(
                "option_worker_memory",
                "found {text!r}; expected at least {least} gigabytes; jobs with reports need 1",
                text=text,
                least=LEAST_WORKER_GB,
            )
        )
    return value


def parse_cluster(text):
    """Return the workers for clouds: "auto", "local", a number, or the address of a scheduler."""
    if WHOLE_NUMBER.fullmatch(text):
        return parse_workers(text)
    if text not in ("auto", "local") and ":" not in text:
        raise refuse_argument(
            message(
                "option_cluster",
                "found {text!r}; expected auto, local, a number of workers, or an address such as "
                "tcp://192.168.1.20:8786",
                text=text,
            )
        )
    return text


def parse_dips(text):
    """Return dips in metres, separated by commas, not negative."""
    values = [_number(part) for part in text.split(",")]
    if not all(0 <= value < float("inf") for value in values):
        raise refuse_argument(
            message(
                "option_dips",
                "found {text!r}; expected dips in metres such as 2.5,5,7.5",
                text=text,
            )
        )
    return values


def refuse_argument(text):
    """Return the error of an argument in the current language."""
    return argparse.ArgumentTypeError(say_in_language(text))


def _number(text):
    """Return a number; nan for forms that tables refuse, such as 1_000 or full-width digits."""
    return float(text) if NUMBER.fullmatch(text) else float("nan")
