/** What people see of an episode: the arena from above, on a canvas, with overlays. */

import { drawSigns } from "segar/marks.js";

const CIRCLE = 1;
const HULL = 2;
const FLOOR = "#0d1117";
const GRID = "#1c2430";
const WALL = "#8b98a9";
const GHOST = "#c9a7ff";

export class Scene {
  constructor(canvas, levels, signs) {
    this.canvas = canvas;
    this.signs = signs;
    this.levels = levels;
    this.overlays = new Set(["velocity"]);
    this.says = (thing) => this.nameOf(thing); // the words that name a thing
  }

  get about() {
    return this.levels.about;
  }

  /** Metres of a point of the window. */
  metres(clientX, clientY) {
    const box = this.canvas.getBoundingClientRect();
    const { walls } = this.about;
    return [((clientX - box.left) / box.width * 2 - 1) * walls, (1 - (clientY - box.top) / box.height * 2) * walls];
  }

  /** Things as they are drawn, from the lowest to the highest, of a state of a level. */
  things(values, level) {
    const { about, levels } = this;
    const { columns, width } = about;
    const kind = levels.world.machine.part("level_kind", level);
    const found = [];
    for (let slot = 0; slot < levels.slots; slot++) {
      const type = about.kinds[levels.kindOf(level, slot)];
      if (!type || (kind[slot] !== CIRCLE && kind[slot] !== HULL) || !type.holds.includes("Position")) continue;
      const read = (name, missing) => (type.holds.includes(name) ? values[slot * width + columns[name]] : missing);
      const at = slot * width + columns.Position;
      const thing = {
        slot, type, x: values[at], y: values[at + 1], radius: read("Size", 0) / 2, order: read("Order", 0),
        visible: read("Visible", 1) > 0, alive: read("Alive", 1) > 0, done: read("Done", 0) > 0, corners: null,
        heat: read("Heat", 0), friction: read("Friction", 0), charge: read("Charge", 0), magnetism: read("Magnetism", 0),
        energy: read("StoredEnergy", 0), mobile: read("Mobile", 0) > 0, agent: about.agents.includes(slot), velocity: null,
      };
      if (type.holds.includes("Velocity")) {
        const v = slot * width + columns.Velocity;
        thing.velocity = [values[v], values[v + 1]];
      }
      if (kind[slot] === HULL) {
        const count = levels.world.machine.part("level_count", level)[slot];
        thing.corners = levels.world.machine.part("level_vertex", level, slot).slice(0, 2 * count);
        thing.radius = levels.world.machine.part("level_hull_radius", level)[slot];
      }
      thing.rgb = colourOf(type, read(type.factor, 0));
      thing.colour = `rgb(${thing.rgb.join(",")})`;
      thing.light = thing.rgb[0] + thing.rgb[1] + thing.rgb[2] > (type.tile ? 300 : 330);
      if (Number.isFinite(thing.x) && Number.isFinite(thing.y)) found.push(thing);
    }
    const tiles = found.filter((one) => one.type.tile).sort((a, b) => b.order - a.order);
    return [...tiles, ...found.filter((one) => !one.type.tile).sort((a, b) => a.order - b.order)];
  }

  /** The topmost thing at a place [m]; undefined where there is none. */
  thingAt(values, level, [x, y]) {
    return this.things(values, level).reverse().find((one) => covers(one, x, y, TOUCHED * this.about.walls));
  }

  /** Draw a state of a level; aim, marked, ghost and other, a place where somebody else is, are optional. */
  draw(values, level, { aim, marked, ghost, other, acceleration } = {}) {
    const { canvas, about } = this;
    const side = canvas.width;
    const context = canvas.getContext("2d");
    const scale = side / (2 * about.walls);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = FLOOR;
    context.fillRect(0, 0, side, side);
    context.setTransform(scale, 0, 0, -scale, side / 2, side / 2);
    grid(context, about.walls, 1 / scale);
    for (const thing of this.things(values, level)) {
      context.globalAlpha = (thing.visible ? 1 : 0.35) * (thing.alive && !thing.done ? 1 : 0.4);
      context.fillStyle = thing.colour;
      outline(context, thing);
      context.fill();
      this.shade(context, thing);
      drawSigns(context, thing, this.signs, 2 * about.walls / 512, (share) => outline(context, thing, share));
      outline(context, thing);
      context.lineWidth = (thing.slot === marked ? 4 : 1.5) / scale;
      context.strokeStyle = thing.slot === marked ? "#ffd866" : thing.type.hole ? "#5a6678" : "rgba(0,0,0,.55)";
      if (!thing.visible) context.setLineDash([4 / scale, 4 / scale]);
      context.stroke();
      context.setLineDash([]);
      context.globalAlpha = 1;
      if (this.overlays.has("velocity") && thing.velocity) arrow(context, thing, thing.velocity, VELOCITY, "#7ee787", scale);
      if (this.overlays.has("force") && acceleration?.[thing.slot]) {
        arrow(context, thing, acceleration[thing.slot], ACCELERATION, "#ff9e64", scale);
      }
      if (this.overlays.has("names")) this.name(context, thing, scale);
    }
    if (ghost) path(context, ghost, scale);
    if (other) this.another(context, this.things(values, level).find((one) => one.agent), other, scale);
    if (aim) {
      const ball = this.things(values, level).find((one) => one.agent);
      if (ball) arrow(context, ball, [aim[0] - ball.x, aim[1] - ball.y], 1, "#ffffff", scale);
    }
    context.lineWidth = 3 / scale;
    context.strokeStyle = WALL;
    context.strokeRect(-about.walls, -about.walls, 2 * about.walls, 2 * about.walls);
  }

  /** Heat and friction as colours over a thing, where they are asked for. */
  shade(context, thing) {
    for (const [name, colour] of [["heat", "255,60,0"], ["friction", "90,160,255"]]) {
      if (this.overlays.has(name) && thing[name] > 0) {
        context.fillStyle = `rgba(${colour},${Math.min(thing[name], 1) * 0.7})`;
        context.fill();
      }
    }
  }

  /** What people call a thing: a tile by its kind, because slots of tiles only have numbers. */
  nameOf(thing) {
    return thing.type.tile && !thing.type.goal ? thing.type.name : this.about.slots[thing.slot].name;
  }

  /** The tile under the body that acts, which ended the episode; null where there is none. */
  under(values, level) {
    const things = this.things(values, level);
    const body = things.find((one) => one.agent);
    const tile = body && things.reverse().find((one) => one.type.tile && !one.type.goal && covers(one, body.x, body.y));
    return tile ? this.nameOf(tile) : null;
  }

  /** Another body where somebody else is who plays the same level. */
  another(context, body, [x, y], scale) {
    const thing = { ...body, x, y };
    outline(context, thing);
    context.fillStyle = "rgba(201,167,255,.4)";
    context.fill();
    context.lineWidth = 2.5 / scale;
    context.strokeStyle = GHOST;
    context.stroke();
    this.name(context, thing, scale, "agent", GHOST, true);
  }

  /** Write the name of a thing above it, or below it where that is wanted or where there is no room. */
  name(context, thing, scale, words = this.says(thing), colour = "#e6edf3", below = false) {
    const size = 13 * Math.max(this.canvas.width / (this.canvas.clientWidth || this.canvas.width), 1);
    const { walls } = this.about;
    context.save();
    context.font = `${size}px system-ui, sans-serif`;
    context.textAlign = "center";
    const room = Math.max(walls - context.measureText(words).width / 2 / scale, 0);
    const above = thing.y + thing.radius + 5 / scale;
    const y = below || above + size / scale > walls ? thing.y - thing.radius - size / scale : above;
    context.translate(Math.min(Math.max(thing.x, -room), room), y);
    context.scale(1 / scale, -1 / scale);
    context.fillStyle = colour;
    context.fillText(words, 0, 0);
    context.restore();
  }
}

const TOUCHED = 0.05;
const VELOCITY = 0.15; // metres of arrow per m/s
const ACCELERATION = 0.05; // metres of arrow per m/s^2

function colourOf({ low, high, span }, value) {
  const share = Math.min(Math.max((value - span[0]) / (span[1] - span[0]), 0), 1) || 0;
  return low.map((x, k) => Math.round(x + share * (high[k] - x)));
}

function outline(context, { x, y, radius, corners }, share = 1) {
  context.beginPath();
  if (!corners) {
    context.arc(x, y, Math.max(share * radius, 0), 0, 2 * Math.PI);
  } else {
    for (let k = 0; k < corners.length; k += 2) context.lineTo(x + share * corners[k], y + share * corners[k + 1]);
  }
  context.closePath();
}

/** Whether a thing covers a place [m]; a disc counts as at least so large. */
function covers(thing, x, y, least = 0) {
  if (!thing.corners) return Math.hypot(thing.x - x, thing.y - y) <= Math.max(thing.radius, least);
  return inside(thing.corners, x - thing.x, y - thing.y);
}

function inside(corners, x, y) {
  for (let k = 0; k < corners.length; k += 2) {
    const [ax, ay] = [corners[k], corners[k + 1]];
    const [bx, by] = [corners[(k + 2) % corners.length], corners[(k + 3) % corners.length]];
    if ((bx - ax) * (y - ay) - (by - ay) * (x - ax) < 0) return false;
  }
  return true;
}

function grid(context, walls, pixel) {
  context.beginPath();
  for (let k = -3; k <= 3; k++) {
    const at = k * walls / 4;
    context.moveTo(at, -walls);
    context.lineTo(at, walls);
    context.moveTo(-walls, at);
    context.lineTo(walls, at);
  }
  context.lineWidth = pixel;
  context.strokeStyle = GRID;
  context.stroke();
}

function arrow(context, { x, y }, [dx, dy], length, colour, scale) {
  const size = Math.hypot(dx, dy) * length;
  if (size * scale < 2) return;
  const [ux, uy] = [dx * length / size, dy * length / size];
  const head = Math.min(9 / scale, size);
  const [tx, ty] = [x + ux * size, y + uy * size];
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(tx, ty);
  context.lineTo(tx - head * (ux + 0.5 * uy), ty - head * (uy - 0.5 * ux));
  context.moveTo(tx, ty);
  context.lineTo(tx - head * (ux - 0.5 * uy), ty - head * (uy + 0.5 * ux));
  context.lineWidth = 2 / scale;
  context.strokeStyle = colour;
  context.stroke();
}

function path(context, points, scale) {
  context.beginPath();
  for (const [x, y] of points) context.lineTo(x, y);
  context.lineWidth = 2 / scale;
  context.setLineDash([5 / scale, 5 / scale]);
  context.strokeStyle = GHOST;
  context.stroke();
  context.setLineDash([]);
}
