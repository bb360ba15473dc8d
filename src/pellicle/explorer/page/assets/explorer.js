// The explorer: sliders of a scene, and the curve, colour, sphere and plan that follow them.
//
// It loads nothing and knows no server: `call(request, body)` returns a promise of the answer. A page makes it
// of fetch, a notebook of the messages of anywidget. slider.js, plot.js and explorer.js are one module.

const PLAN_AFTER = 150; // ms without a change after which the plan is asked for
const COMPILING_AGAIN = 300; // ms between questions while the engine compiles
const PROGRESS_EVERY = 400; // ms between questions about a fit

/** Sends one request at a time, and next the newest of those that came meanwhile: none is queued. */
function newestOf(send, receive) {
  let busy = false;
  let next = null;
  async function run() {
    let sent = null;
    const start = () => {
      if (next === null) return null;
      const body = next();
      next = null;
      return send(body).then((answer) => [body, answer], (error) => [body, { error: error.message }]);
    };
    for (sent = start(); sent !== null; ) {
      const [body, answer] = await sent;
      sent = start(); // on its way while this answer is drawn
      receive(answer, body);
      sent ??= start();
    }
  }
  return (body) => {
    next = body;
    if (busy) return;
    busy = true;
    run().finally(() => { busy = false; });
  };
}

/** Text of a file's bytes that JSON can hold. */
function base64(buffer) {
  const bytes = new Uint8Array(buffer);
  let text = "";
  for (let at = 0; at < bytes.length; at += 32768) text += String.fromCharCode(...bytes.subarray(at, at + 32768));
  return btoa(text);
}

/**
 * Shows an explorer in `element` and returns a promise of functions that act on it.
 *
 * `call(request, body)` returns a promise of the engine's answer. Options: `plotly`, packed by gzip and base64;
 * `nonce` of the page's policy for scripts; `query`, the text of a URL that has values; `changed(query)`, called with
 * the text for the URL after each change; `theme()`, "light" or "dark" where something other than the system decides.
 */
export async function explore(element, call, options = {}) {
  const id = `explorer-${Math.random().toString(36).slice(2, 8)}`;
  element.classList.add("pellicle-explorer");
  const theme = () => { element.dataset.theme = options.theme?.() ?? ""; };
  theme();
  const alert = make("p", { class: "trouble bad", role: "alert", hidden: true });
  const troubles = new Map(); // kind of trouble to its sentence
  const trouble = (kind, sentence) => {
    if ((troubles.get(kind) ?? "") === (sentence ?? "")) return;
    if (sentence) troubles.set(kind, sentence); else troubles.delete(kind);
    alert.textContent = [...troubles.values()].join(" ");
    alert.hidden = troubles.size === 0;
  };
  const columns = make("div", { class: "columns" }, alert);
  element.replaceChildren(columns);
  const ask = async (request, body) => {
    try {
      return await call(request, body);
    } catch (error) {
      return { error: error.message };
    }
  };

  const scene = await ask("scene", {});
  if (scene.error) {
    trouble("scene", scene.error);
    return null;
  }

  // ---- elements ----
  const status = make("p", { class: "status soft", role: "status" });
  const caption = make("figcaption", { id: `${id}-caption` });
  const reading = make("p", { class: "reading soft", role: "status" });
  const canvas = make("div", {
    class: "plot", tabindex: 0, role: "group", "aria-describedby": caption.id,
    "aria-label": `Plot of ${scene.signals.join(", ")} against ${scene.axis.label}. Arrow keys read the points.`,
  });
  const patch = make("div", { class: "patch", role: "img" });
  const colourText = make("p", { class: "colour-text" });
  const sphere = make("img", { class: "sphere", alt: "", hidden: true });
  const look = make("section", { class: "look", "aria-label": "Colour and sphere" }, patch, colourText, sphere);
  const warnings = make("ul", { class: "warnings warn", "aria-label": "Warnings", hidden: true });
  const plan = make("div", { class: "plan" });
  const fitted = make("div", { class: "fitted", role: "status" });
  const plot = new Plot(canvas, caption, reading, scene.axis.label);

  // ---- requests ----
  let serial = 0;
  let gesture = false; // a slider is being moved
  let waiting = null; // timer of the plan
  let again = null; // timer of another view while the engine compiles
  const values = () => Object.fromEntries(controls.map((each) => [each.about.name, each.value]));
  const body = (want) => () => ({ values: values(), want, serial: ++serial, moving: gesture });
  const view = (request) => call("view", request);

  const curves = newestOf(view, (answer, asked) => {
    trouble("view", answer.error);
    if (answer.error) return;
    if (answer.curves?.length) plot.curves = answer.curves;
    if (answer.colour) showColour(answer.colour);
    showWarnings(answer.warnings ?? []);
    plot.draw(asked.moving).then(() => requestAnimationFrame(() => {
      element.dispatchEvent(new CustomEvent("drawn", { detail: { values: asked.values } }));
    }));
    compiling(answer);
    sphereOf(body(["sphere"]));
    clearTimeout(waiting);
    waiting = setTimeout(() => planOf(body(["plan"])), PLAN_AFTER);
  });
  const sphereOf = newestOf(view, (answer) => {
    compiling(answer);
    if (answer.error || !answer.sphere) return;
    sphere.src = answer.sphere;
    sphere.hidden = false;
    sphere.alt = `Sphere coated with this film in daylight, ${colourText.textContent}`;
  });
  const planOf = newestOf(view, (answer) => { if (!answer.error && answer.plan) showPlan(answer.plan); });
  const unfinished = new Set(); // parts of the view whose programs are being compiled
  function compiling(answer) {
    for (const part of ["curves", "colour", "sphere"]) if (answer[part]) unfinished.delete(part);
    for (const part of answer.compiling ?? []) unfinished.add(part);
    const was = element.classList.contains("compiling");
    element.classList.toggle("compiling", unfinished.size > 0);
    if (unfinished.size) {
      say(`Compiling for the effects that are now simulated: ${[...unfinished].join(", ")} …`);
      clearTimeout(again);
      again = setTimeout(refresh, COMPILING_AGAIN);
    } else if (was) say("");
  }
  const refresh = () => curves(body(["curves", "colour"]));
  const say = (text) => { if (status.textContent !== text) status.textContent = text; };

  function showColour(colour) {
    patch.style.background = colour.hex;
    const text = `${colour.hex}: ${colour.text}`;
    colourText.textContent = text;
    patch.setAttribute("aria-label", `Colour ${text}`);
  }

  function showWarnings(found) {
    if (found.join("\n") === warnings.dataset.shown) return;
    warnings.dataset.shown = found.join("\n");
    warnings.hidden = !found.length;
    warnings.replaceChildren(...found.map((text) => make("li", {}, text)));
  }

  function showPlan(rows) {
    const list = (title, own) => own.length
      ? [make("h3", {}, title), make("ul", {}, ...own.map((row) => make("li", {},
        make("strong", {}, row.effect), `: ${row.reason}`,
        row.error ? make("span", { class: "soft" }, ` (error up to ${Number(row.error).toExponential(1)})`) : "",
        row.cost ? make("span", { class: "soft" }, ` (cost ${row.cost})`) : "")))]
      : [];
    const off = rows.filter((row) => row.choice === "off");
    plan.replaceChildren(
      ...list("Simulated", rows.filter((row) => row.choice !== "off")), ...list(`Left out (${off.length})`, off));
  }

  // ---- sliders ----
  const query = new URLSearchParams(options.query ?? "");
  const controls = scene.controls.map((about, i) => new Control(about, `${id}-${i}`, moved));

  function moved(_, moving) {
    if (moving && !gesture) plot.before = plot.curves;
    if (!moving && !gesture) return refreshUrl();
    gesture = moving;
    if (!moving) refreshUrl();
    refresh();
  }

  function refreshUrl() {
    for (const { about, value } of controls) {
      if (value === about.value) query.delete(about.name); else query.set(about.name, short(value, 10));
    }
    options.changed?.(query.toString());
    element.dispatchEvent(new CustomEvent("changed", { detail: values() }));
  }

  function setAll(wanted, errors = {}) {
    plot.before = plot.curves;
    for (const each of controls) {
      if (wanted[each.about.name] !== undefined) each.set(wanted[each.about.name]);
      each.note(errors[each.about.name]);
    }
    gesture = false;
    refreshUrl();
    refresh();
  }

  for (const each of controls) {
    const given = query.get(each.about.name);
    if (given !== null && given !== "" && Number.isFinite(Number(given))) each.set(Number(given));
  }
  const groups = [...new Set(scene.controls.map((about) => about.group))].map((name) => make("fieldset", {},
    make("legend", {}, name), ...controls.filter((each) => each.about.group === name).map((each) => each.element)));

  // ---- data ----
  const notes = make("ul", { class: "notes soft", "aria-live": "polite" });
  function showData(answer) {
    plot.data = answer.curves ?? [];
    notes.replaceChildren(...(answer.notes ?? []).map((text) => make("li", {}, text)));
    fit.disabled = !plot.data.length;
    plot.draw(false);
  }

  async function take(file) {
    if (!file) return;
    trouble("data", null);
    if (scene.limit && file.size > scene.limit) {
      trouble("data", `${file.name} has ${short(file.size / 1e6, 3)} MB: the explorer reads files up to ${short(scene.limit / 1e6, 3)} MB.`);
      return;
    }
    say(`Reading ${file.name} …`);
    let answer;
    try {
      answer = await ask("data", { name: file.name, base64: base64(await file.arrayBuffer()) });
    } catch {
      answer = { error: `${file.name} cannot be read: choose a file, not a folder.` };
    }
    say("");
    trouble("data", answer.error);
    if (answer.error) return;
    showData(answer);
    say(`${file.name} is drawn beside the simulation.`);
  }

  const chooser = make("input", {
    type: "file", hidden: true, accept: ".csv,.txt,.dat,.tsv,text/*,*/*", tabindex: -1, "aria-hidden": "true",
    onchange: () => { take(chooser.files[0]); chooser.value = ""; },
  });
  const zone = make("div", { class: "zone" },
    make("p", {}, make("button", { type: "button", onclick: () => chooser.click() }, "Open a file of data…"), chooser,
      make("span", { class: "soft" }, " or drop a CSV file anywhere here")), notes);
  let depth = 0; // of nested elements that a dragged file has entered
  const over = (change) => (event) => {
    if (![...(event.dataTransfer?.types ?? [])].includes("Files")) return;
    event.preventDefault();
    depth = Math.max(depth + change, 0);
    element.classList.toggle("dropping", depth > 0);
  };
  const target = options.dropTarget ?? element;
  const drop = (event) => {
    event.preventDefault();
    depth = 0;
    element.classList.remove("dropping");
    take(event.dataTransfer.files[0]);
  };
  const listeners = { dragenter: over(1), dragover: over(0), dragleave: over(-1), drop };
  for (const [name, listener] of Object.entries(listeners)) target.addEventListener(name, listener);

  // ---- fit ----
  const fit = make("button", { type: "button", disabled: true, onclick: runFit, title: "Fits the sliders to the data" }, "Fit");
  const stop = make("button", { type: "button", hidden: true, onclick: () => ask("fit_stop", {}) }, "Stop");

  async function runFit() {
    fit.disabled = true;
    stop.hidden = false;
    trouble("fit", null);
    fitted.textContent = "Fitting …";
    const progress = setInterval(async () => {
      const answer = await ask("fit_status", {});
      if (!stop.hidden && answer.running && answer.text) fitted.textContent = `Fitting: ${answer.text}`;
    }, PROGRESS_EVERY);
    const answer = await ask("fit", { values: values() });
    clearInterval(progress);
    fit.disabled = !plot.data.length;
    stop.hidden = true;
    fitted.textContent = answer.stopped ? "The fit was stopped; the sliders are as they were." : "";
    trouble("fit", answer.error);
    if (answer.error || answer.stopped) return;
    setAll(answer.values, answer.errors);
    fitted.replaceChildren(make("p", {}, answer.verdict));
    if (answer.summary) fitted.append(make("details", {}, make("summary", {}, "Summary of the fit"), make("pre", { tabindex: 0 }, answer.summary)));
  }

  // ---- recipe and Python ----
  const shownText = make("code");
  const dialogTitle = make("h2", { id: `${id}-dialog` });
  const copy = make("button", { type: "button", onclick: () => copyText(shownText.textContent, copy) }, "Copy");
  const save = make("a", { class: "button", download: "" }, "Download");
  const dialog = make("dialog", { "aria-labelledby": dialogTitle.id }, dialogTitle, make("pre", { tabindex: 0 }, shownText),
    make("p", { class: "buttons" }, copy, save, make("button", { type: "button", onclick: () => dialog.close() }, "Close")));

  async function showText(kind, title, name) {
    const answer = await ask("recipe", { values: values() });
    trouble("recipe", answer.error);
    if (answer.error) return;
    dialogTitle.textContent = title;
    shownText.textContent = answer[kind];
    URL.revokeObjectURL(save.href);
    save.href = URL.createObjectURL(new Blob([answer[kind]], { type: "text/plain" }));
    save.download = name;
    dialog.showModal();
  }

  async function copyText(text, button) {
    const label = button.textContent;
    try {
      await navigator.clipboard.writeText(text);
    } catch { // no permission: selected text and the old command
      const area = make("textarea", { class: "offscreen" });
      area.value = text;
      (dialog.open ? dialog : element).append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
    button.textContent = "Copied";
    setTimeout(() => { button.textContent = label; }, 1500);
  }

  const buttons = make("div", { class: "buttons", role: "group", "aria-label": "Actions" }, fit, stop,
    make("button", { type: "button", onclick: () => showText("toml", "Recipe", "recipe.toml") }, "Recipe"),
    make("button", { type: "button", onclick: () => showText("python", "Python", "film.py") }, "Python"));
  if (options.changed) {
    const link = make("button", { type: "button", onclick: () => copyText(window.location.href, link) }, "Copy link");
    buttons.append(link);
  }
  buttons.append(make("button", {
    type: "button", onclick: () => setAll(Object.fromEntries(controls.map(({ about }) => [about.name, about.value]))),
  }, "Reset"));

  // ---- page ----
  columns.append(
    make("section", { class: "controls", "aria-label": "Controls" }, ...groups),
    make("section", { class: "spectrum", "aria-label": "Spectrum" }, make("figure", {}, canvas, caption), reading),
    look,
    make("section", { class: "actions", "aria-label": "Data and results" }, buttons, status, fitted, zone, warnings),
    make("section", { class: "effects", "aria-labelledby": `${id}-plan` },
      make("h2", { id: `${id}-plan` }, "Plan: what is simulated, and why"), plan),
  );
  element.append(dialog);
  if (!window.Plotly) {
    try {
      await library(options.plotly, options.nonce);
    } catch (error) {
      trouble("plot", `The curve cannot be drawn in this browser (${error.message}).`);
    }
  }
  if (scene.data) showData(scene.data);
  refresh();
  const redraw = () => { theme(); if (plot.curves.length) plot.draw(false); };
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  dark.addEventListener("change", redraw);
  return {
    values,
    set: (wanted) => setAll(wanted),
    redraw,
    close: () => {
      dark.removeEventListener("change", redraw);
      for (const [name, listener] of Object.entries(listeners)) target.removeEventListener(name, listener);
      window.Plotly?.purge(canvas);
    },
  };
}
