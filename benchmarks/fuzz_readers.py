"""Damaged and random files given to every reader: each is read, or refused in one sentence.

The corpus is every sample in the tests of readers, and the files of measurements/ and docs/examples/.
Hypothesis damages them: bytes, lines, cells, encodings, halves of two files. A full run takes 10000 inputs.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import importlib.util
import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import hypothesis
import hypothesis.strategies as st

from pellicle.data.read_brdf import read_brdf_samples
from pellicle.data.read_counts import read_counts
from pellicle.data.read_spectrum import read_spectra
from pellicle.errors import DataError, UsageError
from pellicle.materials import material
from pellicle.recipes.read import read_recipe

ROOT = Path(__file__).resolve().parents[1]
SECONDS = 20
"""An input that takes longer hangs."""
MEMORY = 2 * 2**30
"""Bytes that may be taken beyond those of the start."""

LARGEST_SAMPLE = 40_000  # bytes; longer files take long and show nothing new
TOKENS = (
    *(b"", b"nan", b"inf", b"-1", b"0", b"1e999", b"1e-999", b"9" * 400, b'"', b"#", b";", b"\t", b","),
    *(b"\x00", b"\xff\xfe", b"R", b"%T", b"A", b"psi", b"nm", b"cm-1", b"1,5", b"#DATA", b"##END=", b"["),
)


def samples_of_tests() -> Iterator[bytes]:
    """Texts of several lines, and bytes, that are constants of the tests of readers."""
    for path in sorted(
        [*ROOT.glob("tests/data/formats/test_*.py"), *ROOT.glob("tests/materials/test_*files.py")]
    ):
        spec = importlib.util.spec_from_file_location(path.stem, path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        with contextlib.suppress(BaseException):  # pytest.importorskip raises what is no Exception
            spec.loader.exec_module(module)
        for value in vars(module).values():
            for item in value.values() if isinstance(value, dict) else (value,):
                if isinstance(item, str) and item.count("\n") > 2:
                    yield item.encode()
                elif isinstance(item, bytes) and len(item) > 20:
                    yield item


def corpus() -> list[bytes]:
    """Every sample, without repetition."""
    files = [
        *ROOT.glob("measurements/**/*"),
        *ROOT.glob("docs/examples/*"),
        *ROOT.glob("docs/surfaces/*.toml"),
        *ROOT.glob("tests/data/formats/samples/*/*"),
    ]
    content = [path.read_bytes() for path in sorted(files) if path.is_file()]
    found = dict.fromkeys([*samples_of_tests(), *content])
    return [sample for sample in found if len(sample) <= LARGEST_SAMPLE]


def _lines(content: bytes, numbers: list[int], change: Callable[[list[bytes], list[int]], None]) -> bytes:
    lines = content.split(b"\n")
    change(lines, [number % len(lines) for number in numbers])
    return b"\n".join(lines)


def _swap(lines: list[bytes], at: list[int]) -> None:
    lines[at[0]], lines[at[1]] = lines[at[1]], lines[at[0]]


def _repeat(lines: list[bytes], at: list[int]) -> None:
    lines[at[0] : at[0]] = lines[at[1] : at[1] + 3]


def _delete(lines: list[bytes], at: list[int]) -> None:
    del lines[at[0] : at[0] + 1 + at[1] % 3]


def _cell(content: bytes, numbers: list[int], token: bytes) -> bytes:
    """Replace one cell of one line."""

    def change(lines: list[bytes], at: list[int]) -> None:
        separator = next((s for s in (b"\t", b";", b",", b"=", b" ") if s in lines[at[0]]), b" ")
        cells = lines[at[0]].split(separator)
        cells[at[1] % len(cells)] = token
        lines[at[0]] = separator.join(cells)

    return _lines(content, numbers, change)


def damaged(samples: list[bytes]) -> st.SearchStrategy[bytes]:
    """Samples with one to four changes."""
    number, token = st.integers(0, 10**6), st.sampled_from(TOKENS) | st.binary(max_size=6)
    changes: list[st.SearchStrategy[Callable[[bytes], bytes]]] = [
        st.builds(lambda a, t: lambda c: c[: a % (len(c) + 1)] + t + c[a % (len(c) + 1) :], number, token),
        st.builds(
            lambda a, n: lambda c: c[: a % (len(c) + 1)] + c[a % (len(c) + 1) + n % 50 :], number, number
        ),
        st.builds(lambda a: lambda c: c[: a % (len(c) + 1)], number),
        st.builds(lambda a: lambda c: c[a % (len(c) + 1) :], number),
        st.builds(lambda a, b: lambda c: _lines(c, [a, b], _swap), number, number),
        st.builds(lambda a, b: lambda c: _lines(c, [a, b], _repeat), number, number),
        st.builds(lambda a, b: lambda c: _lines(c, [a, b], _delete), number, number),
        st.builds(lambda a, b, t: lambda c: _cell(c, [a, b], t), number, number, token),
        st.builds(
            lambda s, a: lambda c: c[: a % (len(c) + 1)] + s[a % (len(s) + 1) :],
            st.sampled_from(samples),
            number,
        ),
        st.sampled_from(
            [
                lambda c: c.replace(b"\n", b"\r\n"),
                lambda c: c.replace(b".", b","),
                lambda c: c.replace(b",", b";"),
                lambda c: c.decode("latin-1").encode("utf-16"),
                lambda c: c.decode("latin-1").encode("utf-16-le"),
                lambda c: b"\xef\xbb\xbf" + c,
                lambda c: c[::-1],
            ]
        ),
    ]

    def apply(sample: bytes, each: list[Callable[[bytes], bytes]]) -> bytes:
        for change in each:
            sample = change(sample)
        return sample

    return st.builds(apply, st.sampled_from(samples), st.lists(st.one_of(changes), min_size=1, max_size=4))


WORDS = st.fixed_dictionaries(
    {},
    optional={
        "signal": st.sampled_from(["R", "T", "psi-delta"]),
        "wavelength_unit": st.sampled_from(["nm", "cm-1", "eV"]),
        "signal_unit": st.sampled_from(["percent", "fraction", "absorbance"]),
        "spectrum": st.sampled_from(["all", "R", "1"]),
        "analyser": st.just(45.0),
    },
)


def readers(path: Path, words: dict[str, object]) -> dict[str, Callable[[], object]]:
    """Every reader, as a function without arguments."""
    return {
        "read_spectra": lambda: read_spectra(path, **words),
        "read_counts": lambda: read_counts(path),
        "read_brdf_samples": lambda: read_brdf_samples(path),
        "material": lambda: material(str(path)),
        "read_recipe": lambda: read_recipe(path),
    }


@contextlib.contextmanager
def limits() -> Iterator[None]:
    """Bound the memory of the process, and restore it."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    old = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY, old[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, old)


def _too_long(*_: object) -> None:
    raise TimeoutError(f"no answer in {SECONDS} s")


def run(inputs: int, folder: Path) -> tuple[collections.Counter[str], list[str]]:
    """Give this many inputs to the readers; returns the outcomes, and the failures with their tracebacks."""
    outcomes: collections.Counter[str] = collections.Counter()
    failures: list[str] = []
    path, suffixes = folder / "input", (".csv", ".toml", ".mat", ".SEsnap")
    samples = corpus()
    content = st.one_of(st.binary(max_size=300), damaged(samples), damaged(samples), damaged(samples))
    settings = hypothesis.settings(
        max_examples=inputs,
        deadline=None,
        database=None,
        derandomize=True,
        phases=[hypothesis.Phase.generate],
        suppress_health_check=list(hypothesis.HealthCheck),
    )

    @settings
    @hypothesis.given(content, WORDS, st.sampled_from(suffixes))
    def give(content: bytes, words: dict[str, object], suffix: str) -> None:
        file = path.with_suffix(suffix)
        file.write_bytes(content)
        for name, read in readers(file, words).items():
            signal.setitimer(signal.ITIMER_REAL, SECONDS)
            try:
                read()
                outcomes[f"{name}: read"] += 1
            except (DataError, UsageError) as error:
                sentence = "\n" not in str(error) and str(error).strip()
                outcomes[f"{name}: refused"] += 1
                if not sentence:
                    failures.append(f"{name} {words} {suffix}: no sentence: {error!r}\n{content!r}")
            except Exception:  # what a user would see as a traceback
                outcomes[f"{name}: failed"] += 1
                failures.append(f"{name} {words} {suffix}: {traceback.format_exc()}\n{content[:2000]!r}")
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0)
        outcomes["inputs"] += 1

    before = signal.signal(signal.SIGALRM, _too_long)
    try:
        with limits(), warnings.catch_warnings():
            warnings.simplefilter("error")  # a user would see them
            give()
    finally:
        signal.signal(signal.SIGALRM, before)
    return outcomes, failures


def main() -> int:
    """Print the outcomes; exit with 1 if an input fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=10_000)
    with tempfile.TemporaryDirectory() as folder:
        outcomes, failures = run(parser.parse_args().inputs, Path(folder))
    for name, count in sorted(outcomes.items()):
        print(f"{name:28} {count}")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory {peak:.0f} MiB; {len(failures)} failures")
    for failure in failures[:20]:
        print("\n" + failure)
    return min(len(failures), 1)


if __name__ == "__main__":
    sys.exit(main())
