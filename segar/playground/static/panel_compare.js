/** The panel of players on the same levels: the person, the agent, random and idle play, the planner; and their ways. */

import { make, panel, scroll, short, table, tableRow } from "segar/elements.js";
import { mean, outcome } from "segar/results.js";

const COMPARE = "Compare on all levels";
const PLAYERS = { you: "you", agent: "agent", random: "random play", idle: "nobody acts", planner: "planner (best known)" };
const HEAD = ["player", "return", "success", "score"];

export function comparePanel(page) {
  const { results } = page;
  const plans = page.about.sets.some((set) => set.baselines);
  const players = Object.keys(PLAYERS).filter((one) => (one !== "agent" || page.policy) && (one !== "planner" || plans));
  const summary = make("div");
  const returns = table("Returns on each level", ["level", ...players.map((one) => PLAYERS[one])]);
  const [rows] = returns.tBodies;
  const way = make("select", {}, make("option", { value: "", textContent: "nobody" }),
    ...players.filter((one) => one !== "you").map((one) => make("option", { value: one, textContent: PLAYERS[one] })));
  const all = make("button", { textContent: COMPARE, onclick: () => playAll() });
  const element = panel(
    "Compare", false,
    make("div", { className: "controls" }, all, make("label", {}, "Show the way of ", way)), summary,
    scroll("Returns on each level", returns),
    make("p", { className: "note", textContent: plans
      ? "A score of 0 is the better of random and idle play on each level, and 1 is the planner, who knows the levels; segar.evaluation.Baselines counts alike."
      : "There are no scores: the page was made without plans=True (segar playground --plans), which finds the planner's episodes." }),
  );
  element.addEventListener("toggle", () => update());
  way.addEventListener("change", () => ghost());
  rows.addEventListener("click", (event) => {
    const chosen = event.target.closest("button");
    if (chosen) page.go(Number(chosen.value));
  });

  /** Count an episode that the person played. */
  function add() {
    const { world } = page;
    if (page.levels.changed.has(world.level)) return;
    results.note(page.set, "you", world.level, outcome(world));
    update();
  }

  async function playAll() {
    const { set, seed } = page;
    const lacking = players.filter((one) => one !== "you" && page.levels.levelNumbers.some((level) => results.returned(set, one, level) === undefined));
    all.disabled = true;
    try {
      for (const one of lacking) await results.playAll(set, one, seed, () => { all.textContent = `${COMPARE} (${PLAYERS[one]} plays)`; });
    } finally {
      all.disabled = false;
      all.textContent = COMPARE;
    }
    page.watch?.update();
    update();
  }

  /** Draw the way of a player on the level that is shown, as it came. */
  async function ghost() {
    const [set, { level }, player] = [page.set, page, way.value];
    page.ghost = null;
    page.refresh();
    if (!player || page.levels.changed.has(level)) return;
    const { path } = await results.play(set, player, level, page.seed);
    if (set !== page.set || level !== page.level || player !== way.value) return;
    page.ghost = path;
    page.refresh();
  }

  function update() {
    if (!element.open) return;
    const { set, levels } = page;
    const yours = levels.levelNumbers.filter((level) => results.returned(set, "you", level) !== undefined);
    summary.replaceChildren(
      summed(`All levels (${levels.count})`, levels.levelNumbers),
      ...(yours.length && yours.length < levels.count ? [summed(`Levels that you played (${yours.length})`, yours)] : []),
    );
    rows.replaceChildren(...levels.levelNumbers.map((level) => tableRow([
      make("button", { value: level, textContent: level, "aria-label": `go to level ${level}` }),
      ...players.map((one) => number(results.returned(set, one, level))),
    ])));
  }

  /** What the players achieve on some levels together. */
  function summed(title, levels) {
    const lines = players.map((one) => {
      const complete = levels.every((level) => results.returned(page.set, one, level) !== undefined);
      const all = (of) => (complete ? mean(levels, of) : undefined);
      const shares = levels.map((level) => results.success(page.set, one, level));
      return [PLAYERS[one], number(all((level) => results.returned(page.set, one, level))),
        number(shares.includes(undefined) ? undefined : mean(shares, (x) => x)),
        number(complete ? results.score(page.set, one, levels) : undefined)];
    });
    return table(title, HEAD, lines);
  }

  return { element, update, add, ghost };
}

function number(x) {
  return x === undefined ? "–" : short(x);
}
