"""Colours and times of films in Mitsuba 3: the tabulated `.bsdf` files and the lookup of `pellicle export`.

Run `python benchmarks/mitsuba_films.py`. The first table has the ΔE2000 of what Mitsuba evaluates near the
mirror direction at 0 to 80 degrees, from the film's spectrum integrated in steps of 1 nm (CIE 1931, D65); in
RGB the exact colour is clipped to positive sRGB, as the tables are; for transparent bases also those of the
light that a smooth film passes. The second table has the processor time
of a rendering relative to the built-in `roughconductor`, and for a film on glass to `roughdielectric`, the
least of five rounds in which the materials take turns. Variants of Mitsuba that need LLVM are left out where
Dr.Jit does not find it; Dr.Jit 1.5 ends the process with LLVM 15 (DRJIT_LIBLLVM_PATH chooses another).
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import jax
import mitsuba as mi
import numpy as np

import pellicle as pl
from pellicle.colour import delta_e2000, lab, sensor
from pellicle.colour.spaces import SRGB_WHITE, TO_SRGB, adaptation
from pellicle.rendering.appearance import appearance
from pellicle.rendering.mitsuba import ALPHA

sys.path.pop(0)  # where colour.py is not colour-science

FILMS = {
    "43 nm oxide on steel": pl.Scene(pl.Layer(2.9, 43.0), 2.7 + 2.8j),
    "120 nm SiO2 on silicon": pl.Scene(pl.Layer("SiO2", 120.0), "Si"),
    "150 nm of index 2 on glass": pl.Scene(pl.Layer(2.0, 150.0), 1.5),
    "400 nm soap film": pl.Scene(pl.Layer(1.33, 400.0), 1.0),
    "1 µm of index 1.5 on glass": pl.Scene(pl.Layer(1.5, 1000.0), 1.7),
}
EYE = sensor()
WAVELENGTHS = np.linspace(380.0, 730.0, 72)
ANGLES = np.linspace(0.0, 80.0, 41)
OFF = 1.5
"""Degrees between the viewer and the mirror direction: inside the lobe, between the nodes of the table."""
SIZE, SAMPLES, ROUNDS = 256, 64, 5


def lobes(i: np.ndarray, o: np.ndarray) -> tuple[float, float, float]:
    """BRDF times cos θ_o of mirror-like facets, height-correlated and as Mitsuba has them, and ⟨i, h⟩."""
    h = (i + o) / np.linalg.norm(i + o)
    d = ALPHA**2 / (np.pi * (h[2] ** 2 * (ALPHA**2 - 1) + 1) ** 2) / (4 * i[2])
    a, b = (2 / (1 + np.sqrt(1 + ALPHA**2 * (1 / c**2 - 1))) for c in (i[2], o[2]))
    return d * a * b / (a + b - a * b), d * a * b, h @ i


def errors(scene: pl.Scene, files: dict[str, Path]) -> list[np.ndarray]:
    """ΔE2000 at each angle: measured and lookup in RGB, then spectral."""
    look, found = appearance(scene), []
    to_xyz = np.linalg.inv(TO_SRGB @ adaptation(EYE.white, SRGB_WHITE))
    for variant, table in (("scalar_rgb", "film.bsdf"), ("scalar_spectral", "film_spectral.bsdf")):
        mi.set_variant(variant)
        register(files["pellicle_film.py"])
        kinds = (
            {"type": "measured", "filename": str(files[table])},
            {"type": "pellicle_film", "filename": str(files["film.npz"]), "alpha": ALPHA},
        )
        for number, made in enumerate(kinds):
            bsdf, off = mi.load_dict(made), []
            for angle in ANGLES:
                theta, beside = np.deg2rad([angle, angle + OFF])
                i = np.array([np.sin(theta), 0, np.cos(theta)])
                o = np.array([-np.sin(beside), 0, np.cos(beside)])
                lobe = lobes(i, o)
                degrees = np.rad2deg(np.arccos(min(lobe[2], 1.0)))
                exact = look.spectra(EYE.wavelength, look.thickness, np.array([degrees]))[0, 0] @ EYE.weights
                if mi.is_spectral:
                    spectrum = [evaluated(bsdf, i, o, four) for four in WAVELENGTHS.reshape(-1, 4).tolist()]
                    shown = np.interp(EYE.wavelength, WAVELENGTHS, np.ravel(spectrum)) @ EYE.weights
                else:
                    shown = to_xyz @ evaluated(bsdf, i, o)
                    exact = to_xyz @ np.maximum(np.linalg.solve(to_xyz, exact), 0.0)
                off.append(delta_e2000(*(lab(xyz, EYE.white) for xyz in (shown / lobe[number], exact))))
            found.append(np.array(off))
    return found


def transmitted_errors(scene: pl.Scene, files: dict[str, Path]) -> list[np.ndarray]:
    """ΔE2000 of what a smooth film passes at each angle, in RGB, then spectral; none on an opaque base."""
    look, found = appearance(scene), []
    if look.metallic:
        return found
    to_xyz = np.linalg.inv(TO_SRGB @ adaptation(EYE.white, SRGB_WHITE))
    [layer] = look.scene.layers
    film = (layer.thickness, layer.material, look.scene.substrate.material)
    with jax.enable_x64(True):
        exact = pl.transmittance(EYE.wavelength, *film, angle=ANGLES[:, None]) @ EYE.weights
    for variant in ("scalar_rgb", "scalar_spectral"):
        mi.set_variant(variant)
        register(files["pellicle_film.py"])
        bsdf = mi.load_dict({"type": "pellicle_film", "filename": str(files["film.npz"]), "alpha": 0.0})
        off = []
        for angle, seen in zip(ANGLES, np.asarray(exact), strict=True):
            theta = np.deg2rad(angle)
            i = np.array([np.sin(theta), 0, np.cos(theta)])
            if mi.is_spectral:
                spectrum = [passed(bsdf, i, four) for four in WAVELENGTHS.reshape(-1, 4).tolist()]
                shown = np.interp(EYE.wavelength, WAVELENGTHS, np.ravel(spectrum)) @ EYE.weights
            else:
                shown = to_xyz @ passed(bsdf, i)
                seen = to_xyz @ np.maximum(np.linalg.solve(to_xyz, seen), 0.0)
            off.append(delta_e2000(*(lab(xyz, EYE.white) for xyz in (shown, seen))))
        found.append(np.array(off))
    return found


def passed(bsdf: Any, i: np.ndarray, wavelengths: Any = None) -> np.ndarray:
    """Transmittance that a smooth BSDF samples for light from above."""
    at = mi.SurfaceInteraction3f()
    at.wi = mi.Vector3f(*i.tolist())
    if wavelengths is not None:
        at.wavelengths = wavelengths
    sampled, weight = bsdf.sample(mi.BSDFContext(mi.TransportMode.Importance), at, 1 - 1e-6, [0.5, 0.5])
    return np.ravel(weight) * sampled.pdf


def evaluated(bsdf: Any, i: np.ndarray, o: np.ndarray, wavelengths: Any = None) -> np.ndarray:
    """Mitsuba's value of a BSDF: the BRDF times cos θ_o."""
    at = mi.SurfaceInteraction3f()
    at.wi = mi.Vector3f(*i.tolist())
    if wavelengths is not None:
        at.wavelengths = wavelengths
    return np.ravel(bsdf.eval(mi.BSDFContext(), at, mi.Vector3f(*o.tolist())))


def rendering(material: dict[str, Any]) -> Any:
    """A sphere on a table in white light."""
    t = mi.ScalarTransform4f
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 5},
            "sky": {"type": "constant"},
            "ball": {"type": "sphere", "material": material},
            "floor": {"type": "rectangle", "to_world": t().translate([0, 0, -1]).scale(9)},
            "sensor": {
                "type": "perspective",
                "fov": 30,
                "to_world": t().look_at([0, -5, 2], [0, 0, 0], [0, 0, 1]),
                "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE},
            },
        }
    )


def times(variant: str, files: dict[str, Path]) -> dict[str, float]:
    """Least processor time in seconds of each material."""
    mi.set_variant(variant)
    register(files["pellicle_film.py"])
    table = "film_spectral.bsdf" if mi.is_spectral else "film.bsdf"
    scenes = {
        "roughconductor": rendering({"type": "roughconductor", "distribution": "ggx", "alpha": ALPHA}),
        "lookup": rendering({"type": "pellicle_film", "filename": str(files["film.npz"]), "alpha": ALPHA}),
        "measured": rendering({"type": "measured", "filename": str(files[table])}),
        "roughdielectric": rendering({"type": "roughdielectric", "distribution": "ggx", "alpha": ALPHA}),
        "on glass": rendering({"type": "pellicle_film", "filename": str(files["glass.npz"]), "alpha": ALPHA}),
    }
    if mi.is_polarized:
        scenes.pop("measured")
    samples = SAMPLES if variant.startswith("llvm") else 4
    taken: dict[str, list[float]] = {name: [] for name in scenes}
    for number in range(ROUNDS + 1):
        for name, scene in scenes.items():
            began = time.process_time()
            np.array(mi.render(scene, spp=samples, seed=number))
            if number:  # the first compiles
                taken[name].append(time.process_time() - began)
    return {name: min(each) for name, each in taken.items()}


def register(path: Path) -> None:
    spec = importlib.util.spec_from_file_location("pellicle_film", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.register()


def main() -> None:
    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    files: dict[str, Path] = {}
    heads = [f"{name}, {mode}" for mode in ("RGB", "spectral") for name in ("measured", "lookup")]
    heads += [f"passed, {mode}" for mode in ("RGB", "spectral")]
    print(f"| film | {' | '.join(heads)} |\n|{'---|' * (len(heads) + 1)}")
    timed: dict[str, Path] = {}
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, scene) in enumerate(FILMS.items()):
            own = Path(folder) / str(number)
            own.mkdir()
            files = {path.name: path for path in pl.export(scene, to="mitsuba", path=own / "film.xml").files}
            timed = timed or files  # oxide on steel
            each_way = [*errors(scene, files), *transmitted_errors(scene, files)]
            cells = [f"{np.mean(each):.2g} / {np.max(each):.2g}" for each in each_way]
            cells += [""] * (len(heads) - len(cells))
            print(f"| {name} | {' | '.join(cells)} |", flush=True)
        made = pl.export(pl.Scene(pl.Layer(2.0, 150.0), 1.5), to="mitsuba", path=own / "glass.xml")
        timed |= {path.name: path for path in made.files if path.name == "glass.npz"}
        print("\n| variant | lookup | measured | film on glass, to roughdielectric |\n|---|---|---|---|")
        for variant in ("llvm_ad_rgb", "llvm_ad_spectral", "llvm_ad_spectral_polarized", "scalar_rgb"):
            try:
                taken = times(variant, timed)
            except ImportError as missing:
                print(f"| {variant} | {missing} |")
                continue
            metal, glass = taken["roughconductor"], taken["roughdielectric"]
            ratios = (
                taken["lookup"] / metal,
                taken.get("measured", np.nan) / metal,
                taken["on glass"] / glass,
            )
            print(f"| {variant} | {' | '.join(f'{x:.2f}' for x in ratios)} |", flush=True)


if __name__ == "__main__":
    main()
