// Plotly, and the plot of curves and data.

const COLOURS = ["--fit", "--blue", "--index-n", "--fourth", "--red", "--green"];
const CHANNELS = ["--red", "--green", "--blue", "--fourth"]; // of a surface, the longest wavelength first
const ANGLES = ["--fit", "--blue", "--green", "--fourth"]; // of incidence, rising, as in reports of fits
const DASHES = ["solid", "dash", "dashdot", "longdash"];
const DASHES_IN_WORDS = ["solid", "dashed", "dash-dotted", "long-dashed"];
const SHARE_OF_RESIDUALS = 0.45; // of the height of another panel
const DECADES = 1e5; // of a logarithmic axis, at most
const GAP = 0.06; // between panels, as a fraction of the height
const ROOM = 0.04; // above and below the curves, as a fraction of the axis
const GROWTH = 0.15; // of the axis, beyond a curve that leaves it while a slider moves

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

/** Ordinate of a curve at x, null beyond its ends. */
function interpolated({ x, y }, at) {
  const rising = x[0] <= x.at(-1);
  let [low, high] = [0, x.length - 1];
  if (rising ? at < x[0] || at > x[high] : at > x[0] || at < x[high]) return null;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if ((x[middle] <= at) === rising) low = middle; else high = middle;
  }
  if (y[low] === null || y[high] === null) return null;
  return x[high] === x[low] ? y[low] : y[low] + ((y[high] - y[low]) * (at - x[low])) / (x[high] - x[low]);
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

  /** Label of the ordinate of a curve, of which each has a panel. */
  #ordinate(curve) {
    return curve.ordinate ?? this.axis.value ?? this.signals.join(", ");
  }

  /** Angles of incidence of the curves, rising; none where there is one. */
  #settings() {
    const every = new Set([...this.curves, ...this.data].map((curve) => curve.setting).filter(Boolean));
    return [...every].sort((one, other) => parseFloat(one) - parseFloat(other));
  }

  /** Whether a panel has several signals, as elements of a Mueller matrix. */
  #shared() {
    const panels = new Map([...this.curves, ...this.data].map((curve) => [curve.signal, this.#ordinate(curve)]));
    return new Set(panels.values()).size < panels.size;
  }

  /** Colour and dash of each curve: by its angle of incidence; by its label where there is one angle. */
  #strokes(colour) {
    const all = [...this.curves, ...this.data];
    const settings = this.#settings();
    const signals = [...new Set(all.map((curve) => curve.signal))];
    const labels = [...new Set(all.map((curve) => curve.label))];
    const colours = this.kind === "surface" ? CHANNELS : COLOURS;
    const pick = (names, at) => colour(names[Math.max(at, 0) % names.length]);
    return (curve) => {
      const at = settings.indexOf(curve.setting);
      if (at < 0) return { color: pick(colours, labels.indexOf(curve.label)), dash: "solid" };
      if (this.#shared()) return { color: pick(colours, signals.indexOf(curve.signal)), dash: DASHES[at % DASHES.length] };
      return { color: pick(ANGLES, at), dash: DASHES[Math.floor(at / ANGLES.length) % DASHES.length] };
    };
  }

  /** Abscissae and ordinates of a line, which is interrupted where an angle passes 360 degrees. */
  static #points({ x, y, ordinate }) {
    const steps = ordinate?.startsWith("Δ") ? y.flatMap((value, i) => (i && Math.abs(value - y[i - 1]) > 180 ? [i] : [])) : [];
    if (!steps.length) return { x, y };
    const gaps = (values, gap) => steps.concat(values.length).flatMap((end, i) => [
      ...values.slice(i ? steps[i - 1] : 0, end), ...(end < values.length ? [gap(end)] : [])]);
    return { x: gaps(x, (end) => x[end]), y: gaps(y, () => null) };
  }

  /** Data minus curve, of each curve that the data measure; the fitted curve goes before that of the sliders. */
  #residuals() {
    const models = new Map([...this.curves, ...this.fitted].map((curve) => [curve.label.replace(/ \(.*\)$/, ""), curve]));
    return this.data.flatMap((curve) => {
      const model = models.get(curve.label.replace(/ \(.*\)$/, ""));
      if (!model) return [];
      const y = curve.x.map((x, i) => {
        const own = curve.y[i];
        const fit = model.x[i] === x ? model.y[i] : interpolated(model, x); // samples have one x several times
        if (own === null || fit === null) return null;
        return curve.ordinate?.startsWith("Δ") ? ((((own - fit) % 360) + 540) % 360) - 180 : own - fit;
      });
      const unit = /\(°\)/.test(curve.ordinate ?? "") ? " (°)" : "";
      return [{ ...curve, y, ordinate: `residual${unit}` }];
    });
  }

  /** Moves the lines whose ordinates alone are new, and returns whether that was all there was to draw.
   * Plotly takes 20 to 50 ms for it. Its hover labels are old until the next whole drawing. */
  #slide(traces, frame) {
    const { element } = this;
    if (frame !== this.frame) return false;
    const paths = new Map();
    for (const [i, trace] of traces.entries()) {
      if (trace.y.every((y, at) => y === element.data[i].y[at]) && trace.y.length === element.data[i].y.length) continue;
      const drawn = element.querySelectorAll(`.scatterlayer .trace${trace.uid} .js-line`);
      if (trace.mode !== "lines" || !drawn.length) return false;
      const { xaxis, [trace.yaxis.replace("y", "yaxis")]: yaxis } = element._fullLayout;
      const points = trace.x.map((x, at) => [xaxis.d2p(x), yaxis.d2p(trace.y[at])]);
      const there = (point) => point?.every(Number.isFinite);
      const steps = points.map((point, at) => (there(point) ? `${there(points[at - 1]) ? "L" : "M"}${point.map((x) => x.toFixed(2))}` : ""));
      drawn.forEach((path, part) => paths.set(path, part ? "" : steps.join("")));
    }
    for (const [path, steps] of paths) path.setAttribute("d", steps);
    traces.forEach(({ x, y }, i) => Object.assign(element.data[i], { x, y }));
    return true;
  }

  /** Draws; while a slider moves, axes only grow. */
  async draw(moving) {
    this.residuals = this.#residuals();
    const ordinates = [...new Set([...this.curves, ...this.data, ...this.residuals].map((curve) => this.#ordinate(curve)))];
    if (!ordinates.length || !window.Plotly) return;
    this.caption.textContent = this.#words();
    const style = getComputedStyle(this.element);
    const colour = (name) => style.getPropertyValue(name).trim();
    const own = this.#strokes(colour);
    const settings = this.#settings();
    const several = this.curves.length > 1;
    const axis = (curve) => `y${Math.max(ordinates.indexOf(this.#ordinate(curve)), 0) + 1}`.replace(/^y1$/, "y");
    const named = new Set(); // names in the legend: with several angles, of each once
    const legend = (name, group) => {
      if (!settings.length) return { name };
      const first = !named.has(group);
      named.add(group);
      return { name: group, legendgroup: group, showlegend: first };
    };
    const trace = (curve, points, more) => ({
      type: "scatter", mode: "lines", ...points, yaxis: axis(curve), meta: curve.label,
      ...(settings.length ? { hovertemplate: `%{y}<extra>${curve.label}</extra>` } : {}), ...more,
    });
    const line = (curve, stroke, more) => trace(curve, Plot.#points(curve), { line: { width: 2, simplify: false, ...stroke }, ...more });
    const shared = this.#shared();
    const group = (curve) => (shared ? curve.label : curve.setting);
    const traces = [
      ...this.data.map((curve) => trace(curve, { x: curve.x, y: curve.y }, {
        mode: "markers", ...legend(`${curve.label} data`, "data"),
        marker: { color: several ? own(curve).color : colour("--data"), size: curve.x.length < 100 ? 7 : 4, symbol: several ? "circle-open" : "circle" },
      })),
      ...(this.axis.points ? [] : this.before).map((curve) => line(curve, own(curve), {
        name: `${curve.label} before`, opacity: 0.35, hoverinfo: "skip", hovertemplate: null, showlegend: !several,
      })),
      ...this.fitted.map((curve) => line(curve, { color: colour("--rival"), dash: "dot" }, legend(`fit: ${curve.label}`, "fit"))),
      ...this.curves.map((curve) => (this.axis.points
        ? trace(curve, { x: curve.x, y: curve.y }, { name: curve.label, mode: "markers", marker: { color: own(curve).color, size: 6, symbol: "x-thin", line: { width: 1.5, color: own(curve).color } } })
        : line(curve, own(curve), legend(curve.label, group(curve))))),
      ...this.residuals.map((curve) => trace(curve, { x: curve.x, y: curve.y }, {
        name: `${curve.label} residual`, showlegend: false, ...(this.axis.points ? { mode: "markers", marker: { size: 4, color: own(curve).color } } : {}), line: { width: 1, simplify: false, color: several ? own(curve).color : colour("--data") },
      })),
    ];
    traces.forEach((each, i) => { each.uid = String(i); });
    const entries = traces.filter((each) => each.showlegend !== false).map((each) => each.name);
    const layout = this.#layout(ordinates, entries, colour, moving);
    const frame = JSON.stringify([layout, traces.map(({ x, y, ...rest }) => rest)]);
    if (moving && this.#slide(traces, frame)) return;
    this.frame = frame;
    await window.Plotly.react(this.element, traces, layout, {
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

  #layout(ordinates, entries, colour, moving) {
    this.width = this.element.clientWidth;
    const narrow = this.width < 560;
    const rows = Math.ceil(entries.reduce((sum, name) => sum + 44 + 8 * name.length, 0) / (this.width - (narrow ? 64 : 80)));
    const top = 10 + 24 * Math.max(rows, 1); // room for the legend
    const coarse = window.matchMedia("(pointer: coarse)").matches;
    const line = { gridcolor: colour("--line"), zerolinecolor: colour("--line"), linecolor: colour("--line") };
    const weights = ordinates.map((name) => (name.startsWith("residual") ? SHARE_OF_RESIDUALS : 1));
    const panels = weights.reduce((sum, each) => sum + each, 0);
    const share = (1 - GAP * (ordinates.length - 1)) / panels;
    const layout = {
      width: this.width, height: (narrow ? 150 : 250) * panels + (narrow ? 56 : 76) + top,
      margin: { l: narrow ? 52 : 68, r: 12, t: top, b: narrow ? 40 : 48 }, uirevision: this.revision, dragmode: coarse ? false : "zoom",
      paper_bgcolor: colour("--page"), plot_bgcolor: colour("--page"), font: { color: colour("--text"), size: 13 },
      hovermode: "x", hoversubplots: "axis", hoverlabel: { bgcolor: colour("--panel"), font: { color: colour("--text") } },
      showlegend: true, legend: { orientation: "h", y: 1, yanchor: "bottom", x: 0, bgcolor: "rgba(0,0,0,0)" },
      xaxis: { ...line, range: this.#span(), title: { text: this.axis.label, standoff: 6 }, anchor: ordinates.length === 1 ? "y" : `y${ordinates.length}` },
    };
    layout.shapes = (this.cut ?? []).map(([x0, x1]) => ({
      type: "rect", x0, x1, y0: 0, y1: 1, yref: "paper", layer: "below", line: { width: 0 }, fillcolor: colour("--soft"), opacity: 0.2,
    }));
    ordinates.forEach((name, number) => {
      const highest = 1 - weights.slice(0, number).reduce((sum, each) => sum + each * share + GAP, 0);
      const range = this.#range(name, moving);
      layout[number === 0 ? "yaxis" : `yaxis${number + 1}`] = {
        ...line, title: { text: name, standoff: 6 }, ...range, domain: [Math.max(highest - share * weights[number], 0), highest], anchor: "x",
      };
    });
    this.element.style.minHeight = `${layout.height + 2}px`;
    return layout;
  }

  /** Range of the abscissa. */
  #span() {
    const ends = [...[...this.curves, ...this.data].flatMap(({ x }) => [x[0], x.at(-1)]), ...(this.cut ?? []).flat()];
    const room = this.data.length ? 0.01 * (Math.max(...ends) - Math.min(...ends)) : 0; // for whole markers
    return [Math.min(...ends) - room, Math.max(...ends) + room];
  }

  #range(name, moving) {
    let [low, high] = [Infinity, -Infinity];
    const log = this.axis.log && !name.startsWith("residual");
    for (const curve of [...this.curves, ...this.before, ...this.fitted, ...this.data, ...this.residuals]) {
      if (this.#ordinate(curve) !== name) continue;
      for (const value of curve.y) {
        if (value === null || (log && value <= 0)) continue;
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    if (!(low <= high)) return { range: [0, 1] };
    if (log) [low, high] = [Math.log10(Math.max(low, high / DECADES)), Math.log10(high)];
    const room = ROOM * (high - low || Math.abs(high) || 1);
    const fromZero = !log && !name.startsWith("residual") && low >= 0 && (high <= 1.5 || low < high / 2);
    let range = [fromZero ? 0 : low - room, high + room];
    const old = this.ranges[name];
    if (moving && old) {
      const more = GROWTH * (old[1] - old[0]); // an axis that grew with each curve would be drawn anew each time
      range = [low < old[0] ? (fromZero ? 0 : range[0] - more) : old[0], high > old[1] ? range[1] + more : old[1]];
    }
    this.ranges[name] = range;
    return { range, type: log ? "log" : "linear" };
  }

  /** Extremes of each signal, the text alternative of the plot. */
  #words() {
    const unit = /\((.*)\)/.exec(this.axis.label)?.[1] ?? "";
    const signals = [...new Set(this.curves.map((curve) => curve.signal))];
    const sentences = signals.map((signal) => {
      const points = this.curves.filter((curve) => curve.signal === signal)
        .flatMap(({ x, y, setting }) => y.map((value, i) => ({ x: x[i], y: value, setting })))
        .filter((each) => each.y !== null);
      if (!points.length) return `${signal}: no values.`;
      const point = (better) => {
        const found = points.reduce((best, each) => (better(each.y, best.y) ? each : best));
        const place = `${short(found.y, 3)} at ${short(found.x, 4)}${unit === "°" ? "" : " "}${unit}`.trim();
        return found.setting ? `${place} (${found.setting})` : place;
      };
      return `${signal}: least ${point((one, best) => one < best)}, greatest ${point((one, best) => one > best)}.`;
    });
    const settings = this.#settings();
    if (settings.length && this.#shared()) {
      const words = settings.map((setting, i) => `${DASHES_IN_WORDS[i % DASHES.length]} ${setting}`);
      sentences.push(`Lines: ${words.join(", ")}.`);
    }
    return sentences.join(" ");
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
