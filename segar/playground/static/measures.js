/** How far apart the two sets of a page are: W2 and KS, with what they are made of, as segar.metrics has them. */

import { finish, Plan } from "segar/transport.js";

export const MOST = 300; // levels of a set that count, the first ones
const READ = ["level_values", "level_parameters", "level_vertex"];
const HULL = 2;

export class Measures {
  /**
   * @param {object} about units, as segar.playground.objective describes them
   * @param {LevelSet[]} sets both of them
   */
  constructor(about, sets) {
    this.about = about;
    this.sets = sets;
    this.counts = sets.map((set) => Math.min(set.count, MOST));
    this.names = about.types.map((type) => type.factors.flatMap(componentsOf));
    this.weighed = this.names.map((names) => names.map((one, c) => ({ ...one, c })).filter((one) => one.scale > 0));
    this.points = sets.map((_, k) => Array.from({ length: this.counts[k] }, (_, level) => this.read(k, level)));
    this.costs = new Float64Array(this.counts[0] * this.counts[1]);
    this.stale = new Uint8Array(this.costs.length).fill(1);
    this.known = sets.map((set) => bytesOf(set).map((array) => array.slice()));
  }

  /** Look which levels were changed since this was last asked: a list of [set, level]. */
  changes() {
    const found = [];
    this.sets.forEach((set, k) => {
      const levels = new Set();
      bytesOf(set).forEach((array, a) => {
        const known = this.known[k][a];
        const size = array.length / set.count;
        for (let at = 0; at < array.length; at++) {
          if (array[at] === known[at]) continue;
          levels.add(Math.floor(at / size));
          known[at] = array[at];
        }
      });
      for (const level of levels) {
        found.push([k, level]);
        if (level >= this.counts[k]) continue;
        this.points[k][level] = this.read(k, level);
        const [n, m] = this.counts;
        for (let other = 0; other < (k ? n : m); other++) this.stale[k ? other * m + level : level * m + other] = 1;
      }
    });
    return found;
  }

  /** A level as numbers: of each type how many things it has and their factors, and the parameters of its world. */
  read(k, level) {
    const set = this.sets[k];
    const { machine } = set.world;
    const values = machine.part("level_values", level);
    const shapes = machine.part("level_kind", level);
    const columnOf = ({ factor, axis }) => set.about.columns[factor.name] + axis;
    const of = this.about.types.map(({ kinds }, t) => {
      const names = this.names[t];
      const raw = [];
      let count = 0;
      for (let slot = 0; slot < set.slots; slot++) {
        if (kinds[k] < 0 || set.kindOf(level, slot) !== kinds[k]) continue;
        count += 1;
        for (const one of names) {
          const ofOutline = one.factor.of_area && shapes[slot] === HULL;
          raw.push(ofOutline ? diameterOf(machine, level, slot) : values[slot * set.width + columnOf(one)]);
        }
      }
      const scaled = new Float64Array(count * this.weighed[t].length);
      this.weighed[t].forEach(({ c, scale }, w, all) => {
        for (let i = 0; i < count; i++) scaled[i * all.length + w] = raw[i * names.length + c] / scale;
      });
      return { count, raw, scaled };
    });
    const world = this.about.parameters.map(({ columns, default: missing }) =>
      (columns[k] < 0 ? missing : set.parameters(level)[columns[k]]));
    return { of, world };
  }

  /** Measure, and yield now and then; see finish. */
  * measured() {
    const [n, m] = this.counts;
    const [a, b] = this.points;
    const total = { square: 0, parts: new Map() };
    for (let i = 0; i < n; i++) {
      for (let j = 0; j < m; j++) {
        if (!this.stale[i * m + j]) continue;
        this.costs[i * m + j] = this.cost(a[i], b[j]);
        this.stale[i * m + j] = 0;
      }
      yield;
    }
    const shared = gcd(n, m);
    const plan = new Plan(n, m);
    yield* plan.solved(this.costs, n, m, m / shared, n / shared);
    const unit = shared / (n * m);
    for (let i = 0; i < n; i++) {
      for (let j = 0; j < m; j++) {
        const mass = plan.flow[i * m + j] * unit;
        if (mass === 0) continue;
        total.square += mass * this.costs[i * m + j];
        this.cost(a[i], b[j], (name, part) => total.parts.set(name, (total.parts.get(name) ?? 0) + mass * part));
      }
    }
    yield;
    const marginals = this.marginals();
    const curves = marginals.map((one) => curveOf(one.x, one.y));
    marginals.forEach((one, k) => {
      const { f, g } = curves[k];
      one.ks = f.reduce((most, share, at) => Math.max(most, Math.abs(share - g[at])), 0);
    });
    yield;
    const ks = Math.max(yield* largestDifference(curves, "f", "g"), yield* largestDifference(curves, "g", "f"));
    const parts = [...total.parts].filter(([, part]) => part > 0).sort((one, other) => other[1] - one[1]);
    return { w2: Math.sqrt(Math.max(total.square, 0)), parts, ks, marginals };
  }

  /** The squared distance of two levels; where it comes from is told by name. */
  cost(a, b, tell) {
    const { types, parameters, mismatch } = this.about;
    let sum = 0;
    for (let t = 0; t < types.length; t++) {
      const say = tell && ((name, part) => tell(`${types[t].name}.${name}`, part));
      sum += matched(a.of[t], b.of[t], this.weighed[t], mismatch * mismatch, say);
    }
    for (let p = 0; p < parameters.length; p++) {
      const { name, scale, period } = parameters[p];
      if (!scale) continue;
      const part = apart(a.world[p] / scale, b.world[p] / scale, period && period / scale) ** 2;
      sum += part;
      tell?.(`world.${name}`, part);
    }
    return sum;
  }

  /** The numbers of both sets by marginal, with its priors: numbers of things, components of factors, parameters. */
  marginals() {
    const found = [];
    const { types, parameters, densities } = this.about;
    const aboutOf = ({ unit, scale, priors }, axis) =>
      ({ unit, scale, priors: priors.map((of) => densities[of[axis]]) });
    const sorted = (numbers) => this.points.map((levels) => Float64Array.from(levels.flatMap(numbers)).sort());
    types.forEach(({ name }, t) => {
      const [x, y] = sorted(({ of }) => of[t].count);
      if (!x.at(-1) && !y.at(-1)) return;
      found.push({ name: `${name}.count`, unit: null, priors: [], x, y });
      if (!x.at(-1) || !y.at(-1)) return;
      this.names[t].forEach((one, c, all) => {
        const [of0, of1] = sorted(({ of }) =>
          of[t].raw.filter((_, at) => at % all.length === c).map((number) => cut(number, one.factor.period)));
        found.push({ ...aboutOf(one.factor, one.axis), name: `${name}.${one.name}`, x: of0, y: of1 });
      });
    });
    parameters.forEach((one, p) => {
      const [x, y] = sorted(({ world }) => cut(world[p], one.period));
      found.push({ ...aboutOf(one, 0), name: `world.${one.name}`, x, y });
    });
    return found;
  }
}

/** The components of a factor, with their scale, and their period in units of it. */
function componentsOf(factor) {
  const { name, scale, period } = factor;
  const names = factor.width > 1 ? [`${name}.x`, `${name}.y`] : [name];
  return names.map((one, axis) => ({ name: one, factor, axis, scale, period: period && period / scale }));
}

/** All that decides the distances of a set, as memory that can be compared. */
function bytesOf(set) {
  const read = READ.map((name) => set.world.machine.array(name));
  return [...read.map((array) => new Int32Array(array.buffer, array.byteOffset, array.byteLength / 4)), set.kinds];
}

/** Of a hull, the diameter of the disc of equal area. */
function diameterOf(machine, level, slot) {
  const count = machine.part("level_count", level)[slot];
  const at = machine.part("level_vertex", level, slot);
  let twice = 0;
  for (let k = 0; k < count; k++) {
    const next = (k + 1) % count;
    twice += at[2 * k] * at[2 * next + 1] - at[2 * k + 1] * at[2 * next];
  }
  return 2 * Math.sqrt(0.5 * twice / Math.PI);
}

/** A difference, the shorter way round where there is a period. */
function apart(x, y, period) {
  const straight = x - y;
  return period ? straight - period * Math.round(straight / period) : straight;
}

/** A number with a period as one between minus and plus half of it. */
function cut(x, period) {
  if (!period) return x;
  const half = period / 2;
  const rest = (x + half) % period;
  const wrapped = (rest < 0 ? rest + period : rest) - half;
  return wrapped >= half ? -half : wrapped;
}

function gcd(a, b) {
  return b ? gcd(b, a % b) : a;
}

/** The least cost of a partial matching of the things of one type, each thing left over at the price of a mismatch. */
function matched(a, b, weighed, price, tell) {
  if (!a.count && !b.count) return 0;
  const [few, many] = a.count <= b.count ? [a, b] : [b, a];
  const [k, j, d] = [few.count, many.count, weighed.length];
  let [kept, sum] = [0, 0];
  const { pairs, nearest, plan } = matchingOf(k, j);
  const square = (i, c, w) => apart(few.scaled[i * d + w], many.scaled[c * d + w], weighed[w].period) ** 2;
  const keep = (i, c) => {
    if (pairs[i * j + c] >= 2 * price) return;
    kept += 1;
    sum += pairs[i * j + c];
    if (tell) for (let w = 0; w < d; w++) tell(weighed[w].factor.name, square(i, c, w));
  };
  for (let i = 0; i < k; i++) {
    nearest[i] = 0;
    for (let c = 0; c < j; c++) {
      let squares = 0;
      for (let w = 0; w < d; w++) squares += square(i, c, w);
      pairs[i * j + c] = Math.min(squares, 2 * price);
      if (pairs[i * j + c] < pairs[i * j + nearest[i]]) nearest[i] = c;
    }
  }
  if (k < 2 || new Set(nearest.subarray(0, k)).size === k) {
    for (let i = 0; i < k; i++) keep(i, nearest[i]);
  } else {
    finish(plan.solved(pairs, k, j, 1, 1));
    for (let at = 0; at < k * j; at++) if (plan.flow[at]) keep(Math.floor(at / j), at % j);
  }
  const left = price * (k + j - 2 * kept);
  tell?.("unmatched", left);
  return sum + left;
}

let matching = { pairs: new Float64Array(0) };

/** Room for the matchings of so many things, which is used again. */
function matchingOf(k, j) {
  if (matching.pairs.length < k * j || matching.plan.rows < k || matching.plan.columns < j) {
    const rows = Math.max(k, matching.plan?.rows ?? 4);
    const columns = Math.max(j, matching.plan?.columns ?? 4);
    const [pairs, nearest] = [new Float64Array(rows * columns), new Int32Array(rows)];
    matching = { pairs, nearest, plan: new Plan(rows, columns) };
  }
  return matching;
}

/** The distribution functions f and g of two samples in ascending order, at each of their numbers. */
function curveOf(x, y) {
  const [f, g] = [[], []];
  for (let i = 0, j = 0; i < x.length || j < y.length;) {
    const at = j === y.length || x[i] < y[j] ? x[i] : y[j];
    while (x[i] === at) i++;
    while (y[j] === at) j++;
    f.push(i / x.length);
    g.push(j / y.length);
  }
  return { f, g };
}

/**
 * The largest difference of the products of functions, at any point of their product space; yields after each curve.
 * Of the pairs of products so far, only those on the edge of their hull towards a large first and a small second count.
 */
function* largestDifference(curves, first, second) {
  let best = [[1, 1]];
  for (const curve of curves) {
    const edge = joined(curve[first].map((p, k) => [p, curve[second][k]]).reverse(), []);
    if (edge.length === 1 && edge[0][0] === 1 && edge[0][1] === 1) continue;
    let edges = best.map(([p, q]) => edge.map(([x, y]) => [p * x, q * y]));
    while (edges.length > 1) {
      const pairs = Array.from({ length: Math.ceil(edges.length / 2) }, (_, k) => edges.slice(2 * k, 2 * k + 2));
      edges = pairs.map(([one, other]) => joined(one, other ?? []));
    }
    [best] = edges;
    yield;
  }
  return Math.max(...best.map(([p, q]) => p - q));
}

/** Of two lists of points (x, y) of falling x, the vertices of their hull that maximise some a x - b y of a, b >= 0. */
function joined(a, b) {
  const chain = [];
  let lowest = Infinity;
  for (let i = 0, j = 0; i < a.length || j < b.length;) {
    const point = j === b.length || (i < a.length && a[i][0] >= b[j][0]) ? a[i++] : b[j++];
    const [x, y] = point;
    if (y >= lowest) continue; // further left and not lower is never better
    lowest = y;
    if (chain.length && chain.at(-1)[0] === x) chain.pop();
    while (chain.length > 1) {
      const [[ax, ay], [bx, by]] = chain.slice(-2);
      if ((bx - ax) * (y - ay) - (by - ay) * (x - ax) < 0) break;
      chain.pop();
    }
    chain.push(point);
  }
  return chain;
}
