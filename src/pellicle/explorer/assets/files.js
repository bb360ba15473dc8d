// Files of data: a button, a place to drop them, and texts to copy or to save.

/** A button and a target for dropped files: `take(file)` gets each. Returns its element and a function that ends it. */
function fileZone(take, target, marked) {
  const chooser = make("input", {
    type: "file", hidden: true, tabindex: -1, "aria-hidden": "true",
    onchange: () => {
      if (chooser.files.length) take(chooser.files[0]);
      chooser.value = "";
    },
  });
  const element = make("p", {}, make("button", { type: "button", onclick: () => chooser.click() }, "Open data…"), chooser,
    make("span", { class: "soft" }, " or drop a file here"));
  let depth = 0; // of nested elements that a dragged file has entered
  const over = (change) => (event) => {
    if (![...(event.dataTransfer?.types ?? [])].includes("Files")) return;
    event.preventDefault();
    depth = Math.max(depth + change, 0);
    marked.classList.toggle("dropping", depth > 0);
  };
  const drop = (event) => {
    const taken = event.defaultPrevented; // by a field of a material
    event.preventDefault();
    depth = 0;
    marked.classList.remove("dropping");
    if (event.dataTransfer.files.length && !taken) take(event.dataTransfer.files[0]);
  };
  const listeners = { dragenter: over(1), dragover: over(0), dragleave: over(-1), drop };
  for (const [name, listener] of Object.entries(listeners)) target.addEventListener(name, listener);
  const end = () => {
    for (const [name, listener] of Object.entries(listeners)) target.removeEventListener(name, listener);
  };
  return { element, end };
}

/** Copies a text and says so on the button. */
async function copyText(text, button, place) {
  const label = button.textContent;
  try {
    await navigator.clipboard.writeText(text);
  } catch { // no permission: selected text and the old command
    const area = make("textarea", { class: "offscreen" });
    area.value = text;
    place.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
    button.focus();
  }
  button.textContent = "Copied";
  setTimeout(() => { button.textContent = label; }, 1500);
}

/** A dialog that shows a text to copy or to save: its element, and a function `show(title, text, name of the file)`. */
function textDialog(id) {
  const code = make("code");
  const title = make("h2", { id: `${id}-dialog` });
  const copy = make("button", { type: "button", onclick: () => copyText(code.textContent, copy, element) }, "Copy");
  const save = make("a", { class: "button", download: "" }, "Download");
  const close = make("button", { type: "button", onclick: () => element.close() }, "Close");
  const how = make("p", { class: "soft" });
  const element = make("dialog", { "aria-labelledby": title.id }, title, make("pre", { tabindex: 0 }, code), how,
    make("p", { class: "buttons" }, copy, save, close));
  const show = (heading, text, name, command) => {
    title.textContent = heading;
    how.textContent = command;
    code.textContent = text;
    URL.revokeObjectURL(save.href);
    save.href = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
    save.download = name;
    element.showModal();
  };
  return { element, show };
}
