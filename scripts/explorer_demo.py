"""Write the explorer as a page with stored answers, which needs no server, for the documentation site."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np

import pellicle as pl
from pellicle.explorer.page import document
from pellicle.explorer.session import Session

STEPS = {"thickness": 10.0, "angle": 15.0}
"""Sliders of the demonstration, and their steps in nm and degrees."""
STEEPEST = 75.0
WAVELENGTHS = np.arange(380.0, 781.0, 5.0)
STORED = (
    "This page has stored answers for its two sliders. pellicle explore, on your machine, computes others, "
    "reads files, fits them, and writes recipes."
)
CALL = """const demo = DEMO;

async function call(request, body) {
  if (request === "scene" && !body.angles) return demo.scene;
  if (request !== "view") throw new Error("STORED");
  const at = Object.entries(demo.steps).map(([name, step]) => Math.round(body.values[name] / step));
  const { y, ...view } = demo.views[at.join()];
  const curves = [{ ...demo.curve, y }];
  const parts = { curves, sphere: demo.spheres[at[0]], plan: demo.plans[at[1]], ...view };
  const wanted = body.want.map((part) => [part, parts[part]]);
  return { serial: body.serial, compiling: [], warnings: [], ...Object.fromEntries(wanted) };
}
"""


def write_demo(path: Path) -> None:
    """Write the page, 2.4 MB: SiO2 on silicon, every 10 nm to 1 µm and every 15 degrees to 75."""
    film = pl.Scene(pl.Layer("SiO2", pl.Free(0, 1000, start=300)), "Si")
    session = Session(film, wavelength=WAVELENGTHS, title="SiO2 on silicon, with stored answers")

    def answer(want: str, **values: float) -> Any:
        size = {"size": 96} if want == "sphere" else {}
        return session.answer("view", {"want": [want], "values": values, "wait": True, **size})[want]

    scene = session.answer("scene", {})
    scene["controls"] = [each for each in scene["controls"] if each["name"] in STEPS]
    for control in scene["controls"]:
        control["step"] = STEPS[control["name"]]
        control["upper"] = min(control["upper"], STEEPEST if control["name"] == "angle" else np.inf)
    depths, angles = (
        np.arange(control["lower"], control["upper"] + 1, control["step"]).tolist()
        for control in scene["controls"]
    )
    views, curve = {}, {}
    for (i, thickness), (j, angle) in itertools.product(enumerate(depths), enumerate(angles)):
        [curve] = answer("curves", thickness=thickness, angle=angle)
        colour = answer("colour", thickness=thickness, angle=angle)
        views[f"{i},{j}"] = {"y": np.round(curve["y"], 4).tolist(), "colour": colour}
    demo = {
        "scene": scene,
        "steps": {control["name"]: control["step"] for control in scene["controls"]},
        "curve": {**curve, "y": None},
        "views": views,
        "spheres": [answer("sphere", thickness=thickness) for thickness in depths],
        "plans": [answer("plan", thickness=300.0, angle=angle) for angle in angles],
    }
    # in a script, "</" would end it
    stored = json.dumps(demo, separators=(",", ":")).replace("</", "<\\/")
    path.write_text(document("demo", CALL.replace("STORED", STORED).replace("DEMO", stored)), "utf-8")


if __name__ == "__main__":
    write_demo(Path("explorer_demo.html"))
