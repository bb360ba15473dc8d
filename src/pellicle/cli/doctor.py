"""`pellicle doctor`: versions, machine, cache and optional packages, as a report of a fault needs them."""

import os
import platform
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

from pellicle.cli.messages import show
from pellicle.cli.session import CACHE_VARIABLE, GOOD, cache_folder

_VARIABLES = (CACHE_VARIABLE, "JAX_PLATFORMS", "JAX_ENABLE_X64", "XLA_FLAGS", "JAX_COMPILATION_CACHE_DIR")
_NOT_OF_USERS = ("all", "notebooks", "browser", "docs", "dev")


def doctor() -> int:
    """Print versions, the machine, the cache of programs and the optional packages, for a report of a fault.

    Example: pellicle doctor
    """
    import jax

    from pellicle.reporting.json_record import versions

    jax.config.update("jax_enable_x64", True)
    lines = [("system", platform.platform()), ("processor", f"{platform.machine()}, {os.cpu_count()} cores")]
    lines += [(name, text or "absent") for name, text in versions().items()]
    lines += [("devices", ", ".join(str(device) for device in jax.devices())), ("cache", _cache())]
    lines += [(name, os.environ[name]) for name in _VARIABLES if name in os.environ]
    lines += [(f"[{extra}]", found) for extra, found in _extras()]
    width = max(len(name) for name, _ in lines)
    show("\n".join(f"{name:{width}}  {text}" for name, text in lines))
    return GOOD


def _cache() -> str:
    """The folder of compiled programs, with their number and size."""
    folder = cache_folder()
    if folder is None:
        return "off"
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    home = str(Path.home())
    place = str(folder).replace(home, "~", 1) if str(folder).startswith(home) else str(folder)
    return f"{place}, {len(sizes)} files, {sum(sizes) / 2**20:.0f} MiB"


def _extras() -> Iterator[tuple[str, str]]:
    """Each extra for users with the versions of its packages, absent ones too."""
    from packaging.requirements import Requirement

    extras: dict[str, list[str]] = {}
    for requirement in map(Requirement, requires("pellicle") or ()):
        marker = str(requirement.marker or "")
        extra = marker.partition("extra == ")[2].strip("\"'")
        if extra and extra not in _NOT_OF_USERS and requirement.name != "pellicle":
            extras.setdefault(extra, []).append(_installed(requirement.name))
    yield from ((extra, ", ".join(found)) for extra, found in extras.items())


def _installed(package: str) -> str:
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return f"{package} absent"
