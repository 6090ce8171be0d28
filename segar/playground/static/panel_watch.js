/** The panel of the agent: it plays what is shown, and all levels of all sets, whose results are a strip of levels each. */

import { make, oneStop, panel, scroll, short, table } from "segar/elements.js";

export function watchPanel(page) {
  const { policy, results } = page;
  const { count, weights, size, reads, sampled } = policy.about;
  const kilobytes = (size / 1000).toLocaleString("en", { maximumFractionDigits: 1 });
  const held = weights === "float32" ? "as float32" : `rounded to ${weights}`;
  const says = `A network of ${count.toLocaleString("en")} weights ${held} (${kilobytes} kB), which reads “${reads}”; its actions are ${sampled ? "drawn" : "those without noise"}.`;
  const acts = make("button", { textContent: "Let the agent play", onclick: () => acting(!page.player.actor) });
  const all = make("button", { textContent: "Let the agent play all levels", onclick: () => playAll() });
  const failuresFirst = make("input", { type: "checkbox", onchange: () => update() });
  const strips = page.about.sets.map((set, k) => ({
    heading: make("h3", { textContent: set.title }),
    says: make("p", { className: "note" }),
    cells: oneStop(make("div", { className: "strip scroll", role: "group", "aria-label": `Levels, ${set.title}` })),
    set: k,
  }));
  const expected = make("span", { className: "bar" });
  const expects = make("p", { className: "note", hidden: !policy.about.value });
  let [low, high] = [Infinity, -Infinity]; // of the values so far
  const element = panel(
    "Watch the agent", true, make("p", { className: "note", textContent: says }),
    make("div", { className: "controls" }, acts, all, make("label", {}, failuresFirst, " failures first")),
    expects, ...(policy.about.value ? [expected] : []),
    ...strips.flatMap((one) => [one.heading, one.says, one.cells]),
    ...(policy.about.probes.length ? [make("h3", { textContent: "What its representation knows" }), known(policy.about.probes)] : []),
  );
  element.addEventListener("toggle", () => update());
  for (const { cells, set } of strips) {
    cells.addEventListener("click", (event) => {
      const cell = event.target.closest("button");
      if (!cell) return;
      if (page.levels !== page.sets[set]) page.show(set);
      watch(Number(cell.value));
    });
  }

  /** Let the agent play what is shown, from its start; or let the person play. */
  function acting(wanted) {
    page.player.actor = wanted ? policy : null;
    acts.textContent = wanted ? "Stop the agent" : "Let the agent play";
    page.go(page.level);
  }

  function watch(level) {
    if (!page.player.actor) acting(true);
    page.go(level);
  }

  /** Play what has not been played yet. */
  async function playAll() {
    all.disabled = true;
    try {
      for (const { set } of strips) await results.playAll(set, "agent", page.seed, later);
    } finally {
      all.disabled = false;
    }
    update();
    page.compare.update();
  }

  let waiting = false;
  function later() {
    if (!waiting) requestAnimationFrame(() => { waiting = false; update(); });
    waiting = true;
  }

  function update() {
    if (!element.open) return;
    for (const { says: line, cells, set } of strips) {
      const played = page.sets[set].levelNumbers.map((level) => ({ level, one: results.episodes[set].agent[level]?.[0] }));
      const done = played.filter(({ one }) => one);
      const good = done.filter(({ one }) => one.success).length;
      line.textContent = `${good} of ${done.length} succeed${done.length < played.length ? `, ${played.length - done.length} not played yet` : ""}`;
      if (failuresFirst.checked) played.sort((a, b) => worth(a) - worth(b) || a.level - b.level);
      const shown = played.map(({ level, one }) => cell(level, one));
      if (cells.children.length !== shown.length) cells.replaceChildren(...shown.map((_, k) => make("button", { tabIndex: k ? -1 : 0 })));
      shown.forEach((about, k) => Object.assign(cells.children[k], about));
    }
  }

  /** Show the value of what the agent saw last, between the lowest and the highest so far. */
  function draw() {
    if (!policy.about.value) return;
    const { value } = policy;
    if (value !== null) [low, high] = [Math.min(low, value), Math.max(high, value)];
    expects.textContent = value === null ? "The critic's value appears here while the agent plays." : `Value of what it sees: ${short(value)}, so far from ${short(low)} to ${short(high)} (the discounted return that its critic expects, in the units of training)`;
    expected.hidden = value === null || low === high;
    if (!expected.hidden) expected.style.width = `${100 * (value - low) / (high - low)}%`;
  }

  return { element, update, draw };
}

/** R² of probes, with intervals, as bars. */
function known(probes) {
  const rows = probes.map(([name, ...numbers]) => {
    const [r2, low, high] = numbers.map((x) => (Math.round(100 * x) / 100 + 0).toFixed(2));
    const bar = make("span", { className: "bar" });
    bar.style.width = `${100 * Math.min(Math.max(numbers[0], 0), 1)}%`;
    return [name, `${r2} [${low}, ${high}]`, bar];
  });
  return scroll("What the representation knows", table(
    "R² on test levels of a linear probe that reads a factor from what the agent's encoder gives: 1 is all that varies, 0 is nothing.",
    ["factor", "R² [interval]"], rows));
}

/** Failures first, those with the lowest return at their head; what was not played comes last. */
function worth({ one }) {
  if (!one) return Infinity;
  return one.success ? 1e300 : one.returned;
}

function cell(level, one) {
  const end = !one ? "not played" : one.failed ? "error" : one.success ? "success" : one.death ? "dead" : "no success";
  const words = `level ${level}: ${end}${one ? `, return ${short(one.returned)}` : ""}`;
  return { value: level, className: `cell ${!one ? "" : one.success ? "good" : "bad"}`, title: words, ariaLabel: words, textContent: !one ? "·" : one.success ? "✓" : "×" };
}
