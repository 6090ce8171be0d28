/** The panel of a page with two sets: their levels side by side, how far apart they are and in what. */

import { download, drawn, make, oneStop, panel, scroll, short, table, tableRow } from "segar/elements.js";
import { fileText } from "segar/level_text.js";
import { Measures, MOST } from "segar/measures.js";
import { Scene } from "segar/scene.js";

const SLICE = 8; // [ms] of measuring between two pictures
const SHOWN = 120; // levels of a wall at first, and more at each touch of a button
const PIXELS = 112; // of a thumbnail
const BINS = 24;
const [WIDE, HIGH] = [100, 40]; // of a histogram

export function designPanel(page) {
  const { sets, about } = page;
  const measures = new Measures(about.objective, sets);
  const value = make("p", { role: "status", className: "value" });
  const parts = table(null, ["part", "share of W2²"]);
  const cards = make("div", { className: "cards" });
  const unseen = make("ul");
  const walls = sets.map((_, k) => wall(page, k));
  const [python, settings] = [0, 1].map(() => make("pre", { tabIndex: 0 }));
  const note = make("p", { className: "note" });
  const saves = sets.map((set, k) => make("button", {
    textContent: `Save ${fileOf(page, k)}`,
    onclick: () => download(fileOf(page, k), fileText(set, set.levelNumbers)),
  }));
  const element = panel(
    "Train and test", true,
    value,
    said("Units are those of the sets as the page was made. Two draws from one distribution differ, too:",
      " segar.metrics.w2_report says by how much. Unmatched is the price of things without counterpart.",
      sets.some((set) => set.count > MOST) ? ` The first ${MOST} levels of each set count.` : ""),
    make("div", { className: "beside" }, ...walls.map((one) => one.element)),
    make("div", { className: "beside" },
      make("section", {}, make("h3", { textContent: "What W2² is made of" }),
        scroll("Parts of W2²", parts),
        make("h3", { textContent: "What W2 and KS do not see" }), unseen),
      make("section", {}, make("h3", { textContent: "Factors that vary, with KS of each" }),
        said(make("span", { className: "key of0" }), ` ${about.sets[0].title}, filled; `,
          make("span", { className: "key of1" }), ` ${about.sets[1].title}, outlined. `,
          "Dashed: priors."),
        scroll("Factors", cards))),
    make("h3", { textContent: "State this objective" }),
    make("div", { className: "beside" },
      make("section", {}, make("p", { textContent: "In Python" }), python),
      make("section", {}, make("p", { textContent: "In the settings of a run (YAML)" }), settings)),
    make("div", { className: "controls" }, ...saves), note,
    ...(page.about.studio ? [] : [said("This page holds these levels, and draws no new ones. To change the distributions, edit their priors in ",
      "Python, and make the page again, or open the levels by segar studio.")]),
  );
  element.classList.add("wide");
  let measuring = false;

  /** Look whether something changed, and show it; what changes while it is measured counts afterwards. */
  function draw() {
    if (!element.open) return;
    walls.forEach((one) => one.mark());
    if (measuring || page.player.running) return;
    const changed = measures.changes();
    if (!changed.length) return;
    for (const [k, level] of changed) walls[k].draw(level);
    measure();
  }

  /** Measure in slices, between which the page is drawn. */
  function measure() {
    measuring = true;
    const steps = measures.measured();
    const slice = () => {
      const end = performance.now() + SLICE;
      let next = steps.next();
      while (!next.done && performance.now() < end) next = steps.next();
      measuring = !next.done;
      if (measuring) {
        setTimeout(slice);
      } else {
        show(next.value);
        draw();
      }
    };
    setTimeout(slice);
  }

  function show({ w2, ks, parts: found, marginals }) {
    value.textContent = `W2 ${short(w2)}, KS ${short(ks)}`;
    parts.tBodies[0].replaceChildren(...found.map(([name, part]) => {
      const share = part / (w2 * w2);
      const bar = make("span", { className: "bar" });
      bar.style.width = `${100 * part / found[0][1]}%`;
      return tableRow([name, `${(100 * share).toFixed(1)} %`, bar]);
    }));
    const varied = marginals.filter(({ x, y }) => Math.min(x[0], y[0]) < Math.max(x.at(-1), y.at(-1)));
    varied.sort((one, other) => other.ks - one.ks);
    cards.replaceChildren(...varied.map((one) => card(one)));
    const weightless = varied.filter((one) => one.scale === 0);
    const words = [
      ...about.objective.unseen.map((text) => `${text}.`),
      ...weightless.map(({ name }) => `${name} has no spread in the units, and so no weight in W2; KS sees it.`),
    ];
    if (!words.length) words.push("Nothing was found in which these sets differ so.");
    unseen.replaceChildren(...words.map((textContent) => make("li", { textContent })));
    const stated = statement(page);
    python.textContent = stated.python;
    settings.textContent = stated.settings;
    note.textContent = stated.note;
    saves.forEach((button, k) => { button.hidden = !stated.files.includes(k); });
  }

  element.addEventListener("toggle", draw);
  measure();
  return { element, draw, measures };
}

function said(...words) {
  return make("p", { className: "note" }, ...words);
}

/** Thumbnails of a set, which are drawn when they come into sight. Arrow keys go from one to the next. */
function wall(page, k) {
  const set = page.sets[k];
  const nameOf = (level) => `${page.about.sets[k].title} level ${level}`;
  const scene = new Scene(null, set, page.about.signs);
  scene.overlays.clear();
  const buttons = [];
  const seen = new Set();
  const grid = oneStop(make("div", { className: "wall", role: "group", "aria-label": `${page.about.sets[k].title} levels` }));
  const box = make("div", { className: "scroll" }, grid);
  const more = make("button", { textContent: "More levels", onclick: () => add() });
  const watch = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (!isIntersecting) continue;
      watch.unobserve(target);
      seen.add(buttons.indexOf(target));
      draw(buttons.indexOf(target));
    }
  }, { root: box, rootMargin: "200px" });
  let marked;

  function add() {
    const end = Math.min(buttons.length + SHOWN, set.count);
    while (buttons.length < end) {
      const level = buttons.length;
      const canvas = make("canvas", { width: PIXELS, height: PIXELS });
      const about = { tabIndex: level ? -1 : 0, "aria-label": nameOf(level), title: nameOf(level) };
      const button = make("button", { ...about, onclick: () => go(level) }, canvas);
      buttons.push(button);
      grid.append(button);
      watch.observe(button);
    }
    more.hidden = end === set.count;
  }

  function go(level) {
    page.show(k);
    page.go(level);
    page.scene.canvas.scrollIntoView({ block: "nearest" });
  }

  function draw(level) {
    if (!seen.has(level)) return;
    scene.canvas = buttons[level].firstChild;
    scene.draw(set.world.machine.part("level_values", level), level);
    buttons[level].classList.toggle("changed", set.changed.has(level));
    buttons[level].setAttribute("aria-label", `${nameOf(level)}${set.changed.has(level) ? ", changed" : ""}`);
  }

  /** Mark the level that is played. */
  function mark() {
    const played = page.levels === set ? page.level : -1;
    if (marked === buttons[played]) return;
    marked?.removeAttribute("aria-current");
    marked = buttons[played];
    marked?.setAttribute("aria-current", "true");
  }

  add();
  const head = make("h3", { textContent: `${page.about.sets[k].title}: ${set.count} level${set.count === 1 ? "" : "s"}` });
  return { element: make("section", {}, head, box, more), draw, mark };
}

/** Histograms of a marginal in both sets over each other, and the densities of its priors. */
function card({ name, unit, priors, x, y, ks }) {
  const [low, high] = [Math.min(x[0], y[0]), Math.max(x.at(-1), y.at(-1))];
  const across = (value) => short((value - low) / (high - low) * WIDE);
  const shares = [x, y].map((numbers) => {
    const found = Array.from({ length: BINS }, () => 0);
    for (const one of numbers) {
      found[Math.min(Math.floor((one - low) / (high - low) * BINS), BINS - 1)] += 1 / numbers.length;
    }
    return found;
  });
  const most = Math.max(...shares.flat());
  const steps = (heights, from, to) => {
    const ends = heights.map((_, k) => across(from + (k + 1) * (to - from) / heights.length));
    const parts = heights.map((height, k) => `V${short(HIGH * (1 - Math.min(height / most, 1)))}H${ends[k]}`);
    return `M${across(from)},${HIGH}${parts.join("")}V${HIGH}`;
  };
  const lines = priors.map((prior, k) => {
    if (!prior) return "";
    const { low: from, high: to, bins } = prior;
    if (from === to) return path(`M${across(from)},${HIGH}V0`, `prior of${k}`);
    const wide = (to - from) / bins.length / ((high - low) / BINS);
    return path(steps(bins.map((mass) => mass / wide), from, to), `prior of${k}`);
  });
  const svg = drawn("svg", { viewBox: `0 0 ${WIDE} ${HIGH}`, preserveAspectRatio: "none", "aria-hidden": "true" });
  svg.append(...shares.map((heights, k) => path(steps(heights, low, high), `share of${k}`)), ...lines);
  const ends = `${short(low)} to ${short(high)}${unit ? ` ${unit}` : ""}`;
  const words = [make("b", { textContent: name }), ` KS\u00a0${ks.toFixed(3)}`, make("br"), ends];
  return make("figure", {}, svg, make("figcaption", {}, ...words));
}

function path(d, className) {
  return drawn("path", { d, class: className });
}

function fileOf(page, k) {
  return `${page.about.sets[k].title}.json`;
}

/** The Python and the settings that state the objective of a page, and which of its sets must be saved for them. */
function statement(page) {
  const lines = ["import segar", ""];
  const settings = ["levels:"];
  const files = new Set();
  const tasks = new Set(); // that files name: a file imports no code, so settings say those of one's own
  let ownRules = false;
  page.sets.forEach((set, k) => {
    const { family, seed, split, own_rules: own } = page.about.objective.origins[k];
    const role = ["train", "test"][k];
    const file = fileOf(page, k);
    const named = family && !set.changed.size;
    const drawn = named && split === role; // as runs draw their levels
    const options = `${set.count}, seed=${seed}${split === "train" ? "" : `, split="${split}"`}`;
    const loaded = `segar.Levels.load("${file}"${own ? ", world=world" : ""})`;
    lines.push(`${role} = ${named ? `segar.family("${family}").sample(${options})` : loaded}`);
    settings.push(`  ${role}: ${drawn ? family : file}`);
    settings.push(`  ${k ? "test_" : ""}count: ${set.count}`, `  ${k ? "test_" : ""}seed: ${drawn ? seed : 0}`);
    if (!drawn) files.add(k);
    ownRules ||= own && !drawn;
    if (!drawn) tasks.add(set.about.description.task);
  });
  lines.push("print(segar.metrics.w2(train, test), segar.metrics.ks(train, test))");
  if (ownRules) settings.push("  world: module:attribute");
  const own = [...tasks].filter((task) => task?.includes(":"));
  if (own.length) settings.push("task:", `  name: ${own[0]}`);
  const beside = files.size ? `Save ${[...files].map((k) => fileOf(page, k)).join(" and ")} beside them.` : "";
  const rules = "The rules of these levels are their own, which no level file holds: world is their segar.World in "
    + "Python, and levels.world names it as module:attribute in the settings.";
  const note = `${beside} ${ownRules ? rules : ""}`;
  return { python: lines.join("\n"), settings: settings.join("\n"), note, files: [...files] };
}
