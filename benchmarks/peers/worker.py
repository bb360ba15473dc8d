"""Run one package on the cases given on stdin as JSON, and write one line of JSON for each.

Started by `__main__.py` with the Python of the packages' environment; needs nothing else of this repository.
"""

from __future__ import annotations

import importlib
import json
import sys
import warnings


def answer(adapter, case: dict) -> dict:
    """Return values and slopes of one case, or the reason for their absence, and the package's warnings."""
    found: dict = {}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for kind in ("values", "slopes"):
            function = getattr(adapter, kind, None)
            if function is None:
                continue
            try:
                found[kind] = {s: [float(x) for x in row] for s, row in function(case).items()}
            except Exception as problem:  # any error is the package's answer
                found[kind] = " ".join(f"{type(problem).__name__}: {problem}".split())
    found["warnings"] = sorted({" ".join(str(w.message).split()) for w in caught})
    return found


def main(name: str) -> None:
    out, sys.stdout = sys.stdout, sys.stderr  # some packages print
    cases = json.load(sys.stdin)
    try:
        adapter = importlib.import_module(f"adapters.{name}")
    except Exception as problem:
        print(json.dumps({"unusable": f"{type(problem).__name__}: {problem}"}), file=out)
        return
    for case_name, case in cases.items():
        print(json.dumps({"case": case_name} | answer(adapter, case)), file=out, flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
