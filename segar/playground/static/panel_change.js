/** The panel in which a level is changed: its things and parameters by sliders and numbers, and the level as text. */

import { download, drawn, make, panel, short } from "segar/elements.js";
import { asText, fileText, levelData, readLevel } from "segar/level_text.js";

const HIDDEN = new Set(["Acceleration", "Drag", "Alive", "Done", "Order"]); // set by rules, or of no effect in people's pictures
const STEPS = 200;

export function changePanel(page) {
  const say = make("p", { className: "note", role: "status" });
  const things = make("select", { "aria-label": "Thing" });
  const kinds = make("select", { "aria-label": "Kind of the thing" });
  const factors = make("div");
  const text = make("textarea", { spellcheck: false, "aria-label": "The level as JSON" });
  const moving = make("input", { type: "checkbox" });
  const element = panel(
    "Change this level", false,
    make("label", {}, moving, " move things by dragging, instead of hitting"),
    make("div", { className: "controls" }, things, kinds,
      make("button", { textContent: "Undo", onclick: () => change(() => page.levels.undo()) })),
    factors, say,
    make("details", {}, make("summary", { textContent: "The level as text (JSON)" }), text,
      make("div", { className: "controls" },
        make("button", { textContent: "Use this text", onclick: () => useText() }),
        make("button", { textContent: "Save as file", onclick: () => download(`level-${page.level}.json`, fileText(page.levels, [page.level])) }))),
  );
  moving.addEventListener("change", () => { page.moving = moving.checked; });
  things.addEventListener("change", () => { page.marked = Number(things.value); page.refresh(); update(); });
  kinds.addEventListener("change", () => change(() => page.levels.setKind(page.level, page.marked, Number(kinds.value))));
  element.addEventListener("toggle", () => update());

  /** Change the level, start it anew, and say what went wrong where it is. */
  function change(how, settled = true) {
    try {
      how();
      say.textContent = "";
    } catch (error) {
      if (!(error instanceof RangeError)) throw error;
      say.textContent = error.message;
    }
    page.player.start(page.level);
    if (settled) update();
  }

  /** Make the level what the text says; where it is wrong, the text stays, and the wrong place in it is selected. */
  function useText() {
    const written = text.value;
    change(() => readLevel(page.levels, page.level, written));
    if (say.textContent === "") return;
    text.value = written;
    const [start, end] = placeOf(say.textContent, written);
    const before = written.slice(0, start).split("\n");
    say.textContent += ` (line ${before.length}, column ${before.at(-1).length + 1} of the text)`;
    text.focus();
    text.setSelectionRange(start, end);
  }

  function update() {
    if (!element.open) return;
    const { levels, level } = page;
    const { about } = levels;
    things.replaceChildren(...about.slots.map((slot, k) => make("option", { value: k, textContent: named(slot, about.kinds[levels.kindOf(level, k)]), selected: k === page.marked })));
    const present = levels.kindOf(level, page.marked);
    kinds.replaceChildren(...levels.kindsOf(page.marked).map((kind) =>
      make("option", { value: kind, textContent: kind < 0 ? "(not there)" : about.kinds[kind].name, selected: kind === present || (kind < 0 && present < 0) })));
    kinds.disabled = kinds.options.length < 2;
    const rows = [];
    for (const name of about.kinds[present]?.holds ?? []) {
      const numbers = levels.factor(level, page.marked, name);
      if (HIDDEN.has(name)) continue;
      numbers.forEach((x, k) => rows.push(row(
        { label: numbers.length > 1 ? `${name} ${"xy"[k] ?? k}` : name, unit: about.factors[name].unit, value: x,
          whole: about.factors[name].whole, flag: about.factors[name].flag, prior: priorOf(about.slots[page.marked].name, name),
          range: about.factors[name].flag ? [0, 1] : rangeOf(about.factors[name].bounds, name, k, x) },
        (value) => levels.setFactor(level, page.marked, name, numbers.with(k, value)),
      )));
    }
    about.parameters.forEach((name, k) => {
      const x = levels.parameters(level)[k];
      rows.push(row(
        { label: `world: ${name}`, unit: about.worlds[name].unit, value: x, prior: priorOf(null, name), range: [Math.min(0, 2 * x), Math.max(1, 2 * x)] },
        (value) => levels.setParameter(level, name, value),
      ));
    });
    factors.replaceChildren(...rows);
    text.value = asText(levelData(levels, level));
  }

  /** A slot by its name, with the kind of thing where the name does not say it. */
  function named(slot, kind) {
    return !kind || kind.name.toLowerCase().includes(slot.name.toLowerCase()) ? slot.name : `${slot.name}: ${kind.name}`;
  }

  function priorOf(entity, factor) {
    return page.levels.about.priors.find((one) => one.factor === factor && (one.entity === entity || (entity === null && !page.levels.about.slots.some((slot) => slot.name === one.entity))));
  }

  /** The ends of a slider: the factor's bounds, else where the levels of this page are, widened. */
  function rangeOf(bounds, name, k, value) {
    if (bounds && bounds[1] - bounds[0] < 1e3) return bounds;
    if (name === "Position") return [-page.levels.about.walls, page.levels.about.walls];
    const { levels } = page;
    const column = levels.about.columns[name] + k;
    let [low, high] = [value, value];
    for (let level = 0; level < levels.count; level++) {
      for (let slot = 0; slot < levels.slots; slot++) {
        const x = levels.values(level, slot)[column];
        if (Number.isFinite(x)) [low, high] = [Math.min(low, x), Math.max(high, x)];
      }
    }
    const more = Math.max((high - low) / 4, 0.5);
    const { negative, zero } = levels.about.factors[name];
    const least = negative ? -Infinity : zero ? 0 : (high + more) / STEPS;
    return [Math.max(low - more, bounds ? bounds[0] : least), Math.min(high + more, bounds ? bounds[1] : Infinity)];
  }

  function row({ label, unit, value, whole, flag, prior, range: [low, high] }, set) {
    const id = `factor-${label.replace(/\W+/g, "-")}`;
    const step = flag || whole ? 1 : (high - low) / STEPS;
    const slider = make("input", { type: "range", min: low, max: high, step: step || "any", value, "aria-label": `${label}, slider` });
    const box = make("input", { type: "number", step: "any", value, id });
    slider.addEventListener("input", () => { box.value = slider.value; change(() => set(Number(slider.value)), false); });
    slider.addEventListener("change", () => update());
    box.addEventListener("change", () => change(() => set(box.value.trim() === "" ? NaN : Number(box.value))));
    const middle = make("div", {}, ...(prior ? [density(prior, low, high)] : []), slider);
    return make("div", { className: "factor" }, make("label", { for: id, title: prior?.law ?? "" }, `${label}${unit ? ` [${unit}]` : ""}`), middle, box);
  }

  return { element, update };
}

/** Where in a text an error is: at the position that the browser names, else at the last of the names in it that is found. */
function placeOf(error, text) {
  const [, position] = /position (\d+)/.exec(error) ?? [];
  const [, line, column] = /line (\d+) column (\d+)/.exec(error) ?? [];
  const lines = text.split("\n");
  if (position) return [Number(position), Number(position) + 1];
  if (line) {
    const start = lines.slice(0, Number(line) - 1).join("\n").length + Math.min(Number(line) - 1, 1) + Number(column) - 1;
    return [start, start + 1];
  }
  if (error.startsWith("the text is no JSON")) return [text.length, text.length];
  let [start, end] = [0, 0];
  const named = /there is no "((?:[^"\\]|\\.)*)"/.exec(error);
  for (const name of [...(error.split(/[: ]/)[0].split(".")), ...(named ? [named[1]] : [])]) {
    const found = text.indexOf(`"${name}"`, end);
    if (found >= 0) [start, end] = [found, found + name.length + 2];
  }
  return [start, end];
}

/** The prior's density over the range of a slider. */
function density({ low, high, bins, law }, from, to) {
  const about = { viewBox: "0 0 100 22", preserveAspectRatio: "none", role: "img", "aria-label": `prior: ${law}` };
  const svg = drawn("svg", about);
  const most = Math.max(...bins);
  const width = short(Math.max((high - low) / bins.length, (to - from) / 200) / (to - from) * 100);
  bins.forEach((mass, k) => {
    const x = short((low + k * (high - low) / bins.length - from) / (to - from) * 100);
    svg.append(drawn("rect", { x, y: short(22 - 22 * mass / most), width, height: short(22 * mass / most) }));
  });
  return svg;
}
