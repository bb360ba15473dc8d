"""Virtual environment of the compared packages, .venv-peers in the root of the repository."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from packages import Package

ROOT = Path(__file__).resolve().parents[2]
VENV = ROOT / ".venv-peers"


def peers_python() -> Path:
    """Return the Python of the packages' environment, and create it if necessary."""
    python = VENV / "bin" / "python"
    if not python.exists():
        made = subprocess.run([sys.executable, "-m", "venv", VENV], capture_output=True)
        if made.returncode:  # on Debian, pip for virtual environments is a separate package; use ours
            subprocess.run([sys.executable, "-m", "venv", "--without-pip", VENV], check=True)
            pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "pip"]
            subprocess.run(pip, check=True)
    return python


def install(python: Path, package: Package) -> str | None:
    """Install a package and return None, or the reason for a failure."""
    command = [str(python), "-m", "pip", "install", "--quiet", *package.install]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode == 0:
        return None
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    return lines[-1].strip() if lines else f"pip ended with {done.returncode}"
