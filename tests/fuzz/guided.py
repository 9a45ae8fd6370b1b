"""Mutated inputs that are led by what they reach: ``python -m tests.fuzz.guided [-runs=N] [FOLDER]``, with atheris.

Atheris has no wheels for many interpreters, so that nothing here needs it; ``pip install atheris`` where it does.
"""

import sys
import tempfile
from pathlib import Path
from random import Random

import atheris

with atheris.instrument_imports(include=["ephs.operad", "ephs.mechanics.scene", "ephs.mechanics.imports"]):
    from tests.fuzz.judging import Judge
    from tests.fuzz.mutations import KINDS, mutated, mutated_again
    from tests.fuzz.seeds import seeds

TEXTS = seeds()
ENDINGS = sorted(KINDS)


def main() -> None:
    """Run until the first defect, or for as many inputs as libFuzzer is told; a text's first letter is its kind."""
    judge = Judge(Path(tempfile.mkdtemp(prefix="ephs-fuzz-")))

    def look(data: bytes) -> None:
        verdict = judge(ENDINGS[data[0] % len(ENDINGS)], data[1:]) if data else None
        if verdict is not None and verdict.outcome == "defect":
            raise RuntimeError(f"{verdict.signature}\n{verdict.detail}")

    def mutate(data: bytes, most: int, seed: int) -> bytes:
        if not data or seed % 4 == 0:
            kind, found = mutated("guided", seed, TEXTS)
        else:
            kind = ENDINGS[data[0] % len(ENDINGS)]
            found = mutated_again(kind, data[1:], TEXTS, Random(seed))
        return (bytes([ENDINGS.index(kind)]) + found)[:most]

    atheris.Setup([sys.argv[0], "-max_len=20000", "-timeout=20", *sys.argv[1:]], look, custom_mutator=mutate)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
