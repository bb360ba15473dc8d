// Plotly, and the plot of curves and data.

const COLOURS = ["--fit", "--blue", "--index-n", "--fourth", "--red", "--green"];
const CHANNELS = ["--red", "--green", "--blue", "--fourth"]; // of a surface, the longest wavelength first
const PANELS = ["Ψ", "Δ"]; // signals that have a panel of their own
const ROOM = 0.04; // above and below the curves, as a fraction of the axis

/** Unpacks and runs Plotly, which is a gzipped script in base64, and returns it. */
async function library(packed, nonce) {
  const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const script = document.createElement("script");
  if (nonce) script.nonce = nonce;
  // hides the module loaders of notebooks, which would take Plotly instead of the window
  script.textContent = `(function(define, module, exports) {${await new Response(stream).text()}\n}).call(window);`;
  document.head.append(script);
  script.remove();
  return window.Plotly;
}

/** The plot: curves of the scene, those before the last change, and data; panels share the abscissa. */
class Plot {
  constructor(element, caption, reading) {
    Object.assign(this, { element, caption, reading, axis: { label: "" }, signals: [], curves: [], before: [], fitted: [], data: [], ranges: {}, revision: 0, at: -1 });
    element.addEventListener("keydown", (event) => this.#key(event));
    this.observer = new ResizeObserver(() => {
      if (element.clientWidth && element.clientWidth !== this.width) this.draw(false);
    });
    this.observer.observe(element);
  }

  end() {
    this.observer.disconnect();
    window.Plotly?.purge(this.element);
  }

  /** Label of the ordinate of a curve: Ψ and Δ have panels of their own, other curves share one. */
  #ordinate(curve) {
    const shared = this.axis.value ?? this.signals.join(", ");
    const own = PANELS.find((signal) => curve.label.replace("fit: ", "").startsWith(signal));
    return own ? `${own} ${/\(.*\)/.exec(shared)?.[0] ?? ""}`.trim() : shared;
  }

  /** Draws; while a slider moves, axes only grow. */
  async draw(moving) {
    const ordinates = [...new Set([...this.curves, ...this.data].map((curve) => this.#ordinate(curve)))];
    if (!ordinates.length || !window.Plotly) return;
    this.caption.textContent = this.#words();
    const style = getComputedStyle(this.element);
    const colour = (name) => style.getPropertyValue(name).trim();
    const labels = [...new Set([...this.curves, ...this.data].map((curve) => curve.label))];
    const colours = this.kind === "surface" ? CHANNELS : COLOURS;
    const own = (curve) => colour(colours[Math.max(labels.indexOf(curve.label), 0) % colours.length]);
    const axis = (curve) => `y${Math.max(ordinates.indexOf(this.#ordinate(curve)), 0) + 1}`.replace(/^y1$/, "y");
    const trace = (curve, more) => ({ type: "scatter", mode: "lines", name: curve.label, x: curve.x, y: curve.y, yaxis: axis(curve), ...more });
    const several = this.curves.length > 1;
    const traces = [
      ...this.data.map((curve) => trace(curve, {
        mode: "markers", name: `${curve.label} data`,
        marker: { color: several ? own(curve) : colour("--data"), size: curve.x.length < 100 ? 7 : 4, symbol: several ? "circle-open" : "circle" },
      })),
      ...this.before.map((curve) => trace(curve, {
        name: `${curve.label} before`, line: { color: own(curve), width: 2, simplify: false }, opacity: 0.35, hoverinfo: "skip", showlegend: !several,
      })),
      ...this.curves.map((curve) => trace(curve, { line: { color: own(curve), width: 2, simplify: false } })),
      ...this.fitted.map((curve) => trace(curve, { line: { color: colour("--rival"), width: 2, dash: "dot" } })),
    ];
    await window.Plotly.react(this.element, traces, this.#layout(ordinates, colour, moving), {
      displaylogo: false, modeBarButtonsToRemove: ["lasso2d", "select2d"], doubleClick: "autosize",
      toImageButtonOptions: { format: "svg", filename: "spectrum" },
    });
    if (!this.element.dataset.ready) {
      this.element.dataset.ready = "true";
      this.element.on("plotly_relayout", (change) => {
        if (Object.keys(change).some((key) => key.endsWith(".autorange"))) {
          this.revision += 1; // forget what was zoomed
          this.draw(false);
        }
      });
    }
  }

  #layout(ordinates, colour, moving) {
    this.width = this.element.clientWidth;
    const narrow = this.width < 560;
    const coarse = window.matchMedia("(pointer: coarse)").matches;
    const line = { gridcolor: colour("--line"), zerolinecolor: colour("--line"), linecolor: colour("--line") };
    const share = (1 - 0.08 * (ordinates.length - 1)) / ordinates.length;
    const layout = {
      width: this.width, height: (narrow ? 150 : 250) * ordinates.length + (narrow ? 90 : 110),
      margin: { l: narrow ? 52 : 68, r: 12, t: 34, b: narrow ? 40 : 48 }, uirevision: this.revision, dragmode: coarse ? false : "zoom",
      paper_bgcolor: colour("--page"), plot_bgcolor: colour("--page"), font: { color: colour("--text"), size: 13 },
      hovermode: "x", hoversubplots: "axis", hoverlabel: { bgcolor: colour("--panel"), font: { color: colour("--text") } },
      showlegend: true, legend: { orientation: "h", y: 1, yanchor: "bottom", x: 0, bgcolor: "rgba(0,0,0,0)" },
      xaxis: { ...line, range: this.#span(), title: { text: this.axis.label, standoff: 6 }, anchor: ordinates.length === 1 ? "y" : `y${ordinates.length}` },
    };
    ordinates.forEach((name, number) => {
      const top = 1 - number * (share + 0.08);
      const range = this.#range(name, moving);
      layout[number === 0 ? "yaxis" : `yaxis${number + 1}`] = {
        ...line, title: { text: name, standoff: 6 }, range, domain: [Math.max(top - share, 0), top], anchor: "x",
      };
    });
    this.element.style.minHeight = `${layout.height + 2}px`;
    return layout;
  }

  /** Range of the abscissa. */
  #span() {
    const ends = [...this.curves, ...this.data].flatMap(({ x }) => [x[0], x.at(-1)]);
    const room = this.data.length ? 0.01 * (Math.max(...ends) - Math.min(...ends)) : 0; // for whole markers
    return [Math.min(...ends) - room, Math.max(...ends) + room];
  }

  #range(name, moving) {
    let [low, high] = [Infinity, -Infinity];
    for (const curve of [...this.curves, ...this.before, ...this.fitted, ...this.data]) {
      if (this.#ordinate(curve) !== name) continue;
      for (const value of curve.y) {
        if (value === null) continue;
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    if (!(low <= high)) return [0, 1];
    const room = ROOM * (high - low || Math.abs(high) || 1);
    const fromZero = low >= 0 && (high <= 1.5 || low < high / 2);
    let range = [fromZero ? 0 : low - room, high + room];
    const old = this.ranges[name];
    if (moving && old) range = [Math.min(old[0], range[0]), Math.max(old[1], range[1])];
    this.ranges[name] = range;
    return range;
  }

  /** Extremes of each curve, the text alternative of the plot. */
  #words() {
    const unit = /\((.*)\)/.exec(this.axis.label)?.[1] ?? "";
    return this.curves.map((curve) => {
      let [low, high] = [0, 0];
      curve.y.forEach((value, i) => {
        if (value !== null && value < curve.y[low]) low = i;
        if (value !== null && value > curve.y[high]) high = i;
      });
      const point = (i) => `${short(curve.y[i], 3)} at ${short(curve.x[i], 4)} ${unit}`.trim();
      return `${curve.label}: least ${point(low)}, greatest ${point(high)}.`;
    }).join(" ");
  }

  #key(event) {
    const [first] = this.curves;
    const steps = { ArrowRight: 1, ArrowLeft: -1, PageUp: 10, PageDown: -10 }[event.key];
    if (!steps || !first || event.target !== this.element) return;
    event.preventDefault();
    this.at = Math.min(Math.max(this.at + steps, 0), first.x.length - 1);
    const values = this.curves.map((curve) => `${curve.label} ${short(curve.y[this.at], 5)}`);
    this.reading.textContent = `${this.axis.label} ${short(first.x[this.at], 5)}: ${values.join(", ")}`;
    try {
      window.Plotly.Fx.hover(this.element, { xval: first.x[this.at] }, ["xy"]);
    } catch { /* a point outside the zoomed range has no label */ }
  }
}
