// Buttons that fit and that identify, and what they say.

const PROGRESS_EVERY = 400; // ms between questions about a fit

/** Status with its colour, and the verdict. */
const verdict = (answer) => make("p", { class: `verdict ${answer.tone}` }, make("strong", {}, `${answer.status}:`), ` ${answer.verdict}`);

const folded = (title, text) => make("details", {}, make("summary", {}, title), make("pre", { tabindex: 0 }, text));

/**
 * Buttons and what follows them, `said`: `ask(request, body)` asks the engine, `progress()` returns a promise of the
 * state of a fit, `body()` has the values of the sliders and `found(answer)` takes the numbers of a fit, `taken(number)` a film.
 */
class FitActions {
  constructor({ ask, progress, body, found, taken }) {
    Object.assign(this, { ask, progress, body, found, taken });
    const button = (text, onclick, more) => make("button", { type: "button", onclick, ...more }, text);
    this.fit = button("Fit", () => this.#run(), { class: "fit", disabled: true, title: "Fits the marked sliders to the data" });
    this.stop = button("Stop", () => ask("fit_stop"), { hidden: true });
    this.which = button("Which film?", () => this.#identify(), { class: "fit which", disabled: true, title: "Looks for the films on this substrate that describe the data" });
    this.said = make("div", { class: "fitted", role: "status" });
    this.buttons = [this.fit, this.stop, this.which];
  }

  set disabled(wanted) {
    this.fit.disabled = this.which.disabled = wanted;
  }

  clear() {
    this.said.textContent = "";
  }

  async #run() {
    this.disabled = true;
    this.stop.hidden = false;
    if (document.activeElement === document.body) this.stop.focus(); // the button that had it is disabled
    this.said.textContent = "Fitting …";
    const timer = setInterval(async () => {
      const { running, text } = await this.progress();
      if (running && text && !this.stop.hidden) this.said.textContent = `Fitting: ${text} …`;
    }, PROGRESS_EVERY);
    const answer = await this.ask("fit", this.body(true));
    clearInterval(timer);
    this.disabled = false;
    if (document.activeElement === this.stop) this.fit.focus();
    this.stop.hidden = true;
    this.clear();
    if (answer.error) return;
    if (!answer.values) { // stopped
      this.said.textContent = "The fit was stopped; the sliders are as they were.";
      return;
    }
    this.found(answer);
    this.said.replaceChildren(verdict(answer));
    if (answer.summary) this.said.append(folded("Summary of the fit", answer.summary));
  }

  async #identify() {
    this.disabled = true;
    this.said.textContent = "Trying films on this substrate …";
    const answer = await this.ask("identify", this.body(false));
    this.disabled = false;
    this.which.focus();
    this.clear();
    if (answer.error) return;
    const rows = answer.hypotheses.map(({ name, text }, number) => make("li", {},
      make("button", { type: "button", onclick: () => this.taken(number) }, `Show ${name}`), ` ${text}`));
    this.said.replaceChildren(verdict(answer), make("ol", { class: "hypotheses", "aria-label": "Films that the data leave" }, ...rows),
      folded("All that was tried", answer.summary));
  }
}
