// Media and layers of a film: fields for materials and thicknesses, and buttons that add, move and remove layers.

/** Texts of rows for the address: `air|SiO2@0:1000|Si`. */
const filmText = (rows) => rows.map((row) => (row.thickness ? `${row.material}@${row.thickness}` : row.material)).join("|");

/** Rows of a text of an address, all of them new. */
const filmRows = (text) => text.split("|").map((part) => {
  const at = part.lastIndexOf("@");
  return at < 0 ? { material: part } : { material: part.slice(0, at), thickness: part.slice(at + 1) };
});

/**
 * The list of layers: `show(rows, words)` takes those of a scene, `refuse(sentences)` puts one beside each row.
 * `changed(rows)` is called with rows for the engine and returns a promise of the end of the change, `opened(file)` one of
 * the word of a file of n and k. What is typed while the list is made anew stays: `remember()` goes before that.
 */
class LayerList {
  constructor(id, changed, opened) {
    Object.assign(this, { id, changed, opened, rows: [], words: [], typed: null, pending: Promise.resolve(), busy: false });
    this.list = make("datalist", { id: `${id}-materials` });
    this.body = make("div");
    this.summary = make("summary", {}, "Layers");
    this.details = make("details", { open: true }, this.summary, this.body, this.list);
    this.element = make("fieldset", { class: "layers" }, make("legend", {}, "Materials and layers"), this.details);
  }

  show(rows, words) {
    this.element.hidden = !rows;
    this.remember();
    const kept = rows?.length === this.rows.length ? this.typed : [];
    this.typed = null;
    if (!rows) return;
    this.rows = rows.map((row) => ({ ...row }));
    if (words.length !== this.words.length) this.list.replaceChildren(...words.map((value) => make("option", { value })));
    this.words = words;
    this.summary.textContent = rows.map((row) => row.material ?? "mixed").join(" | ");
    this.#draw([], kept);
  }

  /** Keeps texts that no change has taken yet; fields are quiet until they are made anew. */
  remember() {
    this.typed ??= this.rows.flatMap((row, at) => Object.entries(row.inputs ?? {})
      .map(([key, input]) => ({ at, key, text: input.value, active: input === document.activeElement, range: [input.selectionStart, input.selectionEnd] }))
      .filter(({ key, text, active }) => active || text !== (row[key] ?? "")));
  }

  /** Constants follow the sliders of their index, `values` by name. */
  follow(values) {
    for (const row of this.rows) {
      const n = values[row.index];
      if (n === undefined || row.field === document.activeElement || row.field.value !== row.material) continue;
      const k = values[row.index.replace(/n$/, "k")];
      row.material = row.field.value = `${short(n)}${k ? `+${short(k)}j` : ""}`;
    }
  }

  refuse(sentences) {
    this.remember();
    const kept = this.typed;
    this.typed = null;
    this.#draw(sentences, kept);
    if (!kept.some(({ active }) => active)) this.body.querySelector("[aria-invalid]")?.focus();
  }

  #draw(sentences, kept) {
    const shown = this.rows.map((row, at) => this.#row(row, at, sentences[at] ?? ""));
    const add = make("button", { type: "button", onclick: () => this.#after(() => this.#add()) }, "+ layer");
    shown.splice(1, 0, make("p", { class: "buttons" }, add, make("span", { class: "soft" }, "below the ambient")));
    this.body.replaceChildren(...shown);
    for (const { at, key, text, active, range } of kept) {
      const input = this.rows[at].inputs[key];
      if (!input) continue;
      input.value = text;
      if (active) { input.focus(); input.setSelectionRange(...range); } else this.#after(() => this.#take(this.rows[at], key));
    }
  }

  #row(row, at, sentence) {
    const layer = at > 0 && at < this.rows.length - 1;
    const name = layer ? `layer ${at}${/ \(.*\)/.exec(row.part)?.[0] ?? ""}` : row.part;
    const about = `${this.id}-row-${at}`;
    const wrong = sentence ? { "aria-invalid": "true", "aria-describedby": about } : {};
    const input = (key, label, more) => make("input", {
      type: "text", value: row[key] ?? "", autocomplete: "off", spellcheck: "false", "aria-label": `${label} of ${name}`, ...wrong, ...more,
      onchange: () => this.#take(row, key), onblur: () => this.#take(row, key), // a text that was put back has no change
      onkeydown: (event) => { if (event.key === "Enter") this.#take(row, key); },
    });
    row.field = input("material", "material", { list: this.list.id, disabled: row.material === null, placeholder: row.material === null ? "mixed" : "name, index or model" });
    const thickness = layer && row.thickness !== null
      ? [input("thickness", "thickness in nm", { class: "bounds", placeholder: "0:1000", title: "Thickness in nm: FROM:TO for a slider, or one number" }), make("span", { class: "soft" }, "nm")] : [];
    row.inputs = { material: row.field, ...(thickness.length ? { thickness: thickness[0] } : {}) };
    const chooser = make("input", { type: "file", hidden: true, tabindex: -1, "aria-hidden": "true", onchange: () => this.#open(row, chooser.files[0]) });
    const button = (text, label, onclick, disabled = false) => make("button", { type: "button", onclick, disabled, "aria-label": label, title: label }, text);
    const moves = layer ? [
      button("↑", `Move ${name} up`, () => this.#after(() => this.#move(at)), at === 1),
      button("×", `Remove ${name}`, () => this.#after(() => this.#remove(at)), this.rows.length === 3)] : [];
    const element = make("div", { class: "row", role: "group", "aria-label": name },
      make("div", { class: "line" }, make("span", { class: "part" }, name),
        ...(row.material === null ? [] : [button("n, k…", `File of n and k for ${name}`, () => chooser.click())]), ...moves, chooser),
      make("div", { class: "line" }, row.field, ...thickness), make("p", { id: about, class: "bad", hidden: !sentence }, sentence));
    element.addEventListener("drop", (event) => {
      const [file] = event.dataTransfer.files;
      if (!file || row.material === null) return;
      event.preventDefault();
      this.#open(row, file);
    });
    return element;
  }

  /** Acts when no change is under way: rows then are those of the engine. */
  #after(action) {
    this.pending = this.pending.then(action, action);
  }

  /** Takes the text of a field; one that is typed during a change is taken when that has ended. */
  #take(row, key) {
    const text = row.inputs[key].value.trim();
    if (this.busy || this.typed || text === (row[key] ?? "")) return;
    row[key] = text;
    (row.edited ??= new Set()).add(key);
    this.#after(() => this.#tell());
  }

  async #open(row, file) {
    const word = file && await this.opened(file);
    if (!word) return;
    row.field.value = word;
    this.#take(row, "material");
  }

  #add() {
    const material = this.rows.at(-1).material === "SiO2" ? "TiO2" : "SiO2";
    this.rows.splice(1, 0, { part: "", was: null, material, thickness: "0:1000" });
    return this.#tell();
  }

  #move(at) {
    this.rows.splice(at - 1, 2, this.rows[at], this.rows[at - 1]);
    return this.#tell();
  }

  #remove(at) {
    this.rows.splice(at, 1);
    return this.#tell();
  }

  #tell() {
    const text = (row, key) => (row.was === null || row.edited?.has(key) ? row[key] : null);
    this.busy = true;
    return this.changed(this.rows.map((row) => ({ was: row.was ?? null, material: text(row, "material"), thickness: text(row, "thickness") })))
      .finally(() => { this.busy = false; });
  }
}
