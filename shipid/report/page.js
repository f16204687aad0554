"use strict";
(() => {
  const CONFIG = { responsive: true, displayModeBar: false, showTips: false, scrollZoom: false };
  const root = document.documentElement;
  if (typeof DecompressionStream === "undefined") {
    document.getElementById("too-old").hidden = false;
    return;
  }

  // Plotly and the data of figures lie in the page compressed.
  function bytesOf(base64) {
    const text = atob(base64), bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    return bytes;
  }

  async function unpacked(element) {
    return new Response(new Response(bytesOf(element.textContent)).body.pipeThrough(new DecompressionStream("deflate"))).text();
  }

  function once(make) {
    let made = null;
    return () => (made ??= make());
  }

  const json = async (element) => JSON.parse(await unpacked(element));
  const plotly = once(async () => {
    const script = document.createElement("script");
    script.textContent = await unpacked(document.getElementById("plotly"));
    document.head.append(script);
  });

  // Figures name CSS variables instead of colours: one figure serves the light, the dark and the printed page.
  function painted(value, style) {
    if (typeof value === "string") {
      const name = /^var\((--[\w-]+)\)$/.exec(value);
      return name ? style.getPropertyValue(name[1]).trim() : value;
    }
    if (Array.isArray(value)) return value.map((item) => painted(item, style));
    if (value && typeof value === "object") {
      return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, painted(item, style)]));
    }
    return value;
  }

  // Paper is narrower than most windows: A4 without its margins, in two columns where a figure has several panels.
  const PAPER = 660;
  const onPaper = (plot) => PAPER / (plot.closest(".panels.many, .head") ? 2 : 1) - 20;

  function draw(plot, spec, hidden, view) {
    const { data, layout } = painted(spec, getComputedStyle(root));
    for (const trace of data) trace.visible = !(trace.meta || []).some((key) => hidden.has(key));
    // Dragging would catch a finger that only wants to scroll the page.
    const coarse = matchMedia("(pointer: coarse)").matches;
    layout.dragmode = coarse ? false : "zoom";
    layout.uirevision = view;
    if (root.dataset.theme) layout.width = onPaper(plot);
    Plotly.react(plot, data, layout, CONFIG);
  }

  // Every figure can be taken away: as an image, or as the numbers of its lines.
  const TYPES = { f4: Float32Array, f8: Float64Array, i1: Int8Array, i2: Int16Array, i4: Int32Array,
                  u1: Uint8Array, u2: Uint16Array, u4: Uint32Array };

  // What a trace holds: a list, or numbers written as bytes (single precision has seven digits).
  function values(given) {
    if (!given?.bdata) return [...(given || [])];
    const list = [...new TYPES[given.dtype](bytesOf(given.bdata).buffer)];
    return given.dtype === "f4" ? list.map((value) => (Number.isFinite(value) ? Number(value.toPrecision(7)) : "")) : list;
  }

  function csv(plot) {
    const rows = [["line", "x", "y", "shown", "text"]];
    const plain = (text) => String(text ?? "").replace(/<br>/g, "; ").replace(/<[^>]*>/g, "");
    for (const trace of plot.data) {
      if (trace.z) continue; // cells are in a table
      const x = values(trace.x), y = values(trace.y);
      const words = [trace.customdata, trace.text].find(Array.isArray) || [];
      x.forEach((value, i) => rows.push(
        [trace.name || "", value ?? "", y[i] ?? "", trace.visible === false ? 0 : 1, plain(words[i])]));
    }
    const cell = (value) => (/[",\n]/.test(value) ? `"${String(value).replace(/"/g, '""')}"` : value);
    return rows.map((row) => row.map(cell).join(",")).join("\n") + "\n";
  }

  function save(figure, kind) {
    figure.querySelectorAll(".plot").forEach((plot, i) => {
      const filename = `${document.title.split(":")[0]}-${figure.id}${i ? `-${i + 1}` : ""}`.replace(/[^\w.-]+/g, "-");
      if (kind !== "csv") {
        Plotly.downloadImage(plot, { format: kind, filename, width: plot.clientWidth, height: plot.clientHeight, scale: 2 });
        return;
      }
      const link = document.createElement("a");
      link.href = URL.createObjectURL(new Blob([csv(plot)], { type: "text/csv" }));
      link.download = `${filename}.csv`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  }

  // Every figure: its hidden lines, its controls, `load` which unpacks its data, and `redraw` which reads all of them.
  const jobs = [];
  function setUp(figure, load, redraw) {
    const hidden = new Set();
    const job = { figure, drawn: false, data: null };
    job.load = once(async () => {
      const data = await load();
      await plotly();
      job.data = data;
    });
    job.draw = () => {
      job.drawn = true;
      watcher.unobserve(figure);
      redraw(job.data, hidden);
    };
    const update = () => { if (job.drawn) job.draw(); };
    for (const chip of figure.querySelectorAll(".chips button")) {
      chip.addEventListener("click", () => {
        const shown = chip.getAttribute("aria-pressed") === "true";
        chip.setAttribute("aria-pressed", String(!shown));
        if (shown) hidden.add(chip.dataset.key);
        else hidden.delete(chip.dataset.key);
        update();
      });
    }
    for (const control of figure.querySelectorAll(".control")) control.addEventListener("input", update);
    for (const button of figure.querySelectorAll(".save button")) {
      button.addEventListener("click", () => { if (job.drawn) save(figure, button.dataset.kind); });
    }
    jobs.push(job);
    watcher.observe(figure);
  }

  // A figure is drawn when it comes near the window, so that the first is there at once.
  const near = new Set();
  const watcher = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (isIntersecting) near.add(target);
      else near.delete(target);
    }
    drawNear();
  }, { rootMargin: "600px" });

  const pause = () => new Promise((resolve) => setTimeout(resolve));
  const idle = () => new Promise((resolve) => (window.requestIdleCallback || setTimeout)(resolve));

  // One figure at a time, those in the window first: a long page answers to the reader in between.
  let drawing = false;
  async function drawNear() {
    if (drawing) return;
    drawing = true;
    const inside = ({ figure }) => figure.getBoundingClientRect().top < innerHeight;
    for (;;) {
      const waiting = jobs.filter((job) => !job.drawn && near.has(job.figure));
      const job = waiting.find(inside) || waiting[0];
      if (!job) break;
      await job.load();
      if (!job.drawn) job.draw();
      await pause();
    }
    drawing = false;
  }

  const chosen = (figure) =>
    [...figure.querySelectorAll("[data-control]")].map((control) =>
      Number(control.querySelector("input:checked, select")?.value ?? 0));

  // --- figures whose views were made beforehand
  for (const script of document.querySelectorAll("script.views")) {
    const figure = script.closest("figure");
    const plots = figure.querySelectorAll(".plot");
    setUp(figure, () => json(script), (views, hidden) => {
      const key = chosen(figure).join("-");
      const keys = new Set(views[key].flatMap((spec) => spec.data.flatMap((trace) => trace.meta || [])));
      for (const chip of figure.querySelectorAll(".chips button")) {
        chip.parentElement.hidden = !keys.has(chip.dataset.key); // the legend of this view
      }
      views[key].forEach((spec, i) => draw(plots[i], spec, hidden, key));
    });
  }

  // --- windows: true path, ship outline at start and end, predicted paths
  let windows = null;
  const loadWindows = once(async () => { windows = await json(document.getElementById("windows")); });

  function outlineAt(x, y, psi) {
    const [ahead, aside] = windows.outline;
    const turned = ahead.map((a, i) => [
      x + a * Math.cos(psi) - aside[i] * Math.sin(psi), y + a * Math.sin(psi) + aside[i] * Math.cos(psi)]);
    turned.push(turned[0]);
    return {
      x: turned.map((point) => point[1]), y: turned.map((point) => point[0]), mode: "lines", hoverinfo: "skip",
      line: { color: "var(--muted)", width: 1 }, fill: "toself", fillcolor: "var(--hull)",
    };
  }

  // Plotly reads tags in its texts.
  const escaped = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;");
  const pathsOf = (shot, size) => shot.paths.filter((path) => path[1] === size || path[1] === -1);

  function drawWindow(plot, shot, size, hidden, view) {
    const [x, y] = shot.truth;
    const end = x.length - 1;
    const truth = { x: y, y: x, mode: "lines", name: "true path", meta: ["truth"], line: windows.truth,
                    hovertemplate: "true path<extra></extra>" };
    const shown = pathsOf(shot, size);
    const lines = shown.map(([line, , ahead, aside]) => ({
      x: aside, y: ahead, mode: "lines", meta: windows.lines[line].keys, line: windows.lines[line].line,
      hovertemplate: `${escaped(windows.lines[line].name)}<extra></extra>`,
    }));
    const bands = shown.filter((path) => path.length > 5).map(([line, , , , , ahead, aside]) => ({
      x: aside, y: ahead, mode: "lines", meta: [...windows.lines[line].keys, "band"], hoverinfo: "skip",
      line: { color: windows.lines[line].line.color, width: 0.5 }, opacity: 0.15,
      fill: "toself", fillcolor: windows.lines[line].line.color,
    }));
    const data = [...bands, truth, outlineAt(0, 0, 0), outlineAt(x[end], y[end], shot.psi), ...lines];
    draw(plot, { data, layout: windows.layout }, hidden, view);
  }

  function showWind(place, wind) {
    place.hidden = !wind;
    if (!wind) return;
    if (wind[0] < 0.05) {
      place.textContent = "no wind"; // 0.0 m/s, from no direction
      return;
    }
    const degrees = ((Math.round((wind[1] * 180) / Math.PI) % 360) + 360) % 360; // psi counts on over whole turns
    place.innerHTML = `<svg viewBox="0 0 20 20" width="20" height="20" aria-hidden="true">
      <path transform="rotate(${degrees} 10 10)" d="M10 18V3M5 8l5-5 5 5"/></svg>`;
    place.append(`wind ${wind[0].toFixed(1)} m/s towards ${degrees}° from ahead`);
  }

  // as `length_text` in Python
  function lengthText(value) {
    const power = value >= 0.0000005 && value < 0.0995 ? Number(value.toExponential(1).split("e")[1]) : 0;
    return value.toFixed(Math.min(Math.max(1 - power, 2), 6));
  }

  const browser = document.getElementById("browser");
  if (browser) {
    const slider = browser.querySelector("input[type=range]");
    const list = browser.querySelector(".errors");
    let last = -1;
    setUp(browser, loadWindows, (_, hidden) => {
      const [run, size] = chosen(browser);
      const shots = windows.runs[run];
      slider.max = shots.length - 1;
      if (run !== last) slider.value = Math.floor(shots.length / 2);
      last = run;
      const shot = shots[slider.value];
      slider.setAttribute("aria-valuetext", `t = ${shot.t} s`);
      browser.querySelector(".where").textContent = `t = ${shot.t} s; instant ${Number(slider.value) + 1} of ${shots.length}`;
      showWind(browser.querySelector(".wind"), shot.wind);
      drawWindow(browser.querySelector(".plot"), shot, size, hidden, `${run}-${slider.value}`);
      list.replaceChildren(...pathsOf(shot, size).map((path) => {
        const { name, line } = windows.lines[path[0]];
        const item = document.createElement("li");
        item.innerHTML = `<svg class="swatch" viewBox="0 0 26 14" width="26" height="14" aria-hidden="true">
          <line x1="1" y1="7" x2="25" y2="7" class="${line.dash}" stroke-width="${line.width}"/></svg>`;
        item.firstChild.style.setProperty("--line", line.color);
        const error = document.createElement("span");
        error.className = "value";
        error.textContent = path[4] === null ? "diverged" : `${lengthText(path[4])} m`;
        item.append(name, error);
        return item;
      }));
    });
  }

  // --- tables sort by a press on a heading; what has no number comes last in either direction
  for (const table of document.querySelectorAll("table.sortable")) {
    const headings = [...table.tHead.rows[0].cells];
    headings.forEach((heading, column) => heading.addEventListener("click", () => {
      const down = heading.getAttribute("aria-sort") === "ascending";
      const numeric = !heading.classList.contains("words");
      for (const other of headings) other.removeAttribute("aria-sort");
      heading.setAttribute("aria-sort", down ? "descending" : "ascending");
      const key = (row) => row.cells[column].dataset.key ?? row.cells[column].textContent.toLowerCase();
      const compare = (a, b) => {
        const [left, right] = [key(a), key(b)];
        if (!numeric) return (down ? -1 : 1) * left.localeCompare(right);
        const missing = (Number(left) >= 1e300) - (Number(right) >= 1e300);
        return missing || (down ? -1 : 1) * (Number(left) - Number(right));
      };
      table.tBodies[0].append(...[...table.tBodies[0].rows].sort(compare));
    }));
  }

  const repaint = () => jobs.forEach((job) => { if (job.drawn) job.draw(); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  addEventListener("beforeprint", () => {
    root.dataset.theme = "light";
    for (const job of jobs) job.drawn ||= job.data !== null;
    for (const details of document.querySelectorAll("details")) details.open = true;
    repaint();
  });
  addEventListener("afterprint", () => {
    delete root.dataset.theme;
    repaint();
    document.querySelectorAll(".js-plotly-plot").forEach((plot) => Plotly.Plots.resize(plot));
  });

  // Printing cannot wait: what the reader has not come to yet is unpacked in idle time.
  async function loadAll() {
    for (const job of jobs) {
      await idle();
      await job.load();
    }
  }
  addEventListener("load", loadAll);
})();
