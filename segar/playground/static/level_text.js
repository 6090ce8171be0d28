/** Levels as text: the JSON that segar.Levels reads and writes. */

const SHAPES = [null, "circle", "hull"];

/** A number as JSON, which gives the same number back; JSON.stringify loses the sign of zero. */
export function numberText(x) {
  return Object.is(x, -0) ? "-0.0" : Number.isInteger(x) && Math.abs(x) < 1e15 ? x.toFixed(1) : String(x);
}

/** Any plain value as JSON with numbers as numberText has them, in lines as a person reads it. */
export function asText(value, indent = "") {
  const inner = `${indent} `;
  if (typeof value === "number") return numberText(value);
  if (Array.isArray(value)) {
    if (value.every((one) => typeof one !== "object" || one === null || (Array.isArray(one) && one.length <= 2))) {
      return `[${value.map((one) => asText(one)).join(", ")}]`;
    }
    return `[\n${value.map((one) => inner + asText(one, inner)).join(",\n")}\n${indent}]`;
  }
  if (value instanceof Whole) return String(value.number);
  if (value !== null && typeof value === "object") {
    const parts = Object.entries(value).map(([key, one]) => `${inner}${JSON.stringify(key)}: ${asText(one, inner)}`);
    return parts.length ? `{\n${parts.join(",\n")}\n${indent}}` : "{}";
  }
  return JSON.stringify(value);
}

/** A whole number, which is written without a point. */
export class Whole {
  constructor(number) {
    this.number = number;
  }
}

/** A level as plain data. */
export function levelData(levels, level) {
  const { about, world } = levels;
  const entities = {};
  const kinds = world.machine.part("level_kind", level);
  for (let slot = 0; slot < levels.slots; slot++) {
    const kind = about.kinds[levels.kindOf(level, slot)];
    if (!kind) continue;
    const one = { type: kind.name, shape: SHAPES[kinds[slot]] };
    if (one.shape === "hull") {
      const corners = world.machine.part("level_vertex", level, slot);
      const count = world.machine.part("level_count", level)[slot];
      one.vertices = Array.from({ length: count }, (_, k) => [corners[2 * k], corners[2 * k + 1]]);
    }
    one.factors = {};
    const sampled = {};
    for (const name of kind.holds) {
      const numbers = levels.factor(level, slot, name);
      if (numbers.some(Number.isNaN)) continue;
      one.factors[name] = numbers.length === 1 ? numbers[0] : numbers;
      const drawn = levels.drawn(level, slot, name);
      if (drawn && drawn.some((x, k) => !Object.is(x, numbers[k]))) sampled[name] = drawn.length === 1 ? drawn[0] : drawn;
    }
    if (Object.keys(sampled).length) one.sampled = sampled;
    entities[about.slots[slot].name] = one;
  }
  const parameters = Object.fromEntries(about.parameters.map((name, k) => [name, levels.parameters(level)[k]]));
  return { index: new Whole(about.indices[level]), parameters, entities };
}

/** The text of a file with these levels. */
export function fileText(levels, some) {
  const described = JSON.stringify(levels.about.description);
  const listed = some.map((level) => asText(levelData(levels, level), " ")).join(",\n ");
  return `{"format": "segar-levels", "version": 1,\n"description": ${described},\n"levels": [\n ${listed}\n]}\n`;
}

/** Make a level what a text says: that of a level, or of a file whose first level is meant. Errors say where and why. */
export function readLevel(levels, level, text) {
  let data;
  try {
    data = JSON.parse(text);
  } catch (error) {
    throw new RangeError(`the text is no JSON: ${error.message}`);
  }
  if (data?.format === "segar-levels") data = data.levels?.[0];
  if (typeof data?.entities !== "object" || data.entities === null) throw new RangeError("a level has entities: {name: {type, factors}}");
  const { about } = levels;
  levels.together(level, () => {
    for (const name of Object.keys(data.entities)) known(name, about.slots.map((slot) => slot.name), "entities");
    about.slots.forEach((slot, k) => readThing(levels, level, k, data.entities[slot.name]));
    for (const [name, value] of Object.entries(data.parameters ?? {})) {
      known(name, about.parameters, "parameters");
      levels.setParameter(level, name, value);
    }
  });
}

/** Make the thing of a slot what a text says; undefined where the text has none. */
function readThing(levels, level, k, one) {
  const { kinds, slots } = levels.about;
  const { name, kinds: possible, optional } = slots[k];
  if (!one && !optional) throw new RangeError(`entities.${name} is missing`);
  const names = possible.map((kind) => kinds[kind].name);
  if (one) known(one.type, names, `entities.${name}.type`);
  levels.setKind(level, k, one ? possible[names.indexOf(one.type)] : -1);
  for (const [factor, value] of Object.entries(one?.factors ?? {})) {
    const place = `entities.${name}.factors`;
    known(factor, kinds[levels.kindOf(level, k)].holds, place);
    const numbers = Array.isArray(value) ? value : [value];
    if (numbers.some((x) => typeof x !== "number")) throw new RangeError(`${place}.${factor} must be a number, not ${JSON.stringify(value)}`);
    levels.setFactor(level, k, factor, numbers);
  }
}

function known(name, names, place) {
  if (!names.includes(name)) throw new RangeError(`${place}: there is no ${JSON.stringify(name)} here, only ${names.join(", ")}`);
}
