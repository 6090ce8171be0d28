/** The panel of segar studio: what the library behind the page can do, which a page in a file cannot. */

import { make, panel, scroll, short, table } from "segar/elements.js";
import { fileText } from "segar/level_text.js";

const KEPT = "segar-studio"; // under this name the browser keeps what is shown, until the page is there again
const TICK = 1000; // [ms]

export function studioPanel(page) {
  const { studio } = page.about;
  const kept = JSON.parse(sessionStorage.getItem(KEPT) ?? "{}");
  sessionStorage.removeItem(KEPT);
  const drafts = studio.sets.map(({ text, seed, split, number }) => ({ text: text ?? "", seed, split, number }));
  const buttons = [];
  let asked = null; // the question that is answered now
  let plan = null;

  const text = make("textarea", { spellcheck: false, wrap: "off", id: "studio-text" });
  const draw = { seed: numberBox("studio-seed"), split: make("input", { type: "text", id: "studio-split", size: 8 }), number: numberBox("studio-number") };
  const wrong = make("p", { className: "note", role: "alert" });
  const busy = make("p", { className: "note", role: "status" });
  const stop = make("button", { textContent: "Stop", hidden: true, onclick: () => asked?.abort() });
  const distances = make("div");
  const planned = make("p", { className: "note", role: "status" });
  const playPlan = make("button", { textContent: "Play the plan", disabled: true, onclick: () => follow() });
  const hard = make("div");
  const which = make("p", { className: "note" });
  const drawing = make("div", {},
    make("label", { for: "studio-text", textContent: "The distribution, as Python" }), text, wrong,
    make("div", { className: "controls" },
      make("label", { for: "studio-seed" }, "Seed "), draw.seed, make("label", { for: "studio-split" }, "Split "), draw.split,
      make("label", { for: "studio-number" }, "Levels "), draw.number,
      button("Draw levels", () => drawAnew()), make("button", { textContent: "Undo the edits", onclick: () => { drafts[page.set] = { ...studio.sets[page.set] }; update(); } })));
  const fixed = make("p", { className: "note", textContent: "These levels come from a file, which holds no distribution to draw from." });
  const runs = make("select");
  const ran = make("p", { className: "note", role: "alert" });
  const element = panel("Studio", true, which, drawing, fixed,
    make("div", { className: "controls" }, busy, stop),
    ...(page.sets.length > 1 ? [make("div", { className: "controls" }, button("Measure distances", () => measure())), distances] : []),
    make("div", { className: "controls" }, button("Plan this level", () => makePlan()), playPlan), planned,
    make("div", { className: "controls" }, button("Hardness of this set", () => rate())), hard,
    ...(studio.runs ? [make("div", { className: "controls" }, make("label", {}, "Policy of the run ", runs), button("Let it play", () => choose())), ran] : []));

  text.addEventListener("input", () => { drafts[page.set].text = text.value; });
  draw.split.addEventListener("input", () => { drafts[page.set].split = draw.split.value; });
  for (const name of ["seed", "number"]) draw[name].addEventListener("input", () => { drafts[page.set][name] = Number(draw[name].value); });
  if (studio.runs) listRuns();

  function button(textContent, onclick) {
    const made = make("button", { textContent, onclick });
    buttons.push(made);
    return made;
  }

  /** The answer of the server to a question; null where it has none, which is said in the place given. */
  async function ask(name, question, place) {
    place.textContent = "";
    asked = new AbortController();
    const start = performance.now();
    const tell = () => { busy.textContent = `The library works (${name}), for ${Math.round((performance.now() - start) / 1000)} s.`; };
    const clock = setInterval(tell, TICK);
    tell();
    for (const one of buttons) one.disabled = true;
    stop.hidden = false;
    try {
      const response = await fetch(name, {
        method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(question), signal: asked.signal,
      });
      const answer = await response.json().catch(() => ({ error: `the studio refuses (${response.status}); open its page anew` }));
      if (response.ok) return answer;
      place.textContent = answer.error;
    } catch (error) {
      place.textContent = error.name === "AbortError" ? "Stopped." : "The studio does not answer. Is it still running?";
    } finally {
      clearInterval(clock);
      asked = null;
      busy.textContent = "";
      stop.hidden = true;
      for (const one of buttons) one.disabled = false;
    }
    return null;
  }

  /** Show the page that the server has now. */
  function reload() {
    sessionStorage.setItem(KEPT, JSON.stringify({ set: page.set, drafts }));
    location.reload();
  }

  async function drawAnew() {
    const { set } = page;
    if (page.record.unsaved() && wrong.dataset.warned !== "yes") {
      wrong.dataset.warned = "yes";
      wrong.textContent = "Your episodes are of the present levels. Save them first, or draw again to drop them.";
      return;
    }
    const answer = await ask("draw", { version: studio.version, set, ...drafts[set] }, wrong);
    if (answer) return reload();
    const line = /^line (\d+)/.exec(wrong.textContent);
    if (line) select(Number(line[1]));
  }

  /** Select a line of the text. */
  function select(number) {
    const lines = text.value.split("\n");
    const start = lines.slice(0, number - 1).join("\n").length + (number > 1 ? 1 : 0);
    text.focus();
    text.setSelectionRange(start, start + (lines[number - 1] ?? "").length);
  }

  async function measure() {
    const answer = await ask("distance", { version: studio.version }, distances);
    if (!answer) return;
    const { w2, ks, levels } = answer;
    const rows = [
      ["W2", w2.value], ["95 % interval", `${short(w2.low)} to ${short(w2.high)}`], ["floor (one distribution)", w2.floor], ["p of W2", w2.p_value],
      ["KS", ks.value], ["p of KS", ks.p_value],
    ];
    distances.replaceChildren(
      table(`Between ${levels[0]} and ${levels[1]} levels, as they were drawn`, ["measure", "value"], rows),
      scroll("KS of each factor", table("KS of each factor", ["factor", "KS", "band", "p"], ks.factors.map((one) => [one.name, one.value, one.band, one.p_value]))),
      ...w2.unseen.map((textContent) => make("p", { className: "note", textContent: `W2 does not see: ${textContent}` })),
    );
  }

  async function makePlan() {
    const { levels, level, set } = page;
    const state = stateOf();
    const answer = await ask("plan", { set, level: fileText(levels, [level]), seed: String(page.seed) }, planned);
    if (!answer) return;
    plan = { ...answer, state, seed: page.seed };
    planned.textContent = `${answer.solved ? "Success" : answer.died ? "Death" : "No success"} after ${answer.steps} steps, return ${short(answer.return)}: the best of ${answer.rollouts} episodes on level ${level}.`;
    playPlan.disabled = false;
    page.refresh();
  }

  /** What changes when the level that is shown does. */
  function stateOf() {
    return [page.levels, page.level, page.levels.past.at(-1)];
  }

  function isOfPlan() {
    return plan !== null && stateOf().every((one, k) => one === plan.state[k]);
  }

  /** Play the actions of the plan. */
  function follow() {
    if (!isOfPlan()) {
      planned.textContent = "The plan is of another level. Plan this one.";
      return;
    }
    page.player.start(page.level, plan.seed);
    page.player.queue = [...plan.actions];
    page.player.running = true;
    page.refresh();
  }

  async function rate() {
    const { set } = page;
    const answer = await ask("hardness", { version: studio.version, set }, hard);
    if (!answer) return;
    const go = (level) => make("button", { textContent: level, "aria-label": `go to level ${level}`, onclick: () => { if (page.set !== set) page.show(set); page.go(level); } });
    const percent = (share) => `${Math.round(100 * share)} %`;
    const { summary } = answer;
    const players = ["random", "scripted", "oracle"].filter((one) => `${one}_success` in summary);
    const name = page.about.sets[set].title;
    hard.replaceChildren(
      table(`Players on the ${summary.levels} levels of "${name}"`, ["player", "success", "return"],
        players.map((one) => [one === "oracle" ? "planner" : one, `${percent(summary[`${one}_success`])} (95 %: ${summary[`${one}_success_95`].map(percent).join(" to ")})`, summary[`${one}_return`]])),
      scroll("Hardness of each level", table("From the hardest", ["level", "random success", "planner", "steps", "return"],
        [...answer.levels].sort((a, b) => a.oracle_solved - b.oracle_solved || a.random_success - b.random_success)
          .map((one) => [go(one.level), percent(one.random_success), one.oracle_solved ? "success" : "no success", one.oracle_steps ?? "–", one.oracle_return]))),
      scroll("Factors that actions change", table(`What actions change, in ${answer.tried} levels`, ["entity", "factor", "gain", "levels"],
        answer.factors.map((one) => [one.entity, one.factor, one.gain, percent(one.share)]))),
    );
  }

  async function listRuns() {
    const answer = await ask("runs", {}, ran);
    if (!answer) return;
    runs.replaceChildren(make("option", { value: "", textContent: answer.runs.length ? "(none)" : "(no run has a network.npz)" }),
      ...answer.runs.map((one) => make("option", { value: one, textContent: one, selected: one === answer.run })));
  }

  async function choose() {
    if (await ask("policy", { version: studio.version, run: runs.value || null }, ran)) reload();
  }

  function update() {
    const { set } = page;
    const draft = drafts[set];
    const drawable = studio.sets[set].text !== null;
    which.textContent = page.sets.length > 1 ? `The set that is shown: ${page.about.sets[set].title}` : "";
    drawing.hidden = !drawable;
    fixed.hidden = drawable;
    text.value = draft.text;
    draw.seed.value = draft.seed;
    draw.split.value = draft.split;
    draw.number.value = draft.number;
  }

  return { element, update, set: kept.set ?? 0, ghost: () => (isOfPlan() && plan.path.length ? plan.path : null) };
}

function numberBox(id) {
  return make("input", { type: "number", min: 0, id });
}
