// Elements of HTML, and sliders with their numbers.

const LOG_POSITIONS = 1000; // of a slider with a logarithmic scale
const RELEASE_AFTER = 300; // ms after the last key: several presses are one change
const LOG_STEPS = 200; // of the keyboard from one end to the other

/** Makes an element: its tag, attributes (`onclick` and others are listeners), and children. */
function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name.slice(2), value);
    else if (value !== null && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children);
  return element;
}

const short = (value, digits = 6) => String(Number(Number(value).toPrecision(digits)));

/** A slider with its number: `value` is in the unit of the control whatever the scale. */
class Control {
  constructor(about, id, changed) {
    const { label, unit, lower, upper } = about;
    this.about = about;
    this.value = about.value;
    this.log = about.scale === "log" && lower > 0;
    const bounds = this.log ? [0, LOG_POSITIONS] : [lower, upper];
    const place = { min: bounds[0], max: bounds[1], step: "any" };
    this.range = make("input", {
      type: "range", ...place, id: `${id}-range`, "data-control": about.name,
      "aria-label": unit ? `${label} in ${unit}` : label, title: "Double-click, or Delete, resets",
      oninput: () => { this.#take(this.#ofPosition(Number(this.range.value))); changed(this, true); },
      onchange: () => changed(this, false),
      ondblclick: () => { this.set(about.value); changed(this, false); },
      onkeydown: (event) => this.#key(event),
      onkeyup: (event) => { if (this.#steps(event) !== 0) this.#timer = setTimeout(() => changed(this, false), RELEASE_AFTER); },
    });
    this.number = make("input", {
      type: "number", id, step: about.step || "any", min: lower, max: upper, "data-control": about.name,
      inputmode: "decimal", autocomplete: "off",
      oninput: () => {
        const typed = this.number.valueAsNumber;
        if (typed >= lower && typed <= upper) { this.#take(typed, false); changed(this, true); }
      },
      onchange: () => { this.set(Number.isFinite(this.number.valueAsNumber) ? this.number.valueAsNumber : this.value); changed(this, false); },
    });
    this.error = make("p", { class: "error-of-fit", hidden: true });
    const name = make("label", { for: id }, label, unit ? make("span", { class: "soft" }, ` (${unit})`) : "");
    this.free = make("input", { type: "checkbox", checked: Boolean(about.free), "aria-label": `Fit ${label}` });
    const free = make("label", { class: "free", title: "Fitted to the data" }, this.free, "fit");
    const line = make("div", { class: "line" }, name, this.number, free);
    const ends = make("div", { class: "ends soft", "aria-hidden": "true" },
      make("span", {}, short(lower, 4)), make("span", {}, short(upper, 4)));
    this.element = make("div", { class: "control" }, line, this.error, this.range, ends);
    this.set(about.value);
  }

  /** Sets the value, within the bounds, and shows it. */
  set(value) {
    this.#take(Math.min(Math.max(value, this.about.lower), this.about.upper));
  }

  /** Shows the errors of a fit below the number, `{noise, expanded}`, or removes them. */
  note(errors) {
    const parts = errors ? [["95 %", errors.expanded], ["1σ noise", errors.noise]].filter(([, error]) => Number.isFinite(error)) : [];
    this.error.textContent = parts.map(([name, error]) => `± ${short(error, 2)} (${name})`).join(", ");
    this.error.hidden = !parts.length;
  }

  #take(value, write = true) {
    this.value = value;
    this.note(undefined);
    this.range.value = this.#position(value);
    this.range.setAttribute("aria-valuetext", `${short(value)} ${this.about.unit}`.trim());
    if (write) this.number.value = short(value);
  }

  #position(value) {
    const { lower, upper } = this.about;
    return this.log ? (LOG_POSITIONS * Math.log(value / lower)) / Math.log(upper / lower) : value;
  }

  #ofPosition(position) {
    const { lower, upper, step } = this.about;
    if (this.log) return Math.min(Math.max(Number((lower * (upper / lower) ** (position / LOG_POSITIONS)).toPrecision(4)), lower), upper);
    const rounded = step > 0 ? lower + Math.round((position - lower) / step) * step : position;
    return Math.min(Math.max(Number(rounded.toPrecision(12)), lower), upper);
  }

  #timer = null; // of the end of a change by keys

  #steps(event) {
    const count = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 };
    return (count[event.key] ?? 0) * (event.shiftKey ? 10 : 1);
  }

  #key(event) {
    const { lower, upper, step, value } = this.about;
    const steps = this.#steps(event);
    let wanted;
    if (event.key === "Home") wanted = lower;
    else if (event.key === "End") wanted = upper;
    else if (event.key === "Delete" || event.key === "Backspace") wanted = value;
    else if (steps !== 0) wanted = this.log ? this.value * (upper / lower) ** (steps / LOG_STEPS) : this.value + steps * (step || (upper - lower) / 100);
    else return;
    event.preventDefault();
    clearTimeout(this.#timer);
    this.range.value = this.#position(Math.min(Math.max(wanted, lower), upper));
    this.range.dispatchEvent(new Event("input", { bubbles: true }));
    if (steps === 0) this.range.dispatchEvent(new Event("change", { bubbles: true }));
  }
}
