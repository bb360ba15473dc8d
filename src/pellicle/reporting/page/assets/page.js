// Figures, tables and buttons of a report. It loads nothing: Plotly and the numbers are in the page.
"use strict";
(() => {
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const drawn = new Map(); // figures in view, by the id of their element
  let chosen = null; // number of the rival that is shown

  // ---- Plotly, packed in the page ----
  async function library() {
    if (window.Plotly) return window.Plotly; // of a file that the pages of a batch share
    if (!document.getElementById("plotly")) throw new Error("plotly.min.js is missing in the folder above");
    const packed = document.getElementById("plotly").textContent.trim();
    const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
    const text = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.textContent = await new Response(text).text();
    document.head.append(script);
    return window.Plotly;
  }

  // ---- colours: "var(--name)" in the figures is that of the page, light or dark ----
  function themed(value, style) {
    if (typeof value === "string" && value.startsWith("var(")) {
      return style.getPropertyValue(value.slice(4, -1)).trim();
    }
    if (Array.isArray(value)) {
      return typeof value[0] === "number" ? value : value.map((each) => themed(each, style));
    }
    if (value !== null && typeof value === "object") {
      return Object.fromEntries(Object.entries(value).map(([key, each]) => [key, themed(each, style)]));
    }
    return value;
  }

  function draw(figure) {
    const element = document.getElementById(figure.id);
    const style = getComputedStyle(document.documentElement);
    const traces = figure.traces.concat(chosen === null ? [] : figure.rivals[chosen] || []);
    const coarse = window.matchMedia("(pointer: coarse)").matches;
    const layout = { ...figure.layout, dragmode: coarse ? false : "zoom", uirevision: "kept" };
    const name = document.title.replace(/[^\w.-]+/g, "_");
    const config = {
      responsive: true,
      displaylogo: false,
      modeBarButtonsToRemove: ["lasso2d", "select2d"],
      toImageButtonOptions: { format: "svg", filename: `${name}_${figure.id}` },
    };
    return window.Plotly.react(element, themed(traces, style), themed(layout, style), config);
  }

  async function show(figure) {
    if (drawn.has(figure.id)) return;
    drawn.set(figure.id, figure);
    const element = document.getElementById(figure.id);
    element.replaceChildren();
    await draw(figure);
    element.on("plotly_click", (event) => {
      const point = event.points.find((each) => each.customdata && "rival" in Object(each.customdata));
      if (point) choose(point.customdata.rival === chosen ? null : point.customdata.rival);
      const link = event.points.find((each) => each.customdata && "link" in Object(each.customdata));
      if (link) window.location.assign(link.customdata.link);
    });
    keys(element, figure);
    element.dataset.ready = "true";
  }

  // ---- rivals ----
  function choose(rival) {
    chosen = rival;
    for (const figure of drawn.values()) draw(figure);
    for (const button of document.querySelectorAll("button[data-rival]")) {
      const pressed = chosen !== null && Number(button.dataset.rival) === chosen;
      button.setAttribute("aria-pressed", String(pressed));
      button.closest("tr").classList.toggle("chosen", pressed);
    }
    const note = document.getElementById("rival-note");
    const button = document.querySelector(`button[data-rival="${rival}"]`);
    if (note) note.textContent = button ? `Shown beside the fit: ${button.dataset.about}` : "No rival is shown.";
  }

  for (const button of document.querySelectorAll("button[data-rival]")) {
    button.addEventListener("click", () => {
      const rival = Number(button.dataset.rival);
      choose(rival === chosen ? null : rival);
    });
  }

  // ---- keyboard: arrows read the points, + and - zoom, 0 shows all ----
  function reading(columns, at) {
    return columns
      .filter((column) => column.values[at] !== null)
      .map((column) => `${column.name} ${Number(column.values[at]).toPrecision(5)}`)
      .join(", ");
  }

  function zoom(element, factor, centre) {
    const [low, high] = element._fullLayout.xaxis.range;
    const middle = centre === null || centre < low || centre > high ? (low + high) / 2 : centre;
    const range = [middle - (middle - low) * factor, middle + (high - middle) * factor];
    window.Plotly.relayout(element, { "xaxis.range": range });
  }

  function keys(element, figure) {
    const { columns } = figure;
    const note = document.getElementById(`${figure.id}-reading`);
    let at = -1;
    element.addEventListener("keydown", (event) => {
      const steps = { ArrowRight: 1, ArrowLeft: -1, PageUp: 10, PageDown: -10 };
      if (event.key in steps && columns.length) {
        const last = columns[0].values.length - 1;
        at = Math.min(Math.max(at + steps[event.key], 0), last);
        note.textContent = reading(columns, at);
        try {
          window.Plotly.Fx.hover(element, { xval: columns[0].values[at] }, ["xy"]);
        } catch { /* a point outside the zoomed range has no label */ }
      } else if (event.key === "+" || event.key === "=" || event.key === "-") {
        zoom(element, event.key === "-" ? 2 : 0.5, at < 0 ? null : columns[0].values[at]);
      } else if (event.key === "0" || event.key === "Escape") {
        window.Plotly.relayout(element, { "xaxis.autorange": true });
        window.Plotly.Fx.unhover(element);
      } else {
        return;
      }
      event.preventDefault();
    });
  }

  // ---- the numbers of a figure as a table, made when it is unfolded ----
  for (const details of document.querySelectorAll("details[data-figure]")) {
    details.addEventListener("toggle", () => {
      const figure = figures.find((each) => each.id === details.dataset.figure);
      const place = details.querySelector(".scroll");
      if (!details.open || place.hasChildNodes()) return;
      const table = document.createElement("table");
      table.createCaption().textContent = figure.layout.meta || "";
      const head = table.createTHead().insertRow();
      for (const column of figure.columns) {
        const cell = document.createElement("th");
        cell.scope = "col";
        cell.className = "number";
        cell.textContent = column.name;
        head.append(cell);
      }
      const body = table.createTBody();
      const count = figure.columns.length ? figure.columns[0].values.length : 0;
      for (let row = 0; row < count; row += 1) {
        const line = body.insertRow();
        for (const column of figure.columns) {
          const cell = line.insertCell();
          cell.className = "number";
          cell.textContent = column.values[row] === null ? "" : String(column.values[row]);
        }
      }
      place.append(table);
    });
  }

  // ---- copying ----
  for (const button of document.querySelectorAll("button[data-copy]")) {
    button.addEventListener("click", async () => {
      const source = document.getElementById(button.dataset.copy);
      try {
        await navigator.clipboard.writeText(source.textContent);
      } catch { // pages from disk have no clipboard in some browsers
        const range = document.createRange();
        range.selectNodeContents(source);
        window.getSelection().removeAllRanges();
        window.getSelection().addRange(range);
        document.execCommand("copy");
      }
      button.textContent = "Copied";
      setTimeout(() => { button.textContent = "Copy"; }, 2000);
    });
  }

  // ---- one of several figures ----
  for (const select of document.querySelectorAll("select[data-shows]")) {
    select.addEventListener("change", () => {
      for (const part of document.getElementsByClassName(select.dataset.shows)) part.hidden = part.dataset.of !== select.value;
    });
  }

  // ---- sorting and filtering the table of a batch ----
  const table = document.querySelector("table[data-sortable]");
  if (table) {
    const body = table.tBodies[0];
    const value = (row, column) => row.cells[column].dataset.value ?? row.cells[column].textContent.trim();
    const order = (one, other) => {
      const [a, b] = [Number(one), Number(other)];
      if (one === "" || other === "") return one === other ? 0 : one === "" ? 1 : -1;
      return Number.isNaN(a) || Number.isNaN(b) ? one.localeCompare(other, undefined, { numeric: true }) : a - b;
    };
    for (const button of table.querySelectorAll("th button")) {
      button.addEventListener("click", () => {
        const head = button.closest("th");
        const falling = head.getAttribute("aria-sort") === "ascending";
        for (const other of table.querySelectorAll("th")) other.removeAttribute("aria-sort");
        head.setAttribute("aria-sort", falling ? "descending" : "ascending");
        const rows = [...body.rows].map((row) => [value(row, head.cellIndex), row]);
        rows.sort(([one], [other]) => {
          const found = order(one, other);
          return falling && one !== "" && other !== "" ? -found : found;
        });
        body.append(...rows.map(([, row]) => row));
      });
    }
    const text = document.getElementById("filter-text");
    const status = document.getElementById("filter-status");
    const count = document.getElementById("filter-count");
    const filter = () => {
      const wanted = text.value.toLowerCase();
      let left = 0;
      for (const row of body.rows) {
        const fits = !status.value || row.dataset.status === status.value;
        row.hidden = !(fits && row.textContent.toLowerCase().includes(wanted));
        left += row.hidden ? 0 : 1;
      }
      count.textContent = `${left} of ${body.rows.length} shown`;
    };
    text.addEventListener("input", filter);
    status.addEventListener("change", filter);
  }

  // ---- a page that is redrawn: new figures in place of those of the same names ----
  document.addEventListener("figures", (event) => {
    for (const figure of event.detail) {
      figures.splice(figures.findIndex((each) => each.id === figure.id), 1, figure);
      if (!drawn.has(figure.id)) continue;
      drawn.set(figure.id, figure);
      draw(figure);
    }
  });

  // ---- start: each figure is drawn when it comes near the window ----
  async function start() {
    if (!figures.length) return;
    await library();
    const seen = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        const figure = figures.find((each) => each.id === entry.target.id);
        if (entry.isIntersecting) show(figure);
      }
    }, { rootMargin: "800px" });
    for (const figure of figures) seen.observe(document.getElementById(figure.id));
    window.addEventListener("beforeprint", () => { for (const figure of figures) show(figure); });
    const dark = window.matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", () => { for (const figure of drawn.values()) draw(figure); });
  }

  start().catch((error) => {
    const note = document.getElementById("trouble");
    note.hidden = false;
    note.textContent = `The interactive figures cannot be drawn here (${error.message}); the pictures below show the same.`;
  });
})();
