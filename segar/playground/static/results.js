/** What players achieve on the levels of a page as they came, played beside the episode that is shown. */

import { Policy } from "segar/policy.js";
import { idleAction } from "segar/player.js";
import { World } from "segar/world.js";

const SLICE = 8; // [ms] of playing until pictures are drawn and keys are heard
const RANDOM_PLAYS = 20; // per level, as segar.evaluation.find_baselines plays

export class Results {
  constructor(about, blob) {
    this.about = about;
    this.blob = blob;
    this.worlds = [];
    this.policy = null;
    this.turn = Promise.resolve();
    this.end = 0;
    this.plans = about.sets.map((set) => set.baselines && plansOf(set, blob));
    this.episodes = about.sets.map(() => ({ you: [], agent: [], random: [], idle: [] }));
  }

  /** Note an episode of a player on a level. */
  note(set, player, level, episode) {
    (this.episodes[set][player][level] ??= []).push(episode);
  }

  /** Play episodes of a player on each level of a set on which there are none; told is called after each level. */
  async playAll(set, player, seed, told = () => {}) {
    const plays = player === "random" ? RANDOM_PLAYS : 1;
    for (let level = 0; level < this.about.sets[set].count; level++) {
      if (this.episodes[set][player][level]) continue;
      const played = [];
      for (let k = 0; k < plays; k++) played.push(await this.play(set, player, level, seed, k));
      this.episodes[set][player][level] = played;
      told();
    }
  }

  /** An episode of "agent", "random", "idle" or "planner": its return, its end, its steps, and the way of the agent's body. */
  play(set, player, level, seed, k = 0) {
    const played = this.turn.then(() => this.playNow(set, player, level, seed, k));
    this.turn = played.catch(() => {});
    return played;
  }

  /** The episode, in slices of time; one at a time. */
  async playNow(set, player, level, seed, k) {
    const about = this.about.sets[set];
    const world = await (this.worlds[set] ??= World.load(about, this.blob));
    const actor = await this.actor(set, player, level, k);
    world.start(level, seed, level, actor.key ?? null);
    actor.begin?.();
    const column = about.agents.length ? about.agents[0] * about.width + about.columns.Position : null;
    const path = [];
    const note = () => column !== null && path.push([...world.values.subarray(column, column + 2)]);
    note();
    while (!world.over) {
      if (performance.now() > this.end) {
        await new Promise((resolve) => setTimeout(resolve));
        this.end = performance.now() + SLICE;
      }
      world.step(actor.action(world));
      note();
    }
    return { ...outcome(world), path };
  }

  async actor(set, player, level, k) {
    const { task } = this.about.sets[set];
    if (player === "agent") return (this.policy ??= await Policy.load(this.about.policy, this.blob));
    if (player === "planner") return this.plans[set][level];
    if (player === "idle") return { action: () => idleAction(task) };
    const draw = generator(level * RANDOM_PLAYS + k);
    return { action: () => task.action_low.map((low, a) => low + draw() * (task.action_high[a] - low)) };
  }

  /** The mean return of a player on a level; undefined where it has not played. */
  returned(set, player, level) {
    const { baselines } = this.about.sets[set];
    const known = baselines?.[{ planner: "oracle", random: "random", idle: "idle" }[player]];
    return known ? known[level] : mean(this.episodes[set][player]?.[level], (one) => one.returned);
  }

  /** The share of a player's episodes on a level that succeed; undefined where it is not known. */
  success(set, player, level) {
    if (player === "planner") return this.about.sets[set].baselines && Number(this.about.sets[set].baselines.solved[level]);
    return mean(this.episodes[set][player][level], (one) => Number(one.success));
  }

  /**
   * The score of a player on some levels, as segar.evaluation.Baselines counts it: 0 for the better of random and idle play
   * on each level, 1 for the planner; undefined without baselines, or where the planner is no better.
   */
  score(set, player, levels) {
    if (!this.plans[set]) return undefined;
    const of = (one) => mean(levels, (level) => this.returned(set, one, level));
    const floor = mean(levels, (level) => Math.max(this.returned(set, "random", level), this.returned(set, "idle", level)));
    const span = of("planner") - floor;
    return span > 0 ? (of(player) - floor) / span : undefined;
  }
}

/** How an episode ended. */
export function outcome(world) {
  return { returned: world.total, success: world.success, death: world.death, steps: world.steps, failed: world.failed };
}

/** The mean of a number of each; undefined where there is none. */
export function mean(some, number) {
  return some?.length ? some.reduce((sum, one) => sum + number(one), 0) / some.length : undefined;
}

/** The planner on each level: its actions in their order, and the key of what rules draw in its plan. */
function plansOf({ baselines, task }, blob) {
  const actions = new Float32Array(blob(baselines.actions).slice().buffer);
  const keys = new BigUint64Array(blob(baselines.keys).slice().buffer);
  const size = task.action_low.length;
  let first = 0;
  return baselines.steps.map((steps, level) => {
    const mine = actions.subarray(first, first + size * steps);
    first += size * steps;
    return { key: keys[level], action: (world) => mine.slice(size * world.steps, size * (world.steps + 1)) };
  });
}

/** Numbers from 0 to 1 that depend on the seed alone (mulberry32). */
function generator(seed) {
  let state = seed | 0;
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let x = Math.imul(state ^ (state >>> 15), 1 | state);
    x = (x + Math.imul(x ^ (x >>> 7), 61 | x)) ^ x;
    return ((x ^ (x >>> 14)) >>> 0) / 2 ** 32;
  };
}
