"""Numbers and languages on the command line."""

import argparse

from tankcal.cli.showing import say_in_language
from tankcal.messages import message
from tankcal.text.languages import LANGUAGES
from tankcal.text.numerals import NUMBER, WHOLE_NUMBER

MOST_WORKERS = 256  # on one machine
LEAST_WORKER_GB = 0.5


def add_language(parser):
    """--language, of what a command without a job prints."""
    parser.add_argument(
        "--language",
        metavar="CODE",
        choices=LANGUAGES,
        help=f"language of all output: {', '.join(LANGUAGES)} (default: language of the input, "
        "else of the environment)",
    )


def positive(text):
    value = _number(text)
    if not 0 < value < float("inf"):
        raise refuse_argument(
            message("option_above_0", "found {text!r}; expected a number above 0", text=text)
        )
    return value


def yield_mpa(text):
    from tankcal.job.plausibility import MOST_YIELD_MPA

    value = positive(text)
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


def share(text):
    value = _number(text)
    if not 0 < value < 1:
        raise refuse_argument(
            message("option_share", "found {text!r}; expected a number between 0 and 1", text=text)
        )
    return value


def parse_list(text):
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
    if not WHOLE_NUMBER.fullmatch(text):
        raise refuse_argument(
            message("option_whole", "found {text!r}; expected a whole number", text=text)
        )
    return int(text)


def parse_workers(text):
    """Number of workers on this machine."""
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
    """Gigabytes of memory of a worker."""
    value = positive(text)
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
    """Who reads clouds: "auto", "local", a number of workers, or the address of a scheduler."""
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
    """Dips in metres with commas between, not below 0."""
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
    """The error of an argument, in the language that is spoken."""
    return argparse.ArgumentTypeError(say_in_language(text))


def _number(text):
    """Its value; nan for what a table refuses, too, such as 1_000 or full-width digits."""
    return float(text) if NUMBER.fullmatch(text) else float("nan")
