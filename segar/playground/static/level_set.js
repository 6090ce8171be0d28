/** The levels of a set, which can be changed: factors, places, which things there are. Every change can be undone. */

const ABSENT = -1;

export class LevelSet {
  /** @param {World} world whose modules hold the levels; @param {(blob: number) => Uint8Array} blob bytes of the page */
  constructor(world, blob) {
    const { about } = world;
    const copied = (k) => blob(k).slice().buffer;
    const [places, numbers] = [new Int32Array(copied(about.sampled[0])), new Float64Array(copied(about.sampled[1]))];
    this.world = world;
    this.about = about;
    this.kinds = new Int16Array(copied(about.types));
    this.sampled = new Map([...places].map((place, k) => [place, numbers[k]]));
    this.slots = world.about.slots.length;
    this.width = world.about.width;
    this.past = [];
    this.changed = new Set();
    this.cameAs = new Map(); // level to a copy of what it was before it was changed
  }

  get count() {
    return this.about.count;
  }

  /** All levels, by their numbers. */
  get levelNumbers() {
    return Array.from({ length: this.count }, (_, level) => level);
  }

  get machines() {
    return [this.world.machine, ...this.world.observers];
  }

  /** The kind of a thing, as a number of about.kinds; negative where there is none. */
  kindOf(level, slot) {
    return this.kinds[level * this.slots + slot];
  }

  /** The initial state of a thing, one number per column. */
  values(level, slot) {
    return this.world.machine.part("level_values", level, slot);
  }

  /** The numbers of a factor of a thing; null where it lacks the factor. */
  factor(level, slot, name) {
    const kind = this.about.kinds[this.kindOf(level, slot)];
    if (!kind?.holds.includes(name)) return null;
    const column = this.about.columns[name];
    return [...this.values(level, slot).subarray(column, column + this.about.factors[name].width)];
  }

  /** The numbers of a factor as they were drawn, before things were moved apart; null once the level was changed. */
  drawn(level, slot, name) {
    if (this.changed.has(level)) return null;
    const first = (level * this.slots + slot) * this.width + this.about.columns[name];
    const numbers = this.factor(level, slot, name);
    return numbers.map((x, k) => this.sampled.get(first + k) ?? x);
  }

  /** Set numbers of a factor; throws a RangeError that says what they can be. */
  setFactor(level, slot, name, numbers) {
    const { factors, columns, slots } = this.about;
    const { width } = factors[name];
    if (this.factor(level, slot, name) === null) throw new RangeError(`'${slots[slot].name}' has no ${name}`);
    if (numbers.length !== width) throw new RangeError(`${name} is ${width} numbers, not ${numbers.length}`);
    check(`${name} of '${slots[slot].name}'`, factors[name], numbers);
    this.remember(level);
    this.values(level, slot).set(numbers, columns[name]);
  }

  /** Set a parameter of a level's world. */
  setParameter(level, name, number) {
    check(`the world's ${name}`, this.about.worlds[name], [number]);
    this.remember(level);
    this.parameters(level)[this.about.parameters.indexOf(name)] = number;
    if (name === "FloorFriction") this.values(level, this.slots - 1)[this.about.columns.Friction] = number; // rules read the floor's
  }

  parameters(level) {
    return this.world.machine.part("level_parameters", level);
  }

  /** Kinds that a slot can have in this page: those that some level has there. */
  kindsOf(slot) {
    const found = this.about.slots[slot].kinds.filter((kind) => this.levelWith(slot, kind) !== null);
    return this.about.slots[slot].optional ? [ABSENT, ...found] : found;
  }

  /** A level that came with a thing of this kind in the slot; null where none did. */
  levelWith(slot, kind) {
    for (let level = 0; level < this.count; level++) {
      if (this.kindOf(level, slot) === kind && !this.changed.has(level)) return level;
    }
    return null;
  }

  /** Make the thing of a slot one of another kind, as it is in a level that came with one, where it stands now. */
  setKind(level, slot, kind) {
    if (kind === this.kindOf(level, slot)) return;
    this.remember(level);
    const place = this.factor(level, slot, "Position");
    if (kind < 0) {
      for (const machine of this.machines) {
        for (const name of machine.ofLevels(true)) {
          const part = machine.part(name, level, slot);
          part.fill(part instanceof BigInt64Array ? 0n : 0);
          if (KIND_NAMES.test(name)) part.fill(ABSENT);
        }
      }
      this.values(level, slot).fill(NaN);
    } else {
      const from = this.levelWith(slot, kind);
      if (from === null) throw new RangeError(`no level of this page has a ${this.about.kinds[kind].name} there`);
      for (const machine of this.machines) {
        for (const name of machine.ofLevels(true)) machine.part(name, level, slot).set(machine.part(name, from, slot));
      }
      if (place) this.values(level, slot).set(place, this.about.columns.Position);
    }
    this.kinds[level * this.slots + slot] = kind;
  }

  /** Make several changes of a level one, for undo; where one of them throws, none is made. */
  together(level, changes) {
    const [before, past] = [this.copy(level), this.past];
    this.past = [];
    try {
      changes();
    } catch (error) {
      this.restore(before);
      throw error;
    } finally {
      this.past = past;
    }
    this.keep(before);
  }

  /** Keep a level as it is now, for undo. */
  remember(level) {
    const before = this.copy(level);
    if (!this.changed.has(level)) this.cameAs.set(level, before);
    this.keep(before);
    this.changed.add(level);
  }

  /** What a function returns while all levels are as they came. */
  asTheyCame(what) {
    const now = [...this.changed].map((level) => this.copy(level));
    for (const { level } of now) this.restore(this.cameAs.get(level));
    try {
      return what();
    } finally {
      for (const one of now) {
        this.restore(one);
        this.changed.add(one.level);
      }
    }
  }

  /** Keep a copy of a level, for undo. */
  keep(before) {
    this.past.push(before);
    if (this.past.length > MOST_PAST) this.past.shift();
  }

  /** All that decides a level, as copies. */
  copy(level) {
    const parts = this.machines.map((machine) =>
      Object.fromEntries(machine.ofLevels().map((name) => [name, machine.part(name, level).slice()])),
    );
    return { level, parts, kinds: this.kinds.slice(level * this.slots, (level + 1) * this.slots), was: this.changed.has(level) };
  }

  /** Make a level what a copy says. */
  restore({ level, parts, kinds, was }) {
    this.machines.forEach((machine, k) => {
      for (const [name, part] of Object.entries(parts[k])) machine.part(name, level).set(part);
    });
    this.kinds.set(kinds, level * this.slots);
    if (!was) this.changed.delete(level);
  }

  /** Undo the last change; returns its level, or null where there is none. */
  undo() {
    const last = this.past.pop();
    if (!last) return null;
    this.restore(last);
    return last.level;
  }
}

/** Throw a RangeError unless the numbers are such as segar.Factor.is_possible allows. */
function check(what, { bounds, possible, whole, flag, negative, zero }, numbers) {
  const [low, high] = bounds ?? [-LARGEST, LARGEST];
  for (const x of numbers) {
    const fits = x >= low && x <= high && (!whole || Number.isInteger(x)) && (!flag || x === 0 || x === 1) && (negative || x >= 0) && (zero || x !== 0);
    if (!fits) throw new RangeError(`${what} must be ${possible}, not ${x}`);
  }
}

const LARGEST = 1e30;
const MOST_PAST = 200;
const KIND_NAMES = /types$/;
