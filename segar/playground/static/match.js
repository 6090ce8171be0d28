/** A match: a person plays training levels and then test levels beside the agent; then the gaps of both, and the planner's. */

import { drawn, make, table, tableRow } from "segar/elements.js";
import { mean, outcome } from "segar/results.js";

const LEVELS = 5; // of each set
const SPEED = 0.25; // of time
const NUDGE = 0.05; // [m] of the aim for each touch of an arrow key; a fifth of it with Shift
const PAUSE = 10; // steps between two showings of the agent's way
const ROUNDS = ["Training", "Test"];
const WHO = { you: "you", agent: "agent", planner: "planner" };
const [WIDE, HIGH, LEFT, RIGHT, EDGE] = [360, 200, 60, 240, 24]; // of the drawing
const DEEPEST = 8; // the range of returns in it
const LEAST = 16; // between two names in it
const ARROWS = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const HOW = "Drag from your ball to where it shall go, and let go: the farther, the harder. Time stands while you aim, and you may hit again.";
const KEYS = "Keys: arrows aim, with Shift finely; Enter hits.";

export function matchOf(page) {
  const { results } = page;
  const rounds = page.sets.flatMap((set, k) => set.levelNumbers.slice(0, LEVELS).map((level) => ({ set: k, level })));
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const main = document.getElementById("page");
  const [name, about] = ["title", "about"].map((id) => document.getElementById(id));
  const before = [name.textContent, about.textContent, document.title];
  const heading = make("h2");
  const says = make("p");
  const next = make("button", { className: "first", onclick: () => proceed() });
  const keys = make("p", { className: "note keys", textContent: KEYS });
  const marks = table(null, ["player"]);
  marks.tHead.rows[0].append(...ROUNDS.map((name, set) => make("th", { textContent: name, scope: "colgroup", colSpan: number(set) })));
  const board = make("div", { className: "board" }, marks);
  const all = make("button", { textContent: "Open the whole playground", onclick: () => leave() });
  const element = make("section", { id: "match", "aria-label": "Match" }, heading, says, keys,
    make("div", { className: "controls" }, next), board, make("div", { className: "controls" }, all));
  let at = -1;
  let way = null; // of the agent, on this level
  let since = performance.now();
  const played = rounds.map(() => ({}));

  /** How many rounds a set has. */
  function number(set) {
    return rounds.filter((one) => one.set === set).length;
  }

  /** Where they begin. */
  function first(set) {
    return rounds.findIndex((one) => one.set === set);
  }

  function begin(k) {
    at = k;
    way = null;
    since = performance.now();
    const { set, level } = rounds[k];
    if (page.set === set) page.go(level);
    else page.show(set, level);
    played[k].playing = results.play(set, "agent", level, page.seed);
    played[k].playing.then((one) => {
      results.episodes[set].agent[level] ??= [one];
      played[k].agent = one;
      if (at === k) way = one.path;
      tell();
    });
    tell();
  }

  function proceed() {
    if (at + 1 < rounds.length) begin(at + 1);
    else if (at < rounds.length) finish();
    else again();
    document.getElementById("arena").focus({ preventScroll: true });
  }

  function again() {
    played.forEach((one) => { delete one.you; });
    element.querySelectorAll(".result").forEach((one) => one.remove());
    main.classList.remove("over");
    begin(0);
  }

  /** The person's episode has ended. */
  function ended() {
    if (played[at]) played[at].you = outcome(page.world);
    tell();
  }

  function title() {
    const { set } = rounds[at];
    return `${ROUNDS[set]} level ${1 + at - first(set)} of ${number(set)}`;
  }

  function tell() {
    if (at >= rounds.length) return;
    const { you, agent } = played[at];
    heading.textContent = title();
    const last = at + 1 === rounds.length;
    const turn = !last && rounds[at + 1].set !== rounds[at].set;
    says.textContent = you ? `You: ${ending(you)}. The agent: ${agent ? ending(agent) : "is playing"}.` : HOW;
    next.hidden = !you;
    keys.hidden = Boolean(you);
    next.textContent = last ? "See your gap" : turn ? "Go to the test" : "Next level";
    keepScore();
    page.refresh();
  }

  function keepScore() {
    const cells = (who) => rounds.map(({ set }, k) => mark(played[k].you && played[k][who], k === at, `${ROUNDS[set]} ${1 + k - first(set)}`));
    marks.tBodies[0].replaceChildren(...["you", "agent"].map((who) => tableRow([WHO[who], ...cells(who)])));
  }

  /** What who listens hears. */
  function status() {
    if (at >= rounds.length) return `${heading.textContent}. ${says.textContent} Press Enter: ${next.textContent}.`;
    const { you } = played[at];
    const { world, scene, level } = page;
    if (you) return `${title()} is over. ${says.textContent} Press Enter: ${next.textContent}.`;
    const things = scene.things(world.values, level);
    const ball = things.find((one) => one.agent);
    const goal = things.find((one) => one.type.goal);
    const to = (x, y) => `${Math.abs(x).toFixed(2)} ${x < 0 ? "left" : "right"}, ${Math.abs(y).toFixed(2)} ${y < 0 ? "down" : "up"}`;
    const away = ball && goal ? ` The goal is ${to(goal.x - ball.x, goal.y - ball.y)} of your ball.` : "";
    const aim = page.aim && ball ? ` Your aim is ${to(page.aim[0] - ball.x, page.aim[1] - ball.y)}.` : "";
    return `${title()}, step ${world.steps} of ${world.about.task.max_steps}.${away}${aim}`;
  }

  /** The agent at the present moment; before the first hit it shows its way on the first level, again and again. */
  function ghost() {
    if (!way?.length || at >= rounds.length) return null;
    const { world, player } = page;
    const { steps_per_second: rate } = world.about;
    let time = player.running ? world.steps - 1 + Math.min(player.waiting, 1) : world.steps;
    if (waits()) time = ((performance.now() - since) / 1000 * rate * SPEED) % (way.length + PAUSE);
    time = Math.max(time, 0);
    const k = Math.min(Math.floor(time), way.length - 1);
    const [here, there] = [way[k], way[Math.min(k + 1, way.length - 1)]];
    return here.map((x, axis) => x + Math.min(time - k, 1) * (there[axis] - x));
  }

  /** Whether the agent shows its way. */
  function waits() {
    return !still && at === 0 && way !== null && page.world.steps === 0 && !page.player.running && !page.aim;
  }

  /** Let time go on without a hit. */
  function resume() {
    page.aim = null;
    page.player.running = page.world.steps > 0 && !page.world.over;
    page.refresh();
  }

  function key(event) {
    const arrow = ARROWS[event.key];
    const enters = event.key === "Enter" || event.key === " ";
    if (event.key === "Escape") resume();
    if (!arrow && !enters && event.key !== "n") return false;
    if (at >= rounds.length && event.key !== "Enter") return false; // arrows and Space scroll the result
    if (event.target.closest?.("button, summary, a") && !arrow) return false;
    const { world } = page;
    if (world.over) {
      if (!arrow) proceed();
    } else if (enters) page.strike();
    else if (arrow) {
      page.player.running = false;
      const ball = page.scene.things(world.values, page.level).find((one) => one.agent);
      const size = event.shiftKey ? NUDGE / 5 : NUDGE;
      const from = page.aim ?? (ball ? [ball.x, ball.y] : [0, 0]);
      page.aim = from.map((x, axis) => x + arrow[axis] * size);
      page.refresh();
    }
    return true;
  }

  /** Show what was played, and what the test changed. */
  async function finish() {
    for (const one of played) one.agent = await one.playing;
    if (at >= rounds.length) return;
    at = rounds.length;
    main.classList.add("over");
    const of = (who, set, what) => mean(rounds.flatMap((one, k) => (one.set === set ? [{ ...one, ...played[k] }] : [])),
      (one) => (who === "planner" ? { returned: results.returned(set, who, one.level), success: results.success(set, who, one.level) } : one[who])[what]);
    const lines = Object.keys(WHO).map((who) => {
      const [train, test] = [0, 1].map((set) => of(who, set, "returned"));
      const solved = [0, 1].map((set) => Math.round(of(who, set, "success") * number(set)));
      return { who, train, test, solved, gap: test - train };
    });
    const [you, agent, planner] = lines;
    heading.textContent = `Your gap is ${signed(you.gap)}, the agent's ${signed(agent.gap)}, the planner's ${signed(planner.gap)}`;
    says.textContent = verdictOf(you, agent);
    next.textContent = "Play again";
    keepScore();
    const rows = lines.map(({ who, train, test, solved, gap }) => [WHO[who], `${solved[0]} of ${number(0)}; ${plain(train)}`, `${solved[1]} of ${number(1)}; ${plain(test)}`, signed(gap)]);
    says.after(make("div", { className: "result" },
      make("p", {}, make("strong", { textContent: "What the test changed: " }), page.about.match),
      chart(lines),
      table("Levels solved, and mean return", ["player", "training", "test", "gap"], rows),
      make("p", { className: "note", textContent: "The gap is the mean return on test levels minus that on training levels. The return is higher, nearer to 0, the faster the ball comes near the goal. The planner knows the levels and searches for their best play. So few levels are a game and no measurement: segar evaluates agents on hundreds." })));
    page.refresh();
  }

  /** Open the page as it is without a match. */
  function leave() {
    main.classList.remove("match", "over");
    element.remove();
    page.match = null;
    [name.textContent, about.textContent, document.title] = before;
    page.scene.says = (thing) => page.scene.nameOf(thing);
    page.scene.overlays.delete("names");
    page.scene.overlays.add("velocity");
    page.player.speed = 1;
    page.refresh();
  }

  main.classList.add("match");
  document.getElementById("stage").after(element);
  page.scene.overlays.add("names");
  page.scene.overlays.delete("velocity");
  page.player.speed = SPEED;
  page.scene.says = (thing) => (!thing.agent ? thing.type.goal ? "goal" : thing.type.name : waits() ? "you: drag from here" : "you");
  name.textContent = "Beat the agent";
  document.title = `${name.textContent}: ${page.about.title} – SEGAR`;
  about.textContent = `${page.levels.about.aim} A trained agent, the violet ghost, plays the same level: five levels as in its training, then five of a test.`;
  return { begin, ended, ghost, key, leave, resume, status, get moves() { return at < rounds.length && waits(); } };
}

/** Who wins, by the gaps; a test that is easier than the training helps. */
export function verdictOf(you, agent) {
  if (you.solved[0] === 0) return "You solved no training level, so your gap says little: play again.";
  const [better, worse] = Math.min(you.gap, agent.gap) < 0 ? ["cost you less", "cost you more"] : ["helped you more", "helped you less"];
  return you.gap >= agent.gap ? `You beat the agent: the test ${better}.` : `The agent beats you: the test ${worse}.`;
}

function ending({ success, death, steps }) {
  return success ? `goal after ${steps} steps` : death ? "dead" : "missed";
}

/** A level of a player: played or not, and how it ended. */
function mark(one, present, where) {
  const words = !one ? "not played" : one.success ? "goal" : "missed";
  return make("span", { className: `cell ${!one ? "" : one.success ? "good" : "bad"} ${present ? "now" : ""}`, title: words, role: "img", "aria-label": `${where}: ${words}`, textContent: !one ? "·" : one.success ? "✓" : "×" });
}

function signed(x) {
  return `${x < 0 ? "" : "+"}${plain(x)}`;
}

function plain(x) {
  return x.toFixed(2).replace("-", "−");
}

/** Mean returns in training and in the test, a line for each player; a death, which costs much, is below the drawing. */
function chart(lines) {
  const all = lines.flatMap(({ train, test }) => [train, test]);
  const high = Math.max(...all);
  const low = Math.max(Math.min(...all), high - DEEPEST);
  const y = (x) => EDGE + Math.min((high - x) / (high - low || 1), 1) * (HIGH - 2 * EDGE);
  const label = `Mean returns: ${lines.map(({ who, train, test }) => `${WHO[who]} ${plain(train)} in training and ${plain(test)} in the test`).join("; ")}`;
  const svg = drawn("svg", { viewBox: `0 0 ${WIDE} ${HIGH}`, role: "img", "aria-label": label, class: "gaps" });
  const text = (x, height, words, about = {}) => {
    const one = drawn("text", { x, y: height, ...about });
    one.textContent = words;
    svg.append(one);
  };
  for (const [x, words] of [[LEFT, "training"], [RIGHT, "test"]]) {
    svg.append(drawn("line", { x1: x, x2: x, y1: EDGE - 8, y2: HIGH - EDGE + 8, class: "axis" }));
    text(x, 12, words, { "text-anchor": "middle" });
  }
  let free = -Infinity; // the height from which on names have room
  for (const { who, train, test, gap } of [...lines].sort((a, b) => b.test - a.test)) {
    svg.append(drawn("line", { x1: LEFT, y1: y(train), x2: RIGHT, y2: y(test), class: who }));
    for (const [x, value] of [[LEFT, train], [RIGHT, test]]) svg.append(drawn("circle", { cx: x, cy: y(value), r: 4, class: who }));
    free = Math.max(y(test) + 5, free + LEAST);
    text(RIGHT + 10, free, `${WHO[who]} ${signed(gap)}`, { class: who });
  }
  return svg;
}
