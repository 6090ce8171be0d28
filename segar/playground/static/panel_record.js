/** The panel of what a person played: episodes that ended, which leave as a file that Python replays to the bit. */

import { download, make, panel, scroll, short, table, tableRow } from "segar/elements.js";
import { asText, fileText, Whole } from "segar/level_text.js";

export function recordPanel(page) {
  const list = table(null, ["level", "steps", "return", "end"]);
  const save = make("button", { textContent: "Save as file", disabled: true });
  const element = panel("Your episodes", false, scroll("Episodes", list),
    make("div", { className: "controls" }, save),
    make("p", { className: "note", textContent: "The file holds levels, seeds and actions; segar.datasets reads it and plays the same episodes again. Only episodes on the levels as they came, of the set that is shown, are in it." }));
  const episodes = [];

  /** Keep the episode that has ended, or that the person leaves. */
  function add() {
    const { world, levels } = page;
    if (levels.changed.has(world.level)) return;
    const end = verdict(world) || "left";
    const data = {
      level: new Whole(world.level), seed: new Whole(world.seed), actions: world.actions.map((one) => [...one]),
      return: world.total, terminated: world.terminated, truncated: world.truncated, success: world.success,
    };
    episodes.push({ levels, level: world.level, data, saved: false });
    list.tBodies[0].prepend(tableRow([String(world.level), String(world.steps), short(world.total), end]));
    save.disabled = false;
  }

  save.addEventListener("click", () => {
    const { about } = page.levels;
    const levels = page.levels.asTheyCame(() => fileText(page.levels, page.levels.levelNumbers));
    const head = `"format": "segar-play", "version": 1, "segar": ${JSON.stringify(page.about.segar)}, "task": ${JSON.stringify(about.description.task ?? null)}, "seed": 0`;
    const kept = episodes.filter((one) => one.levels === page.levels);
    for (const one of kept) one.saved = true;
    download("episodes.json", `{${head},\n"levels": ${levels},\n"episodes": ${asText(kept.map((one) => one.data))}}\n`);
  });
  return { element, add, unsaved: () => episodes.some((one) => !one.saved) };
}

/** How an episode ended, in a word. */
export function verdict(world) {
  if (world.failed) return "error";
  const where = world.cause ? ` on ${world.cause}` : "";
  return world.success ? "success" : world.death ? `dead${where}` : world.terminated ? `end${where}` : world.truncated ? "time is up" : "";
}
