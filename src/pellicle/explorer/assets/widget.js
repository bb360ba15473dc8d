// The explorer in a notebook: requests are messages to the kernel, and `values` are a trait of the model.

const ANSWER_WITHIN = 20_000; // ms; a kernel that runs a cell answers after it

/** Light or dark as the notebook is, where it says so: JupyterLab or Visual Studio Code. */
function notebookTheme() {
  const { jpThemeLight, vscodeThemeKind } = document.body.dataset;
  if (jpThemeLight) return jpThemeLight === "true" ? "light" : "dark";
  if (vscodeThemeKind) return vscodeThemeKind.includes("light") ? "light" : "dark";
  return null;
}

async function render({ model, el }) {
  const view = Math.random().toString(36).slice(2); // other views of the model hear the same answers
  const waiting = new Map();
  let count = 0;
  const receive = ({ id, answer }) => {
    waiting.get(id)?.(answer);
    waiting.delete(id);
  };
  const call = (request, body) => new Promise((resolve, reject) => {
    const id = `${view}-${++count}`;
    waiting.set(id, resolve);
    model.send({ id, request, body });
    if (request === "fit") return;
    setTimeout(() => {
      if (waiting.delete(id)) reject(new Error("The notebook's kernel does not answer: it is busy, or has ended."));
    }, ANSWER_WITHIN);
  });
  model.on("msg:custom", receive);
  const element = document.createElement("div");
  el.append(element);
  const explorer = await explore(element, call, { plotly: PLOTLY, theme: notebookTheme });
  if (explorer === null) return;

  const same = (one, other) => Object.entries(one).every(([name, value]) => other[name] === undefined || other[name] === value);
  let own = false; // a change of this view
  const fromKernel = async () => {
    if (own) return;
    const [wanted, angles] = [model.get("values"), model.get("angles")];
    if (String(angles) !== String(explorer.angles())) await explorer.list(angles.length ? angles : null, wanted);
    else if (!same(wanted, explorer.values())) explorer.set(wanted);
  };
  element.addEventListener("changed", (event) => {
    own = true;
    model.set("angles", event.detail.angles);
    model.set("values", event.detail.values);
    own = false;
    model.save_changes();
  });
  fromKernel();
  model.on("change:values", fromKernel);
  model.on("change:angles", fromKernel);
  const themes = new MutationObserver(explorer.redraw);
  themes.observe(document.body, { attributeFilter: ["data-jp-theme-light", "data-vscode-theme-kind"] });
  return () => {
    model.off("msg:custom", receive);
    model.off("change:values", fromKernel);
    model.off("change:angles", fromKernel);
    themes.disconnect();
    explorer.close();
  };
}

export default { render };
