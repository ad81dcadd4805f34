"""Process that computes a job for the app: progress as lines of JSON on the standard output.

python -m tankcal.products.app.worker JOB OUT DOCUMENTS

A line is {"text": {language: step}, "share": 0 to 1 or null}, {"done": [files]} or
{"error": {language: [lines]}}. The app stops the computation by ending the process; results that
were not complete are removed by the next run.
"""

import json
import sys
from pathlib import Path

from tankcal.errors import TankcalError, reason_of
from tankcal.products.desk.computing import Run
from tankcal.terminal import prepare_for_small_work
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words, say


def main(arguments):
    """Compute a job; arguments: its path, the folder of the results, "documents" or ""."""
    source, out, documents = arguments
    words = {language: load_words(language) for language in LANGUAGES}

    def translate(text):
        """Text in each language."""
        return {language: say(known, text) for language, known in words.items()}

    def write(**content):
        """Write a line."""
        print(json.dumps(content), flush=True)

    prepare_for_small_work()
    run = Run(
        Path(source),
        Path(out),
        lambda text, share: write(text=translate(text), share=share),
        documents == "documents",
    )
    try:
        run.wait()
    except TankcalError as error:
        lines = [translate(text) for text in error.texts]
        write(error={language: [line[language] for line in lines] for language in LANGUAGES})
        return error.exit_status
    except OSError as error:
        reason = translate(reason_of(error))
        write(error={language: [text] for language, text in reason.items()})
        return 2
    write(done=[path.name for path in run.files])
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
