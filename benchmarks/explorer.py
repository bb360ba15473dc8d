"""Latency of the explorer in a headless Chromium, from a slider's `input` event to the painted curve.

Run `python benchmarks/explorer.py`, with Playwright and Chromium as for `make browser-tests`. Each scene's
thickness is dragged by the mouse, an event every 16 ms, and stepped by the keyboard, a key every 60 ms. A
curve counts as painted when the frame after the redraw is finished; events that a newer one has overtaken
count until the newer curve. `drawn` is the number of curves drawn for these events, `request` the median time
from sending the values to having the answer, `engine` the time within it that computes curve and colour.

Linux, 2 cores with 10 other processes waiting for them, Chromium 150 without a GPU, 1400 × 900 pixels. The
processes of the benchmark went before the others (`chrt -r 5`). `whole` is the time of the same run with each
curve drawn by `Plotly.react`, in turns with the lines alone, as the page moves them while a slider moves.

    scene                  moved by   median ms  95 % ms  whole: median, 95 %   main thread ms  whole
    film                   mouse           18.7     22.1           42     50              15.7     43
    film                   keyboard        25.2     35.8           42     50              18.0     44
    psi, delta, 3 angles   mouse           20.3     38.6           50     74              19.5     55
    psi, delta, 3 angles   keyboard        27.5     38.4           51     73              23.4     54

Means of two runs of 100 events. While other benchmarks filled the memory bus too, all five scenes took 27 to
58 ms, and 95 % of the events 34 to 77 ms.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright  # pyright: ignore[reportMissingImports]

SCENES = {
    "film": ([], ""),
    "film, 45 degrees": ([], "&angle=45"),
    "film, rough, bandwidth": ([], "&layer.roughness=3&bandwidth=5"),
    "film, psi and delta": (["--signal", "psi-delta", "--angle", "70"], ""),
    "psi, delta, 3 angles": (["--signal", "psi-delta", "--angle", "65,70,75"], ""),
}
"""Flags and parameters of the address, by scene: SiO2 on Si, 401 wavelengths."""
COUNT = """() => {
  const box = document.querySelector("main");
  const number = document.querySelector("input[type=number]");
  window.pending = [];
  window.latency = [];
  window.drawn = 0;
  box.addEventListener("input", (event) => window.pending.push([event.timeStamp, Number(number.value)]));
  box.addEventListener("drawn", (event) => {
    const painted = new MessageChannel();
    painted.port2.onmessage = () => {
      const now = performance.now();
      const last = window.pending.findLastIndex(([, value]) => value === event.detail.values.thickness);
      window.drawn += last >= 0;
      for (const [time] of window.pending.splice(0, last + 1)) window.latency.push(now - time);
    };
    painted.port1.postMessage(null);
  });
}"""
"""Keeps events until a curve of their value, or of a later one, is painted."""
REQUESTS = """(() => {
  const before = window.fetch;
  window.requests = [];
  window.fetch = async (address, options) => {
    const began = performance.now();
    const response = await before(address, options);
    const read = response.json.bind(response);
    response.json = async () => {
      const answer = await read();
      const { curves, colour } = answer.milliseconds ?? {};
      if (curves !== undefined) window.requests.push([performance.now() - began, curves + (colour ?? 0)]);
      return answer;
    };
    return response;
  };
})()"""


def drag(page: Page, events: int) -> None:
    box = page.get_by_role("slider", name="thickness in nm").bounding_box()
    assert box is not None
    middle, left = box["y"] + box["height"] / 2, box["x"] + 0.2 * box["width"]
    page.mouse.move(left, middle)
    page.mouse.down()
    for i in range(events):
        page.mouse.move(left + 0.6 * box["width"] * i / events, middle)
        page.wait_for_timeout(16)
    page.mouse.up()


def keys(page: Page, events: int) -> None:
    page.get_by_role("slider", name="thickness in nm").focus()
    for _ in range(events):
        page.keyboard.press("ArrowRight")
        page.wait_for_timeout(60)


def main() -> None:
    parser = argparse.ArgumentParser(description="Latency of the explorer's sliders.")
    parser.add_argument("--events", type=int, default=200)
    events = parser.parse_args().events
    chromium = os.environ.get("PELLICLE_BROWSER") or shutil.which("chromium") or shutil.which("google-chrome")
    print("scene                      moved by  events  drawn  median ms  95 % ms  request ms  engine ms")
    code = "from pellicle.cli import process; process()"
    with sync_playwright() as driver, tempfile.TemporaryDirectory() as folder:
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for scene, (flags, query) in SCENES.items():
            command = [sys.executable, "-c", code, "explore", "--no-browser", *flags]
            server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(folder))
            assert server.stdout is not None
            page = browser.new_page(viewport={"width": 1400, "height": 900})
            page.add_init_script(REQUESTS)
            page.goto(server.stdout.readline().strip() + query)
            page.wait_for_selector(".plan li", timeout=120_000)
            page.wait_for_selector("main:not(.compiling)", timeout=120_000)
            page.wait_for_timeout(3000)  # neighbours are compiled in the background
            page.evaluate(COUNT)
            for name, move in {"mouse": drag, "keyboard": keys}.items():
                page.evaluate("() => { requests.length = 0; latency.length = 0; drawn = 0; }")
                move(page, events)
                page.wait_for_timeout(800)
                latency, requests = page.evaluate("[latency, requests]")
                median, most = np.percentile(latency, [50, 95])
                answer, engine = np.median(requests, axis=0)
                drawn = page.evaluate("drawn")
                row = f"{scene:<26} {name:<9} {len(latency):>6} {drawn:>6} {median:>10.1f} {most:>8.1f}"
                print(f"{row} {answer:>11.1f} {engine:>10.2f}", flush=True)
            page.close()
            server.send_signal(signal.SIGINT)
            server.wait(20)
        browser.close()
    print(f"processes waiting for {os.cpu_count()} cores: {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
