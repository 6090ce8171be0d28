/** The page: which set and level are played, how the person acts, and what is shown. */

import { make, short } from "segar/elements.js";
import { LevelSet } from "segar/level_set.js";
import { follow, fragmentOf } from "segar/link.js";
import { changePanel } from "segar/panel_change.js";
import { comparePanel } from "segar/panel_compare.js";
import { overlaysPanel } from "segar/panel_overlays.js";
import { recordPanel, verdict } from "segar/panel_record.js";
import { seenPanel } from "segar/panel_seen.js";
import { watchPanel } from "segar/panel_watch.js";
import { Player } from "segar/player.js";
import { Policy } from "segar/policy.js";
import { Results } from "segar/results.js";
import { Scene } from "segar/scene.js";
import { World } from "segar/world.js";

const REACH = 0.6; // [m] from the ball to where a hit is as hard as can be
const SAID_EVERY = 1000; // [ms] at least, between two sentences for who listens
const KEYS = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** Open a page; what it returns is for programs that play it. */
export async function open(about, blob) {
  const worlds = await Promise.all(about.sets.map((set) => World.load(set, blob)));
  const policy = about.policy ? await Policy.load(about.policy, blob) : null;
  const page = new Page(about, worlds.map((world) => new LevelSet(world, blob)), policy, new Results(about, blob));
  if (about.studio) {
    const { studioPanel } = await import("segar/panel_studio.js"); // a page in a file lacks it
    page.studio = studioPanel(page);
    $("panels").prepend(page.studio.element);
  }
  page.show(page.studio?.set ?? 0);
  if (about.objective) {
    const { designPanel } = await import("segar/panel_design.js"); // a page of one set lacks it
    page.design = designPanel(page);
    $("page").append(page.design.element);
  }
  if (about.match && !window.location.hash) {
    const { matchOf } = await import("segar/match.js"); // a page without a match lacks it
    page.match = matchOf(page);
    page.match.begin(0);
  }
  await page.follow();
  return page;
}

const $ = (id) => document.getElementById(id);
const short2 = (x) => String(Number(x.toFixed(2)));

function trouble(words) {
  $("trouble").textContent = words;
  $("trouble").hidden = !words;
}

class Page {
  constructor(about, sets, policy, results) {
    this.about = about;
    this.sets = sets;
    this.policy = policy;
    this.results = results;
    this.levels = sets[0];
    this.marked = 0;
    this.moving = false;
    this.aim = this.held = this.ghost = this.match = null;
    this.scene = new Scene($("arena"), this.levels, about.signs);
    this.player = new Player(this.world, () => this.refresh());
    $("title").textContent = about.title;
    document.title = `${about.title} – SEGAR`;
    if (sets.length > 1) {
      $("sets").append(...about.sets.map((set, k) => make("button", { textContent: set.title, onclick: () => this.show(k) })));
    }
    this.seen = seenPanel(this);
    this.change = changePanel(this);
    this.record = recordPanel(this);
    this.compare = comparePanel(this);
    this.watch = policy && watchPanel(this);
    const panels = [this.watch, this.seen, this.compare, overlaysPanel(this), this.change, this.record];
    $("panels").append(...panels.filter((one) => one).map((one) => one.element));
    this.listen();
    const { slots, agents } = this.levels.about;
    const body = agents.map((slot) => slots[slot].name).join(" or ") || "the body that acts";
    $("about").textContent = `${this.levels.about.aim} Drag from ${body}, or press an arrow key, to hit it. “Overlays” names the things.`.trim();
    this.actionSliders();
    let last = performance.now();
    const tick = (now) => {
      this.player.pass((now - last) / 1000);
      last = now;
      if (this.player.running || this.stale || this.match?.moves) this.draw();
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  get world() {
    return this.levels.world;
  }

  get level() {
    return this.world.level;
  }

  /** The number of the set that is shown. */
  get set() {
    return this.sets.indexOf(this.levels);
  }

  /** The seed that is asked for. */
  get seed() {
    const text = $("seed").value.trim();
    const seed = /^\d{1,20}$/.test(text) ? BigInt(text) : this.world.seed;
    return seed < 1n << 64n ? seed : this.world.seed;
  }

  /** Show a set, at a level and a seed where they are given. */
  show(k, level = null, seed = this.seed) {
    this.leave();
    this.levels = this.sets[k];
    $("seed").value = seed;
    this.scene.levels = this.levels;
    this.player.world = this.world;
    [...$("sets").children].forEach((button, i) => button.setAttribute("aria-current", String(i === k)));
    $("level").max = this.levels.count - 1;
    this.marked = this.levels.about.agents[0] ?? 0;
    this.begin(level ?? this.level);
    this.compare.update();
    this.watch?.update();
    this.studio?.update();
  }

  /** Leave the present episode, and go to a level of the set. */
  go(level) {
    this.leave();
    this.begin(level);
  }

  /** Keep an episode that the person does not play to its end. */
  leave() {
    if (this.world.steps > 0 && !this.world.over && !this.player.assisted) this.record.add();
  }

  begin(level) {
    const { count } = this.levels;
    const at = ((level % count) + count) % count;
    this.player.start(at, this.seed, this.player.actor ? at : 0); // the agent plays as Results has it
    this.player.running = this.player.actor !== null;
    $("level").value = this.level;
    $("address").replaceChildren();
    this.change.update();
    this.compare.ghost();
  }

  /** Show what the page's address says. */
  async follow() {
    try {
      await follow(this, window.location.hash);
      trouble("");
    } catch (error) {
      if (!(error instanceof RangeError)) throw error;
      trouble(`The address names a level that this page cannot show: ${error.message}.`);
    }
  }

  /** Give the person an address that opens this page at what it shows. */
  async link() {
    const href = await fragmentOf(this);
    const link = make("a", { href, textContent: `Link to level ${this.level}${this.levels.changed.has(this.level) ? " as you changed it" : ""}` });
    let end = " is in the clipboard.";
    try {
      await navigator.clipboard.writeText(link.href);
    } catch {
      end = ": copy its address."; // where the browser does not let a page write into the clipboard
    }
    $("address").replaceChildren(link, end);
  }

  /** Something changed: draw it with the next picture, and keep an episode that has ended. */
  refresh() {
    this.stale = true;
    const { world } = this;
    if (world.terminated && !world.success) world.cause = this.scene.under(world.values, this.level);
    if (world.over && !this.kept && world.steps > 0 && !world.failed) {
      this.kept = true;
      if (!this.player.assisted) {
        this.record.add();
        this.compare.add();
      }
      this.match?.ended();
    }
    if (!world.over) this.kept = false;
  }

  draw() {
    this.stale = false;
    const { world, player } = this;
    const ghost = this.studio?.ghost() ?? (this.levels.changed.has(this.level) ? null : this.ghost);
    this.scene.draw(player.shown, this.level, { aim: this.aim, marked: this.change.element.open ? this.marked : undefined, ghost, other: this.match?.ghost(), acceleration: player.acceleration });
    this.seen.draw();
    this.watch?.draw();
    this.design?.draw();
    const words = world.failed ?? verdict(world);
    const status = `level ${this.level}${this.levels.changed.has(this.level) ? " (changed)" : ""}, step ${world.steps} of ${world.about.task.max_steps}, return ${world.total.toFixed(3)}${words ? `: ${words}` : ""}`;
    if ($("status").textContent !== status) $("status").textContent = status;
    this.say(this.match?.status() ?? status);
    $("play").textContent = player.running ? "Pause" : "Play";
    $("play").setAttribute("aria-pressed", String(player.running));
    $("play").disabled = $("single").disabled = world.over;
    $("replay").disabled = world.steps === 0;
  }

  /** Tell who listens what the status is and where the things are, once a second at most. */
  say(status) {
    const now = performance.now();
    clearTimeout(this.later);
    if (now < (this.said ?? -Infinity) + SAID_EVERY) {
      this.later = setTimeout(() => this.say(status), SAID_EVERY);
      return;
    }
    const things = this.scene.things(this.world.values, this.level).filter((one) => one.visible && !one.done);
    const places = things.map((one) => `${this.scene.nameOf(one)}${one.alive ? "" : " (dead)"} at ${short2(one.x)}, ${short2(one.y)}`);
    const label = `The arena from above, in metres from its middle: ${places.join("; ")}. ${status}`;
    if ($("said").textContent === status && $("arena").getAttribute("aria-label") === label) return;
    this.said = now;
    $("said").textContent = status;
    $("arena").setAttribute("aria-label", label);
  }

  /** Act in a direction (right, up) of length 1 at most. */
  hit(unit) {
    if (this.levels.about.task.action_low.length === 2) this.player.act(this.player.inRange(unit));
  }

  /** Hit the ball towards the aim, where there is one. */
  strike() {
    if (!this.aim) return;
    const ball = this.scene.things(this.world.values, this.level).find((one) => one.agent);
    const [dx, dy] = ball ? [this.aim[0] - ball.x, this.aim[1] - ball.y] : this.aim;
    const reach = Math.max(Math.hypot(dx, dy), REACH);
    this.aim = null;
    this.hit([dx / reach, dy / reach]);
  }

  listen() {
    const arena = $("arena");
    arena.addEventListener("pointerdown", (event) => {
      arena.setPointerCapture(event.pointerId);
      const place = this.scene.metres(event.clientX, event.clientY);
      const thing = this.scene.thingAt(this.world.values, this.level, place);
      if (this.moving) {
        if (thing) this.hold(thing.slot);
      } else if (this.levels.about.task.action_low.length === 2) {
        this.aim = place;
        if (this.match) this.player.running = false; // time stands while one aims
      }
      this.refresh();
    });
    arena.addEventListener("pointermove", (event) => {
      const place = this.scene.metres(event.clientX, event.clientY);
      if (this.held !== null) this.drag(place);
      else if (this.aim) this.aim = place;
      else return;
      this.refresh();
    });
    arena.addEventListener("pointerup", () => {
      this.strike();
      if (this.held !== null) this.change.update();
      this.aim = this.held = null;
      this.refresh();
    });
    arena.addEventListener("pointercancel", () => {
      this.match?.resume();
      this.aim = this.held = null;
      this.refresh();
    });
    document.addEventListener("keydown", (event) => this.key(event));
    $("play").addEventListener("click", () => this.toggle());
    $("single").addEventListener("click", () => this.single());
    $("again").addEventListener("click", () => this.go(this.level));
    $("replay").addEventListener("click", () => this.player.replay());
    $("before").addEventListener("click", () => this.go(this.level - 1));
    $("next").addEventListener("click", () => this.go(this.level + 1));
    $("level").addEventListener("change", () => this.go(Math.min(Math.max(Math.round(Number($("level").value)) || 0, 0), this.levels.count - 1)));
    $("seed").addEventListener("change", () => {
      const asked = $("seed").value;
      this.go(this.level);
      $("seed").value = this.world.seed;
      trouble(String(this.world.seed) === asked.trim() ? "" : `A seed is a whole number from 0 to 2^64 - 1, not ${asked || "a text"}.`);
    });
    $("link").addEventListener("click", () => this.link());
    $("link").hidden = window.location.protocol === "about:"; // in a notebook, where the page has no address
    window.addEventListener("hashchange", () => this.follow());
    $("speed").addEventListener("change", () => { this.player.speed = Number($("speed").value); });
  }

  key(event) {
    if (event.target.closest?.("input, textarea, select") || event.ctrlKey || event.metaKey || event.altKey) return;
    if (this.match) {
      if (this.match.key(event)) event.preventDefault();
      return;
    }
    const onButton = event.target.closest?.("button, summary");
    if (event.key in KEYS) this.hit(KEYS[event.key]);
    else if (event.key === " " && !onButton) this.toggle();
    else if (event.key === ".") this.single();
    else if (event.key === "n") this.go(this.level + 1);
    else if (event.key === "r") this.go(this.level);
    else return;
    event.preventDefault();
  }

  toggle() {
    this.player.running = !this.player.running && !this.world.over;
    this.refresh();
  }

  single() {
    this.player.running = false;
    this.player.step();
  }

  hold(slot) {
    this.held = this.marked = slot;
    if (this.world.steps > 0) this.player.start(this.level);
    this.levels.remember(this.level);
  }

  /** Move the thing that is held. */
  drag(place) {
    const { walls } = this.levels.about;
    const held = place.map((x) => Math.min(Math.max(x, -walls), walls));
    const column = this.levels.about.columns.Position;
    this.levels.values(this.level, this.held).set(held, column);
    this.player.start(this.level);
  }

  /** Sliders of the action, for tasks whose action is not a direction. */
  actionSliders() {
    const { action_low: low, action_high: high } = this.levels.about.task;
    if (low.length === 2) return;
    const sliders = low.map((x, k) => make("input", { type: "range", min: x, max: high[k], step: "any", value: this.player.idle[k], "aria-label": `component ${k} of the action` }));
    const act = make("button", { textContent: "Act", onclick: () => this.player.act(sliders.map((one) => Number(one.value))) });
    $("actions").append(...sliders, act);
    $("actions").hidden = false;
    $("about").textContent = `Set the action by its sliders, from ${low.map(short).join(", ")} to ${high.map(short).join(", ")}.`;
  }
}
