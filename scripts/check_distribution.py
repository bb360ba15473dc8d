"""Build the sdist and the wheel into dist/ and check them.

    python scripts/check_distribution.py                     # build, metadata, lists of files
    python scripts/check_distribution.py python3.11 ...      # and an installation for each interpreter

The wheel is built from the sdist. It must have every file of `src/pellicle` and no other. For each
interpreter the wheel is installed into an empty environment in a temporary folder, where the commands of
`first_steps` run. An interpreter that does not start is left out, with a line that says so.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"
AROUND = {".gitignore", "CHANGELOG.md", "CITATION.cff", "LICENSE", "PKG-INFO", "README.md", "pyproject.toml"}
"""Files of the sdist beside `src`; `.gitignore` is added by hatchling."""
LARGEST_MB = 5.0


def build() -> tuple[Path, Path]:
    """Build both into an empty dist/; return the sdist and the wheel."""
    shutil.rmtree(DIST, ignore_errors=True)
    subprocess.run(
        [sys.executable, "-m", "build", "--outdir", DIST, ROOT], check=True, stdout=subprocess.DEVNULL
    )
    (sdist,), (wheel,) = DIST.glob("*.tar.gz"), DIST.glob("*.whl")
    subprocess.run([sys.executable, "-m", "twine", "check", "--strict", sdist, wheel], check=True)
    return sdist, wheel


def package_files(root: Path) -> set[str]:
    """Return the files of the package, relative to `root`: those of git, or in an unpacked archive all."""
    listed = subprocess.run(["git", "ls-files", "pellicle"], cwd=root, capture_output=True, text=True)
    if listed.returncode == 0 and listed.stdout:
        return set(listed.stdout.splitlines())
    files = (path for path in (root / "pellicle").rglob("*") if path.is_file())
    return {path.relative_to(root).as_posix() for path in files if path.suffix != ".pyc"}


def wheel_files(wheel: Path) -> set[str]:
    return {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}


def sdist_files(sdist: Path) -> set[str]:
    with tarfile.open(sdist) as archive:
        return {name.partition("/")[2] for name in archive.getnames()}


def differences(sdist: Path, wheel: Path) -> list[str]:
    """Return what is missing from the two files, or should not be there: a line for each."""
    package = package_files(ROOT / "src")
    lines = []
    for path, expected, found in (
        (wheel, package, wheel_files(wheel)),
        (sdist, AROUND | {f"src/{name}" for name in package}, sdist_files(sdist)),
    ):
        lines += [f"{path.name} lacks {name}" for name in sorted(expected - found)]
        lines += [f"{path.name} should not have {name}" for name in sorted(found - expected)]
        size = path.stat().st_size / 1e6
        print(f"{path.name}: {len(found)} files, {size:.2f} MB")
        if size > LARGEST_MB:
            lines.append(f"{path.name} has {size:.1f} MB; at most {LARGEST_MB:g} are expected")
    return lines


def release_differences(version: str, citation: str, changelog: str) -> list[str]:
    """Return what contradicts the version of a release; a development version contradicts nothing."""
    if not re.fullmatch(r"[\d.]+", version):
        return []
    lines = []
    if not re.search(rf"^version: {re.escape(version)}$", citation, re.MULTILINE):
        lines.append(f"CITATION.cff has another version than {version}")
    if not re.search(rf"^## {re.escape(version)} \(\d{{4}}-\d\d-\d\d\)$", changelog, re.MULTILINE):
        lines.append(f"CHANGELOG.md has no heading '## {version} (YYYY-MM-DD)'")
    return lines


def starts(interpreter: str) -> bool:
    try:
        return subprocess.run([interpreter, "--version"], capture_output=True).returncode == 0
    except OSError:
        return False


def first_steps(interpreter: str, wheel: Path) -> None:
    """Install the wheel into an empty environment, and import, demonstrate and fit outside of the clone."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        subprocess.run([interpreter, "-m", "venv", home / "venv"], check=True)
        scripts = home / "venv" / ("Scripts" if os.name == "nt" else "bin")
        python, pellicle = scripts / "python", scripts / "pellicle"
        clean = {
            key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))
        }
        environment = {**clean, "PELLICLE_CACHE": "off", "MPLBACKEND": "agg"}

        def run(*command: str | Path) -> None:
            subprocess.run(command, check=True, cwd=home, env=environment, stdout=subprocess.DEVNULL)

        run(python, "-m", "pip", "install", "--quiet", "--no-compile", wheel)
        run(python, "-m", "pip", "check")
        names = "import pellicle as pl; [getattr(pl, name) for name in pl.__all__]"
        run(python, "-W", "error", "-c", f"{names}; assert {str(home)!r} in pl.__file__, pl.__file__")
        run(pellicle, "--help")
        run(pellicle, "materials", "SiO2")
        run(pellicle, "demo")
        for name in ("hematite.toml", "hematite.csv", "colours.png", "result/result.json"):
            assert (home / "pellicle-demo" / name).is_file(), f"pellicle demo has not written {name}"
        flags = ["--layer", "Fe2O3", "--substrate", "BK7", "--thickness", "10:1000", "--json"]
        run(pellicle, "fit", "pellicle-demo/hematite.csv", *flags, "--noise", "0.004")


def main() -> None:
    sdist, wheel = build()
    version = wheel.name.split("-")[1]
    citation, changelog = ((ROOT / name).read_text("utf-8") for name in ("CITATION.cff", "CHANGELOG.md"))
    if lines := [*differences(sdist, wheel), *release_differences(version, citation, changelog)]:
        raise SystemExit("\n".join(lines))
    for interpreter in sys.argv[1:]:
        if starts(interpreter):
            first_steps(interpreter, wheel)
            print(f"{interpreter}: installed, imported, demonstrated and fitted")
        else:
            print(f"{interpreter}: not on this machine, left out")


if __name__ == "__main__":
    main()
