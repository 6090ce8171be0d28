/** Signs that say what a thing is like, as segar.rendering.signs specifies them and `segar play` draws them. */

const colour = ([r, g, b], a = 1) => `rgba(${r},${g},${b},${a})`;
const TURN = 2 * Math.PI;

/** Draw the signs of a thing over it; unit is a pixel of an arena of 512 [m], trace(share) makes its outline the path. */
export function drawSigns(context, thing, signs, unit, trace) {
  const { x, y, radius } = thing;
  if (thing.type.tile) {
    if (!thing.visible) return;
    if (thing.type.hole) {
      for (const [share, grey] of signs.hole_steps) {
        trace(share);
        context.fillStyle = colour([grey, grey, grey]);
        context.fill();
      }
    }
    ground(context, thing, signs, unit, trace);
    if (thing.type.goal) {
      context.strokeStyle = context.fillStyle = "#fff";
      context.lineWidth = 2.5 * unit;
      for (const share of signs.goal_rings) {
        trace(share);
        context.stroke();
      }
      disc(context, x, y, signs.goal_dot * unit);
    }
    return;
  }
  if (thing.done) return;
  if (thing.alive && thing.energy) chevrons(context, thing, signs.chevrons, unit);
  if (!thing.mobile && thing.visible) {
    context.fillStyle = "#000";
    for (let k = 0; k < signs.bolts.count; k++) {
      disc(context, ...at(x, y, radius - signs.bolts.inside * unit, TURN * (k + 0.5) / signs.bolts.count), signs.bolts.size * unit);
    }
  }
  if (thing.agent) {
    trace(1 + signs.agent.outside * unit / radius);
    context.strokeStyle = colour(signs.agent.colour);
    context.lineWidth = signs.agent.width * unit;
    context.stroke();
  }
  if (!thing.alive) {
    context.strokeStyle = colour(signs.dead.colour);
    cross(context, x, y, signs.dead.side * radius, signs.dead.width * unit);
    return;
  }
  const both = thing.charge && thing.magnetism;
  const ink = thing.light && thing.visible ? "#000" : "#fff";
  for (const [value, draw, side] of [[thing.charge, charge, -1], [thing.magnetism, magnet, 1]]) {
    if (!value) continue;
    const { weakest } = signs.sign;
    const size = radius * signs.sign[both ? "beside" : "alone"] * (weakest + (1 - weakest) * Math.min(Math.abs(value), 1));
    context.strokeStyle = context.fillStyle = ink;
    draw(context, x + (both ? side * signs.sign.apart * radius : 0), y, size, value > 0);
  }
}

/** Dots, the denser the rougher the ground; waves, the denser the hotter it is. */
function ground(context, { x, y, radius, friction, heat, rgb, light }, { dots, waves }, unit, trace) {
  if (!(friction > 0) && !(heat > 0)) return;
  context.save();
  trace(1);
  context.clip();
  if (friction > 0) {
    const spacing = (dots.widest - dots.closer * Math.min(friction, 1)) * unit;
    context.fillStyle = light ? "rgba(0,0,0,.47)" : "rgba(255,255,255,.35)";
    for (let row = -Math.ceil(radius / (0.87 * spacing)); row * 0.87 * spacing < radius; row++) {
      for (let k = -Math.ceil(radius / spacing) - 1; k * spacing < radius; k++) disc(context, x + (k + 0.5 * Math.abs(row % 2)) * spacing, y + row * 0.87 * spacing, dots.size * unit);
    }
  }
  if (heat > 0) {
    const spacing = (waves.widest - waves.closer * Math.min(heat, 1)) * unit;
    context.strokeStyle = rgb[1] < 120 ? "rgba(255,240,90,.75)" : "rgba(150,0,0,.75)";
    context.lineWidth = waves.width * unit;
    for (let row = -Math.ceil(radius / spacing); row * spacing < radius; row++) {
      context.beginPath();
      for (let k = 0; k * spacing / 6 < 2 * radius + spacing; k++) context.lineTo(x - radius + k * spacing / 6, y + (row + 0.5) * spacing - spacing / 5 * Math.sin(TURN * k / 9));
      context.stroke();
    }
  }
  context.restore();
}

/** Arrow heads around a circle: outward from what pushes, inward to what brakes. */
function chevrons(context, { x, y, radius, energy }, { count, least, more, most, push, brake }, unit) {
  const size = Math.min(least + more * Math.abs(energy), most) * unit;
  const inner = radius + 2 * unit;
  const [tip, foot] = energy > 0 ? [inner + size, inner] : [inner, inner + size];
  const wide = 0.9 * size / (inner + size);
  context.fillStyle = colour(energy > 0 ? push : brake);
  for (let k = 0; k < count; k++) {
    const angle = TURN * (k + 0.5) / count;
    context.beginPath();
    context.moveTo(...at(x, y, tip, angle));
    context.lineTo(...at(x, y, foot, angle + wide));
    context.lineTo(...at(x, y, foot, angle - wide));
    context.fill();
  }
}

function charge(context, x, y, size, positive) {
  context.lineWidth = size / 4;
  line(context, x - size / 2, y, x + size / 2, y);
  if (positive) line(context, x, y - size / 2, x, y + size / 2);
}

/** A field that comes out of the picture, or goes into it. */
function magnet(context, x, y, size, positive) {
  context.lineWidth = size / 8;
  context.beginPath();
  context.arc(x, y, 7 / 16 * size, 0, TURN);
  context.stroke();
  if (positive) disc(context, x, y, size / 6);
  else cross(context, x, y, 0.55 * size, size / 8);
}

function cross(context, x, y, side, width) {
  context.lineWidth = width;
  line(context, x - side / 2, y - side / 2, x + side / 2, y + side / 2);
  line(context, x - side / 2, y + side / 2, x + side / 2, y - side / 2);
}

function line(context, ax, ay, bx, by) {
  context.beginPath();
  context.moveTo(ax, ay);
  context.lineTo(bx, by);
  context.stroke();
}

function disc(context, x, y, radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, TURN);
  context.fill();
}

function at(x, y, radius, angle) {
  return [x + radius * Math.cos(angle), y + radius * Math.sin(angle)];
}
