// Angles of incidence: a list to edit, which stands in place of the slider where it has several.

/** Numbers of a text such as "65, 70 75"; null for an empty one. What is no number becomes NaN. */
function anglesOf(text) {
  const words = (text ?? "").split(/[\s,;°]+/).filter(Boolean);
  return words.length ? words.map(Number) : null;
}

/**
 * The list of angles: `show(scene)` takes the description of a scene, `refuse(sentence)` marks what was typed.
 * `changed(angles)` is called with the numbers that were typed, null for none.
 */
class AngleList {
  constructor(id, changed) {
    this.input = make("input", {
      type: "text", id, autocomplete: "off", spellcheck: "false", placeholder: "65, 70, 75", "aria-describedby": `${id}-about`,
      onchange: () => changed(anglesOf(this.input.value)),
    });
    this.name = make("label", { for: id });
    this.about = make("p", { id: `${id}-about`, class: "soft" });
    this.element = make("div", { class: "control angles" }, this.name, this.input, this.about);
  }

  show({ angles, at_one_wavelength: nm }) {
    const several = angles?.length > 1;
    const unit = make("span", { class: "soft" }, " (°)");
    this.name.replaceChildren(several ? "angles of incidence" : "several angles", unit);
    this.input.value = several ? angles.map((angle) => short(angle, 8)).join(", ") : "";
    this.input.removeAttribute("aria-invalid");
    this.name.hidden = this.input.hidden = nm !== null;
    this.about.textContent = several ? "One curve for each. A single angle has a slider."
      : nm !== null ? `The curve is drawn against the angle of incidence, since there is one wavelength, ${short(nm)} nm.`
        : "A list of angles, with a curve for each, takes the place of the slider.";
  }

  refuse() {
    this.input.setAttribute("aria-invalid", "true");
  }
}
