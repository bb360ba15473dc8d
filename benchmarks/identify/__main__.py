"""Identifications of simulated samples: `python benchmarks/identify`.

Simulates samples by the tmm package with everyday flaws (`specimens.py`), identifies each (`pl.identify`)
with the substrate that is stated, which in some cases is wrong, and compares the answer with the truth:
confident errors, right answers, undecided ones that list the truth, layers that are not there.
`--only decisions` checks which further measurement `pl.plan_measurement` expects to decide between rivals,
by simulating and fitting it. `--real` identifies measurements and files of other programs (`real.py`).
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

# small matrices: several threads of BLAS wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import decisions
import nested
import numpy as np
import real
from scoring import (
    Answer,
    best_film,
    described,
    failures,
    films,
    goals,
    reason,
    reasons,
    reliability,
    score,
    table,
    truth_of,
    write_csv,
)
from specimens import Specimen, clean, measured
from suite import HELD_OUT, SEED, Case, cases

import pellicle as pl
from pellicle.cli.session import start

NOISE_LIKE = 1.3
"""Ratio of the remaining residuals to the noise up to which nothing in the data contradicts an answer."""


def data_of(case: Case, seed: int) -> pl.Spectrum:
    """The measurement of a case; one against a mirror that was not divided out is relative to that."""
    data = measured(case.specimen, case.view, case.random(seed))
    if not case.reference:
        return data
    mirror = clean(Specimen((), case.reference), replace(case.view, noise=0.0))
    return replace(data, values=data.values / mirror)


def answer(case: Case, seed: int) -> Answer:
    """Identify the sample of a case."""
    data = data_of(case, seed)
    about: dict[str, Any] = {"back": case.back} if case.back else {}
    began = time.perf_counter()
    try:
        found = pl.identify(data, case.stated, **about)
    except ValueError as error:
        found, verdict, status, outcome, layers = None, str(error), "error", "silent", False
    else:
        verdict, status = found.verdict, str(found.status)
        outcome, layers = score(case, found)
    seconds = time.perf_counter() - began
    sure = best_film(case, found) if found is not None and found.hypotheses else (np.nan, False)
    close = found is not None and bool(found.hypotheses) and found.hypotheses[0].remaining < NOISE_LIKE
    return Answer(
        *(case.name, case.group, status, outcome, layers, len(films(case)), close, truth_of(case)),
        answer="" if found is None else described(found),
        verdict=verdict,
        seconds=seconds,
        gain=nested.gain(case, data) if case.group == "there" else np.nan,
        probability=sure[0],
        best_right=sure[1],
        reason="" if found is None else reason(case, found, outcome),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="+", default=[], help="groups, or parts of names, or decisions")
    parser.add_argument("--every", type=int, default=1, help="only every so-many-th case")
    parser.add_argument("--seed", type=int, default=SEED, help=f"master seed ({SEED}; held out: {HELD_OUT})")
    parser.add_argument("--real", action="store_true", help="files of measurements and of other programs")
    parser.add_argument("--out", type=Path, help="CSV file of the answers")
    asked = parser.parse_args()
    start()
    if asked.real:
        real.report()
        return
    if asked.only == ["decisions"]:
        decisions.report(asked.seed, asked.every)
        return
    chosen = [x for x in cases(asked.seed) if not asked.only or any(word in x.name for word in asked.only)]
    answers: list[Answer] = []
    for case in chosen[:: asked.every]:
        one = answer(case, asked.seed)
        answers.append(one)
        print(f"{one.seconds:6.1f} s  {one.outcome:7} {one.status:10} {one.name}", flush=True)
        if one.outcome != "right":
            print(f"      truth {one.truth}\n      answer {one.answer}", flush=True)
        if asked.out is not None:
            write_csv(answers, asked.out)
    if answers:
        print("\n" + table(answers) + "\n\n" + "\n".join(goals(answers)) + "\n\n" + failures(answers))
        print("\n" + reasons(answers) + "\n\n" + reliability(answers))
        print(f"median {np.median([x.seconds for x in answers]):.1f} s")


if __name__ == "__main__":
    main()
