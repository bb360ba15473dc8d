// Fields for the options of reading a file: its units, columns, signal and range.

/**
 * Folded fields below the notes of a file: `show(fields, name, texts, notes)`, `need(fields)` opens those that a message
 * names. `changed(texts)` is called with the text of each field by its name.
 */
class ReadingFields {
  constructor(id, changed) {
    Object.assign(this, { id, changed, inputs: new Map() });
    this.notes = make("ul", { class: "notes soft" });
    this.fields = make("div", { class: "fields" });
    this.summary = make("summary");
    this.element = make("details", { class: "how", hidden: true }, this.summary, this.notes, this.fields);
  }

  /** Makes the fields of an engine, once. */
  make(fields) {
    if (this.inputs.size || !fields) return;
    for (const { name, label, help, form, words } of fields) {
      const id = `${this.id}-${name}`;
      const input = make("input", {
        type: "text", id, title: help, placeholder: form, autocomplete: "off", spellcheck: "false", list: words.length ? `${id}-words` : null,
        onchange: () => this.changed(this.texts()),
      });
      this.inputs.set(name, input);
      this.fields.append(make("div", {}, make("label", { for: id }, label), input,
        ...(words.length ? [make("datalist", { id: `${id}-words` }, ...words.map((value) => make("option", { value })))] : [])));
    }
  }

  texts() {
    return Object.fromEntries([...this.inputs].map(([name, input]) => [name, input.value.trim()]));
  }

  show(name, texts, notes) {
    this.name = name;
    this.element.hidden = name === null;
    this.summary.textContent = `How ${name} is read`;
    this.notes.replaceChildren(...notes.map((text) => make("li", {}, text)));
    for (const [key, input] of this.inputs) {
      input.value = texts[key] ?? "";
      input.removeAttribute("aria-invalid");
    }
  }

  /** Opens the fields for a file that cannot be read without some of them. */
  need(name, fields) {
    if (!fields?.length) return;
    if (name !== this.name) this.show(name, {}, []); // the notes are of the file before
    this.element.open = true;
    for (const [key, input] of this.inputs) input.toggleAttribute("aria-invalid", fields.includes(key));
    for (const key of fields) this.inputs.get(key)?.setAttribute("aria-invalid", "true");
    this.inputs.get(fields[0])?.focus();
  }
}
