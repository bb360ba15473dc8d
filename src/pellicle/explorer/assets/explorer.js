// The explorer: sliders of a scene, and the curve, colour, sphere and plan that follow them.
//
// It loads nothing and knows no server: `call(request, body)` returns a promise of the answer. A page makes it
// of fetch, a notebook of the messages of anywidget.

const PLAN_AFTER = 150; // ms without a change after which the plan is asked for
const AGAIN_AFTER = 150; // ms between questions while the engine compiles
const SAME_CHANGE = 1500; // ms within which several steps of a slider are one change, and have one curve before it

const NO_DATA = { name: null, curves: [], notes: [], cut: [] };

/** Rows of a plan as two lists: effects that are simulated, and those that are left out. */
function planLists(rows) {
  const item = (row) => make("li", {}, make("strong", {}, row.effect), `: ${row.reason}`,
    row.error ? make("span", { class: "soft" }, ` (error up to ${Number(row.error).toExponential(1)})`) : "",
    row.cost ? make("span", { class: "soft" }, ` (cost ${row.cost})`) : "");
  const list = (title, own) => (own.length ? [make("h3", {}, title), make("ul", {}, ...own.map(item))] : []);
  const off = rows.filter((row) => row.choice === "off");
  const on = rows.filter((row) => row.choice !== "off");
  const [, items] = list("", off);
  const folded = items ? [make("details", {}, make("summary", {}, `Left out (${off.length})`), items)] : [];
  return [...list(`Simulated (${on.length})`, on), ...folded];
}

/**
 * Shows an explorer in `element` and returns a promise of functions that act on it.
 *
 * `call(request, body)` returns a promise of the engine's answer. Options: `plotly`, packed by gzip and base64;
 * `nonce` of the page's policy for scripts; `query`, the text of a URL that has values; `changed(query)`, called with
 * the text for the URL after each change; `titled(title)`, called with the scene's title; `theme()`, "light" or "dark"
 * where something other than the system decides; `dropTarget`, where files may be dropped.
 */
export async function explore(element, call, options = {}) {
  const id = `explorer-${Math.random().toString(36).slice(2, 8)}`;
  const sentence = make("p", { role: "alert" });
  const dismiss = make("button", { type: "button", onclick: () => { troubles.clear(); trouble(); } }, "Dismiss");
  const alert = make("div", { class: "trouble bad", hidden: true }, sentence, dismiss);
  const columns = make("div", { class: "columns" }, make("section", { class: "spectrum" }, alert));
  element.classList.add("pellicle-explorer");
  element.replaceChildren(columns);
  const theme = () => { element.dataset.theme = options.theme?.() ?? ""; };
  theme();

  const troubles = new Map(); // kind of trouble to its sentence
  function trouble(kind, found) {
    if (found) troubles.set(kind, found); else troubles.delete(kind);
    const text = [...troubles.values()].join(" ");
    alert.hidden = !text;
    if (sentence.textContent === text) return;
    sentence.textContent = text;
    if (found) alert.scrollIntoView({ block: "nearest" });
  }
  /** The answer; what is wrong is shown, and removed by the next answer of its kind. */
  async function ask(request, body = {}) {
    const sent = call(request, angles === null ? body : { angles, ...body }).catch((error) => ({ error: error.message }));
    const answer = await during(sent);
    trouble(request, answer.error);
    return answer;
  }
  /** The promise; `data-busy` says until it ends, and while a slider is moved, that what is shown may be old. */
  function during(promise) {
    pending += 1;
    showBusy();
    return promise.finally(() => { pending -= 1; showBusy(); });
  }
  const showBusy = () => element.toggleAttribute("data-busy", gesture || pending > 0 || planTimer !== null || againTimer !== null);

  // ---- elements ----
  const status = make("p", { class: "status soft", role: "status" });
  const caption = make("figcaption", { id: `${id}-caption` });
  const reading = make("p", { class: "reading soft", role: "status" });
  const canvas = make("div", { class: "plot", tabindex: 0, role: "group", "aria-describedby": caption.id });
  const patch = make("div", { class: "patch", role: "img" });
  const colourText = make("p", { class: "colour-text" });
  const sphere = make("img", { class: "sphere", alt: "", hidden: true });
  const look = make("section", { class: "look", "aria-label": "Colour and sphere", hidden: true }, patch, colourText, sphere);
  const warnings = make("ul", { class: "warnings warn", "aria-label": "Warnings", hidden: true });
  const plan = make("div", { class: "plan" });
  const notes = make("ul", { class: "notes soft", "aria-live": "polite" });
  const sliders = make("section", { class: "controls", "aria-label": "Controls" });
  const plot = new Plot(canvas, caption, reading);
  const say = (text) => { if (status.textContent !== text) status.textContent = text; };

  // ---- views of the current values ----
  const query = new URLSearchParams(options.query ?? "");
  let controls = [];
  let film = ""; // texts of the media and layers, where they are not those that the session began with
  let angles = null; // of incidence, where they are not those of the scene
  let limit = Infinity; // bytes of a file
  let lastName = ""; // of the file that was read last
  let serial = 0;
  let turns = 0; // scenes that were asked for
  let gesture = false; // a slider is being moved
  let planTimer = null;
  let againTimer = null;
  let pending = 0; // requests and drawings under way
  const unfinished = new Set(); // parts of the view whose programs are being compiled
  const marked = () => controls.filter((each) => each.free.checked).map((each) => each.about.name);
  const values = () => Object.fromEntries(controls.map((each) => [each.about.name, each.value]));
  const view = (...want) => () => ({ values: values(), want, serial: ++serial, turn: turns, moving: gesture });
  const asView = (body) => ask("view", body);
  const refresh = () => {
    layerList.follow(values());
    askCurves(view("curves", "colour"));
  };

  const askCurves = newestOf(asView, (answer, asked) => {
    if (answer.error || asked.turn !== turns) return; // curves of another scene
    if (answer.curves) plot.curves = answer.curves;
    if (answer.colour) showColour(answer.colour);
    showWarnings(answer.warnings ?? []);
    compiling(answer, asked);
    during(plot.draw(asked.moving)).then(() => requestAnimationFrame(() => {
      element.dispatchEvent(new CustomEvent("drawn", { detail: { values: asked.values, parts: Object.keys(answer) } }));
    }));
    askSphere(view("sphere"));
    clearTimeout(planTimer);
    planTimer = setTimeout(() => { planTimer = null; askPlan(view("plan")); }, PLAN_AFTER);
  });
  const askSphere = newestOf(asView, (answer, asked) => {
    compiling(answer, asked);
    if (!answer.sphere) return;
    sphere.src = answer.sphere;
    sphere.hidden = look.hidden = false;
    patch.hidden = !colourText.textContent; // a surface has no one colour
    sphere.alt = `Ball with this film or surface in a studio. ${colourText.textContent}`.trim();
  });
  const askPlan = newestOf(asView, (answer) => { if (answer.plan) plan.replaceChildren(...planLists(answer.plan)); });

  /** Asks again for what is being compiled; the old picture stays. */
  function compiling(answer, asked) {
    for (const part of asked.want) unfinished.delete(part);
    for (const part of answer.compiling ?? []) unfinished.add(part);
    const was = element.classList.contains("compiling");
    element.classList.toggle("compiling", unfinished.size > 0);
    if (!unfinished.size) return was && say("");
    say(`Compiling for these effects: ${[...unfinished].join(", ")} …`);
    clearTimeout(againTimer);
    againTimer = setTimeout(() => { againTimer = null; refresh(); }, AGAIN_AFTER);
  }

  function showColour(colour) {
    patch.hidden = look.hidden = false;
    const share = 100 / colour.each.length;
    const stripes = colour.each.map((hex, i) => `${hex} ${i * share}% ${(i + 1) * share}%`);
    patch.style.background = stripes.length > 1 ? `linear-gradient(to right, ${stripes.join(", ")})` : colour.hex;
    look.classList.toggle("several", stripes.length > 1);
    colourText.textContent = colour.text;
    patch.setAttribute("aria-label", `Colour ${colourText.textContent}`);
  }

  function showWarnings(found) {
    if (found.join("\n") === warnings.dataset.shown) return;
    warnings.dataset.shown = found.join("\n");
    warnings.hidden = !found.length;
    warnings.replaceChildren(...found.map((text) => make("li", {}, text)));
  }

  // ---- sliders ----
  let last = { control: null, time: 0 };
  function moved(control, moving) {
    const now = performance.now();
    const again = control === last.control && now - last.time < SAME_CHANGE;
    if (moving && !gesture && !again) plot.before = plot.curves;
    plot.fitted = [];
    last = { control, time: now };
    gesture = moving;
    if (!moving) tellChange();
    refresh();
  }

  function tellChange() {
    query.delete("angle"); // a list has no slider
    if (film) query.set("film", film); else query.delete("film");
    if (angles === null) query.delete("angles"); else query.set("angles", angles.join(","));
    for (const { about, value } of controls) {
      if (value === about.value && !(film && value)) query.delete(about.name); else query.set(about.name, short(value, 10));
    }
    options.changed?.(query.toString());
    element.dispatchEvent(new CustomEvent("changed", { detail: { values: values(), angles: angles ?? [] } }));
  }

  function setAll(wanted, errors = {}) {
    Object.assign(plot, { before: plot.curves, fitted: [] });
    for (const each of controls) {
      if (wanted[each.about.name] !== undefined) each.set(wanted[each.about.name]);
      each.note(errors[each.about.name]);
    }
    gesture = false;
    tellChange();
    refresh();
  }

  /**
   * Makes the sliders of a scene, at the values of `given` and at the angles of incidence `listed`, null for its own.
   * Returns whether there is a scene; null where another one was asked for meanwhile.
   */
  async function takeScene(given, listed = null) {
    const turn = ++turns;
    const scene = await ask("scene", { angles: listed });
    if (turn !== turns) return null;
    if (scene.error) return false;
    angles = listed !== null && scene.angles?.length ? scene.angles : listed; // in rising order
    const checked = new Map(controls.map((each) => [each.about.name, each.free.checked]));
    options.titled?.(scene.title);
    element.classList.toggle("of-surface", scene.kind === "surface");
    limit = scene.limit ?? Infinity;
    Object.assign(plot, { kind: scene.kind, axis: scene.axis, signals: scene.signals, curves: [], before: [], fitted: [], ranges: {} });
    const at = scene.angles?.length ? ` at ${scene.angles.map((angle) => `${short(angle, 8)}°`).join(", ")}` : "";
    canvas.setAttribute("aria-label", `Plot of ${scene.signals.join(", ")} against ${scene.axis.label}${at}. Arrow keys read the points.`);
    controls = scene.controls.map((about, i) => new Control(about, `${id}-${i}`, moved));
    for (const each of controls) {
      const value = given.get(each.about.name);
      if (value !== null && value !== "" && Number.isFinite(Number(value))) each.set(Number(value));
      each.free.checked = checked.get(each.about.name) ?? each.free.checked;
    }
    const groups = [...new Set(scene.controls.map((about) => about.group))];
    const list = scene.angles ? [angleList.element] : []; // a surface has none
    if (list.length && !groups.includes("light")) groups.splice(groups.includes("instrument") ? groups.indexOf("instrument") : groups.length, 0, "light");
    const typing = document.activeElement === angleList.input;
    layerList.remember();
    if (list.length) angleList.show(scene);
    sliders.replaceChildren(layerList.element, ...groups.map((name) => make("fieldset", {}, make("legend", {}, name),
      ...controls.filter((each) => each.about.group === name).map((each) => each.element), ...(name === "light" ? list : []))));
    if (typing) angleList.input.focus();
    stored.replaceChildren(...(scene.files ?? []).map((name, number) => make("button", {
      type: "button", "aria-pressed": String(number === scene.number), onclick: () => takeTab(number),
    }, name)));
    layerList.show(scene.layers, scene.words);
    reader.make(scene.fields);
    film = scene.edited ? filmText(scene.layers) : "";
    showData(scene.data ?? NO_DATA);
    return true;
  }

  // ---- media and layers ----
  const layerList = new LayerList(`${id}-layers`, takeLayers, async (file) => {
    const answer = await ask("material", { name: file.name, base64: base64(await file.arrayBuffer()) });
    return answer.word;
  });

  /** Shows the scene with changed media and layers; sliders of what stays keep their values. */
  async function takeLayers(rows) {
    say("Building the scene …");
    const answer = await ask("layers", { rows, values: values(), free: marked() });
    say("");
    if (answer.wrong || answer.error) layerList.refuse(answer.wrong ?? []);
    if (answer.error || answer.wrong || !(await takeScene(new URLSearchParams(), angles))) return;
    fits.clear();
    tellChange();
    refresh();
  }

  /** Builds the film of an address, where the session has another one. */
  async function takeFilm(text) {
    if (!text) return;
    const scene = await ask("scene");
    if (!scene.layers || filmText(scene.layers) === text) return;
    const { wrong, error } = await ask("layers", { rows: filmRows(text) });
    if (wrong || error) trouble("layers", `The film of the address cannot be built. ${error ?? wrong.filter(Boolean).join(" ")}`);
  }

  // ---- angles of incidence ----
  const angleList = new AngleList(`${id}-angles`, (listed) => takeAngles(listed));

  /** Draws a curve for each angle of a list, at the values of the sliders. */
  async function takeAngles(listed, wanted = values()) {
    const found = await takeScene(new URLSearchParams(Object.entries(wanted)), listed);
    if (found === null) return;
    if (!found) return angleList.refuse();
    tellChange();
    refresh();
  }

  // ---- data ----
  const stored = make("div", { class: "buttons stored", role: "group", "aria-label": "Files of the recipe" });
  const zone = fileZone((file) => takeData(file.name, null, file), options.dropTarget ?? element, element);

  async function takeData(name, body, file) {
    if (file && file.size > limit) {
      return trouble("data", `${name} has ${short(file.size / 1e6, 3)} MB: the explorer reads files of up to ${limit / 1e6} MB.`);
    }
    say(`Reading ${name} …`);
    lastName = name;
    try {
      body ??= { name, base64: base64(await file.arrayBuffer()) };
    } catch {
      trouble("data", `${name} cannot be read: choose a file, not a folder.`);
      return say("");
    }
    await readData(name, body);
  }

  /** Reads a file, or the last one anew with the options of the fields. */
  async function readData(name, body) {
    const answer = await ask("data", body);
    say("");
    if (answer.error) reader.need(name, answer.fields);
    await takeAnswer(answer);
  }

  const reader = new ReadingFields(`${id}-reading`, (texts) => readData(lastName, { reading: texts }));

  /** Shows another file of the recipe. */
  async function takeTab(number) {
    const answer = await ask("tab", { number });
    await takeAnswer(answer.error ? answer : { ...answer, scene_changed: true });
  }

  function showData(data) {
    const there = data.name !== null;
    if (there) lastName = data.name;
    Object.assign(plot, { data: data.curves, cut: data.cut, before: [], fitted: [] });
    const remove = make("button", { type: "button", onclick: removeData, "aria-label": `Remove ${data.name}`, title: "Removes the data, with their angles and signal" }, "×");
    notes.replaceChildren(...data.notes.slice(0, 1).map((text) => make("li", {}, text, " ", remove)));
    if (data.cut.length) notes.append(make("li", {}, "The shaded points are left out: the notes below say why."));
    reader.show(data.name, data.reading ?? {}, data.notes.slice(1));
    fits.disabled = !there;
    element.classList.toggle("with-data", there);
  }

  /** Shows what the engine has after a request that changed data or scene, at the values `kept` of the sliders. */
  async function takeAnswer(answer, kept = values()) {
    if (answer.error) return;
    if (answer.states_angle) delete kept.angle;
    if (answer.scene_changed && !(await takeScene(new URLSearchParams(Object.entries(kept))))) return;
    if (answer.states_angle) for (const each of controls) if (each.about.name === "angle") each.set(each.about.value);
    for (const each of controls) each.note();
    fits.clear();
    showData(answer);
    tellChange();
    await plot.draw(false);
    refresh();
  }

  async function removeData() {
    const answer = await ask("remove");
    await takeAnswer(answer.error ? answer : { ...answer, scene_changed: true });
  }

  // ---- fit, and which film ----
  const fits = new FitActions({
    ask,
    progress: () => call("fit_status", {}).catch(() => ({})),
    body: (free) => ({ values: values(), ...(free && marked().length ? { free: marked() } : {}) }),
    found: (answer) => {
      setAll(answer.values, answer.errors);
      plot.fitted = answer.curves ?? []; // with scale and offset
    },
    taken: takeHypothesis,
  });

  /** Shows the scene of a hypothesis, whose free numbers can then be moved and fitted. */
  async function takeHypothesis(number) {
    const answer = await ask("hypothesis", { number });
    if (answer.error || !(await takeScene(new URLSearchParams()))) return;
    tellChange();
    await plot.draw(false);
    refresh();
  }

  // ---- recipe, Python, link ----
  const dialog = textDialog(id);
  async function showText(kind, title, name) {
    const answer = await ask("recipe", fits.body(true));
    if (!answer.error) dialog.show(title, answer[kind], name, answer.commands[kind]);
  }
  async function reset() {
    const answer = await ask("reset");
    if (!answer.error && (await takeScene(new URLSearchParams()))) await takeAnswer({ ...answer, scene_changed: false });
  }
  const button = (text, onclick) => make("button", { type: "button", onclick }, text);
  const link = button("Copy link", () => copyText(window.location.href, link, element));
  const buttons = make("div", { class: "buttons", role: "group", "aria-label": "Actions" }, ...fits.buttons,
    button("Recipe", () => showText("toml", "Recipe", "recipe.toml")),
    button("Python", () => showText("python", "Python", "film.py")),
    ...(options.changed ? [link] : []), button("Reset", reset));

  // ---- start ----
  const asked = anglesOf(query.get("angles"));
  const ready = takeFilm(query.get("film")).then(() => takeScene(query, asked)).then(async (found) => {
    if (found || asked === null) return found;
    const refused = sentence.textContent;
    const other = await takeScene(query);
    trouble("angles", other ? refused : "");
    return other;
  });
  if (!window.Plotly) {
    await library(options.plotly, options.nonce).catch((error) => {
      trouble("plot", `The curve cannot be drawn in this browser (${error.message}).`);
    });
  }
  if (!(await ready)) return null;
  columns.replaceChildren(
    sliders,
    make("section", { class: "spectrum", "aria-label": "Spectrum" }, alert, make("figure", {}, canvas, caption), reading),
    make("section", { class: "actions", "aria-label": "Data and results" },
      make("div", { class: "zone" }, zone.element, stored, notes, reader.element), buttons, fits.said, status, warnings),
    look,
    make("section", { class: "effects", "aria-labelledby": `${id}-plan` },
      make("h2", { id: `${id}-plan` }, "Plan: what is simulated, and why"), plan),
  );
  element.append(dialog.element);
  refresh();
  const redraw = () => { theme(); plot.draw(false); };
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  dark.addEventListener("change", redraw);
  const close = () => {
    dark.removeEventListener("change", redraw);
    zone.end();
    plot.end();
  };
  return { values, angles: () => angles ?? [], set: (wanted) => setAll(wanted), list: takeAngles, redraw, close };
}
