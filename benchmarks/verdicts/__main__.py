"""Verdicts on flawed measurements: `python benchmarks/verdicts`.

Simulates measurements of films by an independent model (`transfer_matrix.py`), clean ones and ones with the
everyday flaws of instruments and samples (`flaws.py`), of scenes that are not those fitted
(`wrong_scenes.py`) and of samples that no data of the kind determine (`undecidable.py`); fits each with the
recipe of its family, and compares the verdict with the truth. Prints a table of outcomes, the figures
required of them and every verdict that should have been another one.

A flaw that leaves no misfit above the noise once the free numbers have adapted to it is "budget-only":
residuals cannot show it, only an uncertainty budget can.
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import absorbers
import comparisons
import single_colours
import surfaces
from causes import score
from scoring import Answer, changes, failures, goals, read_csv, table, write_csv
from suite import SEED, Case, Measured, cases, measured, short

import pellicle as pl
from pellicle.cli.session import start

OTHER_KINDS: dict[str, Callable[[int], Iterator[tuple[str, Any, Any, float, bool, str]]]] = {
    "brdf": surfaces.cases,
    "colour": single_colours.cases,
}
"""Cases of data that are no spectra, by the name that `--only` asks for: kind, data, scene, truth, whether σ
is given, and what is true."""


def fitted(data: Any, scene: Any, **about: Any) -> Answer:
    """Fit a scene to data; `about` are the fields of the answer that describe the case."""
    began = time.perf_counter()
    value = stderr = noise = chi2 = rms = math.nan
    warnings = ""
    try:
        fit = pl.fit(data, scene)
    except ValueError as error:  # DataError and UsageError too: data that pellicle refuses to fit
        status, verdict = "error", str(error)
    else:
        found = next(p for p in fit.free if p.name.endswith("thickness"))
        value, stderr = found.value, found.stderr
        noise = getattr(found, "stderr_noise", None) or stderr
        status, verdict, warnings = str(fit.status), fit.verdict, " / ".join(fit.warnings)
        chi2, rms = fit.chi2_reduced, math.nan if fit.rms is None else fit.rms
    return Answer(
        value=value,
        stderr=stderr,
        stderr_noise=noise,
        status=status,
        chi2_reduced=chi2,
        rms=rms,
        seconds=time.perf_counter() - began,
        verdict=verdict,
        warnings=warnings,
        **about,
    )


def answer(m: Measured) -> Answer:
    """Fit the recipe of a case to its measurement."""
    case = m.case
    return fitted(
        m.data,
        case.family.scene(),
        name=case.name,
        group=m.group,
        family=case.family.name,
        kind=case.kind,
        sigma_given=case.sigma_given,
        truth=m.truth,
        bound=m.bound,
        evidence=m.evidence,
        detail=m.detail,
    )


def other_answers(only: Sequence[str], seed: int) -> Iterator[Answer]:
    """Answers of the kinds that are no spectra, where they are asked for by name."""
    for name in only:
        if name in OTHER_KINDS:
            numbers: Counter[str] = Counter()
            for kind, data, scene, truth, given, detail in OTHER_KINDS[name](seed):
                numbers[kind] += 1
                about = {"group": name, "family": name, "kind": kind, "sigma_given": given, "truth": truth}
                case = f"{name} | {kind} {numbers[kind]} | {'sigma' if given else 'no sigma'}"
                measures = {"bound": math.nan, "evidence": math.nan}
                yield fitted(data, scene, name=case, detail=detail, **about, **measures)


def chosen(only: Sequence[str], limit: int | None, brief: bool) -> list[Case]:
    """Cases whose group, family or kind is among `only`, all without; the first `limit` of them."""
    if only and set(only) <= OTHER_KINDS.keys():
        return []
    every = short(cases()) if brief else cases()
    kept = [c for c in every if not only or {c.group, c.family.name, c.kind, c.name} & set(only)]
    if not kept:
        raise SystemExit(f"no case has a group, family, kind or name among: {', '.join(only)}")
    return kept[:limit]


def write_case(m: Measured, folder: Path) -> None:
    """Write the data and the recipe of a case, for `pellicle fit DATA --recipe RECIPE`."""
    folder.mkdir(parents=True, exist_ok=True)
    stem = "".join(x if x.isalnum() else "_" for x in m.case.name)
    data, family = m.data, m.case.family
    columns = {"wavelength_nm": data.wavelength}
    if data.delta is None:
        columns["intensity" if family.counts else data.signal] = data.values
        columns |= {} if data.sigma is None else {"sigma": data.sigma}
    else:
        columns |= {"angle": data.angle, "psi": data.values, "delta": data.delta}
        columns |= {} if data.sigma is None else {"sigma_psi": data.sigma, "sigma_delta": data.delta_sigma}
    rows = zip(*columns.values(), strict=True)
    text = "\n".join([",".join(columns), *(",".join(f"{x:.8g}" for x in row) for row in rows)])
    (folder / f"{stem}.csv").write_text(text + "\n", encoding="utf-8")
    (folder / f"{stem}.toml").write_text(f"# {m.detail}\n{family.recipe}", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--only",
        nargs="+",
        default=[],
        help=f"groups, families, kinds or names of cases; {', '.join(OTHER_KINDS)}, absorbers, comparisons",
    )
    parser.add_argument("--limit", type=int, help="only the first cases")
    parser.add_argument("--short", action="store_true", help="about 24 cases of all groups")
    parser.add_argument("--seed", type=int, default=SEED, help=f"master seed ({SEED})")
    parser.add_argument("--out", type=Path, help="CSV file of the answers")
    parser.add_argument("--compare", type=Path, help="CSV file of an earlier run: which outcomes changed")
    parser.add_argument("--write-cases", type=Path, help="folder for data and recipes; nothing is fitted")
    asked = parser.parse_args()
    start()
    if asked.only == ["absorbers"]:
        absorbers.report(asked.seed, asked.limit)
        return
    if asked.only == ["comparisons"]:
        comparisons.report(asked.seed)
        return
    answers: list[Answer] = []

    def add(one: Answer) -> None:
        answers.append(one)
        print(f"{one.seconds:6.2f} s  {one.group:11}  {one.outcome:13}  {one.name}", flush=True)
        if asked.out is not None and len(answers) % 20 == 0:
            write_csv(answers, asked.out)

    for one in other_answers(asked.only, asked.seed):
        add(one)
    for case in chosen(asked.only, asked.limit, asked.short):
        m = measured(case, asked.seed)
        if asked.write_cases is not None:
            write_case(m, asked.write_cases)
            continue
        add(answer(m))
    if not answers:
        return
    print("\n" + table(answers) + "\n\n" + "\n".join(goals(answers)))
    print(failures(answers))
    print("\n" + score(answers))
    if asked.out is not None:
        write_csv(answers, asked.out)
    if asked.compare is not None:
        print("\n" + changes(answers, read_csv(asked.compare)))


if __name__ == "__main__":
    main()
