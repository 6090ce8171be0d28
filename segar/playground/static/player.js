/** Time on a page: when steps are taken, by whom, and what the present moment looks like. */

const LONGEST = 0.25; // [s] that one picture catches up with

export class Player {
  /**
   * @param {World} world
   * @param {() => void} changed is called whenever the episode or its state changes
   */
  constructor(world, changed) {
    this.world = world;
    this.changed = changed;
    this.running = false;
    this.speed = 1;
    this.waiting = 0;
    this.queue = null; // actions that are replayed
    this.actor = null; // gives actions where nobody replays
    this.once = null; // the next action, by a person
    this.assisted = false; // whether somebody else than the person acted in this episode
    this.before = world.values.slice();
  }

  /** Start an episode, and wait. The place is as in World.start. */
  start(level, seed = this.world.seed, place = 0) {
    this.world.start(level, seed, place);
    this.before = this.world.values.slice();
    this.queue = this.once = null;
    this.running = false;
    this.assisted = this.actor !== null;
    this.waiting = 0;
    this.actor?.begin?.();
    this.changed();
  }

  /** Play the present episode again from its start. */
  replay() {
    const actions = this.world.actions;
    this.start(this.world.level, this.world.seed, this.world.place);
    this.queue = [...actions];
    this.running = this.queue.length > 0;
    this.changed();
  }

  /** The action that does nothing. */
  get idle() {
    return idleAction(this.world.about.task);
  }

  /** An action of the direction (right, up), each from -1 to 1, in the task's range; 0 stays 0 where the range holds it. */
  inRange(unit) {
    const { action_low: low, action_high: high } = this.world.about.task;
    return unit.map((x, k) => {
      if (low[k] < 0 && high[k] > 0) return x >= 0 ? x * high[k] : -x * low[k];
      return low[k] + (x + 1) / 2 * (high[k] - low[k]);
    });
  }

  /** Act once, and let time run. */
  act(action) {
    if (this.world.over) return;
    this.queue = null;
    this.once = action;
    this.running = true;
    this.changed();
  }

  /** Take one step now. */
  step() {
    if (this.world.over) {
      this.running = false;
      return;
    }
    this.before = this.world.values.slice();
    const proposed = this.actor?.action(this.world); // asked for in each step, because the actor may remember
    const others = this.queue ? this.queue.shift() : proposed;
    if (others && !this.once) this.assisted = true;
    const action = this.once ?? others ?? this.idle;
    this.once = null;
    this.world.step(action);
    if (this.queue?.length === 0) {
      this.queue = null;
      this.running = !this.world.over && this.running && this.actor !== null;
    }
    if (this.world.over) this.running = false;
    this.changed();
  }

  /** Let so many seconds pass. */
  pass(seconds) {
    if (!this.running) return;
    this.waiting += Math.min(seconds, LONGEST) * this.speed * this.world.about.steps_per_second;
    while (this.waiting >= 1 && this.running) {
      this.waiting -= 1;
      this.step();
    }
  }

  /** The state between the last two steps that people see now. */
  get shown() {
    const now = this.world.values;
    if (!this.running) return now;
    const { columns, width } = this.world.about;
    const shown = now.slice();
    const share = Math.min(this.waiting, 1);
    for (let at = columns.Position; at < shown.length; at += width) {
      for (const k of [at, at + 1]) shown[k] = this.before[k] + share * (now[k] - this.before[k]);
    }
    return shown;
  }

  /** Mean acceleration of each thing in the last step [m/s^2]; undefined where it has no velocity. */
  get acceleration() {
    const { columns, width, steps_per_second: rate, slots } = this.world.about;
    if (columns.Velocity === undefined) return [];
    const now = this.world.values;
    return slots.map((_, slot) => {
      const at = slot * width + columns.Velocity;
      const change = [0, 1].map((k) => (now[at + k] - this.before[at + k]) * rate);
      return change.every(Number.isFinite) ? change : undefined;
    });
  }
}

/** The action of a task that does nothing, or the one nearest to it. */
export function idleAction({ action_low: low, action_high: high }) {
  return low.map((x, k) => Math.min(Math.max(0, x), high[k]));
}
