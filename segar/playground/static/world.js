/** Episodes on the levels of one set, as segar.envs.VectorEnv plays them with one environment, to the bit. */

import { Machine } from "segar/machine.js";

const CONFLICT = 1;
const BATCH = 512; // episodes that segar.evaluation plays at once
const APART = 0x9e3779b97f4a7c15n; // the environments of a batch, in what their draws follow from
const SAID = {
  2: "a number of the state is not finite after this step: some rule divides by zero or overflows",
  3: "the reward of this step is not finite",
  4: "an action is not finite",
};

export class World {
  /** Load the modules of a set; see segar.playground.world. */
  static async load(about, blob) {
    const observations = await Promise.all(about.observations.map((one) => Machine.load(one, blob)));
    return new World(about, await Machine.load(about.module, blob), observations);
  }

  constructor(about, machine, observations) {
    this.about = about;
    this.machine = machine;
    this.observers = observations;
    this.level = 0;
    this.seed = 0n;
    this.actions = [];
    this.failed = null;
    this.start(0, 0);
  }

  get values() {
    return this.machine.array("values");
  }

  get steps() {
    return this.actions.length;
  }

  /**
   * Start an episode on a level. What rules, textures and policies draw follows from the seed, and from the place of the
   * environment among all that segar.evaluation.play_episodes starts; or from the key, where it is given.
   */
  start(level, seed, place = 0, key = null) {
    const { machine } = this;
    this.level = level;
    this.seed = BigInt(seed);
    this.place = place;
    this.actions = [];
    this.rewards = [];
    this.total = 0;
    this.terminated = this.truncated = false;
    this.failed = this.cause = null;
    for (const name of ["reward", "terminated", "success", "death", "errors"]) {
      const array = machine.array(name);
      array.fill(array instanceof BigInt64Array ? 0n : 0);
    }
    machine.array("episodes")[0] = BigInt(place % BATCH) * APART; // counts the episode of environment 0 as the first one of that place
    machine.array("chosen")[0] = BigInt(level);
    machine.run("start", { seed: this.seed + BigInt(place - (place % BATCH)) });
    if (key !== null) machine.array("key")[0] = key;
    for (const observer of this.observers) {
      this.tell(observer, "begin");
      if (remembers(observer)) this.tell(observer, "write");
    }
  }

  get over() {
    return this.terminated || this.truncated || this.failed !== null;
  }

  get success() {
    return this.machine.array("success")[0] !== 0;
  }

  get death() {
    return this.machine.array("death")[0] !== 0;
  }

  /** Take a step with an action, which is held to the task's range; nothing happens when the episode is over. */
  step(action) {
    if (this.over) return;
    const { machine } = this;
    const taken = Float32Array.from(action);
    machine.array("actions").set(taken);
    machine.run("step", { sub_steps: this.about.task.sub_steps, with_task: 1 });
    const errors = machine.array("errors");
    if (errors[0] !== 0n) {
      this.failed = this.said(errors);
      errors.fill(0n);
      return;
    }
    for (const observer of this.observers.filter(remembers)) {
      this.tell(observer, "advance");
      this.tell(observer, "write");
    }
    const reward = machine.array("reward")[0];
    this.actions.push(taken);
    this.rewards.push(reward);
    this.total += reward;
    this.terminated = machine.array("terminated")[0] !== 0;
    this.truncated = this.steps >= this.about.task.max_steps && !this.terminated;
  }

  /** What an error of the kernel means. */
  said(errors) {
    if (Number(errors[0]) !== CONFLICT) return SAID[Number(errors[0])] ?? `error ${errors[0]}`;
    const [slot, column, first, second] = Array.from(errors.slice(1), Number);
    const { slots, rules, columns, factors } = this.about;
    const factor = Object.keys(columns).find((name) => columns[name] <= column && column < columns[name] + factors[name].width);
    return `${rules[first]} and ${rules[second]} set ${factor} of '${slots[slot].name}' to different values, and neither is more specific; give one a priority`;
  }

  /** What agents see now, by the number of the observation; the memory of its module, until the next call. */
  observe(k) {
    const observer = this.observers[k];
    if (!remembers(observer)) this.tell(observer, "write");
    return observer.array("observation");
  }

  /** Copy the present state into a module's memory and make its calls. */
  tell(observer, role) {
    for (const name of ["values", "level", "key", "tick", "actions"]) {
      if (name in observer.places) observer.array(name).set(this.machine.array(name));
    }
    observer.run(role);
  }
}

/** Whether an observation shows something of the past, so that it is written in each step. */
function remembers(observer) {
  return observer.calls.advance.length > 0;
}
