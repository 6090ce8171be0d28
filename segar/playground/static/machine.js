/** A WebAssembly module of SEGAR with the arrays in its memory, by name. */

const ALIGNED = 16;
const PAGE = 65536;
const ARRAYS = {
  float64: Float64Array, float32: Float32Array, int64: BigInt64Array, uint64: BigUint64Array, int32: Int32Array,
  int16: Int16Array, int8: Int8Array, uint8: Uint8Array, bool: Uint8Array,
};

/** The array type of a dtype. */
export function arrayType(dtype) {
  const found = ARRAYS[dtype];
  if (!found) throw new Error(`no array holds numbers of the type ${dtype}`);
  return found;
}

export class Machine {
  /**
   * @param {object} about code, places, calls and sizes, as segar.playground.modules describes them
   * @param {(blob: number) => Uint8Array} blob bytes of the page by their number
   */
  static async load(about, blob) {
    const module = await WebAssembly.compile(await new Blob(about.code.map(blob)).arrayBuffer());
    const section = WebAssembly.Module.customSections(module, "segar")[0];
    const described = JSON.parse(new TextDecoder().decode(section));
    const instance = await WebAssembly.instantiate(module, {});
    return new Machine(about, blob, described.exports, instance.exports);
  }

  constructor(about, blob, described, exports) {
    this.exports = exports;
    this.entries = Object.fromEntries(described.map((one) => [one.name, one]));
    this.sizes = about.sizes;
    this.calls = about.calls;
    this.places = {};
    let top = exports.__heap_base.value;
    for (const [name, place] of Object.entries(about.places)) {
      const shape = place.shape.map((size) => (typeof size === "string" ? this.sizes[size] : size));
      const length = shape.reduce((product, size) => product * size, 1);
      top = Math.ceil(top / ALIGNED) * ALIGNED;
      this.places[name] = { ...place, shape, length, address: top };
      top += length * arrayType(place.dtype).BYTES_PER_ELEMENT;
    }
    const lacking = top - exports.memory.buffer.byteLength;
    if (lacking > 0) exports.memory.grow(Math.ceil(lacking / PAGE));
    for (const [name, place] of Object.entries(this.places)) {
      if (place.data) write(this.array(name), place.data.dtype, ...place.data.parts.map(blob));
    }
    for (const [name, place] of Object.entries(this.places)) {
      if (place.edges_of) writeEdges(this.array(name), ...place.edges_of.map((of) => this.array(of)));
    }
  }

  /** The present memory of an array. */
  array(name) {
    const place = this.places[name];
    return new (arrayType(place.dtype))(this.exports.memory.buffer, place.address, place.length);
  }

  /** Names of the arrays with a part for each level; of those with a part for each thing of each level, where asked. */
  ofLevels(ofThings = false) {
    const named = Object.entries(this.places).filter(([, place]) => (ofThings ? place.of_things : place.of_levels));
    return named.map(([name]) => name);
  }

  /** The part of such an array that belongs to a level, or to a thing of a level. */
  part(name, level, slot) {
    const { shape, length } = this.places[name];
    const ofLevel = length / shape[0];
    const size = slot === undefined ? ofLevel : ofLevel / shape[1];
    const first = level * ofLevel + (slot === undefined ? 0 : slot * size);
    return this.array(name).subarray(first, first + size);
  }

  /** Make all calls of a role, with these numbers for arguments that are no arrays. */
  run(role, numbers = {}) {
    for (const { entry, names, sizes } of this.calls[role]) {
      const values = this.entries[entry].arguments.map(([name, dtype, shape]) => {
        if (shape !== undefined) return this.places[names[name]].address;
        if (name === "start") return 0;
        if (name === "stop") return 1;
        const value = sizes?.[name] ?? this.sizes[name] ?? numbers[name];
        if (value === undefined) throw new Error(`${entry} needs the number ${name}`);
        return dtype === "uint64" ? BigInt.asIntN(64, BigInt(value)) : Number(value);
      });
      this.exports[entry](...values);
    }
  }
}

/** Write the numbers of an array as a page holds them, see Blobs.add_array; some places hold others, with all their bits. */
export function write(array, dtype, planes, places, exact) {
  const width = planes.length / array.length;
  const size = width < 8 ? width : 1; // longer numbers are not in planes
  const bytes = new Uint8Array(planes.length);
  for (let k = 0, plane = 0; plane < size; plane++) {
    for (let at = plane; at < bytes.length; at += size) bytes[at] = planes[k++];
  }
  array.set(dtype === "float16" ? Float32Array.from(new Uint16Array(bytes.buffer), ofHalf) : new (arrayType(dtype))(bytes.buffer));
  const others = new array.constructor(exact.buffer, exact.byteOffset, places.length / 4);
  new Int32Array(places.buffer, places.byteOffset, others.length).forEach((place, k) => { array[place] = others[k]; });
}

/** The number that 16 bits are in the form of IEEE 754; finite. */
function ofHalf(bits) {
  const [exponent, fraction] = [(bits >> 10) & 31, bits & 1023];
  const size = exponent === 0 ? fraction * 2 ** -24 : (1024 + fraction) * 2 ** (exponent - 25);
  return bits >> 15 ? -size : size;
}

/** Edges of convex polygons as lines, as segar.observations has them: a, b, c of a x + b y + c, and 1 / a. */
export function writeEdges(edges, vertices, counts) {
  const room = vertices.length / 2 / counts.length;
  for (let i = 0; i < counts.length; i++) {
    for (let k = 0; k < room; k++) {
      const at = 2 * (i * room + k);
      const next = 2 * (i * room + ((k + 1) % Math.max(counts[i], 1)));
      const dx = vertices[next] - vertices[at];
      const dy = vertices[next + 1] - vertices[at + 1];
      const length = Math.sqrt(dx * dx + dy * dy);
      const a = -dy / (length > 0 ? length : 1);
      const b = dx / (length > 0 ? length : 1);
      const c = -(a * vertices[at] + b * vertices[at + 1]);
      edges.set([a, b, c, Math.abs(a) > LEVEL_EDGE ? 1 / a : 0], 2 * at);
    }
  }
}

const LEVEL_EDGE = 1e-6;
